"""Frequencies of a lowest flexible mode with which a workspace controller is unstable, on one free axis."""

from __future__ import annotations

from typing import Final

import numpy as np

from palpate.arrays import Array
from palpate.control import WorkspaceController
from palpate.devices.flexible_mode import FlexibleMode
from palpate.errors import DesignError
from palpate.linear.flexible_tip import sampled_axis
from palpate.tuning.axis import unit_law, unit_radii

__all__ = ["flexible_bands"]

STEP: Final = 1.0  # Hz


def flexible_bands(
    controller: WorkspaceController, *, delay: int = 0, tip_share: float, damping_ratio: float, highest: float = 1000.0
) -> Array:
    """Return the bands of frequency (k, 2), Hz, in which the lowest mode of a free axis makes the loop unstable.

    The loop is exact for the sampled axis: motors and encoder on one side, a share of the mass on the other. It is the
    same for every mass and for every stiffness of the object. The edges are found within 1 Hz.

    Args:
        controller: its gains are judged.
        delay: samples from a command to its application.
        tip_share: of the mass on the tip's side, above 0 and below 1.
        damping_ratio: of the mode, at least 0 and below 1.
        highest: frequency up to which bands are sought, Hz.

    Raises:
        DesignError: a share or a ratio out of range.
    """
    if not (0.0 < tip_share < 1.0 and 0.0 <= damping_ratio < 1.0):
        raise DesignError("flexible_bands: tip_share must be above 0 and below 1, damping_ratio at least 0 and below 1")
    frequency = np.arange(STEP, highest + STEP, STEP)
    modes = [FlexibleMode(float(f), tip_share, damping_ratio) for f in frequency]
    axes = [sampled_axis(mode, 1.0, controller.period) for mode in modes]
    radius = unit_radii(axes, unit_law(controller), delay)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], radius >= 1.0, [0]]).astype(int)))
    return np.array([(frequency[a], frequency[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]).reshape(
        -1, 2
    )
