"""palpate: model a haptic device, prove what it can render stably, design the controller, run the loop."""

from __future__ import annotations

import importlib

from palpate.errors import PalpateError

TYPE_CHECKING = False  # the import of typing takes longer than the rest, and Ctrl-C during it ends in a traceback
if TYPE_CHECKING:
    from typing import Any

    __version__: str

    from palpate.contact import Contact as Contact
    from palpate.contact import Mesh as Mesh
    from palpate.contact import Proxy as Proxy
    from palpate.contact import Surface as Surface
    from palpate.control.controller import Controller as Controller
    from palpate.devices import Device as Device
    from palpate.linear.discretization import discretize as discretize
    from palpate.linear.linearization import linearize as linearize
    from palpate.metrics import summarize as summarize
    from palpate.scenario import Scenario as Scenario
    from palpate.simulation.loop import Loop as Loop
    from palpate.simulation.simulator import simulate as simulate
    from palpate.simulation.trace import Trace as Trace
    from palpate.sweeps import sweep as sweep
    from palpate.tuning import design as design

# Numerical packages take a second to import; each name brings its own when first used, so the command line is quick.
_LAZY_ATTRIBUTES = {
    "Contact": "palpate.contact",
    "Controller": "palpate.control.controller",
    "Device": "palpate.devices",
    "Loop": "palpate.simulation.loop",
    "Mesh": "palpate.contact",
    "Proxy": "palpate.contact",
    "Scenario": "palpate.scenario",
    "Surface": "palpate.contact",
    "Trace": "palpate.simulation.trace",
    "design": "palpate.tuning",
    "discretize": "palpate.linear",
    "linearize": "palpate.linear",
    "simulate": "palpate.simulation.simulator",
    "summarize": "palpate.metrics",
    "sweep": "palpate.sweeps",
}
_SUBPACKAGES = (
    "contact",
    "control",
    "devices",
    "fem",
    "identification",
    "linear",
    "metrics",
    "plotting",
    "report",
    "scenario",
    "simulation",
    "stability",
    "sweeps",
    "tuning",
)

__all__ = ["PalpateError", "__version__", *_LAZY_ATTRIBUTES, *_SUBPACKAGES]  # noqa: PLE0604


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("palpate")
        except PackageNotFoundError:  # run from a source tree that is not installed
            return "unknown"
    if name in _LAZY_ATTRIBUTES:
        return getattr(importlib.import_module(_LAZY_ATTRIBUTES[name]), name)
    if name in _SUBPACKAGES:
        return importlib.import_module(f"palpate.{name}")
    raise AttributeError(f"module 'palpate' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
