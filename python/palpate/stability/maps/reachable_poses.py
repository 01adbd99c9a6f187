"""Poses that a device reaches on its side of the base axis, away from singularities."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.devices import Device

__all__ = ["reachable_poses", "shoulder"]

SINGULAR = 0.1  # least ratio of the Jacobian's smallest to largest singular value
TURN = math.pi / 2  # rad, largest rotation of the base from the start


def reachable_poses(
    device: Device, start: Array, count: int
) -> tuple[float, Array, Array, dict[str, NDArray[np.int64]]]:
    """Return grid spacing (m), tips (n, 3) in m, poses (n, dof) in rad, and the indices of each section.

    Half of the ``count`` grid points are on two planes through the start, half in the volume.
    """
    home = device.forward(start)
    hinge, reach = shoulder(device)
    size = float(np.sqrt(0.8 * np.pi * reach**2 / max(0.5 * count, 8)))  # two planes, about half of each within reach
    volume = float(np.cbrt(2 * np.pi / 3 * reach**3 / max(0.5 * count, 8)))
    line, coarse = (np.arange(-np.ceil(reach / step), np.ceil(reach / step) + 1) * step for step in (size, volume))
    u, v = (g.ravel() for g in np.meshgrid(line, line, indexing="ij"))
    planes = {
        "y-z": np.stack([np.full(u.size, home[0]), u + hinge[1], v + hinge[2]], axis=1),
        "x-z": np.stack([u + hinge[0], np.full(u.size, home[1]), v + hinge[2]], axis=1),
    }
    space = np.stack([g.ravel() for g in np.meshgrid(coarse, coarse, coarse, indexing="ij")], axis=1) + hinge
    tips: list[Array] = [home[None, :]]
    poses: list[Array] = [start[None, :]]
    sections: dict[str, NDArray[np.int64]] = {}
    total = 1
    for name, points in (*planes.items(), ("space", space)):
        found = [(p, q) for p in points if (q := _pose_at(device, p, start, hinge, reach)) is not None]
        if found:
            tips.append(np.array([p for p, _ in found]))
            poses.append(np.array([q for _, q in found]))
        if name != "space":
            sections[name] = np.arange(total, total + len(found))
        total += len(found)
    return size, np.concatenate(tips), np.concatenate(poses), sections


def shoulder(device: Device) -> tuple[Array, float]:
    """Return the position of the shoulder joint (3,), m, and the reach of the arm from there, m."""
    l1, l2 = device.parameters.one("geometry.l1"), device.parameters.one("geometry.l2")
    return np.array([0.0, l2, -l1]), l1 + l2


def _pose_at(device: Device, tip: Array, start: Array, hinge: Array, reach: float) -> Array | None:
    """Return the pose at ``tip`` with the elbow configuration of the start; None if it is out of reach."""
    if np.linalg.norm(tip - hinge) > reach:
        return None
    low, high = device.joint_limits
    elbow, side = np.linalg.det(device.jacobian(start)), _axis_distance(device, start)
    for q in device.core.inverse(tip, start)[0]:
        pose = start + np.angle(np.exp(1j * (np.asarray(q) - start)))
        if np.any((pose < low) | (pose > high)):
            continue
        if abs(pose[0] - start[0]) > TURN + 1e-9 or _axis_distance(device, pose) * side <= 0:
            continue
        jacobian = device.jacobian(pose)
        values = np.linalg.svd(jacobian, compute_uv=False)
        if np.linalg.det(jacobian) * elbow > 0 and values[-1] >= SINGULAR * values[0]:
            return np.asarray(pose, dtype=float)
    return None


def _axis_distance(device: Device, pose: Array) -> float:
    """Return the distance of the tip from the base axis, m; negative where the arm reaches behind it."""
    hinge, _ = shoulder(device)
    x, _, z = device.forward(pose) - hinge
    return float(x * np.sin(pose[0]) + z * np.cos(pose[0]))
