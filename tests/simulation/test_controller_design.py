"""The design functions from a scenario's [controller] table: options arrive, wrong ones are named, text survives."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from palpate import devices
from palpate.control import Controller, lead_lag, lqg
from palpate.errors import DesignError, ScenarioError
from palpate.linear import rendering_plant
from palpate.scenario import Scenario
from palpate.scenario.design_options import FLAG, OPTIONS, sort_options
from palpate.simulation.controllers import build_controller, build_law, with_controller

ARM = devices.load("phantom-premium-1.5a")
POSE = np.array([0.0, 2.2305, 3.2776])


def scenario(controller: dict[str, Any]) -> Scenario:
    return Scenario.from_dict(
        {
            "device": {"name": "phantom-premium-1.5a"},
            "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "0.5 ms"},
            "reference": {"shape": "step", "force": ["1 N", "1 N", "1 N"]},
            "object": {"kind": "spring", "stiffness": "2 N/mm"},
            "controller": controller,
            "run": {"duration": "10 ms"},
        }
    )


def test_options_reach_the_design_in_si() -> None:
    """Each table gives the very controller that the function gives for the same numbers."""
    ours = build_controller(
        scenario(
            {
                "kind": "lead_lag",
                "stiffness": "1 N/mm",
                "crossover": ["100 rad/s", "120 rad/s", "140 rad/s"],
                "phase_margin": "50 deg",
                "steady_error": 0.01,
                "decouple": False,
                "smooth_reference": False,
            }
        ),
        ARM,
        POSE,
    )
    plant = rendering_plant(ARM, POSE, stiffness=1000.0, period=5e-4)
    expected = lead_lag(
        plant,
        crossover=[100, 120, 140],
        phase_margin=50,
        steady_error=0.01,
        decouple=False,
        smooth_reference=False,
    )
    assert pytest.approx(expected.system.A) == ours.system.A
    assert pytest.approx(expected.system.D) == ours.system.D
    assert ours.notes["design_stiffness"] == 1000.0

    table = {"kind": "lqg", "integrators": False, "force_weight": 3.0, "speed_weight": "5 ms", "noise": "0.02 N"}
    plant = rendering_plant(ARM, POSE, stiffness=2000.0, period=5e-4)  # the object's own, unless options say otherwise
    expected = lqg(plant, integrators=False, force_weight=3.0, speed_weight=0.005, noise=0.02)
    assert pytest.approx(expected.system.A) == build_controller(scenario(table), ARM, POSE).system.A


@pytest.mark.parametrize(
    "table",
    [
        {"kind": "lead_lag", "crossover": "150 rad/s", "decouple": False, "steady_error": 0.01},
        {"kind": "lqg", "integral_rate": "5 1/s", "windup_time": "20 ms", "integrators": True},
    ],
)
def test_options_survive_being_written(table: dict[str, Any]) -> None:
    read = scenario(table)
    assert Scenario.from_dict(read.to_dict()).controller.options == read.controller.options


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ({"kind": "lqg", "integrator": True}, "did you mean integrators"),
        ({"kind": "lqg", "integrators": 1}, "neither true nor false"),
        ({"kind": "lead_lag", "crossover": "20 Hz"}, "crossover"),
        ({"kind": "lead_lag", "steady_error": True}, "steady_error"),
    ],
)
def test_wrong_options_are_named(table: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        scenario(table)


def test_an_unreachable_design_is_said_before_anything_runs() -> None:
    with pytest.raises(DesignError, match="deg of lead"):
        build_controller(scenario({"kind": "lead_lag", "crossover": "900 rad/s", "phase_margin": "80 deg"}), ARM, POSE)


@pytest.mark.parametrize(
    ("kind", "option"),
    [
        (kind, key)
        for kind, known in OPTIONS.items()
        for key, (unit, axes) in known.items()
        if unit != FLAG and not axes
    ],
)
def test_an_option_of_the_whole_design_takes_no_list(kind: str, option: str) -> None:
    """The axes differ only in the options whose theory has a value for each."""
    per_axis = {"stiffness", "crossover", "phase_margin", "steady_error", "disturbance", "noise"}
    assert option not in per_axis or (kind, option) == ("workspace", "disturbance")
    with pytest.raises(ValueError, match=option):
        sort_options({"kind": kind, option: [1.0, 1.0, 1.0]}, {"kind"})


@pytest.mark.parametrize(
    ("gains", "kind"), [([0.0, 1.0, 2.0], "gain"), ([0.0, 0.0, 0.0], "gain"), ([-0.1, 1.0, 1.0], "state_space")]
)
def test_gains_that_are_not_negative_are_written_as_gains_and_others_as_a_matrix(gains: list[float], kind: str) -> None:
    """Either way the controller that is read back has the same matrices."""
    slider = {
        "device": {"name": "slider"},
        "reference": {"force": ["1 N", "0 N", "0 N"]},
        "object": {"stiffness": "1 N/mm"},
    }
    scenario = Scenario.from_dict(slider)
    through = np.hstack([np.diag(gains), -np.diag(gains)])
    law = Controller(control.StateSpace([], [], [], through, scenario.period), None, "own", {})
    written = with_controller(scenario, law)
    assert written.controller.kind == kind
    again = Scenario.from_dict(written.to_dict())
    device = again.load_device()
    np.testing.assert_allclose(build_controller(again, device, np.zeros(1)).system.D, through)


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [("share", 1.5, "share must be above 0"), ("bandwidth", "-200 rad/s", "must be positive and finite")],
)
def test_a_value_that_a_workspace_controller_refuses_has_its_place(option: str, value: object, says: str) -> None:
    chosen = scenario({"kind": "workspace", option: value})
    for build in (build_law, build_controller):
        with pytest.raises(DesignError, match=rf"^controller\.{option}: .*{says}"):
            build(chosen, ARM, POSE)
