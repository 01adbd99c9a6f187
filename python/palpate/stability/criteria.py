"""Four stability criteria of a sampled loop: eigenvalues, Jury, Routh (through the bilinear map), Lyapunov.

Each takes one loop or a stack of them, and shares nothing with the others: two tables of a polynomial, one matrix
equation. Coefficients are highest power first, as numpy's.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import matrix_balance

from palpate.checks import fraction, not_negative, positive
from palpate.errors import StabilityError

__all__ = [
    "Jury",
    "Lyapunov",
    "Routh",
    "characteristic_polynomial",
    "jury",
    "lyapunov",
    "precise_tables",
    "routh",
    "wall_polynomial",
]

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Jury:
    """Jury's table, each row divided by its leading coefficient.

    Attributes:
        reflections: last over leading coefficient of each row (..., d), rows of degree d, d-1, ..., 1; stable if all
            are inside (-1, 1).
        stable: (...), every root inside the unit circle.
        margin: (...), 1 less the largest |reflection|; not positive if unstable.
    """

    reflections: Array
    stable: Flags
    margin: Array


@dataclass(frozen=True)
class Routh:
    """Routh's array of the polynomial in s, z = (1 + s)/(1 - s).

    Attributes:
        first_column: (..., d+1); stable if all have one sign.
        stable: (...), every root inside the unit circle.
        outside: (...), sign changes: roots outside the circle; -1 where a pivot vanishes, a root on the circle.
    """

    first_column: Array
    stable: Flags
    outside: NDArray[np.int64]


@dataclass(frozen=True)
class Lyapunov:
    """A matrix P with P - A^T P A = Q > 0; P > 0 certifies that x^T P x decays, so that A is stable.

    Attributes:
        matrix: P (..., n, n), in the states' own scale.
        stable: (...), P and, recomputed from it, P - A^T P A are both positive definite.
        decrease: (...), smallest eigenvalue of P - A^T P A against Q in the balanced states, 1 without rounding.
    """

    matrix: Array
    stable: Flags
    decrease: Array


def characteristic_polynomial(matrix: ArrayLike) -> Array:
    """Return det(zI - A) (..., n+1) of A (..., n, n): determinants on the unit circle, and their Fourier sum.

    It does not use eigenvalues, so that tables built on it are a check of them.
    """
    a = np.asarray(matrix, dtype=float)
    n = a.shape[-1]
    z = np.exp(2j * np.pi * np.arange(n + 1) / (n + 1))
    values = np.linalg.det(z[:, None, None] * np.eye(n) - a[..., None, :, :])
    powers = np.fft.fft(values, axis=-1).real / (n + 1)  # lowest power first
    return np.ascontiguousarray(powers[..., ::-1])


def precise_tables(matrix: ArrayLike, digits: int = 150) -> tuple[bool, bool]:
    """Return whether Jury's table and Routh's array find A (n, n) stable, in decimal arithmetic of ``digits`` digits.

    The coefficients of many roots near 1 lose the roots in double precision; here the polynomial of the very matrix
    given (Faddeev & Le Verrier) and both tables keep them.
    """
    a = np.asarray(matrix, dtype=float)
    n = len(a)
    with localcontext() as context:
        context.prec = digits
        exact = np.array([[Decimal(float(x)) for x in row] for row in a], dtype=object).reshape(n, n)
        eye = np.array([[Decimal(int(i == j)) for j in range(n)] for i in range(n)], dtype=object).reshape(n, n)
        coefficients = [Decimal(1)]
        power = np.full((n, n), Decimal(0), dtype=object)
        for k in range(1, n + 1):
            power = exact @ power + coefficients[-1] * eye
            coefficients.append(-sum(np.diag(exact @ power), Decimal(0)) / k)
        by_jury, rows = True, coefficients
        while len(rows) > 1:
            last = rows[-1] / rows[0]
            if abs(last) >= 1:
                by_jury = False
                break
            rows = [x - last * y for x, y in zip(rows[:-1], rows[:0:-1], strict=True)]
        mapped = [sum(c * int(t) for c, t in zip(coefficients, column, strict=True)) for column in _bilinear(n).T]
        by_routh, upper, lower = True, mapped[0::2], mapped[1::2]
        first = [upper[0]]
        for _ in range(n):
            if not lower or lower[0] == 0:
                by_routh = False
                break
            first.append(lower[0])
            ratio = upper[0] / lower[0]
            short = [*lower[1:], *[Decimal(0)] * (len(upper) - len(lower))]
            upper, lower = lower, [x - ratio * y for x, y in zip(upper[1:], short, strict=True)]
        by_routh = by_routh and (min(first) > 0 or max(first) < 0)
    return by_jury, bool(by_routh)


def wall_polynomial(
    *,
    mass: ArrayLike,
    damping: ArrayLike,
    period: ArrayLike,
    stiffness: ArrayLike,
    virtual_damping: ArrayLike = 0.0,
    delay: int = 0,
    velocity_filter: ArrayLike = 0.0,
) -> Array:
    """Return the characteristic polynomial (..., delay + 4 or 5) of a mass against a sampled wall, in closed form.

    (z-1)(z-a) z^n (z-alpha) + (b1 z + b0)[K (z-alpha) + (1-alpha)(B/T)(z-1)], a = e^{-bT/m}, t = m/b,
    b1 = (T - t(1-a))/b, b0 = (t(1-a) - aT)/b; without damping b1 = b0 = T^2/2m. All arguments broadcast.

    Args:
        mass: kg; damping: N s/m; period: s; stiffness: N/m; virtual_damping: N s/m.
        delay: whole samples.
        velocity_filter: alpha.

    Raises:
        StabilityError: a mass or period that is not positive, a negative damping or delay.
    """
    if int(delay) != delay or delay < 0:
        raise StabilityError(f"delay must be a whole number of samples, 0 or more, not {delay}; hold() takes any")
    arrays = [np.asarray(v, float) for v in (mass, damping, period, stiffness, virtual_damping, velocity_filter)]
    m, b, t, k, v, alpha = np.broadcast_arrays(*arrays)
    for name, low, values, unit in (("mass", positive, m, "kg"), ("period", positive, t, "s")):
        low(float(values.min()), name, unit)
    not_negative(float(b.min()), "damping", "N s/m")
    fraction(float(alpha.max()), "velocity_filter")
    x = b * t / m
    a = np.exp(-x)
    phi1 = np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1.0), 1.0)
    small = x < 1e-2
    series = 0.5 - x / 6 + x**2 / 24 - x**3 / 120 + x**4 / 720 - x**5 / 5040 + x**6 / 40320
    phi2 = np.where(small, series, (1 - phi1) / np.where(small, 1.0, x))
    scale = t**2 / m
    b1, b0 = scale * phi2, scale * (phi1 - phi2)
    rate = (1 - alpha) * v / t
    wall = np.stack([k + rate, -(k * alpha + rate)], axis=-1)
    push = np.stack([b1, b0], axis=-1)
    one = np.ones_like(a)
    device = _product(_product(np.stack([one, -one], -1), np.stack([one, -a], -1)), np.stack([one, -alpha], -1))
    poly = np.concatenate([device, np.zeros((*a.shape, delay))], axis=-1)
    poly[..., -3:] += _product(push, wall)
    return poly


def _product(p: Array, q: Array) -> Array:
    """Return the product of two stacks of polynomials."""
    out = np.zeros((*p.shape[:-1], p.shape[-1] + q.shape[-1] - 1))
    for i in range(q.shape[-1]):
        out[..., i : i + p.shape[-1]] += p * q[..., i : i + 1]
    return out


def jury(coefficients: ArrayLike) -> Jury:
    """Return Jury's table of a polynomial in z, or of a stack of them (..., d+1).

    Raises:
        StabilityError: no degree, a value that is not finite, or a leading zero.
    """
    rows = _checked(coefficients, "jury")
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
    p = _checked(coefficients, "routh")
    d = p.shape[-1] - 1
    q = p @ _bilinear(d)
    half = d // 2 + 1
    upper = np.zeros((*p.shape[:-1], half))
    lower = np.zeros_like(upper)
    upper[..., : len(range(0, d + 1, 2))] = q[..., 0::2]
    lower[..., : len(range(1, d + 1, 2))] = q[..., 1::2]
    column = [upper[..., 0]]
    scale = np.abs(q).max(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for _ in range(d):
            column.append(lower[..., 0])
            ratio = upper[..., :1] / lower[..., :1]
            following = np.zeros_like(upper)
            following[..., :-1] = upper[..., 1:] - ratio * lower[..., 1:]
            upper, lower = lower, following
    first = np.stack(column, axis=-1)
    clear = np.isfinite(first).all(axis=-1) & (np.abs(first) > 1e-300 + 0 * scale[..., None]).all(axis=-1)
    changes = (np.sign(first[..., 1:]) != np.sign(first[..., :-1])).sum(axis=-1)
    outside = np.where(clear, changes, -1)
    return Routh(first, outside == 0, np.asarray(outside, dtype=np.int64))


def _bilinear(d: int) -> Array:
    """Return the matrix that takes p (highest first) to (1 - s)^d p((1 + s)/(1 - s)) (highest first)."""
    table = np.zeros((d + 1, d + 1))
    for row in range(d + 1):
        power = d - row  # of z: (1 + s)^power (1 - s)^(d - power)
        for i in range(power + 1):
            for j in range(d - power + 1):
                table[row, d - i - j] += comb(power, i) * comb(d - power, j) * (-1) ** j
    return table


def _checked(coefficients: ArrayLike, who: str) -> Array:
    try:
        p = np.array(coefficients, dtype=float)
    except (TypeError, ValueError):
        raise StabilityError(f"{who}: the coefficients must be numbers, highest power first") from None
    if p.ndim == 0 or p.shape[-1] < 2:
        raise StabilityError(f"{who}: give the coefficients of a polynomial of degree 1 or more, highest power first")
    if not np.all(np.isfinite(p)):
        raise StabilityError(f"{who}: every coefficient must be finite")
    if np.any(p[..., 0] == 0):
        raise StabilityError(f"{who}: the leading coefficient must not be zero; leave leading zeros out")
    return p


def lyapunov(matrix: ArrayLike) -> Lyapunov:
    """Return the Lyapunov certificate of a loop x_{k+1} = A x_k, or of a stack (..., n, n).

    P - A^T P A = Q is solved as a linear system with Q = I in balanced states, and the certificate is then checked
    as anyone would: is P positive definite, and is P - A^T P A, computed from P, as well?

    Raises:
        StabilityError: not square, or not finite.
    """
    a = np.asarray(matrix, dtype=float)
    if a.ndim < 2 or a.shape[-1] != a.shape[-2] or not np.all(np.isfinite(a)):
        raise StabilityError("lyapunov: give a finite square matrix, or a stack of them")
    n = a.shape[-1]
    flat = a.reshape(-1, n, n)
    scales = np.array([np.diag(matrix_balance(one, permute=False)[1]) for one in flat])
    balanced = flat * scales[:, None, :] / scales[:, :, None]
    p = np.empty_like(flat)
    for start in range(0, len(flat), 1000):
        part = balanced[start : start + 1000]
        turned = np.swapaxes(part, 1, 2)
        system = np.eye(n * n) - np.einsum("kij,klm->kiljm", turned, turned).reshape(-1, n * n, n * n)
        wanted = np.broadcast_to(np.eye(n).reshape(n * n, 1), (len(part), n * n, 1))
        p[start : start + 1000] = _solve(system, wanted).reshape(-1, n, n)
    p = 0.5 * (p + np.swapaxes(p, 1, 2))
    falls = p - np.swapaxes(balanced, 1, 2) @ p @ balanced
    finite = np.isfinite(p).all(axis=(1, 2)) & np.isfinite(falls).all(axis=(1, 2))
    safe_p, safe_falls = (np.where(finite[:, None, None], x, -np.eye(n)) for x in (p, falls))
    decrease = np.linalg.eigvalsh(0.5 * (safe_falls + np.swapaxes(safe_falls, 1, 2)))[:, 0]
    stable = finite & (np.linalg.eigvalsh(safe_p)[:, 0] > 0) & (decrease > 0)
    own = p / scales[:, :, None] / scales[:, None, :]
    shape = a.shape[:-2]
    return Lyapunov(own.reshape(a.shape), stable.reshape(shape), np.asarray(decrease.reshape(shape), float))


def _solve(system: Array, wanted: Array) -> Array:
    """Solve a stack of systems; where one is singular (a root on the circle) the answer is not a number."""
    try:
        return np.asarray(np.linalg.solve(system, wanted), dtype=float)
    except np.linalg.LinAlgError:
        out = np.full(wanted.shape, np.nan)
        for i, one in enumerate(system):
            if np.linalg.matrix_rank(one) == len(one):
                out[i] = np.linalg.solve(one, wanted[i])
        return out
