"""Memory and time of the vibration modes of a body, before they are computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

MAX_GROUPS: Final = 80  # of contact nodes whose loads give residual vectors
MAX_BASIS: Final = 3e8  # bytes of the residual vectors
BLOCK: Final = 12  # right-hand sides solved at once
_ENTRY: Final = 12.0  # bytes per number of the factor, with the fronts that are not yet eliminated: up to 9.7
_SOLVED: Final = 3.5e9  # numbers per second and right-hand side, with orthogonalization: 2.9e9 to 4.7e9
_FILL: Final = 36.0  # numbers of the factor per unknown^(4/3): 22 to 36 on bodies of 2,178 to 232,377 unknowns


@dataclass(frozen=True)
class ModesCost:
    """Cost of vibration modes.

    Attributes:
        count: of the modes.
        memory: bytes of the factor and of the bases.
        seconds: of the factorization and the solutions.
    """

    count: int
    memory: float
    seconds: float

    def __str__(self) -> str:
        return f"computing {self.count} modes: {self.memory / 1e9:.2g} GB, about {self.seconds:.2g} s"


def fill(unknowns: float) -> float:
    """Return the typical size of the factor of a body's stiffness, in numbers."""
    return float(_FILL * unknowns ** (4.0 / 3.0))


def groups(unknowns: float, contact_nodes: float) -> int:
    """Return the number of groups of contact nodes whose loads give residual vectors."""
    return int(min(contact_nodes, MAX_GROUPS, max(16, int(MAX_BASIS / (48 * unknowns)))))


def modes_cost(
    unknowns: float, contact_nodes: float, count: int, entries: float, factorization: float = 0.0
) -> ModesCost:
    """Return the cost of `count` modes.

    Args:
        unknowns: of the free nodes.
        contact_nodes: of the body.
        count: of the modes.
        entries: numbers in the Cholesky factor.
        factorization: its duration, s.
    """
    vectors, residual = 2 * count + 3 * BLOCK, 6 * groups(unknowns, contact_nodes)
    # The basis is copied as it grows. Residual vectors exist five times while they are made orthonormal.
    memory = _ENTRY * entries + 8.0 * unknowns * (2 * vectors + count + 5 * residual)
    return ModesCost(count, memory, factorization + (vectors + residual) * 2.0 * entries / _SOLVED)
