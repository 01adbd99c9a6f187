"""Parts of a simulation against plain references: meshes, frames, statics, windows, reach, designs and exports."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import fem
from palpate.contact import Mesh, Surface
from palpate.control import Controller
from palpate.errors import DesignError, OutputError, ScenarioError
from palpate.scenario import Scenario
from palpate.simulation.controllers import (
    build_controller,
    design_for,
    read_scenario,
    with_controller,
    written_out,
)
from palpate.simulation.evidence import (
    _creep,
    _established,
    _passed,
    _pressed,
    _shifts,
    _tool_error,
    is_one_sided,
    leaves_reach,
    second_differences,
)
from palpate.simulation.force_objects import force_object
from palpate.simulation.joint_run import _contact
from palpate.simulation.judgment import _lost, _reach, _unsupported, _without_force, judge
from palpate.simulation.loop_config import _order
from palpate.simulation.meshes import box_mesh, bumpy_ellipsoid
from palpate.simulation.moving_frame import seen_from_object, touching_tip, turned_to_object
from palpate.simulation.observed_run import observe
from palpate.simulation.placed_objects import PlacedObject, object_channels
from palpate.simulation.proxy_law import ProxyProbe
from palpate.simulation.simulator import _plain
from palpate.simulation.statics import expected_deflection, force_over_stiffness, presses, steady_error
from palpate.simulation.step_response import step_response
from palpate.simulation.trace import CHANNELS, Trace, TraceError, complete, describe_channel
from palpate.simulation.trace_export import column_names
from palpate.simulation.verdict import State
from palpate.simulation.windows import Window, constant_stretches, windows
from scipy.spatial.transform import Rotation

T = 1e-3
POSE = [0.1, 2.2305, 3.2776]
TRACKING: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0.1 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "1 ms", "topology": "force_tracking"},
    "reference": {"shape": "step", "force": ["1 N", "0 N", "-2 N"]},
    "object": {"kind": "spring", "stiffness": ["900 N/m", "0 N/m", "500 N/m"]},
    "controller": {"kind": "none"},
}


def tracking(**tables: Any) -> Scenario:
    return Scenario.from_dict({**TRACKING, **tables})


@pytest.mark.parametrize("divisions", [1, 2, 3])
def test_a_box_mesh_is_a_closed_cube_of_equal_triangles_below_its_origin(divisions: int) -> None:
    edge = 0.06
    vertices, triangles = box_mesh(edge, divisions)
    assert len(triangles) == 12 * divisions**2
    assert len(vertices) == 6 * divisions**2 + 2 == len(np.unique(np.round(vertices, 12), axis=0))
    np.testing.assert_allclose(vertices.min(axis=0), [-edge / 2, -edge / 2, -edge])
    np.testing.assert_allclose(vertices.max(axis=0), [edge / 2, edge / 2, 0.0], atol=1e-15)
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    normals = np.cross(b - a, c - a)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), (edge / divisions) ** 2)
    outward = (a + b + c) / 3.0 - [0.0, 0.0, -edge / 2]
    assert (np.sum(normals * outward, axis=1) > 0.0).all()
    assert np.sum(a * np.cross(b, c)) / 6.0 == pytest.approx(edge**3)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()
    # parallel diagonals: the longest sides on a pair of opposite faces have one direction
    sides = np.stack([b - a, c - b, a - c], axis=1)
    lengths = np.linalg.norm(sides, axis=2).max(axis=1)
    long = sides[np.arange(len(sides)), np.argmax(np.linalg.norm(sides, axis=2), axis=1)]
    np.testing.assert_allclose(lengths, np.sqrt(2.0) * edge / divisions)
    for axis in range(3):
        flat = np.abs(normals[:, axis]) > 0.5 * np.linalg.norm(normals, axis=1)
        slopes = long[flat] / lengths[flat, None]
        np.testing.assert_allclose(np.abs(slopes @ slopes[0]), 1.0)


def test_an_ellipsoid_has_its_bumps_and_its_top_at_the_origin() -> None:
    size, bump = (0.06, 0.05, 0.04), 0.1
    vertices, _ = bumpy_ellipsoid(size, bump, 2)
    half = np.array(size) / 2.0

    def radius(x: float, y: float, z: float) -> float:
        waves = np.sin(5 * x + 1) * np.sin(4 * y + 2) + np.sin(3 * z) * np.cos(4 * x + 3 * y)
        return float(1.0 + bump * waves / 2.0)

    smooth, _ = bumpy_ellipsoid((2.0, 2.0, 2.0), 0.0, 2)
    directions = smooth + np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
    expected = [np.array(e) * half * radius(*e) for e in directions]
    top = np.array([0.0, 0.0, half[2] * radius(0.0, 0.0, 1.0)])
    np.testing.assert_allclose(vertices, np.array(expected) - top, atol=1e-15)


def test_a_moving_frame_is_left_by_its_translation_and_then_its_rotation() -> None:
    rng = np.random.default_rng(0)
    turns, origins, points = rng.standard_normal((3, 5, 3))
    run = Trace.of(np.arange(5.0), {"frame_position": origins, "frame_rotation": turns, "tip": points, "tool": -points})
    still = Trace.of(np.arange(5.0), {"tip": points})
    for row in range(5):
        matrix = Rotation.from_rotvec(turns[row]).as_matrix()
        np.testing.assert_allclose(seen_from_object(run, points)[row], matrix.T @ (points[row] - origins[row]))
        np.testing.assert_allclose(turned_to_object(run, points)[row], matrix.T @ points[row])
        np.testing.assert_allclose(touching_tip(run)[row], matrix.T @ (-points[row] - origins[row]))
    for found in (seen_from_object(still, points), turned_to_object(still, points), touching_tip(still)):
        np.testing.assert_array_equal(found, points)


def test_a_constant_force_deflects_a_spring_per_axis_and_a_wall_along_its_normal() -> None:
    none = [None, None, None]
    assert expected_deflection(None) == none
    assert expected_deflection(tracking()) == [pytest.approx(1 / 900), None, pytest.approx(-2 / 500)]
    ramp = {"shape": "ramp", "force": ["1 N", "0 N", "-2 N"], "rise": "10 ms"}
    assert expected_deflection(tracking(reference=ramp)) == expected_deflection(tracking())
    assert expected_deflection(tracking(reference={**TRACKING["reference"], "stop": "0.5 s"})) == none
    wall = {"kind": "wall", "stiffness": "400 N/m", "normal": [0.0, 0.6, 0.8]}
    pressing = (1.0 * 0.0 - 2.0 * 0.8) / 400.0
    found = expected_deflection(tracking(object=wall))
    assert found == [None, pytest.approx(pressing * 0.6), pytest.approx(pressing * 0.8)]
    assert expected_deflection(tracking(object={**wall, "normal": [0.0, -0.6, -0.8]})) == none
    assert expected_deflection(tracking(object={"kind": "none"})) == none


def test_driven_axes_are_those_above_a_twentieth_of_the_largest_deflection() -> None:
    expected = [[2.0, 0.1, np.nan], [2.0, 0.101, -1.0], [0.0, np.nan, 0.0]]
    found = steady_error([[2.2, 9.0, 5.0], [2.2, 0.202, -1.3], [1.0, 1.0, 1.0]], expected)
    np.testing.assert_allclose(found, [0.1, 1.0, np.nan])
    for dof, columns in ((1, [0.5, np.nan, np.nan]), (2, [0.5, np.nan, np.nan]), (3, [0.5, np.nan, -0.25])):
        np.testing.assert_array_equal(force_over_stiffness([1.0, 2.0, -1.0], [2.0, 0.0, 4.0], dof)[0], columns)
    angles = np.array([0.0, 1.0, 2.0])
    for angle in (0.0, np.arccos(-0.049), np.arccos(-0.051), np.pi):
        load = 3.0 * np.array([np.cos(angle), np.sin(angle), 0.0])
        assert bool(presses(load, [7.0, 0.0, 0.0])[0]) is bool(np.cos(angle) < -0.05)
    assert presses(np.outer(angles, [0, 0, -1.0]), [0.0, 0.0, 1.0]).tolist() == [False, True, True]


@pytest.mark.parametrize("turns", [0.3, 0.999, 1.0, 1.2, 1.5])
def test_a_hann_window_passes_its_transform_of_an_oscillation(turns: float) -> None:
    x = (np.arange(20000) + 0.5) / 20000 - 0.5
    weights = 1.0 + np.cos(2.0 * np.pi * x)
    share = abs(np.sum(weights * np.cos(2.0 * np.pi * turns * x)) / weights.sum())
    assert _passed(turns) == pytest.approx(max(share, 0.0275), rel=1e-4)
    assert _passed(2.0) == _passed(7.0) == 0.0275


def test_a_contact_is_established_when_it_lasts_as_long_as_the_flight_after_it() -> None:
    def first(*lengths: int) -> int:
        """Return the row for stretches off and on the object in turn."""
        return _established(np.repeat(np.arange(len(lengths)) % 2 > 0, lengths))

    assert first(0, 5, 9, 3) == 0
    assert first(4, 5, 5, 30) == 4
    assert first(4, 5, 6, 30) == 15
    assert first(4, 3, 7, 5, 5, 40) == 14  # as long as the flight, and half as long as the bounces
    assert first(4, 3, 7, 5, 6, 40) == 25
    assert first(4, 3, 8, 5, 5, 40) == 25
    assert first(4, 2, 3, 2, 3, 2, 90) == 4  # none lasts: the first contact


def test_an_oscillation_of_the_tip_is_measured_at_the_last_sample_of_a_tool() -> None:
    n = 10
    tool, tip = np.zeros((n, 3)), np.zeros((n, 3))
    tool[:, 0], tip[:, 1] = np.arange(n), 2.0 * np.arange(n)
    run = Trace.of(T * np.arange(n), {"tip": tip, "tool": tool})
    expected = np.hypot(7.0, 14.0) / 1.0
    assert _tool_error(run, slice(4, 8), np.ones((n, 3)) / np.sqrt(3.0), 0.0) == pytest.approx(expected, rel=1e-6)


def test_reach_is_left_at_any_row_of_the_window_and_at_none_outside() -> None:
    scenario = tracking()
    for row, beyond in ((19, False), (20, True), (49, True), (50, True), (51, False)):
        angles = np.tile(POSE, (60, 1))
        angles[row, 0] += 7.0
        force = np.tile([1.0, 0.0, -2.0], (60, 1))
        run = Trace.of(T * np.arange(60), {"angle": angles, "reference_force": force})
        assert leaves_reach(run, scenario, Window(20, 50)) is beyond
        if beyond:
            assert _reach(run, scenario, Window(20, 50))[0] == pytest.approx(T * row)
    still = Trace.of(T * np.arange(60), {"angle": np.tile(POSE, (60, 1)), "reference_force": force})
    soft = tracking(object={"kind": "spring", "stiffness": "2 N/m"})
    assert leaves_reach(still, soft, Window(20, 50))
    assert _reach(still, soft, Window(20, 50))[0] is None
    assert not leaves_reach(still, soft, Window(20, 50, constant=False))
    frozen = tracking(
        object={"kind": "spring", "stiffness": "2 N/m"},
        device={"name": "phantom-premium-1.5a", "kinematics": "linear"},
    )
    assert not leaves_reach(still, frozen, Window(20, 50))


def test_supports_that_change_late_are_the_reason_only_where_the_forces_are_constant() -> None:
    body = SimpleNamespace(supports=[SimpleNamespace(at=0.098), SimpleNamespace(at=0.05)])
    one = SimpleNamespace(object=SimpleNamespace(body=body))
    scenario: Any = SimpleNamespace(
        each_object={"": one}, period=T, operator=SimpleNamespace(moves=False), reference=None
    )
    n = 100
    constant = np.ones((n, 3))
    changing = constant + np.arange(n)[:, None]
    for force, said in ((constant, True), (changing, False)):
        run = Trace.of(T * np.arange(n), {"reference_force": force})
        found = _unsupported(run, scenario)
        assert (found is not None) is said
        if found:
            assert found.startswith("the supports of the body change at 0.098 s, too late to judge what follows")
    hand = np.zeros((n, 3))
    scenario.operator = SimpleNamespace(moves=True, values=lambda _time: hand)
    steady = Trace.of(T * np.arange(n), {"reference_force": constant})
    assert _unsupported(steady, scenario) is not None
    hand[:, 2] = np.arange(n)
    assert _unsupported(steady, scenario) is None
    hand[:] = 0.0
    assert _unsupported(run, None) is None
    body.supports = []
    assert _unsupported(Trace.of(T * np.arange(n), {"reference_force": constant}), scenario) is None


def test_a_window_begins_where_a_force_becomes_constant_and_lasts_a_tenth_or_a_twentieth() -> None:
    forces = np.zeros((1000, 2))
    forces[200:300, 1], forces[300:, 1] = 1.0, 2.0
    forces[300:950, 0] = np.arange(650)
    assert constant_stretches(forces)[[0, 1, 2, 3, -1]].tolist() == [0, 200, 300, 301, 1000]
    assert windows(forces) == [Window(0, 199), Window(200, 299), Window(950, 999)]
    forces[950, 0] = 9.0
    assert windows(forces) == [Window(0, 199), Window(200, 299), Window(0, 999, False)]
    forces[299] = 7.0
    assert windows(forces) == [Window(0, 199), Window(0, 999, False)]
    short = np.zeros((120, 1))
    short[50:] = 1.0
    assert windows(short) == [Window(0, 49), Window(50, 119)]
    short[71:] = 2.0
    assert windows(short) == [Window(0, 49), Window(0, 119, False)]
    assert (Window(3, 13).fifth, Window(3, 12).fifth) == (2, 1)
    assert (Window(3, 13).ending, Window(3, 6).ending) == (slice(12, 14), slice(6, 7))


def test_a_step_of_two_samples_has_a_response_and_its_band_is_not_left_at_its_edge() -> None:
    two = step_response([1.0, 2.0], [3.0, 5.0], start=1.0)
    assert (two.steady, two.peak, two.settling_time, two.overshoot_percent) == (5.0, 5.0, 1.0, 0.0)
    assert (two.swing_growth, two.returns, two.ripple, two.error_percent) == (None, False, 0.0, None)
    y = np.r_[0.0, 8.0, 5.0, 4.5, np.full(96, 4.0)]
    found = step_response(np.arange(100.0), y, band=0.125, expected=-5.0)
    assert (found.steady, found.settling_time, found.overshoot_percent) == (4.0, 3.0, 100.0)
    assert found.error_percent == pytest.approx(180.0)
    back = step_response(np.arange(100.0), np.r_[0.0, 8.0, 0.4, 0.3, np.full(96, 0.0)], band=0.05)
    assert (back.returns, back.settling_time, back.peak) == (True, 2.0, 8.0)


def test_bends_are_changes_of_the_speed_between_late_samples() -> None:
    rng = np.random.default_rng(2)
    time = np.cumsum(rng.uniform(0.5, 1.5, 30))
    tip = rng.standard_normal((30, 3))
    for interval in (0.7, None):
        unit = np.median(np.diff(time)) if interval is None else interval
        found = second_differences(time, tip, interval)
        for row in range(2, 30):
            after, before = ((tip[i] - tip[i - 1]) / (time[i] - time[i - 1]) * unit for i in (row, row - 1))
            assert found[row] == pytest.approx(np.linalg.norm(after - before))
    assert _shifts(tip, Window(0, 29), 0.1, 0.1) == {}


def test_each_channel_of_an_object_is_described_by_the_longest_name_that_ends_its_own() -> None:
    assert describe_channel("tip") == CHANNELS["tip"]
    assert describe_channel("left_cube_object_force") == ("N", "left_cube: force of the tip on the object")
    assert describe_channel("egg_force") == ("N", "egg: force of the tip on the object")
    assert describe_channel("egg_frame_position") == ("m", "egg: origin of the frame of a moving object")
    assert describe_channel("egg_contact_moment")[0] == "N*m"
    assert describe_channel("unknown") == ("", "")
    assert describe_channel("a_touching") == ("", "a: 1 while the tip touches it")


def test_columns_are_named_by_axis_or_joint() -> None:
    assert column_names("depth", 1) == ["depth"]
    assert column_names("tip", 3) == ["tip_x", "tip_y", "tip_z"]
    assert column_names("angle", 3) == ["angle_1", "angle_2", "angle_3"]
    assert column_names("tip", 2) == ["tip_1", "tip_2"]


def test_a_plot_has_a_line_for_each_component_that_moves() -> None:
    pyplot = pytest.importorskip("matplotlib.pyplot")
    time = np.array([0.0, 0.5, 2.0])
    values = {
        "tip": [[0.0, 1.0, 2.0], [0.0, 0.0, 3.0], [0.0, 5.0, 4.0]], "angle": np.ones((3, 3)), "own": np.ones((3, 4)),
        "triangle": [1.0, 2.0, 3.0], "object_force": np.zeros((3, 3)),
    }  # fmt: skip
    run = Trace.of(time, values)  # type: ignore[arg-type]
    figure, axes = pyplot.subplots()
    expected = {
        "tip": (["y", "z"], [1, 2], "tip [m]"), "angle": (["1", "2", "3"], [0, 1, 2], "angle [rad]"),
        "own": (["1", "2", "3", "4"], [0, 1, 2, 3], "own"), "triangle": (None, [0], "triangle"),
        "object_force": (["x"], [0], "object force [N]"),
    }  # fmt: skip
    for name, (labels, columns, title) in expected.items():
        axes.clear()
        assert run.plot(name, axes) is axes
        lines = axes.get_lines()
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("time [s]", title)
        assert (axes.get_legend() is None) is (labels is None)
        if labels is not None:
            assert [line.get_label() for line in lines] == labels
        for line, column in zip(lines, columns, strict=True):
            np.testing.assert_array_equal(line.get_xdata(), time)
            np.testing.assert_array_equal(line.get_ydata(), run[name][:, column])
    pyplot.close(figure)
    own = run.plot("tip").figure
    assert own.get_size_inches().tolist() == [6.4, 3.2]
    pyplot.close(own)


class Recorder:
    """Stands in for the writer of the package mcap, which may not be installed."""

    made: list[Recorder] = []  # noqa: RUF012

    def __init__(self, file: Any) -> None:
        self.calls: list[tuple[str, dict[str, Any]]] = [("file", {"name": file.name})]
        self.made.append(self)

    def __getattr__(self, name: str) -> Any:
        def call(*arguments: Any, **keywords: Any) -> int:
            self.calls.append((name, {**dict(enumerate(arguments)), **keywords}))  # type: ignore[dict-item]
            return len(self.calls)

        return call


def test_an_mcap_file_holds_units_metadata_and_one_number_per_component(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mcap", ModuleType("mcap"))
    monkeypatch.setitem(sys.modules, "mcap.writer", SimpleNamespace(Writer=Recorder))
    values = {"tip": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], "depth": [7.0, 8.0]}
    Trace.of([0.0, 0.1], values, metadata={"title": "press"}).save(tmp_path / "t.mcap")  # type: ignore[arg-type]
    first, start, notes, *rest, last = Recorder.made[-1].calls
    assert (first[0], start, last) == ("file", ("start", {"profile": "", "library": "palpate"}), ("finish", {}))
    assert (notes[0], notes[1][0]) == ("add_metadata", "palpate")
    assert json.loads(notes[1][1]["trace"]) == {"metadata": {"title": "press"}, "unstable_from_s": None}
    tips = [{"x": 1.0, "y": 2.0, "z": 3.0}, {"x": 4.0, "y": 5.0, "z": 6.0}]
    rows: dict[str, list[dict[str, float]]] = {"tip": tips, "depth": [{"value": 7.0}, {"value": 8.0}]}
    for number, name in enumerate(("tip", "depth")):
        schema, channel, *messages = rest[4 * number : 4 * number + 4]
        told = json.loads(schema[1].pop("data"))
        assert schema == ("register_schema", {"name": name, "encoding": "jsonschema"})
        assert told == {
            "type": "object",
            "description": f"{CHANNELS[name][1]} [m]",
            "properties": {key: {"type": "number"} for key in rows[name][0]},
        }
        assert channel == (
            "register_channel",
            {"topic": f"/{name}", "message_encoding": "json", "schema_id": 4 + 4 * number, "metadata": {"unit": "m"}},
        )
        for (call, given), row, stamp in zip(messages, rows[name], (0, 10**8), strict=True):
            assert (call, json.loads(given.pop("data"))) == ("add_message", row)
            assert given == {"channel_id": 5 + 4 * number, "log_time": stamp, "publish_time": stamp}


def test_a_design_is_for_the_stiffness_given_else_that_of_the_object_else_one_newton_per_millimeter() -> None:
    device, start = tracking().load_device(), np.array(POSE)

    def designed(options: dict[str, Any], stiffness: Any, normalize: bool = False) -> Controller:
        return design_for("lqg", options, device, start, stiffness, T, normalize)

    for options, stiffness, normalize, expected in (
        ({}, None, False, 1000.0), ({}, 700.0, False, 700.0), ({"stiffness": 400.0}, 700.0, False, 400.0),
        ({}, 700.0, True, 1000.0), ({"stiffness": 400.0}, 700.0, True, 400.0),
    ):  # fmt: skip
        law = designed(options, stiffness, normalize)
        assert law.notes["design_stiffness"] == expected
        assert (law.design_stiffness is not None) is normalize
        same = designed({"stiffness": expected}, None)
        np.testing.assert_allclose(law.system.D, same.system.D)
        np.testing.assert_allclose(law.system.A, same.system.A)
    with pytest.raises(DesignError, match='a design is "lead_lag" or "lqg", not \'pid\''):
        design_for("pid", {}, device, start, None, T)
    with pytest.raises(DesignError, match="lqg: an option is not known"):
        designed({"colour": 1.0}, None)


def test_a_controller_is_written_as_a_gain_if_it_acts_on_the_error_of_each_axis_alone() -> None:
    import control

    def kind(d: Any, states: int = 0) -> str:
        a, b, c = np.zeros((states, states)), np.ones((states, 6)), np.ones((3, states))
        return with_controller(tracking(), Controller(control.StateSpace(a, b, c, d, T))).controller.kind

    gain = np.diag([1.0, 0.0, 2.0])
    both = np.hstack([gain, -gain])
    assert kind(both) == "gain"
    assert kind(both, 1) == "state_space"
    assert kind(-both) == "state_space"
    assert kind(np.hstack([gain, gain])) == "state_space"
    assert kind(np.hstack([gain + 0.1, -gain])) == "state_space"
    found = with_controller(tracking(), Controller(control.StateSpace([], [], [], both, T))).controller
    assert found.gain == (1.0, 0.0, 2.0)
    lqg = tracking(controller={"kind": "lqg"})
    again = written_out(lqg)
    assert again.controller.kind == "state_space"
    law, same = (build_controller(one, lqg.load_device(), np.array(POSE)) for one in (lqg, again))
    for name in "ABCD":
        np.testing.assert_allclose(getattr(law.system, name), getattr(same.system, name))
    np.testing.assert_allclose(law.antiwindup, same.antiwindup)
    assert written_out(tracking()) is not None
    scenario = tracking()
    assert written_out(scenario) is scenario
    assert read_scenario(scenario) is scenario
    assert read_scenario(TRACKING) == scenario
    assert read_scenario(TRACKING, law).controller == again.controller
    normalized = tracking(controller={"kind": "lqg", "normalize": True})
    assert written_out(normalized).controller.normalize == (1000.0, 1000.0, 1000.0)


def test_a_field_has_the_parameters_of_its_scenario() -> None:
    place = np.array([1.0, 2.0, 3.0])

    def fields(**keys: Any) -> dict[str, Any] | None:
        touched = {"kind": "field", "field": keys}
        return force_object(Scenario.from_dict({**TRACKING, "object": touched}), place)

    found = fields(kind="vibration", force=["1 N", "0 N", "2 N"], frequency="100 Hz")
    assert found is not None
    assert (found["frequency"], found["decay"], found["at_contact"]) == (pytest.approx(100.0), np.inf, False)
    np.testing.assert_array_equal(found["normal"], [0.0, 0.0, 1.0])
    np.testing.assert_array_equal(found["point"], place)
    np.testing.assert_array_equal(found["force"], [1.0, 0.0, 2.0])
    with pytest.raises(ScenarioError, match=r"500 Hz; it must be below half the servo rate, 500 Hz"):
        fields(kind="vibration", force=["1 N", "0 N", "2 N"], frequency="500 Hz")
    mass = fields(kind="virtual_mass", mass="0.1 kg", stiffness="300 N/m", coupling_damping="2 N*s/m")
    assert mass == {"kind": "virtual_mass", "mass": 0.1, "stiffness": 300.0, "damping": 2.0, "period": T}
    assert fields(kind="viscous", damping="3 N*s/m") is None
    well = fields(kind="gravity_well", stiffness="300 N/m", radius="2 mm", largest_force="0.4 N")
    assert well is not None
    assert (well["stiffness"], well["radius"], well["cap"]) == pytest.approx((300.0, 2e-3, 0.4))
    constant = fields(kind="constant", force=["1 N", "0 N", "2 N"])
    assert constant is not None
    assert constant["force"].tolist() == [1.0, 0.0, 2.0]


def test_the_deflection_of_an_object_is_that_of_its_law() -> None:
    tip = np.array([[2.0, 0.0, -1.0], [0.5, 1.0, 3.0], [1.0, 2.0, 3.0]])

    def deflected(object: dict[str, Any], values: dict[str, Any] | None = None) -> list[list[float]]:
        setup = SimpleNamespace(wall=SimpleNamespace(point=[1.0, 0.0, 0.0]))
        placed = PlacedObject(Scenario.from_dict({**TRACKING, "object": object}), setup, np.zeros(3))
        return placed._deflection(tip, values or {}).tolist()

    away = (tip - [1.0, 0.0, 0.0]).tolist()
    assert deflected({"kind": "spring", "stiffness": "1 N/m"}) == away
    wall = {"kind": "wall", "stiffness": "1 N/m", "normal": [0.0, 0.0, 1.0]}
    assert deflected(wall) == [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    law = {"kind": "force_law", "normal": [0.0, 1.0, 0.0], "law": {"formula": "500 * x", "deepest": "1 m"}}
    depth = np.array([[2.0], [-1.0], [0.0]])
    assert np.abs(deflected(law, {"depth": depth})).tolist() == [[0.0, 2.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    assert deflected(law, {"depth": depth})[0][1] == -2.0
    assert deflected(law, {"mass_position": tip - 0.25}) == np.full((3, 3), 0.25).tolist()
    field = {"kind": "gravity_well", "stiffness": "1 N/m", "radius": "1.5 m", "largest_force": "9 N"}
    assert deflected({"kind": "field", "field": field}) == [away[0], [0.0] * 3, [0.0] * 3]
    push = {"kind": "constant", "force": ["1 N", "0 N", "0 N"]}
    assert deflected({"kind": "field", "field": push}) == np.zeros((3, 3)).tolist()


def test_the_deflection_of_a_scene_is_that_of_the_object_with_the_largest_force() -> None:
    """Each object has its force, whether it touches, and then its own columns."""
    springs = {"kind": "spring", "stiffness": "1 N/m"}
    placed = {
        name: PlacedObject(
            Scenario.from_dict({**TRACKING, "object": springs}),
            SimpleNamespace(wall=SimpleNamespace(point=[point, 0.0, 0.0])),
            np.zeros(3),
        )
        for name, point in (("left", -1.0), ("right", 1.0))
    }
    columns = np.array([
        [3.0, 0.0, 4.0, 1.0, 0.0, 6.0, 0.0, 1.0],
        [3.0, 0.0, 4.0, 1.0, 0.0, 4.0, 0.0, 1.0],
        [3.0, 0.0, 4.0, 0.0, 0.0, 1.0, 0.0, 1.0],
        [3.0, 0.0, 4.0, 1.0, 0.0, 5.0, 0.0, 1.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    ])  # fmt: skip
    found = object_channels(placed, columns, np.zeros((5, 3)))
    assert found["deflection"][:, 0].tolist() == [-1.0, 1.0, -1.0, 1.0, 0.0]
    assert list(found) == [
        "deflection",
        *(f"{name}_{key}" for name in ("left", "right") for key in ("force", "touching", "deflection")),
    ]
    np.testing.assert_array_equal(found["right_force"], columns[:, 4:7])
    np.testing.assert_array_equal(found["left_touching"], columns[:, 3:4])


def test_an_observed_run_is_held_pushed_by_shares_of_its_force_and_observed(tmp_path: Path) -> None:
    path = tmp_path / "block.h5"
    fem.build(
        fem.block((0.024, 0.024, 0.012), 0.006),
        young=20e3,
        fixed="z < 0.001 mm",
        touch="z > 11.9 mm",
        order=1,
        output=path,
    )
    body = {"file": str(path), "origin": ["12 mm", "12 mm", "12 mm"], "tip": "flat", "radius": "8 mm"}
    hand = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m"}
    tables = {
        **{key: TRACKING[key] for key in ("device", "start")},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {**hand, "shape": "ramp", "rise": "0.1 s", "force": ["0 N", "0 N", "-0.6 N"]},
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-0.2 mm"], "body": {**body, "kind": "compliance"}},
        "run": {"duration": "0.5 s", "record_every": 5},
    }
    seen = observe(Scenario.from_dict(tables), ticks=300, hold=0.2504)
    assert (seen.end, seen.held, len(seen.trace)) == (500, 751, 751 + 2 + 300)
    assert seen.rests
    assert not seen.oscillates
    assert seen.lasts
    assert "and observed for 0.302 s; its verdict is settled" in seen.sentence
    force, operator = seen.trace["object_force"], seen.trace["operator_force"]
    assert np.linalg.norm(force[751]) == pytest.approx(np.linalg.norm(force[750]), rel=1e-3)
    free = observe(Scenario.from_dict(tables), ticks=5, hold=0.2504).trace
    push = operator[752:757] - operator[751]
    along = push @ force[751] / np.linalg.norm(force[751]) ** 2
    assert along[0] == pytest.approx(0.05, abs=0.01)
    assert np.linalg.norm(push[0]) / np.linalg.norm(force[751]) == pytest.approx(np.hypot(0.05, 0.02), abs=0.01)
    assert len(free) == 751 + 2 + 5
    assert np.abs(operator[757] - operator[751]).max() < 0.5 * np.abs(push[0]).max()
    assert seen.kept == pytest.approx(0.0505995, rel=1e-3)


def test_a_tip_off_its_object_in_the_last_hundredth_alone_is_off_it_now_and_then() -> None:
    for off, since in ((100, 0.020), (99, 0.020), (98, 0.098)):
        touching = np.ones(101)
        touching[21:30] = touching[off + 1 :] = 0.0
        found, reason = _lost(Trace.of(T * np.arange(101), {"touching": touching}), 0.25)
        assert found == pytest.approx(since)
        assert ("25 % of the time since the contact is established" in reason) is (off > 98)


def test_a_run_of_two_samples_with_a_fixed_tip_is_judged() -> None:
    tables = {**TRACKING, "servo": {"period": "1 ms", "topology": "impedance_display"}, "operator": {"kind": "fixed"}}
    del tables["reference"]
    scenario = Scenario.from_dict(tables)

    def judged(n: int, change: float, force: float) -> State:
        zero = np.zeros((n, 3))
        command = zero.copy()
        command[-1, 1] = change
        values = {
            "saturated": np.zeros(n),
            "command_force": command,
            "object_force": zero + np.array([0.0, 0.0, force]),
        }
        return judge(Trace.of(T * np.arange(n), values, metadata={"scenario": scenario.to_dict()})).state

    assert judged(1, 0.0, 1.0) is State.UNDECIDED
    assert judged(2, 0.0, 1.0) is State.SETTLED
    assert judged(100, 0.049, 1.0) is State.SETTLED
    assert judged(100, 0.051, 1.0) is State.UNDECIDED
    assert judged(100, 0.051, 2.0) is State.SETTLED


def test_a_resolved_loop_has_at_most_a_thousand_states() -> None:
    assert _order(1000, "the controller") == 1000
    with pytest.raises(OutputError, match="the controller has 1001 states; a resolved loop has at most 1000"):
        _order(1001, "the controller")


def test_an_incomplete_trace_is_refused_and_other_errors_pass() -> None:
    for problem in (KeyError("tip"), TypeError("no"), ZeroDivisionError(), ValueError("bad"), AttributeError("a")):
        with pytest.raises(TraceError, match="the trace is not complete, so it cannot be judged"), complete():
            raise problem
    for own in (ScenarioError("mine"), OutputError("mine")):
        with pytest.raises(type(own), match=r"^mine$"), complete():
            raise own
    with pytest.raises(OSError, match="disk"), complete():
        raise OSError("disk")


@pytest.mark.parametrize("triangle", [0, 1, 5])
def test_the_law_of_a_smooth_contact_is_the_stiffness_along_the_normal_of_its_triangle(triangle: int) -> None:
    mesh = Mesh(*box_mesh(0.08, 2))
    probe = ProxyProbe(mesh, Surface(stiffness=np.array([800.0]), period=T).core_for(mesh), 0.0)
    normal = probe.normals[triangle]
    place = mesh.vertices[mesh.triangles[triangle]].mean(axis=0)
    tilted = normal + 0.1 * np.roll(normal, 1)  # the facet's own normal counts
    law = probe.law(triangle, tilted, place, place - 1e-3 * normal)
    assert law is not None
    np.testing.assert_allclose(law.D, 800.0 * np.outer(normal, normal), atol=1e-3)
    assert probe.law(triangle, normal, place, place + 1e-3 * normal) is None


def test_an_object_without_force_has_no_creep_left() -> None:
    body = SimpleNamespace(options={"instantaneous_ratio": 3.0, "retardation_time": 1.0})
    scenario: Any = SimpleNamespace(
        each_object={"": SimpleNamespace(object=SimpleNamespace(body=body))},
        operator=SimpleNamespace(kind="force", stiffness=None),
        servo=SimpleNamespace(topology="impedance_display"),
    )
    run = Trace.of(T * np.arange(101), {"object_force": np.zeros((101, 3))})
    deflection = np.full((101, 3), 1e-3)
    for touching in (np.ones(101, dtype=bool), np.arange(101) < 100):
        assert _creep(run, scenario, Window(0, 100), deflection, touching) == 0.0
    loaded = Trace.of(T * np.arange(101), {"object_force": np.ones((101, 3))})
    began = np.arange(101) >= 100  # in the last sample
    found = _creep(loaded, scenario, Window(0, 100), deflection, began)
    assert found == pytest.approx(2.0 * np.sqrt(3.0) * 1e-3)
    assert _creep(loaded, scenario, Window(0, 100), deflection, np.zeros(101, dtype=bool)) == 0.0


def test_a_run_recorded_seldom_is_not_settled_without_the_verdict_of_every_tick() -> None:
    cube = {"shape": "box", "edge": "80 mm", "divisions": 2}
    surface = {"stiffness": "800 N/m"}
    touched = {"kind": "mesh", "mesh": cube, "surface": surface, "position": ["0 mm", "0 mm", "-1 mm"]}
    tables = {**TRACKING, "object": touched}
    n = 200
    settled = {
        "angle": np.tile(POSE, (n, 1)), "tip": np.tile([0.1, 0.2, 0.3], (n, 1)), "saturated": np.zeros(n),
        "touching": np.ones(n), "deflection": np.tile([0.0, 0.0, -1e-3], (n, 1)),
        "object_force": np.tile([0.0, 0.0, -1.0], (n, 1)), "command_force": np.tile([0.0, 0.0, -1.0], (n, 1)),
        "motor_force": np.zeros((n, 3)), "reference_force": np.tile([0.0, 0.0, -1.0], (n, 1)),
        "operator_force": np.zeros((n, 3)), "torque": np.zeros((n, 3)),
    }  # fmt: skip
    for every in (1, 2, 3):
        given = Scenario.from_dict({**tables, "run": {"duration": "1 s", "record_every": every}}).to_dict()
        verdict = judge(Trace.of(T * every * np.arange(n), settled, metadata={"scenario": given}), np.nan)
        assert verdict.state is (State.SETTLED if every == 1 else State.UNDECIDED)
        assert (f"one of {every} ticks is recorded" in verdict.reason) is (every > 1)


def test_a_load_presses_if_it_is_above_a_twentieth_of_the_largest_up_to_then() -> None:
    scenario: Any = SimpleNamespace(contact_kind="wall", object=SimpleNamespace(normal=[0.0, 0.0, 1.0]))
    for before, after, expected in ((19.9, 1.0, True), (20.1, 1.0, False), (19.9, 99.0, True)):
        load = np.zeros((10, 3))
        load[:, 2] = [-before, *([-1.0] * 6), -after, -after, -after]
        run = Trace.of(T * np.arange(10), {"reference_force": load, "operator_force": 0.0 * load, "object_force": load})
        assert _pressed(run, scenario, np.ones(10, dtype=bool), 6) is expected
    scenario = SimpleNamespace(contact_kind="mesh", object=SimpleNamespace(normal=None))
    load[:, 2] = -1.0
    run = Trace.of(T * np.arange(10), {"reference_force": load, "operator_force": 0.0 * load, "object_force": -load})
    for row, expected in (
        (4, False),
        (5, False),
        (6, False),
        (7, True),
    ):  # off the object until then, any load may press
        assert _pressed(run, scenario, np.arange(10) == row, 6) is expected


def test_metadata_are_plain_values() -> None:
    given = {
        1: np.array([[1.5, 2.0]]), "a": (np.float64(2.5), np.int64(3), np.bool_(True)), "b": None, "c": float("inf"),
        "d": 1 + 2j, "e": "text", "f": [True, 4, np.nan],
    }  # fmt: skip
    assert _plain(given) == {
        "1": [[1.5, 2.0]], "a": [2.5, 3, True], "b": None, "c": "inf", "d": "(1+2j)", "e": "text",
        "f": [True, 4, "nan"],
    }  # fmt: skip


def test_a_force_that_was_not_found_in_more_than_a_hundredth_of_the_samples_is_unknown() -> None:
    last = slice(-100, None)
    for missing, rows, said in ((2, slice(None), None), (3, slice(None), "3 of 200"), (3, last, "3 of the last 100")):
        solved = np.ones(200)
        solved[-missing:] = 0.0
        found = _without_force(Trace.of(T * np.arange(200), {"solved": solved}), rows)
        assert (found is None) is (said is None)
        assert said is None or f"the contact force was not found in {said} samples" in str(found)
    solved = np.ones(200)
    solved[-1] = 0.0
    run = Trace.of(T * np.arange(200), {"solved": solved})
    assert _without_force(run, slice(-100, None)) is None
    assert _without_force(run, slice(-99, None)) is not None
    assert _without_force(Trace.of([0.0], {"tip": np.zeros((1, 3))})) is None


@pytest.mark.parametrize(
    ("kind", "nodes", "said"),
    [
        ("compliance", 127, 128),
        ("compliance", 126, None),
        ("signed_distance", 189, None),
        ("signed_distance", 255, 256),
    ],
)
def test_too_many_nodes_are_named_only_where_the_contact_holds_no_more(kind: str, nodes: int, said: int | None) -> None:
    block = {"shape": "block", "size": ["60 mm", "60 mm", "20 mm"], "young": "5 kPa", "poisson": 0.4, "spacing": "3 mm"}
    scenario = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms"},
        "reference": {"force": ["0 N", "0 N", "-1 N"]},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-9 mm"],
            "body": {**block, "radius": "8 mm", "kind": kind},
        },
        "run": {"duration": "1 s"},
    }
    channels = {"solved": np.zeros(9), "contact_nodes": np.full(9, float(nodes))}
    found = str(_without_force(Trace.of(T * np.arange(9), channels, metadata={"scenario": scenario})))
    assert (f"more than {said} nodes lie under the tip" in found) is (said is not None)
    assert ("too many nodes lie near the tip" in found) is (said is None)


def test_a_scene_is_one_sided_only_if_each_of_its_objects_is() -> None:
    def scene(*kinds: str) -> Any:
        each = {str(i): SimpleNamespace(object=SimpleNamespace(kind=kind)) for i, kind in enumerate(kinds)}
        return SimpleNamespace(each_object=each)

    assert is_one_sided(scene("wall", "mesh", "body", "force_law", "textured_wall"))
    assert not is_one_sided(scene("wall", "spring"))
    assert not is_one_sided(scene("field"))


def test_a_contact_at_an_edge_has_no_one_law() -> None:
    """A point just beside the edge of a cube passes it within the larger step of the differences."""
    mesh = Mesh(*box_mesh(0.08, 1))
    probe = ProxyProbe(mesh, Surface(stiffness=np.array([800.0]), period=T).core_for(mesh), 0.0)
    top = int(np.argmax(probe.normals[:, 2]))
    normal = np.array([0.0, 0.0, 1.0])
    for beside, smooth in ((1e-3, True), (2e-7, False)):
        place = np.array([0.04 - beside, 0.001, 0.0])
        law = probe.law(top, normal, place, place - [0.0, 0.0, 1e-3])
        assert (law is not None) is smooth


def test_the_controller_of_an_admittance_display_is_no_law_from_force_to_force() -> None:
    tables = {
        **TRACKING,
        "servo": {"period": "1 ms", "topology": "admittance_display", "tool": {"mass": "1 kg", "damping": "1 N*s/m"}},
        "controller": {"kind": "workspace"},
        "operator": {"kind": "force", "shape": "step", "force": ["1 N", "0 N", "0 N"]},
    }
    del tables["reference"]
    scenario = Scenario.from_dict(tables)
    with pytest.raises(DesignError, match="follows a tool, so it is no linear law from force to force"):
        build_controller(scenario, scenario.load_device(), np.array(POSE))


def test_a_shared_contact_has_the_stiffness_of_its_force_over_its_depth() -> None:
    turn = Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix()
    row = np.zeros(15)
    row[0:3], row[3:6], row[8], row[10:13] = [0.1, 0.0, 2.0], [0.0, 0.0, -1e-3], 4.0, [0.1, 0.0, 0.0]
    found = _contact(turn, row)
    np.testing.assert_allclose(found.force, -turn @ row[0:3])
    np.testing.assert_allclose(found.deflection, turn @ row[3:6])
    np.testing.assert_allclose(found.normal, turn @ [0.0, 0.0, 1.0], atol=1e-12)
    assert (found.depth, found.stiffness, found.touching) == (pytest.approx(1e-3), pytest.approx(2000.0), True)
    for depth, stiffness in ((49e-6, 0.0), (51e-6, 2.0 / 51e-6)):
        row[5] = -depth
        assert _contact(turn, row).stiffness == pytest.approx(stiffness)
    row[8] = 0.0
    assert _contact(turn, row).touching is False
    row[8], row[10:13] = 4.0, row[0:3]
    assert _contact(turn, row).touching is False


@pytest.mark.parametrize(("crossings", "oscillates"), [(3, False), (4, True), (6, True)])
def test_a_response_oscillates_if_each_quarter_crosses_its_mean_four_times(crossings: int, oscillates: bool) -> None:
    """Blocks of +1 and -1 of equal length; the last quarter is one and a half times as large as the one before."""
    block = np.repeat(np.where(np.arange(crossings + 1) % 2, -1.0, 1.0), 9)
    y = np.concatenate([np.zeros(2 * len(block)), block, 1.5 * block])
    growth = step_response(np.arange(float(len(y))), y).swing_growth
    assert growth == (pytest.approx(1.5) if oscillates else None)
    few = np.concatenate([np.zeros(14), *([np.resize([1.0, -1.0], 7)] * 2)])
    assert step_response(np.arange(28.0), few).swing_growth is None
    enough = np.concatenate([np.zeros(16), *([np.resize([1.0, -1.0], 8)] * 2)])
    assert step_response(np.arange(32.0), enough).swing_growth == 1.0
