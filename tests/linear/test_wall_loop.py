"""A device along a line, its discretization with any delay, and the loop with a wall, sample by sample."""

from __future__ import annotations

import re
from typing import Any

import control
import numpy as np
import pytest
from palpate import devices
from palpate.errors import PoseError, StabilityError
from palpate.linear.linear_device import MAX_DELAY, HumanArm, LinearDevice, _reachable, couple_arm, discretize_zoh
from palpate.linear.wall import _companion, causal_controller, frequency_values, wall_loop
from scipy.linalg import expm

T = 2e-3
ARM = devices.load("phantom-premium-1.5a").with_viscous([2e-3, 1e-3, 3e-3])
POSE = np.array([0.2, 2.2305, 3.2776])
TISSUE = HumanArm(0.3, 3.0, 150.0, 900.0, 2.0)
RIGID = HumanArm(0.2, 5.0, 250.0)
MASS = LinearDevice.of_mass(0.1, 0.4)
HELD = LinearDevice.of_mass(0.1, 0.4, TISSUE)
MIXED = control.StateSpace([[-3.0, 20.0], [-15.0, -2.0]], [[0.5], [2.0]], [[1.0, 0.7]], [[0.0]])
FILTERED = control.StateSpace([[0.5, 0.1], [0.0, 0.3]], [[0.4], [1.0]], [[0.6, 0.2]], [[0.7]], T)


def fine_motion(
    device: LinearDevice | control.StateSpace, forces: np.ndarray, delay: float, parts: int = 20
) -> np.ndarray:
    """Return the tip at the samples under held forces that act after a delay, in steps of T / parts."""
    system = device.state_space if isinstance(device, LinearDevice) else device
    n = system.nstates
    big = np.zeros((n + 1, n + 1))
    big[:n, :n], big[:n, n:] = system.A, system.B
    step = expm(big * T / parts)
    shift, state, tips = round(delay * parts), np.zeros(n), []
    for k in range(len(forces) * parts):
        if k % parts == 0:
            tips.append(system.C[0] @ state)
        past = (k - shift) // parts
        state = step[:n, :n] @ state + step[:n, n] * (forces[past] if past >= 0 else 0.0)
    return np.array(tips)


@pytest.mark.parametrize("device", [MASS, HELD, LinearDevice.at_pose(ARM, POSE, (1, 2, -1)), MIXED])
@pytest.mark.parametrize("delay", [0.0, 0.35, 1.0, 2.6])
def test_the_discretization_and_its_response_are_those_of_the_motion(device: Any, delay: float) -> None:
    forces = np.random.default_rng(0).normal(size=12)
    tip = discretize_zoh(device, T, delay)
    assert (tip.whole, tip.fractional, tip.period) == (int(delay), delay % 1 > 0, T)
    state, line, found = np.zeros(len(tip.step)), np.zeros(tip.whole + 2), []
    for force in forces:
        line = np.r_[force, line[:-1]]
        found.append(tip.out @ state)
        state = state + tip.step @ state + tip.now * line[tip.whole] + tip.before * line[tip.whole + 1]
    wanted = fine_motion(device, forces, delay)
    np.testing.assert_allclose(found, wanted, atol=1e-9 * np.abs(wanted).max())
    theta = np.array([1e-3, 0.1, 1.0, 3.0])
    for angle, got in zip(theta, tip.response(theta), strict=True):
        z = np.exp(1j * angle)
        gain = tip.out @ np.linalg.solve((z - 1) * np.eye(len(state)) - tip.step, tip.now + tip.before / z)
        assert got == pytest.approx(gain / z**tip.whole, rel=1e-7)


@pytest.mark.parametrize("delay", [0.0, 0.35, 1.0, 2.6])
@pytest.mark.parametrize("alpha", [0.0, 0.6])
@pytest.mark.parametrize("law", [None, FILTERED])
@pytest.mark.parametrize("device", [MASS, HELD])
def test_the_wall_loop_is_its_difference_equations(
    device: LinearDevice, delay: float, alpha: float, law: control.StateSpace | None
) -> None:
    """Force K x + B v by the filtered difference, controller, hold and delay, from any place of the tip."""
    k, b = 300.0, 2.0
    tip = discretize_zoh(device, T, delay)
    loop = wall_loop(device, T, delay, alpha, law)
    assert loop.period == T
    state = np.random.default_rng(1).normal(size=len(tip.step))
    whole = np.zeros(len(loop.base))
    whole[: len(state)] = state
    line, last, speed, memory = np.zeros(tip.whole + 2), 0.0, 0.0, np.zeros(2)
    matrix = loop.matrix(k, b)
    for _ in range(25):
        x = tip.out @ state
        assert loop.position @ whole == pytest.approx(x, rel=1e-8, abs=1e-12)
        speed = alpha * speed + (1 - alpha) * (x - last) / T
        last = x
        assert loop.velocity @ whole == pytest.approx(speed, rel=1e-8, abs=1e-9)
        force = k * x + b * speed
        if law is not None:
            force, memory = (law.C @ memory)[0] + law.D[0, 0] * force, law.A @ memory + law.B[:, 0] * force
        line = np.r_[-force, line[:-1]]
        state = state + tip.step @ state + tip.now * line[tip.whole] + tip.before * line[tip.whole + 1]
        whole = matrix @ whole
        np.testing.assert_allclose(whole[: len(state)], state, rtol=1e-8, atol=1e-10)
    assert loop.spectral_radius(k, b) == pytest.approx(np.abs(np.linalg.eigvals(matrix)).max(), rel=1e-12)
    np.testing.assert_array_equal(wall_loop(tip, None, 0.0, alpha, law).base, loop.base)
    stack = loop.matrix([[k], [2 * k]], [0.0, b, 2 * b])
    assert stack.shape == (2, 3, *matrix.shape)
    np.testing.assert_array_equal(stack[0, 1], matrix)
    np.testing.assert_array_equal(stack[1, 0], loop.matrix("0.6 N/mm"))


@pytest.mark.parametrize("law", [None, FILTERED])
@pytest.mark.parametrize("alpha", [0.0, 0.6])
def test_a_root_of_the_loop_needs_the_wall_response_of_its_angle(law: Any, alpha: float) -> None:
    """det(z - A(K, B)) is zero for the K and B that give W(theta), real and imaginary part."""
    loop = wall_loop(MASS, T, 1.5, alpha, law)
    theta = np.array([0.05, 0.4, 1.2, 2.5])
    wanted, rate = loop.required_wall_response(theta), loop.velocity_response(theta)
    for angle, w, v in zip(theta, wanted, rate, strict=True):
        b = w.imag / v.imag
        values = np.linalg.eigvals(loop.matrix(w.real - b * v.real, b))
        assert np.abs(values - np.exp(1j * angle)).min() < 1e-6


def test_a_device_along_a_line_is_that_of_its_linearization() -> None:
    """Apparent mass, response to a force along the line, and the name for verdicts."""
    along = np.array([1.0, 2.0, -1.0])
    unit = along / np.linalg.norm(along)
    for arm, said in (
        (None, ""),
        (RIGID, ", gripped rigidly by an arm of 0.2 kg, 5 N s/m, 250 N/m"),
        (TISSUE, ", held through fingertip tissue of 900 N/m by an arm of 0.3 kg, 3 N s/m, 150 N/m"),
    ):
        got = LinearDevice.at_pose(ARM, POSE, along, arm)
        assert got.name == f"phantom-premium-1.5a along {np.round(unit, 6).tolist()}{said}"
        np.testing.assert_allclose(got.along, unit, rtol=1e-15)
        row = got.along @ got.jacobian
        assert got.apparent_mass == pytest.approx(1 / (row @ np.linalg.inv(got.inertia) @ row), rel=1e-12)
        for s in (3j, 40j, -20.0 + 10j):
            exact = row @ np.linalg.solve(got.inertia * s * s + got.damping * s + got.stiffness, row)
            system = got.state_space
            found = (system.C @ np.linalg.solve(s * np.eye(system.nstates) - system.A, system.B))[0, 0]
            assert found == pytest.approx(exact, rel=1e-8)
    bare = LinearDevice.at_pose(ARM, POSE, along)
    torque, step = ARM.gravity(POSE), 1e-6
    np.testing.assert_array_equal(bare.inertia, ARM.mass_matrix(POSE))
    np.testing.assert_allclose(bare.damping, np.diag([2e-3, 1e-3, 3e-3]), atol=1e-12)
    force = np.linalg.solve(ARM.jacobian(POSE).T, torque)
    slope = [
        (ARM.gravity(POSE + step * e) - ARM.gravity(POSE - step * e)
         - (ARM.jacobian(POSE + step * e) - ARM.jacobian(POSE - step * e)).T @ force) / (2 * step)
        for e in np.eye(3)
    ]  # fmt: skip
    np.testing.assert_allclose(bare.stiffness, np.array(slope).T, atol=1e-8)
    assert LinearDevice.at_pose(ARM, POSE).along.tolist() == [1.0, 0.0, 0.0]


def test_an_arm_adds_its_energy_to_a_stack_of_devices() -> None:
    draw = np.random.default_rng(0)
    m, d, s = draw.normal(size=(3, 4, 3, 3))
    jacobian = draw.normal(size=(4, 2, 3))
    x, hand = draw.normal(size=3), draw.normal(size=2)
    rigid, soft = couple_arm(m, d, s, jacobian, RIGID), couple_arm(m, d, s, jacobian, TISSUE)
    for k in range(4):
        tip = jacobian[k] @ x
        own = [x @ one[k] @ x for one in (m, d, s)]
        for got, one, hold in zip(rigid, own, (0.2, 5.0, 250.0), strict=False):
            assert x @ got[k] @ x == pytest.approx(one + hold * tip @ tip)
        np.testing.assert_array_equal(rigid[3][k], jacobian[k])
        both, stretch = np.r_[x, hand], tip - hand
        for got, one, hold, tissue in zip(soft, own, (0.3, 3.0, 150.0), (0.0, 2.0, 900.0), strict=False):
            wanted = one + hold * hand @ hand + tissue * stretch @ stretch
            assert both @ got[k] @ both == pytest.approx(wanted)
        np.testing.assert_allclose(soft[3][k] @ both, tip, rtol=1e-12)


def test_the_reachable_space_is_invariant_and_no_larger_than_needed() -> None:
    draw = np.random.default_rng(0)
    turn = np.linalg.qr(draw.normal(size=(6, 6)))[0]
    blocks = np.zeros((2, 6, 6))
    blocks[:, :3, :3], blocks[:, 3:, 3:] = draw.normal(size=(2, 3, 3)), draw.normal(size=(2, 3, 3))
    maps = tuple(turn @ one @ turn.T for one in blocks)
    for size, start in ((3, turn[:, 0]), (6, turn[:, 0] + turn[:, 4]), (1, turn[:, 1])):
        used = maps if size > 1 else (np.eye(6), 0 * np.eye(6))
        basis = _reachable(start, used)
        assert basis.shape == (6, size)
        np.testing.assert_allclose(basis.T @ basis, np.eye(size), atol=1e-12)
        np.testing.assert_allclose(basis @ basis.T @ start, start, atol=1e-12)
        for one in used:
            np.testing.assert_allclose(basis @ basis.T @ one @ basis, one @ basis, atol=1e-9)


@pytest.mark.parametrize(
    ("top", "bottom"), [([2.0], [4.0]), ([3.0], [2.0, 1.0]), ([1.0, 2.0, 3.0], [2.0, 0.5, -0.2]), ([1, 4], [2, 1, 0.3])]
)
def test_a_transfer_function_keeps_its_values_as_a_state_space(top: list[float], bottom: list[float]) -> None:
    z = np.exp(1j * np.array([0.1, 1.0, 3.0]))
    a, b, c, d = _companion(np.array(top, float), np.array(bottom, float))
    assert len(a) == len(bottom) - 1
    system = control.StateSpace(a, b, c, d, T)
    wanted = np.polyval(top, z) / np.polyval(bottom, z)
    np.testing.assert_allclose(frequency_values(system, z), wanted, rtol=1e-12)
    made = causal_controller(control.TransferFunction([0.0, *top], bottom, T), T)
    np.testing.assert_allclose(frequency_values(made, z), wanted, rtol=1e-12)
    assert frequency_values(made, z).shape == (3,)


TF = control.TransferFunction
SS = control.StateSpace


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: causal_controller(TF([1, 0, 0], [1, 0.5], T), T),
         "the controller is not causal: its numerator has degree 2 and its denominator 1, so it would need samples of "
         "the future"),
        (lambda: causal_controller(SS(np.zeros((1, 1)), np.ones((1, 2)), [[1]], np.zeros((1, 2)), T), T),
         "the controller must be a sampled control system from one force to one force"),
        (lambda: causal_controller(1.0, T), "the controller must be a sampled control system from one force to one "
         "force"),
        (lambda: causal_controller(TF([1], [1, 1]), T), "the controller is continuous: sample it with the servo "
         "period first"),
        (lambda: causal_controller(TF([1], [1, 0.5], 1e-3), T),
         "the controller is sampled every 0.001 s and the loop every 0.002 s"),
        (lambda: causal_controller(TF([1], [1, 1.5], T), T),
         "the controller itself is unstable (a pole of modulus 1.5): give a stable one"),
        (lambda: wall_loop(MASS), "period is missing: the loop's servo period in s"),
        (lambda: discretize_zoh(MASS, T, MAX_DELAY + 1), "delay: 1001 samples; the most is 1000"),
        (lambda: discretize_zoh(3.0, T),  # type: ignore[arg-type]
         "the device must be a LinearDevice or a continuous control.StateSpace, not float; for an arm use "
         "LinearDevice.at_pose(arm, pose, along=(0, 0, 1))"),
        (lambda: discretize_zoh(SS(0, 1, 1, 0, T), T), "the device must be continuous, from one force to one "
         "displacement; palpate discretizes it exactly"),
        (lambda: discretize_zoh(SS(0, [[1, 1]], 1, [[0, 0]]), T), "the device must be continuous, from one force to "
         "one displacement; palpate discretizes it exactly"),
        (lambda: discretize_zoh(SS(0, 1, 1, 0.1), T),
         "the device has a direct feedthrough: its D must be zero; add inertia"),
        (lambda: LinearDevice.at_pose(ARM, POSE, (0, 0, 0)),
         "along must be a direction (3,) in the base frame, not [0.0, 0.0, 0.0]"),
        (lambda: LinearDevice.at_pose(ARM, POSE, (1, 0)),
         "along must be a direction (3,) in the base frame, not [1.0, 0.0]"),
        (lambda: LinearDevice.at_pose(ARM, POSE, (np.inf, 0, 0)),
         "along must be a direction (3,) in the base frame, not [inf, 0.0, 0.0]"),
    ],
)  # fmt: skip
def test_what_fits_no_loop_is_refused(call: Any, says: str) -> None:
    with pytest.raises(StabilityError) as caught:
        call()
    assert str(caught.value) == says


def test_limits_of_what_is_allowed() -> None:
    assert discretize_zoh(MASS, T, MAX_DELAY).whole == 1000
    assert causal_controller(TF([1], [1, -1], T), T).nstates == 1  # an integrator
    assert causal_controller(TF([1], [1, 0.5], True), T).nstates == 1
    slider = devices.load("slider")
    with pytest.raises(PoseError, match=re.escape("slider cannot be pushed along [0.0, 1.0, 0.0] at [0.0]: choose ")):
        LinearDevice.at_pose(slider, [0.0], (0.0, 1.0, 0.0))
    assert LinearDevice.at_pose("slider", [0.0], (1e-3, 1.0, 0.0)).apparent_mass > 0.0


def test_an_arm_and_a_mass_take_text_and_refuse_what_is_negative() -> None:
    assert HumanArm("300 g", "3 N*s/m", "0.15 N/mm", "0.9 N/mm", "2 N*s/m") == TISSUE  # type: ignore[arg-type]
    assert HumanArm(0.0, 0.0, 0.0).tissue_stiffness is None
    for values, says in (
        ((-1.0, 0, 0), "the arm's mass"), ((1, -1, 0), "the arm's damping"), ((1, 0, -1), "the arm's stiffness"),
        ((1, 0, 0, -1), "the fingertip's stiffness"), ((1, 0, 0, 1, -1), "the fingertip's damping"),
        ((0.0, 0, 0, 1.0), "the mass of an arm behind fingertip tissue"),
    ):  # fmt: skip
        with pytest.raises(StabilityError, match=f"^{says}"):
            HumanArm(*values)
    mass = LinearDevice.of_mass("100 g", "0.4 N*s/m")
    assert mass.name == "a mass of 0.1 kg with 0.4 N s/m" == MASS.name
    assert [x.item() for x in (mass.inertia, mass.damping, mass.stiffness, mass.jacobian)] == [0.1, 0.4, 0.0, 1.0]
    assert LinearDevice.of_mass(0.1).damping == 0.0
