"""Boundary elements: compliance of the surface of a homogeneous body, without a mesh of its interior.

Somigliana's identity holds at each node x of the surface, with Kelvin's displacement U and traction T (Brebbia, Telles
& Wrobel, Boundary Element Techniques, 1984, sections 5.2 and 5.5; James & Pai, ArtDefo, 1999, for haptics):

    c(x) u(x) + integral T(x, y) u(y) dA = integral U(x, y) t(y) dA

Displacements u, and tractions t on fixed triangles, are quadratic or linear in each flat triangle. c and the strongly
singular integrals follow from rigid translations, which no traction accompanies. There is no volumetric locking near a
Poisson's ratio of 0.5. Contact acts as in `palpate.fem.elements`: linear hat functions as tractions, and mean
displacements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack, lu_factor, lu_solve

from palpate.arrays import Array, Flags, Indices
from palpate.contact.simplices import area_vectors, unique_rows
from palpate.fem.errors import BodyError
from palpate.fem.hat_functions import hat_integrals

__all__ = ["BoundaryElements"]

Kernel = Callable[[int, int], Array]

_CHUNK = 1_500_000  # pairs of a node and a quadrature point at a time
_NEAR = 2.0  # size of a triangle over its distance, above which it is subdivided
_MOST_LEVELS = 5
_LEAST_ANGLE = 1e-3  # share of a sphere about a node of a surface that is a boundary
_DUFFY = 12  # Gauss points along each direction in a triangle that contains the node
# Quadrature of degree 4 on a triangle (Strang & Fix 1973): barycentric coordinates and weights.
_A, _B = 0.445948490915965, 0.091576213509771
_RULE: Array = np.array([[1 - 2 * a if i == j else a for j in range(3)] for a in (_A, _B) for i in range(3)])
_WEIGHTS: Array = np.repeat([0.223381589678011, 0.109951743655322], 3)
_GRID: Array = np.array([[i, j, 10 - i - j] for i in range(11) for j in range(11 - i)]) / 10.0


@dataclass(frozen=True, eq=False)
class BoundaryElements:
    """Boundary-element discretization of a closed surface with N nodes: its vertices, then the midpoints of its edges.

    Attributes:
        points: vertices (v, 3), m.
        triangles: vertices of each triangle (k, 3), counterclockwise seen from outside.
        contact: whether each triangle belongs to the contact surface (k,).
        dirichlet: whether each vertex is fixed (v,). A triangle is fixed if its three vertices are.
        young: Young's modulus, Pa.
        poisson: Poisson's ratio.
        order: 2 for quadratic displacements, 1 for linear ones, which have no nodes at midpoints.

    Raises:
        BodyError: no triangle is fixed.
    """

    points: Array
    triangles: Indices
    contact: Flags
    dirichlet: Flags
    young: float
    poisson: float
    order: int = 2

    def __post_init__(self) -> None:
        if not self.fixed_triangles.any():
            raise BodyError("fixed: no whole triangle of the surface is fixed: fix a larger part of it")

    @property
    def fixed_triangles(self) -> Flags:
        """Whether each triangle is fixed (k,)."""
        return np.asarray(self.dirichlet[self.triangles].all(axis=1))

    @cached_property
    def contact_nodes(self) -> Indices:
        """Contact nodes (n,): vertices of the contact triangles that are not fixed."""
        vertices = np.unique(self.triangles[self.contact])
        return np.asarray(vertices[~self.dirichlet[vertices]])

    @cached_property
    def elements(self) -> Indices:
        """Nodes of each triangle (k, 3 or 6): its vertices, then the midpoints of the edges 01, 12 and 20."""
        if self.order == 1:
            return self.triangles
        edges = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]], axis=2)
        number = unique_rows(edges.reshape(-1, 2))[1]
        return np.hstack([self.triangles, len(self.points) + number.reshape(-1, 3)])

    @cached_property
    def nodes(self) -> Array:
        """Positions of the nodes (N, 3), m."""
        total = np.zeros((int(self.elements.max()) + 1, 3))
        total[self.elements] = _shapes(_LOCAL[: self.elements.shape[1]], 1) @ self.points[self.triangles]
        return total

    @cached_property
    def areas(self) -> Array:
        """Integrals of the hat functions of the contact nodes (n,), m^2."""
        return hat_integrals(self.points, self.triangles[self.contact], self.contact_nodes)

    @property
    def memory(self) -> float:
        """Bytes of the matrices and of the integration."""
        edges = 1.5 * len(self.triangles) if self.order == 2 else 0.0
        size, held = 3.0 * (len(self.points) + edges), 3.0 * self.order**2 * self.fixed_triangles.sum()
        return float(8.0 * size * (size + held + 9.0 * len(self.contact_nodes)) + 0.4e9)

    def compliance(self) -> tuple[NDArray[np.float32], float]:
        """Return the compliance (3n, 3n), m/N, row 3 x contact node + axis, and its asymmetry, which is removed.

        The asymmetry is relative, and measures the error of the discretization.

        Raises:
            BodyError: the surface overlaps itself, or the compliance is not positive definite.
        """
        held = np.unique(self.elements[self.fixed_triangles])
        t, load, reaction = self._integrals(held)
        self._check_angles(t)
        scale = self.young / float(np.ptp(self.points, axis=0).max())  # makes the columns of u and t alike
        t[:, _rows(held)] = -scale * reaction
        alone = np.setdiff1d(np.flatnonzero(self.dirichlet), held)  # fixed vertices without a fixed triangle
        t[_rows(alone)], load[_rows(alone)] = 0.0, 0.0
        t[:, _rows(alone)] = 0.0
        t[_rows(alone), _rows(alone)] = 1.0
        moved = lu_solve(lu_factor(t, overwrite_a=True), load, overwrite_b=True)
        moved[_rows(held)] = 0.0
        mean = sparse.kron(self._means(), sparse.eye(3)).tocsr()
        compliance = (mean @ moved) / np.repeat(self.areas, 3)
        asymmetry = float(np.abs(compliance - compliance.T).max() / np.abs(compliance).max())
        result = np.asarray(0.5 * (compliance + compliance.T), dtype=np.float32)
        if lapack.spotrf(result, lower=1, clean=False)[1] != 0:
            raise BodyError(
                "the compliance is not positive definite: mesh the surface again with well-shaped triangles; the "
                f"widest angle of these is {self._widest_angle():.0f} degrees"
            )
        return result, asymmetry

    def _check_angles(self, t: Array) -> None:
        """Raise BodyError if a node lies on or in another part of the surface.

        The trace of c is three times the share of a small sphere about the node that is in the body.
        """
        share = np.einsum("iaia->i", t.reshape(len(self.nodes), 3, len(self.nodes), 3)) / 3.0
        if share.min() > _LEAST_ANGLE and share.max() < 1.0 - _LEAST_ANGLE:
            return
        x, y, z = 1e3 * self.nodes[int(np.argmax(np.abs(share - 0.5)))]
        raise BodyError(
            f"the surface overlaps or touches itself at ({x:.4g}, {y:.4g}, {z:.4g}) mm: unite its parts, or build the "
            "body by finite elements"
        )

    def _widest_angle(self) -> float:
        """Return the widest angle of a triangle, degrees."""
        edges = np.roll(self.points[self.triangles], -1, axis=1) - self.points[self.triangles]
        edges /= np.linalg.norm(edges, axis=2, keepdims=True)
        return float(np.degrees(np.arccos(-np.einsum("kia,kia->ki", edges, np.roll(edges, 1, axis=1)).max())))

    def _means(self) -> sparse.csr_matrix:
        """Return the weights of the nodal displacements in the mean over each contact node's patch (n, N)."""
        faces, shapes = self.triangles[self.contact], _shapes(_RULE, self.order)
        elements = self.elements[self.contact]
        entries = self._sizes[self.contact, None, None] * np.einsum("q,qi,qj->ij", _WEIGHTS, _RULE, shapes)
        rows, columns = np.repeat(faces, elements.shape[1], axis=1), np.tile(elements, 3)
        shape = (len(self.points), len(self.nodes))
        mass = sparse.csr_matrix((entries.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
        return (sparse.diags(1.0 / self.areas) @ mass[self.contact_nodes]).tocsr()

    @cached_property
    def _area_vectors(self) -> Array:
        return area_vectors(self.points, self.triangles)

    @cached_property
    def _sizes(self) -> Array:
        return np.asarray(np.linalg.norm(self._area_vectors, axis=1))

    @cached_property
    def _normals(self) -> Array:
        return np.asarray(self._area_vectors / self._sizes[:, None])

    def _integrals(self, held: Indices) -> list[Array]:
        """Return the integrals of kernels times shape functions at each node.

        They are T with c for all displacements (3N, 3N), U for the tractions of the contact nodes (3N, 3n), and U for
        those of the fixed nodes `held` (3N, 3 held).
        """
        size = len(self.nodes)
        everything = np.ones(len(self.triangles), dtype=bool)
        fields = [
            _Field(self.elements, everything, self.order, np.arange(size)),
            _Field(self.triangles, self.contact, 1, self.contact_nodes),
            _Field(self.elements, self.fixed_triangles, self.order, held),
        ]
        result = [np.zeros((size, 3, len(field.nodes), 3)) for field in fields]
        levels = self._levels()
        self._add_far(result, fields, levels)
        for level in range(1, int(levels.max()) + 1):
            x, triangle = np.nonzero(levels == level)
            self._add_pairs(result, fields, x, triangle, *_subdivided(level))
        for local in range(self.elements.shape[1]):
            triangle = np.arange(len(self.triangles))
            self._add_pairs(result, fields, self.elements[:, local], triangle, *_singular(local), local)
        index = np.arange(size)
        result[0][index, :, index] -= result[0].sum(axis=2)  # a rigid translation needs no traction
        return [each.reshape(3 * size, -1) for each in result]

    def _levels(self) -> NDArray[np.int8]:
        """Return how often each triangle is subdivided for each node (N, k); -1 if it contains the node."""
        corners = self.points[self.triangles]
        center = corners.mean(axis=1)
        reach = np.linalg.norm(corners - center[:, None], axis=2).max(axis=1)
        levels = np.zeros((len(self.nodes), len(center)), dtype=np.int8)
        for begin in range(0, len(self.nodes), 200):
            x = self.nodes[begin : begin + 200]
            distance = np.linalg.norm(x[:, None] - center, axis=2)
            row, triangle = np.nonzero(distance < (1.0 + _NEAR) * reach)
            nearest = np.linalg.norm(_GRID @ corners[triangle] - x[row, None], axis=2).min(axis=1)
            distance[row, triangle] = np.maximum(nearest, 1e-3 * reach[triangle])
            ratio = _NEAR * reach / distance
            levels[begin : begin + 200] = np.clip(np.ceil(np.log2(ratio)), 0, _MOST_LEVELS)
        levels[self.elements.ravel(), np.repeat(np.arange(len(center)), self.elements.shape[1])] = -1
        return levels

    def _add_far(self, result: list[Array], fields: list[_Field], levels: NDArray[np.int8]) -> None:
        """Add the triangles that are not near a node, all at once."""
        count = len(_RULE)
        y = (_RULE @ self.points[self.triangles]).reshape(-1, 3)
        normal = np.repeat(self._normals, count, axis=0)
        weights = [field.weights(self._sizes) for field in fields]
        step = max(1, _CHUNK // len(y))
        for begin in range(0, len(self.nodes), step):
            part = slice(begin, begin + step)
            far = np.repeat(levels[part] == 0, count, axis=1)
            traction, displacement = self._kernels(y - self.nodes[part, None], normal, far)
            for i, j in np.ndindex(3, 3):
                result[0][part, i, :, j] += (weights[0] @ traction(i, j).T).T
                if j < i:
                    continue
                shared = displacement(i, j).T
                for matrix, hats in zip(result[1:], weights[1:], strict=True):
                    value = (hats @ shared).T
                    matrix[part, i, :, j] += value
                    if i != j:
                        matrix[part, j, :, i] += value

    def _add_pairs(
        self,
        result: list[Array],
        fields: list[_Field],
        nodes: Indices,
        triangles: Indices,
        rule: Array,
        weights: Array,
        own: int | None = None,
    ) -> None:
        """Add pairs of a node and a triangle, (p,) each, with a rule of their own (q, 3), (q,).

        `own` is the local number of a node that its triangle contains; its shape function is left out of T.
        """
        step = max(1, _CHUNK // len(rule))
        for begin in range(0, len(nodes), step):
            x, triangle = nodes[begin : begin + step], triangles[begin : begin + step]
            y = rule @ self.points[self.triangles[triangle]]
            normal = np.broadcast_to(self._normals[triangle, None], y.shape)
            traction, displacement = self._kernels(y - self.nodes[x, None], normal, None)
            for matrix, field in zip(result, fields, strict=True):
                kernel = traction if matrix is result[0] else displacement
                shapes = weights[:, None] * _shapes(rule, field.order)
                if own is not None and kernel is traction:
                    shapes[:, own] = 0.0
                columns = field.columns[triangle]
                on, local = np.nonzero(columns >= 0)
                for i, j in np.ndindex(3, 3):
                    values = (kernel(i, j) @ shapes) * self._sizes[triangle, None]
                    np.add.at(matrix, (x[on], i, columns[on, local], j), values[on, local])

    def _kernels(self, r: Array, normal: Array, mask: Flags | None) -> tuple[Kernel, Kernel]:
        """Return Kelvin's traction and displacement for separations (p, q, 3), by axes; 0 off `mask`."""
        nu = self.poisson
        inverse = 1.0 / np.maximum(np.linalg.norm(r, axis=2), 1e-300)
        if mask is not None:
            inverse *= mask
        e = [r[..., axis] * inverse for axis in range(3)]
        n = [normal[..., axis] for axis in range(3)]
        flux = e[0] * n[0] + e[1] * n[1] + e[2] * n[2]
        strong = -1.0 / (8.0 * np.pi * (1.0 - nu)) * inverse**2
        weak = (1.0 + nu) / (8.0 * np.pi * (1.0 - nu) * self.young) * inverse

        def traction(i: int, j: int) -> Array:
            value = flux * (3.0 * e[i] * e[j] + ((1.0 - 2.0 * nu) if i == j else 0.0))
            if i != j:
                value = value + (1.0 - 2.0 * nu) * (n[i] * e[j] - n[j] * e[i])
            return np.asarray(strong * value)

        def displacement(i: int, j: int) -> Array:
            return np.asarray(weak * (e[i] * e[j] + ((3.0 - 4.0 * nu) if i == j else 0.0)))

        return traction, displacement


class _Field:
    """Displacements or tractions on some triangles, interpolated between some nodes."""

    def __init__(self, elements: Indices, on: Flags, order: int, nodes: Indices) -> None:
        number = np.full(int(elements.max()) + 1, -1)
        number[nodes] = np.arange(len(nodes))
        self.nodes, self.order = nodes, order
        self.columns = np.where(on[:, None], number[elements], -1)  # (k, 3 or 6); -1: of no node

    def weights(self, sizes: Array) -> sparse.csr_matrix:
        """Return the weights of the quadrature points of all triangles for each node (nodes, 6 k), m^2."""
        shapes = _WEIGHTS[:, None] * _shapes(_RULE, self.order)
        values = sizes[:, None, None] * shapes
        columns = np.broadcast_to(self.columns[:, None], values.shape)
        points = np.broadcast_to(np.arange(len(sizes) * len(_RULE)).reshape(len(sizes), -1, 1), values.shape)
        used = columns >= 0
        shape = (len(self.nodes), len(sizes) * len(_RULE))
        return sparse.csr_matrix((values[used], (columns[used], points[used])), shape=shape)


def _rows(nodes: Indices) -> Indices:
    """Return the rows of the three axes of nodes (n,): (3n,)."""
    return np.asarray((3 * nodes[:, None] + np.arange(3)).ravel())


def _shapes(at: Array, order: int) -> Array:
    """Return the shape functions at barycentric coordinates (q, 3): (q, 3), or (q, 6) of order 2."""
    if order == 1:
        return at
    return np.hstack([at * (2.0 * at - 1.0), 4.0 * at * at[:, [1, 2, 0]]])


_LOCAL: Array = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])


def _subdivided(level: int) -> tuple[Array, Array]:
    """Return the rule on a triangle that is split into four `level` times: coordinates (q, 3) and weights (q,)."""
    triangles = np.eye(3)[None]
    for _ in range(level):
        a, b, c = (triangles[:, i] for i in range(3))
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = np.concatenate([np.stack(part, axis=1) for part in parts])
    return (_RULE @ triangles).reshape(-1, 3), np.tile(_WEIGHTS, len(triangles)) / len(triangles)


def _singular(local: int) -> tuple[Array, Array]:
    """Return a rule that removes 1/r at a node of a triangle (Duffy 1982): coordinates (q, 3) and weights (q,).

    At a vertex it is one triangle with its apex there. At the midpoint of an edge, there are two.
    """
    x, w = np.polynomial.legendre.leggauss(_DUFFY)
    x, w = (x + 1.0) / 2.0, w / 2.0
    s, t = (axis.ravel() for axis in np.meshgrid(x, x, indexing="ij"))
    rule, weights = np.stack([1.0 - s, s * (1.0 - t), s * t], axis=1), 2.0 * s * np.outer(w, w).ravel()
    corners = np.roll(np.eye(3), -(local % 3), axis=0)
    if local < 3:
        return rule @ corners, weights
    a, b, c = corners
    middle = (a + b) / 2.0
    parts = [np.stack([middle, b, c]), np.stack([middle, c, a])]
    return np.concatenate([rule @ part for part in parts]), np.tile(weights, 2) / 2.0
