"""The boundary of stability as the simulation finds it, without being told where theory has it."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import ScenarioLoop
from palpate.simulation.simulator import Simulation, build_simulation
from palpate.stability.boundaries import Boundary
from palpate.sweeps.outcomes import growth, name_rows
from palpate.sweeps.refinement import follow

__all__ = ["SimulatedBoundary", "simulated_boundary"]

Array = NDArray[np.float64]
STEPS, LEVELS = 8, 4  # of the coarse grid, each way; how often it is halved along the boundary
PUSH = 1e-3  # N, for five samples
LOST = 100  # times the push: an object that was pressed so hard was struck by a swing that grew, whatever became of it
CYCLES, LONGEST = 25, 4.0  # of the slowest swing at the boundary, and s: how long a cell runs
SLOW, AGAIN = (0.1, 1.5), 4  # a swing that a fifth of the run multiplies by as much is followed so many times as long


@dataclass(frozen=True)
class SimulatedBoundary:
    """Where the simulated loop begins to grow, over a window from no damping and no stiffness.

    Attributes:
        damping: B (k,), N s/m.
        stiffness: K (k,), N/m.
        window: largest B and K looked at.
        distance: of each point from the exact curve (k,), as a share of the window's width and height.
        runs: loops that were run; a grid as fine would have needed `cells`.
        cells: see `runs`.
        duration: of each run, s; a swing that then was about as large as before was followed four times as long.
    """

    damping: Array
    stiffness: Array
    window: tuple[float, float]
    distance: Array
    runs: int
    cells: int
    duration: float

    @property
    def furthest(self) -> float:
        """The largest distance; nan without a point."""
        return float(self.distance.max()) if len(self.distance) else math.nan


def simulated_boundary(
    scenario: Scenario,
    loop: ScenarioLoop,
    edge: Boundary,
    window: tuple[float, float],
    min_stable_stiffness: float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> SimulatedBoundary | None:
    """Return the boundary within ``window`` (largest B, N s/m, and K, N/m) as the full simulation finds it.

    The object is held from both sides at the start tip; the device is as the scenario has it but without dry friction,
    counts and limits, which bound every swing; the push is a millinewton, so that the motion is small at first. None
    for an oblique surface: no spring acts along its normal alone.

    Args:
        scenario: whose loop runs.
        loop: the same, linear: it tells along which axes the object is felt.
        edge: the exact boundary, which is compared, and tells how slow the swings are.
        window: see above.
        min_stable_stiffness: object with which the loop is stable, N/m: the lower edge, which is compared as well.
        progress: called with the share of the levels done.
    """
    if scenario.object.kind == "wall" and np.max(np.abs(loop.directions)) < 1 - 1e-9:
        return None
    within = (edge.damping <= window[0]) & (edge.stiffness <= window[1]) & (edge.stiffness > 0.02 * window[1])
    slowest = float(edge.angle[within].min(initial=math.pi))
    ticks = max(round(1.0 / scenario.period), math.ceil(CYCLES * 2 * math.pi / max(slowest, 1e-9)))
    ticks = min(ticks, round(LONGEST / scenario.period))
    short, long = _freed(scenario, loop, ticks), _freed(scenario, loop, AGAIN * ticks)
    felt = np.abs(loop.directions).max(axis=1)
    damping, stiffness = (np.linspace(0.0, most, STEPS * 2**LEVELS + 1) for most in window)
    done = 0

    def look(i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
        nonlocal done
        cells = stiffness[j][:, None] * felt, damping[i][:, None] * felt
        found = _growth(short, *cells)
        near = (found > SLOW[0]) & (found < SLOW[1])  # what dies slowly may hide another oscillation, which grows
        if near.any():
            again = _growth(long, *(values[near] for values in cells)) ** (1 / AGAIN)
            found[near] = np.where(np.isinf(again) & (found[near] > 1), found[near], again)
        done += 1
        if progress is not None:
            progress(done / (LEVELS + 1))
        return found

    found = follow(("object.damping", "object.stiffness"), (damping, stiffness), LEVELS, look)
    points = found.boundary
    return SimulatedBoundary(
        points[:, 0],
        points[:, 1],
        window,
        _distance(points / window, edge, window, min_stable_stiffness),
        int(found.ran.sum()),
        found.ran.size,
        ticks * scenario.period,
    )


def _freed(s: Scenario, loop: ScenarioLoop, ticks: int) -> Simulation:
    """Return a scenario made ready to be pushed against a spring, without dry friction, counts and limits."""
    tables = s.to_dict()
    tables["device"] = {**tables["device"], "encoder": False, "saturation": False}
    tables["run"] = {"duration": f"{2 * s.period:.9g} s", "substeps": max(4, s.run.substeps)}
    experiment = build_simulation(tables)
    device = experiment.device.with_friction(coulomb=0.0)
    experiment.setup.friction = device.core_friction
    experiment.setup.wall = _spring(device.forward(experiment.start))
    push, silent = np.zeros((2, ticks + 1, 3))
    push[:5] = PUSH * loop.directions.sum(axis=1) / math.sqrt(loop.directions.shape[1])
    tracking = not np.any(experiment.operator) and s.servo.topology == "force_tracking"
    reference, operator = (push, silent) if tracking else (silent, push)
    return replace(experiment, device=device, reference=reference, operator=operator)


def _growth(experiment: Simulation, stiffness: Array, damping: Array) -> Array:
    """Return the swing's growth (k,) in cells of stiffness and damping (k, 3); inf for one that has run away."""
    period = experiment.scenario.period
    if experiment.scenario.device.model == "nonlinear":
        columns = {"stiffness": np.ascontiguousarray(stiffness), "damping": np.ascontiguousarray(damping)}
        args = (experiment.setup, experiment.reference, experiment.operator, columns, len(stiffness))
        found = name_rows(np.asarray(_core.run_cells(*args, os.cpu_count() or 1)), period)
        names = ("unstable_from", "oscillation_2", "oscillation_4", "oscillation_5", "peak_object_force")
        lost, early, prior, late, force = (found[name] for name in names)
    else:  # lanes have no linear model
        cells = [_one(experiment, k, b) for k, b in zip(stiffness, damping, strict=True)]
        lost, early, prior, late, force = np.array(cells).T
    return np.where(force > LOST * PUSH, np.inf, growth(lost, early, prior, late))


def _one(experiment: Simulation, stiffness: Array, damping: Array) -> tuple[float, ...]:
    """Return when one cell was lost, its early, prior and late swing, its largest object force, as lanes have them."""
    experiment.setup.stiffness, experiment.setup.damping = stiffness, damping
    rows, unstable = experiment.run()
    dof, fifth = experiment.device.dof, max((len(rows) - 2) // 5, 1)
    bend = np.linalg.norm(np.diff(experiment.device.forward(rows[:, :dof]), n=2, axis=0), axis=1)
    force = np.linalg.norm(rows[:, 2 * dof + 3 : 2 * dof + 6], axis=1).max()
    fifths = (bend[fifth : 2 * fifth], bend[-2 * fifth : -fifth], bend[-fifth:])
    swings = (float(part.max(initial=0.0)) for part in fifths)
    return math.nan if unstable < 0 else float(unstable), *swings, float(force)


def _spring(point: Array) -> Any:
    anchor = _core.SpringWallParameters()
    anchor.kind = _core.SpringWallParameters.Kind.point
    anchor.point = point
    return anchor


def _distance(points: Array, edge: Boundary, window: tuple[float, float], min_stable_stiffness: float) -> Array:
    """Return how far points (k, 2), in shares of the window, lie from the nearest stretch of the curve."""
    curve = np.column_stack([edge.damping, edge.stiffness]) / window
    first = np.concatenate([np.arange(a, b - 1) for a, b in edge.pieces])
    if min_stable_stiffness > 0.0:
        first = np.append(first, len(curve))
        curve = np.vstack([curve, [[0.0, min_stable_stiffness / window[1]], [1.0, min_stable_stiffness / window[1]]]])
    start, along = curve[first], curve[first + 1] - curve[first]
    length = np.maximum(np.sum(along**2, axis=1), 1e-300)
    out = np.empty(len(points))
    for row, point in enumerate(points):
        share = np.clip(np.sum((point - start) * along, axis=1) / length, 0.0, 1.0)
        out[row] = np.linalg.norm(point - start - share[:, None] * along, axis=1).min()
    return out
