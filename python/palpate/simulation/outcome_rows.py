"""Rows of numbers that the core returns for loops without a trace, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from palpate.arrays import Array
from palpate.simulation.evidence import second_differences
from palpate.simulation.recorded import Recorded, held_tip
from palpate.simulation.windows import Window

__all__ = ["QUANTITIES", "Excursion", "excursions", "name_rows", "outcome_of"]

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
_FIRST: Final = 15  # column of the first joint angles


@dataclass(frozen=True)
class Excursion:
    """Joint coordinates (n, dof) that loops reach in the judged window; nan where the loop diverged.

    Attributes:
        least, greatest: of each joint.
        worst: of the pose with the smallest ratio of the singular values of the Jacobian.
        end: of the last tick.
    """

    least: Array
    greatest: Array
    worst: Array
    end: Array


def name_rows(rows: Array, period: float) -> dict[str, Array]:
    """Return the core's rows of outcomes (n, 15 + 5 dof) as arrays (n,) or (n, 3) by name of QUANTITIES."""
    columns = {"unstable_from": np.where(rows[:, 0] < 0, np.nan, rows[:, 0] * period)}
    at = 1
    for name, (count, _unit, _meaning) in QUANTITIES.items():
        if name != "unstable_from":
            columns[name] = rows[:, at : at + count] if count > 1 else rows[:, at]
            at += count
    return columns


def excursions(rows: Array) -> Excursion:
    """Return the joint coordinates in the core's rows of outcomes (n, 15 + 5 dof)."""
    least, greatest, worst, end, _velocity = np.split(rows[:, _FIRST:], 5, axis=1)
    return Excursion(least, greatest, worst, end)


def outcome_of(trace: Recorded, period: float, window: Window) -> dict[str, Array]:
    """Return the outcome of one loop, as the core measures it, from the trace of every tick, by name of QUANTITIES.

    Args:
        trace: of the run.
        period: T, s.
        window: the judged one, to the last tick, had the loop not diverged.
    """
    first, ticks, tip = window.begin, window.end, held_tip(trace)
    fifth, ending = window.fifth, window.ending
    bend = second_differences(trace.time, tip, period)
    touching, saturated = trace["touching"][:, 0] > 0.0, trace["saturated"][:, 0] > 0.0
    begun = touching & ~np.concatenate([[False], touching[:-1]])
    found: dict[str, Any] = {
        "oscillation_2": bend[first + fifth + 1 : first + 2 * fifth + 1].max(initial=0.0),
        "peak_object_force": np.linalg.norm(trace["object_force"], axis=1).max(initial=0.0),
        "peak_command_force": np.linalg.norm(trace["command_force"], axis=1).max(initial=0.0),
        "touching": touching.mean() if len(tip) else 0.0,
        "saturated": saturated.mean() if len(tip) else 0.0,
    }
    if trace.unstable_from is None:
        found |= {
            "oscillation_4": bend[ticks - 2 * fifth + 1 : ticks - fifth + 1].max(initial=0.0),
            "oscillation_5": bend[ticks - fifth + 1 :].max(initial=0.0),
            "ripple": 0.5 * np.ptp(tip[ending], axis=0).max(),
            "steady_tip": trace["tip"][ending].mean(axis=0) - trace["tip"][0],
            "touching_5": touching[ending].mean(),
            "saturated_5": saturated[ending].mean(),
            "contacts_5": np.count_nonzero(begun[ending]),
        }
    else:
        found["unstable_from"] = trace.unstable_from
    return {
        name: np.array(found.get(name, np.nan if count == 1 else [np.nan] * count), dtype=float)
        for name, (count, _unit, _meaning) in QUANTITIES.items()
    }
