"""Finite elements of a body: stiffness, mass, fixed nodes, and the surface's nodes that carry contact.

The solid is made of quadratic tetrahedra (or linear ones, which lock as Poisson's ratio nears 0.5). Contact acts on the
vertices of the touchable surface: vertex i carries the traction f_i phi_i / A_i, where phi_i is its linear hat function
on the touchable triangles and A_i the hat's integral, and what answers to f_i is the mean displacement under the same
hat. Force and deflection are then conjugate, so reciprocity holds exactly, and no force acts at a point, under which
the displacement would grow without bound as the mesh is refined.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from palpate.contact.mesh import Mesh
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.material import Material, SurfaceLayer
from palpate.fem.selectors import Selector
from palpate.fem.volume import Volume

__all__ = ["Elements", "check_order"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def check_order(order: int) -> None:
    """Raise BodyError if there are no elements of this order."""
    if order not in (1, 2):
        raise BodyError(f"elements are of order 1 (linear) or 2 (quadratic), not {order!r}")


# Degree of the integration, by the order of the elements. A stiffness that changes within an element is looked at in
# the points of a rule whose weights are all positive (that of degree 4 has one that is not: what is stiff there would
# make the body softer), and which has none on the element's border, where a skin may end.
_UNIFORM = {1: 1, 2: 2}
_VARIED = {1: 2, 2: 7}


@dataclass(frozen=True, eq=False)
class Elements:
    """A volume, its material, where it is fixed, where it may be touched (None: everywhere), elements of order 1 or 2.

    Degrees of freedom: 3 x node + axis. Raises BodyError if a piece of the body could move as a whole, or no vertex
    is left to be touched.
    """

    volume: Volume
    material: Material
    fixed: Sequence[Selector]
    touch: Selector | None = None
    order: int = 2

    def __post_init__(self) -> None:
        check_order(self.order)
        self._check_held()
        if len(self.touchable) == 0:
            outside = "" if self.touch is None else f" or outside of {self.touch}"
            raise BodyError(
                f"no vertex of the surface can be touched: all are fixed{outside}; the body reaches "
                f"{_reach(self.volume.points)}"
            )

    @cached_property
    def _mesh(self):  # type: ignore[no-untyped-def]  # scikit-fem has no types
        import skfem

        return skfem.MeshTet(
            np.ascontiguousarray(self.volume.points.T), np.ascontiguousarray(self.volume.tetrahedra.T), sort_t=False
        )

    @cached_property
    def _basis(self):  # type: ignore[no-untyped-def]
        """Shape functions where the stiffness is integrated: exactly if it is the same throughout, else finer."""
        return self._basis_of(_UNIFORM[self.order] if self._uniform else _VARIED[self.order])

    def _basis_of(self, degree: int):  # type: ignore[no-untyped-def]
        import skfem

        element = skfem.ElementTetP2() if self.order == 2 else skfem.ElementTetP1()
        return skfem.Basis(self._mesh, element, intorder=degree)

    @property
    def _uniform(self) -> bool:
        return not self.material.regions and self.material.skin is None

    @cached_property
    def nodes(self) -> Array:
        """Places of all nodes (N, 3), m: the vertices, then the middles of the edges."""
        return np.ascontiguousarray(self._basis.doflocs.T)

    @cached_property
    def surface_nodes(self) -> NDArray[np.bool_]:
        """Which nodes (N,) lie on the surface."""
        on = np.zeros(len(self.nodes), dtype=bool)
        on[self._basis.get_dofs(self._mesh.boundary_facets()).all()] = True
        return on

    @cached_property
    def held(self) -> NDArray[np.bool_]:
        """Which nodes (N,) are fixed."""
        held = np.zeros(len(self.nodes), dtype=bool)
        for where in self.fixed:
            inside = where.inside(self.nodes)
            if where.surface:
                inside &= self.surface_nodes
            if not inside.any():
                raise BodyError(f"fixed: no node of the body lies in {where}; it reaches {_reach(self.nodes)}")
            held |= inside
        return held

    @cached_property
    def free(self) -> Indices:
        """Degrees of freedom that can move."""
        return np.flatnonzero(np.repeat(~self.held, 3))

    @cached_property
    def triangles(self) -> Indices:
        """Touchable triangles of the surface (k, 3), as vertices of the volume."""
        faces = self.volume.surface
        if self.touch is None:
            return faces
        inside = self.touch.inside(self.volume.points)
        return faces[inside[faces].all(axis=1)]

    @cached_property
    def touchable(self) -> Indices:
        """Vertices (n,) of the volume that carry contact: on a touchable triangle and not fixed."""
        on = np.unique(self.triangles)
        return on[~self.held[on]]

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals (n, 3) at the touchable vertices, means of the triangles' weighted by area."""
        points = self.volume.points
        a, b, c = (points[self.triangles[:, i]] for i in range(3))
        total = np.zeros_like(points)
        for i in range(3):
            np.add.at(total, self.triangles[:, i], np.cross(b - a, c - a))
        total = total[self.touchable]
        return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))

    @cached_property
    def areas(self) -> Array:
        """Integrals of the hat functions (n,), m^2."""
        points = self.volume.points
        a, b, c = (points[self.triangles[:, i]] for i in range(3))
        third = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 6.0
        total = np.zeros(len(points))
        for i in range(3):
            np.add.at(total, self.triangles[:, i], third)
        return total[self.touchable]

    @cached_property
    def load(self) -> sparse.csc_matrix:
        """Nodal loads (N, n) of unit forces on the touchable vertices, for one axis; transposed: mean displacements."""
        import skfem

        facets = self._facets(self.triangles)
        kind = skfem.ElementTetP2() if self.order == 2 else skfem.ElementTetP1()
        fine = skfem.FacetBasis(self._mesh, kind, facets=facets, intorder=self.order + 1)
        hats = skfem.FacetBasis(self._mesh, skfem.ElementTetP1(), facets=facets, intorder=self.order + 1)
        mixed = skfem.BilinearForm(lambda u, v, w: u * v).assemble(hats, fine).tocsc()
        return (mixed[:, self.touchable] @ sparse.diags(1.0 / self.areas)).tocsc()

    def _facets(self, triangles: Indices) -> Indices:
        """Facet numbers of scikit-fem's mesh of the given triangles."""
        boundary = np.asarray(self._mesh.boundary_facets())
        rows = np.sort(np.asarray(self._mesh.facets[:, boundary].T), axis=1)
        number = {tuple(row): int(facet) for row, facet in zip(rows.tolist(), boundary, strict=True)}
        return np.array([number[tuple(row)] for row in np.sort(triangles, axis=1).tolist()], dtype=np.int64)

    @cached_property
    def young(self) -> Array:
        """Young's modulus at the points of integration (elements, points), Pa."""
        x = np.asarray(self._basis.global_coordinates())  # 3 x elements x points
        points = x.reshape(3, -1).T
        for region in self.material.regions:
            if not region.where.inside(points).any():
                raise BodyError(
                    f"region {region.where}: no point of integration lies in it, so it would stiffen nothing: it is "
                    "outside of the body, or too small for the mesh"
                )
        skin = self.material.skin
        depth = np.empty(0) if skin is None else self._depth(points)
        if skin is not None:
            self._check_skin(skin, depth)
        return self.material.young_at(points, lambda _: depth).reshape(x.shape[1:])

    def _check_skin(self, skin: SurfaceLayer, depth: Array) -> None:
        """Refuse a skin in which no point of integration lies, `depth` (n,) under it; warn of one under half a cell."""
        if not (depth < skin.thickness).any():
            raise BodyError(
                f"skin {skin}: no point of integration lies in it, so it would stiffen nothing: take a finer mesh, or "
                "a thicker and softer skin"
            )
        a, b, c = (self.volume.points[self.triangles[:, i]] for i in range(3))
        area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
        size = self._basis.dx.sum(axis=1)[self._mesh.f2t[0, self._facets(self.triangles)]]
        high = float(np.median(3.0 * size / area))
        if skin.thickness < 0.5 * high:
            warnings.warn(
                f"skin {skin}: the cells under it are {1e3 * high:.2g} mm high: give the skin at least one cell",
                BodyWarning,
                stacklevel=2,
            )

    def _depth(self, points: Array) -> Array:
        used, faces = np.unique(self.triangles, return_inverse=True)
        near, _ = Mesh(self.volume.points[used], faces.reshape(-1, 3), open=True, mend=False).nearest(points)
        return np.asarray(np.linalg.norm(points - near, axis=1))

    @property
    def memory(self) -> float:
        """Bytes that assembling the stiffness takes, about: pairs of nodes in elements, and slopes at the points."""
        nodes = 10 if self.order == 2 else 4
        points = 24 if self.order == 2 and not self._uniform else 4
        return len(self.volume.tetrahedra) * 8.0 * (4.0 * nodes**2 + 3.0 * nodes * points)

    @cached_property
    def stiffness(self) -> sparse.csr_matrix:
        """Stiffness (3N, 3N), N/m, of isotropic linear elasticity: lambda tr(e) tr(e') + 2 mu e : e'."""
        nu = self.material.poisson
        lame = self.young * nu / ((1 + nu) * (1 - 2 * nu))
        shear = self.young / (2 * (1 + nu))
        slope = np.stack([np.broadcast_to(f[0].grad, (3, *self._basis.dx.shape)) for f in self._basis.basis])

        def blocks(cells: slice) -> Array:
            g, w = slope[:, :, cells], self._basis.dx[cells]
            products = np.einsum("aieq,bjeq,eq->eabij", g, g, w * shear[cells], optimize=True)
            found = np.einsum("aieq,bjeq,eq->eabij", g, g, w * lame[cells], optimize=True)
            found += products.swapaxes(3, 4)
            found[..., range(3), range(3)] += np.einsum("eabii->eab", products)[..., None]
            return np.asarray(found)

        return self._assemble(blocks, 3)

    @cached_property
    def mass(self) -> sparse.csr_matrix:
        """Consistent mass (3N, 3N), kg."""
        basis = self._basis_of(2 * self.order)
        value = np.stack([np.broadcast_to(np.asarray(f[0]), basis.dx.shape) for f in basis.basis])

        def blocks(cells: slice) -> Array:
            v, w = value[:, cells], self.material.density * basis.dx[cells]
            return np.asarray(np.einsum("aeq,beq,eq->eab", v, v, w, optimize=True)[..., None, None])

        return sparse.kron(self._assemble(blocks, 1), sparse.eye(3), format="csr")

    def _assemble(self, blocks: Callable[[slice], Array], axes: int) -> sparse.csr_matrix:
        """Sum element matrices; `blocks` returns those of some elements, (elements, nodes, nodes, axes, axes)."""
        nodes = np.asarray(self._basis.element_dofs.T, dtype=np.int64)  # elements x nodes
        size = len(self.nodes)
        pairs, place = np.unique((nodes[:, :, None] * size + nodes[:, None, :]).ravel(), return_inverse=True)
        place = place.reshape(len(nodes), -1)
        total = np.zeros((axes * axes, len(pairs)))
        many = 400_000 // nodes.shape[1] ** 2  # elements at a time, so that their matrices take little memory
        for begin in range(0, len(nodes), many):
            cells = slice(begin, begin + many)
            to = place[cells].ravel()
            for i, part in enumerate(blocks(cells).reshape(len(to), -1).T):
                total[i] += np.bincount(to, part, len(pairs))
        rows = np.searchsorted(pairs, size * np.arange(size + 1))
        data = np.ascontiguousarray(total.T).reshape(-1, axes, axes)
        return sparse.bsr_matrix((data, pairs % size, rows), shape=(axes * size, axes * size)).tocsr()

    def _check_held(self) -> None:
        if len(self.fixed) == 0:
            raise BodyError("nothing is fixed: the body would float away; fix a part of it, such as z < 1 mm")
        held = np.flatnonzero(self.held[: len(self.volume.points)])
        parts = self.volume.parts
        for part in range(int(parts.max()) + 1):
            there = self.volume.points[held[parts[held] == part]]
            if len(there) == 0:
                x = self.volume.points[np.argmax(parts == part)]
                raise BodyError(f"a piece of the body is not fixed: the one with the point ({_row(x * 1e3)}) mm")
            spread = np.linalg.svd(there - there.mean(axis=0), compute_uv=False)
            if len(there) < 3 or spread[1] < 1e-6 * self.volume.extent:
                raise BodyError("the fixed vertices lie on one line, so the body can turn about it: fix more of it")


def _row(values: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in values)


def _reach(points: Array) -> str:
    return f"from ({_row(points.min(axis=0) * 1e3)}) to ({_row(points.max(axis=0) * 1e3)}) mm"
