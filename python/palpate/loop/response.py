"""What a step response shows: overshoot, settling, steady value and error."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["StepResponse", "step_response"]


@dataclass(frozen=True)
class StepResponse:
    """One channel's answer to a step.

    Attributes:
        steady: mean over the last twentieth of the response, the channel's unit.
        expected: what it should settle at, same unit; None if nothing was expected.
        error_percent: (steady - expected) / |expected| * 100; None without an expected value other than 0.
        overshoot_percent: how far the peak passes the steady value, of the way there; 0 if it never does.
        settling_time: s after the step from when on it stays within the band of the steady value; None if it
            has not stayed there for the last twentieth of the response.
        peak: value farthest from where it began, same unit.
        ripple: half the difference of largest and smallest value in the last twentieth, same unit.
    """

    steady: float
    expected: float | None
    error_percent: float | None
    overshoot_percent: float
    settling_time: float | None
    peak: float
    ripple: float


def step_response(
    time: ArrayLike,
    values: ArrayLike,
    *,
    start: float = 0.0,
    expected: float | None = None,
    band: float = 0.05,
) -> StepResponse:
    """Describe the response of `values` (n,) at `time` (n,), s, to a step at `start`, s.

    `band` is the settling band, as a fraction of the way from the value at `start` to the steady value.

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
    overshoot = 0.0
    settled: float | None = 0.0
    if way != 0.0:
        overshoot = max(0.0, float(np.max((y - steady) / way))) * 100.0
        outside = np.flatnonzero(np.abs(y - steady) > band * abs(way))
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
    )
