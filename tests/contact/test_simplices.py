"""Areas, volumes, boundaries and components of simplices: closed forms, conservation, and a second method."""

from __future__ import annotations

from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from palpate.contact.simplices import (
    adjacent_faces,
    area_vectors,
    boundary,
    components,
    cross,
    equal_neighbors,
    half_edges,
    unique_rows,
    volumes,
)
from palpate.fem import block

PAIRS = st.lists(st.tuples(st.integers(0, 11), st.integers(0, 11)), max_size=30)


def test_the_boundary_of_a_block_encloses_its_volume() -> None:
    """By the divergence theorem, with areas pointing outwards; each edge is run once in each direction."""
    cells = block((0.03, 0.04, 0.05), 0.01)
    triangles = boundary(cells.tetrahedra)
    areas = area_vectors(cells.points, triangles)
    np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-18)
    centers = cells.points[triangles].mean(axis=1)
    assert np.isclose((areas * centers).sum() / 3.0, 0.03 * 0.04 * 0.05)
    assert np.isclose(volumes(cells.points, cells.tetrahedra).sum(), 0.03 * 0.04 * 0.05)
    assert np.isclose(np.linalg.norm(areas, axis=1).sum(), 2.0 * (0.03 * 0.04 + 0.04 * 0.05 + 0.05 * 0.03))
    directed = Counter(map(tuple, half_edges(triangles).tolist()))
    assert set(directed.values()) == {1}
    assert all((b, a) in directed for a, b in directed)


def test_a_mirrored_tetrahedron_has_the_negative_volume() -> None:
    corners = np.random.default_rng(4).normal(size=(4, 3))
    one, other = volumes(corners, np.array([[0, 1, 2, 3], [0, 2, 1, 3]]))
    assert np.isclose(one, -other)
    assert abs(one) > 0.1
    assert np.isclose(6.0 * abs(one), abs(np.linalg.det(np.c_[corners, np.ones(4)])))


@given(PAIRS)
def test_components_join_what_edges_join_and_nothing_else(pairs: list[tuple[int, int]]) -> None:
    edges = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    found = components(edges[:, 0], edges[:, 1], 12)
    group = {i: {i} for i in range(12)}
    for a, b in pairs:
        joined = group[a] | group[b]
        for i in joined:
            group[i] = joined
    for i in range(12):
        assert set(np.flatnonzero(found == found[i]).tolist()) == group[i]
    first = [int(np.flatnonzero(found == label)[0]) for label in range(found.max() + 1)]
    assert first == sorted(first)


@given(PAIRS)
def test_equal_rows_form_chains(pairs: list[tuple[int, int]]) -> None:
    rows = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    one, two = equal_neighbors(rows)
    assert (rows[one] == rows[two]).all()
    assert (one != two).all()
    chains = Counter(map(tuple, rows[one].tolist()))
    assert chains == Counter({row: count - 1 for row, count in Counter(pairs).items() if count > 1})
    assert len(np.unique(two)) == len(two)


@given(st.lists(st.lists(st.sampled_from([-1.5, -0.0, 0.0, 2.0]), min_size=3, max_size=3), min_size=1, max_size=30))
def test_unique_rows_are_those_of_numpy_in_its_order(values: list[list[float]]) -> None:
    rows = np.array(values)
    first, number = unique_rows(rows)
    _, expected, inverse = np.unique(rows + 0.0, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(first, expected)
    np.testing.assert_array_equal(number, inverse.ravel())


def test_cross_products_have_the_bits_of_numpy() -> None:
    a, b = np.random.default_rng(5).normal(size=(2, 100, 3))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))


def test_faces_and_pairs_are_in_the_order_of_their_rows() -> None:
    """The first column decides, then the next; a boundary keeps the order of the faces of its tetrahedra."""
    rows = np.array([[2, 0], [0, 2], [1, 1], [0, 1], [2, 0], [0, 2], [0, 2]])
    one, two = equal_neighbors(rows)
    assert (one.tolist(), two.tolist()) == ([1, 5, 0], [5, 6, 4])
    assert unique_rows(rows)[0].tolist() == [3, 1, 2, 0]
    cells = np.array([[0, 1, 2, 3], [1, 2, 3, 4]])
    faces = np.array([[0, 2, 1], [1, 3, 2], [0, 1, 3], [1, 2, 4], [0, 3, 2], [1, 4, 3], [1, 2, 3], [2, 3, 4]])
    all_faces, first, second = adjacent_faces(cells)
    np.testing.assert_array_equal(all_faces, faces)
    assert (first.tolist(), second.tolist()) == ([1], [6])
    np.testing.assert_array_equal(boundary(cells), faces[[0, 2, 3, 4, 5, 7]])


def test_an_edge_joins_its_ends_in_either_direction() -> None:
    assert components(np.array([3, 1]), np.array([0, 2]), 5).tolist() == [0, 1, 1, 0, 2]
    assert components(np.array([0, 2]), np.array([3, 1]), 5).tolist() == [0, 1, 1, 0, 2]
    assert components(np.empty(0, dtype=int), np.empty(0, dtype=int), 3).tolist() == [0, 1, 2]
