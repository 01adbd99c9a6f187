"""The slider leant on with half a newton, as the tables of a scenario."""

from __future__ import annotations

from typing import Any


def slider(stiffness: str = "97 N/m", **tables: Any) -> dict[str, Any]:
    return {
        "title": "Slider",
        "device": {"name": "slider"},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": stiffness},
        "run": {"duration": "2 s"},
        **tables,
    }


def resonant(stiffness: str) -> dict[str, Any]:
    """Return a slider in a soft hand, whose force passes a lightly damped resonance at 9 Hz and a notch at 16 Hz."""
    return {
        "device": {"name": "slider"},
        "start": {"pose": ["0 mm"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {
            "kind": "arm",
            "mass": "0.02 kg",
            "damping": "3.1 N*s/m",
            "stiffness": "158 N/m",
            "shape": "step",
            "force": ["-0.1 N", "0 N", "0 N"],
        },
        "object": {"kind": "spring", "stiffness": stiffness},
        "controller": {
            "kind": "state_space",
            "A": [[0.89756, -3.06233], [0.000948781, 0.998469]],
            "B": [[0.000948781, 0, 0, -0.000948781, 0, 0], [4.743905e-07, 0, 0, -4.743905e-07, 0, 0]],
            "C": [[-30.21965, 2220.64782], [0, 0], [0, 0]],
            "D": [[0.311993, 0, 0, -0.311993, 0, 0], [0, 0, 0, 0, 0, 0], [0, 0, 0, 0, 0, 0]],
        },
        "run": {"duration": "1 s"},
    }
