"""Boundary of the stable walls in the plane of damping and stiffness, traced as a curve."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.checks import finite
from palpate.errors import StabilityError
from palpate.linear.wall import WallLoop
from palpate.stability.maps.wall_interval import Device, as_wall_loop, is_stable, stability_interval

__all__ = ["Boundary", "stability_boundary", "trace_boundary"]

Curve: TypeAlias = Callable[[Array], tuple[Array, Array]]
Segment: TypeAlias = tuple[Array, Array, Array]  # angle, B, K


@dataclass(frozen=True)
class Boundary:
    """Boundary of the stable walls: at each point one root is on the unit circle and all others are inside.

    Attributes:
        damping: B (k,), N s/m.
        stiffness: K (k,), N/m.
        angle: angle of the root, (k,), rad per sample.
        inside: a (B, K) between the curve and K = 0 that was confirmed to be stable.
        jump: distance of neighbors, relative to the size of the curve, above which a segment is missing between them.
    """

    damping: Array
    stiffness: Array
    angle: Array
    inside: tuple[float, float]
    jump: float = 0.05

    def __str__(self) -> str:
        b, k = self.stiffest
        return (
            f"The stiffest stable wall has {k:.5g} N/m, with {b:.4g} N s/m; {len(self.damping)} points of the boundary."
        )

    @property
    def stiffest(self) -> tuple[float, float]:
        """Return the (B, K) of the largest K on the curve."""
        k = int(np.argmax(self.stiffness))
        return float(self.damping[k]), float(self.stiffness[k])

    @property
    def pieces(self) -> list[tuple[int, int]]:
        """Return (first, last + 1) of each segment of the curve without a jump."""
        if len(self.damping) < 3:
            return [(0, len(self.damping))]
        wide, high = (float(np.ptp(values)) or 1.0 for values in (self.damping, self.stiffness))
        jump = np.hypot(np.diff(self.damping) / wide, np.diff(self.stiffness) / high) > self.jump
        ends = [0, *(np.flatnonzero(jump) + 1).tolist(), len(self.damping)]
        return list(pairwise(ends))

    def stiffest_at(self, damping: float | str) -> float | None:
        """Return the largest K of the curve at B = ``damping``, N/m, by linear interpolation; None beyond the curve."""
        b = finite(damping, "damping", "N*s/m")
        found = []
        for first, last in self.pieces:
            x, y = self.damping[first:last] - b, self.stiffness[first:last]
            tiny = 1e-6 * float(self.damping.max())
            found += y[np.abs(x) <= tiny].tolist()
            k = np.flatnonzero(x[:-1] * x[1:] < 0.0)
            found += (y[k] - x[k] * (y[k + 1] - y[k]) / (x[k + 1] - x[k])).tolist()
        return max(found, default=None)

    def up_to(self, damping: float | str) -> Boundary:
        """Return the part of the curve up to B = ``damping``, N s/m."""
        selected = self.damping <= finite(damping, "damping", "N*s/m")
        b, k, angle = (values[selected] for values in (self.damping, self.stiffness, self.angle))
        return replace(self, damping=b, stiffness=k, angle=angle)


def stability_boundary(device: Device, *, points: int = 1000, min_damping: float | str = 0.0, **loop: Any) -> Boundary:
    """Return the boundary of the stable walls in (B, K), parametrized by the angle of the root on the circle.

    W(theta) = K + B V(theta) is solved for the real K and B, without a grid over K or B. The curve runs from
    ``min_damping`` through the stiffest wall to the largest damping at K = 0. A root at -1 adds a straight segment.
    Segments with another root outside the circle are omitted.

    Args:
        device: as ``critical_stiffness``.
        points: number of points on the curve.
        min_damping: smallest B of the curve, N s/m.
        **loop: as ``wall_loop``.

    Raises:
        StabilityError: as ``wall_loop``; or no wall is stable.
    """
    return trace_boundary(as_wall_loop(device, loop), points, finite(min_damping, "min_damping", "N*s/m"))


def trace_boundary(
    closed: WallLoop,
    points: int,
    min_damping: float,
    scale: tuple[float, float] | None = None,
    single: bool = True,
) -> Boundary:
    """Return the boundary of one loop; ``stability_boundary`` with its options resolved.

    Args:
        closed: the loop.
        points: number of points on the curve.
        min_damping: smallest B of the curve, N s/m.
        scale: size of the region in B (N s/m) and K (N/m), if known.
        single: whether this curve alone bounds the region; a loose end then indicates a missed segment.
    """

    def curve(theta: Array) -> tuple[Array, Array]:
        wall, velocity = closed.required_wall_response(theta), closed.velocity_response(theta)
        b = wall.imag / velocity.imag
        return b, wall.real - b * velocity.real

    segments: list[Segment] = []
    for step in (0.12, 0.02, 0.004):
        theta, b, k, good = _refine(closed, curve, min_damping, scale, step)
        segments = [_segment_at_minus_one(closed, min_damping)] if single else []
        for first, last in _runs(good):  # each ends at K = 0, at B = min_damping or at another segment
            angles = theta[first : last + 1]
            if first > 0:
                angles = np.insert(angles, 0, _segment_end(closed, curve, angles[0], theta[first - 1], min_damping))
            if last < len(theta) - 1:
                angles = np.append(angles, _segment_end(closed, curve, angles[-1], theta[last + 1], min_damping))
            angles = np.unique(angles)
            segments.append((angles, *curve(angles)))
        segments = [segment for segment in segments if len(segment[0]) > 1]
        if segments and not (single and _has_loose_end(segments, min_damping)):
            break
    if not segments:
        raise StabilityError(
            "no wall of any stiffness and damping above min_damping is stable with this device, period and delay; "
            "an arm without an operator may tip over under gravity: give the tip an arm, "
            "LinearDevice.at_pose(..., arm=HumanArm(...))"
        )
    b, k, theta = _resample(segments, curve, points)
    for at in (int(np.argmax(k)), len(k) // 2, len(k) // 4, 3 * len(k) // 4):
        for share in (0.9, 0.999, 0.999999):
            if is_stable(closed, share * float(k[at]), float(b[at])):
                return Boundary(b, k, theta, (float(b[at]), share * float(k[at])))
    raise StabilityError(f"no wall just under the curve is stable, as at B = {b[0]:g} N s/m, K = {k[0]:g} N/m")


def _segment_at_minus_one(loop: WallLoop, min_damping: float) -> Segment:
    """Return the straight segment of the boundary with a root at -1, as angles, B and K; empty if there is none."""
    theta = np.array([np.pi])
    k0, slope = float(loop.required_wall_response(theta).real[0]), float(loop.velocity_response(theta).real[0])
    empty = np.zeros(0)
    if not (np.isfinite(k0) and slope > 0 and k0 - min_damping * slope > 0):
        return empty, empty, empty

    def line(b: Array) -> tuple[Array, Array]:
        return b, k0 - b * slope

    b = np.linspace(min_damping, k0 / slope, 34)[:-1]
    good = _on_boundary(loop, *line(b), np.ones(len(b), dtype=bool))
    runs = _runs(good)
    if not runs:
        return empty, empty, empty
    first, last = runs[0]
    kept = b[first : last + 1]
    if first > 0:
        kept = np.insert(kept, 0, _segment_end(loop, line, kept[0], b[first - 1], min_damping))
    end = b[last + 1] if last < len(b) - 1 else k0 / slope
    kept = np.unique(np.append(kept, _segment_end(loop, line, kept[-1], end, min_damping)))
    return np.full(len(kept), np.pi), *line(kept)


def _has_loose_end(segments: list[Segment], min_damping: float) -> bool:
    """Return whether a segment ends inside the quadrant where no other segment begins."""
    wide = max(float(b.max()) for _, b, _ in segments) - min_damping or 1.0
    high = max(float(k.max()) for _, _, k in segments)
    ends = [((b[i] - min_damping) / wide, k[i] / high) for _, b, k in segments for i in (0, -1)]
    for i, (x, y) in enumerate(ends):
        if x < 0.01 or y < 0.01:
            continue
        if not any(np.hypot(x - other[0], y - other[1]) < 0.01 for j, other in enumerate(ends) if j != i):
            return True
    return False


def _refine(
    loop: WallLoop, curve: Curve, min_damping: float, scale: tuple[float, float] | None, step: float
) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
    """Return angles, B, K and whether each bounds stable walls, refined until steps along the curve are small."""
    theta = _coarse_angles(loop)
    b, k = curve(theta)
    good = np.isfinite(b) & np.isfinite(k) & (k > 0) & (b >= min_damping)
    good &= _on_boundary(loop, b, k, good)
    if scale is not None:
        wide, high = scale
    elif np.any(good):
        wide, high = float(b[good].max()) - min_damping, float(k[good].max())
    else:  # the curve crosses the region between two angles: estimate the size of the region
        high = stability_interval(loop, min_damping).stiffness
        if not 0 < high < np.inf:
            return theta, b, k, good
        wide = high * loop.period
    reach = 1.1 if step > 0.1 else 3.0  # the first segment found may be the smaller one
    for _ in range(24):
        x, y = (b - min_damping) / max(wide, 1e-300), k / high
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
        new_good = np.isfinite(new_b) & np.isfinite(new_k) & (new_k > 0) & (new_b >= min_damping)
        new_good &= _on_boundary(loop, new_b, new_k, new_good)
        theta, b, k = np.insert(theta, at, between), np.insert(b, at, new_b), np.insert(k, at, new_k)
        good = np.insert(good, at, new_good)
    return theta, b, k, good


def _coarse_angles(loop: WallLoop) -> Array:
    theta = np.concatenate([np.geomspace(1e-4, 0.1, 24), np.linspace(0.11, np.pi * (1 - 1e-6), 104)])
    resonances = [
        abs(np.angle(v)) * np.linspace(0.9, 1.1, 11)
        for v in np.linalg.eigvals(np.eye(len(loop.tip.step)) + loop.tip.step)
        if abs(np.angle(v)) > 1e-6
    ]
    theta = np.unique(np.concatenate([theta, *resonances]))
    return np.asarray(theta[(theta > 0) & (theta < np.pi)], dtype=float)


def _resample(segments: list[Segment], curve: Curve, points: int) -> Segment:
    """Return B, K and angle, each (points,), evenly spaced along the segments in (B, K), ends included."""
    width, height = (max(float(np.abs(segment[i]).max()) for segment in segments) or 1.0 for i in (1, 2))
    lengths = []
    for _, b, k in segments:
        steps = np.hypot(np.diff(b) / width, np.diff(k) / height)
        lengths.append(np.concatenate([[0.0], np.cumsum(steps)]))
    total = sum(float(s[-1]) for s in lengths) or 1.0
    counts = [max(2, int(points * float(arc[-1]) / total)) for arc in lengths]
    longest = int(np.argmax([float(arc[-1]) for arc in lengths]))
    counts[longest] = max(2, counts[longest] + points - sum(counts))
    found = []
    for (theta, b, k), arc, count in zip(segments, lengths, counts, strict=True):
        at = np.linspace(0, arc[-1], count)
        if theta[0] == np.pi:  # a line
            found.append((np.interp(at, arc, b), np.interp(at, arc, k), np.full(count, np.pi)))
        else:
            angles = np.interp(at, arc, theta)
            found.append((*curve(angles), angles))
    b, k, theta = (np.concatenate([segment[i] for segment in found]) for i in range(3))
    return b, k, theta


def _on_boundary(loop: WallLoop, b: Array, k: Array, which: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return, for each (b, k) with a pair of roots on the circle, whether all other roots are inside."""
    result = np.zeros(len(b), dtype=bool)
    if np.any(which):
        moduli = np.abs(np.linalg.eigvals(loop.matrix(k[which], b[which])))
        result[which] = moduli.max(axis=1) < 1 + 2e-9
    return result


def _runs(good: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return (first, last) of each run of True."""
    marked = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]])))
    return [(int(a), int(b) - 1) for a, b in zip(marked[::2], marked[1::2], strict=True)]


def _segment_end(loop: WallLoop, curve: Curve, good: float, bad: float, min_damping: float) -> float:
    """Return the angle at which a segment ends, between the angle ``good`` inside it and ``bad`` outside."""

    def bisect(check_roots: bool) -> float:
        inner, outer = good, bad
        for _ in range(5):  # 17 angles at a time, to 1e-6 of the step
            theta = np.linspace(inner, outer, 17)
            b, k = curve(theta)
            kept = (k > 0) & (b >= min_damping)  # nan fails both
            if check_roots:
                kept &= _on_boundary(loop, b, k, kept)
            end = int(np.argmin(kept)) if not kept.all() else len(theta) - 1
            inner, outer = theta[max(end - 1, 0)], theta[end]
        return float(inner)

    # Most segments end where K or B reaches its limit, which needs eigenvalues only at the end itself.
    angle = bisect(check_roots=False)
    b, k = curve(np.array([angle]))
    return angle if _on_boundary(loop, b, k, np.array([True]))[0] else bisect(check_roots=True)
