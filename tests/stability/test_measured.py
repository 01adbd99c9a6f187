"""The critical stiffness of a measured response: its crossing, its standard deviation, and when it is unknown."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.linear import LinearDevice, discretize_zoh
from palpate.stability import MeasuredResponse
from palpate.stability.measured import _crossing

T = 1e-3


def test_a_crossing_of_parabolas_is_exact_and_its_deviation_is_that_of_noisy_trials() -> None:
    """Mismatch (x - a)(1 + x / 10) and a stiffness with a slope, in angles about 0.4 rad, with noise on both."""
    theta = np.linspace(0.3, 0.5, 12)
    x = (theta - 0.41) / 0.1
    mismatch, stiffness = 40.0 * (x - 0.2) * (1.0 + 0.1 * x), 1000.0 + 300.0 * x + 2.0 * x**2
    between = np.array([0.41, 0.45])
    exact = 1000.0 + 300.0 * 0.2 + 2.0 * 0.04
    angle, critical, sigma = _crossing(theta, mismatch, stiffness, np.zeros(12), between)
    assert angle == pytest.approx(0.43, rel=1e-9)
    assert critical == pytest.approx(exact, rel=1e-9)
    assert sigma < 1e-6
    deviation = np.linspace(0.5, 1.5, 12)
    stated = _crossing(theta, mismatch, stiffness, deviation, between)[2]
    rng = np.random.default_rng(0)
    trials = [
        _crossing(
            theta, mismatch + deviation * rng.normal(size=12), stiffness + deviation * rng.normal(size=12),
            deviation, between,
        )[1]
        for _ in range(300)
    ]  # fmt: skip
    assert stated == pytest.approx(np.std(trials), rel=0.2)


def test_a_crossing_outside_its_window_or_without_a_root_is_unknown() -> None:
    theta, flat = np.linspace(0.3, 0.5, 12), np.full(12, 500.0)
    for mismatch in (1.0 + (theta - 0.4) ** 2, theta - 0.55):
        angle, critical, sigma = _crossing(theta, mismatch, flat, np.ones(12), np.array([0.38, 0.42]))
        assert np.isnan([angle, critical]).all()
        assert sigma == np.inf


def measured(
    count: int = 400, low: float = 2.0, top: float = 499.0, deviation: float | None = None
) -> MeasuredResponse:
    f = np.linspace(low, top, count)
    g = discretize_zoh(LinearDevice.of_mass(0.06, 0.5), T, 1).response(2 * np.pi * f * T)
    return MeasuredResponse(f, g, T, None if deviation is None else deviation * np.abs(g))


@pytest.mark.parametrize("count", [15, 16])
def test_sixteen_frequencies_are_needed(count: int) -> None:
    said = measured(count).critical_stiffness(2.0).sentence
    assert (f"the response has {count} frequencies, and at least 16 are needed" in said) is (count < 16)


@pytest.mark.parametrize(("deviation", "noisy"), [(0.299, False), (0.301, True)])
def test_a_relative_noise_above_three_tenths_is_too_much(deviation: float, noisy: bool) -> None:
    said = measured(deviation=deviation).critical_stiffness(2.0).sentence
    assert ("its relative noise is 30 %, above 30 %" in said) is noisy


def test_the_interval_is_four_deviations_wide_and_grows_with_the_noise() -> None:
    fine, coarse = (measured(deviation=one).critical_stiffness(2.0) for one in (1e-3, 2e-3))
    for one in (fine, coarse):
        assert one.known
        assert one.high - one.critical_stiffness == pytest.approx(one.critical_stiffness - one.low)
        assert f"{one.critical_stiffness:.4g} N/m (95 %: {one.low:.4g} to {one.high:.4g} N/m)" in one.sentence
    assert coarse.high - coarse.low == pytest.approx(2.0 * (fine.high - fine.low), rel=0.05)


@pytest.mark.parametrize(("low", "top", "says"), [
    (2.0, 10.0, "the response is too short: it ends at 10 Hz, below the oscillation of the loop; measure up to 500 Hz"),
    (300.0, 499.0, "no stiffness puts an oscillation between 300 Hz and 499 Hz; measure lower frequencies"),
])  # fmt: skip
def test_a_response_without_a_crossing_says_where_to_measure(low: float, top: float, says: str) -> None:
    found = measured(60, low, top).critical_stiffness(0.0)
    assert not found.known
    assert says in found.sentence
