"""Step response metrics: overshoot, settling time, steady value and error, growth of an oscillation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["StepResponse", "step_response"]


@dataclass(frozen=True)
class StepResponse:
    """Step response of one channel.

    Attributes:
        steady: mean over the last twentieth of the response, the channel's unit.
        expected: expected steady value, same unit; None if unknown.
        error_percent: (steady - expected) / |expected| * 100; None without an expected value other than 0.
        overshoot_percent: overshoot of the peak over the steady value, relative to the step; 0 if there is none, or if
            the response returns.
        settling_time: time after the step from which the response stays within the band of the steady value, s; None
            if it is outside during the last twentieth of the response.
        peak: value farthest from the initial one, same unit.
        ripple: half the peak-to-peak value of the last twentieth, same unit.
        swing_growth: peak-to-peak value of the last quarter over that of the quarter before. None if the last half
            does not oscillate (fewer than four crossings of its mean in either quarter).
        returns: whether the steady value is the initial one within `band` of the way to the peak, as after an impact.
    """

    steady: float
    expected: float | None
    error_percent: float | None
    overshoot_percent: float
    settling_time: float | None
    peak: float
    ripple: float
    swing_growth: float | None
    returns: bool


def step_response(
    time: ArrayLike,
    values: ArrayLike,
    *,
    start: float = 0.0,
    expected: float | None = None,
    band: float = 0.05,
) -> StepResponse:
    """Return the metrics of a step response.

    Args:
        time: (n,), s.
        values: (n,), any unit.
        start: time of the step, s.
        expected: expected steady value, same unit.
        band: settling band as a fraction of the step from the initial to the steady value; of the step to the peak
            where the response returns to its initial value.

    Raises:
        ValueError: fewer than two samples from `start` on, different shapes, or values that are not finite.
    """
    t, y = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if t.ndim != 1 or t.shape != y.shape:
        raise ValueError(f"time and values must be two lists of one length, not {t.shape} and {y.shape}")
    after = t >= start - 1e-9
    t, y = t[after] - start, y[after]
    if len(t) < 2:
        raise ValueError(f"a step response needs samples after the step at {start} s")
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(y))):
        raise ValueError("a step response needs finite values")

    tail = y[-max(1, len(y) // 20) :]
    begin, steady = float(y[0]), float(np.mean(tail))
    step = steady - begin
    farthest = int(np.argmax(np.abs(y - begin)))
    reach = float(abs(y[farthest] - begin))
    overshoot, measure = 0.0, reach
    returns = abs(step) <= band * reach
    if not returns:
        overshoot, measure = max(0.0, float(np.max((y - steady) / step))) * 100.0, abs(step)
    settled: float | None = 0.0
    outside = np.flatnonzero(np.abs(y - steady) > band * measure)
    if len(outside):
        last = int(outside[-1])
        settled = float(t[last + 1]) if last < len(y) - len(tail) else None
    error = None if not expected else (steady - expected) / abs(expected) * 100.0
    return StepResponse(
        steady=steady,
        expected=expected,
        error_percent=error,
        overshoot_percent=overshoot,
        settling_time=settled,
        peak=float(y[farthest]),
        ripple=float(np.ptp(tail)) / 2.0,
        swing_growth=_swing_growth(y, reach),
        returns=returns,
    )


def _swing_growth(y: NDArray[np.float64], reach: float) -> float | None:
    quarter = len(y) // 4
    before, last = y[-2 * quarter : -quarter], y[-quarter:]
    for part in (before, last):
        above = part > np.mean(part) if quarter else part
        if quarter < 8 or np.ptp(part) <= 1e-9 * reach or np.count_nonzero(np.diff(above)) < 4:
            return None
    return float(np.ptp(last) / np.ptp(before))
