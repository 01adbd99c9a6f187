"""Linear models of a device from torque to angle, sampled with the servo period."""

from __future__ import annotations

from typing import NamedTuple

import control
import numpy as np

from palpate.arrays import Array
from palpate.devices import Device, identified_model
from palpate.errors import ScenarioError
from palpate.linear import discretize, linearize


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


def _matrices(system: control.StateSpace) -> tuple[Array, Array, Array]:
    if np.any(system.D):
        raise ScenarioError("device.model: a sampled device cannot answer within the sample, its D must be zero")
    return np.array(system.A, float), np.array(system.B, float), np.array(system.C, float)
