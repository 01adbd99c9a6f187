"""Frequency response of a loop on a deformable body, about the contact where its run rests."""

from __future__ import annotations

from dataclasses import dataclass, field

import control
import numpy as np

from palpate.arrays import Array, Complex
from palpate.errors import StabilityError
from palpate.metrics.loop_response import LoopResponse, rigid_device
from palpate.scenario import Scenario
from palpate.simulation.body_response import BodyResponse, HeldTip, MultirateResponse, body_response, multirate_response
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_contact import NORMALIZES
from palpate.simulation.observed_run import observe

__all__ = ["BodyLoopResponse", "body_loop_response"]

MOST_LEFT = 0.02  # of the static stiffness: gain of what the measured response leaves out


@dataclass(frozen=True)
class BodyLoopResponse(LoopResponse):
    """A loop on a body, with the body's own states; `stiffness` is its static stiffness along the contact's normal.

    Attributes:
        body: displacement of the tip (3,), m, to the force on the body (3,), N, sampled. Of a hyperelastic body it is
            the static one, which the force reaches within some updates.
    """

    body: control.StateSpace = field(kw_only=True)

    def desired(self, frequency: Array) -> Complex:
        """Return the dynamic stiffness of the body, sampled (k, 3, 3), N/m; frequency in Hz."""
        return self._object(np.exp(2j * np.pi * frequency * self.period))

    def _object(self, z: Complex) -> Complex:
        b = self.body
        direct = np.broadcast_to(b.D.astype(complex), (len(z), 3, 3))
        if b.nstates == 0:
            return direct
        right = np.broadcast_to(b.B.astype(complex), (len(z), *b.B.shape))
        return np.asarray(b.C @ np.linalg.solve(z[:, None, None] * np.eye(b.nstates) - b.A, right) + direct)


def body_loop_response(scenario: Scenario) -> BodyLoopResponse:
    """Return the loop of a scenario on a body, where its run rests.

    Raises:
        StabilityError: the tip bounces or is off the body at the end of the run. The body's response does not decay, or
            is not known to 2 %. The device has a flexible mode, or is the identified model.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    device = rigid_device(scenario)
    if scenario.controller.normalizes:
        raise StabilityError(f"controller.normalize: {NORMALIZES}")
    run = observe(scenario)
    if not run.lasts:
        found = run.sentence[0].lower() + run.sentence[1:].rstrip(".")
        raise StabilityError(
            f"object: the performance is that of a contact that lasts, and this one does not: {found}; move "
            "the body (object.position), press more gently, or press longer (run.duration)"
        )
    held = HeldTip(scenario, run.trace["tip"][: run.held + 1] - run.trace["tip"][0])
    response: BodyResponse | MultirateResponse
    if held.multirate:
        response, none = multirate_response(held), np.zeros((0, 3))
        system = control.StateSpace(np.zeros((0, 0)), none, none.T, response.static, scenario.period)
    else:
        response = body_response(held)
        system = response.system
        left, stiffness = float(response.error[0, 0]), abs(float(response.static[0, 0]))
        if not left <= MOST_LEFT * stiffness:
            raise StabilityError(
                f"object.body: its response to small motions of the tip is known to {left:.2g} N/m only, of "
                f"{stiffness:.3g} N/m: too little to measure; give more damping (rayleigh_beta), another tip, or a "
                "retardation_time that is short against the run"
            )
    frame, normal = held.frame, held.frame[:, 0]
    system = control.StateSpace(system.A, system.B @ frame.T, frame @ system.C, frame @ system.D @ frame.T, system.dt)
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    return BodyLoopResponse(
        device,
        run.trace["angle"][run.held],
        build_controller(scenario, device, start),
        scenario.period,
        scenario.device.delay,
        float(response.static[0, 0]) * np.outer(normal, normal),
        np.zeros((3, 3)),
        "none",
        scenario.servo.gravity_compensation,
        body=system,
        normal=normal,
    )
