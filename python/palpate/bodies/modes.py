"""Vibration modes of a fixed body, as its touchable surface sees them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, eigsh

from palpate.bodies.elements import Elements
from palpate.bodies.errors import BodyError
from palpate.bodies.factor import Factor

__all__ = ["modes"]

Array = NDArray[np.float64]


def modes(elements: Elements, count: int) -> tuple[Array, NDArray[np.float32]]:
    """Return the `count` lowest frequencies (m,), rad/s, and the shapes (3n, m), 1/sqrt(kg), of unit modal mass.

    By shift and invert around zero (ARPACK) with a factor of the stiffness; the consistent mass.
    """
    if not 0 < count < len(elements.free) - 1:
        raise BodyError(f"a body of {len(elements.free)} unknowns has fewer than {count} modes to ask for")
    stiffness = elements.stiffness[elements.free][:, elements.free]
    factor = Factor(stiffness)
    mass = elements.mass[elements.free][:, elements.free]
    inverse = LinearOperator(stiffness.shape, matvec=lambda v: factor.solve(v.reshape(-1, 1)).ravel(), dtype=float)
    start = np.ones(len(elements.free))  # the same answer each time
    squares, shapes = eigsh(stiffness, count, mass, sigma=0.0, OPinv=inverse, v0=start)
    load = sparse.kron(elements.load, sparse.eye(3), format="csr")[elements.free]
    order = np.argsort(squares)
    return np.sqrt(squares[order]), (load.T @ shapes[:, order]).astype(np.float32)
