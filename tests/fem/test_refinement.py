"""Graded meshes: conforming, deterministic, as fine as asked for, and with the forces of a uniform mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nightly import NIGHTLY
from palpate import Mesh, fem
from palpate.contact.simplices import adjacent_faces, boundary, half_edges, volumes
from palpate.fem import BodyError, Volume, builder
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.mesh_estimate import FineZone, estimate
from palpate.fem.mesh_improvement import min_angles
from palpate.fem.refinement import graded_size, refine
from palpate.fem.volume import fill_surface

trimesh = pytest.importorskip("trimesh")


def surface_of(shape: Any) -> ClosedSurface:
    return ClosedSurface(np.asarray(shape.vertices, dtype=float), np.asarray(shape.faces, dtype=np.int64))


BALL = trimesh.creation.icosphere(3, 0.04)
BOX = trimesh.creation.box((0.06, 0.05, 0.03))
TOP = np.array([[0.0, 0.0, 0.04]])


def longest_edges(volume: Volume) -> tuple[Any, Any]:
    """Return length and midpoint of the longest edge of each tetrahedron."""
    a, b = np.triu_indices(4, 1)
    ends = volume.points[volume.tetrahedra]
    length = np.linalg.norm(ends[:, a] - ends[:, b], axis=2)
    chosen = length.argmax(axis=1)
    rows = np.arange(len(ends))
    return length[rows, chosen], (ends[rows, a[chosen]] + ends[rows, b[chosen]]) / 2.0


@given(
    st.tuples(*[st.floats(-0.03, 0.03)] * 3),
    st.floats(1.5e-3, 6e-3),
    st.floats(0.1, 1.0),
)
@settings(max_examples=8)
def test_a_refined_mesh_is_conforming_and_keeps_its_volume(
    place: tuple[float, ...], spacing: float, growth: float
) -> None:
    """Each inner face has two tetrahedra: the divergence theorem over the boundary gives the volume."""
    surface = surface_of(BOX)
    start = fem.block((0.06, 0.05, 0.03), 0.01)
    middle = start.points - [0.03, 0.025, 0.015]
    size = graded_size(np.array([place]), spacing, growth, 0.02)
    points, cells = refine(surface, middle, start.tetrahedra, size, 1e6)
    assert (volumes(points, cells) > 0.0).all()
    assert volumes(points, cells).sum() == pytest.approx(BOX.volume, rel=1e-12)
    faces, one, _ = adjacent_faces(cells)
    assert len(np.unique(np.sort(faces, axis=1), axis=0)) == len(faces) - len(one)  # no face has three
    skin = boundary(cells)
    assert np.linalg.norm(surface.distance(points[np.unique(skin)])) < 1e-12
    assert Mesh(points, skin).closed
    corners = points[skin]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2.0
    assert area == pytest.approx(BOX.area, rel=1e-12)


@pytest.mark.parametrize("growth", [0.2, 0.6])
def test_edges_grow_with_the_distance_up_to_the_largest(growth: float) -> None:
    size = graded_size(TOP, 2.5e-3, growth, 9e-3)
    length, middle = longest_edges(fill_surface(surface_of(BALL), 9e-3, mesher="stuffing", source="ball", size=size))
    distance = np.linalg.norm(middle - TOP, axis=1)
    np.testing.assert_allclose(size(middle), np.minimum(2.5e-3 + growth * distance, 9e-3))
    assert (length < 1.7 * size(middle)).all()  # 1.13 before points move to the surface and to their means
    assert np.median(length / size(middle)) == pytest.approx(0.95, abs=0.2)
    far = distance > (9e-3 - 2.5e-3) / growth
    if far.any():
        assert np.median(length[far]) > 7e-3


def test_a_graded_ball_has_good_angles_on_its_surface_and_few_vertices() -> None:
    surface = surface_of(BALL)
    size = graded_size(TOP, 2e-3, 0.3, 9e-3)
    graded = fill_surface(surface, 9e-3, mesher="stuffing", source="ball", size=size)
    assert min_angles(graded.points, graded.tetrahedra).min() > 10.0
    assert surface.distance(graded.points[np.unique(graded.surface)]).max() < 1e-9
    edges = half_edges(graded.surface)
    near = np.linalg.norm(graded.points[edges].mean(axis=1) - TOP, axis=1) < 4e-3
    length = np.linalg.norm(graded.points[edges[:, 0]] - graded.points[edges[:, 1]], axis=1)
    assert 1e-3 < np.median(length[near]) < 2.2e-3
    assert len(graded.points) < 4000  # a ball with edges of 2 mm has about 60,000


def test_new_points_of_the_surface_lie_on_it_before_the_mesh_is_improved() -> None:
    """Cells that are far smaller than the coarse ones follow the ball, and not the chords of the coarse ones."""
    surface = surface_of(trimesh.creation.icosphere(5, 0.04))
    coarse = fill_surface(surface, 12e-3, mesher="stuffing", source="ball")
    points, cells = refine(surface, coarse.points, coarse.tetrahedra, graded_size(TOP, 0.8e-3, 0.4, 12e-3), 1e6)
    skin = points[np.unique(boundary(cells))]
    near = np.linalg.norm(skin - TOP, axis=1) < 5e-3
    assert near.sum() > 40
    assert np.quantile(surface.distance(skin[near]), 0.95) < 1e-9
    assert (min_angles(points, cells) > 5.0).all()


def test_the_numbers_of_the_surface_change_no_bit() -> None:
    rng = np.random.default_rng(2)
    order = rng.permutation(len(BALL.vertices))
    faces = np.argsort(order)[BALL.faces][rng.permutation(len(BALL.faces))]
    size = graded_size(TOP, 3e-3, 0.5, 9e-3)
    one, two = (
        fill_surface(ClosedSurface(points, triangles), 9e-3, mesher="stuffing", source="ball", size=size)
        for points, triangles in ((BALL.vertices, BALL.faces), (BALL.vertices[order], faces))
    )
    assert one.points.tobytes() == two.points.tobytes()
    assert one.tetrahedra.tobytes() == two.tetrahedra.tobytes()


@pytest.fixture
def cylinder(tmp_path: Path) -> Path:
    shape = trimesh.creation.cylinder(0.03, 0.02, sections=48)
    shape.apply_translation([0.0, 0.0, -0.01])
    shape.export(tmp_path / "cylinder.stl")
    return tmp_path / "cylinder.stl"


def built(file: Path, **options: Any) -> fem.Body:
    usual = {"touch": "sphere 0 0 0 radius 10 mm", "spacing": "4 mm", "fixed": "z <= -20 mm"}
    return fem.build(file, unit="m", young=10e3, poisson=0.45, **{**usual, **options})


def test_a_graded_body_has_the_force_of_a_uniform_one(cylinder: Path) -> None:
    uniform, graded = built(cylinder), built(cylinder, growth=0.3)
    assert len(graded.contents.vertices) < 0.65 * len(uniform.contents.vertices)
    for depth in (1.2e-3, 2e-3):
        one, two = (body.signed_distance().indent([0, 0, 0], 8e-3, depth).force[2] for body in (uniform, graded))
        assert two == pytest.approx(one, rel=0.02)
    assert graded.record["growth"] == 0.3


def test_a_tip_and_a_touched_region_grade_the_mesh_by_default(cylinder: Path) -> None:
    by_default = built(cylinder, spacing=None, tip_radius="8 mm")
    same = built(cylinder, spacing=fem.spacing_for("8 mm"), growth=0.3)
    assert by_default.contents.compliance.tobytes() == same.contents.compliance.tobytes()
    assert built(cylinder).record["growth"] == 0.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"growth": 0.3, "touch": None}, "growth: edges grow from the touched region: give it"),
        ({"growth": 0.3, "mesher": "ftetwild"}, "growth: ftetwild has one spacing"),
        ({"growth": -0.3}, "growth: -0.3"),
        ({"growth": 0.3, "touch": "z > 5 mm"}, 'touch: no place of the surface lies in "z > 5 mm"'),
    ],
)
def test_what_cannot_be_graded_is_refused(cylinder: Path, options: dict[str, Any], words: str) -> None:
    with pytest.raises(BodyError, match=words):
        built(cylinder, **options)


def test_a_body_too_thin_for_the_coarse_part_is_refused_with_the_remedy(tmp_path: Path) -> None:
    """A dumbbell whose thin handle lies far from the touched region."""
    z = np.linspace(0.0, 0.1, 61)
    ball = np.sqrt(np.maximum(0.02**2 - (np.minimum(z, 0.1 - z) - 0.02) ** 2, 0.0)) * (np.minimum(z, 0.1 - z) < 0.04)
    profile = np.stack([np.where((z > 0.03) & (z < 0.07), np.maximum(ball, 2e-3), ball), z], axis=1)
    trimesh.creation.revolve(profile, sections=32).export(tmp_path / "dumbbell.stl")
    options = {"spacing": "2.5 mm", "fixed": "z < 50 mm", "touch": "z > 97 mm", "order": 1}
    with pytest.raises(BodyError, match="growth=0 has the small spacing everywhere"):
        built(tmp_path / "dumbbell.stl", **options, growth=0.5)
    assert len(built(tmp_path / "dumbbell.stl", **options).nodes) > 10


def test_a_mesh_that_would_be_too_large_is_refused() -> None:
    start = fem.block((0.06, 0.05, 0.03), 0.01)
    with pytest.raises(BodyError, match="growth: the graded mesh has more than 1e\\+04 tetrahedra"):
        refine(surface_of(BOX), start.points, start.tetrahedra, graded_size(TOP, 1e-3, 0.0, 1e-3), 1e4)


@pytest.mark.parametrize("growth", [0.1, 0.3, 1.0] if NIGHTLY else [0.3])
def test_the_size_of_a_graded_body_is_estimated(tmp_path: Path, growth: float) -> None:
    """Nodes and contact nodes within a factor of two, from the area of the touched region alone."""
    BALL.export(tmp_path / "ball.stl")
    body = built(tmp_path / "ball.stl", fixed="z < -30 mm", touch="z > 36 mm", spacing="3 mm", growth=growth, order=1)
    surface = surface_of(BALL)
    area = 2.0 * np.pi * 0.04 * 0.004  # of a cap of 4 mm
    coarse = surface.extent / 15.0
    guess = estimate(surface, coarse, 1, FineZone(area, 3e-3, growth, coarse))
    assert 0.5 < guess.contact_nodes / len(body.nodes) < 2.0
    assert 0.5 < guess.nodes / body.record["nodes"] < 2.0


def test_a_graded_body_beyond_the_memory_is_refused_before_it_is_meshed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def meshed(*_: Any, **__: Any) -> None:
        raise AssertionError("meshed")

    monkeypatch.setattr(builder, "fill_surface", meshed)
    BALL.export(tmp_path / "ball.stl")
    with pytest.raises(BodyError, match=r"memory: a spacing of 0\.02 mm at the touched region gives about"):
        built(tmp_path / "ball.stl", fixed="z < -30 mm", touch="z > 38 mm", spacing="0.02 mm", growth=0.3)
