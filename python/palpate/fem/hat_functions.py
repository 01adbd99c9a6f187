"""Linear hat functions of a triangulated surface: their integrals, and the mean normals around their vertices."""

from __future__ import annotations

import numpy as np

from palpate.arrays import Array, Indices
from palpate.contact.simplices import area_vectors

__all__ = ["hat_integrals", "mean_normals"]


def hat_integrals(points: Array, triangles: Indices, nodes: Indices) -> Array:
    """Return the integrals of the hat functions of `nodes` (n,) over triangles (k, 3) of points (v, 3): (n,), m^2."""
    third = np.linalg.norm(area_vectors(points, triangles), axis=1) / 3.0
    total = np.zeros(len(points))
    for i in range(3):
        np.add.at(total, triangles[:, i], third)
    return np.asarray(total[nodes])


def mean_normals(points: Array, triangles: Indices, nodes: Indices) -> Array:
    """Return outward unit normals at `nodes` (n,) of triangles (k, 3), area-weighted means over them: (n, 3)."""
    area = area_vectors(points, triangles)
    total = np.zeros_like(points)
    for i in range(3):
        np.add.at(total, triangles[:, i], area)
    total = total[nodes]
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))
