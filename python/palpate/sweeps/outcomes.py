"""What a cell of a sweep leaves behind: a few numbers of its loop, and a verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUANTITIES", "Outcomes", "Verdict", "name_rows"]

Array = NDArray[np.float64]
# Name: (columns, unit, what it is).
QUANTITIES: dict[str, tuple[int, str, str]] = {
    "unstable_from": (1, "s", "when the loop diverged; nan: it did not"),
    "early_swing": (1, "m", "largest second difference of the tip's position in the run's second fifth"),
    "late_swing": (1, "m", "the same in the last fifth"),
    "ripple": (1, "m", "half the tip's range over the last fifth, along the axis where it is largest"),
    "steady_tip": (3, "m", "mean displacement of the tip from its start over the last fifth"),
    "peak_object_force": (1, "N", "largest force of the tip on the object"),
    "peak_command_force": (1, "N", "largest commanded force"),
    "touching": (1, "", "share of the time in touch"),
    "saturated": (1, "", "share of the time at the drive's limits"),
    "verdict": (1, "", "0 dies out, 1 keeps swinging, 2 grows, 3 diverges"),
}
STILL = 1e-14  # m: second differences of tip positions below are rounding
SAME = 0.02  # a swing that changes by less over three fifths of the run keeps on


class Verdict(IntEnum):
    """How a loop's swing ends."""

    DIES = 0
    SWINGS = 1
    GROWS = 2
    DIVERGES = 3


class Outcomes(Mapping[str, Array]):
    """Arrays by name of QUANTITIES, each with one row per cell.

    `growth` is late over early swing: inf where the loop diverged, 0 where it came to rest. `unstable`: it is above 1.
    """

    def __init__(self, values: Mapping[str, Array]) -> None:
        self._values = values

    def __getitem__(self, name: str) -> Array:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    @property
    def growth(self) -> Array:
        """Late over early swing."""
        return growth(self["unstable_from"], self["early_swing"], self["late_swing"])

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Whether the swing grows or the loop diverges."""
        return np.asarray(self.growth > 1.0, dtype=bool)


def growth(unstable_from: Array, early: Array, late: Array) -> Array:
    """Return how many times larger the late swing is than the early one."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(late <= STILL, 0.0, late / early)
    return np.asarray(np.where(np.isnan(unstable_from), ratio, np.inf), dtype=float)


def name_rows(rows: Array, period: float) -> dict[str, Array]:
    """Return the core's rows of outcomes (n, 11 + 2 dof) as arrays by name of QUANTITIES."""
    unstable_from = np.where(rows[:, 0] < 0, np.nan, rows[:, 0] * period)
    times = growth(unstable_from, rows[:, 1], rows[:, 2])
    verdict = np.select(
        [~np.isnan(unstable_from), times > 1 + SAME, times >= 1 - SAME],
        [Verdict.DIVERGES, Verdict.GROWS, Verdict.SWINGS],
        Verdict.DIES,
    )
    return {
        "unstable_from": unstable_from,
        "early_swing": rows[:, 1],
        "late_swing": rows[:, 2],
        "ripple": rows[:, 3],
        "steady_tip": rows[:, 4:7],
        "peak_object_force": rows[:, 7],
        "peak_command_force": rows[:, 8],
        "touching": rows[:, 9],
        "saturated": rows[:, 10],
        "verdict": verdict.astype(float),
    }
