"""Verdicts of the cells of a batch, by the rule that judges a run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.arrays import Array, Flags
from palpate.control.controller import Controller
from palpate.devices.reach import NEAR_SINGULAR, conditioning, excursion_beyond, unreachable
from palpate.errors import PalpateError
from palpate.simulation.decision import LASTING, Evidence, decide
from palpate.simulation.evidence import lossy, resolution
from palpate.simulation.linear_evidence import AT_LIMIT, linear_sign
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.outcome_rows import Excursion, excursions, name_rows
from palpate.simulation.simulator import Simulation
from palpate.simulation.statics import force_over_stiffness, presses, steady_error
from palpate.stability.maps.zwidth_map import loop_radii

__all__ = ["judge_rows", "linear_radii"]

EXACT = 1e-3  # relative error of the deflection below which force over stiffness is reached


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
    steady = out["steady_tip"] - np.array(scenario.object.position)
    error, pressed, expected = np.full(count, np.nan), False, np.full((count, 3), np.nan)
    deflection = np.linalg.norm(steady, axis=1)
    if scenario.contact_kind == "wall":
        normal = np.array(scenario.object.normal)
        deflection = np.maximum(-steady @ normal, 0.0)
        pressed = bool(presses(reference + operator, normal)[0])
    elif scenario.contact_kind == "spring":
        expected = np.broadcast_to(force_over_stiffness(reference, stiffness, device.dof), (count, 3))
        error = steady_error(steady, expected)
    beyond = _beyond(simulation, excursions(rows), expected, error)
    linear = np.array([linear_sign(radius) for radius in radii], dtype=float)
    fifth = (len(simulation.reference) - 1 - simulation.setup.window_start) // 5
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        slide = _slowest_slide(simulation) ** fifth
        decay = np.fmax(radii**fifth, slide if slide > LASTING else np.nan)  # a shorter window does not show its decay
        turns = fifth * np.sqrt(out["oscillation_5"] / out["ripple"]) / (2.0 * np.pi)  # in the last fifth
    evidence = Evidence.of(
        count,
        unstable_from=out["unstable_from"],
        early=out["oscillation_2"],
        prior=out["oscillation_4"],
        late=out["oscillation_5"],
        ripple=out["ripple"],
        trend=np.where(turns < 1.0, out["ripple"], 0.0),
        deflection=deflection,
        error=error,
        touching=out["touching_5"],
        contacts=out["contacts_5"],
        saturated=out["saturated_5"],
        pressed=pressed,
        beyond=beyond,
        resolution=resolution(scenario, device, simulation.start)[0],
        linear=linear.astype(int),
        decay=decay,
        lossy=lossy(scenario, device),
    )
    reach = np.where(np.isnan(out["unstable_from"]), beyond.astype(float), np.nan)
    return {**out, "beyond_reach": reach, "linear": linear, "verdict": decide(evidence).astype(float)}


def _slowest_slide(simulation: Simulation) -> float:
    """Return the factor per tick of the slowest motion along a wall that decays; nan if unknown or without a wall.

    At the start pose it may be decoupled from the wall, and the linear loop lacks it; at other poses it is not.
    """
    scenario = simulation.scenario
    if scenario.contact_kind != "wall":
        return np.nan
    everywhere = scenario.object.model_copy(update={"kind": "spring", "normal": None})
    law = simulation.controller
    try:
        loop = scenario_loop(
            scenario.model_copy(update={"object": everywhere}), controller=law if isinstance(law, Controller) else None
        )
    except PalpateError:
        return np.nan
    moduli = np.abs(np.linalg.eigvals(loop.path.A))
    return max((float(modulus) for modulus in moduli if modulus < 1.0 - AT_LIMIT), default=np.nan)


def _beyond(simulation: Simulation, joints: Excursion, expected: Array, error: Array) -> Flags:
    """Return whether cells leave the reach, or end near a singular pose as force over stiffness is beyond it: (n,).

    Args:
        simulation: of all cells.
        joints: coordinates in the judged window; nan in cells that diverged.
        expected: force over stiffness (n, 3), m; nan if unknown.
        error: of the deflection at the end from it (n,).
    """
    device, beyond = simulation.device, np.zeros(len(joints.end), dtype=bool)
    ended = np.flatnonzero(~np.isnan(joints.end[:, 0]))
    reached = (joints.least[ended], joints.greatest[ended], joints.worst[ended])
    beyond[ended] = excursion_beyond(device, simulation.start, *reached)
    away = ended[np.abs(error[ended]) > EXACT]
    near = away[conditioning(device, joints.end[away]) < NEAR_SINGULAR]
    if simulation.scenario.device.kinematics == "nonlinear":
        beyond[near] |= unreachable(device, simulation.start, expected[near] + simulation.scenario.object.position)
    return beyond


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
        law = simulation.controller
        loop = scenario_loop(scenario, controller=law if isinstance(law, Controller) else None)
    except PalpateError:
        return unknown
    stiffness, damping = values[0][:, 0], values[1][:, 0]
    if loop.normalized:  # the controller sees its design stiffness in every cell
        design = np.full(count, float(loop.stiffness.max()))
        stiffness, damping = design, damping * np.divide(design, stiffness, out=np.ones(count), where=stiffness > 0.0)
    return loop_radii(loop, stiffness, damping)
