"""The core compiles for other machines: ARM Linux, Windows and WebAssembly. Needs `pip install ziglang`.

Each target compiles a servo loop with a wall from the smallest set of headers. With PALPATE_NIGHTLY=1, each also
compiles the umbrella headers.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest
from nightly import nightly

INCLUDE = Path(__file__).parents[2] / "core" / "include"
TARGETS = {"aarch64-linux-gnu": [], "x86_64-windows-gnu": [], "wasm32-wasi": ["-fno-exceptions"]}
PROGRAM = """
#include <palpate/mechanism/premium.hpp>
#include <palpate/object/spring_wall.hpp>
#include <palpate/plant/device_catalog.hpp>
#include <palpate/servo/servo.hpp>
using namespace palpate;
int main() {
  servo::ServoSetup<mechanism::Premium> setup{.mechanism = mechanism::Premium(plant::phantom_premium_1_5a())};
  const object::SpringWall wall({.kind = object::SpringWallKind::half_space, .stiffness = Vector3<>::Constant(800.0)});
  servo::Servo<mechanism::Premium, object::SpringWall> servo(setup, wall);
  return servo.tick(setup.mechanism.inverse({0.0, 0.0, -0.001}).q, Vector3<>::Zero()).torque[2] > 0.1 ? 0 : 1;
}
"""
UMBRELLA = "#include <palpate/deformable.hpp>\n#include <palpate/mesh.hpp>\n#include <palpate/palpate.hpp>\n"

pytestmark = pytest.mark.skipif(importlib.util.find_spec("ziglang") is None, reason="needs zig: pip install ziglang")


def compile_for(target: str, text: str, folder: Path) -> None:
    located = subprocess.run([sys.executable, "-m", "cmeel", "cmake"], capture_output=True, text=True, check=True)
    eigen = Path(located.stdout.strip().split(";")[0]) / "include" / "eigen3"
    source = folder / "program.cpp"
    source.write_text(text, "utf-8")
    command = [sys.executable, "-m", "ziglang", "c++", "-target", target, "-std=c++20", "-O1", "-c", *TARGETS[target]]
    command += ["-I", INCLUDE, "-isystem", eigen, source, "-o", folder / "program.o"]
    done = subprocess.run([str(part) for part in command], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert (folder / "program.o").stat().st_size > 0


@pytest.mark.parametrize("target", TARGETS)
def test_a_servo_loop_compiles_for(target: str, tmp_path: Path) -> None:
    compile_for(target, PROGRAM, tmp_path)


@nightly
@pytest.mark.parametrize("target", TARGETS)
def test_all_headers_compile_for(target: str, tmp_path: Path) -> None:
    compile_for(target, UMBRELLA + "int main() {}\n", tmp_path)
