"""Passivity of a sampled wall: the exact damping that it requires of the device (Colgate & Schenkel 1997).

A passive display is stable with every passive operator. A sampled wall generates energy because the force is held
while the tip moves. Only the device's physical damping b dissipates it; the mass has no effect.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.arrays import Array
from palpate.checks import finite, fraction, not_negative, positive
from palpate.errors import StabilityError
from palpate.linear.wall import causal_controller, frequency_values
from palpate.units import array_to_si

__all__ = [
    "coulomb_amplitude",
    "coupling_damping",
    "field_damping",
    "passive_damping",
    "passive_stiffness",
    "quantized_stiffness",
    "sufficient_damping",
]


def passive_damping(
    *,
    stiffness: float | str = 0.0,
    virtual_damping: float | str = 0.0,
    period: float | str,
    delay: float = 0.0,
    velocity_filter: float = 0.0,
    virtual_mass: float | str = 0.0,
    law: Any = None,
) -> float:
    """Return the least device damping b (N s/m) with which the wall is passive, exactly.

    b > max over theta of (T/2)/(1 - cos theta) Re{(1 - e^{-j theta}) H(e^{j theta}) e^{-j n theta}}. Without delay
    this is KT/2 + |B|. With n samples of delay it is the maximum of (KT/2) sin((n+1/2) theta)/sin(theta/2) -
    B cos((n+1) theta). With a fractional delay the force changes within a period. The worst motion is then linear in
    each part, and the condition applies to the largest eigenvalue of a 2 x 2 form.

    Args:
        stiffness: K, N/m.
        virtual_damping: B, N s/m, through the backward difference.
        period: T, s.
        delay: in samples, may be fractional.
        velocity_filter: alpha of v <- alpha v + (1 - alpha) dx/T.
        virtual_mass: M, kg, through the second backward difference; alone it requires 2M/T.
        law: sampled control law from motion (m) to force (N), added to these.

    Raises:
        StabilityError: a value out of range, or a law that is not causal or not stable.
    """
    wall = _Wall(stiffness, virtual_damping, period, delay, velocity_filter, virtual_mass, law)
    return max(0.0, _maximum(wall.required_damping, wall.delay))


def sufficient_damping(
    *, stiffness: float | str, virtual_damping: float | str = 0.0, period: float | str, delay: float = 0.0
) -> float:
    """Return K(n + 1/2)T + |B| (N s/m), n the delay rounded up: an upper bound of ``passive_damping``."""
    t = positive(period, "period", "s")
    n = np.ceil(not_negative(delay, "delay", "samples"))
    spring = not_negative(stiffness, "stiffness", "N/m") * float(n + 0.5) * t
    return spring + abs(finite(virtual_damping, "virtual_damping", "N*s/m"))


def passive_stiffness(
    *,
    damping: float | str,
    period: float | str,
    virtual_damping: ArrayLike = 0.0,
    delay: float = 0.0,
    velocity_filter: float = 0.0,
) -> Array:
    """Return the largest passive K (N/m) with the device damping b, for each B; 0 where no wall is passive.

    Args:
        damping: b, N s/m.
        period: T, s.
        virtual_damping: B, N s/m, any shape.
        delay: in samples, may be fractional.
        velocity_filter: alpha.

    Raises:
        StabilityError: a value out of range.
    """
    b = not_negative(damping, "damping", "N*s/m")
    values = array_to_si(virtual_damping, "N*s/m", "virtual_damping", error=StabilityError)
    out = np.zeros(values.size)
    for i, b_wall in enumerate(values.ravel()):
        wall = _Wall(0.0, float(b_wall), period, delay, velocity_filter, 0.0, None)
        if _maximum(wall.required_damping, wall.delay) > b * (1 + 1e-12):
            continue
        low, high = 0.0, 2.0 * b / wall.period * (1 + 1e-9)  # limit of the hold alone
        spread = abs(float(b_wall)) * 4 / wall.period
        high = high + spread
        for _ in range(60):  # the requirement is convex in K, so passive K form an interval from zero
            middle = 0.5 * (low + high)
            inside = (
                _maximum(
                    _Wall(middle, float(b_wall), period, delay, velocity_filter, 0.0, None).required_damping, delay
                )
                <= b
            )
            low, high = (middle, high) if inside else (low, middle)
            if high - low <= 1e-13 * high:
                break
        out[i] = low
    return out.reshape(values.shape)


class _Wall:
    """Damping that a sampled wall requires of the device at each angle."""

    def __init__(
        self,
        stiffness: float | str,
        virtual_damping: float | str,
        period: float | str,
        delay: float,
        velocity_filter: float,
        virtual_mass: float | str,
        law: Any,
    ) -> None:
        self.period = positive(period, "period", "s (a rate of zero has none)")
        self.stiffness = finite(stiffness, "stiffness", "N/m")
        self.damping = finite(virtual_damping, "virtual_damping", "N*s/m")
        self.delay = not_negative(delay, "delay", "samples (a negative one would not be causal)")
        self.alpha = fraction(velocity_filter, "velocity_filter")
        self.mass = finite(virtual_mass, "virtual_mass", "kg")
        self.law: control.StateSpace | None = None if law is None else causal_controller(law, self.period)

    def over_difference(self, theta: Array) -> NDArray[np.complex128]:
        """Return H/(z - 1), force per change of position, (k,), N/m, at angles (k,), rad per sample."""
        t, a = self.period, self.alpha
        z = np.exp(1j * theta)
        z_minus_one = -2 * np.sin(theta / 2) ** 2 + 1j * np.sin(theta)
        result = (
            self.stiffness / z_minus_one + self.damping / t * (1 - a) / (z - a) + self.mass / t**2 * z_minus_one / z**2
        )
        if self.law is not None:
            result = result + frequency_values(self.law, z) / z_minus_one
        return np.asarray(result, dtype=complex)

    def required_damping(self, theta: Array) -> Array:
        """Return the damping (k,), N s/m, required at angles ``theta`` (k,), rad per sample."""
        whole = np.floor(self.delay + 1e-12)
        part = max(self.delay - whole, 0.0)
        h = self.over_difference(theta) * np.exp(-1j * whole * theta)
        if part < 1e-12:
            return np.asarray(-self.period * h.real, dtype=float)
        # In the first `part` of a period the older force acts. With displacements p and q in the two parts, the work is
        # f*(q + z p), the change of position p + q, and the dissipation b (p^2/part + q^2/(1 - part))/T.
        z = np.exp(1j * theta)
        inner = part * np.conj(z) + (1 - part)  # weighted inner product of the two forms, each of length 1
        real, imag = (h * inner).real, (h * inner).imag
        root = np.sqrt(np.maximum(np.abs(h) ** 2 - imag**2, 0.0))
        return np.asarray(0.5 * self.period * (root - real), dtype=float)


def _maximum(function: Callable[[Array], Array], delay: float) -> float:
    """Return the maximum of a smooth function of theta over (0, pi], by a grid refined about its maximum."""
    theta = np.concatenate([np.geomspace(1e-5, 1e-2, 40), np.linspace(1.1e-2, np.pi, 400 * (int(delay) + 1))])
    values = function(theta)
    for _ in range(6):
        k = int(np.argmax(values))
        low, high = theta[max(k - 1, 0)], theta[min(k + 1, len(theta) - 1)]
        theta = np.linspace(low, high, 41)
        values = function(theta)
    return float(values.max())


def field_damping(
    *, lipschitz: float | str, longest_period: float | str, delay: int = 0, virtual_damping: float | str = 0.0
) -> float:
    """Return the damping (N s/m) with which a nonlinear conservative force field is passive, with late ticks.

    The condition is lambda_min(D) >= L (T_max/2 + n T_max) + B_max, with D the device damping at the tip and L the
    Lipschitz constant of the force. It is sufficient in general and exact for the stiffest wall.

    Args:
        lipschitz: L, largest change of force per displacement in the field, N/m.
        longest_period: T_max, longest time between ticks, s.
        delay: n, samples.
        virtual_damping: B_max, damping by backward difference, N s/m.

    Raises:
        StabilityError: a negative value, or a longest period that is not positive.
    """
    slope = not_negative(lipschitz, "lipschitz", "N/m")
    longest = positive(longest_period, "longest_period", "s")
    samples = not_negative(delay, "delay", "samples")
    return slope * longest * (0.5 + samples) + not_negative(virtual_damping, "virtual_damping", "N*s/m")


def quantized_stiffness(
    *,
    damping: float | str,
    coulomb: float | str,
    period: float | str,
    quantum: float | str,
    virtual_damping: float | str = 0.0,
) -> float:
    """Return the largest passive K (N/m) of a wall seen through an encoder: min(2(b - B)/T, 2 f_c/Delta - 2B/T).

    Viscous damping dissipates the energy generated by sampling, Coulomb friction that generated by quantization
    (Abbott & Okamura 2005, for B = 0). The result is 0 where no wall is passive.

    Args:
        damping: b, N s/m.
        coulomb: f_c, N.
        period: T, s.
        quantum: Delta, one count at the tip, m; 0 for none.
        virtual_damping: B of the wall, N s/m, by backward difference.

    Raises:
        StabilityError: a value out of range.
    """
    t = positive(period, "period", "s")
    lost = 2 * not_negative(virtual_damping, "virtual_damping", "N*s/m") / t
    sampled = 2 * not_negative(damping, "damping", "N*s/m") / t
    friction = not_negative(coulomb, "coulomb", "N")
    step = not_negative(quantum, "quantum", "m")
    bound = sampled if step == 0.0 else min(sampled, 2 * friction / step)
    return max(0.0, bound - lost)


def coulomb_amplitude(
    *, mass: float | str, stiffness: float | str, damping: float | str, coulomb: float | str, period: float | str
) -> float:
    """Return the amplitude A* (m) below which Coulomb friction damps an oscillation against the wall.

    A* = 4 f_c / (pi sqrt(K/m) (KT/2 - b)), from the describing function of Coulomb friction. A larger oscillation
    grows. The result is inf where b >= KT/2, and accurate where sqrt(K/m) T << 1.

    Args:
        mass: kg; stiffness: K, N/m; damping: b, N s/m; coulomb: f_c, N; period: T, s.

    Raises:
        StabilityError: a value out of range.
    """
    m, k = positive(mass, "mass", "kg"), positive(stiffness, "stiffness", "N/m")
    deficit = k * positive(period, "period", "s") / 2 - not_negative(damping, "damping", "N*s/m")
    friction = not_negative(coulomb, "coulomb", "N")
    if deficit <= 0:
        return float("inf")
    return float(4 * friction / (np.pi * np.sqrt(k / m) * deficit))


def coupling_damping(*, coupling_stiffness: float | str, coupling_damping: float | str, period: float | str) -> float:
    """Return b_c + k_c T/2 (N s/m), the least device damping for passivity with every passive discrete object.

    Args:
        coupling_stiffness: k_c, N/m, of the virtual coupling.
        coupling_damping: b_c, N s/m, by backward difference.
        period: T, s.

    Raises:
        StabilityError: a value out of range.
    """
    k = not_negative(coupling_stiffness, "coupling_stiffness", "N/m")
    b = not_negative(coupling_damping, "coupling_damping", "N*s/m")
    if k == 0.0 and b == 0.0:
        raise StabilityError("a virtual coupling needs a stiffness or a damping above zero")
    return b + k * positive(period, "period", "s") / 2
