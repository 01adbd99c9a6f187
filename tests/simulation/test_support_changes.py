"""Supports of a body that change while a loop runs: the same run by a program, its record and its verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nightly import some
from palpate import Loop, fem, simulate
from palpate.errors import PalpateError, ScenarioError
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.simulation import Trace, build_simulation
from palpate.simulation.bodies import pressed_at
from palpate.simulation.body_response import HeldTip, body_response
from palpate.simulation.surface_frames import SurfaceFrames
from palpate.simulation.verdict import State
from palpate.stability import certify
from palpate.sweeps.axes import SweepError
from palpate.sweeps.excitation import excited

BESIDE = ["x < 11 mm", "x > 29 mm"]
RELAXING = {
    "kind": "viscoelastic",
    "contact": "signed_distance",
    "instantaneous_ratio": 2.0,
    "retardation_time": "50 ms",
}
SWINGING = {"kind": "modal", "contact": "signed_distance", "rayleigh_alpha": "20 1/s", "rayleigh_beta": "2 ms"}
KINDS = ({"kind": "compliance"}, {"kind": "signed_distance"}, RELAXING, SWINGING)
GRASP = [{"at": "0.4 s", "held": BESIDE}]


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("body") / "block.h5"
    volume = fem.block(["40 mm", "40 mm", "20 mm"], "4 mm")
    fem.build(volume, young="10 kPa", fixed="z < 0.1 mm", touch="z > 19.9 mm", modes=10, output=path)
    return path


def press(block: Path, duration: str = "1 s", **body: Any) -> dict[str, Any]:
    """A press of 0.3 N along -z by a hand-held arm."""
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.3 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-15 mm"],
            "body": {"file": str(block), "origin": ["20 mm", "20 mm", "20 mm"], "radius": "15 mm", **body},
        },
        "run": {"duration": duration},
    }


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind["kind"])
def test_a_body_that_may_change_but_does_not_runs_alike(block: Path, kind: dict[str, Any]) -> None:
    plain, free = simulate(press(block, **kind)), simulate(press(block, **kind, supports=[]))
    for name in ("tip", "object_force", "stored_energy"):
        np.testing.assert_array_equal(free[name], plain[name])
    assert plain["contact_nodes"].max() >= 4
    assert str(free.verdict) == str(plain.verdict)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind["kind"])
def test_a_loop_changed_by_a_program_is_that_of_the_scenario(block: Path, kind: dict[str, Any]) -> None:
    changes = [*GRASP, {"at": "0.6 s", "held": [], "touchable": "x > 10 mm"}]
    planned = simulate(press(block, **kind, supports=changes))
    loop = Loop(press(block, **kind, supports=[]))
    for _ in range(2):  # reset() forgets the changes
        loop.run(400)
        loop.change_supports(held=BESIDE)
        loop.run(200)
        loop.change_supports(held=[], touchable="x > 10 mm")
        loop.run()
        for name in ("tip", "object_force", "stored_energy"):
            np.testing.assert_array_equal(loop.trace[name], planned[name])
        assert str(loop.trace.verdict) == str(planned.verdict)
        assert [change.at for change in loop.scenario.object.body.supports] == pytest.approx([0.4, 0.6])
        loop.reset()
    assert loop.scenario.object.body.supports == ()
    before = simulate(press(block, **kind))
    np.testing.assert_array_equal(before["tip"][:401], planned["tip"][:401])
    assert np.abs(before["tip"][450] - planned["tip"][450]).max() < 1e-5  # a grasp in rest changes nothing
    assert np.abs(before["tip"][-1] - planned["tip"][-1]).max() < 5e-4


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind["kind"])
def test_a_record_repeats_the_body_with_its_changes(block: Path, kind: dict[str, Any]) -> None:
    changes = [{"at": "20 ms", "held": ["x < 11 mm"]}, {"at": "0.2 s", "held": ["y < 11 mm"]}]
    trace = simulate(press(block, "0.4 s", **kind, supports=changes))
    for row in (10, 100, 400):
        pressed = pressed_at(trace, row)
        nodes, forces = pressed.body.core.contact_forces()
        assert len(nodes) == trace["contact_nodes"][row, 0]
        if kind["kind"] == "compliance" and len(nodes):
            assert forces.sum() == pytest.approx(np.linalg.norm(trace["object_force"][row]), rel=0.05)
    held = pressed.body.nodes[:, 1] < 11e-3
    before = pressed_at(trace, 200).displacement[held]
    np.testing.assert_allclose(pressed_at(trace, 400).displacement[held], before, atol=2e-8)
    assert np.abs(before).max() > 1e-6


def loop_response(trace: Trace) -> Any:
    """Static stiffness of the body about the end of a run, as its linear loop has it, N/m."""
    return body_response(HeldTip(Scenario.from_dict(trace.scenario), trace["tip"] - trace["tip"][0])).static


@pytest.mark.parametrize(
    ("options", "difference"),
    some(
        [
            ({"kind": "compliance"}, 1e-4),
            ({"kind": "signed_distance"}, 1e-4),
            ({"kind": "signed_distance", "static_friction": 0.5}, 0.03),  # the place depends on the path
            (RELAXING, 3e-3),  # points at the border of the contact come and go within the tolerance of the forces
            (SWINGING, 3e-3),
        ],
        4,
    ),
)
def test_the_verdict_is_that_of_the_last_phase(block: Path, options: dict[str, Any], difference: float) -> None:
    """Its linear loop is that of the body with the supports of the last phase, not of the first."""
    stiffness: dict[str, Any] = {}
    for name, body in {
        "free": {"supports": []},
        "grasped": {"supports": [{"at": "10 ms", "held": BESIDE}]},
        "held": {"held": BESIDE},
        "released": {"supports": [{"at": "10 ms", "held": BESIDE}, {"at": "0.5 s", "held": []}]},
    }.items():
        trace = simulate(press(block, "2 s", **options, **body))
        verdict = trace.verdict
        assert verdict.state is State.SETTLED, verdict
        assert verdict.linear is not None
        at_limit = name == "released" and "static_friction" in options  # nodes may rest where they begin to slide
        assert "the linear loop is stable" in verdict.linear or (
            at_limit and "opposite displacements" in verdict.linear
        )
        stiffness[name] = np.linalg.norm(loop_response(trace))
        told = "judged after the last change of supports, at " in verdict.reason
        assert told is (name in ("grasped", "released"))
    assert stiffness["held"] > 1.005 * stiffness["free"]
    assert stiffness["grasped"] == pytest.approx(stiffness["held"], rel=difference)
    assert stiffness["released"] == pytest.approx(stiffness["free"], rel=difference)


def test_a_change_near_the_end_leaves_the_run_undecided(block: Path) -> None:
    """The evidence before it counts no more; a fixed object and force would settle."""
    calm = simulate(press(block, "2 s"))
    assert calm.verdict.state is State.SETTLED
    late = simulate(press(block, "2 s", supports=[{"at": "1.95 s", "held": BESIDE}]))
    assert late.verdict.state is State.UNDECIDED
    assert "the supports of the body change at 1.95 s, too late to judge" in late.verdict.reason
    loop = Loop(press(block, "2 s", supports=[]))
    loop.run(1990)
    loop.change_supports(held=BESIDE)
    loop.run()
    assert loop.trace.verdict.state is State.UNDECIDED


def test_a_certificate_is_that_of_the_last_phase(block: Path) -> None:
    """Depths that the run passed under other supports are not tested, and the certificate says so."""
    plain = press(block, kind="signed_distance", supports=[])
    grasped = press(block, kind="signed_distance", supports=[{"at": "0.5 s", "held": BESIDE}])
    found, free = certify(grasped), certify(plain)
    assert free.verdict.state is State.STABLE
    held = certify(press(block, kind="signed_distance", held=BESIDE))
    assert found.verdict.state is State.STABLE
    assert found.margin["gain_margin"] == pytest.approx(held.margin["gain_margin"], rel=0.02)
    assert "No other depth is tested: after 0.5 s, the last change, the run passes none." in found.method
    assert not any("No other depth" in step for step in free.method)
    assert any("those after their last change, at 0.5 s" in sentence for sentence in found.assumptions)


def test_a_certificate_needs_no_table_of_the_run(block: Path) -> None:
    """A run without one lasts for 1 s."""
    tables = press(block, "1 s", kind="signed_distance")
    short = {key: table for key, table in tables.items() if key != "run"}
    found = certify(short)
    assert found.verdict == certify(tables).verdict
    assert found.verdict.state is State.STABLE


def test_a_run_names_an_overlap_with_what_is_held_at_its_end(block: Path) -> None:
    under = ["x < 17 mm"]
    told = [
        "overlaps a part of the surface that is fixed"
        in summarize(simulate(press(block, supports=supports)))["verdict"]
        for supports in ([], [{"at": "0.5 s", "held": under}])
    ]
    assert told == [False, True]


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        (
            {"supports": [{"at": "2 s", "held": BESIDE}]},
            r"object\.body\.supports: the change at 2 s comes after the run of 1 s",
        ),
        (
            {"supports": [{"at": "0.1 s", "held": "x < -1 mm"}]},
            r"object\.body\.supports: held: no contact node lies in",
        ),
        ({"supports": [*GRASP, *GRASP]}, r"the times must increase, and 0\.4 s follows 0\.4 s"),
        ({"supports": [{"at": "0.1 s"}]}, r"it changes nothing; write for example held"),
        ({"supports": [{"at": "0.1 s", "hold": BESIDE}]}, r"hold"),
        (
            {"supports": GRASP, "static_friction": 0.3},
            r"supports: with friction, supports that change at run time need kind = \"signed_distance\"",
        ),
        (
            {"supports": GRASP, "kind": "viscoelastic", "instantaneous_ratio": 2, "retardation_time": "1 s"},
            r"need the contact by signed distance; write contact = \"signed_distance\"",
        ),
        (
            {"supports": GRASP, "kind": "modal"},
            r"need the contact by signed distance; write contact = \"signed_distance\"",
        ),
        (
            {"supports": GRASP, **SWINGING, "instantaneous_ratio": 2, "retardation_time": "1 s"},
            r"of a body with inertia that relaxes do not change; remove instantaneous_ratio",
        ),
        (
            {"supports": GRASP, "kind": "mass_spring"},
            r"need a body of the kind compliance, signed_distance, viscoelastic or modal",
        ),
        ({"supports": [{"at": "0 s", "held": BESIDE}]}, r"is that of the start: hold a region"),
    ],
)
def test_a_scenario_whose_changes_are_none_is_refused(block: Path, body: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ScenarioError, match=sentence):
        build_simulation(press(block, **body))


def test_a_program_is_told_why_it_cannot_change_supports(block: Path) -> None:
    with pytest.raises(ScenarioError, match="with that key"):
        Loop(press(block)).change_supports(held=BESIDE)
    loop = Loop(press(block, supports=GRASP))
    with pytest.raises(ScenarioError, match="comes before the first sample"):
        loop.change_supports(held=BESIDE)
    loop.run(10)
    with pytest.raises(ScenarioError, match=r"a change at 0\.01 s comes no later than that at 0\.4 s"):
        loop.change_supports(held=BESIDE)
    loop.run(500)
    with pytest.raises(ScenarioError, match="no contact node lies in"):
        loop.change_supports(held="x < -1 mm")
    with pytest.raises(ScenarioError, match="write them as text"):
        loop.change_supports(held=5)  # type: ignore[arg-type]
    loop.change_supports(held=[])
    with pytest.raises(ScenarioError, match="comes no later than that at"):
        loop.change_supports(held=BESIDE)


def test_what_keeps_supports_says_so(block: Path) -> None:
    simulation = build_simulation(press(block, supports=GRASP))
    with pytest.raises(PalpateError, match="cannot be drawn while a loop runs"):
        SurfaceFrames(simulation)
    with pytest.raises(SweepError, match="under constant supports"):
        excited(simulation)


def test_changes_are_kept_in_tables(block: Path) -> None:
    scenario = Scenario.from_dict(press(block, supports=[*GRASP, {"at": "0.5 s", "touchable": []}]))
    assert Scenario.from_dict(scenario.to_dict()) == scenario
    assert scenario.object.body is not None
    assert scenario.object.body.supports is not None
    assert scenario.object.body.supports[1].held is None
    assert scenario.object.body.supports[1].touchable == ()
