"""The least settling time that a drive allows, against closed forms and a simulated bang-bang."""

from __future__ import annotations

import numpy as np
import palpate
import pytest
from hypothesis import given
from hypothesis import strategies as st
from palpate.devices import Device, load
from palpate.devices.device import Parameters
from palpate.linear.linearization import static_tip_force
from palpate.metrics import tip_inertia
from palpate.tuning import drive_bound, remedies
from palpate.tuning.presses import Press, draw_poses, draw_presses, hold_time, press_tables

ARM = load("phantom-premium-1.5a")


def mass(kilograms: float, **drive: float | tuple[float, ...]) -> Device:
    values: dict[str, tuple[float, ...]] = {"mass.apparent": (kilograms,) * 3, "friction.viscous": (0.0,) * 3}
    for key, value in drive.items():
        values[f"drive.{key}"] = value if isinstance(value, tuple) else (value,)
    return Device("mass", "", "tip_device", Parameters(values))


def test_a_small_force_gives_the_symmetric_bound() -> None:
    """(2 sqrt 1.05 - sqrt 0.2) sqrt(d m / F_max), for F well below F_max."""
    force, stiffness, most = 1e-6, 1000.0, 8.5
    wanted = (2 * np.sqrt(1.05) - np.sqrt(0.2)) * np.sqrt(force / stiffness * 0.1 / most)
    assert drive_bound(mass(0.1, peak_force=most), np.zeros(3), [0, 0, 1], force, stiffness) == pytest.approx(wanted)
    assert wanted == pytest.approx(1.6022 * np.sqrt(force / stiffness * 0.1 / most), rel=1e-4)


def test_the_bound_is_the_time_of_a_simulated_bang_bang() -> None:
    """The operator helps to accelerate and hinders braking: (8 + 5)/m and (8 - 5)/m."""
    force, stiffness, most, m, t = 5.0, 500.0, 8.0, 0.1, 1e-7
    way, go, brake = force / stiffness, (most + force) / m, (most - force) / m
    switch = 1.05 * way * brake / (go + brake)
    x = v = time = 0.0
    while x < 0.95 * way:
        v += t * (go if x < switch else -brake)
        x += t * v
        time += t
    assert drive_bound(mass(m, peak_force=most), np.zeros(3), [1, 0, 0], force, stiffness) == pytest.approx(
        time, rel=1e-4
    )


def test_limits_of_torque_bound_as_a_limit_of_force_on_one_axis() -> None:
    by_force = drive_bound(mass(0.1, peak_force=8.0), np.zeros(3), [0, 1, 0], 2.0, 500.0)
    by_torque = drive_bound(mass(0.1, peak_torque=(8.0, 8.0, 8.0)), np.zeros(3), [0, 1, 0], 2.0, 500.0)
    assert by_torque == pytest.approx(by_force)


def test_a_force_at_the_limit_cannot_brake_and_no_limit_takes_no_time() -> None:
    assert drive_bound(mass(0.1, peak_force=8.0), np.zeros(3), [0, 1, 0], 8.0, 500.0) == np.inf
    assert drive_bound(mass(0.1), np.zeros(3), [0, 1, 0], 8.0, 500.0) == 0.0
    slow = [
        drive_bound(mass(0.1, peak_force=8.0), np.zeros(3), [0, 1, 0], force, 500.0) for force in (7.9, 7.99, 7.999)
    ]
    assert slow[0] < slow[1] < slow[2] < np.inf  # brakes by 1, 0.1 and 0.01 m/s^2


def test_presses_stay_within_reach_along_the_axes_of_the_inertia() -> None:
    poses = draw_poses(ARM, np.array([0.0, 0.5, -0.3]), 6)
    soft, stiff = (draw_presses(ARM, poses, 2.0, k) for k in (20.0, 5000.0))
    assert len(soft) < len(stiff) <= 36
    for press in stiff[::5]:
        pushed = tip_inertia(ARM, press.pose) @ press.direction
        assert np.linalg.norm(np.cross(pushed, press.direction)) < 1e-9
        assert np.linalg.cond(ARM.jacobian(press.pose)) <= 4.0
        assert press.bound == drive_bound(ARM, press.pose, press.direction, 2.0, 5000.0)


def test_the_hold_time_is_that_at_which_a_simulated_drive_loses_the_force() -> None:
    """Six newtons on the arm: the motors' force falls below what holds the tip at the time of the thermal model."""
    pose, along, force = np.array([0.0, 0.5, -0.3]), np.array([1.0, 0.0, 0.0]), 6.0
    wanted = hold_time(ARM, pose, along, force)
    assert wanted == pytest.approx(0.5, abs=0.05)
    tables = press_tables(Press(pose, along, 0.0), ARM.name, force, 3500.0, 1e-3, 0, 0.8)
    trace = palpate.simulate(tables | {"controller": {"kind": "workspace"}})
    share = trace["deflection"][:, 0] * 3500.0 / force
    settled = np.flatnonzero(np.abs(share[:400] - 1.0) < 0.05)[0]
    lost = trace.time[settled + int(np.argmax(np.abs(share[settled:] - 1.0) > 0.05))]
    assert lost == pytest.approx(wanted, rel=0.1)


@pytest.mark.parametrize(("stiffness", "loss"), [(100.0, 3.088), (258.0, 3.562)])
def test_cold_motors_hold_a_soft_target_at_least_as_long_as_stated(stiffness: float, loss: float) -> None:
    """At the pose of the target the motors carry more than at the start, and the press has warmed them."""
    pose, along, force = np.array([-0.222, 2.812, 2.198]), np.array([-0.976, 0.0, -0.22]), 2.366
    stated = hold_time(ARM, pose, along, force, stiffness)
    assert 0.7 * loss < stated < loss < hold_time(ARM, pose, along, force)
    tables = press_tables(Press(pose, along, 0.0), ARM.name, force, stiffness, 1e-3, 0, 1.2 * loss)
    trace = palpate.simulate(tables | {"controller": {"kind": "workspace"}})
    short = np.linalg.norm(trace["deflection"] * stiffness / force - along / np.linalg.norm(along), axis=1) > 0.05
    assert trace.time[200 + int(np.argmax(short[200:]))] == pytest.approx(loss, rel=0.03)


def test_the_continuous_force_is_held_for_ever_and_more_than_the_peak_not_at_all() -> None:
    device = mass(0.1, peak_force=8.0, continuous_force=2.0, thermal_time=5.0)
    assert hold_time(device, np.zeros(3), [0, 0, 1], 2.0) == np.inf
    assert hold_time(device, np.zeros(3), [0, 0, 1], 8.1) == 0.0
    # at the peak the limit begins to fall at 0.9 of the temperature, which then reads 16 in the end
    assert hold_time(device, np.zeros(3), [0, 0, 1], 8.0) == pytest.approx(-5.0 * np.log(1.0 - 0.9 / 16.0))
    assert hold_time(mass(0.1), np.zeros(3), [0, 0, 1], 1e3) == np.inf


def test_without_a_peak_force_the_limit_falls_at_the_rated_temperature() -> None:
    device = mass(0.1, continuous_force=2.0, thermal_time=5.0)
    assert hold_time(device, np.zeros(3), [0, 0, 1], 8.0) == pytest.approx(-5.0 * np.log(1.0 - 1.0 / 16.0))


@given(count=st.integers(1, 40), share=st.floats(-0.1, 1.1))
def test_the_first_remedy_that_works_is_found(count: int, share: float) -> None:
    """Bisection finds the result of trying one after the other."""
    threshold = share * count
    tried = next((k for k in range(count) if k >= threshold), None)
    assert remedies._first(range(count), lambda k: k >= threshold) == tried


def test_an_operator_who_pushes_up_carries_a_part_of_the_weight() -> None:
    """The motors hold |W - F| against a force along the weight's support W, and |W| + F against one down."""
    pose = np.array([0.0, 0.5, -0.3])
    weight = static_tip_force(ARM.jacobian(pose), ARM.gravity(pose))
    size = float(np.linalg.norm(weight))
    assert size > 0.05
    up, down = hold_time(ARM, pose, weight, 6.0), hold_time(ARM, pose, -weight, 6.0)
    assert up > down
    assert hold_time(ARM, pose, weight, 6.0 + 2.0 * size) == pytest.approx(down, rel=1e-9)


def test_the_operator_s_force_and_the_weight_act_together_on_the_bound() -> None:
    """Along the weight's support W a force |W| leaves nothing to hold: the motors go and brake alike."""
    pose = np.array([0.0, 0.5, -0.3])
    weight = static_tip_force(ARM.jacobian(pose), ARM.gravity(pose))
    size, along = float(np.linalg.norm(weight)), weight / np.linalg.norm(weight)
    inertia = float(np.linalg.norm(tip_inertia(ARM, pose) @ along))
    free = drive_bound(ARM, pose, along, size, 500.0)
    wanted = (2 * np.sqrt(1.05) - np.sqrt(0.2)) * np.sqrt(size / 500.0 * inertia / ARM.peak_force)
    assert free == pytest.approx(wanted, rel=1e-6)
    assert drive_bound(ARM, pose, 7.0 * along, size, 500.0) == pytest.approx(wanted, rel=1e-6)
