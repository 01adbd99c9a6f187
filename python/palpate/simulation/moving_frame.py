"""Traces of moving objects, seen from the object."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.arrays import Array


class Channels(Protocol):
    """Channels of a trace by name."""

    def __getitem__(self, name: str) -> Array: ...
    def __contains__(self, name: object) -> bool: ...


def seen_from_object(trace: Channels, points: Array) -> Array:
    """Return positions (n, 3), m, at the samples of a trace, in the frame of its object if that moves."""
    if "frame_position" not in trace:
        return points
    place, rotation = trace["frame_position"], Rotation.from_rotvec(trace["frame_rotation"])
    return np.asarray(rotation.inv().apply(points - place), dtype=float)
