"""Refinement of a tetrahedral mesh towards a region, by bisection of longest edges (Rivara 1984).

The longest edge of each tetrahedron that is too large is bisected, and with it the longest edges of its neighbors: no
tetrahedron has a bisected edge beside a longer one that is whole. Edges are compared by length, then by their
vertices, so both sides of a face are cut alike: the mesh stays conforming, and the same input gives the same bits.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from palpate.arrays import Array, Indices
from palpate.contact.simplices import boundary, half_edges
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.errors import BodyError
from palpate.fem.mesh_improvement import move

Size = Callable[[Array], Array]  # mean edge, m, that points (n, 3), m, should have (n,)

_CORNERS: Final = np.array(list(combinations(range(4), 2)))  # of the edges of a tetrahedron
_LONGEST: Final = 1.13  # longest edge of a tetrahedron over the mean edge, as in the lattice of isosurface stuffing
_ROUNDS: Final = 60  # each bisects the longest edges, so three of them halve a tetrahedron


def graded_size(places: Array, spacing: float, growth: float, largest: float) -> Size:
    """Return the mean edge that grows from `spacing`, m, by `growth` of the distance from `places` (p, 3), m.

    It does not exceed `largest`, m.
    """
    tree = cKDTree(places)
    return lambda points: np.minimum(spacing + growth * tree.query(points)[0], largest)


def refine(surface: ClosedSurface, points: Array, cells: Indices, size: Size, most: float) -> tuple[Array, Indices]:
    """Return points (n, 3), m, and tetrahedra (m, 4) whose edges are at most 1.13 of `size` where they are.

    New points of the boundary move onto `surface` where no tetrahedron gets a small angle.

    Raises:
        BodyError: there would be more than `most` tetrahedra.
    """
    for _ in range(_ROUNDS):
        edges, number, rank, length = _edges(points, cells)
        longest = np.take_along_axis(number, rank[number].argmax(axis=1)[:, None], axis=1)[:, 0]
        chosen = np.unique(longest)
        too_long = length[chosen] > _LONGEST * size(points[edges[chosen]].mean(axis=1))
        if not too_long.any():
            break
        marked = np.zeros(len(edges), dtype=bool)
        marked[chosen[too_long]] = True
        while True:  # a tetrahedron that is cut is cut across its longest edge first
            others = longest[marked[number].any(axis=1) & ~marked[longest]]
            if not len(others):
                break
            marked[others] = True
        on = _keys(np.sort(half_edges(boundary(cells)), axis=1), len(points))
        cut = np.flatnonzero(marked)
        outer = len(points) + np.flatnonzero(np.isin(_keys(edges[cut], len(points)), on))
        cells = _bisect(cells, edges[cut], rank[cut], len(points))
        if len(cells) > most:
            raise BodyError(
                f"growth: the graded mesh has more than {most:.1g} tetrahedra: use a larger spacing, a smaller touched "
                "region or a larger growth"
            )
        points = np.concatenate([points, points[edges[cut]].mean(axis=1)])
        target = points.copy()
        target[outer] = surface.nearest(points[outer])[0]
        points = move(points, target, cells)
    return points, cells


def _keys(edges: Indices, count: int) -> Indices:
    """Return a number for each edge (e, 2) between `count` vertices, the lower one first."""
    return np.asarray(edges[:, 0] * count + edges[:, 1])


def _edges(points: Array, cells: Indices) -> tuple[Indices, Indices, Indices, Array]:
    """Return the edges (e, 2), those of each tetrahedron (m, 6), and rank and length of each edge (e,)."""
    ends = np.sort(cells[:, _CORNERS], axis=2)
    keys, number = np.unique(_keys(ends.reshape(-1, 2), len(points)), return_inverse=True)
    edges = np.stack(np.divmod(keys, len(points)), axis=1)
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    rank = np.empty(len(edges), dtype=np.int64)
    rank[np.lexsort((keys, length))] = np.arange(len(edges))
    return edges, number.reshape(-1, 6), rank, length


def _bisect(cells: Indices, edges: Indices, rank: Indices, count: int) -> Indices:
    """Return the tetrahedra (m, 4) cut at the midpoints of edges (e, 2), which are the points from `count` on.

    A tetrahedron is cut across its edge of the highest rank (e,), then each half across its own.
    """
    keys = _keys(edges, count)  # ascending
    done = []
    while len(cells):
        ends = np.sort(cells[:, _CORNERS], axis=2)
        old = (ends < count).all(axis=2)  # an edge to a midpoint is whole
        own = np.where(old, ends[..., 0] * count + ends[..., 1], -1)
        at = np.minimum(np.searchsorted(keys, own), len(keys) - 1)
        order = np.where(keys[at] == own, rank[at], -1)
        which = order.argmax(axis=1)
        whole = order.max(axis=1) < 0
        done.append(cells[whole])
        cells, which, middle = cells[~whole], which[~whole], count + at[np.arange(len(at)), which][~whole]
        halves = []
        for end in range(2):
            half = cells.copy()
            half[np.arange(len(half)), _CORNERS[which, end]] = middle
            halves.append(half)
        cells = np.concatenate(halves)
    return np.concatenate(done)
