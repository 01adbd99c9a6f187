"""Samples, files, models and signals that are refused, each on both sides of its bound, with the whole sentence."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from identify_data import short_recording
from palpate import devices
from palpate import identification as identify
from palpate.errors import RecordingError
from palpate.identification.arx_models import arx
from palpate.identification.recording import Recording
from palpate.identification.samples import check_samples, uniform_period
from palpate.identification.weak_form import TestFunctions, slowest_speed, smooth

ARM, SLIDER = devices.load("phantom-premium-1.5a"), devices.load("slider")
GRID = np.arange(100.0)


def moved(place: int, off: float, time: Any = GRID) -> Any:
    out = np.array(time, dtype=float)
    out[place] += off
    return out


def checked(time: Any) -> None:
    check_samples(np.asarray(time, float), {}, "sample {}".format)


def record(count: int = 200, dof: int = 1, **changes: Any) -> Recording:
    draw = np.random.default_rng(0)
    parts = {
        "time": 1e-3 * np.arange(count),
        "angle": draw.normal(size=(count, dof)),
        "torque": draw.normal(size=(count, dof)),
    }
    return Recording(**(parts | changes))


def stairs(*values: float) -> Recording:
    """An angle that repeats a pattern of small steps, and then these values."""
    pattern = np.r_[np.tile(np.r_[0.0:12.0, 10.0:0.0:-1.0], 10), np.arange(12.0), values]
    return record(len(pattern), angle=pattern)


def held(count: int) -> list[bool]:
    values = np.sin(np.arange(80.0))
    values[30 : 30 + count] = 2.0
    found = record(80).at_end(values[:, None])[:, 0]
    assert not np.delete(found, np.arange(30, 30 + count)).any()
    return [bool(one) for one in found[30 : 30 + count]]


def test_what_stands_at_an_end_for_three_samples_is_marked() -> None:
    assert held(1) == [False]
    assert held(2) == [False] * 2
    assert held(3) == [True] * 3
    low = record(80).at_end(np.r_[np.full(4, -3.0), np.sin(np.arange(76.0))][:, None])[:, 0]
    assert low.tolist() == [True] * 4 + [False] * 76


def test_what_lies_within_a_bound_is_accepted() -> None:
    checked(GRID[:50])
    checked(moved(40, 0.0999))
    checked(moved(40, -0.0999))
    checked(1e5 + 1e-3 * moved(40, 0.15))  # the rounding of a large time stamp is allowed for
    checked(-1e5 + 1e-3 * moved(40, 0.15))
    record(100).split(0.5)
    assert len(record(141).decimate(2)) == 51
    one = record()
    assert one.decimate(1) is one
    record(period=1e-3 / 1.0999)
    stairs(21.9).require_excitation()  # a step of 10.9, below half of the range
    record(angle=np.repeat([0.0, 1.0], 100)).require_excitation()  # few values: a count of the encoder
    assert arx(record(25 + 25), 2, 1, 1).samples == 48
    assert uniform_period(0.1 * np.arange(11.0)) == 0.1
    assert TestFunctions(0.1).kernels(0.0125)[3] == 2
    assert identify.multisine([1.0], (1.0, 2.0), lines=1).sample(1.0, 0.01).shape == (100, 1)
    assert identify.multisine([0.0], (1.0, 2.0)).amplitude.tolist() == [0.0]
    identify.prbs([1.0], 0.01 * (1 + 0.9e-6)).sample(1.0, 0.01)


CASES: list[tuple[Callable[[], Any], str]] = [
    (lambda: checked(GRID[:49]), "49 samples are too few; at least 50 are needed"),
    (lambda: checked(moved(40, 0.12)),
     "sample 40: the time stamps are not uniform (40.12 s is 0.12 s off a grid of 1 s); resample before identifying"),
    (lambda: checked(1e5 + 1e-3 * moved(40, 0.25)),
     "sample 40: the time stamps are not uniform (100000.04 s is 0.00025 s off a grid of 0.001 s); resample before "
     "identifying"),
    (lambda: checked(np.where(GRID >= 40, GRID + 0.6, GRID)),
     "sample 40: a gap of 1.6 s after 39 s, about 1 samples missing; the period is 1 s"),
    (lambda: checked(moved(40, -1.0)),
     "sample 40: the time stamp 39 s repeats the one before (39 s)"),
    (lambda: checked(moved(40, -1.5)),
     "sample 40: the time stamp 38.5 s is earlier than the one before (39 s)"),
    (lambda: checked(moved(40, np.nan)), "sample 40: time is nan, not a finite number"),
    (lambda: record(angle=moved(7, -np.inf, np.zeros(200))), "sample 7: angle 1 is -inf, not a finite number"),
    (lambda: record(excitation=np.c_[GRID, GRID]),
     "excitation has shape (100, 2); it must be that of torque, (200, 1)"),
    (lambda: record(angle=np.zeros((200, 1, 1))), "angle must be (samples x joints); its shape is (200, 1, 1)"),
    (lambda: record(torque=np.zeros((200, 0))), "torque must be (samples x joints); its shape is (200, 0)"),
    (lambda: record(angle=np.zeros((200, 2))), "angle has 2 columns and torque 1; each joint needs one of both"),
    (lambda: record(period=np.nan), "the period is nan s; it must be a positive number of seconds"),
    (lambda: record(period=1e-3 / 1.12),
     "the period is said to be 0.000892857 s but the time stamps are 0.001 s apart"),
    (lambda: record(100).split(0.49), "a split at 0.49 of 100 samples leaves a part with fewer than 50"),
    (lambda: record(100).split(0.51), "a split at 0.51 of 100 samples leaves a part with fewer than 50"),
    (lambda: record(140).decimate(2), "140 samples are too short to decimate by 2"),
    (lambda: record().decimate(0), "a recording is decimated by 1 or more, not by 0"),
    (lambda: record(torque=np.full(200, 0.25)).require_excitation(),
     "too little excitation: torque 1 is 0.25 in all 200 samples; excite every joint"),
    (lambda: stairs(22.1).require_excitation(),
     "sample 232: angle 1 jumps from 11 to 22.1 rad, over half of its range: the encoder wraps, or a sample is wrong; "
     "unwrap the angle before identifying"),
    (lambda: arx(record(49 + 1), [[20]], 5, 1), "50 samples are too few for 25 coefficients per output; 70 are needed"),
    (lambda: arx(record(), -1, 1, 1), "na must be a 1 x 1 matrix of whole numbers, 0 or more, or one of them"),
    (lambda: arx(record(), 1, 1.5, 1), "nb must be a 1 x 1 matrix of whole numbers, 0 or more, or one of them"),
    (lambda: arx(record(), 1, 1, [1, 2]), "nk must be a 1 x 1 matrix of whole numbers, 0 or more, or one of them"),
    (lambda: arx(record(), 0, 0, 1), "an output without any coefficient cannot be modeled; raise na or nb in its row"),
    (lambda: arx(record(), 1, 1, 1).residuals(record(dof=2)),
     "the model has 1 outputs but the recording 2 joints"),
    (lambda: arx(record(), 1, 1, 1).residuals(record(time=2e-3 * np.arange(200))),
     "the model is sampled every 0.001 s but the recording every 0.002 s; decimate both alike"),
    (lambda: identify.estimate_parameters(short_recording(0), ARM, level=0.0),
     "the confidence level must lie between 0 and 1, not 0.0"),
    (lambda: identify.estimate_parameters(short_recording(0), ARM, level=1.0),
     "the confidence level must lie between 0 and 1, not 1.0"),
    (lambda: identify.estimate_parameters(short_recording(0), SLIDER), "the recording has 3 joints, slider has 1"),
    (lambda: identify.estimate_parameters(short_recording(0).slice(0, 250), ARM),
     "0.5 s are too short for 14 parameters; record at least 5 s"),
    (lambda: smooth(np.zeros((200, 1)), 1e-6, 0.025),
     "0.0002 s are too short: angles are smoothed over 0.025001 s; record longer, or check the unit of the time"),
    (lambda: TestFunctions(0.1).kernels(0.0151),
     "samples every 0.0151 s are too slow for test functions 0.1 s wide; sample at 0.0125 s or less"),
    (lambda: identify.multisine([1.0], (1.0, 2.0), lines=0), "a multisine needs at least one line; got 0"),
    (lambda: identify.multisine([[1.0]], (1.0, 2.0)),
     "amplitudes must be finite and not negative, one per channel; got [[1.0]]"),
    (lambda: identify.multisine([1.0, 1.0, 1.0], (1.0, 2.0)).sample(1.0, 0.01),
     "the band 1 to 2 Hz has 2 lines in 1 s; 3 channels need more"),
    (lambda: identify.multisine([1.0], (1.0, 50.0)).sample(2.0, 0.01),
     "the band must rise within 0 < f < 50 Hz (half the sampling rate); got 1 to 50 Hz"),
    (lambda: identify.multisine([1.0], (0.0, 5.0)).sample(2.0, 0.01),
     "the band must rise within 0 < f < 50 Hz (half the sampling rate); got 0 to 5 Hz"),
    (lambda: identify.multisine([1.0], (2.0, 2.0)).sample(2.0, 0.01),
     "the band must rise within 0 < f < 50 Hz (half the sampling rate); got 2 to 2 Hz"),
    (lambda: identify.multisine([1.0], (0.99, 5.0)).sample(1.0, 0.01), "0.99 Hz does not fit one period into 1 s"),
    (lambda: identify.prbs([1.0], 0.01 * (1 + 3e-6)).sample(1.0, 0.01),
     "the clock must be a whole number of periods of 0.01 s; got 0.01 s"),
    (lambda: identify.prbs([1.0], 0.004).sample(1.0, 0.01),
     "the clock must be a whole number of periods of 0.01 s; got 0.004 s"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "says"), CASES, ids=range(len(CASES)))
def test_what_lies_beyond_a_bound_is_refused(call: Callable[[], Any], says: str) -> None:
    with pytest.raises(RecordingError) as caught:
        call()
    assert str(caught.value) == says


@pytest.mark.parametrize("name", ["r.csv", "r.h5", "r.hdf5"])
@pytest.mark.parametrize("units", [("m", "N"), ("rad", "N*m")])
def test_the_units_of_a_file_are_those_of_its_joints(tmp_path: Path, name: str, units: tuple[str, str]) -> None:
    one = record(units=units, excitation=np.linspace(0.0, 1.0, 200), metadata={"seed": 3})
    again = Recording.load(one.save(tmp_path / name))
    assert again.units == units
    assert again.metadata == {"seed": 3, "file": name}
    for field in ("time", "angle", "torque", "excitation"):
        np.testing.assert_array_equal(getattr(again, field), getattr(one, field))
    if name != "r.csv":
        with h5py.File(tmp_path / name) as store:
            said = {key: (data.attrs["unit"], data.attrs["description"]) for key, data in store.items()}
            assert said == {
                "time": ("s", "time of the sample"),
                "angle": (units[0], "joint coordinates as the encoders read them"),
                "torque": (units[1], "joint torque held from this sample to the next"),
                "excitation": (units[1], "injected part of the torque"),
            }
            assert store.attrs["period"] == one.period


HEADER = "time [s], {}, {}\n"
UNITS: list[tuple[str, str, float, float]] = [
    ("q1 [mrad]", "tau1 [mN*m]", 1e-3, 1e-3), ("x [mm]", "f [mN]", 1e-3, 1e-3),
    ("angle_1 [deg]", "torque [N*mm]", np.pi / 180, 1e-3),
    ("position [um]", "force_1 [N]", 1e-6, 1.0), ("Theta [rad]", "TAU [N m]", 1.0, 1.0),
    ("q[rad]", "tau [mNm]", 1.0, 1e-3),
    ("x [\u03bcm]", "f [N]", 1e-6, 1.0), ("x [m]", "f [N]", 1.0, 1.0), ("q [rad]", "tau [N\u22c5m]", 1.0, 1.0),
]  # fmt: skip


@pytest.mark.parametrize(("angle", "torque", "scale", "size"), UNITS)
def test_a_column_is_known_by_its_name_and_scaled_by_its_unit(
    tmp_path: Path, angle: str, torque: str, scale: float, size: float
) -> None:
    file = tmp_path / "r.csv"
    rows = "".join(f"{0.01 * k}, {k % 7}, {k % 5}\n" for k in range(60))
    file.write_text("# a remark\n\n" + HEADER.format(angle, torque) + rows, "utf-8")
    found = Recording.load(file)
    np.testing.assert_allclose(found.angle[:, 0], scale * (np.arange(60) % 7), rtol=1e-12)
    np.testing.assert_allclose(found.torque[:, 0], size * (np.arange(60) % 5), rtol=1e-12)
    assert found.excitation is None
    assert (found.period, found.metadata) == (0.01, {"file": "r.csv"})


def test_an_angle_without_noise_has_the_floor_as_its_slowest_speed() -> None:
    """The floor keeps the direction of motion finite; noise on the angle raises it twentyfold its speed error."""
    still = slowest_speed(record(angle=np.zeros(200)), TestFunctions(smoothing=0.011))
    np.testing.assert_allclose(still, [1e-12], rtol=1e-12)
    draw = record().angle
    ratio = slowest_speed(record(angle=2.0 * draw), TestFunctions()) / slowest_speed(record(), TestFunctions())
    np.testing.assert_allclose(ratio, [2.0], rtol=1e-9)
