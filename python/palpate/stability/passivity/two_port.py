"""Virtual coupling: Llewellyn's two-port criterion (Adams & Hannaford 1999) and the exact passivity condition."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.checks import not_negative, positive
from palpate.errors import StabilityError
from palpate.linear.wall import causal_controller, frequency_values
from palpate.stability.passivity.sampled_wall import coupling_damping

__all__ = [
    "CouplingVerdict",
    "certify_coupling",
    "llewellyn",
    "positive_real_margin",
    "two_port_limit",
    "two_port_margin",
]


@dataclass(frozen=True)
class CouplingVerdict:
    """Passivity of a display with a virtual coupling, for every passive discrete object.

    Attributes:
        passive: exact verdict, b >= b_c + k_c T/2.
        required_damping: b_c + k_c T/2, N s/m.
        margin: b minus ``required_damping``, N s/m.
        two_port: least Llewellyn margin over frequency; the two-port criterion accepts the coupling if not negative.
        sentence: the verdict in words.
    """

    passive: bool
    required_damping: float
    margin: float
    two_port: float
    sentence: str


def llewellyn(h11: ArrayLike, h12: ArrayLike, h21: ArrayLike, h22: ArrayLike) -> Array:
    """Return Llewellyn's margin of a two-port over frequency; it is absolutely stable if no value is negative.

    The margin is the minimum of Re h11, Re h22 and 2 Re h11 Re h22 - Re(h12 h21) - |h12 h21|, (k,) for parameters
    (k,).
    """
    a, b, c, d = (np.asarray(h, dtype=complex) for h in (h11, h12, h21, h22))
    product = b * c
    third = 2 * a.real * d.real - product.real - np.abs(product)
    return np.asarray(np.minimum(np.minimum(a.real, d.real), third), dtype=float)


def two_port_margin(
    *,
    damping: float | str,
    coupling_stiffness: float | str,
    coupling_damping: float | str,
    period: float | str,
    angles: int = 2000,
) -> float:
    """Return the least Llewellyn margin of an impedance display with a virtual coupling (Adams & Hannaford 1999).

    h11 = Z_d by Tustin, whose mass is lossless; h12 = (1 + 1/z)/2 for the hold; h21 = -1; h22 = 1/Z_c with
    Z_c = b_c + k_c T z/(z - 1).
    """
    b, t = not_negative(damping, "damping", "N*s/m"), positive(period, "period", "s")
    k, c = not_negative(coupling_stiffness, "coupling_stiffness", "N/m"), not_negative(coupling_damping, "b_c", "N*s/m")
    if k == 0.0 and c == 0.0:
        raise StabilityError("a virtual coupling needs a stiffness or a damping above zero")
    theta = np.concatenate([np.geomspace(1e-4, 1e-2, 100), np.linspace(0.01, np.pi, angles)])
    z = np.exp(1j * theta)
    impedance = c + k * t * z / (z - 1)
    one = np.ones_like(z)
    return float(llewellyn(b * one, 0.5 * (1 + 1 / z), -one, 1 / impedance).min())


def two_port_limit(*, damping: float | str, period: float | str) -> float:
    """Return 8b/T, the k_c (N/m) up to which the two-port accepts an undamped coupling: four times the exact limit."""
    return 8 * not_negative(damping, "damping", "N*s/m") / positive(period, "period", "s")


def positive_real_margin(admittance: Any, period: float | str) -> float:
    """Return the least real part of a sampled admittance on the unit circle; it is passive if not negative.

    A virtual mass driven by the force of the previous sample, (T/M)/(z - 1), has -T/2M. Driven by the force of the
    same sample, (T/M) z/(z - 1), it has T/2M. Only the second is admissible behind a virtual coupling.

    Args:
        admittance: sampled SISO system, velocity per force; poles on the circle allowed.
        period: T, s.

    Raises:
        StabilityError: the admittance is not causal or not stable.
    """
    law = causal_controller(admittance, positive(period, "period", "s"))
    theta = np.concatenate([np.geomspace(1e-4, 1e-2, 100), np.linspace(0.0101, np.pi, 2000)])
    return float(frequency_values(law, np.exp(1j * theta)).real.min())


def certify_coupling(
    *, damping: float | str, coupling_stiffness: float | str, coupling_damping: float | str, period: float | str
) -> CouplingVerdict:
    """Return the exact passivity verdict on a virtual coupling, with the two-port margin for comparison.

    Args:
        damping: b of the device, N s/m.
        coupling_stiffness: k_c, N/m.
        coupling_damping: b_c, N s/m, by backward difference.
        period: T, s.

    Raises:
        StabilityError: a value out of range.
    """
    required = _required(coupling_stiffness, coupling_damping, period)
    damping = not_negative(damping, "damping", "N*s/m")
    margin = damping - required
    port = two_port_margin(
        damping=damping, coupling_stiffness=coupling_stiffness, coupling_damping=coupling_damping, period=period
    )
    passive = margin >= -1e-12 * required
    if passive:
        sentence = (
            f"Passive with every passive object: the device's damping {damping:g} N s/m covers "
            f"b_c + k_c T/2 = {required:g} N s/m."
        )
    else:
        comparison = (
            "although the two-port criterion accepts it" if port >= -1e-12 else "and the two-port criterion agrees"
        )
        sentence = (
            f"Not passive, {comparison}: the coupling requires b_c + k_c T/2 = {required:g} N s/m of damping "
            f"and the device has {damping:g} N s/m."
        )
    return CouplingVerdict(passive, required, margin, port, sentence)


def _required(stiffness: float | str, damping: float | str, period: float | str) -> float:
    return coupling_damping(coupling_stiffness=stiffness, coupling_damping=damping, period=period)
