"""Plants beside the rigid nonlinear device: sampled linear models, and what a flexible mode needs."""

from __future__ import annotations

from typing import NamedTuple

import control
import numpy as np

from palpate.arrays import Array
from palpate.devices import Device, identified_model
from palpate.errors import ScenarioError
from palpate.linear import discretize, linearize
from palpate.scenario import Scenario


class SampledPlant(NamedTuple):
    """q = start + c x; x <- a x + b (torque - working_torque). a (n, n), b (n, dof), c (dof, n); rad, N*m."""

    a: Array
    b: Array
    c: Array
    working_torque: Array


def sampled_plant(model: str, device: Device, start: Array, period: float) -> SampledPlant:
    """Return the exact linearization at `start` with a hold ("linear"), or the identified model ("experimental").

    Raises:
        ScenarioError: the identified model has another sampling period.
    """
    if model == "linear":
        system = discretize(linearize(device, start, inputs="torque", outputs="angle"), period, method="zoh")
        matrices = _matrices(system)
    else:
        identified = identified_model(device)
        if abs(identified.period - period) > 1e-9 * period:
            raise ScenarioError(
                f"servo.period: the identified model is sampled every {identified.period:g} s, not {period:g} s"
            )
        matrices = identified.a, identified.b, identified.c
    return SampledPlant(*matrices, np.asarray(device.gravity(start), dtype=float))


def check_mode(scenario: Scenario, device: Device) -> None:
    """Raise ScenarioError if the device has a flexible mode that the plant of the scenario cannot move with."""
    if device.flexible is None:
        return
    problem = ""
    if scenario.device.model != "nonlinear":
        problem = f'device.model = "{scenario.device.model}" is a model of the rigid device'
    elif scenario.operator.kind == "fixed":
        problem = 'operator.kind = "fixed" holds motors and tip'
    elif device.core_mode.fault(scenario.period):
        problem = "the mode needs more than 10000 integration steps per servo period"
    if problem:
        raise scenario.mistake(
            "device.name",
            f"{device.name} has a {device.flexible}, and {problem}; write device.rigid = true to leave the mode out",
        )


def _matrices(system: control.StateSpace) -> tuple[Array, Array, Array]:
    if np.any(system.D):
        raise ScenarioError("device.model: a sampled device cannot answer within the sample, its D must be zero")
    return np.array(system.A, float), np.array(system.B, float), np.array(system.C, float)
