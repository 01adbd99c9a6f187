"""Shapes to touch: a ball, smooth or bumpy, a box, a plate of squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from benchmarks.ball import ball

__all__ = ["ball", "box"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def box(half: tuple[float, float, float], pieces: int) -> tuple[Array, Indices]:
    """A box with half sides `half`, each side pieces x pieces squares, closed and wound outward."""
    points, triangles = [], []
    line = np.linspace(-1.0, 1.0, pieces + 1)
    u, v = (a.ravel() for a in np.meshgrid(line, line, indexing="ij"))
    q = np.arange((pieces + 1) ** 2).reshape(pieces + 1, pieces + 1)
    a, b, c, d = (x.ravel() for x in (q[:-1, :-1], q[1:, :-1], q[1:, 1:], q[:-1, 1:]))
    squares = np.vstack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    for axis in range(3):
        for end in (-1.0, 1.0):
            side = np.empty((len(u), 3))
            side[:, axis], side[:, (axis + 1) % 3], side[:, (axis + 2) % 3] = end, u, v
            triangles.append((squares if end > 0 else squares[:, ::-1]) + len(u) * len(points))
            points.append(side)
    whole = np.vstack(points)
    _, first, same = np.unique(np.round(whole, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    return whole[first] * np.array(half), same.reshape(-1)[np.vstack(triangles)].astype(np.int64)
