"""Numerical derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from palpate.arrays import Array


def central(function: Callable[[Array], Array], x: Array, h: float = 1e-5) -> Array:
    """Jacobian of a vector function by Richardson's extrapolation of central differences, error O(h^4)."""
    columns = []
    for e in np.eye(len(x)):
        coarse = (function(x + 2 * h * e) - function(x - 2 * h * e)) / (4 * h)
        fine = (function(x + h * e) - function(x - h * e)) / (2 * h)
        columns.append((4 * fine - coarse) / 3)
    return np.array(columns).T
