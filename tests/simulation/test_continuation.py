"""Runs that go on under their last forces, where encoder counts may move the tip on along a surface with friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from palpate import fem
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.simulation import build_simulation
from palpate.simulation.continuation import LATER, SHIFTS, durations_on, later_motion, resting_window
from palpate.simulation.decision import STAYS, band_of
from palpate.simulation.evidence import evidence
from palpate.simulation.judgment import judge
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.simulation.windows import Window


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """24 x 24 x 12 mm of 60 kPa, bonded below, touched on its top."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    shape = fem.block((0.024, 0.024, 0.012), 0.004)
    fem.build(shape, young=60e3, fixed="z < 0.001 mm", touch="z > 11.9 mm", order=1, output=path)
    return path


def press(block: Path, force: float = 0.8, aside: float = 0.2, **changes: Any) -> dict[str, Any]:
    """Return the tables of a tracked force on a body with friction of 0.5, under encoder counts, with an arm."""
    body = {"file": str(block), "origin": ["12 mm", "12 mm", "12 mm"], "tip": "flat", "radius": "6 mm"}
    return {
        "device": {"name": "phantom-premium-1.5a", "encoder": True},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "force_tracking"},
        "reference": {"shape": "ramp", "rise": "0.1 s", "force": ["0 N", f"{aside} N", f"-{force} N"]},
        "operator": {"kind": "arm", "mass": "0.1 kg", "damping": "3 N*s/m", "stiffness": "200 N/m"},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-0.1 mm"],
            "body": {**body, "kind": "compliance", "static_friction": 0.5},
        },
        "controller": {"kind": "workspace"},
        "run": {"duration": "1 s"},
        **changes,
    }


def moved(trace: Trace) -> float:
    return float(trace.metadata["continued"]["moved_m"])


def test_the_mean_of_an_oscillation_shows_how_far_a_tip_moves_on() -> None:
    """A tip that oscillates by 20 um about its rest moves on by 30 and 50 um in later stretches of 20 samples."""
    tip, window = np.zeros((165, 3)), Window(0, 100)
    tip[:, 0] = 20e-6 * (-1.0) ** np.arange(165)
    tip[121:141, 1], tip[141:161, 1] = 30e-6, 50e-6
    touching = np.ones((165, 1))
    found = later_motion({"tip": tip, "touching": touching}, window, band=1e-4)  # type: ignore[arg-type]
    assert found["moved_m"] == found["onward_m"] == pytest.approx(50e-6)
    assert found["swing_m"] == pytest.approx(20e-6)
    assert found["contacts"] == 0
    short = later_motion({"tip": tip[:102], "touching": touching[:102]}, window, band=1e-4)  # type: ignore[arg-type]
    assert short["onward_m"] == 0.0


def test_a_tip_that_oscillates_beyond_its_band_or_bounces_later_leaves_its_rest() -> None:
    """Three stretches of 20 samples; the first half of them does not count."""
    tip, touching, window = np.zeros((165, 3)), np.ones((165, 1)), Window(0, 100)
    tip[141:161, 2] = 60e-6 * (-1.0) ** np.arange(20)
    assert later_motion({"tip": tip, "touching": touching}, window, 50e-6)["onward_m"] == pytest.approx(60e-6)  # type: ignore[arg-type]
    assert later_motion({"tip": tip, "touching": touching}, window, 70e-6)["onward_m"] == 0.0  # type: ignore[arg-type]
    touching[142:160:4] = 0.0
    bounces = later_motion({"tip": tip, "touching": touching}, window, 70e-6)  # type: ignore[arg-type]
    assert (bounces["contacts"], bounces["onward_m"]) == (5, 70e-6)
    touching[:] = 1.0
    touching[122:140:8] = touching[142:160:8] = 0.0
    assert later_motion({"tip": tip, "touching": touching}, window, 70e-6)["contacts"] == 6  # type: ignore[arg-type]
    touching[:] = 1.0
    touching[105:120:4] = 0.0
    assert later_motion({"tip": tip, "touching": touching}, window, 70e-6)["onward_m"] == 0.0  # type: ignore[arg-type]


def test_counts_settle_no_tip_that_slips_on_within_twelve_more_durations(block: Path) -> None:
    """Tips held by 0.97 of the friction force rest for seconds; then some of them slip by 0.4 to 0.8 mm."""
    slipped = []
    for force in (0.795, 0.8, 0.802, 0.805):
        tables = press(block, force, 0.388, run={"duration": "2 s"})
        trace, longer = palpate.simulate(tables), palpate.simulate({**tables, "run": {"duration": "26 s"}})
        np.testing.assert_array_equal(trace["tip"], longer["tip"][:2001])
        assert trace.verdict.state in (State.SETTLED, State.UNDECIDED)
        rest = resting_window(trace)
        if rest is None:
            continue
        window, band = rest
        way = later_motion(longer, window, band)["moved_m"]
        assert moved(trace) == way
        e = evidence(trace, Scenario.from_dict(trace.scenario), window, None)
        if way > STAYS * band_of(e)[0]:
            assert trace.verdict.state is State.UNDECIDED
            alone = replace(trace, metadata={k: v for k, v in trace.metadata.items() if k != "continued"})
            slipped += [trace.verdict.reason] if alone.verdict.state is State.SETTLED else []
    assert slipped, "no tip slipped later that the recorded run alone shows at rest"
    assert all("the tip moves on by" in reason for reason in slipped)


def test_the_trace_of_a_continued_run_ends_as_the_scenario_asks(block: Path) -> None:
    simulation = build_simulation(press(block))
    trace, alone = simulation.simulate(), simulation.trace(*simulation.run())
    assert len(trace) == 1001
    assert trace.metadata["continued"]["duration_s"] == pytest.approx(LATER * 1.0)
    for name in trace.channels:
        np.testing.assert_array_equal(trace[name], alone[name])
    assert "continued" not in alone.metadata


def test_a_tip_that_friction_alone_holds_settles_if_the_continued_run_shows_that_it_stays(block: Path) -> None:
    """The same tip is within 0.5 um of its place after five minutes."""
    trace = palpate.simulate(press(block, aside=0.24, operator={"kind": "none"}))
    assert moved(trace) < 2e-6
    assert trace.verdict.state is State.SETTLED
    trace.metadata.pop("continued")
    verdict = judge(trace)
    assert verdict.state is State.UNDECIDED
    assert "within two encoder counts, in which a contact with friction may slip on" in verdict.reason


def test_a_run_that_records_every_tenth_tick_has_the_same_way_on(block: Path) -> None:
    every, tenth = (palpate.simulate(press(block, run={"duration": "1 s", "record_every": n})) for n in (1, 10))
    assert moved(tenth) == moved(every)
    assert tenth.verdict == every.verdict
    assert tenth.scenario["run"]["record_every"] == 10


def test_windings_do_not_warm_up_in_a_continued_run(block: Path) -> None:
    """Motors that hold 2.6 N are limited after 2.3 s; the tip goes on as without limits. A second run has them."""
    free = palpate.simulate(press(block, 3.0))
    limits = {"name": "phantom-premium-1.5a", "encoder": True, "saturation": True}
    simulation = build_simulation(press(block, 3.0, device=limits))
    limited, again = simulation.simulate(), simulation.simulate()
    assert "the hot drive limits them after another 2." in limited.verdict.reason
    assert moved(limited) == moved(free)
    np.testing.assert_array_equal(limited["tip"], again["tip"])
    assert simulation.setup.limits.continuous_force == simulation.device.continuous_force


def test_a_stored_trace_keeps_its_verdict(block: Path, tmp_path: Path) -> None:
    trace = palpate.simulate(press(block, aside=0.24, operator={"kind": "none"}))
    assert Trace.load(trace.save(tmp_path / "run.h5")).verdict == trace.verdict


def smooth(tables: dict[str, Any]) -> None:
    tables["object"]["body"]["static_friction"] = 0.0


def test_a_run_with_friction_without_counts_goes_on_too(block: Path) -> None:
    """Its friction may feed a limit cycle that the linear loop does not have."""
    tables = press(block)
    tables["device"]["encoder"] = False
    trace = palpate.simulate(tables)
    assert trace.metadata["continued"]["durations"] == LATER
    assert trace.verdict.state is State.SETTLED


def late_force(tables: dict[str, Any]) -> None:
    tables["reference"]["rise"] = "1 s"


def moving(tables: dict[str, Any]) -> None:
    """The object comes to rest, and moves again after the end of the run."""
    rows = [["0 s", 0.0], ["0.1 s", 0.1], ["2 s", 0.1], ["2.1 s", 5.0]]
    tables["object"]["frame"] = {"displacement": [[at, f"{x} mm", "0 mm", "0 mm"] for at, x in rows]}


@pytest.mark.parametrize("change", [smooth, late_force, moving])
def test_other_runs_end_when_they_end(block: Path, change: Any) -> None:
    tables = press(block)
    change(tables)
    assert "continued" not in palpate.simulate(tables).metadata


def test_a_controller_in_python_is_not_asked_after_the_end_of_its_run(block: Path) -> None:
    """The tip rests, but the controller may have any state."""
    times: list[float] = []

    def hold(tick: Any) -> Any:
        times.append(tick.time)
        return tick.reference

    trace = palpate.simulate(press(block), controller=hold)
    assert resting_window(trace) is not None
    assert "continued" not in trace.metadata
    assert max(times) <= 1.0


def test_a_verdict_states_the_way_on_from_a_tenth_of_the_band_on(block: Path) -> None:
    trace = palpate.simulate(press(block))
    continued = trace.metadata["continued"]
    assert continued["moved_m"] < 0.1 * continued["band_m"]
    for share, state, told in (
        (0.09, State.SETTLED, None),
        (0.3, State.SETTLED, "by {way:.2g} mm"),
        (STAYS + 0.01, State.UNDECIDED, "by {way:.2g} mm"),
        (1e80, State.UNDECIDED, "without limit"),
    ):
        way = share * continued["band_m"]
        other = replace(trace, metadata={**trace.metadata, "continued": {**continued, "moved_m": way, "onward_m": way}})
        verdict = judge(other)
        assert verdict.state is state
        for text in (verdict.reason, summarize(other)["verdict"]):
            if told is None:
                assert "the tip moves on" not in text
            else:
                far = told.format(way=1e3 * way)
                assert f"the tip moves on {far} in 12 more durations of the run" in text


def test_a_hyperelastic_body_goes_on_for_four_durations_and_others_for_twelve(block: Path) -> None:
    for kind, durations in (("compliance", LATER), ("viscoelastic", LATER), ("neo-hookean", 4), ("corotational", 4)):
        tables = press(block)
        body = {**tables["object"]["body"], "kind": kind}
        body |= {"instantaneous_ratio": 2.0, "retardation_time": "20 ms"} if kind == "viscoelastic" else {}
        assert durations_on(Scenario.from_dict(press(block, object={**tables["object"], "body": body}))) == durations


def test_a_run_on_a_mesh_with_friction_goes_on_too(block: Path) -> None:
    mesh = {
        "kind": "mesh",
        "position": ["0 mm", "0 mm", "-0.1 mm"],
        "mesh": {"shape": "box", "edge": "80 mm", "divisions": 4},
        "surface": {"stiffness": "0.5 N/mm", "tangential": "0.3 N/mm", "static_friction": 0.5},
    }
    rough = press(block, object=mesh)
    trace = palpate.simulate(rough)
    assert trace.verdict.state is State.SETTLED
    assert moved(trace) < STAYS * trace.metadata["continued"]["band_m"]
    smooth = palpate.simulate(press(block, aside=0.0, object={**mesh, "surface": {"stiffness": "0.5 N/mm"}}))
    assert smooth.verdict.state is State.SETTLED
    assert moved(smooth) < SHIFTS * smooth.metadata["continued"]["band_m"]
    alone = judge(replace(smooth, metadata={key: of for key, of in smooth.metadata.items() if key != "continued"}))
    assert alone.state is State.UNDECIDED
    assert "nothing holds the tip along the surface of the mesh, and the tip may slide off after" in alone.reason


@pytest.fixture(scope="module")
def drum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A net of 30 x 30 mm of stretched springs, fixed at its border."""
    path = tmp_path_factory.mktemp("body") / "drum.h5"
    number = np.arange(49).reshape(7, 7)
    points = 5e-3 * np.array([[i, j, 0] for i in range(7) for j in range(7)], dtype=float)
    pairs = [number[:-1], number[1:]], [number[:, :-1], number[:, 1:]]
    springs = np.vstack([np.column_stack([one.ravel(), two.ravel()]) for one, two in pairs])
    a, b, c, d = (number[i : i + 6, j : j + 6].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    border = np.any((points[:, :2] < 1e-6) | (points[:, :2] > 29.9e-3), axis=1)
    options = {"rest_lengths": 5e-3 / 1.2, "damping": 0.02, "masses": 1e-4}
    fem.build_springs(points, springs, stiffness=200.0, fixed=border, triangles=triangles, output=path, **options)
    return path


def test_a_tip_that_nothing_holds_is_followed_until_it_slides_off(drum: Path) -> None:
    """It rests in unstable equilibrium over the middle of a net, and leaves it by 1.7 mm within 30 s."""
    force = [[time, "0 N", "0 N", f"{-newton} N"] for time, newton in (("0 s", 0.0), ("1 s", 0.884512))]
    push = [["1.3 s", "0 N", "0 N", "-0.884512 N"], ["1.302 s", "0.008845 N", "0 N", "-0.893357 N"]]
    body = {"file": str(drum), "kind": "mass_spring", "origin": ["15 mm", "15 mm", "0 mm"], "radius": "6 mm"}
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"topology": "impedance_display"},
        "operator": {
            "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "100 N/m",
            "shape": "table", "table": [*force, *push, ["1.31 s", "0 N", "0 N", "-0.884512 N"]],
        },
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-6 mm"],
            "body": {**body, "hardening_strain": 0.5, "stiffness_scale": 1.18},
        },
        "run": {"duration": "2.5 s"},
    }  # fmt: skip
    trace = palpate.simulate(tables)
    assert np.ptp(trace["tip"][-250:], axis=0).max() < 1e-6
    assert moved(trace) == pytest.approx(1.7e-3, abs=0.1e-3)
    assert trace.verdict.state is State.UNDECIDED
    assert "the tip moves on by 1.7 mm" in trace.verdict.reason
    loop = palpate.Loop(tables)
    loop.run()
    verdict = loop.trace.verdict
    assert verdict.state is State.UNDECIDED
    assert "nothing holds the tip along the surface of the body" in verdict.reason


def test_a_loop_whose_tip_shifts_is_not_settled_as_it_is_not_followed(tmp_path: Path) -> None:
    """A constant force on a creeping block without friction: the run that goes on slides by 2 mm."""
    path = tmp_path / "block.h5"
    shape = fem.block((0.04, 0.04, 0.02), 0.004)
    fem.build(shape, young=10e3, poisson=0.45, fixed="z < 0.1 mm", touch="z > 19.9 mm", output=path)
    body = {"file": str(path), "kind": "viscoelastic", "contact": "signed_distance", "radius": "6 mm"}
    creep = {"instantaneous_ratio": 2.0, "retardation_time": "50 ms", "origin": ["20 mm", "20 mm", "20 mm"]}
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "ramp", "rise": "0.1 s", "force": ["0 N", "0 N", "-0.3 N"]},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-6 mm"], "body": {**body, **creep}},
        "run": {"duration": "1 s"},
    }
    followed = palpate.simulate(tables)
    assert moved(followed) > 1e-3
    assert "the tip moves on by" in followed.verdict.reason
    loop = palpate.Loop(tables)
    loop.run()
    np.testing.assert_array_equal(loop.trace["tip"], followed["tip"])
    assert loop.trace.verdict.state is State.UNDECIDED
    assert "its mean position still shifts, and the tip may slide off after the run" in loop.trace.verdict.reason
