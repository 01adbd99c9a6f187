"""Traces: every bit comes back from the file, a file is whole or not there, and nothing in it is not finite."""

from __future__ import annotations

import csv
import json
import os
import stat
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from palpate import simulate
from palpate.errors import OutputError
from palpate.files import atomic_write
from palpate.metrics import summarize
from palpate.simulation.step_response import step_response
from palpate.simulation.trace import Trace, TraceError
from palpate.simulation.trace_export import Channel
from resealed import changed, reseal
from scipy.io import loadmat

PRESS: dict[str, Any] = {
    "title": "Press µ → 木",
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "0.5 ms"},
    "reference": {"force": "2 N"},
    "object": {"stiffness": "1 N/mm"},
    "controller": {"kind": "lqg"},
    "run": {"duration": "0.2 s"},
}


@pytest.fixture(scope="module")
def pressed() -> Trace:
    return simulate(PRESS)


def small(values: Any = ((0.0,), (1.0,), (2.0,)), **options: Any) -> Trace:
    return Trace.of([0.0, 0.5, 1.0], {"deflection": values}, **options)


def same(left: Trace, right: Trace) -> bool:
    return (
        left.time.tobytes() == right.time.tobytes()
        and list(left.channels) == list(right.channels)
        and all(
            left[name].tobytes() == right[name].tobytes()
            and left.channels[name].unit == right.channels[name].unit
            and left.channels[name].description == right.channels[name].description
            for name in left.channels
        )
        and left.unstable_from == right.unstable_from
        and left.metadata == right.metadata
    )


def test_a_run_comes_back_from_its_file_bit_for_bit(pressed: Trace, tmp_path: Path) -> None:
    """Round trip: time, every channel, units, descriptions, scenario and version."""
    assert same(Trace.load(pressed.save(tmp_path / "trace.h5")), pressed)


@given(values=arrays(np.float64, (3, 2), elements=st.floats(allow_nan=False, allow_infinity=False)))
def test_any_finite_values_come_back(values: Any, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Subnormal numbers and the sign of zero included."""
    trace = small(values, unstable_from=1.5, metadata={"note": ["µ", 1, None]})
    assert same(Trace.load(trace.save(tmp_path_factory.mktemp("trace") / "t.h5")), trace)


def test_a_traces_scenario_runs_again_to_the_same_bits(pressed: Trace, tmp_path: Path) -> None:
    """A trace file is enough to repeat its run."""
    read = Trace.load(pressed.save(tmp_path / "trace.h5"))
    assert same(simulate(read.scenario), pressed)


def test_the_file_reads_without_palpate(pressed: Trace, tmp_path: Path) -> None:
    """Plain HDF5: a dataset per channel, time attached as its scale, the unit as an attribute, metadata as JSON."""
    with h5py.File(pressed.save(tmp_path / "trace.h5")) as file:
        units = {name: data.attrs["unit"] for name, data in file["channels"].items()}
        assert all(data.dims[0][0] == file["time"] for data in file["channels"].values())
        assert file["time"].attrs["unit"] == "s"
        assert json.loads(file["metadata/scenario"][()])["title"] == "Press µ → 木"
        assert bool(file.attrs["completed"])
    assert units == {
        "angle": "rad", "velocity": "rad/s", "tip": "m", "deflection": "m", "object_force": "N", "command_force": "N",
        "motor_force": "N", "torque": "N*m", "motor_torque": "N*m", "reference_force": "N", "operator_force": "N",
        "touching": "", "saturated": "", "energy": "J",
    }  # fmt: skip


def test_a_file_that_the_caller_has_open_loads(pressed: Trace, tmp_path: Path) -> None:
    path = pressed.save(tmp_path / "trace.h5")
    with h5py.File(path):
        np.testing.assert_array_equal(Trace.load(path).time, pressed.time)


def test_the_slider_has_a_sliding_joints_units() -> None:
    """m, m/s and N where an arm has rad, rad/s and N*m."""
    trace = simulate({"device": {"name": "slider"}, "reference": {"force": "1 N"}, "object": {"stiffness": "1 N/mm"}})
    assert [trace.channels[name].unit for name in ("angle", "velocity", "torque")] == ["m", "m/s", "N"]


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_a_trace_is_never_made_of_what_is_not_finite(wrong: float) -> None:
    """Neither channels, nor time, nor the time of divergence."""
    with pytest.raises(TraceError, match=r"channel deflection is not finite at t = 0\.5 s"):
        small([[0.0], [wrong], [0.0]])
    with pytest.raises(TraceError, match="time must be finite"):
        Trace.of([0.0, wrong], {})
    with pytest.raises(TraceError, match="unstable_from"):
        small(unstable_from=wrong)


def test_metadata_that_is_not_finite_is_not_written(tmp_path: Path) -> None:
    """NaN is no JSON: such a file would open nowhere but in Python."""
    with pytest.raises(ValueError, match="JSON"):
        small(metadata={"note": float("nan")}).save(tmp_path / "trace.h5")
    assert not list(tmp_path.iterdir())


def test_rows_and_time_must_agree() -> None:
    """One row for each sample, time increasing."""
    with pytest.raises(TraceError, match="one row per sample, 3 of them"):
        small([[0.0], [1.0]])
    with pytest.raises(TraceError, match="increasing"):
        Trace.of([0.0, 0.0], {})
    with pytest.raises(TraceError, match="increasing"):
        Trace(np.zeros((2, 2)), {})
    with pytest.raises(KeyError, match="no channel 'tip'; there are deflection"):
        small()["tip"]


def test_a_write_that_fails_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whole or not at all: half-way failure keeps the old bytes and leaves no temporary file."""
    path = small().save(tmp_path / "trace.h5")
    before = path.read_bytes()

    def stop(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(h5py.Group, "create_group", stop)
    with pytest.raises(OutputError, match=r"trace\.h5: cannot be written: disk full"):
        small([[5.0]] * 3).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupted_write_leaves_nothing(tmp_path: Path) -> None:
    """Ctrl-C while writing: no file that claims to be one."""

    def interrupted(part: Path) -> None:
        part.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        atomic_write(tmp_path / "page.html", interrupted)
    assert not list(tmp_path.iterdir())


def test_a_new_file_has_the_rights_of_any_new_file(tmp_path: Path) -> None:
    """A colleague can read what was written: the umask decides, not the temporary file."""
    mask = os.umask(0o022)
    try:
        path = small().save(tmp_path / "new" / "folder" / "trace.h5")
    finally:
        os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_where_nothing_can_be_written_the_message_says_why(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"trace\.h5: cannot be written: "):
        small().save(tmp_path / "file" / "trace.h5")
    (tmp_path / "folder.h5").mkdir()
    with pytest.raises(OutputError, match=r"folder\.h5: cannot be written: Is a directory"):
        small().save(tmp_path / "folder.h5")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.h5"]


def test_a_file_that_is_no_trace_says_so(tmp_path: Path) -> None:
    """Missing, not HDF5, another program's HDF5, or cut off."""
    with pytest.raises(TraceError, match="there is no such file"):
        Trace.load(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("time,angle\n")
    with pytest.raises(TraceError, match="not an HDF5 file"):
        Trace.load(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(TraceError, match="no checksum at its end"):
        Trace.load(tmp_path / "other.h5")
    reseal(tmp_path / "other.h5")
    with pytest.raises(TraceError, match="not a trace of palpate"):
        Trace.load(tmp_path / "other.h5")
    whole = small().save(tmp_path / "whole.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(TraceError, match="no checksum at its end: truncated"):
        Trace.load(tmp_path / "cut.h5")


@pytest.mark.parametrize(
    "damage", ["no channels", "no time", "no unit", "a list of channels", "nested metadata", "text"]
)
def test_a_trace_of_another_shape_says_so(damage: str, tmp_path: Path) -> None:
    """Whatever h5py meets in a file that claims to be a trace ends in one sentence."""
    path = small(metadata={"version": "1"}).save(tmp_path / "trace.h5")
    with changed(path) as file:
        if damage == "no unit":
            del file["channels/deflection"].attrs["unit"]
        elif damage == "nested metadata":
            file["metadata/more/inside"] = 1
        elif damage == "text":
            del file["metadata/version"]
            file["metadata/version"] = "{not JSON"
        else:
            del file["time" if damage == "no time" else "channels"]
            if damage == "a list of channels":
                file["channels"] = [1.0]
    with pytest.raises(TraceError, match=r"trace\.h5: (not a complete trace|metadata version: not JSON)"):
        Trace.load(path)


def test_csv_has_units_in_its_header_and_every_digit(pressed: Trace, tmp_path: Path) -> None:
    """Export: column names with units, values that read back to the same doubles."""
    assert b"\r" not in pressed.save(tmp_path / "trace.csv").read_bytes()
    with (tmp_path / "trace.csv").open(encoding="utf-8") as file:
        header, *rows = list(csv.reader(file))
    assert header[:5] == ["time [s]", "angle_1 [rad]", "angle_2 [rad]", "angle_3 [rad]", "velocity_1 [rad/s]"]
    assert "deflection_z [m]" in header
    assert header[-1] == "energy [J]"
    table = np.array(rows, dtype=float)
    assert np.array_equal(table[:, 0], pressed.time)
    assert np.array_equal(table[:, header.index("deflection_z [m]")], pressed["deflection"][:, 2])
    assert table.shape == (len(pressed), len(header))


def test_a_summary_is_json_and_states_the_verdict(pressed: Trace) -> None:
    """summary.json: strict JSON; a loop with integrators ends at force over stiffness."""
    summary = json.loads(json.dumps(summarize(pressed), allow_nan=False))
    assert summary["stable"] is True
    assert summary["verdict"].startswith("settled to 5 % in ")
    assert set(summary["axes"]) == {"x", "y", "z"}
    for row in summary["axes"].values():
        assert row["expected_deflection_m"] == pytest.approx(2e-3, rel=1e-12)
        assert row["steady_deflection_m"] == pytest.approx(2e-3, rel=0.02)


def test_a_first_order_response_settles_when_its_exponential_does() -> None:
    """Closed form: 1 - exp(-t/tau) enters the 5 % band at tau ln 20 and never overshoots."""
    time = np.linspace(0.0, 20.0, 20001)
    found = step_response(time, 3.0 * (1.0 - np.exp(-time)), expected=3.0)
    assert found.settling_time == pytest.approx(np.log(20.0), abs=2e-3)
    assert found.overshoot_percent < 1e-6
    assert found.error_percent == pytest.approx(0.0, abs=1e-6)
    assert found.swing_growth is None


@pytest.mark.parametrize("zeta", [0.1, 0.4, 0.7])
def test_a_second_order_response_overshoots_by_the_textbooks_formula(zeta: float) -> None:
    """Closed form: overshoot exp(-pi zeta / sqrt(1 - zeta^2)), of the way, from any start and in any direction."""
    time = np.linspace(0.0, 100.0, 100001)
    damped = np.sqrt(1.0 - zeta**2)
    way = 1.0 - np.exp(-zeta * time) * (np.cos(damped * time) + zeta / damped * np.sin(damped * time))
    for begin, reach in ((0.0, 1.0), (5.0, -2.0)):
        found = step_response(time, begin + reach * way)
        assert found.overshoot_percent == pytest.approx(100.0 * np.exp(-np.pi * zeta / damped), rel=1e-3)
        assert found.steady == pytest.approx(begin + reach, rel=1e-3)


@pytest.mark.parametrize("rate", [-0.05, 0.0, 0.05])
def test_the_growth_of_a_swing_is_its_exponential(rate: float) -> None:
    """Closed form: over a quarter of the run, exp(rate * quarter)."""
    time = np.linspace(0.0, 60.0, 60001)
    found = step_response(time, np.exp(rate * time) * np.sin(10.0 * time))
    assert found.swing_growth == pytest.approx(np.exp(rate * 15.0), rel=0.01)


def test_a_tap_settles_when_it_is_back() -> None:
    """A response that ends where it began is measured by its peak, not by a way of length zero."""
    time = np.linspace(0.0, 50.0, 50001)
    found = step_response(time, time * np.exp(-time))
    tail = time[time * np.exp(-time) > 0.05 * np.exp(-1.0)][-1]
    assert found.settling_time == pytest.approx(tail, abs=2e-3)
    assert found.overshoot_percent == 0.0
    assert found.returns
    assert not step_response(time, time * np.exp(-time) + np.minimum(time, 0.05)).returns  # 0.05 is 12 % of its peak


def test_a_response_returns_to_where_it_began_and_not_to_zero() -> None:
    """Adding a constant to a response changes its values alone."""
    for back in (0.05, 0.0501):  # of the way to the peak
        one, other = (step_response(range(100), [begin, begin + 1.0, *98 * [begin + back]]) for begin in (0.0, 4.0))
        assert one.returns == other.returns == (back <= 0.05 + 1e-12)
        assert one.overshoot_percent == pytest.approx(other.overshoot_percent)
        assert one.settling_time == other.settling_time


def test_a_channel_is_read_by_name() -> None:
    trace = small()
    assert "deflection" in trace
    assert "tip" not in trace
    assert trace.channels["deflection"] == Channel(trace["deflection"], "m", trace.channels["deflection"].description)
    assert trace["deflection"].shape == (3, 1)
    assert len(trace) == 3


def test_the_suffix_decides_the_format_and_an_unknown_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TraceError, match=r"t\.txt: the suffix decides the format of a trace; it is \.h5, \.csv, \.mat"):
        small().save(tmp_path / "t.txt")
    with pytest.raises(TraceError, match=r"t\.csv: a trace is loaded from \.h5, not from '\.csv'"):
        Trace.load(small().save(tmp_path / "t.csv"))


@pytest.mark.parametrize("suffix", [".h5", ".csv", ".mat", ".parquet", ".mcap"])
def test_a_file_of_another_format_is_not_overwritten(suffix: str, tmp_path: Path) -> None:
    """A trace of the same format is; so is an empty file."""
    path = tmp_path / f"file{suffix}"
    path.write_text("notes of a whole day")
    with pytest.raises(OutputError, match="a file of that name is there, and it is no trace saved as"):
        small().save(path)
    assert path.read_text() == "notes of a whole day"
    path.write_text("")
    if suffix in (".parquet", ".mcap"):
        pytest.importorskip("pyarrow" if suffix == ".parquet" else "mcap")
    small().save(path)
    assert small([[5.0]] * 3).save(path) == path


def test_another_programs_hdf5_is_not_overwritten(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(OutputError, match="it is no trace saved as"):
        small().save(tmp_path / "other.h5")


def test_mat_opens_with_its_channels_and_units(pressed: Trace, tmp_path: Path) -> None:
    found = loadmat(pressed.save(tmp_path / "t.mat"), simplify_cells=True)
    assert np.array_equal(found["time"], pressed.time)
    assert np.array_equal(found["tip"], pressed["tip"])
    assert found["units"]["object_force"] == "N"
    assert json.loads(found["metadata"])["metadata"]["scenario"] == pressed.scenario


def test_parquet_has_the_columns_of_csv(pressed: Trace, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(pressed.save(tmp_path / "t.parquet"))
    assert np.array_equal(table["tip_z [m]"].to_numpy(), pressed["tip"][:, 2])
    assert json.loads(table.schema.metadata[b"palpate"])["metadata"]["scenario"] == pressed.scenario


def test_mcap_has_a_topic_per_channel(tmp_path: Path) -> None:
    reader = pytest.importorskip("mcap.reader")
    with small().save(tmp_path / "t.mcap").open("rb") as file:
        messages = [(c.topic, m.log_time, json.loads(m.data)) for _, c, m in reader.make_reader(file).iter_messages()]
    trace = small()
    assert [topic for topic, _, _ in messages] == ["/deflection"] * len(trace)
    assert [stamp for _, stamp, _ in messages] == [round(1e9 * t) for t in trace.time]
    assert [message["value"] for _, _, message in messages] == trace["deflection"][:, 0].tolist()


def test_a_data_frame_has_the_time_as_its_index(pressed: Trace) -> None:
    pytest.importorskip("pandas")
    frame = pressed.to_pandas()
    assert np.array_equal(frame.index, pressed.time)
    assert np.array_equal(frame["object_force_y [N]"], pressed["object_force"][:, 1])
    assert frame.attrs["scenario"] == pressed.scenario


@pytest.mark.parametrize("values", [np.zeros((5, 2)), np.zeros(4), np.zeros((2, 2))])
def test_a_step_response_is_of_two_lists_of_one_length(values: np.ndarray) -> None:
    time = np.zeros((2, 2)) if values.shape == (2, 2) else np.arange(5.0)
    with pytest.raises(ValueError, match="time and values must be two lists of one length, not"):
        step_response(time, values)


def test_the_ripple_of_a_response_is_half_the_range_of_its_last_twentieth() -> None:
    """It and the mean of that part are those of the end alone; a settled response is within the band, its edge too."""
    values = np.concatenate([np.linspace(0.0, 3.0, 380), np.tile([3.9, 4.1], 10)])
    found = step_response(1e-3 * np.arange(400), values, band=0.5)
    assert (found.ripple, found.steady) == (pytest.approx(0.1), pytest.approx(4.0))
    assert found.settling_time == pytest.approx(1e-3 * np.argmax(values >= 2.0))
    edge = np.array([0.0, 1.5, 0.5, 1.5, *[1.0] * 16])
    assert step_response(np.arange(20.0), edge, band=0.5).settling_time == 1.0
    assert step_response(np.arange(20.0), edge, band=0.499).settling_time == 4.0


def test_a_response_is_two_lists_of_one_length_and_finite() -> None:
    for time, values in ((np.zeros((2, 2)), np.zeros((2, 2))), (np.arange(3.0), np.arange(2.0))):
        with pytest.raises(ValueError, match="time and values must be two lists of one length, not"):
            step_response(time, values)
    with pytest.raises(ValueError, match=r"a step response needs samples after the step at 1\.5 s"):
        step_response(np.arange(3.0), np.arange(3.0), start=1.5)
    for time, values in (([0.0, 1.0, 2.0], [0.0, np.nan, 1.0]), ([0.0, 1.0, np.inf], [0.0, 1.0, 1.0])):
        with pytest.raises(ValueError, match="a step response needs finite values"):
            step_response(time, values)
