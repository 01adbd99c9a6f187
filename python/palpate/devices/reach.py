"""Reach of a device: joint limits, joints that have turned round, and singular poses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Flags
from palpate.errors import PoseError

if TYPE_CHECKING:
    from palpate.devices.device import Device

__all__ = ["NEAR_SINGULAR", "SINGULAR", "beyond_reach", "conditioning", "unreachable"]

NEAR_SINGULAR = 0.05  # ratio of the smallest to the largest singular value of the Jacobian near a singular pose
SINGULAR = 0.005  # ratio of the smallest to the largest singular value of the Jacobian of a singular pose


def beyond_reach(device: Device, start: ArrayLike, angles: ArrayLike) -> Flags:
    """Return whether each of `angles` (n, dof) is beyond reach (n,).

    Beyond reach are a joint outside its limits, one that has turned round since `start` (dof,), and a pose that is
    singular to SINGULAR while the start was not.
    """
    q, first = np.atleast_2d(angles), np.asarray(start, dtype=float)
    low, high = device.joint_limits
    found = np.any((q < low) | (q > high), axis=1)
    if device.model.revolute:
        found |= np.any(np.abs(q - first) > 2.0 * np.pi, axis=1)
    if conditioning(device, first[None])[0] > SINGULAR:
        found |= conditioning(device, q) < SINGULAR
    return np.asarray(found, dtype=bool)


def conditioning(device: Device, angles: Array) -> Array:
    """Return the ratio of the smallest to the largest singular value of the Jacobian at `angles` (n, dof): (n,)."""
    jacobian = np.reshape(device.jacobian(angles), (len(angles), 3, device.dof))
    values = np.linalg.svd(jacobian, compute_uv=False)
    return np.asarray(values[:, -1] / np.maximum(values[:, 0], 1e-300), dtype=float)


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
