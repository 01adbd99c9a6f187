"""Time of the exact stability functions: boundary, map of spectral radii, and workspace."""

from __future__ import annotations

import numpy as np
from palpate.linear import LinearDevice
from palpate.stability import critical_stiffness, stability_boundary, wall_spectral_radius, workspace

from benchmarks.section import TIMED, Effort, Progress, Rows, Section, timed, timed_cells

__all__ = ["SECTION"]

PERIOD = 1e-3  # s
SIDE = 1000  # points of the map along each axis
DEVICE = "phantom-premium-1.5a"
POSES = 500


def _measure(effort: Effort, tell: Progress) -> Rows:
    tip = LinearDevice.of_mass(0.06, 0.05)
    damping, stiffness = np.meshgrid(np.linspace(0, 60, SIDE), np.linspace(0, 5e4, SIDE))
    tell("exact boundaries", 0.0)
    rows = [
        timed(
            "critical stiffness", lambda: critical_stiffness(tip, period=PERIOD, virtual_damping=5.0),
            effort.runs(50),
        ),
        timed(
            "boundary, 1000 points", lambda: stability_boundary(tip, period=PERIOD, points=1000),
            effort.runs(50), 10e-3,
        ),
        timed(
            "boundary, 1000 points, delay of 2", lambda: stability_boundary(tip, period=PERIOD, delay=2, points=1000),
            effort.runs(50), 10e-3,
        ),
    ]  # fmt: skip
    tell("a map of a million spectral radii", 0.3)
    rows.append(
        timed(
            f"spectral radius, {SIDE} × {SIDE} walls",
            lambda: wall_spectral_radius(tip, period=PERIOD, stiffness=stiffness, virtual_damping=damping),
            effort.runs(3),
            10.0,
        )
    )
    tell("a workspace", 0.85)
    rows.append(
        timed(f"workspace of an arm, {POSES} poses × 10 walls", lambda: workspace(DEVICE, poses=POSES), effort.runs(1))
    )
    return Rows(rows)


SECTION = Section(
    "a mass of 60 g with 0.05 N·s/m at 1 kHz and walls; a device with three joints behind fingertip tissue",
    TIMED,
    timed_cells,
    _measure,
)
