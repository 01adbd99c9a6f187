"""Reach of a device: limits, turns and singular poses, each on both sides of its bound."""

from __future__ import annotations

import warnings
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import devices
from palpate.devices import Device
from palpate.devices.device import Parameters
from palpate.devices.reach import (
    NEAR_SINGULAR,
    SINGULAR,
    beyond_reach,
    check_reach,
    conditioning,
    excursion_beyond,
    near_limits,
    unreachable,
)
from palpate.errors import PalpateWarning, PoseError

ARM, SLIDER, PLANE = (devices.load(name) for name in ("phantom-premium-1.5a", "slider", "haply-2diy"))
POSE = np.array([0.0, 2.2305, 3.2776])


def limited(device: Device, lower: Any, upper: Any) -> Device:
    limits = {"limits.lower": tuple(lower), "limits.upper": tuple(upper)}
    return replace(device, parameters=Parameters({**device.parameters.values, **limits}))


def near(ratio: float) -> np.ndarray:
    """Return a pose of the arm whose Jacobian's singular values have this ratio."""
    low, high = 2.0, np.pi  # angles between the links: from far to stretched
    for _ in range(80):
        middle = 0.5 * (low + high)
        pose = np.array([0.0, 2.2305, 2.2305 + middle - np.pi / 2.0])
        low, high = (middle, high) if conditioning(ARM, pose[None])[0] > ratio else (low, middle)
    return np.array([0.0, 2.2305, 2.2305 + low - np.pi / 2.0])


def test_the_conditioning_is_the_ratio_of_the_singular_values_whatever_the_unit_of_length() -> None:
    poses = np.random.default_rng(0).uniform(-1.0, 1.0, (5, 3)) + POSE
    expected = [np.linalg.svd(ARM.jacobian(pose), compute_uv=False) for pose in poses]
    np.testing.assert_allclose(conditioning(ARM, poses), [values[2] / values[0] for values in expected])
    plane = np.array([[1.0, 2.0], [0.9, 2.2]])
    expected = [np.linalg.svd(PLANE.jacobian(pose), compute_uv=False) for pose in plane]
    np.testing.assert_allclose(conditioning(PLANE, plane), [values[1] / values[0] for values in expected])
    np.testing.assert_allclose(conditioning(SLIDER, np.array([[0.0], [0.1]])), [1.0, 1.0])


def test_a_joint_beyond_its_limits_or_turned_round_is_beyond_reach() -> None:
    """A limit itself and a whole turn are within."""
    device = limited(ARM, [-1.0, 2.0, 3.0], [1.0, 2.5, 3.5])
    for joint, (low, high) in enumerate(((-1.0, 1.0), (2.0, 2.5), (3.0, 3.5))):
        for value, beyond in ((low, False), (high, False), (low - 1e-9, True), (high + 1e-9, True)):
            pose = POSE.copy()
            pose[joint] = value
            assert beyond_reach(device, POSE, pose).tolist() == [beyond]
    turn = 2.0 * np.pi
    for moved, beyond in (
        (turn, False),
        (-turn, False),
        (turn + 1e-6, True),
        (-turn - 1e-6, True),
        (0.6 * turn, False),
    ):
        pose = np.array([moved, 2.2305, 3.2776])
        assert beyond_reach(ARM, POSE * [0, 1, 1], pose)[0] == beyond
        around = np.array([[0.5, 2.2305, 3.2776]])
        least, greatest = around.copy(), around.copy()
        (least if moved < 0 else greatest)[0, 0] += moved
        assert excursion_beyond(ARM, around[0], least, greatest, around).tolist() == [beyond]
    assert beyond_reach(SLIDER, [0.0], [[100.0], [-100.0]]).tolist() == [False, False]


def test_a_singular_pose_is_beyond_reach_unless_the_start_is() -> None:
    fine, edge = near(1.01 * SINGULAR), near(0.99 * SINGULAR)
    assert beyond_reach(ARM, POSE, np.array([fine, edge])).tolist() == [False, True]
    assert beyond_reach(ARM, edge, np.array([fine, edge])).tolist() == [False, False]
    same = np.array([POSE, POSE])
    assert excursion_beyond(ARM, POSE, same, same, np.array([edge, fine])).tolist() == [True, False]
    assert (SINGULAR, NEAR_SINGULAR) == (0.005, 0.05)


def test_poses_near_a_singular_one_or_a_limit_are_remarked() -> None:
    """The worst of them; of a joint's range 2 % are near, and beyond its limits nothing is said."""
    fine, edge = near(1.01 * NEAR_SINGULAR), near(0.99 * NEAR_SINGULAR)
    assert near_limits(ARM, np.array([POSE, fine])) == []
    factor = 1.0 / conditioning(ARM, edge[None])[0]
    assert near_limits(ARM, np.array([POSE, edge, POSE])) == [
        f"the pose comes near a singular one: the Jacobian's singular values differ by a factor of {factor:.3g}"
    ]
    plane = limited(PLANE, [0.0, 0.0], [2.0, 4.0])
    for second, told in ((3.921, True), (3.919, False), (4.0, True), (4.001, False), (0.079, True), (-0.001, False)):
        found = [remark for remark in near_limits(plane, np.array([[1.0, 2.0], [1.0, second]])) if "joint" in remark]
        if conditioning(PLANE, np.array([[1.0, second]]))[0] > NEAR_SINGULAR:
            assert found == (["joint 2 comes near its limit"] if told else [])
    device = limited(SLIDER, [-1.0], [1.0])
    for place, told in ((0.961, True), (0.959, False), (-0.961, True), (1.0, True), (1.01, False), (0.0, False)):
        assert near_limits(device, np.array([[0.0], [place]])) == (["joint 1 comes near its limit"] if told else [])
    far = limited(SLIDER, [99.0], [101.0])
    assert near_limits(far, np.array([[100.0]])) == []
    assert near_limits(far, np.array([[100.97]])) == ["joint 1 comes near its limit"]
    arm = limited(ARM, [-1.0, 2.2, 3.0], [1.0, 4.0, 3.5])
    assert near_limits(arm, POSE[None]) == ["joint 2 comes near its limit"]


def test_a_pose_for_a_task_is_within_reach_or_refused_or_warned_of() -> None:
    device = limited(ARM, [-1.0, 2.0, 3.0], [1.0, 2.5, 3.5])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_reach(device, POSE, "it")
        check_reach(ARM, near(1.01 * NEAR_SINGULAR), "it")
        check_reach(SLIDER, [5.0], "it")
    for pose, joint in (([0.0, 2.51, 3.2], 2), ([0.0, 2.2, 2.99], 3), ([-1.01, 2.6, 3.2], 1)):
        with pytest.raises(PoseError) as caught:
            check_reach(device, pose, "it")
        told = f"it: joint {joint} of phantom-premium-1.5a is beyond its limits; choose another pose"
        assert str(caught.value) == told
    with pytest.warns(PalpateWarning, match=r"^it: joint 1 comes near its limit$") as found:
        check_reach(device, [1.0, 2.2305, 3.2776], "it")
    with pytest.warns(PalpateWarning, match=r"^it: the pose comes near a singular one"):
        check_reach(ARM, near(1.01 * SINGULAR), "it")
    with pytest.raises(PoseError) as caught:
        check_reach(ARM, near(0.99 * SINGULAR), "it")
    assert str(caught.value) == (
        "it: the Jacobian is singular at this pose (ratio of its singular values 0.005, below 0.005): choose a pose "
        "off the singularity"
    )

    def caller() -> None:
        check_reach(device, [1.0, 2.2305, 3.2776], "it")

    with pytest.warns(PalpateWarning) as found:
        caller()  # the warning is that of the line that called the function
    assert found[0].filename == __file__


def test_a_displacement_is_unreachable_where_no_pose_has_the_tip() -> None:
    """On single axes an unknown one counts as zero, and one that is unknown altogether can be reached."""
    nan = np.nan
    moves = np.array([[0.0, 0.0, 1e-3], [1.0, 0.0, 0.0], [nan, nan, nan], [nan, 1e-3, nan], [nan, nan, 1.0], [0.0] * 3])
    assert unreachable(ARM, POSE, moves).tolist() == [False, True, False, False, True, False]
    device = limited(ARM, [-0.01, 2.0, 3.0], [0.01, 2.5, 3.5])
    sideways = np.array([[10e-3, 0.0, 0.0], [0.1e-3, 0.0, 0.0], [10e-3, 0.0, 0.0]])
    assert unreachable(device, POSE, sideways).tolist() == [True, False, True]
    assert unreachable(ARM, POSE, [0.0, 0.0, 1e-3]).tolist() == [False]


def test_a_planar_device_has_singular_poses_and_a_single_joint_has_none() -> None:
    """The links of the five-bar are stretched where its singular values are far apart."""
    poses = np.stack(np.meshgrid(np.linspace(-1.5, 3.0, 60), np.linspace(0.0, 4.5, 60)), axis=-1).reshape(-1, 2)
    with np.errstate(invalid="ignore"):
        known = poses[[bool(np.isfinite(PLANE.jacobian(pose)).all()) for pose in poses]]
    ratios = conditioning(PLANE, known)
    near_one = known[(ratios < NEAR_SINGULAR) & (ratios > SINGULAR)][0]
    assert near_limits(PLANE, near_one[None])[0].startswith("the pose comes near a singular one: ")
    good, bad = known[np.argmax(ratios)], near_one
    for _ in range(60):  # towards the pose whose ratio is least
        step = 1e-4 * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
        around = np.array([bad, *(bad + 10.0 * step), *(bad + step)])
        around = around[[bool(np.isfinite(PLANE.jacobian(pose)).all()) for pose in around]]
        bad = around[np.argmin(conditioning(PLANE, around))]
    assert conditioning(PLANE, bad[None])[0] < SINGULAR
    with pytest.raises(PoseError, match="the Jacobian is singular at this pose"):
        check_reach(PLANE, bad, "it")
    assert beyond_reach(PLANE, good, bad).tolist() == [True]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_reach(PLANE, good, "it")


def test_the_bounds_of_the_conditioning_belong_to_what_is_within() -> None:
    """Of a Jacobian that is diagonal, whose singular values are its entries."""

    def device(ratio: float, dof: int = 2) -> Any:
        free = np.full(dof, np.inf)
        jacobian = np.array([[1.0, 0.0], [0.0, ratio], [0.0, 0.0]])[:, :dof]
        model = SimpleNamespace(revolute=True)
        return SimpleNamespace(
            name="it",
            dof=dof,
            model=model,
            joint_limits=(-free, free),
            jacobian=lambda q: np.array([jacobian] * len(q)),
        )

    q = np.zeros((1, 2))
    for ratio, remarked in ((NEAR_SINGULAR, False), (np.nextafter(NEAR_SINGULAR, 0.0), True)):
        assert bool(near_limits(device(ratio), q)) is remarked
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        check_reach(device(SINGULAR), q[0], "it")
        with pytest.raises(PoseError, match="singular"):
            check_reach(device(np.nextafter(SINGULAR, 0.0)), q[0], "it")
    assert conditioning(device(0.0), q)[0] == 0.0
