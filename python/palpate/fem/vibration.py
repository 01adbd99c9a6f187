"""Vibration modes of a fixed body at its contact nodes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy import sparse
from scipy.linalg import eigh

from palpate.arrays import Array, Single
from palpate.fem.elements import Elements
from palpate.fem.errors import BodyError
from palpate.fem.factor import Factor

_BLOCK = 12  # right-hand sides solved at once
_TOLERANCE = 1e-6  # on the residual of an eigenvalue, relative


def modes(elements: Elements, count: int) -> tuple[Array, Single]:
    """Return the `count` lowest frequencies (m,), rad/s, and the shapes (3n, m), 1/sqrt(kg), of unit modal mass.

    The method is shift-and-invert at zero (Ericsson & Ruhe 1980), with the consistent mass.

    Raises:
        BodyError: the body has fewer modes.
    """
    if not 0 < count < len(elements.free) - 1:
        raise BodyError(f"modes: a body of {len(elements.free)} unknowns has fewer than {count} modes; ask for fewer")
    factor = Factor(elements.stiffness[elements.free][:, elements.free])
    mass = elements.mass[elements.free][:, elements.free]
    inverse_squares, basis, vectors = _largest_eigenpairs(factor.solve, mass, count)
    load = sparse.kron(elements.load, sparse.eye(3), format="csr")[elements.free]
    return 1.0 / np.sqrt(inverse_squares), ((load.T @ basis) @ vectors).astype(np.float32)


def _largest_eigenpairs(
    solve: Callable[[Array], Array], mass: sparse.csr_matrix, count: int
) -> tuple[Array, Array, Array]:
    """Return the largest eigenvalues (m,) of K^-1 M, descending, a basis (N, p) and the eigenvectors in it (p, m).

    Block Lanczos method (Golub & Underwood 1977) with full reorthogonalization in M, done twice. The basis grows until
    the residual of every pair is 1e-6 of its eigenvalue. The start block is fixed, so the result is reproducible.
    """
    size = mass.shape[0]
    check = min(size, 2 * count + 2 * _BLOCK)
    storage = np.empty((size, min(size, check + _BLOCK)), order="F")
    projected = np.empty((0, 0))  # basis^T M K^-1 M basis
    block = np.random.default_rng(0).standard_normal((size, min(_BLOCK, size)))
    while True:
        before = len(projected)
        block = _orthonormalize(block, storage[:, :before], mass)
        added = block.shape[1]
        total = before + added
        if total > storage.shape[1]:
            storage = np.concatenate([storage, np.empty((size, max(count // 4, 2 * _BLOCK)))], axis=1).copy(order="F")
        storage[:, before:total] = block
        basis = storage[:, :total]
        block = solve(mass @ block)
        column = basis.T @ (mass @ block)
        projected = np.block([[projected, column[:before]], [column[:before].T, column[before:]]])
        block -= basis @ column
        if total < check and added > 0:
            continue
        values, vectors = eigh(projected, subset_by_index=(total - count, total - 1))
        tail = vectors[before:]
        squares = np.einsum("im,ij,jm->m", tail, block.T @ (mass @ block), tail, optimize=True)
        residuals = np.sqrt(np.maximum(squares, 0.0))
        if (residuals <= _TOLERANCE * values).all() or total == size or added == 0:
            return values[::-1], basis, vectors[:, ::-1]
        check = min(size, total + max(count // 4, _BLOCK))


def _orthonormalize(block: Array, basis: Array, mass: sparse.csr_matrix) -> Array:
    """Return an M-orthonormal basis of the part of `block` that is M-orthogonal to `basis`."""
    scale = np.sqrt(np.einsum("ij,ij->j", block, mass @ block))
    for _ in range(2):
        block = block - basis @ (basis.T @ (mass @ block))
        squares, rotation = np.linalg.eigh(block.T @ (mass @ block))
        kept = squares > (1e-12 * scale.max()) ** 2
        block = (block @ rotation[:, kept]) / np.sqrt(squares[kept])
        scale = np.ones(1)
    return block[:, : mass.shape[0] - basis.shape[1]]
