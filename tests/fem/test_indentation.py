"""Indentation step by step: which depths count as reached, and how a body that is turned inside out is found."""

from __future__ import annotations

import re

import numpy as np
import pytest
from palpate.arrays import Array
from palpate.fem import BodyError, Volume, block
from palpate.fem.indentation import ContactHistory, count_inverted, settle_at_depths

CELLS = block(0.01, 0.005)
DEPTHS = 1e-3 * np.arange(1.0, 13.0)


def press(rests: str, contacts: str, inverted: dict[int, int] | None = None) -> Array:
    """Press through steps with ("1") or without ("0") equilibrium and contact; the row says at which step."""
    reached = []

    def settle(step: int) -> Array:
        reached.append(step)
        row = np.full(12, float(step))
        row[7], row[-1] = int(contacts[step]), int(rests[step])
        return row

    return settle_at_depths(DEPTHS[: len(rests)], settle, lambda: (inverted or {}).get(reached[-1], 0))


def test_the_last_depth_decides() -> None:
    """Steps without equilibrium, contact or with inverted tetrahedra on the way are allowed, up to nine of them."""
    for rests, contacts, inverted in (
        ("111", "111", {}),
        ("001", "111", {}),
        ("111", "000", {}),
        ("111", "101", {1: 3}),
        (9 * "0" + "1", 10 * "1", {}),
        ("1" + 9 * "0" + "1", 11 * "1", {}),
    ):
        assert press(rests, contacts, inverted)[0] == len(rests) - 1


@pytest.mark.parametrize(
    ("rests", "contacts", "inverted", "said"),
    [
        ("110", "111", {}, "at 3 mm there is no equilibrium; the last equilibrium in contact was at 2 mm: use"),
        ("101", "111", {1: 1, 2: 4}, "at 3 mm the tip inverts 4 tetrahedra of the body; the last"),
        ("111", "111", {1: 1, 2: 1}, "at 3 mm the tip inverts 1 tetrahedra of the body; the last equilibrium in conta"),
        ("111", "110", {}, "at 3 mm the tip loses contact with the body; the last equilibrium in contact was at 2 mm"),
        ("110", "010", {}, "at 3 mm the tip loses contact with the body; the last equilibrium in contact was at 2 mm"),
        ("10", "00", {}, "at 2 mm there is no equilibrium; nor is there one at a smaller depth: use a smaller"),
        ("1" + 11 * "0", 12 * "1", {}, "at 11 mm there is no equilibrium; the last equilibrium in contact was at 1 mm"),
        (12 * "0", 12 * "1", {}, "at 10 mm there is no equilibrium; nor is there one at a smaller depth: use a"),
    ],
)
def test_a_press_that_fails_gives_the_depth_and_the_last_equilibrium(
    rests: str, contacts: str, inverted: dict[int, int], said: str
) -> None:
    with pytest.raises(BodyError, match=re.escape(said)):
        press(rests, contacts, inverted)


def test_a_tetrahedron_is_inverted_if_its_map_reverses_orientation() -> None:
    """By the determinant of a linear map, whatever the orientation of the mesh; a motion of the whole inverts none."""
    points, cells = CELLS.points, CELLS.tetrahedra
    rng = np.random.default_rng(5)
    for turned in (cells, cells[:, [1, 0, 2, 3]]):
        assert count_inverted(points, turned, np.broadcast_to([0.3, -0.2, 0.1], points.shape)) == 0
        for _ in range(5):
            linear = rng.normal(size=(3, 3))
            expected = len(cells) if np.linalg.det(linear) < 0.0 else 0
            assert count_inverted(points, turned, points @ (linear.T - np.eye(3))) == expected


def test_the_tetrahedra_of_a_node_that_is_pushed_through_the_mesh_are_inverted() -> None:
    """One tetrahedron, whose apex crosses its base; half of the crossing flattens it, which is no inversion."""
    points, cells = np.vstack([np.zeros(3), 0.01 * np.eye(3)]), np.array([[0, 1, 2, 3]])
    for share, expected in ((0.9, 0), (1.0, 0), (1.1, 1)):
        push = np.zeros((4, 3))
        push[3, 2] = -share * points[3, 2]
        assert count_inverted(points, cells, push) == expected


def test_a_mesh_of_which_three_tetrahedra_share_a_face_is_refused() -> None:
    points = 0.01 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1], [1, 1, 1]], dtype=float)
    assert len(Volume(points[:5], np.array([[0, 1, 2, 3], [0, 1, 2, 4]])).surface) == 6
    with pytest.raises(BodyError, match="more than two tetrahedra share a face: the mesh overlaps itself; mesh again"):
        _ = Volume(points, np.array([[0, 1, 2, 3], [0, 1, 2, 4], [0, 1, 2, 5]])).surface


def test_a_history_needs_the_forces_of_each_tick() -> None:
    rows = np.zeros((3, 15))
    rows[:, 9] = 1.0
    assert ContactHistory.of(rows).nodes.tolist() == [0, 0, 0]
    rows[1, 9] = 0.0
    with pytest.raises(BodyError, match="nodes"):
        ContactHistory.of(rows)
