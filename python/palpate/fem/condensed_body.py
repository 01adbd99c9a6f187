"""Elastic body condensed to its surface: data, geometry and storage."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Self
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse
from scipy.spatial import cKDTree

from palpate import _core
from palpate.arrays import Array, Flags, Indices, Single
from palpate.contact.diagnosis import format_size
from palpate.contact.mesh import BodySurface, Mesh
from palpate.contact.pseudonormals import Pseudonormals
from palpate.contact.simplices import area_vectors, boundary, parts_of_cells
from palpate.fem.checks import point_of
from palpate.fem.contact_accuracy import (
    fits_closely,
    force_error,
    has_known_error,
    is_shallow,
    is_thin,
    node_distance,
)
from palpate.fem.curved_surface import CurvedSurface
from palpate.fem.errors import BodyError
from palpate.fem.layer_modulus import layer_moduli
from palpate.fem.model_spec import COMPLIANCE, ModelSpec
from palpate.fem.multifrontal import MultifrontalSolver
from palpate.fem.spring_network import SpringNetwork, build_network, contact_patches, given_network, unstable_row
from palpate.fem.storage import BodyData, read, write
from palpate.fem.support_changes import DEFORMS, HELD
from palpate.fem.volume import Volume

CoreBody = (
    _core.ComplianceBody
    | _core.ModalBody
    | _core.StandardLinearSolidBody
    | _core.MassSpringBody
    | _core.HyperelasticBody
    | _core.SignedDistanceBody
    | _core.SupportedBody
    | _core.MultirateBody
)
_STIFF: Final = 10.0  # ratio of moduli from which material counts as fixed
_DRAG: Final = 4.0  # largest negative pressure over the least shear modulus, where a column is 10 % too soft
_FACING: Final = 0.5  # cosine between a normal and the direction to a tip above which a place faces the tip
_CURVED: Final = 0.1  # radius of a tip over that of the surface above which the surface is curved
_LEVEL: Final = np.cos(np.radians(30.0))
_LAYER_MODULI: Final[WeakKeyDictionary[BodyData, Array]] = WeakKeyDictionary()  # which the models of a body share


class CondensedBody:
    """Surface compliance of an elastic body, for n contact nodes.

    Attributes:
        contents: arrays and record, as stored in a file.
        kind: material model, its options and the friction coefficients.
        settling_period: period of a mass-spring model, s, which `indent` lets come to rest; None for other models.
        ramp_time: duration of an indentation by one tip radius, s.
    """

    def __init__(self, contents: BodyData, kind: ModelSpec = COMPLIANCE) -> None:
        self.contents = contents
        self.kind = kind
        self.settling_period: float | None = None
        self.ramp_time = 0.0
        self.last_core: CoreBody | None = None  # that acted last, in place of `core`: of several tips or of a press

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a body that `palpate body build` wrote.

        Raises:
            BodyError: the file is missing, incomplete, or not a body.
        """
        return cls(read(path))

    def save(self, path: str | Path) -> Path:
        """Write the body to an HDF5 file (.h5), atomically.

        The file holds the condensed body. It does not hold the material model or the friction.
        """
        return write(self.contents, path)

    def __repr__(self) -> str:
        x, y, z = np.ptp(self.points, axis=0).tolist()
        modes = len(self.contents.frequencies)
        counts = f"{len(self.nodes)} contact nodes" + (f", {modes} modes" if modes else "")
        return f"<Body: {self.kind}; {counts}, {format_size((x, y, z))}, source: {self.record['source']}>"

    @property
    def points(self) -> Array:
        """Points of the whole surface at rest (s, 3), m."""
        return self.contents.points

    @property
    def triangles(self) -> Indices:
        """Triangles of the whole surface (k, 3), counterclockwise seen from outside."""
        return self.contents.triangles

    @property
    def nodes(self) -> Array:
        """Positions of the contact nodes at rest (n, 3), m."""
        return self.contents.points[self.contents.nodes]

    @property
    def normals(self) -> Array:
        """Outward unit normals at the contact nodes (n, 3)."""
        return self.contents.normals

    @property
    def compliance(self) -> Single:
        """Displacement of each contact node per force on each (3n, 3n), m/N, row 3 x node + axis."""
        return self.contents.compliance

    @property
    def record(self) -> Mapping[str, Any]:
        """Build record: inputs, sizes, times, versions."""
        return self.contents.record

    @property
    def extent(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @cached_property
    def surface(self) -> Mesh:
        """Contact surface as a mesh."""
        used, faces = self._contact_surface
        return BodySurface(self.points[used], faces.reshape(-1, 3))

    @cached_property
    def whole_surface(self) -> Mesh:
        """The whole surface at rest as a mesh."""
        return BodySurface(self.points, self.triangles)

    @cached_property
    def _pseudonormals(self) -> Pseudonormals:
        """Normals of the contact surface."""
        return Pseudonormals(self.surface.vertices, self.surface.triangles)

    @cached_property
    def _curved_surface(self) -> CurvedSurface:
        """The contact surface as contact by signed distance sees it."""
        return CurvedSurface(self.surface.vertices, self.surface.triangles, self._pseudonormals)

    @cached_property
    def untouched_surface(self) -> Mesh | None:
        """The rest of the surface as a mesh; None if all of it is touched."""
        faces = self.contents.triangles[~self.contents.contact_triangles]
        return BodySurface(self.points, faces) if len(faces) else None

    @cached_property
    def _fixed_surface(self) -> tuple[Mesh | None, cKDTree | None]:
        """Triangles of the contact surface that are fixed or held, and a tree of its fixed or held vertices, if any."""
        faces = self.contents.triangles[self.contents.contact_triangles]
        free = np.isin(faces, self.contents.nodes)
        still = faces[~free.any(axis=1)]
        mesh = BodySurface(self.points, still) if len(still) else None
        vertices = np.unique(faces[~free])
        return mesh, cKDTree(self.points[vertices]) if len(vertices) else None

    @cached_property
    def _untouched_places(self) -> tuple[Array, Array]:
        """Middles of the triangles and of their edges outside of the contact surface, m, and normals: (k, 3) each."""
        corners = self.points[self.triangles[~self.contents.contact_triangles]]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]
        middles = [corners.mean(axis=1), *(0.5 * (corners[:, i] + corners[:, i - 1]) for i in range(3))]
        return np.concatenate(middles), np.tile(normals, (4, 1))

    def is_level(self, center: Array, radius: float) -> bool:
        """Return whether the nodes in a sphere have the normal of the nearest surface point, within 30 degrees.

        Contact along the normals pushes nodes at an edge obliquely: beside one the force was up to 2.7 times too large.
        """
        normal = self._pseudonormals.at(*self.surface.nearest(center[None]))[0]
        within = np.linalg.norm(self.nodes - center, axis=1) < radius
        return bool((self.normals[within] @ normal > _LEVEL).all())

    def nearest_node(self, point: Array) -> int:
        """Return the index of the contact node nearest to a point (3,), m, at rest."""
        return int(np.argmin(np.linalg.norm(self.nodes - point, axis=1)))

    def is_thin_under(self, point: Array, radius: float, depth: float) -> bool:
        """Return whether the body is too thin, at the surface near a point (3,), m, for a known error (`is_thin`)."""
        node, effective = self.nearest_node(point), self.effective_radius(point, radius)
        inward = -self.normals[node]
        return is_thin(effective, depth, self.depth_along(self.nodes[node] + 1e-6 * self.extent * inward, inward))

    def effective_radius(self, point: Array, radius: float) -> float:
        """Return the radius of the sphere that meets a plane as one of `radius`, m, meets the surface near a point, m.

        It is 1/(1/radius + H) with the mean curvature H of the surface (Hertz), and infinite in a hollow that fits.
        """
        curvature = 1.0 / radius + self.curvature_at(point)
        return 1.0 / curvature if curvature > 0.0 else np.inf

    def curvature_at(self, point: Array) -> float:
        """Return the mean curvature of the surface near a point (3,), m, in 1/m, positive where it is convex."""
        return float(np.mean(self._curvatures_at(point)))

    def sagitta_at(self, point: Array) -> float:
        """Return the height, m, of the surface near a point (3,), m, over a chord as long as the distance of the nodes.

        The curvature is the root mean square of that in several directions.
        """
        return self._bend_at(point) * node_distance(self.nodes, point) ** 2 / 8.0

    def is_curved(self, point: Array, radius: float) -> bool:
        """Return whether the surface near a point (3,), m, is curved for a tip: by over a tenth of its curvature.

        There contact along the normals is far too stiff: on balls of 10 and 20 mm, with contact radii of 0.7 to 1.4
        distances of the nodes, by 20 to 190 %, beyond `force_error` in 122 of 262 presses of all depths.
        """
        return self._bend_at(point) * radius > _CURVED

    def _bend_at(self, point: Array) -> float:
        """Return the root mean square of the curvatures near a point (3,), m, in 1/m."""
        return float(np.sqrt(np.mean(self._curvatures_at(point) ** 2)))

    def _curvatures_at(self, point: Array) -> Array:
        return self._curved_surface.curvatures(int(self.surface.nearest(point[None])[1][0]))

    def mesh_doubt(self, point: Array, radius: float, depth: float) -> str:
        """Return why the error by the mesh of a sphere's force near a point (3,), m, is not known; "" if it may be."""
        effective = self.effective_radius(point, radius)
        if np.isinf(effective):
            return "the tip is as wide as the hollow of the surface"
        contact = f"the contact radius of about {1e3 * float(np.sqrt(effective * depth)):.2g} mm"
        if self.is_thin_under(point, radius, depth):
            return f"the body is thin under the tip, less than 1.8 times {contact}"
        if is_shallow(effective, depth, node_distance(self.nodes, point)):
            return f"{contact} is less than 0.38 times the distance of the nodes (press deeper, or use a finer mesh)"
        if fits_closely(self.sagitta_at(point), depth, self.curvature_at(point), radius):
            return "the mesh is too coarse for the hollow under the tip (press deeper, or use a finer mesh)"
        return ""

    def mesh_error(self, nodes: int, point: Array, radius: float, depth: float) -> float | None:
        """Return the relative error by the mesh of a sphere's force (`force_error`); None if it is not known.

        Args:
            nodes: number of nodes in contact.
            point: near which it presses (3,), m.
            radius: of the sphere, m.
            depth: of its lowest point below the surface at rest, m.
        """
        by_distance = self.kind.by_distance
        known = depth > 0.0 and has_known_error(self.record) and not self.kind.contact_points
        flat = self.is_level(point, radius) and not self.is_curved(point, radius)
        if not known or not (by_distance or flat) or self.mesh_doubt(point, radius, depth):
            return None
        return force_error(nodes, signed_distance=by_distance, sagitta=self.sagitta_at(point) / depth)

    def in_phase(self, number: int) -> CondensedBody:
        """Return the geometry of the body after a number of changes of its supports: its nodes are those not held."""
        assert self.kind.supports is not None
        roles, nodes = self.kind.supports.roles(self.nodes)[number], self.contents.nodes
        fixed = self.contents.dirichlet.copy()
        fixed[self._surface_vertices[nodes[roles == HELD]]] = True
        deforms = np.isin(self.triangles, nodes[roles == DEFORMS]).all(axis=1)
        contact = self.contents.contact_triangles & ~deforms
        contents = replace(self.contents, nodes=nodes[roles != HELD], dirichlet=fixed, contact_triangles=contact)
        return CondensedBody(contents)

    def overlaps_untouched(self, centers: Array, radius: float, axis: Array | None = None) -> Flags:
        """Return whether rigid tips at `centers` (m, 3), m, are over a part of the surface without contact (m,).

        That is a fixed or held part, which it overlaps, or one outside of the contact surface that it would touch. No
        force acts there, so that on the tip is too small.

        Args:
            centers: of a sphere, or of the flat end of a rod.
            radius: m.
            axis: unit vector along the rod, out of the body (3,); None: a sphere.
        """
        return self._overlaps_fixed(centers, radius, axis) | self._overlaps_outside(centers, radius, axis)

    def _overlaps_outside(self, centers: Array, radius: float, axis: Array | None) -> Flags:
        """Return whether a tip would touch places outside of the contact surface that face it (m,).

        The surface sinks in: a sphere touches it as far as half of its depth (Hertz).
        """
        places, normals = self._untouched_places
        found = np.zeros(len(centers), dtype=bool)
        if not len(places):
            return found
        nearest, faces = self.surface.nearest(centers)
        height = np.einsum("ma,ma->m", centers - nearest, self._pseudonormals.at(nearest, faces))
        for row, center in enumerate(centers):
            offsets = center - places
            if axis is None:
                distance = np.linalg.norm(offsets, axis=1)
                within = distance < 0.5 * (radius + height[row])
                facing = np.einsum("ka,ka->k", offsets, normals) > _FACING * distance
            else:
                below = offsets @ axis
                within = (below < -1e-3 * radius) & (np.linalg.norm(offsets - np.outer(below, axis), axis=1) < radius)
                facing = normals @ axis > _FACING
            found[row] = (within & facing).any()
        return found

    def _overlaps_fixed(self, centers: Array, radius: float, axis: Array | None) -> Flags:
        """Return whether a tip overlaps the fixed or held contact surface by more than a thousandth of its radius."""
        mesh, tree = self._fixed_surface
        found = np.zeros(len(centers), dtype=bool)
        if tree is None:
            return found
        vertices = np.asarray(tree.data)

        def overlap(offsets: Array) -> Flags:
            if axis is None:
                return np.asarray(np.linalg.norm(offsets, axis=1) < 0.999 * radius, dtype=bool)
            above = offsets @ axis
            beside = np.linalg.norm(offsets - np.outer(above, axis), axis=1)
            return np.asarray((above > 1e-3 * radius) & (beside < 0.999 * radius), dtype=bool)

        if mesh is not None:
            found |= overlap(mesh.nearest(centers)[0] - centers)
        if axis is None:
            return found | overlap(vertices[tree.query(centers)[1]] - centers)
        for row in np.flatnonzero(~found):  # the nearest vertex may lie beside the rod and another one under it
            found[row] = overlap(vertices - centers[row]).any()
        return found

    @cached_property
    def _surface_vertices(self) -> Indices:
        """Mesh vertex of each surface point (s,); of springs or boundary elements the points are the first vertices."""
        if self.is_network or len(self.contents.tetrahedra) == 0:
            return np.arange(len(self.points))
        return np.asarray(np.unique(self.volume.surface))

    @cached_property
    def _fixed_triangles(self) -> Indices:
        """Triangles of the whole surface whose three points are fixed (k, 3)."""
        fixed = self.contents.dirichlet[self._surface_vertices]
        return np.asarray(self.triangles[fixed[self.triangles].all(axis=1)])

    def is_behind_fixed(self, start: Array, end: Array) -> bool:
        """Return whether the straight way from `start` to `end`, both (3,), m, crosses a fixed part of the body.

        That is a fixed part of the surface, or material ten times as stiff as that at `start` which is fixed somewhere.
        No surface can be displaced along such a way.
        """
        if len(_crossings(self.points, self._fixed_triangles, start, end)[0]):
            return True
        held = self._held_by_stiffness(start)
        return len(held) > 0 and len(_crossings(self.contents.vertices, held, start, end)[0]) > 0

    def _held_by_stiffness(self, point: Array) -> Indices:
        """Return the boundary (k, 3), as vertices, of fixed parts much stiffer than the surface near a point (3,)."""
        cells, young = self.contents.tetrahedra, self.contents.young
        if not len(cells) or np.ptp(young) == 0.0:
            return np.empty((0, 3), dtype=np.int64)
        vertex = self.node_vertices[self.nearest_node(point)]
        stiff = cells[young > _STIFF * young[(cells == vertex).any(axis=1)].mean()]
        part = parts_of_cells(stiff, len(self.contents.vertices))
        return boundary(stiff[np.isin(part[stiff[:, 0]], part[self.contents.dirichlet])])

    def depth_along(self, point: Array, direction: Array) -> float:
        """Return the way from a point (3,), m, to the surface of the body at rest along a unit vector; 0 outside."""
        return self.surface_along(point, direction)[0]

    def surface_along(self, point: Array, direction: Array) -> tuple[float, Indices]:
        """Return the same way, and the corners (3,) of the triangle where it ends, as points; none outside."""
        if not self.contains(point):
            return 0.0, np.empty(0, dtype=np.int64)
        shares, crossed = _crossings(self.points, self.triangles, point, point + 2.0 * self.extent * direction)
        if not len(shares):
            return 0.0, np.empty(0, dtype=np.int64)
        first = int(np.argmin(shares))
        return 2.0 * self.extent * float(shares[first]), np.asarray(self.triangles[crossed[first]])

    def on_surface(self, values: ArrayLike) -> Array:
        """Return node values (n, ...) at the vertices of `surface` (v, ...); fixed vertices have zero.

        `body.surface.vertices + body.on_surface(displacement)` is the deformed surface.

        Raises:
            BodyError: there is not one number, or one row of numbers, per node.
        """
        try:
            each = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            raise BodyError(f"values: one number, or row of numbers, per node is needed, not {values!r}") from None
        if each.ndim == 0 or len(each) != len(self.nodes):
            raise BodyError(f"one value, or row, for each of the {len(self.nodes)} nodes is needed, not {each.shape}")
        whole = np.zeros((len(self.points), *each.shape[1:]))
        whole[self.contents.nodes] = each
        return np.asarray(whole[self._contact_surface[0]])

    @property
    def is_network(self) -> bool:
        """Whether the body consists of a user's springs (`build_springs`) and is no solid."""
        return len(self.contents.springs) > 0

    @cached_property
    def volume(self) -> Volume:
        """Tetrahedral mesh from which the body was built.

        Raises:
            BodyError: the body was built by boundary elements, or consists of springs.
        """
        if self.is_network:
            raise BodyError("the body consists of springs, not of a solid: use mass_spring, or build a solid")
        if len(self.contents.tetrahedra) == 0:
            raise BodyError(
                "the body was built by boundary elements, from its surface alone: build it by finite elements for "
                "this model"
            )
        return Volume(self.contents.vertices, self.contents.tetrahedra, str(self.record["source"]))

    def contains(self, point: ArrayLike) -> bool:
        """Return whether a point (3,), m or text, lies in the body at rest, by the solid angle of its surface.

        Raises:
            PoseError: the point is not three finite numbers.
        """
        at = point_of(point)
        a, b, c = (self.points[self.triangles[:, i]] - at for i in range(3))
        x, y, z = (np.linalg.norm(edge, axis=1) for edge in (a, b, c))
        volume = np.einsum("ka,ka->k", a, np.cross(b, c))  # van Oosterom & Strackee 1983
        dot = [np.einsum("ka,ka->k", p, q) for p, q in ((a, b), (b, c), (c, a))]
        angle = 2.0 * np.arctan2(volume, x * y * z + dot[0] * z + dot[1] * x + dot[2] * y)
        return bool(angle.sum() > 2.0 * np.pi)

    @cached_property
    def patch_weights(self) -> sparse.csr_matrix:
        """Weight of each mesh vertex (p) in the mean over each node's patch (n, p)."""
        begin, vertices, weights = self._patches()
        return sparse.csr_matrix((weights, vertices, begin), shape=(len(self.nodes), len(self.contents.vertices)))

    @cached_property
    def node_vertices(self) -> Indices:
        """Mesh vertex of each node (n,)."""
        return np.asarray(self._volume_triangles()[0])

    @cached_property
    def spring_network(self) -> SpringNetwork:
        """Masses and springs of `mass_spring`. Takes a few seconds for thousands of vertices of a solid."""
        if self.is_network:
            return given_network(self.contents)
        density = self._recorded("density_kg_per_m3")
        return build_network(self.volume, self.contents.young, self._recorded("poisson"), density)

    @cached_property
    def core(self) -> CoreBody:
        """C++ contact model of one tip."""
        return _core.ComplianceBody(*self._arrays(), *self.kind.friction)

    def _signed_distance_core(self, tips: int = 1, *, tool: bool = True) -> _core.SignedDistanceBody:
        """Return a core with contact by signed distance, from the options of the kind, at rest.

        Args:
            tips: 1 to 8 tips that move independently.
            tool: whether the contact points of the kind take the place of one tip.
        """
        arguments = self._signed_distance_arguments()
        if not tool:
            arguments.pop("contact_points", None)
        static, dynamic = self.kind.friction
        return _core.SignedDistanceBody(
            *self._arrays(), **arguments, tips=tips, static_friction=static, dynamic_friction=dynamic
        )

    def _supported_core(self) -> _core.SupportedBody:
        """Return a core whose supports and touched nodes change as the plan of the kind says, at rest."""
        plan = self.kind.supports
        assert plan is not None
        roles = np.ascontiguousarray(plan.roles(self.nodes))
        arguments: dict[str, Any] = {}
        if self.kind.by_distance:
            arguments = self._signed_distance_arguments()
            arguments["static_friction"], arguments["dynamic_friction"] = self.kind.friction
        try:
            return _core.SupportedBody(*self._arrays(), steps=plan.steps, roles=roles, **arguments)
        except ValueError as problem:
            raise BodyError(f"supports: {problem}") from None

    def _signed_distance_arguments(self) -> dict[str, Any]:
        """Return the arguments of a core with contact by signed distance by name, without arrays and friction."""
        numbers = {name: value for name, value in self.kind.options.items() if isinstance(value, float | int)}
        vertices, triangles, node, modulus = self._contact_patches()
        arguments: dict[str, Any] = {
            "vertices": vertices,
            "triangles": triangles,
            "node": node,
            "modulus": modulus,
            "poisson": self._recorded("poisson"),
            "shapes": np.empty((0, 0), dtype=np.float32),
            "frequencies": np.empty(0),
            "period": numbers.get("period", 1e-3),
            "rayleigh_alpha": numbers.get("rayleigh_alpha", 0.0),
            "rayleigh_beta": numbers.get("rayleigh_beta", 0.0),
            "instantaneous_ratio": numbers.get("instantaneous_ratio", 1.0),
            "retardation_time": numbers.get("retardation_time", 1.0),
            "sideways": numbers.get("sideways_fraction", 1.0),
        }
        if self.kind.name == "modal":
            arguments["frequencies"], arguments["shapes"] = self.contents.modes_and_residuals()
        if self.kind.contact_points:
            arguments["contact_points"] = np.array(self.kind.contact_points)
        return arguments

    def _recorded(self, key: str) -> float:
        if self.is_network:
            raise BodyError("the body consists of springs, not of a solid with an elastic modulus: use mass_spring")
        try:
            return float(self.record[key])
        except (KeyError, TypeError, ValueError):
            raise BodyError(f"the record of the body lacks {key}, which this model needs: build it again") from None

    @cached_property
    def _contact_surface(self) -> tuple[Indices, Indices]:
        """Indices of the points of `surface`, and its triangles as indices into those points."""
        return np.unique(self.triangles[self.contents.contact_triangles], return_inverse=True)

    def _volume_triangles(self) -> tuple[Indices, Indices]:
        """Return the contact nodes (n,) and the contact triangles (k, 3) as vertices of `volume`."""
        if self.is_network:
            return self.contents.nodes, self.triangles[self.contents.contact_triangles]
        on_surface = np.unique(self.volume.surface)
        return on_surface[self.contents.nodes], on_surface[self.triangles[self.contents.contact_triangles]]

    def _contact_patches(self) -> tuple[Array, NDArray[np.int32], NDArray[np.int32], Array]:
        """Return vertices (v, 3), triangles (k, 3), nodes of the vertices (v,), moduli of their layers (n, 2), Pa."""
        used, faces = self._contact_surface
        node_of = np.full(len(self.points), -1, dtype=np.int32)
        node_of[self.contents.nodes] = np.arange(len(self.nodes), dtype=np.int32)
        triangles = np.ascontiguousarray(faces.reshape(-1, 3), dtype=np.int32)
        return np.ascontiguousarray(self.points[used]), triangles, node_of[used], self._plane_strain_moduli()

    def _plane_strain_moduli(self) -> Array:
        """Return E / (1 - nu^2) of the contact's layer under round tips and under flat ends (n, 2), Pa."""
        return self._layer_moduli() / (1.0 - self._recorded("poisson") ** 2)

    def _layer_moduli(self) -> Array:
        """Return Young's modulus of the contact's layer under round tips and under flat ends (n, 2), Pa."""
        contents = self.contents
        if len(contents.tetrahedra) == 0:
            scale = float(self.record.get("scaled_stiffness", 1.0))
            return np.full((len(self.nodes), 2), scale * self._recorded("young_Pa"))
        moduli = _LAYER_MODULI.get(contents)
        if moduli is None:
            moduli = layer_moduli(self.nodes, self.normals, contents.areas, self.volume, contents.young)
            _LAYER_MODULI[contents] = moduli
        return moduli

    def _patches(self) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
        nodes, triangles = self._volume_triangles()
        return contact_patches(self.contents.vertices, triangles, nodes)

    def _network_compliance(self) -> Single:
        """Return the static compliance of the contact nodes by the springs and volumes near rest (3n, 3n), m/N."""
        if self.is_network:
            return np.ascontiguousarray(self.compliance)
        network, free = self.spring_network, np.flatnonzero(~self.contents.dirichlet)
        begin, vertices, weights = self._patches()
        loads = sparse.csr_matrix((weights, vertices, begin), shape=(len(self.nodes), len(network.points))).T
        stiffness = network.free_matrix(self.contents.dirichlet)
        return MultifrontalSolver(stiffness, loads.tocsr()[free], network.points[free]).compliance()

    def _check_network(self) -> None:
        """Raise BodyError if negative pressures make the network unstable at rest, or of several moduli too soft."""
        network = self.spring_network
        if not (network.pressure < 0.0).any():
            return
        problem, shear = "", self.contents.young.min() / (2.0 * (1.0 + self._recorded("poisson")))
        if -network.pressure.min() > _DRAG * shear:
            problem = (
                f"of stiff material they are over {_DRAG:g} times the shear modulus of the softest: it is too soft"
            )
        elif unstable_row(network.free_matrix(self.contents.dirichlet), 0.0) is not None:
            problem = "they outweigh the springs: the body is unstable at rest"
        if problem:
            raise BodyError(
                "mass_spring: below a Poisson's ratio of 0.25 the volumes have negative pressures, and "
                f"{problem}. Use a Poisson's ratio of 0.25 or more, or another model"
            )

    def _own_compliance(self) -> Array:
        """Return the static compliance of each contact node by itself (n, 3, 3), m/N."""
        n = len(self.nodes)
        blocks = np.einsum("iaib->iab", self.compliance.reshape(n, 3, n, 3))
        return np.ascontiguousarray(blocks, dtype=float)

    def _network_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the masses, springs, volumes and patches of the mass-spring model, in the order of the core."""
        network = self.spring_network
        begin, vertices, weights = self._patches()
        return {
            "positions": network.points,
            "masses": network.masses,
            "fixed": np.ascontiguousarray(self.contents.dirichlet),
            "springs": np.ascontiguousarray(network.springs, dtype=np.int32),
            "stiffness": network.stiffness,
            "rest_lengths": network.rest_lengths,
            "damping": network.damping,
            "tetrahedra": np.ascontiguousarray(network.tetrahedra, dtype=np.int32),
            "pressure": network.pressure,
            "patch_begin": begin,
            "patch_vertices": vertices,
            "patch_weights": weights,
            "patch_compliance": self._own_compliance(),
        }

    def _arrays(self) -> tuple[Array, Array, Array, Single]:
        nodes, normals, areas = (np.ascontiguousarray(a) for a in (self.nodes, self.normals, self.contents.areas))
        return nodes, normals, areas, np.ascontiguousarray(self.compliance)


def _crossings(points: Array, triangles: Indices, start: Array, end: Array) -> tuple[Array, Indices]:
    """Return the shares, 0 to 1, of a straight way at which it crosses triangles (k, 3) of points, and which ones.

    Args:
        points: (s, 3), m.
        triangles: as indices of points (k, 3).
        start, end: of the way (3,), m.
    """
    way, normal = end - start, area_vectors(points, triangles)
    along = normal @ way
    crossed = np.abs(along) > 1e-12 * np.linalg.norm(normal, axis=1) * float(np.linalg.norm(way))
    corners, normal, along = points[triangles[crossed]], normal[crossed], along[crossed]
    share = np.einsum("ij,ij->i", corners[:, 0] - start, normal) / along
    from_at = corners - (start + share[:, None] * way)[:, None]
    parts = np.einsum("ikj,ij->ik", np.cross(from_at, np.roll(from_at, -1, axis=1)), normal)
    inside = parts.min(axis=1) >= -1e-9 * parts.sum(axis=1)  # a way along an edge crosses both triangles
    met = inside & (share >= 0.0) & (share <= 1.0)
    return share[met], np.flatnonzero(crossed)[met]
