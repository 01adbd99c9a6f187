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
    return turned_to_object(trace, points - trace["frame_position"])


def turned_to_object(trace: Channels, vectors: Array) -> Array:
    """Return vectors (n, 3) at the samples of a trace, such as forces, in the frame of its object if that moves."""
    if "frame_position" not in trace:
        return vectors
    return np.asarray(Rotation.from_rotvec(trace["frame_rotation"]).inv().apply(vectors), dtype=float)


def touching_tip(trace: Channels) -> Array:
    """Return the point that touches the object (n, 3), m, in the frame of the object if that moves.

    It is the tip, or the virtual tool of an admittance display.
    """
    return seen_from_object(trace, trace["tool"] if "tool" in trace else trace["tip"])
