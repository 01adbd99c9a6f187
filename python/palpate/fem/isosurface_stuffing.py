"""Isosurface stuffing: tetrahedra that fill a surface, with bounded dihedral angles (Labelle & Shewchuk 2007).

The tetrahedra of a body-centered cubic lattice are cut at the surface. Lattice points close to a cut are first moved
onto it, which bounds all dihedral angles to 10.7 and 164.8 degrees, whatever the surface. The result depends only on
the surface and the spacing.
"""

from __future__ import annotations

from itertools import product
from typing import Final, NamedTuple, Protocol

import numpy as np

from palpate.arrays import Array, Flags, Indices
from palpate.contact.simplices import components, volumes

MEAN_EDGE: Final = (6.0 + 8.0 * 0.75**0.5) / 14.0  # mean edge of the lattice over the side of its cubes
_LONG, _SHORT = 0.24999, 0.41189  # parts of an edge: a closer cut moves the lattice point
_STEPS: Final = 8  # of regula falsi
_PROBE: Final = 0.01  # part of an edge by which a crossing is checked on both sides
_HALVINGS: Final = 10  # of an edge whose crossing failed the check


class FilledSurface(Protocol):
    """Closed surface with a distance and an inside."""

    @property
    def vertices(self) -> Array:
        """Vertices (n, 3), m."""

    def distance(self, points: Array) -> Array:
        """Return the distance of points (n, 3) from the surface (n,), m."""

    def inside(self, points: Array) -> Flags:
        """Return whether points (n, 3) lie inside (n,)."""

    def signed(self, points: Array) -> Array:
        """Return the distance of points (n, 3) near the surface (n,), m, positive inside."""


class Lattice(NamedTuple):
    """Body-centered cubic lattice over a grid of cubes. Its points are the corners, then the centers."""

    shape: tuple[int, int, int]  # cubes along each axis
    side: float  # of a cube, m
    low: Array  # lowest corner (3,), m

    def corners(self) -> Indices:
        """Return the index of each corner (nx + 1, ny + 1, nz + 1)."""
        shape = [n + 1 for n in self.shape]
        return np.arange(int(np.prod(shape))).reshape(shape)

    def centers(self) -> Indices:
        """Return the index of each center (nx, ny, nz)."""
        return int(np.prod([n + 1 for n in self.shape])) + np.arange(int(np.prod(self.shape))).reshape(self.shape)

    def places(self) -> Indices:
        """Return the places of the points (n, 3) in halves of a side: even for corners, odd for centers."""
        corners = 2 * np.indices([n + 1 for n in self.shape]).reshape(3, -1).T
        return np.concatenate([corners, 2 * np.indices(self.shape).reshape(3, -1).T + 1])

    def long_edges(self) -> Indices:
        """Return the edges (e, 2) between neighboring corners and between neighboring centers."""
        pairs = []
        for grid in (self.corners(), self.centers()):
            for axis in range(3):
                line = np.moveaxis(grid, axis, 0)
                pairs.append(np.stack([line[:-1].ravel(), line[1:].ravel()], axis=1))
        return np.concatenate(pairs)

    def short_edges(self) -> Indices:
        """Return the edges (e, 2) from the centers to the corners of their cubes."""
        centers = self.centers().ravel()
        corners = [_octant(self.corners(), self.shape, step).ravel() for step in product((0, 1), repeat=3)]
        return np.concatenate([np.stack([centers, corner], axis=1) for corner in corners])

    def tetrahedra(self, wanted: Flags) -> Indices:
        """Return the tetrahedra (m, 4) with a wanted point (n,): two centers, and an edge of the face between them."""
        found = []
        corners, centers = self.corners(), self.centers()
        for axis in range(3):
            grid = np.moveaxis(centers, axis, 0)
            face = np.moveaxis(corners, axis, 0)[1:-1]
            near, far = grid[:-1], grid[1:]
            ring = [face[:, :-1, :-1], face[:, 1:, :-1], face[:, 1:, 1:], face[:, :-1, 1:]]
            for k in range(4):
                cells = np.stack([near, far, ring[k], ring[(k + 1) % 4]], axis=-1).reshape(-1, 4)
                found.append(cells[wanted[cells].any(axis=1)])
        return np.concatenate(found)


def lattice_over(low: Array, high: Array, spacing: float) -> Lattice:
    """Return the lattice with edges of `spacing`, m, in the mean, around the box from `low` to `high` (3,), m."""
    side = spacing / MEAN_EDGE
    nx, ny, nz = (np.ceil((high - low) / side).astype(int) + 2).tolist()
    middle = (low + high) / 2.0
    return Lattice((nx, ny, nz), side, middle - side * np.array([nx, ny, nz]) / 2.0)


def stuff(surface: FilledSurface, lattice: Lattice) -> tuple[Array, Indices]:
    """Return points (n, 3), m, and tetrahedra (m, 4) of the inside.

    There may be no tetrahedra.
    """
    places = lattice.places()
    points = lattice.low + lattice.side / 2.0 * places
    edges = np.concatenate([lattice.long_edges(), lattice.short_edges()])
    long = np.arange(len(edges)) < len(edges) - 8 * int(np.prod(lattice.shape))
    sign = _signs(surface, points, edges[~long], lattice.side)
    cut = sign[edges[:, 0]] * sign[edges[:, 1]] < 0
    edges, long = edges[cut], long[cut]
    crossings = _crossings(surface, points, edges, sign)
    sign, points = _warp(points, edges, crossings, np.where(long, _LONG, _SHORT), sign)
    remaining = (sign[edges] != 0).all(axis=1)
    cells = lattice.tetrahedra(sign > 0)
    even = places.sum(axis=1) // 2 % 2 == 0  # the parity of the indices along the axes, of corners and of centers
    center = np.arange(len(places)) >= int(np.prod([n + 1 for n in lattice.shape]))
    even = np.where(center, (places - 1).sum(axis=1) // 2 % 2 == 0, even)
    tetrahedra = _cut(cells, sign, _CutPoints(len(points), edges[remaining]), even, center)
    points = np.concatenate([points, crossings[remaining]])
    used, tetrahedra = np.unique(tetrahedra, return_inverse=True)
    return _oriented(points[used], tetrahedra.reshape(-1, 4).astype(np.int64))


def _oriented(points: Array, cells: Indices) -> tuple[Array, Indices]:
    inverted = volumes(points, cells) < 0.0
    cells[inverted] = cells[inverted][:, [0, 2, 1, 3]]
    return points, cells


def _octant(corners: Indices, shape: tuple[int, ...], step: tuple[int, ...]) -> Indices:
    return corners[tuple(slice(s, s + n) for s, n in zip(step, shape, strict=True))]


def _signs(surface: FilledSurface, points: Array, edges: Indices, side: float) -> Indices:
    """Return 1 inside, 0 on the surface, -1 outside (n,).

    An edge shorter than the distances of its ends together does not meet the surface, so its ends have one sign.
    """
    distance = surface.distance(points)
    apart = distance[edges].sum(axis=1) > 1.001 * 0.75**0.5 * side
    a, b = edges[apart].T
    part = components(a, b, len(points))
    count = int(part.max()) + 1
    farthest = np.zeros(count)
    np.maximum.at(farthest, part, distance)
    chosen = np.full(count, len(points))
    rows = np.flatnonzero(distance == farthest[part])
    np.minimum.at(chosen, part[rows], rows)
    sign = np.where(surface.inside(points[chosen]), 1, -1)[part]
    return np.where(distance <= 1e-6 * side, 0, sign)


def _crossings(surface: FilledSurface, points: Array, edges: Indices, sign: Indices) -> Array:
    """Return a point of the surface on each edge (e, 3) whose ends have opposite signs, by regula falsi."""
    inner = np.where(sign[edges[:, 0]] > 0, edges[:, 0], edges[:, 1])
    outer = edges.sum(axis=1) - inner
    start, way = points[inner], points[outer] - points[inner]
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    at_low, at_high = surface.distance(start), -surface.distance(points[outer])
    part = at_low / np.maximum(at_low - at_high, np.finfo(float).tiny)
    for _ in range(_STEPS):
        value = surface.signed(start + part[:, None] * way)
        inside = value > 0.0
        at_high = np.where(inside, at_high / 2.0, value)  # the Illinois rule
        at_low = np.where(inside, value, at_low / 2.0)
        low, high = np.where(inside, part, low), np.where(inside, high, part)
        part = low + (high - low) * at_low / np.maximum(at_low - at_high, np.finfo(float).tiny)
    part = np.clip(part, low, high)
    found = start + part[:, None] * way
    before, after = (start + np.clip(part + d, 0.0, 1.0)[:, None] * way for d in (-_PROBE, _PROBE))
    apart = surface.distance(found) > _PROBE * np.linalg.norm(way, axis=1)
    wrong = np.flatnonzero(
        apart | ~(surface.inside(before) | (part < _PROBE)) | (surface.inside(after) & (part < 1.0 - _PROBE))
    )
    found[wrong] = _bisect(surface, start[wrong], way[wrong])
    return np.asarray(found)


def _bisect(surface: FilledSurface, start: Array, way: Array) -> Array:
    """Return points (e, 3) between `start`, which are inside, and `start + way`, outside, where the inside ends."""
    low, high = np.zeros(len(start)), np.ones(len(start))
    for _ in range(_HALVINGS if len(start) else 0):
        part = (low + high) / 2.0
        inside = surface.inside(start + part[:, None] * way)
        low, high = np.where(inside, part, low), np.where(inside, high, part)
    return np.asarray(start + ((low + high) / 2.0)[:, None] * way)


def _warp(points: Array, edges: Indices, crossings: Array, near: Array, sign: Indices) -> tuple[Indices, Array]:
    """Move lattice points with a near crossing onto the nearest one; return the new signs (n,) and points (n, 3).

    A moved point removes the crossings of its edges. Points are moved in the order of their indices, in rounds: each
    round moves the points without a neighbor of lower index that is to be moved.
    """
    sign, points = sign.copy(), points.copy()
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    way = np.linalg.norm(crossings[:, None] - points[edges], axis=2)
    close = way < (near * length)[:, None]
    while True:
        live = (sign[edges] != 0).all(axis=1)
        violated = np.zeros(len(points), dtype=bool)
        violated[edges[close & live[:, None]]] = True
        if not violated.any():
            return sign, points
        both = live & violated[edges].all(axis=1)
        waits = np.zeros(len(points), dtype=bool)
        waits[edges[both].max(axis=1)] = True
        row, end = np.nonzero(close & live[:, None])
        vertex = edges[row, end]
        now = ~waits[vertex]
        row, end, vertex = row[now], end[now], vertex[now]
        order = np.lexsort((row, way[row, end], vertex))
        first = order[np.append(True, np.diff(vertex[order]) > 0)]
        points[vertex[first]] = crossings[row[first]]
        sign[vertex[first]] = 0


class _CutPoints:
    """Index of the crossing of an edge (e, 2), counted from the number of lattice points."""

    def __init__(self, count: int, edges: Indices) -> None:
        self._count = count
        keys = np.sort(edges, axis=1) @ np.array([count, 1])
        order = np.argsort(keys, kind="stable")
        self._keys = keys[order]
        self._order = np.append(order, 0)  # of a key beyond the last one, which has no crossing and is not used

    def __call__(self, a: Indices, b: Indices) -> Indices:
        keys = np.minimum(a, b) * self._count + np.maximum(a, b)
        return np.asarray(self._count + self._order[np.searchsorted(self._keys, keys)])


def _cut(cells: Indices, sign: Indices, cut: _CutPoints, even: Flags, center: Flags) -> Indices:
    """Return the part of lattice tetrahedra (m, 4) inside of the surface, as tetrahedra.

    A quadrilateral a, b, cut(b, m), cut(a, m) is split from the point whose edge to m is short, or from the even one
    if both edges are short.
    """
    order = np.argsort(-sign[cells], axis=1, kind="stable")
    cells = np.take_along_axis(cells, order, axis=1)  # inside, on the surface, outside
    inside, outside = (sign[cells] > 0).sum(axis=1), (sign[cells] < 0).sum(axis=1)
    found = [cells[(inside > 0) & (outside == 0)]]

    def split_from_second(a: Indices, b: Indices, m: Indices) -> Flags:
        long_a, long_b = center[a] == center[m], center[b] == center[m]
        return np.where(long_a == long_b, even[b], long_a)

    one = cells[(inside == 1) & (outside > 0)]
    corner = one[:, 0]
    ends = [np.where(sign[v] < 0, cut(corner, v), v) for v in one[:, 1:].T]
    found.append(np.stack([corner, *ends], axis=1))

    a, b, z, m = cells[(inside == 2) & (outside == 1)].T
    swap = split_from_second(a, b, m)
    a, b = np.where(swap, b, a), np.where(swap, a, b)
    found += [np.stack([a, cut(a, m), cut(b, m), z], axis=1), np.stack([a, b, cut(b, m), z], axis=1)]

    a, b, c, m = cells[(inside == 3) & (outside == 1)].T
    sources = _sources(split_from_second(a, b, m), split_from_second(b, c, m), split_from_second(c, a, m))
    found += _prism((a, b, c), (cut(a, m), cut(b, m), cut(c, m)), sources)

    a, b, c, d = cells[(inside == 2) & (outside == 2)].T
    top, bottom = (a, cut(a, c), cut(a, d)), (b, cut(b, c), cut(b, d))
    by_c, by_d = split_from_second(a, b, c), split_from_second(a, b, d)
    third = np.where(by_c == by_d, even[c], ~by_c)  # of the surface: never three diagonals around the prism
    found += _prism(top, bottom, _sources(by_c, third, ~by_d))
    return np.concatenate(found)


def _sources(second_ab: Flags, second_bc: Flags, second_ca: Flags) -> Indices:
    """Return the number of diagonals from each top point of a prism (m, 3): 0, 1 or 2."""
    return np.stack([~second_ab + 0 + second_ca, second_ab + 0 + ~second_bc, second_bc + 0 + ~second_ca], axis=1)


def _prism(top: tuple[Indices, ...], bottom: tuple[Indices, ...], sources: Indices) -> list[Indices]:
    """Split prisms into three tetrahedra each, given the number of diagonals from each top point (m, 3)."""
    order = np.argsort(-sources, axis=1, kind="stable")
    t = np.take_along_axis(np.stack(top, axis=1), order, axis=1)
    b = np.take_along_axis(np.stack(bottom, axis=1), order, axis=1)
    return [
        np.stack([t[:, 0], b[:, 0], b[:, 1], b[:, 2]], axis=1),
        np.stack([t[:, 0], t[:, 1], b[:, 1], b[:, 2]], axis=1),
        np.stack([t[:, 0], t[:, 1], t[:, 2], b[:, 2]], axis=1),
    ]
