"""Runs whose figures and pages are tested."""

from __future__ import annotations

from pathlib import Path

from palpate import fem, simulate
from palpate.simulation import Trace


def run_slide() -> Trace:
    """Press a point on a checkerboard of 100 and 200 N/m, on which it slides along x."""
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0.05 N", "0.02 N", "-0.3 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "40 N/m"},
        "object": {
            "kind": "mesh",
            "position": ["0.3 mm", "0.2 mm", "-0.4 mm"],
            "mesh": {"shape": "box", "edge": "40 mm", "divisions": 10, "rotation": ["0 deg", "0 deg", "0 deg"]},
            "surface": {"stiffness": ["100 N/m", "200 N/m"], "pattern": "checkerboard", "width": "4 mm"},
        },
        "run": {"duration": "0.3 s"},
    }
    return simulate(tables)


def run_press(path: Path) -> Trace:
    """Press a sphere into a block of 10 kPa, which is written to a file."""
    volume = fem.block((0.04, 0.04, 0.02), (0.01, 0.01, 0.01))
    fem.build(volume, young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, output=path)
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0.1 N", "0 N", "-0.3 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "40 N/m"},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-0.5 mm"],
            "body": {"file": str(path), "origin": ["20 mm", "20 mm", "20 mm"], "radius": "8 mm"},
        },
        "run": {"duration": "0.2 s"},
    }
    return simulate(tables)


def run_diverging() -> Trace:
    """Lean on a spring that is too stiff for the slider."""
    tables = {
        "device": {"name": "slider"},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "30 N/mm"},
        "run": {"duration": "2 s"},
    }
    return simulate(tables)
