"""The core's own tests, under the address and undefined-behaviour sanitizers, and the core as a package for C++."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent


def run(*command: object, cwd: Path | None = None) -> str:
    """Run a command and return what it printed; all it said is the message if it fails."""
    done = subprocess.run([str(part) for part in command], cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def configure(source: Path, build: Path, *options: str) -> subprocess.CompletedProcess[str]:
    command = [BIN / "cmake", "-S", source, "-B", build, "-G", "Ninja", f"-DCMAKE_MAKE_PROGRAM={BIN / 'ninja'}"]
    command += [f"-DPython_EXECUTABLE={sys.executable}", *options]
    return subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)


def test_core_under_sanitizers() -> None:
    """Every GoogleTest of core/tests, with warnings as errors; skipped only where GoogleTest is not installed."""
    build = ROOT / "build" / "core-tests"
    options = ("-DPALPATE_TESTS=ON", "-DPALPATE_SANITIZE=ON", "-DPALPATE_WERROR=ON")
    configured = configure(ROOT, build, *options)
    if "Could NOT find GTest" in configured.stderr:
        pytest.skip("GoogleTest is not installed (Debian: libgtest-dev)")
    assert configured.returncode == 0, configured.stderr
    run(BIN / "ninja", "-C", build)
    output = run(BIN / "ctest", "--test-dir", build, "--output-on-failure", "-j", "2")
    assert "100% tests passed" in output


def test_a_program_outside_the_tree_finds_the_installed_core(tmp_path: Path) -> None:
    """Install the CMake package, build ten lines of C++ against it, run a tick: a tenth of a newton-metre or less."""
    configured = configure(ROOT, tmp_path / "build", f"-DCMAKE_INSTALL_PREFIX={tmp_path / 'prefix'}")
    assert configured.returncode == 0, configured.stderr
    run(BIN / "cmake", "--install", tmp_path / "build")
    eigen = run(sys.executable, "-m", "cmeel", "cmake").strip()
    source = ROOT / "core" / "tests" / "consumer"
    options = (f"-DCMAKE_PREFIX_PATH={tmp_path / 'prefix'};{eigen}", "-DCMAKE_BUILD_TYPE=Debug")
    configured = configure(source, tmp_path / "consumer", *options)
    assert configured.returncode == 0, configured.stderr
    run(BIN / "ninja", "-C", tmp_path / "consumer")
    words = run(tmp_path / "consumer" / "consumer").split()
    torque = [float(word) for word in words[1:4]]
    # One millimetre into a wall of 800 N/m: 0.8 N along z, times the arm's levers at the zero pose (0, 0, l2 = 0.17 m).
    assert torque == pytest.approx([0.0, 0.0, 0.8 * 0.17], abs=2e-3)


def test_the_catalogue_in_cpp_is_the_catalogue_in_toml() -> None:
    """phantom_premium_1_5a() of the core has the numbers of phantom-premium-1.5a.toml, one by one."""
    from palpate import _core, devices

    values = devices.load("phantom-premium-1.5a").parameters.values
    for key, coded in _core.phantom_premium_1_5a().items():
        if key in values and not key.startswith("drive."):
            assert tuple(coded) == values[key], key
