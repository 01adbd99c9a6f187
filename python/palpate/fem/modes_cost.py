"""Memory and time of the vibration modes of a body, before they are computed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from palpate.fem.factor import installed

MAX_GROUPS: Final = 80  # of contact nodes whose loads give residual vectors
MAX_BASIS: Final = 3e8  # bytes of the residual vectors
BLOCK: Final = 12  # right-hand sides solved at once
# Bytes per entry of the Cholesky factor in the order of nested dissection. SuperLU keeps both triangles, and its own
# order fills more of larger matrices: 19 and 26 on balls of 22,554 and 66,135 unknowns.
_ENTRY: Final = {"SuperLU": 30.0, "CHOLMOD": 12.0, "PARDISO": 12.0}
_SPEED: Final = 0.05  # of SuperLU over that of a dense product, in multiplications of the Cholesky factor: 0.04 to 0.08
_SOLVED: Final = 1.5e9  # entries of two triangles per second in a solution by SuperLU: 1.5e9 to 2.8e9
_FILL: Final = 30.0  # entries of the factor per unknown^(4/3): 21 to 30 on bodies of 13,230 to 66,135 unknowns


@dataclass(frozen=True)
class ModesCost:
    """Cost of vibration modes.

    Attributes:
        count: of the modes.
        library: that factorizes the stiffness.
        memory: bytes of the factor and of the bases.
        seconds: of the factorization and the solutions; None where it is not known.
    """

    count: int
    library: str
    memory: float
    seconds: float | None

    def __str__(self) -> str:
        time = "" if self.seconds is None else f", about {self.seconds:.2g} s"
        return f"computing {self.count} modes: {self.memory / 1e9:.2g} GB{time} by {self.library}"

    @property
    def remedy(self) -> str:
        """What lowers the cost, beside a coarser mesh."""
        library = "the faster PARDISO (extra body), " if self.library == "SuperLU" else ""
        return f"fewer modes, {library}"


def fill(unknowns: float) -> float:
    """Return the typical number of entries of the factor of a body's stiffness."""
    return float(_FILL * unknowns ** (4.0 / 3.0))


def groups(unknowns: float, contact_nodes: float) -> int:
    """Return the number of groups of contact nodes whose loads give residual vectors."""
    return int(min(contact_nodes, MAX_GROUPS, max(16, int(MAX_BASIS / (48 * unknowns)))))


def modes_cost(
    unknowns: float, contact_nodes: float, count: int, entries: float, operations: float = 0.0, speed: float = 0.0
) -> ModesCost:
    """Return the cost of `count` modes.

    Args:
        unknowns: of the free nodes.
        contact_nodes: of the body.
        count: of the modes.
        entries: of the Cholesky factor.
        operations: multiplications that compute the factor.
        speed: floating-point operations per second of a dense product; 0: not known.
    """
    library = installed()
    vectors, residual = 2 * count + 3 * BLOCK, 6 * groups(unknowns, contact_nodes)
    # The basis is copied as it grows. Residual vectors exist four times while they are made orthonormal.
    memory = _ENTRY[library] * entries + 8.0 * unknowns * (2 * vectors + count + 4 * residual)
    seconds = None
    if library == "SuperLU" and speed > 0.0:
        seconds = operations / (_SPEED * speed) + (vectors + residual) * 2.0 * entries / _SOLVED
    return ModesCost(count, library, memory, seconds)
