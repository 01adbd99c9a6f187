"""Indentation of a condensed body by a rigid tip: equilibrium, and motion along a path."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Final, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array, Flags, Indices
from palpate.checks import MAX_TIPS
from palpate.contact.simplices import volumes
from palpate.contact.unfound import MOST_NODES, MOST_PLACES, crowded, unfound
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
    row_of,
)
from palpate.fem.condensed_body import CondensedBody
from palpate.fem.contact_accuracy import softening, unresolved
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.model_spec import COMPLIANCE, ModelSpec

_MAX_UNSETTLED = 10  # consecutive depths without equilibrium, each with hundreds of model updates
_MAX_UPDATES = 200  # model updates at each depth
NODES, SOLVED, LOST = 7, 9, 14  # columns of a row of the core: nodes in contact, forces found, contact lost
OVERLAPS_UNTOUCHED: Final = (
    "overlaps a part of the surface that is fixed, held or not touched and does not push back, so its force is too "
    "small: press a radius away from it"
)
_ASIDE: Final = 0.1  # of the radius by which a point off the contact surface moves without an error
_FEW: Final = 4  # nodes in contact below which a press causes a warning
_SIDEWAYS: Final = 0.5  # cosine between the force on a tip and the normal of a press below which it points sideways
_INVERTED: Final = (
    "the tip inverts tetrahedra of the body, which its springs do not prevent: use a smaller depth or a larger tip, or "
    "hyperelastic"
)
_FALLEN: Final = 0.99  # force over the largest one of a press, below which it has fallen
_FLIGHT = 40  # windows of 50 ms without contact after which a mass-spring body has left the tip
_STEPS_PER_RADIUS, _STILL_STEPS = 50, 5  # of an indentation of a signed-distance body; at its end


class Indentation(NamedTuple):
    """Force on an indenting tip and displacement of the surface."""

    force: Array  # of the body on the tip (3,), N
    displacement: Array  # of the contact nodes (n, 3), m
    nodes: int  # in contact
    error: float | None  # of a sphere's force by the mesh, relative (`force_error`); None if it is not known


class ContactHistory(NamedTuple):
    """Contact of a tip along a path of m samples."""

    force: Array  # of the body on the tip (m, 3), N
    deflection: Array  # of the nodes in contact, weighted by their forces (m, 3), m
    energy: Array  # stored in the body (m,), J; of a hyperelastic one with memory what it returns within two updates
    nodes: Indices  # number of nodes in contact (m,)
    friction: Array  # tangential part of the force (m, 3), N
    lost: Flags  # whether the tip was inside the body without contact: it began there or was pushed through (m,)

    @classmethod
    def of(cls, rows: Array) -> Self:
        """Return the rows (m, 15) of the core as a history; raise BodyError if the forces of one were not found."""
        if not rows[:, SOLVED].all():
            raise BodyError(crowded())
        nodes, lost = rows[:, NODES].astype(np.int64), rows[:, LOST] > 0.0
        return cls(rows[:, 0:3], rows[:, 3:6], rows[:, 6], nodes, rows[:, 10:13], lost)


class IndentableBody(CondensedBody):
    """Condensed body that a rigid tip indents."""

    def indent(
        self, point: ArrayLike, radius: float | str, depth: float | str, *, tip: TipShape = "sphere"
    ) -> Indentation:
        """Press a rigid tip `depth` into the body along the normal at the surface point nearest to `point`.

        Inertia and creep are left out (`modal`, `viscoelastic`). An indentation from rest has no friction, except for
        `mass_spring`, whose nodes also move sideways. Displacements are assumed small compared with body and tip.
        A mesh that is too coarse causes a warning: fewer than four nodes in contact, a tip smaller than their distance,
        or a contact radius of less than 0.38 distances (`is_shallow`). So do a tip over a part of the surface
        without contact, and a point farther from it than the radius. By signed distance, a force that falls with the
        depth and a deep tip (`softening`) cause one too.

        Args:
            point: (3,), m or text such as "5 mm".
            radius: of the sphere, or of the flat end of a rod, m or text such as "5 mm".
            depth: of the tip's lowest point or end below the surface at rest, m or text; not negative.
            tip: "sphere" or "flat".

        Returns:
            At equilibrium: the force on the tip (3,), N, the displacement of the contact nodes (n, 3), m, their number
            in contact, and the error of a sphere's force by the mesh alone (None if unknown).

        Raises:
            PoseError: the point is not three finite numbers.
            BodyError: the point is farther from the body than the body's extent.
            BodyError: the point lies nearer to a part of the surface that is not touched, and farther than a tenth of
                the radius from the contact surface.
            BodyError: the depth is negative or exceeds the body along the press.
            BodyError: the radius is not positive or exceeds the body's extent.
            BodyError: the tip has another shape, or more than 128 nodes lie under it.
            BodyError: the tip is smaller than the distance of the nodes, and its force points sideways.
            BodyError: the tip loses contact, a mass-spring or hyperelastic body has inverted tetrahedra, or a
                hyperelastic one finds no equilibrium.
        """
        if static := self._static_body():
            found = static.indent(point, radius, depth, tip=tip)
            self.last_core = static.core
            return found
        x = point_of(point)
        check_tip(tip)
        size, deep = positive(radius, "m", "radius"), indentation_depth(depth)
        target, normal = self._indentation_axis(x, size, deep)
        center = target + normal * ((size if tip == "sphere" else 0.0) - deep)
        self.core.reset()
        if isinstance(self.core, _core.HyperelasticBody):
            history = self._settle_hyperelastic(self.core, center, normal, deep, size, tip)
        else:
            history = self._ramp(center, normal, deep, size, tip)
        nodes, force, small = int(history.nodes[-1]), history.force[-1], unresolved(self.nodes, target, size, tip)
        axis = None if tip == "sphere" else normal
        over = deep > 0.0 and bool(self.overlaps_untouched(center[None], size, axis)[0])
        error = self._force_error(nodes, target, size, deep) if tip == "sphere" and not small and not over else None
        if (apart := float(np.linalg.norm(target - x))) > size:
            at = row_of(1e3 * target)
            warnings.warn(
                f"point: it lies {1e3 * apart:.3g} mm from the surface; the tip presses the nearest point ({at}) mm",
                BodyWarning,
                stacklevel=2,
            )
        if deep > 0.0:
            if over:
                warnings.warn(f"the tip {OVERLAPS_UNTOUCHED}", BodyWarning, stacklevel=2)
            check_resolved(force, normal, nodes, error, small)
            if self.kind.by_distance and (softer := softening(deep, size, tip)) is not None:
                warnings.warn(
                    f"depth: at {deep / size:.2g} radii contact by signed distance may be up to {100 * softer:.0f} % "
                    "too soft, because it assumes small strains: use a larger tip, or hyperelastic",
                    BodyWarning,
                    stacklevel=2,
                )
        return Indentation(force, self.displacement(), nodes, error)

    def _force_error(self, nodes: int, point: Array, radius: float, depth: float) -> float | None:
        """Return the relative error of a sphere's force by the mesh; None if it is not known, with a warning if why."""
        doubt = self.mesh_doubt(point, radius, depth)
        if doubt and nodes >= _FEW:  # fewer cause a warning of their own
            warnings.warn(f"depth: {doubt}: the error of its force is not known", BodyWarning, stacklevel=3)
        along_normals = self.kind.name == COMPLIANCE.name
        if not doubt and nodes >= _FEW and along_normals and self.is_curved(point, radius):
            warnings.warn(
                "the surface is curved there, where contact along the nodes' normals is too stiff by an unknown "
                "amount: use signed_distance()",
                BodyWarning,
                stacklevel=3,
            )
        return self.mesh_error(nodes, point, radius, depth) if along_normals or self.kind.by_distance else None

    def _static_body(self) -> Self | None:
        """Return the body without inertia, creep, friction and changes of supports, or None if it has none of them.

        A body at two rates returns the same body at one rate, or that without inertia and creep.
        """
        if self.kind.supports is not None:
            static = type(self)(self.contents, self.kind._replace(supports=None))
            if self.kind.by_distance:
                static.core = static._signed_distance_core()
            return static._static_body() or static
        if isinstance(self.core, _core.MultirateBody):
            options = {name: value for name, value in self.kind.options.items() if name != "update_interval"}
            elastic = type(self)(self.contents, COMPLIANCE._replace(friction=self.kind.friction))
            one_rate: Self = getattr(elastic, self.kind.name)(**options)
            return one_rate._static_body() or one_rate
        if isinstance(self.core, _core.ModalBody | _core.StandardLinearSolidBody):
            return type(self)(self.contents)
        if isinstance(self.core, _core.SignedDistanceBody) and (self.core.has_memory or self.kind.friction[0] > 0.0):
            options = _static_options(self.kind)
            kind = self.kind._replace(name="signed_distance", options=options, friction=(0.0, 0.0))
            static = type(self)(self.contents, kind)
            static.core = static._signed_distance_core()
            return static
        return None

    def _indentation_axis(self, x: Array, size: float, deep: float) -> tuple[Array, Array]:
        """Return the surface point nearest to `x` (3,), m, and the unit normal there (3,); raise as `indent`."""
        nearest, face = self.surface.nearest(x[None])
        distance = float(np.linalg.norm(nearest[0] - x))
        if distance > self.extent:
            raise BodyError(
                f"the point lies {distance:.3g} m from the body, whose extent is {self.extent:.3g} m: points are in m"
            )
        if deep > self.extent:
            raise BodyError(f"depth: {deep:g} m exceeds the body's extent of {self.extent:.3g} m: lengths are in m")
        if size > self.extent:
            raise BodyError(f"radius: {size:g} m exceeds the body's extent of {self.extent:.3g} m: use a smaller tip")
        if deep > 1000 * size:
            raise BodyError(
                f"radius: {size:g} m is less than a thousandth of the depth of {deep:g} m: use a larger tip"
            )
        beside = self.untouched_surface
        if beside is not None and distance > _ASIDE * size:
            other = float(np.linalg.norm(beside.nearest(x[None])[0][0] - x))
            if other < distance:
                raise BodyError(
                    f"the point lies {1e3 * other:.3g} mm from a part of the surface that is not touched, and "
                    f"{1e3 * distance:.3g} mm from the contact surface: take a point on the contact surface"
                )
        if self.kind.by_distance:
            target, normal = self._curved_surface.at(nearest[0], int(face[0]))
        else:
            target, normal = nearest[0], self._pseudonormals.at(nearest, face)[0]
        thick = float(np.ptp(self.points @ normal))
        if deep > thick and not self.is_network:  # a membrane has no thickness
            raise BodyError(
                f"depth: {1e3 * deep:.3g} mm exceeds the {1e3 * thick:.3g} mm of the body along the press: use a "
                "smaller depth"
            )
        return target, normal

    def _ramp(self, center: Array, normal: Array, deep: float, size: float, tip: TipShape) -> ContactHistory:
        """Press the tip in along a line that ends at `center` (3,), m; let a mass-spring model come to rest."""
        if isinstance(self.core, _core.SignedDistanceBody):
            return self._ramp_slowly(center, normal, deep, size, tip)
        radii = deep / size
        if self.settling_period is None:  # less than one radius per step
            steps = int(np.ceil(2.0 * radii)) if radii > 1.0 else 1
        else:
            steps = int(np.ceil(max(radii, 1.0) * self.ramp_time / self.settling_period))
        path = center + np.outer(deep * (1.0 - np.arange(1, steps + 1) / steps), normal)
        history = self._move(path, size, outward=normal, tip=tip)
        if self.settling_period is not None:
            in_contact = 1e3 * deep * (np.flatnonzero(history.nodes) + 1) / steps
            history = self._settle(center, size, normal, tip, self.settling_period)
            if len(in_contact) > 0 and history.nodes[-1] == 0:
                raise BodyError(
                    f"depth: at {1e3 * deep:.3g} mm the tip loses contact with the body; the last contact was at "
                    f"{in_contact[-1]:.3g} mm: use a smaller depth or a larger tip"
                )
        return history

    def _ramp_slowly(self, center: Array, normal: Array, deep: float, size: float, tip: TipShape) -> ContactHistory:
        """Press the tip in by a fiftieth of its radius per step; raise BodyError if it is pushed through the body."""
        steps = int(np.ceil(_STEPS_PER_RADIUS * deep / size)) + 1
        left = np.append(np.linspace(deep, 0.0, steps + 1), np.zeros(_STILL_STEPS))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", BodyWarning)  # the last step decides
            history = self._move(center + np.outer(left, normal), size, outward=normal, tip=tip)
        if not history.lost[-1]:
            push = history.force @ normal
            if push[-1] < _FALLEN * push.max():
                warnings.warn(
                    f"the force is largest at a depth of {1e3 * (deep - left[np.argmax(push)]):.3g} mm and falls from "
                    "there on: the tip slips off, or is so deep that contact by signed distance is too soft, which "
                    "begins at about one radius: use a smaller depth or a larger tip, or no signed_distance",
                    BodyWarning,
                    stacklevel=4,
                )
            return self._move(center[None], size, outward=normal, tip=tip)
        if history.lost[0]:
            raise BodyError(
                "contact_points: before the press a tip of the tool is already inside the body, without contact: give "
                "the points less the position of the lowest tip"
            )
        until = 1e3 * (deep - left[np.argmax(history.lost)])
        raise BodyError(
            f"depth: the tip is pushed through the body at {until:.3g} mm: use a smaller depth or a larger tip, or "
            "the body without signed_distance"
        )

    def _settle_hyperelastic(
        self, core: _core.HyperelasticBody, center: Array, normal: Array, deep: float, size: float, tip: TipShape
    ) -> ContactHistory:
        """Press the tip in by equilibria at ten depths, or four per radius if these are more."""
        steps = max(10, int(np.ceil(4.0 * deep / size)))
        depths = deep * np.arange(1, steps + 1) / steps

        def settle(step: int) -> Array:
            position = center + (deep - depths[step]) * normal
            return np.asarray(core.settle(position[None], normal[None], size, tip == "flat", _MAX_UPDATES)[0])

        def inverted() -> int:
            return count_inverted(self.contents.vertices, self.contents.tetrahedra, np.asarray(core.displacement()))

        return ContactHistory.of(settle_at_depths(depths, settle, inverted)[None])

    def _settle(self, center: Array, size: float, normal: Array, tip: TipShape, period: float) -> ContactHistory:
        """Keep the tip at `center` until the force stays within 0.1 % for 50 ms and will; warn if it does not in 60 s.

        What it will still change by follows from the change between the last windows, as it decays exponentially. A
        body that the press has thrown off has no force until it falls back on the tip: that must last for 2 s.
        """
        still, free = np.tile(center, (int(np.ceil(0.05 / period)), 1)), 0
        mean, drift = np.full(3, np.inf), np.inf
        for _ in range(1200):
            history = self._move(still, size, outward=normal, tip=tip)
            free = 0 if history.nodes.any() else free + 1
            least = 1e-3 * float(np.linalg.norm(history.force[-1]))
            last, mean = mean, history.force.mean(axis=0)
            before, drift = drift, float(np.linalg.norm(mean - last))
            steady = np.abs(np.ptp(history.force, axis=0)).max() <= least and _change_left(before, drift) <= least
            if steady and (free == 0 or free >= _FLIGHT):
                break
        else:
            warnings.warn(
                "the body did not settle in 60 s: add damping if it swings, use a shorter period if it creeps",
                BodyWarning,
                stacklevel=4,
            )
        force, deflection, energy, nodes, friction, lost = history
        return ContactHistory(force[-1:], deflection[-1:], energy[-1:], nodes[-1:], friction[-1:], lost[-1:])

    def simulate_path(
        self,
        path: ArrayLike,
        radius: float | str,
        *,
        outward: ArrayLike | None = None,
        tip: TipShape = "sphere",
        go_on: bool = False,
    ) -> ContactHistory:
        """Move the tip along a path, one period per sample, from rest, and return the contact.

        The tip may go in by any depth, by less than its radius per sample.

        Args:
            path: centers of the tip (m, 3), m or text.
            radius: of the sphere, or of the flat end of a rod, m or text.
            outward: direction out of the body, which is also the axis of a flat end: (3,) or (m, 3). None selects,
                for a sphere, the mean normal of the nodes in contact or the normal of the nearest node, and for a flat
                end the normal of the nearest surface point.
            tip: "sphere" or "flat".
            go_on: begin with the state in which the last path has left the body, in place of rest.

        Raises:
            PoseError: the path or a direction has the wrong shape or a number that is not finite.
            BodyError: the radius is not positive, the tip has another shape, more than 128 nodes lie under it, or it
                inverts tetrahedra of a mass-spring or hyperelastic body.
        """
        centers = lengths(path, "path")
        if centers.ndim != 2 or centers.shape[1] != 3:
            raise PoseError(f"a path is (m, 3) numbers in m; this has shape {centers.shape}")
        check_finite(centers, "path")
        check_near(centers, self.points)
        size = positive(radius, "m", "radius")
        check_tip(tip)
        if outward is None and tip == "flat":
            outward = self._pseudonormals.at(*self.surface.nearest(centers))
        if not go_on:
            self.core.reset()
        return self._move(centers, size, outward=outward, tip=tip)

    def _move(self, centers: Array, radius: float, *, outward: ArrayLike | None, tip: TipShape) -> ContactHistory:
        """Move the tip along a path (m, 3), m, from the present state; `outward` is (3,) or (m, 3)."""
        axes, self.last_core = np.empty((0, 3)) if outward is None else directions(outward, centers.shape), None
        rows = self.core.simulate_path(np.ascontiguousarray(centers), axes, radius, tip == "flat")
        if self.kind.by_distance:
            _warn_of_unsolved(rows)
            _warn_of_lost(rows[:, None, LOST] > 0.0)
        if isinstance(self.core, _core.HyperelasticBody):
            check_found(rows[:, SOLVED] > 0.0)
        if self.kind.name == "mass_spring":
            _check_upright(rows)
        return ContactHistory.of(rows)

    def simulate_tips(
        self, paths: ArrayLike, radii: ArrayLike, *, segments: ArrayLike | None = None
    ) -> list[ContactHistory]:
        """Move several tips along their paths on this body, from rest, and return the contact of each.

        The tips share the body's displacement: one presses what another has moved. The contact must be by signed
        distance.

        Args:
            paths: centers of the 1 to 8 tips, one period per sample (m, tips, 3), m or text.
            radii: of the tips (tips,), m or text.
            segments: from the center of each tip to the far end of its axis (tips, 3), m; None for spheres. A tip
                consists of the points within its radius of that segment (a capsule).

        Raises:
            PoseError: the paths or segments have the wrong shape or a number that is not finite.
            BodyError: there are more than 8 tips, a radius is not positive, or the contact is not by signed distance.
        """
        if self.kind.supports is not None:
            raise BodyError(
                "supports: several paths on a body whose supports change are not available: use "
                "with_support_changes(None)"
            )
        if not isinstance(self.core, _core.SignedDistanceBody):
            raise BodyError(
                'several tips need the contact by signed distance: signed_distance(), or contact="signed_distance"'
            )
        centers = np.ascontiguousarray(lengths(paths, "paths"))
        if centers.ndim != 3 or centers.shape[2] != 3 or not 1 <= centers.shape[1] <= MAX_TIPS:
            raise PoseError(
                f"paths are (m, tips, 3) numbers in m of 1 to {MAX_TIPS} tips; these have shape {centers.shape}"
            )
        check_finite(centers, "paths")
        count = centers.shape[1]
        sizes = np.array([positive(radius, "m", "radii") for radius in np.ravel(np.asarray(radii, dtype=object))])
        axes = np.zeros((count, 3)) if segments is None else np.ascontiguousarray(lengths(segments, "segments"))
        if len(sizes) != count or axes.shape != (count, 3):
            raise PoseError(f"{count} paths need {count} radii and segments, not {len(sizes)} and {axes.shape}")
        check_finite(axes, "segments")
        along = np.linalg.norm(axes, axis=1)
        axes = np.where(along[:, None] > 0.0, axes / np.maximum(along, 1e-300)[:, None], [0.0, 0.0, 1.0])
        core = self.last_core = self._signed_distance_core(count, tool=False)
        rows = core.simulate_tips(centers, np.ascontiguousarray(axes), sizes, along)
        _warn_of_unsolved(rows.reshape(-1, rows.shape[2]))
        _warn_of_lost(rows[:, :, LOST] > 0.0)
        return [ContactHistory.of(rows[:, tip]) for tip in range(count)]

    def pressure(self) -> Array:
        """Return the tip's pressure on each node's patch (n,), Pa, in the last tick or press."""
        nodes, forces = (self.last_core or self.core).contact_forces()
        pressure = np.zeros(len(self.nodes))
        np.add.at(pressure, nodes, forces / self.contents.areas[nodes])  # two tips of a tool may press one node
        return pressure

    def displacement(self) -> Array:
        """Return the mean displacement of each node's patch (n, 3), m.

        A linear body gives the long-term displacement under the forces of the last tick. A mass-spring body at one rate
        and a body whose supports change give their current displacement, a hyperelastic body that of each node's vertex
        at the last model update. After `indent` it is that of the press.
        """
        core = self.last_core or self.core
        if isinstance(core, _core.HyperelasticBody):
            return np.asarray(core.displacement())[self.node_vertices]
        if isinstance(core, _core.MassSpringBody | _core.SupportedBody):
            return np.asarray(core.displacement())
        nodes, forces = core.contact_forces()
        total = np.zeros(3 * len(self.nodes))
        for node, force, friction in zip(nodes, forces, core.friction_forces(), strict=True):
            total += self.compliance[:, 3 * node : 3 * node + 3] @ (friction - force * self.normals[node])
        return total.reshape(-1, 3)


def _change_left(before: float, drift: float) -> float:
    """Return an upper estimate of the change that follows two consecutive ones, as it decays exponentially."""
    return drift / (max(1.0 - drift / before, 1e-3) if drift < before < np.inf else 1e-3)


def _static_options(kind: ModelSpec) -> dict[str, float | str]:
    return {name: value for name, value in kind.options.items() if name == "sideways_fraction"}


def settle_at_depths(depths: Array, settle: Callable[[int], Array], inverted: Callable[[], int]) -> Array:
    """Press a tip in by equilibria at `depths` (m,), m, and return the core's row at the last one.

    A body that buckles may have no equilibrium at some depths in between.

    Args:
        depths: increasing.
        settle: moves the tip to the depth of an index and returns a row. Column 7 of the row is the number of nodes
            in contact, the last column is positive at equilibrium.
        inverted: returns the number of tetrahedra of negative volume at present.

    Raises:
        BodyError: there is no equilibrium at the last depth or at ten consecutive ones, or the tip has lost contact,
            inverted tetrahedra or more nodes under it than a local model holds at the last depth.
    """
    settled_depth, touched, unsettled = 0.0, False, 0
    for index, depth in enumerate(depths):
        row = settle(index)
        contact, settled, last = row[NODES] > 0, row[-1] > 0, index + 1 == len(depths)
        touched, unsettled = touched or contact, 0 if settled else unsettled + 1
        turned = inverted()
        if contact and settled and turned == 0:
            settled_depth = 1e3 * depth
        if (last and (not settled or turned > 0 or (touched and not contact))) or unsettled >= _MAX_UNSETTLED:
            problem = "there is no equilibrium"
            if touched and not contact:
                problem = "the tip loses contact with the body"
            elif settled:
                problem = f"the tip inverts {turned} tetrahedra of the body"
            until = (
                f"the last equilibrium in contact was at {settled_depth:.3g} mm"
                if settled_depth > 0
                else "nor is there one at a smaller depth"
            )
            raise BodyError(f"depth: at {1e3 * depth:.3g} mm {problem}; {until}: use a smaller depth or a larger tip")
    if row[SOLVED] == 0.0:
        raise BodyError(f"depth: at {1e3 * depth:.3g} mm {crowded()}")
    return row


def count_inverted(points: Array, tetrahedra: Indices, displacement: Array) -> int:
    """Return how many tetrahedra (c, 4) of a mesh with points (p, 3), m, a displacement (p, 3), m, turns inside out."""
    return int((volumes(points, tetrahedra) * volumes(points + displacement, tetrahedra) < 0.0).sum())


def check_resolved(force: Array, normal: Array, count: int, error: float | None, small: str) -> None:
    """Warn of a press that the mesh does not resolve; raise BodyError if its force points sideways as well.

    Args:
        force: on the tip (3,), N.
        normal: outward unit normal of the press (3,).
        count: number of nodes in contact.
        error: of the force by the mesh, relative; None if unknown.
        small: of `unresolved`.
    """
    if small and count > 0 and force @ normal < _SIDEWAYS * np.linalg.norm(force):
        raise BodyError(
            f"{small}: it lies beside them, and its force points sideways: use a mesh with a spacing of the tip's "
            "radius or a larger tip"
        )
    if count == 0:
        warnings.warn(
            "no node is in contact: the surface is fixed or outside of the contact surface there, the mesh is too "
            "coarse, or the contact was lost",
            BodyWarning,
            stacklevel=3,
        )
    elif small:
        warnings.warn(
            f"{small}, and the error of its force is not known: use a mesh with a spacing of the tip's radius or a "
            "larger tip",
            BodyWarning,
            stacklevel=3,
        )
    elif count < _FEW:
        warnings.warn(
            f"only {count} of the body's nodes {'is' if count == 1 else 'are'} in contact, too few for an accurate "
            f"force{'' if error is None else f' (error up to {100 * error:.0f} %)'}: use a finer mesh, a larger tip "
            "or a larger depth",
            BodyWarning,
            stacklevel=3,
        )


def _check_upright(rows: Array) -> None:
    """Raise BodyError if a tip in contact inverts tetrahedra of a mass-spring body in some ticks (m, 15)."""
    rows[rows[:, NODES] == 0, SOLVED] = 1.0  # without contact there is no force, whatever the shape
    turned = (rows[:, SOLVED] == 0.0) & (rows[:, NODES] < MOST_NODES - 1)
    if turned.any():
        raise BodyError(f"in {int(turned.sum())} of {len(rows)} ticks {_INVERTED}")


def _warn_of_unsolved(rows: Array) -> None:
    """Warn of steps of a signed-distance body whose forces are not converged, and mark them as solved."""
    unsolved = int(np.count_nonzero((rows[:, SOLVED] == 0.0) & (rows[:, LOST] == 0.0)))
    rows[:, SOLVED] = 1.0
    if unsolved:
        warnings.warn(
            f"the forces of {unsolved} of {len(rows)} steps are not converged to 2 % (5 % with friction), or more than "
            f"{MOST_PLACES} nodes are near the tip: use shorter steps, a smaller depth or tip, or a coarser mesh",
            BodyWarning,
            stacklevel=4,
        )


def _warn_of_lost(lost: Flags) -> None:
    """Warn if a tip of a signed-distance body is in it without contact: `lost` (steps, tips)."""
    if not lost.any():
        return
    text = "a tip starts inside the body or behind its contact surface, where it has"
    if not lost[:1].any():
        first = int(np.argmax(lost.any(axis=1)))
        remedy = "use a smaller depth, a larger tip, or hyperelastic"
        text = f"from step {first} on a tip is pushed through the body ({remedy}). It has"
    warnings.warn(f"path: {text} no contact by signed distance until it has come out", BodyWarning, stacklevel=4)


def not_found(found: Flags) -> str:
    """Return why the forces on a hyperelastic body were not `found` in some ticks (m,); empty if they were."""
    missing = int(np.count_nonzero(~found))
    if missing == 0:
        return ""
    return f"path: {unfound(f'{missing} of {len(found)} ticks')}"


def check_found(found: Flags) -> None:
    """Raise BodyError if the forces on a hyperelastic body were not `found` in some ticks (m,)."""
    if problem := not_found(found):
        raise BodyError(problem)
