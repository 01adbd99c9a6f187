"""Sizes, memory and results of the multifrontal elimination, against plain counts and a dense inverse."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse
from palpate.fem import block, multifrontal
from palpate.fem.multifrontal import MultifrontalSolver, _contribution_bytes, _mirror, _pivot_bytes


def system(threads: int, monkeypatch: pytest.MonkeyPatch) -> tuple[MultifrontalSolver, np.ndarray, np.ndarray]:
    """Return a solver, the stiffness and the loads of a grid of springs with unequal axes."""
    monkeypatch.setattr("palpate.fem.dense.threads", lambda: threads)
    volume = block((0.09, 0.06, 0.05), 0.01)
    count = len(volume.points)
    pairs = np.concatenate([volume.tetrahedra[:, [a, b]] for a in range(4) for b in range(a)])
    graph = np.zeros((count, count))
    graph[pairs[:, 0], pairs[:, 1]] = graph[pairs[:, 1], pairs[:, 0]] = -1.0
    graph += np.diag(0.5 - graph.sum(axis=1))
    stiffness = np.kron(graph, np.array([[3.0, 0.5, 0.2], [0.5, 2.0, -0.3], [0.2, -0.3, 4.0]]))
    loads = np.zeros((count, 7))
    loads[np.arange(0, 70, 10), np.arange(7)] = np.linspace(1.0, 2.0, 7)
    loads[np.arange(5, 75, 10), np.arange(7)] = 0.5
    solver = MultifrontalSolver(scipy.sparse.csr_matrix(stiffness), scipy.sparse.csr_matrix(loads), volume.points)
    return solver, stiffness, loads


@pytest.mark.parametrize("threads", [1, 2, 3])
def test_the_compliance_is_that_of_the_inverse(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    solver, stiffness, loads = system(threads, monkeypatch)
    each = np.kron(loads, np.eye(3))
    found = solver.compliance()
    np.testing.assert_allclose(found, each.T @ np.linalg.solve(stiffness, each), rtol=1e-4, atol=1e-6 * found.max())
    np.testing.assert_array_equal(found, found.T)


def test_springs_along_the_axes_couple_the_nodes_between_which_they_act(monkeypatch: pytest.MonkeyPatch) -> None:
    """Such a spring has entries of one axis only: the nodes across it must be coupled too."""
    monkeypatch.setattr("palpate.fem.dense.threads", lambda: 1)
    volume = block((0.09, 0.06, 0.05), 0.01)
    count = len(volume.points)
    pairs = np.unique(
        np.sort(np.concatenate([volume.tetrahedra[:, [a, b]] for a in range(4) for b in range(a)])), axis=0
    )
    stiffness = 0.5 * np.eye(3 * count)
    for i, j in pairs:
        along = volume.points[j] - volume.points[i]
        along[np.abs(along) < 1e-9] = 0.0
        at = np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
        stretch = np.concatenate([-along, along])
        stiffness[np.ix_(at, at)] += 100.0 * np.outer(stretch, stretch) / (along @ along)
    sparse = scipy.sparse.csr_matrix(stiffness)
    assert sparse.nnz < 9 * np.count_nonzero(np.abs(stiffness).reshape(count, 3, count, 3).sum(axis=(1, 3)))
    loads = np.zeros((count, 4))
    loads[np.arange(3, 43, 10), np.arange(4)] = 1.0
    each = np.kron(loads, np.eye(3))
    found = MultifrontalSolver(sparse, scipy.sparse.csr_matrix(loads), volume.points).compliance()
    np.testing.assert_allclose(found, each.T @ np.linalg.solve(stiffness, each), rtol=1e-4, atol=1e-6 * found.max())


def test_the_fronts_hold_the_factor_and_its_operations(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eliminating s unknowns of n takes as many operations as the volume between two cubes: (n^3 - (n - s)^3) / 3."""
    solver, stiffness, _ = system(1, monkeypatch)
    near = {i: set(np.flatnonzero(row).tolist()) for i, row in enumerate(stiffness[::3, ::3])}
    order = solver._order.tolist()
    entries = factor = all_of = 0.0
    for front in solver._fronts:
        own = set(order[front.begin : front.end])
        outside = set[int]().union(*(near[i] for i in own)) - own - set(order[: front.begin])
        for i in outside:
            near[i] |= outside
        s, r, m = 3.0 * len(own), 3.0 * len(outside), 3.0 * len(front.loads)
        assert sorted(outside) == sorted(order[i] for i in front.neighbors)
        entries += s * (s + r)  # full squares
        factor += ((s + r) ** 3 - r**3) / 3
        all_of += ((s + r + m) ** 3 - (r + m) ** 3) / 3
    assert solver.factor_entries == pytest.approx(entries)
    assert solver.factor_operations == pytest.approx(factor)
    assert solver.operations == pytest.approx(all_of)


def test_one_thread_needs_the_blocks_that_wait_and_the_front_at_work(monkeypatch: pytest.MonkeyPatch) -> None:
    solver, stiffness, _ = system(1, monkeypatch)
    waiting = peak = 0.0
    for front in solver._fronts:
        made = _contribution_bytes(*front.sizes)
        peak = max(peak, waiting + made + _pivot_bytes(*front.sizes))
        waiting += made - sum(_contribution_bytes(*solver._fronts[child].sizes) for child in front.children)
    assert solver.memory == pytest.approx(peak + 12.0 * np.count_nonzero(stiffness))


@pytest.mark.parametrize("size", [1, 4, 5, 11])
def test_the_lower_triangle_is_copied_in_tiles(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(multifrontal, "_TILE", 4)
    matrix = np.random.default_rng(1).normal(size=(size, size)).astype(np.float32)
    whole = np.tril(matrix) + np.tril(matrix, -1).T
    _mirror(matrix)
    np.testing.assert_array_equal(matrix, whole)
