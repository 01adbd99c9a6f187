"""How stiff a wall can be: the exact critical stiffness, and the whole boundary in stiffness and damping as a curve."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, TypeAlias

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.checks import finite
from palpate.errors import StabilityError
from palpate.linear.linear_device import LinearDevice, SampledDevice
from palpate.linear.wall import WallLoop, wall_loop

__all__ = [
    "Boundary",
    "StabilityInterval",
    "critical_stiffness",
    "stability_boundary",
    "stability_interval",
    "wall_spectral_radius",
]

Array = NDArray[np.float64]
OPTIONS = frozenset({"period", "delay", "velocity_filter", "controller"})
Device: TypeAlias = LinearDevice | SampledDevice | WallLoop | control.StateSpace


@dataclass(frozen=True)
class StabilityInterval:
    """The range of stiffness that a loop bears, from the softest wall up.

    Attributes:
        stiffness: least stiffness at which a root leaves the unit circle, N/m; 0 if no wall is stable, inf if none is
            too stiff.
        min_stable_stiffness: stiffness from which on the loop is stable, N/m; above 0 if the device
            falls over without a wall.
        frequency: of the oscillation at the limit, Hz; half the sampling rate for a root at -1, nan if there is none.
    """

    stiffness: float
    min_stable_stiffness: float
    frequency: float


@dataclass(frozen=True)
class Boundary:
    """The edge of the stable walls, each point a root on the unit circle with all others inside.

    Attributes:
        damping: B (k,), N s/m.
        stiffness: K (k,), N/m.
        angle: where the root is, (k,), rad per sample.
        inside: a (B, K) between curve and K = 0 that was confirmed to be stable.
    """

    damping: Array
    stiffness: Array
    angle: Array
    inside: tuple[float, float]

    def __str__(self) -> str:
        b, k = self.stiffest
        return f"Walls up to {k:.5g} N/m, with {b:.4g} N s/m; {len(self.damping)} points of the boundary."

    @property
    def stiffest(self) -> tuple[float, float]:
        """Return the (B, K) of the largest K on the curve."""
        k = int(np.argmax(self.stiffness))
        return float(self.damping[k]), float(self.stiffness[k])

    @property
    def pieces(self) -> list[tuple[int, int]]:
        """Return (first, past the last) of the stretches of the curve without a jump."""
        if len(self.damping) < 3:
            return [(0, len(self.damping))]
        wide, high = (float(np.ptp(values)) or 1.0 for values in (self.damping, self.stiffness))
        jump = np.hypot(np.diff(self.damping) / wide, np.diff(self.stiffness) / high) > 0.05
        ends = [0, *(np.flatnonzero(jump) + 1).tolist(), len(self.damping)]
        return list(pairwise(ends))

    def up_to(self, damping: float) -> Boundary:
        """Return the part of the curve up to B = ``damping``, N s/m."""
        kept = self.damping <= damping
        return Boundary(self.damping[kept], self.stiffness[kept], self.angle[kept], self.inside)


def _loop(device: Device, options: dict[str, Any]) -> WallLoop:
    if isinstance(device, WallLoop):
        if options:
            raise StabilityError(f"{min(options)} belongs to the loop, which is given already")
        return device
    if strange := options.keys() - OPTIONS:
        hint = "; the wall's damping is virtual_damping" if "damping" in strange else ""
        raise StabilityError(f"{min(strange)} is no option of a loop: there are {', '.join(sorted(OPTIONS))}{hint}")
    return wall_loop(device, **options)


def critical_stiffness(device: Device, *, virtual_damping: float = 0.0, **loop: Any) -> float:
    """Return the least stiffness (N/m) at which ``device`` against a wall loses stability, exactly.

    Args:
        device: a LinearDevice, a continuous SISO state space from force (N) to motion (m), or a WallLoop.
        virtual_damping: B of the wall, N s/m.
        **loop: period (s), delay (samples, whole or not), velocity_filter, controller: as ``wall_loop``.

    Raises:
        StabilityError: as ``wall_loop``.
    """
    return stability_interval(_loop(device, loop), virtual_damping).stiffness


def stability_interval(loop: WallLoop, virtual_damping: float = 0.0) -> StabilityInterval:
    """Return the first interval of stiffness, from zero up, in which the loop is stable.

    Every real K that puts a root on the unit circle is found: at +1, at -1, and in between where Im W = B Im V. The
    intervals between them are judged by their eigenvalues.
    """
    b = finite(virtual_damping, "virtual_damping", "N s/m")
    for density in (1, 8):
        angles, values = _crossings(loop, b, density)
        edges = np.concatenate([[0.0], values, [2 * values[-1] if values.size else 1.0]])
        middles = 0.5 * (edges[1:] + edges[:-1])
        stable = [_inside(loop, k, b) for k in middles]
        if not any(stable):
            return StabilityInterval(0.0, 0.0, float("nan"))
        first = stable.index(True)
        last = first
        while last + 1 < len(stable) and stable[last + 1]:
            last += 1
        min_stable_stiffness = float(edges[first])
        if last == len(stable) - 1:
            return StabilityInterval(float("inf"), min_stable_stiffness, float("nan"))
        stiffest = float(edges[last + 1])
        probes = min_stable_stiffness + (stiffest - min_stable_stiffness) * np.concatenate(
            [np.geomspace(1e-3, 0.5, 6), [0.7, 0.9, 0.999]]
        )
        if all(_inside(loop, k, b) for k in probes) and not _inside(
            loop, min_stable_stiffness + (stiffest - min_stable_stiffness) * 1.001, b
        ):
            break
    frequency = float(angles[last]) / (2 * np.pi * loop.period)
    return StabilityInterval(stiffest, min_stable_stiffness, frequency)


def _inside(loop: WallLoop, stiffness: float, damping: float) -> bool:
    return loop.spectral_radius(stiffness, damping) < 1.0


def _grid(loop: WallLoop, density: int = 1) -> Array:
    """Return angles in (0, pi), dense about the device's resonances."""
    near = [np.geomspace(1e-5, np.pi, 700 * density), np.linspace(1e-3, np.pi, 500 * density)]
    for value in np.linalg.eigvals(np.eye(len(loop.tip.step)) + loop.tip.step):
        if abs(value) > 0 and abs(np.angle(value)) > 0:
            width = max(abs(np.log(abs(value))), 1e-7)
            near.append(abs(np.angle(value)) + width * np.linspace(-8, 8, 64 * density + 1))
    theta = np.unique(np.concatenate(near))
    return np.asarray(theta[(theta > 1e-6) & (theta < np.pi * (1 - 1e-9))], dtype=float)


def _crossings(loop: WallLoop, b: float, density: int) -> tuple[Array, Array]:
    """Return (angle, K), K ascending and positive, of every root on the unit circle with damping ``b``."""

    def off(theta: Array) -> Array:
        return np.asarray(loop.required_wall_response(theta).imag - b * loop.velocity_response(theta).imag, dtype=float)

    theta = _grid(loop, density)
    height = off(theta)
    k = np.nonzero(height[:-1] * height[1:] < 0)[0]
    low, high, at_low = theta[k], theta[k + 1], height[k]
    for _ in range(60):  # all at once; a bracket of 1e-2 shrinks to rounding
        middle = 0.5 * (low + high)
        if middle.size == 0 or np.all(high - low <= 4e-16 * high):
            break
        at_middle = off(middle)
        left = at_middle * at_low > 0
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    angles = np.concatenate([0.5 * (low + high), [np.pi]])
    values = loop.required_wall_response(angles).real - b * loop.velocity_response(angles).real
    static = _static_edge(loop)
    angles, values = np.concatenate([angles, [0.0]]), np.concatenate([values, [static]])
    # a sign change through a pole of W, where the device does not answer, is no root
    real = np.isfinite(values) & (values > 0) & (values < 1e15)
    order = np.argsort(values[real])
    return angles[real][order], values[real][order]


def _static_edge(loop: WallLoop) -> float:
    """Return the stiffness that makes up for what the device lacks of its own: a root at +1; 0 if it rests anywhere."""
    step = loop.tip.step
    scale = np.abs(step).max()
    if np.linalg.matrix_rank(step / scale, tol=1e-13) < len(step):
        return 0.0
    gain = -loop.tip.out @ np.linalg.solve(step, loop.tip.now + loop.tip.before)
    if (c := loop.controller) is not None:
        rest = np.eye(c.nstates) - c.A
        if c.nstates and np.linalg.matrix_rank(rest) < c.nstates:
            return 0.0  # an integrator holds any load
        gain = gain * float((c.C @ np.linalg.solve(rest, c.B) + c.D)[0, 0])
    return float(-1 / gain) if gain != 0 else 0.0


def stability_boundary(device: Device, *, points: int = 1000, least_damping: float = 0.0, **loop: Any) -> Boundary:
    """Return the boundary of the stable walls in (B, K), traced as a curve in the angle of the root on the circle.

    W(theta) = K + B V(theta) is solved for the real K and B; no grid over K or B, no search. The curve starts at
    ``least_damping`` and runs through the stiffest wall to the largest damping that a wall of no stiffness may have;
    a root at -1 adds a straight piece. Pieces that bound no stable wall (a root is outside already) are left out.

    Args:
        device: as ``critical_stiffness``.
        points: on the curve.
        least_damping: B from which on the curve is wanted, N s/m.
        **loop: as ``wall_loop``.

    Raises:
        StabilityError: as ``wall_loop``; or no wall at all is stable.
    """
    return trace(_loop(device, loop), points, least_damping)


def trace(
    closed: WallLoop,
    points: int,
    least_damping: float,
    scale: tuple[float, float] | None = None,
    alone: bool = True,
) -> Boundary:
    """Return the boundary as ``boundary`` does.

    Args:
        closed: the loop.
        points: on the curve.
        least_damping: B from which on the curve is wanted, N s/m.
        scale: the size of the region in B and K, if it is known.
        alone: the region is bounded by this loop's curve and no other's, so that a loose end tells of a piece missed.
    """

    def curve(theta: Array) -> tuple[Array, Array]:
        wanted, rate = closed.required_wall_response(theta), closed.velocity_response(theta)
        b = wanted.imag / rate.imag
        return b, wanted.real - b * rate.real

    pieces: list[tuple[Array, Array, Array]] = []
    for step in (0.12, 0.02, 0.004):
        theta, b, k, good = _refined(closed, curve, least_damping, scale, step)
        pieces = [_flip(closed, least_damping)] if alone else []
        for first, last in _runs(good):  # each runs on to where it meets K = 0, B = least_damping or another piece
            angles = theta[first : last + 1]
            if first > 0:
                angles = np.insert(angles, 0, _last_good(closed, curve, angles[0], theta[first - 1], least_damping))
            if last < len(theta) - 1:
                angles = np.append(angles, _last_good(closed, curve, angles[-1], theta[last + 1], least_damping))
            angles = np.unique(angles)
            pieces.append((angles, *curve(angles)))
        pieces = [piece for piece in pieces if len(piece[0]) > 1]
        if pieces and not (alone and _loose(pieces, least_damping)):
            break
    if not pieces:
        raise StabilityError(
            "no wall of any stiffness and damping above least_damping is stable with this device, period and delay; "
            "an arm that nobody holds may tip over under gravity: give the tip an arm, "
            "LinearDevice.at_pose(..., arm=HumanArm(...))"
        )
    b, k, theta = _spaced(pieces, curve, points)
    for at in (int(np.argmax(k)), len(k) // 2, len(k) // 4, 3 * len(k) // 4):
        for share in (0.9, 0.999, 0.999999):
            if _inside(closed, share * float(k[at]), float(b[at])):
                return Boundary(b, k, theta, (float(b[at]), share * float(k[at])))
    raise StabilityError(f"no wall just under the curve is stable, as at B = {b[0]:g} N s/m, K = {k[0]:g} N/m")


def _flip(loop: WallLoop, least: float) -> tuple[Array, Array, Array]:
    """Return the piece of boundary with a root at -1, (angle, B, K): a line, where a heavily damped device ends."""
    theta = np.array([np.pi])
    k0, slope = float(loop.required_wall_response(theta).real[0]), float(loop.velocity_response(theta).real[0])
    empty = np.zeros(0)
    if not (np.isfinite(k0) and slope > 0 and k0 - least * slope > 0):
        return empty, empty, empty

    def line(b: Array) -> tuple[Array, Array]:
        return b, k0 - b * slope

    b = np.linspace(least, k0 / slope, 34)[:-1]
    good = _edge(loop, *line(b), np.ones(len(b), dtype=bool))
    runs = _runs(good)
    if not runs:
        return empty, empty, empty
    first, last = runs[0]
    kept = b[first : last + 1]
    if first > 0:
        kept = np.insert(kept, 0, _last_good(loop, line, kept[0], b[first - 1], least))
    end = b[last + 1] if last < len(b) - 1 else k0 / slope
    kept = np.unique(np.append(kept, _last_good(loop, line, kept[-1], end, least)))
    return np.full(len(kept), np.pi), *line(kept)


def _loose(pieces: list[tuple[Array, Array, Array]], least: float) -> bool:
    """Return whether a piece ends within the quadrant, where no other begins."""
    wide = max(float(b.max()) for _, b, _ in pieces) - least or 1.0
    high = max(float(k.max()) for _, _, k in pieces)
    ends = [((b[i] - least) / wide, k[i] / high) for _, b, k in pieces for i in (0, -1)]
    for i, (x, y) in enumerate(ends):
        if x < 0.01 or y < 0.01:
            continue
        if not any(np.hypot(x - other[0], y - other[1]) < 0.01 for j, other in enumerate(ends) if j != i):
            return True
    return False


def _refined(
    loop: WallLoop, curve: Any, least: float, scale: tuple[float, float] | None, step: float
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Return angles, B, K and which bound stable walls, so close that the curve moves little from one to the next."""
    theta = _coarse(loop)
    b, k = curve(theta)
    good = np.isfinite(b) & np.isfinite(k) & (k > 0) & (b >= least)
    good &= _edge(loop, b, k, good)
    if scale is not None:
        wide, high = scale
    elif np.any(good):
        wide, high = float(b[good].max()) - least, float(k[good].max())
    else:  # the curve passes the region between two angles: ask how far up and how far right it may lie
        high = stability_interval(loop, least).stiffness
        if not 0 < high < np.inf:
            return theta, b, k, good
        wide = high * loop.period
    reach = 1.1 if step > 0.1 else 3.0  # what was found first may be the smaller part
    for _ in range(24):
        x, y = (b - least) / max(wide, 1e-300), k / high
        with np.errstate(invalid="ignore"):
            far = np.hypot(np.diff(x), np.diff(y)) > step
            through = (np.minimum(x[1:], x[:-1]) < reach) & (np.maximum(x[1:], x[:-1]) > -0.1)
            through &= (np.minimum(y[1:], y[:-1]) < reach) & (np.maximum(y[1:], y[:-1]) > -0.1)
        split = far & through & (np.diff(theta) > 1e-13)
        if not np.any(split) or len(theta) > 4000:
            break
        between = 0.5 * (theta[:-1] + theta[1:])[split]
        new_b, new_k = curve(between)
        at = np.flatnonzero(split) + 1
        new_good = np.isfinite(new_b) & np.isfinite(new_k) & (new_k > 0) & (new_b >= least)
        new_good &= _edge(loop, new_b, new_k, new_good)
        theta, b, k = np.insert(theta, at, between), np.insert(b, at, new_b), np.insert(k, at, new_k)
        good = np.insert(good, at, new_good)
    return theta, b, k, good


def _spaced(pieces: list[tuple[Array, Array, Array]], curve: Any, points: int) -> tuple[Array, Array, Array]:
    """Return ``points`` (B, K, angle) on the pieces, evenly along the curve in (B, K), its ends among them."""
    wide, high = (max(float(np.abs(piece[i]).max()) for piece in pieces) or 1.0 for i in (1, 2))
    ways = []
    for _, b, k in pieces:
        steps = np.hypot(np.diff(b) / wide, np.diff(k) / high)
        ways.append(np.concatenate([[0.0], np.cumsum(steps)]))
    length = sum(float(way[-1]) for way in ways) or 1.0
    counts = [max(2, int(points * float(way[-1]) / length)) for way in ways]
    longest = int(np.argmax([float(way[-1]) for way in ways]))
    counts[longest] = max(2, counts[longest] + points - sum(counts))
    found = []
    for (theta, b, k), way, count in zip(pieces, ways, counts, strict=True):
        at = np.linspace(0, way[-1], count)
        if theta[0] == np.pi:  # a line
            found.append((np.interp(at, way, b), np.interp(at, way, k), np.full(count, np.pi)))
        else:
            angles = np.interp(at, way, theta)
            found.append((*curve(angles), angles))
    b, k, theta = (np.concatenate([piece[i] for piece in found]) for i in range(3))
    return b, k, theta


def _coarse(loop: WallLoop) -> Array:
    theta = np.concatenate([np.geomspace(1e-4, 0.1, 24), np.linspace(0.11, np.pi * (1 - 1e-6), 104)])
    resonances = [
        abs(np.angle(v)) * np.linspace(0.9, 1.1, 11)
        for v in np.linalg.eigvals(np.eye(len(loop.tip.step)) + loop.tip.step)
        if abs(np.angle(v)) > 1e-6
    ]
    theta = np.unique(np.concatenate([theta, *resonances]))
    return np.asarray(theta[(theta > 0) & (theta < np.pi)], dtype=float)


def _edge(loop: WallLoop, b: Array, k: Array, which: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where (b, k), which puts one pair of roots on the circle, leaves all others inside."""
    result = np.zeros(len(b), dtype=bool)
    if np.any(which):
        moduli = np.abs(np.linalg.eigvals(loop.matrix(k[which], b[which])))
        result[which] = moduli.max(axis=1) < 1 + 2e-9
    return result


def _runs(good: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (first, last) of each run of True."""
    marked = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]])))
    return [(int(a), int(b) - 1) for a, b in zip(marked[::2], marked[1::2], strict=True)]


def _last_good(loop: WallLoop, curve: Any, good: float, bad: float, least: float) -> float:
    """Return the angle at which the piece of curve ends, between one that belongs to it and one that does not."""

    def narrowed(judge: bool) -> float:
        inner, outer = good, bad
        for _ in range(5):  # 17 angles at a time: to 1e-6 of the step
            theta = np.linspace(inner, outer, 17)
            b, k = curve(theta)
            kept = (k > 0) & (b >= least)  # nan fails both
            if judge:
                kept &= _edge(loop, b, k, kept)
            end = int(np.argmin(kept)) if not kept.all() else len(theta) - 1
            inner, outer = theta[max(end - 1, 0)], theta[end]
        return float(inner)

    # Most pieces end where K or B does, which needs no eigenvalues but for the end itself.
    angle = narrowed(judge=False)
    b, k = curve(np.array([angle]))
    return angle if _edge(loop, b, k, np.array([True]))[0] else narrowed(judge=True)


def wall_spectral_radius(
    device: Device, *, stiffness: ArrayLike, virtual_damping: ArrayLike = 0.0, workers: int | None = None, **loop: Any
) -> Array:
    """Return the largest modulus of the loop's eigenvalues for every wall; below 1 is stable.

    Args:
        device: as ``critical_stiffness``.
        stiffness: K, N/m, any shape.
        virtual_damping: B, N s/m, broadcast against K.
        workers: threads; None: one a core. The result does not depend on them.
        **loop: as ``wall_loop``.

    Returns:
        Array of the broadcast shape.

    Raises:
        StabilityError: as ``wall_loop``, or a wall that is not finite.
    """
    closed = _loop(device, loop)
    k, b = np.broadcast_arrays(np.asarray(stiffness, float), np.asarray(virtual_damping, float))
    if not (np.all(np.isfinite(k)) and np.all(np.isfinite(b))):
        raise StabilityError("stiffness and virtual_damping must be finite, in N/m and N s/m")
    flat_k, flat_b = k.ravel(), b.ravel()
    result = np.empty(flat_k.size)
    size = 20_000  # walls at a time: memory stays small, threads have work

    def part(start: int) -> None:
        window = slice(start, start + size)
        result[window] = np.abs(np.linalg.eigvals(closed.matrix(flat_k[window], flat_b[window]))).max(axis=-1)

    starts = range(0, flat_k.size, size)
    threads = min(workers or os.cpu_count() or 1, len(starts))
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(part, starts))
    else:
        for start in starts:
            part(start)
    return result.reshape(k.shape)
