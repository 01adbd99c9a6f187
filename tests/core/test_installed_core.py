"""The installed C++ package: found by CMake and pkg-config, after its folder is moved; and the examples."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
UNOPTIMIZED = ("-DCMAKE_BUILD_TYPE=Debug", "-DCMAKE_CXX_FLAGS_DEBUG=-O0")
CONSUMER = ROOT / "core" / "tests" / "consumer"


def run(*command: object, env: dict[str, str] | None = None) -> str:
    """Run a command and return what it printed; all it said is the message if it fails."""
    words = [str(part) for part in command]
    done = subprocess.run(words, env={**os.environ, **(env or {})}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def configure(source: Path, build: Path, *options: str) -> str:
    """Configure a CMake project and return its warnings."""
    command = [BIN / "cmake", "-S", source, "-B", build, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={BIN / 'ninja'}"]
    command += [f"-DPython_EXECUTABLE={sys.executable}", *options]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stderr


def eigen() -> Path:
    """The CMake prefix of the Eigen that the tests install."""
    return Path(run(sys.executable, "-m", "cmeel", "cmake").strip().split(";")[0])


def torque(text: str) -> list[float]:
    """The torques that the consumer prints."""
    return [float(word) for word in text.split()[1:4]]


# One millimeter into a wall of 800 N/m: 0.8 N along z, times the arm's levers at the zero pose (0, 0, l2 = 0.17 m).
EXPECTED = pytest.approx([0.0, 0.0, 0.8 * 0.17], abs=2e-3)


@pytest.fixture(scope="module")
def prefix(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the core with its compiled library, then move the folder that it is installed in."""
    folder = tmp_path_factory.mktemp("installed")
    configure(ROOT, folder / "build", "-DPALPATE_CORE=ON", "-DPALPATE_WERROR=ON", *UNOPTIMIZED)
    run(BIN / "ninja", "-C", folder / "build")
    run(BIN / "cmake", "--install", folder / "build", "--prefix", folder / "first")
    shutil.rmtree(folder / "build")
    return (folder / "first").rename(folder / "moved")


def test_cmake_finds_the_moved_package(prefix: Path, tmp_path: Path) -> None:
    """A program outside the tree links the headers alone; without a build type, CMake warns."""
    paths = f"-DCMAKE_PREFIX_PATH={prefix};{eigen()}"
    assert "CMAKE_BUILD_TYPE is not set" in configure(CONSUMER, tmp_path / "no-type", paths)
    assert "palpate" not in configure(CONSUMER, tmp_path / "build", paths, *UNOPTIMIZED)
    run(BIN / "ninja", "-C", tmp_path / "build")
    assert torque(run(tmp_path / "build" / "consumer")) == EXPECTED


@pytest.mark.skipif(shutil.which("pkg-config") is None, reason="pkg-config is not installed")
def test_pkg_config_finds_the_moved_package(prefix: Path, tmp_path: Path) -> None:
    """The flags of palpate-core.pc compile and link the same program against the compiled core."""
    places = [prefix / "lib" / "pkgconfig", eigen() / "share" / "pkgconfig"]
    flags = run(
        "pkg-config", "--cflags", "--libs", "palpate-core", env={"PKG_CONFIG_PATH": os.pathsep.join(map(str, places))}
    ).split()
    assert str(prefix) in os.path.normpath(flags[flags.index("-DPALPATE_COMPILED") + 1][2:])
    compiler = os.environ.get("CXX", "c++")
    run(compiler, "-std=c++20", CONSUMER / "main.cpp", "-o", tmp_path / "program", *flags)
    assert torque(run(tmp_path / "program")) == EXPECTED


# A number of the last line of each example, from a closed form.
LAST = {
    "01_wall": "-1.600 N",  # 2 mm into 800 N/m
    "02_mesh_friction": "tangential 0.200 N, normal 0.500 N, slides",  # 1 mm into 500 N/m, friction 0.4
    "03_own_object": "0.7321 0.0000 -0.5732",  # 200 N/m x 10 mm x exp(-1.005); the wall adds 0.5 N
    "04_own_controller": "1.000 N",  # at rest 1 mm inside 1000 N/m
    "05_own_mechanism": "-320.2 rad/s^2, -20.203 m/s^2",  # of the slide: force / 0.08 kg + 0.105 m x (2 rad/s)^2
    "06_simulated_loop": "-1.503 N",  # 2 N are shared by the wall and the operator's spring; the arm weighs on the rest
}


@pytest.fixture(scope="module")
def examples(prefix: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the examples against the installed package, unoptimized, which compiles fastest."""
    build = tmp_path_factory.mktemp("examples")
    paths = f"-DCMAKE_PREFIX_PATH={prefix};{eigen()}"
    configure(ROOT / "examples" / "cpp", build, paths, *UNOPTIMIZED, "-DCMAKE_CXX_FLAGS=-Werror -Wall -Wextra")
    run(BIN / "ninja", "-C", build, *LAST)
    return build


@pytest.mark.parametrize("name", LAST)
def test_example_prints_the_numbers_of_its_closed_form(examples: Path, name: str) -> None:
    source = ROOT / "examples" / "cpp" / f"{name}.cpp"
    assert len(source.read_text("utf-8").splitlines()) <= 60
    assert LAST[name] in run(examples / name).splitlines()[-1]
