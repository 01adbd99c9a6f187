"""Boundary of stability found by simulation, as an independent check of the exact boundary."""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.simulation.decision import growth
from palpate.simulation.linear_loop import ScenarioLoop
from palpate.simulation.outcome_rows import name_rows
from palpate.simulation.simulator import Simulation, build_simulation
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.maps.refined import follow

__all__ = ["SimulatedBoundary", "simulated_boundary"]

STEPS, LEVELS = 8, 4  # steps of the coarse grid per axis; number of refinements along the boundary
PUSH = 1e-3  # N, for five samples
DIVERGED = 100  # object force over excitation above which a run counts as unstable
CYCLES, MAX_DURATION = 25, 4.0  # periods of the slowest oscillation at the boundary, and s: duration of a run
SLOW, REPEAT = (0.1, 1.5), 4  # growth factors for which a run is repeated, and factor of its duration


@dataclass(frozen=True)
class SimulatedBoundary:
    """Boundary of stability in simulation, over a window from zero damping and stiffness.

    Attributes:
        damping: B (k,), N s/m.
        stiffness: K (k,), N/m.
        window: largest B (N s/m) and K (N/m).
        distance: distance of each point from the exact curve (k,), as a fraction of the window's width and height.
        runs: number of simulated loops.
        cells: number of cells of a uniform grid of the same resolution.
        duration: duration of each run, s; runs with slow growth or decay were repeated four times as long.
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
    exact: Boundary,
    window: tuple[float, float],
    min_stable_stiffness: float = 0.0,
    progress: Callable[[float], None] | None = None,
) -> SimulatedBoundary | None:
    """Return the boundary within ``window`` as the full simulation finds it.

    The object is a bilateral spring at the start tip. Dry friction, encoder counts and limits, which bound every
    oscillation, are switched off. The excitation is 1 mN, so that the motion is small at first.

    Args:
        scenario: the scenario whose loop runs.
        loop: its linear loop, whose directions the object acts along.
        exact: the exact boundary, for the comparison and the duration of the runs.
        window: largest B (N s/m) and K (N/m).
        min_stable_stiffness: lower edge of the stable region, N/m, also compared.
        progress: called with the fraction of the levels done.

    Returns:
        The boundary; None for an oblique surface, along whose normal alone no spring acts.
    """
    if scenario.object.kind == "wall" and np.max(np.abs(loop.directions)) < 1 - 1e-9:
        return None
    within = (exact.damping <= window[0]) & (exact.stiffness <= window[1]) & (exact.stiffness > 0.02 * window[1])
    slowest = float(exact.angle[within].min(initial=math.pi))
    ticks = max(round(1.0 / scenario.period), math.ceil(CYCLES * 2 * math.pi / max(slowest, 1e-9)))
    ticks = min(ticks, round(MAX_DURATION / scenario.period))
    short, long = _prepare(scenario, loop, ticks), _prepare(scenario, loop, REPEAT * ticks)
    axes = np.abs(loop.directions).max(axis=1)
    damping, stiffness = (np.linspace(0.0, limit, STEPS * 2**LEVELS + 1) for limit in window)
    done = 0

    def simulate_cells(i: NDArray[np.int64], j: NDArray[np.int64]) -> Array:
        nonlocal done
        cells = stiffness[j][:, None] * axes, damping[i][:, None] * axes
        found = _growth(short, *cells)
        slow = (found > SLOW[0]) & (found < SLOW[1])  # slow decay may hide another, growing oscillation
        if slow.any():
            repeated = _growth(long, *(values[slow] for values in cells)) ** (1 / REPEAT)
            found[slow] = np.where(np.isinf(repeated) & (found[slow] > 1), found[slow], repeated)
        done += 1
        if progress is not None:
            progress(done / (LEVELS + 1))
        return found

    found = follow(("object.damping", "object.stiffness"), (damping, stiffness), LEVELS, simulate_cells)
    points = found.boundary
    return SimulatedBoundary(
        points[:, 0],
        points[:, 1],
        window,
        _distance(points / window, exact, window, min_stable_stiffness),
        int(found.ran.sum()),
        found.ran.size,
        ticks * scenario.period,
    )


def _prepare(s: Scenario, loop: ScenarioLoop, ticks: int) -> Simulation:
    """Return the simulation of a push against a spring, without dry friction, encoder counts and limits."""
    tables = s.to_dict()
    tables["device"] = {**tables["device"], "encoder": False, "saturation": False}
    tables["run"] = {"duration": f"{2 * s.period:.9g} s", "substeps": max(4, s.run.substeps)}
    simulation = build_simulation(tables)
    device = simulation.device.with_friction(coulomb=0.0)
    simulation.setup.friction = device.core_friction
    simulation.setup.wall = _spring(device.forward(simulation.start))
    push, silent = np.zeros((2, ticks + 1, 3))
    push[:5] = PUSH * loop.directions.sum(axis=1) / math.sqrt(loop.directions.shape[1])
    tracking = not np.any(simulation.operator) and s.servo.topology == "force_tracking"
    reference, operator = (push, silent) if tracking else (silent, push)
    return replace(simulation, device=device, reference=reference, operator=operator)


def _growth(simulation: Simulation, stiffness: Array, damping: Array) -> Array:
    """Return the growth (k,) of the oscillation for stiffness and damping (k, 3); inf where the loop diverged."""
    period = simulation.scenario.period
    if simulation.scenario.device.model == "nonlinear":
        columns = {"stiffness": np.ascontiguousarray(stiffness), "damping": np.ascontiguousarray(damping)}
        args = (simulation.setup, simulation.reference, simulation.operator, columns, len(stiffness))
        found = name_rows(np.asarray(_core.run_cells(*args, os.cpu_count() or 1)), period)
        names = ("unstable_from", "oscillation_2", "oscillation_4", "oscillation_5", "peak_object_force")
        diverged, early, prior, late, force = (found[name] for name in names)
    else:  # the vector lanes have no linear model
        cells = [_simulate_cell(simulation, k, b) for k, b in zip(stiffness, damping, strict=True)]
        diverged, early, prior, late, force = np.array(cells).T
    return np.where(force > DIVERGED * PUSH, np.inf, growth(diverged, early, prior, late))


def _simulate_cell(simulation: Simulation, stiffness: Array, damping: Array) -> tuple[float, ...]:
    """Return the tick of divergence or nan, the oscillation in three fifths of the run, and the peak object force."""
    simulation.setup.stiffness, simulation.setup.damping = stiffness, damping
    rows, unstable = simulation.run()
    dof, fifth = simulation.device.dof, max((len(rows) - 2) // 5, 1)
    acceleration = np.linalg.norm(np.diff(simulation.device.forward(rows[:, :dof]), n=2, axis=0), axis=1)
    force = np.linalg.norm(rows[:, 2 * dof + 3 : 2 * dof + 6], axis=1).max()
    fifths = (acceleration[fifth : 2 * fifth], acceleration[-2 * fifth : -fifth], acceleration[-fifth:])
    oscillations = (float(part.max(initial=0.0)) for part in fifths)
    return math.nan if unstable < 0 else float(unstable), *oscillations, float(force)


def _spring(point: Array) -> Any:
    wall = _core.SpringWallParameters()
    wall.kind = _core.SpringWallParameters.Kind.point
    wall.point = point
    return wall


def _distance(points: Array, exact: Boundary, window: tuple[float, float], min_stable_stiffness: float) -> Array:
    """Return the distance (k,) of points (k, 2), as fractions of the window, from the exact curve."""
    curve = np.column_stack([exact.damping, exact.stiffness]) / window
    first = np.concatenate([np.arange(a, b - 1) for a, b in exact.pieces])
    if min_stable_stiffness > 0.0:
        first = np.append(first, len(curve))
        curve = np.vstack([curve, [[0.0, min_stable_stiffness / window[1]], [1.0, min_stable_stiffness / window[1]]]])
    start, along = curve[first], curve[first + 1] - curve[first]
    length = np.maximum(np.sum(along**2, axis=1), 1e-300)
    out = np.empty(len(points))
    for row, point in enumerate(points):
        fraction = np.clip(np.sum((point - start) * along, axis=1) / length, 0.0, 1.0)
        out[row] = np.linalg.norm(point - start - fraction[:, None] * along, axis=1).min()
    return out
