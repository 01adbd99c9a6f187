"""Vibration modes and residual vectors of a fixed body at its contact nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import eigh

from palpate.arrays import Array, Single
from palpate.fem.elements import Elements
from palpate.fem.errors import BodyError
from palpate.fem.factor import Factor
from palpate.fem.modes_cost import BLOCK, groups

_TOLERANCE = 1e-6  # on the residual of an eigenvalue, relative
_ROUNDING = 1e-13  # of products of vectors, relative to the largest one


class Modes(NamedTuple):
    """Vibration modes at n contact nodes, and residual vectors that complete them for contact forces.

    Shapes have unit modal mass and are orthogonal in mass and stiffness, residual vectors included.
    """

    frequencies: Array  # (m,), rad/s
    shapes: Single  # (3n, m), 1/sqrt(kg)
    residual_frequencies: Array  # of the residual vectors (r,), rad/s
    residual_shapes: Single  # (3n, r), 1/sqrt(kg)


def modes(elements: Elements, factor: Factor, count: int) -> Modes:
    """Return the `count` lowest modes and the residual vectors of the contact loads, with the factor of the stiffness.

    The method is shift-and-invert at zero (Ericsson & Ruhe 1980), with the consistent mass. The residual vectors span
    the static response to the contact loads and the response to its inertia, K^-1 B and K^-1 M K^-1 B, beyond the
    modes: residual attachment modes (Rubin 1975) with one more Krylov block (Wilson, Yuan & Dickens 1982). Without
    them a short contact, whose waves do not leave the neighborhood of the tip, converges slowly with the modes.

    Raises:
        BodyError: the body has fewer modes.
    """
    if not 0 < count < len(elements.free) - 1:
        raise BodyError(f"modes: a body of {len(elements.free)} unknowns has fewer than {count} modes; ask for fewer")
    stiffness = elements.stiffness[elements.free][:, elements.free]
    mass = elements.mass[elements.free][:, elements.free]
    inverse_squares, basis, vectors = _largest_eigenpairs(factor.solve, mass, count)
    lowest = basis @ vectors
    load = sparse.kron(elements.load, sparse.eye(3), format="csr")[elements.free]
    start = factor.solve(np.asarray((load @ _grouped_loads(elements)).todense()))
    krylov = np.hstack([start, factor.solve(mass @ start)])
    residual = _orthonormalize(krylov, lowest, mass)
    squares, rotation = eigh(residual.T @ (stiffness @ residual))
    return Modes(
        1.0 / np.sqrt(inverse_squares),
        (load.T @ lowest).astype(np.float32),
        np.sqrt(squares),
        ((load.T @ residual) @ rotation).astype(np.float32),
    )


def _grouped_loads(elements: Elements) -> sparse.csr_matrix:
    """Return the loads (3n, 3g) of g groups of neighboring contact nodes, in proportion to their areas.

    Every node is a group of its own up to 80 nodes, and as far as the residual vectors need less than 0.3 GB. The
    centers of larger groups are spread by farthest-point sampling.
    """
    points, areas = elements.nodes[elements.contact_nodes], elements.areas
    allowed = groups(len(elements.free), len(points))
    if len(points) <= allowed:
        return sparse.eye(3 * len(points), format="csr")
    distance = np.linalg.norm(points - points[0], axis=1)
    group = np.zeros(len(points), dtype=int)
    for center in range(1, allowed):
        farther = np.linalg.norm(points - points[np.argmax(distance)], axis=1)
        group[farther < distance] = center
        distance = np.minimum(distance, farther)
    weights = sparse.csr_matrix((areas, (np.arange(len(points)), group)), shape=(len(points), allowed))
    return sparse.kron(weights, sparse.eye(3), format="csr")


def _largest_eigenpairs(
    solve: Callable[[Array], Array], mass: sparse.csr_matrix, count: int
) -> tuple[Array, Array, Array]:
    """Return the largest eigenvalues (m,) of K^-1 M, descending, a basis (N, p) and the eigenvectors in it (p, m).

    Block Lanczos method (Golub & Underwood 1977) with full reorthogonalization in M, done twice. The basis grows until
    the residual of every pair is 1e-6 of its eigenvalue. The start block is fixed, so the result is reproducible.
    """
    size = mass.shape[0]
    check = min(size, 2 * count + 2 * BLOCK)
    storage = np.empty((size, min(size, check + BLOCK)), order="F")
    projected = np.empty((0, 0))  # basis^T M K^-1 M basis
    block = np.random.default_rng(0).standard_normal((size, min(BLOCK, size)))
    while True:
        before = len(projected)
        block = _orthonormalize(block, storage[:, :before], mass)
        added = block.shape[1]
        total = before + added
        if total > storage.shape[1]:
            storage = np.concatenate([storage, np.empty((size, max(count // 4, 2 * BLOCK)))], axis=1).copy(order="F")
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
        check = min(size, total + max(count // 4, BLOCK))


def _orthonormalize(block: Array, basis: Array, mass: sparse.csr_matrix) -> Array:
    """Return an M-orthonormal basis of the part of `block` that is M-orthogonal to `basis`.

    Directions that rounding cannot tell from those of the basis or of each other are dropped.
    """
    norm = np.sqrt(np.einsum("ij,ij->j", block, mass @ block))
    block = block / np.maximum(norm, np.finfo(float).tiny)
    for _ in range(2):
        block = block - basis @ (basis.T @ (mass @ block))
        squares, rotation = np.linalg.eigh(block.T @ (mass @ block))
        kept = squares > max(_ROUNDING * squares.max(initial=0.0), 1e-24)
        block = (block @ rotation[:, kept]) / np.sqrt(squares[kept])
    return block[:, max(0, basis.shape[1] + block.shape[1] - mass.shape[0]) :]
