"""Ripple of a servo: spectrum of the tip motion compared with the vibrotactile threshold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.signal.windows import flattop

from palpate.arrays import Array
from palpate.checks import positive
from palpate.errors import StabilityError

__all__ = ["Ripple", "ripple", "vibration_threshold"]

PEAK_FREQUENCY = 250.0  # Hz, of the highest sensitivity
MIN_THRESHOLD = 0.1e-6  # m, threshold there
FLAT_LIMIT = 40.0  # Hz, below which the threshold is constant


@dataclass(frozen=True)
class Ripple:
    """Ripple of the tip.

    Attributes:
        frequency: (k,), Hz; amplitude: (k,), m, of the sine at each frequency, norm over the axes.
        threshold: (k,), m.
        worst: frequency of the largest amplitude over threshold, Hz.
        ratio: largest amplitude over threshold; perceptible above 1.
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
        line = f"{1e6 * self.amplitude[at]:.3g} µm at {self.worst:.4g} Hz"
        if self.perceptible:
            return f"The ripple is perceptible: {line}, {self.ratio:.3g} times the threshold of a fingertip."
        return f"The ripple is not perceptible: {line}, {self.ratio:.2g} of the threshold of a fingertip."


def vibration_threshold(frequency: ArrayLike) -> Array:
    """Return the detection threshold (m) of a vibration at the fingertip for each frequency (Hz).

    The threshold is constant up to 40 Hz, falls by 12 dB per octave to 0.1 µm at 250 Hz and rises equally above.
    Source: Verrillo 1963, contactors of at least 2.9 cm^2 on the thenar eminence; Gescheider & Verrillo 1979.
    Thresholds for a tool grasped in the whole hand are lower, by 68 % at 40 Hz and 88 % at 300 Hz (Brisben, Hsiao &
    Johnson 1999).
    """
    f = np.maximum(np.asarray(frequency, dtype=float), FLAT_LIMIT)
    return np.asarray(MIN_THRESHOLD * np.maximum(PEAK_FREQUENCY / f, f / PEAK_FREQUENCY) ** 2, dtype=float)


def ripple(tip: ArrayLike, period: float, lowest: float = 20.0) -> Ripple:
    """Return the ripple of a tip without deliberate motion.

    Args:
        tip: (n,) or (n, axes), m, uniformly sampled; a linear trend is removed.
        period: sampling period, s.
        lowest: lowest frequency of ripple, Hz. Lines above it that are the flank of a slower motion do not count.

    Raises:
        StabilityError: the motion is too short for ``lowest``, or not finite.
    """
    t = positive(period, "period", "s")
    x = np.asarray(tip, dtype=float)
    x = x[:, None] if x.ndim == 1 else x
    if not np.all(np.isfinite(x)):
        raise StabilityError("tip: a motion must be finite")
    if len(x) * t * lowest < 10:
        raise StabilityError(
            f"tip: {len(x) * t:.3g} s is too short a stretch to resolve {lowest:g} Hz, which takes {10 / lowest:.3g} s"
        )
    line = np.linspace(-1, 1, len(x))
    ripple = x - np.polynomial.polynomial.polyval(line, np.polynomial.polynomial.polyfit(line, x, 1)).T
    window = flattop(len(x), sym=False)  # preserves the amplitude of a sine between two lines
    lines = 2 / window.sum() * np.abs(np.fft.rfft(ripple * window[:, None], axis=0))
    amplitude = np.asarray(np.linalg.norm(lines, axis=1), dtype=float)
    f = np.fft.rfftfreq(len(x), t)
    keep = (f >= lowest) & (f < 0.5 / t)
    falls = np.diff(amplitude, prepend=0.0) < 0.0
    keep[: int(np.argmax(keep & ~falls))] = False  # the flank of a slower motion, which the window spreads
    f, amplitude, threshold = f[keep], amplitude[keep], vibration_threshold(f[keep])
    at = int(np.argmax(amplitude / threshold))
    return Ripple(np.asarray(f, float), amplitude, threshold, float(f[at]), float(amplitude[at] / threshold[at]))
