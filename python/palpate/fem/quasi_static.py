"""Quasi-static hyperelastic solid in contact with tips, with a multirate servo coupling."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array, Flags, Indices
from palpate.checks import SAME_PLACE
from palpate.errors import PoseError
from palpate.fem.checks import (
    TipShape,
    check_finite,
    check_near,
    check_tip,
    directions,
    indentation_depth,
    lengths,
    point_of,
    positive,
    tick_period,
    whole,
)
from palpate.fem.contact_accuracy import unresolved
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.hyperelastic import HyperelasticModel
from palpate.fem.indentation import NODES, check_found, check_resolved, count_inverted, not_found, settle_at_depths


class MultiTipHistory(NamedTuple):
    """Contact of t tips along paths of m ticks."""

    force: Array  # of the body on each tip (m, t, 3), N
    deflection: Array  # of the nodes in contact with each tip, weighted by their forces (m, t, 3), m
    nodes: Indices  # number of nodes in contact with each tip (m, t)
    potential: Array  # energy that the contact releases if the tips leave (m,), J
    tank_energy: Array  # level of the energy tank (m,), J; potential + tank_energy is the work since first contact
    tank_empty: Flags  # whether the tank was too low for a full switch of models (m,)


class RealtimeRun(NamedTuple):
    """Contact and timing of m ticks in wall-clock time."""

    touches: MultiTipHistory
    late: Array  # lateness of each tick (m,), s
    ticks: Array  # duration of each tick (m,), s
    steps: Array  # duration of each model update, s
    found: Flags  # whether the forces of all tips were found in each tick (m,); if not, energy alone bounds them


class QuasiStaticSolver:
    """Hyperelastic solid in contact with one or two rigid tips, solved at two rates.

    A model update (tens of ms) makes one Newton step toward equilibrium under the contact forces of the tips. It then
    passes a local model to the servo: the positions of up to 64 nodes near the tips and their compliance, from the
    tangent stiffness. Up to 128 nodes in all, the compliance of farther nodes is extrapolated, for fast tips.

    A servo tick solves the unilateral contact of both tips on the local model. The switch to a new local model is
    limited by an energy tank, so the tips never extract more energy than they put in.

    Args:
        solid: mesh, material, Dirichlet and contact nodes; it is not modified.
        nodes_per_tip: nodes near each tip in the local model, 4 to 64; two tips share 64.

    Raises:
        BodyError: the number of nodes is out of range, or the solid relaxes.
    """

    def __init__(self, solid: HyperelasticModel, *, nodes_per_tip: float | str = 32) -> None:
        if not isinstance(solid, HyperelasticModel):
            raise BodyError(f"solid: a palpate.fem.HyperelasticModel is needed, not {solid!r}")
        if solid.instantaneous_ratio > 1.0:
            raise BodyError(
                "solid: a QuasiStaticSolver has no clock, so its solid does not relax; give the solid no "
                "instantaneous_ratio, or use Body.hyperelastic(period, instantaneous_ratio=...) with one tip"
            )
        self.solid = solid
        elements = solid.elements
        self.core = _core.QuasiStaticSolver(
            *solid.arrays(),
            np.ascontiguousarray(elements.contact_nodes, dtype=np.int32),
            np.ascontiguousarray(elements.triangles, dtype=np.int32),
            elements.layer_moduli / (1.0 - elements.material.poisson**2),
            whole(nodes_per_tip, "nodes_per_tip", 4, 64),
        )

    def indent(
        self,
        point: ArrayLike,
        radius: float | str,
        depth: float | str,
        *,
        outward: ArrayLike,
        tip: TipShape = "sphere",
        steps: int = 100,
    ) -> tuple[Array, Array]:
        """Press a rigid tip in at `point` of the surface at rest, by equilibria at ten depths.

        Fewer than four nodes in contact, or a tip smaller than the distance of the nodes, cause a warning.

        Args:
            point: (3,), m or text.
            radius: of the sphere, or of the flat end of a rod, m or text.
            depth: m or text; not negative.
            outward: direction out of the body at the point (3,).
            tip: "sphere" or "flat".
            steps: maximum number of model updates at each depth.

        Returns:
            The force on the tip (3,), N, and the displacement of all points (N, 3), m.

        Raises:
            BodyError: the tip loses contact or inverts tetrahedra, there is no equilibrium, or more than 128 nodes
                lie under the tip.
            BodyError: the tip is smaller than the distance of the nodes, and its force points sideways.
        """
        x, size, deep = point_of(point), positive(radius, "m", "radius"), indentation_depth(depth)
        normal = directions(outward, (3,))
        depths = np.linspace(0.1, 1.0, 10)[:, None] * deep
        path, max_updates = x + normal * ((size if tip == "sphere" else 0.0) - depths), whole(steps, "steps", 1)
        self.core.reset()

        def settle(index: int) -> Array:
            arguments = _core_path(path[index : index + 1], size, normal, tip)
            return np.asarray(self.core.settle(*arguments, max_updates)[0])

        def inverted() -> int:
            return count_inverted(self.solid.points, self.solid.elements.volume.tetrahedra, self.displacement())

        row = settle_at_depths(depths[:, 0], settle, inverted)
        if deep > 0.0:
            small = unresolved(self.solid.points[self.solid.elements.contact_nodes], x, size, tip)
            check_resolved(row[0:3], normal, int(row[NODES]), None, small)
        return row[0:3], self.displacement()

    def simulate_path(
        self,
        path: ArrayLike,
        radius: float | str | Sequence[float | str],
        *,
        outward: ArrayLike,
        tip: TipShape = "sphere",
        every: int = 20,
    ) -> MultiTipHistory:
        """Move the tips along a path, one tick per sample and one model update per `every` ticks.

        Ticks and updates run synchronously, so results are reproducible. An update uses the positions of the tips at
        its first tick, and the servo receives its local model `every` ticks later.

        Args:
            path: centers of one tip (m, 3), or of t tips, at most two (m, t, 3), m or text.
            radius: of the tips, m or text; one value, or one per tip.
            outward: direction out of the body at the contact: (3,), (m, 3) or (m, t, 3).
            tip: "sphere" or "flat", for all tips.
            every: ticks per model update.

        Raises:
            PoseError: the path or a direction has the wrong shape or a number that is not finite.
            BodyError: a radius is not positive, the tip has another shape, the path never comes near the body, or the
                contact forces of a tick were not found: more than 128 nodes lie under a tip, it inverts tetrahedra, or
                it moves too far between two updates.
        """
        ticks = whole(every, "every", 1)
        arguments = _core_path(path, radius, outward, tip)
        check_near(arguments[0], self.solid.points)
        rows, tips = self.core.simulate_path(*arguments, ticks), arguments[0].shape[1]
        check_found(_found(rows, tips))
        return _history(rows, tips)

    def simulate_realtime(
        self,
        path: ArrayLike,
        radius: float | str | Sequence[float | str],
        *,
        outward: ArrayLike,
        tip: TipShape = "sphere",
        period: float | str = "1 ms",
        thread: bool = True,
    ) -> RealtimeRun:
        """Move the tips along a path in wall-clock time, one tick per `period`; see `simulate_path`.

        The call returns after m periods; Ctrl-C takes effect then. The next call continues from the current state. To
        stop earlier, pass the path in pieces. Where a model update comes too late for a fast tip, single ticks may find
        no force: a BodyWarning counts them.

        Args:
            path: as in `simulate_path`.
            radius: as in `simulate_path`.
            outward: as in `simulate_path`.
            tip: as in `simulate_path`.
            period: of a tick, s or text.
            thread: whether to update the model in a thread of its own; without it there are no updates but the first,
                if the solver has no model yet.
        """
        tick = tick_period(period)
        arguments = _core_path(path, radius, outward, tip)
        rows, times, steps = self.core.simulate_realtime(*arguments, tick, thread)
        tips = arguments[0].shape[1]
        found = _found(rows, tips)
        if problem := not_found(found):
            warnings.warn(problem, BodyWarning, stacklevel=2)
        return RealtimeRun(_history(rows, tips), times[:, 0], times[:, 1], steps[:, 0], found)

    def displacement(self) -> Array:
        """Return the displacement of all points at the last model update (N, 3), m."""
        return np.asarray(self.core.displacement())

    def reset(self) -> None:
        """Return to the undeformed state without contact."""
        self.core.reset()


def _core_path(
    path: ArrayLike, radius: float | str | Sequence[float | str], outward: ArrayLike, tip: TipShape
) -> tuple[Array, Array, Array, bool]:
    """Return centers (m, t, 3), m, axes (m, t, 3), radii (t,), m, and whether the tips are flat."""
    centers = lengths(path, "path")
    if centers.ndim == 2:
        centers = centers[:, None]
    if centers.ndim != 3 or centers.shape[1] not in (1, 2) or centers.shape[2] != 3:
        raise PoseError(f"a path is (m, 3), or (m, 2, 3) for two tips, numbers in m; this has shape {centers.shape}")
    check_finite(centers, "path")
    if centers.shape[1] == 2 and (same := np.linalg.norm(np.diff(centers, axis=1)[:, 0], axis=1) < SAME_PLACE).any():
        raise BodyError(f"path: in row {int(np.argmax(same))} both tips are in the same place; keep them apart")
    sizes = lengths(radius, "radius").ravel().tolist()
    radii = np.array([positive(size, "m", "radius") for size in sizes] * (centers.shape[1] if len(sizes) == 1 else 1))
    if len(radii) != centers.shape[1]:
        raise BodyError(f"radius: {len(radii)} values for {centers.shape[1]} tips; give one, or one per tip")
    check_tip(tip)
    axes = np.asarray(outward)
    axes = directions(axes[:, None] if axes.ndim == 2 else axes, centers.shape)
    return np.ascontiguousarray(centers), axes, radii, tip == "flat"


def _found(rows: Array, tips: int) -> Flags:
    """Return whether the forces of all tips were found in each row of the core (m,)."""
    return np.asarray((rows[:, 9 : 10 * tips : 10] > 0.0).all(axis=1))


def _history(rows: Array, tips: int) -> MultiTipHistory:
    """Return the rows of the core as a history."""
    each = rows[:, : 10 * tips].reshape(len(rows), tips, 10)
    potential, tank, _, empty = rows[:, 10 * tips :].T
    return MultiTipHistory(each[..., 0:3], each[..., 3:6], each[..., 7].astype(np.int64), potential, tank, empty > 0)
