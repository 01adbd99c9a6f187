"""Triangles and tetrahedra: areas, volumes, boundaries and connected components."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from palpate.arrays import Array, Indices

__all__ = [
    "FACES",
    "adjacent_faces",
    "area_vectors",
    "barycentric",
    "boundary",
    "components",
    "cross",
    "equal_neighbors",
    "half_edges",
    "parts_of_cells",
    "unique_rows",
    "volumes",
]

FACES: Final = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))  # of a tetrahedron, counterclockwise seen from outside


def cross(a: Array, b: Array) -> Array:
    """Return the cross products of vectors (n, 3) and (n, 3): the bits of `numpy.cross`, several times as fast."""
    out = np.empty(a.shape)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.subtract(a[:, j] * b[:, k], a[:, k] * b[:, j], out=out[:, i])
    return out


def area_vectors(points: Array, triangles: Indices) -> Array:
    """Return the areas of triangles (k, 3) of points (n, 3), along their normals: (k, 3), m^2."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return np.asarray(cross(b - a, c - a) / 2.0)


def barycentric(points: Array, corners: Array) -> Array:
    """Return the weights (n, 3) of the corners (n, 3, 3) at points (n, 3) of their triangles."""
    u, v, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    uu, uv, vv = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (u, v), (v, v)))
    wu, wv = np.einsum("ij,ij->i", w, u), np.einsum("ij,ij->i", w, v)
    scale = np.maximum(uu * vv - uv**2, np.finfo(float).tiny)
    second, third = (vv * wu - uv * wv) / scale, (uu * wv - uv * wu) / scale
    return np.stack([1.0 - second - third, second, third], axis=1)


def volumes(points: Array, cells: Indices) -> Array:
    """Return the signed volumes of tetrahedra (m, 4) of points (n, 3): (m,), m^3; positive for outward `FACES`."""
    a, b, c = (points[cells[:, i]] - points[cells[:, 0]] for i in (1, 2, 3))
    return np.asarray(np.einsum("ij,ij->i", a, cross(b, c)) / 6.0)


def half_edges(triangles: Indices) -> Indices:
    """Return the directed edges (3 k, 2) of triangles (k, 3); row 3 i + j is edge j of triangle i."""
    return np.asarray(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2))


def boundary(cells: Indices) -> Indices:
    """Return the triangles (k, 3) of one tetrahedron each, counterclockwise seen from outside.

    They are in the order of `FACES`, then of the tetrahedra.
    """
    faces, one, other = adjacent_faces(cells)
    return np.delete(faces, np.append(one, other), axis=0)


def adjacent_faces(cells: Indices) -> tuple[Indices, Indices, Indices]:
    """Return the faces (4 m, 3) of tetrahedra (m, 4), and the pairs of `equal_neighbors` among them.

    Face i is one of tetrahedron i % m, counterclockwise seen from outside, in the order of `FACES`.
    """
    faces = np.concatenate([cells[:, face] for face in FACES])
    return faces, *equal_neighbors(np.sort(faces, axis=1))


def equal_neighbors(rows: Indices) -> tuple[Indices, Indices]:
    """Return the indices (k,) and (k,) of rows that are equal and follow each other when all are sorted.

    A row that occurs p times is in p - 1 pairs. The order of numbers in a row counts.
    """
    order = np.lexsort(rows.T[::-1])
    same = (rows[order][1:] == rows[order][:-1]).all(axis=1)
    return order[:-1][same], order[1:][same]


def unique_rows(rows: Array | Indices) -> tuple[Indices, Indices]:
    """Return the index of the first of each set of equal rows (u,), sets in ascending order, and the set of each (n,).

    These are the index and the inverse of `numpy.unique` along axis 0, which takes an order of magnitude longer.
    """
    order = np.lexsort(rows.T[::-1])
    first = np.ones(len(rows), dtype=bool)
    first[1:] = (rows[order][1:] != rows[order][:-1]).any(axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.cumsum(first) - 1
    return order[first], number


def components(a: Indices, b: Indices, count: int) -> Indices:
    """Return the connected component of each of `count` nodes (n,) of a graph with the edges a (e,) to b (e,).

    Components are numbered from zero in the order of their first node.
    """
    graph = coo_matrix((np.ones(len(a), dtype=bool), (a, b)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def parts_of_cells(cells: Indices, count: int) -> Indices:
    """Return the connected component of each of `count` points (n,) of tetrahedra (m, 4); see `components`."""
    return components(cells[:, [0, 0, 0]].ravel(), cells[:, 1:].ravel(), count)
