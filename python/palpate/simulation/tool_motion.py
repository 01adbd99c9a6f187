"""Contact points of a tool on a body over time."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from palpate import _core
from palpate.arrays import Array
from palpate.fem.condensed_body import CoreBody
from palpate.scenario import Scenario
from palpate.scenario.body import BodyChoice

_OVERLAP: Final = 0.02  # of the smaller radius: overlap of two tips that counts

__all__ = [
    "closed_over",
    "last_motion",
    "overlapping",
    "step_body",
    "tick_times",
    "tool_in_body",
    "tool_places",
    "tool_poses",
]


def tool_places(choice: BodyChoice, times: ArrayLike = (0.0,)) -> Array:
    """Return the centers of a tool's tips less the device's tip (n, k, 3), m; one tip: zero.

    Args:
        choice: of the body.
        times: n times, s.
    """
    if choice.tool is not None:
        return choice.tool.places(choice.contact_points, times)
    return np.tile(np.array(choice.contact_points or ((0.0, 0.0, 0.0),)), (len(np.asarray(times)), 1, 1))


def tool_in_body(choice: BodyChoice, times: ArrayLike = (0.0,)) -> Array:
    """Return `tool_places` in the frame of the body (n, k, 3), m."""
    return np.asarray(tool_places(choice, times) @ Rotation.from_euler("xyz", choice.rotation).as_matrix())


def tick_times(period: float, time: ArrayLike) -> Array:
    """Return the times without lateness of the ticks at times (n,), s."""
    return np.asarray(np.floor(np.asarray(time) / period + 1e-6) * period)


def tool_poses(scenario: Scenario, time: ArrayLike) -> Array:
    """Return angles, rad, and opening of each tool that moves at times (n,), s: (n, 4 times their number)."""
    when = tick_times(scenario.period, time)
    bodies = [one.object.body for one in scenario.each_object.values()]
    rows = [body.tool.rows() for body in bodies if body is not None and body.tool is not None]
    columns = [np.interp(when, table[:, 0], table[:, axis]) for table in rows for axis in (1, 2, 3, 4)]
    return np.column_stack(columns) if columns else np.empty((len(when), 0))


def last_motion(choice: BodyChoice) -> float:
    """Return the time at which a body's tool comes to rest, s; 0 if it does not move."""
    rows = np.zeros((1, 5)) if choice.tool is None else choice.tool.rows()
    moving = np.flatnonzero((rows[:, 1:] != rows[-1, 1:]).any(axis=1))
    return float(rows[moving[-1] + 1, 0]) if len(moving) else 0.0


def overlapping(centers: Array, radii: Array, before: Array | None = None) -> str | None:
    """Return which two of some round tips overlap most and by how much; None if none do.

    Args:
        centers: of the tips (k, 3), m.
        radii: of the tips (k,), m.
        before: centers of the tips of a rigid tool (k, 3), m; only those count that overlap more now.
    """

    def overlaps(of: Array) -> Array:
        apart = np.linalg.norm(of[:, None] - of, axis=2)
        return np.triu(np.maximum(np.add.outer(radii, radii) - apart, 0.0), 1)

    now = overlaps(centers)
    more = now if before is None else now - overlaps(before)
    one, two = np.unravel_index(np.argmax(more), more.shape)
    if not more[one, two] > _OVERLAP * min(radii[one], radii[two]):
        return None
    return f"{one + 1} and {two + 1} overlap by {1e3 * now[one, two]:.2g} mm at the end, as rigid tips cannot"


def closed_over(choice: BodyChoice, time: ArrayLike) -> str | None:
    """Return that spheres of a gripper overlap at a time (1,), s, more than when it is open; None if they do not."""
    if choice.tool is None or choice.tip == "flat" or len(choice.contact_points) < 2:
        return None
    radii = np.full(len(choice.contact_points), choice.radius)
    pair = overlapping(tool_places(choice, time)[0], radii, np.array(choice.contact_points))
    return pair and f"the tips {pair}: do not close the tool so far"


def step_body(core: CoreBody, path: Array, choice: BodyChoice, times: Array) -> Array:
    """Return the core's rows of a body under its tip or tool along a path.

    Args:
        core: of the body.
        path: of the tip in the frame of the body (n, 3), m.
        choice: of the body.
        times: of the path (n,), s.
    """
    flat = choice.tip == "flat"
    path = np.ascontiguousarray(path)
    axes = np.tile([0.0, 0.0, 1.0], (len(path), 1)) if flat else np.empty((0, 3))
    if choice.tool is None:
        return np.asarray(core.simulate_path(path, axes, choice.radius, flat))
    assert isinstance(core, _core.SignedDistanceBody | _core.SupportedBody)
    places = np.ascontiguousarray(tool_in_body(choice, times))
    return np.asarray(core.simulate_path(path, axes, choice.radius, flat, places))
