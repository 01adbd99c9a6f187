"""Exact stability margins of the sampled loop with one channel or several, without approximation of the hold.

For a loop L(z) with m channels, stable under negative unity feedback:

- Gain interval: the connected interval of real k around 1 for which k L is stable, with the same k in every channel.
  It equals the interval of factors on the object's stiffness.
- Phase margin: the smallest rotation phi, equal in every channel, that puts an eigenvalue on the unit circle. There an
  eigenvalue of L(e^{j theta}) is -e^{j phi}.
- Delay margin: the smallest phi / theta over those frequencies, times the period. It is at most one period if an
  eigenvalue of L(-1) has a modulus of 1 or more: every whole number of samples below the margin is stable.
- Disk margin (symmetric disk, channels perturbed independently): alpha = 1 / max_theta sigma_max(S - I/2). Each channel
  may change simultaneously by any gain in [(2-alpha)/(2+alpha), (2+alpha)/(2-alpha)] or any phase below
  2 atan(alpha/2).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Any, Literal

import control
import numpy as np
from scipy.linalg import eigvals
from scipy.optimize import brentq, minimize_scalar

from palpate.arrays import Array, Complex, Flags
from palpate.control.controller import Controller
from palpate.control.feedback_loop import closed_loop_matrices, loop_gain, spectral_radius
from palpate.errors import DesignError

NARROW = 1e-4  # relative width of a range of unstable gains that a search may miss
CURVES = 1.5  # allowance for the curvature of an eigenvalue's modulus in a step
STEP = 1.02  # ratio of the gains of a search
BLOCK = 64  # gains that are evaluated together
UNBOUNDED = 1e6  # gain at which the search stops; the interval is then unbounded


@dataclass(frozen=True)
class Margins:
    """Margins of a stable sampled loop.

    Attributes:
        gain_down: smallest stable factor on all channels; 0 if there is none.
        gain_up: largest stable factor on all channels; inf if there is none.
        phase: phase margin of all channels, deg; inf if no rotation destabilizes.
        delay: delay margin of all channels, s; inf if the modulus of every eigenvalue of L stays below 1.
        crossover: highest frequency at which an eigenvalue of L has modulus 1, rad/s; 0 if none.
        disk: alpha of the symmetric disk margin; at most 2 for a loop without gain.
        disk_gain: admissible factor (or its inverse) on each channel independently.
        disk_phase: admissible phase of each channel independently, deg.
        peak_frequency: frequency of the least disk margin, rad/s.
        spectral_radius: largest modulus of the closed loop's eigenvalues.
    """

    gain_down: float
    gain_up: float
    phase: float
    delay: float
    crossover: float
    disk: float
    disk_gain: float
    disk_phase: float
    peak_frequency: float
    spectral_radius: float

    def to_dict(self) -> dict[str, Any]:
        """Return the margins as a dictionary for reports."""
        return asdict(self)


def margins(
    controller: Controller, plant: control.StateSpace, at: Literal["command", "object_force"] = "command"
) -> Margins:
    """Return the margins of the loop of ``controller`` and ``plant``, broken at ``at``.

    Raises:
        DesignError: the loop is unstable, or controller and plant do not fit.
    """
    return loop_margins(loop_gain(controller, plant, at))


def loop_margins(loop: control.StateSpace) -> Margins:
    """Return the margins of a sampled loop gain L(z) (m x m), negative feedback.

    Raises:
        DesignError: L is not square and sampled, or the closed loop is unstable.
    """
    if loop.ninputs != loop.noutputs or not loop.isdtime(strict=True) or loop.dt is True:
        raise DesignError("margins: the loop gain must be square and sampled with its period in s")
    radius = spectral_radius(loop)
    if radius >= 1.0:
        raise DesignError(
            f"margins: the loop is unstable (spectral radius {radius:.6f}), so it has no margins; "
            "critical_gain gives the gain that would be stable"
        )
    down, up = gain_interval(loop)
    crossings = _unit_crossings(loop)
    phase, delay = np.inf, np.inf
    for theta, angle in crossings:
        # L's eigenvalue is e^{j angle}: a lag of angle + pi brings it to -1, a lead of pi - angle as well.
        lag = np.mod(angle + np.pi, 2 * np.pi)
        phase = min(phase, lag, 2 * np.pi - lag)
        if theta > 0:
            delay = min(delay, lag / theta * float(loop.dt))
    if np.abs(np.linalg.eigvals(frequency_response(loop, np.pi))).max() >= 1.0:
        delay = min(delay, float(loop.dt))  # a delay of one sample turns the sign there
    peak, where = _peak(loop)
    alpha = 1 / peak if peak > 0 else np.inf
    ratio = (2 + alpha) / (2 - alpha) if alpha < 2 else np.inf
    return Margins(
        gain_down=down,
        gain_up=up,
        phase=float(np.degrees(phase)),
        delay=float(delay),
        crossover=max((theta for theta, _ in crossings), default=0.0) / float(loop.dt),
        disk=float(alpha),
        disk_gain=float(ratio),
        disk_phase=float(np.degrees(2 * np.arctan(alpha / 2))),
        peak_frequency=where / float(loop.dt),
        spectral_radius=radius,
    )


def gain_interval(loop: control.StateSpace, around: float = 1.0) -> tuple[float, float]:
    """Return the interval (low, high) of real gains about ``around`` for which the closed loop is stable.

    The search makes steps of 2 %. Where the slope of an eigenvalue's modulus may lead it out of the circle and back
    within a step, the step is halved, down to `NARROW`. Bisection locates the ends to 1e-10 relative.

    Raises:
        DesignError: ``around`` itself is not stable.
    """
    if spectral_radius(loop, around) >= 1.0:
        raise DesignError(f"gain_interval: the loop is unstable at the gain {around:g} to start from")
    steps = STEP ** np.arange(np.ceil(np.log(UNBOUNDED) / np.log(STEP)) + 1)
    down, up = _first_exit(loop, around / steps), _first_exit(loop, around * steps)
    return 0.0 if down is None else down, np.inf if up is None else up


def critical_gain(loop: control.StateSpace, largest: float = 1.0) -> float:
    """Return the least positive gain k <= ``largest`` at which k L leaves the unit circle, from small gains up.

    For a loop that is unstable at ``largest`` this is the limit of the relative stiffness or controller gain.

    Raises:
        DesignError: the loop is stable up to ``largest``, or unstable at every gain down to ``largest`` / 1e6.
    """
    gains = largest * np.geomspace(1 / UNBOUNDED, 1.0, 1400)
    stable = np.abs(np.linalg.eigvals(closed_loop_matrices(loop, gains))).max(axis=1, initial=0.0) < 1.0
    if not stable.any():
        raise DesignError(f"critical_gain: the loop is unstable at every gain from {gains[0]:.3g} to {largest:g}")
    found = _first_exit(loop, gains[int(np.argmax(stable)) :])
    if found is None:
        raise DesignError(f"critical_gain: the loop is stable up to the gain {largest:g}")
    return found


def _first_exit(loop: control.StateSpace, gains: Array) -> float | None:
    """Return the critical gain in the first interval of ``gains`` that the loop leaves; the first gain is stable."""
    for start in range(0, len(gains) - 1, BLOCK):
        block = gains[start : start + BLOCK + 1]
        sizes, slopes = _moduli(loop, block)
        ways = np.diff(block)[:, None]
        may_leave = _reaches(sizes[:-1], slopes[:-1], ways) & _reaches(sizes[1:], slopes[1:], -ways)
        for k in np.flatnonzero((sizes[1:].max(axis=1, initial=0.0) >= 1.0) | may_leave):
            if (found := _exit(loop, float(block[k]), float(block[k + 1]))) is not None:
                return _edge(loop, *found)
    return None


def _exit(loop: control.StateSpace, inside: float, outside: float) -> tuple[float, float] | None:
    """Return a stable gain and an unstable one next to it between two gains, the first stable; None if none is found.

    The range is halved where an eigenvalue may leave the circle and come back in it.
    """
    if spectral_radius(loop, outside) >= 1.0:
        return inside, outside
    if abs(outside - inside) <= NARROW * inside or not _may_leave(loop, inside, outside):
        return None
    middle = 0.5 * (inside + outside)
    return _exit(loop, inside, middle) or _exit(loop, middle, outside)


def _may_leave(loop: control.StateSpace, first: float, last: float) -> bool:
    """Return whether the slopes of the eigenvalues' moduli at both gains lead one out of the circle in between."""
    sizes, slopes = _moduli(loop, np.array([first, last]))
    return bool(_reaches(sizes, slopes, np.array([[last - first], [first - last]])).all())


def _moduli(loop: control.StateSpace, gains: Array) -> tuple[Array, Array]:
    """Return the closed loop's eigenvalues' moduli (k, n) at gains (k,), and their slopes: inf if one is double."""
    values, right = np.linalg.eig(closed_loop_matrices(loop, gains))
    sizes = np.abs(values)
    feedback = np.linalg.inv(np.eye(loop.noutputs) + gains[:, None, None] * loop.D)
    try:
        turned = np.linalg.solve(right, loop.B @ feedback)
    except np.linalg.LinAlgError:
        return sizes, np.full_like(sizes, np.inf)
    rates = -np.einsum("kij,kji->ki", turned, feedback @ loop.C @ right)
    return sizes, np.real(np.conj(values) * rates) / np.maximum(sizes, 1e-300)


def _reaches(sizes: Array, slopes: Array, ways: Array) -> Flags:
    """Return whether slopes (k, n) may lead a modulus (k, n) out of the circle within changes of the gain (k, 1): (k,).

    A slope of inf, which is not known, may.
    """
    with np.errstate(invalid="ignore"):
        ahead = sizes + CURVES * np.fmax(slopes * ways, 0.0)
    return np.asarray(((ahead >= 1.0) | np.isinf(slopes)).any(axis=1), dtype=bool)


def _edge(loop: control.StateSpace, inside: float, outside: float) -> float:
    """Return the critical gain between a stable and an unstable one, by bisection."""
    for _ in range(80):
        middle = 0.5 * (inside + outside)
        if abs(outside - inside) <= 1e-12 * abs(outside):
            break
        if spectral_radius(loop, middle) < 1.0:
            inside = middle
        else:
            outside = middle
    return float(0.5 * (inside + outside))


def frequency_response(sys: control.StateSpace, theta: float | Array) -> Complex:
    """Return the response (..., p, m) at e^{j theta}, theta (...) in rad per sample."""
    n = sys.nstates
    inverse = np.exp(1j * np.asarray(theta))[..., None, None] * np.eye(n) - sys.A
    inputs = np.broadcast_to(sys.B, (*np.shape(theta), n, sys.ninputs))
    return np.asarray(sys.D + sys.C @ np.linalg.solve(inverse, inputs), dtype=complex)


def _grid(loop: control.StateSpace) -> Array:
    """Return angles in (0, pi], dense about the resonances of the closed loop."""
    base = np.concatenate([np.geomspace(1e-6, np.pi, 600), np.linspace(0.01, np.pi, 400)])
    closed = loop.A - loop.B @ np.linalg.solve(np.eye(loop.noutputs) + loop.D, loop.C)
    return _refined(base, closed, np.linspace(-6, 6, 49), 1e-9)


def _unit_crossings(loop: control.StateSpace) -> list[tuple[float, float]]:
    """Return (theta, angle) where an eigenvalue e^{j angle} of L(e^{j theta}) crosses the unit circle.

    The eigenvalues are sorted by modulus: at a unit modulus the sorted one is continuous, so a change of sign of
    log|lambda| is a crossing.
    """
    theta = _grid(loop)

    def levels(t: float | Array) -> Complex:
        values = np.linalg.eigvals(frequency_response(loop, t))
        return np.asarray(np.take_along_axis(values, np.argsort(np.abs(values), axis=-1), -1), dtype=complex)

    table = levels(theta)
    with np.errstate(divide="ignore"):
        level = np.log(np.abs(table))
    found = []
    for j in range(loop.noutputs):

        def height(t: float, j: int = j) -> float:
            return float(np.log(abs(levels(t)[j])))

        for k in np.nonzero(level[:-1, j] * level[1:, j] < 0)[0]:
            root = float(brentq(height, theta[k], theta[k + 1], xtol=1e-14, rtol=1e-13))
            found.append((root, float(np.angle(levels(root)[j]))))
    return found


def _peak(loop: control.StateSpace) -> tuple[float, float]:
    """Return max over theta of sigma_max(S - I/2) and where, S = (I + L)^-1."""
    m = loop.noutputs
    feedback = np.linalg.inv(np.eye(m) + loop.D)
    s = control.StateSpace(
        loop.A - loop.B @ feedback @ loop.C, loop.B @ feedback, -feedback @ loop.C, feedback - 0.5 * np.eye(m), loop.dt
    )
    return peak_gain(s)


def peak_gain(sys: control.StateSpace) -> tuple[float, float]:
    """Return the H-infinity norm of a stable sampled system and the angle (rad per sample) of its peak.

    A grid gives a candidate. The symplectic pencil gives the frequencies at a level just above it, and the search
    continues between them until there are none (Bruinsma & Steinbuch 1990).
    """

    def height(t: float) -> float:
        return float(np.linalg.norm(frequency_response(sys, t), 2))

    def heights(theta: Array) -> Array:
        return np.asarray(np.linalg.norm(frequency_response(sys, theta), 2, axis=(-2, -1)))

    def climb(low: float, high: float) -> tuple[float, float]:
        best = minimize_scalar(lambda t: -height(t), bounds=(low, high), method="bounded", options={"xatol": 1e-13})
        return max((height(t), t) for t in (low, high, float(best.x)))

    grid = _refined(np.geomspace(1e-6, np.pi, 300), sys.A, np.linspace(-4, 4, 17), 0.0)
    theta = np.concatenate([[0.0], grid])
    k = int(np.argmax(heights(theta)))
    peak, where = climb(theta[max(k - 1, 0)], theta[min(k + 1, len(theta) - 1)])
    for _ in range(20):
        level = peak * (1 + 1e-6)
        edges = np.concatenate([[0.0], np.sort(_at_level(sys, level)), [np.pi]])
        spans = [(a, b) for a, b in pairwise(edges) if height(0.5 * (a + b)) > level]
        if not spans:
            break
        peak, where = max(climb(a, b) for a, b in spans)
    return float(peak), float(where)


def _refined(base: Array, a: Array, offsets: Array, smallest: float) -> Array:
    """Return angles in (smallest, pi]: `base`, and `offsets` in half widths about the resonances of a (n, n)."""
    parts = [base]
    for z in np.linalg.eigvals(a):
        if abs(z) > 0:
            parts.append(abs(np.angle(z)) + max(abs(np.log(abs(z))), 1e-6) * offsets)
    theta = np.unique(np.concatenate(parts))
    return np.asarray(theta[(theta > smallest) & (theta <= np.pi)], dtype=float)


def _at_level(sys: control.StateSpace, level: float) -> Array:
    """Return the angles in (0, pi) at which a singular value of the system equals ``level``.

    They are the unit-modulus eigenvalues of the pencil of G(1/z)^T G(z) = level^2.
    """
    a, b, c, d = sys.A, sys.B, sys.C, sys.D
    n = len(a)
    r = level**2 * np.eye(b.shape[1]) - d.T @ d
    ri = np.linalg.inv(r)
    at = a + b @ ri @ d.T @ c
    zero, eye = np.zeros((n, n)), np.eye(n)
    left = np.block([[at, zero], [-c.T @ (np.eye(len(c)) + d @ ri @ d.T) @ c, eye]])
    right = np.block([[eye, -b @ ri @ b.T], [zero, at.T]])
    values = eigvals(left, right)
    values = values[np.isfinite(values)]
    on = values[np.abs(np.abs(values) - 1) < 1e-8]
    angles = np.angle(on)
    return np.asarray(angles[angles > 0], dtype=float)
