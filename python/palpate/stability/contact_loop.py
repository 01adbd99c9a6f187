"""Stability of a contact with a deformable body, linearized where the tip rests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from palpate import _core
from palpate.control.controller_forms import as_linear_controller
from palpate.control.stability_margins import gain_interval
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.bodies import origin_of, scenario_body
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.trace import Trace
from palpate.stability.criteria import check_stability

__all__ = ["ContactStability", "contact_stability"]

Array = NDArray[np.float64]
_STEP = 1e-6  # m: small against the patch of a node, large against rounding


@dataclass(frozen=True)
class ContactStability:
    """Stability of the loop along the force of one contact.

    Directions across the force are not tested: a tip without friction meets no stiffness there.

    Attributes:
        normal: unit vector out of the body, against the force of the tip, (3,), device frame.
        stiffness: derivative of the force by the tip position along the normal, N/m.
        radius: largest modulus of the sampled loop's eigenvalues.
        criteria: verdict of each of four criteria on its own (see `certify`).
        stiffness_margin: factor on the contact stiffness at which the loop oscillates; inf: none; nan: it is unstable.
    """

    normal: Array
    stiffness: float
    radius: float
    criteria: Mapping[str, bool]
    stiffness_margin: float

    @property
    def stable(self) -> bool:
        """Whether all criteria find the loop stable."""
        return all(self.criteria.values())

    @property
    def critical_stiffness(self) -> float:
        """Contact stiffness at which the loop oscillates, N/m."""
        return self.stiffness * self.stiffness_margin


def contact_stability(trace: Trace, row: int = -1, *, controller: Any = None) -> ContactStability:
    """Return the stability of a contact with a body, linearized at sample `row` of a trace.

    The contact is modeled as a wall with the tangent stiffness at that sample; for a viscoelastic body the stiffness
    within one period counts. Limits and encoder counts are neglected.

    Args:
        trace: a run on a body whose tip rests in contact at `row`.
        row: index of the sample.
        controller: the linear controller of the run, if it was not the scenario's.

    Raises:
        StabilityError: the scenario has no body, or the tip is not in contact at that sample.
    """
    scenario = Scenario.from_dict(trace.scenario)
    if scenario.object.body is None:
        raise StabilityError("contact_stability needs a scenario with a body; use certify for springs and walls")
    if not trace["touching"][row, 0]:
        raise StabilityError(
            f"the tip is not in contact with the body at t = {trace.time[row]:g} s; choose a sample in contact"
        )
    device = scenario.load_device()
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    normal = -trace["object_force"][row] / np.linalg.norm(trace["object_force"][row])
    stiffness = float(
        normal @ _tangent_stiffness(scenario, trace["tip"][: row % len(trace) + 1] - trace["tip"][0]) @ normal
    )
    if not stiffness > 0.0:
        raise StabilityError(f"the contact at t = {trace.time[row]:g} s has no stiffness along its force")
    wall = {"kind": "wall", "stiffness": f"{stiffness!r} N/m", "normal": normal.tolist()}
    loop = scenario_loop(
        Scenario.from_dict({**trace.scenario, "object": wall}),
        pose=trace["angle"][row],
        tip_force=trace["command_force"][row],
        operator_force=trace["operator_force"][row],
        controller=build_controller(scenario, device, start)
        if controller is None
        else as_linear_controller(controller, scenario.period),
    )
    radius, criteria = check_stability(loop.matrix())
    factor = gain_interval(loop.gain())[1] if radius < 1.0 else float("nan")
    return ContactStability(normal, stiffness, radius, criteria, float(factor))


def _tangent_stiffness(scenario: Scenario, tip: Array) -> Array:
    """Return the tangent stiffness of a contact (3, 3), N/m, device frame, at the end of the path `tip`.

    Args:
        scenario: its object is a body.
        tip: displacement of the tip from its start (m, 3), m. A hyperelastic body is simulated along the whole path.
    """
    choice = scenario.object.body
    assert choice is not None
    body = scenario_body(scenario)
    rotation = Rotation.from_euler("xyz", choice.turn).as_matrix()
    path = (tip - np.array(scenario.object.position)) @ rotation + origin_of(choice, body)
    outward = [0.0, 0.0, 1.0] if choice.tip == "flat" else None

    def force(position: Array) -> Array:
        if not hyperelastic:
            body.core.reset()
        return np.array(body.simulate_path(position[None], choice.radius, outward=outward, tip=choice.tip).force[0])

    hyperelastic = isinstance(body.core, _core.HyperelasticBody)
    if hyperelastic:
        body.core.reset()
        body.simulate_path(path, choice.radius, outward=outward, tip=choice.tip)
    columns = [(force(path[-1] - step) - force(path[-1] + step)) / (2 * _STEP) for step in _STEP * np.eye(3)]
    stiffness = np.stack(columns, axis=1)
    return np.asarray(rotation @ (0.5 * (stiffness + stiffness.T)) @ rotation.T)
