"""The boundary between stable and unstable cells, found on a coarse grid and refined only where neighbours differ."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.stability.maps.refined import Refined, follow
from palpate.sweeps.axes import COLUMNS, Axis, SweepError, axes_of
from palpate.sweeps.outcomes import Outcomes
from palpate.sweeps.plan import Plan

__all__ = ["Refined", "refine"]


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


def _finer(axis: Axis, step: int) -> tuple[float, ...]:
    coarse = np.asarray(axis.values, dtype=float)
    places = np.arange((len(coarse) - 1) * step + 1) / step
    return tuple(float(x) for x in np.interp(places, np.arange(len(coarse)), coarse))
