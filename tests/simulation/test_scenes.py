"""Several objects in one scenario, and objects in moving frames."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.errors import PalpateError, ScenarioError
from palpate.metrics import measure_performance
from palpate.scenario import Scenario
from palpate.simulation import Trace
from palpate.stability import certify, zwidth

POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]
SHIFT = ["2 mm", "-1 mm", "3 mm"]
CUBE = {"shape": "box", "edge": "80 mm", "divisions": 4}
REST = ["0 mm", "0 mm", "0 mm"]


def press(**objects: Any) -> dict[str, Any]:
    """A hand that pushes the tip along -x and -z."""
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {
            "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m", "shape": "step",
            "force": ["-0.8 N", "0 N", "-1 N"],
        },
        "run": {"duration": "0.4 s"},
        **objects,
    }  # fmt: skip


def wall(normal: list[int], stiffness: str = "600 N/m", **more: Any) -> dict[str, Any]:
    return {"kind": "wall", "normal": normal, "stiffness": stiffness, "damping": "1 N*s/m", **more}


def largest_difference(one: Trace, other: Trace, name: str = "tip") -> float:
    return float(np.abs(one[name] - other[name]).max())


def test_forces_of_objects_add() -> None:
    """Two walls at one place are one wall with the sum of their stiffness and damping; the parts share its force."""
    halves = simulate(press(objects={"soft": wall([0, 0, 1], "400 N/m"), "stiff": wall([0, 0, 1], "800 N/m")}))
    whole = simulate(press(object=wall([0, 0, 1], "1200 N/m") | {"damping": "2 N*s/m"}))
    assert whole["touching"].any()
    assert largest_difference(halves, whole) < 1e-12
    assert np.array_equal(halves["object_force"], halves["soft_force"] + halves["stiff_force"])
    assert halves.channels["soft_force"].unit == "N"
    assert halves.channels["soft_force"].description == "soft: force of the tip on the object"


def test_two_walls_are_a_corner() -> None:
    """A corner as a function of the tip gives the run of two perpendicular walls."""
    start = simulate(press(object=wall([0, 0, 1]), run={"duration": "1 ms"}))["tip"][0]

    def corner(tip: Any) -> list[float]:
        depth, speed = np.minimum(tip.position - start, 0.0), np.where(tip.position < start, tip.velocity, 0.0)
        entered = np.where(tip.position < start, np.minimum(tip.position - tip.velocity * 1e-3 - start, 0.0), 0.0)
        rate = np.where(speed != 0.0, (depth - entered) / 1e-3, 0.0)
        return [min(600.0 * depth[0] + rate[0], 0.0), 0.0, min(600.0 * depth[2] + rate[2], 0.0)]

    walls = simulate(press(objects={"left": wall([1, 0, 0]), "floor": wall([0, 0, 1])}))
    both = simulate(press(object={"kind": "none"}), object=corner)
    assert walls["left_touching"].mean() > 0.5
    assert walls["floor_touching"].mean() > 0.5
    assert largest_difference(walls, both) < 1e-9
    assert np.abs(walls["left_deflection"][:, 1:]).max() == 0.0


@pytest.mark.parametrize(
    "touched",
    [
        wall([0, 0, 1]),
        {"kind": "spring", "stiffness": "600 N/m", "damping": "1 N*s/m"},
        {"kind": "mesh", "mesh": CUBE, "surface": {"stiffness": "0.6 N/mm", "static_friction": 0.2}},
    ],
    ids=lambda touched: touched["kind"],
)
def test_a_frame_at_rest_is_a_position(touched: dict[str, Any]) -> None:
    frame = {"displacement": [["0 s", *SHIFT], ["1 s", *SHIFT]]}
    moved = simulate(press(object={**touched, "frame": frame}))
    placed = simulate(press(object={**touched, "position": SHIFT}))
    assert placed["touching"].any()
    for name in ("tip", "deflection", *(("proxy", "normal") if touched["kind"] == "mesh" else ())):
        assert largest_difference(moved, placed, name) < 1e-9, name
    assert np.allclose(moved["frame_position"] - moved["tip"][0], [2e-3, -1e-3, 3e-3], atol=1e-12)


def test_a_turned_frame_turns_its_object() -> None:
    """A floor in a frame turned by 90 degrees about y is a wall along x."""
    turned = [["0 s", "0 deg", "90 deg", "0 deg"], ["1 s", "0 deg", "90 deg", "0 deg"]]
    frame = simulate(press(object={**wall([0, 0, 1]), "frame": {"rotation": turned}}))
    placed = simulate(press(object=wall([1, 0, 0])))
    assert largest_difference(frame, placed) < 1e-12
    assert np.allclose(frame["frame_rotation"], [0.0, np.pi / 2, 0.0])


def test_a_slowly_moving_wall_and_the_arm_are_springs_in_series() -> None:
    """The tip moves by K_wall / (K_wall + K_arm) of the motion of the wall."""
    rows = [["0 s", *REST], ["0.3 s", *REST], ["1.3 s", "0 mm", "0 mm", "10 mm"]]
    lift = wall([0, 0, 1], "500 N/m", frame={"displacement": rows})
    trace = simulate(press(object=lift, run={"duration": "1.3 s"}))
    late = trace.time > 0.9
    speed = np.polyfit(trace.time[late], trace["tip"][late, 2], 1)[0]
    assert speed == pytest.approx(0.01 * 500.0 / 700.0, rel=0.02)
    assert trace["touching"][late].all()


@pytest.mark.parametrize("analysis", [certify, zwidth, measure_performance], ids=lambda f: f.__name__)
def test_an_analysis_takes_one_object_at_rest(analysis: Any) -> None:
    with pytest.raises(PalpateError, match=r"objects: an analysis takes one object, and the scenario has a, b"):
        analysis(press(objects={"a": wall([0, 0, 1]), "b": wall([1, 0, 0])}))
    moving = {"displacement": [["0 s", *REST], ["1 s", *SHIFT]]}
    with pytest.raises(PalpateError, match=r"object.frame: an analysis takes an object at rest: remove the frame"):
        analysis(press(object=wall([0, 0, 1], frame=moving)))


@pytest.mark.parametrize(
    ("tables", "sentence"),
    [
        ({"objects": {}}, "objects: 0 tables"),
        ({"objects": {"a": wall([0, 0, 1])}, "object": wall([0, 0, 1])}, "object: with \\[objects.NAME\\] tables"),
        ({"objects": {"motor": wall([0, 0, 1])}}, '"motor" cannot name an object'),
        ({"objects": {"a": {"kind": "none"}}}, 'the object a has kind = "none"'),
        ({"objects": {"a": {"kind": "wall", "normal": [0, 0, 1]}}}, "objects.a.stiffness is missing"),
        ({"objects": {"a": {**wall([0, 0, 1]), "stifness": 1}}}, r"in \[objects.a\]; did you mean stiffness\?"),
        ({"object": {**wall([0, 0, 1]), "frame": {}}}, "object.frame.displacement is missing"),
        ({"object": {"kind": "none", "frame": {"rotation": [["0 s", *REST]]}}}, "a table needs at least two rows"),
    ],
)
def test_a_wrong_scene_is_refused_in_a_sentence(tables: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ScenarioError, match=sentence):
        Scenario.from_dict(press(**tables))


def test_a_mistake_names_the_object(tmp_path: Path) -> None:
    mesh = {
        "kind": "mesh",
        "mesh": {"file": str(tmp_path / "none.stl"), "unit": "mm"},
        "surface": {"stiffness": "1 N/m"},
    }
    with pytest.raises(ScenarioError, match=r"objects.liver.mesh.file: .*none.stl"):
        simulate(press(objects={"liver": mesh, "rib": wall([0, 0, 1])}))
