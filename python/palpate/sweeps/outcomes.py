"""Outcomes of the cells of a sweep: a few numbers per loop, and the state of its verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.simulation.decision import growth
from palpate.simulation.outcome_rows import QUANTITIES as ROWS
from palpate.simulation.verdict import State

__all__ = ["QUANTITIES", "Outcomes"]

# Name: (columns, unit, meaning).
QUANTITIES: dict[str, tuple[int, str, str]] = {
    **ROWS,
    "beyond_reach": (
        1,
        "",
        "1: a pose of the judged window or force over stiffness is beyond reach, 0: none is; nan: the loop diverged",
    ),
    "linear": (1, "", "1: the linear loop is stable, -1: it is unstable, 0: not evaluated"),
    "verdict": (1, "", ", ".join(f"{state.value} {state.label}" for state in State)),
}


@runtime_checkable
class Tallied(Protocol):
    """Outcomes that count their states themselves."""

    def tally(self) -> list[int]:
        """Return the number of cells in each State."""
        ...


class Outcomes(Mapping[str, Array]):
    """Arrays by name of QUANTITIES, each with one row per cell.

    `growth` is the growth factor of the oscillation per fifth of the judged window: inf where the loop diverged, 0
    where it came to rest.
    """

    def __init__(self, values: Mapping[str, Array]) -> None:
        self._values = values

    def __getitem__(self, name: str) -> Array:
        return self._values[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def tally(self) -> list[int]:
        """Return the number of cells in each State. Those of a file are read a part at a time."""
        if isinstance(self._values, Tallied):
            return self._values.tally()
        return [int(np.count_nonzero(self["verdict"] == state.value)) for state in State]

    @property
    def growth(self) -> Array:
        """Growth factor of the oscillation per fifth of the window; see `palpate.simulation.decision.growth`."""
        return growth(*(self[name] for name in ("unstable_from", "oscillation_2", "oscillation_4", "oscillation_5")))

    def where(self, *states: State) -> NDArray[np.bool_]:
        """Return where the verdict is one of `states`."""
        return np.isin(self["verdict"], [float(state) for state in states])

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Where the verdict is "unstable"."""
        return self.where(State.UNSTABLE)

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Where the verdict is "settled"."""
        return self.where(State.SETTLED)
