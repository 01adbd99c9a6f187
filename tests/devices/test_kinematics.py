"""Where the tip is, how it moves, which poses reach it, and what is said when none does."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from palpate import devices
from palpate.devices.device import Parameters
from palpate.devices.reach import check_reach, near_limits
from palpate.errors import PoseError
from palpate.linear import linearize
from riesz import riesz_derivative

Array = NDArray[np.float64]
ARM = devices.load("phantom-premium-1.5a")
L1, L2 = 0.215, 0.170  # m
SHOULDER = np.array([0.0, L2, -L1])  # in the frame whose origin is the tip at q = 0
ANGLES = hnp.arrays(np.float64, 3, elements=st.floats(-np.pi, np.pi))
VECTORS = hnp.arrays(np.float64, 3, elements=st.floats(-10, 10))


def rotation(q: Array) -> Array:
    """Attitude of the forearm, R = exp(yaw theta1) exp(pitch theta3), as printed in 2.10."""
    s1, c1, s3, c3 = np.sin(q[0]), np.cos(q[0]), np.sin(q[2]), np.cos(q[2])
    return np.array([[c1, -s1 * s3, c3 * s1], [0.0, c3, s3], [-s1, -c1 * s3, c1 * c3]])


def body_jacobian(q: Array) -> Array:
    """Linear rows of the body Jacobian, as printed in 2.14, m/rad."""
    return np.array(
        [
            [L1 * np.cos(q[1]) + L2 * np.sin(q[2]), 0.0, 0.0],
            [0.0, L1 * np.cos(q[1] - q[2]), 0.0],
            [0.0, -L1 * np.sin(q[1] - q[2]), L2],
        ]
    )


@given(ANGLES)
def test_jacobian_is_the_derivative_of_the_tip(q: Array) -> None:
    expected = np.column_stack([riesz_derivative(ARM.forward, q, j) for j in range(3)])
    np.testing.assert_allclose(ARM.jacobian(q), expected, rtol=0, atol=1e-15)


@given(ANGLES)
def test_tip_hessian_is_the_derivative_of_the_jacobian(q: Array) -> None:
    expected = np.stack([riesz_derivative(ARM.jacobian, q, j) for j in range(3)], axis=-1)
    np.testing.assert_allclose(ARM.tip_hessian(q), expected, rtol=0, atol=1e-15)


@given(ANGLES)
def test_jacobian_is_the_body_jacobian_turned_to_the_base(q: Array) -> None:
    """R(q) J_body(q) = dp/dq, so that tau = J_body^T R^T f (3.33) and tau = (dp/dq)^T f are one."""
    np.testing.assert_allclose(ARM.jacobian(q), rotation(q) @ body_jacobian(q), rtol=0, atol=1e-15)


@given(
    ANGLES, hnp.arrays(np.float64, 3, elements=st.floats(-10, 10)), hnp.arrays(np.float64, 3, elements=st.floats(-9, 9))
)
def test_virtual_work(q: Array, qd: Array, force: Array) -> None:
    """The torque J^T f does the work that f does at the tip, whose velocity is taken without the Jacobian."""
    step = 1e-4
    stencil = np.array([1, -8, 0, 8, -1]) / 12
    points = ARM.forward(np.array([q + k * step * qd for k in (-2, -1, 0, 1, 2)]))
    velocity = stencil @ points / step
    assert (ARM.jacobian(q).T @ force) @ qd == pytest.approx(force @ velocity, rel=1e-7, abs=1e-8)


@given(
    st.floats(-np.pi, np.pi),
    st.floats(0.0, np.pi),
    st.floats(0.05, 0.95),
)
def test_forward_undoes_inverse(azimuth: float, elevation: float, reach: float) -> None:
    """Every point between the folded and the stretched arm has a pose, and its tip is the point."""
    distance = (L1 - L2) + reach * 2 * L2
    away = np.array([np.sin(elevation) * np.sin(azimuth), np.cos(elevation), np.sin(elevation) * np.cos(azimuth)])
    point = SHOULDER + distance * away
    assume(np.hypot(point[0], point[2] + L1) > 1e-6)  # the yaw axis has its own test
    np.testing.assert_allclose(ARM.forward(ARM.inverse(point)), point, rtol=0, atol=1e-12)


@settings(max_examples=200)
@given(ANGLES)
def test_inverse_undoes_forward(q: Array) -> None:
    """The pose nearest to the one that made the point is that pose, wherever the Jacobian is regular."""
    assume(abs(np.linalg.det(ARM.jacobian(q))) > 1e-5)
    np.testing.assert_allclose(ARM.inverse(ARM.forward(q), nearest_to=q), q, rtol=0, atol=1e-7)


def test_inverse_without_a_hint_is_the_printed_branch() -> None:
    """(2.11) to (2.13): theta1 = atan2(px, pz + l1), theta2 = gamma + beta, theta3 = theta2 + alpha - pi/2."""
    p = np.array([0.03, -0.02, 0.05])
    across, up = np.hypot(p[0], p[2] + L1), p[1] - L2
    r = np.hypot(across, up)
    beta = np.arctan2(up, across)
    gamma = np.arccos((L1**2 + r**2 - L2**2) / (2 * L1 * r))
    alpha = np.arccos((L1**2 + L2**2 - r**2) / (2 * L1 * L2))
    expected = [np.arctan2(p[0], p[2] + L1), gamma + beta, gamma + beta + alpha - np.pi / 2]
    np.testing.assert_allclose(ARM.inverse(p), expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("point", "why"),
    [
        (np.add(SHOULDER, [0.0, 0.0, 0.5]), r"500\.0 mm from the shoulder, and the arm reaches 385\.0 mm"),
        (np.add(SHOULDER, [0.0, 0.01, 0.02]), r"22\.4 mm from the shoulder, and the folded arm keeps 45\.0 mm away"),
        (np.add(SHOULDER, [0.0, 0.2, 0.0]), "yaw axis"),
        (np.array([0.0, np.nan, 0.0]), "finite"),
        (np.zeros(2), "three finite numbers in m"),
    ],
)
def test_an_unreachable_point_says_why(point: Array, why: str) -> None:
    with pytest.raises(PoseError, match=why):
        ARM.inverse(point)


@pytest.mark.parametrize(
    "q", [[0.0, 0.7, 0.7 + np.pi / 2], [0.0, np.pi / 2, 0.0]], ids=["straight arm", "tip on the yaw axis"]
)
def test_a_singular_pose_is_named(q: list[float]) -> None:
    """Where J loses rank a tip force cannot be turned into every torque; the message names pose and remedy."""
    with pytest.raises(PoseError, match=r"singular at q = .*(choose|inputs in torque)"):
        linearize(ARM, q, inputs="force")


@given(ANGLES, st.floats(-np.pi, np.pi))
def test_yaw_turns_the_tip_about_the_shoulder_axis(q: Array, turn: float) -> None:
    """Turning theta1 is a rotation of tip and Jacobian about the vertical through the shoulder, and nothing else."""
    s, c = np.sin(turn), np.cos(turn)
    yaw = np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])
    turned = np.add(q, [turn, 0.0, 0.0])
    np.testing.assert_allclose(ARM.forward(turned) - SHOULDER, yaw @ (ARM.forward(q) - SHOULDER), rtol=0, atol=1e-14)
    np.testing.assert_allclose(ARM.jacobian(turned), yaw @ ARM.jacobian(q), rtol=0, atol=1e-14)


def test_the_origin_is_the_tip_at_zero() -> None:
    np.testing.assert_allclose(ARM.forward(np.zeros(3)), np.zeros(3), rtol=0, atol=1e-17)


@pytest.mark.parametrize("name", ["phantom-premium-1.5a", "phantom-premium-1.5a-rotors", "slider"])
def test_stacked_states_equal_single_ones(name: str) -> None:
    """A stack (n, dof) is n single calls, bit for bit."""
    device = devices.load(name)
    rng = np.random.default_rng(1)
    q, qd, tau = rng.normal(size=(3, 17, device.dof))
    calls = {
        "forward": (q,),
        "jacobian": (q,),
        "tip_hessian": (q,),
        "mass_matrix": (q,),
        "coriolis": (q, qd),
        "gravity": (q,),
        "energy": (q, qd),
        "acceleration": (q, qd, tau),
    }
    for method, arguments in calls.items():
        stacked = getattr(device, method)(*arguments)
        single = np.array([getattr(device, method)(*(a[i] for a in arguments)) for i in range(len(q))])
        assert stacked.shape == single.shape, method
        np.testing.assert_array_equal(stacked, single, err_msg=method)
    points = device.forward(q)
    np.testing.assert_array_equal(device.inverse(points), [device.inverse(p) for p in points])


@pytest.mark.parametrize(
    "bad", [np.zeros(2), np.zeros((2, 2)), np.zeros((1, 1, 3)), [0.0, np.inf, 0.0], [0.0, np.nan, 0.0]]
)
def test_a_state_of_the_wrong_shape_or_not_finite_is_refused(bad: object) -> None:
    with pytest.raises(PoseError, match="q must"):
        ARM.forward(bad)  # type: ignore[arg-type]


def test_reach_is_checked_before_a_task() -> None:
    """A singular pose and one beyond the limits are refused; a slider has no singular pose."""
    check_reach(ARM, [0.0, 2.2305, 3.2776], "task")
    with pytest.raises(PoseError, match="task: the Jacobian is singular at this pose"):
        check_reach(ARM, [0.0, 2.2305, 2.2305 + np.pi / 2], "task")
    slider = devices.load("slider")
    check_reach(slider, [0.0], "task")
    ends = {"limits.lower": (-0.1,), "limits.upper": (0.3,)}
    limited = devices.Device(slider.name, "", "slider", Parameters({**slider.parameters.values, **ends}))
    for at, remarks in ((-0.1, 1), (0.3, 1), (0.1, 0)):
        assert near_limits(limited, np.array([[at]])) == ["joint 1 comes near its limit"] * remarks
    beyond = np.nextafter(slider.joint_limits[1], np.inf)
    if np.isfinite(beyond).all():
        with pytest.raises(PoseError, match="task: joint 1 of slider is beyond its limits"):
            check_reach(slider, beyond, "task")
