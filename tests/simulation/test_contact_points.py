"""A rigid tool of several tips on a body: forces are sums over its tips, its moment is a derivative of the energy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import fem, simulate
from palpate.arrays import Array
from palpate.errors import PoseError, ScenarioError
from palpate.fem import Body, BodyError
from palpate.scenario import Scenario
from palpate.simulation import Trace
from palpate.simulation.body_response import HeldTip, body_response
from palpate.simulation.verdict import State
from palpate.stability import contact_stability
from scipy.spatial.transform import Rotation

RADIUS = 5e-3
TOOL = np.array([[-9e-3, 1e-3, 0.0], [8e-3, -2e-3, -0.3e-3], [1e-3, 7e-3, 0.2e-3]])
MIDDLE = np.array([20e-3, 20e-3, 20e-3])


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 x 40 x 20 mm of 10 kPa, bonded below, touched on its top."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    fem.build(fem.block((0.04, 0.04, 0.02), 0.005), young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", output=path)
    return path


@pytest.fixture(scope="module")
def ridge(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """12 x 40 x 24 mm of 20 kPa, bonded below, touched on its sides."""
    path = tmp_path_factory.mktemp("body") / "ridge.h5"
    fem.build(fem.block((0.012, 0.04, 0.024), 0.004), young=20e3, fixed="z < 0.001 mm", touch="z > 4 mm", output=path)
    return path


def moved(deep: float, samples: int = 60) -> Array:
    """Path into the top of the block and sideways (samples, 3), m."""
    s = np.linspace(0.0, 1.0, samples)[:, None]
    top = MIDDLE + np.array([0.0, 0.0, RADIUS])
    return np.asarray(top + s * [0.4e-3, -0.3e-3, -deep - 0.5e-3] + [0.0, 0.0, 0.5e-3])


def tables(file: Path, **options: Any) -> dict[str, Any]:
    body = {"file": str(file), "kind": "signed_distance", "radius": "5 mm", "origin": ["20 mm", "20 mm", "20 mm"]}
    points = [[f"{x} m" for x in point] for point in TOOL]
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"force": ["0 N", "0 N", "-0.5 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-5.5 mm"],
            "body": {**body, "contact_points": points, **options},
        },
        "run": {"duration": "1.5 s"},
    }


def run(file: Path, **options: Any) -> Trace:
    return simulate(Scenario.from_dict(tables(file, **options)))


def test_a_tool_of_one_tip_at_its_origin_is_that_tip(block: Path) -> None:
    body = fem.load(block).signed_distance(static_friction=0.4)
    tool = body.with_contact_points([[0.0, 0.0, 0.0]])
    for one, other in zip(
        body.simulate_path(moved(2e-3), RADIUS), tool.simulate_path(moved(2e-3), RADIUS), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-14)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_the_force_of_a_tool_is_the_sum_of_the_forces_of_its_tips(block: Path, friction: float) -> None:
    body = fem.load(block).signed_distance(static_friction=friction)
    path = moved(2e-3)
    total = body.with_contact_points(TOOL).simulate_path(path, RADIUS)
    tips = body.simulate_tips(path[:, None] + TOOL, [RADIUS] * 3)
    np.testing.assert_allclose(total.force, sum(tip.force for tip in tips), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(total.friction, sum(tip.friction for tip in tips), rtol=1e-12, atol=1e-15)
    np.testing.assert_array_equal(total.nodes, sum(tip.nodes for tip in tips))
    np.testing.assert_array_equal(total.energy, tips[0].energy)
    weights = [np.linalg.norm(tip.force[-1] - tip.friction[-1]) for tip in tips]
    mean = np.average([tip.deflection[-1] for tip in tips], axis=0, weights=weights)
    np.testing.assert_allclose(total.deflection[-1], mean, rtol=1e-12)
    assert min(tip.nodes[-1] for tip in tips) > 0


def test_the_moment_of_a_tool_is_the_derivative_of_the_energy_by_its_rotation(block: Path) -> None:
    """Without friction. The tips of the run's tool are turned by small angles in the place where the run left it."""
    trace = run(block)
    body = fem.load(block).signed_distance()
    end = trace["tip"][-1] - trace["tip"][0] + MIDDLE + [0.0, 0.0, 5.5e-3]
    angle = 2e-4

    def energy(turn: Array) -> float:
        tips = Rotation.from_rotvec(turn).apply(TOOL)
        approach = end + np.linspace(1.0, 0.0, 150)[:, None] * [0.0, 0.0, 5e-3]
        path = np.vstack([approach, np.tile(end, (5, 1))])
        return float(body.simulate_tips(path[:, None] + tips, [RADIUS] * 3)[0].energy[-1])

    turns = angle * np.eye(3)
    derivative = [(energy(turn) - energy(-turn)) / (2.0 * angle) for turn in turns]
    moment = trace["contact_moment"][-1]
    np.testing.assert_allclose(moment, derivative, atol=2e-3 * np.abs(moment).max())
    assert np.abs(moment).max() > 1e-4


def test_friction_on_a_sphere_has_the_radius_as_lever(block: Path) -> None:
    """The normal forces of a sphere have no moment about its center. The top of the block lies below that center."""
    scenario = tables(block, static_friction=0.8, stiffness_scale=20.0, contact_points=[["0 mm", "0 mm", "0 mm"]])
    trace = simulate(Scenario.from_dict({**scenario, "reference": {"force": ["0.2 N", "0 N", "-0.6 N"]}}))
    body = fem.load(block).scaled_stiffness(20.0).signed_distance(static_friction=0.8)
    path = trace["tip"] - trace["tip"][0] + MIDDLE + np.array([0.0, 0.0, 5.5e-3])
    friction = -body.simulate_path(path, RADIUS).friction[-1]
    lever = np.cross([0.0, 0.0, -RADIUS], friction)
    np.testing.assert_allclose(trace["contact_moment"][-1], lever, atol=0.05 * np.linalg.norm(lever))
    assert np.linalg.norm(lever) > 1e-4


def test_a_tool_turned_with_its_body_turns_its_response(block: Path) -> None:
    path = moved(2e-3) - moved(2e-3)[0]
    turn = Rotation.from_euler("z", 0.7)
    matrix = turn.as_matrix()
    points = [[f"{x} m" for x in point] for point in turn.apply(TOOL)]
    still = HeldTip(Scenario.from_dict(tables(block)), path)
    turned = HeldTip(
        Scenario.from_dict(tables(block, contact_points=points, rotation=["0 rad", "0 rad", "0.7 rad"])),
        turn.apply(path),
    )
    np.testing.assert_allclose(turned.force, matrix @ still.force, rtol=1e-6, atol=1e-9)
    one, other = body_response(still), body_response(turned)
    stiffness = one.frame @ one.static @ one.frame.T
    expected = matrix @ stiffness @ matrix.T
    np.testing.assert_allclose(other.frame @ other.static @ other.frame.T, expected, atol=1e-2 * np.abs(expected).max())


def test_the_stiffness_of_a_tool_is_the_derivative_of_the_sum_of_its_forces(block: Path) -> None:
    """At depths at which differences of two sizes agree: where a point begins to touch, there is no derivative."""
    body = fem.load(block).signed_distance()

    def differences(path: Array, step: float) -> Array:
        settled = np.vstack([path, np.tile(path[-1], (20, 1))])

        def force(way: Array) -> Array:
            whole = np.vstack([settled, np.tile(path[-1] + way, (5, 1))])
            tips = body.simulate_tips(whole[:, None] + TOOL, [RADIUS] * 3)
            return np.asarray(-sum(tip.force[-1] for tip in tips))

        return np.column_stack([(force(step * e) - force(-step * e)) / (2.0 * step) for e in np.eye(3)])

    smooth = 0
    for deep in (1.8e-3, 1.9e-3, 2e-3, 2.2e-3):
        path = moved(deep)
        expected, wider = differences(path, 2e-6), differences(path, 1e-5)
        if np.abs(wider - expected).max() < 1e-3 * np.abs(expected).max():
            smooth += 1
            response = body_response(HeldTip(Scenario.from_dict(tables(block)), path - path[0]))
            found = response.frame @ response.static @ response.frame.T
            np.testing.assert_allclose(found, expected, atol=5e-3 * np.abs(expected).max())
    assert smooth >= 2


def test_the_margin_of_a_tool_is_where_its_run_begins_to_oscillate(block: Path) -> None:
    """With friction, so that the contact resists in all directions."""

    def pressed(scale: float) -> Trace:
        hard = {"reference": {"force": ["0 N", "0 N", "-3 N"]}, "run": {"duration": "3 s"}}
        return simulate(Scenario.from_dict({**tables(block, static_friction=0.6, stiffness_scale=scale), **hard}))

    soft = pressed(60.0)
    assert soft.verdict.state is State.SETTLED
    assert 1.0 < contact_stability(soft).stiffness_margin < 1.5
    assert pressed(200.0).verdict.state in (State.UNSTABLE, State.BOUNDED_OSCILLATION)


def test_tips_that_press_against_each_other_hold_the_tool_without_a_net_force(ridge: Path) -> None:
    """Opposite sides of a ridge: no common normal, yet a stiffness along the line between the tips."""
    across = [["-10.5 mm", "0 mm", "0 mm"], ["10.5 mm", "0 mm", "0 mm"]]
    place = {"origin": ["6 mm", "20 mm", "16 mm"], "contact_points": across}
    scenario = Scenario.from_dict(
        {**tables(ridge, **place), "reference": {"force": ["0 N", "0 N", "0 N"]}}
        | {"object": {**tables(ridge, **place)["object"], "position": ["0 mm", "0 mm", "0 mm"]}}
    )
    trace = simulate(scenario)
    assert trace.verdict.state is State.SETTLED
    assert np.linalg.norm(trace["object_force"][-1]) < 5e-3
    assert trace["contact_nodes"][-1, 0] >= 2
    response = body_response(HeldTip(scenario, np.zeros((2, 3))))
    stiffness = response.frame @ response.static @ response.frame.T
    assert stiffness[0, 0] > 3.0 * abs(stiffness[1, 1])
    one_side = HeldTip(Scenario.from_dict(tables(ridge, **{**place, "contact_points": across[:1]})), np.zeros((2, 3)))
    alone = body_response(one_side)
    assert stiffness[0, 0] > float((alone.frame @ alone.static @ alone.frame.T)[0, 0])  # a second tip only adds


def test_pressure_on_a_node_under_two_tips_is_that_of_both(block: Path) -> None:
    body = fem.load(block).signed_distance().with_contact_points([[-1e-3, 0.0, 0.0], [1e-3, 0.0, 0.0]])
    force = body.simulate_path(moved(2e-3), RADIUS).force[-1]
    nodes = body.core.contact_forces()[0]
    assert len(np.unique(nodes)) < len(nodes)
    assert body.pressure() @ body.contents.areas == pytest.approx(force[2], rel=1e-9)


def test_a_tool_is_refused_where_it_has_no_meaning(block: Path) -> None:
    body = fem.load(block)
    sharp = body.signed_distance()
    for refused, error, text in (
        (lambda: body.with_contact_points(TOOL), BodyError, "signed distance"),
        (lambda: sharp.with_contact_points(np.zeros((2, 3))), BodyError, "points 1 and 2 are in the same place"),
        (lambda: sharp.with_contact_points(np.eye(9)[:, :3]), BodyError, "9 points; a tool has at most 8"),
        (lambda: sharp.with_contact_points([1.0, 2.0, 3.0]), PoseError, r"write one point as \[\[x, y, z\]\]"),
        (lambda: sharp.with_contact_points(np.zeros((2, 2))), PoseError, r"\(k, 3\)"),
    ):
        with pytest.raises(error, match=text):
            refused()
    for options, text in (
        ({"kind": "compliance"}, "contact_points: a tool needs the contact by signed distance"),
        ({"contact_points": 2 * [["0 mm", "0 mm", "0 mm"]]}, "points 1 and 2 are in the same place"),
    ):
        with pytest.raises(ScenarioError, match=text):
            Scenario.from_dict(tables(block, **options))
    turning = tables(block)
    turning["object"]["frame"] = {"rotation": [["0 s", "0 deg", "0 deg", "0 deg"], ["1 s", "0 deg", "0 deg", "5 deg"]]}
    with pytest.raises(ScenarioError, match="a tool does not go with a body that turns"):
        Scenario.from_dict(turning)


def test_a_tip_of_a_tool_that_starts_inside_the_body_is_named(block: Path) -> None:
    deep = [["0 mm", "0 mm", "0 mm"], ["10 mm", "0 mm", "-15 mm"]]
    with pytest.raises(ScenarioError, match="the tip starts inside the body"):
        run(block, contact_points=deep)


def test_a_body_keeps_its_tool_when_its_stiffness_or_friction_changes(block: Path) -> None:
    tool: Body = fem.load(block).signed_distance().with_contact_points(TOOL)
    path = moved(1e-3)
    stiff = tool.scaled_stiffness(2.0).with_friction(0.3)
    assert stiff.kind.contact_points == tool.kind.contact_points
    assert "tool of 3 tips" in str(stiff.kind)
    np.testing.assert_allclose(
        tool.scaled_stiffness(2.0).simulate_path(path, RADIUS).force,
        2.0 * tool.simulate_path(path, RADIUS).force,
        rtol=1e-4,
        atol=1e-6,
    )
    single = tool.with_contact_points([])
    assert not single.kind.contact_points
    np.testing.assert_array_equal(
        single.simulate_path(path, RADIUS).force, fem.load(block).signed_distance().simulate_path(path, RADIUS).force
    )
