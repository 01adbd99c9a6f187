"""Guard of a scenario as plain numbers, and in the setup of its loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate import _core
from palpate.devices import Device
from palpate.scenario import Scenario

__all__ = ["guard_numbers", "set_guard"]


def guard_numbers(scenario: Scenario, device: Device) -> dict[str, Any] | None:
    """Return the guard of a scenario with the numbers that it takes from the device; None: it has none.

    An energy bound has the `damping` and `coulomb` friction of each joint that it relies on, in the units of the joint,
    and the `lateness` of ticks that it allows for, s.
    """
    guard = scenario.guard
    if guard.kind == "none":
        return None
    if guard.kind == "energy_bound":
        return {
            "kind": guard.kind,
            "damping": (guard.viscous * device.viscous).tolist(),
            "coulomb": (guard.coulomb * device.coulomb).tolist(),
            "lateness": scenario.servo.jitter,
        }
    if guard.kind == "passivity_controller":
        return {"kind": guard.kind, "cap": guard.cap}
    if guard.kind == "sample_estimate_hold":
        return {"kind": guard.kind, "correction": guard.correction}
    names = ("kind", "velocity", "horizon", "observer", "deadbeat")
    return {name: getattr(guard, name) for name in names}


def set_guard(setup: Any, numbers: dict[str, Any] | None) -> None:
    """Give the core's setup the guard of `guard_numbers`."""
    if numbers is None:
        return
    if numbers["kind"] == "energy_bound":
        setup.set_energy_bound(np.array(numbers["damping"]), np.array(numbers["coulomb"]), numbers["lateness"])
    elif numbers["kind"] == "passivity_controller":
        setup.set_passivity_controller(numbers["cap"])
    elif numbers["kind"] == "sample_estimate_hold":
        setup.set_sample_estimate_hold(numbers["correction"])
    else:
        estimate = getattr(_core.VelocityEstimate, numbers["velocity"])
        setup.set_half_sample(estimate, numbers["horizon"], numbers["observer"], numbers["deadbeat"])
