"""Identified model of the arm in the thesis, from torques to angles (3.25 to 3.31), with its misprints corrected.

The thesis prints the transfer functions h_ij and the matrices A_e and B_e, but not C_e. Two corrections are needed:

- (3.29) and (3.30) print -1.1428 z^4, where A_e contains 2 x 0.0714: the term is -0.1428 z^4. As printed, there is a
  pole at 1.763.
- The largest pole of each axis is 1 within the rounding of the digits (1.0004, 1.0000, 0.9994). As 1.0004 would
  diverge, the poles are set to 1. This changes one coefficient of each axis by at most 0.0005. Mechanics has a pole at
  1 for the yaw only: on axes 2 and 3 of the arm gravity acts as a spring.

The states are those of A_e, scaled by powers of two. Axis 1 is in controller form (states 1 to 6). Axes 2 and 3 are in
observer form (7 to 12 and 13 to 18); states 7 and 13 have no effect. C_e is the numerator of h11 over the scaling for
axis 1, and 0.5 for the last state of each other axis. Equation (3.37) confirms it: C_dl = K dp/dq C_e to every printed
digit.
"""

from __future__ import annotations

from typing import Final

import control
import numpy as np
from palpate.arrays import Array

from experiments.hosseini2004.printed_numbers import printed

__all__ = ["PERIOD", "denominators", "experimental_model"]

PERIOD: Final = 5e-4  # s, (3.12)
CHAINS: Final = ((2.0, 1.0, 1.0, 0.5, 0.25), (0.5, 0.5, 1.0, 2.0), (0.5, 1.0, 1.0, 2.0))  # A_e below the diagonal
ENDS: Final = (0.5, 0.5, 0.5)  # B_e of state 1; C_e of states 12 and 18


def experimental_model(*, integrating: bool = True, mirror_axis1: bool = False) -> control.StateSpace:
    """Return the identified model, 18 states, 3 torques (N m) to 3 angles (rad), sampled every 0.5 ms.

    Args:
        integrating: put the pole of each axis that is nearest to z = 1 exactly there; False: as the printed digits
            have it, with the misprint of (3.29), (3.30) corrected.
        mirror_axis1: count the first torque the other way round. As printed, a positive torque turns axis 1 to
            negative angles, which no arm does whose torque and angle are counted alike.
    """
    first, second, third = denominators(integrating=integrating)
    h11 = _numerator("eq3.26-numerator") * (-1.0 if mirror_axis1 else 1.0)
    blocks = [
        _controller_form(h11, first, CHAINS[0], ENDS[0]),
        _observer_form([_numerator("eq3.27-numerator"), _numerator("eq3.28-numerator")], second, CHAINS[1], ENDS[1]),
        _observer_form([_numerator("eq3.29-numerator"), _numerator("eq3.30-numerator")], third, CHAINS[2], ENDS[2]),
    ]
    torques = (np.array([0]), np.array([1, 2]), np.array([1, 2]))
    a, b, c = np.zeros((18, 18)), np.zeros((18, 3)), np.zeros((3, 18))
    for axis, (block, inputs) in enumerate(zip(blocks, torques, strict=True)):
        states = np.arange(6 * axis + 6 - len(block[0]), 6 * axis + 6)
        a[np.ix_(states, states)], b[np.ix_(states, inputs)], c[axis, states] = block
    return control.StateSpace(
        a,
        b,
        c,
        np.zeros((3, 3)),
        PERIOD,
        inputs=[f"torque[{i + 1}]" for i in range(3)],
        outputs=[f"angle[{i + 1}]" for i in range(3)],
    )


def denominators(*, integrating: bool = True) -> tuple[Array, Array, Array]:
    """Return the denominators of axes 1, 2 and 3, from z^6 down, the misprint corrected.

    With ``integrating`` the coefficient of z^5 is moved so that each vanishes at z = 1.
    """
    out = []
    for key in ("eq3.26-denominator", "eq3.27-denominator", "eq3.29-denominator"):
        source = printed(key)
        values = source.values[0].copy()
        for j in range(values.size):
            wrong = source.erratum(0, j)
            if wrong is not None:
                values[j] = float(wrong[0])
        if integrating:
            values[1] -= values.sum()
        out.append(values)
    return out[0], out[1], out[2]


def _numerator(key: str) -> Array:
    """Return the coefficients of z^4 to z^0."""
    return np.asarray(printed(key).values[0], dtype=float)


def _controller_form(
    numerator: Array, denominator: Array, chain: tuple[float, ...], end: float
) -> tuple[Array, Array, Array]:
    """Return A (6, 6), B (6, 1) and C (6,): state 1 takes the input, each next state the one before."""
    n = len(chain) + 1
    scale = np.concatenate([[1.0], np.cumprod(chain)])
    a = np.zeros((n, n))
    a[0] = -denominator[1:] / scale
    a[np.arange(1, n), np.arange(n - 1)] = chain
    b = np.zeros((n, 1))
    b[0] = end
    c = np.zeros(n)
    c[1:] = numerator / (scale[1:] * end)  # z^4 over z^6: two samples of delay
    return a, b, c


def _observer_form(
    numerators: list[Array], denominator: Array, chain: tuple[float, ...], end: float
) -> tuple[Array, Array, Array]:
    """Return A (5, 5), B (5, inputs) and C (5,): the last state is the output, fed back to every state."""
    n = len(chain) + 1
    scale = np.concatenate([np.cumprod(chain[::-1])[::-1], [1.0]])  # from each state to the last
    a = np.zeros((n, n))
    a[:, -1] = -denominator[1 : n + 1][::-1] / scale
    a[np.arange(1, n), np.arange(n - 1)] += chain
    b = np.zeros((n, len(numerators)))
    for j, numerator in enumerate(numerators):
        # Two samples of delay: the last state takes nothing, the one before it z^4's coefficient.
        b[:-1, j] = numerator[: n - 1][::-1] / (scale[:-1] * end)
    c = np.zeros(n)
    c[-1] = end
    return a, b, c
