"""Quadratic surface through the vertices and normals of a triangle mesh: that of contact by signed distance."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from palpate.arrays import Array, Indices
from palpate.contact.pseudonormals import Pseudonormals
from palpate.contact.simplices import area_vectors, barycentric
from palpate.fem.hat_functions import mean_normals

__all__ = ["CurvedSurface"]

_SHARP = 0.82  # cosine between a triangle and the normal of its corner, below which the triangle stays flat: 35 degrees
_BENT = np.radians(30.0)  # half of the angle between two triangles from which on their edge is sharp


class CurvedSurface:
    """Quadratic triangles (Nagata 2005) over triangles (k, 3) of points (n, 3), m, as in the core's `PatchPoints`.

    A triangle is flat if one at its corners deviates from the corner's normal by more than 35 degrees.

    Args:
        flat: normals of the flat triangles.
    """

    def __init__(self, points: Array, triangles: Indices, flat: Pseudonormals) -> None:
        self._points, self._triangles, self._flat = points, triangles, flat

    def at(self, point: Array, face: int) -> tuple[Array, Array]:
        """Return the point (3,), m, over a point of the flat triangle `face`, and the unit normal there (3,)."""
        corners, normals = self._corners(face)
        if not normals.any():
            return point, self._flat.at(point[None], np.array([face]))[0]
        weights = barycentric(point[None], corners[None])[0]
        curved = point.copy()
        for one, two in ((0, 1), (1, 2), (2, 0)):
            both, edge = normals[one] + normals[two], corners[two] - corners[one]
            curved -= weights[one] * weights[two] * ((normals[one] - normals[two]) @ edge) / (both @ both) * both
        normal = weights @ normals
        return curved, normal / np.linalg.norm(normal)

    def curvatures(self, face: int) -> Array:
        """Return the curvature of a triangle in three directions (3,), 1/m, positive where the surface is convex.

        It is the turn of the normal along its edges; of a flat triangle, over its edges, and 0 over sharp ones.
        """
        points, normals = self._corners(face)
        edges = np.roll(points, -1, axis=0) - points
        lengths = np.linalg.norm(edges, axis=1)
        if normals.any():
            turns = np.roll(normals, -1, axis=0) - normals
            return np.asarray(np.einsum("ej,ej->e", edges, turns) / lengths**2)
        area = area_vectors(self._points, self._triangles[face][None])[0]
        size = float(np.linalg.norm(area))
        outward = np.cross(edges, area) / (lengths * size)[:, None]
        across = self._flat.of_edges[3 * face : 3 * face + 3]  # unit normals of the edges
        turn = np.arcsin(np.clip(np.einsum("ej,ej->e", outward, across), -1.0, 1.0))
        middle = 2.0 * size / (3.0 * lengths)  # distance of the triangle's middle from each edge
        return np.where(np.abs(turn) < _BENT, turn / middle, 0.0)

    def _corners(self, face: int) -> tuple[Array, Array]:
        """Return the corners of a triangle (3, 3), m, and their unit normals (3, 3); zeros if the triangle is flat."""
        corners = self._triangles[face]
        normals = self._normals[corners]
        return self._points[corners], normals * np.linalg.norm(normals, axis=1).all()

    @cached_property
    def _normals(self) -> Array:
        """Unit normals of the points, weighted by area (n, 3); zero at points of sharp edges."""
        normals = mean_normals(self._points, self._triangles, np.arange(len(self._points)))
        aligned = np.einsum("ka,kca->kc", self._flat.of_faces, normals[self._triangles])
        normals[self._triangles[~(aligned > _SHARP)]] = 0.0
        return normals
