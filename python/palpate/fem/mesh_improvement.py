"""Improvement of a tetrahedral mesh that fills a surface: sharp edges, smoothing, and a manifold surface."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.spatial import cKDTree

from palpate.arrays import Array, Flags, Indices
from palpate.contact.simplices import (
    FACES,
    adjacent_faces,
    boundary,
    components,
    cross,
    equal_neighbors,
    half_edges,
    unique_rows,
    volumes,
)
from palpate.fem.closed_surface import ClosedSurface

MIN_ANGLE: Final = 10.0  # degrees, smallest dihedral angle that a moved point may leave
_REACH: Final = 0.5  # spacings within which a surface point moves to a sharp edge
_LONG: Final = 4.0  # spacings, least length of connected sharp edges that are kept; shorter ones are roughness
_SMOOTHINGS: Final = 4
_EDGES: Final = np.array([(0, 1, 2, 3), (0, 2, 1, 3), (0, 3, 1, 2), (1, 2, 0, 3), (1, 3, 0, 2), (2, 3, 0, 1)])
_BLOCK: Final = 1 << 10  # tetrahedra whose angles are computed together


def improve(surface: ClosedSurface, points: Array, cells: Indices, spacing: float) -> Array:
    """Return the points (n, 3), m, moved to sharp edges of the surface and to the means of their neighbors.

    No tetrahedron of `cells` (m, 4) gets a dihedral angle below `MIN_ANGLE`, or its own if that is smaller.
    """
    on = np.zeros(len(points), dtype=bool)
    on[np.unique(boundary(cells))] = True
    points, sharp = _snap(surface, points, cells, on, spacing)
    graph = _neighbors(cells, len(points))
    skin = _neighbors(boundary(cells), len(points))
    for _ in range(_SMOOTHINGS):
        target = graph @ points
        target[on] = surface.nearest((skin @ points)[on])[0]
        target[sharp] = points[sharp]
        points = move(points, target, cells)
    return points


def min_angles(points: Array, cells: Indices) -> Array:
    """Return the smallest dihedral angle of each tetrahedron (m,), degrees; negative if it is inverted."""
    least = np.empty(len(cells))
    for begin in range(0, len(cells), _BLOCK):
        corners = points[cells[begin : begin + _BLOCK]][:, _EDGES].reshape(-1, 4, 3)  # six rows for each tetrahedron
        edge, one, other = (corners[:, i] - corners[:, 0] for i in (1, 2, 3))
        u, v = cross(edge, one), cross(edge, other)
        angle = np.arctan2(np.linalg.norm(cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
        least[begin : begin + _BLOCK] = angle.reshape(-1, len(_EDGES)).min(axis=1)
    return np.asarray(np.degrees(least) * np.sign(volumes(points, cells)))


def move(points: Array, target: Array, cells: Indices) -> Array:
    """Move points to `target` (n, 3) unless a tetrahedron around them would get a small angle."""
    allowed = np.minimum(MIN_ANGLE, min_angles(points, cells) - 1e-9)
    free = np.ones(len(points), dtype=bool)
    for _ in range(20):
        moved = np.where(free[:, None], target, points)
        bad = cells[min_angles(moved, cells) < allowed]
        if len(bad) == 0:
            return moved
        free[bad] = False
    return points


def _snap(surface: ClosedSurface, points: Array, cells: Indices, on: Flags, spacing: float) -> tuple[Array, Flags]:
    """Move surface points (n,) to the corners and sharp edges of the surface; return points and whether each moved.

    Each corner takes the nearest point. Then each point moves to the nearest sharp edge, the nearest points first.
    """
    sharp = np.zeros(len(points), dtype=bool)
    edges = _long_lines(surface.vertices, surface.sharp_edges, _LONG * spacing)
    rows = np.flatnonzero(on)
    corners = surface.vertices[np.append(_corners(surface.vertices, edges), surface.spikes(0.5 * spacing))]
    jobs: list[tuple[int, Array]] = []
    if len(corners):
        distance, nearest = cKDTree(points[rows]).query(corners)
        order = np.lexsort((np.arange(len(corners)), distance))
        jobs += [(int(rows[nearest[i]]), corners[i]) for i in order if distance[i] < 2.0 * _REACH * spacing]
    if len(edges):
        samples = _samples(surface.vertices, edges, 0.05 * spacing)
        distance, nearest = cKDTree(samples).query(points[rows])
        order = np.lexsort((rows, distance))
        jobs += [(int(rows[i]), samples[nearest[i]]) for i in order if distance[i] < _REACH * spacing]
    around = _cells_around(cells, len(points))
    points = points.copy()
    for vertex, target in jobs:
        if sharp[vertex]:
            continue
        near = cells[around.indices[around.indptr[vertex] : around.indptr[vertex + 1]]]
        allowed = min(MIN_ANGLE, float(min_angles(points, near).min()))
        old = points[vertex].copy()
        points[vertex] = target
        sharp[vertex] = bool(min_angles(points, near).min() >= allowed)
        if not sharp[vertex]:
            points[vertex] = old
    return points, sharp


def _long_lines(vertices: Array, edges: Indices, least: float) -> Indices:
    """Return the edges (e, 2) that belong to connected lines of a length of `least`, m, or more."""
    if len(edges) == 0:
        return edges
    line = components(edges[:, 0], edges[:, 1], len(vertices))[edges[:, 0]]
    length = np.bincount(line, np.linalg.norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], axis=1))
    return np.asarray(edges[length[line] >= least])


def _corners(vertices: Array, edges: Indices) -> Indices:
    """Return the vertices at which sharp edges end, branch or turn by more than 35 degrees."""
    used, count = np.unique(edges, return_counts=True)
    total = np.zeros_like(vertices)
    way = vertices[edges[:, 1]] - vertices[edges[:, 0]]
    way /= np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)[:, None]
    np.add.at(total, edges[:, 0], way)
    np.add.at(total, edges[:, 1], -way)
    turn = np.linalg.norm(total[used], axis=1) > 2.0 * np.sin(np.radians(35.0) / 2.0)
    return np.asarray(used[(count != 2) | turn])


def _samples(vertices: Array, edges: Indices, step: float) -> Array:
    """Return points (s, 3) along edges (e, 2), about `step` apart."""
    a, b = vertices[edges[:, 0]], vertices[edges[:, 1]]
    count = np.clip(np.ceil(np.linalg.norm(b - a, axis=1) / step).astype(int), 1, 10_000)
    edge = np.repeat(np.arange(len(edges)), count)
    part = (np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[edge]
    return np.asarray(a[edge] + part[:, None] * (b - a)[edge])


def _neighbors(cells: Indices, count: int) -> csr_matrix:
    """Return the matrix (n, n) that takes the mean over the neighbors of each point; a point without any stays."""
    width = cells.shape[1]
    pairs = [(i, j) for i in range(width) for j in range(width) if i != j]
    a, b = (np.concatenate([cells[:, pair[k]] for pair in pairs]) for k in (0, 1))
    graph = csr_matrix((np.ones(len(a)), (a, b)), shape=(count, count))
    graph.data[:] = 1.0
    alone = np.asarray(graph.sum(axis=1)).ravel() == 0
    graph = graph + diags(alone.astype(float)).tocsr()
    return csr_matrix(graph.multiply(1.0 / np.asarray(graph.sum(axis=1))))


def _cells_around(cells: Indices, count: int) -> csr_matrix:
    """Return the matrix (n, m) with an entry for each tetrahedron around each point."""
    rows = np.repeat(np.arange(len(cells)), 4)
    return csr_matrix((np.ones(len(rows)), (cells.ravel(), rows)), shape=(count, len(cells)))


def manifold(points: Array, cells: Indices) -> tuple[Array, Indices]:
    """Return points and tetrahedra whose surface has two triangles at each edge and one fan at each vertex.

    A vertex whose tetrahedra are not connected through faces is doubled. At an edge with more than two surface
    triangles, the tetrahedra around it are removed, smallest group first. Groups without any face to the largest part
    that are smaller than a hundredth of it are removed.
    """
    for _ in range(50):
        triangles = boundary(cells)
        edges = np.sort(half_edges(triangles), axis=1)
        first, number = unique_rows(edges)
        crowded = edges[first[np.bincount(number) > 2]]
        if len(crowded) == 0:
            break
        drop = np.zeros(len(cells), dtype=bool)
        for a, b in crowded.tolist():
            around = np.flatnonzero(((cells == a) | (cells == b)).sum(axis=1) == 2)
            label = _groups(cells[around])
            drop[around[label == np.argmin(np.bincount(label))]] = True
        cells = cells[~drop]
    return _split_pinched(points, _without_crumbs(points, cells))


def _without_crumbs(points: Array, cells: Indices) -> Indices:
    """Drop parts, connected through faces, that have less than a hundredth of the volume of the largest one."""
    label = _groups(cells)
    size = np.bincount(label, np.abs(volumes(points, cells)))
    return np.asarray(cells[(size >= 0.01 * size.max())[label]])


def _split_pinched(points: Array, cells: Indices) -> tuple[Array, Indices]:
    """Give each group of tetrahedra around a vertex that are connected through faces a vertex of its own."""
    corner = 4 * np.arange(len(cells))[:, None] + np.arange(4)
    faces = np.concatenate([cells[:, face] for face in FACES])
    owners = np.concatenate([corner[:, face] for face in FACES])
    order = np.argsort(faces, axis=1)
    faces, owners = np.take_along_axis(faces, order, axis=1), np.take_along_axis(owners, order, axis=1)
    one, two = equal_neighbors(faces)
    group = components(owners[one].ravel(), owners[two].ravel(), 4 * len(cells))
    _, first, number = np.unique(group, return_index=True, return_inverse=True)
    vertex = cells.ravel()[first]  # of each group
    rank = np.argsort(np.argsort(vertex, kind="stable"), kind="stable")
    return points[np.sort(vertex, kind="stable")], rank[number].reshape(-1, 4)


def _groups(cells: Indices) -> Indices:
    """Return the index of the part of each tetrahedron (m,). Parts share no face."""
    _, one, two = adjacent_faces(cells)
    return components(one % len(cells), two % len(cells), len(cells))
