"""The hand of the experiments: a loose grip that leads the tip by forces known beforehand."""

from __future__ import annotations

from typing import Any, Final

OPERATOR_STIFFNESS: Final = 200.0  # N/m: the hand follows a force by so much


def default_operator(table: list[list[str]], **more: Any) -> dict[str, Any]:
    """Return [operator] of an arm of 0.15 kg and 4.5 N s/m that pushes by `table` (time, x, y, z), as a file has it."""
    return {
        "kind": "arm",
        "mass": "0.15 kg",
        "damping": "4.5 N*s/m",
        "stiffness": f"{OPERATOR_STIFFNESS:g} N/m",
        "shape": "table",
        "table": table,
        **more,
    }
