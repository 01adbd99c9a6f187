"""Force that the motors hold at the end of a run, and the time until their windings are too hot for it."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from palpate.arrays import Array
from palpate.linear.linearization import static_tip_force
from palpate.scenario import Scenario
from palpate.simulation.recorded import Recorded

__all__ = ["drive_hold", "motor_load"]


def motor_load(trace: Recorded, scenario: Scenario) -> Array:
    """Return the size of the force at the tip that the drive limits, gravity compensation included (n,), N."""
    force = trace["motor_force"]
    if scenario.servo.gravity_compensation and len(force):
        device, start = scenario.load_device(), trace["angle"][0]
        force = force + static_tip_force(device.jacobian(start), device.gravity(start))
    return np.asarray(np.linalg.norm(force, axis=1))


def drive_hold(trace: Recorded, scenario: Scenario) -> str | None:
    """Return how long the motors can hold the mean force of the last twentieth of a run; None: for ever, or not known.

    The windings are cold at the start of the run.
    """
    device = scenario.load_device()
    if not scenario.device.saturation or np.isinf(device.continuous_force) or len(trace.time) < 2:
        return None
    load = motor_load(trace, scenario)
    held = float(load[-max(len(load) // 20, 1) :].mean())
    gain = -np.expm1(-float(np.median(np.diff(trace.time))) / device.thermal_time)
    temperature = lfilter([gain], [1.0, gain - 1.0], (load / device.continuous_force) ** 2)[-1]
    left = device.limit_time(held, float(temperature))
    if np.isinf(left):
        return None
    return f"the motors hold {held:.3g} N, and the hot drive limits them after another {left:.3g} s"
