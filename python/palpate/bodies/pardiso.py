"""MKL's PARDISO: a sparse Cholesky factor, or the dense matrix that is left of the last unknowns when the others go.

pypardiso finds and loads the library; what it offers has no Schur complement, does not tell beforehand what a factor
will take, and keeps the memory of every factor.
"""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

__all__ = ["Pardiso", "PardisoError"]

Array = NDArray[np.float64]
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1
_POSITIVE_DEFINITE = 2
_ERRORS = {-2: "not enough memory", -4: "a pivot is not positive", -7: "a diagonal number is not positive"}


class PardisoError(Exception):
    """PARDISO gave up."""


class Pardiso:
    """A symmetric positive definite matrix (N, N), ordered by nested dissection; raises ImportError without pypardiso.

    Only its upper triangle is read, and every diagonal number must be stored. With `kept`, the last so many unknowns
    are not factorised: `complement` is what is left of them.

    Attributes:
        memory: bytes that the factor, the orders and the work arrays will take at most.
        operations: floating-point operations of the factorisation.
    """

    def __init__(self, matrix: sparse.csr_matrix, kept: int = 0) -> None:
        from pypardiso import PyPardisoSolver

        self._call = PyPardisoSolver().libmkl.pardiso_64
        self._call.restype = None
        upper = sparse.triu(matrix, format="csr")
        upper.sort_indices()
        self._size, self._kept = upper.shape[0], kept
        self._numbers = np.asarray(upper.data, dtype=float)
        self._begin, self._columns = (np.asarray(a, dtype=np.int64) for a in (upper.indptr, upper.indices))
        self._handle = np.zeros(64, dtype=np.int64)
        self._order = np.zeros(self._size, dtype=np.int64)
        self._order[self._size - kept :] = 1  # which ones are kept
        options = self._options = np.zeros(64, dtype=np.int64)  # numbered from 0, as in MKL's reference for C
        options[0] = 1  # these options, not the defaults
        options[1] = 2  # nested dissection
        options[9] = 13
        options[17] = options[18] = -1  # count numbers and operations
        options[34] = 1  # rows and columns from 0
        options[35] = 1 if kept > 0 else 0  # the Schur complement, dense, at factorisation
        self._phase(_ANALYSE)
        self.memory = 1024.0 * float(max(options[14], options[15] + options[16]))
        self.operations = 1e6 * float(options[18])

    def factorise(self) -> None:
        """Factorise, for `solve`; raises PardisoError if the matrix is not positive definite."""
        self._phase(_FACTORISE)

    def solve(self, right: Array) -> Array:
        """Return the solution (N, k) of right sides (N, k), after `factorise`."""
        b = np.asfortranarray(right, dtype=float)
        x = np.empty_like(b, order="F")
        self._phase(_SOLVE, b, x)
        return x

    def complement(self) -> Array:
        """Return A22 - A21 A11^-1 A12 of the kept unknowns 2 and the others 1, and release all the rest."""
        found = np.zeros((self._kept, self._kept))
        self._phase(_FACTORISE, found, found)
        self.release()
        return found

    def release(self) -> None:
        """Give the memory of the factor back."""
        if self._handle.any():
            self._phase(_RELEASE)
            self._handle[:] = 0

    def __del__(self) -> None:
        if hasattr(self, "_handle"):
            self.release()

    def _phase(self, phase: int, b: Array | None = None, x: Array | None = None) -> None:
        def number(value: int) -> Any:
            return ctypes.byref(ctypes.c_int64(value))

        def address(array: NDArray[Any] | None) -> Any:
            return None if array is None else array.ctypes.data_as(ctypes.c_void_p)

        error = ctypes.c_int64(0)
        self._call(
            address(self._handle), number(1), number(1), number(_POSITIVE_DEFINITE), number(phase), number(self._size),
            address(self._numbers), address(self._begin), address(self._columns), address(self._order),
            number(1 if b is None else b.shape[1]), address(self._options), number(0), address(b), address(x),
            ctypes.byref(error),
        )  # fmt: skip
        if error.value != 0:
            raise PardisoError(_ERRORS.get(error.value, f"PARDISO's error {error.value}"))
