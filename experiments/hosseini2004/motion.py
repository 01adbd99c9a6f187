"""Open-loop motion of the arm under joint torques (sections 2.7 and 3.9 of the thesis)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from palpate.arrays import Array
from scipy.integrate import solve_ivp

__all__ = ["Motion", "constant", "move", "pulse"]


class Arm(Protocol):
    """Equations of motion: those of a device, or the printed ones."""

    def acceleration(self, q: Array, qd: Array, tau: Array) -> Array:
        """Return qdd (3,), rad/s²."""
        ...


@dataclass(frozen=True)
class Motion:
    """Joint angles (n, 3), rad, and velocities (n, 3), rad/s, at times (n,), s."""

    time: Array
    q: Array
    qd: Array


def constant(tau: ArrayLike) -> Callable[[float], Array]:
    """Return a torque that does not change, (3,), N m."""
    value = np.array(tau, dtype=float)
    return lambda _: value


def pulse(tau: ArrayLike, joint: int, width: float) -> Callable[[float], Array]:
    """Return a torque (3,), N m, constant but for one joint, whose torque ends after `width` seconds."""
    during, after = np.array(tau, dtype=float), np.array(tau, dtype=float)
    after[joint] = 0.0
    return lambda t: during if t < width else after


def move(
    arm: Arm,
    start: ArrayLike,
    speed: ArrayLike,
    torque: Callable[[float], Array],
    duration: float,
    *,
    samples: int = 1001,
    tolerance: float = 1e-8,
) -> Motion:
    """Integrate the motion from `start` (3,), rad, and `speed` (3,), rad/s, for `duration` seconds."""

    def rate(t: float, state: Array) -> Array:
        return np.concatenate([state[3:], arm.acceleration(state[:3], state[3:], torque(t))])

    time = np.linspace(0.0, duration, samples)
    initial = np.concatenate([np.asarray(start, dtype=float), np.asarray(speed, dtype=float)])
    solution = solve_ivp(
        rate, (0.0, duration), initial, method="DOP853", t_eval=time, rtol=tolerance, atol=tolerance / 100, max_step=0.1
    )
    return Motion(time, solution.y[:3].T, solution.y[3:].T)
