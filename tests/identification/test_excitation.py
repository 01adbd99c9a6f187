"""Excitation signals: exact peaks, the band they promise, channels that can be told apart, one signal per seed."""

from types import SimpleNamespace

import numpy as np
import pytest
from palpate.devices import load
from palpate.errors import RecordingError
from palpate.identification import chirp, crest_factor, multisine, prbs
from palpate.identification.excitation import _count
from palpate.identification.servo import respond

PERIOD = 1e-3


@pytest.mark.parametrize(
    "excitation",
    [
        multisine([0.1, 0.2, 0.05], (0.5, 20.0), lines=15, seed=4),
        prbs([0.1, 0.2, 0.05], 0.02, seed=4),
        chirp([0.1, 0.2, 0.05], (0.5, 20.0), seed=4),
    ],
    ids=["multisine", "prbs", "chirp"],
)
def test_peak_is_exact_and_the_seed_fixes_the_signal(excitation):
    values = excitation.sample(8.0, PERIOD)
    assert values.shape == (8000, 3)
    tolerance = 1e-3 if excitation.describe()["kind"] == "chirp" else 1e-12  # a sampled sine may miss its own peak
    np.testing.assert_allclose(np.abs(values).max(axis=0), [0.1, 0.2, 0.05], rtol=tolerance)
    np.testing.assert_array_equal(values, excitation.sample(8.0, PERIOD))


@pytest.mark.parametrize(
    "make", [lambda s: multisine([1.0, 1.0], (0.5, 20.0), seed=s), lambda s: prbs([1.0], 0.02, seed=s)]
)
def test_another_seed_is_another_signal(make):
    one, other = make(1).sample(4.0, PERIOD), make(2).sample(4.0, PERIOD)
    assert np.abs(one - other).max() > 0.5


def test_multisine_channels_are_orthogonal_and_stay_in_their_band():
    values = multisine([1.0, 1.0, 1.0], (1.0, 10.0), lines=12, seed=0).sample(8.0, PERIOD)
    gram = values.T @ values / len(values)
    np.testing.assert_allclose(gram - np.diag(np.diag(gram)), 0.0, atol=1e-12)
    power = np.abs(np.fft.rfft(values, axis=0)) ** 2
    frequency = np.fft.rfftfreq(len(values), PERIOD)
    outside = power[(frequency < 0.99) | (frequency > 10.01)].sum()
    assert outside < 1e-20 * power.sum()


def test_multisine_phases_beat_random_ones():
    wave = multisine([1.0], (1.0, 10.0), lines=20, seed=0).sample(8.0, PERIOD)
    spectrum = np.fft.rfft(wave, axis=0)
    draw = np.random.default_rng(0)
    turned = np.exp(2j * np.pi * draw.uniform(size=(len(spectrum), 100)))
    random = crest_factor(np.fft.irfft(spectrum * turned, axis=0))
    assert crest_factor(wave)[0] < np.percentile(random, 5)


def test_prbs_is_binary_with_flat_correlation():
    values = prbs([0.3], 0.01, seed=1).sample(10.23, PERIOD)[:, 0]  # one whole sequence of 1023 chips
    assert set(np.unique(values)) == {-0.3, 0.3}
    chips = np.sign(values[::10])
    spectrum = np.abs(np.fft.fft(chips)) ** 2
    correlation = np.fft.ifft(spectrum).real
    np.testing.assert_allclose(correlation[1:], -1.0, atol=1e-9)  # the mark of a maximal-length sequence


def test_prbs_channels_are_successive_stretches_of_one_sequence():
    """Also where all chips together are just one more than the sequence of a shorter register."""
    for chips in (7, 8, 9, 16):
        both = prbs([1.0, 1.0], 0.01, seed=2).sample(0.01 * chips, PERIOD)
        one = prbs([1.0], 0.01, seed=2).sample(0.02 * chips, PERIOD)
        np.testing.assert_array_equal(both.T.ravel(), one[:, 0])


def test_sweep_passes_the_band_once_per_channel():
    values = chirp([1.0, 1.0], (1.0, 30.0), seed=3).sample(10.0, PERIOD)
    assert np.all((values[:, 0] == 0) | (values[:, 1] == 0))
    for channel in values.T:
        wave = channel[np.flatnonzero(channel)[0] : np.flatnonzero(channel)[-1] + 1]
        crossings = np.diff(np.flatnonzero(np.diff(np.sign(wave))))
        assert crossings[:3].mean() > 8 * crossings[-3:].mean()  # slow at first, fast at last


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: multisine([1.0], (5.0, 1.0)).sample(1.0, PERIOD), "band must rise"),
        (lambda: multisine([1.0], (0.1, 5.0)).sample(1.0, PERIOD), "does not fit one period"),
        (lambda: multisine([1.0], (1.0, 600.0)).sample(1.0, PERIOD), "500 Hz"),
        (lambda: multisine([1.0], (1.0, 2.0), lines=0), "at least one line"),
        (lambda: prbs([1.0], 0.0015).sample(1.0, PERIOD), "whole number of periods"),
        (lambda: prbs([np.nan], 0.01), "finite"),
        (lambda: prbs([-1.0], 0.01), "not negative"),
    ],
)
def test_impossible_signals_say_why(call, says):
    with pytest.raises(RecordingError, match=says):
        call()


@pytest.mark.parametrize("clock", [0.0, -0.01, np.inf, np.nan])
def test_a_clock_is_a_positive_time(clock):
    with pytest.raises(RecordingError, match="the clock must be a positive time"):
        prbs([1.0], clock)


def test_the_crest_factor_is_that_of_the_shape_alone():
    t = np.linspace(0.0, 1.0, 4000, endpoint=False)
    shapes = np.column_stack(
        [np.sign(np.sin(2 * np.pi * 5 * t) + 1e-9), np.sin(2 * np.pi * 5 * t), 2 * (t % 0.1) / 0.1 - 1]
    )
    expected = [1.0, np.sqrt(2.0), np.sqrt(3.0)]
    for scale in (1.0, 1e-3, 50.0):
        np.testing.assert_allclose(crest_factor(scale * shapes), expected, rtol=1e-2)


@pytest.mark.parametrize(("duration", "count"), [(1.4e-3, 0), (1.6e-3, 2), (3e-3, 3)])
def test_a_signal_has_two_samples_or_more(duration: float, count: int) -> None:
    if count:
        assert _count(duration, 1e-3) == count
    else:
        with pytest.raises(RecordingError, match=r"0\.0014 s at a period of 0\.001 s are fewer than two samples"):
            _count(duration, 1e-3)


@pytest.mark.parametrize("name", ["excitation", "sway", "angle_noise", "torque_noise"])
def test_a_signal_of_another_shape_is_refused_by_its_name(name: str) -> None:
    device, servo = load("slider"), SimpleNamespace()
    signals = {"excitation": np.zeros((9, 1)), name: np.zeros((8, 2))}
    excitation = signals.pop("excitation")
    n, said = (8, "excitation") if name == "excitation" else (9, name.removeprefix("angle_").removeprefix("torque_"))
    with pytest.raises(RecordingError, match=rf"the {said} must be \({n}, 1\), not \(8, 2\)"):
        respond(device, servo, excitation, 1e-3, **signals)  # type: ignore[arg-type]
