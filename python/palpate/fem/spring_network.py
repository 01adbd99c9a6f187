"""A body as masses and springs: a network on the vertices of its mesh that comes as near to the solid as it can.

Springs along lines transmit forces along them only, so that a network of them has C_ijkl alike in all indices: its
Poisson's ratio is 1/4 (Cauchy; in the closed form of Lloyd, Szekely & Harders 2007 too). What another ratio needs is
added as a pressure for the volume around each vertex (Golec et al. 2020):

    lambda tr(e)^2 / 2 + mu e : e  =  mu (tr(e)^2 / 2 + e : e)  +  (lambda - mu) tr(e)^2 / 2
                                      springs                      volumes

Springs lie along the edges of the tetrahedra, and from vertex to vertex across each inner face: edges alone have too
few directions to be alike in all. Their stiffness is that which answers uniform strains best: at each vertex the
stress, and the force, of every one of the six uniform strains; least squares with no spring below zero.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement
from math import factorial, prod

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg

from palpate.fem.errors import BodyError
from palpate.fem.volume import Volume

__all__ = ["SpringNetwork", "build_network", "patches"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_FACES = ((0, 1, 2, 3), (0, 1, 3, 2), (0, 2, 3, 1), (1, 2, 3, 0))  # three corners, and the one across
_PRIOR = 0.1  # weight of a spring's first guess against one equation of strain: decides what strains leave open


@dataclass(frozen=True, eq=False)
class SpringNetwork:
    """Masses, springs and volumes on the N vertices of a mesh."""

    places: Array  # at rest (N, 3), m
    masses: Array  # (N,), kg
    springs: Indices  # vertices at their ends (s, 2)
    stiffness: Array  # of the springs (s,), N/m
    tetrahedra: Indices  # (m, 4)
    pressure: Array  # of a unit change of volume at each vertex (N,), Pa
    misfit: float  # root mean square of the stress that uniform strains leave wrong, by that of the solid

    @property
    def matrix(self) -> sparse.csr_matrix:
        """Stiffness (3N, 3N), N/m, near rest; row 3 x vertex + axis."""
        x, (a, b) = self.places, self.springs.T
        along = (x[b] - x[a]) / np.linalg.norm(x[b] - x[a], axis=1, keepdims=True)
        longer = _rows(np.stack([a, b], axis=1), np.stack([-along, along], axis=1), len(x))
        swell, volumes = self._swell()
        whole = longer.T @ sparse.diags(self.stiffness) @ longer
        return (whole + swell.T @ sparse.diags(self.pressure / volumes) @ swell).tocsr()

    def _swell(self) -> tuple[sparse.csr_matrix, Array]:
        """Change of the volume at each vertex (N, 3N), m^2, and the volume there (N,), m^3."""
        faces, volumes = _slopes(self.places, self.tetrahedra)
        each = _rows(self.tetrahedra, faces * volumes[:, None, None], len(self.places))
        share = _shares(self.tetrahedra, len(self.places))
        return (share @ each).tocsr(), np.asarray(share @ volumes)


def build_network(volume: Volume, young: Array, poisson: float, density: float) -> SpringNetwork:
    """Return the network for Young's modulus (m,), Pa, of each tetrahedron, Poisson's ratio, and a density, kg/m^3.

    Poisson's ratio below 1/4 needs pressures below zero, which hold near rest only.
    """
    x, cells = volume.points, volume.tetrahedra
    slopes, volumes = _slopes(x, cells)
    share = _shares(cells, len(x))
    around = np.asarray(share @ volumes)
    shear = young / (2 * (1 + poisson))
    at_vertex = np.asarray(share @ (volumes * shear)) / around
    springs = np.unique(np.concatenate([_edges(cells), _across(cells)]), axis=0)
    # The solid's force at a vertex under a uniform strain, mu (tr(e) + 2 e) g: g is zero inside, if mu is the same.
    g = np.zeros_like(x)
    np.add.at(g, cells, slopes * (volumes * shear)[:, None, None])
    stiffness, misfit = _fit(x, springs, around, at_vertex, g)
    pressure = at_vertex * (2 * poisson / (1 - 2 * poisson) - 1)
    return SpringNetwork(x, density * around, springs, stiffness, cells, pressure, misfit)


def patches(points: Array, triangles: Indices, nodes: Indices) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """Return the vertices that each of the n nodes' forces act on: where each list begins (n + 1,), they, their shares.

    A force spreads as its linear hat on the `triangles` (k, 3): the shares are the hat's products with its neighbours'
    by its own integral, and sum to one.
    """
    a, b, c = (points[triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    local = area[:, None, None] / 12.0 * (1.0 + np.eye(3))
    rows, columns = np.repeat(triangles, 3, axis=1).ravel(), np.tile(triangles, (1, 3)).ravel()
    products = sparse.csr_matrix((local.ravel(), (rows, columns)), shape=(len(points),) * 2)[nodes]
    share = (sparse.diags(1.0 / np.asarray(products.sum(axis=1)).ravel()) @ products).tocsr()
    return share.indptr.astype(np.int32), share.indices.astype(np.int32), share.data


def _edges(cells: Indices) -> Indices:
    return np.unique(np.sort(np.concatenate([cells[:, list(e)] for e in combinations(range(4), 2)]), axis=1), axis=0)


def _across(cells: Indices) -> Indices:
    """Return the pairs of vertices that face each other across a face (k, 2)."""
    faces = np.sort(np.concatenate([cells[:, list(f[:3])] for f in _FACES]), axis=1)
    tips = np.concatenate([cells[:, f[3]] for f in _FACES])
    order = np.lexsort(faces.T)
    same = np.flatnonzero((np.diff(faces[order], axis=0) == 0).all(axis=1))
    return np.sort(np.stack([tips[order[same]], tips[order[same + 1]]], axis=1), axis=1)


def _slopes(x: Array, cells: Indices) -> tuple[Array, Array]:
    """Return the slopes of the linear hat functions (m, 4, 3), 1/m, and the volumes (m,), m^3."""
    u, v, w = (x[cells[:, i]] - x[cells[:, 0]] for i in (1, 2, 3))
    faces = np.stack([np.cross(v, w), np.cross(w, u), np.cross(u, v)], axis=1)
    six = np.einsum("ij,ij->i", u, faces[:, 0])
    slopes = np.concatenate([-faces.sum(axis=1, keepdims=True), faces], axis=1) / six[:, None, None]
    return slopes, six / 6.0


def _shares(cells: Indices, count: int) -> sparse.csr_matrix:
    """Return a quarter for each vertex (N) of each tetrahedron (m)."""
    ones = np.full(cells.size, 0.25)
    return sparse.csr_matrix((ones, (cells.ravel(), np.repeat(np.arange(len(cells)), 4))), shape=(count, len(cells)))


def _rows(vertices: Indices, values: Array, count: int) -> sparse.csr_matrix:
    """Return rows (r, 3 count) with `values` (r, k, 3) at `vertices` (r, k)."""
    columns = 3 * vertices[:, :, None] + np.arange(3)
    rows = np.repeat(np.arange(len(vertices)), columns[0].size)
    return sparse.csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(len(vertices), 3 * count))


def _fit(x: Array, springs: Indices, around: Array, shear: Array, g: Array) -> tuple[Array, float]:
    """Return the springs' stiffness (s,), N/m, and the misfit.

    At each vertex: sum k l^2 nnnn / 2 = V mu (15 numbers alike in all indices), and sum k l nnn = - mu (g, alike in all
    indices; 10 numbers), over the springs there with the directions n away from it.
    """
    (a, b), count = springs.T, len(x)
    length = np.linalg.norm(x[b] - x[a], axis=1)
    n = (x[b] - x[a]) / length[:, None]
    at_a = sparse.csr_matrix((np.ones(len(a)), (a, np.arange(len(a)))), shape=(count, len(a)))
    at_b = sparse.csr_matrix((np.ones(len(b)), (b, np.arange(len(b)))), shape=(count, len(b)))
    # A guess: all springs alike but for length and the material around, of the right sum of stiffness.
    guess = 0.5 * (shear[a] + shear[b]) * np.cbrt(0.5 * (around[a] + around[b]))
    guess *= (15 * around * shear).sum() / (guess * length**2).sum()
    left, right = [], []
    for axes in combinations_with_replacement(range(3), 4):
        weight = np.sqrt(_repeats(axes))
        i, j, k, m = axes
        want = (i == j) * (k == m) + (i == k) * (j == m) + (i == m) * (j == k)
        each = sparse.diags(0.5 * length**2 * np.prod(n[:, axes], axis=1) * guess)
        left.append(sparse.diags(weight / (around * shear)) @ (at_a + at_b) @ each)
        right.append(np.full(count, weight * want))
    for three in combinations_with_replacement(range(3), 3):
        weights = np.sqrt(_repeats(three)) / (around ** (2 / 3) * shear)
        i, j, k = three
        pulls = -(g[:, i] * (j == k) + g[:, j] * (i == k) + g[:, k] * (i == j))
        each = sparse.diags(length * np.prod(n[:, three], axis=1) * guess)
        left.append(sparse.diags(weights) @ (at_a - at_b) @ each)
        right.append(weights * pulls)
    left.append(_PRIOR * sparse.eye(len(springs)))
    right.append(np.full(len(springs), _PRIOR))
    matrix, target = sparse.vstack(left).tocsr(), np.concatenate(right)
    found = _least_squares(matrix, target)
    stress = 15 * count
    wrong = (matrix[:stress] @ found - target[:stress]).reshape(15, count)
    return found * guess, float(np.linalg.norm(wrong) / np.linalg.norm(target[:stress]))


def _repeats(axes: tuple[int, ...]) -> float:
    """Return how many entries of a tensor alike in all indices are this one."""
    return factorial(len(axes)) / prod(factorial(times) for times in Counter(axes).values())


def _least_squares(matrix: sparse.csr_matrix, target: Array) -> Array:
    """Return x >= 0 that brings `matrix` x nearest to `target`, by block principal pivoting (Judice & Pires 1994)."""
    normal, right = (matrix.T @ matrix).tocsr(), matrix.T @ target
    positive = np.ones(len(right), dtype=bool)
    fewest, patience = len(right) + 1, 5
    for _ in range(100):
        at = np.flatnonzero(positive)
        part = normal[at][:, at]
        scale = sparse.diags(1.0 / part.diagonal())
        x = np.zeros(len(right))
        x[at], failed = cg(part, right[at], rtol=1e-11, maxiter=20_000, M=scale)
        if failed:
            break
        slope = normal @ x - right
        wrong = np.where(positive, x < -1e-9, slope < -1e-9 * np.abs(right).max())
        if not wrong.any():
            return np.maximum(x, 0.0)
        if wrong.sum() < fewest:
            fewest, patience = int(wrong.sum()), 5
        elif patience > 0:
            patience -= 1
        else:
            wrong[: np.flatnonzero(wrong)[-1]] = False  # the last one only, which ends
        positive ^= wrong
    raise BodyError("no springs were found for this mesh: its tetrahedra are too flat, mesh again")
