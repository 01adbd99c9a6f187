"""One tick of an admittance display about rest, linear and exact: device, operator, force sensor, tool and feedback.

The law is that of the core, `AdmittanceController`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.arrays import Array
from palpate.control.workspace_controller import WorkspaceController, is_damped, reachable_axes
from palpate.devices import Device
from palpate.errors import PoseError
from palpate.linear.linear_device import HumanArm
from palpate.linear.sampled_loop import equations_of_motion, sampled_plants

__all__ = ["SensedPlant", "TipFeedback", "admittance_loop", "sensed_plant", "tip_feedback"]


@dataclass(frozen=True)
class SensedPlant:
    """Device and operator, sampled, and the force that a sensor at the tip reads, in the r axes of the tip's motion.

    Attributes:
        a: (n, n); b: (n, dof), of the motor torques.
        angles: (dof, n), of the encoders.
        force: (r, n), N per state; force_torque: (r, dof), N per torque that acted until the sample.
    """

    a: Array
    b: Array
    angles: Array
    force: Array
    force_torque: Array


@dataclass(frozen=True)
class TipFeedback:
    """What the controller knows about a pose, and its gains.

    Attributes:
        axes: (3, r), orthonormal, in which the tip can move; r = dof.
        jacobian: (r, dof), of the tip in these axes.
        inertia: (dof, dof); friction: viscous (dof,); holding: derivative of the torque at rest by the pose (dof, dof).
        position: 1/s^2; velocity: 1/s; observer: gains (3,); period: s.
    """

    axes: Array
    jacobian: Array
    inertia: Array
    friction: Array
    holding: Array
    position: float
    velocity: float
    observer: Array
    period: float


def sensed_plant(
    device: Device, pose: Array, arm: HumanArm | None, rest_force: Array, period: float, axes: Array
) -> SensedPlant:
    """Return the plant at rest in a pose (dof,); arguments as of `sampled_plants`, and the axes of the tip (3, r)."""
    a, b, c = (one[0] for one in sampled_plants(device, pose[None], arm, rest_force, period))
    n, dof = b.shape
    if arm is None:
        return SensedPlant(a, b, c, np.zeros((axes.shape[1], n)), np.zeros((axes.shape[1], dof)))
    m, d, s, rows = (one[0] for one in equations_of_motion(device, pose[None], arm, rest_force))
    moving = np.linalg.norm(device.jacobian(pose), axis=1) > 0
    into = axes[moving].T
    inverse = np.linalg.inv(m)
    eye, none = np.eye(len(m)), np.zeros_like(m)
    place, speed = np.hstack([eye, none]), np.hstack([none, eye])
    if arm.tissue_stiffness is not None:  # coordinates of the device, then those of the hand
        device_rows, hand = rows[:, : len(m) - len(rows)], np.eye(len(m))[len(m) - len(rows) :]
        stretch = hand - np.hstack([device_rows, np.zeros((len(rows), len(rows)))])
        force = arm.tissue_stiffness * stretch @ place + arm.tissue_damping * stretch @ speed
        return SensedPlant(a, b, c, into @ force, np.zeros((len(into), dof)))
    force = rows @ (arm.mass * inverse @ np.hstack([s, d]) - arm.damping * speed - arm.stiffness * place)
    return SensedPlant(a, b, c, into @ force, -arm.mass * into @ rows @ inverse[:, :dof])


def tip_feedback(controller: WorkspaceController, pose: Array, rest_force: Array) -> TipFeedback:
    """Return the feedback at rest in a pose (dof,), under a force of the operator (3,), N.

    Raises:
        PoseError: the pose is so near a singular one that the controller damps its inverse.
    """
    device = controller.device
    jacobian = device.jacobian(pose)
    if is_damped(jacobian):
        raise PoseError("the pose is near a singular one, where the controller bounds its force")
    axes = reachable_axes(jacobian)
    slope = device.linearization(pose, np.zeros(device.dof), device.gravity(pose))[0]
    inertia = device.mass_matrix(pose)
    turned = np.einsum("k,kij->ij", rest_force, device.tip_hessian(pose))
    gains: Any = controller.gains
    return TipFeedback(
        axes, axes.T @ jacobian, inertia, device.viscous, -inertia @ slope - turned,
        gains.position, gains.velocity, np.asarray(gains.observer), controller.period,
    )  # fmt: skip


def admittance_loop(
    plant: SensedPlant,
    feedback: TipFeedback,
    mass: float,
    damping: float,
    stiffness: Array | None = None,
    object_damping: Array | None = None,
    delay: int = 0,
) -> tuple[Array, Array, Array]:
    """Return (A, B, C) of one tick, from a force on the tool (3, N) to the tool's velocity (3, m/s), object included.

    The states are those of the plant, the torques of the last ticks (newest first), and per axis the position and
    velocity of the tool and the estimates of position, velocity and disturbance.

    Args:
        plant: device and operator.
        feedback: of the tip.
        mass: of the tool, kg.
        damping: of the tool, N s/m.
        stiffness: of the object (3, 3), N/m, as the servo knows it; None: no object.
        object_damping: of the object (3, 3), N s/m, by backward difference.
        delay: samples.
    """
    (n, dof), r, t = plant.b.shape, feedback.axes.shape[1], feedback.period
    past = n + (delay + 1) * dof
    size = past + 5 * r
    rows = np.eye(size, size + 3)
    x, torques, pushed = rows[:n], rows[n:past], np.eye(3, size + 3, size)
    y, v, *estimate = np.split(rows[past:], 5)
    k = np.zeros((3, 3)) if stiffness is None else stiffness
    b = np.zeros((3, 3)) if object_damping is None else object_damping

    felt = plant.force @ x + plant.force_torque @ torques[delay * dof :]
    inverse = np.linalg.inv((mass + t * damping) * np.eye(3) + t * t * k)
    loss = damping * np.eye(3) + t * k + b
    axes = feedback.axes
    tool = axes.T @ inverse @ (axes @ felt - k @ axes @ y - loss @ axes @ v - pushed)
    angles = plant.angles @ x
    error = feedback.jacobian @ angles - estimate[0]
    place, speed, disturbance = (one + gain * error for one, gain in zip(estimate, feedback.observer, strict=True))
    wanted = tool + feedback.position * (y - 0.5 * t * v - place) + feedback.velocity * (v - speed) - disturbance
    known = wanted + disturbance
    to_joints = np.linalg.inv(feedback.jacobian)
    torque = feedback.holding @ angles + feedback.inertia @ to_joints @ wanted
    torque += feedback.friction[:, None] * (to_joints @ v) - feedback.jacobian.T @ felt
    acting = torque if delay == 0 else torques[(delay - 1) * dof : delay * dof]
    step = np.vstack(
        [
            plant.a @ x + plant.b @ acting,
            torque,
            torques[: delay * dof],
            y + t * (v + t * tool),
            v + t * tool,
            place + t * (speed + 0.5 * t * known),
            speed + t * known,
            disturbance,
        ]
    )
    return step[:, :size], step[:, size:], axes @ v[:, :size]
