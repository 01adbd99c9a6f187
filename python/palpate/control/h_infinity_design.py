"""Discrete H-infinity synthesis by two Riccati equations: the yardstick of a loop's robustness.

The map z = (1 + w)/(1 - w) keeps stability and the H-infinity norm. A sampled problem therefore becomes a continuous
one, which has formulas for both Riccati equations and the controller (Zhou, Doyle & Glover 1996, theorem 17.1). The
result is accepted only if the sampled loop with it is stable and its norm, computed separately, is the level found.

The gap margin b of a loop of P and K is 1/||[K; I] (I - P K)^-1 [I P]||, between 0 and 1. It is the size of the
smallest perturbation of the plant's normalized coprime factors that destabilizes the loop. Its optimum over all
controllers has a closed form (Glover & McFarlane 1989).
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from scipy.linalg import schur, solve_continuous_are

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.feedback_loop import active_axes, loop_gain, require_sampled
from palpate.control.stability_margins import frequency_response, loop_margins, peak_gain
from palpate.errors import DesignError

_RESOLUTION = 1e-9  # relative, of the level found by bisection


@dataclass(frozen=True)
class HInfinityDesign:
    """Controller that minimizes the H-infinity norm of a sampled loop.

    Attributes:
        controller: from measurements to commands, sampled; u = K y.
        level: gamma, the least norm from disturbances to errors.
    """

    controller: control.StateSpace
    level: float


def h_infinity(plant: control.StateSpace, measurements: int, commands: int) -> HInfinityDesign:
    """Return the controller u = K y that minimizes the norm from w to z of a sampled plant (w, u) to (z, y).

    Args:
        plant: sampled, with inputs (w, u) and outputs (z, y); D12 of full column rank and D21 of full row rank.
        measurements: number of y, the last outputs.
        commands: number of u, the last inputs.

    Raises:
        DesignError: the plant is not sampled, or does not meet the assumptions of the formulas.
    """
    if not plant.isdtime(strict=True) or plant.dt is True:
        raise DesignError("h_infinity: the plant must be sampled with its period in s")
    problem = _Problem.of(plant, measurements, commands)
    low, high = problem.direct, max(problem.direct, 1e-6)
    while problem.controller(high) is None:
        low, high = high, 2.0 * high
        if high > 1e9:
            raise DesignError("h_infinity: no controller stabilizes the plant; is it stabilizable and detectable?")
    while high - low > _RESOLUTION * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if problem.controller(middle) is not None else (middle, high)
    level = high * (1.0 + 10 * _RESOLUTION)
    found = problem.controller(level)
    if found is None:
        raise DesignError("h_infinity: the equations have no accurate solution at the level found")
    law = problem.sampled(found, float(plant.dt))
    closed = lower_feedback(plant, law)
    if np.abs(np.linalg.eigvals(closed.A)).max(initial=0.0) >= 1.0:
        raise DesignError(
            "h_infinity: the loop with the controller found is not stable; the problem is ill-conditioned"
        )
    norm = peak_gain(closed)[0]
    if not norm <= level * (1.0 + 1e-4):
        raise DesignError(f"h_infinity: the loop has the norm {norm:g} in place of {level:g}; it is ill-conditioned")
    return HInfinityDesign(law, float(high))


def lower_feedback(plant: control.StateSpace, law: control.StateSpace) -> control.StateSpace:
    """Return the loop from w to z of a plant (w, u) to (z, y) with u = K y."""
    m, p = plant.ninputs - law.noutputs, plant.noutputs - law.ninputs
    b1, b2, c1, c2 = plant.B[:, :m], plant.B[:, m:], plant.C[:p], plant.C[p:]
    d11, d12, d21, d22 = plant.D[:p, :m], plant.D[:p, m:], plant.D[p:, :m], plant.D[p:, m:]
    e = np.linalg.inv(np.eye(law.noutputs) - law.D @ d22)
    u_x, u_w = e @ np.hstack([law.D @ c2, law.C]), e @ law.D @ d21
    y_x = np.hstack([c2, np.zeros((len(c2), law.nstates))]) + d22 @ u_x
    y_w = d21 + d22 @ u_w
    n, k = plant.nstates, law.nstates
    a = np.block([[plant.A, np.zeros((n, k))], [np.zeros((k, n)), law.A]]) + np.vstack([b2 @ u_x, law.B @ y_x])
    b = np.vstack([b1 + b2 @ u_w, law.B @ y_w])
    c = np.hstack([c1, np.zeros((p, k))]) + d12 @ u_x
    return control.StateSpace(a, b, c, d11 + d12 @ u_w, plant.dt)


@dataclass(frozen=True)
class _Problem:
    """Continuous problem with D12 = [0; I], D21 = [0 I] and D22 = 0, and the maps back.

    `direct` bounds the level from below.
    """

    a: Array
    b1: Array
    b2: Array
    c1: Array
    c2: Array
    d11: Array
    d22: Array
    to_u: Array
    to_y: Array
    direct: float

    @classmethod
    def of(cls, plant: control.StateSpace, measurements: int, commands: int) -> _Problem:
        m, p = plant.ninputs - commands, plant.noutputs - measurements
        a, b, c, d = bilinear(plant.A, plant.B, plant.C, plant.D)
        # rotate w and z, and scale u and y, to the normalized D12 and D21
        left, s, vt = np.linalg.svd(d[:p, m:])
        right_left, s2, right = np.linalg.svd(d[p:, :m])
        if len(s) < commands or s.min(initial=np.inf) < 1e-10 or len(s2) < measurements or s2.min() < 1e-10:
            raise DesignError(
                "h_infinity: every command must have a cost and every measurement a noise (D12 and D21 of full rank)"
            )
        to_u = vt.T / s
        to_y = (right_left / s2).T
        turn_z, turn_w = np.roll(left, -commands, axis=1), np.roll(right.T, -measurements, axis=1)
        d11 = turn_z.T @ d[:p, :m] @ turn_w
        q, r = p - commands, m - measurements
        sides = (d11[:q], d11[:, :r])
        direct = max((float(np.linalg.norm(side, 2)) for side in sides if side.size), default=0.0)
        return cls(
            a, b[:, :m] @ turn_w, b[:, m:] @ to_u, turn_z.T @ c[:p], to_y @ c[p:], d11, d[p:, m:], to_u, to_y, direct
        )

    def controller(self, level: float) -> tuple[Array, Array, Array, Array] | None:
        """Return the central controller (A, B, C, D) of the normalized problem; None if the level is not reached."""
        n, m1, m2, p1, p2 = len(self.a), self.b1.shape[1], self.b2.shape[1], len(self.c1), len(self.c2)
        q, r = p1 - m2, m1 - p2
        if level <= self.direct:
            return None
        b, c = np.hstack([self.b1, self.b2]), np.vstack([self.c1, self.c2])
        d1 = np.hstack([self.d11, np.vstack([np.zeros((q, m2)), np.eye(m2)])])
        d2 = np.vstack([self.d11, np.hstack([np.zeros((p2, r)), np.eye(p2)])])
        weight = d1.T @ d1 - np.diag(np.r_[np.full(m1, level**2), np.zeros(m2)])
        noise = d2 @ d2.T - np.diag(np.r_[np.full(p1, level**2), np.zeros(p2)])
        x = _riccati(self.a, b, self.c1.T @ self.c1, self.c1.T @ d1, weight)
        y = _riccati(self.a.T, c.T, self.b1 @ self.b1.T, self.b1 @ d2.T, noise)
        if x is None or y is None or np.abs(np.linalg.eigvals(x @ y)).max(initial=0.0) >= level**2:
            return None
        f = -np.linalg.solve(weight, d1.T @ self.c1 + b.T @ x)
        gain = -np.linalg.solve(noise.T, (self.b1 @ d2.T + y @ c.T).T).T
        f12, f2, l12, l2 = f[r:m1], f[m1:], gain[:, q:p1], gain[:, p1:]
        d1111, d1112 = self.d11[:q, :r], self.d11[:q, r:]
        d1121, d1122 = self.d11[q:, :r], self.d11[q:, r:]
        inner = np.linalg.inv(level**2 * np.eye(q) - d1111 @ d1111.T) if q else np.zeros((0, 0))
        outer = np.linalg.inv(level**2 * np.eye(r) - d1111.T @ d1111) if r else np.zeros((0, 0))
        k11 = -d1121 @ d1111.T @ inner @ d1112 - d1122
        k12 = np.eye(m2) - d1121 @ outer @ d1121.T
        k21 = np.eye(p2) - d1112.T @ inner @ d1112
        if min(np.linalg.eigvalsh(k12).min(), np.linalg.eigvalsh(k21).min()) <= 0.0:
            return None
        z = np.linalg.inv(np.eye(n) - y @ x / level**2)
        into = -z @ l2 + z @ (self.b2 + l12) @ k11
        measured = -(self.c2 + f12)  # D21^-1 C2 of the controller
        return self.a + b @ f + into @ measured, into, f2 + k11 @ measured, k11

    def sampled(self, law: tuple[Array, Array, Array, Array], period: float) -> control.StateSpace:
        """Return the controller of the original problem."""
        a, b, c, d = law
        b, c, d = b @ self.to_y, self.to_u @ c, self.to_u @ d @ self.to_y
        e = np.linalg.inv(np.eye(len(d)) + d @ self.d22)  # u = K (y - D22 u)
        a, b, c, d = a - b @ self.d22 @ e @ c, b - b @ self.d22 @ e @ d, e @ c, e @ d
        return control.StateSpace(*bilinear(a, b, c, d, back=True), period)


def bilinear(a: Array, b: Array, c: Array, d: Array, back: bool = False) -> tuple[Array, Array, Array, Array]:
    """Return the system under z = (1 + w)/(1 - w), from z to w or ``back``; the norm stays the same.

    Raises:
        DesignError: the system has a pole at z = -1, or at w = 1, which the map sends to infinity.
    """
    eye, sign = np.eye(len(a)), -1.0 if back else 1.0
    if len(a) and np.linalg.cond(eye + sign * a) > 1e14:
        raise DesignError("h_infinity: a pole at half the sampling rate; delay the plant or change its period slightly")
    e = np.linalg.inv(eye + sign * a)
    if back:
        return (eye + a) @ e, np.sqrt(2.0) * e @ b, np.sqrt(2.0) * c @ e, d + c @ e @ b
    return e @ (a - eye), np.sqrt(2.0) * e @ b, np.sqrt(2.0) * c @ e, d - c @ e @ b


def _riccati(a: Array, b: Array, q: Array, cross: Array, r: Array) -> Array | None:
    """Return the stabilizing X >= 0 of A'X + XA + Q - (XB + S) R^-1 (B'X + S') = 0; None if there is none."""
    n = len(a)
    try:
        h = np.block([[a, np.zeros((n, n))], [-q, -a.T]]) - np.vstack([b, -cross]) @ np.linalg.solve(
            r, np.hstack([cross.T, b.T])
        )
        if np.abs(np.linalg.eigvals(h).real).min(initial=np.inf) < 1e-12 * max(np.abs(h).max(initial=0.0), 1e-300):
            return None
        _, vectors, count = schur(h, output="real", sort="lhp")
        x = np.linalg.solve(vectors[:n, :n].T, vectors[n:, :n].T).T
    except np.linalg.LinAlgError:
        return None
    if count != n or not np.isfinite(x).all():
        return None
    x = 0.5 * (x + x.T)
    smallest = np.linalg.eigvalsh(x).min(initial=0.0)
    return x if smallest >= -1e-9 * max(float(np.abs(x).max(initial=0.0)), 1e-300) else None


def gap_margin(plant: control.StateSpace, feedback: control.StateSpace) -> float:
    """Return the gap margin b of the loop y = P u, u = K y, between 0 and 1; 0 if it is not stable."""
    m, p = plant.ninputs, plant.noutputs
    zero, b = np.zeros((p, p)), plant.B
    # disturbances on y and u; errors u and y
    four = control.StateSpace(
        plant.A,
        np.hstack([np.zeros((len(plant.A), p)), b, b]),
        np.vstack([np.zeros((m, len(plant.A))), plant.C, plant.C]),
        np.block(
            [
                [np.zeros((m, p)), np.zeros((m, m)), np.eye(m)],
                [zero + np.eye(p), plant.D, plant.D],
                [zero + np.eye(p), plant.D, plant.D],
            ]
        ),
        plant.dt,
    )
    closed = lower_feedback(four, feedback)
    if closed.nstates and np.abs(np.linalg.eigvals(closed.A)).max() >= 1.0:
        return 0.0
    return 1.0 / peak_gain(closed)[0]


def optimal_gap_margin(plant: control.StateSpace) -> float:
    """Return the largest gap margin that any controller gives a sampled plant: (1 + largest eigenvalue of X Z)^-1/2."""
    a, b, c, d = bilinear(plant.A, plant.B, plant.C, plant.D)
    r, s = np.eye(d.shape[1]) + d.T @ d, np.eye(len(d)) + d @ d.T
    inner = a - b @ np.linalg.solve(r, d.T @ c)
    q = c.T @ np.linalg.solve(s, c)
    try:
        x = solve_continuous_are(inner, b, q, r)
        z = solve_continuous_are(inner.T, c.T, b @ np.linalg.solve(r, b.T), s)
    except np.linalg.LinAlgError as problem:
        raise DesignError("optimal_gap_margin: the plant is not stabilizable and detectable") from problem
    return float((1.0 + np.abs(np.linalg.eigvals(x @ z)).max()) ** -0.5)


@dataclass(frozen=True)
class Robustness:
    """Gap margin of a loop beside the best that any controller has at the same crossover.

    Attributes:
        margin: b of the loop.
        optimum: largest b of any controller for the same scaled plant.
        crossover: frequency at which the plant is scaled to unit gain, rad/s.
    """

    margin: float
    optimum: float
    crossover: float

    @property
    def share(self) -> float:
        """Share of the optimal robustness, 0 to 1."""
        return self.margin / self.optimum


def robustness(controller: Controller, plant: control.StateSpace, crossover: float | None = None) -> Robustness:
    """Return the robustness of a sampled loop beside the optimum, the plant scaled to unit gain at the crossover.

    The optimal controller has no integrator unless the plant has one, so a controller with integrators cannot reach it.

    Args:
        controller: force tracking.
        plant: 3 tip forces to 3 object forces, sampled.
        crossover: rad/s; None: that of the loop, the largest of its axes.

    Raises:
        DesignError: the loop is not stable, or controller and plant do not fit.
    """
    period = require_sampled(plant, "robustness")
    if crossover is None:
        crossover = loop_margins(loop_gain(controller, plant)).crossover
    axes = active_axes(plant)
    part = control.StateSpace(plant.A, plant.B[:, axes], plant.C[axes], plant.D[np.ix_(axes, axes)], period)
    gain = 1.0 / float(np.linalg.norm(frequency_response(part, crossover * period), 2))
    h = controller.feedback
    scaled = control.StateSpace(part.A, part.B, gain * part.C, gain * part.D, period)
    law = control.StateSpace(h.A, h.B[:, axes] / gain, h.C[axes], h.D[np.ix_(axes, axes)] / gain, period)
    return Robustness(gap_margin(scaled, law), optimal_gap_margin(scaled), float(crossover))
