"""Whether a hand feels the ripple of a servo: the spectrum of the tip's motion against the threshold of touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal.windows import flattop

from palpate.checks import positive
from palpate.errors import StabilityError

__all__ = ["Ripple", "ripple", "vibration_threshold"]

Array = NDArray[np.float64]
BEST = 250.0  # Hz, where the skin feels best
LEAST = 0.1e-6  # m, the amplitude it feels there
FLAT = 40.0  # Hz, below which the threshold is flat


@dataclass(frozen=True)
class Ripple:
    """The tip's ripple.

    Attributes:
        frequency: (k,), Hz; amplitude: (k,), m, of a sine at each, all axes together.
        threshold: (k,), m.
        worst: frequency at which amplitude over threshold is largest, Hz.
        ratio: amplitude over threshold there; above 1 it is perceptible.
    """

    frequency: Array
    amplitude: Array
    threshold: Array
    worst: float
    ratio: float

    @property
    def perceptible(self) -> bool:
        """Whether a line of the spectrum is above the threshold."""
        return self.ratio > 1.0

    def __str__(self) -> str:
        at = int(np.argmax(self.amplitude / self.threshold))
        said = f"{1e6 * self.amplitude[at]:.3g} um at {self.worst:.4g} Hz"
        if self.perceptible:
            return f"The ripple is perceptible: {said}, {self.ratio:.3g} times the threshold of a fingertip."
        return f"The ripple is not perceptible: {said}, {self.ratio:.2g} of the threshold of a fingertip."


def vibration_threshold(frequency: ArrayLike) -> Array:
    """Return the least amplitude (m) of a vibration that a fingertip feels, at each frequency (Hz).

    Flat up to 40 Hz, then 12 dB an octave down to 0.1 um at 250 Hz, and as steeply up again (Verrillo 1963, contactors
    of 2.9 cm^2 and more on the thenar eminence; Gescheider & Verrillo 1979). A tool held in the whole hand is felt
    better: at 40 and 300 Hz the threshold was 68 and 88 % lower than with a small probe (Brisben, Hsiao & Johnson
    1999).
    """
    f = np.maximum(np.asarray(frequency, dtype=float), FLAT)
    return np.asarray(LEAST * np.maximum(BEST / f, f / BEST) ** 2, dtype=float)


def ripple(tip: ArrayLike, period: float, lowest: float = 20.0) -> Ripple:
    """Return the ripple of a tip that is at rest but for it.

    Args:
        tip: (n,) or (n, axes), m, one sample a period, of a stretch without deliberate motion; a slope is taken out.
        period: between samples, s.
        lowest: Hz, below which motion is not counted as ripple.

    Raises:
        StabilityError: too short for ``lowest``, or not finite.
    """
    t = positive(period, "period", "s")
    x = np.asarray(tip, dtype=float)
    x = x[:, None] if x.ndim == 1 else x
    if not np.all(np.isfinite(x)):
        raise StabilityError("tip: a motion must be finite")
    if len(x) * t * lowest < 10:
        raise StabilityError(
            f"tip: {len(x) * t:.3g} s is too short a stretch to tell {lowest:g} Hz; it takes {10 / lowest:.3g} s"
        )
    line = np.linspace(-1, 1, len(x))
    ripple = x - np.polynomial.polynomial.polyval(line, np.polynomial.polynomial.polyfit(line, x, 1)).T
    window = flattop(len(x), sym=False)  # a sine between two lines keeps its amplitude
    lines = 2 / window.sum() * np.abs(np.fft.rfft(ripple * window[:, None], axis=0))
    amplitude = np.asarray(np.linalg.norm(lines, axis=1), dtype=float)
    f = np.fft.rfftfreq(len(x), t)
    keep = (f >= lowest) & (f < 0.5 / t)
    f, amplitude, threshold = f[keep], amplitude[keep], vibration_threshold(f[keep])
    at = int(np.argmax(amplitude / threshold))
    return Ripple(np.asarray(f, float), amplitude, threshold, float(f[at]), float(amplitude[at] / threshold[at]))
