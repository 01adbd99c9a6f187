"""Repair of a surface to be filled, and its winding number."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate.fem import BodyError
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.winding_number import WindingNumber

trimesh = pytest.importorskip("trimesh")
SPHERE = trimesh.creation.icosphere(3, 0.04)


def closed(vertices: Any, faces: Any) -> ClosedSurface:
    return ClosedSurface(np.asarray(vertices, dtype=float), np.asarray(faces, dtype=np.int64))


def test_the_winding_number_is_one_inside_and_zero_outside() -> None:
    fine = trimesh.creation.icosphere(4, 0.04)
    points = np.random.default_rng(0).normal(size=(200, 3))
    points *= (np.linspace(0.0, 0.12, 200) / np.linalg.norm(points, axis=1))[:, None]
    radius = np.linalg.norm(points, axis=1)
    clear = np.abs(radius - 0.04) > 2e-4
    found = WindingNumber(np.asarray(fine.vertices), np.asarray(fine.faces))(points)
    np.testing.assert_array_equal(found[clear], (radius < 0.04)[clear])


def test_shells_that_share_an_edge_alone_are_separate() -> None:
    """Four triangles meet at the edge, so that it connects none of them."""
    points = 0.01 * np.array([[0, 0, 0], [0, 0, 1], [1, 0, 0.5], [0, 1, 0.5], [-1, 0, 0.5], [0, -1, 0.5]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    one, other = np.array([1, 0, 2, 3])[faces], np.array([1, 0, 4, 5])[faces]
    surface = closed(points, np.vstack([one, other]))
    assert surface.volume == pytest.approx(2.0 * 0.01**3 / 6.0)
    assert surface.shells == 2
    for angle in np.radians(range(0, 360, 15)):  # the order of the triangles differs
        turned = points @ [[np.cos(angle), np.sin(angle), 0.0], [-np.sin(angle), np.cos(angle), 0.0], [0.0, 0.0, 1.0]]
        assert closed(turned, np.vstack([one, other])).shells == 2
    assert closed(points, one).shells == 1


@pytest.mark.parametrize("extent", [1e-5, 1.0, 1e4])
def test_a_shape_encloses_a_volume_at_every_scale(extent: float) -> None:
    """A plate of a thousandth of its width does; the same plate squeezed to nothing does not."""
    plate = trimesh.creation.box((1.0, 1.0, 1e-3))
    surface = closed(extent * plate.vertices, plate.faces)
    assert surface.volume == pytest.approx(1e-3 * extent**3)
    assert surface.thickness == pytest.approx(1e-3 * extent, rel=3e-3)
    with pytest.raises(BodyError, match=r"encloses no volume|is empty"):
        closed(extent * plate.vertices * [1.0, 1.0, 1e-9], plate.faces)


def test_a_clean_surface_needs_no_repair() -> None:
    surface = closed(SPHERE.vertices, SPHERE.faces)
    assert surface.repairs == []
    assert surface.simple
    assert surface.volume == pytest.approx(SPHERE.volume)


def test_vertices_that_differ_in_the_last_bits_are_welded() -> None:
    soup = SPHERE.triangles.reshape(-1, 3)
    soup = soup + 1e-8 * np.random.default_rng(0).uniform(-1, 1, soup.shape)
    surface = closed(soup, np.arange(len(soup)).reshape(-1, 3))
    assert surface.repairs == [f"{len(soup) - len(SPHERE.vertices)} duplicate vertices welded"]
    assert surface.simple


def test_repeated_and_reversed_triangles_are_repaired() -> None:
    faces = np.concatenate([SPHERE.faces, SPHERE.faces[:5]])
    faces[10:20] = faces[10:20, ::-1]
    surface = closed(SPHERE.vertices, faces)
    assert surface.volume == pytest.approx(SPHERE.volume)
    assert any("5 triangles repeated and dropped" in text for text in surface.repairs)
    assert any("oriented outwards" in text for text in surface.repairs)


def test_an_inverted_surface_is_turned() -> None:
    assert closed(SPHERE.vertices, SPHERE.faces[:, ::-1]).volume == pytest.approx(SPHERE.volume)


def test_a_hole_of_several_edges_is_closed_by_a_cap() -> None:
    """A hexagon about a vertex: the fan about its center has its area, and the volume lacks a flat pyramid."""
    fine = trimesh.creation.icosphere(4, 0.04)
    apex = 100
    around = (fine.faces == apex).any(axis=1)
    assert around.sum() == 6
    surface = closed(fine.vertices, fine.faces[~around])
    rim = np.setdiff1d(fine.faces[around], [apex])
    raised = fine.vertices.copy()
    raised[apex] = raised[rim].mean(axis=0)
    capped = trimesh.Trimesh(raised, fine.faces, process=False)
    assert surface.volume == pytest.approx(capped.volume, rel=1e-9)
    share = capped.area_faces[around].sum() / fine.area_faces[~around].sum()
    assert surface.repairs == surface.warnings == [f"1 hole closed, {100.0 * share:.2g} % of the area"]


def test_two_holes_with_a_common_vertex_are_closed_each_by_its_own_fan() -> None:
    """Two hexagons, one vertex apart along a row: the cap of each is flat about its own center."""
    fine = trimesh.creation.icosphere(4, 0.04)
    near = [set(one) for one in fine.vertex_neighbors]
    first, common = 700, sorted(near[700])
    second = next(v for c in common for v in sorted(near[c] - near[first] - {first}) if len(near[v] & near[first]) == 1)
    around = np.isin(fine.faces, [first, second]).any(axis=1)
    assert around.sum() == 12
    raised = fine.vertices.copy()
    for apex in (first, second):
        raised[apex] = fine.vertices[sorted(near[apex])].mean(axis=0)
    surface = closed(fine.vertices, fine.faces[~around])
    assert surface.repairs[0].startswith("2 holes closed, ")
    assert surface.volume == pytest.approx(trimesh.Trimesh(raised, fine.faces, process=False).volume, rel=1e-9)


def test_a_hole_of_a_fiftieth_of_the_area_is_closed_and_a_tenth_in_all() -> None:
    """A hole of 45 of 1,280 triangles is too large; of those of 20, three are closed, and eight are too many."""
    near = [set(one) for one in SPHERE.vertex_neighbors]
    apart = [v for v in range(len(near)) if len(near[v]) == 5][:8]  # the corners of the icosahedron
    disc = {v: {v} | near[v] for v in apart}

    def without(vertices: set[int]) -> np.ndarray:
        return SPHERE.faces[~np.isin(SPHERE.faces, sorted(vertices)).any(axis=1)]

    wide = set().union(*(near[v] for v in disc[apart[0]]))
    with pytest.raises(
        BodyError, match=r"the surface has 15 edges at a border, .* 3\.\d+ % of the area, the largest 3\."
    ):
        closed(SPHERE.vertices, without(wide))
    three = closed(SPHERE.vertices, without(set().union(*(disc[v] for v in apart[:3]))))
    assert three.repairs[0].startswith("3 holes closed, 4.")
    with pytest.raises(
        BodyError, match=r"the surface has 80 edges at a border, .* 1\d\.\d* % of the area, the largest 1\."
    ):
        closed(SPHERE.vertices, without(set().union(*disc.values())))


def test_spheres_within_each_other_are_solid_and_hollow_in_turn() -> None:
    balls = [trimesh.creation.icosphere(2, radius) for radius in (0.01, 0.04, 0.02, 0.03)]
    four = trimesh.util.concatenate(balls)
    surface = closed(four.vertices, four.faces)
    a, d, b, c = (ball.volume for ball in balls)
    assert surface.volume == pytest.approx(d - c + b - a)
    assert surface.warnings == ["2 cavities inside of a part; give an inclusion as a region"]
    depths = np.array([[0.005, 0.0, 0.0], [0.015, 0.0, 0.0], [0.025, 0.0, 0.0], [0.035, 0.0, 0.0]])
    assert surface.inside(depths).tolist() == [False, True, False, True]


def test_each_of_many_cavities_is_empty() -> None:
    side, apart = 0.002, 0.005
    places = apart * (np.stack(np.indices((6, 6, 6)), axis=-1).reshape(-1, 3) - 2.5)
    holes = [trimesh.creation.box((side,) * 3, np.block([[np.eye(3), x[:, None]], [0, 0, 0, 1]])) for x in places]
    block = trimesh.util.concatenate([trimesh.creation.box((0.04,) * 3), *holes])
    surface = closed(block.vertices, block.faces)
    assert surface.volume == pytest.approx(0.04**3 - 216 * side**3, rel=1e-12)
    assert surface.warnings == ["216 cavities inside of a part; give an inclusion as a region"]


def test_triangles_without_area_make_an_empty_surface() -> None:
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    with pytest.raises(BodyError, match="the surface is empty: none of its triangles has an area"):
        closed(line, [[0, 1, 2]])


def test_pseudonormals_of_a_box_halve_the_angles_between_its_sides() -> None:
    """Of a face its normal, of an edge the sum of two, of a corner that of three, however the sides are divided."""
    half = np.array([0.01, 0.02, 0.03])
    box = trimesh.creation.box(2.0 * half).subdivide()
    surface = closed(box.vertices, box.faces)
    rng, sides = np.random.default_rng(5), np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1).T
    sides = sides[np.abs(sides).sum(axis=1) > 0.0]
    for number in (0, 1):  # a corner of the triangles in the middle of a side, or a place anywhere on it
        inner = number * rng.uniform(-0.9, 0.9, sides.shape)
        points = half * np.where(sides == 0.0, inner, sides)
        normals = surface.pseudonormals.at(*surface.nearest(points))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        np.testing.assert_allclose(normals, sides / np.linalg.norm(sides, axis=1)[:, None], atol=1e-6)
        for step in (-1e-3, 2e-3):
            found = surface.signed(points + step * sides)
            size = np.linalg.norm(sides, axis=1) if step > 0.0 else np.ones(len(sides))
            np.testing.assert_allclose(found, -step * size, rtol=1e-6)


def test_a_surface_is_the_same_in_any_order_of_its_triangles() -> None:
    """Also where two tetrahedra share an edge, so that two triangles have the same first and last vertex."""
    points = 0.01 * np.array([[0, 0, 0], [0, 0, 1], [1, 1, 0.5], [1, 2, 0.5], [1, -1, 0.5], [1, -2, 0.5]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    faces = np.vstack([faces, np.array([0, 1, 5, 4])[faces]])
    one = closed(points, faces)
    rng = np.random.default_rng(0)
    for _ in range(5):
        other = closed(points, faces[rng.permutation(8)])
        np.testing.assert_array_equal(other.vertices, one.vertices)
        np.testing.assert_array_equal(other.triangles, one.triangles)


def test_a_vertex_on_an_edge_is_a_seam_and_no_hole() -> None:
    box = trimesh.creation.box((0.02, 0.03, 0.04))
    a, b, c = box.faces[0]
    middle = (box.vertices[a] + box.vertices[b]) / 2.0
    new = len(box.vertices)
    faces = np.concatenate([box.faces[1:], [[a, new, c], [new, b, c]]])
    surface = closed(np.vstack([box.vertices, middle]), faces)
    assert surface.repairs == ["1 seam of vertices on an edge closed"]
    assert surface.warnings == []
    assert surface.volume == pytest.approx(box.volume)
    inner = np.array([[0.0, 0.0, 0.0], [0.009, 0.0, 0.0], [0.011, 0.0, 0.0]])
    assert surface.inside(inner).tolist() == [True, True, False]


def test_a_sphere_within_a_sphere_is_a_cavity() -> None:
    inner = trimesh.creation.icosphere(2, 0.02)
    both = trimesh.util.concatenate([SPHERE, inner])
    surface = closed(both.vertices, both.faces)
    assert surface.volume == pytest.approx(SPHERE.volume - inner.volume)
    assert surface.warnings == ["1 cavity inside of a part; give an inclusion as a region"]
    assert surface.inside(np.array([[0.0, 0.0, 0.0], [0.03, 0.0, 0.0]])).tolist() == [False, True]


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_strut_across_a_cavity_given_inwards_is_solid(inside_out: bool) -> None:
    """The orientation in the file tells the strut from a second cavity, also if the whole file is inside out."""
    cavity, strut = trimesh.creation.icosphere(2, 0.02), trimesh.creation.box((0.06, 0.006, 0.006))
    points = np.array([[0.0, 0.0, 0.0], [0.025, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.025, 0.0]])

    def inside(*inverted: trimesh.Trimesh) -> tuple[list[bool], list[str]]:
        parts = [part.copy() for part in (SPHERE, cavity, strut)]
        for part, original in zip(parts, (SPHERE, cavity, strut), strict=True):
            if (original in inverted) is not inside_out:
                part.invert()
        whole = trimesh.util.concatenate(parts)
        surface = closed(whole.vertices, whole.faces)
        return surface.inside(points).tolist(), surface.warnings

    one = "1 cavity inside of a part; give an inclusion as a region"
    two = "2 cavities inside of a part; give an inclusion as a region"
    assert inside(cavity) == ([True, True, False, True], [one])
    assert inside(cavity, strut) == ([False, False, False, True], [two])
    unknown = "cavities cross each other: to make one a solid, orient the others inwards"
    assert inside() == ([False, False, False, True], [unknown, two])


def test_blocks_with_a_common_edge_are_two_shells() -> None:
    block = trimesh.creation.box((0.02, 0.02, 0.02))
    other = block.copy().apply_translation([0.02, 0.02, 0.0])
    both = trimesh.util.concatenate([block, other])
    surface = closed(both.vertices, both.faces)
    assert (surface.shells, int(surface.parts.max()) + 1) == (2, 1)
    assert closed(SPHERE.vertices, SPHERE.faces).shells == 1


def test_a_large_hole_and_a_single_side_are_refused() -> None:
    with pytest.raises(BodyError, match=r"edges at a border.*holes below 2 %, together 10 %, are closed"):
        closed(SPHERE.vertices, SPHERE.faces[SPHERE.triangles_center[:, 2] < 0.02])
    angle = np.linspace(0.0, 2.0 * np.pi, 41)[:-1]
    width = np.array([-1.0, 1.0])[:, None] * 0.01
    radius = 0.04 + width * np.cos(angle / 2.0)
    rows = np.stack([radius * np.cos(angle), radius * np.sin(angle), width * np.sin(angle / 2.0)], axis=-1)
    one, two = np.arange(40), np.roll(np.arange(40), -1)
    low = np.where(two == 0, 40, two)  # the band closes with its sides exchanged
    high = np.where(two == 0, 0, two + 40)
    faces = np.concatenate([np.stack([one, low, high], axis=1), np.stack([one, high, one + 40], axis=1)])
    with pytest.raises(BodyError, match="edges at a border"):
        closed(rows.reshape(-1, 3), faces)


def test_far_from_a_single_tetrahedron_the_winding_number_is_zero() -> None:
    """The grid of its few triangles has few cells, and none outside of them."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    for count in (1, 4):
        number = WindingNumber(corners, faces if count == 4 else np.array([[0, 1, 2], [0, 2, 1]]))
        far = np.random.default_rng(1).normal(size=(50, 3))
        far *= 9.0 / np.linalg.norm(far, axis=1, keepdims=True)
        np.testing.assert_array_equal(number(far), np.zeros(50))
        assert number(np.array([[0.2, 0.2, 0.2], [0.4, 0.4, 0.4]])).tolist() == [count == 4, 0.0]


@pytest.mark.parametrize("shape", [SPHERE, trimesh.creation.box((0.05, 0.03, 0.07))], ids=["sphere", "box"])
def test_the_nearest_triangle_and_the_winding_number_agree_on_the_inside(shape: Any) -> None:
    surface = closed(shape.vertices, shape.faces)
    points = np.random.default_rng(1).uniform(-0.05, 0.05, (3000, 3))
    clear = surface.distance(points) > 1e-4
    np.testing.assert_array_equal(surface.inside(points)[clear], (surface.winding_number(points) > 0.5)[clear])


@pytest.mark.parametrize(("slope", "spike"), [(63.0, True), (37.0, True), (33.0, False)])
def test_an_apex_is_a_spike_up_to_the_length_of_its_shortest_edge(slope: float, spike: bool) -> None:
    """A cone of 24 sides: the apex alone has no triangle near its normal and no sharp edge."""
    n, radius = 24, 0.01
    height = radius * np.tan(np.radians(slope))
    angle = 2.0 * np.pi * np.arange(n) / n
    rim = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n)])
    points = np.vstack([rim, [[0.0, 0.0, height], [0.0, 0.0, 0.0]]])
    k = np.arange(n)
    sides = np.column_stack([k, (k + 1) % n, np.full(n, n)])
    base = np.column_stack([(k + 1) % n, k, np.full(n, n + 1)])
    away, top = np.array([0.3, -0.1, 0.2]), np.array([0.3, -0.1, 0.2 + height])
    cone = ClosedSurface(points + away, np.vstack([sides, base]))
    edge = float(np.hypot(height, radius))
    for least in (0.0, 0.999 * edge):
        found = cone.spikes(least)
        np.testing.assert_allclose(cone.vertices[found], np.reshape(top, (1, 3))[: int(spike)], atol=1e-12)
    assert cone.spikes(1.001 * edge).tolist() == []
