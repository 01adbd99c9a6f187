"""The boundary between stable and unstable cells, found on a coarse grid and refined only where neighbours differ."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.scenario import Scenario
from palpate.sweeps.axes import COLUMNS, Axis, SweepError, axes_of
from palpate.sweeps.outcomes import Outcomes
from palpate.sweeps.plan import Plan

__all__ = ["Refined", "follow", "refine"]

Array = NDArray[np.float64]


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


def refine(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    over: Mapping[str, Any],
    *,
    levels: int = 4,
    threads: int | None = None,
) -> Refined:
    """Return the map of verdicts over two axes, as fine near the boundary as a grid with 2^levels times the steps.

    Args:
        scenario: as `sweep`; a small push shows the linear boundary, a large one also encoder counts and friction.
        over: two keys of COLUMNS, such as object.damping and object.stiffness, each with a coarse range or list.
        levels: how often steps are halved.
        threads: all cores if not given.

    Raises:
        SweepError: not two axes of COLUMNS, or the grid is too fine.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    axes = axes_of(over)
    if len(axes) != 2 or any(axis.key not in COLUMNS for axis in axes) or any(len(axis) < 2 for axis in axes):
        raise SweepError(f"a boundary needs two axes of two values or more, of {', '.join(COLUMNS)}")
    if not 0 <= levels <= 10:
        raise SweepError(f"levels: {levels}; from 0 to 10")
    if not isinstance(scenario, Scenario):
        scenario = Scenario.from_dict(scenario) if isinstance(scenario, Mapping) else Scenario.from_file(scenario)
    fine = tuple(Axis(axis.path, axis.unit, _finer(axis, 2**levels)) for axis in axes)
    plan = Plan(scenario.to_dict(), fine, {}, 1, 0)
    plan.check()

    def simulate_cells(i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
        cells = np.ravel_multi_index((i, j), plan.shape)
        return Outcomes(plan.run_cells(cells, threads or os.cpu_count() or 1)).growth

    values = tuple(np.asarray(axis.values, dtype=float) for axis in fine)
    return follow((axes[0].path, axes[1].path), (values[0], values[1]), levels, simulate_cells)


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


def _finer(axis: Axis, step: int) -> tuple[float, ...]:
    coarse = np.asarray(axis.values, dtype=float)
    places = np.arange((len(coarse) - 1) * step + 1) / step
    return tuple(float(x) for x in np.interp(places, np.arange(len(coarse)), coarse))


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
