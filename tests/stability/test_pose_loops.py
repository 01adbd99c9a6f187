"""Limits at many poses at once: found without the slow search, and at the crossings of each loop's response."""

from __future__ import annotations

import numpy as np
import pytest
from palpate import devices
from palpate.control.controller import Controller
from palpate.linear import HumanArm, LinearDevice
from palpate.linear.linear_device import SampledDevice
from palpate.linear.sampled_loop import assemble_loop
from palpate.linear.wall import WallLoop, wall_loop
from palpate.stability.maps import boundary_curve, wall_interval
from palpate.stability.maps.boundary_curve import stability_boundary
from palpate.stability.maps.pose_loops import ANGLES, PoseLoops, _roots, _TipResponse
from palpate.stability.maps.wall_interval import stability_interval

ARM = devices.load("phantom-premium-1.5a")
POSES = np.array([[0.0, 0.3, 0.2], [0.4, 0.5, -0.3], [-0.7, 0.1, 0.4], [0.1, 0.8, 0.1]])
HAND, THROUGH_TISSUE = HumanArm(0.15, 4.5, 560.0), HumanArm(0.15, 4.5, 560.0, 500.0, 0.5)


def loops_of(arm: HumanArm, delay: int, period: float = 1e-3, gain: float = 1.0) -> PoseLoops:
    return PoseLoops.of(ARM, POSES, Controller.gain(gain, period), period, delay, arm)


def normals(count: int, seed: int = 0) -> np.ndarray:
    drawn = np.random.default_rng(seed).normal(size=(len(POSES), count, 3))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=2, keepdims=True))


def loop_at(loops: PoseLoops, pose: int, normal: np.ndarray) -> WallLoop:
    """The loop of one pose against a wall, from its matrices."""
    one = loops.subset(slice(pose, pose + 1))
    a, entry, out = (
        m[0] for m in assemble_loop(one.plant, one.jacobian, one.geometric_stiffness, one.controller, one.delay)
    )
    n = len(a)
    tip = SampledDevice(a - np.eye(n), -entry @ normal, np.zeros(n), normal @ out, 0, one.period)
    return wall_loop(tip)


CASES = [(HAND, 0, 0.0), (HAND, 1, 2.0), (THROUGH_TISSUE, 0, 0.0), (THROUGH_TISSUE, 2, 0.5)]


@pytest.mark.parametrize(("arm", "delay", "damping"), CASES)
def test_limits_at_many_poses_are_those_of_each_loop_without_a_search(
    arm: HumanArm, delay: int, damping: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The eigenvalues confirm every limit that the crossings of the response give."""
    loops, directions = loops_of(arm, delay), normals(3)
    monkeypatch.setattr(PoseLoops, "_single_loop", lambda *_: pytest.fail("a limit was not confirmed"))
    stiffness, frequency, lower = loops.critical_stiffness(directions, np.full((len(loops), 3), damping))
    for pose in range(len(loops)):
        for k, normal in enumerate(directions[pose]):
            exact = stability_interval(loop_at(loops, pose, normal), damping)
            assert stiffness[pose, k] == pytest.approx(exact.stiffness, rel=1e-7)
            assert frequency[pose, k] == pytest.approx(exact.frequency, rel=1e-6)
            assert lower[pose, k] == pytest.approx(exact.min_stable_stiffness, rel=1e-6, abs=1e-9)


def test_the_search_of_one_loop_finds_the_limit_of_the_crossings() -> None:
    loops, directions = loops_of(THROUGH_TISSUE, 1), normals(1, 5)
    stiffness, frequency, lower = loops.critical_stiffness(directions, np.full((len(loops), 1), 1.5))
    for pose in range(len(loops)):
        found = loops._single_loop(pose, directions[pose, 0], 1.5)
        assert found == pytest.approx((stiffness[pose, 0], frequency[pose, 0], lower[pose, 0]), rel=1e-6)


@pytest.mark.parametrize("delay", [0, 2])
def test_the_response_of_a_tip_is_that_of_the_matrices_of_its_loop(delay: int) -> None:
    """C (z I - A)^-1 B along a normal, at each angle; a wall's K with a root there is 1 over it."""
    loops, directions = loops_of(THROUGH_TISSUE, delay, gain=0.7), normals(2, 3)
    response = _TipResponse(loops)
    theta = np.array([1e-3, 0.2, 1.1, 3.0])
    whole = response.everywhere(theta, directions)
    assert whole.shape == (len(POSES), 2, 4)
    assert response.complete.all()
    for pose in range(len(POSES)):
        a, entry, out = (
            m[pose]
            for m in assemble_loop(loops.plant, loops.jacobian, loops.geometric_stiffness, loops.controller, delay)
        )
        for k, normal in enumerate(directions[pose]):
            exact = [
                normal @ out @ np.linalg.solve(np.exp(1j * angle) * np.eye(len(a)) - a, entry @ normal)
                for angle in theta
            ]
            np.testing.assert_allclose(whole[pose, k], exact, rtol=1e-7)
            rows = np.full(len(theta), pose)
            along = response.along(theta, rows, np.tile(normal, (len(theta), 1)))
            np.testing.assert_allclose(along, exact, rtol=1e-7)


def test_the_angles_of_a_response_are_dense_and_end_before_the_half_circle() -> None:
    assert np.all(np.diff(ANGLES) > 0.0)
    assert ANGLES[0] == pytest.approx(1e-4)
    assert 3.1 < ANGLES[-1] < np.pi
    assert np.diff(ANGLES).max() < 0.02
    assert np.diff(np.log(ANGLES)).max() < 0.05


def test_roots_are_found_to_rounding_and_in_few_steps() -> None:
    """Of a line, a cubic, an exponential and a line near its end; the value is that at the root."""
    places = np.array([0.3, 0.7, 0.1, 0.9])
    steps = 0

    def evaluate(x: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nonlocal steps
        steps += 1
        off = x - places[row]
        kinds = np.stack([off, off**3 + 0.1 * off, np.expm1(20.0 * off), off])
        return kinds[row, np.arange(len(row))], 5.0 + x

    low, high = np.zeros(4), np.ones(4)
    rows = np.arange(4)
    angle, value = _roots(evaluate, low, high, evaluate(low, rows)[0], evaluate(high, rows)[0])
    np.testing.assert_allclose(angle, places, rtol=2e-9)
    np.testing.assert_allclose(value, 5.0 + places, rtol=2e-9)
    assert steps < 55
    assert (low.tolist(), high.tolist()) == ([0.0] * 4, [1.0] * 4)


@pytest.mark.parametrize("delay", [0, 1, 3])
@pytest.mark.parametrize("arm", [None, HAND, THROUGH_TISSUE])
def test_one_pass_over_a_grid_of_angles_finds_the_interval_and_the_curve(
    arm: HumanArm | None, delay: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A finer pass is for loops whose interval the eigenvalues do not confirm."""
    densities, steps = [], []
    crossings, refine = wall_interval._crossings, boundary_curve._refine
    monkeypatch.setattr(wall_interval, "_crossings", lambda *a: densities.append(a[2]) or crossings(*a))
    monkeypatch.setattr(boundary_curve, "_refine", lambda *a: steps.append(a[4]) or refine(*a))
    loop = wall_loop(LinearDevice.of_mass(0.06, 0.5, arm), 1e-3, delay)
    assert 0.0 < stability_interval(loop, 0.3).stiffness < np.inf
    assert densities == [1]
    found = stability_boundary(loop, points=60)
    assert steps == [0.12]
    limit = stability_interval(loop, float(found.damping[20])).stiffness
    assert found.stiffness[20] == pytest.approx(limit, rel=1e-6)
