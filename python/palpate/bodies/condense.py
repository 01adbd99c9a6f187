"""The compliance of a body's touchable surface, condensed from its volume.

C = B^T K^-1 B with the loads B of unit forces on the touchable vertices: how far each moves, on average over its hat,
under a unit force on each (Bro-Nielsen & Cotin 1996; James & Pai 1999). It is symmetric and positive definite, as K is.

C is the Schur complement, with its sign turned, of K in [[K, B], [B^T, 0]]. PARDISO finds it as it factorises, dense
and without solving for any column, in a tenth of the time or less. Where it is not installed, columns are solved for.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack

from palpate.bodies.elements import Elements
from palpate.bodies.errors import BodyError
from palpate.bodies.factor import NOT_DEFINITE, Factor, installed
from palpate.bodies.numbers import number
from palpate.bodies.pardiso import Pardiso, PardisoError

__all__ = ["Condensation", "check_memory"]

_COLUMNS = 96  # right sides solved at once
_PROGRAM = 0.2e9  # bytes of the program itself with its libraries
_SHARE = 0.5  # of the speed of a dense product that a sparse factorisation reaches


def check_memory(vertices: int, working: float, budget: float | str) -> None:
    """Raise BodyError with a proposal if `working` bytes for a body of so many touchable vertices are over `budget`."""
    allowed = number(budget, "byte", "memory")
    if working > allowed:
        raise BodyError(
            f"the build takes about {_bytes(working)}, over the budget of {_bytes(allowed)}; the compliance of "
            f"{vertices} vertices alone is {_bytes(36.0 * vertices**2)}: take a coarser mesh, a smaller part to touch, "
            "or give it more memory"
        )


class Condensation:
    """How a body's compliance will be found, and what that takes: known after the unknowns are ordered, before solving.

    Attributes:
        memory: bytes that the matrices, the factor and the compliance take at most; an estimate without PARDISO.
        operations: floating-point operations; None without PARDISO, which alone tells.
    """

    def __init__(self, elements: Elements) -> None:
        stiffness = elements.stiffness[elements.free][:, elements.free]
        load = sparse.kron(elements.load, sparse.eye(3), format="csr")[elements.free]
        self.kind = installed()
        self.operations: float | None = None
        self._size = load.shape[1]
        self._pardiso: Pardiso | None = None
        self._rest: tuple[sparse.csr_matrix, sparse.csr_matrix] | None = None
        if self.kind == "PARDISO":
            nothing = sparse.csr_matrix((np.zeros(self._size), np.arange(self._size), np.arange(self._size + 1)))
            upper = sparse.bmat([[sparse.triu(stiffness), load], [None, nothing]], format="csr")
            self._pardiso = Pardiso(upper, kept=self._size)
            self.operations = self._pardiso.operations
            factor = self._pardiso.memory
        else:
            self._rest = stiffness, load
            factor = 8.0 * 20.0 * len(elements.free) ** (4 / 3)  # by nested dissection: 10 to 18 N^(4/3) numbers
        held = _PROGRAM + elements.memory + 20.0 * stiffness.nnz
        self.memory = held + max(factor + 8.0 * self._size**2, 12.0 * self._size**2)

    def __str__(self) -> str:
        text = f"condensing to {self._size // 3:,} vertices by {self.kind}: {_bytes(self.memory)}"
        if self.operations is not None:
            text += f", {self.operations / 1e9:.3g} Gflop, about {self.operations / (_SHARE * _speed()):.2g} s"
        return text

    def compliance(self) -> NDArray[np.float32]:
        """Return the compliance (3n, 3n), m/N, row 3 x touchable vertex + axis.

        Raises BodyError if the stiffness or the compliance is not positive definite, or not symmetric.
        """
        found = self._solved() if self._pardiso is None else self._complement(self._pardiso)
        _check(found)
        return found

    def _complement(self, pardiso: Pardiso) -> NDArray[np.float32]:
        try:
            found = pardiso.complement().astype(np.float32)
        except PardisoError as problem:
            raise BodyError(f"{NOT_DEFINITE} ({problem})") from problem
        return np.negative(found, out=found)

    def _solved(self) -> NDArray[np.float32]:
        assert self._rest is not None
        stiffness, load = self._rest
        factor = Factor(stiffness)
        found = np.empty((self._size, self._size), dtype=np.float32)
        columns, transposed = load.tocsc(), load.T.tocsr()
        for begin in range(0, self._size, _COLUMNS):
            some = slice(begin, min(begin + _COLUMNS, self._size))
            found[some] = (transposed @ factor.solve(columns[:, some].toarray())).T
        return found


def _check(compliance: NDArray[np.float32]) -> None:
    """Make the compliance symmetric to the last bit; refuse what is not symmetric and positive definite to rounding."""
    scale, worst = float(np.abs(compliance).max()), 0.0
    for i in range(0, len(compliance), 1024):
        for j in range(0, i + 1, 1024):
            a, b = compliance[i : i + 1024, j : j + 1024], compliance[j : j + 1024, i : i + 1024]
            worst = max(worst, float(np.abs(a - b.T).max()))
            mean = 0.5 * (a + b.T)
            a[:], b[:] = mean, mean.T
    if not np.isfinite(scale) or worst > 1e-4 * scale:
        raise BodyError("the compliance is not symmetric to rounding: the elements are too flat, mesh again")
    if lapack.spotrf(compliance.T, clean=False)[1] != 0:
        raise BodyError("the compliance is not positive definite to rounding: the elements are too flat, mesh again")


def _speed() -> float:
    """Floating-point operations a second of this machine now, by a dense product."""
    a = np.ones((1024, 1024))
    a @ a
    begin = time.perf_counter()
    a @ a
    return 2.0 * 1024.0**3 / (time.perf_counter() - begin)


def _bytes(number: float) -> str:
    return f"{number / 1e9:.3g} GB" if number >= 1e9 else f"{number / 1e6:.3g} MB"
