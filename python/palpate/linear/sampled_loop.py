"""Matrices of the sampled loop: a held device, the servo's delay, the controller, and the observable part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.linear.linear_device import HumanArm, couple_arm

__all__ = ["assemble_loop", "observable_reduction", "sampled_plants"]

Array = NDArray[np.float64]


def sampled_plants(
    device: Device, poses: Array, arm: HumanArm | None, pull: Array, period: float
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
    geometric_stiffness = np.einsum("k,nkij->nij", pull, device.tip_hessian(poses))
    observable_reduction = jacobian[:, np.linalg.norm(jacobian, axis=(0, 2)) > 0, :]
    m, d, s = inertia, -inertia @ a_v, -inertia @ a_q - geometric_stiffness
    if arm is not None:
        m, d, s, _ = couple_arm(m, d, s, observable_reduction, arm)
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


def assemble_loop(
    plant: tuple[Array, Array, Array], jacobian: Array, geometric_stiffness: Array, law: Controller, late: int
) -> tuple[Array, Array, Array]:
    """Return (A, B, C), each (..., ., .), from the object's force (3, N) to the tip (3, m) of one loop or a stack.

    The states are the plant's, the torques on their way (newest first), and the controller's.

    Args:
        plant: sampled (A, B, C) from torques to joint angles.
        jacobian: (..., 3, dof), m/rad.
        geometric_stiffness: (..., dof, dof), N m/rad: how the torque of the motors' force turns with the pose.
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
    torque_x[..., :n] = geometric_stiffness @ pc
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


def observable_reduction(a: Array, entry: Array, out: Array, directions: Array) -> tuple[Array, Array, Array]:
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
