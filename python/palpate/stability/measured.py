"""A verdict from a measured frequency response: what it says, and "cannot tell" where it does not say it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.checks import finite, fraction, not_negative, positive
from palpate.errors import StabilityError

__all__ = ["MeasuredResponse", "MeasuredVerdict"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MeasuredVerdict:
    """What a measured response says about a wall.

    Attributes:
        known: whether it says anything; if not, ``sentence`` has the reason.
        critical_stiffness: N/m, nan if not known.
        low: lower end of its 95 % interval, N/m: claim no more than this.
        high: upper end, N/m.
        frequency: of the oscillation at the limit, Hz.
        sentence: the verdict in words.
    """

    known: bool
    critical_stiffness: float
    low: float
    high: float
    frequency: float
    sentence: str

    def __str__(self) -> str:
        return self.sentence


@dataclass(frozen=True)
class MeasuredResponse:
    """The sampled response of a device, from commanded force to measured tip motion, its own hold and delay in it.

    Attributes:
        frequency: Hz, increasing (k,).
        response: m/N, complex (k,).
        deviation: standard deviation of the response's real and imaginary part, m/N, (k,); None: not known, and then
            estimated from the roughness of the curve.
        period: T, s.

    Raises:
        StabilityError: shapes differ, frequencies do not increase or lie at or above half the rate, values not finite.
    """

    frequency: Array
    response: NDArray[np.complex128]
    period: float
    deviation: Array | None = None

    def __post_init__(self) -> None:
        try:
            object.__setattr__(self, "frequency", np.asarray(self.frequency, dtype=float))
            object.__setattr__(self, "response", np.asarray(self.response, dtype=complex))
        except (TypeError, ValueError):
            raise StabilityError("frequency must be numbers in Hz, response complex numbers in m/N") from None
        positive(self.period, "period", "s")
        f, g = self.frequency, self.response
        if f.ndim != 1 or f.shape != g.shape or len(f) == 0:
            raise StabilityError(
                f"frequency and response must be one list each, of one length, not {f.shape}, {g.shape}"
            )
        if not (np.all(np.isfinite(f)) and np.all(np.isfinite(g))) or np.any(g == 0):
            raise StabilityError("frequency and response must be finite, the response not zero")
        if f[0] <= 0 or np.any(np.diff(f) <= 0) or f[-1] > 0.5 / self.period * (1 + 1e-9):
            raise StabilityError(
                f"frequencies must increase from above 0 to at most half the sampling rate, {0.5 / self.period:g} Hz"
            )
        if self.deviation is not None:
            given = np.asarray(self.deviation, dtype=float)
            if given.shape not in ((), f.shape):
                raise StabilityError(f"deviation must be one number or one for each frequency, {len(f)}, in m/N")
            object.__setattr__(self, "deviation", np.broadcast_to(given, f.shape))
            if np.any(self.deviation < 0) or not np.all(np.isfinite(self.deviation)):
                raise StabilityError("deviation must be finite and not negative, in m/N")

    def critical_stiffness(
        self, virtual_damping: float = 0.0, *, delay: float = 0.0, velocity_filter: float = 0.0
    ) -> MeasuredVerdict:
        """Return the stiffness at which the measured device against a wall loses stability, or why it cannot be told.

        Assumes, as no response can show it, that the device without a wall is stable or rests anywhere, and that it
        has no resonance narrower than the spacing of the frequencies.

        Args:
            virtual_damping: B, N s/m.
            delay: in samples, on top of what the response has in it.
            velocity_filter: alpha.
        """
        b = finite(virtual_damping, "virtual_damping", "N s/m")
        n, alpha = not_negative(delay, "delay", "samples"), fraction(velocity_filter, "velocity_filter")
        f, g = self.frequency, self.response
        if len(f) < 16:
            return _unknown(f"the response has {len(f)} frequencies, and fewer than 16 cannot show where it turns")
        noise = self._noise()
        worst = float(np.median(noise / np.abs(g)))
        if worst > 0.3:
            return _unknown(f"the response is too noisy: its noise is {100 * worst:.0f} % of it, and 30 % is the most")
        theta = 2 * np.pi * f * self.period
        z = np.exp(1j * theta)
        wanted = -np.exp(1j * n * theta) / g
        turn = np.abs(np.angle(wanted[1:] / wanted[:-1]))
        rate = (1 - alpha) / self.period * (z - 1) / (z - alpha)
        off = wanted.imag - b * rate.imag
        spread = np.abs(wanted) * noise / np.abs(g)  # standard deviation of W, each part
        at = wanted.real - b * rate.real
        places = np.nonzero((off[:-1] * off[1:] <= 0) & ((at[:-1] > 0) | (at[1:] > 0)))[0]
        if places.size == 0:
            if f[-1] < 0.49 / self.period:
                return _unknown(
                    f"the response is too short: it ends at {f[-1]:g} Hz, before the loop's oscillation; measure up to "
                    f"{0.5 / self.period:g} Hz"
                )
            return _unknown(
                f"no stiffness puts an oscillation between {f[0]:g} Hz and {f[-1]:g} Hz; measure lower frequencies, "
                "and see that the response has the hold and the delay of the loop in it"
            )
        candidates = [(max(at[i], at[i + 1]), int(i)) for i in places]
        i = min(candidates)[1]
        about = slice(max(i - 1, 0), i + 2)
        if turn[about].max() > 0.5:
            return _unknown(
                f"the frequencies are too far apart about {f[i]:g} Hz: the response turns by "
                f"{np.degrees(turn[about].max()):.0f} degrees from one to the next, and 29 is the most"
            )
        window = slice(max(i - 5, 0), i + 7)
        angle, stiffness, sigma = _crossing(theta[window], off[window], at[window], spread[window], theta[i : i + 2])
        if not np.isfinite(sigma) or not 2 * sigma < 0.5 * stiffness:
            return _unknown(
                f"the response is too noisy about {f[i]:g} Hz: a critical stiffness near {at[i]:.4g} N/m could be "
                "half as large or half as large again"
            )
        frequency = float(angle / (2 * np.pi * self.period))
        low, high = stiffness - 2 * sigma, stiffness + 2 * sigma
        return MeasuredVerdict(
            True,
            stiffness,
            low,
            high,
            frequency,
            f"Stable up to {stiffness:.4g} N/m (95 %: {low:.4g} to {high:.4g} N/m), where it oscillates at "
            f"{frequency:.4g} Hz.",
        )

    def _noise(self) -> Array:
        """Return the standard deviation of the response (each part), given or from its second differences."""
        if self.deviation is not None:
            return np.asarray(self.deviation, dtype=float)
        relative = np.log(self.response / self.response[0])
        phase = np.unwrap(relative.imag)
        curve = relative.real + 1j * phase
        x = np.log(self.frequency)
        # what a straight line through the two neighbours misses, in the middle
        left = (x[2:] - x[1:-1]) / (x[2:] - x[:-2])
        rough = curve[1:-1] - left * curve[:-2] - (1 - left) * curve[2:]
        size = np.sqrt(1 + left**2 + (1 - left) ** 2)
        level = float(np.median(np.abs(rough) / size)) / 1.1774  # the median of a Rayleigh variate
        return np.asarray(level * np.abs(self.response), dtype=float)


def _crossing(theta: Array, off: Array, at: Array, spread: Array, between: Array) -> tuple[float, float, float]:
    """Return (angle, stiffness there, its standard deviation) where ``off`` crosses zero.

    Cubics are fitted to both curves over a few points. Noise moves the angle through the slope of ``off`` and the
    stiffness at it; what a parabola would have said otherwise is added as the error of the fit.
    """
    centre, width = float(between.mean()), float(np.ptp(theta)) / 2
    x = (theta - centre) / width
    found = []
    for degree in (3, 2):
        wave = np.polynomial.Polynomial.fit(x, off, degree, domain=[-1, 1], window=[-1, 1])
        level = np.polynomial.Polynomial.fit(x, at, degree, domain=[-1, 1], window=[-1, 1])
        roots = wave.roots()
        real = roots.real[np.abs(roots.imag) < 1e-9]
        if real.size == 0:
            return float("nan"), float("nan"), float("inf")
        root = float(real[np.argmin(np.abs(real))])
        found.append((root, float(level(root)), float(level.deriv()(root)), float(wave.deriv()(root))))
    root, stiffness, slope, steep = found[0]
    powers = np.vander(x, 4, increasing=True)
    weights = (root ** np.arange(4)) @ np.linalg.pinv(powers)  # of each point in the fit at the root
    noise = float(np.sqrt(np.sum((weights * spread) ** 2)))
    if abs(root) > 1 or steep == 0:
        return float("nan"), float("nan"), float("inf")
    sigma = np.hypot(noise * np.hypot(1.0, slope / steep), stiffness - found[1][1])
    return centre + width * root, stiffness, float(sigma)


def _unknown(reason: str) -> MeasuredVerdict:
    nan = float("nan")
    return MeasuredVerdict(False, nan, nan, nan, nan, f"Cannot tell: {reason}.")
