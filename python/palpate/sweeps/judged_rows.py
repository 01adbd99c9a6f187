"""Verdicts of the cells of a batch, by the rule that judges a run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.arrays import Array
from palpate.devices.reach import beyond_reach
from palpate.errors import PalpateError
from palpate.simulation.evidence import lossy, resolution
from palpate.simulation.linear_evidence import linear_sign
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.outcome_rows import end_angles, name_rows
from palpate.simulation.simulator import Simulation
from palpate.simulation.statics import force_over_stiffness, presses, steady_error
from palpate.simulation.verdict import Evidence, decide
from palpate.stability.maps.zwidth_map import loop_radii

__all__ = ["judge_rows", "linear_radii"]


def judge_rows(simulation: Simulation, rows: Array, columns: Mapping[str, Array], radii: Array) -> dict[str, Array]:
    """Return the outcomes of cells (n,) by name, with their verdicts.

    Args:
        simulation: of all cells; `columns` has the values in which a cell differs from it.
        rows: of the core, (n, k).
        columns: as given to the core, (n, 1) or (n, 3).
        radii: of `linear_radii` (n,).
    """
    scenario, device, count = simulation.scenario, simulation.device, len(rows)
    out = name_rows(rows, scenario.period)
    reference, operator = simulation.reference[-1], simulation.operator[-1]
    stiffness = columns.get("stiffness", np.broadcast_to(np.asarray(simulation.setup.stiffness), (count, 3)))
    steady, known = out["steady_tip"] - np.array(scenario.object.position), ~np.isnan(out["steady_tip"][:, 0])
    error, pressed = np.full(count, np.nan), False
    deflection = np.linalg.norm(steady, axis=1)
    if scenario.contact_kind == "wall":
        normal = np.array(scenario.object.normal)
        deflection = np.maximum(-steady @ normal, 0.0)
        pressed = bool(presses(reference + operator, normal)[0])
    elif scenario.contact_kind == "spring":
        error = steady_error(steady, force_over_stiffness(reference, stiffness, device.dof))
    beyond = np.zeros(count, dtype=bool)
    beyond[known] = beyond_reach(device, simulation.start, end_angles(rows)[known])
    linear = np.array([linear_sign(radius) for radius in radii], dtype=float)
    evidence = Evidence.of(
        count,
        unstable_from=out["unstable_from"],
        early=out["oscillation_2"],
        prior=out["oscillation_4"],
        late=out["oscillation_5"],
        ripple=out["ripple"],
        deflection=deflection,
        error=error,
        touching=out["touching_5"],
        contacts=out["contacts_5"],
        saturated=out["saturated_5"],
        pressed=pressed,
        beyond=beyond,
        resolution=resolution(scenario, device, simulation.start)[0],
        linear=linear.astype(int),
        decay=radii ** ((len(simulation.reference) - 1 - simulation.setup.window_start) // 5),
        lossy=lossy(scenario, device),
    )
    return {**out, "linear": linear, "verdict": decide(evidence).astype(float)}


def linear_radii(simulation: Simulation, columns: Mapping[str, Array], count: int) -> Array:
    """Return the spectral radius (n,) of the linear loop of each cell at the start pose; nan if it is unknown.

    It is known for springs and walls with backward difference whose cells differ in stiffness and damping alone.
    """
    scenario, unknown = simulation.scenario, np.full(count, np.nan)
    varied = columns.keys() - {"seed"}
    if (
        scenario.contact_kind not in ("spring", "wall")
        or scenario.object.coupling != "backward"
        or scenario.servo.jitter > 0.0
        or not varied <= {"stiffness", "damping"}
    ):
        return unknown
    values = [
        columns.get(name, np.tile(getattr(simulation.setup, name), (count, 1))) for name in ("stiffness", "damping")
    ]
    if any(np.any(value != value[:, :1]) for value in values):
        return unknown  # one stiffness and damping for all directions
    try:
        loop = scenario_loop(scenario, controller=simulation.controller)  # type: ignore[arg-type]
    except PalpateError:
        return unknown
    return loop_radii(loop, values[0][:, 0], values[1][:, 0])
