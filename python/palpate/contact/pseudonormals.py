"""Angle-weighted normals of the faces, edges and vertices of a triangle mesh (Baerentzen & Aanaes 2005)."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from palpate.arrays import Array, Indices
from palpate.contact.simplices import area_vectors, barycentric, cross, half_edges, unique_rows

__all__ = ["Pseudonormals"]

_ON_EDGE = 1e-7  # barycentric weight below which a point lies on the edge opposite of a corner


class Pseudonormals:
    """Unit normals of triangles (k, 3) of points (n, 3), and of their edges and vertices.

    Those of edges and vertices do not depend on how the surface is cut into triangles, nor on their order.
    """

    def __init__(self, points: Array, triangles: Indices) -> None:
        self._points, self._triangles = points, triangles

    def at(self, points: Array, faces: Indices) -> Array:
        """Return the unit normals of the faces, edges or vertices on which points (m, 3) of `faces` (m,) lie (m, 3)."""
        weights = barycentric(points, self._points[self._triangles[faces]])
        zero = weights < _ON_EDGE
        normal = self.of_faces[faces]
        edge = np.flatnonzero(zero.sum(axis=1) == 1)
        side = (np.argmax(zero[edge], axis=1) + 1) % 3
        normal[edge] = self.of_edges[3 * faces[edge] + side]
        vertex = np.flatnonzero(zero.sum(axis=1) == 2)
        corner = np.argmax(weights[vertex], axis=1)
        normal[vertex] = self.of_vertices[self._triangles[faces[vertex], corner]]
        return normal

    @cached_property
    def of_faces(self) -> Array:
        """Unit normals of the triangles (k, 3)."""
        return _unit(area_vectors(self._points, self._triangles))

    @cached_property
    def of_vertices(self) -> Array:
        """Unit normals of the points (n, 3)."""
        total = np.zeros_like(self._points)
        corners = self._points[self._triangles]
        for i in range(3):
            a, b = corners[:, (i + 1) % 3] - corners[:, i], corners[:, (i + 2) % 3] - corners[:, i]
            angle = np.arctan2(np.linalg.norm(cross(a, b), axis=1), np.einsum("ij,ij->i", a, b))
            np.add.at(total, self._triangles[:, i], angle[:, None] * self.of_faces)
        return _unit(total)

    @cached_property
    def of_edges(self) -> Array:
        """Unit normals of the edges (3 k, 3), row 3 x triangle + number of the edge's first corner."""
        number = unique_rows(np.sort(half_edges(self._triangles), axis=1))[1]
        total = np.zeros((int(number.max()) + 1, 3))
        np.add.at(total, number, np.repeat(self.of_faces, 3, axis=0))
        return _unit(total)[number]


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1), np.finfo(float).tiny)[:, None])
