"""Factorization of a large sparse symmetric positive definite matrix by the fastest library installed.

pypardiso loads MKL's PARDISO. Its own interface is for unsymmetric matrices and keeps the memory of every factor.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from palpate.arrays import Array
from palpate.fem.errors import BodyError

_ANALYZE, _FACTORIZE, _SOLVE, _RELEASE = 11, 22, 33, -1
_POSITIVE_DEFINITE = 2
_ERRORS = {-2: "not enough memory", -4: "a pivot is not positive", -7: "a diagonal number is not positive"}


@cache
def _library() -> Any:
    """Load the library once, which takes a second, with threads that do not spin between calls."""
    os.environ.setdefault("KMP_BLOCKTIME", "0")
    from pypardiso import PyPardisoSolver

    call = PyPardisoSolver().libmkl.pardiso_64
    call.restype = None
    return call


class PardisoError(Exception):
    """PARDISO returned an error."""


class Pardiso:
    """Symmetric positive definite matrix (N, N), ordered by nested dissection.

    Only the upper triangle is read, and every diagonal entry must be stored.

    Raises:
        ImportError: pypardiso is not installed.
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
        options[0] = 1  # use these options, not the defaults
        options[1] = 2  # nested dissection
        options[9] = 13  # pivots below 1e-13 are perturbed
        options[34] = 1  # row and column indices start at 0
        self._phase(_ANALYZE)

    def factorize(self) -> None:
        """Factorize the matrix for `solve`. Raise PardisoError if it is not positive definite."""
        self._phase(_FACTORIZE)

    def solve(self, right: Array) -> Array:
        """Return the solution (N, k) for right-hand sides (N, k), after `factorize`."""
        b = np.asfortranarray(right, dtype=float)
        x = np.empty_like(b, order="F")
        self._phase(_SOLVE, b, x)
        return x

    def release(self) -> None:
        """Free the memory of the factor."""
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


NOT_DEFINITE = "the stiffness is not positive definite: the body has a rigid-body motion; fix a larger part of it"


def installed() -> str:
    """Return the library that `Factor` uses: the first installed of "PARDISO", "CHOLMOD" and "SuperLU"."""
    for name, module in (("PARDISO", "pypardiso"), ("CHOLMOD", "sksparse.cholmod")):
        try:
            __import__(module)
        except ImportError:
            continue
        return name
    return "SuperLU"


class Factor:
    """Factorized matrix; `solve` takes right-hand sides (N, k).

    Args:
        matrix: symmetric positive definite (N, N).
        kind: "PARDISO", "CHOLMOD" or "SuperLU"; None selects the one of `installed`.

    Raises:
        BodyError: the matrix is not positive definite.
    """

    def __init__(self, matrix: sparse.csr_matrix, kind: str | None = None) -> None:
        self.kind = installed() if kind is None else kind
        self.solve: Callable[[Array], Array] = {
            "PARDISO": _pardiso,
            "CHOLMOD": _cholmod,
            "SuperLU": _superlu,
        }[self.kind](matrix)


def _pardiso(matrix: sparse.csr_matrix) -> Callable[[Array], Array]:
    factor = Pardiso(matrix)
    try:
        factor.factorize()
    except PardisoError as problem:
        raise BodyError(f"{NOT_DEFINITE} ({problem})") from problem
    return factor.solve


def _cholmod(matrix: sparse.csr_matrix) -> Callable[[Array], Array]:
    from sksparse.cholmod import CholmodError, cholesky

    try:
        factor = cholesky(matrix.tocsc(), ordering_method="metis")
        return lambda right: np.asarray(factor(right))
    except CholmodError as problem:
        raise BodyError(f"{NOT_DEFINITE} ({problem})") from problem


def _superlu(matrix: sparse.csr_matrix) -> Callable[[Array], Array]:
    from scipy.sparse.linalg import splu

    try:
        factor = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0
        )
    except RuntimeError as problem:
        raise BodyError(f"{NOT_DEFINITE} ({problem})") from problem
    return lambda right: np.asarray(factor.solve(right))
