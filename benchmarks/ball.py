"""Triangle mesh of a sphere, smooth or with bumps."""

from __future__ import annotations

import numpy as np
from palpate.arrays import Array, Indices

__all__ = ["ball"]


def ball(pieces: int, radius: float = 0.5, bump: float = 0.0) -> tuple[Array, Indices]:
    """Return vertices (n, 3), m, and triangles (20 pieces^2, 3) of an icosahedron with edges in `pieces` parts.

    The vertices lie at radius (1 + bump sin 10x sin 10y sin 10z) along the unit direction (x, y, z), radius in m.
    """
    p = (1 + 5**0.5) / 2
    c = np.array([[-1, p, 0], [1, p, 0], [-1, -p, 0], [1, -p, 0]])
    c = np.vstack([c, np.roll(c, 1, axis=1), np.roll(c, 2, axis=1)])
    faces = np.fromstring(
        """0 11 5  0 5 1  0 1 7  0 7 10  0 10 11  1 5 9  5 11 4  11 10 2  10 7 6  7 1 8
        3 9 4  3 4 2  3 2 6  3 6 8  3 8 9  4 9 5  2 4 11  6 2 10  8 6 7  9 8 1""",
        dtype=int,
        sep=" ",
    ).reshape(20, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(pieces + 1), np.arange(pieces + 1), indexing="ij"))
    keep = i + j <= pieces
    i, j = i[keep], j[keep]
    number = np.full((pieces + 2, pieces + 2), -1)
    number[i, j] = np.arange(len(i))
    a, b = i[i + j < pieces], j[i + j < pieces]
    up = np.stack([number[a, b], number[a + 1, b], number[a, b + 1]], axis=1)
    a, b = i[i + j < pieces - 1], j[i + j < pieces - 1]
    down = np.stack([number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]], axis=1)
    local = np.vstack([up, down])
    weights = np.stack([pieces - i - j, i, j], axis=1) / pieces
    points = np.einsum("vk,fkx->fvx", weights, c[faces]).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    _, first, same = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    triangles = (local[None] + (np.arange(20) * len(i))[:, None, None]).reshape(-1, 3)
    unit = points[first]
    size = radius * (1.0 + bump * np.prod(np.sin(10.0 * unit), axis=1, keepdims=True))
    return size * unit, same.reshape(-1)[triangles].astype(np.int64)
