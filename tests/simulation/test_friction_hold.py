"""Friction that holds a tip: its force along the surface, the rest without it, and runs that it does not settle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from palpate import fem
from palpate.scenario import Scenario
from palpate.simulation import build_simulation
from palpate.simulation.bodies import surface_normal
from palpate.simulation.friction_hold import arm_spring, friction_hold, friction_of
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State, Verdict

FRICTION = 0.5
ARM = {"kind": "arm", "mass": "0.1 kg", "damping": "3 N*s/m", "stiffness": "200 N/m"}


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """24 x 24 x 12 mm of 60 kPa, bonded below, touched on its top."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    shape = fem.block((0.024, 0.024, 0.012), 0.004)
    fem.build(shape, young=60e3, fixed="z < 0.001 mm", touch="z > 11.9 mm", order=1, output=path)
    return path


def press(block: Path, aside: float = 0.0, **changes: Any) -> dict[str, Any]:
    """Return the tables of a press by 0.8 N, beside a force along the surface."""
    body = {"file": str(block), "origin": ["12 mm", "12 mm", "12 mm"], "tip": "flat", "radius": "6 mm"}
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {**ARM, "shape": "ramp", "rise": "0.1 s", "force": ["0 N", f"{aside} N", "-0.8 N"]},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-0.1 mm"],
            "body": {**body, "kind": "compliance", "static_friction": FRICTION},
        },
        "run": {"duration": "1 s"},
        **changes,
    }


def test_the_traction_is_the_force_along_the_surface_over_friction_times_pressure(block: Path) -> None:
    """0.15 N along the top of a block under 0.6 N, which alternate by 10 mN."""
    forces = np.tile([0.0, 0.15, -0.6], (50, 1)) + 0.01 * np.tile([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]], (25, 1))
    channels = {"tip": np.zeros((50, 3)), "object_force": forces}
    trace = Trace.of(1e-3 * np.arange(50), channels, metadata={"scenario": press(block)})
    found = friction_hold(trace, Scenario.from_dict(press(block)), slice(0, 50))
    assert found is not None
    assert found.traction == pytest.approx(0.15 / (FRICTION * 0.6))
    assert found.release == pytest.approx(0.15 / 200.0)
    assert found.fluctuation == pytest.approx(0.01 / np.hypot(0.15, 0.6))


@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_the_normal_of_a_body_turns_with_it(block: Path, angle: float) -> None:
    tables = press(block)
    tables["object"]["body"]["rotation"] = [f"{angle} deg", "0 deg", "0 deg"]
    trace = Trace.of(np.arange(2.0), {"tip": np.zeros((2, 3))}, metadata={"scenario": tables})
    turned = [0.0, -np.sin(np.deg2rad(angle)), np.cos(np.deg2rad(angle))]
    np.testing.assert_allclose(surface_normal(trace, -1), turned, atol=1e-9)


def test_without_friction_nothing_is_held(block: Path) -> None:
    tables = press(block)
    tables["object"]["body"]["static_friction"] = 0.0
    scenario = Scenario.from_dict(tables)
    trace = Trace.of(np.arange(3.0), {"tip": np.zeros((3, 3)), "object_force": np.ones((3, 3))})
    assert friction_of(scenario) == 0.0
    assert friction_hold(trace, scenario, slice(0, 3)) is None


def test_a_tip_that_slips_comes_to_rest_where_the_arm_takes_the_force_along_the_surface(block: Path) -> None:
    """Without friction the tip moves on by the release, to 20 %, since the contact sinks in as it moves."""
    held = palpate.simulate(press(block, 0.2))
    found = friction_hold(held, Scenario.from_dict(held.scenario), slice(-100, None))
    assert found is not None
    smooth = press(block, 0.2)
    smooth["object"]["body"]["static_friction"] = 1e-3
    free = palpate.simulate({**smooth, "run": {"duration": "3 s"}})
    along = float((free["tip"][-1] - held["tip"][-1])[1])
    assert found.release == pytest.approx(along, rel=0.2)


def test_arm_and_fingertip_are_springs_in_series(block: Path) -> None:
    soft = press(block, operator={**ARM, "tissue_stiffness": "300 N/m", "tissue_damping": "2 N*s/m"})
    assert arm_spring(Scenario.from_dict(soft)) == pytest.approx(120.0)
    pushed = press(block, operator={"kind": "force", "force": ["0 N", "0 N", "-0.8 N"]})
    assert arm_spring(Scenario.from_dict(pushed)) == 0.0


def test_counts_do_not_settle_a_tip_that_friction_alone_holds_along_the_surface(block: Path) -> None:
    """Force tracking without an arm; at rest the tip is held by 0.6 of the friction force. The run is not continued."""
    tables = press(block, operator={"kind": "none"})
    tables["servo"] = {"period": "1 ms", "topology": "force_tracking"}
    tables["reference"] = {"shape": "ramp", "rise": "0.1 s", "force": ["0 N", "0.24 N", "-0.8 N"]}
    tables["controller"] = {"kind": "workspace"}

    def verdict() -> Verdict:
        simulation = build_simulation(tables)
        return simulation.trace(*simulation.run()).verdict

    assert verdict().state is State.SETTLED
    tables["device"] = {**tables["device"], "encoder": True}
    assert verdict().state is State.UNDECIDED
    assert "within two encoder counts, in which a contact with friction may slip on" in verdict().reason


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_friction_of_any_object_of_a_scene_counts(friction: float) -> None:
    surface = {"stiffness": "1 N/mm", "static_friction": friction, "dynamic_friction": friction / 2}
    rough = {"kind": "mesh", "mesh": {"shape": "box", "edge": "20 mm", "divisions": 2}, "surface": surface}
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "reference": {"force": "1 N"},
        "objects": {"one": {"kind": "spring", "stiffness": "1 N/mm"}, "two": rough},
    }
    assert friction_of(Scenario.from_dict(tables)) == friction / 2
