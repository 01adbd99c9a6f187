"""A mesh in a scenario: what is read, what is refused, and that the loop on it obeys the laws of simpler objects."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from palpate import simulate
from palpate.contact import Mesh
from palpate.errors import ScenarioError
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.meshes import box_mesh, bumpy_ellipsoid
from palpate.stability import certify

POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]


def tables(surface: dict[str, Any] | None = None, mesh: dict[str, Any] | None = None, **other: Any) -> dict[str, Any]:
    """A press into the top of a cube of 1 N/mm without friction; `surface`, `mesh` and tables lie over it."""
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"period": "0.5 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-2 N"]},
        "object": {
            "kind": "mesh",
            "position": ["3 mm", "2 mm", "-0.2 mm"],
            "mesh": {"shape": "box", "edge": "80 mm", "divisions": 8} if mesh is None else mesh,
            "surface": {"stiffness": "1 N/mm", "tangential": "0 N/mm", **(surface or {})},
        },
        "run": {"duration": "0.2 s"},
        **other,
    }


def refusal(scenario: dict[str, Any], **kw: Any) -> str:
    with pytest.raises(ScenarioError) as caught:
        simulate(Scenario.from_dict(scenario, **kw))
    return str(caught.value)


def test_shapes_are_closed_and_sound() -> None:
    """Box and organ enclose what they should: no border, nothing pierced, the box's volume; tops at the origin."""
    cube = Mesh(*box_mesh(0.08, 6))
    found = cube.diagnose()
    assert found.clean
    assert found.triangles == 6 * 6 * 6 * 2
    assert found.volume == pytest.approx(0.08**3, rel=1e-12)
    assert cube.vertices.max(axis=0) == pytest.approx([0.04, 0.04, 0.0], abs=1e-15)
    liver = Mesh(*bumpy_ellipsoid((0.09, 0.07, 0.05), 0.06, 4))
    assert liver.diagnose().clean
    at, _ = liver.nearest([[0.0, 0.0, 0.001]])
    assert np.linalg.norm(at) < 1e-3
    unbumped = Mesh(*bumpy_ellipsoid((0.09, 0.07, 0.05), 0.0, 5))
    assert unbumped.diagnose().volume == pytest.approx(np.pi / 6 * 0.09 * 0.07 * 0.05, rel=2e-3)


def test_a_flat_mesh_is_a_wall() -> None:
    """The same run on a wall of the same stiffness: equal to rounding, tick by tick."""
    on_mesh = simulate(tables())
    wall = {"kind": "wall", "stiffness": "1 N/mm", "position": ["3 mm", "2 mm", "-0.2 mm"], "normal": [0, 0, 1]}
    on_wall = simulate({**tables(), "object": wall})
    assert np.array_equal(on_mesh["touching"], on_wall["touching"])
    for channel in ("tip", "deflection", "object_force"):
        np.testing.assert_allclose(on_mesh[channel], on_wall[channel], atol=1e-9)
    assert on_mesh["object_force"][-1, 2] < -0.5


def test_shading_reaches_the_loop() -> None:
    """On the shaded top of a ball the normal in the loop is radial, as on a true ball; unshaded it is a facet's."""
    radius, off = 0.04, 5.4e-3
    ball = {"shape": "bumpy_ellipsoid", "size": ["80 mm"] * 3, "bump": 0.0, "divisions": 3}
    angle = {}
    for shading in ("0 deg", "30 deg"):
        scenario = tables({"shading": shading, "tangential": "1 N/mm", "static_friction": 1.0}, ball)
        scenario["object"]["position"] = [f"{-off} m", "0 m", f"{radius - np.sqrt(radius**2 - off**2) - 1e-4} m"]
        trace = simulate(scenario)
        on = trace["touching"][:, 0] > 0.0
        centre = trace["tip"][0] + np.array([-off, 0.0, -np.sqrt(radius**2 - off**2) - 1e-4])
        radial = trace["proxy"][on] - centre
        radial /= np.linalg.norm(radial, axis=1)[:, None]
        angle[shading] = np.degrees(np.arccos(np.clip(np.sum(radial * trace["normal"][on], axis=1), -1.0, 1.0))).max()
    assert angle["30 deg"] < 1.0
    assert angle["0 deg"] > 2.0


@pytest.mark.parametrize("deep", [0.0, 3.0])
def test_a_run_that_begins_inside_says_so(deep: float) -> None:
    """A tip that starts under the surface, as after a slip in position or unit, is told of in the verdict."""
    scenario = tables()
    scenario["object"]["position"] = ["3 mm", "2 mm", f"{deep} mm"]
    verdict = summarize(simulate(scenario))["verdict"]
    assert ("began 3 mm deep in the mesh" in verdict) == (deep > 0.0), verdict


def test_a_run_that_diverges_says_that_it_began_inside() -> None:
    """A box of 80 mm that is read as one of 80 m: the tip starts meters below the surface."""
    scenario = tables(mesh={"shape": "box", "edge": "80 m", "divisions": 8})
    scenario["object"]["position"] = ["3 m", "2 m", "2 m"]
    trace = simulate(scenario)
    assert not trace.completed
    assert "it began 2e+03 mm deep in the mesh; check object.position" in summarize(trace)["verdict"]


def test_a_bounce_that_does_not_end_is_unstable() -> None:
    """A free arm under a constant force never rests past the critical stiffness that the wall's certificate gives."""
    hand = {"kind": "force", "shape": "ramp", "rise": "50 ms", "force": ["0 N", "0 N", "-0.5 N"]}
    free = {"servo": {"topology": "impedance_display"}, "operator": hand, "run": {"duration": "3 s"}}

    def press(share: float) -> dict[str, Any]:
        scenario = tables(
            {"stiffness": f"{share * critical} N/mm"}, {"shape": "box", "edge": "200 mm", "divisions": 8}, **free
        )
        return summarize(simulate(_without_reference(scenario)))

    wall = {"kind": "wall", "stiffness": "1 N/mm", "position": ["0 mm", "0 mm", "-0.2 mm"], "normal": [0, 0, 1]}
    critical = certify(_without_reference(tables(**{**free, "object": wall}))).margin["critical_gain"]
    assert press(0.8)["stable"]
    for share in (2.0, 6.0):
        found = press(share)
        assert not found["stable"]
        assert "the tip bounces" in found["verdict"]


def _without_reference(scenario: dict[str, Any]) -> dict[str, Any]:
    return {key: table for key, table in scenario.items() if key != "reference"}


def test_what_is_recorded_fits_together() -> None:
    """Force = stiffness x depth along the normal; the tip lies that deep under the proxy; apart, all is zero."""
    trace = simulate(tables({"stiffness": ["0.8 N/mm", "1.2 N/mm"], "pattern": "checkerboard", "width": "10 mm"}))
    on = trace["touching"][:, 0] > 0
    assert 100 < on.sum() < len(trace)
    k, depth, normal = trace["surface_stiffness"], trace["depth"], trace["normal"]
    np.testing.assert_allclose(trace["object_force"], -k * depth * normal, atol=1e-12)
    np.testing.assert_allclose((trace["proxy"] - trace["tip"])[on], (depth * normal)[on], atol=1e-12)
    assert set(np.unique(k[on])) <= {800.0, 1200.0}
    assert np.all(trace["triangle"][~on] == -1)
    assert not np.any(normal[~on])


def test_patterns_and_placement() -> None:
    """Stripes lie along the mesh's own x, wherever it is turned and put."""
    stripes = {"stiffness": ["1 N/mm", "2 N/mm"], "pattern": "stripes", "width": "40 mm"}
    cube = {"shape": "box", "edge": "80 mm", "divisions": 4}
    for turn, shift, expected in ((0, -10, 2000), (0, 10, 1000), (180, -10, 1000), (180, 10, 2000)):
        scenario = tables(stripes, {**cube, "rotation": ["0 deg", "0 deg", f"{turn} deg"]})
        scenario["object"]["position"] = [f"{shift} mm", "5 mm", "-0.2 mm"]
        trace = simulate(scenario)
        assert trace["surface_stiffness"].max() == pytest.approx(expected)
        assert trace["normal"][-1] == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_a_file_is_the_shape_it_holds(tmp_path: Path) -> None:
    """A cube written to STL in mm gives the run of the built-in one; the path is relative to the scenario."""
    vertices, triangles = box_mesh(0.08, 8)
    trimesh.Trimesh(vertices * 1e3, triangles, process=False).export(tmp_path / "cube.stl")
    scenario = tables(mesh={"shape": "file", "file": "cube.stl", "unit": "mm"})
    trace = simulate(Scenario.from_dict(scenario, base=tmp_path))
    np.testing.assert_allclose(trace["tip"], simulate(tables())["tip"], atol=1e-8)  # STL holds single precision
    assert "there is no such file" in refusal(tables(mesh={"shape": "file", "file": "no.stl", "unit": "mm"}))


def test_a_hand_may_hold_a_force_tracking_device() -> None:
    """A spring of the hand shares the load: at rest the command carries the object and the hand."""
    hand = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"}
    trace = simulate({**tables(run={"duration": "1.5 s"}), "operator": hand, "controller": {"kind": "gain", "gain": 5}})
    force, hand_force = trace["object_force"][-1, 2], trace["operator_force"][-1, 2]
    moved = (trace["tip"][-1] - trace["tip"][0])[2]
    assert hand_force == pytest.approx(-200.0 * moved, rel=0.02)
    assert trace["command_force"][-1, 2] == pytest.approx(5 * (-2.0 - force), rel=1e-9)


def test_the_way_to_text_and_back() -> None:
    """A scenario with a mesh is the same after to_dict and from_dict."""
    surface = {"stiffness": ["1 N/mm", "1.2 N/mm"], "pattern": "stripes", "width": "10 mm", "static_friction": 0.2}
    scenario = Scenario.from_dict(tables(surface))
    assert Scenario.from_dict(scenario.to_dict()) == scenario


@pytest.mark.parametrize(
    ("surface", "mesh", "said"),
    [
        ({"stiffness": ["1 N/mm", "2 N/mm"]}, None, "pattern is missing"),
        ({"stiffness": ["1 N/mm", "2 N/mm"], "pattern": "stripes"}, None, "width is missing"),
        (
            {"stiffness": ["1 N/mm", "2 N/mm"], "pattern": "listed"},
            None,
            "object.surface.stiffness: must be one value, one per tri",
        ),
        ({"stiffness": "1 N"}, None, "object.surface.stiffness"),
        ({"stiffness": "-1 N/mm"}, None, "must not be negative"),
        ({"stiffness": []}, None, "at least one value"),
        ({"width": "5 mm"}, None, "belongs to a pattern"),
        ({"dynamic_friction": 0.3}, None, "must not exceed static_friction"),
        ({"shading": 30}, None, "30 has no unit, and an angle is needed"),
        ({"shading": "90 deg"}, None, "object.surface.shading: 90 deg; it must be at most 85 deg"),
        ({"field": "smooth"}, None, "is not one of discrete, continuous"),
        ({"tangental": "1 N/mm"}, None, "did you mean tangential?"),
        ({}, {"shape": "box", "edge": "80 mm"}, "divisions is missing"),
        ({}, {"shape": "box", "edge": "80 mm", "divisions": 0}, "must be between 1 and 500"),
        ({}, {"shape": "box", "edge": "80 mm", "divisions": 2, "bump": 0.1}, "bump has no meaning"),
        ({}, {"file": "liver.stl"}, "unit is missing"),
        (
            {},
            {"shape": "bumpy_ellipsoid", "size": ["9 mm", "7 mm", "0 mm"], "bump": 0.1, "divisions": 3},
            "must be positive",
        ),
        ({}, {"shape": "bumpy_ellipsoid", "size": ["9 mm", "7 mm", "5 mm"], "bump": 1.5, "divisions": 3}, "below 1"),
    ],
)
def test_mistakes_are_told(surface: dict[str, Any], mesh: dict[str, Any] | None, said: str) -> None:
    """Each mistake is one sentence that names the field or what is missing."""
    assert said in refusal(tables(surface, mesh))


@pytest.mark.parametrize(
    ("name", "unit", "content", "said"),
    [
        ("none.obj", "mm", None, r"line 13: object\.mesh\.file: .*none\.obj: there is no such file"),
        ("flat.obj", "mm", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", r"line 13: object\.mesh\.file: .*has an area"),
        ("nan.obj", "mm", "v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", r"line 13: object\.mesh\.file: .*vertex 2"),
        ("any.obj", "kg", "", r'line 14: object\.mesh\.unit: "kg" is not a unit of length'),
    ],
)
def test_a_meshs_mistakes_name_the_scenarios_line(
    tmp_path: Path, name: str, unit: str, content: str | None, said: str
) -> None:
    if content is not None:
        (tmp_path / name).write_text(content, "utf-8")
    text = f"""[device]
name = "phantom-premium-1.5a"
[start]
pose = ["0 rad", "2.2305 rad", "3.2776 rad"]
[servo]
topology = "impedance_display"
[operator]
kind = "force"
force = "0 N"
[object]
kind = "mesh"
[object.mesh]
file = "{name}"
unit = "{unit}"
[object.surface]
stiffness = "1 N/mm"
"""
    (tmp_path / "s.toml").write_text(text, "utf-8")
    with pytest.raises(ScenarioError, match=said):
        simulate(tmp_path / "s.toml")


def test_keys_that_belong_elsewhere() -> None:
    """A mesh has no stiffness of its own, a spring no mesh; a mesh cannot be certified as one loop."""
    scenario = tables()
    scenario["object"]["stiffness"] = "1 N/mm"
    assert "in [object.surface]" in refusal(scenario)
    spring = {**tables(), "object": {"kind": "spring", "stiffness": "1 N/mm", "mesh": tables()["object"]["mesh"]}}
    assert 'belongs to kind = "mesh"' in refusal(spring)
    no_surface = tables()
    del no_surface["object"]["surface"]
    assert "surface is missing" in refusal(no_surface)
    slippery = tables()
    del slippery["object"]["surface"]["stiffness"]
    assert 'object.surface.stiffness is missing; write for example stiffness = "1 N/mm"' in refusal(slippery)
    with pytest.raises(Exception, match="a mesh has no one loop to judge"):
        scenario_loop(Scenario.from_dict(tables()))
