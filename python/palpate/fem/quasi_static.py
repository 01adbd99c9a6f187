"""A solid under large displacements that tips press: slow steps of its own, and a servo that feels linear snapshots."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.errors import PoseError
from palpate.fem.body import Shape
from palpate.fem.checks import (
    check_finite,
    check_tip,
    directions,
    lengths,
    point_of,
    positive,
    press_depth,
    tick_period,
    whole,
)
from palpate.fem.errors import BodyError, press_to_rest
from palpate.fem.hyperelastic import HyperelasticModel

__all__ = ["MultiTipHistory", "QuasiStaticSolver", "RealtimeRun"]

Array = NDArray[np.float64]


class MultiTipHistory(NamedTuple):
    """What t tips feel along paths of m ticks."""

    force: Array  # of the body on each tip (m, t, 3), N
    deflection: Array  # of each pressed patch, weighted by its forces (m, t, 3), m
    nodes: NDArray[np.int64]  # pressed by each tip (m, t)
    potential: Array  # that the contact gives out if the tips leave (m,), J
    saved: Array  # put in, and not given out yet (m,), J; potential + saved is the work of the tips since they touched
    waits: NDArray[np.bool_]  # whether a snapshot waited for energy (m,)


class RealtimeRun(NamedTuple):
    """A run in wall-clock time."""

    touches: MultiTipHistory
    late: Array  # how much after its time each tick began (m,), s
    ticks: Array  # how long each tick took (m,), s
    steps: Array  # how long each slow step took, s


class QuasiStaticSolver:
    """A solid that one or two rigid tips press: slow steps, and between them what the servo feels.

    A slow step (tens of ms) goes a Newton step towards rest under the tips' contact, and hands the servo a snapshot:
    up to 64 nodes near the tips, where they are, and their compliance, that of the tangent; farther out, to 128 nodes
    in all, an estimate, for quick tips. The servo's tick solves the one-sided contact on it, both tips together. A new
    snapshot is blended in as far as the energy put in allows: the tips never get out more.

    Args:
        solid: its volume, material, held and touchable parts; it stays as it is.
        near: nodes near each tip whose compliance is solved for, 4 to 64; two tips share 64.

    Raises:
        BodyError: an impossible number of nodes.
    """

    def __init__(self, solid: HyperelasticModel, *, near: float | str = 32) -> None:
        if not isinstance(solid, HyperelasticModel):
            raise BodyError(f"solid: a palpate.fem.HyperelasticModel is pressed, not {solid!r}")
        self.solid = solid
        elements = solid.elements
        load = elements.load
        load.sort_indices()
        self.core = _core.QuasiStaticSolver(
            *solid.arrays(),
            np.ascontiguousarray(elements.touchable, dtype=np.int32),
            np.ascontiguousarray(elements.areas),
            np.ascontiguousarray(load.indptr, dtype=np.int32),
            np.ascontiguousarray(load.indices, dtype=np.int32),
            np.ascontiguousarray(load.data),
            np.ascontiguousarray(elements.triangles, dtype=np.int32),
            whole(near, "near", 4, 64),
        )

    def indent(
        self,
        point: ArrayLike,
        radius: float | str,
        depth: float | str,
        *,
        outward: ArrayLike,
        tip: Shape = "sphere",
        steps: int = 100,
    ) -> tuple[Array, Array]:
        """Press a rigid tip in at `point` of the surface at rest, in ten parts, and let the body come to rest.

        Args:
            point: (3,), m or text.
            radius: of the sphere, or of the flat end of a rod, m or text.
            depth: m or text; not negative.
            outward: (3,), out of the body there.
            tip: "sphere" or "flat".
            steps: slow steps for each part, at most.

        Returns:
            The force on the tip (3,), N, and the displacement of all points (N, 3), m.

        Raises:
            BodyError: the body gives way so far that the tip loses it, or does not come to rest.
        """
        x, size, deep = point_of(point), positive(radius, "m", "radius"), press_depth(depth)
        normal = directions(outward, (3,))
        low = np.linspace(0.1, 1.0, 10)[:, None] * deep
        way, most = x + normal * ((size if tip == "sphere" else 0.0) - low), whole(steps, "steps", 1)
        self.core.reset()

        def settle(part: int) -> Array:
            return np.asarray(self.core.settle(*_ways(way[part : part + 1], size, normal, tip), most)[0])

        return press_to_rest(low[:, 0], settle)[0:3], self.displacement()

    def simulate_path(
        self,
        path: ArrayLike,
        radius: float | str | Sequence[float | str],
        *,
        outward: ArrayLike,
        tip: Shape = "sphere",
        every: int = 20,
    ) -> MultiTipHistory:
        """Go one tick for each place of the tips' centres, and a slow step for each `every` ticks.

        In turn, so always with the same result: a slow step sees the tips where they are at its first tick, and the
        servo gets its snapshot `every` ticks later.

        Args:
            path: (m, 3) for one tip, (m, t, 3) for t of them (at most two), m or text.
            radius: of the tips, m or text; one, or one for each.
            outward: out of the body where it is pressed: (3,), (m, 3) or (m, t, 3).
            tip: "sphere" or "flat", all alike.
            every: ticks.
        """
        ticks = whole(every, "every", 1)
        ways = _ways(path, radius, outward, tip)
        return _touches(self.core.follow(*ways, ticks), ways[0].shape[1])

    def live(
        self,
        path: ArrayLike,
        radius: float | str | Sequence[float | str],
        *,
        outward: ArrayLike,
        tip: Shape = "sphere",
        period: float | str = "1 ms",
        thread: bool = True,
    ) -> RealtimeRun:
        """As `simulate_path`, in wall-clock time: a tick each `period`; slow steps in a thread of their own, or none.

        It ends with the path, m periods after it began, and Ctrl-C is heard then. The next call goes on from where this
        one left the body: to stop when you like, give a path in pieces.
        """
        tick = tick_period(period)
        ways = _ways(path, radius, outward, tip)
        rows, times, steps = self.core.live(*ways, tick, thread)
        return RealtimeRun(_touches(rows, ways[0].shape[1]), times[:, 0], times[:, 1], steps[:, 0])

    def displacement(self) -> Array:
        """Of all points at the last slow step (N, 3), m."""
        return np.asarray(self.core.displacement())

    def reset(self) -> None:
        """Go back to rest, untouched."""
        self.core.reset()


def _ways(
    path: ArrayLike, radius: float | str | Sequence[float | str], outward: ArrayLike, tip: Shape
) -> tuple[Array, Array, Array, bool]:
    centres = lengths(path, "path")
    if centres.ndim == 2:
        centres = centres[:, None]
    if centres.ndim != 3 or centres.shape[1] not in (1, 2) or centres.shape[2] != 3:
        raise PoseError(f"a path is (m, 3), or (m, 2, 3) for two tips, numbers in m; this is {centres.shape}")
    check_finite(centres, "path")
    sizes = lengths(radius, "radius").ravel().tolist()
    radii = np.array([positive(size, "m", "radius") for size in sizes] * (centres.shape[1] if len(sizes) == 1 else 1))
    if len(radii) != centres.shape[1]:
        raise BodyError(f"radius: {len(radii)} of them for {centres.shape[1]} tips; give one, or one for each")
    check_tip(tip)
    axes = np.asarray(outward)
    axes = directions(axes[:, None] if axes.ndim == 2 else axes, centres.shape)
    return np.ascontiguousarray(centres), axes, radii, tip == "flat"


def _touches(rows: Array, tips: int) -> MultiTipHistory:
    if not all(rows[:, 10 * t + 9].all() for t in range(tips)):
        raise BodyError("the contact's forces were not found: take smaller steps")
    each = rows[:, : 10 * tips].reshape(len(rows), tips, 10)
    potential, saved, _, waits = rows[:, 10 * tips :].T
    return MultiTipHistory(each[..., 0:3], each[..., 3:6], each[..., 7].astype(np.int64), potential, saved, waits > 0)
