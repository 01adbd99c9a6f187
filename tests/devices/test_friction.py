"""Dry friction as a set-valued law: what it can hold stays exactly still, what it cannot slides as mechanics says."""

from __future__ import annotations

import numpy as np
import pytest
from core_runs import run
from numpy.typing import NDArray
from palpate import _core, devices

Array = NDArray[np.float64]
SLIDER = devices.load("slider")
MASS = 0.06  # kg
ROTORS = devices.load("phantom-premium-1.5a-rotors")


def test_friction_holds_the_arm_where_gravity_is_weaker() -> None:
    """A pose where |N| < Coulomb friction in every joint: 10 s without moving by one bit, drift and chatter alike."""
    q = np.array([0.3, 1.3, 3.1])
    assert np.all(np.abs(ROTORS.gravity(q)) < ROTORS.coulomb)
    trace = run(ROTORS, ticks=10_000, period=1e-3, start=q)
    np.testing.assert_array_equal(trace.q, np.tile(q, (len(trace.q), 1)))
    np.testing.assert_array_equal(trace.qd, 0.0)
    np.testing.assert_array_equal(ROTORS.acceleration(q, np.zeros(3), np.zeros(3)), 0.0)


def test_the_arm_lets_go_where_gravity_is_stronger() -> None:
    """Only the overloaded joint moves at first; it comes to rest where friction can hold it and never stirs again."""
    device = ROTORS.with_friction(coulomb=[0.01, 0.001, 0.01])
    q = np.array([0.0, 0.2, np.pi])
    assert abs(device.gravity(q)[1]) > 0.001
    trace = run(device, ticks=30_000, period=1e-3, start=q)
    first = device.acceleration(q, np.zeros(3), np.zeros(3))
    np.testing.assert_array_equal(first == 0.0, [True, False, True])
    rest = np.flatnonzero(np.any(trace.qd != 0.0, axis=1))[-1] + 1
    assert rest < len(trace.q) - 1000, "it must come to rest, exactly"
    assert np.all(np.abs(device.gravity(trace.q[-1])) <= 0.01)
    np.testing.assert_array_equal(trace.q[rest:], np.tile(trace.q[-1], (len(trace.q) - rest, 1)))


@pytest.mark.parametrize(("push", "holds"), [(0.49, True), (-0.49, True), (0.51, False), (-0.51, False)])
def test_coulomb_friction_holds_up_to_its_value_and_no_further(push: float, holds: bool) -> None:
    """A constant push below 0.5 N never moves the slider; above, it moves with exactly (push - 0.5 N) / m."""
    device = SLIDER.with_friction(viscous=[0.0], coulomb=[0.5])
    trace = run(device, ticks=2000, period=1e-3, start=[0.0], tip_force=[push, 0.0, 0.0])
    if holds:
        np.testing.assert_array_equal(trace.q, 0.0)
    else:
        net = push - np.sign(push) * 0.5
        np.testing.assert_allclose(trace.q[:, 0], 0.5 * net / MASS * trace.time**2, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("b", [0.0, 0.5])
def test_a_slide_ends_at_the_exact_place_and_for_good(b: float) -> None:
    """From v0, against friction f and damping b: stops after t = (m/b) ln(1 + b v0/f) at x = m v0/b - (f/b) t."""
    speed, friction = 0.2, 0.3
    trace = run(
        SLIDER.with_friction(viscous=[b], coulomb=[friction]),
        ticks=1000,
        period=1e-3,
        start_speed=[speed],
    )
    if b:
        stop = MASS / b * np.log1p(b * speed / friction)
        way = MASS * speed / b - friction / b * stop
    else:
        stop, way = MASS * speed / friction, MASS * speed**2 / (2 * friction)
    after = trace.time > stop
    assert np.all(trace.qd[~after][:-1] > 0)
    np.testing.assert_array_equal(trace.qd[after], 0.0)
    np.testing.assert_allclose(trace.q[after, 0], way, rtol=1e-9)
    assert np.ptp(trace.q[after, 0]) == 0.0


def test_swinging_on_a_spring_loses_four_friction_widths_a_period() -> None:
    """Coulomb friction shortens a swing by 2 f/k each half period, linearly, until it sticks inside |x| <= f/k."""
    f, k = 0.1, 500.0
    # The spring is the operator's arm (no mass, no damper), so that no sampled wall comes in.
    device = SLIDER.with_friction(viscous=[0.0], coulomb=[f])
    setup = device.setup()
    hand = setup.human_arm
    hand.stiffness = k
    setup.human_arm = hand
    setup.start, setup.period, setup.substeps = np.array([0.0021]), 1e-4, 4
    rows, count, _ = setup.run(np.zeros((20_001, 3)), np.zeros((20_001, 3)))
    x, v = np.asarray(rows)[:count, 0], np.asarray(rows)[:count, 1]
    turns = [0.0021]
    while abs(turns[-1]) > f / k:
        turns.append(-np.sign(turns[-1]) * (abs(turns[-1]) - 2 * f / k))
    expected = turns[1:]
    found = [x[i] for i in range(1, len(x) - 1) if (x[i] - x[i - 1]) * (x[i + 1] - x[i]) < 0]
    np.testing.assert_allclose(found, expected[:-1], rtol=0, atol=1e-8)
    assert x[-1] == pytest.approx(expected[-1], abs=1e-9)
    assert v[-1] == 0.0


def test_breakaway_holds_more_than_sliding_friction() -> None:
    """Stribeck: a push of 0.4 N does not tear the slider loose (0.5 N), but keeps it going once it slides (0.3 N)."""
    device = SLIDER.with_friction(viscous=[0.0], coulomb=[0.3], breakaway=[0.5], stribeck_speed=[0.01])
    held = run(device, ticks=500, period=1e-3, tip_force=[0.4, 0.0, 0.0])
    np.testing.assert_array_equal(held.q, 0.0)
    moving = run(device, ticks=500, period=1e-3, start_speed=[0.1], tip_force=[0.4, 0.0, 0.0])
    np.testing.assert_allclose(moving.qd[:, 0], 0.1 + (0.4 - 0.3) / MASS * moving.time, rtol=1e-9)


def test_stribeck_reduces_to_coulomb() -> None:
    """Breakaway = Coulomb: the Stribeck speed means nothing, bit for bit; breakaway -> Coulomb: the effect fades."""
    plain = ROTORS.with_friction(coulomb=0.01)
    start = {"start": [0.0, 0.2, 3.9], "start_speed": [0.5, 0.5, -0.5]}
    reference = run(plain, ticks=1000, period=1e-3, **start)
    for speed in (1e-4, 1e-2, 10.0):
        device = ROTORS.with_friction(coulomb=0.01, breakaway=0.01, stribeck_speed=speed)
        same = run(device, ticks=1000, period=1e-3, **start)
        np.testing.assert_array_equal(same.q, reference.q)
    gaps = []
    for extra in (1e-4, 1e-6):
        near = run(ROTORS.with_friction(coulomb=0.01, breakaway=0.01 + extra), ticks=200, period=1e-3, **start)
        gaps.append(np.abs(near.q - reference.q[:201]).max())
    assert 0 < gaps[1] < 0.02 * gaps[0]


@pytest.mark.parametrize("breakaway", [0.01, 0.015])
def test_sticking_and_sliding_are_located_not_stepped_over(breakaway: float) -> None:
    """An arm on a spring, swung so that its joints stop and start: one substep a millisecond finds what thirty find."""
    device = ROTORS.with_friction(coulomb=0.01, breakaway=breakaway, stribeck_speed=0.05)
    pose = [0.0, 2.2305, 3.2776]
    anchor = _core.SpringWallParameters()
    anchor.kind, anchor.point = _core.SpringWallParameters.Kind.point, device.forward(np.array(pose))
    spring = {"wall": anchor, "stiffness": [500.0] * 3, "damping": [2.0] * 3}
    push = 1.2 * np.sin(2 * np.pi * 3.0 * 1e-3 * np.arange(601))[:, None] * [1.0, 0.5, -0.7]
    found = [run(device, ticks=600, period=1e-3, start=pose, tip_force=push, substeps=n, **spring) for n in (1, 30)]
    stuck = found[1].qd == 0.0
    assert (np.diff(stuck.astype(int), axis=0) != 0).sum() > 10
    np.testing.assert_allclose(found[0].q, found[1].q, atol=1e-7)
    np.testing.assert_array_equal(found[0].qd[stuck], 0.0)


def test_friction_never_gives_energy() -> None:
    trace = run(ROTORS, ticks=3000, period=1e-3, start=[1.0, 3.0, 4.0], start_speed=[2.0, -1.0, 3.0])
    energy = ROTORS.energy(trace.q, trace.qd)
    assert np.all(np.diff(energy) <= 1e-12)


def test_a_new_coulomb_friction_sets_the_breakaway_unless_it_is_given() -> None:
    arm = devices.load("phantom-premium-1.5a").with_friction(coulomb=0.01, breakaway=0.02)
    assert np.array_equal(arm.with_friction(coulomb=0.015).breakaway, [0.015] * 3)
    assert np.array_equal(arm.with_friction(coulomb=0.015, breakaway=0.03).breakaway, [0.03] * 3)
    assert np.array_equal(arm.with_friction(viscous=0.001).breakaway, [0.02] * 3)
    assert np.array_equal(arm.with_friction(breakaway=0.04).coulomb, [0.01] * 3)
