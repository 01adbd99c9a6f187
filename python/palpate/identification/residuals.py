"""Residual tests: residuals of a good model are white and independent of inputs (Ljung 1999, 16.5 to 16.6)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal, stats

from palpate.arrays import Array
from palpate.errors import RecordingError


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation of one residual.

    Attributes:
        correlation: (lags,) at lags 1, 2, …; 1 is perfect correlation.
        limit: bound of a white residual's correlation at each lag, with the stated confidence.
        statistic: of Ljung & Box, chi-square with `lags` degrees of freedom for a white residual.
        p_value: probability of a larger statistic if the residual is white.
        passed: p_value is at least 1 - confidence.
    """

    correlation: Array
    limit: float
    statistic: float
    p_value: float
    passed: bool


@dataclass(frozen=True)
class Independence:
    """Cross-correlation of one residual with one past input.

    Attributes:
        correlation: (lags + 1,) of the residual with the input 0, 1, … samples before.
        limit: bound of an independent residual's correlation at each lag, with the stated confidence.
        passed: the number of lags outside the bound is within the 99 % quantile of chance.
    """

    correlation: Array
    limit: float
    passed: bool


def whiteness(residual: Array, lags: int = 25, confidence: float = 0.99) -> Whiteness:
    """Test whether `residual` (n,) is white.

    Raises:
        RecordingError: fewer than four times as many samples as lags, or a constant residual.
    """
    e = _centred(residual, lags)
    n = len(e)
    full = signal.correlate(e, e, mode="full", method="fft")[n - 1 : n + lags]
    correlation = full[1:] / full[0]
    statistic = float(n * (n + 2) * np.sum(correlation**2 / (n - np.arange(1, lags + 1))))
    p_value = float(stats.chi2.sf(statistic, lags))
    limit = float(stats.norm.ppf(0.5 + 0.5 * confidence) / np.sqrt(n))
    return Whiteness(np.asarray(correlation, dtype=float), limit, statistic, p_value, p_value >= 1 - confidence)


def independence(residual: Array, driven: Array, lags: int = 25, confidence: float = 0.99) -> Independence:
    """Test whether `residual` (n,) is independent of the past of the input `driven` (n,).

    The limit includes the color of both: z sqrt(sum of R_e R_u over all lags / n). In a closed loop the residual acts
    on later inputs through the servo. Those lags do not depend on the model and are not tested.
    """
    e, u = _centred(residual, lags), _centred(driven, lags)
    n = len(e)
    if len(u) != n:
        raise RecordingError(f"residual and input must be equally long; they have {n} and {len(u)} samples")
    scale = np.sqrt((e @ e) * (u @ u))
    cross = signal.correlate(e, u, mode="full", method="fft")[n - 1 : n + lags] / scale
    auto = [signal.correlate(x, x, mode="full", method="fft") / (x @ x) for x in (e, u)]
    near = slice(n - 1 - 4 * lags, n + 4 * lags) if n > 4 * lags else slice(None)
    spread = max(float(np.sum(auto[0][near] * auto[1][near])), 1.0)
    limit = float(stats.norm.ppf(0.5 + 0.5 * confidence) * np.sqrt(spread / n))
    outside = int(np.sum(np.abs(cross) > limit))
    allowed = int(stats.binom.ppf(0.99, lags + 1, 1 - confidence))
    return Independence(np.asarray(cross, dtype=float), limit, outside <= allowed)


def _centred(values: Array, lags: int) -> Array:
    x = np.array(values, dtype=float)
    if x.ndim != 1 or len(x) < 4 * lags or lags < 1:
        raise RecordingError(f"a residual test over {lags} lags needs at least {4 * lags} samples of one signal")
    x -= x.mean()
    if not np.any(x):
        raise RecordingError("the signal of a residual test is constant")
    return x
