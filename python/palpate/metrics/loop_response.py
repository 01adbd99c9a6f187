"""Frequency response of a sampled loop to the operator's force, exact at the frequency of the excitation.

The operator's force moves a continuous device. Samples of that motion pass through object and controller, are held and
delayed, and act back. The component of the held force at the excitation frequency is (1 - e^{-j w T})/(j w T) times the
amplitude of the samples. Below half the sampling rate

    q* = (I - z^-n R(z) Y(z))^-1 G(jw) J^T F,     x = J G(jw) (J^T F + H(jw) z^-n Y(z) q*),     z = e^{jwT},

with G the device from torque to joint motion, R the same behind the hold, and Y = J^T C(z) (K + B v(z)) J plus the
geometric stiffness.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Complex
from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.linear.linearization import static_tip_force
from palpate.linear.sampled_loop import sampled_plants
from palpate.scenario import Object, Scenario
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_loop import controlled_object, require_linear_parts
from palpate.simulation.trace import Trace
from palpate.units import write

__all__ = ["LoopResponse", "arm_stiffness", "hold_response"]


def hold_response(frequency: ArrayLike, period: float) -> Complex:
    """Return H(jw) = (1 - e^{-jwT})/(jwT) of a zero-order hold, (k,); frequency in Hz, period in s."""
    cycles = np.asarray(frequency, dtype=float) * period
    return np.asarray(np.sinc(cycles) * np.exp(-1j * np.pi * cycles), dtype=complex)


def arm_stiffness(arm: HumanArm, frequency: ArrayLike) -> Complex:
    """Return the dynamic stiffness of an arm at the grip (k,), N/m, fingertip included; frequency in Hz."""
    w = 2 * np.pi * np.asarray(frequency, dtype=float)
    skeleton = arm.stiffness + 1j * w * arm.damping - w**2 * arm.mass
    if arm.tissue_stiffness is None:
        return np.asarray(skeleton, dtype=complex)
    tissue = arm.tissue_stiffness + 1j * w * arm.tissue_damping
    return np.asarray(tissue * skeleton / (tissue + skeleton), dtype=complex)


def rigid_device(scenario: Scenario) -> Device:
    """Return the device of a scenario, whose frequency responses are those of a rigid one; raise StabilityError."""
    device = scenario.load_device()
    if device.flexible is not None:
        raise StabilityError(
            "device.rigid: the performance is that of a rigid device, and this one has a flexible mode: write rigid = "
            "true to measure it without, or run the scenario, which has the mode"
        )
    if scenario.device.model == "experimental":
        raise StabilityError('device.model: "experimental" has no motion between samples; use "nonlinear"')
    return device


def _acting(o: Object, values: Array) -> Array:
    """Return the matrix (3, 3) of stiffnesses or dampings per axis (3,) of an object; a wall acts along its normal."""
    if o.normal is None or o.kind not in ("wall", "textured_wall"):
        return np.diag(values)
    normal = np.array(o.normal)
    along = float(values[0]) if np.ptp(values) == 0.0 else float(normal**2 @ values)
    return along * np.outer(normal, normal)


@dataclass(frozen=True)
class LoopResponse:
    """A device at rest in a pose, an object, and the servo between them, without operator.

    Attributes:
        device: the arm or slider.
        pose: (dof,), rad.
        controller: the controller.
        period: T, s.
        delay: n, samples.
        stiffness: K (3, 3), N/m, of the object as the controller sees it; damping: B (3, 3), N s/m.
        coupling: how the damper is sampled, "backward" or "bilinear"; "none": there is no damper.
        gravity_compensation: whether a constant force of the motors carries the weight.
        normal: the only direction to measure (3,); None: each in which the object acts.
        own: K and B of the object itself, which a controller that divides by the stiffness sees scaled; None: as above.
    """

    device: Device
    pose: Array
    controller: Controller
    period: float
    delay: int
    stiffness: Array
    damping: Array
    coupling: str = "backward"
    gravity_compensation: bool = True
    normal: Array | None = None
    own: tuple[Array, Array] | None = None

    @classmethod
    def of(cls, scenario: Scenario, controller: Controller | None = None) -> LoopResponse:
        """Return the loop of a scenario at its start, in contact with the object; with another controller if given.

        Raises:
            StabilityError: the object is no spring or wall, the loop has a guard, or the device has a flexible mode or
                is the identified model, which has no motion between samples.
            ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
        """
        require_linear_parts(scenario)
        o = scenario.object
        if o.stiffness is None:
            raise StabilityError(f'object.kind: "{o.kind}" has no stiffness; give a spring or a wall')
        device = rigid_device(scenario)
        start = scenario.start
        pose = device.inverse(start.tip) if start.tip is not None else np.array(start.pose, dtype=float)
        law = build_controller(scenario, device, pose) if controller is None else controller
        k, b = (_acting(o, one) for one in controlled_object(scenario, law))
        own = _acting(o, np.asarray(o.stiffness, dtype=float)), _acting(o, np.asarray(o.damping, dtype=float))
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
            own=own,
        )

    @classmethod
    def on_mesh(cls, scenario: Scenario, trace: Trace) -> LoopResponse:
        """Return the loop of a scenario along the normal of its last contact with a mesh in a run.

        Friction is taken to stick there: the spring between tip and proxy acts along the surface too.

        Raises:
            StabilityError: the tip never touches the mesh in the run, or the device has a flexible mode or is the
                identified model.
        """
        touching = np.flatnonzero(trace["touching"][:, 0] > 0.0)
        if touching.size == 0:
            raise StabilityError(
                "object: the tip never touches the mesh in this run; move the mesh (object.position) or press longer "
                "(run.duration)"
            )
        row = int(touching[-1])
        surface = scenario.object.surface
        assert surface is not None
        stiffness = write(float(trace["surface_stiffness"][row, 0]), "N/m")
        damping = write(surface.damping, "N*s/m")
        wall = {"kind": "wall", "stiffness": stiffness, "damping": damping, "normal": trace["normal"][row].tolist()}
        device = scenario.load_device()
        start = scenario.start
        designed_at = device.inverse(start.tip) if start.tip is not None else np.array(start.pose, dtype=float)
        at_wall = cls.of(
            Scenario.from_dict({**scenario.to_dict(), "object": wall}), build_controller(scenario, device, designed_at)
        )
        normal, across = trace["normal"][row], 0.0
        if float(surface.static_friction) > 0.0:
            across = float(trace["surface_stiffness"][row, 0]) if surface.tangential is None else surface.tangential
        along_surface = across * (np.eye(3) - np.outer(normal, normal))
        assert at_wall.own is not None
        own, damper = at_wall.own
        seen = float(normal @ at_wall.stiffness @ normal) / max(float(normal @ own @ normal), 1e-300)
        return replace(
            at_wall,
            pose=np.asarray(trace["angle"][row], dtype=float),
            stiffness=at_wall.stiffness + seen * along_surface,
            normal=normal,
            own=(own + along_surface, damper),
        )

    def directions(self) -> Array:
        """Return unit vectors (r, 3) along which the object acts and the device moves."""
        if self.normal is not None:
            return self.normal[None]
        reach = np.linalg.norm(self.device.jacobian(self.pose), axis=1)
        stiff = np.diag(self.stiffness) + np.diag(self.damping)
        if np.count_nonzero(self.stiffness - np.diag(np.diag(self.stiffness))):
            values, vectors = np.linalg.eigh(self.stiffness + self.damping)
            return np.asarray(vectors[:, [int(np.argmax(values))]].T, dtype=float)
        return np.asarray(np.eye(3)[(stiff > 0) & (reach > 1e-9 * reach.max())], dtype=float)

    def desired(self, frequency: Array) -> Complex:
        """Return the dynamic stiffness of the object (k, 3, 3), N/m; frequency in Hz."""
        w = (2 * np.pi * frequency)[:, None, None]
        stiffness, damping = (self.stiffness, self.damping) if self.own is None else self.own
        return np.asarray(stiffness + 1j * w * damping, dtype=complex)

    def displacement(self, frequency: ArrayLike, object_on: bool = True) -> Complex:
        """Return tip motion per force of the operator, (k, 3, 3), m/N.

        Args:
            frequency: (k,), Hz, above 0 and below half the sampling rate.
            object_on: include the object; False: the device alone, with gravity compensation.

        Raises:
            StabilityError: a frequency is out of that range.
        """
        f = self._frequencies(frequency)
        compliance, sampled, law = self._device(f), self._sampled(f), self._law(f, object_on)
        jacobian, delayed = self.device.jacobian(self.pose), self._delay_factor(f)
        forced = compliance @ jacobian.T
        samples = np.linalg.solve(np.eye(self.device.dof) - delayed * sampled @ law, forced)
        back = hold_response(f, self.period)[:, None, None] * delayed * law @ samples
        return np.asarray(jacobian @ (forced + compliance @ back), dtype=complex)

    def reference(self, frequency: ArrayLike, arm: HumanArm | None = None) -> Complex:
        """Return the object's force per reference force of a force-tracking loop, sampled, (k, 3, 3), N/N.

        Args:
            frequency: as for ``displacement``.
            arm: operator at the tip; None: no operator.

        Raises:
            StabilityError: as ``displacement``.
        """
        f = self._frequencies(frequency)
        z = np.exp(2j * np.pi * f * self.period)
        jacobian, delayed = self.device.jacobian(self.pose), self._delay_factor(f)
        s = self.controller.system
        forward = _response(s.A, s.B[:, :3], s.C, s.D[:, :3], z)
        sampled = self._sampled(f, arm)
        driven = delayed * sampled @ (jacobian.T @ forward)
        compliance = np.linalg.solve(np.eye(self.device.dof) - delayed * sampled @ self._law(f, True), driven)
        return np.asarray(self._object(z) @ (jacobian @ compliance), dtype=complex)

    def transmitted(self, frequency: ArrayLike, arm: HumanArm, along: ArrayLike) -> Complex:
        """Return the force on an arm per commanded tip force, both along one direction, (k,), N/N.

        The response includes the inertia of the device and the hold; the object is off.

        Raises:
            StabilityError: as ``displacement``.
        """
        f = self._frequencies(frequency)
        n = np.asarray(along, dtype=float)
        jacobian = self.device.jacobian(self.pose)
        free = jacobian @ self._device(f) @ jacobian.T
        hand = arm_stiffness(arm, f)[:, None, None] * np.eye(3)
        transmitted = hand @ np.linalg.solve(np.eye(3) + free @ hand, free)
        return np.asarray(hold_response(f, self.period) * (n @ transmitted @ n), dtype=complex)

    def _frequencies(self, frequency: ArrayLike) -> Array:
        f = np.atleast_1d(np.asarray(frequency, dtype=float))
        if not np.all((f > 0) & (f < 0.5 / self.period)):
            raise StabilityError(
                f"frequencies must lie above 0 and below half the sampling rate, {0.5 / self.period:g} Hz"
            )
        return f

    def _geometric_stiffness(self) -> Array:
        """Return the derivative of the gravity compensation torque by the pose, (dof, dof), N m/rad."""
        if not self.gravity_compensation:
            return np.zeros((self.device.dof, self.device.dof))
        force = static_tip_force(self.device.jacobian(self.pose), self.device.gravity(self.pose))
        return np.asarray(np.einsum("k,kij->ij", force, self.device.tip_hessian(self.pose)), dtype=float)

    def _device(self, f: Array) -> Complex:
        """Return G(jw), joint motion per torque, (k, dof, dof)."""
        w = (2 * np.pi * f)[:, None, None]
        a_q, a_v, a_t = self.device.linearization(self.pose, np.zeros(self.device.dof), self.device.gravity(self.pose))
        return np.asarray(np.linalg.solve(-(w**2) * np.eye(len(a_q)) - 1j * w * a_v - a_q, a_t.astype(complex)))

    def _sampled(self, f: Array, arm: HumanArm | None = None) -> Complex:
        """Return R(z), sampled joint motion per held torque (k, dof, dof), with an operator's arm if given."""
        a, b, c = (m[0] for m in sampled_plants(self.device, self.pose[None], arm, np.zeros(3), self.period))
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
        feedback, jacobian = self.controller.feedback, self.device.jacobian(self.pose)
        command = _response(feedback.A, feedback.B, feedback.C, feedback.D, z) @ self._object(z)
        return np.asarray(jacobian.T @ command @ jacobian + geometric_stiffness, dtype=complex)

    def _delay_factor(self, f: Array) -> Complex:
        return np.asarray(np.exp(-2j * np.pi * f * self.period * self.delay)[:, None, None], dtype=complex)


def _response(a: Array, b: Array, c: Array, d: Array, z: Complex) -> Complex:
    """Return C (z - A)^-1 B + D at each z, (k, outputs, inputs)."""
    direct = np.broadcast_to(d.astype(complex), (len(z), *d.shape))
    if not len(a):
        return direct
    matrix = z[:, None, None] * np.eye(len(a)) - a
    return np.asarray(c @ np.linalg.solve(matrix, np.broadcast_to(b.astype(complex), (len(z), *b.shape))) + direct)
