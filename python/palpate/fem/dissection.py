"""Elimination order of the nodes of a body by nested dissection (George 1973).

A plane bisects the nodes. A minimum vertex separator of the two halves is eliminated last, and each half is ordered in
the same way. Nodes eliminated together are a front. Fronts form a tree: a front is coupled only to itself and to its
ancestors.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import maximum_bipartite_matching

from palpate.arrays import Array, Indices

_LEAF = 96  # nodes of a front that is not bisected any further
_LARGE = 4000  # nodes above which three planes are tried


@dataclass(frozen=True)
class Front:
    """Positions `begin` to `end` of the elimination order; `children` are the indices of its child fronts."""

    begin: int
    end: int
    children: tuple[int, ...]


def nested_dissection(graph: sparse.csr_matrix, points: Array) -> tuple[Indices, list[Front]]:
    """Return an elimination order of the nodes (N,), and its fronts in postorder, the root last.

    Args:
        graph: adjacency of the nodes (N, N), symmetric.
        points: positions of the nodes (N, 3), m.
    """
    order: list[Indices] = []
    fronts: list[Front] = []
    ordered = 0

    def add(nodes: Indices, children: tuple[int, ...]) -> int:
        nonlocal ordered
        order.append(nodes)
        fronts.append(Front(ordered, ordered + len(nodes), children))
        ordered += len(nodes)
        return len(fronts) - 1

    def dissect(nodes: Indices, graph: sparse.csr_matrix) -> int:
        if len(nodes) <= _LEAF:
            return add(nodes, ())
        side = _bisect(graph, points[nodes])
        children = []
        for k in (0, 1):
            part = np.flatnonzero(side == k)
            if len(part) > 0:
                children.append(dissect(nodes[part], graph[part][:, part]))
        return add(nodes[side == 2], tuple(children))

    dissect(np.arange(graph.shape[0]), graph)
    return np.concatenate(order), fronts


def _bisect(graph: sparse.csr_matrix, points: Array) -> NDArray[np.int8]:
    """Return 0 and 1 for the nodes of the halves and 2 for those of the separator."""
    count = len(points)
    centered = points - points.mean(axis=0)
    normals = np.linalg.eigh(centered.T @ centered)[1].T[::-1]  # longest extent first
    best, min_size = np.zeros(count, dtype=np.int8), count + 1
    for normal in normals if count > _LARGE else normals[:1]:
        side = np.zeros(count, dtype=np.int8)
        side[np.argsort(centered @ normal, kind="stable")[count // 2 :]] = 1
        side[_vertex_cover(graph, side)] = 2
        size = int(np.count_nonzero(side == 2))
        if size < min_size:
            best, min_size = side, size
    return best


def _vertex_cover(graph: sparse.csr_matrix, side: NDArray[np.int8]) -> Indices:
    """Return a minimum vertex cover of the edges between the sides, by a maximum matching (Koenig 1931)."""
    rows = np.repeat(np.arange(len(side)), np.diff(graph.indptr))
    cut = (side[rows] == 0) & (side[graph.indices] == 1)
    left, i = np.unique(rows[cut], return_inverse=True)
    right, j = np.unique(graph.indices[cut], return_inverse=True)
    between = sparse.csr_matrix((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(left), len(right)))
    match_of_right = maximum_bipartite_matching(between, perm_type="row")  # the left node of each right one, or -1
    visited_left = np.ones(len(left), dtype=bool)
    visited_left[match_of_right[match_of_right >= 0]] = False
    visited_right = np.zeros(len(right), dtype=bool)
    front = np.flatnonzero(visited_left)
    while len(front) > 0:  # alternating paths from the unmatched left nodes
        neighbors = np.unique(between[front].indices)
        neighbors = neighbors[~visited_right[neighbors]]
        visited_right[neighbors] = True
        front = match_of_right[neighbors]
        front = front[(front >= 0) & ~visited_left[front]]
        visited_left[front] = True
    return np.concatenate([left[~visited_left], right[visited_right]])
