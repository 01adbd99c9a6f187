"""Stability criteria of a sampled loop: eigenvalues, Jury, Routh (bilinear map) and Lyapunov.

The criteria share no computation: Jury and Routh use the characteristic polynomial, Lyapunov a matrix equation.
"""

from palpate.stability.criteria.agreement import check_stability
from palpate.stability.criteria.lyapunov_equation import Lyapunov, lyapunov
from palpate.stability.criteria.polynomials import characteristic_polynomial, wall_polynomial
from palpate.stability.criteria.tables import Jury, Routh, jury, precise_tables, routh

__all__ = [
    "Jury",
    "Lyapunov",
    "Routh",
    "characteristic_polynomial",
    "check_stability",
    "jury",
    "lyapunov",
    "precise_tables",
    "routh",
    "wall_polynomial",
]
