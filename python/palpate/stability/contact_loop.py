"""Stability of a contact with a deformable body, linearized where the tip rests."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import control
import numpy as np

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.controller_forms import as_linear_controller
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation.body_response.held_tip import HeldTip
from palpate.simulation.body_response.multirate import MultirateResponse, multirate_response
from palpate.simulation.body_response.response import BodyResponse, body_response
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_contact import NORMALIZES
from palpate.simulation.linear_loop import ScenarioLoop, require_linear_parts, scenario_loop
from palpate.simulation.simulator import simulate
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.stability.body.body_loop import BodyLoop, stiffness_margin, unstable_poles
from palpate.stability.body.multirate_loop import MultirateLoop
from palpate.stability.criteria import check_stability

__all__ = ["ContactStability", "contact_at", "contact_stability", "device_loop", "every_tick", "judge"]

_TABLES = 26  # states of the closed loop up to which Jury's, Routh's and Lyapunov's tests are computed


@dataclass(frozen=True)
class ContactStability:
    """Stability of the loop about one contact with a body.

    The loop includes the body's own states: modes, creep, masses and springs, friction that sticks. With friction it is
    tested in all directions in which the device moves. Otherwise it is tested along the force of the contact: a tip
    without friction meets no stiffness across it. `certify` tests the rest of a run across it too if an arm holds the
    tip.

    Attributes:
        normal: unit vector out of the body, against the force of the tip, (3,), device frame.
        depth: of the tip below the surface at rest, along `normal`, m; nan if unknown.
        nodes: number of nodes in contact.
        static_stiffness: force under a lasting displacement of the tip, along `normal`, N/m.
        one_tick_stiffness: force within the tick of a displacement, along `normal`, N/m. Inertia and creep make it
            larger than the static stiffness.
        radius: largest modulus of the sampled loop's eigenvalues.
        criteria: verdict of each criterion on its own: "eigenvalues" of the loop with the body's states, and "Nyquist"
            of the body's measured impulse response. With at most 26 states also "Jury", "Routh" and "Lyapunov". A
            hyperelastic body has no "Nyquist": its loop is the map over one update of its model.
        doubt: error of the body's response times the loop's largest gain; below 1 it changes no verdict.
        stiffness_margin: factor on the force of the body at which the loop oscillates; inf: none up to 10,000; nan: it
            is unstable. Without friction it is that of motions along `normal`.
        slide_margin: the same at which the loop becomes unstable in any direction, without friction: the force, larger
            at the same depth, turns with the contact and pushes the tip aside. inf where motions across are not tested.
        loop: the loop that was tested.
    """

    normal: Array
    depth: float
    nodes: int
    static_stiffness: float
    one_tick_stiffness: float
    radius: float
    criteria: Mapping[str, bool]
    doubt: float
    stiffness_margin: float
    loop: BodyLoop | MultirateLoop = field(repr=False)
    slide_margin: float = float("inf")

    @property
    def state(self) -> State:
        """STABLE, UNSTABLE, or UNDECIDED if the criteria disagree or the doubt is 1: of small motions here."""
        if len(set(self.criteria.values())) > 1 or not self.doubt < 1.0 or abs(self.radius - 1.0) < 1e-9:
            return State.UNDECIDED
        return State.STABLE if self.criteria["eigenvalues"] else State.UNSTABLE

    @property
    def stable(self) -> bool:
        """Whether small motions about this contact decay."""
        return self.state is State.STABLE

    @property
    def critical_stiffness(self) -> float:
        """Static stiffness at which the loop oscillates, N/m, if the whole response of the body is scaled."""
        return self.static_stiffness * self.stiffness_margin


def contact_stability(trace: Trace, row: int = -1, *, controller: Any = None) -> ContactStability:
    """Return the stability of a contact with a body, linearized at sample `row` of a trace.

    The tip is held where it is at that sample until the body rests, and the body's response to small displacements is
    measured in the core's own model. Limits and encoder counts are neglected.

    Args:
        trace: a run on a body whose tip is in contact at `row`.
        row: index of the sample.
        controller: the linear controller of the run, if it was not the scenario's.

    Raises:
        StabilityError: the scenario has no body, the tip is not in contact at that sample, or the body's response to a
            displacement of the tip does not decay.
    """
    if not isinstance(trace, Trace):
        raise StabilityError(f"contact_stability takes the trace of a run, as simulate returns it, not {trace!r:.80}")
    scenario = Scenario.from_dict(trace.scenario)
    if scenario.object.body is None:
        raise StabilityError("contact_stability needs a scenario with a body; use certify for springs and walls")
    require_linear_parts(scenario)
    law = None if controller is None else as_linear_controller(controller, scenario.period)
    at = row % len(trace)
    every = scenario.run.record_every
    if every > 1:
        trace, at = every_tick(scenario, law), at * every
    return contact_at(scenario, trace, at, law, along_normal=True)


def every_tick(scenario: Scenario, controller: Controller | None) -> Trace:
    """Return the trace of a run with every tick recorded."""
    run = {**scenario.to_dict().get("run", {}), "record_every": 1}
    return simulate(Scenario.from_dict({**scenario.to_dict(), "run": run}), controller)


def contact_at(
    scenario: Scenario,
    trace: Trace,
    row: int,
    controller: Controller | None = None,
    *,
    along_normal: bool = False,
    equilibrium: bool = False,
) -> ContactStability:
    """Return the stability of a contact as `contact_stability`, of a trace with every tick recorded.

    Args:
        scenario: its object is a body.
        trace: a run of it.
        row: index of the sample.
        controller: instead of the scenario's.
        along_normal: test motions along the force of the contact only, unless the contact resists others
            (`HeldTip.holds_across`).
        equilibrium: of a hyperelastic body, as for `HeldTip`.
    """
    if not trace["touching"][row, 0]:
        raise StabilityError(
            f"the tip is not in contact with the body at t = {trace.time[row]:g} s; choose a sample in contact"
        )
    held = HeldTip(scenario, trace["tip"][: row + 1] - trace["tip"][0], equilibrium=equilibrium)
    response = multirate_response(held) if held.multirate else body_response(held)
    normal = held.frame[:, 0]
    across = held.holds_across or (scenario.operator.kind == "arm" and not along_normal)
    device = device_loop(scenario, trace, row, normal, across, controller)
    depth = -float(trace["deflection"][row] @ normal)
    loop = loop_around(device.path, device.directions, response)
    alone = loop
    if len(loop.normal) > 1 and not held.holds_across:
        alone = loop.along_normal(device_loop(scenario, trace, row, normal, False, controller).path)
        if loop.radius() < 1.0:
            return replace(judge(loop, alone, response, depth), slide_margin=stiffness_margin(loop.radius))
    return judge(loop, alone, response, depth)


def device_loop(
    scenario: Scenario,
    trace: Trace,
    row: int,
    normal: Array,
    across: bool,
    controller: Controller | None = None,
    arm: HumanArm | None = None,
) -> ScenarioLoop:
    """Return the loop of a scenario about one sample, as around a spring; its `path` ends at the body.

    Args:
        scenario: its object is a body.
        trace: a run of it.
        row: index of the sample.
        normal: of the contact (3,).
        across: whether the path is in all directions in which the device moves, or along `normal` only.
        controller: instead of the scenario's.
        arm: instead of the scenario's operator.
    """
    device = scenario.load_device()
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    law = build_controller(scenario, device, start) if controller is None else controller
    if law.design_stiffness is not None:
        raise StabilityError(f"controller.normalize: {NORMALIZES}")
    placeholder: dict[str, Any] = {"kind": "spring", "stiffness": ["1 N/m"] * 3}
    if not across:
        placeholder = {"kind": "wall", "stiffness": "1 N/m", "normal": normal.tolist()}
    return scenario_loop(
        Scenario.from_dict({**scenario.to_dict(), "object": placeholder}),
        pose=trace["angle"][row],
        tip_force=trace["command_force"][row],
        operator_force=trace["operator_force"][row] if arm is None else np.zeros(3),
        arm=arm,
        controller=law,
    )


def loop_around(
    path: control.StateSpace, directions: Array, response: BodyResponse | MultirateResponse
) -> BodyLoop | MultirateLoop:
    """Return the loop around a response, along the `directions` (3, r) of the device's path, or of several devices."""
    n = response.frame.T @ directions  # directions in the axes of the contact (3, r)
    whole = n.shape[0] == n.shape[1]
    axes, error = (n.T, response.error) if whole else (np.eye(n.shape[1]), np.abs(n).T @ response.error @ np.abs(n))
    if isinstance(response, MultirateResponse):
        local, correction = n.T @ response.local @ n, n.T @ response.correction @ n
        return MultirateLoop(path, local, correction, response.every, axes, n[0], error)
    s = response.system
    body = control.StateSpace(s.A, s.B @ n, n.T @ s.C, n.T @ s.D @ n, s.dt)
    return BodyLoop(path, body, n.T @ response.markov @ n, axes, n[0], error)


def judge(
    loop: BodyLoop | MultirateLoop,
    scaled: BodyLoop | MultirateLoop,
    response: BodyResponse | MultirateResponse,
    depth: float,
) -> ContactStability:
    """Return the stability of a loop around the response of a body.

    Args:
        loop: about one contact.
        scaled: loop in which the force of the body is scaled for the margin.
        response: of the body there.
        depth: of the tip, m.
    """
    matrix = loop.matrix()
    if len(matrix) <= _TABLES:
        radius, criteria = check_stability(matrix)
    else:
        radius = float(np.abs(np.linalg.eigvals(matrix)).max())
        criteria = {"eigenvalues": radius < 1.0}
    margin = stiffness_margin(scaled.radius) if radius < 1.0 and scaled.radius() < 1.0 else float("nan")
    if isinstance(loop, MultirateLoop):
        radius **= 1.0 / loop.every
    else:
        criteria["Nyquist"] = unstable_poles(loop) == 0
    return ContactStability(
        response.frame[:, 0],
        depth,
        response.nodes,
        float(response.static[0, 0]),
        float(response.one_tick[0, 0]),
        radius,
        criteria,
        loop.doubt(),
        margin,
        loop,
    )
