"""The deterministic mesher: angles, determinism, volume, sharp edges, manifold surface."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate import Mesh
from palpate import fem as bodies
from palpate.fem import BodyError, BodyWarning, Volume, isosurface_stuffing
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.isosurface_stuffing import _crossings, _CutPoints, _prism, _signs, _warp, lattice_over, stuff
from palpate.fem.mesh_improvement import manifold, min_angles

trimesh = pytest.importorskip("trimesh")


def surface_of(shape: Any) -> ClosedSurface:
    return ClosedSurface(np.asarray(shape.vertices, dtype=float), np.asarray(shape.faces, dtype=np.int64))


def stuffed(surface: ClosedSurface, spacing: float) -> tuple[Any, Any]:
    return stuff(surface, lattice_over(surface.vertices.min(axis=0), surface.vertices.max(axis=0), spacing))


def turned(shape: Any, angle: float, axis: tuple[float, float, float]) -> Any:
    shape = shape.copy()
    shape.apply_transform(trimesh.transformations.rotation_matrix(angle, axis))
    return shape


SHAPES = {
    "sphere": trimesh.creation.icosphere(3, 0.04),
    "torus": trimesh.creation.torus(0.04, 0.015),
    "turned box": turned(trimesh.creation.box((0.06, 0.05, 0.03)), 0.5, (1, 2, 3)),
    "capsule": turned(trimesh.creation.capsule(0.05, 0.02), 1.0, (1, 0, 1)),
}


@pytest.mark.parametrize("name", SHAPES)
def test_dihedral_angles_have_the_bound_of_labelle_and_shewchuk(name: str) -> None:
    points, cells = stuffed(surface_of(SHAPES[name]), 0.009)
    assert len(cells) > 200
    assert min_angles(points, cells).min() > 10.7


def test_renumbering_the_surface_changes_no_bit() -> None:
    shape = SHAPES["torus"]
    rng = np.random.default_rng(0)
    order = rng.permutation(len(shape.vertices))
    faces = np.argsort(order)[shape.faces][rng.permutation(len(shape.faces))]
    rolled = np.stack([np.roll(face, turn) for face, turn in zip(faces, rng.integers(0, 3, len(faces)), strict=True)])
    one = bodies.fill(shape.vertices, shape.faces, "9 mm")
    two = bodies.fill(shape.vertices[order], rolled, "9 mm")
    assert one.points.tobytes() == two.points.tobytes()
    assert one.tetrahedra.tobytes() == two.tetrahedra.tobytes()


def test_the_volume_error_falls_with_the_square_of_the_spacing() -> None:
    sphere = trimesh.creation.icosphere(4, 0.04)
    error = [1.0 - bodies.fill(sphere.vertices, sphere.faces, h).size / sphere.volume for h in (0.012, 0.006)]
    assert 0.0 < error[1] < 0.35 * error[0] < 0.02


def test_a_block_keeps_its_edges_and_corners() -> None:
    box = trimesh.creation.box((0.06, 0.05, 0.03))
    filled = bodies.fill(box.vertices, box.faces, "7 mm")
    assert filled.size == pytest.approx(box.volume, rel=2e-3)
    for corner in box.vertices:
        assert np.linalg.norm(filled.points - corner, axis=1).min() < 1e-12


def test_rotation_changes_counts_and_volume_little() -> None:
    meshes = []
    for angle in (0.0, 0.4, 1.1):
        shape = turned(SHAPES["torus"], angle, (1, 1, 2))
        meshes.append(bodies.fill(shape.vertices, shape.faces, "8 mm"))
    counts, sizes = [len(mesh.points) for mesh in meshes], [mesh.size for mesh in meshes]
    assert max(counts) < 1.15 * min(counts)
    assert max(sizes) < 1.01 * min(sizes)


def test_the_filled_surface_is_a_manifold_on_the_given_one() -> None:
    surface = surface_of(SHAPES["turned box"])
    filled = bodies.fill(surface.vertices, surface.triangles, "6 mm")
    skin = Mesh(filled.points, filled.surface)
    assert skin.closed
    assert skin.diagnose().pinched_vertices == 0
    assert surface.distance(filled.points[np.unique(filled.surface)]).max() < 0.01 * 0.006


def test_tetrahedra_that_share_only_a_vertex_or_an_edge_are_separated() -> None:
    points = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
    apart, cells = manifold(points, np.array([[0, 1, 2, 3], [0, 4, 6, 5]]))
    assert len(apart) == 8
    assert Mesh(apart, Volume(apart, cells).surface).diagnose().pinched_vertices == 0
    edge, left = manifold(points, np.array([[0, 3, 1, 2], [0, 3, 4, 5], [0, 1, 2, 6]]))  # 0-3 has four triangles
    assert Mesh(edge, Volume(edge, left).surface).closed


def test_overlapping_parts_are_filled_once() -> None:
    two = trimesh.util.concatenate(
        [trimesh.creation.icosphere(3, 0.03), trimesh.creation.icosphere(3, 0.03).apply_translation([0.03, 0, 0])]
    )
    ball, lens = 4.0 / 3.0 * np.pi * 0.03**3, 5.0 / 12.0 * np.pi * 0.03**3  # centers one radius apart
    assert bodies.fill(two.vertices, two.faces, "7 mm").size == pytest.approx(2 * ball - lens, rel=0.03)


def test_a_plate_thinner_than_the_spacing_is_refused_with_one_that_fits() -> None:
    plate = trimesh.creation.box((0.06, 0.06, 0.002))
    with pytest.raises(BodyError, match=r"too thin for a spacing of 12 mm: use a smaller one, such as 0\.9"):
        bodies.fill(plate.vertices, plate.faces, "12 mm")


def test_a_cone_keeps_its_apex() -> None:
    cone = trimesh.creation.cone(0.03, 0.06, sections=48)
    filled = bodies.fill(cone.vertices, cone.faces, "8 mm")
    assert np.linalg.norm(filled.points - [0.0, 0.0, 0.06], axis=1).min() < 1e-12


def test_a_body_that_falls_apart_at_its_neck_is_refused() -> None:
    half = [[0.001, 0.015], [0.02, 0.02], [0.02, 0.05], [0.0, 0.05]]
    profile = [[r, -z] for r, z in half[::-1]] + half
    bell = trimesh.creation.revolve(profile, sections=24)
    with pytest.raises(BodyError, match="fill 2 pieces of a surface of 1 part: it is too thin in places"):
        bodies.fill(bell.vertices, bell.faces, "9 mm")


def test_small_holes_are_closed_with_a_warning() -> None:
    sphere = trimesh.creation.icosphere(3, 0.04)
    with pytest.warns(BodyWarning, match="1 hole closed"):
        filled = bodies.fill(sphere.vertices, sphere.faces[:-1], "10 mm")
    assert filled.size == pytest.approx(sphere.volume, rel=0.05)


class Ball:
    """A sphere with exact distances."""

    def __init__(self, radius: float, center: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        self.radius, self.center, self.vertices = radius, np.array(center), np.zeros((1, 3))
        self.asked = 0

    def signed(self, points: np.ndarray) -> np.ndarray:
        return np.asarray(self.radius - np.linalg.norm(points - self.center, axis=-1))

    def distance(self, points: np.ndarray) -> np.ndarray:
        return np.abs(self.signed(points))

    def inside(self, points: np.ndarray) -> np.ndarray:
        self.asked += len(points)
        return self.signed(points) > 0.0


def test_signs_are_those_of_each_point_and_few_points_are_tested() -> None:
    """Points that no edge across the surface parts have the sign of one of them."""
    ball, lattice = Ball(0.04, (1e-3, 2e-3, -1e-3)), lattice_over(np.full(3, -0.045), np.full(3, 0.045), 0.008)
    points = lattice.low + lattice.side / 2.0 * lattice.places()
    found = _signs(ball, points, lattice.short_edges(), lattice.side)
    exact = np.sign(ball.signed(points))
    exact[ball.distance(points) <= 1e-6 * lattice.side] = 0.0
    np.testing.assert_array_equal(found, exact)
    assert ball.asked < 0.5 * len(points)


def test_crossings_lie_on_the_surface_and_on_their_edges_without_a_bisection(monkeypatch: pytest.MonkeyPatch) -> None:
    ball, lattice = Ball(0.04), lattice_over(np.full(3, -0.045), np.full(3, 0.045), 0.008)
    points = lattice.low + lattice.side / 2.0 * lattice.places()
    edges = np.concatenate([lattice.long_edges(), lattice.short_edges()])
    sign = np.sign(ball.signed(points)).astype(int)
    edges = edges[sign[edges[:, 0]] * sign[edges[:, 1]] < 0]
    bisected: list[int] = []
    whole = isosurface_stuffing._bisect
    monkeypatch.setattr(isosurface_stuffing, "_bisect", lambda s, a, w: bisected.append(len(a)) or whole(s, a, w))
    found = _crossings(ball, points, edges, sign)
    assert bisected == [0]
    assert ball.distance(found).max() < 2e-4 * lattice.side
    a, b = points[edges[:, 0]], points[edges[:, 1]]
    length = np.linalg.norm(b - a, axis=1)
    np.testing.assert_allclose(np.linalg.norm(found - a, axis=1) + np.linalg.norm(found - b, axis=1), length, rtol=1e-9)
    inner = np.where(sign[edges[:, [0]]] > 0, a, b)
    halved = whole(ball, inner, np.where(sign[edges[:, [0]]] > 0, b, a) - inner)
    assert np.linalg.norm(halved - found, axis=1).max() < lattice.side / 2**10


def test_a_point_moves_onto_its_nearest_crossing_if_that_is_close() -> None:
    """Three points on a line and a cut at 0.2 of the first edge; the other edge has none below a quarter."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    edges, near = np.array([[0, 1], [0, 2], [0, 3]]), np.array([0.25, 0.25, 0.25])
    crossings = np.array([[0.2, 0.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.9]])
    sign, moved = _warp(points, edges, crossings, near, np.array([1, -1, -1, -1]))
    np.testing.assert_array_equal(moved[0], crossings[1])  # the nearer of two
    np.testing.assert_array_equal(moved[1:3], points[1:3])
    np.testing.assert_array_equal(moved[3], points[3])  # its edge lost its crossing with the first point
    assert sign.tolist() == [0, -1, -1, -1]
    np.testing.assert_array_equal(points[0], np.zeros(3))
    for place, moves in ((0.249, True), (0.251, False)):
        sign, _ = _warp(points[:2], edges[:1], np.array([[place, 0.0, 0.0]]), near[:1], np.array([1, -1]))
        assert bool(sign[0] == 0) is moves
        assert sign[1] == -1


def test_the_number_of_a_crossing_does_not_depend_on_the_order_of_its_ends() -> None:
    edges = np.array([[4, 9], [7, 2], [0, 3]])
    number = _CutPoints(10, edges)
    a, b = edges.T
    np.testing.assert_array_equal(number(a, b), [10, 11, 12])
    np.testing.assert_array_equal(number(b, a), [10, 11, 12])


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 0, 1), (1, 2, 0), (0, 2, 1), (1, 0, 2), (2, 1, 0)])
def test_a_prism_is_split_into_three_tetrahedra_that_fill_it(order: tuple[int, ...]) -> None:
    top = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    corners = np.concatenate([top, top - [0.0, 0.0, 1.0]])
    sources = np.array([order])
    found = np.concatenate(
        _prism(tuple(np.array([k]) for k in range(3)), tuple(np.array([k + 3]) for k in range(3)), sources)
    )
    edges = corners[found[:, 1:]] - corners[found[:, :1]]
    np.testing.assert_allclose(np.abs(np.linalg.det(edges)) / 6.0, np.full(3, 1.0 / 6.0))
    used = {frozenset((int(a), int(b))) for cell in found for a in cell for b in cell if a < 3 <= b and b - a != 3}
    starts = [min(pair) for pair in used]
    assert [starts.count(k) for k in range(3)] == list(order)


def test_cuts_near_an_end_are_warped_by_the_kind_of_their_edge(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long edges are of the side of a cube, short ones of half its diagonal; most points are not tested one by one."""
    ball, lattice = Ball(0.04), lattice_over(np.full(3, -0.045), np.full(3, 0.045), 0.012)
    lengths: list[np.ndarray] = []
    whole = isosurface_stuffing._warp

    def warp(points: Any, edges: Any, crossings: Any, near: Any, sign: Any) -> Any:
        lengths.append(np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1) / lattice.side)
        np.testing.assert_allclose(lengths[0], np.where(near < 0.3, 1.0, 0.75**0.5))
        return whole(points, edges, crossings, near, sign)

    monkeypatch.setattr(isosurface_stuffing, "_warp", warp)
    stuff(ball, lattice)
    assert 0.2 < (lengths[0] > 0.9).mean() < 0.8
    assert ball.asked < 2 * len(lengths[0]) + 0.5 * len(lattice.places())


def test_a_lattice_of_cubes_is_body_centered() -> None:
    """Centers lie half a side from the corners; each has eight, and neighbors of one kind are a side apart."""
    lattice = lattice_over(np.zeros(3), np.array([0.02, 0.03, 0.01]), 0.006)
    points = lattice.low + lattice.side / 2.0 * lattice.places()
    assert len(points) == lattice.corners().size + lattice.centers().size
    for edges, length in ((lattice.long_edges(), 1.0), (lattice.short_edges(), 0.75**0.5)):
        sizes = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
        np.testing.assert_allclose(sizes, length * lattice.side)
    assert len(lattice.short_edges()) == 8 * lattice.centers().size
    nx, ny, nz = lattice.shape
    count = sum((a + 1) * (b + 1) * c + a * b * (c - 1) for a, b, c in ((nx, ny, nz), (ny, nz, nx), (nz, nx, ny)))
    assert len(lattice.long_edges()) == count
    middle = np.zeros(len(points), dtype=bool)
    middle[lattice.centers()[nx // 2, ny // 2, nz // 2]] = True
    cells = lattice.tetrahedra(middle)
    assert len(cells) == 24  # four on each of the six faces of a cube
    volume = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) / 6.0
    np.testing.assert_allclose(np.abs(volume), lattice.side**3 / 12.0)
    assert np.all(points.min(axis=0) < 0.0)
    assert np.all(points.max(axis=0) > [0.02, 0.03, 0.01])
