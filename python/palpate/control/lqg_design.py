"""LQG design of a force-tracking controller: optimal state feedback, Kalman filter and integrators.

The plant is sampled, from tip force u (N) to object force y (N). The feedback minimizes the sum over samples of
|e|^2 + |speed_weight dy/dt|^2 + |integral_rate xi|^2 + force_weight |u|^2, each term in N^2. xi is the integral of
F_ref - F_object (N s). With force_weight 1 and the other weights 0, a tip of mass m on a spring K keeps its natural
frequency sqrt(K/m) and gets a damping ratio of 0.71.

F_ref enters through the equilibrium x = N_x F_ref, u = N_u F_ref, and through a constant offset of the integrators that
minimizes the cost of a step. A step of the reference therefore does not wind up the integrators.
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import solve_discrete_are

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.feedback_loop import active_axes, require_sampled
from palpate.control.kalman_filter import kalman, require_stabilizable
from palpate.errors import DesignError
from palpate.units import bounded_to_si


def lqg(
    plant: control.StateSpace,
    *,
    integrators: bool = True,
    force_weight: float = 2.0,
    speed_weight: float | str = 0.012,
    integral_rate: float | str = 8.0,
    state_weight: ArrayLike | None = None,
    disturbance: ArrayLike = 1.0,
    noise: ArrayLike = 0.01,
    windup_time: float | str = 0.01,
) -> Controller:
    """Return an LQG controller for a sampled plant from tip force to object force.

    Numbers are SI; a time, a rate or a force may also be text with a unit.

    Args:
        plant: 3 inputs (N), 3 outputs (N), sampled; see ``rendering_plant``. Axes without connection (y and
            z of a slider) get no controller.
        integrators: add the integral of F_ref - F_object on every axis, which removes the steady error.
        force_weight: cost of the commanded force relative to the force error, N^2/N^2; smaller is faster.
        speed_weight: cost of the object force's rate, s; approximately the time constant of the damping.
        integral_rate: cost of the integral, 1/s; approximately the decay rate of a steady error.
        state_weight: cost of the state of the plant (n, n) in place of the force error and its rate; with
            integrators (n + 3, n + 3) for (state, xi).
        disturbance: as in ``kalman``, force noise at the tip, N, or a process covariance.
        noise: as in ``kalman``, noise of F_object, N. The defaults correspond to 1 N of disturbance and the counts of
            a 0.03 mm encoder on an object of 1 N/mm.
        windup_time: time constant, s, with which the integrators track a saturated force.

    Raises:
        DesignError: the plant is not sampled or not 3 x 3, is not stabilizable or detectable, has a zero at z = 1
            although integrators are requested, or a weight is out of range.
    """
    period = require_sampled(plant, "lqg")
    force_weight = bounded_to_si(force_weight, "", "lqg: force_weight", error=DesignError)
    speed_weight = bounded_to_si(speed_weight, "s", "lqg: speed_weight", zero=True, error=DesignError)
    integral_rate = bounded_to_si(integral_rate, "1/s", "lqg: integral_rate", zero=not integrators, error=DesignError)
    windup_time = bounded_to_si(windup_time, "s", "lqg: windup_time", error=DesignError)
    axes = active_axes(plant)
    a, b, c, d = plant.A, plant.B[:, axes], plant.C[axes], plant.D[np.ix_(axes, axes)]
    require_stabilizable(a, b, "lqg: the plant is not stabilizable")

    filtering = kalman(control.StateSpace(a, b, c, d, period), disturbance, noise)
    augmented_a, augmented_b = _augment(a, b, c, d, period) if integrators else (a, b)
    weight, cross = _cost(a, b, c, d, period, speed_weight, integral_rate if integrators else None, state_weight)
    cost = force_weight * np.eye(len(axes)) + _input_cost(b, c, d, period, speed_weight, state_weight is None)
    gain, value = _regulator(augmented_a, augmented_b, weight, cost, cross)
    entry = _reference_gain(a, b, c, d, gain, value)
    matrices = _controller_matrices(a, b, c, d, gain, filtering.gain, entry, period, windup_time)
    system, antiwindup = _embed(*matrices, axes, period)
    notes: dict[str, Any] = {
        "integrators": integrators,
        "force_weight": force_weight,
        "speed_weight": speed_weight,
        "integral_rate": integral_rate if integrators else None,
        "feedback_poles": np.linalg.eigvals(augmented_a - augmented_b @ gain),
        "filter_poles": filtering.poles,
    }
    return Controller(system, antiwindup, "lqg", notes)


def _augment(a: Array, b: Array, c: Array, d: Array, period: float) -> tuple[Array, Array]:
    """Return A and B of the plant with the integrals of F_ref - F_object."""
    require_reachable_forces(a, b, c, d)
    n, m = b.shape
    return np.block([[a, np.zeros((n, m))], [-period * c, np.eye(m)]]), np.vstack([b, -period * d])


def _regulator(a: Array, b: Array, weight: Array, cost: Array, cross: Array) -> tuple[Array, Array]:
    """Return the optimal state feedback (m, n) and the solution of the Riccati equation (n, n)."""
    try:
        value = solve_discrete_are(a, b, weight, cost, s=cross)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(
            "lqg: the weights leave a mode on the unit circle; weigh every state that does not decay, or reduce "
            "force_weight"
        ) from error
    return np.linalg.solve(cost + b.T @ value @ b, b.T @ value @ a + cross.T), value


def _reference_gain(a: Array, b: Array, c: Array, d: Array, gain: Array, value: Array) -> Array:
    """Return the gain (m, m) from F_ref to u: equilibrium of the plant, and offset of the integrators."""
    n, m = b.shape
    rest = np.block([[a - np.eye(n), b], [c, d]])
    target = np.linalg.lstsq(rest, np.vstack([np.zeros((n, m)), np.eye(m)]), rcond=None)[0]
    state_at_rest, force_at_rest = target[:n], target[n:]
    entry = force_at_rest + gain[:, :n] @ state_at_rest
    if gain.shape[1] > n:
        offset = -np.linalg.solve(value[n:, n:], value[n:, :n] @ state_at_rest)
        entry = entry + gain[:, n:] @ offset
    return np.asarray(entry)


def _controller_matrices(
    a: Array, b: Array, c: Array, d: Array, gain: Array, filter_gain: Array, entry: Array, period: float, windup: float
) -> tuple[Array, Array, Array, Array, Array]:
    """Return A, B, C, D of the controller on the active axes, and its anti-windup matrix.

    The states are the prediction x(k|k-1), then xi; u = entry r - feedback x(k|k) - integral xi.
    """
    n, m = b.shape
    follow = -np.expm1(-period / windup)
    feedback, integral = gain[:, :n], gain[:, n:]
    extra = integral.shape[1]
    correct = np.eye(n) - filter_gain @ c
    direct = np.linalg.inv(np.eye(m) - feedback @ filter_gain @ d)
    cc = np.asarray(direct @ np.hstack([-feedback @ correct, -integral]), dtype=float)
    dd = np.asarray(direct @ np.hstack([entry, -feedback @ filter_gain]), dtype=float)
    known_force = b - a @ filter_gain @ d  # input of the applied force to the next prediction
    big_a = np.zeros((n + extra, n + extra))
    big_a[:n, :n] = a @ correct
    big_b = np.vstack([np.hstack([np.zeros((n, m)), a @ filter_gain]), np.zeros((extra, 2 * m))])
    back = known_force
    if extra:
        big_a[n:, n:] = np.eye(m)
        big_b[n:] = period * np.hstack([np.eye(m), -np.eye(m)])
        back = np.vstack([known_force, -follow * np.linalg.solve(direct @ integral, np.eye(m))])
    into = np.vstack([known_force, np.zeros((extra, m))])
    return big_a + into @ cc, big_b + into @ dd, cc, dd, back


def require_reachable_forces(a: Array, b: Array, c: Array, d: Array) -> None:
    """Raise DesignError if a constant object force has no constant command (a zero at z = 1)."""
    n = len(a)
    size = np.linalg.norm(c, axis=1, keepdims=True)
    reach = np.linalg.norm(b, axis=0)
    scale = np.where(size > 0, size, 1.0)
    push = np.where(reach > 0, reach, 1.0)
    rest = np.block([[a - np.eye(n), b / push], [c / scale, d / scale / push]])
    if np.linalg.svd(rest, compute_uv=False)[-1] < 1e-10:
        raise DesignError(
            "lqg: integrators need a plant without a zero at z = 1, which has a command for every constant force; "
            "use integrators=False"
        )


def _cost(
    a: Array, b: Array, c: Array, d: Array, period: float, speed: float, rate: float | None, state: ArrayLike | None
) -> tuple[Array, Array]:
    """Return the weight on (state, xi) and its cross term with u, (n + m, n + m) and (n + m, m)."""
    n, m = b.shape
    size = n + (m if rate is not None else 0)
    cross = np.zeros((size, m))
    if state is not None:
        weight = np.asarray(state, dtype=float)
        if weight.shape != (size, size) or not np.all(np.isfinite(weight)):
            raise DesignError(f"lqg: state_weight must be finite and {size} x {size}, not {weight.shape}")
        return 0.5 * (weight + weight.T), cross
    weight = np.zeros((size, size))
    forward = speed * c @ (a - np.eye(n)) / period
    weight[:n, :n] = c.T @ c + forward.T @ forward
    cross[:n] = c.T @ d + forward.T @ (speed * c @ b / period)
    if rate is not None:
        weight[n:, n:] = rate**2 * np.eye(m)
    return weight, cross


def _input_cost(b: Array, c: Array, d: Array, period: float, speed: float, on_output: bool) -> Array:
    """Return the part of the output's cost that is quadratic in u."""
    if not on_output:
        return np.zeros((b.shape[1], b.shape[1]))
    rate = speed * c @ b / period
    return np.asarray(d.T @ d + rate.T @ rate)


def _embed(
    a: Array, b: Array, c: Array, d: Array, back: Array, axes: NDArray[np.intp], period: float
) -> tuple[control.StateSpace, Array]:
    """Return the controller over all three axes, and its anti-windup matrix; unused axes command zero."""
    n = len(a)
    columns = np.concatenate([axes, 3 + axes])
    wide_b, tall_c, full_d, wide_back = np.zeros((n, 6)), np.zeros((3, n)), np.zeros((3, 6)), np.zeros((n, 3))
    wide_b[:, columns], tall_c[axes], full_d[np.ix_(axes, columns)] = b, c, d
    wide_back[:, axes] = back
    return control.StateSpace(a, wide_b, tall_c, full_d, period), wide_back
