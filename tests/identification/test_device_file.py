"""Identified parameters as a device file."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from identify_data import short_recording
from palpate import devices
from palpate import identification as identify
from palpate.__main__ import main
from palpate.errors import DeviceError, OutputError
from palpate.identification.device_file import write_fit
from palpate.simulation import simulate

ARM = devices.load("phantom-premium-1.5a")
SCENARIO = """
[device]
name = "identified.toml"
[start]
pose = ["0 rad", "2.23 rad", "3.28 rad"]
[servo]
period = "1 ms"
[object]
kind = "wall"
stiffness = "200 N/m"
normal = [0, 0, 1]
[reference]
force = ["0 N", "0 N", "-0.3 N"]
[operator]
kind = "arm"
mass = "0.15 kg"
damping = "4.5 N*s/m"
stiffness = "200 N/m"
[run]
duration = "1 s"
"""


def test_the_saved_device_has_the_estimated_parameters_and_runs(tmp_path: Path) -> None:
    fit = identify.estimate_parameters(short_recording(0), ARM)
    assert fit.save(tmp_path / "identified.toml") == tmp_path / "identified.toml"
    loaded = devices.load(tmp_path / "identified.toml")
    assert loaded.name == "identified"
    np.testing.assert_allclose(identify.base_values(loaded), fit.value[:8], rtol=1e-9)
    np.testing.assert_array_equal(loaded.viscous, fit.friction("k", 3))
    np.testing.assert_array_equal(loaded.coulomb, fit.device.coulomb)
    same = ("geometry.l1", "drive.gear", "drive.encoder_counts", "drive.peak_force", "servo_period")
    assert [loaded.parameters.values[key] for key in same] == [ARM.parameters.values[key] for key in same]
    text = (tmp_path / "identified.toml").read_text("utf-8")
    assert "identified from a recording on 20" in text
    for i, parameter in enumerate(fit.parameters):
        assert f"{fit.low[i]:.4g} to {fit.high[i]:.4g}  {parameter.unit}, {parameter.meaning}" in text
    (tmp_path / "press.toml").write_text(SCENARIO, "utf-8")
    assert simulate(tmp_path / "press.toml").stable


def test_the_command_writes_a_device_that_run_accepts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)

    def palpate(*words: str) -> int:
        monkeypatch.setattr("sys.argv", ["palpate", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return int(ended.value.code or 0)

    identify.simulate_experiment(ARM, duration=12.0, period=2e-3).save("recording.csv")
    assert palpate("identify", "recording.csv", "--write", "identified.toml") == 0
    Path("press.toml").write_text(SCENARIO, "utf-8")
    assert palpate("run", "press.toml", "--out", "out") == 0
    assert "identified from recording.csv on 20" in Path("identified.toml").read_text("utf-8")


@pytest.mark.parametrize("seed", range(5))
def test_a_physical_arm_has_no_negative_mass_or_inertia(seed: int) -> None:
    """Gravity of either sign: the lever changes its side, the mass stays positive."""
    draw = np.random.default_rng(seed)
    values = identify.base_values(ARM) * draw.uniform(0.8, 1.25, 8)
    values[6:] *= draw.choice([-1.0, 1.0], 2)
    device = identify.with_base_values(ARM, values)
    np.testing.assert_allclose(identify.base_values(device), values, rtol=1e-9)
    positive = [v for key, v in device.parameters.values.items() if key.startswith(("mass", "inertia"))]
    assert min(min(v) for v in positive) >= 0.0


def test_unphysical_estimates_write_no_file(tmp_path: Path) -> None:
    fit = identify.estimate_parameters(short_recording(0), ARM)
    wrong = replace(fit, value=fit.value * np.where(np.arange(len(fit.value)) == 4, -1.0, 1.0))
    with pytest.raises(DeviceError, match="not positive definite"):
        wrong.save(tmp_path / "wrong.toml")
    negative = replace(fit, value=fit.value * np.where(np.arange(len(fit.value)) == 3, -1.0, 1.0))
    with pytest.raises(DeviceError, match=r"mass\.a is .*must not be negative"):
        negative.save(tmp_path / "wrong.toml")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(DeviceError, match="named by text"):
        fit.save(None)  # type: ignore[arg-type]
    with pytest.raises(OutputError):
        fit.save(tmp_path)


def test_each_number_names_whether_the_estimate_determined_it(tmp_path: Path) -> None:
    """Mass, inertia and friction, and what differs from the device whose other numbers are kept."""
    values = {**ARM.parameters.values, "drive.peak_force": (9.25,)}
    device = replace(ARM, parameters=replace(ARM.parameters, values=values))
    path = write_fit(tmp_path / "new.toml", device, ARM, "a recording", ["one", "two"])
    tables = tomllib.loads(path.read_text("utf-8"))
    found = {
        f"{table}.{name}": entry["source"]
        for table, entries in tables.items()
        if isinstance(entries, dict)
        for name, entry in entries.items()
        if isinstance(entry, dict)
    }
    assert {key.partition(".")[0] for key in found} >= {"mass", "inertia", "friction", "geometry", "drive"}
    for key, source in found.items():
        determined = key.startswith(("mass.", "inertia.", "friction.")) or key == "drive.peak_force"
        assert source == ("identified" if determined else "device"), key
    assert tables["name"] == "new"
    assert tables["description"] == f"{ARM.description}; identified from a recording"
    assert set(tables["sources"]) == {"identified", "device"}
    assert tables["sources"]["device"] == f"device {ARM.name}, unchanged"
    lines = path.read_text("utf-8").splitlines()
    assert lines[0].startswith(f"# {ARM.name}: identified from a recording on 20")
    assert lines[1:3] == ["# one", "# two"]
