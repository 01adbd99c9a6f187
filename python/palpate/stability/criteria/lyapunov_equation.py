"""Lyapunov certificate of a sampled loop, independent of its eigenvalues and of its polynomial."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import matrix_balance

from palpate.arrays import Array, Flags
from palpate.errors import StabilityError

__all__ = ["Lyapunov", "lyapunov"]


@dataclass(frozen=True)
class Lyapunov:
    """A matrix P with P - A^T P A = Q > 0; P > 0 certifies that x^T P x decays, hence that A is stable.

    Attributes:
        matrix: P (..., n, n), in the scale of the given states.
        stable: (...), whether P and P - A^T P A, recomputed from P, are both positive definite.
        decrease: (...), smallest eigenvalue of P - A^T P A in balanced states, where Q = I; 1 without rounding.
    """

    matrix: Array
    stable: Flags
    decrease: Array


def lyapunov(matrix: ArrayLike) -> Lyapunov:
    """Return the Lyapunov certificate of a loop x_{k+1} = A x_k, or of a stack (..., n, n).

    P - A^T P A = I is solved as a linear system in balanced states. The certificate is then verified: P and
    P - A^T P A, recomputed from P, must both be positive definite.

    Raises:
        StabilityError: the matrix is not square or not finite.
    """
    a = np.asarray(matrix, dtype=float)
    if a.ndim < 2 or a.shape[-1] != a.shape[-2] or not np.all(np.isfinite(a)):
        raise StabilityError("lyapunov: give a finite square matrix, or a stack of them")
    n = a.shape[-1]
    flat = a.reshape(-1, n, n)
    scales = np.array([np.diag(matrix_balance(matrix_k, permute=False)[1]) for matrix_k in flat])
    balanced = flat * scales[:, None, :] / scales[:, :, None]
    p = np.empty_like(flat)
    for start in range(0, len(flat), 1000):
        part = balanced[start : start + 1000]
        transposed = np.swapaxes(part, 1, 2)
        system = np.eye(n * n) - np.einsum("kij,klm->kiljm", transposed, transposed).reshape(-1, n * n, n * n)
        right = np.broadcast_to(np.eye(n).reshape(n * n, 1), (len(part), n * n, 1))
        p[start : start + 1000] = _solve(system, right).reshape(-1, n, n)
    p = 0.5 * (p + np.swapaxes(p, 1, 2))
    difference = p - np.swapaxes(balanced, 1, 2) @ p @ balanced
    finite = np.isfinite(p).all(axis=(1, 2)) & np.isfinite(difference).all(axis=(1, 2))
    safe_p, safe_difference = (np.where(finite[:, None, None], x, -np.eye(n)) for x in (p, difference))
    decrease = np.linalg.eigvalsh(0.5 * (safe_difference + np.swapaxes(safe_difference, 1, 2)))[:, 0]
    stable = finite & (np.linalg.eigvalsh(safe_p)[:, 0] > 0) & (decrease > 0)
    unscaled = p / scales[:, :, None] / scales[:, None, :]
    shape = a.shape[:-2]
    return Lyapunov(unscaled.reshape(a.shape), stable.reshape(shape), np.asarray(decrease.reshape(shape), float))


def _solve(system: Array, right: Array) -> Array:
    """Solve a stack of systems; the solution of a singular one (root on the circle) is nan."""
    try:
        return np.asarray(np.linalg.solve(system, right), dtype=float)
    except np.linalg.LinAlgError:
        out = np.full(right.shape, np.nan)
        for i, matrix in enumerate(system):
            if np.linalg.matrix_rank(matrix) == len(matrix):
                out[i] = np.linalg.solve(matrix, right[i])
        return out
