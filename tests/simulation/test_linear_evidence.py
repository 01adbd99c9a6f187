"""Linear loop of a run: at which radius it is stable, and when its tip rests on the object."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.scenario import Scenario
from palpate.simulation.linear_evidence import LinearRadii, linear_radii_of, linear_sign, touches_at_rest
from palpate.simulation.recorded import external_forces, held_tip, recorded_scenario
from palpate.simulation.trace import Trace
from palpate.stability import certify

PERIOD = 1e-3
SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "80 N/m"},
}
WALL = {"kind": "wall", "stiffness": "80 N/m", "normal": [1.0, 0.0, 0.0]}


def scenario(**tables: Any) -> Scenario:
    return Scenario.from_dict({**SLIDER, **tables})


def still(speed: float = 0.0, samples: int = 40, touching: bool = True, **given: Any) -> Trace:
    """Return a run whose tip moves along x at a speed in its last 20 samples, and fast before."""
    x = np.cumsum(np.where(np.arange(samples) > samples - 20, speed, 1.0)) * PERIOD
    tip = np.column_stack([x, 0.0 * x, 0.0 * x])
    contact = np.full((samples, 1), 1.0)
    contact[-1] = touching
    return Trace.of(PERIOD * np.arange(samples), {"tip": tip, "touching": contact}, **given)


def test_a_radius_is_stable_below_one_unstable_above_and_neither_within_rounding() -> None:
    assert [linear_sign(r) for r in (0.5, 1.0 - 2e-9, 1.0 - 5e-10, 1.0, 1.0 + 5e-10, 1.0 + 2e-9, 7.0)] == [
        *(1, 1, 0, 0, 0, -1, -1)
    ]
    assert linear_sign(math.nan) == 0
    assert [linear_sign(math.inf), linear_sign(0.0)] == [-1, 1]


def test_a_run_leaves_an_unstable_start_for_a_stable_rest_alone() -> None:
    for start, rest, leaves, worst in (
        (1.1, 0.9, True, 1.1), (0.9, 1.1, False, 1.1), (1.1, 1.2, False, 1.2), (0.9, 0.8, False, 0.9),
        (1.1, None, False, 1.1), (1.0, 0.9, False, 1.0), (1.1, 1.0, False, 1.1),
    ):  # fmt: skip
        found = LinearRadii(start, rest)
        assert (found.leaves, found.worst) == (leaves, worst)
        kind = {1: "stable", 0: "at its limit", -1: "unstable"}[linear_sign(worst)]
        said = "unstable at the start (spectral radius 1.1) and stable where the run rests (0.9)" if leaves else kind
        assert str(found).startswith(f"the linear loop is {said}")
        assert str(found).count(f"{worst:.9g}") == 1


def test_a_tip_rests_below_five_millimeters_per_second_over_its_last_samples() -> None:
    s = scenario()
    assert touches_at_rest(still(4.9e-3), s) == (True, "")
    assert touches_at_rest(still(5.1e-3), s) == (False, "the tip does not rest (tip speed 0.0051 m/s)")
    assert touches_at_rest(still(samples=19), s) == (False, "")
    assert touches_at_rest(still(samples=20), s) == (True, "")
    assert touches_at_rest(still(unstable_from=0.03), s) == (False, "")
    linear = {"name": "slider", "model": "linear"}
    assert touches_at_rest(still(), scenario(device=linear)) == (True, "")
    assert touches_at_rest(still(), scenario(device={**linear, "kinematics": "linear"})) == (False, "")


def test_a_tip_off_its_wall_does_not_rest_on_it_and_a_spring_holds_it_anywhere() -> None:
    assert touches_at_rest(still(touching=False), scenario()) == (True, "")
    assert touches_at_rest(still(), scenario(object=WALL)) == (True, "")
    assert touches_at_rest(still(touching=False), scenario(object=WALL)) == (False, "the tip is off the wall")
    moving = "the tip does not rest (tip speed 0.02 m/s)"
    assert touches_at_rest(still(0.02, touching=False), scenario(object=WALL)) == (False, moving)


def test_a_guard_or_a_controller_of_your_own_leaves_no_linear_loop() -> None:
    guard = {"kind": "energy_bound"}
    nonlinear = "a guard makes the loop nonlinear, and the linear loop is that without it"
    assert linear_radii_of(still(), scenario(guard=guard)) == (None, nonlinear)
    for metadata in ({"controller": {"given": True}}, {"controller": {"kind": "python"}}, {"object": "mine"}):
        assert linear_radii_of(still(metadata=metadata), scenario()) == (None, "")
    assert linear_radii_of(still(), None) == (None, "")
    assert linear_radii_of(still(), scenario(object={"kind": "none"})) == (None, "")


def test_a_held_tip_is_behind_the_flexible_mode() -> None:
    trace = still()
    assert held_tip(trace) is trace["tip"]
    offset = np.tile([1e-3, 0.0, 2e-3], (40, 1))
    flexible = Trace.of(trace.time, {"tip": trace["tip"], "tip_offset": offset})
    np.testing.assert_array_equal(held_tip(flexible), trace["tip"] + offset)


def test_external_forces_are_the_reference_and_those_of_the_operator() -> None:
    trace = still()
    """The seventh column counts the changes of the body's supports: none here."""
    pushed = np.hstack([np.zeros((40, 3)), np.tile([0.5, 0.0, 0.0, 0.0], (40, 1))])
    np.testing.assert_array_equal(external_forces(trace, scenario()), pushed)
    reference = np.random.default_rng(0).normal(size=(40, 3))
    asked = Trace.of(trace.time, {"tip": trace["tip"], "reference_force": reference})
    alone = np.hstack([reference, np.zeros((40, 4))])
    np.testing.assert_array_equal(external_forces(asked, None), alone)
    np.testing.assert_array_equal(external_forces(asked, scenario(operator={"kind": "none"})), alone)
    np.testing.assert_array_equal(external_forces(asked, scenario()), alone + pushed)


def test_the_scenario_of_a_trace_is_read_back_unless_it_is_missing_or_of_another_version() -> None:
    s = scenario()
    assert recorded_scenario(still(metadata={"scenario": s.to_dict()})) == s
    assert recorded_scenario(still()) is None
    assert recorded_scenario(still(metadata={"scenario": {"device": {"warp": 9}}})) is None


@pytest.mark.parametrize("kind", ["spring", "wall"])
def test_the_radii_of_a_run_are_those_of_its_loops(kind: str) -> None:
    """Without contact at the end of a run on a wall there is no loop at rest, and on a spring there is."""
    own = {"kind": kind, "stiffness": "40 N/m", "damping": "1 N*s/m"} | (
        {"normal": [-1, 0, 0]} if kind == "wall" else {}
    )
    tables = {**SLIDER, "object": own, "run": {"duration": "1.5 s"}}
    trace = simulate(tables)
    found, reason = linear_radii_of(trace, Scenario.from_dict(tables))
    assert reason == ""
    assert found is not None
    assert found.rest == pytest.approx(found.start, rel=1e-6)
    assert found.start == pytest.approx(certify(tables).margin["spectral_radius"], rel=1e-9)


@pytest.mark.parametrize(("stiffness", "duration"), [(2000.0, 8.0), (2500.0, 8.0)])
def test_an_identified_model_decays_as_its_loop_where_it_rests(stiffness: float, duration: float) -> None:
    tables = {
        "device": {"name": "phantom-premium-1.5a", "model": "experimental", "kinematics": "nonlinear"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "0.5 ms", "topology": "force_tracking"},
        "reference": {"shape": "step", "force": "8.5 N"},
        "object": {"kind": "spring", "stiffness": f"{stiffness} N/m"},
        "controller": {"kind": "gain", "gain": [-0.1, 0.1, 0.1]},
        "run": {"duration": f"{duration} s"},
    }
    trace = simulate(Scenario.from_dict(tables))
    found, _ = linear_radii_of(trace, recorded_scenario(trace))
    steps = np.linalg.norm(np.diff(held_tip(trace), axis=0), axis=1)
    half, end = steps[7600:8000].max(), steps[-400:].max()  # of an oscillation of 0.5 s and less
    per_tick = (end / half) ** (1.0 / (len(steps) - 8000))
    assert found is not None
    assert found.rest is not None
    assert found.rest == pytest.approx(per_tick, abs=2e-5)
    assert abs(found.start - per_tick) > 4e-4
