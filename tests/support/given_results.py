"""Results that a test gives to a page or figure, with known numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from palpate.metrics.device_performance import DeviceMeasures
from palpate.metrics.performance import DirectionalPerformance, Performance
from palpate.metrics.vibration import Ripple
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.maps.simulated import SimulatedBoundary
from palpate.stability.maps.workspace_map import Workspace
from palpate.stability.maps.zwidth_map import ZWidth


def curve(width: float, height: float, points: int = 60) -> Boundary:
    """A quarter of an ellipse, from B = 0 on."""
    angle = np.linspace(0.0, 0.5 * np.pi, points)
    b, k = width * np.sin(angle), height * np.cos(angle) + 1.0
    return Boundary(b, k, np.full(points, 0.3), (0.1 * width, 0.5 * height))


def simulated(of: Boundary, every: int = 1) -> SimulatedBoundary:
    b, k = of.damping[::every], of.stiffness[::every]
    off = np.linspace(0.001, 0.004, len(b))
    return SimulatedBoundary(b, k, (float(b.max()), float(k.max())), off, 1234, 65536, 0.25)


OWN = curve(10.0, 2000.0)
PASSIVE = (np.array([0.0, 1.0, 2.0]), np.array([0.0, 150.0, 300.0]))


def zwidth(**change: Any) -> ZWidth:
    plain = ZWidth("a wall", {"a hand": OWN}, None, "the reason", None, (2.0, 700.0), True, not_simulated="no wish")
    return replace(plain, **change)


def grid_workspace() -> Workspace:
    """Poses on two planes 10 mm apart, with the critical stiffness as a known function of place and direction."""
    steps = 0.01 * np.arange(-3, 4)
    side = np.array([[0.0, y, z] for y in steps for z in steps])
    top = np.array([[x, 0.0, z] for x in steps for z in steps if x])
    start = np.array([[0.0, 0.0, 0.0]])
    tips = np.vstack([start, side, top])
    stiffness = (900.0 + 1e4 * tips[:, 1] + 5e3 * tips[:, 2])[:, None] * np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    directions = np.broadcast_to(np.eye(3)[[0, 1, 2, 0, 1, 2]], (len(tips), 6, 3))
    middle = 1 + len(side) + np.flatnonzero(top[:, 1] == 0.0)
    sections = {
        "y-z": 1 + np.arange(len(side)),
        "x-z": np.r_[1 + np.flatnonzero(side[:, 1] == 0.0), middle],
    }
    zero = np.zeros((len(tips), 3))
    return Workspace(
        "an arm", "1 kHz", tips, zero, directions, stiffness, stiffness / 10.0, 0.0 * stiffness, start[0],
        np.array([0.02, 0.0, -0.05]), sections, 0.01,
    )  # fmt: skip


def performance(**change: Any) -> Performance:
    f = np.geomspace(0.1, 500.0, 40)
    rendered = 300.0 + 2j * np.pi * f * 0.5
    along = tuple(
        DirectionalPerformance(direction, f, (1 + k) * rendered, np.full(40, 300.0 + 0j), -4.0 * f**2 + 0j,
                               310.0, (290.0, 305.0), 12.34, 55.0, 45.6, 0.012)
        for k, direction in enumerate(((1.0, 0.0, 0.0), (0.0, -0.6, 0.8)))
    )  # fmt: skip
    lines = np.geomspace(20.0, 900.0, 30)
    threshold = 1e-6 * (250.0 / lines) ** 2
    ripple = Ripple(lines, np.r_[0.0, 0.5 * threshold[1:]], threshold, 333.0, 0.5)
    device = DeviceMeasures((8.0, 9.0), (1.0, np.inf), (50.0, 60.0), (0.07, 0.15), 0.6, 0.5, (0.02, 0.04), 46.0, 30e-6)
    plain = Performance("a loop", "impedance_display", 443.0, along, ripple, "The ripple is small.", device)
    return replace(plain, **change)
