"""Four independent stability criteria applied to one sampled loop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from palpate.stability.criteria.lyapunov_equation import lyapunov
from palpate.stability.criteria.tables import precise_tables

__all__ = ["check_stability"]


def check_stability(matrix: NDArray[np.float64]) -> tuple[float, dict[str, bool]]:
    """Return the spectral radius of A (n, n), and whether each criterion finds the loop x_{k+1} = A x_k stable."""
    radius = float(np.abs(np.linalg.eigvals(matrix)).max())
    by_jury, by_routh = precise_tables(matrix)
    return radius, {
        "eigenvalues": radius < 1,
        "Jury": by_jury,
        "Routh": by_routh,
        "Lyapunov": bool(lyapunov(matrix).stable),
    }
