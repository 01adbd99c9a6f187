"""The critical stiffness of a measured response: its crossing, its standard deviation, and when it is unknown."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from palpate.errors import StabilityError
from palpate.linear import LinearDevice, discretize_zoh
from palpate.linear.wall import wall_loop
from palpate.stability import MeasuredResponse, stability_interval
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


@pytest.mark.parametrize("spacing", [np.linspace, np.geomspace])
@pytest.mark.parametrize("relative", [0.003, 0.03])
def test_the_noise_of_a_smooth_curve_is_found_by_its_roughness(spacing: Callable[..., Any], relative: float) -> None:
    """Equal noise on the real and the imaginary part, at equal and at growing distances, however late the response."""
    f = np.asarray(spacing(5.0, 400.0, 3000))
    g = discretize_zoh(LinearDevice.of_mass(0.06, 0.5), T, 1).response(2 * np.pi * f * T) * np.exp(-0.1j * f)
    real, imaginary = np.random.default_rng(9).normal(size=(2, len(f)))
    found = MeasuredResponse(f, g * (1.0 + relative * (real + 1j * imaginary)), T)._noise() / np.abs(g)
    assert np.median(found) == pytest.approx(relative, rel=0.05)


@pytest.mark.parametrize(
    ("delay", "smoothing", "damping"), [(0, 0.5, 3.0), (2, 0.0, 1.0), (1, 0.8, 4.0), (3, 0.2, 0.0)]
)
def test_the_limit_is_that_of_the_exact_loop_with_its_delay_and_velocity_filter(
    delay: int, smoothing: float, damping: float
) -> None:
    device = LinearDevice.of_mass(0.06, 0.5)
    exact = stability_interval(wall_loop(device, T, delay + 1, smoothing), damping)
    found = measured(2000).critical_stiffness(damping, delay=delay, velocity_filter=smoothing)
    assert found.known
    assert found.critical_stiffness == pytest.approx(exact.stiffness, rel=1e-4)
    assert found.frequency == pytest.approx(exact.frequency, rel=1e-4)


def test_shapes_and_deviations_that_do_not_fit_are_refused() -> None:
    f, g = np.linspace(2.0, 499.0, 20), np.full(20, 1e-3 + 0j)
    for frequency, response in ((f[:, None], g[:, None]), (f[:-1], g), (f[:0], g[:0])):
        with pytest.raises(StabilityError, match="one list each, of one length"):
            MeasuredResponse(frequency, response, T)
    for values in (np.where(f > 400.0, 0.0, g), np.where(f > 400.0, np.inf, g)):
        with pytest.raises(StabilityError, match="finite, the response not zero"):
            MeasuredResponse(f, values, T)
    for deviation in (-1e-6, np.nan, np.inf):
        with pytest.raises(StabilityError, match="deviation must be finite and not negative"):
            MeasuredResponse(f, g, T, np.full(20, deviation))
    with pytest.raises(StabilityError, match="one number or one for each frequency, 20"):
        MeasuredResponse(f, g, T, np.full(19, 1e-6))
    for frequency in (f[::-1], f - 2.0, np.linspace(2.0, 501.0, 20)):
        with pytest.raises(
            StabilityError, match="must increase from above 0 to at most half the sampling rate, 500 Hz"
        ):
            MeasuredResponse(frequency, g, T)
    whole = MeasuredResponse([100, 500], [1, 2], "1 ms", 0.5)  # type: ignore[arg-type]
    assert (whole.period, whole.frequency.dtype, whole.response.dtype) == (1e-3, float, complex)
    assert whole.deviation is not None
    assert whole.deviation.tolist() == [0.5, 0.5]
