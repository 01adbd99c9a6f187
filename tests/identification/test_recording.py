"""Recordings: what is written is read again bit for bit; what is wrong is named by file and line."""

import re

import h5py
import numpy as np
import pytest
from palpate.errors import RecordingError
from palpate.identification import Recording
from palpate.identification.samples import uniform_period

N = 200


def example(**changes):
    time = np.arange(N) * 1e-3
    draw = np.random.default_rng(0)
    parts = {"time": time, "angle": draw.normal(size=(N, 3)), "torque": draw.normal(size=(N, 3)), "metadata": {"a": 1}}
    return Recording(**(parts | changes))


@pytest.mark.parametrize("name", ["r.csv", "r.h5"])
def test_round_trip_keeps_every_bit(tmp_path, name):
    one = example(excitation=np.random.default_rng(1).normal(size=(N, 3)))
    again = Recording.load(one.save(tmp_path / name))
    np.testing.assert_array_equal(again.angle, one.angle)
    np.testing.assert_array_equal(again.torque, one.torque)
    np.testing.assert_array_equal(again.excitation, one.excitation)
    np.testing.assert_array_equal(again.time, one.time)
    assert again.period == pytest.approx(1e-3, rel=1e-12)
    assert again.metadata == {"a": 1, "file": name}
    assert [p.name for p in tmp_path.iterdir()] == [name]


def test_units_are_converted(tmp_path):
    file = tmp_path / "r.csv"
    rows = "\n".join(f"{k}, {k % 7}, {k % 5}" for k in range(N))
    file.write_text("time [ms], theta1 [deg], tau1 [mN·m]\n" + rows)
    recording = Recording.load(file)
    assert recording.period == pytest.approx(1e-3)
    assert recording.angle[6, 0] == pytest.approx(np.deg2rad(6))
    assert recording.torque[4, 0] == pytest.approx(4e-3)


def lines():
    return ["time [s], theta1 [rad], tau1 [N*m]"] + [f"{k * 1e-3:.3f}, {np.sin(k):.6f}, {k % 3}" for k in range(N)]


def changed(place, text):
    out = lines()
    out[place] = text
    return out


def without(first, last):
    out = lines()
    return out[:first] + out[last:]


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (without(100, 110), "line 101: a gap of 0.011 s after 0.098 s, about 10 samples missing"),
        (changed(50, "0.048, 0, 0"), "line 51: the time stamp 0.048 s repeats"),
        (changed(50, "0.020, 0, 0"), "line 51: the time stamp 0.02 s is earlier"),
        (changed(50, "0.0494, 0, 0"), "line 51: the time stamps are not uniform"),
        (changed(50, "0.049, nan, 0"), "line 51: angle 1 is nan"),
        (changed(50, "0.049, 0, inf"), "line 51: torque 1 is inf"),
        (changed(50, "0.049, zero, 0"), "line 51: 'zero' in column 'theta1 [rad]' is not a number"),
        (changed(50, "0.049, 0"), "line 51: 2 fields where the header has 3"),
        (changed(0, "time [s], theta1, tau1 [N*m]"), "column 'theta1' has no unit"),
        (changed(0, "time [s], theta1 [N], tau1 [N*m]"), "column 'theta1 [N]' has unit 'N'; a joint is in"),
        (changed(0, "time [s], theta1 [rad], tau1 [N]"), "rad goes with N*m"),
        (changed(0, "time [s], theta2 [rad], tau1 [N*m]"), "the angle columns are numbered [2]"),
        (changed(0, "time [s], theta1 [rad], current [A]"), "there is no torque column"),
        (
            [f"{line}, {'0' if k else 'time [s]'}" for k, line in enumerate(lines())],
            "header: there are 2 time columns; one is expected",
        ),
        (lines()[:20], "19 samples are too few"),
        ([], "the file is empty"),
        (
            ['title = "press"', "", "[device]", 'name = "slider"'],
            "bad.csv, line 1: this is not a recording, as no column",
        ),
        (['{"state": "settled",', '"verdict": 1}'], "bad.csv, line 1: this is not a recording, as no column"),
        (["name, age", "Bob, 3"], "bad.csv, line 1: this is not a recording, as no column is a time"),
        (lines()[1:], "bad.csv, line 1: numbers stand where the columns are named; write 'time [s], theta1"),
        (
            [line.replace(",", ";") for line in lines()],
            "line 1: semicolons separate the columns; separate them by commas",
        ),
        ([line.replace(", ", "\t") for line in lines()], "line 1: tabs separate the columns; separate them by commas"),
    ],
)
def test_a_bad_file_is_named_with_the_line(tmp_path, content, says):
    file = tmp_path / "bad.csv"
    file.write_text("\n".join(content))
    with pytest.raises(RecordingError, match=re.escape(says)) as caught:
        Recording.load(file)
    assert str(file) in str(caught.value)


def test_bad_hdf5_files_are_named(tmp_path):
    file = tmp_path / "bad.h5"
    file.write_text("no")
    with pytest.raises(RecordingError, match="not an HDF5 file"):
        Recording.load(file)
    with h5py.File(file, "w") as store:
        store["vertices"] = np.zeros((4, 3))
    with pytest.raises(RecordingError, match=r"bad\.h5: this is not a recording, as it has none of the channels time"):
        Recording.load(file)
    with h5py.File(file, "w") as store:
        store["time"] = np.arange(N) * 1e-3
    with pytest.raises(RecordingError, match=r"bad\.h5: there is no channel 'angle'"):
        Recording.load(file)
    with pytest.raises(RecordingError, match="no such file"):
        Recording.load(tmp_path / "none.csv")


def test_samples_are_checked_without_a_file_too():
    angle = np.zeros((N, 3))
    angle[17, 2] = np.nan
    with pytest.raises(RecordingError, match="sample 17: angle 3 is nan"):
        example(angle=angle)
    with pytest.raises(RecordingError, match="each joint needs one of both"):
        example(torque=np.zeros((N, 2)))
    with pytest.raises(RecordingError, match=r"period is said to be 0\.002 s"):
        example(period=2e-3)


def test_a_joint_that_never_moves_is_too_little_excitation():
    angle = np.random.default_rng(0).normal(size=(N, 3))
    angle[:, 1] = 0.3
    with pytest.raises(RecordingError, match=r"too little excitation: angle 2 is 0\.3 in all 200 samples"):
        example(angle=angle).require_excitation()


def test_decimation_keeps_the_linear_relation_between_torque_and_angle():
    # A damped mass under held torque: m v' = u - k v. In the band left, m q'' + k q' - u stays 0 after decimation.
    period, n, mass, damping = 1e-3, 8000, 2.0, 0.5
    torque = np.random.default_rng(0).choice([-1.0, 1.0], n // 50).repeat(50)[:, None]
    decay = np.exp(-damping / mass * period)
    q, v = np.zeros(n), 0.0
    for k in range(n - 1):
        drive = torque[k, 0] / damping
        q[k + 1] = q[k] + drive * period + (v - drive) * (1 - decay) * mass / damping
        v = drive + (v - drive) * decay
    coarse = Recording(np.arange(n) * period, q[:, None], torque).decimate(10)
    frequency = np.fft.rfftfreq(len(coarse), coarse.period)
    window = np.hanning(len(coarse))
    speed = np.gradient(coarse.angle[:, 0], coarse.period)
    rest = mass * np.gradient(speed, coarse.period) + damping * speed - coarse.torque[:, 0]
    band = (frequency > 0.5) & (frequency < 4.0)
    left = np.linalg.norm(np.fft.rfft(rest * window)[band])
    assert left < 0.02 * np.linalg.norm(np.fft.rfft(coarse.torque[:, 0] * window)[band])


def test_split_parts_follow_each_other():
    first, second = example().split(0.7)
    assert len(first) == 140
    assert second.time[0] - first.time[-1] == pytest.approx(1e-3)
    with pytest.raises(RecordingError, match="fewer than 50"):
        example().split(0.9)


@pytest.mark.parametrize("wrong", ["time", "angle", "torque"])
def test_each_channel_alone_must_have_one_row_per_sample(wrong):
    n = 100
    values = {"time": 1e-3 * np.arange(n), "angle": np.zeros((n, 2)), "torque": np.ones((n, 2))}
    Recording(**values)
    with pytest.raises(RecordingError, match="one row per sample"):
        Recording(**{**values, wrong: values[wrong][:-1]})
    with pytest.raises(RecordingError, match="one row per sample"):
        Recording(**{**values, "time": values["time"][:, None]})


def test_a_file_that_is_no_text_is_named_as_such(tmp_path):
    file = tmp_path / "picture.csv"
    file.write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\xff,\xfe\n1\n")
    with pytest.raises(RecordingError, match=r"picture\.csv, line 1: this is not a text file; a recording is CSV"):
        Recording.load(file)


def test_a_period_is_rounded_to_six_digits_if_the_record_stays_within_a_hundredth_of_it() -> None:
    """0.4 ppm of 100 samples are 4e-5 of a period, of 100,000 samples 4 %."""
    for period, count, rounded in ((1.0000004e-3, 100, True), (1.0000004e-3, 100_000, False), (2.5e-4, 100_000, True)):
        found = uniform_period(period * np.arange(count))
        assert found == pytest.approx(float(f"{period:.6g}") if rounded else period, rel=1e-11)
