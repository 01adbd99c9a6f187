"""The compliance C = B^T K^-1 B by fronts: dense products only (multifrontal method, Duff & Reid 1983).

Eliminating a front's unknowns s leaves its neighbours r and the loads m on the body's surface with
    L L^T = K_ss,  X = [K_rs; B_s^T] L^-T,  K_rr -= X_r X_r^T,  B_r^T -= X_m X_r^T,  C += X_m X_m^T,
and what is left goes on to the front that it hangs on. K's part is in double precision. The loads' part, three fifths
of the work, is in single precision: its errors are those of substitution with L, which is as well conditioned as the
square root of K. A few trial loads go through in double, and what energy they get from C is held against that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import blas, lapack

from palpate import _core
from palpate.bodies.dissection import dissect
from palpate.bodies.errors import BodyError
from palpate.bodies.factor import NOT_DEFINITE

__all__ = ["Fronts"]

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


class _Left(NamedTuple):
    """What a front leaves to the one that it hangs on; columns in one piece."""

    stiffness: Array  # of the rest (3r, 3r), lower triangle, N/m
    load: Single  # (3m, 3r)
    trial: Array  # (trials, 3r)


class Fronts:
    """A stiffness (3N, 3N), N/m, and loads (N, n) of one axis; node by node, three axes each.

    Attributes:
        operations: floating-point operations of `compliance`.
        memory: bytes that it will take at most.
    """

    def __init__(self, stiffness: sparse.csr_matrix, loads: sparse.csr_matrix, places: Array) -> None:
        graph = stiffness[::3][:, ::3]
        graph.data = np.ones(len(graph.data), dtype=np.int8)
        self._order, plan = dissect(graph, places)
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
        self._count()

    def _count(self) -> None:
        self.operations, waiting, most = 0.0, 0.0, 0.0
        for front in self._fronts:
            s, r, m = 3.0 * (front.end - front.begin), 3.0 * len(front.rest), 3.0 * len(front.loads)
            self.operations += s**3 / 3 + s**2 * (r + m) + s * (r + m) ** 2
            most = max(most, waiting + 8.0 * (s**2 + s * r + r**2) + 4.0 * (s**2 + s * (r + m) + m * r + m**2))
            waiting += 8.0 * r**2 + 4.0 * m * r
            for child in front.children:
                r, m = 3.0 * len(self._fronts[child].rest), 3.0 * len(self._fronts[child].loads)
                waiting -= 8.0 * r**2 + 4.0 * m * r
        self.memory = most + 4.0 * (3.0 * self._loads.shape[1]) ** 2 + 12.0 * self._stiffness.nnz

    def compliance(self) -> Single:
        """Return C (3n, 3n), m/N, symmetric to the last bit.

        Raises BodyError if the stiffness is not positive definite, or C does not give trial loads their energy.
        """
        size = 3 * self._loads.shape[1]
        found = np.zeros((size, size), dtype=np.float32, order="F")
        forces = np.random.default_rng(0).standard_normal((size, _TRIALS))
        self._trials: Array = (self._loads @ forces.reshape(-1, 3 * _TRIALS)).reshape(-1, _TRIALS)
        self._squares = np.zeros((_TRIALS, _TRIALS))
        left: dict[int, _Left] = {}
        for number, front in enumerate(self._fronts):
            left[number] = self._eliminate(front, [(self._fronts[c], left.pop(c)) for c in front.children], found)
        for i in range(0, size, 1024):
            for j in range(i + 1024, size, 1024):
                found[i : i + 1024, j : j + 1024] = found[j : j + 1024, i : i + 1024].T
            block = found[i : i + 1024, i : i + 1024]
            block[:] = np.tril(block) + np.tril(block, -1).T
        worst = np.abs(forces.T @ (found @ forces) - self._squares).max() / np.abs(self._squares).max()
        if not worst < _ACCURACY:
            raise BodyError(
                f"the compliance is wrong by {worst:.1g}, by rounding: the elements are too flat, mesh again"
            )
        return found.T

    def _eliminate(self, front: _Front, below: list[tuple[_Front, _Left]], found: NDArray[np.float32]) -> _Left:
        s, r, m = 3 * (front.end - front.begin), 3 * len(front.rest), 3 * len(front.loads)
        own, beside, trial = (np.zeros(shape, order="F") for shape in ((s, s), (r, s), (_TRIALS, s)))
        across = np.zeros((m, s), dtype=np.float32, order="F")
        left = _Left(
            np.zeros((r, r), order="F"), np.zeros((m, r), np.float32, order="F"), np.zeros((_TRIALS, r), order="F")
        )
        self._assemble(front, own, beside, across, trial)
        for child, given in below:
            inside = child.rest < front.end
            cut = 3 * int(np.count_nonzero(inside))
            here = _axes(child.rest[inside] - front.begin)
            there = _axes(np.searchsorted(front.rest, child.rest[~inside]))
            rows = _axes(np.searchsorted(front.loads, child.loads))
            _core.add_at(own, given.stiffness[:cut, :cut], here, here, True)
            _core.add_at(beside, given.stiffness[cut:, :cut], there, here)
            _core.add_at(left.stiffness, given.stiffness[cut:, cut:], there, there, True)
            _core.add_at(across, given.load[:, :cut], rows, here)
            _core.add_at(left.load, given.load[:, cut:], rows, there)
            trial[:, here] += given.trial[:, :cut]
            left.trial[:, there] += given.trial[:, cut:]
        factor, wrong = lapack.dpotrf(own, lower=1, clean=0, overwrite_a=1)
        if wrong != 0:
            raise BodyError(NOT_DEFINITE)
        trial = blas.dtrsm(1.0, factor, trial, side=1, lower=1, trans_a=1, overwrite_b=1)
        self._squares += trial @ trial.T
        if r > 0:
            beside = blas.dtrsm(1.0, factor, beside, side=1, lower=1, trans_a=1, overwrite_b=1)
            blas.dsyrk(-1.0, beside, beta=1.0, c=left.stiffness, lower=1, overwrite_c=1)
            left.trial[:] -= trial @ beside.T
        if m > 0:
            across = blas.strsm(1.0, _single(factor), across, side=1, lower=1, trans_a=1, overwrite_b=1)
            if r > 0:
                blas.sgemm(-1.0, across, _single(beside), beta=1.0, c=left.load, trans_b=1, overwrite_c=1)
            at = _axes(front.loads)
            _core.add_at(found, blas.ssyrk(1.0, across, lower=1), at, at, True)
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
