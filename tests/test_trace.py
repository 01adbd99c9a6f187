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
from palpate.files import write_whole
from palpate.metrics import summarize
from palpate.metrics.step import step_response
from palpate.simulation.trace import Channel, Trace, TraceError

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
    assert same(Trace.read(pressed.write(tmp_path / "trace.h5")), pressed)


@given(values=arrays(np.float64, (3, 2), elements=st.floats(allow_nan=False, allow_infinity=False)))
def test_any_finite_values_come_back(values: Any, tmp_path_factory: pytest.TempPathFactory) -> None:
    """Subnormal numbers and the sign of zero included."""
    trace = small(values, unstable_from=1.5, metadata={"note": ["µ", 1, None]})
    assert same(Trace.read(trace.write(tmp_path_factory.mktemp("trace") / "t.h5")), trace)


def test_a_traces_scenario_runs_again_to_the_same_bits(pressed: Trace, tmp_path: Path) -> None:
    """A trace file is enough to repeat its run."""
    read = Trace.read(pressed.write(tmp_path / "trace.h5"))
    assert same(simulate(read.scenario), pressed)


def test_the_file_reads_without_palpate(pressed: Trace, tmp_path: Path) -> None:
    """Plain HDF5: a dataset per channel, time attached as its scale, the unit as an attribute, metadata as JSON."""
    with h5py.File(pressed.write(tmp_path / "trace.h5")) as file:
        units = {name: data.attrs["unit"] for name, data in file["channels"].items()}
        assert all(data.dims[0][0] == file["time"] for data in file["channels"].values())
        assert file["time"].attrs["unit"] == "s"
        assert json.loads(file["metadata/scenario"][()])["title"] == "Press µ → 木"
        assert bool(file.attrs["stable"])
    assert units == {
        "angle": "rad", "velocity": "rad/s", "tip": "m", "deflection": "m", "object_force": "N", "command_force": "N",
        "torque": "N*m", "reference_force": "N", "operator_force": "N", "touching": "", "saturated": "", "energy": "J",
    }  # fmt: skip


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
        small(metadata={"note": float("nan")}).write(tmp_path / "trace.h5")
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
    path = small().write(tmp_path / "trace.h5")
    before = path.read_bytes()

    def stop(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(h5py.Group, "create_group", stop)
    with pytest.raises(OutputError, match=r"trace\.h5: cannot be written: disk full"):
        small([[5.0]] * 3).write(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupted_write_leaves_nothing(tmp_path: Path) -> None:
    """Ctrl-C while writing: no file that claims to be one."""

    def interrupted(part: Path) -> None:
        part.write_text("half")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "page.html", interrupted)
    assert not list(tmp_path.iterdir())


def test_a_new_file_has_the_rights_of_any_new_file(tmp_path: Path) -> None:
    """A colleague can read what was written: the umask decides, not the temporary file."""
    mask = os.umask(0o022)
    try:
        path = small().write(tmp_path / "new" / "folder" / "trace.h5")
    finally:
        os.umask(mask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_where_nothing_can_be_written_the_message_says_why(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"trace\.h5: cannot be written: "):
        small().write(tmp_path / "file" / "trace.h5")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match="folder: cannot be written: Is a directory"):
        small().write(tmp_path / "folder")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder"]


def test_a_file_that_is_no_trace_says_so(tmp_path: Path) -> None:
    """Missing, not HDF5, another program's HDF5, or cut off."""
    with pytest.raises(TraceError, match="there is no such file"):
        Trace.read(tmp_path / "none.h5")
    (tmp_path / "text.h5").write_text("time,angle\n")
    with pytest.raises(TraceError, match="not a readable trace"):
        Trace.read(tmp_path / "text.h5")
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = 1
    with pytest.raises(TraceError, match="not a trace of palpate"):
        Trace.read(tmp_path / "other.h5")
    whole = small().write(tmp_path / "whole.h5").read_bytes()
    (tmp_path / "cut.h5").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(TraceError, match="not a readable trace"):
        Trace.read(tmp_path / "cut.h5")


@pytest.mark.parametrize(
    "damage", ["no channels", "no time", "no unit", "a list of channels", "nested metadata", "text"]
)
def test_a_trace_of_another_shape_says_so(damage: str, tmp_path: Path) -> None:
    """Whatever h5py meets in a file that claims to be a trace ends in one sentence."""
    path = small(metadata={"version": "1"}).write(tmp_path / "trace.h5")
    with h5py.File(path, "a") as file:
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
    with pytest.raises(TraceError, match=r"trace\.h5: not a readable trace: "):
        Trace.read(path)


def test_csv_has_units_in_its_header_and_every_digit(pressed: Trace, tmp_path: Path) -> None:
    """Export: column names with units, values that read back to the same doubles."""
    assert b"\r" not in pressed.write_csv(tmp_path / "trace.csv").read_bytes()
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
    assert summary["verdict"].startswith("stable: settles to 5 % in ")
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


def test_a_channel_is_read_by_name() -> None:
    trace = small()
    assert "deflection" in trace
    assert "tip" not in trace
    assert trace.channels["deflection"] == Channel(trace["deflection"], "m", trace.channels["deflection"].description)
    assert trace["deflection"].shape == (3, 1)
    assert len(trace) == 3
