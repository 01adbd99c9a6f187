"""Matrices of the sampled loop: discretized device, delay, controller, and the observable part."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.linear.flexible_tip import couple_tip
from palpate.linear.linear_device import HumanArm, couple_arm


def sampled_plants(
    device: Device, poses: Array, arm: HumanArm | None, rest_force: Array, period: float
) -> tuple[Array, Array, Array]:
    """Return (A, B, C), each (n, ., .), of a device at rest in n poses, from sampled torques to joint angles.

    The angles are those of the encoders. With a flexible mode the operator moves the tip behind it.

    Args:
        device: dof joints.
        poses: (n, dof), rad.
        arm: operator at the tip; None: no operator.
        rest_force: force of the operator at rest (3,), N; its torque changes with the pose.
        period: sampling period, s.
    """
    count, dof = poses.shape
    m, d, s, _ = equations_of_motion(device, poses, arm, rest_force)
    size = m.shape[-1]
    inverse = np.linalg.inv(m)
    block = np.zeros((count, 2 * size + dof, 2 * size + dof))
    block[:, :size, size : 2 * size] = np.eye(size)
    block[:, size : 2 * size, :size] = -inverse @ s
    block[:, size : 2 * size, size : 2 * size] = -inverse @ d
    block[:, size : 2 * size, 2 * size :] = inverse[:, :, :dof]
    discrete = expm(block * period)
    out = np.broadcast_to(np.eye(dof, 2 * size), (count, dof, 2 * size))
    return discrete[:, : 2 * size, : 2 * size], discrete[:, : 2 * size, 2 * size :], out


def equations_of_motion(
    device: Device, poses: Array, arm: HumanArm | None, rest_force: Array
) -> tuple[Array, Array, Array, Array]:
    """Return M, D, S, each (n, ., .), of a device at rest in n poses with its operator, and the tip's motion (n, ., .).

    The last is the Jacobian of the tip that the operator holds, without the axes along which it cannot move. Arguments
    as of `sampled_plants`.
    """
    dof = poses.shape[1]
    inertia, jacobian = device.mass_matrix(poses), device.jacobian(poses)
    torque = device.gravity(poses)
    slopes = [device.linearization(q, np.zeros(dof), t)[:2] for q, t in zip(poses, torque, strict=True)]
    a_q, a_v = (np.array([pair[i] for pair in slopes]) for i in range(2))
    geometric_stiffness = np.einsum("k,nkij->nij", rest_force, device.tip_hessian(poses))
    moving_rows = jacobian[:, np.linalg.norm(jacobian, axis=(0, 2)) > 0, :]
    m, d, s = inertia, -inertia @ a_v, -inertia @ a_q
    if device.flexible is None:
        s = s - geometric_stiffness
    else:
        m, d, s, moving_rows = couple_tip(m, d, s, moving_rows, device.flexible)
        s[:, dof:, dof:] -= geometric_stiffness
    if arm is not None:
        m, d, s, moving_rows = couple_arm(m, d, s, moving_rows, arm)
    return m, d, s, moving_rows


def assemble_loop(
    plant: tuple[Array, Array, Array], jacobian: Array, geometric_stiffness: Array, controller: Controller, delay: int
) -> tuple[Array, Array, Array]:
    """Return (A, B, C), each (..., ., .), from the object's force (3, N) to the tip (3, m) of one loop or a stack.

    The states are those of the plant, the delayed torques (newest first), and those of the controller.

    Args:
        plant: sampled (A, B, C) from torques to joint angles.
        jacobian: (..., 3, dof), m/rad.
        geometric_stiffness: (..., dof, dof), N m/rad: derivative of the gravity compensation torque by the pose.
        controller: the controller.
        delay: samples.
    """
    pa, pb, pc = plant
    batch, n, dof = pa.shape[:-2], pa.shape[-1], pb.shape[-1]
    transposed, feedback = np.swapaxes(jacobian, -1, -2), controller.feedback
    m = feedback.nstates
    size = n + delay * dof + m
    a, entry, out = np.zeros((*batch, size, size)), np.zeros((*batch, size, 3)), np.zeros((*batch, 3, size))
    a[..., :n, :n] = pa
    torque_x, torque_w = np.zeros((*batch, dof, size)), transposed @ feedback.D
    torque_x[..., :n] = geometric_stiffness @ pc
    torque_x[..., n + delay * dof :] = transposed @ feedback.C
    if delay:
        a[..., :n, n + (delay - 1) * dof : n + delay * dof] = pb
        for i in range(1, delay):
            a[..., n + i * dof : n + (i + 1) * dof, n + (i - 1) * dof : n + i * dof] = np.eye(dof)
        a[..., n : n + dof, :] += torque_x
        entry[..., n : n + dof, :] = torque_w
    else:
        a[..., :n, :] += pb @ torque_x
        entry[..., :n, :] = pb @ torque_w
    if m:
        a[..., n + delay * dof :, n + delay * dof :] = feedback.A
        entry[..., n + delay * dof :, :] = feedback.B
    out[..., :n] = jacobian @ pc
    return a, entry, out


def observable_reduction(a: Array, entry: Array, out: Array, directions: Array) -> tuple[Array, Array, Array]:
    """Return (A, B, C) along some directions, without unreachable and unobservable modes.

    Args:
        a: (n, n).
        entry: (n, 3), input matrix of the object's force.
        out: (3, n), output matrix of the tip.
        directions: (3, r).
    """
    basis, other = reachable_space(a, entry, entry @ directions)
    a, entry, out = other @ a @ basis, other @ entry, out @ basis
    basis, other = reachable_space(a.T, out.T, out.T @ directions)
    return basis.T @ (other @ a.T).T, basis.T @ entry @ directions, directions.T @ out @ other.T


def reachable_space(a: Array, all_inputs: Array, b: Array, tolerance: float = 1e-9) -> tuple[Array, Array]:
    """Return a basis (n, k) of the space that the input ``b`` reaches through ``a``, and its inverse (k, n).

    The states are first scaled by their response to ``all_inputs``, so that states with different units compare. A
    state that ``b`` excites only by rounding stays small.
    """
    n = len(a)
    if n == 0:
        return np.zeros((0, 0)), np.zeros((0, 0))
    size, power = np.zeros(n), all_inputs
    for _ in range(2 * n):
        size = np.maximum(size, np.abs(power).max(axis=1))
        power = a @ power
    scale = np.where(size > 1e-200, size, 1.0)
    step = a * scale[None, :] / scale[:, None] - np.eye(n)
    columns: list[Array] = []
    candidates = list((b / scale[:, None]).T)
    while candidates and len(columns) < n:
        vector = candidates.pop(0)
        length = np.linalg.norm(vector)
        for _ in range(2):
            for column in columns:
                vector = vector - column * (column @ vector)
        if length > 0 and np.linalg.norm(vector) > tolerance * length:
            columns.append(vector / np.linalg.norm(vector))
            candidates.append(step @ columns[-1])
    basis = np.array(columns).T.reshape(n, len(columns))
    return scale[:, None] * basis, basis.T / scale[None, :]
