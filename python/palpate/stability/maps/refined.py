"""Map of verdicts over two axes, found on a coarse grid and refined only where neighbors differ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array

__all__ = ["Refined", "follow"]


@dataclass(frozen=True, repr=False)
class Refined:
    """Map over two axes, with cells far from the boundary interpolated from coarse neighbors.

    Attributes:
        paths: of the two axes.
        values: of the two axes, SI, (m,) and (n,).
        unstable: (m, n).
        growth: (m, n), growth factor of the oscillation; nan where not run.
        ran: (m, n), whether the cell was run.
    """

    paths: tuple[str, str]
    values: tuple[Array, Array]
    unstable: NDArray[np.bool_]
    growth: Array
    ran: NDArray[np.bool_]

    def __repr__(self) -> str:
        sizes = " × ".join(f"{path} ({len(values)})" for path, values in zip(self.paths, self.values, strict=True))
        return (
            f"<Refined: {sizes}; {self.ran.sum():,} of {self.ran.size:,} cells run, {self.unstable.mean():.0%} of the "
            "map unstable>"
        )

    @property
    def boundary(self) -> Array:
        """Return points (k, 2) of the boundary, SI, where the verdict changes along the second axis.

        Between two neighbors the logarithm of the growth is interpolated linearly to zero; the midpoint is used where
        one of them diverged or came to rest.
        """
        first, second = self.values
        at = np.argwhere(self.unstable[:, 1:] != self.unstable[:, :-1])
        points = np.empty((len(at), 2))
        for row, (i, j) in enumerate(at):
            with np.errstate(divide="ignore", invalid="ignore"):
                low, high = np.log(self.growth[i, j]), np.log(self.growth[i, j + 1])
            share = low / (low - high) if np.isfinite(low) and np.isfinite(high) and low * high < 0 else 0.5
            points[row] = first[i], second[j] + share * (second[j + 1] - second[j])
        return points


def follow(
    paths: tuple[str, str],
    values: tuple[Array, Array],
    levels: int,
    simulate_cells: Callable[[NDArray[np.int64], NDArray[np.int64]], Array],
) -> Refined:
    """Return the map of cells: a coarse grid first, then only cells at the boundary.

    Every square whose corners differ, and those beside it, are halved, `levels` times.

    Args:
        paths: of the two axes.
        values: of the two axes at their finest, SI, with a multiple of 2^levels steps each.
        levels: how often steps are halved.
        simulate_cells: function from the indices (k,) along both axes to the growth (k,) of these cells.
    """
    shape = (len(values[0]), len(values[1]))
    growth = np.full(shape, np.nan)
    ran = np.zeros(shape, dtype=bool)
    unstable = np.zeros(shape, dtype=bool)

    def run(wanted: NDArray[np.bool_]) -> None:
        i, j = np.nonzero(wanted & ~ran)
        if len(i):
            growth[i, j] = simulate_cells(i, j)
            unstable[i, j] = growth[i, j] > 1
            ran[i, j] = True

    step = 2**levels
    wanted = np.zeros(shape, dtype=bool)
    wanted[::step, ::step] = True
    run(wanted)
    while step > 1:
        half = step // 2
        wanted = np.zeros(shape, dtype=bool)
        for i, j in np.argwhere(_mixed(unstable[::step, ::step])):
            wanted[i * step : (i + 1) * step + 1 : half, j * step : (j + 1) * step + 1 : half] = True
        _inherit(unstable, ran, step)
        run(wanted)
        step = half
    return Refined(paths, values, unstable, growth, ran)


def _mixed(corners: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return for each square of a lattice, and those beside it, whether its corners differ."""
    four = np.stack([corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:]])
    mixed = np.asarray(four.any(axis=0) & ~four.all(axis=0), dtype=bool)
    wide = mixed.copy()  # the boundary may leave a square through a side between two equal corners
    wide[1:] |= mixed[:-1]
    wide[:-1] |= mixed[1:]
    wide[:, 1:] |= mixed[:, :-1]
    wide[:, :-1] |= mixed[:, 1:]
    return wide


def _inherit(unstable: NDArray[np.bool_], ran: NDArray[np.bool_], step: int) -> None:
    """Copy the verdict of the preceding corner to cells of the finer lattice that are not run."""
    half = step // 2
    for i, j in ((half, 0), (0, half), (half, half)):
        part = unstable[i::step, j::step]
        known = ran[i::step, j::step]
        source = unstable[::step, ::step][: part.shape[0], : part.shape[1]]
        unstable[i::step, j::step] = np.where(known, part, source)
