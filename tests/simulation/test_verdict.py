"""One verdict for every run: never "settled" where the loop is unstable, off its object, out of reach or limited."""

from __future__ import annotations

import re
import tomllib
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from hypothesis import given
from hypothesis import strategies as st
from palpate.devices.reach import beyond_reach
from palpate.errors import ScenarioError
from palpate.scenario import Scenario
from palpate.simulation.decision import Evidence, decide
from palpate.simulation.evidence import lossy, resolution
from palpate.simulation.judgment import _reach, judge
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.simulation.windows import Window
from palpate.sweeps import sweep

SCENARIOS = Path(__file__).parents[2] / "scenarios"
PRESS: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "0.5 ms", "topology": "force_tracking"},
    "reference": {"shape": "step", "force": "8.5 N"},
    "object": {"kind": "spring", "stiffness": "1 N/mm"},
    "controller": {"kind": "lqg"},
    "run": {"duration": "1 s"},
}


def press(**changes: dict[str, Any]) -> dict[str, Any]:
    out = deepcopy(PRESS)
    for table, keys in changes.items():
        out[table] = {**out.get(table, {}), **keys}
    return out


@pytest.mark.parametrize(("force", "duration"), [("8.5 N", "1 s"), ("0.5 N", "3 s"), ("0.05 N", "0.3 s")])
def test_a_loop_with_an_unstable_linear_loop_is_never_settled(force: str, duration: str) -> None:
    trace = palpate.simulate(
        press(
            servo={"period": "1 ms"},
            controller={"kind": "none"},
            reference={"force": force},
            run={"duration": duration},
        )
    )
    assert trace.completed
    assert trace.verdict.state is State.UNSTABLE
    assert "the linear loop is unstable" in str(trace.verdict.linear)


def test_a_pose_at_the_edge_of_the_reach_is_out_of_reach_from_when_it_becomes_singular() -> None:
    trace = palpate.simulate(press(start={"pose": ["30 deg", "100 deg", "200 deg"]}))
    verdict = trace.verdict
    assert verdict.state is State.OUT_OF_REACH
    assert verdict.since is not None
    assert 0.0 < verdict.since < 0.2
    device, row = Scenario.from_dict(trace.scenario).load_device(), np.searchsorted(trace.time, verdict.since)
    beyond = beyond_reach(device, trace["angle"][0], trace["angle"])
    assert beyond[row]
    assert not beyond[:row].any()


@pytest.mark.parametrize("angle", [6.5, -6.5, 13.0])
def test_a_joint_that_has_turned_round_once_is_named_with_the_time(angle: float) -> None:
    scenario = Scenario.from_dict(PRESS)
    angles = np.tile([0.0, 2.2305, 3.2776], (5, 1))
    angles[3:, 0] += angle
    trace = Trace.of(np.linspace(0.0, 0.4, 5), {"angle": angles})
    assert _reach(trace, scenario, Window(0, 4)) == (pytest.approx(0.3), "joint 1 has turned round at t = 0.3 s")
    assert _reach(trace, scenario, Window(4, 4))[0] == pytest.approx(0.4)


def test_settling_refers_to_the_driven_axes() -> None:
    trace = palpate.simulate(press(reference={"force": ["0 N", "0 N", "8.5 N"]}))
    summary = palpate.summarize(trace)
    assert list(summary["axes"]) == ["z"]
    assert summary["axes"]["z"]["settling_5_percent_s"] < 0.1
    assert np.ptp(trace["deflection"][:, 0]) < 1e-12 < np.ptp(trace["deflection"][:, 2])


def test_the_motors_give_what_the_operator_does_not_and_their_limits_act_on_that() -> None:
    """Force tracking: command = reference + motors; held for ever, the motors give the continuous force."""
    trace = palpate.simulate(press(device={"saturation": True}, run={"duration": "5 s"}))
    motors = np.linalg.norm(trace["motor_force"], axis=1)
    np.testing.assert_allclose(trace["motor_force"], trace["command_force"] - trace["reference_force"])
    assert motors.max() <= 8.5 * (1 + 1e-12)
    assert motors[-1] == pytest.approx(1.4, rel=0.05)
    assert trace.verdict.state is State.DRIVE_LIMIT
    gentle = palpate.simulate(press(device={"saturation": True}, reference={"force": "0.5 N"}, run={"duration": "5 s"}))
    assert gentle.verdict.settled
    assert not gentle["saturated"].any()


def test_a_drive_that_gets_warm_is_no_instability_and_is_told_beforehand() -> None:
    """The motors hold 1.62 N with the weight, above the continuous 1.4 N; the limit acts after 14 s."""
    tables = tomllib.loads((SCENARIOS / "drive-limits-and-encoder.toml").read_text("utf-8"))
    tables["object"]["stiffness"] = "150 N/m"
    cold = palpate.simulate({**tables, "run": {"duration": "4 s"}})
    assert cold.verdict.settled
    told = re.search(
        r"the motors hold 1\.62 N, and the hot drive limits them after another ([\d.]+) s", str(cold.verdict)
    )
    assert told
    warm = palpate.simulate({**tables, "run": {"duration": "16 s"}})
    assert warm.verdict.state is State.DRIVE_LIMIT
    assert warm.verdict.since == pytest.approx(4.0 + float(told[1]), abs=0.01)


def test_without_limits_the_summary_says_what_the_motors_would_have_to_give() -> None:
    """8.5 N along each axis is a force of 14.7 N."""
    told = palpate.summarize(palpate.simulate(press()))
    assert told["peak_motor_force_N"] > 8.5 * np.sqrt(3.0)
    assert any("of which the drive gives 8.5 N" in warning for warning in told["warnings"])


def test_a_tip_that_is_thrown_off_its_mesh_has_lost_contact() -> None:
    tables = tomllib.loads((SCENARIOS / "slide-cube-by-forces.toml").read_text("utf-8"))
    tables["object"]["surface"]["viscous"] = "0 N*s/m"
    verdict = palpate.simulate(tables).verdict
    assert verdict.state is State.CONTACT_LOST


def test_a_steady_error_above_the_band_is_not_settled() -> None:
    trace = palpate.simulate(press(controller={"kind": "gain", "gain": 0.03}, reference={"force": "1 N"}))
    assert trace.verdict.state is State.UNDECIDED
    assert "from force over stiffness" in trace.verdict.reason


def test_the_attribute_of_a_trace_is_its_summary() -> None:
    for kind in ("none", "lqg", "lead_lag"):
        for period in ("0.25 ms", "1 ms"):
            trace = palpate.simulate(press(servo={"period": period}, controller={"kind": kind}))
            summary = palpate.summarize(trace)
            assert trace.stable == summary["stable"] == (trace.verdict.state is State.SETTLED)
            assert summary["verdict"].startswith(trace.verdict.state.label)


def test_a_joint_limit_stops_the_start_and_judges_the_run(tmp_path: Path) -> None:
    text = (SCENARIOS.parent / "python/palpate/devices/phantom-premium-1.5a.toml").read_text("utf-8")
    source = 'source = "assumed"'
    limits = (
        f'\n[limits]\nlower = {{ value = ["-1 rad", "2.225 rad", "1 rad"], {source} }}\n'
        f'upper = {{ value = ["1 rad", "3 rad", "4 rad"], {source} }}\n'
    )
    path = tmp_path / "limited.toml"
    path.write_text(text.replace("\n[drive]", f"{limits}\n[drive]"), "utf-8")
    limited = press(device={"name": str(path)})
    with pytest.raises(ScenarioError, match=r"start: joint 2 of \S+ is at 126.1 deg, beyond its limits"):
        palpate.simulate({**limited, "start": {"pose": ["0 rad", "2.2 rad", "3.2776 rad"]}})
    trace = palpate.simulate(limited)
    assert trace["angle"][:, 1].min() < 2.225
    assert trace.verdict.state is State.OUT_OF_REACH
    assert "joint 2 is beyond its limit" in trace.verdict.reason


sizes = st.floats(0.0, 1.0)


@given(
    early=sizes, prior=sizes, late=sizes, ripple=sizes, deflection=sizes, touching=sizes, saturated=sizes,
    contacts=st.integers(0, 9), pressed=st.booleans(), beyond=st.booleans(), constant=st.booleans(),
    linear=st.sampled_from([-1, 0, 1]), lossy=st.booleans(), diverged=st.booleans(),
    error=st.one_of(st.just(np.nan), st.floats(-1.0, 1.0)), generated=st.floats(-0.1, 0.1),
)  # fmt: skip
def test_no_evidence_against_a_loop_leaves_it_settled(diverged: bool, **values: Any) -> None:
    evidence = Evidence.of(1, unstable_from=1.0 if diverged else np.nan, **values)
    state = State(int(decide(evidence)[0]))
    against = (
        diverged
        or values["beyond"]
        or values["saturated"] > 0.01
        or values["linear"] < 0
        or not values["constant"]
        or abs(values["error"]) > 0.05
        or (values["pressed"] and values["touching"] == 0.0)
        or (values["ripple"] > max(0.05 * values["deflection"], 1e-6) and values["linear"] <= 0)
    )
    if against:
        assert state is not State.SETTLED
    if values["linear"] > 0:
        evidence = replace(evidence, generated=np.full(1, np.nan))
        assert State(int(decide(evidence)[0])) is state
    if diverged:
        assert state is State.UNSTABLE


def test_a_table_that_ends_constant_has_the_steady_error_of_the_step_to_the_same_force() -> None:
    loop = press(controller={"kind": "gain", "gain": 0.03}, run={"duration": "3 s"})
    step = palpate.simulate({**loop, "reference": {"shape": "step", "force": "1 N"}})
    rows = [["0 s", "0 N", "0 N", "0 N"], ["0.3 s", "1 N", "1 N", "1 N"], ["1 s", "1 N", "1 N", "1 N"]]
    table = palpate.simulate({**loop, "reference": {"shape": "table", "table": rows}})
    assert step.verdict.state is State.UNDECIDED
    assert table.verdict.state is State.UNDECIDED
    assert "from force over stiffness" in table.verdict.reason


def test_the_verdict_does_not_depend_on_how_many_ticks_are_recorded(tmp_path: Path) -> None:
    """A tip that bounces on a mesh at 47 Hz, recorded every 10 ms."""
    tables = press(
        servo={"period": "1 ms", "topology": "impedance_display"},
        operator={"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m",
                  "tissue_stiffness": "800 N/m", "tissue_damping": "1 N*s/m",
                  "shape": "step", "force": ["0 N", "0 N", "-1.5 N"]},
        run={"duration": "0.8 s", "record_every": 10},
    )  # fmt: skip
    del tables["reference"], tables["controller"]
    tables["object"] = {
        "kind": "mesh", "position": ["0 mm", "0 mm", "-0.5 mm"],
        "mesh": {"shape": "box", "edge": "80 mm", "divisions": 1},
        "surface": {"stiffness": "12 N/mm"},
    }  # fmt: skip
    seldom = palpate.simulate(tables)
    every = palpate.simulate({**tables, "run": {"duration": "0.8 s"}})
    assert every.verdict.state is State.BOUNDED_OSCILLATION
    assert seldom.verdict == every.verdict
    np.testing.assert_array_equal(seldom["tip"], every["tip"][::10])
    assert palpate.Trace.load(seldom.save(tmp_path / "t.h5")).verdict == every.verdict


def test_a_mesh_recorded_seldom_is_not_settled_without_the_verdict_of_every_tick() -> None:
    tables = tomllib.loads((SCENARIOS / "slide-cube-small-steps.toml").read_text("utf-8"))
    tables["run"]["record_every"] = 5
    seldom = palpate.simulate(tables)
    assert seldom.verdict.settled
    del seldom.metadata["verdict"]
    alone = judge(seldom)
    assert alone.state is State.UNDECIDED
    assert "one of 5 ticks is recorded" in alone.reason


def test_a_force_on_three_axes_states_its_magnitude() -> None:
    summary = palpate.summarize(palpate.simulate(press(reference={"force": ["3 N", "-4 N", "12 N"]})))
    assert summary["peak_reference_force_N"] == pytest.approx(13.0, rel=1e-12)


def test_a_run_of_very_many_ticks_is_judged_by_the_recorded_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise every tick is simulated once, and the recorded ones are a part of them."""
    tables = press(run={"duration": "0.05 s", "record_every": 5})
    whole = palpate.simulate(press(run={"duration": "0.05 s"}))
    thinned = palpate.simulate(tables)
    monkeypatch.setattr("palpate.simulation.simulator.MOST_TICKS", 100)
    seldom = palpate.simulate(tables)
    for trace in (thinned, seldom):
        np.testing.assert_array_equal(trace["tip"], whole["tip"][::5])
    assert thinned.verdict == whole.verdict
    monkeypatch.setattr("palpate.simulation.simulator.Simulation.every_tick", lambda _self: pytest.fail("too long"))
    palpate.simulate(tables)
    palpate.simulate(press(run={"duration": "0.05 s"}))


def test_the_resolution_of_the_tip_is_two_counts_of_every_joint() -> None:
    """The least distance that encoders of the arm can miss, at each of several poses."""
    with_counts = Scenario.from_dict(press(device={"encoder": True}))
    device, angles = with_counts.load_device(), np.array([[0.0, 2.2305, 3.2776], [0.3, 0.5, -0.3]])
    shifts = [
        np.abs(2.0 * device.jacobian(q) * device.encoder_step).sum(axis=1) for q in angles
    ]  # of each axis, if all joints miss two counts
    found = resolution(with_counts, device, angles)
    np.testing.assert_allclose(found, np.linalg.norm(shifts, axis=1))
    np.testing.assert_array_equal(resolution(Scenario.from_dict(PRESS), device, angles), [0.0, 0.0])
    assert lossy(with_counts, device)
    assert not lossy(Scenario.from_dict(PRESS), device.frictionless())


def test_a_tip_that_is_pushed_through_its_body_has_lost_contact() -> None:
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"force": ["0 N", "0 N", "-0.3 N"]},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-4 mm"],
            "body": {
                "shape": "block",
                "size": ["40 mm", "40 mm", "30 mm"],
                "young": "2 kPa",
                "spacing": "8 mm",
                "radius": "4 mm",
                "kind": "signed_distance",
            },
        },
        "run": {"duration": "0.1 s"},
    }
    spring = {"kind": "spring", "stiffness": "0.01 N/mm"}
    pad = tables["object"]
    scene = {key: table for key, table in tables.items() if key != "object"} | {"objects": {"pad": pad, "held": spring}}
    apart = {**pad["body"], "contact_points": [["-6 mm", "0 mm", "0 mm"], ["6 mm", "0 mm", "1 mm"]]}
    tool = {**tables, "object": {**pad, "body": apart}}
    for case, channel, tip in (
        (tables, "contact_lost", "the tip"),
        (scene, "pad_contact_lost", "the tip"),
        (tool, "contact_lost", "a tip of the tool"),
    ):
        trace = palpate.simulate(case)
        assert trace["touching"].any()
        assert trace[channel][-1, 0] == 1.0
        assert trace.verdict.state is State.CONTACT_LOST
        assert trace.verdict.reason.startswith(f"{tip} is pushed through the body at t = ")
    out = palpate.simulate({**tables, "run": {"duration": "0.5 s"}})  # on the other side of the body
    assert out["contact_lost"][-1, 0] == 0.0
    assert out.verdict.state is State.CONTACT_LOST
    assert out.verdict.reason.startswith("the tip is pushed through the body at t = ")
    beside = palpate.simulate({**tables, "object": {**pad, "position": ["60 mm", "0 mm", "8 mm"]}})
    assert beside.verdict.state is State.CONTACT_LOST
    assert beside.verdict.reason == "the tip never touches the object"
    inside = palpate.simulate({**tables, "object": {**pad, "position": ["0 mm", "0 mm", "3 mm"]}})
    assert inside.verdict.state is State.CONTACT_LOST
    where = "inside the body or behind its contact surface, where it has no contact: check object.position"
    assert inside.verdict.reason == f"the tip starts {where}"


@pytest.mark.parametrize(("friction", "hides"), [(0.0, False), (0.4, True)])
def test_dry_friction_of_a_surface_may_hide_what_the_linear_loop_does(friction: float, hides: bool) -> None:
    mesh = {"shape": "box", "edge": "40 mm", "divisions": 2, "radius": "2 mm"}
    surface = {"stiffness": "100 N/m", "static_friction": friction, "dynamic_friction": friction}
    scenario = Scenario.from_dict({**PRESS, "object": {"kind": "mesh", "mesh": mesh, "surface": surface}})
    assert lossy(scenario, scenario.load_device().frictionless()) is hides


SLOW: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"topology": "impedance_display"},
    "operator": {"kind": "arm", "mass": "0.1 kg", "damping": "100 N*s/m", "stiffness": "10 N/m"},
    "object": {"kind": "wall", "stiffness": "50 N/m", "normal": [1, 0, 0]},
}


@pytest.mark.parametrize("given", ["0.2 s", "1 s", "2.5 s"])
def test_a_tip_on_its_way_to_rest_has_not_settled(given: str) -> None:
    """A time constant of 1.7 s towards 50 mm: after 0.2 s the tip is at 6 mm, in a loop that is stable."""
    press = {"shape": "step", "force": ["-3 N", "0 N", "0 N"]}
    trace = palpate.simulate({**SLOW, "operator": {**SLOW["operator"], **press}, "run": {"duration": given}})
    assert abs(trace["tip"][-1, 0]) < 0.9 * 0.05
    assert trace.verdict.state is State.UNDECIDED
    assert "has not settled" in trace.verdict.reason
    cells = sweep(trace.scenario, {"object.stiffness": ["50 N/m"]})
    assert cells.outcomes["verdict"].astype(int) == [State.UNDECIDED]


def test_a_step_shortly_before_the_end_has_not_settled() -> None:
    """From 17 to 50 mm with a time constant of 1.7 s, judged in the last 6 % of 10 s; after 20 s the tip rests."""
    rows = [["0 s", "-1 N", "0 N", "0 N"], ["9.4 s", "-1 N", "0 N", "0 N"], ["9.401 s", "-3 N", "0 N", "0 N"]]
    press = {"shape": "table", "table": [*rows, ["100 s", "-3 N", "0 N", "0 N"]]}
    run = {**SLOW, "operator": {**SLOW["operator"], **press}}
    verdicts = {time: palpate.simulate({**run, "run": {"duration": time}}).verdict for time in ("10 s", "20 s")}
    assert verdicts["10 s"].state is State.UNDECIDED
    assert verdicts["20 s"].settled


@pytest.mark.parametrize("given", ["0.2 s", "0.34 s"])
def test_a_turning_point_of_a_slow_oscillation_is_no_rest(given: str) -> None:
    """At 20 N/m the slider swings by 25 mm with a period of 0.34 s; it hardly moves where it turns."""
    tables = tomllib.loads((SCENARIOS / "slider-wall-stable.toml").read_text("utf-8"))
    swinging = {**tables, "object": {"kind": "spring", "stiffness": "20 N/m"}, "run": {"duration": given}}
    assert palpate.simulate(swinging).verdict.state is State.UNDECIDED


def test_a_fixed_tip_does_not_hide_its_drive_or_controller() -> None:
    """15 N of wall on a drive of 8.5 N, and a controller whose command grows by 1 % per tick."""
    tables = tomllib.loads((SCENARIOS / "hold-inside-a-wall.toml").read_text("utf-8"))
    deep = {**tables, "object": {**tables["object"], "position": ["0 mm", "5 mm", "0 mm"]}}
    strong = palpate.simulate({**deep, "device": {**deep["device"], "saturation": True}}).verdict
    assert (strong.state, strong.since) == (State.DRIVE_LIMIT, 0.0)
    eye = np.eye(3)
    growing = {"A": 1.01 * eye, "B": np.hstack([0.0 * eye, eye]), "C": eye, "D": np.hstack([0.0 * eye, -eye])}
    law = {"kind": "state_space", **{name: rows.tolist() for name, rows in growing.items()}}
    unstable = palpate.simulate({**deep, "controller": law}).verdict
    assert unstable.state is State.UNDECIDED
    assert "the command still changes" in unstable.reason
    assert palpate.simulate(deep).verdict.settled


def test_late_ticks_are_not_judged_by_the_loop_without_them() -> None:
    """At 90 N/m late ticks destabilize the slider; a short run in which the oscillation shrinks shows nothing."""
    tables = tomllib.loads((SCENARIOS / "slider-wall-stable.toml").read_text("utf-8"))
    tables |= {"servo": {**tables["servo"], "jitter": "0.9 ms"}, "object": {"kind": "spring", "stiffness": "90 N/m"}}
    assert palpate.simulate({**tables, "run": {"duration": "60 s", "record_every": 5}}).verdict.state is State.UNSTABLE
    for seed in range(4):
        verdict = palpate.simulate({**tables, "run": {"duration": "2 s", "seed": seed}}).verdict
        assert not verdict.settled
        assert "late ticks destabilize a loop" in str(verdict.linear)
    never = {**tables, "object": {"kind": "spring", "stiffness": "110 N/m"}, "run": {"duration": "2 s"}}
    assert "the linear loop is unstable" in str(palpate.simulate(never).verdict.linear)


def retreat(until: str, duration: str) -> Trace:
    """Return a run of a hand on a wall that moves away by 2 mm, farther than the hand's force over its stiffness."""
    return palpate.simulate(
        {
            "device": {"name": "slider"},
            "servo": {"period": "1 ms", "topology": "impedance_display"},
            "operator": {"kind": "arm", "mass": "0.3 kg", "damping": "10 N*s/m", "stiffness": "130 N/m",
                         "force": ["-0.12 N", "0 N", "0 N"]},
            "object": {"kind": "wall", "normal": [1, 0, 0], "stiffness": "500 N/m",
                       "frame": {"displacement": [["0 s", "0 mm", "0 mm", "0 mm"], [until, "-2 mm", "0 mm", "0 mm"]]}},
            "run": {"duration": duration},
        }
    )  # fmt: skip


def test_a_run_whose_object_moves_until_the_end_is_undecided() -> None:
    verdict = retreat("100 s", "1 s").verdict
    assert verdict.state is State.UNDECIDED
    assert "the object moves until the end" in verdict.reason


@pytest.mark.parametrize("duration", ["3 s", "6 s", "9 s"])
def test_the_rounding_of_a_hand_at_rest_presses_on_nothing(duration: str) -> None:
    trace = retreat("0.5 s", duration)
    assert not trace["touching"][-1, 0]
    assert np.linalg.norm(trace["operator_force"][-1]) < 1e-3
    assert trace.verdict.state is State.SETTLED
    assert trace.verdict.reason.endswith("off the object")


@pytest.mark.parametrize(("before", "state"), [(1.0, State.UNDECIDED), (5.0, State.SETTLED)])
def test_a_fast_linear_loop_does_not_explain_a_tip_that_slides_on(before: float, state: State) -> None:
    slides = {"ripple": 1e-4, "ripple_before": before * 1e-4, "swing": 1e-9, "swing_before": 1e-9}
    found = decide(
        Evidence.of(
            1, unstable_from=np.nan, early=1e-10, prior=4e-12, late=3.9e-12, deflection=3e-3, linear=1, decay=8e-4,
            **slides,
        )
    )  # fmt: skip
    assert State(int(found[0])) is state


@pytest.mark.parametrize("late", [1e-8, 2.25e-7])
@pytest.mark.parametrize("resolution", [0.0, 1.1e-4])
def test_a_linear_loop_that_decays_faster_does_not_settle_a_tip_that_moves_on(late: float, resolution: float) -> None:
    """The evidence of a run on a body with friction, whose tip moves on by two deflections, and its oscillation."""
    found = decide(
        Evidence.of(
            1, unstable_from=np.nan, early=2.58e-7, prior=2.34e-7, late=late, ripple=1.33e-4, ripple_before=2.53e-4,
            swing=2e-5, swing_before=2.9e-5, shift=2.29e-4, shift_ratio=0.574, deflection=1.17e-3, linear=1,
            decay=0.135, resolution=resolution, local=True, lossy=True,
        )
    )  # fmt: skip
    assert State(int(found[0])) is (State.UNDECIDED if late > 1e-7 else State.SETTLED)


def test_the_loop_in_contact_does_not_judge_a_tip_that_never_touches_its_wall() -> None:
    wall = {"kind": "wall", "normal": [1, 0, 0], "stiffness": "50 N/mm", "position": ["-5 mm", "0 mm", "0 mm"]}
    hand = {"kind": "arm", "mass": "0.3 kg", "damping": "10 N*s/m", "stiffness": "200 N/m"}
    verdicts = [
        palpate.simulate(
            {
                "device": {"name": "slider", "delay": 2},
                "servo": {"period": "1 ms", "topology": "impedance_display"},
                "operator": {**hand, "force": [push, "0 N", "0 N"]},
                "object": wall,
                "run": {"duration": "1 s"},
            }
        ).verdict
        for push in ("-0.5 N", "0.5 N", "-3 N")
    ]
    assert all("never touches" in str(verdict.linear) for verdict in verdicts[:2])
    assert verdicts[0].state in (State.CONTACT_LOST, State.SETTLED)
    assert verdicts[1].state is State.SETTLED
    assert verdicts[2].state in (State.UNSTABLE, State.BOUNDED_OSCILLATION)


def arm_run(pose: tuple[float, float, float], duration: str, **tables: dict[str, Any]) -> Trace:
    """Return a run of the arm as an impedance display from a pose, rad."""
    arm = {"name": "phantom-premium-1.5a", **tables.pop("device", {})}
    servo = {"period": "1 ms", "topology": "impedance_display"}
    start = {"pose": [f"{angle} rad" for angle in pose]}
    return palpate.simulate({"device": arm, "servo": servo, "start": start, "run": {"duration": duration}, **tables})


@pytest.mark.parametrize("duration", ["2.1 s", "30 s"])
def test_an_oscillation_does_not_hide_a_slow_drift_near_a_singular_pose(duration: str) -> None:
    """The mean drifts by the size of the oscillation per fifth of the short run, then by 0.4 of the deflection."""
    hand = {"kind": "arm", "mass": "0.334 kg", "damping": "0.453 N*s/m", "stiffness": "192 N/m"}
    trace = arm_run(
        (0.306, 1.367, -0.301),
        duration,
        object={"kind": "wall", "stiffness": "53.1 N/m", "normal": [-0.622, -0.733, 0.276]},
        operator={**hand, "force": ["1.02 N", "1.13 N", "-0.66 N"]},
    )
    assert trace.verdict.state is (State.SETTLED if duration == "30 s" else State.UNDECIDED)


def test_a_guard_does_not_stabilize_an_arm_that_tips_over_along_its_wall() -> None:
    """Under a constant force it leaves the wall after 58 s. A hand that holds it prevents that."""
    wall = {"kind": "wall", "stiffness": "38.8 N/m", "normal": [0, 0, 1]}
    push = {"force": ["0 N", "0 N", "-0.0276 N"]}
    hand = {"kind": "arm", "mass": "0.1 kg", "damping": "5 N*s/m", "stiffness": "100 N/m", **push}
    for operator, expected in (({"kind": "force", **push}, State.UNDECIDED), (hand, State.SETTLED)):
        verdict = arm_run(
            (0.0174, 2.366, 2.981),
            "3.3 s",
            device={"delay": 2, "encoder": True},
            object=wall,
            operator=operator,
            guard={"kind": "passivity_controller"},
        ).verdict
        assert verdict.state is expected
        assert ("the linear loop is unstable" in str(verdict.linear)) is (expected is State.UNDECIDED)


@pytest.mark.parametrize(
    ("guard", "expected"),
    [("passivity_controller", State.UNSTABLE), ("half_sample", State.UNSTABLE), ("energy_bound", State.SETTLED)],
)
def test_of_the_guards_only_an_energy_bound_stabilizes_a_bilinear_damper(guard: str, expected: State) -> None:
    """It oscillates at half the sampling rate and diverges after 23 s and 10 s; in 1 s its growth hardly shows."""
    hand = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
    verdict = arm_run(
        (0.0, 2.2305, 3.2776),
        "1 s",
        object={"kind": "spring", "stiffness": "800 N/m", "damping": "30 N*s/m", "coupling": "bilinear"},
        operator={**hand, "force": ["0 N", "0 N", "-1 N"]},
        guard={"kind": guard},
    ).verdict
    assert verdict.state is expected


def test_friction_of_any_object_of_a_scene_hides_what_its_linear_loop_does() -> None:
    rough = {"kind": "mesh", "mesh": {"shape": "box", "edge": "20 mm", "divisions": 2}}
    for friction in (0.0, 0.3):
        rough["surface"] = {"stiffness": "1 N/mm", "static_friction": friction}
        spring = {"kind": "spring", "stiffness": "1 N/mm"}
        tables = {key: value for key, value in press().items() if key != "object"}
        scene = Scenario.from_dict({**tables, "objects": {"one": spring, "two": rough}})
        assert lossy(scene, scene.load_device().frictionless()) is (friction > 0.0)


def bouncing(contacts: int, touching: float = 0.2, growth: float = 1.0, widening: float = 0.0) -> State:
    """Decide a loop that bounces 1 mm high under a force that presses it on."""
    late = 1e-3
    evidence = Evidence.of(
        1,
        unstable_from=np.nan,
        early=late / growth**3,
        prior=late / growth,
        late=late,
        ripple=1e-3,
        swing=1e-3,
        swing_before=1e-3 / growth,
        ripple_before=1e-3 / growth,
        deflection=0.5e-3,
        touching=touching,
        contacts=contacts,
        apart=1.0 - touching,
        pressed=True,
        widening=widening,
        turns=contacts + 1.0,
    )
    return State(int(decide(evidence)[0]))


@pytest.mark.parametrize("touching", [0.2, 0.8])
def test_bounces_of_one_period_have_one_state_however_many_are_in_a_fifth(touching: float) -> None:
    """Two contacts show a period. One alone, or bounces that decay, may be the last ones."""
    for contacts in (2, 3, 4, 9):
        assert bouncing(contacts, touching) is State.BOUNDED_OSCILLATION
        assert bouncing(contacts, touching, growth=1.25, widening=1.25) is State.UNSTABLE
    for contacts in (0, 1):
        assert bouncing(contacts, touching) is State.CONTACT_LOST
    for contacts in (2, 3):
        assert bouncing(contacts, touching, growth=0.95) is State.CONTACT_LOST


def test_a_lost_contact_that_comes_back_asks_for_a_longer_run() -> None:
    """A hand pushes a light device against a wall: it bounces at the end of a short run, and settles in a long one."""
    scenario = press(
        servo={"period": "1 ms"},
        reference={"force": ["0 N", "0 N", "-0.3 N"]},
        operator={"kind": "arm", "mass": "60 g", "damping": "0.2 N*s/m", "stiffness": "20 N/m"},
        object={"kind": "wall", "stiffness": "0.3 N/mm", "normal": [0, 0, 1], "position": ["0 mm", "0 mm", "-2 mm"]},
        run={"duration": "0.3 s"},
    )
    del scenario["controller"], scenario["servo"]["topology"]
    verdict = palpate.simulate(scenario).verdict
    assert verdict.state is State.CONTACT_LOST, verdict
    assert "it touches it within the last 0.059 s and may bounce on: give a longer run.duration" in verdict.reason
    assert palpate.simulate({**scenario, "run": {"duration": "2 s"}}).verdict.settled
