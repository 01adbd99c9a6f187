"""Controllers as the thesis describes them: LQG with Q = I and R = 10 I, driven by the error; first-order lead-lag.

The thesis prints Q = I and R = 10 I (4.3.3) and, in figure 4.1, an LQG that sees only F_ref - F_object. It prints no
gain of its lead-lag: one first-order block in two of the three force loops (4.3.2), on the arm with gravity held. Its
table 5.1 follows from one static gain along z.
"""

from __future__ import annotations

from typing import Any, Final, Literal

import control
import numpy as np
from numpy.typing import ArrayLike
from palpate.arrays import Array
from palpate.control import Controller, lqg
from palpate.devices import Device
from palpate.errors import DesignError
from palpate.linear.linearization import static_tip_force
from scipy.optimize import root

from experiments.hosseini2004.cases import CASES, POSE, STIFFEST, angle_plant, case_plant, ignorant_lqg
from experiments.hosseini2004.experimental import PERIOD

__all__ = ["Z_GAIN", "driven_by_error", "lead_lag_of_table_51", "printed_weights", "rest"]

Name = Literal["A", "B", "C", "D"]
Z_GAIN: Final = 0.0031  # static gain along z, N/N; fitted to the row of 2 N/mm of table 5.1
# Static gain, zero and pole (rad/s) along y and z; along x the gain is 1. Zeros and poles only keep the loop stable.
BLOCKS: Final = {1: (1.0, 100.0, 1000.0), 2: (Z_GAIN, 1.0, 1000.0)}


def driven_by_error(controller: Controller) -> Controller:
    """Return the controller with F_ref - F_object as its only input (figure 4.1): the same gains, no feedforward."""
    s = controller.system
    b, d = s.B[:, 3:], s.D[:, 3:]
    system = control.StateSpace(s.A, np.hstack([-b, b]), s.C, np.hstack([-d, d]), s.dt)
    return Controller(system, controller.antiwindup, controller.kind, {**controller.notes, "driven_by": "error"})


def printed_weights(case: Name) -> Controller:
    """Return the LQG of a case with the printed weights: Q = I, R = 10 I for feedback and filter, driven by the error.

    It is designed for 3.5 N/mm, with the integrators and the knowledge of the kinematics that the case has in the
    thesis.

    Raises:
        DesignError: an unknown case.
    """
    if case not in CASES:
        raise DesignError(f'a case is "A", "B", "C" or "D", not {case!r}')
    chosen = CASES[case]
    if not chosen.jacobians:
        return ignorant_lqg(angle_plant(chosen.model), integrators=chosen.integrators)
    plant = case_plant(case, STIFFEST)
    n = plant.nstates
    options: dict[str, Any] = {
        "state_weight": np.eye(n + (3 if chosen.integrators else 0)),
        "force_weight": 10.0,
        "disturbance": np.eye(n),
        "noise": float(np.sqrt(10.0)),
    }
    return driven_by_error(lqg(plant, integrators=chosen.integrators, **options))


def lead_lag_of_table_51() -> Controller:
    """Return a lead-lag of the thesis's structure with the static gains (1, 1, 0.0031), which explain table 5.1."""
    size = len(BLOCKS)
    a, b, c, d = np.zeros((size, size)), np.zeros((size, 3)), np.zeros((3, size)), np.eye(3)
    for state, (axis, (gain, zero, pole)) in enumerate(BLOCKS.items()):
        at_zero, at_pole = ((1 - w * PERIOD / 2) / (1 + w * PERIOD / 2) for w in (zero, pole))
        high = gain * (1 - at_pole) / (1 - at_zero)
        a[state, state], b[state, axis] = at_pole, 1.0
        c[axis, state], d[axis, axis] = high * (at_pole - at_zero), high
    system = control.StateSpace(a, np.hstack([b, -b]), c, np.hstack([d, -d]), PERIOD)
    return Controller(system, None, "lead_lag", {"static_gain": [1.0, 1.0, Z_GAIN]})


def rest(device: Device, gain: ArrayLike, stiffness: float, force: float = 8.5, pose: ArrayLike = POSE) -> Array:
    """Return the deflection (3,), m, at which the nonlinear arm rests, gravity held as at `pose`.

    Solves J(θ)ᵀ (diag(gain) (F - K (p(θ) - p0)) + f_hold) = N(θ) for θ.

    Args:
        device: the arm.
        gain: static gain of the controller (3,), N/N.
        stiffness: of the object on every axis, N/m.
        force: reference on every axis, N.
        pose: start (3,), rad.

    Raises:
        DesignError: no equilibrium found.
    """
    start, c = np.asarray(pose, dtype=float), np.asarray(gain, dtype=float)
    origin = device.forward(start)
    hold = static_tip_force(device.jacobian(start), device.gravity(start))

    def residual(q: Array) -> Array:
        u = c * (force - stiffness * (device.forward(q) - origin))
        return np.asarray(device.jacobian(q).T @ (u + hold) - device.gravity(q), dtype=float)

    guess = start + np.linalg.solve(device.jacobian(start), np.full(3, force / stiffness))
    found = root(residual, guess, tol=1e-13)
    if not np.abs(residual(found.x)).max() <= 1e-9:
        raise DesignError(f"no equilibrium of the arm on {stiffness:g} N/m with the static gains {c.tolist()}")
    return np.asarray(device.forward(found.x) - origin, dtype=float)
