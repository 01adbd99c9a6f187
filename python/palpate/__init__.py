"""palpate: model a haptic device, prove what it can render stably, design the controller, run the loop."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from palpate.errors import PalpateError

if TYPE_CHECKING:
    from palpate.analysis.discretize import discretize
    from palpate.analysis.linearize import linearize
    from palpate.control.controller import Controller
    from palpate.devices import Device
    from palpate.loop.simulate import simulate
    from palpate.loop.trace import Trace
    from palpate.scenario import Scenario
    from palpate.sweeps import sweep
    from palpate.touch import Contact, Mesh, Proxy, Surface

# Numerical packages take a second to import; each name brings its own when first used, so the command line is quick.
_HOMES = {
    "Contact": "palpate.touch",
    "Controller": "palpate.control.controller",
    "Device": "palpate.devices",
    "Mesh": "palpate.touch",
    "Proxy": "palpate.touch",
    "Scenario": "palpate.scenario",
    "Surface": "palpate.touch",
    "Trace": "palpate.loop.trace",
    "discretize": "palpate.analysis",
    "linearize": "palpate.analysis",
    "simulate": "palpate.loop.simulate",
    "sweep": "palpate.sweeps",
}
_ROOMS = (
    "analysis",
    "bench",
    "bodies",
    "control",
    "design",
    "devices",
    "identify",
    "loop",
    "report",
    "scenario",
    "stability",
    "sweeps",
    "thesis",
    "touch",
)

__all__ = [
    "Contact",
    "Controller",
    "Device",
    "Mesh",
    "PalpateError",
    "Proxy",
    "Scenario",
    "Surface",
    "Trace",
    "analysis",
    "bench",
    "bodies",
    "control",
    "design",
    "devices",
    "discretize",
    "identify",
    "linearize",
    "loop",
    "report",
    "scenario",
    "simulate",
    "stability",
    "sweep",
    "sweeps",
    "thesis",
    "touch",
]


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    if name in _ROOMS:
        return importlib.import_module(f"palpate.{name}")
    raise AttributeError(f"module 'palpate' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
