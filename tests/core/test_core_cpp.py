"""The core's own tests, most of them under the address and undefined-behavior sanitizers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from nightly import NIGHTLY

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


def configure_tests(build: Path, *options: str) -> None:
    """Configure the tests; skip where GoogleTest is not installed."""
    options = ("-DPALPATE_TESTS=ON", "-DPALPATE_WERROR=ON", *options)
    if compiler := os.environ.get("PALPATE_TEST_CXX"):
        options = (*options, f"-DCMAKE_CXX_COMPILER={compiler}")
    configured = configure(ROOT, build, *options)
    if "Could NOT find GTest" in configured.stderr:
        pytest.skip("GoogleTest is not installed (Debian: libgtest-dev)")
    assert configured.returncode == 0, configured.stderr


def test_core_under_sanitizers() -> None:
    """The GoogleTests of core/tests, with warnings as errors; skipped only where GoogleTest is not installed.

    Those of bodies, whose compilation under sanitizers takes minutes, are in `make sanitize` and `make nightly`.
    """
    build = ROOT / "build" / "core-tests"
    configure_tests(build, "-DPALPATE_SANITIZE=ON", *(["-DPALPATE_NIGHTLY=ON"] if NIGHTLY else []))
    run(BIN / "ninja", "-C", build)
    output = run(BIN / "ctest", "--test-dir", build, "--output-on-failure", "-j", "2", "--output-junit", "junit.xml")
    assert "100% tests passed" in output


@pytest.mark.skipif(NIGHTLY, reason="the test above contains them")
def test_bodies_in_the_core() -> None:
    """The GoogleTests of bodies, without sanitizers and without springs that harden at two rates, which take long."""
    build = ROOT / "build" / "body-tests"
    configure_tests(build, "-DCMAKE_CXX_FLAGS_RELEASE=-O1")
    run(BIN / "ninja", "-C", build, "palpate_body_tests")
    quick = "--gtest_filter=-LinearBodyTwoRates/hardening.*"
    assert "[  PASSED  ] 2" in run(build / "core" / "tests" / "palpate_body_tests", "--gtest_brief=1", quick)


def test_the_catalog_in_cpp_is_the_catalog_in_toml() -> None:
    """phantom_premium_1_5a() of the core has the numbers of phantom-premium-1.5a.toml, one by one."""
    from palpate import _core, devices

    values = devices.load("phantom-premium-1.5a").parameters.values
    for key, coded in _core.phantom_premium_1_5a().items():
        if key in values and not key.startswith("drive."):
            assert tuple(coded) == values[key], key
