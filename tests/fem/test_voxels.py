"""Bodies made of voxels, whose surface has edges that four triangles share."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.contact.mesh import BodySurface, Mesh
from palpate.fem import Body, Volume, block, build

SIZE = 12e-3  # of each of two cubes


@pytest.fixture(scope="module")
def diagonal() -> Body:
    """Two cubes that share a vertical edge."""
    solid = block((2 * SIZE, 2 * SIZE, SIZE), 4e-3)
    x, y, _ = solid.points[solid.tetrahedra].mean(axis=1).T
    cells = solid.tetrahedra[(x < SIZE) == (y < SIZE)]
    used, cells = np.unique(cells, return_inverse=True)
    solid = Volume(solid.points[used], cells.reshape(-1, 4))
    return build(solid, young=10e3, fixed="z < 0.1 mm", touch="surface z > 0.5 mm")


@pytest.mark.filterwarnings("ignore:only")
@pytest.mark.parametrize("kind", ["compliance", "signed_distance", "hyperelastic"])
def test_a_press_is_that_of_its_path_and_of_the_press_turned_by_half_a_turn(diagonal: Body, kind: str) -> None:
    body = {
        "compliance": lambda: diagonal,
        "signed_distance": diagonal.signed_distance,
        "hyperelastic": lambda: diagonal.hyperelastic("4 ms"),
    }[kind]()
    at = np.array([5e-3, 7e-3, SIZE])
    turned = [2 * SIZE, 2 * SIZE, 2 * SIZE] - at
    force = body.indent(at, 6e-3, 1e-3).force
    assert force[2] > 0.01
    assert body.indent([turned[0], turned[1], SIZE], 6e-3, 1e-3).force[2] == pytest.approx(force[2], rel=0.05)
    height = at[2] + 6e-3 - np.concatenate([np.linspace(-2e-4, 1e-3, 200), np.full(100, 1e-3)])
    path = np.stack([np.full_like(height, at[0]), np.full_like(height, at[1]), height], axis=1)
    assert body.simulate_path(path, 6e-3).force[-1] == pytest.approx(force, abs=2e-3 * force[2])


def test_the_nearest_place_is_the_nearer_one_of_both_cubes(diagonal: Body) -> None:
    surface = diagonal.whole_surface
    assert isinstance(surface, BodySurface)
    first = surface.vertices[surface.triangles].mean(axis=1)[:, :2].sum(axis=1) < 2 * SIZE
    cubes = [Mesh(surface.vertices, surface.triangles[part]) for part in (first, ~first)]
    points = np.random.default_rng(0).uniform(-5e-3, 2 * SIZE + 5e-3, (2000, 3))
    found, faces = surface.nearest(points)
    distance = np.linalg.norm(found - points, axis=1)
    nearer = np.min([np.linalg.norm(cube.nearest(points)[0] - points, axis=1) for cube in cubes], axis=0)
    np.testing.assert_allclose(distance, nearer, atol=1e-15)
    centers = surface.vertices[surface.triangles[faces]]
    normal = np.cross(centers[:, 1] - centers[:, 0], centers[:, 2] - centers[:, 0])
    off = np.einsum("ij,ij->i", found - centers[:, 0], normal) / np.linalg.norm(normal, axis=1)
    np.testing.assert_allclose(off, 0.0, atol=1e-12)  # on the triangle of that number
