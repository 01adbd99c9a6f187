"""Jury's table and Routh's array of a sampled loop, for one polynomial or a stack of them.

Coefficients are highest power first, as in numpy.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.arrays import Array, Flags
from palpate.errors import StabilityError
from palpate.stability.criteria.polynomials import bilinear_map

__all__ = ["Jury", "Routh", "jury", "precise_tables", "routh"]


@dataclass(frozen=True)
class Jury:
    """Jury's table, each row divided by its leading coefficient.

    Attributes:
        reflections: (..., d), last over leading coefficient of the rows of degree d, d-1, ..., 1. The loop is stable
            if all are inside (-1, 1).
        stable: (...), whether every root is inside the unit circle.
        margin: (...), 1 minus the largest |reflection|; not positive if unstable.
    """

    reflections: Array
    stable: Flags
    margin: Array


@dataclass(frozen=True)
class Routh:
    """Routh's array of the polynomial in s, z = (1 + s)/(1 - s).

    Attributes:
        first_column: (..., d+1); the loop is stable if all have the same sign.
        stable: (...), whether every root is inside the unit circle.
        outside: (...), number of roots outside the circle; -1 where a pivot vanishes (root on the circle).
    """

    first_column: Array
    stable: Flags
    outside: NDArray[np.int64]


def jury(coefficients: ArrayLike) -> Jury:
    """Return Jury's table of a polynomial in z, or of a stack of polynomials (..., d+1).

    Raises:
        StabilityError: degree 0, a coefficient that is not finite, or a leading zero.
    """
    rows = _polynomial(coefficients, "jury")
    reflections = []
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        while rows.shape[-1] > 1:
            rows = rows / rows[..., :1]
            last = rows[..., -1:]
            reflections.append(last[..., 0])
            rows = (rows - last * rows[..., ::-1])[..., :-1]
        table = np.stack(reflections, axis=-1)
        margin = 1 - np.abs(table).max(axis=-1)
    margin = np.where(np.isfinite(margin), margin, -np.inf)
    return Jury(table, margin > 0, margin)


def routh(coefficients: ArrayLike) -> Routh:
    """Return Routh's array of a polynomial in z, or of a stack (..., d+1), through z = (1 + s)/(1 - s).

    Raises:
        StabilityError: as ``jury``.
    """
    p = _polynomial(coefficients, "routh")
    d = p.shape[-1] - 1
    q = p @ bilinear_map(d)
    half = d // 2 + 1
    upper = np.zeros((*p.shape[:-1], half))
    lower = np.zeros_like(upper)
    upper[..., : len(range(0, d + 1, 2))] = q[..., 0::2]
    lower[..., : len(range(1, d + 1, 2))] = q[..., 1::2]
    column = [upper[..., 0]]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(d):
            column.append(lower[..., 0])
            ratio = upper[..., :1] / lower[..., :1]
            following = np.zeros_like(upper)
            following[..., :-1] = upper[..., 1:] - ratio * lower[..., 1:]
            upper, lower = lower, following
    first = np.stack(column, axis=-1)
    clear = np.isfinite(first).all(axis=-1) & (np.abs(first) > 1e-300).all(axis=-1)
    changes = (np.sign(first[..., 1:]) != np.sign(first[..., :-1])).sum(axis=-1)
    outside = np.where(clear, changes, -1)
    return Routh(first, outside == 0, np.asarray(outside, dtype=np.int64))


def precise_tables(matrix: ArrayLike, digits: int = 150) -> tuple[bool, bool]:
    """Return whether Jury's table and Routh's array find A (n, n) stable, computed with ``digits`` decimal digits.

    In double precision the coefficients of a polynomial with many roots near 1 do not determine the roots. The
    characteristic polynomial (Faddeev & Le Verrier) and both tables are therefore computed in decimal arithmetic.
    """
    with localcontext() as context:
        context.prec = digits
        coefficients = _precise_polynomial(np.asarray(matrix, dtype=float))
        return _precise_jury(coefficients), _precise_routh(coefficients)


def _precise_polynomial(a: Array) -> list[Decimal]:
    """Return det(zI - A), highest power first, by the recursion of Faddeev & Le Verrier."""
    n = len(a)
    exact = np.array([[Decimal(float(x)) for x in row] for row in a], dtype=object).reshape(n, n)
    eye = np.array([[Decimal(int(i == j)) for j in range(n)] for i in range(n)], dtype=object).reshape(n, n)
    coefficients = [Decimal(1)]
    power = np.full((n, n), Decimal(0), dtype=object)
    for k in range(1, n + 1):
        power = exact @ power + coefficients[-1] * eye
        coefficients.append(-sum(np.diag(exact @ power), Decimal(0)) / k)
    return coefficients


def _precise_jury(coefficients: list[Decimal]) -> bool:
    row = coefficients
    while len(row) > 1:
        last = row[-1] / row[0]
        if abs(last) >= 1:
            return False
        row = [x - last * y for x, y in zip(row[:-1], row[:0:-1], strict=True)]
    return True


def _precise_routh(coefficients: list[Decimal]) -> bool:
    n = len(coefficients) - 1
    mapped = [sum(c * int(t) for c, t in zip(coefficients, column, strict=True)) for column in bilinear_map(n).T]
    upper, lower = mapped[0::2], mapped[1::2]
    first = [upper[0]]
    for _ in range(n):
        if not lower or lower[0] == 0:
            return False
        first.append(lower[0])
        ratio = upper[0] / lower[0]
        short = [*lower[1:], *[Decimal(0)] * (len(upper) - len(lower))]
        upper, lower = lower, [x - ratio * y for x, y in zip(upper[1:], short, strict=True)]
    return bool(min(first) > 0 or max(first) < 0)


def _polynomial(coefficients: ArrayLike, caller: str) -> Array:
    try:
        p = np.array(coefficients, dtype=float)
    except (TypeError, ValueError):
        raise StabilityError(f"{caller}: the coefficients must be numbers, highest power first") from None
    if p.ndim == 0 or p.shape[-1] < 2:
        raise StabilityError(
            f"{caller}: give the coefficients of a polynomial of degree 1 or more, highest power first"
        )
    if not np.all(np.isfinite(p)):
        raise StabilityError(f"{caller}: every coefficient must be finite")
    if np.any(p[..., 0] == 0):
        raise StabilityError(f"{caller}: the leading coefficient must not be zero; leave leading zeros out")
    return p
