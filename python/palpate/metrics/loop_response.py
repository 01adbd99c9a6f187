"""What a hand feels of a sampled loop, over frequency: exact for the oscillation that the hand imposes.

The hand's force moves a continuous device; samples of that motion go through object and controller, are held, delayed,
and act back. Of the staircase that acts back, the part at the hand's own frequency counts:
(1 - e^{-j w T})/(j w T) times the samples' amplitude. Nothing else is left out, so below half the sampling rate

    q* = (I - z^-n R(z) Y(z))^-1 G(jw) J^T F,     x = J G(jw) (J^T F + H(jw) z^-n Y(z) q*),     z = e^{jwT},

with G the device from torque to joint motion, R the same behind the hold, and Y = J^T C(z) (K + B v(z)) J + turning.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.linear.linearization import static_tip_force
from palpate.linear.sampled_loop import sampled_plants
from palpate.scenario import Scenario
from palpate.simulation.controllers import build_controller

__all__ = ["LoopResponse", "arm_stiffness", "hold_response"]

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def hold_response(frequency: ArrayLike, period: float) -> Complex:
    """Return H(jw) = (1 - e^{-jwT})/(jwT) of a zero-order hold, (k,); frequency in Hz, period in s."""
    turn = np.asarray(frequency, dtype=float) * period
    return np.asarray(np.sinc(turn) * np.exp(-1j * np.pi * turn), dtype=complex)


def arm_stiffness(arm: HumanArm, frequency: ArrayLike) -> Complex:
    """Return the force per motion of a hand at its grip at each frequency (Hz), (k,), N/m, fingertip included."""
    w = 2 * np.pi * np.asarray(frequency, dtype=float)
    bone = arm.stiffness + 1j * w * arm.damping - w**2 * arm.mass
    if arm.tissue_stiffness is None:
        return np.asarray(bone, dtype=complex)
    tissue = arm.tissue_stiffness + 1j * w * arm.tissue_damping
    return np.asarray(tissue * bone / (tissue + bone), dtype=complex)


@dataclass(frozen=True)
class LoopResponse:
    """A device at rest in a pose, an object, and the servo between them; nobody holds the tip.

    Attributes:
        device: the arm or slider.
        pose: (dof,), rad.
        law: the controller.
        period: T, s.
        delay: n, samples.
        stiffness: K (3, 3), N/m, of the object; damping: B (3, 3), N s/m.
        coupling: how the damper is sampled, "backward" or "bilinear".
        gravity_compensation: whether a constant force of the motors carries the weight.
    """

    device: Device
    pose: Array
    law: Controller
    period: float
    delay: int
    stiffness: Array
    damping: Array
    coupling: str = "backward"
    gravity_compensation: bool = True

    @classmethod
    def of(cls, scenario: Scenario) -> LoopResponse:
        """Return the loop of a scenario at its start; a wall is taken as touched.

        Raises:
            StabilityError: it touches no spring or wall, or its device is the identified model, which has no motion
                between samples.
            ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
        """
        o = scenario.object
        if o.stiffness is None:
            raise StabilityError(f'object.kind: nothing to feel in "{o.kind}"; give a spring or a wall')
        if scenario.device.model == "experimental":
            raise StabilityError('device.model: "experimental" knows no motion between samples; use "nonlinear"')
        device = scenario.load_device()
        start = scenario.start
        pose = device.inverse(start.tip) if start.tip is not None else np.array(start.pose, dtype=float)
        if o.kind == "wall":
            normal = np.array(o.normal)
            k, b = (float(values[0]) * np.outer(normal, normal) for values in (o.stiffness, o.damping))
        else:
            k, b = np.diag(o.stiffness), np.diag(o.damping)
        law = build_controller(scenario, device, pose)
        return cls(
            device,
            pose,
            law,
            scenario.period,
            scenario.device.delay,
            k,
            b,
            o.coupling,
            scenario.servo.gravity_compensation,
        )

    def directions(self) -> Array:
        """Return unit vectors (r, 3) along which the object is felt and the device moves."""
        reach = np.linalg.norm(self.device.jacobian(self.pose), axis=1)
        stiff = np.diag(self.stiffness) + np.diag(self.damping)
        if np.count_nonzero(self.stiffness - np.diag(np.diag(self.stiffness))):
            values, vectors = np.linalg.eigh(self.stiffness + self.damping)
            return np.asarray(vectors[:, [int(np.argmax(values))]].T, dtype=float)
        return np.asarray(np.eye(3)[(stiff > 0) & (reach > 1e-9 * reach.max())], dtype=float)

    def displacement(self, frequency: ArrayLike, object_on: bool = True) -> Complex:
        """Return the tip's motion per force of the hand, (k, 3, 3), m/N.

        Args:
            frequency: (k,), Hz, above 0 and below half the sampling rate.
            object_on: False: of the device alone, held against gravity.

        Raises:
            StabilityError: a frequency out of that range.
        """
        f = self._frequencies(frequency)
        moved, sampled, law = self._device(f), self._sampled(f), self._law(f, object_on)
        jacobian, late = self.device.jacobian(self.pose), self._late(f)
        pushed = moved @ jacobian.T
        samples = np.linalg.solve(np.eye(self.device.dof) - late * sampled @ law, pushed)
        back = hold_response(f, self.period)[:, None, None] * late * law @ samples
        return np.asarray(jacobian @ (pushed + moved @ back), dtype=complex)

    def reference(self, frequency: ArrayLike) -> Complex:
        """Return the object's force per reference force of a force-tracking loop, sampled, (k, 3, 3), N/N.

        Raises:
            StabilityError: as ``displacement``.
        """
        f = self._frequencies(frequency)
        z = np.exp(2j * np.pi * f * self.period)
        jacobian, late = self.device.jacobian(self.pose), self._late(f)
        s = self.law.system
        forward = _response(s.A, s.B[:, :3], s.C, s.D[:, :3], z)
        sampled = self._sampled(f)
        driven = late * sampled @ (jacobian.T @ forward)
        moved = np.linalg.solve(np.eye(self.device.dof) - late * sampled @ self._law(f, True), driven)
        return np.asarray(self._object(z) @ (jacobian @ moved), dtype=complex)

    def transmitted(self, frequency: ArrayLike, arm: HumanArm, along: ArrayLike) -> Complex:
        """Return the force on a hand per commanded tip force, both along one direction, (k,), N/N.

        What the device's mass and the hold let through; the object is off.

        Raises:
            StabilityError: as ``displacement``.
        """
        f = self._frequencies(frequency)
        n = np.asarray(along, dtype=float)
        jacobian = self.device.jacobian(self.pose)
        free = jacobian @ self._device(f) @ jacobian.T
        hand = arm_stiffness(arm, f)[:, None, None] * np.eye(3)
        felt = hand @ np.linalg.solve(np.eye(3) + free @ hand, free)
        return np.asarray(hold_response(f, self.period) * (n @ felt @ n), dtype=complex)

    def _frequencies(self, frequency: ArrayLike) -> Array:
        f = np.atleast_1d(np.asarray(frequency, dtype=float))
        if not np.all((f > 0) & (f < 0.5 / self.period)):
            raise StabilityError(
                f"frequencies must lie above 0 and below half the sampling rate, {0.5 / self.period:g} Hz"
            )
        return f

    def _geometric_stiffness(self) -> Array:
        """Return how the torque of the motors' hold turns with the pose, (dof, dof), N m/rad."""
        if not self.gravity_compensation:
            return np.zeros((self.device.dof, self.device.dof))
        force = static_tip_force(self.device.jacobian(self.pose), self.device.gravity(self.pose))
        return np.asarray(np.einsum("k,kij->ij", force, self.device.tip_hessian(self.pose)), dtype=float)

    def _device(self, f: Array) -> Complex:
        """Return G(jw), joint motion per torque (k, dof, dof)."""
        w = (2 * np.pi * f)[:, None, None]
        a_q, a_v, a_t = self.device.linearization(self.pose, np.zeros(self.device.dof), self.device.gravity(self.pose))
        return np.asarray(np.linalg.solve(-(w**2) * np.eye(len(a_q)) - 1j * w * a_v - a_q, a_t.astype(complex)))

    def _sampled(self, f: Array) -> Complex:
        """Return R(z), sampled joint motion per held torque (k, dof, dof)."""
        a, b, c = (m[0] for m in sampled_plants(self.device, self.pose[None], None, np.zeros(3), self.period))
        return _response(a, b, c, np.zeros((len(c), b.shape[1])), np.exp(2j * np.pi * f * self.period))

    def _object(self, z: Complex) -> Complex:
        """Return the object's force per motion, (k, 3, 3), N/m."""
        rate = 2 * (z - 1) / (z + 1) if self.coupling == "bilinear" else 1 - 1 / z
        return np.asarray(self.stiffness + rate[:, None, None] / self.period * self.damping, dtype=complex)

    def _law(self, f: Array, object_on: bool) -> Complex:
        """Return Y(z), torque per joint motion (k, dof, dof), before the delay."""
        z = np.exp(2j * np.pi * f * self.period)
        geometric_stiffness = np.broadcast_to(
            self._geometric_stiffness().astype(complex), (len(z), self.device.dof, self.device.dof)
        )
        if not object_on:
            return geometric_stiffness
        feedback, jacobian = self.law.feedback, self.device.jacobian(self.pose)
        command = _response(feedback.A, feedback.B, feedback.C, feedback.D, z) @ self._object(z)
        return np.asarray(jacobian.T @ command @ jacobian + geometric_stiffness, dtype=complex)

    def _late(self, f: Array) -> Complex:
        return np.asarray(np.exp(-2j * np.pi * f * self.period * self.delay)[:, None, None], dtype=complex)


def _response(a: Array, b: Array, c: Array, d: Array, z: Complex) -> Complex:
    """Return C (z - A)^-1 B + D at each z, (k, outputs, inputs)."""
    direct = np.broadcast_to(d.astype(complex), (len(z), *d.shape))
    if not len(a):
        return direct
    matrix = z[:, None, None] * np.eye(len(a)) - a
    return np.asarray(c @ np.linalg.solve(matrix, np.broadcast_to(b.astype(complex), (len(z), *b.shape))) + direct)
