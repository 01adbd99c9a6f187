"""Characteristic polynomials of sampled loops; coefficients are highest power first, as in numpy."""

from __future__ import annotations

from math import comb

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.checks import fraction, not_negative, positive
from palpate.errors import StabilityError
from palpate.units import array_to_si

__all__ = ["bilinear_map", "characteristic_polynomial", "wall_polynomial"]


def characteristic_polynomial(matrix: ArrayLike) -> Array:
    """Return det(zI - A) (..., n+1) of A (..., n, n), by interpolation on the unit circle.

    No eigenvalues are used, so tables built on the coefficients are independent of them.
    """
    a = np.asarray(matrix, dtype=float)
    n = a.shape[-1]
    z = np.exp(2j * np.pi * np.arange(n + 1) / (n + 1))
    values = np.linalg.det(z[:, None, None] * np.eye(n) - a[..., None, :, :])
    powers = np.fft.fft(values, axis=-1).real / (n + 1)  # lowest power first
    return np.ascontiguousarray(powers[..., ::-1])


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

    (z-1)(z-a) z^n (z-alpha) + (b1 z + b0)[K (z-alpha) + (1-alpha)(B/T)(z-1)], with a = e^{-bT/m}, t = m/b,
    b1 = (T - t(1-a))/b and b0 = (t(1-a) - aT)/b. Without damping b1 = b0 = T^2/2m. All arguments broadcast.

    Args:
        mass: kg; damping: N s/m; period: s; stiffness: N/m; virtual_damping: N s/m.
        delay: whole samples.
        velocity_filter: alpha.

    Raises:
        StabilityError: a mass or period that is not positive, a negative damping or delay.
    """
    if int(delay) != delay or delay < 0:
        raise StabilityError(
            f"delay must be a whole number of samples, 0 or more, not {delay}; discretize_zoh() takes any"
        )
    given = {
        "mass": (mass, "kg"),
        "damping": (damping, "N*s/m"),
        "period": (period, "s"),
        "stiffness": (stiffness, "N/m"),
        "virtual_damping": (virtual_damping, "N*s/m"),
        "velocity_filter": (velocity_filter, ""),
    }
    arrays = [array_to_si(value, unit, name, error=StabilityError) for name, (value, unit) in given.items()]
    m, b, t, k, v, alpha = np.broadcast_arrays(*arrays)
    for name, check, values, unit in (("mass", positive, m, "kg"), ("period", positive, t, "s")):
        check(float(values.min()), name, unit)
    not_negative(float(b.min()), "damping", "N*s/m")
    fraction(float(alpha.max()), "velocity_filter")
    x = b * t / m
    a = np.exp(-x)
    phi1 = np.where(x > 0, -np.expm1(-x) / np.where(x > 0, x, 1.0), 1.0)
    small = x < 1e-2
    series = 0.5 - x / 6 + x**2 / 24 - x**3 / 120 + x**4 / 720 - x**5 / 5040
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


def bilinear_map(d: int) -> Array:
    """Return the matrix (d+1, d+1) that maps p(z) to (1 - s)^d p((1 + s)/(1 - s)), highest power first."""
    table = np.zeros((d + 1, d + 1))
    for row in range(d + 1):
        power = d - row  # of z: (1 + s)^power (1 - s)^(d - power)
        for i in range(power + 1):
            for j in range(d - power + 1):
                table[row, d - i - j] += comb(power, i) * comb(d - power, j) * (-1) ** j
    return table


def _product(p: Array, q: Array) -> Array:
    """Return the product of two stacks of polynomials."""
    out = np.zeros((*p.shape[:-1], p.shape[-1] + q.shape[-1] - 1))
    for i in range(q.shape[-1]):
        out[..., i : i + p.shape[-1]] += p * q[..., i : i + 1]
    return out
