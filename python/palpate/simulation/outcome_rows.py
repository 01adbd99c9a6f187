"""Rows of numbers that the core returns for loops without a trace, by name."""

from __future__ import annotations

from typing import Final

import numpy as np

from palpate.arrays import Array

__all__ = ["QUANTITIES", "end_angles", "name_rows"]

# Name: (columns, unit, meaning).
QUANTITIES: Final[dict[str, tuple[int, str, str]]] = {
    "unstable_from": (1, "s", "time at which the loop diverged; nan: it did not"),
    "oscillation_2": (1, "m", "largest second difference of the tip's position in the judged window's second fifth"),
    "oscillation_4": (1, "m", "the same in the fourth fifth"),
    "oscillation_5": (1, "m", "the same in the last fifth"),
    "ripple": (1, "m", "half the tip's range over the last fifth, along the axis where it is largest"),
    "steady_tip": (3, "m", "mean displacement of the tip from its start over the last fifth"),
    "peak_object_force": (1, "N", "largest force of the tip on the object"),
    "peak_command_force": (1, "N", "largest commanded force"),
    "touching": (1, "", "fraction of the run in contact"),
    "saturated": (1, "", "fraction of the run at the limits of the drive"),
    "touching_5": (1, "", "fraction of the window's last fifth in contact"),
    "saturated_5": (1, "", "fraction of the window's last fifth at the limits of the drive"),
    "contacts_5": (1, "", "contacts that begin in the window's last fifth"),
}
_FIRST: Final = 15  # column of the joint angles at the end


def name_rows(rows: Array, period: float) -> dict[str, Array]:
    """Return the core's rows of outcomes (n, 15 + 2 dof) as arrays (n,) or (n, 3) by name of QUANTITIES."""
    columns = {"unstable_from": np.where(rows[:, 0] < 0, np.nan, rows[:, 0] * period)}
    at = 1
    for name, (count, _unit, _meaning) in QUANTITIES.items():
        if name != "unstable_from":
            columns[name] = rows[:, at : at + count] if count > 1 else rows[:, at]
            at += count
    return columns


def end_angles(rows: Array) -> Array:
    """Return the joint coordinates (n, dof) at the end of each loop; nan where it diverged."""
    dof = (rows.shape[1] - _FIRST) // 2
    return rows[:, _FIRST : _FIRST + dof]
