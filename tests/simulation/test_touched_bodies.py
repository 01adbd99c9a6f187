"""What is read about the body of a run, and the verdict of its linear loop within the doubt about its response."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import fem
from palpate.errors import ScenarioError, StabilityError
from palpate.fem import force_error
from palpate.scenario import Scenario
from palpate.simulation import friction_hold, linear_contact
from palpate.simulation.bodies import (
    mesh_error,
    origin_of,
    overlaps_untouched,
    place_body,
    pressed_at,
    scenario_body,
    surface_normal,
)
from palpate.simulation.body_response import HeldTip
from palpate.simulation.trace import Trace
from scipy.spatial.transform import Rotation

TURN = Rotation.from_euler("xyz", [0.0, 0.0, 30.0], degrees=True).as_matrix()
ORIGIN = np.array([0.012, 0.011, 0.012])
PLACE = np.array([0.5e-3, 0.2e-3, -0.2e-3])
TOOL = {"contact_points": [["0 mm", "0 mm", "0 mm"], ["9 mm", "0 mm", "0 mm"]]}
POSITION = ("0.5 mm", "0.2 mm", "-0.2 mm")


def build(path: Path, order: int, spacing: float, **material: Any) -> Path:
    shape = fem.block((0.024, 0.022, 0.012), spacing)
    fem.build(shape, young=20e3, fixed="z < 0.001 mm", touch="z > 0.001 mm", order=order, output=path, **material)
    return path


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("body") / "block.h5", 1, 0.006)


def scenario_of(
    block: Path, tip: str = "sphere", position: Any = ("0.5 mm", "0.2 mm", "-0.2 mm"), **body: Any
) -> Scenario:
    touched = {"file": str(block), "origin": ["12 mm", "11 mm", "12 mm"], "tip": tip, "radius": "3 mm"}
    turned = {"kind": "compliance", "rotation": ["0 deg", "0 deg", "30 deg"]}
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0.1 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m"},
        "object": {"kind": "body", "position": list(position), "body": {**touched, **turned, **body}},
        "run": {"duration": "50 ms"},
    }
    return Scenario.from_dict(tables)


def at(points: Any, scenario: Scenario) -> Trace:
    """Return a run whose tip is at points of the body's own frame (n, 3), m, after the start, which is off the body."""
    start = np.array([0.3, -0.2, 0.1])
    tip = (np.atleast_2d(points) - ORIGIN) @ TURN.T + start + PLACE
    return Trace.of(
        1e-3 * np.arange(len(tip) + 1), {"tip": np.vstack([start, tip])}, metadata={"scenario": scenario.to_dict()}
    )


def test_a_tip_is_pressed_where_the_run_was_in_the_frame_of_the_body(block: Path) -> None:
    """The force of the contact is that of the core at the same place; before it nothing is displaced."""
    scenario = scenario_of(block)
    points = [[0.012, 0.011, 0.016], [0.012, 0.012, 0.0145], [0.0121, 0.0122, 0.0142]]
    run = at(points, scenario)
    body = scenario_body(scenario)
    for row, point in ((1, points[0]), (2, points[1]), (3, points[2]), (-1, points[2]), (-2, points[1])):
        found = pressed_at(run, row)
        np.testing.assert_allclose(found.tip, point, atol=1e-12)
        body.core.reset()
        body.core.simulate_path(np.array([point]), np.empty((0, 3)), 3e-3, False)
        np.testing.assert_allclose(found.pressure, body.pressure(), rtol=1e-5, atol=1e-9)
        assert found.pressure.any() == (row != 1)


def test_a_tip_overlaps_what_is_fixed_where_it_is_near_the_foot_of_the_body(
    block: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = scenario_of(block)
    run = at([[0.012, 0.011, 0.0149], [-0.0029, 0.011, 0.0005], [-0.0029, 0.011, 0.0055]], scenario)
    for rows, expected in (([0, 1], False), ([2], True), ([0, 1, 2], True), ([3], True), ([1, 3], True)):
        near = scenario_body(scenario).overlaps_untouched(
            np.array([[0.012, 0.011, 0.0149], [-0.0029, 0.011, 0.0005], [-0.0029, 0.011, 0.0055]])[
                np.array([row - 1 for row in rows if row])
            ],
            3e-3,
            None,
        )
        assert overlaps_untouched(run, np.array(rows)) is bool(near.any())
        assert expected or not near.any()
    flat = scenario_of(block, "flat")
    asked: list[Any] = []
    monkeypatch.setattr(fem.Body, "overlaps_untouched", lambda _, *given: asked.append(given) or np.array([True]))
    assert overlaps_untouched(at([[0.012, 0.011, 0.006]], flat), np.array([1]))
    centers, radius, axis = asked[0]
    np.testing.assert_allclose(centers, [[0.012, 0.011, 0.006]])
    assert (radius, axis.tolist()) == (3e-3, [0.0, 0.0, 1.0])


def test_a_normal_is_that_of_the_nearest_node_turned_to_the_device(block: Path) -> None:
    scenario = scenario_of(block)
    body = scenario_body(scenario)
    points = [[0.012, 0.011, 0.0125], [-0.001, 0.011, 0.006], [0.025, 0.0, 0.009]]
    run = at(points, scenario)
    for row, point in enumerate(points, 1):
        nearest = min(range(len(body.nodes)), key=lambda i: float(np.linalg.norm(body.nodes[i] - point)))
        found = surface_normal(run, row)
        assert found is not None
        np.testing.assert_allclose(found, TURN @ body.normals[nearest], atol=1e-12)


def test_a_quadratic_body_resolves_a_tip_that_spans_its_nodes(tmp_path: Path) -> None:
    fine = build(tmp_path / "fine.h5", 2, 0.006)
    top = [[0.012, 0.011, 0.0235]]  # 0.5 mm deep
    large, small = (scenario_of(fine, radius=radius) for radius in ("12 mm", "0.5 mm"))
    assert mesh_error(at(top, large), 1, 9) == force_error(9, signed_distance=False)
    assert mesh_error(at(top, small), 1, 9) is None
    assert mesh_error(at([[0.001, 0.011, 0.0235]], large), 1, 9) is None  # beside an edge
    others: list[dict[str, Any]] = [{"tip": "flat"}, {"kind": "mass_spring"}, {"kind": "signed_distance", **TOOL}]
    for other in others:
        assert mesh_error(at(top, scenario_of(fine, radius="12 mm", **other)), 1, 9) is None
    linear = scenario_of(build(tmp_path / "linear.h5", 1, 0.006), radius="12 mm")
    assert mesh_error(at(top, linear), 1, 9) is None
    firm = scenario_of(build(tmp_path / "firm.h5", 2, 0.006, surface_layer="6 mm = 50 kPa"), radius="12 mm")
    assert mesh_error(at(top, firm), 1, 9) is None
    run = at(top, large)
    assert surface_normal(run, 1) is not None
    fine.unlink()
    assert mesh_error(run, 1, 9) is None
    assert surface_normal(run, 1) is None
    assert overlaps_untouched(run, np.array([0, 1])) is False


def test_a_body_lies_at_the_position_of_its_origin_and_turned(block: Path) -> None:
    scenario = scenario_of(block)
    choice = scenario.object.body
    assert choice is not None
    body, origin, turn = place_body(scenario, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(turn, TURN, atol=1e-15)
    np.testing.assert_allclose(origin + turn @ ORIGIN, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(origin_of(choice, body), ORIGIN)
    without = choice.model_copy(update={"origin": None})
    np.testing.assert_array_equal(origin_of(without, body), np.zeros(3))
    low, high = body.points.min(axis=0), body.points.max(axis=0)
    made = origin_of(choice.model_copy(update={"origin": None, "shape": "block"}), body)
    np.testing.assert_allclose(made, [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, high[2]])


@pytest.mark.parametrize(("below", "refused"), [(2.9, False), (3.1, True), (5.0, True)])
def test_a_tip_may_start_as_deep_as_its_radius(block: Path, below: float, refused: bool) -> None:
    scenario = scenario_of(block, position=("0 mm", "0 mm", f"{below} mm"))
    if not refused:
        place_body(scenario, np.zeros(3))
        return
    with pytest.raises(ScenarioError, match=f"its center {below:.3g} mm below the surface"):
        place_body(scenario, np.zeros(3))


def test_a_flat_tip_may_start_deeper_by_half_the_side_of_the_largest_patch(block: Path) -> None:
    areas = scenario_body(scenario_of(block)).contents.areas
    most = 3.0 + 1e3 * 0.5 * float(np.sqrt(areas.max()))
    place_body(scenario_of(block, "flat", ("0 mm", "0 mm", f"{min(most - 0.05, 5.9)} mm")), np.zeros(3))
    if most < 5.9:
        with pytest.raises(ScenarioError, match="the tip starts inside the body"):
            place_body(scenario_of(block, "flat", ("0 mm", "0 mm", f"{most + 0.05} mm")), np.zeros(3))


def held_of(scenario: Scenario, deep: float = 1e-3, **options: Any) -> HeldTip:
    """Return the tip at the end of a path to the middle of the top, its center a radius less a depth above it."""
    end = PLACE + np.array([0.0, 0.0, 3e-3 - deep])
    return HeldTip(scenario, np.linspace(end + np.array([0.0, 0.0, 2e-3]), end, 30), **options)


def test_a_held_tip_has_the_force_of_its_place_in_the_frame_of_the_device(block: Path) -> None:
    scenario = scenario_of(block)
    tip = held_of(scenario)
    body = scenario_body(scenario)
    assert (tip.radius, tip.period, tip.every, tip.friction, tip.holds_across) == (3e-3, 1e-3, 1, False, False)
    assert (tip.memoryless, tip.rounds, tip.multirate) == (True, False, False)
    np.testing.assert_allclose(tip.frame[:, 0], -tip.force / np.linalg.norm(tip.force), atol=1e-12)
    for shift in (np.zeros(3), np.array([1e-4, 2e-4, -1e-4]), np.array([0.0, 0.0, -3e-4])):
        forces, nodes = tip.move(shift[None])
        body.core.reset()
        point = ORIGIN + np.array([0.0, 0.0, 2e-3]) + TURN.T @ shift
        row = np.asarray(body.core.simulate_path(point[None], np.empty((0, 3)), 3e-3, False))[0]
        np.testing.assert_allclose(forces[0], -TURN @ row[:3], rtol=1e-5, atol=1e-7)
        assert nodes[0] == row[7]
    with pytest.raises(StabilityError, match="the tip does not touch the body"):
        held_of(scenario, -1e-3)
    rubs = held_of(scenario_of(block, static_friction=0.5))
    assert (rubs.friction, rubs.holds_across, rubs.rounds, rubs.memoryless) == (True, True, True, True)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"kind": "neo-hookean", "density": "1000 kg/m^3"}, "with inertia, whose swing outlasts an update"),
        ({"kind": "neo-hookean", "instantaneous_ratio": 2.0, "retardation_time": "1 s"}, "with relaxation, which"),
        ({"kind": "mass_spring", "update_interval": "20 ms"}, "at two rates, whose motion"),
    ],
)
def test_a_held_tip_takes_no_body_whose_motion_outlasts_an_update(
    block: Path, options: dict[str, Any], said: str
) -> None:
    scenario = scenario_of(block, **options)
    with pytest.raises(StabilityError, match=said):
        held_of(scenario)


@pytest.mark.parametrize(
    ("asymmetry", "limit", "said"),
    [
        (0.01, 1.5, ""), (0.0101, 1.5, "the response of the body to opposite displacements is not the same"),
        (0.004, 1.0051, ""), (0.004, 1.0049, "too near its limit"), (0.004, 0.9951, "too near its limit"),
        (0.004, 0.9949, ""), (0.0, 1.0011, ""), (0.0, 1.0009, "too near its limit"),
    ],
)  # fmt: skip
def test_a_loop_on_a_body_is_judged_only_if_the_doubt_about_its_response_does_not_matter(
    block: Path, monkeypatch: pytest.MonkeyPatch, asymmetry: float, limit: float, said: str
) -> None:
    """The doubt is the asymmetry and a thousandth; the radius is 1 where the scaled response has a limit."""
    scenario = Scenario.from_dict({**scenario_of(block).to_dict(), "operator": {"kind": "none"}})
    asked: list[tuple[Any, float]] = []
    slides = False

    def radius(_loop: Any, law: Any, scale: float) -> tuple[float, bool]:
        asked.append((law, scale))
        return scale / limit, slides

    system = SimpleNamespace(A=np.zeros((1, 1)), B=np.ones((1, 3)), C=np.ones((3, 1)), D=np.diag([1.0, 2.0, 3.0]))
    frame = np.linalg.qr(np.array([[0.0, 1.0, 2.0], [1.0, 0.0, 1.0], [3.0, 1.0, 0.0]]))[0]
    held = SimpleNamespace(multirate=False, frame=frame, holds_across=True)
    monkeypatch.setattr(linear_contact, "HeldTip", lambda *_: held)
    monkeypatch.setattr(linear_contact, "body_response", lambda _: SimpleNamespace(asymmetry=asymmetry, system=system))
    monkeypatch.setattr(linear_contact, "_radius", radius)
    loops: list[dict[str, Any]] = []
    monkeypatch.setattr(linear_contact, "_loop", lambda _trace, _scenario, _row, spring: loops.append(spring))
    run = Trace.of([0.0, 1.0], {"tip": np.zeros((2, 3)), "touching": np.ones(2)})
    found, reason = linear_contact.contact_radius(run, scenario)
    assert (found is None) is bool(said)
    assert said in reason
    if asked:
        np.testing.assert_allclose([scale for _, scale in asked], [1 - asymmetry - 1e-3, 1.0, 1 + asymmetry + 1e-3])
        law = asked[0][0]
        np.testing.assert_allclose(law.D, frame @ system.D @ frame.T)
        np.testing.assert_allclose(law.B, system.B @ frame.T)
        np.testing.assert_allclose(law.C, frame @ system.C)
        assert loops == [{"kind": "spring", "stiffness": "1 N/m"}]
        held.holds_across = False
        linear_contact.contact_radius(run, scenario)
        assert loops[1] == {"kind": "wall", "stiffness": "1 N/m", "normal": frame[:, 0].tolist()}
        slides, expected = True, "" if said or limit < 1.0 else "nothing holds the tip along the surface of the body"
        assert said or linear_contact.contact_radius(run, scenario)[1] == expected
    off = Trace.of([0.0, 1.0], {"tip": np.zeros((2, 3)), "touching": [1.0, 0.0]})
    assert linear_contact.contact_radius(off, scenario) == (None, "the tip is off the object")
    held.multirate = True
    assert "updated outside the tick" in linear_contact.contact_radius(run, scenario)[1]


def test_a_run_without_a_body_has_no_surface(block: Path) -> None:
    tables = scenario_of(block).to_dict()
    tables["object"] = {"kind": "spring", "stiffness": "100 N/m"}
    run = Trace.of([0.0, 1.0], {"tip": np.zeros((2, 3))}, metadata={"scenario": tables})
    assert surface_normal(run, 1) is None
    assert mesh_error(run, 1, 9) is None
    assert not overlaps_untouched(run, np.array([0]))


@pytest.mark.parametrize("friction", [0.3, 1.5])
def test_without_a_normal_friction_may_take_the_whole_of_the_force(
    friction: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A force F at the angle of friction has the share m/sqrt(1 + m^2) along the surface."""
    body = SimpleNamespace(options={"static_friction": 9.0, "dynamic_friction": friction})
    one = SimpleNamespace(object=SimpleNamespace(body=body, surface=None))
    hand = SimpleNamespace(kind="arm", stiffness=200.0, tissue_stiffness=None)
    scenario: Any = SimpleNamespace(each_object={"": one}, operator=hand)
    force = np.array([[9.0, 9.0, 9.0], [0.0, 3.0, 4.0], [0.0, 3.0, 4.0], [0.6, 3.0, 4.0], [-0.6, 3.0, 4.0]])
    run = Trace.of(np.arange(5.0), {"object_force": force})
    monkeypatch.setattr(friction_hold, "surface_normal", lambda *_: None)
    found = friction_hold.friction_hold(run, scenario, slice(1, 5))
    assert found is not None
    assert found.fluctuation == pytest.approx(np.sqrt(2 * 0.36 / 4) / 5.0)
    assert found.traction == 1.0
    assert found.release == pytest.approx(5.0 * np.sin(np.arctan(friction)) / 200.0)
    monkeypatch.setattr(friction_hold, "surface_normal", lambda *_: np.array([0.0, 0.6, 0.8]))
    found = friction_hold.friction_hold(run, scenario, slice(1, 5))
    assert found is not None
    assert found.traction < 1e-12
    monkeypatch.setattr(friction_hold, "surface_normal", lambda *_: np.array([0.0, 0.0, -1.0]))
    hand.stiffness = None
    found = friction_hold.friction_hold(run, scenario, slice(1, 5))
    assert found is not None
    assert (found.traction, found.release) == (pytest.approx(3.0 / (friction * 4.0)), np.inf)
    still = Trace.of(np.arange(5.0), {"object_force": 0.0 * force})
    assert friction_hold.friction_hold(still, scenario, slice(1, 5)) is None
    body.options = {}
    assert friction_hold.friction_hold(run, scenario, slice(1, 5)) is None
