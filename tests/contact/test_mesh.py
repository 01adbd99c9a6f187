"""Meshes: repairs, refusals with their sentences, and files in any unit."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import palpate
import pytest
import trimesh
from palpate import Proxy, Surface
from palpate.contact import Mesh, MeshError
from palpate.contact.diagnosis import Diagnosis, format_size
from palpate.contact.mesh import weld
from touch_shapes import ball, box

TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])


@pytest.mark.parametrize(
    ("vertices", "triangles", "words"),
    [
        (np.empty((0, 3)), TETRAHEDRON, "vertices must be"),
        ("organ.stl", TETRAHEDRON, r"vertices must be \(n, 3\) numbers in m, not str"),
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
    for face, text in (
        ("1 2 9", r"line 5: a face names vertex 9; the 3 vertices before it count from 1"),
        ("0 1 2", r"line 5: a face names vertex 0; the 3 vertices before it count from 1"),
        ("1/1 2/0 x/1", r'line 5: "x/1" is not the number of a vertex'),
    ):
        (tmp_path / "face.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3 # 0 is not a vertex\nf {face}\n")
        with pytest.raises(MeshError, match=text):
            Mesh.load(tmp_path / "face.obj", unit="mm")
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


def test_close_vertices_become_the_first_of_them_in_the_order_of_their_use() -> None:
    """Chains become one; the distance is a millionth of the extent."""
    points = np.array([
        [0.0, 0.0, 0.0], [9.0, 0.0, 0.0], [0.0, 12.0, 0.0],  # an extent of 15
        [0.0, 0.0, 14e-6], [0.0, 0.0, 28e-6], [9.0, 16e-6, 0.0], [9.0, 0.0, 0.0], [0.0, 12.0, 14.9e-6],
    ])  # fmt: skip
    faces = np.array([[4, 6, 7], [0, 5, 2], [3, 1, 2]])
    merged, found = weld(points, faces)
    np.testing.assert_array_equal(merged, points[[0, 1, 2, 5]])
    np.testing.assert_array_equal(found, [[0, 1, 2], [0, 3, 2], [0, 1, 2]])
    far, same = weld(points, faces, 0.0)
    np.testing.assert_array_equal(far, points[[0, 1, 2, 3, 4, 5, 7]])
    np.testing.assert_array_equal(same, [[4, 1, 6], [0, 5, 2], [3, 1, 2]])
    for scale in (1e-3, 1e3):
        np.testing.assert_array_equal(weld(scale * points, faces)[1], found)
    order = np.random.default_rng(0).permutation(len(points))
    shuffled = np.empty_like(points)
    shuffled[order] = points
    again, mixed = weld(shuffled, order[faces])
    assert len(again) == 4
    apart = np.linalg.norm(again[mixed] - merged[found], axis=-1)
    assert apart.max() <= 30e-6


def test_the_arrays_of_a_mesh_cannot_be_written() -> None:
    mesh = Mesh(CORNERS, TETRAHEDRON)
    for _ in range(2):
        for array in (mesh.vertices, mesh.triangles):
            with pytest.raises(ValueError, match="read-only"):
                array[0, 0] = 1
        mesh.move([[2.0, 0.0, 0.0]], [1])
        np.testing.assert_array_equal(mesh.vertices[1], [2.0, 0.0, 0.0])
    mesh.move([[1.0, 0.0, 0.0]], 1)
    np.testing.assert_array_equal(mesh.vertices, CORNERS)
    for vertices, says in (([4], "vertex indices are 0 to 3; given are 4 to 4"), ([-1], "given are -1 to -1")):
        with pytest.raises(MeshError, match=says):
            mesh.move([[0.0, 0.0, 0.0]], vertices)
    mesh.move([[0.0, 0.0, 3.0]], [3])
    assert mesh.vertices[3, 2] == 3.0
    with pytest.raises(MeshError, match=r"^triangle 0 would have no area there; nothing was moved$"):
        mesh.move([[0.0, 0.0, 0.0]], [2])


def test_the_first_triangle_and_the_first_point_count_as_others() -> None:
    """Their number is zero, and they are touched, found and refused like the others."""
    mesh = Mesh(CORNERS, TETRAHEDRON)
    below = np.array([[0.2, 0.2, -1.0], [0.3, 0.1, -2.0], [-1.0, 0.2, 0.2]])
    at, faces = mesh.nearest(below)
    np.testing.assert_allclose(at, [[0.2, 0.2, 0.0], [0.3, 0.1, 0.0], [0.0, 0.2, 0.2]], atol=1e-12)
    np.testing.assert_array_equal(faces, [0, 0, 3])
    contacts = Proxy(mesh).simulate_path([[0.2, 0.2, -0.1], [0.2, 0.2, 0.1], [0.2, 0.2, -0.1]])
    assert contacts.triangle.tolist() == [-1, 0, -1]
    assert contacts.touching.tolist() == [False, True, False]
    assert contacts[1].touching
    assert contacts[1].depth == pytest.approx(0.1)
    assert len(contacts) == 3


def test_a_diagnosis_names_each_defect_that_there_is() -> None:
    none = dict.fromkeys(
        ("open_edges", "non_manifold_edges", "mixed_winding_edges", "degenerate", "duplicate", "self_intersections"), 0
    )
    size = (1.0, 0.5, 0.25)
    clean = Diagnosis(12, 8, 1, size, 0.125, **none)
    assert str(clean) == "12 triangles, 8 vertices, 1 part\n1 × 0.5 × 0.25 m along x, y and z\nclosed, 0.125 m^3"
    assert (clean.closed, clean.clean) == (True, True)
    names = {
        "open_edges": "open edges (a border)",
        "non_manifold_edges": "edges with more than two triangles",
        "mixed_winding_edges": "edges between triangles of opposite orientation",
        "degenerate": "triangles without area",
        "duplicate": "repeated triangles",
        "self_intersections": "edges that intersect a triangle",
        "pinched_vertices": "vertices at which parts meet in a point only",
    }
    for key, name in names.items():
        found = Diagnosis(**{**vars(clean), key: 1, "components": 2, "repairs": ("it",)})
        end = "" if key == "open_edges" else "closed, 0.125 m^3\n"
        assert str(found) == (
            f"12 triangles, 8 vertices, 2 parts\n1 × 0.5 × 0.25 m along x, y and z\n1 {name}\n{end}repaired: it"
        )
        assert found.closed is (key != "open_edges")
        assert not found.clean
    unknown = Diagnosis(**{**vars(clean), "self_intersections": -1})
    assert not unknown.clean
    assert "intersect" not in str(unknown)


@pytest.mark.parametrize(
    ("kind", "text"), [("obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), ("off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n")]
)
def test_a_file_without_triangles_is_refused(kind: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / f"none.{kind}"
    path.write_text(text)
    with pytest.raises(MeshError) as caught:
        Mesh.load(path, unit="mm")
    told = str(caught.value)
    assert told.startswith(f"{path}: ")
    assert "the file has no triangles that can be read" in told or "not a readable" in told


def test_a_broken_file_is_refused_without_a_word_of_its_reader(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a logger without handlers Python prints warnings to the terminal."""
    monkeypatch.setattr(logging.getLogger("trimesh"), "handlers", [])
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    (tmp_path / "a.stl").write_bytes(b"solid" + b"\0" * 79)
    with pytest.raises(MeshError, match=r"a\.stl: "):
        Mesh.load(tmp_path / "a.stl", unit="mm")
    assert logging.getLogger("trimesh").handlers
    assert capfd.readouterr() == ("", "")


def test_the_parts_of_a_repair_are_counted_in_words() -> None:
    twice = np.vstack([TETRAHEDRON, TETRAHEDRON[:1], [[1, 1, 2]]])
    assert Mesh(CORNERS, twice).diagnose().repairs == (
        "1 triangle without area dropped",
        "1 triangle repeated and dropped",
    )
    turned = TETRAHEDRON.copy()
    turned[:2] = turned[:2, ::-1]
    (repair,) = Mesh(CORNERS, turned).diagnose().repairs
    assert repair == "2 triangles flipped"
    for broken, says in (
        (
            np.vstack([TETRAHEDRON, [[1, 1, 2]]]),
            "without area (1, the first is triangle 4): drop them, or use repair=True",
        ),
        (np.vstack([TETRAHEDRON, TETRAHEDRON[1:2]]), "that repeat another one (1, the first is triangle"),
        (TETRAHEDRON[1:], "at a border ("),
        (turned, "oriented opposite to a neighbor ("),
    ):
        with pytest.raises(MeshError) as caught:
            Mesh(CORNERS, broken, repair=False)
        assert f"the mesh has triangles {says}" in str(caught.value)
    assert Mesh(CORNERS, TETRAHEDRON[1:], open=True).open is True
    assert Mesh(CORNERS, TETRAHEDRON[1:], open=True).closed is False
    assert repr(Mesh(CORNERS, TETRAHEDRON[1:], open=True)) == "<Mesh: 3 triangles, 1 × 1 × 1 m, open>"
    assert repr(Mesh(CORNERS, TETRAHEDRON)) == "<Mesh: 4 triangles, 1 × 1 × 1 m>"
    assert Mesh(CORNERS, TETRAHEDRON).extent == pytest.approx(np.sqrt(3.0))
