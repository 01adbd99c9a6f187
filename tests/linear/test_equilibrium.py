"""Equilibria, modes and the linear model: stored results, the stability of given slopes, and every refusal."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from fingerprint import fingerprint
from palpate import devices
from palpate.errors import DesignError, PoseError
from palpate.linear import discretize, equilibria, linearize, modes
from palpate.linear.eigenmodes import damping_effect
from palpate.linear.equilibrium import _classify, _free_joints, _newton
from palpate.linear.linearization import require_regular, static_tip_force

ARM = devices.load("phantom-premium-1.5a").with_viscous([2e-3, 1e-3, 3e-3])
POSE = np.array([0.2, 2.2305, 3.2776])
FORCE = np.array([0.05, -0.02, 0.1])
SAID = [
    [(1, True), (1, False), (1, False), (1, False)],
    [
        (0, True),
        (0, True),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
        (0, False),
    ],
    [(1, True), (1, False), (1, False), (1, False)],
]
POSES = [23.619412, 37.171506, 32.287233]
MODELS = [
    [25.399339, 26.112002, 25.542007, 9.438793],
    [21.672025, 26.112002, -7.091034, 9.438793],
    [22.932372, -0.756648, -5.175364, 9.438793],
    [21.470527, -0.885616, 25.542007, 9.438793],
    [38.316664, 29.804338, 25.320974, 12.918871],
    [38.316818, 23.58967, 25.542007, 9.438793],
    [42.613896, 28.481764, 25.542007, 9.438793],
]


def test_equilibria_are_the_stored_ones() -> None:
    """Pose, torque, free directions and stability, in order, under a torque and under a force."""
    torque = ARM.gravity(POSE)
    found = [
        equilibria(ARM, torque=torque, starts=5),
        equilibria(ARM, force=FORCE, starts=4),
        equilibria(ARM, torque=[0] * 3),
    ]
    said = [[(one.free, one.stable) for one in each] for each in found]
    assert said == SAID
    poses = []
    for each in found:  # sorted: angles that are equal but for rounding come in any order
        angle, load = np.array([one.q for one in each]), np.array([one.torque for one in each])
        poses.append(
            fingerprint(np.sort(np.hstack([np.cos(angle), np.sin(angle), 10.0 * load]).round(9) + 0.0, axis=0))
        )
    assert poses == pytest.approx(POSES, abs=1e-5)
    for one in found[1]:
        np.testing.assert_allclose(one.torque, ARM.jacobian(one.q).T @ FORCE, atol=1e-12)
        np.testing.assert_allclose(ARM.gravity(one.q), one.torque, atol=1e-9)
        assert np.all((one.q >= 0.0) & (one.q < 2 * np.pi))


@pytest.mark.parametrize(
    ("slope", "free", "stable"),
    [
        (np.diag([-1.0, -2.0, -3.0]), 0, True),
        (np.diag([1.0, -2.0, -3.0]), 0, False),
        (np.diag([0.0, -2.0, -3.0]), 1, True),
        (np.diag([0.5e-6, -1000.0, 0.0]), 2, True),
        (np.diag([1.5e-6, -1000.0, 0.0]), 1, False),
        (np.diag([0.5e-9, -0.1, -0.2]), 1, True),
        (np.diag([1.5e-9, -0.1, -0.2]), 0, False),
        (np.array([[-1.0, 2.0, 0.0], [-2.0, -1.0, 0.0], [0.0, 0.0, -1.0]]), 0, False),  # flutter
        (np.array([[-1.0, 1e-8, 0.0], [-1e-8, -1.0, 0.0], [0.0, 0.0, -1.0]]), 0, False),
    ],
)
def test_a_pose_is_stable_if_no_undamped_mode_grows(slope: np.ndarray, free: int, stable: bool) -> None:
    found = _classify(POSE, slope, FORCE)
    assert (found.free, found.stable) == (free, stable)
    assert found.q is POSE
    assert found.torque is FORCE


def test_a_step_of_newton_is_at_most_half_a_radian() -> None:
    asked: list[float] = []

    def line(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        asked.append(float(q[0]))
        return 3.0 * (q - 1.7), np.array([[3.0]]), q

    found = _newton(line, np.zeros(1))
    assert found is not None
    assert found[0] == pytest.approx(1.7, abs=1e-12)
    assert asked[:5] == pytest.approx([0.0, 0.5, 1.0, 1.5, 1.7])
    assert _newton(line, np.zeros(1), steps=3) is None
    assert _newton(lambda q: (q * q + 1.0, np.diag(2.0 * q), q), np.ones(1)) is None
    asked.clear()
    _newton(line, np.full(1, 1.7))
    assert len(asked) == 2


def test_the_joints_without_gravity_are_found() -> None:
    assert _free_joints(ARM).tolist() == [True, False, False]
    assert _free_joints(devices.load("slider")).tolist() == [True]


def test_modes_come_by_frequency_with_the_positive_imaginary_part_first() -> None:
    a = np.zeros((6, 6))
    a[:2, :2], a[2:4, 2:4], a[4, 4] = [[-1.0, 5.0], [-5.0, -1.0]], [[-0.2, 2.0], [-2.0, -0.2]], -3.0
    found = modes(control.StateSpace(a, np.ones((6, 1)), np.ones((1, 6)), 0))
    assert [one.pole for one in found] == pytest.approx([0, -0.2 + 2j, -0.2 - 2j, -3, -1 + 5j, -1 - 5j])
    assert [one.frequency for one in found] == pytest.approx([0.0, 4.04**0.5, 4.04**0.5, 3.0, 26**0.5, 26**0.5])
    assert [one.damping for one in found] == pytest.approx([1, 0.2 / 4.04**0.5, 0.2 / 4.04**0.5, 1, 26**-0.5, 26**-0.5])
    for size, zero in ((0.5e-12, True), (2e-12, False)):
        (slow, _) = modes(control.StateSpace(np.diag([-size * 7.0, -7.0]), np.ones((2, 1)), np.ones((1, 2)), 0))
        assert (slow.pole == 0) is zero
    late, _ = modes(control.StateSpace(np.diag([0.5, 0.0]), np.ones((2, 1)), np.ones((1, 2)), 0, 0.1))
    assert late.pole == pytest.approx(np.log(0.5) / 0.1)
    dead = modes(control.StateSpace(np.diag([0.5, 0.0]), np.ones((2, 1)), np.ones((1, 2)), 0, 0.1))[1]
    assert (dead.frequency, dead.damping) == (np.inf, 1.0)
    assert modes(control.StateSpace([], [], [], [[1.0]])) == []
    still, damped = damping_effect(ARM, POSE)
    assert [one.pole for one in still] == [one.pole for one in modes(linearize(ARM.frictionless(), POSE))]
    assert [one.pole for one in damped] == [one.pole for one in modes(linearize(ARM, POSE))]


def test_linear_models_are_the_stored_ones() -> None:
    systems = [
        linearize(ARM, POSE), linearize(ARM, POSE, [0.3, -0.2, 0.1], [0.01, 0.02, -0.03], outputs="tip"),
        linearize(ARM, POSE, inputs="force", outputs="object_force", stiffness=[1.0, 2.0, 3.0]),
        linearize(ARM, ["10 deg", "2.2 rad", "3.3 rad"], inputs="force", force=FORCE),
        discretize(linearize(ARM, POSE), "2 ms", "tustin"), discretize(linearize(ARM, POSE), 2e-3, "series", order=3),
        discretize(linearize(ARM, POSE), 0.05, "series"),
    ]  # fmt: skip
    found = [[fingerprint(one) for one in (s.A, s.B, s.C, s.D)] for s in systems]
    assert found == [pytest.approx(one, abs=1e-5) for one in MODELS]
    assert systems[2].output_labels == [f"object_force[{a}]" for a in "xyz"]
    assert systems[1].output_labels == [f"tip[{a}]" for a in "xyz"]
    assert systems[0].output_labels == ["angle[1]", "angle[2]", "angle[3]"]
    assert systems[0].input_labels == ["torque[1]", "torque[2]", "torque[3]"]
    assert systems[3].input_labels == [f"force[{a}]" for a in "xyz"]
    assert systems[4].state_labels == [f"{kind}[{i}]" for kind in ("angle", "velocity") for i in (1, 2, 3)]
    np.testing.assert_allclose(ARM.jacobian(POSE).T @ static_tip_force(ARM.jacobian(POSE), FORCE), FORCE, atol=1e-12)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: equilibria(ARM), "equilibria: give either torque (N m) or force (N)"),
        (lambda: equilibria(ARM, torque=[0, 0, 0], force=[0, 0, 0]),
         "equilibria: give either torque (N m) or force (N)"),
        (lambda: equilibria(ARM, torque=[9.0, 0, 0], starts=2),
         "phantom-premium-1.5a has no equilibrium under torque [9.0, 0.0, 0.0] N m: gravity cannot balance it at any "
         "pose, so reduce the load (a joint without gravity needs exactly zero)"),
        (lambda: linearize(ARM, POSE, force=FORCE),
         'linearize: force is only for inputs="force"; with inputs="torque" pass tau'),
        (lambda: linearize(ARM, POSE, inputs="x"), 'linearize: inputs must be "torque" or "force", not \'x\''),
        (lambda: linearize(ARM, POSE, outputs="x"),
         'linearize: outputs must be "angle", "tip" or "object_force", not \'x\''),
        (lambda: linearize(ARM, POSE, outputs="object_force"),
         'linearize: outputs="object_force" needs the object\'s stiffness in N/m'),
        (lambda: linearize(ARM, POSE, stiffness=1.0), 'linearize: stiffness is only for outputs="object_force"'),
        (lambda: linearize(ARM, POSE, outputs="object_force", stiffness=[1.0, -1.0, 0.0]),
         "linearize: stiffness must be finite and not negative in N/m, not [1.0, -1.0, 0.0]"),
        (lambda: linearize(ARM, POSE, outputs="object_force", stiffness=[1.0, np.inf, 0.0]),
         "linearize: stiffness must be finite and not negative in N/m, not [1.0, inf, 0.0]"),
        (lambda: linearize(ARM, POSE[:2]), "q must be 3 values in rad, not an array of shape (2,)"),
        (lambda: linearize(ARM, POSE, [0.0]), "qd must be 3 values in rad/s, not an array of shape (1,)"),
        (lambda: linearize(ARM, POSE, None, [0.0]), "tau must be 3 values in N*m, not an array of shape (1,)"),
        (lambda: require_regular(np.diag([1.0, 0.5, 1e-9]), np.zeros(3)),
         "the Jacobian is singular at q = [0.0, 0.0, 0.0] rad (singular values 1, 0.5, 1e-09 m/rad): choose a pose off "
         "the singularity, or inputs in torque"),
    ],
)  # fmt: skip
def test_what_has_no_linear_model_is_refused(call: Any, says: str) -> None:
    with pytest.raises(PoseError) as caught:
        call()
    assert str(caught.value) == says


def test_limits_of_the_discretization_and_the_linear_model() -> None:
    require_regular(np.diag([1.0, 0.5, 1.1e-9]), np.zeros(3))
    assert linearize(ARM, POSE, outputs="object_force", stiffness=0.0).C.any() is np.False_
    system = linearize(ARM, POSE)
    sampled = discretize(system, 1e-3)
    with pytest.raises(DesignError) as caught:
        discretize(sampled, 1e-3)
    assert str(caught.value) == "discretize: the system is sampled already (dt = 0.001); pass a continuous one"
    with pytest.raises(DesignError, match=r"^discretize: Tustin has no result for a pole at 2/T = 2000 1/s$"):
        discretize(
            control.StateSpace([[2000.0]], [[1.0]], [[1.0]], [[0.0]]) * control.StateSpace([[1.0]], 1, 1, 0),
            1e-3,
            "tustin",
        )
    with pytest.raises(DesignError, match=r"^discretize: the series needs an order of at least 2, not 1$"):
        discretize(system, 1e-3, "series", order=1)
    assert discretize(system, 1e-3, "series", order=2).dt == 1e-3
