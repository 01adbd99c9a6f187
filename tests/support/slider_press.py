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
