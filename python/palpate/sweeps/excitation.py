"""Excitation of the cells of a sweep: constant forces over the window in which a loop is judged."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.arrays import Array, Indices
from palpate.simulation.simulator import Simulation
from palpate.simulation.support_phase import last_change
from palpate.simulation.windows import constant_stretches
from palpate.sweeps.axes import SweepError

__all__ = ["Excitation", "excited"]

WINDOW = 0.4  # least fraction of a run over which the scenario's own forces must be constant at its end
HELD = 0.6  # fraction of the run over which forces are held if they are not
PULSE, SAMPLES = 0.02, 5  # force of the perturbation over the held force, and its duration in samples


@dataclass(frozen=True)
class Excitation:
    """What a sweep does with the forces of a scenario.

    Attributes:
        first: first sample of the judged window.
        held: time from which the forces are held constant, s; None: the scenario's own forces are judged.
    """

    first: int
    held: float | None

    def __str__(self) -> str:
        if self.held is None:
            return "each cell runs under the forces of the scenario"
        return (
            f"each cell holds the forces of t = {self.held:.4g} s from then on, with a small pulse: the scenario's own "
            "forces change too late to judge the loop under them"
        )


def excited(simulation: Simulation) -> tuple[Simulation, Excitation]:
    """Return a simulation whose forces are constant over the window in which it is judged, and what was changed.

    If the scenario's own forces are constant and not zero over the last 40 % of the run, they are kept. Otherwise the
    forces of the longest constant stretch, or the largest ones, are held from their beginning, and a pulse of 2 % over
    five samples perturbs the tip.

    Raises:
        SweepError: the scenario has no excitation.
    """
    reference, operator = simulation.reference, simulation.operator
    forces = np.hstack([reference, operator])
    scenario = simulation.scenario
    if last_change(scenario) is not None:
        raise SweepError(
            "object.body.supports: a sweep judges cells under constant supports; write held, or run the scenario itself"
        )
    if any(one.object.body is not None and one.object.body.tool is not None for one in scenario.each_object.values()):
        raise SweepError(
            "object.body.tool: a sweep judges cells under a tool at rest; remove it, or run the scenario itself"
        )
    if not forces.any():
        displaced = any(any(one.object.position) for one in scenario.each_object.values())
        displaced = displaced or any(scenario.operator.rest)
        if displaced or not scenario.servo.gravity_compensation:
            return simulation, Excitation(0, None)
        raise SweepError(
            f"{scenario.source or 'scenario'}: no excitation, so no loop can be judged; "
            "give [reference] or [operator] a force"
        )
    edges = constant_stretches(forces)
    samples, first = len(forces), int(edges[-2])
    if samples - first >= WINDOW * samples and forces[-1].any():
        return _judged(simulation, first), Excitation(first, None)
    held = _longest_load(forces, edges)
    length = max(samples, held + round(HELD * samples))
    row = np.minimum(np.arange(length), held)
    force = forces[held]
    pulse = np.zeros((length, 3))
    pulse[held + 1 : held + 1 + SAMPLES] = PULSE * np.linalg.norm(force) / np.sqrt(3.0)
    changed = replace(
        simulation,
        reference=np.ascontiguousarray(reference[row]),
        operator=np.ascontiguousarray(operator[row] + pulse),
    )
    return _judged(changed, held), Excitation(held, held * scenario.period)


def _judged(simulation: Simulation, first: int) -> Simulation:
    simulation.setup.window_start = first
    return simulation


def _longest_load(forces: Array, edges: Indices) -> int:
    """Return the first sample of the longest constant stretch, between `edges`, of forces (n, 6) that are not zero."""
    lengths = np.diff(edges) * np.any(forces[edges[:-1]] != 0.0, axis=1)
    if lengths.max(initial=0) >= 0.1 * len(forces):
        return int(edges[np.argmax(lengths)])
    return int(np.argmax(np.linalg.norm(forces, axis=1)))
