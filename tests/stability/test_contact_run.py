"""Runs that check a contact: how long they last, and the push that they compare."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.simulator import Simulation
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State, Verdict
from palpate.stability.contact_run import LONGER, PUSH, SETTLE, SHARE, Observed, run_on, run_pushed


def press(duration: float, **tables: Any) -> Scenario:
    return Scenario.from_dict(
        {
            "device": {"name": "phantom-premium-1.5a"},
            "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "0.5 ms", "topology": "impedance_display"},
            "operator": {
                "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m",
                "force": ["0 N", "0 N", "-1 N"],
            },
            "object": {
                "kind": "mesh",
                "position": ["0.5 mm", "0.3 mm", "-0.5 mm"],
                "mesh": {"shape": "box", "edge": "80 mm", "divisions": 2},
                "surface": {"stiffness": "300 N/m"},
            },
            "run": {"duration": f"{duration} s"},
            **tables,
        }
    )  # fmt: skip


IDENTIFIED = {
    "device": {"name": "phantom-premium-1.5a", "model": "experimental"},
    "servo": {"period": "0.5 ms"},
    "operator": {"kind": "none"},
    "reference": {"force": ["0 N", "0 N", "-1 N"]},
    "controller": {"kind": "lead_lag", "stiffness": "1 N/mm"},
}


@pytest.mark.parametrize("tables", [{}, IDENTIFIED])
def test_the_push_is_a_half_sine_into_the_surface_and_along_it(
    tables: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its peak is 2 % of the contact's force; it lasts 20 ms from the sample at rest. The tip answers to it."""
    scenario, ran, simulate = press(0.03, **tables), list[Simulation](), Simulation.simulate
    trace = Simulation.of(scenario).simulate()
    rest = len(trace) - 1
    assert trace["touching"][rest, 0] == 1.0

    def record(self: Simulation) -> Trace:
        ran.append(self)
        return simulate(self)

    monkeypatch.setattr(Simulation, "simulate", record)
    found = run_pushed(scenario, Observed(trace, rest, True, Verdict(State.SETTLED, "")), 0.02, float("nan"))
    free, pushed = ran
    push = pushed.operator - free.operator
    ticks = round(PUSH / scenario.period)
    shape = np.sin(np.pi * np.arange(1, ticks + 1) / (ticks + 1))
    peak = max(SHARE * float(np.linalg.norm(trace["object_force"][rest])), 1e-3)
    assert found.push == pytest.approx(peak)
    assert 0.0 < found.kept < 2.0
    assert np.flatnonzero(push.any(axis=1)).tolist() == list(range(rest + 1, rest + 1 + ticks))
    assert np.linalg.norm(push[rest + 1 : rest + 1 + ticks], axis=1) == pytest.approx(peak * shape)
    assert np.all(push[rest + 1 : rest + 1 + ticks] @ trace["normal"][rest] < 0.0)


@pytest.mark.parametrize(("duration", "hold", "lasts"), [(0.3, 0.0, SETTLE), (1.2, 0.0, 1.2), (0.3, 3.0, 3.0)])
def test_a_run_goes_on_unless_its_forces_were_constant_for_a_second(duration: float, hold: float, lasts: float) -> None:
    found = run_on(press(duration), hold)
    assert found.constant
    assert not found.fails
    assert found.trace.time[-1] == pytest.approx(lasts)
    assert found.rest == len(found.trace) - 1


def test_a_run_that_seems_to_fail_goes_on_before_it_is_judged() -> None:
    failing = {
        "device": {"name": "slider"},
        "start": {"pose": ["0 m"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "object": {"kind": "spring", "stiffness": "97 N/m"},
        "operator": {"kind": "force", "force": ["0.5 N", "0 N", "0 N"]},
    }
    found = run_on(press(1.2, **failing))
    assert found.fails
    assert found.trace.time[-1] == pytest.approx(1.2 + LONGER)
