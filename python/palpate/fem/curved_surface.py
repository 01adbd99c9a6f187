"""Quadratic surface through the vertices and normals of a triangle mesh: that of contact by signed distance."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from palpate.arrays import Array, Indices
from palpate.contact.pseudonormals import Pseudonormals
from palpate.contact.simplices import barycentric
from palpate.fem.hat_functions import mean_normals

__all__ = ["CurvedSurface"]

_SHARP = 0.82  # cosine between a triangle and the normal of its corner, below which the triangle stays flat: 35 degrees


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

    def curvature(self, face: int) -> float:
        """Return the mean curvature of a triangle, 1/m, positive where the surface is convex.

        It is 0 beside a convex edge. In a hollow it is that of the normals of all corners, however sharp.
        """
        corners = self._triangles[face]
        edges, turns = (np.roll(at, -1, axis=0) - at for at in (self._points[corners], self._means[corners]))
        curvature = float(np.mean(np.einsum("ej,ej->e", edges, turns) / np.einsum("ej,ej->e", edges, edges)))
        return curvature if self._corners(face)[1].any() else min(curvature, 0.0)

    def _corners(self, face: int) -> tuple[Array, Array]:
        """Return the corners of a triangle (3, 3), m, and their unit normals (3, 3); zeros if the triangle is flat."""
        corners = self._triangles[face]
        normals = self._normals[corners]
        return self._points[corners], normals * np.linalg.norm(normals, axis=1).all()

    @cached_property
    def _means(self) -> Array:
        """Unit normals of the points, weighted by area (n, 3)."""
        return mean_normals(self._points, self._triangles, np.arange(len(self._points)))

    @cached_property
    def _normals(self) -> Array:
        """The same, zero at points of sharp edges."""
        normals = self._means.copy()
        aligned = np.einsum("ka,kca->kc", self._flat.of_faces, normals[self._triangles])
        normals[self._triangles[~(aligned > _SHARP)]] = 0.0
        return normals
