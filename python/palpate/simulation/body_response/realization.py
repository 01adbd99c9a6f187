"""Realization of a measured impulse response by states (Ho & Kalman 1966), with a bound of its error.

For Markov parameters h_k = C A^(k-1) B the Hankel matrix H_ij = h_(i+j+1) has the rank of the system. With its singular
value decomposition U S V^T and the shifted matrix H'_ij = h_(i+j+2),

    A = S^(-1/2) U^T H' V S^(-1/2),   B = the first columns of S^(1/2) V^T,   C = the first rows of U S^(1/2).

Rows and columns may be any subset of the offsets i and j. They are dense at first and then sparse, so that fast and
slow motions are covered by one small matrix. The gain of the difference of two stable systems is at most the sum of the
magnitudes of the differences of their Markov parameters, entry by entry.
"""

from __future__ import annotations

import control
import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array

__all__ = ["realize"]

_DENSE, _SPARSE = 24, 40  # offsets in succession, and geometric ones after them
_ORDERS = (1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 18, 22, 26, 32, 40, 48, 64)
_BLOCK = 64  # powers of a that are multiplied at once
_ACCURATE = 1e-5  # error relative to the sum of the Markov parameters at which the order suffices


def realize(markov: Array, period: float) -> tuple[control.StateSpace, Array]:
    """Return a sampled system with the impulse response (n, outputs, inputs), and a bound of its error.

    The order is the least whose error is 1e-5 of the whole, or else at most 1.2 times the least error found.

    Args:
        markov: the response at ticks 0 to n - 1 to a unit impulse at tick 0. It has decayed at the end.
        period: s.

    Returns:
        The system, stable, and a bound of the gain of the difference (outputs, inputs), with the system's own response
        after the record.
    """
    outputs, inputs = markov.shape[1:]
    empty = np.zeros((0, 0)), np.zeros((0, inputs)), np.zeros((outputs, 0))
    left_out = np.abs(markov[1:]).sum(axis=0)
    whole = float((left_out + np.abs(markov[0])).max())
    found = [(left_out, empty)]
    if left_out.max() > 1e-9 * whole:
        offsets = _offsets((len(markov) - 3) // 2)
        hankel, shifted = (_hankel(markov, offsets, first) for first in (1, 2))
        left, values, right = np.linalg.svd(hankel, full_matrices=False)
        for order in _ORDERS:
            if order > len(values) or values[order - 1] <= 1e-13 * values[0]:
                break
            root = np.sqrt(values[:order])
            a = (left[:, :order] / root).T @ shifted @ (right[:order].T / root)
            b, c = root[:, None] * right[:order, :inputs], left[:outputs, :order] * root
            found.append((_error(markov, a, b, c), (a, b, c)))
            if found[-1][0].max() <= _ACCURATE * whole:
                break
    least = min(float(error.max()) for error, _ in found)
    error, system = next(one for one in found if one[0].max() <= max(1.2 * least, _ACCURATE * whole))
    return control.StateSpace(*system, markov[0], period), error


def _offsets(most: int) -> NDArray[np.int64]:
    """Return offsets from 0 to ``most``, dense at first."""
    dense = np.arange(min(_DENSE, most + 1))
    if most <= _DENSE:
        return dense
    return np.unique(np.concatenate([dense, np.rint(np.geomspace(_DENSE, most, _SPARSE)).astype(int)]))


def _hankel(markov: Array, offsets: NDArray[np.int64], first: int) -> Array:
    blocks = markov[offsets[:, None] + offsets[None, :] + first]  # rows, columns, outputs, inputs
    rows, columns, outputs, inputs = blocks.shape
    return np.asarray(blocks.transpose(0, 2, 1, 3).reshape(rows * outputs, columns * inputs))


def _error(markov: Array, a: Array, b: Array, c: Array) -> Array:
    """Return the sum of the magnitudes of the differences over the record and after it, by entry; inf: unstable.

    After the record the system's response counts as much as it differs from the record in its last quarter. It counts
    in full if it is larger than four times that quarter.
    """
    values, vectors = np.linalg.eig(a)
    if np.abs(values).max() >= 1.0:
        return np.full(markov.shape[1:], np.inf)
    answers, state = _impulse_response(a, b, c, len(markov) - 1)
    try:
        modes = np.linalg.solve(vectors, state.astype(complex))
    except np.linalg.LinAlgError:
        return np.full(markov.shape[1:], np.inf)
    after = np.abs(c @ vectors) / (1.0 - np.abs(values)) @ np.abs(modes)
    difference, size = np.abs(markov[1:] - answers), np.abs(markov[1:])
    last = slice(-(len(size) // 4) or None, None)
    level = max(float(size[last].sum()), 1e-300)
    doubt = min(4.0 * float(difference[last].sum()) / level, 1.0) if after.sum() <= 4.0 * level else 1.0
    return np.asarray(difference.sum(axis=0) + doubt * after, dtype=float)


def _impulse_response(a: Array, b: Array, c: Array, ticks: int) -> tuple[Array, Array]:
    """Return c a^k b for so many k from 0 on, and a^ticks b. Blocks of powers save calls."""
    block = np.empty((min(_BLOCK, ticks), *b.shape))
    state = b
    for k in range(len(block)):
        block[k] = state
        state = a @ state
    answers, power = np.empty((ticks, len(c), b.shape[1])), np.linalg.matrix_power(a, len(block))
    for begin in range(0, ticks, len(block)):
        answers[begin : begin + len(block)] = (c @ block)[: ticks - begin]
        last, block = block, power @ block
    used = (ticks - 1) % len(last)
    return answers, a @ last[used]
