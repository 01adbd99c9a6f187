"""Device whose tip moves on a spring and a damper behind its motors: the lowest flexible mode, linear."""

from __future__ import annotations

import numpy as np

from palpate.arrays import Array
from palpate.devices.flexible_mode import FlexibleMode

__all__ = ["couple_tip", "sampled_axis"]


def couple_tip(
    inertia: Array, damping: Array, stiffness: Array, jacobian: Array, mode: FlexibleMode
) -> tuple[Array, Array, Array, Array]:
    """Return M, D, S (..., 2n, 2n) and J (..., axes, 2n) of a device, or of a stack, with its lowest mode.

    The first n coordinates are those of motors and encoders, the others those that the joints would have at the tip.
    Friction acts at the motors. Gravity acts on both sides by their share.

    Args:
        inertia: (..., n, n).
        damping: (..., n, n).
        stiffness: (..., n, n), of gravity.
        jacobian: of the tip (..., axes, n).
        mode: the lowest mode.
    """
    share = mode.tip_share
    none = np.zeros_like(inertia)

    def spring(size: float) -> Array:
        return np.asarray(np.block([[size * inertia, -size * inertia], [-size * inertia, size * inertia]]))

    def split(matrix: Array) -> Array:
        return np.asarray(np.block([[(1.0 - share) * matrix, none], [none, share * matrix]]))

    friction = np.block([[damping, none], [none, none]])
    tip = np.concatenate([np.zeros_like(jacobian), jacobian], axis=-1)
    return split(inertia), friction + spring(mode.damping), split(stiffness) + spring(mode.stiffness), tip


def sampled_axis(mode: FlexibleMode, inertia: float, period: float) -> tuple[Array, Array]:
    """Return (A, B) of one free axis, from the acceleration that a unit of known mass would have, sampled.

    The states are the positions of encoder and tip, m, and their speeds, m/s. In the coordinates of the center of mass
    and of the stretch the motion is a free mass and an oscillator, so the result is exact.

    Args:
        mode: the lowest mode.
        inertia: of the axis over the known one.
        period: s.
    """
    share, ratio, rate = mode.tip_share, mode.damping_ratio, 2.0 * np.pi * mode.frequency
    turn = rate * np.sqrt(1.0 - ratio * ratio)
    decay = np.exp(-ratio * rate * period)
    cosine, sine = decay * np.cos(turn * period), decay * np.sin(turn * period) / turn
    modal, push = np.zeros((4, 4)), np.zeros(4)  # center of mass, its speed, stretch, its speed
    modal[:2, :2] = [[1.0, period], [0.0, 1.0]]
    modal[2:, 2:] = [[cosine + ratio * rate * sine, sine], [-rate * rate * sine, cosine - ratio * rate * sine]]
    push[:2] = np.array([0.5 * period * period, period]) / inertia
    push[2:] = -np.array([(1.0 - modal[2, 2]) / (rate * rate), sine]) / ((1.0 - share) * inertia)
    out = np.array([[1.0, 0.0, -share, 0.0], [1.0, 0.0, 1.0 - share, 0.0], [0.0, 1.0, 0.0, -share],
                    [0.0, 1.0, 0.0, 1.0 - share]])  # fmt: skip
    return out @ modal @ np.linalg.inv(out), out @ push
