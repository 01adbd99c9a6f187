"""Contact by signed distance measures its depth from the curved surface between the nodes, as it presses it."""

from __future__ import annotations

import itertools
import warnings
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from palpate import fem
from palpate.contact.mesh import Mesh
from palpate.contact.pseudonormals import Pseudonormals
from palpate.fem.contact_accuracy import fits_closely, node_distance
from palpate.fem.curved_surface import CurvedSurface

trimesh = pytest.importorskip("trimesh")


def _points_on(triangles: np.ndarray, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return random faces (n,) and points (n, 3) on triangles with corners (k, 3, 3)."""
    faces = rng.integers(len(triangles), size=count)
    return faces, np.einsum("nc,ncd->nd", rng.dirichlet(np.ones(3), size=count), triangles[faces])


def test_the_curved_surface_of_a_ball_lies_seven_times_nearer_to_it_than_its_facets() -> None:
    ball, rng = trimesh.creation.icosphere(2, radius=1.0), np.random.default_rng(1)
    curved = CurvedSurface(ball.vertices, ball.faces, Pseudonormals(ball.vertices, ball.faces))
    faces, points = _points_on(ball.triangles, rng, 300)
    found = [curved.at(point, int(face)) for point, face in zip(points, faces, strict=True)]
    radii = np.linalg.norm([point for point, _ in found], axis=1)
    sag = 1.0 - np.linalg.norm(points, axis=1)
    assert sag.max() > 0.015
    assert np.abs(radii - 1.0).max() < sag.max() / 7.0
    cosines = [normal @ point / np.linalg.norm(point) for point, normal in found]
    assert min(cosines) > np.cos(np.deg2rad(2.0))
    assert [np.linalg.norm(normal) for _, normal in found] == pytest.approx([1.0] * 300)


def test_the_curvature_of_balls_and_hollows_is_that_of_their_radius() -> None:
    ball = trimesh.creation.icosphere(2, radius=0.05)
    for faces, sign in ((ball.faces, 1.0), (ball.faces[:, ::-1], -1.0)):
        curved = CurvedSurface(ball.vertices, faces, Pseudonormals(ball.vertices, faces))
        found = [np.mean(curved.curvatures(face)) for face in range(len(faces))]
        assert found == pytest.approx([sign / 0.05] * len(faces), rel=0.15)
        assert np.mean(found) == pytest.approx(sign / 0.05, rel=0.03)


def test_flat_faces_and_sharp_edges_stay_where_they_are() -> None:
    box, rng = trimesh.creation.box((1.0, 2.0, 3.0)).subdivide().subdivide(), np.random.default_rng(2)
    curved = CurvedSurface(box.vertices, box.faces, Pseudonormals(box.vertices, box.faces))
    faces, points = _points_on(box.triangles, rng, 300)
    for point, face in zip(points, faces, strict=True):
        place, normal = curved.at(point, int(face))
        assert place == pytest.approx(point, abs=1e-12)
        assert normal == pytest.approx(box.face_normals[face], abs=1e-9)
        assert curved.curvatures(int(face)) == pytest.approx(0.0, abs=1e-9)


@pytest.fixture(scope="module")
def ball() -> fem.Body:
    """Return a ball of 10 mm, bonded at its lower third, with cells of 4 mm."""
    surface = trimesh.creation.icosphere(5, radius=10e-3)
    mesh = Mesh(surface.vertices, surface.faces)
    return fem.build(mesh, young="10 kPa", poisson=0.45, fixed="z < -3 mm", spacing="4 mm").signed_distance()


@pytest.mark.parametrize("fineness", [0, 1, 2, 3])
def test_the_curvature_of_a_ball_is_that_of_its_radius_also_where_its_triangles_are_flat(fineness: int) -> None:
    """Those of an icosahedron deviate by 37 degrees from the normals of its corners."""
    curved = curved_surface(trimesh.creation.icosphere(fineness, radius=10e-3))
    each = np.array([curved.curvatures(face) for face in range(20 * 4**fineness)])
    assert each == pytest.approx(100.0, rel=0.25)


def test_a_saddle_has_curvature_but_none_in_the_mean() -> None:
    x, y = (part.ravel() for part in np.meshgrid(*[np.linspace(-10e-3, 10e-3, 21)] * 2, indexing="ij"))
    points = np.column_stack([x, y, 20.0 * (x * x - y * y)])
    cells = np.arange(400) + np.arange(400) // 20
    triangles = np.concatenate(
        [np.stack([cells, cells + 21, cells + 22], 1), np.stack([cells, cells + 22, cells + 1], 1)]
    )
    middle = int(np.argmin(np.linalg.norm(points[triangles].mean(axis=1), axis=1)))
    found = CurvedSurface(points, triangles, Pseudonormals(points, triangles)).curvatures(middle)
    assert np.mean(found) == pytest.approx(0.0, abs=2.0)
    assert np.sqrt(np.mean(found**2)) == pytest.approx(np.sqrt(2.0 / 3.0) * 40.0, rel=0.1)


def curved_surface(mesh: Any) -> CurvedSurface:
    """Return the curved surface through a mesh of trimesh."""
    points, triangles = np.array(mesh.vertices), np.array(mesh.faces)
    return CurvedSurface(points, triangles, Pseudonormals(points, triangles))


@cache
def bowl() -> fem.Body:
    """Return a disk of 15 mm of height with a bowl of 10 mm in its top, 8 mm over the bonded floor, cells of 4 mm."""
    angle = np.linspace(0.0, np.arccos(0.3), 24)
    rim = np.column_stack([10e-3 * np.sin(angle), 18e-3 - 10e-3 * np.cos(angle)])
    profile = [[0.0, 0.0], [18e-3, 0.0], [18e-3, rim[-1, 1]], *rim[::-1]]
    surface = trimesh.creation.revolve(np.array(profile), sections=64)
    surface.merge_vertices()
    surface.fix_normals()
    mesh = Mesh(surface.vertices, surface.faces)
    return fem.build(mesh, young="10 kPa", poisson=0.45, fixed="z < 0.01 mm", spacing="4 mm").signed_distance()


@pytest.mark.filterwarnings("ignore::palpate.fem.BodyWarning")
def test_a_press_of_a_coarse_ball_has_the_force_of_hertz_and_of_a_path_to_the_same_place(ball: fem.Body) -> None:
    rng, radius, depth = np.random.default_rng(3), 6e-3, 1e-3
    effective = 1.0 / (1.0 / radius + 1.0 / 10e-3)
    hertz = 4.0 / 3.0 * 10e3 / (1.0 - 0.45**2) * np.sqrt(effective) * depth**1.5
    pressed, moved = [], []
    for _ in range(20):
        out = rng.normal(size=3) * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.5]
        out /= np.linalg.norm(out)
        pressed.append(float(ball.indent(10e-3 * out, radius, depth).force @ out))
        way = np.outer(10e-3 + radius - np.linspace(0.0, depth, 60), out)
        moved.append(float(ball.simulate_path(way, radius).force[-1] @ out))
    assert np.mean(pressed) / hertz == pytest.approx(1.0, abs=0.08)
    assert 0.75 < min(pressed) / hertz < max(pressed) / hertz < 1.15
    assert pressed == pytest.approx(moved, rel=0.1)


@pytest.mark.filterwarnings("ignore::palpate.fem.BodyWarning")
def test_95_of_100_presses_on_a_coarse_ball_are_within_the_stated_error_of_the_force_of_hertz(ball: fem.Body) -> None:
    rng, within = np.random.default_rng(5), []
    for radius, depth in itertools.product((4e-3, 6e-3, 9e-3), (0.5e-3, 0.8e-3, 1.2e-3)):
        effective = 1.0 / (1.0 / radius + 1.0 / 10e-3)
        hertz = 4.0 / 3.0 * 10e3 / (1.0 - 0.45**2) * np.sqrt(effective) * depth**1.5
        for _ in range(16):
            out = rng.normal(size=3) * [1.0, 1.0, 0.0] + [0.0, 0.0, 1.5]
            out /= np.linalg.norm(out)
            press = ball.indent(10e-3 * out, radius, depth)
            if press.error is not None:
                within.append(abs(float(press.force @ out) / hertz - 1.0) < press.error)
    assert len(within) > 90
    assert np.mean(within) > 0.95


def test_the_error_along_the_normals_of_a_ball_is_not_known(ball: fem.Body) -> None:
    """The force is up to twice that of Hertz there, with a bound of 39 % on a flat surface."""
    with pytest.warns(fem.BodyWarning, match="contact along the nodes' normals is too stiff"):
        press = type(ball)(ball.contents).indent((0.0, 0.0, 10e-3), 6e-3, 1.2e-3)
    assert press.error is None
    assert press.force[2] > 1.4 * ball.indent((0.0, 0.0, 10e-3), 6e-3, 1.2e-3).force[2]
    assert ball.is_curved(np.array([0.0, 0.0, 10e-3]), 1.5e-3)
    assert not ball.is_curved(np.array([0.0, 0.0, 10e-3]), 0.5e-3)


@pytest.mark.parametrize(
    ("radius", "depth", "doubt"),
    [
        ("4 mm", "1 mm", None),
        ("4 mm", "0.5 mm", "too coarse for the hollow"),
        ("12 mm", "1 mm", "as wide as the hollow"),
    ],
)
def test_the_error_in_a_hollow_is_stated_unless_the_tip_fits_it_closely(
    radius: str, depth: str, doubt: str | None
) -> None:
    """A bowl of 10 mm: with cells of 4 mm the force of 8 mm was up to twice that with cells of 2 mm."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        press = bowl().indent((0.0, 0.0, 8e-3), radius, depth)
    assert (press.error is None) is (doubt is not None)
    assert doubt is None or any(doubt in str(one.message) for one in found)


def test_a_sphere_fits_a_hollow_more_closely_the_larger_and_the_shallower_it_is() -> None:
    height = 0.2e-3
    assert not fits_closely(height, 1.5e-3, -100.0, 2e-3)
    assert fits_closely(height, 1.5e-3, -100.0, 6e-3)
    assert fits_closely(height, 0.5e-3, -100.0, 2e-3)
    assert fits_closely(height, 1.0, -100.0, 12e-3)
    assert not fits_closely(height, 0.1e-3, 100.0, 12e-3)


def test_a_press_counts_as_shallow_by_the_effective_radius(ball: fem.Body) -> None:
    """Spheres of 6 and 10 mm touch as one of 3.75 mm and a plane; a hollow that fits has no such sphere."""
    top = np.array([0.0, 0.0, 10e-3])
    assert ball.effective_radius(top, 6e-3) == pytest.approx(3.75e-3, rel=0.1)
    distance = node_distance(ball.nodes, top)
    flat_limit, ball_limit = ((0.38 * distance) ** 2 / radius for radius in (6e-3, 3.75e-3))
    assert "less than 0.38 times" in ball.mesh_doubt(top, 6e-3, 0.9 * ball_limit)
    assert 0.9 * ball_limit > 1.2 * flat_limit
    assert ball.mesh_doubt(top, 6e-3, 1.1 * ball_limit) == ""
    inward = replace(ball.contents, triangles=ball.contents.triangles[:, ::-1])
    assert type(ball)(inward).effective_radius(top, 12e-3) == np.inf
