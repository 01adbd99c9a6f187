"""Compliance C = B^T K^-1 B by the multifrontal method (Duff & Reid 1983), with dense products only.

The elimination of a front's unknowns s updates its neighbors r and the loads m:
    L L^T = K_ss,  X = [K_rs; B_s^T] L^-T,  K_rr -= X_r X_r^T,  B_r^T -= X_m X_r^T,  C += X_m X_m^T.
The result is the contribution block that the parent front assembles.

Independent subtrees run in parallel threads. Contribution blocks are added in a fixed order, so the result is
reproducible. K is factorized in double precision. The loads, three fifths of the work, are in single precision: their
error is that of substitution with L, whose condition number is the square root of that of K. A few trial loads are
eliminated in double precision, and their energy checks C.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from copy import copy
from typing import NamedTuple

import numpy as np
from scipy import sparse

from palpate import _core
from palpate.arrays import Array, Indices, Single
from palpate.fem import dense
from palpate.fem.dissection import nested_dissection
from palpate.fem.errors import BodyError
from palpate.fem.factor import NOT_DEFINITE, Factor, FactorFront

_TRIALS = 4  # loads that check the compliance
_TOLERANCE = 1e-4  # on their energy, relative
_TILE = 1024  # rows and columns that are mirrored at a time


class _Front(NamedTuple):
    begin: int  # positions begin to end of the elimination order are eliminated here
    end: int
    children: tuple[int, ...]
    neighbors: Indices  # positions in the elimination order
    loads: Indices  # indices of the loads on this subtree

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Unknowns eliminated here, of the neighbors and of the loads: s, r, m."""
        return 3 * (self.end - self.begin), 3 * len(self.neighbors), 3 * len(self.loads)


class ContributionBlock(NamedTuple):
    """Contribution of a front to its parent. Fortran order; lower triangle of symmetric blocks."""

    stiffness: Array  # of the neighbors (3r, 3r), N/m
    load: Single  # (3m, 3r)
    compliance: Single  # of the loads, contribution of the subtree (3m, 3m), m/N
    trial: Array  # (trials, 3r)
    energy: Array  # of the trials, contribution of the subtree (trials, trials)


class _PivotBlock(NamedTuple):
    """Rows and columns that a front eliminates."""

    stiffness: Array  # (s, s)
    coupling: Array  # to the neighbors (r, s)
    load: Single  # (m, s)
    trial: Array  # (trials, s)


class _StoppedError(Exception):
    """Another thread has failed or was interrupted."""


class MultifrontalSolver:
    """Solver for a stiffness (3N, 3N), N/m, and for its compliance under the loads (N, n) of one axis.

    Unknowns are ordered by node, three axes each.

    Attributes:
        operations: floating-point operations of `compliance`.
        memory: upper bound of the bytes of `compliance`.
        factor_entries: numbers that `factor` keeps.
        factor_operations: floating-point operations of `factor`.
    """

    def __init__(self, stiffness: sparse.csr_matrix, loads: sparse.csr_matrix, points: Array) -> None:
        graph = _coupled_nodes(stiffness)
        self._order, tree = nested_dissection(graph, points)
        position = np.empty(len(self._order), dtype=np.int64)
        position[self._order] = np.arange(len(self._order))
        self._position, self._stiffness, self._loads = position, stiffness, loads.tocsr()[self._order]
        adjacency = graph[self._order]
        self._fronts: list[_Front] = []
        for node in tree:
            begin, end, children = node.begin, node.end, node.children
            coupled = [position[adjacency.indices[adjacency.indptr[begin] : adjacency.indptr[end]]]]
            loaded = [self._loads.indices[self._loads.indptr[begin] : self._loads.indptr[end]]]
            coupled += [self._fronts[c].neighbors for c in children]
            loaded += [self._fronts[c].loads for c in children]
            structure = np.unique(np.concatenate(coupled))
            neighbors = structure[structure >= end]
            self._fronts.append(_Front(begin, end, children, neighbors, np.unique(np.concatenate(loaded))))
        self._threads = dense.threads()
        self._failures: list[BaseException] = []
        self._kept: dict[int, FactorFront] | None = None  # by the index of the front
        self.operations = float(sum(_operations(*front.sizes) for front in self._fronts))
        sizes = [(3.0 * (front.end - front.begin), 3.0 * len(front.neighbors)) for front in self._fronts]
        self.factor_entries = sum(s * (s + r) for s, r in sizes)
        self.factor_operations = sum(s**3 / 3.0 + s * s * r + s * r * r for s, r in sizes)
        self.memory = self._peak_memory(len(self._fronts) - 1, self._threads) + 12.0 * self._stiffness.nnz

    def compliance(self) -> Single:
        """Return C (3n, 3n), m/N, exactly symmetric.

        Raises:
            BodyError: the stiffness is not positive definite, or the energy of a trial load is wrong.
        """
        forces = np.random.default_rng(0).standard_normal((3 * self._loads.shape[1], _TRIALS))
        result = self._eliminate_all((self._loads @ forces.reshape(-1, 3 * _TRIALS)).reshape(-1, _TRIALS))
        compliance = result.compliance
        _mirror(compliance)
        displacements = compliance @ forces.astype(np.float32)
        error = np.abs(forces.T @ displacements - result.energy).max() / np.abs(result.energy).max()
        if not error < _TOLERANCE:
            raise BodyError(
                f"the rounding error of the compliance is {error:.1g}: mesh again if elements are too flat, or fix a "
                "larger part of the body"
            )
        return compliance.T

    def factor(self) -> Factor:
        """Return the Cholesky factor of the stiffness.

        Raises:
            BodyError: the stiffness is not positive definite.
        """
        bare = copy(self)
        bare._loads = self._loads[:, :0]
        bare._fronts = [front._replace(loads=front.loads[:0]) for front in self._fronts]
        kept = bare._kept = {}
        bare._eliminate_all(np.empty((self._stiffness.shape[0], 0)))
        return Factor(_axes(self._order), [kept[index] for index in range(len(self._fronts))])

    def _eliminate_all(self, trials: Array) -> ContributionBlock:
        """Eliminate every front, with trial loads (3N, k) in the elimination order."""
        self._trials = trials
        root = len(self._fronts) - 1
        self._failures.clear()
        try:
            with dense.one_thread():
                blocks = self._eliminate_children(root, self._threads)
        except _StoppedError:
            raise self._failures[0] from None
        return self._eliminate(root, blocks)

    def _eliminate_children(self, index: int, threads: int) -> list[ContributionBlock]:
        """Eliminate the subtrees below a front, and return the contribution blocks of its children."""
        children = self._fronts[index].children
        if threads == 1 or len(children) != 2:
            return [self._eliminate_subtree(child, threads) for child in children]
        with ThreadPoolExecutor(1) as executor:
            second = executor.submit(self._eliminate_subtree, children[1], threads // 2)
            try:
                return [self._eliminate_subtree(children[0], threads - threads // 2), second.result()]
            except BaseException as problem:  # also Ctrl-C: every other thread stops at its next front
                self._failures.append(problem)
                raise

    def _eliminate_subtree(self, index: int, threads: int) -> ContributionBlock:
        """Eliminate a front and its descendants."""
        blocks = self._eliminate_children(index, threads)
        if self._failures:
            raise _StoppedError
        try:
            return self._eliminate(index, blocks)
        except BaseException as problem:
            self._failures.append(problem)
            raise

    def _peak_memory(self, index: int, threads: int) -> float:
        """Return an upper bound of the bytes of `_eliminate_subtree`."""
        front = self._fronts[index]
        blocks = [_contribution_bytes(*self._fronts[child].sizes) for child in front.children]
        own = sum(blocks) + _contribution_bytes(*front.sizes) + _pivot_bytes(*front.sizes)
        if threads > 1 and len(blocks) == 2:
            first, second = front.children
            return max(own, self._peak_memory(first, threads - threads // 2) + self._peak_memory(second, threads // 2))
        return max(
            [own, *(sum(blocks[:i]) + self._peak_memory(child, threads) for i, child in enumerate(front.children))]
        )

    def _eliminate(self, index: int, blocks: list[ContributionBlock]) -> ContributionBlock:
        """Return the contribution block of a front; clear the `blocks` of its children to free their memory."""
        front, trials = self._fronts[index], self._trials.shape[1]
        s, r, m = front.sizes
        pivot = _PivotBlock(
            np.zeros((s, s), order="F"),
            np.zeros((r, s), order="F"),
            np.zeros((m, s), np.float32, order="F"),
            np.zeros((trials, s), order="F"),
        )
        result = ContributionBlock(
            np.zeros((r, r), order="F"),
            np.zeros((m, r), np.float32, order="F"),
            np.zeros((m, m), np.float32, order="F"),
            np.zeros((trials, r), order="F"),
            np.zeros((trials, trials), order="F"),
        )
        self._assemble(front, pivot)
        for child, block in zip(front.children, blocks, strict=True):
            _extend_add(front, self._fronts[child], block, pivot, result)
        blocks.clear()
        if not dense.potrf(pivot.stiffness):
            raise BodyError(NOT_DEFINITE)
        dense.trsm(pivot.stiffness, pivot.coupling)
        if self._kept is not None:
            self._kept[index] = FactorFront(3 * front.begin, _axes(front.neighbors), pivot.stiffness, pivot.coupling)
        dense.trsm(pivot.stiffness, pivot.trial)
        dense.syrk(-1.0, pivot.coupling, result.stiffness)
        result.trial[:] -= pivot.trial @ pivot.coupling.T
        result.energy[:] += pivot.trial @ pivot.trial.T
        if m > 0:
            dense.trsm(_single(pivot.stiffness), pivot.load)
            dense.gemm(-1.0, pivot.load, _single(pivot.coupling), result.load)
            dense.syrk(1.0, pivot.load, result.compliance)
        return result

    def _assemble(self, front: _Front, pivot: _PivotBlock) -> None:
        """Assemble the stiffness and the loads of the nodes that a front eliminates."""
        rows = self._stiffness[_axes(self._order[front.begin : front.end])]  # also the columns, by symmetry
        column = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
        node, axis = np.divmod(rows.indices, 3)
        at = self._position[node]
        inside, outside = (at >= front.begin) & (at < front.end), at >= front.end
        pivot.stiffness[3 * (at[inside] - front.begin) + axis[inside], column[inside]] = rows.data[inside]
        row = np.searchsorted(front.neighbors, at[outside])
        pivot.coupling[3 * row + axis[outside], column[outside]] = rows.data[outside]
        loads = self._loads[front.begin : front.end].tocoo()
        row = np.searchsorted(front.loads, loads.col)
        for a in range(3):
            pivot.load[3 * row + a, 3 * loads.row + a] = loads.data
        pivot.trial[:] = self._trials[_axes(np.arange(front.begin, front.end))].T


def _coupled_nodes(stiffness: sparse.csr_matrix) -> sparse.csr_matrix:
    """Return which nodes (N, N) a stiffness couples: 1 where it has an entry of any two axes."""
    graph = stiffness[::3][:, ::3]
    if stiffness.nnz != 9 * graph.nnz:  # springs along an axis couple no others
        entries = stiffness.tocoo()
        ones = np.ones(len(entries.data), dtype=np.int8)
        graph = sparse.csr_matrix((ones, (entries.row // 3, entries.col // 3)), shape=graph.shape)
    graph.data = np.ones(len(graph.data), dtype=np.int8)
    return graph


def _extend_add(
    front: _Front, child: _Front, block: ContributionBlock, pivot: _PivotBlock, result: ContributionBlock
) -> None:
    """Add the contribution block of a child to the pivot and contribution block of its parent."""
    inside = child.neighbors < front.end
    split = 3 * int(np.count_nonzero(inside))
    own = _axes(child.neighbors[inside] - front.begin)
    outer = _axes(np.searchsorted(front.neighbors, child.neighbors[~inside]))
    rows = _axes(np.searchsorted(front.loads, child.loads))
    _core.scatter_add(pivot.stiffness, block.stiffness[:split, :split], own, own, True)
    _core.scatter_add(pivot.coupling, block.stiffness[split:, :split], outer, own)
    _core.scatter_add(result.stiffness, block.stiffness[split:, split:], outer, outer, True)
    _core.scatter_add(pivot.load, block.load[:, :split], rows, own)
    _core.scatter_add(result.load, block.load[:, split:], rows, outer)
    _core.scatter_add(result.compliance, block.compliance, rows, rows, True)
    pivot.trial[:, own] += block.trial[:, :split]
    result.trial[:, outer] += block.trial[:, split:]
    result.energy[:] += block.energy


def _mirror(matrix: Single) -> None:
    """Copy the lower triangle of a square matrix to its upper triangle."""
    size = len(matrix)
    for i in range(0, size, _TILE):
        for j in range(i + _TILE, size, _TILE):
            matrix[i : i + _TILE, j : j + _TILE] = matrix[j : j + _TILE, i : i + _TILE].T
        diagonal = matrix[i : i + _TILE, i : i + _TILE]
        diagonal[:] = np.tril(diagonal) + np.tril(diagonal, -1).T


def _single(array: Array) -> Single:
    return array.astype(np.float32, order="F")


def _axes(nodes: Indices) -> Indices:
    """Return the unknowns of nodes (n,), as (3n,)."""
    return (3 * np.asarray(nodes, dtype=np.int64)[:, None] + np.arange(3)).ravel()


def _operations(s: int, r: int, m: int) -> float:
    return s**3 / 3 + s**2 * (r + m) + s * (r + m) ** 2


def _pivot_bytes(s: int, r: int, m: int) -> float:
    return 8.0 * s * (s + r) + 4.0 * s * (s + r + m)


def _contribution_bytes(_s: int, r: int, m: int) -> float:
    return 8.0 * r**2 + 4.0 * m * (m + r)
