"""One axis of the workspace controller along a normal, written independently of the core, for laws of its contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from palpate.arrays import Array
from palpate.control.workspace_controller import WorkspaceController
from scipy.linalg import expm


@dataclass(frozen=True)
class Hand:
    """Rigid hand at a tip, with a spring that rests at the surface: kg, N s/m, N/m."""

    mass: float = 0.0
    damping: float = 0.0
    stiffness: float = 0.0


def axis_depth(
    law: WorkspaceController,
    inertia: float | Array,
    stiffness: Array,
    press: Array,
    hand: Hand | Array,
    start: tuple[float, float],
) -> Array:
    """Return the depth (n,), m, of a tip that is pressed into a surface; negative: the axis would leave it.

    Args:
        law: gains, share and operator_mass; the drive's limit is that of its device.
        inertia: of the tip without the hand, kg, one or (n,).
        stiffness: of the surface at each tick (n,), N/m.
        press: reference force into the surface (n,), N.
        hand: model of the hand, or its recorded force into the surface (n,), N.
        start: depth, m, and speed, m/s.
    """
    n, t, gains, limit = len(stiffness), law.period, law.gains, law.device.peak_force
    modeled = hand if isinstance(hand, Hand) else Hand()
    felt = np.zeros(n) if isinstance(hand, Hand) else hand
    tip = np.broadcast_to(np.asarray(inertia, dtype=float), (n,))
    kp, kd, rp, rd = gains.position, gains.velocity, gains.reference_position, gains.reference_velocity
    correct = np.asarray(gains.observer)
    depth, state = np.zeros(n), np.array(start)
    estimate, model = np.array([*start, -modeled.stiffness * start[0] / (tip[0] + law.operator_mass)]), np.array(start)
    steps: dict[float, tuple[Array, Array]] = {}
    for i in range(n):
        depth[i] = state[0]
        believed, mass = tip[i] + law.operator_mass, tip[i] + modeled.mass
        if mass not in steps:
            block = np.array(
                [[0.0, 1.0, 0.0], [-modeled.stiffness / mass, -modeled.damping / mass, 1.0 / mass], [0] * 3]
            )
            whole = expm(block * t)
            steps[mass] = whole[:2, :2], whole[:2, 2]
        estimate = estimate + correct * (state[0] - estimate[0])
        away = press[i] / stiffness[i] - model[0]
        brake, speed = law.share * (limit - press[i] * np.sign(away)) / believed, rp / rd * away
        linear = 0.5 * brake * (rd / rp) ** 2
        if abs(away) > linear:  # braking curve, and the line that continues it
            speed = np.sign(away) * (np.sqrt(2.0 * brake * abs(away)) - rp / rd * linear)
        most = law.share * (limit + press[i] * np.array([-1.0, 1.0])) / believed
        planned = float(np.clip(rd * (speed - model[1]), -most[0], most[1]))
        wanted = planned + kp * (model[0] - estimate[0]) + kd * (model[1] - estimate[1]) - estimate[2]
        motor = float(np.clip(believed * wanted - press[i], -limit, limit))
        given = (motor + press[i]) / believed
        a, b = steps[mass]
        state = a @ state + b * (motor + press[i] + felt[i])
        model = model + t * np.array([model[1] + 0.5 * t * planned, planned])
        moved = given + estimate[2]
        estimate = estimate + t * np.array([estimate[1] + 0.5 * t * moved, moved, 0.0])
    return depth
