"""Exact derivatives of trigonometric polynomials, which is what a jointed arm's geometry, inertia and energy are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def riesz_derivative(function: Callable[[Array], Array], at: Array, joint: int, degree: int = 2) -> Array:
    """Exact derivative along one joint of a trigonometric polynomial of at most this degree (M. Riesz).

    f'(x) = sum_k (-1)^(k+1) f(x + t_k) / (4 n sin^2(t_k / 2)), t_k = (2 k - 1) pi / (2 n): no truncation error.
    """
    total = 0.0
    for k in range(1, 2 * degree + 1):
        shift = (2 * k - 1) * np.pi / (2 * degree)
        moved = at.copy()
        moved[joint] += shift
        total = total + (-1) ** (k + 1) / (4 * degree * np.sin(shift / 2) ** 2) * function(moved)
    return np.asarray(total, dtype=float)
