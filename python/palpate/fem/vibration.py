"""Vibration modes of a fixed body, as its touchable surface sees them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh

from palpate.fem.elements import Elements
from palpate.fem.errors import BodyError
from palpate.fem.factor import Factor

__all__ = ["modes"]

Array = NDArray[np.float64]

_BLOCK = 12  # right sides solved at once
_ACCURACY = 1e-6  # of an inverse square, by the residual


def modes(elements: Elements, count: int) -> tuple[Array, NDArray[np.float32]]:
    """Return the `count` lowest frequencies (m,), rad/s, and the shapes (3n, m), 1/sqrt(kg), of unit modal mass.

    By shift and invert around zero (Ericsson & Ruhe 1980) with a factor of the stiffness; the consistent mass.
    """
    if not 0 < count < len(elements.free) - 1:
        raise BodyError(f"modes: a body of {len(elements.free)} unknowns has fewer than {count} of them")
    factor = Factor(elements.stiffness[elements.free][:, elements.free])
    mass = elements.mass[elements.free][:, elements.free]
    squares, basis, shares = _softest(factor.solve, mass, count)
    load = sparse.kron(elements.load, sparse.eye(3), format="csr")[elements.free]
    return 1.0 / np.sqrt(squares), ((load.T @ basis) @ shares).astype(np.float32)


def _softest(solve: Callable[[Array], Array], mass: sparse.csr_matrix, count: int) -> tuple[Array, Array, Array]:
    """Return the largest eigenvalues (m,) of K^-1 M, falling, a basis (N, p) and the eigenvectors in it (p, m).

    Block Lanczos (Golub & Underwood 1977), each block made orthogonal in M to all before it, twice, in dense products;
    the basis grows until every pair's residual is 1e-6 of its eigenvalue. The same answer each time.
    """
    size = mass.shape[0]
    check = min(size, 2 * count + 2 * _BLOCK)
    room = np.empty((size, min(size, check + _BLOCK)), order="F")
    pressed = np.empty((0, 0))  # basis^T M K^-1 M basis
    block = np.random.default_rng(0).standard_normal((size, min(_BLOCK, size)))
    while True:
        before = len(pressed)
        block = _orthonormal(block, room[:, :before], mass)
        new = block.shape[1]
        done = before + new
        if done > room.shape[1]:
            room = np.concatenate([room, np.empty((size, max(count // 4, 2 * _BLOCK)))], axis=1).copy(order="F")
        room[:, before:done] = block
        basis = room[:, :done]
        block = solve(mass @ block)
        column = basis.T @ (mass @ block)
        pressed = np.block([[pressed, column[:before]], [column[:before].T, column[before:]]])
        block -= basis @ column
        if done < check and new > 0:
            continue
        values, shares = eigh(pressed, subset_by_index=(done - count, done - 1))
        left = shares[before:]
        wrong = np.sqrt(np.maximum(np.einsum("im,ij,jm->m", left, block.T @ (mass @ block), left, optimize=True), 0.0))
        if (wrong <= _ACCURACY * values).all() or done == size or new == 0:
            return values[::-1], basis, shares[:, ::-1]
        check = min(size, done + max(count // 4, _BLOCK))


def _orthonormal(block: Array, basis: Array, mass: sparse.csr_matrix) -> Array:
    """Return what is new in the block, orthonormal in M and to the basis."""
    scale = np.sqrt(np.einsum("ij,ij->j", block, mass @ block))
    for _ in range(2):
        block = block - basis @ (basis.T @ (mass @ block))
        squares, turn = np.linalg.eigh(block.T @ (mass @ block))
        new = squares > (1e-12 * scale.max()) ** 2
        block = (block @ turn[:, new]) / np.sqrt(squares[new])
        scale = np.ones(1)
    return block[:, : mass.shape[0] - basis.shape[1]]
