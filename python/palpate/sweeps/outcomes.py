"""Outcomes of the cells of a sweep: a few numbers per loop, and a verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

__all__ = ["QUANTITIES", "Outcomes", "Verdict", "name_rows"]

Array = NDArray[np.float64]
# Name: (columns, unit, meaning).
QUANTITIES: dict[str, tuple[int, str, str]] = {
    "unstable_from": (1, "s", "time at which the loop diverged; nan: it did not"),
    "oscillation_2": (1, "m", "largest second difference of the tip's position in the run's second fifth"),
    "oscillation_4": (1, "m", "the same in the fourth fifth"),
    "oscillation_5": (1, "m", "the same in the last fifth"),
    "ripple": (1, "m", "half the tip's range over the last fifth, along the axis where it is largest"),
    "steady_tip": (3, "m", "mean displacement of the tip from its start over the last fifth"),
    "peak_object_force": (1, "N", "largest force of the tip on the object"),
    "peak_command_force": (1, "N", "largest commanded force"),
    "touching": (1, "", "fraction of the time in contact"),
    "saturated": (1, "", "fraction of the time at the limits of the drive"),
    "verdict": (1, "", "0 decays, 1 sustained, 2 grows, 3 diverges"),
}
STILL = 1e-14  # m, second differences of tip positions at rounding level
# Growth factors per fifth of the run of a sustained oscillation. Impacts are irregular: in 349 of 350 arms with endless
# impacts on a wall the maximum of a fifth was at least 0.9 times that of the fifth before.
SUSTAINED_GROWTH = (0.9, 1.02)


class Verdict(IntEnum):
    """Final behavior of a loop's oscillation."""

    DECAYING = 0
    SUSTAINED = 1
    GROWING = 2
    DIVERGES = 3


class Outcomes(Mapping[str, Array]):
    """Arrays by name of QUANTITIES, each with one row per cell.

    `growth` is the growth factor of the oscillation per fifth of the run: inf where the loop diverged, 0 where it came
    to rest. `unstable` is true where it is above 1.
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
        """Growth factor of the oscillation per fifth of the run; see the function `growth`."""
        return growth(*(self[name] for name in ("unstable_from", "oscillation_2", "oscillation_4", "oscillation_5")))

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Whether the oscillation grows or the loop diverges."""
        return np.asarray(self.growth > 1.0, dtype=bool)


def growth(unstable_from: Array, early: Array, prior: Array, late: Array) -> Array:
    """Return the growth factor of an oscillation per fifth of the run: inf where the loop diverged, 0 at rest.

    It is the larger of the ratio of the last to the fourth fifth and the mean ratio from the second to the last. An
    oscillation that grew and is now bounded counts as growing, and a hard first impact does not hide later growth.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.where(late <= STILL, 0.0, np.maximum(late / prior, np.cbrt(late / early)))
    return np.asarray(np.where(np.isnan(unstable_from), ratio, np.inf), dtype=float)


def name_rows(rows: Array, period: float) -> dict[str, Array]:
    """Return the core's rows of outcomes (n, 12 + 2 dof) as arrays by name of QUANTITIES."""
    unstable_from = np.where(rows[:, 0] < 0, np.nan, rows[:, 0] * period)
    factor = growth(unstable_from, rows[:, 1], rows[:, 2], rows[:, 3])
    verdict = np.select(
        [~np.isnan(unstable_from), factor > SUSTAINED_GROWTH[1], factor >= SUSTAINED_GROWTH[0]],
        [Verdict.DIVERGES, Verdict.GROWING, Verdict.SUSTAINED],
        Verdict.DECAYING,
    )
    return {
        "unstable_from": unstable_from,
        "oscillation_2": rows[:, 1],
        "oscillation_4": rows[:, 2],
        "oscillation_5": rows[:, 3],
        "ripple": rows[:, 4],
        "steady_tip": rows[:, 5:8],
        "peak_object_force": rows[:, 8],
        "peak_command_force": rows[:, 9],
        "touching": rows[:, 10],
        "saturated": rows[:, 11],
        "verdict": verdict.astype(float),
    }
