"""Finite elements of a body: stiffness, mass, Dirichlet nodes and contact nodes.

The elements are quadratic tetrahedra, or linear ones, which lock as Poisson's ratio approaches 0.5. Contact acts on the
vertices of the contact surface. Vertex i carries the traction f_i phi_i / A_i, where phi_i is its linear hat function
on the contact triangles and A_i the integral of phi_i. The displacement conjugate to f_i is the mean displacement
weighted by phi_i. Reciprocity therefore holds exactly. There are no point forces, under which the displacement would
diverge with mesh refinement.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from palpate.arrays import Array, Flags, Indices
from palpate.contact.mesh import BodySurface
from palpate.contact.simplices import area_vectors
from palpate.fem.checks import bounds_of, row_of
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.hat_functions import hat_integrals, mean_normals
from palpate.fem.layer_modulus import layer_moduli
from palpate.fem.material import Material, SurfaceLayer
from palpate.fem.selectors import Selector
from palpate.fem.volume import Volume


def check_order(order: int) -> None:
    """Raise BodyError unless `order` is 1 or 2."""
    if order not in (1, 2):
        raise BodyError(f"elements are of order 1 (linear) or 2 (quadratic), not {order!r}")


# Degree of the quadrature, by the order of the elements. A stiffness that varies within an element needs a rule with
# positive weights only, which excludes degree 4, and without points on the border of the element, where a surface
# layer may end.
_UNIFORM = {1: 1, 2: 2}
_VARIED = {1: 2, 2: 7}


@dataclass(frozen=True, eq=False)
class Elements:
    """Finite-element discretization with N nodes and n contact nodes. Degrees of freedom: 3 x node + axis.

    Attributes:
        volume: tetrahedral mesh.
        material: stiffness and density.
        fixed: regions with a Dirichlet boundary condition.
        touch: region of the contact surface; None for the whole surface.
        order: 1 for linear elements, 2 for quadratic ones.

    Raises:
        BodyError: a part of the body has a rigid-body motion, or there is no contact node.
    """

    volume: Volume
    material: Material
    fixed: Sequence[Selector]
    touch: Selector | None = None
    order: int = 2

    def __post_init__(self) -> None:
        check_order(self.order)
        self._check_dirichlet()
        if len(self.contact_nodes) == 0:
            outside = "" if self.touch is None else f" or outside of {self.touch}"
            raise BodyError(
                f"the body has no contact node: all surface vertices are fixed{outside}; the body extends "
                f"{bounds_of(self.volume.points)}"
            )

    @cached_property
    def _mesh(self):  # type: ignore[no-untyped-def]  # scikit-fem has no types
        import skfem

        return skfem.MeshTet(
            np.ascontiguousarray(self.volume.points.T), np.ascontiguousarray(self.volume.tetrahedra.T), sort_t=False
        )

    @cached_property
    def _basis(self):  # type: ignore[no-untyped-def]
        """Shape functions at the quadrature points of the stiffness; the quadrature is exact if it is uniform."""
        return self._basis_of(_UNIFORM[self.order] if self.material.is_uniform else _VARIED[self.order])

    def _basis_of(self, degree: int):  # type: ignore[no-untyped-def]
        import skfem

        element = skfem.ElementTetP2() if self.order == 2 else skfem.ElementTetP1()
        return skfem.Basis(self._mesh, element, intorder=degree)

    @cached_property
    def nodes(self) -> Array:
        """Positions of all nodes (N, 3), m: the vertices, then the midpoints of the edges."""
        return np.ascontiguousarray(self._basis.doflocs.T)

    @cached_property
    def surface_nodes(self) -> Flags:
        """Whether each node lies on the surface (N,)."""
        on = np.zeros(len(self.nodes), dtype=bool)
        on[self._basis.get_dofs(self._mesh.boundary_facets()).all()] = True
        return on

    @cached_property
    def dirichlet(self) -> Flags:
        """Whether each node is fixed (N,)."""
        dirichlet = np.zeros(len(self.nodes), dtype=bool)
        for region in self.fixed:
            inside = region.inside(self.nodes)
            if region.surface:
                inside &= self.surface_nodes
            if not inside.any():
                raise BodyError(
                    f"fixed: no node of the body lies in {region}; it extends {bounds_of(self.nodes)}: use a larger "
                    "region, or a finer mesh"
                )
            dirichlet |= inside
        return dirichlet

    @cached_property
    def free(self) -> Indices:
        """Indices of the free degrees of freedom."""
        return np.flatnonzero(np.repeat(~self.dirichlet, 3))

    @cached_property
    def triangles(self) -> Indices:
        """Triangles of the contact surface (k, 3), as vertices of the volume."""
        faces = self.volume.surface
        if self.touch is None:
            return faces
        inside = self.touch.inside(self.volume.points)
        return faces[inside[faces].all(axis=1)]

    @cached_property
    def contact_nodes(self) -> Indices:
        """Contact nodes (n,), as vertices of the volume: those of the contact triangles that are not fixed."""
        vertices = np.unique(self.triangles)
        return vertices[~self.dirichlet[vertices]]

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals at the contact nodes (n, 3), area-weighted means over the triangles."""
        return mean_normals(self.volume.points, self.triangles, self.contact_nodes)

    @cached_property
    def areas(self) -> Array:
        """Integrals of the hat functions of the contact nodes (n,), m^2."""
        return hat_integrals(self.volume.points, self.triangles, self.contact_nodes)

    @property
    def layer_moduli(self) -> Array:
        """Young's modulus of the contact's layer at the contact nodes, under round tips and flat ends (n, 2), Pa."""
        nodes = self.volume.points[self.contact_nodes]
        return layer_moduli(nodes, self.normals, self.areas, self.volume, self.young.mean(axis=1))

    @cached_property
    def load(self) -> sparse.csc_matrix:
        """Nodal loads of unit forces on the contact nodes along one axis (N, n).

        The transpose maps nodal to mean displacements.
        """
        import skfem

        facets = self._facets(self.triangles)
        element = skfem.ElementTetP2() if self.order == 2 else skfem.ElementTetP1()
        fine = skfem.FacetBasis(self._mesh, element, facets=facets, intorder=self.order + 1)
        hats = skfem.FacetBasis(self._mesh, skfem.ElementTetP1(), facets=facets, intorder=self.order + 1)
        mixed = skfem.BilinearForm(lambda u, v, w: u * v).assemble(hats, fine).tocsc()
        return (mixed[:, self.contact_nodes] @ sparse.diags(1.0 / self.areas)).tocsc()

    def _facets(self, triangles: Indices) -> Indices:
        """Return the facet indices of triangles (k, 3) in scikit-fem's mesh (k,)."""
        boundary = np.asarray(self._mesh.boundary_facets())
        rows = np.sort(np.asarray(self._mesh.facets[:, boundary].T), axis=1)
        number = {tuple(row): int(facet) for row, facet in zip(rows.tolist(), boundary, strict=True)}
        return np.array([number[tuple(row)] for row in np.sort(triangles, axis=1).tolist()], dtype=np.int64)

    @cached_property
    def young(self) -> Array:
        """Young's modulus at the quadrature points (elements, points), Pa."""
        x = np.asarray(self._basis.global_coordinates())  # 3 x elements x points
        points = x.reshape(3, -1).T
        for region in self.material.regions:
            if not region.where.inside(points).any():
                raise BodyError(
                    f"region {region.where}: no quadrature point lies in it, so it has no effect: it is outside of the "
                    "body, or too small for the mesh"
                )
        layer = self.material.surface_layer
        depth = np.empty(0) if layer is None else self._depth(points)
        if layer is not None:
            self._check_layer(layer, depth, points)
        return self.material.young_at(points, lambda _: depth).reshape(x.shape[1:])

    def _check_layer(self, layer: SurfaceLayer, depth: Array, points: Array) -> None:
        """Check a surface layer against the depths (q,), m, of the quadrature points (q, 3), m.

        Raises:
            BodyError: no quadrature point lies in the layer, or each one that does lies in a region.

        Warns if the layer is thinner than half a cell.
        """
        if not (depth < layer.thickness).any():
            raise BodyError(
                f"surface_layer {layer}: no quadrature point lies in it, so it has no effect: use a finer mesh, "
                "or a thicker and softer layer"
            )
        left = points[depth < layer.thickness]
        for region in self.material.regions:
            left = left[~region.where.inside(left)]
        if not len(left):
            raise BodyError(
                f"surface_layer {layer}: regions, which replace it, contain all of it, so it has no effect: make the "
                "regions smaller, or leave it out"
            )
        area = np.linalg.norm(area_vectors(self.volume.points, self.triangles), axis=1)
        size = self._basis.dx.sum(axis=1)[self._mesh.f2t[0, self._facets(self.triangles)]]
        height = float(np.median(3.0 * size / area))
        if layer.thickness < 0.5 * height:
            warnings.warn(
                f"surface_layer {layer}: the cells at the surface are {1e3 * height:.2g} mm high: use at least one "
                "cell per layer thickness",
                BodyWarning,
                stacklevel=2,
            )

    def _depth(self, points: Array) -> Array:
        """Return the distance of points (q, 3), m, from the contact surface (q,), m."""
        used, faces = np.unique(self.triangles, return_inverse=True)
        nearest, _ = BodySurface(self.volume.points[used], faces.reshape(-1, 3)).nearest(points)
        return np.asarray(np.linalg.norm(points - nearest, axis=1))

    @property
    def memory(self) -> float:
        """Estimated memory of the assembly, bytes: node pairs of the elements, and gradients at quadrature points."""
        nodes = 10 if self.order == 2 else 4
        points = 24 if self.order == 2 and not self.material.is_uniform else 4
        return len(self.volume.tetrahedra) * 8.0 * (4.0 * nodes**2 + 3.0 * nodes * points)

    @cached_property
    def stiffness(self) -> sparse.csr_matrix:
        """Stiffness (3N, 3N), N/m, of isotropic linear elasticity: lambda tr(e) tr(e') + 2 mu e : e'."""
        nu = self.material.poisson
        lame = self.young * nu / ((1 + nu) * (1 - 2 * nu))
        shear = self.young / (2 * (1 + nu))
        gradient = np.stack([np.broadcast_to(f[0].grad, (3, *self._basis.dx.shape)) for f in self._basis.basis])

        def blocks(cells: slice) -> Array:
            g, w = gradient[:, :, cells], self._basis.dx[cells]
            products = np.einsum("aieq,bjeq,eq->eabij", g, g, w * shear[cells], optimize=True)
            result = np.einsum("aieq,bjeq,eq->eabij", g, g, w * lame[cells], optimize=True)
            result += products.swapaxes(3, 4)
            result[..., range(3), range(3)] += np.einsum("eabii->eab", products)[..., None]
            return np.asarray(result)

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
        """Assemble element matrices; `blocks` returns those of a slice, (elements, nodes, nodes, axes, axes)."""
        nodes = np.asarray(self._basis.element_dofs.T, dtype=np.int64)  # elements x nodes
        size = len(self.nodes)
        pairs, position = np.unique((nodes[:, :, None] * size + nodes[:, None, :]).ravel(), return_inverse=True)
        position = position.reshape(len(nodes), -1)
        total = np.zeros((axes * axes, len(pairs)))
        chunk = 400_000 // nodes.shape[1] ** 2  # elements at a time, which bounds the memory of their matrices
        for begin in range(0, len(nodes), chunk):
            cells = slice(begin, begin + chunk)
            index = position[cells].ravel()
            for i, entries in enumerate(blocks(cells).reshape(len(index), -1).T):
                total[i] += np.bincount(index, entries, len(pairs))
        rows = np.searchsorted(pairs, size * np.arange(size + 1))
        data = np.ascontiguousarray(total.T).reshape(-1, axes, axes)
        return sparse.bsr_matrix((data, pairs % size, rows), shape=(axes * size, axes * size)).tocsr()

    def _check_dirichlet(self) -> None:
        if len(self.fixed) == 0:
            raise BodyError("nothing is fixed, so the body has rigid-body motions: fix a part of it, such as z < 1 mm")
        fixed = np.flatnonzero(self.dirichlet[: len(self.volume.points)])
        parts = self.volume.parts
        for part in range(int(parts.max()) + 1):
            points = self.volume.points[fixed[parts[fixed] == part]]
            if len(points) == 0:
                x = self.volume.points[np.argmax(parts == part)]
                raise BodyError(f"a piece of the body is not fixed: the one with the point ({row_of(x * 1e3)}) mm")
            spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
            if len(points) < 3 or spread[1] < 1e-6 * self.volume.extent:
                raise BodyError(
                    "the fixed vertices lie on one line, about which the body can rotate: fix a larger part of it"
                )
