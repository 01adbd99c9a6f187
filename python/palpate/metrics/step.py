"""What a step response shows: overshoot, settling, steady value and error, and whether a swing grows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["StepResponse", "step_response"]


@dataclass(frozen=True)
class StepResponse:
    """One channel's answer to a step.

    Attributes:
        steady: mean over the last twentieth of the response, the channel's unit.
        expected: what it should settle at, same unit; None if nothing was expected.
        error_percent: (steady - expected) / |expected| * 100; None without an expected value other than 0.
        overshoot_percent: how far the peak passes the steady value, of the way there; 0 if it never does, or if the
            response comes back to where it began (within `band` of its peak).
        settling_time: s after the step from when on it stays within the band of the steady value; None if it
            has not stayed there for the last twentieth of the response.
        peak: value farthest from where it began, same unit.
        ripple: half the difference of largest and smallest value in the last twentieth, same unit.
        swing_growth: peak-to-peak swing in the last quarter over that in the quarter before: above 1 it grows. None if
            the last half does not swing (fewer than four passes through its mean in either quarter).
    """

    steady: float
    expected: float | None
    error_percent: float | None
    overshoot_percent: float
    settling_time: float | None
    peak: float
    ripple: float
    swing_growth: float | None


def step_response(
    time: ArrayLike,
    values: ArrayLike,
    *,
    start: float = 0.0,
    expected: float | None = None,
    band: float = 0.05,
) -> StepResponse:
    """Describe the response of `values` (n,) at `time` (n,), s, to a step at `start`, s.

    `band` is the settling band, as a fraction of the way from the value at `start` to the steady value; of the way to
    the peak where the response comes back.

    Raises:
        ValueError: fewer than two samples from `start` on, other shapes, or values that are not finite.
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
    way = steady - begin
    farthest = int(np.argmax(np.abs(y - begin)))
    reach = float(abs(y[farthest] - begin))
    overshoot, measure = 0.0, reach
    if abs(way) > band * reach:
        overshoot, measure = max(0.0, float(np.max((y - steady) / way))) * 100.0, abs(way)
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
    )


def _swing_growth(y: NDArray[np.float64], reach: float) -> float | None:
    quarter = len(y) // 4
    before, last = y[-2 * quarter : -quarter], y[-quarter:]
    for part in (before, last):
        above = part > np.mean(part) if quarter else part
        if quarter < 8 or np.ptp(part) <= 1e-9 * reach or np.count_nonzero(np.diff(above)) < 4:
            return None
    return float(np.ptp(last) / np.ptp(before))
