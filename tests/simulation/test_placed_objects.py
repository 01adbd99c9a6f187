"""Where objects are placed, the meshes that a scenario describes, and the operator's arm in the core's setup."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import _core, devices
from palpate.control import WorkspaceController, workspace
from palpate.errors import OutputError, ScenarioError
from palpate.scenario import Scenario
from palpate.simulation.loop_config import _controller, _force_object
from palpate.simulation.meshes import box_mesh, bumpy_ellipsoid, mesh_origin, sensed_tip, touched_mesh
from palpate.simulation.simulator import _hold

ARM, SLIDER = devices.load("phantom-premium-1.5a"), devices.load("slider")
START = np.array([0.123, 1.9, 3.0])
MESH: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": [f"{q} rad" for q in START]},
    "reference": {"force": ["0 N", "0 N", "-1 N"]},
    "object": {"kind": "mesh", "position": ["1 mm", "2 mm", "-3 mm"],
               "mesh": {"shape": "box", "edge": "40 mm", "divisions": 4}, "surface": {"stiffness": "1 N/mm"}},
}  # fmt: skip


def with_encoder(given: bool) -> Any:
    return SimpleNamespace(device=SimpleNamespace(encoder=given))


def test_an_object_lies_at_the_start_as_the_encoders_read_it() -> None:
    """Each joint is at its nearest count; exact without encoders, and on joints without counts."""
    step = ARM.encoder_step
    counts = np.array([np.argmin(np.abs(q - s * np.arange(-30000, 30000))) for q, s in zip(START, step, strict=True)])
    read = step * (counts - 30000)
    assert 0.0 < np.abs(read - START).max() <= 0.5 * step.max()
    np.testing.assert_allclose(sensed_tip(with_encoder(True), ARM, START), ARM.forward(read), rtol=1e-12)
    np.testing.assert_array_equal(sensed_tip(with_encoder(False), ARM, START), ARM.forward(START))
    bare = ARM.__class__(ARM.name, "", ARM.mechanism, ARM.parameters.__class__(
        {key: value for key, value in ARM.parameters.values.items() if key != "drive.encoder_counts"}))  # fmt: skip
    np.testing.assert_array_equal(sensed_tip(with_encoder(True), bare, START), bare.forward(START))


@pytest.mark.parametrize("encoder", [False, True])
def test_a_mesh_lies_where_its_scenario_places_it_from_the_tip_or_the_pose(encoder: bool) -> None:
    tables = {**MESH, "device": {**MESH["device"], "encoder": encoder}}
    scenario = Scenario.from_dict(tables)
    expected = sensed_tip(scenario, ARM, START) + np.array([1e-3, 2e-3, -3e-3])
    np.testing.assert_allclose(mesh_origin(scenario), expected, rtol=1e-12)
    tip = [f"{1e3 * part:.12g} mm" for part in ARM.forward(START)]
    from_tip = Scenario.from_dict({**tables, "start": {"tip": tip}})
    np.testing.assert_allclose(mesh_origin(from_tip), expected, atol=1e-9 + encoder * 1e-4)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_cube_has_equal_triangles_that_face_outward_and_its_origin_on_top(n: int) -> None:
    edge = 0.03
    vertices, triangles = box_mesh(edge, n)
    assert vertices.shape == (6 * n**2 + 2, 3)
    assert len(triangles) == 12 * n**2
    np.testing.assert_allclose(vertices.min(axis=0), [-edge / 2, -edge / 2, -edge], atol=1e-15)
    np.testing.assert_allclose(vertices.max(axis=0), [edge / 2, edge / 2, 0.0], atol=1e-15)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    area = np.cross(b - a, c - a) / 2.0
    np.testing.assert_allclose(np.linalg.norm(area, axis=1), edge**2 / (2 * n**2), rtol=1e-12)
    assert np.einsum("ij,ij->", a, area) / 3.0 == pytest.approx(edge**3)
    outward = (a + b + c) / 3.0 + np.array([0.0, 0.0, edge / 2])
    assert (np.einsum("ij,ij->i", outward, area) > 0.0).all()
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert set(np.unique(sides, axis=0, return_counts=True)[1]) == {2}


@pytest.mark.parametrize("bump", [0.0, 0.2])
def test_an_ellipsoid_bulges_as_its_formula_says_and_its_top_is_the_origin(bump: float) -> None:
    size = np.array([0.04, 0.06, 0.03])
    vertices, triangles = bumpy_ellipsoid((0.04, 0.06, 0.03), bump, 3)

    def radius(x: Any, y: Any, z: Any) -> Any:
        waves = np.sin(5 * x + 1) * np.sin(4 * y + 2) + np.sin(3 * z) * np.cos(4 * x + 3 * y)
        return 1 + bump * waves / 2

    away = 2.0 * (vertices + size * [0.0, 0.0, 0.5 * radius(0.0, 0.0, 1.0)]) / size
    length = np.linalg.norm(away, axis=1)
    np.testing.assert_allclose(length, radius(*(away / length[:, None]).T), rtol=1e-12)
    assert np.ptp(length) > bump
    assert (len(vertices), len(triangles)) == (642, 1280)


@pytest.mark.parametrize("pattern", ["stripes", "checkerboard"])
def test_a_pattern_has_the_stiffness_of_the_field_of_its_triangle(pattern: str) -> None:
    """Fields of 10 mm from the lowest corner of the mesh in its own frame, also if the mesh is turned."""
    surface = {"stiffness": ["1 N/mm", "2 N/mm", "5 N/mm"], "pattern": pattern, "width": "10 mm"}
    flat = MESH["object"]["mesh"]
    for rotation in (["0 deg", "0 deg", "0 deg"], ["10 deg", "-20 deg", "30 deg"]):
        mesh = {**flat, "rotation": rotation}
        scenario = Scenario.from_dict({**MESH, "object": {**MESH["object"], "mesh": mesh, "surface": surface}})
        origin = np.array([0.1, -0.2, 0.3])
        touched, found = touched_mesh(scenario, origin)
        own, triangles = box_mesh(0.04, 4)
        middle = own[triangles].mean(axis=1) + np.array([0.02, 0.02, 0.04])
        column, row = (np.floor(middle[:, k] / 0.01).astype(int) for k in (0, 1))
        number = column if pattern == "stripes" else column + row
        np.testing.assert_array_equal(found.stiffness, np.array([1e3, 2e3, 5e3])[number % 3])
        away = np.asarray(touched.vertices) - origin
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), np.linalg.norm(own, axis=1), atol=1e-12)
        if any(angle != "0 deg" for angle in rotation):
            x, y, z = np.radians([10.0, -20.0, 30.0])
            about_x = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
            about_y = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
            about_z = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
            np.testing.assert_allclose(away, own @ (about_z @ about_y @ about_x).T, atol=1e-12)


def test_a_file_that_cannot_be_read_and_a_surface_that_does_not_fit_name_their_fields() -> None:
    missing = {"file": "nowhere.stl", "unit": "mm"}
    with pytest.raises(ScenarioError, match=r"object\.mesh\.file: .*nowhere\.stl"):
        touched_mesh(Scenario.from_dict({**MESH, "object": {**MESH["object"], "mesh": missing}}), np.zeros(3))


def test_an_arm_without_mass_damping_or_tissue_has_none_in_the_core() -> None:
    given = {"kind": "arm", "mass": 0.2, "damping": 3.0, "stiffness": 40.0, "tissue_stiffness": 500.0,
             "tissue_damping": 0.7, "rest": (1e-3, 2e-3, 3e-3)}  # fmt: skip
    scenario: Any = SimpleNamespace(device=SimpleNamespace(model="nonlinear"))
    names = ("mass", "damping", "stiffness", "tissue_stiffness", "tissue_damping")
    for left_out in (None, *names):
        setup = SLIDER.setup()
        scenario.operator = SimpleNamespace(**{**given, left_out or "kind": None if left_out else "arm"})
        _hold(setup, scenario, SLIDER, np.array([0.05]))
        arm = setup.human_arm
        for name in names:
            bare = left_out == name or (left_out == "tissue_stiffness" and name.startswith("tissue"))
            unset = getattr(_core.HumanArm(), name) if left_out == "tissue_stiffness" and bare else 0.0
            assert getattr(arm, name) == (unset if bare else given[name])
        assert arm.tissue is (left_out != "tissue_stiffness")
        np.testing.assert_allclose(arm.rest, SLIDER.forward(np.array([0.05])) + given["rest"])
        assert not setup.fixed


def test_an_arm_needs_the_nonlinear_device_and_a_fixed_tip_and_a_force_are_no_arm() -> None:
    scenario: Any = SimpleNamespace(device=SimpleNamespace(model="linear"), operator=SimpleNamespace(kind="arm"))
    with pytest.raises(ScenarioError, match=r'an arm moves with the nonlinear device; with device\.model = "linear"'):
        _hold(SLIDER.setup(), scenario, SLIDER, np.zeros(1))
    for kind in ("fixed", "force"):
        setup = SLIDER.setup()
        scenario.operator = SimpleNamespace(kind=kind)
        _hold(setup, scenario, SLIDER, np.zeros(1))
        assert setup.fixed is (kind == "fixed")


def test_a_workspace_controller_is_resolved_with_its_numbers_and_the_tool_of_a_display() -> None:
    controller: WorkspaceController = workspace(SLIDER, 1e-3, bandwidth=150.0)
    display = _controller(controller, SLIDER, SimpleNamespace(mass=0.3, damping=4.0))  # type: ignore[arg-type]
    assert display == {
        "kind": "admittance", "bandwidth": 150.0, "damping": controller.damping, "observer": controller.observer,
        "disturbance": controller.disturbance, "tool_mass": 0.3, "tool_damping": 4.0,
        "friction": SLIDER.viscous.tolist(),
    }  # fmt: skip
    tracking = _controller(controller, SLIDER, None)
    assert (tracking["kind"], tracking["bandwidth"], tracking["friction"]) == (
        "workspace", 150.0, SLIDER.viscous.tolist()
    )  # fmt: skip
    assert tracking["stiffness"] == list(controller.stiffness)
    with pytest.raises(OutputError, match="it knows another device than that of the scenario"):
        _controller(controller, ARM, None)


def test_a_force_object_is_resolved_to_plain_numbers_and_the_table_of_a_law_to_files() -> None:
    written: list[Any] = []
    blobs: Any = SimpleNamespace(write=lambda key, values: written.append((key, values)) or f"{key}.file")
    well = {"kind": "gravity_well", "point": np.array([1.0, 2.0, 3.0]), "cap": np.inf, "radius": 0.5, "count": 3}
    assert _force_object(well, blobs) == {
        "kind": "gravity_well", "point": [1.0, 2.0, 3.0], "cap": None, "radius": 0.5, "count": 3
    }  # fmt: skip
    assert written == []
    law = {"kind": "force_law", "depth": np.array([0.0, 1.0]), "force": np.array([0.0, 5.0]), "damping": 2.0}
    found = _force_object(law, blobs)
    assert found == {"kind": "force_law", "depth": "depth.file", "force": "force.file", "damping": 2.0}
    assert [(key, values.tolist()) for key, values in written] == [("depth", [0.0, 1.0]), ("force", [0.0, 5.0])]
