"""From a scenario's [controller] table to the controller that runs."""

from __future__ import annotations

import control
import numpy as np
from numpy.typing import NDArray

from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.scenario import Scenario
from palpate.simulation.controller_design import design_for

__all__ = ["build_controller"]


def build_controller(scenario: Scenario, device: Device, start: NDArray[np.float64]) -> Controller:
    """Return the scenario's controller; lead-lag and LQG are designed for the device linearised at `start` (dof,), rad.

    Raises:
        DesignError: no controller meets the options.
        PoseError: the tip force cannot reach every joint at `start` (a singular pose).
    """
    table = scenario.controller
    period = scenario.period
    if table.kind in ("none", "gain"):
        return Controller.gain(np.array(table.gain if table.gain is not None else (1.0, 1.0, 1.0)), period)
    if table.kind == "state_space":
        n = len(table.A or ())
        a, b = np.array(table.A, float).reshape(n, n), np.array(table.B, float).reshape(n, 6)
        c, d = np.array(table.C, float).reshape(3, n), np.array(table.D, float)
        antiwindup = None if table.antiwindup is None else np.array(table.antiwindup, float)
        return Controller(control.StateSpace(a, b, c, d, period), antiwindup, "state_space")
    return design_for(table.kind, table.options, device, start, scenario.object.stiffness, period)
