"""Work of tips on a body, and what a body returns beyond it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from palpate.fem import ContactHistory


def path_work(felt: ContactHistory, path: np.ndarray) -> np.ndarray:
    """Return the work of the tip on the body in each step of its path (m, 3), J: (m - 1,)."""
    return -(0.5 * (felt.force[1:] + felt.force[:-1]) * np.diff(path, axis=0)).sum(axis=1)


def largest_fall(felt: Sequence[ContactHistory], paths: Sequence[np.ndarray]) -> float:
    """Return the largest fall of the work of all tips of a body less its stored energy, J."""
    work = sum(path_work(one, path) for one, path in zip(felt, paths, strict=True))
    kept = np.cumsum(work) - felt[0].energy[1:]
    return float((np.maximum.accumulate(kept) - kept).max())
