"""Check an installed wheel: it imports from site-packages, computes a known limit, runs a loop and has its commands.

`make wheel` runs this in a fresh virtual environment.
"""

from __future__ import annotations

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import palpate

SCENARIO = {
    "device": {"name": "slider"},
    "operator": {"kind": "none"},
    "object": {"kind": "spring", "stiffness": "80 N/m"},
    "reference": {"force": ["0.5 N", "0 N", "0 N"]},
    "run": {"duration": "0.2 s"},
}


def main() -> None:
    assert "site-packages" in str(palpate.__file__), palpate.__file__
    limit = palpate.stability.wall_limit(mass=0.06, damping=0.05, period=1e-3)
    assert "100.01 N/m" in str(limit), limit
    device = Path(palpate.__file__).parent / "devices" / "phantom-premium-1.5a.toml"
    assert device.is_file(), "the device files are missing"
    trace = palpate.simulate(SCENARIO)
    assert len(trace) == 201, len(trace)
    command = Path(sys.executable).with_name("palpate")
    done = subprocess.run([command, "--version"], capture_output=True, text=True, check=True)
    assert version("palpate") in done.stdout, done.stdout
    print(f"the wheel of palpate {version('palpate')} works")


if __name__ == "__main__":
    main()
