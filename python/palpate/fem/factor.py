"""Cholesky factor of a body's stiffness by the multifrontal method, for solutions with several right-hand sides."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import blas

from palpate.arrays import Array, Indices
from palpate.fem import dense

NOT_DEFINITE: Final = (
    "the stiffness is not positive definite: the body has a rigid-body motion; fix a larger part of it"
)


class FactorFront(NamedTuple):
    """Columns of the factor that a front eliminates: its s unknowns, and r coupled ones that are eliminated later."""

    begin: int  # of the unknowns in the elimination order
    neighbors: Indices  # in the elimination order (r,)
    diagonal: Array  # lower triangular (s, s), Fortran order
    coupling: Array  # (r, s), Fortran order

    @property
    def own(self) -> slice:
        """The unknowns eliminated here, in the elimination order."""
        return slice(self.begin, self.begin + len(self.diagonal))


class Factor:
    """Factor L of P K P^T = L L^T, with a permutation P.

    Args:
        order: the unknowns in the order of elimination (N,).
        fronts: in that order.
    """

    def __init__(self, order: Indices, fronts: list[FactorFront]) -> None:
        self._order, self._fronts = order, fronts

    def solve(self, right: Array) -> Array:
        """Return K^-1 times right-hand sides (N, k), by substitution front by front."""
        x = np.asarray(right, dtype=float)[self._order]
        with dense.one_thread():  # numpy and scipy have threads of their own, which would wait for each other
            for front in self._fronts:
                x[front.own] = blas.dtrsm(1.0, front.diagonal, x[front.own], lower=True)
                x[front.neighbors] -= front.coupling @ x[front.own]
            for front in reversed(self._fronts):
                rest = x[front.own] - front.coupling.T @ x[front.neighbors]
                x[front.own] = blas.dtrsm(1.0, front.diagonal, rest, lower=True, trans_a=True)
        solution = np.empty_like(x)
        solution[self._order] = x
        return solution
