"""A boundary as a curve: its largest stiffness, its pieces, and its stiffness at a damping, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.linear import HumanArm, LinearDevice, wall_loop
from palpate.stability.maps.boundary_curve import Boundary, _has_loose_end, stability_boundary


def curve(damping: np.ndarray, stiffness: np.ndarray, jump: float = 0.05) -> Boundary:
    return Boundary(damping, stiffness, np.linspace(0.1, 0.2, len(damping)), (0.0, 1.0), jump)


ARC = curve(5.0 * np.sin(np.linspace(0.0, 2.6, 400)), 100.0 * (1.0 - np.cos(np.linspace(0.0, 2.6, 400))))


def test_the_stiffest_point_is_that_of_the_largest_stiffness() -> None:
    b, k = ARC.stiffest
    assert (b, k) == (ARC.damping[-1], ARC.stiffness[-1])
    peak = curve(np.array([0.0, 1.0, 2.0]), np.array([5.0, 9.0, 7.0]))
    assert peak.stiffest == (1.0, 9.0)
    assert str(peak) == "The stiffest stable wall has 9 N/m, with 1 N s/m; 3 points of the boundary."


def test_the_stiffness_at_a_damping_is_the_highest_branch_of_the_curve() -> None:
    """The arc passes each damping twice: below and above its widest point."""
    for b in (0.5, 2.0, 3.7, 4.9):
        upper = 100.0 * (1.0 + np.sqrt(1.0 - (b / 5.0) ** 2))
        lower = 100.0 * (1.0 - np.sqrt(1.0 - (b / 5.0) ** 2))
        expected = upper if b > ARC.damping[-1] else lower
        assert ARC.stiffest_at(b) == pytest.approx(expected, rel=1e-3)
        assert ARC.stiffest_at(f"{b} N*s/m") == ARC.stiffest_at(b)
    assert ARC.stiffest_at(5.1) is None
    assert ARC.stiffest_at(-0.1) is None
    line = curve(np.array([0.0, 1.0, 2.0]), np.array([10.0, 30.0, 20.0]), jump=2.0)
    for b, k in ((0.0, 10.0), (0.25, 15.0), (1.0, 30.0), (1.75, 22.5), (2.0, 20.0)):
        assert line.stiffest_at(b) == pytest.approx(k)


def test_a_curve_is_cut_where_neighbors_are_farther_apart_than_its_jump() -> None:
    b, k = np.r_[np.linspace(0, 4, 50), np.linspace(6, 10, 50)], np.full(100, 7.0)
    k[-1] = 8.0
    assert curve(b, k, jump=0.19).pieces[0] == (0, 50)
    assert (0, 50) not in curve(b, k, jump=0.21).pieces
    high = np.r_[np.linspace(0, 40, 50), np.linspace(60, 100, 50)]
    assert curve(np.linspace(0, 10, 100), high).pieces == [(0, 50), (50, 100)]
    assert curve(np.linspace(0, 10, 100), high, jump=0.3).pieces == [(0, 100)]
    assert curve(np.array([0.0, 9.0]), np.array([1.0, 50.0])).pieces == [(0, 2)]
    gap = curve(b, np.linspace(1.0, 2.0, 100))
    assert gap.stiffest_at(5.0) is None  # no stiffness is told between two pieces
    assert gap.stiffest_at(3.0) == pytest.approx(np.interp(3.0, gap.damping, gap.stiffness))


def test_an_end_inside_the_quadrant_is_loose_unless_another_segment_begins_there() -> None:
    def segment(*points: tuple[float, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        b, k = np.array(points).T
        return np.zeros(len(b)), b, k

    rise, fall = segment((0.0, 50.0), (3.0, 100.0)), segment((3.0, 100.0), (5.0, 0.0))
    assert not _has_loose_end([rise, fall], 0.0)
    for ends in ([rise], [fall], [rise, segment((3.5, 100.0), (5.0, 0.0))]):
        assert _has_loose_end(ends, 0.0)


def test_a_part_of_a_curve_keeps_its_points_and_their_angles() -> None:
    part = ARC.up_to(3.0)
    kept = ARC.damping <= 3.0
    np.testing.assert_array_equal(part.damping, ARC.damping[kept])
    np.testing.assert_array_equal(part.stiffness, ARC.stiffness[kept])
    np.testing.assert_array_equal(part.angle, ARC.angle[kept])
    assert (part.inside, part.jump) == (ARC.inside, ARC.jump)
    assert len(ARC.up_to("5 N*s/m").damping) == 400


@pytest.mark.parametrize("points", [40, 300])
@pytest.mark.parametrize(
    ("damping", "arm", "delay", "filtered", "least"),
    [
        (0.05, None, 0, 0.0, 0.0),
        (0.05, None, 2, 0.0, 0.0),
        (5.0, None, 1, 0.0, 0.0),
        (0.05, HumanArm(0.15, 4.5, 560.0, 500.0, 0.5), 1, 0.0, 0.0),
        (0.05, HumanArm(0.012, 0.44, 4.5, 230.0, 0.01), 3, 0.5, 0.0),
        (0.05, None, 0, 0.0, 10.0),
        (100.0, None, 0, 0.0, 0.0),
    ],
)
def test_a_curve_is_evenly_spaced_and_runs_from_the_least_damping_to_no_stiffness(
    points: int, damping: float, arm: HumanArm | None, delay: int, filtered: float, least: float
) -> None:
    loop = wall_loop(LinearDevice.of_mass(0.06, damping, arm), 1e-3, delay, filtered)
    found = stability_boundary(loop, min_damping=least, points=points)
    b, k = found.damping / found.damping.max(), found.stiffness / found.stiffness.max()
    assert len(b) == points
    assert b[0] == pytest.approx(least / found.damping.max(), abs=2e-7)
    assert k[-1] == pytest.approx(0.0, abs=2e-7)
    steps = np.hypot(np.diff(b), np.diff(k))
    steps = steps[steps > 1e-6]  # but where two segments meet
    assert np.abs(steps / np.median(steps) - 1.0).max() < 0.2


def test_a_curve_of_three_points_or_more_is_parted_at_its_jumps() -> None:
    """A jump is longer than its share of the curve's size; the size of a curve without extent is 1."""
    three = curve(np.array([0.0, 1.0, 10.0]), np.array([0.0, 1.0, 10.0]), jump=0.5)
    assert three.pieces == [(0, 2), (2, 3)]
    assert curve(np.array([0.0, 10.0]), np.array([0.0, 10.0])).pieces == [(0, 2)]
    for jump, pieces in ((0.49, [(0, 1), (1, 2), (2, 3)]), (0.51, [(0, 3)])):
        assert curve(np.array([0.0, 1.0, 2.0]), np.full(3, 7.0), jump).pieces == pieces
        assert curve(np.full(3, 7.0), np.array([0.0, 1.0, 2.0]), jump).pieces == pieces
    slanted = curve(np.array([0.0, 3.0, 6.0]), np.array([0.0, 40.0, 80.0]), jump=0.7)
    assert slanted.pieces == [(0, 1), (1, 2), (2, 3)]  # half of both sides: 0.707 of the size


def test_a_curve_without_damping_has_its_stiffness_at_zero() -> None:
    one = Boundary(np.zeros(2), np.array([5.0, 3.0]), np.zeros(2), (0.0, 1.0))
    assert one.stiffest_at(0.0) == 5.0
    assert one.stiffest_at(0.1) is None
