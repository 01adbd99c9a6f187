"""Runs of the thesis's loop for the design tests: the nonlinear arm pressed against a spring."""

from __future__ import annotations

from typing import Any

from palpate import simulate
from palpate.control import Controller
from palpate.metrics import summarize
from palpate.simulation.trace import Trace


def press(controller: Controller, stiffness: float, force: float, duration: float = 1.0, **device: Any) -> Trace:
    """Step the reference to ``force`` (N) on every axis at t = 0; ``stiffness`` in N/m."""
    return simulate(
        {
            "device": {"name": "phantom-premium-1.5a", **device},
            "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "0.5 ms"},
            "reference": {"shape": "step", "force": [f"{force} N"] * 3},
            "object": {"kind": "spring", "stiffness": f"{stiffness} N/m"},
            "run": {"duration": f"{duration} s"},
        },
        controller=controller,
    )


def axes(trace: Trace) -> list[dict[str, float]]:
    """Steady deflection, overshoot and settling of x, y and z."""
    assert trace.unstable_from is None
    return list(summarize(trace)["axes"].values())
