"""Bounds of the designs: what each refuses, on both sides, and the parts of the synthesis against other programs."""

from __future__ import annotations

import warnings
from typing import Any

import control
import numpy as np
import pytest
from palpate import devices
from palpate.control import Controller, h_infinity, lead_lag, loop_gain, lqg, optimal_gap_margin, robustness, workspace
from palpate.control import h_infinity_design as synthesis
from palpate.control.feedback_loop import active_axes, closed_loop_matrix, spectral_radius
from palpate.control.h_infinity_design import HInfinityDesign, bilinear, gap_margin, lower_feedback
from palpate.control.kalman_filter import _require, kalman
from palpate.control.lead_lag_design import _has_text, _three
from palpate.control.lqg_design import require_reachable_forces
from palpate.control.stability_margins import _exit, critical_gain, frequency_response, gain_interval, loop_margins
from palpate.control.workspace_controller import _condition, is_damped, reachable_axes
from palpate.errors import DesignError, PoseError
from scipy.linalg import solve_continuous_are

T = 5e-4
EYE, NONE = np.eye(3), np.zeros((3, 3))
SS = control.StateSpace
ARM = devices.load("phantom-premium-1.5a")


def scalar(a: float, cost: float = 1.0, noise: float = 1.0, through: float = 0.0) -> control.StateSpace:
    return SS([[a]], [[1, 0, 1]], [[1], [0], [1]], [[0, 0, 0], [0, 0, cost], [0, noise, through]], 1.0)


def test_the_riccati_solution_is_that_of_scipy_and_none_without_one() -> None:
    draw = np.random.default_rng(0)
    for n in (1, 3, 5):
        a, b, c = draw.normal(size=(n, n)), draw.normal(size=(n, 2)), draw.normal(size=(2, n))
        cross, r = 0.1 * draw.normal(size=(n, 2)), np.array([[2.0, 0.3], [0.3, 1.0]])
        q = c.T @ c + cross @ np.linalg.solve(r, cross.T)
        found = synthesis._riccati(a, b, q, cross, r)
        np.testing.assert_allclose(found, solve_continuous_are(a, b, q, r, s=cross), rtol=1e-6, atol=1e-9)
    one, zero = np.ones((1, 1)), np.zeros((1, 1))
    assert synthesis._riccati(zero, one, zero, zero, one) is None  # eigenvalues on the imaginary axis
    assert synthesis._riccati(-one, one, -0.5 * one, zero, one) is None  # negative
    assert synthesis._riccati(-one, one, -2.0 * one, zero, one) is None
    assert synthesis._riccati(one, zero, one, zero, one) is None  # not stabilizable
    assert synthesis._riccati(-one, one, one, zero, zero) is None  # no cost
    empty = np.zeros((0, 0))
    assert synthesis._riccati(empty, np.zeros((0, 1)), empty, np.zeros((0, 1)), one) is not None


def test_a_problem_beyond_the_formulas_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    full = r"^h_infinity: every command must have a cost and every measurement a noise \(D12 and D21 of full rank\)$"

    def bare(cost: float, noise: float) -> control.StateSpace:
        return SS([[0.9]], [[0, 0, 1]], [[0], [0], [1]], [[0, 0, 0], [0, 0, cost], [0, noise, 0]], 1.0)

    for wrong in (bare(0.9e-10, 1.0), bare(1.0, 0.9e-10), bare(0.0, 1.0)):
        with pytest.raises(DesignError, match=full):
            h_infinity(wrong, 1, 1)
    for right in (bare(1.1e-10, 1.0), bare(1.0, 1.1e-10)):
        assert synthesis._Problem.of(right, 1, 1).direct == 0.0
    with pytest.raises(DesignError, match=full):
        h_infinity(SS([[0.9]], [[1, 1, 1]], [[1], [1]], [[0, 1, 1], [1, 0, 0]], 1.0), 1, 2)
    with pytest.raises(DesignError, match=full):
        h_infinity(SS([[0.9]], [[1, 1]], [[1], [1], [1]], [[0, 1], [1, 0], [1, 0]], 1.0), 2, 1)
    lost = SS(np.diag([2.0, 0.5]), [[1, 0, 0], [0, 0, 1]], [[1, 0], [0, 0], [0, 1]], scalar(0.9).D, 1.0)
    with pytest.raises(DesignError, match=r"^h_infinity: no controller stabilizes the plant; is it stabilizable and"):
        h_infinity(lost, 1, 1)
    with pytest.raises(DesignError, match=r"^h_infinity: a pole at half the sampling rate; delay the plant or change"):
        h_infinity(scalar(-1.0), 1, 1)
    found = h_infinity(scalar(1.2, through=0.4), 1, 1)
    assert isinstance(found, HInfinityDesign)
    closed = lower_feedback(scalar(1.2, through=0.4), found.controller)
    assert np.abs(closed.poles()).max() < 1.0
    for share, refused in ((1.0, False), (1.00005, False), (1.0002, True)):
        monkeypatch.setattr(synthesis, "peak_gain", lambda _, share=share: (share * found.level, 0.0))
        if not refused:
            assert h_infinity(scalar(1.2, through=0.4), 1, 1).level == found.level
            continue
        with pytest.raises(DesignError, match=r"^h_infinity: the loop has the norm .* in place of .*; it is ill-cond"):
            h_infinity(scalar(1.2, through=0.4), 1, 1)
    monkeypatch.setattr(synthesis, "lower_feedback", lambda *_: SS([[1.0]], [[1.0]], [[1.0]], [[0.0]], 1.0))
    with pytest.raises(DesignError, match=r"^h_infinity: the loop with the controller found is not stable"):
        h_infinity(scalar(1.2), 1, 1)


def test_the_bilinear_map_moves_the_frequencies_and_back() -> None:
    draw = np.random.default_rng(1)
    parts = 0.4 * draw.normal(size=(3, 3)), draw.normal(size=(3, 2)), draw.normal(size=(2, 3)), draw.normal(size=(2, 2))
    sampled, moved = SS(*parts, 1.0), bilinear(*parts)
    for theta in (0.2, 2.0):
        s = 1j * np.tan(theta / 2)
        found = moved[3] + moved[2] @ np.linalg.solve(s * np.eye(3) - moved[0], moved[1])
        np.testing.assert_allclose(found, frequency_response(sampled, theta), rtol=1e-9)
    for again, one in zip(bilinear(*moved, back=True), parts, strict=True):
        np.testing.assert_allclose(again, one, atol=1e-9)
    with pytest.raises(DesignError, match="a pole at half the sampling rate"):
        bilinear(np.diag([1.0, 0.5]), np.ones((2, 1)), np.ones((1, 2)), np.zeros((1, 1)), back=True)
    assert bilinear(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1)))[3] == 1.0


def test_a_gap_margin_is_zero_without_stability_and_closed_form_without_states() -> None:
    """b = 1 / |[k; 1] (1 - p k)^-1 [1 p]| = |1 - p k| / (|[k; 1]| |[1 p]|) for constants."""
    for p, k in ((0.5, -1.0), (-2.0, 0.3)):
        found = gap_margin(SS([], [], [], [[p]], 1.0), SS([], [], [], [[k]], 1.0))
        assert found == pytest.approx(abs(1 - p * k) / np.hypot(1, k) / np.hypot(1, p), rel=1e-6)
    edge = SS([[0.5]], [[1.0]], [[1.0]], [[0.0]], 1.0)
    for k, stable in ((0.5, False), (0.499, True), (-1.5, False), (-1.499, True)):
        assert (gap_margin(edge, SS([], [], [], [[k]], 1.0)) > 0.0) is stable
    with pytest.raises(DesignError, match=r"^optimal_gap_margin: the plant is not stabilizable and detectable$"):
        optimal_gap_margin(SS(np.diag([2.0, 0.5]), [[0.0], [1.0]], [[1.0, 1.0]], [[0.0]], 1.0))


def test_the_robustness_of_a_constant_gain_is_that_of_its_scaled_loop() -> None:
    plant = SS(0.5 * EYE, EYE * [1.0, 2.0, 4.0], EYE, NONE, 1e-3)
    law = Controller.gain(0.05, 1e-3)
    found = robustness(law, plant, crossover=200.0)
    gain = 1.0 / np.linalg.norm(frequency_response(plant, 0.2), 2)
    scaled = SS(plant.A, plant.B, gain * plant.C, NONE, 1e-3)
    assert found.margin == pytest.approx(gap_margin(scaled, SS([], [], [], -0.05 / gain * EYE, 1e-3)), rel=1e-9)
    assert found.optimum == pytest.approx(optimal_gap_margin(scaled), rel=1e-9)
    assert found.crossover == 200.0


def test_a_filter_and_a_regulator_need_modes_that_they_reach() -> None:
    for z, seen, refused in (
        (1.0, 1e-10, True),
        (1.0, 2e-9, False),
        (1.5, 0.0, True),
        (0.9, 0.0, False),
        (-1.0, 0.0, True),
    ):
        a, c = np.diag([z, 0.3]), np.array([[seen, 1.0]])
        if refused:
            with pytest.raises(DesignError, match=r"^who: no output sees the mode at z = .*, which does not decay by"):
                _require(a, c, "who", "no output sees")
        else:
            _require(a, c, "who", "no output sees")
    blind = SS(np.diag([1.0, 0.5]), [[0.0], [1.0]], [[1.0, 1.0]], [[0.0]], T)
    with pytest.raises(DesignError, match=r"^kalman: no st"):
        kalman(blind, 1.0, 1.0)
    good = SS(np.diag([0.99, 0.5]), [[0.0], [1.0]], [[1.0, 1.0]], [[0.0]], T)
    assert np.abs(kalman(good, 1.0, 1.0).poles).max() == pytest.approx(0.99)
    for options, says in (
        ({"noise": -1.0}, r"kalman: measurement noise must be positive and finite in N, not \[-1\.0\]"),
        ({"noise": np.inf}, r"kalman: measurement noise must be positive and finite in N, not \[inf\]"),
        ({"disturbance": np.nan}, "kalman: the disturbance must be finite"),
        ({"disturbance": np.eye(3)}, "kalman: a process covariance must be 2 x 2, not 3 x 3"),
    ):
        with pytest.raises(DesignError, match=f"^{says}$"):
            kalman(good, **({"disturbance": 1.0, "noise": 1.0} | options))  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [1e-8, 1.0, 1e8])
def test_a_zero_at_one_is_found_in_any_units(size: float) -> None:
    """1 - 1/z holds no constant force; 1 + share - 1/z does."""
    for share, refused in ((0.0, True), (1e-3, False)):
        a, b, c, d = np.zeros((1, 1)), np.ones((1, 1)), -np.ones((1, 1)), np.full((1, 1), 1.0 + share)
        if refused:
            with pytest.raises(DesignError, match=r"^lqg: integrators need a plant without a zero at z = 1"):
                require_reachable_forces(a, b * size, c * size, d * size * size)
        else:
            require_reachable_forces(a, b * size, c * size, d * size * size)
    require_reachable_forces(np.zeros((1, 1)), np.array([[2.0]]), np.array([[3.0]]), np.array([[-5.0]]))
    with pytest.raises(DesignError):
        require_reachable_forces(np.zeros((1, 1)), np.array([[2.0]]), np.array([[3.0]]), np.array([[-6.0]]))


def test_an_axis_weaker_than_rounding_is_no_axis() -> None:
    for weak, axes in ((1e-13, [0, 1]), (1e-11, [0, 1, 2])):
        assert active_axes(SS(EYE, EYE * [1.0, 0.5, weak], EYE, NONE, T)).tolist() == axes
        assert active_axes(SS(EYE, NONE, EYE, np.diag([1.0, -0.5, -weak]), T)).tolist() == axes
    assert active_axes(SS(EYE, NONE + 1e-200, EYE, NONE, T)).tolist() == [0, 1, 2]


def test_the_closed_loop_of_a_gain_is_that_of_the_scaled_loop() -> None:
    draw = np.random.default_rng(0)
    loop = SS(0.3 * draw.normal(size=(4, 4)), draw.normal(size=(4, 2)), draw.normal(size=(2, 4)), 0.2 * EYE[:2, :2], T)
    for gain in (0.5, np.exp(0.3j), np.array([[0.4, 0.1], [0.0, 0.7]])):
        g = gain if np.ndim(gain) else gain * np.eye(2)
        wanted = loop.A - loop.B @ np.linalg.inv(np.eye(2) + g @ loop.D) @ g @ loop.C
        np.testing.assert_allclose(closed_loop_matrix(loop, gain), wanted, rtol=1e-9, atol=1e-12)
        assert spectral_radius(loop, gain) == pytest.approx(np.abs(np.linalg.eigvals(wanted)).max())
    assert spectral_radius(SS([], [], [], [[0.5]], T)) == 0.0


def test_the_ends_of_a_range_of_gains_are_those_of_one_pole() -> None:
    """z = 0.5 - k: stable for -0.5 < k < 1.5."""
    loop = SS([[0.5]], [[1.0]], [[1.0]], [[0.0]], T)
    assert gain_interval(loop) == (0.0, pytest.approx(1.5, rel=1e-10))
    assert gain_interval(loop, 0.2)[1] == pytest.approx(1.5, rel=1e-10)
    assert critical_gain(loop, 2.0) == pytest.approx(1.5, rel=1e-10)
    high = SS([[1.5]], [[1.0]], [[1.0]], [[0.0]], T)
    assert gain_interval(high) == (pytest.approx(0.5, rel=1e-10), pytest.approx(2.5, rel=1e-10))
    assert critical_gain(high, 5.0) == pytest.approx(2.5, rel=1e-10)
    still = SS([[0.5]], [[1e-9]], [[1.0]], [[0.0]], T)
    assert gain_interval(still) == (0.0, np.inf)
    found = loop_margins(still)
    assert (found.crossover, found.phase, found.delay) == (0.0, np.inf, np.inf)
    assert found.disk == pytest.approx(2.0, rel=1e-6)
    for call, says in (
        (lambda: gain_interval(loop, 1.5000001), r"gain_interval: the loop is unstable at the gain 1\.5 to start from"),
        (lambda: critical_gain(loop, 1.4), r"critical_gain: the loop is stable up to the gain 1\.4"),
        (lambda: critical_gain(SS([[3.0]], [[1.0]], [[1.0]], [[0.0]], T), 1.5),
         r"critical_gain: the loop is unstable at every gain from 1\.5e-06 to 1\.5"),
        (lambda: loop_margins(SS([[2.5]], [[1.0]], [[1.0]], [[0.0]], T)),
         r"margins: the loop is unstable \(spectral radius 1\.500000\), so it has no margins; critical_gain gives the "
         r"gain that would be stable"),
        (lambda: loop_gain(Controller.gain(1.0, T), SS(EYE, EYE, EYE, NONE, T * (1.0 + 2e-6))),
         r"the plant's period is 0\.000500001 s and the controller's 0\.0005 s; sample both alike"),
    ):  # fmt: skip
        with pytest.raises(DesignError, match=f"^{says}$"):
            call()
    loop_gain(Controller.gain(1.0, T), SS(EYE, EYE, EYE, NONE, T * (1.0 + 5e-7)))
    assert _exit(loop, 1.4, 1.6) == (1.4, 1.6)
    assert _exit(loop, 0.1, 0.2) is None


def test_the_loops_at_the_command_and_at_the_force_have_their_own_order() -> None:
    plant = SS(0.5 * EYE, EYE + 0.1, EYE, NONE, T)
    law = Controller.gain([1.0, 2.0, 3.0], T)
    for theta in (0.1, 2.0):
        p, k = frequency_response(plant, theta), np.diag([1.0, 2.0, 3.0])
        np.testing.assert_allclose(frequency_response(loop_gain(law, plant), theta), k @ p, rtol=1e-9)
        np.testing.assert_allclose(frequency_response(loop_gain(law, plant, "object_force"), theta), p @ k, rtol=1e-9)


def test_text_and_limits_of_a_specification() -> None:
    assert [_has_text(one) for one in ("1", ["1", "2"], ("1",), ["1", 2.0], 3.0, [1.0])] == [True] * 3 + [False] * 3
    np.testing.assert_allclose(_three("0.5 rad", "phase_margin", "deg", 0.0, 90.0), np.full(3, np.degrees(0.5)))
    assert _three([1.0, 2.0, 3.0], "crossover", "rad/s", 0.0, 4.0).tolist() == [1.0, 2.0, 3.0]
    for wrong in (0.0, 4.0, [1.0, 2.0], [1.0, np.nan, 2.0]):
        with pytest.raises(DesignError, match=r"^lead_lag: crossover must be one value or three between 0 and 4 rad/s"):
            _three(wrong, "crossover", "rad/s", 0.0, 4.0)
    twins = SS(EYE, T * np.array([[1, 1, 0], [1, 1 + 1e-9, 0], [0, 0, 1.0]]), EYE, NONE, T)
    with pytest.raises(DesignError, match=r"^lead_lag: the axes cannot be decoupled at the crossover; use decouple="):
        lead_lag(twins)
    with pytest.raises(DesignError, match=r"^lqg: state_weight must be finite and 6 x 6, not \(6, 6\)$"):
        lqg(SS(0.5 * EYE, EYE, EYE, NONE, T), state_weight=np.full((6, 6), np.inf))
    with pytest.raises(DesignError, match=r"^lqg: the weights leave a mode on the unit circle; weigh every state"):
        lqg(SS(EYE, EYE, EYE, NONE, T), integrators=False, state_weight=np.zeros((3, 3)))


def test_the_workspace_controller_says_what_it_does_not_take() -> None:
    for call, says in (
        (lambda: workspace(ARM, T, speed=1.0), 'workspace: "speed" is no option; known are bandwidth, damping, '),
        (lambda: workspace(ARM, T, normal_only=1), "workspace: normal_only must be True or False, not 1"),
        (lambda: workspace(ARM, 0.0), "workspace: the servo period must be positive, not 0 s"),
        (lambda: workspace(ARM, T, bandwidth=-1.0), "workspace: "),
    ):  # fmt: skip
        with pytest.raises(DesignError) as caught:
            call()
        assert str(caught.value).startswith(says)
    with pytest.raises(PoseError, match=r"^workspace: the pose is singular, so the tip's inertia is not defined$"):
        workspace(ARM, T).linearized([0.0, 0.5, 0.5 + np.pi / 2])
    jacobian = np.diag([1.0, 1.0, 0.5])
    assert _condition(jacobian) == pytest.approx(1.5 * np.sqrt(6.0))
    for small, damped in ((0.13, False), (0.11, True)):
        assert is_damped(np.diag([1.0, 1.0, small])) is damped
    np.testing.assert_array_equal(reachable_axes(jacobian[[1, 2, 0]]), EYE)
    turned = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 2)))[0] @ np.array([[1.0, 0.3], [0.0, 2.0]])
    axes = reachable_axes(turned)
    assert axes.shape == (3, 2)
    np.testing.assert_allclose(axes @ axes.T @ turned, turned, atol=1e-12)
    nyquist = np.pi / T

    def warned(**options: Any) -> str:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            workspace(ARM, T, **options)
        return " ".join(str(one.message) for one in caught)

    assert warned(reference=nyquist * (1 - 1e-9)) == ""
    text = warned(bandwidth=nyquist * 1.01, observer=1.0, reference=2 * nyquist)
    assert text == (
        "workspace: the feedback has a rate of 6346 rad/s, above the Nyquist frequency of 6283 rad/s, so it acts "
        "within one tick and passes noise and encoder counts: lower bandwidth, or shorten the servo period"
    )
    assert "the observer has a rate of 6400 rad/s" in warned(bandwidth=1000.0, observer=6.4)
    assert "the reference model has a rate of 7000 rad/s" in warned(reference=7000.0)
