"""Winding number of a triangle surface: 1 inside of a closed surface with outward triangles, 0 outside.

It is the number of triangles that a ray leaves through, less those that it enters through. A surface without a border
has the same number for all rays. The ray has a generic direction, and an edge is evaluated alike for both of its
triangles, so a ray counts exactly one of them.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.arrays import Array, Indices

_TURN: Final = Rotation.from_euler("xyz", (0.7312, -0.4137, 1.1923)).as_matrix()  # the rays run along its third column
_CELLS: Final = 1024  # of the grid of triangles along an axis, at most
_BLOCK: Final = 2_000_000  # pairs of a point and a triangle evaluated at once


class WindingNumber:
    """Winding number of triangles (f, 3) of vertices (v, 3), without a border, at any points."""

    def __init__(self, vertices: Array, triangles: Indices) -> None:
        self._points, self._triangles = vertices @ _TURN, triangles
        corners = self._points[triangles][:, :, :2]
        low, high = corners.min(axis=1), corners.max(axis=1)
        self._low = low.min(axis=0)
        size = np.maximum(high.max(axis=0) - self._low, np.finfo(float).tiny)
        self._count = min(_CELLS, max(1, int(np.sqrt(len(triangles)))))
        while True:
            self._side = size / self._count
            first, last = self._cell(low), self._cell(high)
            span = last - first + 1
            if span.prod(axis=1).sum() <= 40 * len(triangles) or self._count == 1:
                break
            self._count = max(1, self._count // 2)
        cells, owner = _cover(first, span, self._count)
        order = np.argsort(cells, kind="stable")
        self._owner = owner[order]
        self._begin = np.searchsorted(cells[order], np.arange(self._count**2 + 1))
        a, b, c = (corners[:, i] for i in range(3))
        self._upward = _cross(b - a, c - a) > 0.0

    def __call__(self, points: Array) -> Array:
        """Return the winding number at points (n, 3), m: (n,)."""
        turned = points @ _TURN
        index = np.floor((turned[:, :2] - self._low) / self._side).astype(np.int64)
        inside = ((index >= 0) & (index < self._count)).all(axis=1)
        cell = np.where(inside, index[:, 0] * self._count + index[:, 1], 0)
        counts = np.where(inside, self._begin[cell + 1] - self._begin[cell], 0)
        ends = np.cumsum(counts)
        total = np.zeros(len(points))
        for low, high in _ranges(ends):
            number = counts[low:high]
            point = np.repeat(np.arange(low, high), number)
            place = np.arange(len(point)) - np.repeat(np.cumsum(number) - number, number)
            triangle = self._owner[self._begin[cell[point]] + place]
            total += np.bincount(point, self._crossings(turned[point], triangle), minlength=len(points))
        return total

    def _crossings(self, points: Array, triangles: Indices) -> Array:
        """Return 1 where the ray from a point leaves through its triangle, -1 where it enters, else 0."""
        vertices = self._triangles[triangles]
        upward = self._upward[triangles]
        within = np.ones(len(points), dtype=bool)
        for i in range(3):
            a, b = vertices[:, i], vertices[:, (i + 1) % 3]
            swapped = a > b
            start, end = self._points[np.where(swapped, b, a), :2], self._points[np.where(swapped, a, b), :2]
            left = (_cross(end - start, points[:, :2] - start) > 0.0) != swapped
            within &= left == upward
        rows = np.flatnonzero(within)
        a, b, c = (self._points[vertices[rows, i]] - points[rows] for i in range(3))
        above = (np.einsum("ij,ij->i", a, np.cross(b, c)) > 0.0) == upward[rows]
        result = np.zeros(len(points))
        result[rows] = np.where(above, np.where(upward[rows], 1.0, -1.0), 0.0)
        return result

    def _cell(self, places: Array) -> Indices:
        index = np.floor((places - self._low) / self._side).astype(np.int64)
        return np.asarray(np.clip(index, 0, self._count - 1))


def _cover(first: Indices, span: Indices, count: int) -> tuple[Indices, Indices]:
    """Return the cells of a grid that boxes cover, and the box of each."""
    number = span.prod(axis=1)
    owner = np.repeat(np.arange(len(first)), number)
    place = np.arange(len(owner)) - np.repeat(np.cumsum(number) - number, number)
    row, column = place // span[owner, 1], place % span[owner, 1]
    return (first[owner, 0] + row) * count + first[owner, 1] + column, owner


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _ranges(ends: Indices) -> list[tuple[int, int]]:
    """Split a list of cumulative counts into ranges of about `_BLOCK` items."""
    if len(ends) == 0 or ends[-1] == 0:
        return []
    cuts = np.searchsorted(ends, np.arange(_BLOCK, int(ends[-1]), _BLOCK))
    return [(int(a), int(b)) for a, b in pairwise(np.unique([0, *cuts.tolist(), len(ends)]))]
