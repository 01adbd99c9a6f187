"""Measures of a device and its two-port, each against a closed form."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.devices import Device, load
from palpate.devices.device import Parameters
from palpate.errors import PoseError, StabilityError
from palpate.metrics import (
    LoopResponse,
    TwoPort,
    device_measures,
    hold_response,
    measure_performance,
    moving_force,
    peak_acceleration,
    peak_force,
    tip_inertia,
    two_port,
)
from palpate.metrics.device_performance import most_within_limits
from palpate.scenario import Scenario
from palpate.stability import llewellyn

ARM, FIVE_BAR = load("phantom-premium-1.5a"), load("haply-2diy")
POSE, FLAT = np.array([0.2, 1.9, 2.9]), np.array([1.2, 2.0])
MASS, B, T = 0.06, 0.05, 1e-3  # the slider


def box(**numbers: Any) -> Device:
    """Return three sliding axes of 80, 80 and 120 g."""
    values = {"mass.apparent": (0.08, 0.08, 0.12), "friction.viscous": (0.0,) * 3}
    return Device(
        "box", "", "tip_device", Parameters({**values, **{k.replace("__", "."): v for k, v in numbers.items()}})
    )


def test_three_sliding_axes_in_closed_form() -> None:
    device = box(
        drive__peak_force=(8.0,),
        drive__continuous_force=(2.0,),
        drive__encoder_step=(1e-5, 1e-5, 2e-5),
        friction__coulomb=(0.2, 0.1, 0.1),
        friction__breakaway=(0.2, 0.1, 0.1),
    )
    m = device_measures(device, np.zeros(3))
    assert m.peak_force == pytest.approx((8.0, 8.0))
    assert m.continuous_force == pytest.approx((2.0, 2.0))
    assert m.tip_mass == pytest.approx((0.08, 0.12))
    assert m.peak_acceleration == pytest.approx((8.0 / 0.12, 8.0 / 0.08))
    assert (m.kinematic_isotropy, m.inertial_isotropy) == pytest.approx((1.0, 0.08 / 0.12))
    assert m.moving_force == pytest.approx((0.1, 0.2))
    assert m.dynamic_range == pytest.approx(20 * np.log10(8.0 / 0.2))
    assert m.resolution == pytest.approx(2e-5)
    # along a diagonal the first joint to move decides
    assert moving_force(device, np.zeros(3), [1, 1, 0]) == pytest.approx(0.1 * np.sqrt(2))


def test_without_limit_friction_and_encoder() -> None:
    m = device_measures(box(), np.zeros(3))
    assert m.peak_force == m.peak_acceleration == (np.inf, np.inf)
    assert m.moving_force == (0.0, 0.0)
    assert m.dynamic_range == np.inf
    assert m.resolution == 0.0


@pytest.mark.parametrize("direction", [[1, 0, 0], [0, 1, 0], [0, -1, 0], [1, 2, -1]])
def test_the_arm_at_its_peak_uses_the_whole_limit_beside_its_weight(direction: list[float]) -> None:
    e = np.array(direction) / np.linalg.norm(direction)
    weight = np.linalg.solve(ARM.jacobian(POSE).T, ARM.gravity(POSE))
    assert np.linalg.norm(weight + peak_force(ARM, POSE, e) * e) == pytest.approx(8.5)
    a = peak_acceleration(ARM, POSE, e)
    assert peak_acceleration(ARM, POSE, 3.0 * e) == pytest.approx(a)
    assert peak_force(ARM, POSE, 3.0 * e) == pytest.approx(peak_force(ARM, POSE, e))
    assert np.linalg.norm(weight + a * tip_inertia(ARM, POSE) @ e) == pytest.approx(8.5)
    # the motors' torque then moves the tip with that acceleration from rest
    torque = ARM.jacobian(POSE).T @ (weight + a * tip_inertia(ARM, POSE) @ e)
    moved = ARM.jacobian(POSE) @ ARM.acceleration(POSE, np.zeros(3), torque)
    assert moved == pytest.approx(a * e, rel=1e-9, abs=1e-9 * a)


def limited(**numbers: Any) -> Device:
    """Return the arm with other limits of its drives."""
    values = {k.replace("__", "."): v for k, v in numbers.items()}
    return Device(ARM.name, "", "premium", Parameters({**ARM.parameters.values, **values}))


@pytest.mark.parametrize("direction", [[1, 0, 0], [0, 3, 0], [0, -0.2, 0], [1, 2, -1], [-1, -2, 1]])
def test_the_arm_at_its_peak_uses_the_torque_of_one_motor_beside_its_weight(direction: list[float]) -> None:
    torques = np.array([0.05, 0.3, 0.2])
    device = limited(drive__peak_torque=tuple(torques), drive__peak_force=(np.inf,))
    e = np.array(direction) / np.linalg.norm(direction)
    weight = np.linalg.solve(device.jacobian(POSE).T, device.gravity(POSE))
    force = peak_force(device, POSE, direction)
    assert force > 0.0
    assert np.max(np.abs(device.jacobian(POSE).T @ (weight + force * e)) / torques) == pytest.approx(1.0)


def test_the_peak_of_the_arm_is_taken_both_ways_along_the_axes_of_its_inertia() -> None:
    axes = np.linalg.eigh(tip_inertia(ARM, POSE))[1].T
    both = [peak_force(ARM, POSE, sign * e) for e in axes for sign in (1, -1)]
    found = device_measures(ARM, POSE).peak_force
    assert found == pytest.approx((min(both), max(both)))
    forward = [peak_force(ARM, POSE, e) for e in axes]
    backward = [peak_force(ARM, POSE, -e) for e in axes]
    assert (min(forward), max(forward)) != pytest.approx(found) != (min(backward), max(backward))


def test_drives_that_cannot_carry_the_weight_have_no_force_left() -> None:
    weight = np.linalg.solve(ARM.jacobian(POSE).T, ARM.gravity(POSE))
    e = -weight / np.linalg.norm(weight)
    for share in (0.9, 0.3):
        assert peak_force(limited(drive__peak_force=(share * np.linalg.norm(weight),)), POSE, e) == 0.0
    small = limited(drive__peak_force=(1.1 * np.linalg.norm(weight),))
    assert peak_force(small, POSE, -e) == pytest.approx(0.1 * np.linalg.norm(weight))
    torque = np.abs(ARM.gravity(POSE))
    weak = limited(drive__peak_torque=(np.inf, 0.9 * torque[1], np.inf), drive__peak_force=(np.inf,))
    up = np.linalg.solve(ARM.jacobian(POSE).T, [0.0, np.sign(ARM.gravity(POSE)[1]), 0.0])
    assert peak_force(weak, POSE, up) == 0.0


def test_a_planar_device_is_limited_by_the_torque_of_one_motor() -> None:
    device = Device(
        FIVE_BAR.name, "", "five_bar", Parameters({**FIVE_BAR.parameters.values, "drive.peak_torque": (0.1, 0.2)})
    )
    jacobian = device.jacobian(FLAT)
    e = np.array([0.6, 0.8, 0.0])
    torque = jacobian.T @ (peak_force(device, FLAT, e) * e)
    assert np.max(np.abs(torque) / [0.1, 0.2]) == pytest.approx(1.0)
    m = device_measures(device, FLAT)
    values = np.linalg.svd(jacobian, compute_uv=False)
    assert m.kinematic_isotropy == pytest.approx(values[1] / values[0])
    assert m.tip_mass == pytest.approx(np.sort(1.0 / np.linalg.eigvals(_mobility(device))), rel=1e-9)


def _mobility(device: Device) -> np.ndarray:
    plane = device.jacobian(FLAT)[:2]
    return np.asarray(plane @ np.linalg.solve(device.mass_matrix(FLAT), plane.T))


def test_one_count_of_the_coarsest_joint_is_the_resolution() -> None:
    moved = [
        np.linalg.norm(ARM.forward(POSE + s * e) - ARM.forward(POSE))
        for e, s in zip(np.eye(3), ARM.encoder_step, strict=True)
    ]
    assert device_measures(ARM, POSE).resolution == pytest.approx(max(moved), rel=1e-3)


def test_a_singular_pose_has_no_measures() -> None:
    with pytest.raises(PoseError, match="singular"):
        device_measures(ARM, [0.0, np.pi / 2, np.pi])


def slider(topology: str, gain: float, delay: int = 0) -> dict[str, Any]:
    push = {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]}
    return {
        "device": {"name": "slider", "delay": delay},
        "servo": {"period": "1 ms", "topology": topology},
        **(
            {"operator": push} if topology == "impedance_display" else {"reference": {"force": ["0.1 N", "0 N", "0 N"]}}
        ),
        "object": {"kind": "spring", "stiffness": "80 N/m"},
        "controller": {"kind": "gain", "gain": [gain] * 3},
        "run": {"duration": "0.1 s"},
    }


@pytest.mark.parametrize("gain", [1.0, 0.7, 1.2])
def test_the_static_precision_is_that_of_the_gain(gain: float) -> None:
    """An impedance display shows gain times K. A free tip rests where the gains on both forces balance."""
    shown = measure_performance(slider("impedance_display", gain)).along[0]
    assert shown.precision == pytest.approx(abs(gain - 1.0), abs=1e-4)
    tables = slider("force_tracking", 1.0)
    through = np.hstack([gain * np.eye(3), -np.eye(3)]).tolist()
    tables["controller"] = {"kind": "state_space", "A": [], "B": [], "C": [[], [], []], "D": through}
    assert measure_performance(tables).along[0].precision == pytest.approx(abs(gain - 1.0), abs=1e-4)


@pytest.mark.parametrize("delay", [0, 2])
def test_the_two_port_of_the_slider_in_closed_form(delay: int) -> None:
    f = np.array([0.3, 3.0, 30.0, 300.0])
    s = 2j * np.pi * f
    port = two_port(
        slider("impedance_display", 0.8, delay), f, [1, 0, 0], coupling_stiffness=500.0, coupling_damping=1.0
    )
    z = np.exp(s * T)
    assert port.h11 == pytest.approx(MASS * s + B, rel=1e-9)
    assert port.h12 == pytest.approx(0.8 * hold_response(f, T) * z**-delay, rel=1e-12)
    assert port.h21 == pytest.approx(-np.ones(4))
    coupling = 1.0 + 500.0 * T * z / (z - 1)
    assert port.h22 == pytest.approx(1.0 / coupling, rel=1e-12)
    assert port.width == pytest.approx(port.h12 * coupling, rel=1e-12)
    rigid = port.transmitted(1e12 * np.ones(4))
    assert rigid == pytest.approx(port.h11 + port.width, rel=1e-6)
    assert port.force_error == pytest.approx(np.abs(port.h12 - 1.0))
    assert np.all(np.isfinite(llewellyn(port.h11, port.h12, port.h21, port.h22)))


def test_the_two_port_takes_the_response_of_the_controller_and_any_length_of_the_direction() -> None:
    """u = -0.5 (z - 0.3)/(z - 0.6) F_object along x."""
    f = np.array([3.0, 30.0, 300.0])
    z, tables = np.exp(2j * np.pi * f * T), slider("impedance_display", 1.0)
    one = np.eye(3)
    tables["controller"] = {
        "kind": "state_space",
        "A": (0.6 * one).tolist(),
        "B": np.hstack([0 * one, one]).tolist(),
        "C": (-0.5 * 0.3 * one).tolist(),
        "D": np.hstack([0 * one, -0.5 * one]).tolist(),
    }
    port = two_port(tables, f, [-2.0, 0.0, 0.0])
    assert port.h12 == pytest.approx(0.5 * (z - 0.3) / (z - 0.6) * hold_response(f, T), rel=1e-9)
    assert port.h11 == pytest.approx(MASS * 2j * np.pi * f + B, rel=1e-9)
    assert np.array_equal(port.width, np.full(3, np.inf + 0j))


def test_the_width_is_the_change_of_the_transmitted_impedance_up_to_a_rigid_environment() -> None:
    """Also of a damper of 1 N s/m, whose admittance is 1."""
    real, imaginary = np.random.default_rng(3).normal(size=(2, 4, 5))
    h11, h12, h21, h22 = real + 1j * imaginary
    h22[0] = 1.0
    port = TwoPort(np.ones(5), h11, h12, h21, h22)
    assert port.width == pytest.approx(port.transmitted(1e14 * np.ones(5)) - port.transmitted(np.zeros(5)), rel=1e-9)


@pytest.mark.parametrize(("stiffness", "damping"), [(0.4, 0.0), (0.0, 0.4), (0.4, 0.4)])
def test_a_coupling_of_a_spring_or_a_damper_alone_is_one(stiffness: float, damping: float) -> None:
    """Y22 = 1/(b + k T z/(z - 1)), however soft; without either there is no coupling."""
    f = np.array([1.0, 40.0])
    z = np.exp(2j * np.pi * f * T)
    tables = slider("impedance_display", 1.0, 0)
    port = two_port(tables, f, [1, 0, 0], coupling_stiffness=stiffness, coupling_damping=damping)
    assert port.h22 * (damping + stiffness * T * z / (z - 1.0)) == pytest.approx(np.ones(2))
    assert port.h22.dtype == complex
    assert np.array_equal(two_port(tables, f, [1, 0, 0]).h22, np.zeros(2))


def test_the_transmitted_impedance_is_the_rendered_one_below_the_aliases() -> None:
    tables = slider("impedance_display", 1.0, 1)
    tables["object"]["stiffness"] = "300 N/m"
    f = np.array([0.5, 2.0, 10.0])
    loop = LoopResponse.of(Scenario.from_dict(tables))
    rendered = 1.0 / (2j * np.pi * f * loop.displacement(f)[:, 0, 0])
    transmitted = two_port(tables, f, [1, 0, 0]).transmitted(300.0 / (2j * np.pi * f))
    assert np.abs(transmitted / rendered - 1.0).max() < 1e-4
    assert np.all(np.isinf(two_port(tables, f, [1, 0, 0]).width))


def test_a_loop_that_tracks_a_force_is_no_display() -> None:
    with pytest.raises(StabilityError, match="tracks a force"):
        two_port(slider("force_tracking", 1.0), [1.0], [1, 0, 0])


def test_a_motor_that_a_direction_does_not_load_does_not_limit_it() -> None:
    """However much it holds already; the others limit by what is left of their torque, both ways."""
    device = box(drive__peak_torque=(2.0, 2.0, 3.0))
    for held, along, most in (
        ([0.0, 5.0, 0.0], [1.0, 0.0, 0.0], 2.0),
        ([0.5, 5.0, 0.0], [1.0, 0.0, 0.0], 1.5),
        ([0.5, 5.0, 0.0], [-1.0, 0.0, 0.0], 2.5),
        ([0.5, 0.0, 1.0], [1.0, 0.0, 2.0], 1.0),
        ([5.0, 0.0, 0.0], [1.0, 0.0, 0.0], 0.0),
        ([0.0, 0.0, 0.0], [0.5, 0.0, 0.0], 4.0),
    ):
        assert most_within_limits(device, np.eye(3), np.array(held), np.array(along), np.inf) == pytest.approx(most)
    free = box()
    for held, limit, most in (([0.0, 3.0, 0.0], 5.0, 4.0), ([1.0, 0.0, 0.0], 5.0, 4.0), ([0.0, 5.0, 0.0], 5.0, 0.0)):
        found = most_within_limits(free, np.eye(3), np.array(held), np.array([1.0, 0.0, 0.0]), limit)
        assert found == pytest.approx(most)
    assert most_within_limits(free, np.eye(3), np.zeros(3), np.array([2.0, 0.0, 0.0]), 5.0) == pytest.approx(2.5)
    assert most_within_limits(free, np.eye(3), np.zeros(3), np.array([1.0, 0.0, 0.0]), np.inf) == np.inf


@pytest.mark.parametrize(("small", "moves"), [(5e-10, True), (1.5e-11, True), (0.9e-11, False)])
def test_a_lever_below_a_billionth_of_the_largest_is_rounding(small: float, moves: bool) -> None:
    """However short all of them are: the ratio decides."""
    device: Any = SimpleNamespace(jacobian=lambda _: np.diag([1e-2, small, 0.0]), breakaway=np.array([1.0, 1e-15, 0.0]))
    lever = np.array([1e-2, small]) / np.sqrt(2.0)
    expected = 1e-15 / lever[1] if moves else 1.0 / lever[0]
    assert moving_force(device, [0.0], [1.0, 1.0, 0.0]) == pytest.approx(expected)
    assert moving_force(device, [0.0], [0.0, 0.0, 1.0]) == np.inf
