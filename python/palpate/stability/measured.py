"""Critical stiffness from a measured frequency response, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.checks import finite, fraction, not_negative, positive
from palpate.errors import StabilityError

__all__ = ["MeasuredResponse", "MeasuredVerdict"]


@dataclass(frozen=True)
class MeasuredVerdict:
    """Verdict of a measured response on a wall.

    Attributes:
        known: whether the response determines the limit; if not, ``sentence`` has the reason.
        critical_stiffness: N/m, nan if not known.
        low: lower end of its 95 % interval, N/m.
        high: upper end, N/m.
        frequency: frequency of the oscillation at the limit, Hz.
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
    """Sampled response of a device from commanded force to measured tip motion, hold and delay included.

    Attributes:
        frequency: Hz, increasing (k,).
        response: m/N, complex (k,).
        deviation: standard deviation of the real and of the imaginary part, m/N, (k,); None: estimated from the
            roughness of the curve.
        period: T, s.

    Raises:
        StabilityError: the shapes differ, the frequencies do not increase or exceed half the sampling rate, or a
            value is not finite.
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
        object.__setattr__(self, "period", positive(self.period, "period", "s"))
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
        self, virtual_damping: float | str = 0.0, *, delay: float = 0.0, velocity_filter: float = 0.0
    ) -> MeasuredVerdict:
        """Return the stiffness at which the measured device against a wall becomes unstable, or why it is unknown.

        Two assumptions cannot be seen in a response. The device is stable or at rest anywhere without a wall. It has
        no resonance narrower than the spacing of the frequencies.

        Args:
            virtual_damping: B, N s/m.
            delay: in samples, in addition to the delay in the response.
            velocity_filter: alpha.
        """
        b = finite(virtual_damping, "virtual_damping", "N*s/m")
        n, alpha = not_negative(delay, "delay", "samples"), fraction(velocity_filter, "velocity_filter")
        f, g = self.frequency, self.response
        if len(f) < 16:
            return _unknown(f"the response has {len(f)} frequencies, and at least 16 are needed")
        noise = self._noise()
        relative = float(np.median(noise / np.abs(g)))
        if relative > 0.3:
            return _unknown(f"the response is too noisy: its relative noise is {100 * relative:.0f} %, above 30 %")
        theta = 2 * np.pi * f * self.period
        z = np.exp(1j * theta)
        wall = -np.exp(1j * n * theta) / g
        rotation = np.abs(np.angle(wall[1:] / wall[:-1]))
        rate = (1 - alpha) / self.period * (z - 1) / (z - alpha)
        mismatch = wall.imag - b * rate.imag
        deviation = np.abs(wall) * noise / np.abs(g)  # of the real and of the imaginary part of W
        stiffness = wall.real - b * rate.real
        places = np.nonzero((mismatch[:-1] * mismatch[1:] <= 0) & ((stiffness[:-1] > 0) | (stiffness[1:] > 0)))[0]
        if places.size == 0:
            return self._no_crossing()
        i = min((max(stiffness[k], stiffness[k + 1]), int(k)) for k in places)[1]
        about = slice(max(i - 1, 0), i + 2)
        if rotation[about].max() > 0.5:
            return _unknown(
                f"the frequencies are too far apart about {f[i]:g} Hz: the phase changes by "
                f"{np.degrees(rotation[about].max()):.0f} degrees from one to the next, and 29 is the limit"
            )
        window = slice(max(i - 5, 0), i + 7)
        angle, critical, sigma = _crossing(
            theta[window], mismatch[window], stiffness[window], deviation[window], theta[i : i + 2]
        )
        if not np.isfinite(sigma) or not 2 * sigma < 0.5 * critical:
            return _unknown(
                f"the response is too noisy about {f[i]:g} Hz: the error of the critical stiffness near "
                f"{stiffness[i]:.4g} N/m could exceed 50 %"
            )
        frequency = float(angle / (2 * np.pi * self.period))
        low, high = critical - 2 * sigma, critical + 2 * sigma
        sentence = (
            f"Stable up to {critical:.4g} N/m (95 %: {low:.4g} to {high:.4g} N/m), where it oscillates at "
            f"{frequency:.4g} Hz."
        )
        return MeasuredVerdict(True, critical, low, high, frequency, sentence)

    def _no_crossing(self) -> MeasuredVerdict:
        low, high, nyquist = self.frequency[0], self.frequency[-1], 0.5 / self.period
        if high < 0.49 / self.period:
            return _unknown(
                f"the response is too short: it ends at {high:g} Hz, below the oscillation of the loop; measure up to "
                f"{nyquist:g} Hz"
            )
        return _unknown(
            f"no stiffness puts an oscillation between {low:g} Hz and {high:g} Hz; measure lower frequencies, "
            "and check that the response includes the hold and the delay of the loop"
        )

    def _noise(self) -> Array:
        """Return the standard deviation of each part (k,), m/N, given or from the second differences."""
        if self.deviation is not None:
            return np.asarray(self.deviation, dtype=float)
        relative = np.log(self.response / self.response[0])
        phase = np.unwrap(relative.imag)
        curve = relative.real + 1j * phase
        x = np.log(self.frequency)
        # deviation from the straight line through the two neighbors
        weight = (x[2:] - x[1:-1]) / (x[2:] - x[:-2])
        deviation = curve[1:-1] - weight * curve[:-2] - (1 - weight) * curve[2:]
        size = np.sqrt(1 + weight**2 + (1 - weight) ** 2)
        level = float(np.median(np.abs(deviation) / size)) / 1.1774  # the median of a Rayleigh variate
        return np.asarray(level * np.abs(self.response), dtype=float)


def _crossing(
    theta: Array, mismatch: Array, stiffness: Array, deviation: Array, between: Array
) -> tuple[float, float, float]:
    """Return (angle, critical stiffness, its standard deviation) where ``mismatch`` crosses zero.

    Cubics are fitted to both curves over a few points. Noise acts through the slope of ``mismatch`` and directly on
    the stiffness. The difference from a fit by parabolas is added as the error of the fit.
    """
    center, width = float(between.mean()), float(np.ptp(theta)) / 2
    x = (theta - center) / width
    found = []
    for degree in (3, 2):
        wave = np.polynomial.Polynomial.fit(x, mismatch, degree, domain=[-1, 1], window=[-1, 1])
        level = np.polynomial.Polynomial.fit(x, stiffness, degree, domain=[-1, 1], window=[-1, 1])
        roots = wave.roots()
        real = roots.real[np.abs(roots.imag) < 1e-9]
        if real.size == 0:
            return float("nan"), float("nan"), float("inf")
        root = float(real[np.argmin(np.abs(real))])
        found.append((root, float(level(root)), float(level.deriv()(root)), float(wave.deriv()(root))))
    root, critical, slope, steepness = found[0]
    powers = np.vander(x, 4, increasing=True)
    weights = (root ** np.arange(4)) @ np.linalg.pinv(powers)  # weight of each point in the fitted value at the root
    noise = float(np.sqrt(np.sum((weights * deviation) ** 2)))
    if abs(root) > 1 or steepness == 0:
        return float("nan"), float("nan"), float("inf")
    sigma = np.hypot(noise * np.hypot(1.0, slope / steepness), critical - found[1][1])
    return center + width * root, critical, float(sigma)


def _unknown(reason: str) -> MeasuredVerdict:
    nan = float("nan")
    return MeasuredVerdict(False, nan, nan, nan, nan, f"Undecided: {reason}.")
