"""Impulse response of a body that relaxes, from displacements of the tip that last.

The response to a lasting displacement falls from the instantaneous to the static stiffness, without oscillations. Each
displacement leaves a constant in the force, of the contact's iterations. In an impulse response the sum of that
constant over a slow relaxation is as large as the response; in the response to a lasting displacement it is a constant.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from palpate.arrays import Array
from palpate.simulation.body_response.held_tip import HeldTip

__all__ = ["relaxation_record"]

_RELAXED = 12.0  # time constants of the record: 6e-6 of the relaxation is left
_SHORTEST, _LONGEST = 256, 16384  # ticks of the record
_DENSE, _RATIO = 8, 1.15  # ticks that are all nodes of the interpolation, and the ratio of later nodes
_LATER = 0.01  # share of the logarithm in the scale, on which late times differ
_SIGNS = np.array([1.0, -1.0, -1.0, 1.0])  # of the steps: forth, return, back, return; they cancel a slow drift


def relaxation_record(held: HeldTip, step: float) -> tuple[Array, Array, Array]:
    """Return the impulse response (n, r, r), its odd part and the gain of what it leaves out (r, r), N/m.

    Args:
        held: the body and its tip or tips, with a `relaxation`.
        step: displacement of the tip, m.
    """
    ticks = int(np.clip(math.ceil(_RELAXED * held.relaxation), _SHORTEST, _LONGEST))
    nodes = _nodes(ticks)
    passed = np.arange(ticks) / held.relaxation
    scale = -np.expm1(-passed) + _LATER * np.log1p(passed)  # the response is nearly linear in it
    size = len(held.frame)
    mean, odd, left = np.empty((ticks, size, size)), np.empty((size, size)), np.empty((size, size))
    for axis in range(size):
        steps = _lasting(held, step * held.frame[:, axis], ticks) @ held.frame / step
        curve = np.tensordot(_SIGNS, steps, 1) / len(_SIGNS)
        smooth = PchipInterpolator(scale[nodes], curve[nodes])(scale)
        mean[:, :, axis] = np.diff(smooth, axis=0, prepend=0.0)
        difference = np.tensordot(_SIGNS * [1.0, 1.0, -1.0, -1.0], steps, 1) / len(_SIGNS)
        odd[:, axis] = np.abs(difference[0]) + np.abs(difference[-1] - difference[0])
        left[:, axis] = _left_out(curve - smooth, nodes)
    return mean, odd, left


def _lasting(held: HeldTip, moved: Array, ticks: int) -> Array:
    """Return the changes of the force (4, ticks, r), N, after each step of the tip by `moved` (r,), m, and back."""
    answers = np.empty((len(_SIGNS), ticks, len(moved)))
    before = held.move(np.zeros((1, len(moved))))[0][-1]
    for row, place in enumerate((1.0, 0.0, -1.0, 0.0)):
        forces = held.move(np.tile(place * moved, (ticks, 1)))[0]
        answers[row] = forces - before
        before = forces[-1]
    return answers


def _nodes(ticks: int) -> NDArray[np.int64]:
    """Return ticks from 0 to the last: all at first, and geometric ones after them."""
    count = max(math.ceil(math.log(ticks / _DENSE) / math.log(_RATIO)), 2)
    later = np.rint(np.geomspace(_DENSE, ticks - 1, count)).astype(int)
    return np.unique(np.concatenate([np.arange(_DENSE), later]))


def _left_out(difference: Array, nodes: NDArray[np.int64]) -> Array:
    """Return the gain (r,) of the difference (n, r) of a response from the smooth one, N/m.

    Between two nodes the difference rises to its median there and falls again. What scatters about it is rounding,
    which the body does not have: it counts once.
    """
    total, scatter = np.zeros(difference.shape[1]), np.zeros(difference.shape[1])
    for begin, end in pairwise(nodes):
        if end - begin < 2:
            continue
        between = difference[begin + 1 : end]
        middle = np.median(between, axis=0)
        total += 2.0 * np.abs(middle)
        scatter = np.maximum(scatter, np.median(np.abs(between - middle), axis=0))
    return np.asarray(total + scatter)
