"""Groups of normals, faces near a path, bounds of stiffness and samples in contact, each against a direct search."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate.contact import Mesh, Surface
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.contact_law import ContactLaw
from palpate.simulation.meshes import box_mesh
from palpate.simulation.trace import Trace
from palpate.stability.mesh_contact import mesh_contact
from palpate.stability.mesh_modes import face_modes, sliding_mode
from palpate.stability.mesh_sites import (
    GROUPS,
    KEPT,
    NEAR,
    NORMAL_RESOLUTION,
    SLIDES,
    TouchedSurface,
    contact_rows,
    face_stiffness,
    faces_near,
    group_normals,
)

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def cube(divisions: int) -> Mesh:
    return Mesh(*box_mesh(0.04, divisions))


def test_every_normal_is_near_that_of_its_group_and_every_stiffness_within_its_bounds() -> None:
    rng = np.random.default_rng(0)
    for spread, count in ((0.02, 40), (0.3, 60), (1.5, 80)):
        normals = np.array([0.0, 0.0, 1.0]) + spread * rng.normal(size=(count, 3))
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        low = rng.uniform(100.0, 200.0, count)
        stiffness = np.stack([low, low + rng.uniform(0.0, 50.0, count)], axis=1)
        groups, widest = group_normals(normals, stiffness)
        assert len(groups) <= GROUPS
        angles = np.arccos(np.clip(normals @ np.array([normal for normal, _, _ in groups]).T, -1.0, 1.0))
        assert angles.min(axis=1).max() <= widest + 1e-9
        if spread == 0.02:
            assert widest <= NORMAL_RESOLUTION
        for k in range(count):
            assert any(
                angles[k, i] <= widest + 1e-9 and least <= stiffness[k, 0] and largest >= stiffness[k, 1]
                for i, (_, least, largest) in enumerate(groups)
            )
        assert min(least for _, least, _ in groups) == stiffness[:, 0].min()
        assert max(largest for _, _, largest in groups) == stiffness[:, 1].max()


def test_normals_within_the_resolution_are_one_group_and_others_are_not() -> None:
    angles = np.array([0.0, 0.9 * NORMAL_RESOLUTION, 1.1 * NORMAL_RESOLUTION])
    normals = np.stack([np.sin(angles), 0 * angles, np.cos(angles)], axis=1)
    groups, widest = group_normals(normals, np.array([[1.0, 2.0], [3.0, 9.0], [5.0, 6.0]]))
    assert [(low, high) for _, low, high in groups] == [(1.0, 9.0), (5.0, 6.0)]
    assert widest == pytest.approx(angles[1])


@pytest.mark.parametrize("field", ["discrete", "continuous"])
@pytest.mark.parametrize("where", ["one", "face", "vertex"])
def test_the_stiffness_felt_on_a_face_lies_between_its_bounds(field: str, where: str) -> None:
    """Bounds of a value per face spread over vertices are those of the faces around the corners."""
    mesh, rng = cube(3), np.random.default_rng(1)
    count = {"one": 1, "face": len(mesh.triangles), "vertex": len(mesh.vertices)}[where]
    values = rng.uniform(100.0, 900.0, count)
    bounds = face_stiffness(Surface(stiffness=values, field=field), mesh)
    assert bounds.shape == (len(mesh.triangles), 2)
    for face, corners in enumerate(mesh.triangles):
        if where == "one":
            expected = values
        elif where == "vertex":
            expected = values[corners]
        elif field == "discrete":
            expected = values[face : face + 1]
        else:
            expected = values[np.isin(mesh.triangles, corners).any(axis=1)]
        assert tuple(bounds[face]) == (expected.min(), expected.max())


def test_the_faces_near_a_path_touch_a_visited_one_and_lie_within_two_millimetres() -> None:
    """Against points strewn over each face."""
    mesh = cube(24)  # cells of 1.7 mm
    corners = mesh.vertices[mesh.triangles]
    path = np.linspace([-0.004, 0.0003, 0.0], [0.005, 0.0011, 0.0], 40)
    away = np.linalg.norm(corners.mean(axis=1)[:, None] - path[None], axis=2)
    visited = np.unique(away.argmin(axis=0))
    found = faces_near(mesh, visited, path)
    assert set(visited) < set(found.tolist())
    shares = np.isin(mesh.triangles, mesh.triangles[visited]).any(axis=1)
    assert not np.any(np.isin(np.flatnonzero(~shares), found))
    weights = np.random.default_rng(2).dirichlet([0.7, 0.7, 0.7], 200)
    for face in np.setdiff1d(np.flatnonzero(shares), visited):
        distance = np.linalg.norm((weights @ corners[face])[:, None] - path, axis=2).min()
        if not NEAR - 1e-4 < distance < NEAR + 3e-4:
            assert (face in found) == (distance < NEAR)
    small = faces_near(mesh, visited[:1], path[:1])
    assert 1 < len(small) <= 1 + 12  # a corner of a cube of squares has six faces around it


def path_trace(depth: np.ndarray, step: float = 2.0**-13) -> Trace:
    """A proxy that moves along x by `step` a sample; it touches where the depth is positive."""
    n = len(depth)
    proxy = np.column_stack([step * np.arange(n), np.zeros(n), np.zeros(n)])
    channels = {"touching": (depth > 0.0)[:, None] * 1.0, "depth": depth[:, None], "proxy": proxy}
    return Trace.of(1e-3 * np.arange(n), channels)


def test_samples_in_contact_are_spread_over_the_path_and_end_with_the_last() -> None:
    depth = np.r_[np.zeros(50), np.full(401, 1e-3), np.zeros(30)]
    assert contact_rows(path_trace(depth), 5, 480) == [50, 150, 250, 350, 450]
    assert contact_rows(path_trace(depth), 5, 250) == [50, 100, 150, 200, 250]
    assert contact_rows(path_trace(depth), 1, 480) == [50, 450]
    slow = path_trace(depth)
    slow["proxy"][:250] = slow["proxy"][250]  # still at first: time does not count, the path does
    assert [row for row in contact_rows(slow, 5, 480) if row >= 250] == [300, 350, 400, 450]


def test_a_first_graze_is_no_sample_and_a_run_without_contact_is_refused() -> None:
    depth = np.r_[np.zeros(20), np.full(10, 1e-5), np.full(100, 1e-3)]
    assert min(contact_rows(path_trace(depth), 4, 129)) == 30
    assert min(contact_rows(path_trace(depth), 4, 25)) == 20
    with pytest.raises(StabilityError, match="never touches the mesh"):
        contact_rows(path_trace(np.zeros(40)), 4, 39)
    with pytest.raises(StabilityError, match="never touches the mesh"):
        contact_rows(path_trace(depth), 4, 19)


PIT = np.array([[0.02, 0.02, 0], [-0.02, 0.02, 0], [-0.02, -0.02, 0], [0.02, -0.02, 0], [0, 0, -0.015]])
PIT_FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])


def touched(tmp_path: Path, mesh: dict[str, Any] | None = None, **surface: Any) -> TouchedSurface:
    """The surface of a pit of four faces, or of another mesh, in an impedance display at 1 kHz."""
    trimesh = pytest.importorskip("trimesh")
    file = tmp_path / "pit.obj"
    trimesh.Trimesh(PIT, PIT_FACES, process=False).export(file)
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m"},
        "object": {
            "kind": "mesh",
            "mesh": mesh or {"file": str(file), "unit": "m", "open": True},
            "surface": {"stiffness": "400 N/m", **surface},
        },
        "run": {"duration": "0.1 s"},
    }
    return TouchedSurface(Scenario.from_dict(tables))


def test_a_point_of_the_surface_has_the_numbers_of_the_scenario(tmp_path: Path) -> None:
    n = np.array([0.0, 0.6, 0.8])
    plain = touched(tmp_path).point(n, 400.0, 2.0)
    assert (plain.stiffness, plain.tangential, plain.friction, plain.drag, plain.damping) == (
        400.0,
        400.0,
        0.0,
        0.0,
        2.0,
    )
    assert plain.period == 1e-3
    rough = touched(tmp_path, tangential="250 N/m", static_friction=0.5, dynamic_friction=0.3, viscous="2 N*s/m")
    for static, friction in ((True, 0.5), (False, 0.3)):
        point = rough.point(n, 600.0, 1.0, static=static)
        assert (point.stiffness, point.tangential, point.friction) == (600.0, 250.0, friction)
        assert point.drag == pytest.approx(2.0 / (1e-3 * 250.0))
    assert touched(tmp_path, static_friction=0.5).point(n, 400.0, 0.0, static=False).friction == 0.5
    assert not plain.rubs


def test_a_normalized_controller_sees_the_design_stiffness_along_the_normal_and_the_same_friction(
    tmp_path: Path,
) -> None:
    surface = touched(tmp_path, static_friction=0.5)
    surface.controller = surface.controller.normalized((100.0, 300.0, 800.0))
    for n, design in (([1.0, 0.0, 0.0], 100.0), ([0.0, 0.6, 0.8], 0.36 * 300.0 + 0.64 * 800.0)):
        point = surface.point(np.array(n), 400.0, 2.0)
        assert point.stiffness == pytest.approx(design)
        assert point.damping / 2.0 == pytest.approx(design / 400.0)
        assert point.friction * point.stiffness == pytest.approx(0.5 * 400.0)
        assert point.tangential == 400.0
    assert surface.point(np.array([1.0, 0.0, 0.0]), 0.0, 2.0).damping == 2.0


def test_a_proxy_sticks_with_the_static_and_slides_with_the_dynamic_friction(tmp_path: Path) -> None:
    surface = touched(tmp_path, static_friction=0.5, dynamic_friction=0.2)
    point = surface.point(np.array([0.0, 0.0, 1.0]), 400.0, 1.0)
    slow = face_modes(surface.point(point.normal, 400.0, 1.0, static=False))
    modes = surface._face(point)
    assert [mode.kind for mode in modes].count("sticking") == 1
    slides = [mode for mode in modes if mode.kind == "sliding"]
    expected = [mode for mode in slow if mode.kind == "sliding"]
    assert len(slides) == len(expected) > 0
    for one, other in zip(slides, expected, strict=True):
        np.testing.assert_array_equal(one.law.D, other.law.D)
    alike = touched(tmp_path, static_friction=0.5)
    assert [mode.name for mode in alike._face(point)] == [mode.name for mode in face_modes(point)]


def test_valleys_are_where_neighbors_rise_and_nowhere_else(tmp_path: Path) -> None:
    """A pit has four valley edges, in two pairs of directions, and a corner that holds; a box and a ridge have none."""
    pit = touched(tmp_path)
    modes = pit._valleys(np.arange(4), 0.0)
    kinds = [mode.kind for mode in modes]
    assert kinds.count("vertex") == 1
    edges = np.array([PIT[4] - PIT[k] for k in range(4)]) / np.linalg.norm(PIT[4])
    for mode in modes:
        if mode.kind != "edge":
            continue
        stiff = np.linalg.eigh(mode.law.D)[1]
        free = stiff[:, 0]  # along the valley nothing holds the tip
        assert np.abs(edges @ free).max() / np.linalg.norm(edges[0]) == pytest.approx(1.0, abs=1e-9)
        assert np.linalg.eigvalsh(mode.law.D)[1:] == pytest.approx([400.0, 400.0], rel=0.02)
    lines = {int(np.argmax(np.abs(edges @ np.linalg.eigh(one.law.D)[1][:, 0]))) for one in modes if one.kind == "edge"}
    assert len(lines) == 4
    assert pit._valleys(np.array([0, 2]), 1.0) == []  # they share a corner only
    two = pit._valleys(np.array([0, 1]), 1.0)
    assert {mode.kind for mode in two} == {"edge"}
    box = {"shape": "box", "edge": "40 mm", "divisions": 2}
    cube_surface = touched(tmp_path, box)
    assert cube_surface._valleys(np.arange(len(cube_surface.mesh.triangles)), 1.0) == []
    assert touched(tmp_path, shading="30 deg")._valleys(np.arange(4), 1.0) == []
    assert touched(tmp_path, {**pit_mesh(tmp_path), "radius": "3 mm"})._valleys(np.arange(4), 1.0) == []


def test_a_site_has_the_modes_of_the_valleys_among_its_faces(tmp_path: Path) -> None:
    pit = touched(tmp_path)
    normal, place = pit.normals[0], PIT[PIT_FACES[0]].mean(axis=0)
    channels = {
        "angle": np.array([[0.0, 2.2305, 3.2776]]), "command_force": np.zeros((1, 3)),
        "operator_force": np.zeros((1, 3)), "proxy": place[None], "triangle": np.array([[0]]),
        "normal": normal[None], "depth": np.array([[3e-4]]), "surface_stiffness": np.array([[400.0]]),
    }  # fmt: skip
    site = pit.site(Trace.of(np.zeros(1), channels), 0, np.arange(4))
    named = [mode.name for mode in site.modes if mode.kind in ("edge", "vertex")]
    assert named == [mode.name for mode in pit._valleys(np.arange(4), 0.0)]


def pit_mesh(tmp_path: Path) -> dict[str, Any]:
    return {"file": str(tmp_path / "pit.obj"), "unit": "m", "open": True}


def test_a_surface_is_curved_by_shading_a_field_or_a_sphere_alone(tmp_path: Path) -> None:
    assert not touched(tmp_path).curved
    assert touched(tmp_path, shading="30 deg").curved
    assert touched(tmp_path, {**pit_mesh(tmp_path), "radius": "3 mm"}).curved
    box = {"shape": "box", "edge": "40 mm", "divisions": 2}
    pattern = {"stiffness": ["100 N/m", "200 N/m"], "pattern": "checkerboard", "width": "4 mm"}
    assert touched(tmp_path, box, **pattern, field="continuous").curved
    assert not touched(tmp_path, box, **pattern).curved
    normals = touched(tmp_path).normals
    assert np.linalg.norm(normals, axis=1) == pytest.approx(np.ones(4))
    assert np.all(normals[:, 2] > 0.0)


@pytest.mark.parametrize("design", [None, (100.0, 300.0, 800.0)])
def test_slips_measured_on_a_flat_part_of_a_shaded_surface_are_those_of_a_face(
    design: tuple[float, float, float] | None, tmp_path: Path
) -> None:
    """Also where a normalized controller scales the normal force: the cone of friction is that of the surface."""
    box = {"shape": "box", "edge": "40 mm", "divisions": 1}
    surface = touched(tmp_path, box, shading="30 deg", static_friction=0.5, dynamic_friction=0.3)
    if design is not None:
        surface.controller = surface.controller.normalized(design)
    normal = np.array([0.0, 0.0, 1.0])
    face = int(np.argmax(surface.normals @ normal))
    place, depth = surface.mesh.vertices[surface.mesh.triangles[face]].mean(axis=0), 3e-4
    channels = {
        "proxy": place[None], "triangle": np.array([[face]]), "normal": normal[None], "depth": np.array([[depth]]),
        "surface_stiffness": np.array([[400.0]]),
    }  # fmt: skip
    rest, slips = surface._measured(Trace.of(np.zeros(1), channels), 0, 0.0)
    point = surface.point(normal, 400.0, 0.0, static=False)
    assert rest is not None
    assert pytest.approx(np.diag([400.0, 400.0, 400.0 if design is None else 800.0]), abs=1e-3) == rest.law.D
    assert len(slips) == SLIDES
    for k, slip in enumerate(slips):
        angle = 2.0 * np.pi * k / SLIDES
        s = np.array([np.cos(angle), np.sin(angle)]) @ point.tangents()
        exact = sliding_mode(point, s, KEPT)
        for z in (1.01, np.exp(0.3j), -1.0):
            assert response(slip.law, z) == pytest.approx(response(exact.law, z), abs=0.2)


def response(law: ContactLaw, z: complex) -> np.ndarray:
    return law.D + law.C @ np.linalg.solve(z * np.eye(len(law.A)) - law.A, law.B)


def test_a_mesh_of_one_triangle_is_a_site_with_its_face(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    corners = np.array([[-0.05, -0.04, 0.0], [0.05, -0.04, 0.0], [0.0, 0.06, 0.0]])
    trimesh.Trimesh(corners, [[0, 1, 2]], process=False).export(tmp_path / "one.obj")
    mesh = {"file": str(tmp_path / "one.obj"), "unit": "m", "open": True}
    tables = touched(tmp_path, mesh).scenario.to_dict()
    tables["operator"]["force"] = ["0 N", "0 N", "-1 N"]
    for site in mesh_contact(Scenario.from_dict(tables)).sites:
        assert [point.stiffness for point in site.points] == [400.0]


def test_a_tip_that_is_kept_still_has_no_contact_that_oscillates() -> None:
    tables = tomllib.loads((SCENARIOS / "slide-cube-by-forces.toml").read_text("utf-8"))
    del tables["reference"], tables["controller"]
    tables["operator"], tables["servo"]["topology"] = {"kind": "fixed"}, "impedance_display"
    says = r'^operator\.kind: "fixed" keeps the tip still, so nothing can oscillate; give another operator$'
    with pytest.raises(StabilityError, match=says):
        mesh_contact(Scenario.from_dict(tables))
