"""Stretches of a run in which the external force is constant; a run is judged in them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Indices

__all__ = ["Window", "constant_stretches", "windows"]

LEAST_WINDOW = 0.05  # fraction of a run over which the external force must be constant at its end
LEAST_PLATEAU = 0.1  # the same for a stretch before
LEAST_SAMPLES = 50  # samples of either


@dataclass(frozen=True)
class Window:
    """Rows `begin` to `end`, both included, of a trace; `constant`: the external force is constant in them."""

    begin: int
    end: int
    constant: bool = True

    @property
    def fifth(self) -> int:
        """Number of rows of a fifth of the window."""
        return (self.end - self.begin) // 5

    @property
    def ending(self) -> slice:
        """Rows of the last fifth."""
        return self.part(4, 5)

    def part(self, begin: int, end: int) -> slice:
        """Return the rows from the beginning of fifth `begin` to that of fifth `end`, from 0 to 5."""
        fifth = max(self.fifth, 1)
        return slice(max(self.end + 1 - (5 - begin) * fifth, 0), max(self.end + 1 - (5 - end) * fifth, 0))


def constant_stretches(forces: ArrayLike) -> Indices:
    """Return the edges (k + 1,) of the k stretches in which all forces (n, m), N, are constant: 0, ..., n."""
    values: Array = np.asarray(forces, dtype=float)
    changes = np.flatnonzero(np.any(values[1:] != values[:-1], axis=1)) + 1
    return np.concatenate([[0], changes, [len(values)]]).astype(np.int64)


def windows(forces: ArrayLike) -> list[Window]:
    """Return the windows in which a run under external forces (n, m), N, is judged; the last one ends the run."""
    edges = constant_stretches(forces)
    count = int(edges[-1])
    least = max(LEAST_SAMPLES, LEAST_PLATEAU * count)
    found = [Window(int(a), int(b) - 1) for a, b in pairwise(edges[:-1]) if b - a >= least]
    if count - edges[-2] >= max(LEAST_SAMPLES, LEAST_WINDOW * count):
        return [*found, Window(int(edges[-2]), count - 1)]
    return [*found, Window(0, count - 1, False)]
