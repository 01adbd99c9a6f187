"""Mass-spring network on the vertices of a body's mesh, fitted to linear elasticity.

A spring transmits force along its axis only. A network of springs therefore has a stiffness C_ijkl symmetric in all
indices, and Poisson's ratio 1/4 (Cauchy; also in the closed form of Lloyd, Szekely & Harders 2007). For another ratio,
a pressure acts on the volume around each vertex (Golec et al. 2020):

    lambda tr(e)^2 / 2 + mu e : e  =  mu (tr(e)^2 / 2 + e : e)  +  (lambda - mu) tr(e)^2 / 2
                                      springs                      volumes

Springs lie along the edges of the tetrahedra, and between the vertices opposite each inner face; edges alone have too
few directions to be isotropic. The stiffness of the springs is a nonnegative least-squares fit to the stress and the
force at each vertex under the six uniform strains.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement
from math import factorial, prod

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg, splu

from palpate.arrays import Array, Flags, Indices
from palpate.contact.simplices import area_vectors, equal_neighbors, unique_rows
from palpate.fem.errors import BodyError
from palpate.fem.storage import BodyData
from palpate.fem.volume import Volume

_FACES = ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 3, 1), (1, 2, 3, 0))  # three corners, and the opposite one
_PRIOR = 0.1  # regularization: weight of a spring's initial stiffness relative to one equation of strain


@dataclass(frozen=True, eq=False)
class SpringNetwork:
    """Masses, springs and volumes on N vertices; without volumes in a network of springs alone."""

    points: Array  # at rest (N, 3), m
    masses: Array  # (N,), kg
    springs: Indices  # end vertices (s, 2)
    stiffness: Array  # of the springs (s,), N/m
    tetrahedra: Indices  # (m, 4)
    pressure: Array  # per unit volumetric strain at each vertex (N,), Pa
    misfit: float  # rms error of the stress under uniform strains over the rms stress of the solid
    rest_lengths: Array  # of the springs (s,), m
    damping: Array  # of the springs (s,), N s/m

    @property
    def matrix(self) -> sparse.csr_matrix:
        """Tangent stiffness at `points` (3N, 3N), N/m, row 3 x vertex + axis, of linear springs under their tension."""
        x, (a, b) = self.points, self.springs.T
        lengths = np.linalg.norm(x[b] - x[a], axis=1)
        axes = (x[b] - x[a]) / lengths[:, None]
        elongation = _row_matrix(np.stack([a, b], axis=1), np.stack([-axes, axes], axis=1), len(x))
        tension = self.stiffness * (1.0 - self.rest_lengths / lengths)  # over the length: stiffness across the axis
        springs = elongation.T @ sparse.diags(self.stiffness - tension) @ elongation
        springs += sparse.kron(_laplacian(self.springs, tension, len(x)), sparse.eye(3))
        if len(self.tetrahedra) == 0:
            return springs.tocsr()
        volume_change, volumes = self._volume_operator()
        return (springs + volume_change.T @ sparse.diags(self.pressure / volumes) @ volume_change).tocsr()

    def free_matrix(self, fixed: Flags) -> sparse.csr_matrix:
        """Rows and columns of `matrix` of the vertices that are not fixed; `fixed` (N,)."""
        free = np.flatnonzero(np.repeat(~fixed, 3))
        return self.matrix[free][:, free]

    @property
    def forces(self) -> Array:
        """Forces of the springs on the vertices at `points` (N, 3), N."""
        a, b = self.springs.T
        edges = self.points[b] - self.points[a]
        tension = self.stiffness * (1.0 - self.rest_lengths / np.linalg.norm(edges, axis=1))
        total = np.zeros_like(self.points)
        np.add.at(total, a, tension[:, None] * edges)
        np.add.at(total, b, -tension[:, None] * edges)
        return total

    def _volume_operator(self) -> tuple[sparse.csr_matrix, Array]:
        """Return the derivative of the volume at each vertex (N, 3N), m^2, and the volume there (N,), m^3."""
        gradients, volumes = _hat_gradients(self.points, self.tetrahedra)
        of_cells = _row_matrix(self.tetrahedra, gradients * volumes[:, None, None], len(self.points))
        quarters = _vertex_quarters(self.tetrahedra, len(self.points))
        return (quarters @ of_cells).tocsr(), np.asarray(quarters @ volumes)


def build_network(volume: Volume, young: Array, poisson: float, density: float) -> SpringNetwork:
    """Return the network of a body.

    A Poisson's ratio below 1/4 needs negative pressures, which are stable near rest only.

    Args:
        volume: tetrahedral mesh.
        young: Young's modulus of each tetrahedron (m,), Pa.
        poisson: Poisson's ratio.
        density: kg/m^3.

    Raises:
        BodyError: the fit of the springs does not converge.
    """
    x, cells = volume.points, volume.tetrahedra
    gradients, volumes = _hat_gradients(x, cells)
    quarters = _vertex_quarters(cells, len(x))
    vertex_volumes = np.asarray(quarters @ volumes)
    shear = young / (2 * (1 + poisson))
    vertex_shear = np.asarray(quarters @ (volumes * shear)) / vertex_volumes
    pairs = np.concatenate([_edges(cells), _opposite_pairs(cells)])
    springs = pairs[unique_rows(pairs)[0]]
    # Force of the solid at a vertex under a uniform strain: mu (tr(e) + 2 e) g; g = 0 inside a homogeneous body.
    g = np.zeros_like(x)
    np.add.at(g, cells, gradients * (volumes * shear)[:, None, None])
    stiffness, misfit = _fit(x, springs, vertex_volumes, vertex_shear, g)
    pressure = vertex_shear * (2 * poisson / (1 - 2 * poisson) - 1)
    lengths = np.linalg.norm(x[springs[:, 1]] - x[springs[:, 0]], axis=1)
    masses, undamped = density * vertex_volumes, np.zeros(len(springs))
    return SpringNetwork(x, masses, springs, stiffness, cells, pressure, misfit, lengths, undamped)


def given_network(contents: BodyData) -> SpringNetwork:
    """Return the network of a body of springs."""
    return SpringNetwork(
        contents.vertices,
        contents.masses,
        contents.springs,
        contents.spring_stiffness,
        np.empty((0, 4), dtype=np.int64),
        np.zeros(len(contents.vertices)),
        0.0,
        contents.rest_lengths,
        contents.spring_damping,
    )


def unstable_row(stiffness: sparse.spmatrix, least: float) -> int | None:
    """Return a row in which a symmetric matrix has an eigenvalue below `least`, or None if it has none.

    The signs of the pivots of a symmetric factorization are those of the eigenvalues (Sylvester).
    """
    shifted = (stiffness - least * sparse.eye(stiffness.shape[0])).tocsc()
    factor = splu(
        shifted, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True, "Equil": False}
    )
    negative = np.flatnonzero(factor.U.diagonal() <= 0.0)
    return int(np.argsort(factor.perm_c)[negative[0]]) if len(negative) else None


def contact_patches(
    points: Array, triangles: Indices, nodes: Indices
) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """Return the vertices over which the force on each of n nodes is distributed, and their weights, in CSR form.

    A force is distributed with the linear hat function of its node on the `triangles` (k, 3). The weights are the
    integrals of products of hat functions over the integral of the node's own; they sum to one.

    Returns:
        Start of each node's list (n + 1,), vertices (w,), weights (w,).
    """
    area = np.linalg.norm(area_vectors(points, triangles), axis=1)
    local = area[:, None, None] * (1.0 + np.eye(3))  # twelve times the integrals; the weights are their ratios
    rows, columns = np.repeat(triangles, 3, axis=1).ravel(), np.tile(triangles, (1, 3)).ravel()
    products = sparse.csr_matrix((local.ravel(), (rows, columns)), shape=(len(points),) * 2)[nodes]
    weights = (sparse.diags(1.0 / np.asarray(products.sum(axis=1)).ravel()) @ products).tocsr()
    return weights.indptr.astype(np.int32), weights.indices.astype(np.int32), weights.data


def _edges(cells: Indices) -> Indices:
    """Return the edges of tetrahedra (m, 4) as pairs of vertices (e, 2)."""
    pairs = np.sort(np.concatenate([cells[:, list(e)] for e in combinations(range(4), 2)]), axis=1)
    return pairs[unique_rows(pairs)[0]]


def _opposite_pairs(cells: Indices) -> Indices:
    """Return the pairs of vertices opposite a common face (k, 2)."""
    faces = np.sort(np.concatenate([cells[:, list(f[:3])] for f in _FACES]), axis=1)
    apexes = np.concatenate([cells[:, f[3]] for f in _FACES])
    one, two = equal_neighbors(faces)
    return np.sort(np.stack([apexes[one], apexes[two]], axis=1), axis=1)


def _hat_gradients(x: Array, cells: Indices) -> tuple[Array, Array]:
    """Return the gradients of the linear hat functions (m, 4, 3), 1/m, and the volumes (m,), m^3."""
    u, v, w = (x[cells[:, i]] - x[cells[:, 0]] for i in (1, 2, 3))
    faces = np.stack([np.cross(v, w), np.cross(w, u), np.cross(u, v)], axis=1)
    six = np.einsum("ij,ij->i", u, faces[:, 0])
    gradients = np.concatenate([-faces.sum(axis=1, keepdims=True), faces], axis=1) / six[:, None, None]
    return gradients, six / 6.0


def _vertex_quarters(cells: Indices, count: int) -> sparse.csr_matrix:
    """Return the matrix (N, m) that distributes a quarter of each tetrahedron's value to each of its vertices."""
    ones = np.full(cells.size, 0.25)
    return sparse.csr_matrix((ones, (cells.ravel(), np.repeat(np.arange(len(cells)), 4))), shape=(count, len(cells)))


def _row_matrix(vertices: Indices, values: Array, count: int) -> sparse.csr_matrix:
    """Return the matrix (r, 3 count) with `values` (r, k, 3) in the columns of `vertices` (r, k)."""
    columns = 3 * vertices[:, :, None] + np.arange(3)
    rows = np.repeat(np.arange(len(vertices)), columns[0].size)
    return sparse.csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(len(vertices), 3 * count))


def _laplacian(springs: Indices, weights: Array, count: int) -> sparse.csr_matrix:
    """Return the graph Laplacian (N, N) of springs (s, 2) with weights (s,)."""
    a, b = springs.T
    rows, columns = np.concatenate([a, b, a, b]), np.concatenate([a, b, b, a])
    return sparse.csr_matrix((np.concatenate([weights, weights, -weights, -weights]), (rows, columns)), (count, count))


def _fit(x: Array, springs: Indices, volumes: Array, shear: Array, g: Array) -> tuple[Array, float]:
    """Return the stiffness of the springs (s,), N/m, and the misfit.

    The sums run over the springs of a vertex, with their directions n away from it. Both sides of both equations are
    symmetric tensors: sum k l^2 nnnn / 2 = V mu (15 components) and sum k l nnn = -mu g (10 components).
    """
    (a, b), count = springs.T, len(x)
    length = np.linalg.norm(x[b] - x[a], axis=1)
    n = (x[b] - x[a]) / length[:, None]
    at_a = sparse.csr_matrix((np.ones(len(a)), (a, np.arange(len(a)))), shape=(count, len(a)))
    at_b = sparse.csr_matrix((np.ones(len(b)), (b, np.arange(len(b)))), shape=(count, len(b)))
    # Initial stiffness from the material and the volume at both ends, scaled to the right total stress.
    guess = 0.5 * (shear[a] + shear[b]) * np.cbrt(0.5 * (volumes[a] + volumes[b]))
    guess *= (15 * volumes * shear).sum() / (guess * length**2).sum()
    rows, right = [], []
    for axes in combinations_with_replacement(range(3), 4):
        weight = np.sqrt(_multiplicity(axes))
        i, j, k, m = axes
        stress = (i == j) * (k == m) + (i == k) * (j == m) + (i == m) * (j == k)
        per_spring = sparse.diags(0.5 * length**2 * np.prod(n[:, axes], axis=1) * guess)
        rows.append(sparse.diags(weight / (volumes * shear)) @ (at_a + at_b) @ per_spring)
        right.append(np.full(count, weight * stress))
    for triple in combinations_with_replacement(range(3), 3):
        weights = np.sqrt(_multiplicity(triple)) / (volumes ** (2 / 3) * shear)
        i, j, k = triple
        force = -(g[:, i] * (j == k) + g[:, j] * (i == k) + g[:, k] * (i == j))
        per_spring = sparse.diags(length * np.prod(n[:, triple], axis=1) * guess)
        rows.append(sparse.diags(weights) @ (at_a - at_b) @ per_spring)
        right.append(weights * force)
    rows.append(_PRIOR * sparse.eye(len(springs)))
    right.append(np.full(len(springs), _PRIOR))
    matrix, target = sparse.vstack(rows).tocsr(), np.concatenate(right)
    solution = _nonnegative_least_squares(matrix, target)
    equations = 15 * count
    error = (matrix[:equations] @ solution - target[:equations]).reshape(15, count)
    return solution * guess, float(np.linalg.norm(error) / np.linalg.norm(target[:equations]))


def _multiplicity(axes: tuple[int, ...]) -> float:
    """Return the number of equal entries of a symmetric tensor that one component stands for."""
    return factorial(len(axes)) / prod(factorial(times) for times in Counter(axes).values())


def _nonnegative_least_squares(matrix: sparse.csr_matrix, target: Array) -> Array:
    """Return x >= 0 that minimizes |matrix x - target|, by block principal pivoting (Judice & Pires 1994)."""
    normal, right = (matrix.T @ matrix).tocsr(), matrix.T @ target
    free = np.ones(len(right), dtype=bool)
    min_infeasible, attempts = len(right) + 1, 5
    for _ in range(100):
        index = np.flatnonzero(free)
        block = normal[index][:, index]
        jacobi = sparse.diags(1.0 / block.diagonal())
        x = np.zeros(len(right))
        x[index], failed = cg(block, right[index], rtol=1e-11, maxiter=20_000, M=jacobi)
        if failed:
            break
        gradient = normal @ x - right
        infeasible = np.where(free, x < -1e-9, gradient < -1e-9 * np.abs(right).max())
        if not infeasible.any():
            return np.maximum(x, 0.0)
        if infeasible.sum() < min_infeasible:
            min_infeasible, attempts = int(infeasible.sum()), 5
        elif attempts > 0:
            attempts -= 1
        else:
            infeasible[: np.flatnonzero(infeasible)[-1]] = False  # exchange the last one only: guarantees termination
        free ^= infeasible
    raise BodyError("the springs cannot be fitted to this mesh: its tetrahedra are too flat, mesh again")
