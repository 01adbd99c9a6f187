"""The servo loop of a scenario, linear about a pose and sampled as it runs: hold, delay, coupling, controller, hand.

Everything the servo computes from samples stays sampled, the turning of the hold's torque with the pose included; all
that moves between samples (device, gravity, the operator's arm) is continuous behind the hold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from palpate.control.build import build_controller
from palpate.control.controller import Controller
from palpate.design.loop import closed_loop_matrix, spectral_radius
from palpate.design.virtual_coupling import virtual_coupling
from palpate.devices import Device
from palpate.loop.plant import sampled_plant
from palpate.scenario import Scenario
from palpate.stability.checks import StabilityError
from palpate.stability.tip import Arm, in_hand

__all__ = ["ScenarioLoop", "assembled", "felt", "held_plants", "scenario_arm", "scenario_loop"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ScenarioLoop:
    """A scenario's loop about one pose.

    Attributes:
        path: from the force on the object, as the controller sees it (r, N), to the deflection (r, m), r directions.
        directions: (3, r), orthonormal: those along which the object is felt and the device can move.
        stiffness: K (r, r), N/m; damping: B (r, r), N s/m.
        coupling: "backward" or "bilinear".
        damping_felt: least damping of the device against tip motion in these directions, N s/m; nan if unknown.
        hidden: number of modes that the object does not feel or the controller does not move.
        rests: whether the device without object and hand rests where it is, rather than tipping over under gravity.
    """

    path: control.StateSpace
    directions: Array
    stiffness: Array
    damping: Array
    coupling: str
    damping_felt: float
    hidden: int
    rests: bool = True

    @property
    def period(self) -> float:
        """T, s."""
        return float(self.path.dt)

    def gain(self, stiffness: ArrayLike | None = None, damping: ArrayLike | None = None) -> control.StateSpace:
        """Return L(z) (r x r), negative feedback understood, broken at the object's force.

        Args:
            stiffness: other K (r, r), or one number for all directions, N/m.
            damping: other B likewise, N s/m.
        """
        r = self.directions.shape[1]
        k = self.stiffness if stiffness is None else np.asarray(stiffness, float) * np.eye(r)
        b = self.damping if damping is None else np.asarray(damping, float) * np.eye(r)
        # the coupling of a unit damper, and the spring beside it
        rule = virtual_coupling(0.0, 1.0, self.period, "bilinear" if self.coupling == "bilinear" else "backward")
        eye, p = np.eye(r), self.path
        av, bv, cv, dv = (np.kron(eye, m) for m in (rule.A, rule.B, rule.C, rule.D))
        direct = k + b @ dv
        a = np.block([[p.A, np.zeros((p.nstates, r))], [bv @ p.C, av]])
        entry = np.vstack([p.B, bv @ p.D])
        out = np.hstack([direct @ p.C, b @ cv])
        return control.StateSpace(a, entry, -out, -direct @ p.D, p.dt)

    def matrix(self, scale: float = 1.0) -> Array:
        """Return the closed loop's matrix with the object's stiffness and damping times ``scale``."""
        return np.asarray(closed_loop_matrix(self.gain(), scale).real, dtype=float)

    def radius(self, stiffness: float | None = None, damping: float | None = None) -> float:
        """Return the largest modulus of the closed loop's eigenvalues, for another K and B if given."""
        return spectral_radius(self.gain(stiffness, damping))


def scenario_loop(
    scenario: Scenario,
    *,
    pose: ArrayLike | None = None,
    tip_force: ArrayLike = (0.0, 0.0, 0.0),
    operator_force: ArrayLike | None = None,
    arm: Arm | None = None,
    controller: Controller | None = None,
) -> ScenarioLoop:
    """Return the loop of ``scenario`` about its start, or about another pose of rest.

    Args:
        pose: (dof,), rad; the start's if not given. Only a nonlinear device has others.
        tip_force: command of the controller at rest there (3,), N, without the hold.
        operator_force: of the hand at rest there (3,), N; the arm's spring at the start if not given.
        arm: holds the tip instead of the scenario's operator.
        controller: instead of the one that the scenario describes.

    Raises:
        StabilityError: nothing is touched, the hand does not let the tip move, or the directions cannot be pushed.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    if scenario.object.kind == "none":
        raise StabilityError("object.kind: nothing is touched, so there is no loop to judge; give a spring or a wall")
    if scenario.object.kind == "mesh":
        raise StabilityError(
            "object.kind: a mesh has no one loop to judge: simulate the run, or judge a wall as stiff as its stiffest "
            "polygon"
        )
    if scenario.object.kind == "body":
        raise StabilityError(
            "object.kind: a body is as stiff as it is pressed: simulate the run, or judge its contact by "
            "palpate.stability.contact_stability(trace)"
        )
    if scenario.operator.kind == "hold" and arm is None:
        raise StabilityError(
            'operator.kind: "hold" keeps the tip still, so nothing can oscillate; give another operator'
        )
    device = scenario.load_device()
    start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
    law = build_controller(scenario, device, start) if controller is None else controller
    frozen = scenario.device.kinematics == "linear"
    at = start if pose is None or scenario.device.model != "nonlinear" else np.asarray(pose, dtype=float)
    hand = arm if arm is not None else scenario_arm(scenario)
    jacobian = device.jacobian(start if frozen else at)
    hold = _hold(scenario, device, start)
    motors = hold if frozen else hold + np.asarray(tip_force, dtype=float)
    turning = np.einsum("k,kij->ij", motors, device.tip_hessian(start if frozen else at))
    plant = _plant(scenario, device, at, start, hand, operator_force)
    directions = _directions(scenario, jacobian)
    r = directions.shape[1]
    k = directions.T @ np.diag(np.asarray(scenario.object.stiffness, float)) @ directions
    b = directions.T @ np.diag(np.asarray(scenario.object.damping, float)) @ directions

    a, entry, out = assembled((plant.A, plant.B, plant.C), jacobian, turning, law, scenario.device.delay)
    small = felt(a, entry, out, directions)
    path = control.StateSpace(*small, np.zeros((r, r)), scenario.period)
    rests = _rests(device, at, turning)
    own = _damping_felt(device, jacobian, directions) if scenario.device.model != "experimental" else float("nan")
    return ScenarioLoop(path, directions, k, b, scenario.object.coupling, own, len(a) - path.nstates, rests)


def scenario_arm(scenario: Scenario) -> Arm | None:
    """Return the arm that holds the tip in a scenario; None: there is none."""
    o = scenario.operator
    if o.kind != "arm":
        return None
    return Arm(o.mass or 0.0, o.damping or 0.0, o.stiffness or 0.0, o.tissue_stiffness, o.tissue_damping or 0.0)


def _hold(scenario: Scenario, device: Device, start: Array) -> Array:
    from palpate.analysis.linearize import hold_force

    if not scenario.servo.gravity_hold:
        return np.zeros(3)
    return hold_force(device.jacobian(start), device.gravity(start))


def _plant(
    scenario: Scenario, device: Device, at: Array, start: Array, arm: Arm | None, operator_force: ArrayLike | None
) -> control.StateSpace:
    """Return the sampled plant from motor torques to joint angles, the hand on it."""
    if scenario.device.model != "nonlinear":
        if arm is not None:
            raise StabilityError('operator: an arm moves with the nonlinear device; write device.model = "nonlinear"')
        p = sampled_plant(scenario.device.model, device, start, scenario.period)
        return control.StateSpace(p.a, p.b, p.c, np.zeros((device.dof, device.dof)), scenario.period)
    # the hand's force turns with the pose as well
    if operator_force is None:
        pull = np.zeros(3)
        if arm is not None and scenario.operator.kind == "arm":
            pull = (arm.stiffness if arm.tissue_stiffness is None else 0.0) * np.array(scenario.operator.rest)
    else:
        pull = np.asarray(operator_force, dtype=float)
    a, b, c = held_plants(device, at[None, :], arm, pull, scenario.period)
    return control.StateSpace(a[0], b[0], c[0], np.zeros((device.dof, device.dof)), scenario.period)


def held_plants(
    device: Device, poses: Array, arm: Arm | None, pull: Array, period: float
) -> tuple[Array, Array, Array]:
    """Return (A, B, C), each (n, ...), of a device at rest in n poses, in a hand: from held torques to joint angles.

    Args:
        device: dof joints.
        poses: (n, dof), rad.
        arm: holds the tip; None: nobody does.
        pull: force of the hand at rest (3,), N; its torque turns with the pose.
        period: of the hold, s.
    """
    count, dof = poses.shape
    inertia, jacobian = device.mass_matrix(poses), device.jacobian(poses)
    torque = device.gravity(poses)
    slopes = [device.linearization(q, np.zeros(dof), t)[:2] for q, t in zip(poses, torque, strict=True)]
    a_q, a_v = (np.array([pair[i] for pair in slopes]) for i in range(2))
    turning = np.einsum("k,nkij->nij", pull, device.tip_hessian(poses))
    felt = jacobian[:, np.linalg.norm(jacobian, axis=(0, 2)) > 0, :]
    m, d, s = inertia, -inertia @ a_v, -inertia @ a_q - turning
    if arm is not None:
        m, d, s, _ = in_hand(m, d, s, felt, arm)
    size = m.shape[-1]
    inverse = np.linalg.inv(m)
    block = np.zeros((count, 2 * size + dof, 2 * size + dof))
    block[:, :size, size : 2 * size] = np.eye(size)
    block[:, size : 2 * size, :size] = -inverse @ s
    block[:, size : 2 * size, size : 2 * size] = -inverse @ d
    block[:, size : 2 * size, 2 * size :] = inverse[:, :, :dof]
    held = expm(block * period)
    out = np.broadcast_to(np.eye(dof, 2 * size), (count, dof, 2 * size))
    return held[:, : 2 * size, : 2 * size], held[:, : 2 * size, 2 * size :], out


def assembled(
    plant: tuple[Array, Array, Array], jacobian: Array, turning: Array, law: Controller, late: int
) -> tuple[Array, Array, Array]:
    """Return (A, B, C), each (..., ., .), from the object's force (3, N) to the tip (3, m) of one loop or a stack.

    The states are the plant's, the torques on their way (newest first), and the controller's.

    Args:
        plant: sampled (A, B, C) from torques to joint angles.
        jacobian: (..., 3, dof), m/rad.
        turning: (..., dof, dof), N m/rad: how the torque of the motors' force turns with the pose.
        law: the controller.
        late: delay, samples.
    """
    pa, pb, pc = plant
    batch, n, dof = pa.shape[:-2], pa.shape[-1], pb.shape[-1]
    turned, feedback = np.swapaxes(jacobian, -1, -2), law.feedback
    m = feedback.nstates
    size = n + late * dof + m
    a, entry, out = np.zeros((*batch, size, size)), np.zeros((*batch, size, 3)), np.zeros((*batch, 3, size))
    a[..., :n, :n] = pa
    torque_x, torque_w = np.zeros((*batch, dof, size)), turned @ feedback.D
    torque_x[..., :n] = turning @ pc
    torque_x[..., n + late * dof :] = turned @ feedback.C
    if late:
        a[..., :n, n + (late - 1) * dof : n + late * dof] = pb
        for i in range(1, late):
            a[..., n + i * dof : n + (i + 1) * dof, n + (i - 1) * dof : n + i * dof] = np.eye(dof)
        a[..., n : n + dof, :] += torque_x
        entry[..., n : n + dof, :] = torque_w
    else:
        a[..., :n, :] += pb @ torque_x
        entry[..., :n, :] = pb @ torque_w
    if m:
        a[..., n + late * dof :, n + late * dof :] = feedback.A
        entry[..., n + late * dof :, :] = feedback.B
    out[..., :n] = jacobian @ pc
    return a, entry, out


def _directions(scenario: Scenario, jacobian: Array) -> Array:
    """Return an orthonormal basis (3, r) of where the object pushes and the device moves."""
    if scenario.object.kind == "wall":
        normal = np.array(scenario.object.normal, dtype=float)
        if np.linalg.norm(normal @ jacobian) <= 1e-9 * np.linalg.norm(jacobian):
            raise StabilityError("object.normal: the device cannot move along it, so there is no loop to judge")
        return normal[:, None]
    stiff = np.asarray(scenario.object.stiffness, float) + np.asarray(scenario.object.damping, float)
    axes = np.flatnonzero((np.linalg.norm(jacobian, axis=1) > 1e-9 * np.linalg.norm(jacobian)) & (stiff > 0))
    if axes.size == 0:
        raise StabilityError("object.stiffness: the object is not felt along any axis in which the device moves")
    return np.asarray(np.eye(3)[:, axes], dtype=float)


def felt(a: Array, entry: Array, out: Array, directions: Array) -> tuple[Array, Array, Array]:
    """Return (A, B, C) along some directions, without the modes that force there does not reach or motion does not see.

    Args:
        a: (n, n).
        entry: (n, 3), of the object's force.
        out: (3, n), to the tip.
        directions: (3, r).
    """
    basis, other = _reached(a, entry, entry @ directions)
    a, entry, out = other @ a @ basis, other @ entry, out @ basis
    basis, other = _reached(a.T, out.T, out.T @ directions)
    return basis.T @ (other @ a.T).T, basis.T @ entry @ directions, directions.T @ out @ other.T


def _reached(a: Array, all_ways: Array, b: Array, tolerance: float = 1e-9) -> tuple[Array, Array]:
    """Return (basis, its inverse) of the space (n, k) that the input ``b`` reaches through ``a``.

    The states are first scaled by how far ``all_ways`` of pushing moves them, so that metres and newtons compare; a
    state that only rounding moves under ``b`` stays as small as it is.
    """
    n = len(a)
    if n == 0:
        return np.zeros((0, 0)), np.zeros((0, 0))
    size, power = np.zeros(n), all_ways
    for _ in range(2 * n):
        size = np.maximum(size, np.abs(power).max(axis=1))
        power = a @ power
    scale = np.where(size > 1e-200, size, 1.0)
    step = a * scale[None, :] / scale[:, None] - np.eye(n)
    columns: list[Array] = []
    waiting = list((b / scale[:, None]).T)
    while waiting and len(columns) < n:
        vector = waiting.pop(0)
        length = np.linalg.norm(vector)
        for _ in range(2):
            for column in columns:
                vector = vector - column * (column @ vector)
        if length > 0 and np.linalg.norm(vector) > tolerance * length:
            columns.append(vector / np.linalg.norm(vector))
            waiting.append(step @ columns[-1])
    basis = np.array(columns).T.reshape(n, len(columns))
    return scale[:, None] * basis, basis.T / scale[None, :]


def _rests(device: Device, at: Array, turning: Array) -> bool:
    """Return whether gravity and the hold's force together have no hilltop here: M q'' = -S q with S not negative."""
    a_q, _, _ = device.linearization(at, np.zeros(device.dof), device.gravity(at))
    stiffness = -device.mass_matrix(at) @ a_q - turning
    values = np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))
    return bool(values.min() >= -1e-9 * max(float(np.abs(values).max()), 1e-300))


def _damping_felt(device: Device, jacobian: Array, directions: Array) -> float:
    """Return the least damping (N s/m) that any joint motion with unit tip speed in these directions meets."""
    if np.any(device.viscous <= 0):
        return 0.0
    mobility = directions.T @ jacobian @ np.diag(1 / device.viscous) @ jacobian.T @ directions
    return float(1 / np.linalg.eigvalsh(mobility).max())


def with_object(loop: ScenarioLoop, stiffness: float, damping: float) -> ScenarioLoop:
    """Return the same loop around an object of one stiffness (N/m) and damping (N s/m) in every direction."""
    eye = np.eye(loop.directions.shape[1])
    return replace(loop, stiffness=stiffness * eye, damping=damping * eye)
