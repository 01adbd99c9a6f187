"""Sampled plant for controller design, from tip force to object force."""

from __future__ import annotations

from typing import Literal

import control
from numpy.typing import ArrayLike

from palpate.devices import Device
from palpate.linear.discretization import discretize
from palpate.linear.linearization import linearize


def rendering_plant(
    device: Device,
    q: ArrayLike,
    *,
    stiffness: ArrayLike,
    period: float | str,
    method: Literal["zoh", "tustin", "series"] = "zoh",
) -> control.StateSpace:
    """Return the sampled plant from tip force u (3, N) to object force K (p - p0) (3, N) about the pose ``q``.

    The device rests at ``q`` under the constant tip force that balances gravity. The change of the Jacobian with the
    pose is included.

    Args:
        q: pose (dof,), rad; this and the next two may be text with units as well.
        stiffness: K, N/m, one value or three (x, y, z).
        period: servo period, s.
        method: as in ``discretize``; "zoh" corresponds to the servo loop.

    Raises:
        PoseError, DesignError: from ``linearize`` and ``discretize``.
    """
    continuous = linearize(device, q, inputs="force", outputs="object_force", stiffness=stiffness)
    return discretize(continuous, period, method)
