"""Loops with the workspace controller that several tests share."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from palpate.arrays import Array
from palpate.control import WorkspaceController, loop_gain
from palpate.devices import Device
from palpate.devices.device import Parameters

POSE = np.array([0.0, 2.2305, 3.2776])
OTHER = np.array([0.0, 0.5, -0.3])
PERIOD = 5e-4


def tables(pose: Array, stiffness: float, force: float, **device: Any) -> dict[str, Any]:
    return {
        "device": {"name": "phantom-premium-1.5a", **device},
        "start": {"pose": [f"{float(q)!r} rad" for q in pose]},
        "servo": {"period": "0.5 ms"},
        "reference": {"shape": "step", "force": f"{force} N"},
        "object": {"kind": "spring", "stiffness": f"{stiffness!r} N/m"},
        "controller": {"kind": "workspace"},
        "run": {"duration": "0.3 s"},
    }


def mass(kilograms: float = 0.1) -> Device:
    return Device(
        "mass", "", "tip_device", Parameters({"mass.apparent": (kilograms,) * 3, "friction.viscous": (0.0,) * 3})
    )


def axis_loop(controller: WorkspaceController) -> control.StateSpace:
    """Return the loop gain of one axis of a mass."""
    t, m, k = controller.period, 0.1, controller.stiffness[0]
    eye = np.eye(3)
    a = np.kron([[1.0, t], [0.0, 1.0]], eye)
    b = np.kron([[t * t / 2 / m], [t / m]], eye)
    plant = control.StateSpace(a, b, np.kron([[k, 0.0]], eye), np.zeros((3, 3)), t)
    return loop_gain(controller.linearized(np.zeros(3)), plant)


SURFACE = {"static_friction": 0.2, "tangential": "1 N/mm"}
LEADING = {
    "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m", "shape": "table",
    "table": [["0 s", "0 N", "0 N", "0 N"], ["0.2 s", "0 N", "0 N", "0 N"], ["0.7 s", "4 N", "0.8 N", "0 N"]],
}  # fmt: skip


def slide(slope: float, friction: bool, normal_only: bool) -> dict[str, Any]:
    """A hand leads the tip by 20 mm over a plane of triangles, tilted by a slope in degrees, pressed with 1 N."""
    mesh = {"shape": "box", "edge": "200 mm", "divisions": 8, "rotation": ["0 deg", f"{slope} deg", "0 deg"]}
    surface = {"stiffness": ["0.3 N/mm", "3 N/mm"], "pattern": "stripes", "width": "8 mm"}
    return {
        "device": {"name": "phantom-premium-1.5a", "saturation": True},
        "start": {"pose": [f"{float(q)!r} rad" for q in POSE]},
        "servo": {"period": "0.5 ms"},
        "reference": {"shape": "ramp", "force": ["0 N", "0 N", "-1 N"], "rise": "0.1 s"},
        "operator": LEADING,
        "object": {
            "kind": "mesh",
            "mesh": mesh,
            "surface": surface | (SURFACE if friction else {"tangential": "0 N/m"}),
        },
        "controller": {"kind": "workspace", "normal_only": normal_only},
        "run": {"duration": "1.5 s"},
    }
