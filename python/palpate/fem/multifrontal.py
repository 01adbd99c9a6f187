"""The compliance C = B^T K^-1 B by fronts: dense products only (multifrontal method, Duff & Reid 1983).

Eliminating a front's unknowns s leaves its neighbours r and the loads m on the body's surface with
    L L^T = K_ss,  X = [K_rs; B_s^T] L^-T,  K_rr -= X_r X_r^T,  B_r^T -= X_m X_r^T,  C += X_m X_m^T,
and what is left goes on to the front that it hangs on. Threads share the fronts that do not hang on each other; what
they leave is added in the same order whoever comes first. K's part is in double precision. The loads' part, three
fifths of the work, is in single precision: its errors are those of substitution with L, which is as well conditioned
as the square root of K. A few trial loads go through in double, and what energy they get from C is held against that.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from palpate import _core
from palpate.fem import dense
from palpate.fem.dissection import nested_dissection
from palpate.fem.errors import BodyError
from palpate.fem.factor import NOT_DEFINITE

__all__ = ["MultifrontalSolver"]

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Indices = NDArray[np.int64]
_TRIALS = 4
_ACCURACY = 1e-4


class _Front(NamedTuple):
    begin: int  # nodes begin to end of the order are eliminated here
    end: int
    children: tuple[int, ...]
    rest: Indices  # neighbours, by place in the order
    loads: Indices  # numbers of the loads on it and below it

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Unknowns of its own, of its neighbours and of the loads: s, r, m."""
        return 3 * (self.end - self.begin), 3 * len(self.rest), 3 * len(self.loads)


class ContributionBlock(NamedTuple):
    """What a front leaves to the one that it hangs on; columns in one piece, of square matrices the lower triangle."""

    stiffness: Array  # of the rest (3r, 3r), N/m
    load: Single  # (3m, 3r)
    compliance: Single  # of the loads, what comes from here and below (3m, 3m), m/N
    trial: Array  # (trials, 3r)
    energy: Array  # of the trials, what comes from here and below (trials, trials)


class _StoppedError(Exception):
    """Another thread has failed, or was interrupted."""


class MultifrontalSolver:
    """A stiffness (3N, 3N), N/m, and loads (N, n) of one axis; node by node, three axes each.

    Attributes:
        operations: floating-point operations of `compliance`.
        memory: bytes that it will take at most.
    """

    def __init__(self, stiffness: sparse.csr_matrix, loads: sparse.csr_matrix, places: Array) -> None:
        graph = stiffness[::3][:, ::3]
        graph.data = np.ones(len(graph.data), dtype=np.int8)
        self._order, plan = nested_dissection(graph, places)
        place = np.empty(len(self._order), dtype=np.int64)
        place[self._order] = np.arange(len(self._order))
        self._place, self._stiffness, self._loads = place, stiffness, loads.tocsr()[self._order]
        near = graph[self._order]
        self._fronts: list[_Front] = []
        for part in plan:
            begin, end, children = part.begin, part.end, part.children
            rest = [place[near.indices[near.indptr[begin] : near.indptr[end]]]]
            some = [self._loads.indices[self._loads.indptr[begin] : self._loads.indptr[end]]]
            rest += [self._fronts[c].rest for c in children]
            some += [self._fronts[c].loads for c in children]
            beyond = np.unique(np.concatenate(rest))
            self._fronts.append(_Front(begin, end, children, beyond[beyond >= end], np.unique(np.concatenate(some))))
        self._threads = dense.threads()
        self._failures: list[BaseException] = []
        self.operations = float(sum(_operations(*front.sizes) for front in self._fronts))
        self.memory = self._most(len(self._fronts) - 1, self._threads) + 12.0 * self._stiffness.nnz

    def compliance(self) -> Single:
        """Return C (3n, 3n), m/N, symmetric to the last bit.

        Raises BodyError if the stiffness is not positive definite, or C does not give trial loads their energy.
        """
        size = 3 * self._loads.shape[1]
        forces = np.random.default_rng(0).standard_normal((size, _TRIALS))
        self._trials: Array = (self._loads @ forces.reshape(-1, 3 * _TRIALS)).reshape(-1, _TRIALS)
        root = len(self._fronts) - 1
        self._failures.clear()
        try:
            with dense.one_thread():
                below = self._below(root, self._threads)
        except _StoppedError:
            raise self._failures[0] from None
        left = self._eliminate(self._fronts[root], below)
        found = left.compliance
        for i in range(0, size, 1024):
            for j in range(i + 1024, size, 1024):
                found[i : i + 1024, j : j + 1024] = found[j : j + 1024, i : i + 1024].T
            block = found[i : i + 1024, i : i + 1024]
            block[:] = np.tril(block) + np.tril(block, -1).T
        answers = found @ forces.astype(np.float32)
        worst = np.abs(forces.T @ answers - left.energy).max() / np.abs(left.energy).max()
        if not worst < _ACCURACY:
            raise BodyError(
                f"the compliance is wrong by {worst:.1g}, by rounding: the elements are too flat, mesh again; or the "
                "body hangs by too little, fix more of it"
            )
        return found.T

    def _below(self, number: int, threads: int) -> list[ContributionBlock]:
        """Eliminate all that hangs on a front; return what its children leave."""
        children = self._fronts[number].children
        if threads == 1 or len(children) != 2:
            return [self._tree(child, threads) for child in children]
        with ThreadPoolExecutor(1) as other:
            later = other.submit(self._tree, children[1], threads // 2)
            try:
                return [self._tree(children[0], threads - threads // 2), later.result()]
            except BaseException as problem:  # Ctrl-C too: every other thread stops at its next front
                self._failures.append(problem)
                raise

    def _tree(self, number: int, threads: int) -> ContributionBlock:
        """Eliminate a front and all that hangs on it."""
        below = self._below(number, threads)
        if self._failures:
            raise _StoppedError
        try:
            return self._eliminate(self._fronts[number], below)
        except BaseException as problem:
            self._failures.append(problem)
            raise

    def _most(self, number: int, threads: int) -> float:
        """Return the bytes that `_tree` takes at most."""
        front = self._fronts[number]
        left = [_bytes_left(*self._fronts[child].sizes) for child in front.children]
        own = sum(left) + _bytes_left(*front.sizes) + _bytes_inside(*front.sizes)
        if threads > 1 and len(left) == 2:
            first, second = front.children
            return max(own, self._most(first, threads - threads // 2) + self._most(second, threads // 2))
        return max([own, *(sum(left[:i]) + self._most(child, threads) for i, child in enumerate(front.children))])

    def _eliminate(self, front: _Front, below: list[ContributionBlock]) -> ContributionBlock:
        """Eliminate a front, given what its children leave, which is let go."""
        s, r, m = front.sizes
        own, beside, trial = (np.zeros(shape, order="F") for shape in ((s, s), (r, s), (_TRIALS, s)))
        across = np.zeros((m, s), dtype=np.float32, order="F")
        left = ContributionBlock(
            np.zeros((r, r), order="F"),
            np.zeros((m, r), np.float32, order="F"),
            np.zeros((m, m), np.float32, order="F"),
            np.zeros((_TRIALS, r), order="F"),
            np.zeros((_TRIALS, _TRIALS), order="F"),
        )
        self._assemble(front, own, beside, across, trial)
        for number, given in zip(front.children, below, strict=True):
            child = self._fronts[number]
            inside = child.rest < front.end
            cut = 3 * int(np.count_nonzero(inside))
            here = _axes(child.rest[inside] - front.begin)
            there = _axes(np.searchsorted(front.rest, child.rest[~inside]))
            rows = _axes(np.searchsorted(front.loads, child.loads))
            _core.scatter_add(own, given.stiffness[:cut, :cut], here, here, True)
            _core.scatter_add(beside, given.stiffness[cut:, :cut], there, here)
            _core.scatter_add(left.stiffness, given.stiffness[cut:, cut:], there, there, True)
            _core.scatter_add(across, given.load[:, :cut], rows, here)
            _core.scatter_add(left.load, given.load[:, cut:], rows, there)
            _core.scatter_add(left.compliance, given.compliance, rows, rows, True)
            trial[:, here] += given.trial[:, :cut]
            left.trial[:, there] += given.trial[:, cut:]
            left.energy[:] += given.energy
        below.clear()
        if not dense.cholesky(own):
            raise BodyError(NOT_DEFINITE)
        dense.solve_transposed(own, beside)
        dense.solve_transposed(own, trial)
        dense.subtract_square(left.stiffness, beside)
        left.trial[:] -= trial @ beside.T
        left.energy[:] += trial @ trial.T
        if m > 0:
            dense.solve_transposed(_single(own), across)
            dense.subtract_product(left.load, across, _single(beside))
            dense.add_square(left.compliance, across)
        return left

    def _assemble(self, front: _Front, own: Array, beside: Array, across: Single, trial: Array) -> None:
        """Put the stiffness and the loads of the front's own nodes in their places."""
        rows = self._stiffness[_axes(self._order[front.begin : front.end])]  # symmetric: the columns as well
        column = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
        node, axis = np.divmod(rows.indices, 3)
        at = self._place[node]
        inside, beyond = (at >= front.begin) & (at < front.end), at >= front.end
        own[3 * (at[inside] - front.begin) + axis[inside], column[inside]] = rows.data[inside]
        row = np.searchsorted(front.rest, at[beyond])
        beside[3 * row + axis[beyond], column[beyond]] = rows.data[beyond]
        loads = self._loads[front.begin : front.end].tocoo()
        row = np.searchsorted(front.loads, loads.col)
        for a in range(3):
            across[3 * row + a, 3 * loads.row + a] = loads.data
        trial[:] = self._trials[_axes(np.arange(front.begin, front.end))].T


def _single(array: Array) -> Single:
    return array.astype(np.float32, order="F")


def _axes(nodes: Indices) -> Indices:
    """Return the unknowns of nodes."""
    return (3 * np.asarray(nodes, dtype=np.int64)[:, None] + np.arange(3)).ravel()


def _operations(s: int, r: int, m: int) -> float:
    return s**3 / 3 + s**2 * (r + m) + s * (r + m) ** 2


def _bytes_inside(s: int, r: int, m: int) -> float:
    return 8.0 * s * (s + r) + 4.0 * s * (s + r + m)


def _bytes_left(_s: int, r: int, m: int) -> float:
    return 8.0 * r**2 + 4.0 * m * (m + r)
