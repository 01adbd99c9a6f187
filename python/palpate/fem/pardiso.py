"""MKL's PARDISO: a sparse Cholesky factor.

pypardiso finds and loads the library; what it offers is for matrices without symmetry, and keeps the memory of every
factor.
"""

from __future__ import annotations

import ctypes
import os
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

__all__ = ["Pardiso", "PardisoError"]

Array = NDArray[np.float64]
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1
_POSITIVE_DEFINITE = 2
_ERRORS = {-2: "not enough memory", -4: "a pivot is not positive", -7: "a diagonal number is not positive"}


@cache
def _library() -> Any:
    """Find the library once, which takes a second; its threads do not spin between calls, where others want to run."""
    os.environ.setdefault("KMP_BLOCKTIME", "0")
    from pypardiso import PyPardisoSolver

    call = PyPardisoSolver().libmkl.pardiso_64
    call.restype = None
    return call


class PardisoError(Exception):
    """PARDISO gave up."""


class Pardiso:
    """A symmetric positive definite matrix (N, N), ordered by nested dissection; raises ImportError without pypardiso.

    Only its upper triangle is read, and every diagonal number must be stored.
    """

    def __init__(self, matrix: sparse.csr_matrix) -> None:
        self._call = _library()
        upper = sparse.triu(matrix, format="csr")
        upper.sort_indices()
        self._size = upper.shape[0]
        self._numbers = np.asarray(upper.data, dtype=float)
        self._begin, self._columns = (np.asarray(a, dtype=np.int64) for a in (upper.indptr, upper.indices))
        self._handle = np.zeros(64, dtype=np.int64)
        self._order = np.zeros(self._size, dtype=np.int64)
        options = self._options = np.zeros(64, dtype=np.int64)  # numbered from 0, as in MKL's reference for C
        options[0] = 1  # these options, not the defaults
        options[1] = 2  # nested dissection
        options[9] = 13
        options[34] = 1  # rows and columns from 0
        self._phase(_ANALYSE)

    def factorise(self) -> None:
        """Factorise, for `solve`; raises PardisoError if the matrix is not positive definite."""
        self._phase(_FACTORISE)

    def solve(self, right: Array) -> Array:
        """Return the solution (N, k) of right sides (N, k), after `factorise`."""
        b = np.asfortranarray(right, dtype=float)
        x = np.empty_like(b, order="F")
        self._phase(_SOLVE, b, x)
        return x

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
