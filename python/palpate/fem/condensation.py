"""The compliance of a body's touchable surface, condensed from its volume.

C = B^T K^-1 B with the loads B of unit forces on the touchable vertices: how far each moves, on average over its hat,
under a unit force on each (Bro-Nielsen & Cotin 1996; James & Pai 1999). It is symmetric and positive definite, as K is.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, lapack

from palpate.fem.checks import positive
from palpate.fem.elements import Elements
from palpate.fem.errors import BodyError
from palpate.fem.multifrontal import MultifrontalSolver

__all__ = ["Condensation", "check_memory"]

_PROGRAM = 0.15e9  # bytes of the program itself with its libraries
_SHARE = 0.7  # of the speed of a dense product in double precision that fronts reach, half of them in single


def check_memory(vertices: int, working: float, budget: float | str) -> None:
    """Raise BodyError with a proposal if `working` bytes for a body of so many touchable vertices are over `budget`."""
    allowed = positive(budget, "byte", "memory")
    if working > allowed:
        raise BodyError(
            f"the build takes about {_bytes(working)}, over the budget of {_bytes(allowed)}; the compliance of "
            f"{vertices} vertices alone is {_bytes(36.0 * vertices**2)}: take a coarser mesh, a smaller part to touch, "
            "or give it more memory"
        )


class Condensation:
    """How a body's compliance will be found, and what that takes: known after the unknowns are ordered, before solving.

    Attributes:
        memory: bytes that the matrices, the fronts and the compliance take at most.
        operations: floating-point operations.
    """

    def __init__(self, elements: Elements) -> None:
        free = ~elements.held
        stiffness = elements.stiffness[elements.free][:, elements.free]
        self._fronts = MultifrontalSolver(stiffness, elements.load[free], elements.nodes[free])
        self._vertices = len(elements.touchable)
        self.operations = self._fronts.operations
        checked = 2 * 36.0 * self._vertices**2  # the compliance, and its factor
        self.memory = _PROGRAM + elements.memory + 20.0 * stiffness.nnz + max(self._fronts.memory, checked)

    def __str__(self) -> str:
        return (
            f"condensing to {self._vertices:,} vertices: {_bytes(self.memory)}, "
            f"{self.operations / 1e9:.3g} Gflop, about {self.operations / (_SHARE * _speed()):.2g} s"
        )

    def compliance(self) -> NDArray[np.float32]:
        """Return the compliance (3n, 3n), m/N, row 3 x touchable vertex + axis.

        Raises BodyError if the stiffness or the compliance is not positive definite, or rounding is felt.
        """
        found = self._fronts.compliance()
        if lapack.spotrf(found, lower=1, clean=False)[1] != 0:
            raise BodyError(
                "the compliance is not positive definite to rounding: the elements are too flat, mesh again; or the "
                "body hangs by too little, fix more of it"
            )
        return found


def _speed() -> float:
    """Floating-point operations a second of this machine now, by a dense product in double precision."""
    a = np.ones((1024, 1024), order="F")
    blas.dgemm(1.0, a, a)
    begin = time.perf_counter()
    blas.dgemm(1.0, a, a)
    return 2.0 * 1024.0**3 / (time.perf_counter() - begin)


def _bytes(number: float) -> str:
    return f"{number / 1e9:.3g} GB" if number >= 1e9 else f"{number / 1e6:.3g} MB"
