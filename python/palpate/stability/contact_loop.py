"""The loop of a tip that presses a body, linear where it rests: its verdict, and its stiffness margin."""

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
from palpate.stability.certificate import check_stability

__all__ = ["ContactStability", "contact_stability"]

Array = NDArray[np.float64]
_STEP = 1e-6  # m: small against every node's patch, large against rounding


@dataclass(frozen=True)
class ContactStability:
    """What is exact about the loop around one contact, along its force.

    Across the force a tip without friction meets no stiffness but the ripple of the body's mesh: nothing is said of it.

    Attributes:
        normal: out of the body, against the force of the tip (3,), unit, device's frame.
        stiffness: slope of the force along it by the tip's place there, N/m.
        radius: largest modulus of the sampled loop's eigenvalues.
        criteria: verdict of each of four criteria on its own (`certify`).
        stiffness_margin: factor by which the contact may be stiffer before the loop oscillates; inf: any; nan: it is
            unstable.
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
        """The contact's stiffness at which the loop would oscillate, N/m."""
        return self.stiffness * self.stiffness_margin


def contact_stability(trace: Trace, row: int = -1, *, controller: Any = None) -> ContactStability:
    """Judge the loop of a trace on a body, linearised at sample `row`, where the tip rests in contact.

    The contact counts as a touched wall, as stiff as it is there; a body of a kind with a memory as it is within one
    period. Limits and encoder counts are left out.

    Args:
        controller: that ran instead of the scenario's; linear.

    Raises:
        StabilityError: the scenario has no body, or the tip is apart at that sample.
    """
    scenario = Scenario.from_dict(trace.scenario)
    if scenario.object.body is None:
        raise StabilityError("contact_stability judges the contact with a body; certify judges springs and walls")
    if not trace["touching"][row, 0]:
        raise StabilityError(
            f"the tip is apart from the body at t = {trace.time[row]:g} s: there is no contact to judge"
        )
    device = scenario.load_device()
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    normal = -trace["object_force"][row] / np.linalg.norm(trace["object_force"][row])
    stiffness = float(normal @ _slope(scenario, trace["tip"][: row % len(trace) + 1] - trace["tip"][0]) @ normal)
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
    radius, criteria = check_stability(loop)
    factor = gain_interval(loop.gain())[1] if radius < 1.0 else float("nan")
    return ContactStability(normal, stiffness, radius, criteria, float(factor))


def _slope(scenario: Scenario, tip: Array) -> Array:
    """Return minus the slope of the force on the tip (3, 3), N/m, at the end of `tip` (m, 3), m from the start.

    In the device's frame. A body under large displacements is led along the tip's whole way there.
    """
    choice = scenario.object.body
    assert choice is not None
    body = scenario_body(scenario)
    turn = Rotation.from_euler("xyz", choice.turn).as_matrix()
    way = (tip - np.array(scenario.object.position)) @ turn + origin_of(choice, body)
    outward = [0.0, 0.0, 1.0] if choice.tip == "flat" else None

    def force(place: Array) -> Array:
        if not large:
            body.core.reset()
        return np.array(body.simulate_path(place[None], choice.radius, outward=outward, tip=choice.tip).force[0])

    large = isinstance(body.core, _core.HyperelasticBody)
    if large:
        body.core.reset()
        body.simulate_path(way, choice.radius, outward=outward, tip=choice.tip)
    columns = [(force(way[-1] - step) - force(way[-1] + step)) / (2 * _STEP) for step in _STEP * np.eye(3)]
    own = np.stack(columns, axis=1)
    return np.asarray(turn @ (0.5 * (own + own.T)) @ turn.T)
