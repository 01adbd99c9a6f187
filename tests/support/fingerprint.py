"""One number for a whole array, so that a test can store a result with many entries."""

from __future__ import annotations

from typing import Any

import numpy as np


def fingerprint(values: Any, smallest: float = 1e-6) -> float:
    """Return a number that changes with the size, the shape, the order and every entry of an array.

    Entries count by their logarithm, so that small ones are seen too; those below ``smallest`` times the largest one
    count linearly, so that rounding errors do not show.
    """
    x = np.asarray(values)
    parts = [x.real, x.imag] if np.iscomplexobj(x) else [np.asarray(x, dtype=float)]
    total = float(np.sum(np.sqrt(np.arange(2.0, 2.0 + x.ndim)) * x.shape))
    largest = max(float(np.abs(part).max(initial=0.0)) for part in parts)
    if largest == 0.0:
        return total
    for part in parts:
        flat = part.ravel() / (smallest * largest)
        weight = 1.0 + 0.5 * np.cos(1.0 + 1.3 * np.arange(len(flat)))
        total += float(np.sum(weight * np.sign(flat) * np.log1p(np.abs(flat))) / np.sqrt(len(flat)))
    return total + float(np.log(largest))
