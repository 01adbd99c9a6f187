"""Generalized winding number of a triangle surface (Jacobson, Kavan & Sorkine-Hornung 2013).

It is 1 inside of a closed surface with outward triangles and 0 outside. Distant clusters of triangles are replaced by
dipoles (Barill et al. 2018).
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from palpate.arrays import Array, Indices

_CLUSTER: Final = 16  # mean number of triangles in a cluster
_FAR: Final = 3.0  # radii of a cluster beyond which it acts as a dipole; the error is below 0.01
_BLOCK: Final = 2_000_000  # pairs evaluated at once


class WindingNumber:
    """Winding number of triangles (f, 3) of vertices (v, 3) at any points."""

    def __init__(self, vertices: Array, triangles: Indices) -> None:
        corners = vertices[triangles]
        order, starts = _clusters(corners.mean(axis=1))
        self._corners = corners[order]
        self._starts, self._counts = starts, np.diff(np.append(starts, len(order)))
        a, b, c = (self._corners[:, i] for i in range(3))
        vectors = np.cross(b - a, c - a) / 2.0
        areas = np.linalg.norm(vectors, axis=1)
        total = np.add.reduceat(areas, starts)
        weighted = np.add.reduceat(areas[:, None] * self._corners.mean(axis=1), starts)
        self._dipoles = np.add.reduceat(vectors, starts)
        self._centers = weighted / np.maximum(total, np.finfo(float).tiny)[:, None]
        offsets = self._corners - np.repeat(self._centers, self._counts, axis=0)[:, None]
        self._radii = np.maximum.reduceat(np.linalg.norm(offsets, axis=2).max(axis=1), starts)

    def __call__(self, points: Array) -> Array:
        """Return the winding number at points (n, 3), m: (n,)."""
        rows = max(1, _BLOCK // len(self._radii))
        parts = [self._block(points[i : i + rows]) for i in range(0, len(points), rows)]
        return np.concatenate(parts) if parts else np.empty(0)

    def _block(self, points: Array) -> Array:
        origin = points.mean(axis=0)
        centers, places = self._centers - origin, points - origin
        square = (places**2).sum(axis=1)[:, None] + (centers**2).sum(axis=1) - 2.0 * places @ centers.T
        far = square > (_FAR * self._radii) ** 2
        flux = (centers * self._dipoles).sum(axis=1) - places @ self._dipoles.T
        total = np.where(far, flux / np.where(far, square, 1.0) ** 1.5, 0.0).sum(axis=1)
        point, cluster = np.nonzero(~far)
        counts = self._counts[cluster]
        ends = np.cumsum(counts)
        for low, high in _ranges(ends):
            begin = ends[low - 1] if low else 0
            inside = np.arange(begin, ends[high - 1]) - np.repeat(ends[low:high] - counts[low:high], counts[low:high])
            triangle = np.repeat(self._starts[cluster[low:high]], counts[low:high]) + inside
            owner = np.repeat(point[low:high], counts[low:high])
            angles = solid_angles(self._corners[triangle] - points[owner][:, None])
            total += np.bincount(owner, angles, minlength=len(points))
        return np.asarray(total / (4.0 * np.pi))


def solid_angles(corners: Array) -> Array:
    """Return the solid angles of triangles (n, 3, 3) from the origin (n,), sr (Van Oosterom & Strackee 1983)."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners.transpose(1, 2, 0)
    x, y, z = (
        np.sqrt(ax * ax + ay * ay + az * az),
        np.sqrt(bx * bx + by * by + bz * bz),
        np.sqrt(cx * cx + cy * cy + cz * cz),
    )
    ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
    triple = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return np.asarray(2.0 * np.arctan2(triple, x * y * z + ab * z + bc * x + ca * y))


def _clusters(centers: Array) -> tuple[Indices, Indices]:
    """Return an order of the triangles by cells of a grid, and the index at which each cell starts."""
    low, size = centers.min(axis=0), np.ptp(centers, axis=0)
    cells = max(1.0, len(centers) / _CLUSTER)  # a surface fills the square of the number of cells on a side
    side = max(float(size.max()), np.finfo(float).tiny) / np.sqrt(cells)
    index = np.floor((centers - low) / side).astype(np.int64)
    keys = np.ravel_multi_index(tuple(index.T), tuple((index.max(axis=0) + 1).tolist()))
    order = np.argsort(keys, kind="stable")
    return order, np.flatnonzero(np.append(True, np.diff(keys[order]) > 0))


def _ranges(ends: Indices) -> list[tuple[int, int]]:
    """Split a list of cumulative counts into ranges of at most about `_BLOCK` items."""
    if len(ends) == 0:
        return []
    cuts = np.unique(np.searchsorted(ends, np.arange(0, int(ends[-1]) + _BLOCK, _BLOCK)))
    cuts = np.unique(np.clip(np.append(cuts, len(ends)), 0, len(ends)))
    if cuts[0] != 0:
        cuts = np.insert(cuts, 0, 0)
    return [(int(a), int(b)) for a, b in pairwise(cuts)]
