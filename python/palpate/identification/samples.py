"""Samples of an experiment, and their checks: finite, increasing in time, without gaps, uniform."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.errors import RecordingError

MINIMUM_SAMPLES = 50
JITTER = 0.1  # periods between a time stamp and the uniform grid, above which the sampling is not uniform


@dataclass(frozen=True)
class Columns:
    """Content of a recording's file; `Recording` describes the fields."""

    time: Array
    angle: Array
    torque: Array
    period: float = 0.0
    metadata: dict[str, Any] = field(default_factory=dict)
    excitation: Array | None = None
    units: tuple[str, str] = ("rad", "N*m")


def as_columns(values: ArrayLike, name: str) -> Array:
    """Return `values` as an array (samples, joints). Raise RecordingError for any other shape."""
    array = np.array(values, dtype=float)
    if array.ndim == 1:
        array = array[:, None]
    if array.ndim != 2 or array.shape[1] == 0:
        raise RecordingError(f"{name} must be (samples x joints); its shape is {array.shape}")
    return array


def check_samples(time: Array, channels: dict[str, Array | None], place: Callable[[int], str]) -> None:
    """Raise RecordingError unless samples are finite and uniform; `place` names the sample of an index."""
    if len(time) < MINIMUM_SAMPLES:
        raise RecordingError(f"{len(time)} samples are too few; at least {MINIMUM_SAMPLES} are needed")
    for name, values in {"time": time[:, None], **channels}.items():
        if values is not None and not np.all(np.isfinite(values)):
            row, column = np.argwhere(~np.isfinite(values))[0]
            label = name if name == "time" else f"{name} {column + 1}"
            raise RecordingError(f"{place(int(row))}: {label} is {values[row, column]}, not a finite number")
    steps = np.diff(time)
    if np.any(steps <= 0):
        row = int(np.argmax(steps <= 0)) + 1
        kind = "repeats" if steps[row - 1] == 0 else "is earlier than"
        raise RecordingError(
            f"{place(row)}: the time stamp {time[row]:.9g} s {kind} the one before ({time[row - 1]:.9g} s)"
        )
    period = float(np.median(steps))
    if np.any(steps > 1.5 * period):
        row = int(np.argmax(steps > 1.5 * period)) + 1
        missing = float(steps[row - 1]) / max(period, 1e-300) - 1.0
        raise RecordingError(
            f"{place(row)}: a gap of {steps[row - 1]:.6g} s after {time[row - 1]:.9g} s"
            f", about {missing:.0f} samples missing; the period is {period:.6g} s"
        )
    mean = (time[-1] - time[0]) / (len(time) - 1)
    off = np.abs(time - time[0] - mean * np.arange(len(time)))
    if off.max() > JITTER * mean + 1e-9 * abs(time).max():
        row = int(np.argmax(off > JITTER * mean))
        raise RecordingError(
            f"{place(row)}: the time stamps are not uniform ({time[row]:.9g} s is {off[row]:.3g} s off a grid of "
            f"{mean:.6g} s); resample before identifying"
        )


def uniform_period(time: Array) -> float:
    """Return the period, s, without the rounding error of the time stamps."""
    raw = (time[-1] - time[0]) / (len(time) - 1)
    short = float(f"{raw:.6g}")
    return short if abs(short - raw) * len(time) < 0.01 * raw else float(raw)
