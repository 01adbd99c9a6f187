"""Passivity of a rendered wall: how much of the device's own damping it takes, exactly, whoever holds the device.

A passive device is stable in every passive hand. The sampled wall makes energy because the force is held while the tip
moves on; only the device's physical damping b takes it away again (Colgate & Schenkel 1997; the mass plays no part).
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.checks import finite, fraction, not_negative, positive
from palpate.errors import StabilityError
from palpate.linear.wall import _at, causal_controller

__all__ = [
    "coulomb_amplitude",
    "coupling_damping",
    "field_damping",
    "passive_damping",
    "passive_stiffness",
    "quantized_stiffness",
    "sufficient_damping",
]

Array = NDArray[np.float64]


def passive_damping(
    *,
    stiffness: float = 0.0,
    virtual_damping: float = 0.0,
    period: float,
    delay: float = 0.0,
    velocity_filter: float = 0.0,
    virtual_mass: float = 0.0,
    law: Any = None,
) -> float:
    """Return the least damping b (N s/m) of the device with which the wall is passive, exactly.

    b > max over theta of (T/2)/(1 - cos theta) Re{(1 - e^{-j theta}) H(e^{j theta}) e^{-j n theta}}: KT/2 + |B|
    without delay, and (KT/2) sin((n+1/2) theta)/sin(theta/2) - B cos((n+1) theta) with n samples of it. Between
    whole samples the force changes within a period; the worst motion is then linear in each part, and the condition is
    on the largest eigenvalue of a 2 x 2 form, which becomes the above at whole delays.

    Args:
        stiffness: K, N/m.
        virtual_damping: B, N s/m, through the backward difference.
        period: T, s.
        delay: in samples, whole or not.
        velocity_filter: alpha of v <- alpha v + (1 - alpha) dx/T.
        virtual_mass: M, kg, through the second backward difference; alone it needs 2M/T.
        law: any other sampled law from motion (m) to force (N), added to these.

    Raises:
        StabilityError: a value out of range, or a law that looks ahead or is unstable.
    """
    wall = _Wall(stiffness, virtual_damping, period, delay, velocity_filter, virtual_mass, law)
    return max(0.0, _largest(wall.demand, wall.delay))


def sufficient_damping(*, stiffness: float, virtual_damping: float = 0.0, period: float, delay: float = 0.0) -> float:
    """Return K(n + 1/2)T + |B| (N s/m), n the delay rounded up: never less than ``passive_damping``."""
    t = positive(period, "period", "s")
    n = np.ceil(not_negative(delay, "delay", "samples"))
    held = not_negative(stiffness, "stiffness", "N/m") * float(n + 0.5) * t
    return held + abs(finite(virtual_damping, "virtual_damping", "N s/m"))


def passive_stiffness(
    *,
    damping: float,
    period: float,
    virtual_damping: ArrayLike = 0.0,
    delay: float = 0.0,
    velocity_filter: float = 0.0,
) -> Array:
    """Return the largest K (N/m) that is passive with the device's ``damping`` b, for each B; 0 where none is.

    Args:
        damping: b, N s/m.
        period: T, s.
        virtual_damping: B, N s/m, any shape.
        delay: in samples, whole or not.
        velocity_filter: alpha.

    Raises:
        StabilityError: a value out of range.
    """
    b = not_negative(damping, "damping", "N s/m")
    values = np.asarray(virtual_damping, dtype=float)
    out = np.zeros(values.size)
    for i, one in enumerate(values.ravel()):
        wall = _Wall(0.0, float(one), period, delay, velocity_filter, 0.0, None)
        if _largest(wall.demand, wall.delay) > b * (1 + 1e-12):
            continue
        low, high = 0.0, 2.0 * b / wall.period * (1 + 1e-9)  # what the bare hold alone allows
        spread = abs(float(one)) * 4 / wall.period
        high = high + spread
        for _ in range(60):  # the demand is convex in K and the set of passive K an interval from zero
            middle = 0.5 * (low + high)
            inside = _largest(_Wall(middle, float(one), period, delay, velocity_filter, 0.0, None).demand, delay) <= b
            low, high = (middle, high) if inside else (low, middle)
            if high - low <= 1e-13 * high:
                break
        out[i] = low
    return out.reshape(values.shape)


class _Wall:
    """What a wall demands of the device's damping at each angle."""

    def __init__(
        self,
        stiffness: float,
        virtual_damping: float,
        period: float,
        delay: float,
        velocity_filter: float,
        virtual_mass: float,
        law: Any,
    ) -> None:
        self.period = positive(period, "period", "s (a rate of zero has none)")
        self.stiffness = finite(stiffness, "stiffness", "N/m")
        self.damping = finite(virtual_damping, "virtual_damping", "N s/m")
        self.delay = not_negative(delay, "delay", "samples (a negative one would look ahead)")
        self.alpha = fraction(velocity_filter, "velocity_filter")
        self.mass = finite(virtual_mass, "virtual_mass", "kg")
        self.law: control.StateSpace | None = None if law is None else causal_controller(law, self.period)

    def over_difference(self, theta: Array) -> NDArray[np.complex128]:
        """H/(z - 1): force per change of position, (k,), N/m."""
        t, a = self.period, self.alpha
        z = np.exp(1j * theta)
        ahead = -2 * np.sin(theta / 2) ** 2 + 1j * np.sin(theta)
        result = self.stiffness / ahead + self.damping / t * (1 - a) / (z - a) + self.mass / t**2 * ahead / z**2
        if self.law is not None:
            result = result + _at(self.law, z) / ahead
        return np.asarray(result, dtype=complex)

    def demand(self, theta: Array) -> Array:
        """Return the damping that a motion at ``theta`` (rad per sample) needs, N s/m."""
        whole = np.floor(self.delay + 1e-12)
        part = max(self.delay - whole, 0.0)
        h = self.over_difference(theta) * np.exp(-1j * whole * theta)
        if part < 1e-12:
            return np.asarray(-self.period * h.real, dtype=float)
        # A period falls in two: the first `part` of it under the older force. With p, q the ways in each, the force's
        # work is f*(q + z p), the position's change p + q, and the device dissipates b (p^2/part + q^2/(1 - part))/T.
        z = np.exp(1j * theta)
        inner = part * np.conj(z) + (1 - part)  # of the two forms, weighted; each has length 1
        real, imag = (h * inner).real, (h * inner).imag
        root = np.sqrt(np.maximum(np.abs(h) ** 2 - imag**2, 0.0))
        return np.asarray(0.5 * self.period * (root - real), dtype=float)


def _largest(height: Any, delay: float) -> float:
    """Return the maximum of a smooth function of theta over (0, pi], grid and then ever finer about its best."""
    theta = np.concatenate([np.geomspace(1e-5, 1e-2, 40), np.linspace(1.1e-2, np.pi, 400 * (int(delay) + 1))])
    values = height(theta)
    for _ in range(6):
        k = int(np.argmax(values))
        low, high = theta[max(k - 1, 0)], theta[min(k + 1, len(theta) - 1)]
        theta = np.linspace(low, high, 41)
        values = height(theta)
    return float(values.max())


def field_damping(*, lipschitz: float, longest_period: float, delay: int = 0, virtual_damping: float = 0.0) -> float:
    """Return the damping (N s/m) with which a nonlinear conservative force field is passive, late ticks included.

    lambda_min(D) >= L (T_max/2 + n T_max) + B_max: D the device's damping at the tip, L the largest change of force per
    way anywhere in the field (the Lipschitz constant of its gradient), T_max the longest time between ticks that
    happens, n samples of delay, B_max of damping by backward difference. Sufficient; exact for the stiffest wall.

    Args:
        lipschitz: L, N/m.
        longest_period: T_max, s.
        delay: n, samples.
        virtual_damping: B_max, N s/m.

    Raises:
        StabilityError: a negative value, or no time between ticks.
    """
    slope = not_negative(lipschitz, "lipschitz", "N/m")
    longest = positive(longest_period, "longest_period", "s")
    late = not_negative(delay, "delay", "samples")
    return slope * longest * (0.5 + late) + not_negative(virtual_damping, "virtual_damping", "N s/m")


def quantized_stiffness(*, damping: float, coulomb: float, period: float, quantum: float) -> float:
    """Return the largest passive K (N/m) of a wall seen through an encoder: min(2b/T, 2 f_c/Delta).

    Abbott & Okamura 2005: viscous damping pays for sampling, Coulomb friction for quantisation, neither for both.

    Args:
        damping: b, N s/m.
        coulomb: f_c, N.
        period: T, s.
        quantum: Delta, one count at the tip, m; 0 for none.

    Raises:
        StabilityError: a value out of range.
    """
    sampled = 2 * not_negative(damping, "damping", "N s/m") / positive(period, "period", "s")
    friction = not_negative(coulomb, "coulomb", "N")
    step = not_negative(quantum, "quantum", "m")
    return sampled if step == 0.0 else min(sampled, 2 * friction / step)


def coulomb_amplitude(*, mass: float, stiffness: float, damping: float, coulomb: float, period: float) -> float:
    """Return A* (m): a swing against the wall smaller than this dies in Coulomb friction, a larger one grows.

    A* = 4 f_c / (pi sqrt(K/m) (KT/2 - b)), by the describing function of Coulomb friction; inf where b >= KT/2 and
    every swing dies. Good where the swing is slow against the rate, sqrt(K/m) T << 1.

    Args:
        mass: kg; stiffness: K, N/m; damping: b, N s/m; coulomb: f_c, N; period: T, s.

    Raises:
        StabilityError: a value out of range.
    """
    m, k = positive(mass, "mass", "kg"), positive(stiffness, "stiffness", "N/m")
    short = k * positive(period, "period", "s") / 2 - not_negative(damping, "damping", "N s/m")
    if short <= 0:
        return float("inf")
    return float(4 * not_negative(coulomb, "coulomb", "N") / (np.pi * np.sqrt(k / m) * short))


def coupling_damping(*, coupling_stiffness: float, coupling_damping: float, period: float) -> float:
    """Return b_c + k_c T/2 (N s/m): with it the display is passive before every passive discrete object, and not less.

    Args:
        coupling_stiffness: k_c, N/m, of the virtual coupling.
        coupling_damping: b_c, N s/m, by backward difference.
        period: T, s.

    Raises:
        StabilityError: a value out of range.
    """
    k = not_negative(coupling_stiffness, "coupling_stiffness", "N/m")
    b = not_negative(coupling_damping, "coupling_damping", "N s/m")
    if k == 0.0 and b == 0.0:
        raise StabilityError("a virtual coupling needs a stiffness or a damping above zero")
    return b + k * positive(period, "period", "s") / 2
