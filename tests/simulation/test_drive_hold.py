"""The time until a force of the motors is limited because their windings are hot."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import palpate
import pytest
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.simulation.drive_hold import motor_load
from palpate.simulation.verdict import State
from palpate.stability import certify

HOLD = re.compile(r"the motors hold ([\d.]+) N, and the hot drive limits them after another ([\d.]+) s")


def pressed(force: float, duration: float, **servo: Any) -> Scenario:
    return Scenario.from_dict(
        {
            "device": {"name": "phantom-premium-1.5a", "saturation": True},
            "start": {"pose": ["0.2 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "1 ms", "topology": "impedance_display", **servo},
            "operator": {
                "kind": "arm",
                "mass": "0.15 kg",
                "damping": "4.5 N*s/m",
                "stiffness": "100 N/m",
                "force": ["0 N", "0 N", f"{-force} N"],
            },
            "object": {"kind": "spring", "stiffness": "0.6 N/mm"},
            "run": {"duration": f"{duration} s"},
        }
    )


def hold_of(text: str) -> tuple[float, float]:
    found = HOLD.search(text)
    assert found is not None, text
    return float(found[1]), float(found[2])


@pytest.mark.parametrize("compensated", [True, False])
def test_a_short_run_states_when_a_long_one_loses_its_force(compensated: bool) -> None:
    short, long = (palpate.simulate(pressed(2.4, one, gravity_compensation=compensated)) for one in (1.5, 8.0))
    assert short.verdict.state is State.SETTLED
    held, left = hold_of(short.verdict.reason)
    assert hold_of(" ".join(summarize(short)["warnings"])) == (held, left)
    load = motor_load(short, pressed(2.4, 1.5, gravity_compensation=compensated))
    assert held == pytest.approx(load[-1], rel=5e-3)
    limited = np.flatnonzero(long["saturated"][:, 0])
    assert not short["saturated"].any()
    assert 1.5 + left == pytest.approx(long.time[limited[0]], abs=0.02)


def test_a_force_within_the_rating_is_held_for_ever() -> None:
    trace = palpate.simulate(pressed(0.8, 1.5))
    assert trace.verdict.state is State.SETTLED
    assert "hot" not in trace.verdict.reason
    assert summarize(trace)["warnings"] == []


def test_without_drive_limits_the_summary_compares_with_the_rating() -> None:
    scenario = pressed(2.4, 1.5)
    free = scenario.model_copy(update={"device": scenario.device.model_copy(update={"saturation": False})})
    trace = palpate.simulate(free)
    assert "hot" not in trace.verdict.reason
    held = motor_load(trace, free)[-1]
    remark = f"without drive limits: the motors hold {held:.3g} N, of which the drive gives 1.4 N for long"
    assert remark in summarize(trace)["warnings"]


def test_a_certificate_states_how_long_the_motors_hold_the_force() -> None:
    certificate = certify(pressed(2.4, 1.5))
    assert certificate.stable
    run = hold_of(palpate.simulate(pressed(2.4, 1.5)).verdict.reason)
    assert hold_of(" ".join(certificate.method)) == run
