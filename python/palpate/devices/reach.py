"""Reach of a device: joint limits, joints that have turned round, and singular poses."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Flags
from palpate.errors import PalpateWarning, PoseError

if TYPE_CHECKING:
    from palpate.devices.device import Device

__all__ = [
    "NEAR_SINGULAR",
    "SINGULAR",
    "beyond_reach",
    "check_reach",
    "conditioning",
    "excursion_beyond",
    "near_limits",
    "unreachable",
]

NEAR_SINGULAR = 0.05  # ratio of the smallest to the largest singular value of the Jacobian near a singular pose
NEAR_LIMIT = 0.02  # of a joint's range, distance from its limits that is near
SINGULAR = 0.005  # ratio of the smallest to the largest singular value of the Jacobian of a singular pose


def beyond_reach(device: Device, start: ArrayLike, angles: ArrayLike) -> Flags:
    """Return whether each of `angles` (n, dof) is beyond reach (n,).

    Beyond reach are a joint outside its limits, one that has turned round since `start` (dof,), and a pose that is
    singular to SINGULAR while the start was not.
    """
    q = np.atleast_2d(angles)
    return excursion_beyond(device, start, q, q, q)


def excursion_beyond(device: Device, start: ArrayLike, least: Array, greatest: Array, worst: Array) -> Flags:
    """Return whether each of n motions leaves the reach (n,), as `beyond_reach`.

    Args:
        device: that moves.
        start: joint angles (dof,).
        least, greatest: of each joint during the motion (n, dof).
        worst: joint angles of the pose with the smallest ratio of singular values (n, dof).
    """
    first = np.asarray(start, dtype=float)
    low, high = device.joint_limits
    found = np.any((least < low) | (greatest > high), axis=1)
    if device.model.revolute:
        found |= np.any(np.maximum(first - least, greatest - first) > 2.0 * np.pi, axis=1)
    if conditioning(device, first[None])[0] > SINGULAR:
        found |= conditioning(device, worst) < SINGULAR
    return np.asarray(found, dtype=bool)


def conditioning(device: Device, angles: Array) -> Array:
    """Return the ratio of the smallest to the largest singular value of the Jacobian at `angles` (n, dof): (n,)."""
    jacobian = np.reshape(device.jacobian(angles), (len(angles), 3, device.dof))
    values = np.linalg.svd(jacobian, compute_uv=False)
    return np.asarray(values[:, -1] / np.maximum(values[:, 0], 1e-300), dtype=float)


def near_limits(device: Device, angles: Array) -> list[str]:
    """Return remarks if poses (n, dof) within reach come near a singular pose or a joint limit; empty if not."""
    if device.dof > 1 and (least := float(conditioning(device, angles).min())) < NEAR_SINGULAR:
        factor = f"{1.0 / max(least, 1e-300):.3g}"
        return [f"the pose comes near a singular one: the Jacobian's singular values differ by a factor of {factor}"]
    low, high = device.joint_limits
    margin = np.minimum(angles - low, high - angles).min(axis=0)
    if np.any(near := margin < NEAR_LIMIT * (high - low)) and np.all(margin >= 0.0):
        return [f"joint {int(np.flatnonzero(near)[0]) + 1} comes near its limit"]
    return []


def check_reach(device: Device, pose: ArrayLike, task: str) -> None:
    """Warn if `pose` (dof,) is near a singular pose or a joint limit.

    Raises:
        PoseError: the pose is singular to SINGULAR, or a joint is beyond its limits.
    """
    q = np.atleast_2d(np.asarray(pose, dtype=float))
    low, high = device.joint_limits
    if np.any(outside := (q[0] < low) | (q[0] > high)):
        joint = int(np.flatnonzero(outside)[0]) + 1
        raise PoseError(f"{task}: joint {joint} of {device.name} is beyond its limits; choose another pose")
    if device.dof > 1 and (ratio := float(conditioning(device, q)[0])) < SINGULAR:
        raise PoseError(
            f"{task}: the Jacobian is singular at this pose (ratio of its singular values {ratio:.2g}, below "
            f"{SINGULAR:g}): choose a pose off the singularity"
        )
    for remark in near_limits(device, q):
        warnings.warn(f"{task}: {remark}", PalpateWarning, stacklevel=3)


def unreachable(device: Device, start: ArrayLike, displacement: ArrayLike) -> Flags:
    """Return whether the tip cannot be displaced from `start` (dof,) by each `displacement` (n, 3), m: (n,).

    It cannot if no pose has the tip there, or if that pose is beyond reach. An unknown displacement (nan on every axis)
    can; on single axes nan counts as zero.
    """
    q = np.asarray(start, dtype=float)
    moves = np.atleast_2d(displacement).astype(float)
    tip = np.asarray(device.forward(q), dtype=float)
    known = ~np.isnan(moves).all(axis=1)
    moves, index = np.unique(np.nan_to_num(moves), axis=0, return_inverse=True)

    def missed(move: Array) -> bool:
        try:
            return bool(beyond_reach(device, q, device.inverse(tip + move, q))[0])
        except PoseError:
            return True

    found = np.array([missed(move) for move in moves], dtype=bool)
    return np.asarray(found[index.ravel()] & known, dtype=bool)
