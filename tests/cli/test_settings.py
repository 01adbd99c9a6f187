"""--set KEY=VALUE gives what a scenario file with that value gives, for every command that reads a scenario."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from palpate.cli.main import app
from palpate.sweeps import open_sweep
from palpate.sweeps.outcomes import QUANTITIES
from typer.testing import CliRunner

SCENARIO = """
title = "A wall"
[device]
name = "{device}"
[start]
{start}
[servo]
topology = "impedance_display"
period = "{period}"
[object]
kind = "wall"
stiffness = "80 N/m"
normal = [1, 0, 0]
[operator]
kind = "arm"
force = ["-0.3 N", "0 N", "0 N"]
mass = "0.15 kg"
damping = "4.5 N*s/m"
stiffness = "{operator}"
[run]
duration = "0.1 s"
"""
SLIDER = {"device": "slider", "start": ""}
ARM = {"device": "phantom-premium-1.5a", "start": 'pose = ["0 deg", "30 deg", "60 deg"]'}
# command, its options, the file to compare (in the folder --out), the device
COMMANDS = [
    ("run", [], "summary.json", SLIDER),
    ("certify", [], "certificate.json", SLIDER),
    ("zwidth", ["--no-simulate"], "zwidth.json", SLIDER),
    ("performance", [], "performance.json", SLIDER),
    ("resolve", [], "loop.json", SLIDER),
    ("workspace", ["--poses", "60"], "workspace.json", ARM),
]


def palpate(*words: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(word) for word in words])
    return result.exit_code, " ".join(result.output.split())


def write(path: Path, device: dict[str, str], period: str, operator: str) -> Path:
    path.write_text(SCENARIO.format(period=period, operator=operator, **device), "utf-8")
    return path


@pytest.mark.parametrize(("command", "options", "file", "device"), COMMANDS, ids=[row[0] for row in COMMANDS])
def test_a_setting_is_the_value_in_the_file(
    command: str, options: list[str], file: str, device: dict[str, str], tmp_path: Path
) -> None:
    plain = write(tmp_path / "plain.toml", device, "1 ms", "200 N/m")
    edited = write(tmp_path / "edited.toml", device, "2 ms", "560 N/m")
    settings = ["--set", "servo.period=2 ms", "--set", 'operator.stiffness="560 N/m"']
    codes = {
        palpate(command, plain, *options, *settings, "--out", tmp_path / "set")[0],
        palpate(command, edited, *options, "--out", tmp_path / "edit")[0],
    }
    assert len(codes) == 1
    assert (tmp_path / "set" / file).read_text("utf-8") == (tmp_path / "edit" / file).read_text("utf-8")
    said = palpate(command, plain, *options, "--out", tmp_path / "plain")[1]
    assert str(tmp_path / "plain") in said
    if command != "run":
        assert all(str(written) in said for written in (tmp_path / "plain").iterdir())
    assert (tmp_path / "set" / file).read_text("utf-8") != (tmp_path / "plain" / file).read_text("utf-8")


def test_a_sweep_over_a_scenario_with_a_setting(tmp_path: Path) -> None:
    plain = write(tmp_path / "plain.toml", SLIDER, "1 ms", "200 N/m")
    edited = write(tmp_path / "edited.toml", SLIDER, "2 ms", "200 N/m")
    over = ("--over", "object.stiffness=50 N/m, 90 N/m")
    assert palpate("sweep", plain, *over, "--set", "servo.period=2 ms", "--out", tmp_path / "a.h5")[0] == 0
    assert palpate("sweep", edited, *over, "--out", tmp_path / "b.h5")[0] == 0
    code, said = palpate("sweep", plain, *over, "--out", tmp_path / "c.h5")
    assert code == 0
    assert str(tmp_path / "c.h5") in said
    found, wanted, plain_sweep = (open_sweep(tmp_path / f"{name}.h5") for name in "abc")
    assert all(np.array_equal(found[name], wanted[name], equal_nan=True) for name in QUANTITIES)
    assert not np.array_equal(found["peak_object_force"], plain_sweep["peak_object_force"])


def test_a_device_has_no_settings() -> None:
    code, said = palpate("workspace", "phantom-premium-1.5a", "--set", "servo.period=2 ms")
    assert code == 2
    assert "--set changes a scenario, and phantom-premium-1.5a is a device" in said


@pytest.mark.parametrize("command", ["certify", "zwidth", "performance", "resolve", "workspace"])
def test_an_unknown_key_is_refused(command: str, tmp_path: Path) -> None:
    plain = write(tmp_path / "plain.toml", SLIDER, "1 ms", "200 N/m")
    code, said = palpate(command, plain, "--set", "object.stifness=2 N/mm", "--out", tmp_path / "out")
    assert code == 2
    assert "did you mean stiffness" in said
    assert not (tmp_path / "out").exists()
