"""Static condensation of a body's stiffness to the compliance of its contact nodes.

C = B^T K^-1 B with the nodal loads B of unit forces on the contact nodes (Bro-Nielsen & Cotin 1996; James & Pai 1999).
C gives the displacement of each contact node, averaged with its hat function, per force on each. It is symmetric and
positive definite, as K is.
"""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, lapack

from palpate.fem.checks import positive
from palpate.fem.elements import Elements
from palpate.fem.errors import BodyError
from palpate.fem.factor import Factor
from palpate.fem.modes_cost import ModesCost, modes_cost
from palpate.fem.multifrontal import MultifrontalSolver

_PROGRAM = 0.15e9  # bytes of the program and its libraries
_EFFICIENCY = 0.7  # speed of the factorization over that of a dense product in double precision


def check_memory(vertices: int, working: float, budget: float | str) -> None:
    """Raise BodyError if `working` bytes, for a body of `vertices` contact nodes, exceed `budget`."""
    allowed = positive(budget, "byte", "memory")
    if working > allowed:
        alone = bytes_text(36.0 * vertices**2)
        raise BodyError(
            f"memory: the build needs about {bytes_text(working)}, over the budget of {bytes_text(allowed)}; the "
            f"compliance of {vertices} nodes alone takes {alone}: use a coarser mesh, a smaller contact surface, or a "
            "larger budget"
        )


def check_memory_of_modes(cost: ModesCost, kept: float, budget: float | str) -> None:
    """Raise BodyError if the modes, with `kept` bytes of the elements and the compliance, exceed `budget`."""
    allowed, working = positive(budget, "byte", "memory"), _PROGRAM + kept + cost.memory
    if working > allowed:
        raise BodyError(
            f"memory: {cost.count} modes need about {bytes_text(working)}, over the budget of {bytes_text(allowed)}: "
            "use fewer modes, a coarser mesh, or a larger budget"
        )


class Condensation:
    """Plan of a condensation, with its cost before any factorization.

    Attributes:
        memory: upper bound of the bytes of matrices, fronts and compliance.
        operations: floating-point operations.
    """

    def __init__(self, elements: Elements) -> None:
        free = ~elements.dirichlet
        stiffness = elements.stiffness[elements.free][:, elements.free]
        self._solver = MultifrontalSolver(stiffness, elements.load[free], elements.nodes[free])
        self._vertices, self._unknowns = len(elements.contact_nodes), len(elements.free)
        self.operations = self._solver.operations
        check = 2 * 36.0 * self._vertices**2  # the compliance and its factor
        self.memory = _PROGRAM + elements.memory + 20.0 * stiffness.nnz + max(self._solver.memory, check)

    def modes_cost(self, count: int) -> ModesCost:
        """Return the cost of `count` vibration modes."""
        solver = self._solver
        return modes_cost(
            self._unknowns, self._vertices, count, solver.factor_entries, solver.factor_operations / sustained_speed()
        )

    def factor(self) -> Factor:
        """Return the factor of the stiffness of the free unknowns. Raise BodyError if it is not positive definite."""
        return self._solver.factor()

    def __str__(self) -> str:
        return (
            f"condensing to {self._vertices:,} contact nodes: {bytes_text(self.memory)}, "
            f"{self.operations / 1e9:.3g} Gflop, about {self.operations / sustained_speed():.2g} s"
        )

    def compliance(self) -> NDArray[np.float32]:
        """Return the compliance (3n, 3n), m/N, row 3 x contact node + axis.

        Raises:
            BodyError: the stiffness or the compliance is not positive definite, or the rounding error is too large.
        """
        compliance = self._solver.compliance()
        if lapack.spotrf(compliance, lower=1, clean=False)[1] != 0:
            raise BodyError(
                "the compliance is not positive definite to rounding: mesh again if elements are too flat, or fix a "
                "larger part of the body"
            )
        return compliance


def sustained_speed() -> float:
    """Return the floating-point operations per second of a factorization, from the time of a dense product."""
    a = np.ones((1024, 1024), order="F")
    blas.dgemm(1.0, a, a)
    begin = time.perf_counter()
    blas.dgemm(1.0, a, a)
    return _EFFICIENCY * 2.0 * 1024.0**3 / (time.perf_counter() - begin)


def bytes_text(number: float) -> str:
    """Return a number of bytes as text."""
    return f"{number / 1e9:.3g} GB" if number >= 1e9 else f"{number / 1e6:.3g} MB"
