"""Meshes: repairs, refusals with their sentences, and files in any unit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import palpate
import pytest
import trimesh
from palpate import Proxy, Surface
from palpate.contact import Mesh, MeshError
from palpate.contact.diagnosis import format_size
from touch_shapes import ball, box

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        (np.empty((0, 3)), TETRAHEDRON, "vertices must be"),
        (CORNERS, np.empty((0, 3), dtype=int), "triangles must be"),
        (CORNERS, TETRAHEDRON.astype(float), "whole numbers"),
        (CORNERS[:, :2], TETRAHEDRON, "vertices must be"),
        (np.where(CORNERS == 1, np.nan, CORNERS), TETRAHEDRON, "finite"),
        (CORNERS, TETRAHEDRON + 1, "indices are 0 to 3"),
        (CORNERS, TETRAHEDRON - 1, "indices are 0 to 3"),
        (CORNERS, [[0, 0, 1], [2, 2, 3]], "empty"),
        (CORNERS, TETRAHEDRON[:3], "open=True"),
        (np.vstack([CORNERS, [1, 1, 1]]), np.vstack([TETRAHEDRON, [[0, 1, 4]]]), "more than two"),
    ],
)
def test_what_cannot_be_touched_is_refused_in_a_sentence(vertices: object, triangles: object, words: str) -> None:
    with pytest.raises(MeshError, match=words):
        Mesh(vertices, triangles)


def test_what_can_be_mended_is_mended_and_told() -> None:
    vertices, triangles = ball(4)
    broken = triangles.copy()
    broken[::3] = broken[::3, ::-1]
    broken = np.vstack([broken, broken[5:6], [[1, 1, 2]]])
    mesh = Mesh(vertices, broken)
    found = mesh.diagnose()
    assert found.clean
    assert found.volume == pytest.approx(Mesh(vertices, triangles).diagnose().volume, rel=1e-12)
    assert len(found.repairs) == 3
    assert "flipped" in str(found)
    with pytest.raises(MeshError, match="without area"):
        Mesh(vertices, broken, repair=False)


def test_an_inside_out_mesh_is_turned_outward() -> None:
    vertices, triangles = ball(4)
    assert Mesh(vertices, triangles[:, ::-1]).diagnose().volume > 0.0


def test_diagnosis_tells_open_edges_parts_and_piercing() -> None:
    vertices, triangles = ball(4)
    sheet = Mesh(vertices, triangles[:-1], open=True).diagnose()
    assert (sheet.open_edges, sheet.closed, sheet.clean) == (3, False, False)
    both = Mesh(np.vstack([vertices, vertices + 0.3]), np.vstack([triangles, triangles + len(vertices)])).diagnose()
    assert both.components == 2
    assert both.self_intersections > 0
    assert Mesh(vertices, triangles).diagnose().self_intersections == 0


@pytest.mark.parametrize("kind", ["stl", "obj", "ply", "off", "glb"])
def test_files_are_read_in_the_stated_unit(kind: str, tmp_path: Path) -> None:
    """A box of 20 x 30 x 40 mm has its volume in m^3 and its eight corners, whatever the file repeats."""
    vertices, triangles = box((10.0, 15.0, 20.0), 1)
    path = tmp_path / f"box.{kind}"
    trimesh.Trimesh(vertices, triangles, process=False).export(path)
    mesh = palpate.Mesh.load(path, unit="mm")
    assert mesh.diagnose().volume == pytest.approx(24e-6, rel=1e-6)
    assert mesh.size == pytest.approx((0.02, 0.03, 0.04), rel=1e-6)
    assert "20 × 30 × 40 mm" in repr(mesh)
    assert "20 × 30 × 40 mm" in str(mesh.diagnose())
    assert "closed, 2.4e-05 m^3" in str(mesh.diagnose())
    assert len(mesh.vertices) == 8
    assert mesh.closed


def test_bad_files_are_refused_with_their_name(tmp_path: Path) -> None:
    with pytest.raises(MeshError, match="no such file"):
        Mesh.load(tmp_path / "none.stl", unit="mm")
    for name in ("bad.stl", "bad.obj", "bad.xyz"):
        (tmp_path / name).write_text("this is not a mesh\n")
        with pytest.raises(MeshError, match=name.replace(".", r"\.")):
            Mesh.load(tmp_path / name, unit="mm")
    (tmp_path / "not-finite.obj").write_text("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match=r"not-finite\.obj: vertices must be finite"):
        Mesh.load(tmp_path / "not-finite.obj", unit="mm")
    (tmp_path / "part.step").write_text("ISO-10303-21;\n")
    with pytest.raises(MeshError, match="STL, OBJ, PLY, OFF and GLB are read"):
        Mesh.load(tmp_path / "part.step", unit="mm")
    with pytest.raises(MeshError, match="a folder"):
        Mesh.load(tmp_path, unit="mm")
    path = tmp_path / "box.off"
    trimesh.Trimesh(*box((1.0, 1.0, 1.0), 1)).export(path)
    for unit in ("furlongs per fortnight", "N", ""):
        with pytest.raises(MeshError, match="unit"):
            Mesh.load(path, unit=unit)


def test_nearest_is_the_nearest_on_a_box() -> None:
    mesh = Mesh(*box((1.0, 1.0, 1.0), 3))
    at, _ = mesh.nearest([[0.1, 0.2, 3.0], [2.0, 2.0, 2.0], [0.0, 0.9, 0.0]])
    np.testing.assert_allclose(at, [[0.1, 0.2, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.0]], atol=1e-12)


@pytest.mark.parametrize("radius", [0.0, 2e-3])
def test_a_proxy_rides_on_a_mesh_that_moves(radius: float) -> None:
    """The top of a box moves up and aside under a stuck tip: the spring is longer by what it has moved."""
    mesh = Mesh(*box((0.05, 0.05, 0.05), 6))
    proxy = Proxy(mesh, Surface(stiffness=1000.0, static_friction=np.inf), radius=radius)
    proxy.step([1e-3, 2e-3, 0.08])
    tip = np.array([1e-3, 2e-3, 0.049 + radius])
    before = proxy.step(tip)
    top = np.flatnonzero(mesh.vertices[:, 2] > 0.049)
    mesh.move(mesh.vertices[top] + [0.5e-3, -1e-3, 2e-3], top)
    after = proxy.step(tip)
    np.testing.assert_allclose(after.force - before.force, 1000.0 * np.array([0.5e-3, -1e-3, 2e-3]), atol=1e-9)
    np.testing.assert_allclose(mesh.vertices[top, 2], 0.052)
    mesh.move(mesh.vertices - [0.0, 0.0, 0.1])
    assert not Proxy(mesh).step(tip).touching


def test_a_move_that_cannot_be_changes_nothing() -> None:
    mesh = Mesh(*box((0.05, 0.05, 0.05), 2))
    start = mesh.vertices
    a, b, c = mesh.triangles[3]
    for positions, vertices, words in (
        ([start[b]], [a], "no area"),
        ([[np.nan, 0, 0]], [a], "finite"),
        ([[0.0, 0, 0]], [999], "indices are"),
        ([[0.0, 0, 0]], [a, c], "as many"),
    ):
        with pytest.raises(MeshError, match=words):
            mesh.move(positions, vertices)
        np.testing.assert_array_equal(mesh.vertices, start)
        np.testing.assert_array_equal(mesh.nearest([start[a]])[0], [start[a]])


def test_parts_that_meet_in_a_point_are_told() -> None:
    vertices, triangles = box((1.0, 1.0, 1.0), 2)
    far = np.argmax(vertices.sum(axis=1))
    near = np.argmin(vertices.sum(axis=1))
    others = np.where(triangles == near, far, triangles + len(vertices))
    mesh = Mesh(np.concatenate([vertices, vertices + 2.0]), np.concatenate([triangles, others]))
    assert mesh.diagnose().pinched_vertices == 1
    assert not mesh.diagnose().clean
    assert "meet in a point" in str(mesh.diagnose())
    assert Mesh(vertices, triangles).diagnose().clean
    assert Mesh(*ball(5)).diagnose().pinched_vertices == 0
    sheet = Mesh([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.2]], [[0, 1, 2], [1, 3, 2]], open=True)
    assert sheet.diagnose().pinched_vertices == 0


@pytest.mark.parametrize("bad", [np.nan, np.inf, -1e155])
def test_a_point_without_a_distance_has_no_nearest_point(bad: float) -> None:
    mesh = Mesh([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[0, 1, 2]], open=True)
    with pytest.raises(MeshError, match="point 1 is not finite or too far"):
        mesh.nearest([[0.0, 0.0, 1.0], [0.0, bad, 0.0]])


@pytest.mark.parametrize(
    ("size", "shown"),
    [
        ((0.1, 0.02, 0.5), "100 × 20 × 500 mm"),
        ((0.999, 0.1, 0.1), "999 × 100 × 100 mm"),
        ((0.2, 1.5, 1.0), "0.2 × 1.5 × 1 m"),
    ],
)
def test_a_size_is_shown_in_mm_below_one_meter(size: tuple[float, float, float], shown: str) -> None:
    assert format_size(size) == shown
