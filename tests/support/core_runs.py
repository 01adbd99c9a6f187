"""The core's simulation, driven directly: for tests of physics that need no scenario around it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from palpate import _core
from palpate.devices import Device

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """What a run recorded, one row per servo sample.

    Attributes:
        time: (n,), s.
        q: (n, dof), rad (m for the slider).
        qd: (n, dof), rad/s.
        object_force: (n, 3), N.
        torque: (n, dof), N m.
        unstable_tick: tick of divergence, -1 if none.
    """

    time: Array
    q: Array
    qd: Array
    object_force: Array
    torque: Array
    unstable_tick: int


def run(device: Device, *, ticks: int, period: float, tip_force: ArrayLike = (0.0, 0.0, 0.0), **fields: Any) -> Run:
    """Run the core's loop with no controller but what `fields` sets on the setup.

    Args:
        ticks: servo periods.
        period: s.
        tip_force: force on the tip, N: constant (3,) or at each sample (ticks + 1, 3).
        **fields: attributes of the core's setup (start, start_speed, gravity_compensation, substeps, delay, wall, ...).
    """
    setup = device.setup()
    setup.period = period
    for name, value in fields.items():
        setattr(setup, name, np.asarray(value, float) if isinstance(value, (list, tuple)) else value)
    force = np.ascontiguousarray(np.broadcast_to(np.asarray(tip_force, float), (ticks + 1, 3)))
    rows, count, unstable = setup.run(np.zeros((ticks + 1, 3)), force)
    rows = np.asarray(rows)[:count]
    n = device.dof
    return Run(
        np.arange(count) * period * setup.record_every,
        rows[:, :n],
        rows[:, n : 2 * n],
        rows[:, 2 * n : 2 * n + 3],
        rows[:, 2 * n + 6 : 3 * n + 6],
        unstable,
    )


def impedance_display() -> Any:
    """Controller u = -F_object: the object's force, felt as it is."""
    d = np.hstack([np.zeros((3, 3)), -np.eye(3)])
    return _core.StateSpace(np.zeros((0, 0)), np.zeros((0, 6)), np.zeros((3, 0)), d, np.zeros((0, 3)))


def spring_at(point: ArrayLike) -> Any:
    """An object held from all sides at a point (3,), m."""
    anchor = _core.SpringWallParameters()
    anchor.kind = _core.SpringWallParameters.Kind.point
    anchor.point = np.asarray(point, float)
    return anchor
