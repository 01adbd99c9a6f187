"""Factorization of a large sparse symmetric positive definite matrix by the fastest library installed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse

from palpate.arrays import Array
from palpate.fem.errors import BodyError
from palpate.fem.pardiso import Pardiso, PardisoError

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
