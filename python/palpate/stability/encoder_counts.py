"""Dry friction that a display with encoders needs of its joints to be passive (Abbott & Okamura 2005)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import ScenarioLoop
from palpate.stability.assumptions import start_pose

__all__ = ["count_at_tip", "friction_for_counts"]


def count_at_tip(s: Scenario, loop: ScenarioLoop) -> float:
    """Return the tip displacement, m, if every encoder advances by one count, at most over the directions of the loop.

    Tip motions exist in which the counts of all joints change at once.
    """
    device = s.load_device()
    return float((np.abs(loop.directions.T @ device.jacobian(start_pose(s))) @ device.encoder_step).max())


def friction_for_counts(s: Scenario, loop: ScenarioLoop, stiffness: ArrayLike, damping: ArrayLike) -> Array:
    """Return the dry friction of each joint (dof,), N m or N, with which encoder counts generate no energy.

    A count is off by half a step at most, so the force of a spring K by K/2 steps and that of a damper B by B/T steps.
    The work of this error is at most that of a dry friction of its size, for any delay. A motion across the edges of
    the counts, which changes its direction every n + 1 ticks with n samples of delay, extracts it all.

    Args:
        s: scenario of the loop.
        loop: its loop, for the directions.
        stiffness: K in these directions (r, r), or one number for all, N/m.
        damping: B in these directions, likewise, N s/m.
    """
    device, r = s.load_device(), loop.directions.shape[1]
    lever = loop.directions.T @ device.jacobian(start_pose(s))
    k, b = (np.asarray(value, dtype=float) * np.eye(r) if np.ndim(value) == 0 else np.asarray(value, dtype=float)
            for value in (stiffness, damping))  # fmt: skip
    spring, damper = (lever.T @ matrix @ lever for matrix in (k, b / s.period))
    error = 0.5 * (np.abs(spring + damper) + np.abs(damper))  # of the counts of this tick, and of the one before
    return np.asarray(error @ device.encoder_step, dtype=float)
