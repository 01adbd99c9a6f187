"""Each measure of a run against a motion that shows it, and each threshold of the verdict against both of its sides."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.simulation.decision import FLOOR, Evidence, decide, growth
from palpate.simulation.evidence import (
    _apart,
    _arm_stiffness,
    _creep,
    _drift,
    _pressed,
    _tool_error,
    evidence,
    interruption,
    pushed_through,
    second_differences,
    swing,
)
from palpate.simulation.judgment import _hidden, _lost, _oscillation, _undecided, judge, judge_pushed
from palpate.simulation.outcome_rows import outcome_of
from palpate.simulation.statics import force_over_stiffness, presses, steady_error
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.simulation.windows import Window, windows

PERIOD = 1e-3


def trace(tip: np.ndarray, **channels: Any) -> Trace:
    """A run of a tip (n, 3), in contact and not saturated, unless other channels are given."""
    n = len(tip)
    values = {"tip": tip, "touching": np.ones(n), "saturated": np.zeros(n), **channels}
    return Trace.of(PERIOD * np.arange(n), values)


def along_x(x: np.ndarray) -> np.ndarray:
    return np.column_stack([x, np.zeros_like(x), np.zeros_like(x)])


def kinks(n: int, sizes: dict[int, float]) -> np.ndarray:
    """A path along x whose second difference is a size at each of some samples, and else zero."""
    bend = np.zeros(n)
    for at, size in sizes.items():
        bend[at] = size
    return along_x(np.cumsum(np.cumsum(bend)))


def test_early_prior_and_late_are_the_second_fourth_and_last_fifth_of_the_window() -> None:
    """A kink in each fifth, first and last sample of each: what is at the edge belongs to the fifth before it."""
    first, last, fifth = 100, 1100, 200
    for place in (1, 90, 200):
        sizes = {first + k * fifth + place: 10.0**-k for k in range(5)}
        run = trace(kinks(last + 1, {50: 9.0, **sizes}))
        found = evidence(run, None, Window(first, last), None)
        assert (found.early[0], found.prior[0], found.late[0]) == pytest.approx((1e-1, 1e-3, 1e-4), rel=1e-6)
        still = np.zeros((last + 1, 3))
        full = trace(run["tip"], object_force=still, command_force=still)
        cell = outcome_of(full, PERIOD, Window(first, last))
        fifths = (cell["oscillation_2"], cell["oscillation_4"], cell["oscillation_5"])
        assert fifths == pytest.approx((1e-1, 1e-3, 1e-4), rel=1e-6)


def test_an_oscillation_grows_by_its_factor_per_fifth() -> None:
    """x = exp(s t) sin(w t) in any direction: late over prior is exp(s fifth), and late over early its cube."""
    t = PERIOD * np.arange(1001)
    for factor in (0.5, 1.0, 1.7):
        wave = 1e-4 * factor ** (t / 0.2) * np.sin(2 * np.pi * 50.0 * t)
        found = evidence(trace(wave[:, None] * np.array([0.6, 0.0, -0.8])), None, Window(0, 1000), 0.9)
        assert found.late[0] / found.prior[0] == pytest.approx(factor, rel=1e-3)
        assert growth(found.unstable_from, found.early, found.prior, found.late)[0] == pytest.approx(factor, rel=1e-2)
        ending = 0.8 * np.abs(wave[-200:]).max()
        assert found.swing[0] == pytest.approx(ending, rel=0.1)
        assert found.swing[0] / found.swing_before[0] == pytest.approx(factor, rel=0.05)
        assert found.ripple[0] / found.ripple_before[0] == pytest.approx(factor, rel=0.02)
        assert found.decay[0] == pytest.approx(0.9**200)
        assert found.linear[0] == 1


def test_late_samples_do_not_bend_a_straight_motion_and_a_bend_is_per_nominal_interval() -> None:
    rng = np.random.default_rng(0)
    time = PERIOD * (np.arange(200) + rng.uniform(0.0, 0.4, 200))
    assert second_differences(time, along_x(0.3 * time), PERIOD).max() < 1e-15
    even = PERIOD * np.arange(200)
    tip = np.column_stack([3.0 * even**2, 4.0 * even**2, 0.0 * even])
    for interval in (PERIOD, None):
        found = second_differences(even, tip, interval)
        np.testing.assert_allclose(found[2:], 10.0 * PERIOD**2, rtol=1e-6)
        assert found[:2].tolist() == [0.0, 0.0]
    assert second_differences(even, tip, 2 * PERIOD)[5] == pytest.approx(20.0 * PERIOD**2)
    assert second_differences(even[:2], tip[:2], PERIOD).tolist() == [0.0, 0.0]


def test_a_swing_is_the_amplitude_without_a_quadratic_trend() -> None:
    t = np.linspace(0.0, 1.0, 500)
    trend = 3.0 * t**2 - 2.0 * t + 1.0
    assert swing(t, along_x(trend)) < 1e-12
    wave = 0.01 * np.sin(2 * np.pi * 12.0 * t)
    tip = np.column_stack([trend, trend + wave, 5 * t])
    assert swing(t, tip) == pytest.approx(0.01, rel=0.1)
    assert swing(t[:7], along_x(trend[:7])) == pytest.approx(0.5 * np.ptp(trend[:7]))
    assert swing(t[:8], along_x(trend[:8])) < 1e-12


@pytest.mark.parametrize(("frequency", "fifths"), [(6.0, 2), (7.3, 2), (13.0, 1), (61.0, 1)])
def test_a_drift_below_an_oscillation_shifts_the_mean_of_the_tip_and_an_oscillation_does_not(
    frequency: float, fifths: int
) -> None:
    """A drift of 0.2 of the oscillation per fifth, or none; a fifth has 1.2 to 12.2 periods."""
    t = PERIOD * np.arange(1001)
    rest, wave = np.array([0.6, 0.0, -0.8]), np.array([0.0, 1.0, 0.0])
    for drift in (0.0, 1e-3):
        path = drift * t[:, None] * rest + 1e-3 * np.sin(2 * np.pi * frequency * t)[:, None] * wave
        found = evidence(trace(path), None, Window(0, 1000), None)
        assert found.shift_fifths[0] == fifths
        if drift == 0.0:
            assert found.shift[0] == 0.0
        else:
            assert found.shift[0] == pytest.approx(0.2 * drift * fifths, abs=0.08 * 1e-3)


def test_a_shift_is_that_of_the_last_two_fifths_and_its_ratio_is_to_the_one_before() -> None:
    t = PERIOD * np.arange(1001)
    faster = evidence(trace(along_x(t**2)), None, Window(0, 1000), None)
    assert faster.shift[0] == pytest.approx(0.9**2 - 0.7**2, rel=0.01)
    assert faster.shift_ratio[0] == pytest.approx((0.9**2 - 0.7**2) / (0.7**2 - 0.5**2), rel=0.01)
    assert np.isnan(evidence(trace(along_x(t)), None, Window(0, 39), None).shift[0])


def test_contacts_saturation_and_deflection_are_those_of_the_last_fifth() -> None:
    n = 501
    touching, saturated = np.ones(n), np.zeros(n)
    touching[405:410] = touching[450:470] = touching[300:310] = 0.0
    saturated[460:480], saturated[100:300] = 1.0, 1.0
    deflection = along_x(np.where(np.arange(n) > 400, 3.0, 50.0)) + np.array([0.0, 4.0, 0.0])
    run = trace(along_x(np.zeros(n)), touching=touching, saturated=saturated, deflection=deflection)
    found = evidence(run, None, Window(0, 500), None)
    assert found.contacts[0] == 2.0
    assert found.touching[0] == pytest.approx(0.75)
    assert found.saturated[0] == pytest.approx(0.2)
    assert found.deflection[0] == pytest.approx(5.0)
    assert found.linear[0] == 0
    assert np.isnan(found.decay[0])
    moved = evidence(trace(along_x(np.r_[np.zeros(400), np.full(101, 2.0)])), None, Window(0, 500), None)
    assert moved.deflection[0] == pytest.approx(2.0)  # from the first sample, if there is no deflection


def test_the_drift_is_that_of_the_command_between_the_halves_over_the_largest_force() -> None:
    command = along_x(np.r_[np.zeros(100), np.full(50, 1.0), np.full(50, 1.5)])
    run = trace(along_x(np.zeros(200)), command_force=command, object_force=along_x(np.linspace(0.0, -5.0, 200)))
    assert _drift(run, slice(100, 200)) == pytest.approx(0.1)
    assert _drift(run, slice(100, 101)) == 0.0
    assert _drift(run, slice(150, 200)) == 0.0
    assert _drift(run, slice(149, 151)) == pytest.approx(0.1)  # two samples have two halves
    assert _drift(run, slice(148, 152)) == pytest.approx(0.1)


def test_a_tip_is_apart_while_it_is_off_and_pressed() -> None:
    """10 samples before the contact do not count, nor those in which the force pulls or hardly presses."""
    n = 110
    touching = np.zeros(n, dtype=bool)
    touching[10:60] = touching[80:110] = True
    normal = np.array([0.0, 0.0, 1.0])
    load = np.tile([0.0, 0.0, -2.0], (n, 1))
    load[60:65] = [0.0, 0.0, 2.0]
    load[65:68] = [0.0, 0.0, -0.09]  # below 5 % of the largest
    load[68:70] = [2.0, 0.0, -0.09]  # along the surface
    force = np.where(touching[:, None], -1.0 * normal, 0.0)
    zero = np.zeros((n, 3))
    for reference, operator in ((load, zero), (zero, load), (0.25 * load, 0.75 * load)):
        run = trace(zero, reference_force=reference, operator_force=operator, object_force=force)
        assert _apart(run, touching) == pytest.approx(10 / 100)
    assert _apart(run, np.zeros(n, dtype=bool)) == 0.0


def test_the_bounces_of_an_impact_do_not_count_and_a_lost_contact_does() -> None:
    """Each row: lengths of flights and contacts in turn. The first is a flight, 0 for a tip on its object."""
    for turns, expected in (
        ((10, 3, 20, 4, 10, 2, 5, 90), 0.0),  # bounces, then rest
        ((0, 60, 20, 40), 20 / 120),  # a slide that loses the object and finds it again
        ((0, 5, 20, 95), 20 / 120),
        ((10, 3, 20, 60, 15, 22), 15 / 97),  # lost after the impact
        ((10, 3, 20, 4, 23), 43 / 50),  # it never rests
        ((10, 90), 0.0),
        ((100, 30, 20, 160), 20 / 210),  # a long flight before the first contact does not count
    ):
        touching = np.repeat(np.arange(len(turns)) % 2 == 1, turns)
        n = len(touching)
        force = np.where(touching[:, None], [0.0, 0.0, -1.0], 0.0)
        load, zero = np.tile([0.0, 0.0, -2.0], (n, 1)), np.zeros((n, 3))
        run = trace(zero, reference_force=load, operator_force=zero, object_force=force)
        assert _apart(run, touching) == pytest.approx(expected), turns


def test_a_tip_is_pushed_through_from_when_it_is_lost_until_the_end() -> None:
    lost = np.zeros(100)
    run = trace(np.zeros((100, 3)), contact_lost=lost)
    assert pushed_through(run) is None
    assert pushed_through(trace(np.zeros((100, 3)))) is None
    lost[20:30] = lost[70:] = 1.0
    assert pushed_through(trace(np.zeros((100, 3)), contact_lost=lost)) == pytest.approx(0.070)
    assert pushed_through(trace(np.zeros((100, 3)), contact_lost=np.ones(100))) == 0.0
    lost[99] = 0.0
    assert pushed_through(trace(np.zeros((100, 3)), contact_lost=lost)) is None


def test_a_lost_contact_says_since_when_or_for_how_long() -> None:
    touching = np.zeros(1001)
    assert _lost(trace(np.zeros((1001, 3)), touching=touching), 0.0) == (None, "the tip never touches the object")
    touching[100:300] = 1.0
    since, reason = _lost(trace(np.zeros((1001, 3)), touching=touching), 0.5)
    assert since == pytest.approx(0.299)
    assert "from t = 0.299 s on" in reason
    touching[800:] = 1.0
    since, reason = _lost(trace(np.zeros((1001, 3)), touching=touching), 0.4567)
    assert since == pytest.approx(0.299)
    assert "in 45.7 % of the time" in reason
    touching[300:800] = 1.0
    assert _lost(trace(np.zeros((1001, 3)), touching=touching), 0.0)[0] == pytest.approx(1.0)


def test_an_oscillation_is_described_along_its_largest_axis_without_its_trend() -> None:
    t = PERIOD * np.arange(1000)
    for axis, name in enumerate("xyz"):
        tip = np.tile(0.001 * np.sin(2 * np.pi * 3.0 * t)[:, None], (1, 3))
        tip[:, axis] = 0.02 * np.sin(2 * np.pi * 20.0 * t) + 0.01 * t
        found, amplitude, frequency = _oscillation(t, tip)
        assert found == name
        assert amplitude == pytest.approx(0.5 * np.ptp(tip[:, axis]))
        assert frequency == pytest.approx(20.0, rel=0.03)
    alternating = np.where(np.arange(9) % 2, -1.0, 1.0)  # between any two samples it crosses its mean
    assert _oscillation(t[:9], along_x(alternating))[2] == pytest.approx(0.5 / PERIOD)
    assert _oscillation(t, along_x(t))[2] is None
    assert _oscillation(t[:2], along_x(t[:2])) == ("x", pytest.approx(0.5e-3), None)


def test_forces_press_against_an_outward_normal_of_any_length_and_along_it_they_do_not() -> None:
    outward = np.array([0.0, 3.0, 4.0])
    for angle, pressing in ((0.0, False), (86.0, False), (90.0, False), (92.5, False), (93.5, True), (180.0, True)):
        u, v = outward / 5.0, np.array([1.0, 0.0, 0.0])
        force = 7.0 * (np.cos(np.radians(angle)) * u + np.sin(np.radians(angle)) * v)
        assert bool(presses(force, outward)[0]) is pressing
    assert not presses(np.zeros(3), outward)[0]


def test_the_steady_error_is_the_largest_of_the_driven_axes() -> None:
    expected = force_over_stiffness([2.0, 0.05, -4.0], [1000.0, 1000.0, 500.0], 3)
    np.testing.assert_allclose(expected, [[2e-3, 5e-5, -8e-3]])
    assert steady_error([2e-3, 1.0, -8e-3], expected)[0] == pytest.approx(0.0)  # y is not driven
    assert steady_error([2.2e-3, 0.0, -7e-3], expected)[0] == pytest.approx(0.125)
    two = force_over_stiffness([[2.0, 1.0, -4.0]], [1000.0, 0.0, 500.0], 2)
    assert np.isnan(two[0, 1:]).all()
    assert np.isnan(steady_error([1.0, 1.0, 1.0], np.full(3, np.nan))[0])


def test_windows_are_stretches_of_constant_force_that_last() -> None:
    def forces(*lengths: int) -> np.ndarray:
        return np.concatenate([np.full((length, 6), float(k)) for k, length in enumerate(lengths)])

    assert windows(forces(1000)) == [Window(0, 999)]
    assert windows(forces(300, 700)) == [Window(0, 299), Window(300, 999)]
    assert windows(forces(99, 901)) == [Window(99, 999)]
    assert windows(forces(100, 900)) == [Window(0, 99), Window(100, 999)]
    assert windows(forces(951, 49)) == [Window(0, 950), Window(0, 999, False)]
    assert windows(forces(950, 50)) == [Window(0, 949), Window(950, 999)]
    assert windows(forces(9000, 499)) == [Window(0, 8999), Window(9000, 9498)]
    assert windows(forces(9600, 450))[-1] == Window(0, 10049, False)
    ramp = np.tile(np.arange(1000.0)[:, None], (1, 6))
    assert windows(ramp) == [Window(0, 999, False)]
    last = Window(100, 999)
    assert (last.fifth, last.ending) == (179, slice(821, 1000))
    assert Window(5, 7).ending == slice(7, 8)


def settled(**change: Any) -> Evidence:
    """A loop at rest in contact under a known linear loop, with a deflection of 1 mm."""
    values = {
        "unstable_from": np.nan, "early": 1e-6, "prior": 1e-8, "late": 1e-10, "ripple": 1e-7, "ripple_before": 1e-6,
        "swing": 1e-8, "swing_before": 1e-7, "deflection": 1e-3, "linear": 1, "decay": 1e-4, "touching": 1.0,
    }  # fmt: skip
    return Evidence.of(1, **{**values, **change})


def state(**change: Any) -> State:
    return State(int(decide(settled(**change))[0]))


# A swing of 20 um that keeps its size: 2 % of the deflection.
STEADY = {"early": 1e-6, "prior": 1e-6, "late": 1e-6, "swing": 2e-5, "swing_before": 2e-5, "ripple": 2e-5, "linear": 0,
          "ripple_before": 2e-5}  # fmt: skip
SMALL = {"swing": 1.5e-6, "ripple": 1.5e-6, "ripple_before": 1e-6}
# Encoder counts of 0.1 mm shake a contact with friction, whose force fluctuates by 20 % under an arm.
SHAKEN = {"linear": 0, "trend": 0.0, "resolution": 1e-4, "fluctuation": 0.2, "traction": 0.1, "release": 2e-4}
# The same beside a stable linear loop whose slowest motion decays to 0.09 per fifth.
SUSTAINED = {**SHAKEN, "linear": 1, "decay": 0.09, "late": 1e-8}
# The same without an arm's spring, and under a force that hardly fluctuates.
UNHELD = {**SHAKEN, "fluctuation": 0.01, "traction": 0.5, "release": np.inf}


@pytest.mark.parametrize(
    ("change", "name", "inside", "outside", "expected"),
    [
        ({}, "unstable_from", np.nan, 0.3, State.UNSTABLE),
        (STEADY | {"early": 0.2e-6}, "late", 1.0199e-6, 1.0201e-6, State.UNSTABLE),
        (STEADY | {"early": 0.2e-6, "contacts": 1}, "late", 1.499e-6, 1.501e-6, State.UNSTABLE),
        (STEADY | {"early": 0.2e-6, "contacts": 1}, "widening", 1.19, 1.21, State.UNSTABLE),
        ({"pressed": True, "contacts": 3}, "touching", 0.5, 0.499, State.CONTACT_LOST),
        ({}, "apart", 0.05, 0.0501, State.CONTACT_LOST),
        ({}, "saturated", 0.01, 0.0101, State.DRIVE_LIMIT),
        ({}, "beyond", False, True, State.OUT_OF_REACH),
        ({}, "constant", True, False, State.UNDECIDED),
        ({"pressed": True}, "contacts", 3, 4, State.BOUNDED_OSCILLATION),
        (STEADY | {"linear": 1, "decay": 0.9, "late": 0.8e-6, "ripple": 1e-4, "swing": 1e-4, "local": True},
         "resolution", 1.99e-5, 2.01e-5, State.UNDECIDED),
        (STEADY, "late", 0.699e-6, 0.701e-6, State.UNDECIDED),
        (STEADY | {"linear": 1, "decay": 0.5**4, "local": True}, "late", 0.499e-6, 0.501e-6, State.UNDECIDED),
        (STEADY | {"linear": 1}, "turns", 0.99, 1.01, State.BOUNDED_OSCILLATION),
        (STEADY | {"trend": 0.0}, "swing", 0.99e-5, 1.01e-5, State.BOUNDED_OSCILLATION),
        (STEADY | SMALL, "deflection", 1.51e-4, 1.49e-4, State.BOUNDED_OSCILLATION),
        (STEADY | SMALL | {"deflection": 0.0, "ripple": 9e-7}, "swing", 0.99e-6, 1.01e-6, State.BOUNDED_OSCILLATION),
        (STEADY | {"linear": 1}, "resolution", 2.01e-5, 1.99e-5, State.BOUNDED_OSCILLATION),
        (STEADY | {"resolution": 3e-5}, "swing", 1.49e-5, 1.51e-5, State.UNDECIDED),
        (STEADY | {"resolution": 3e-5, "swing": 1.51e-5}, "linear", 1, 0, State.UNDECIDED),
        ({}, "kept", 0.299, 0.301, State.BOUNDED_OSCILLATION),
        ({"decay": 0.7}, "kept", 3 * 0.7**4 - 1e-3, 3 * 0.7**4 + 1e-3, State.BOUNDED_OSCILLATION),
        ({"decay": 0.999, "trend": 0.0}, "kept", 0.899, 0.901, State.BOUNDED_OSCILLATION),
        ({"linear": 0, "trend": 0.0}, "kept", 0.299, 0.301, State.UNDECIDED),
        ({}, "error", 0.0499, 0.0501, State.UNDECIDED),
        ({}, "error", -0.0499, -0.0501, State.UNDECIDED),
        ({}, "drift", 0.0499, 0.0501, State.UNDECIDED),
        ({"linear": 0, "trend": 0.0, "ripple_before": 7e-5}, "ripple", 4.99e-5, 5.01e-5, State.UNDECIDED),
        ({"linear": 0, "trend": 0.0}, "ripple_before", 7.49e-5, 7.51e-5, State.UNDECIDED),
        ({"linear": 0, "trend": 0.0, "ripple_before": 1e-5}, "ripple", 1.249e-5, 1.251e-5, State.UNDECIDED),
        ({"linear": 0, "trend": 0.0, "ripple": 2e-5}, "ripple_before", 1.97e-5, 1.95e-5, State.UNDECIDED),
        ({"linear": 0, "swing": 2e-6, "generated_before": 0.0}, "generated", 0.0099, 0.0101, State.UNDECIDED),
        ({"linear": 0, "generated": 0.05, "generated_before": 0.05}, "swing", 0.99e-6, 1.01e-6, State.UNDECIDED),
        ({"linear": 0, "swing": 2e-6, "generated": 0.09}, "generated_before", 0.101, 0.099, State.UNDECIDED),
        ({"decay": 0.8}, "trend", 6.24e-6, 6.26e-6, State.UNDECIDED),
        ({"decay": 0.99, "trend": 1e-6}, "swing", 2.01e-6, 1.99e-6, State.UNDECIDED),
        ({"decay": 0.8, "trend": 3e-6, "swing": 1e-6, "trend_before": 2e-6}, "local", False, True, State.UNDECIDED),
        ({"decay": 0.8, "trend": 3e-6, "swing": 0, "local": True}, "trend_before", 3.01e-6, 2.99e-6, State.UNDECIDED),
        ({"linear": 0, "trend_before": 2e-5}, "trend", 1.31e-5, 1.32e-5, State.UNDECIDED),
        ({"linear": 0, "trend_before": np.nan}, "trend", 1.31e-6, 1.32e-6, State.UNDECIDED),
        ({"decay": 0.8, "shift_ratio": 0.1}, "shift", 1.249e-5, 1.251e-5, State.UNDECIDED),
        ({"decay": 0.8, "shift_fifths": 2}, "shift", 2.81e-5, 2.82e-5, State.UNDECIDED),
        ({"linear": 0, "shift_ratio": 0.5}, "shift", 4.99e-5, 5.01e-5, State.UNDECIDED),
        ({"linear": 0, "shift": 1.9e-5, "shift_ratio": 1.5}, "resolution", 9.6e-5, 9.4e-5, State.UNDECIDED),
        (SHAKEN, "fluctuation", 0.149, 0.151, State.UNDECIDED),
        (SHAKEN, "release", 0.99e-4, 1.01e-4, State.UNDECIDED),
        (SHAKEN, "resolution", 0.0, 1e-4, State.UNDECIDED),
        (SHAKEN, "kept", 0.1, np.nan, State.UNDECIDED),
        (SUSTAINED, "late", 2.99e-9, 3.01e-9, State.UNDECIDED),
        (UNHELD, "traction", 0.399, 0.401, State.UNDECIDED),
        (UNHELD, "release", 1e3, np.inf, State.UNDECIDED),
        (UNHELD, "linear", 1, 0, State.UNDECIDED),
        (SHAKEN, "onward", 0.399e-4, 0.401e-4, State.UNDECIDED),
        (UNHELD, "onward", 0.399e-4, np.nan, State.UNDECIDED),
        (SHAKEN | {"deflection": 3e-3}, "onward", 0.599e-4, 0.601e-4, State.UNDECIDED),
        ({}, "linear", 1, -1, State.UNSTABLE),
    ],
)  # fmt: skip
def test_a_loop_is_settled_up_to_each_threshold_and_not_beyond(
    change: dict[str, Any], name: str, inside: Any, outside: Any, expected: State
) -> None:
    if change.get("early") == 0.2e-6:  # below the threshold the swing is steady, and does not grow
        assert state(**{**change, name: inside}) is State.BOUNDED_OSCILLATION
    else:
        assert state(**{**change, name: inside}) is State.SETTLED
    assert state(**{**change, name: outside}) is expected


def test_a_visible_oscillation_without_a_linear_loop_is_rest_or_sustained_by_its_decay() -> None:
    rests, decays, lasts = (state(**{**STEADY, "late": late}) for late in (0.69e-6, 0.899e-6, 0.901e-6))
    assert (rests, decays, lasts) == (State.SETTLED, State.UNDECIDED, State.BOUNDED_OSCILLATION)
    assert state(**STEADY, turns=0.99) is State.UNDECIDED


def test_an_unstable_linear_loop_is_undecided_only_where_something_hides_it() -> None:
    assert state(linear=-1, lossy=True) is State.UNDECIDED
    swinging = {**STEADY, "linear": -1}
    assert state(**swinging) is State.UNSTABLE
    assert state(**swinging, lossy=True) is State.BOUNDED_OSCILLATION
    assert state(**swinging, contacts=1) is State.BOUNDED_OSCILLATION
    assert state(linear=-1, saturated=0.5) is State.DRIVE_LIMIT
    assert state(**{**swinging, "swing": 2e-6, "ripple": 2e-6}) is State.UNSTABLE


def test_a_tip_that_travels_is_not_judged_by_its_bumps() -> None:
    growing = {**STEADY, "early": 0.2e-6, "late": 2e-6, "swing": 1e-4}
    assert state(**{**growing, "ripple": 2.99e-4}) is State.UNSTABLE
    assert state(**{**growing, "ripple": 3.01e-4}) is State.UNDECIDED


def test_growth_needs_a_swing_that_is_seen_and_widens() -> None:
    growing = {**STEADY, "late": 1.1e-6, "early": 1.5e-6}
    narrow, wide = ({**growing, "swing_before": 2e-5 / ratio} for ratio in (1.019, 1.021))
    assert state(**narrow) is State.BOUNDED_OSCILLATION
    assert state(**wide) is State.UNSTABLE
    assert state(**{**wide, "linear": 1, "decay": np.nan}) is State.BOUNDED_OSCILLATION
    small = {**wide, "ripple": 1e-7, "late": 1.1e-8, "prior": 1e-8, "early": 1.1e-8}
    for swinging, expected in ((0.99e-7, State.SETTLED), (1.01e-7, State.UNSTABLE)):
        assert state(**{**small, "swing": swinging, "swing_before": 0.5 * swinging}) is expected


def test_a_diverging_run_says_when_and_along_which_axis() -> None:
    tip = np.zeros((50, 3))
    tip[-1] = [0.1, -0.5, 0.2]
    run = trace(tip)
    diverged = Trace(run.time, run.channels, 0.0515)
    for verdict in (judge(diverged), judge_pushed(diverged, 10, np.nan)):
        assert (verdict.state, verdict.since, verdict.axis) == (State.UNSTABLE, 0.0515, "y")
        assert verdict.reason == "diverges at t = 0.0515 s, most along y"
    one = Trace(run.time[:1], {}, 0.001)
    assert judge(one).reason == "diverges at t = 0.001 s"
    assert judge(Trace(np.zeros(1), {})).reason == "the run has no samples to judge"


def test_two_samples_are_judged() -> None:
    run = trace(along_x(np.array([0.0, 1e-3])), reference_force=np.ones((2, 3)))
    assert "no samples to judge" not in judge(run).reason


def test_a_run_that_leaves_its_start_says_how_far_it_goes() -> None:
    """From the first sample to the last: 3 mm and 4 mm across each other."""
    way = np.linspace(0.0, 1e-3, 50)[:, None] * np.array([3.0, 0.0, -4.0])
    linear: Any = SimpleNamespace(leaves=True)
    assert _hidden(trace(way), settled(), State.SETTLED, "", linear).endswith("comes to rest 5 mm away")


@pytest.mark.parametrize(("deflection", "resolution"), [(1e-3, 0.0), (1e-6, 1e-6)])
def test_a_tip_off_its_target_rests_if_it_moves_less_than_the_approach_and_the_counts(
    deflection: float, resolution: float
) -> None:
    """Up to 1e-3 of the deflection, or two encoder counts."""
    for ripple, rests in ((0.99e-6, True), (1.01e-6, False)):
        found = settled(error=0.2, ripple=ripple, deflection=deflection, resolution=resolution)
        said = _undecided(replace(trace(np.zeros((2, 3))), time=np.array([0.0, 1.0])), found, "its swing")
        expected = "it rests" if rests else "after 1 s it is"
        assert said.startswith(f"{expected} 20 % from force over stiffness")


def test_bounces_of_an_impact_that_decay_over_three_fifths_are_no_sustained_oscillation() -> None:
    """They may be as large in one fifth as in the one before."""
    bounces = {"contacts": 1.0, "prior": 7.7e-6, "late": 7.3e-6, "swing": 2.1e-5, "swing_before": 3.2e-5,
               "ripple": 5.1e-5, "ripple_before": 8.6e-5, "deflection": 7.8e-5, "linear": 0}  # fmt: skip
    assert state(**bounces, early=2.4e-5) is State.UNDECIDED
    assert state(**bounces, early=8e-6) is State.BOUNDED_OSCILLATION
    assert state(**{**bounces, "contacts": 0.0}, early=2.4e-5) is State.BOUNDED_OSCILLATION


def test_a_motion_at_rounding_level_does_not_grow() -> None:
    """However small it was before: second differences below 1e-14 m are rounding."""
    before = {"early": 1e-17, "prior": 1e-17, "swing": 2e-6, "swing_before": 1e-6, "ripple": 2e-6, "linear": 0}
    assert state(**before, late=0.9e-14) is State.SETTLED
    assert state(**before, late=1.1e-14) is State.UNSTABLE


def test_a_run_that_nothing_excites_is_undecided() -> None:
    still = trace(np.zeros((500, 3)))
    assert judge(still).state is State.UNDECIDED
    assert "nothing excites the loop" in judge(still).reason
    for size, expected in ((0.9e-7, State.UNDECIDED), (1.1e-7, State.SETTLED)):
        moved = along_x(np.r_[np.linspace(0.0, size, 50), np.full(450, size)])
        assert judge(trace(moved)).state is expected
    pushed = trace(np.zeros((500, 3)), reference_force=np.ones((500, 3)), object_force=np.ones((500, 3)))
    assert judge(pushed).state is State.SETTLED


def swinging(factor: float, frequency: float = 50.0, offset: float = 1e-3) -> Trace:
    """A swing of 0.1 mm along y about an offset along x, which grows by a factor per fifth; it ends at full size."""
    t = PERIOD * np.arange(1001)
    wave = 1e-4 * factor ** ((t - 1.0) / 0.2) * np.sin(2 * np.pi * frequency * t)
    tip = np.column_stack([np.where(t > 0.0, offset, 0.0), wave, 0.0 * t])
    return trace(tip, reference_force=np.ones((len(t), 3)))


def test_a_reason_says_what_the_tip_does_and_what_the_linear_loop_does() -> None:
    steady = judge(swinging(1.0))
    assert (steady.state, steady.axis) == (State.BOUNDED_OSCILLATION, "y")
    assert re.fullmatch(r"it oscillates by 0\.\d+ mm along y at [\d.]+ Hz", steady.reason)
    assert steady.frequency == pytest.approx(50.0, rel=0.06)
    assert f"at {steady.frequency:.3g} Hz" in steady.reason
    assert steady.amplitude == pytest.approx(1e-4, rel=0.01)
    assert judge(swinging(1.0), 0.9).reason == f"{steady.reason}; the linear loop is stable (spectral radius 0.9)"
    pushed = judge_pushed(swinging(1.0), 100, 0.456)
    assert pushed.reason.endswith("Hz, and keeps 46% of its response to a push")
    assert pushed.linear is None
    grows = judge(swinging(1.5))
    assert grows.state is State.UNSTABLE
    assert grows.since == 0.0
    assert re.fullmatch(
        r"an oscillation by 0\.\d+ mm along y at [\d.]+ Hz grows by a factor of 1\.5 in 0\.199 s", grows.reason
    )
    hidden = judge(swinging(1.0), 1.1)
    assert hidden.state is State.UNSTABLE
    assert hidden.reason.startswith("bounded oscillation at the end of the run, with an oscillation by 0.1 mm")
    assert hidden.since is None
    still = judge(swinging(0.1, offset=0.1), 1.1)
    assert still.reason.startswith("the run of 1 s does not show the growth; it ends with an oscillation by")
    decays = judge(swinging(0.5), 0.99)
    assert decays.state is State.SETTLED
    assert "decays by a factor of 0.5 in 0.199 s; the linear loop is stable" in decays.reason
    assert decays.axis is None
    rests = judge(swinging(0.5, offset=0.1))
    assert rests.state is State.SETTLED
    assert re.fullmatch(r"the tip rests within 0\.\d+ mm", rests.reason)


def test_growth_is_zero_at_rest_and_infinite_after_divergence() -> None:
    rest = [growth(*(np.array([one]) for one in (np.nan, 1e-3, 1e-20, late)))[0] for late in (0.0, 0.9e-14)]
    assert rest == [0.0, 0.0]
    assert growth(*(np.array([one]) for one in (np.nan, 1e-20, 1e-15, 1.1e-14)))[0] == pytest.approx(
        1.1e6 ** (1 / 3), rel=0.1
    )
    assert growth(*(np.array([one]) for one in (0.3, 1.0, 1.0, 0.0)))[0] == np.inf


def test_a_green_tick_is_for_settled_and_stable_alone() -> None:
    tones = {one.tone: {other for other in State if other.tone == one.tone} for one in State}
    assert tones["good"] == {State.SETTLED, State.STABLE}
    assert tones["note"] == {State.UNDECIDED}
    assert len({one.label for one in State}) == len(State)


@pytest.mark.parametrize("kind", ["wall", "force_law", "mesh"])
def test_a_force_presses_on_a_plane_by_its_normal_and_on_a_mesh_by_the_last_contact(kind: str) -> None:
    n = 100
    touching = np.zeros(n, dtype=bool)
    touching[30:60] = touching[70:80] = True
    force = np.zeros((n, 3))
    force[30:60], force[70:80] = [0.0, 0.0, 3.0], [-4.0, 0.0, 0.0]  # of the tip on the object: into it
    scenario: Any = SimpleNamespace(contact_kind=kind, object=SimpleNamespace(normal=[0.0, 1.0, 0.0]))

    def pressed(load: list[float], until: int = n - 1, contacts: np.ndarray = touching) -> bool:
        half = np.tile(0.5 * np.array(load), (n, 1))
        half[until + 1 :] = 0.0
        run = trace(np.zeros((n, 3)), reference_force=half, operator_force=half, object_force=force)
        return _pressed(run, scenario, contacts, until)

    if kind == "mesh":
        cases = (([-1.0, 0.0, 0.0], n - 1, True), ([1.0, 0.0, 0.0], n - 1, False), ([0.0, 0.0, 1.0], n - 1, False),
                 ([0.0, 0.0, 1.0], 69, True), ([-1.0, 0.0, 0.0], 69, False), ([-1.0, 0.0, 0.0], 70, True))  # fmt: skip
        for load, until, expected in cases:
            assert pressed(load, until) is expected
        assert pressed([0.0, 5.0, 0.0], contacts=np.zeros(n, dtype=bool))  # it never touched: any force may press
        assert not pressed([0.0, 0.0, 0.0], contacts=np.zeros(n, dtype=bool))
    else:
        assert pressed([0.0, -1.0, 0.0])
        assert not pressed([0.0, 1.0, 0.0])
        assert not pressed([-1.0, 0.0, 0.0])


def test_the_slack_of_a_hand_through_tissue_is_that_of_both_springs_in_series() -> None:
    def arm(**changes: Any) -> float:
        values = {"kind": "arm", "stiffness": 300.0, "tissue_stiffness": None, **changes}
        topology = values.pop("topology", "impedance_display")
        return _arm_stiffness(
            SimpleNamespace(operator=SimpleNamespace(**values), servo=SimpleNamespace(topology=topology))  # type: ignore[arg-type]
        )

    assert arm() == 300.0
    assert arm(tissue_stiffness=600.0) == pytest.approx(200.0)
    assert [arm(kind="force"), arm(stiffness=None), arm(stiffness=0.0), arm(topology="force_tracking")] == [0.0] * 4


@pytest.mark.parametrize("arm", [0.0, 150.0])
def test_a_creeping_body_lets_the_tip_go_on_as_the_standard_linear_solid_says(arm: float) -> None:
    """A force F on springs k + K(t): deflection F/(k + K), with K from r at once to 1 after long times."""
    n, ratio, tau, soft = 501, 3.0, 0.4, 200.0
    operator = SimpleNamespace(kind="arm" if arm else "force", stiffness=arm, tissue_stiffness=None)

    def left(begin: int, options: dict[str, float], window: int = 0) -> float:
        touching = np.arange(n) >= begin
        since = PERIOD * (n - 1 - max(begin, window))
        now = soft / (1.0 - (1.0 - 1.0 / ratio) * np.exp(-since / tau))
        deep = 1.0 / (arm + now)
        run = trace(np.zeros((n, 3)), object_force=along_x(np.full(n, now * deep)))
        body = SimpleNamespace(object=SimpleNamespace(body=SimpleNamespace(options=options)))
        scenario: Any = SimpleNamespace(
            each_object={"a": body, "b": SimpleNamespace(object=SimpleNamespace(body=None))}, operator=operator,
            servo=SimpleNamespace(topology="impedance_display"),
        )  # fmt: skip
        found = _creep(run, scenario, Window(window, n - 1), along_x(np.full(n, deep)), touching)
        return found - (1.0 / (arm + soft) - deep)

    creeps = {"instantaneous_ratio": ratio, "retardation_time": tau}
    for begin, window in ((0, 0), (200, 0), (50, 100), (490, 0)):
        assert left(begin, creeps, window) == pytest.approx(0.0, abs=1e-12)
    assert left(0, {}) < -1e-5  # a body that does not creep has nothing left


def test_an_interruption_is_the_time_off_the_object_after_the_impact() -> None:
    wall: Any = SimpleNamespace(each_object={"": SimpleNamespace(object=SimpleNamespace(kind="wall"))})
    spring: Any = SimpleNamespace(each_object={"": SimpleNamespace(object=SimpleNamespace(kind="spring"))})
    touching = np.ones(100)
    touching[:10] = touching[40:47] = 0.0
    run = trace(np.zeros((100, 3)), touching=touching)
    assert interruption(run, wall) == pytest.approx(7e-3)
    assert [interruption(run, spring), interruption(run, None)] == [0.0, 0.0]
    touching[-1] = 0.0
    assert interruption(trace(np.zeros((100, 3)), touching=touching), wall) == 0.0
    assert interruption(trace(np.zeros((3, 3)), touching=np.array([1.0, 0.0, 1.0])), wall) == pytest.approx(1e-3)


def test_a_tip_off_its_tool_by_more_than_the_counts_has_an_error() -> None:
    tool, tip = np.zeros((10, 3)), np.zeros((10, 3))
    tool[-1], tip[-1] = [3e-3, 0.0, 0.0], [0.0, 4e-3, 0.0]
    run = trace(tip, tool=tool)
    deep = along_x(np.r_[np.full(8, 9.0), 0.1, 0.3])
    for counts, expected in ((0.0, (5e-3 - FLOOR) / 0.2), (2e-3, 3e-3 / 0.2), (6e-3, 0.0)):
        assert _tool_error(run, slice(8, 10), deep, counts) == pytest.approx(expected)
