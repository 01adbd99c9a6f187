"""An order in which to eliminate the nodes of a body, by nested dissection (George 1973).

A plane halves the nodes, the fewest nodes that part the halves come last, and so on in each half. What is eliminated
together is a front; fronts form a tree, and a front touches only itself and those on its way to the root.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import maximum_bipartite_matching

__all__ = ["Front", "nested_dissection"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_LEAF = 96  # nodes of a front that is not halved any more
_LARGE = 4000  # nodes for which several planes are tried


@dataclass(frozen=True)
class Front:
    """Places `begin` to `end` in the order; `children` are the numbers of the fronts that hang on it."""

    begin: int
    end: int
    children: tuple[int, ...]


def nested_dissection(graph: sparse.csr_matrix, places: Array) -> tuple[Indices, list[Front]]:
    """Return an order of the nodes (N,), and its fronts, children before parents, the root last.

    Args:
        graph: which nodes (N, N) are neighbours, symmetric.
        places: of the nodes (N, 3), m.
    """
    order: list[Indices] = []
    fronts: list[Front] = []
    done = 0

    def add(nodes: Indices, children: tuple[int, ...]) -> int:
        nonlocal done
        order.append(nodes)
        fronts.append(Front(done, done + len(nodes), children))
        done += len(nodes)
        return len(fronts) - 1

    def halve(nodes: Indices, graph: sparse.csr_matrix) -> int:
        if len(nodes) <= _LEAF:
            return add(nodes, ())
        side = _parts(graph, places[nodes])
        children = []
        for k in (0, 1):
            part = np.flatnonzero(side == k)
            if len(part) > 0:
                children.append(halve(nodes[part], graph[part][:, part]))
        return add(nodes[side == 2], tuple(children))

    halve(np.arange(graph.shape[0]), graph)
    return np.concatenate(order), fronts


def _parts(graph: sparse.csr_matrix, places: Array) -> NDArray[np.int8]:
    """Return 0 and 1 for the halves and 2 for the nodes that part them."""
    count = len(places)
    centred = places - places.mean(axis=0)
    across = np.linalg.eigh(centred.T @ centred)[1].T[::-1]  # longest first
    best, least = np.zeros(count, dtype=np.int8), count + 1
    for axis in across if count > _LARGE else across[:1]:
        side = np.zeros(count, dtype=np.int8)
        side[np.argsort(centred @ axis, kind="stable")[count // 2 :]] = 1
        side[_cover(graph, side)] = 2
        size = int(np.count_nonzero(side == 2))
        if size < least:
            best, least = side, size
    return best


def _cover(graph: sparse.csr_matrix, side: NDArray[np.int8]) -> Indices:
    """Return the fewest nodes that touch every edge between the sides, by the largest matching (Koenig 1931)."""
    rows = np.repeat(np.arange(len(side)), np.diff(graph.indptr))
    cut = (side[rows] == 0) & (side[graph.indices] == 1)
    left, i = np.unique(rows[cut], return_inverse=True)
    right, j = np.unique(graph.indices[cut], return_inverse=True)
    between = sparse.csr_matrix((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(left), len(right)))
    of_right = maximum_bipartite_matching(between, perm_type="row")  # the left node of each right one, or -1
    found = np.ones(len(left), dtype=bool)
    found[of_right[of_right >= 0]] = False
    reached = np.zeros(len(right), dtype=bool)
    new = np.flatnonzero(found)
    while len(new) > 0:  # alternating ways from the left nodes without a partner
        there = np.unique(between[new].indices)
        there = there[~reached[there]]
        reached[there] = True
        new = of_right[there]
        new = new[(new >= 0) & ~found[new]]
        found[new] = True
    return np.concatenate([left[~found], right[reached]])
