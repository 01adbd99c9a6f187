"""A tool that turns and a gripper that closes: work and energy, places of the tips, loops, files and refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import Loop, fem, simulate
from palpate.errors import ScenarioError, StabilityError
from palpate.metrics import palpation_metrics, summarize
from palpate.scenario import Scenario
from palpate.simulation import Trace
from palpate.simulation.bodies import pressed_at
from palpate.simulation.verdict import State
from palpate.stability import certify, contact_stability
from palpate.sweeps import SweepError, sweep
from scipy.spatial.transform import Rotation

Options = dict[str, Any]
OPEN = (("-10.5 mm", "0 mm", "-2 mm"), ("10.5 mm", "0 mm", "-2 mm"))
CLOSED = (("-8 mm", "0 mm", "-2 mm"), ("8 mm", "0 mm", "-2 mm"))
TURNING = (("0.1 s", "0 deg", "0 deg", "0 deg"), ("0.4 s", "0 deg", "4 deg", "15 deg"))
CLOSING = (("0.1 s", 1), ("0.4 s", 0.2))


@pytest.fixture(scope="module")
def ridge(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """12 x 40 x 24 mm of 20 kPa, bonded below, touched on its sides and top."""
    path = tmp_path_factory.mktemp("body") / "ridge.h5"
    fem.build(fem.block((0.012, 0.04, 0.024), 0.004), young=20e3, fixed="z < 0.001 mm", touch="z > 4 mm", output=path)
    return path


def tables(ridge: Path, tool: Options | None, **options: Any) -> dict[str, Any]:
    body = {
        "file": str(ridge),
        "kind": "signed_distance",
        "radius": "4 mm",
        "origin": ["6 mm", "20 mm", "16 mm"],
        "contact_points": OPEN,
        **({} if tool is None else {"tool": tool}),
    }
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"force": ["0 N", "0.02 N", "0 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "0 mm"], "body": {**body, **options}},
        "run": {"duration": "0.8 s"},
    }


def run(ridge: Path, tool: Options | None, **options: Any) -> Trace:
    return simulate(Scenario.from_dict(tables(ridge, tool, **options)))


MOVES: list[Options] = [
    {"rotation": TURNING, "closed_points": CLOSED, "opening": (("0 s", 0.4), ("1 s", 0.4))},
    {"closed_points": CLOSED, "opening": CLOSING},
    {"rotation": TURNING, "closed_points": CLOSED, "opening": CLOSING},
]


@pytest.mark.parametrize("tool", MOVES)
def test_a_gripper_that_closes_and_turns_stores_the_work_of_its_tips(ridge: Path, tool: Options) -> None:
    """Static and without friction, so nothing is lost: the error is that of the sum over ticks."""
    metrics = palpation_metrics(run(ridge, tool))
    assert metrics is not None
    assert metrics.work > 1e-5
    assert abs(metrics.lost) < 2e-3 * metrics.stored


def test_late_ticks_leave_the_work_of_a_tool_as_it_is(ridge: Path) -> None:
    """The tool has the pose of the tick's own time."""
    late = tables(ridge, MOVES[2])
    late["servo"]["jitter"] = "0.3 ms"
    metrics = palpation_metrics(simulate(Scenario.from_dict(late)))
    assert metrics is not None
    assert abs(metrics.lost) < 1e-4 * metrics.stored


def test_a_gripper_that_opens_again_gets_back_what_it_gave(ridge: Path) -> None:
    there_and_back = {
        "closed_points": CLOSED,
        "opening": (*CLOSING, ("0.7 s", 1)),
        "rotation": (*TURNING, ("0.7 s", "0 deg", "0 deg", "0 deg")),
    }
    trace = run(ridge, there_and_back)
    metrics = palpation_metrics(trace)
    assert metrics is not None
    assert abs(metrics.work - metrics.stored) < 2e-3 * trace["stored_energy"].max()


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_the_tips_of_a_moving_tool_have_the_forces_of_tips_that_move_alone(ridge: Path, friction: float) -> None:
    """The places follow from numpy and scipy; `simulate_tips` knows no tool."""
    tool = {"rotation": TURNING, "closed_points": CLOSED, "opening": CLOSING}
    trace = run(ridge, tool, static_friction=friction, rotation=["0 deg", "0 deg", "25 deg"])
    part = np.clip((trace.time - 0.1) / 0.3, 0.0, 1.0)[:, None]
    x = 8e-3 + 2.5e-3 * (1.0 - 0.8 * part[:, 0])
    places = np.stack([np.column_stack([side * x, 0.0 * x, 0.0 * x - 2e-3]) for side in (-1, 1)], axis=1)
    turned = np.radians([0.0, 4.0, 15.0]) * part
    places = np.stack([Rotation.from_euler("xyz", turned).apply(places[:, k]) for k in range(2)], axis=1)
    body_turn = Rotation.from_euler("z", 25.0, degrees=True).as_matrix()
    centers = (trace["tip"][:, None] - trace["tip"][0] + places) @ body_turn + [6e-3, 20e-3, 16e-3]
    alone = fem.load(ridge).signed_distance(static_friction=friction).simulate_tips(centers, [4e-3, 4e-3])
    for k in range(2):
        expected = -alone[k].force @ body_turn.T
        same = 2 * 3e-4 if friction else 1e-6  # rounding decides whether the sweeps of friction end, each within 3e-4
        np.testing.assert_allclose(trace[f"point{k + 1}_force"], expected, atol=same * np.abs(expected).max())
    total = trace["point1_force"] + trace["point2_force"]
    np.testing.assert_allclose(trace["object_force"], total, atol=1e-12)


def test_a_tool_that_turns_with_its_body_has_its_forces_turned(ridge: Path) -> None:
    """About the vertical, by the moment of rest: forces at the end are those of the tool that was never turned."""
    turn = [("0.1 s", "0 deg", "0 deg", "0 deg"), ("0.4 s", "0 deg", "0 deg", "15 deg")]
    squeezed = [["-9 mm", "0 mm", "-2 mm"], ["9 mm", "0 mm", "-2 mm"]]
    still = tables(ridge, None, contact_points=squeezed)
    moved = tables(ridge, {"rotation": turn}, contact_points=squeezed, rotation=["0 deg", "0 deg", "15 deg"])
    for one in (still, moved):
        one["operator"] = {"kind": "fixed"}
        one["servo"]["topology"] = "impedance_display"
        del one["reference"]
    one, other = simulate(Scenario.from_dict(still)), simulate(Scenario.from_dict(moved))
    matrix = Rotation.from_euler("z", 15.0, degrees=True).as_matrix()
    expected = one["point1_force"][-1] @ matrix.T
    np.testing.assert_allclose(other["point1_force"][-1], expected, atol=1e-3 * np.linalg.norm(expected))
    assert np.linalg.norm(expected) > 0.01


@pytest.mark.parametrize("every", [1, 7])
def test_a_loop_that_moves_its_tool_gives_the_trace_of_a_scenario_that_does(ridge: Path, every: int) -> None:
    loop = Loop(Scenario.from_dict(tables(ridge, {"closed_points": CLOSED})))
    for k in range(400):
        if k >= 100 and k % every == 0:
            part = (k - 100) / 300
            loop.move_tool([0.0, 0.0, 0.2 * part], opening=1.0 - 0.7 * part)
        loop.step()
    live = loop.run()
    again = simulate(loop.scenario)
    for name in ("tip", "object_force", "point1_force", "contact_moment"):
        np.testing.assert_allclose(again[name], live[name], atol=1e-9 * np.abs(live[name]).max())
    assert live.verdict.state is again.verdict.state
    assert np.abs(live["contact_moment"]).max() > 1e-5
    loop.reset()
    assert loop.scenario.object.body.tool.rotation is None  # type: ignore[union-attr]


def test_a_run_in_which_the_tool_moves_to_the_end_is_undecided(ridge: Path) -> None:
    late = {"rotation": (TURNING[0], ("0.8 s", "0 deg", "0 deg", "15 deg"))}
    verdict = run(ridge, late).verdict
    assert verdict.state is State.UNDECIDED
    assert verdict.reason.startswith("the tool moves until the end: hold it at rest for the last fifth of the run")


def test_the_stability_of_a_gripper_is_that_of_its_last_pose(ridge: Path) -> None:
    """A tool closed on the way, and one that has been closed from the start, end in the same loop."""
    closing = {"closed_points": CLOSED, "opening": (("0.1 s", 1), ("0.3 s", 0))}
    friction = {"static_friction": 0.0}
    moved = run(ridge, closing, **friction)
    closed = run(ridge, None, contact_points=CLOSED, **friction)
    assert moved.verdict.state is State.SETTLED
    one, other = contact_stability(moved), contact_stability(closed)
    assert one.stiffness_margin == pytest.approx(other.stiffness_margin, rel=0.02)
    with pytest.raises(StabilityError, match=r"holds the tool still, and it moves until 0.3 s"):
        contact_stability(moved, 200)


def test_a_gripper_whose_tips_pass_into_each_other_is_undecided(ridge: Path) -> None:
    """Spheres of 7 mm, 14.4 and 13.2 mm apart at the end."""
    for half, state in ((7.2, State.SETTLED), (6.6, State.UNDECIDED)):
        closed = tuple((f"{sign * half} mm", "0 mm", "-2 mm") for sign in (-1, 1))
        tool = {"closed_points": closed, "opening": (("0.1 s", 1), ("0.4 s", 0))}
        verdict = run(ridge, tool, static_friction=0.6, radius="7 mm").verdict
        assert verdict.state is state
        assert state is State.SETTLED or "the tips 1 and 2 overlap by 0.8 mm" in verdict.reason


def test_a_grip_without_friction_has_no_certificate(ridge: Path) -> None:
    """It named a limit of stiffness, beyond which the loop did not oscillate, and a negative stiffness."""
    tool = {"closed_points": CLOSED, "opening": (("0.1 s", 1), ("0.3 s", 0))}
    slippery, rough = (certify(tables(ridge, tool, static_friction=mu)) for mu in (0.0, 0.6))
    assert slippery.verdict.state is State.UNDECIDED
    assert "the tips press against each other" in slippery.verdict.reason
    assert rough.verdict.state is State.STABLE


def test_the_pressure_under_a_moved_tool_is_that_of_its_forces(ridge: Path) -> None:
    trace = run(ridge, MOVES[2])
    body = pressed_at(trace, -1).body
    forces = body.core.contact_forces()[1]
    expected = sum(np.linalg.norm(trace[f"point{k}_force"][-1]) for k in (1, 2))
    assert forces.sum() == pytest.approx(float(expected), rel=0.1)  # along the nodes' normals


def edited(change: Callable[[Options], None], ridge: Path) -> Callable[[], object]:
    whole = tables(ridge, {"closed_points": CLOSED, "opening": CLOSING})
    change(whole["object"]["body"])
    return lambda: Scenario.from_dict(whole)


@pytest.mark.parametrize(
    ("tool", "points", "text"),
    [
        ({"closed_points": CLOSED[:1]}, OPEN, "tool: closed_points: 1 points for 2 contact_points"),
        ({"opening": CLOSING}, OPEN, "closed_points is missing; opening needs the contact points of the closed tool"),
        ({"closed_points": OPEN[::-1]}, OPEN, "tool: closed_points: tips 1 and 2 come to the same place"),
        ({"rotation": TURNING}, [], "tool: contact_points is missing; they are the tips of the tool"),
        ({"closed_points": CLOSED, "opening": (("0 s", 1), ("1 s", 2))}, OPEN, "the opening of row 2 is 2"),
        ({"closed_points": CLOSED, "opening": (("1 s", 1), ("1 s", 0))}, OPEN, r"the time of row 2 \(1 s\) is not"),
        ({"closed_points": CLOSED, "opening": (("1 s", 1),)}, OPEN, "a table needs at least two rows"),
        ({"closed_points": CLOSED, "opening": (("1 s", 1), (2,))}, OPEN, "row 2 must be a time and a number from 0"),
        ({"turning": TURNING}, OPEN, "turning"),
    ],
)
def test_a_motion_that_no_tool_makes_is_refused(ridge: Path, tool: Options, points: Any, text: str) -> None:
    with pytest.raises(ScenarioError, match=text):
        Scenario.from_dict(tables(ridge, tool, contact_points=points))


def test_tips_that_cross_at_an_opening_that_is_not_reached_are_no_mistake(ridge: Path) -> None:
    crossing = {"closed_points": OPEN[::-1], "opening": (("0.1 s", 1), ("0.4 s", 0.8))}
    assert Scenario.from_dict(tables(ridge, crossing)).object.body is not None


def test_a_loop_refuses_a_motion_that_its_tool_does_not_make(ridge: Path) -> None:
    still = Loop(Scenario.from_dict(tables(ridge, None)))
    rigid = Loop(Scenario.from_dict(tables(ridge, {})))
    planned = Loop(Scenario.from_dict(tables(ridge, MOVES[0])))
    gripper = Loop(Scenario.from_dict(tables(ridge, {"closed_points": CLOSED})))
    crossing = Loop(
        Scenario.from_dict(tables(ridge, {"closed_points": OPEN[::-1], "opening": (("0 s", 1), ("1 ms", 0.8))}))
    )
    crossing.run(100)
    refused: list[tuple[Callable[[], object], str]] = [
        (still.move_tool, "a loop moves the tool of a body at rest with that table"),
        (lambda: rigid.move_tool(opening=0.5), "the opening is 1 without closed_points, not 0.5"),
        (lambda: gripper.move_tool(opening=1.5), "the opening is from 0 to 1, not 1.5"),
        (lambda: planned.move_tool([0.0, 0.0, 0.1]), "a motion at 0 s comes before that at 1 s of the scenario"),
        (lambda: gripper.move_tool([0.0, 0.1]), "rotation: three finite numbers, rad"),
        (lambda: gripper.move_tool(opening="half"), "the opening is from 0 to 1, not 'half'"),  # type: ignore[arg-type]
        (lambda: gripper.move_tool(opening=None), "the opening is from 0 to 1, not None"),  # type: ignore[arg-type]
        (lambda: crossing.move_tool(opening=0.5), "closed_points: tips 1 and 2 come to the same place"),
    ]
    for attempt, text in refused:
        with pytest.raises(ScenarioError, match=text):
            attempt()


def test_flat_tips_follow_no_rotation_that_tilts_them(ridge: Path) -> None:
    """Their axis is the z of the body: a rotation about it moves them, any other would tilt them."""

    def flat(degrees: tuple[float, float, float], **options: Any) -> Scenario:
        rows = [["0 s", "0 deg", "0 deg", "0 deg"], ["0.2 s", *(f"{angle} deg" for angle in degrees)]]
        return Scenario.from_dict(tables(ridge, {"rotation": rows}, tip="flat", **options))

    for degrees, turned in (((5, 0, 0), "0 deg"), ((0, -5, 0), "0 deg"), ((0, 0, 5), "90 deg")):
        with pytest.raises(ScenarioError, match="tool: rotation: flat tips do not tilt with the tool"):
            flat(degrees, rotation=[turned, "0 deg", "0 deg"])
    loop = Loop(flat((0, 0, 5)))
    loop.run()
    with pytest.raises(ScenarioError, match="flat tips do not tilt"):
        loop.move_tool([0.1, 0.0, 0.0])


def test_a_sweep_refuses_a_tool_that_moves(ridge: Path, tmp_path: Path) -> None:
    scenario = Scenario.from_dict(tables(ridge, MOVES[0]))
    with pytest.raises(SweepError, match=r"object.body.tool: a sweep judges cells under a tool at rest"):
        sweep(scenario, {"object.body.stiffness_scale": [1.0, 2.0]})


def test_a_scenario_keeps_the_motion_of_its_tool_through_text(ridge: Path) -> None:
    scenario = Scenario.from_dict(tables(ridge, MOVES[2]))
    assert Scenario.from_dict(scenario.to_dict()).object == scenario.object


def test_the_summary_of_a_grip_gives_the_force_of_each_tip(ridge: Path) -> None:
    trace = run(ridge, MOVES[1])
    found = palpation_metrics(trace)
    assert found is not None
    last = trace.time >= trace.time[-1] - 0.1
    expected = [np.linalg.norm(trace[f"point{k}_force"][last], axis=1).mean() for k in (1, 2)]
    np.testing.assert_allclose(found.final_tip_forces, expected, rtol=1e-12)
    assert f"its tips with {expected[0]:.3g}, {expected[1]:.3g} N" in summarize(trace)["verdict"]


def test_a_certificate_of_a_gripper_tests_depths_after_its_last_motion(ridge: Path) -> None:
    """Whether the force on the tool grows before or after it has closed, no tested sample has a tool that moves."""
    closing = {"closed_points": CLOSED, "opening": (("0.05 s", 1), ("0.2 s", 0))}
    late = tables(ridge, closing, static_friction=0.5)
    late["reference"] = {"shape": "ramp", "start": "0.25 s", "rise": "0.2 s", "force": ["0 N", "0.1 N", "0 N"]}
    early = tables(ridge, closing, static_friction=0.5)
    one, other = (certify(Scenario.from_dict(one)) for one in (late, early))
    for found in (one, other):
        assert found.verdict.state in (State.STABLE, State.UNDECIDED)
        assert any("after its last motion, which ends at 0.2 s" in sentence for sentence in found.assumptions)
        assert "holds the tool still" not in found.verdict.reason
