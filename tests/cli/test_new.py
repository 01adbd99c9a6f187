"""`palpate new` and `palpate run --set`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from palpate import Trace, devices
from palpate.cli.main import app
from typer.testing import CliRunner

TEXT = """\
[device]
name = "slider"
[servo]
topology = "impedance_display"
[operator]
kind = "force"
force = ["-1 N", "0 N", "0 N"]
[object]
kind = "wall"
normal = [1, 0, 0]
stiffness = "100 N/m"
[run]
duration = "0.1 s"
"""


def palpate(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return result.exit_code, result.output


def test_a_new_device_loads(tmp_path: Path) -> None:
    code, told = palpate("new", "device", tmp_path / "my-slider")
    assert code == 0
    path = tmp_path / "my-slider.toml"
    assert f"palpate devices {path}" in told
    assert devices.load(path).name == "my-slider"
    assert palpate("devices", path)[0] == 0


def test_a_new_scenario_runs(tmp_path: Path) -> None:
    assert palpate("new", "scenario", tmp_path / "press.toml")[0] == 0
    code, told = palpate("run", tmp_path / "press.toml", "--out", tmp_path / "out")
    assert code == 0, told
    assert Trace.load(tmp_path / "out" / "trace.h5").scenario["title"] == "press"
    code, told = palpate("certify", tmp_path / "press.toml")
    assert code == 0, told


def test_a_new_controller_runs(tmp_path: Path) -> None:
    assert palpate("new", "controller", tmp_path / "mine")[0] == 0
    done = subprocess.run([sys.executable, tmp_path / "mine.py"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("settled")


def test_an_existing_file_and_an_odd_name_are_refused(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text("x = 1\n", "utf-8")
    code, told = palpate("new", "device", tmp_path / "own")
    assert code == 2
    assert "a file of that name is there" in told
    assert (tmp_path / "own.toml").read_text("utf-8") == "x = 1\n"
    assert "use letters, digits and '_'" in palpate("new", "controller", tmp_path / "my-law")[1]
    assert "a name has letters" in palpate("new", "device", tmp_path / 'a"b')[1]
    assert palpate("new", "robot", "x")[0] == 2


def test_run_takes_other_values(tmp_path: Path) -> None:
    path = tmp_path / "wall.toml"
    path.write_text(TEXT, "utf-8")
    code, told = palpate(
        "run", path, "--out", tmp_path, "--set", 'object.stiffness="90 N/m"', "--set", "servo.period=0.5 ms",
        "--set", "device.encoder=true", "--set", 'operator.force=["-0.5 N", "0 N", "0 N"]',
    )  # fmt: skip
    assert code == 1, told  # 0.1 s is too short to settle
    assert "undecided: it has not settled after 0.1 s" in told
    tables = Trace.load(tmp_path / "trace.h5").scenario
    assert tables["object"]["stiffness"] == ["90.0 N/m"] * 3
    assert tables["servo"]["period"] == "0.0005 s"
    assert tables["device"]["encoder"] is True
    assert tables["operator"]["force"][0] == "-0.5 N"


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ("object.stifness=1 N/mm", 'unknown key "stifness" in [object]; did you mean stiffness?'),
        ("object.stiffness=1 mm", '"1 mm" is a length [m]; a stiffness is needed'),
        ("object.stiffness=1000", 'write it as "1000 N/m"'),
        ("object.stiffness", 'write it as --set object.stiffness="2 N/mm"'),
    ],
)
def test_a_wrong_setting_is_told_in_one_sentence(tmp_path: Path, setting: str, says: str) -> None:
    path = tmp_path / "wall.toml"
    path.write_text(TEXT, "utf-8")
    code, told = palpate("run", path, "--out", tmp_path / "out", "--set", setting)
    assert code == 2
    assert says in told
    assert len(told.strip().splitlines()) == 1
