"""`palpate together`: the joint verdict, its exit code, and what it writes."""

from __future__ import annotations

from pathlib import Path

import pytest
from palpate.cli.main import app
from palpate.simulation import Trace
from typer.testing import CliRunner

SCENARIO = """
[device]
name = "phantom-premium-1.5a"

[start]
pose = ["0 rad", "2.2305 rad", "3.2776 rad"]

[servo]
period = "1 ms"

[reference]
shape = "ramp"
rise = "50 ms"
force = ["0 N", "0 N", "-0.4 N"]

[operator]
kind = "arm"
mass = "0.15 kg"
damping = "4.5 N*s/m"
stiffness = "200 N/m"

[object]
kind = "body"
position = ["{x} mm", "0 mm", "{z} mm"]

[object.body]
shape = "block"
size = ["48 mm", "32 mm", "16 mm"]
young = "10 kPa"
spacing = "8 mm"
kind = "signed_distance"
radius = "6 mm"

[run]
duration = "0.8 s"
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for name, x, z, press in (
        ("left", -8, -6.2, 0.4),
        ("right", 8, -6.2, 0.4),
        ("away", 8, -60, 0.4),
        ("hard", 8, -6.2, 40),
    ):
        text = SCENARIO.format(x=x, z=z).replace('"-0.4 N"', f'"-{press} N"')
        (tmp_path / f"{name}.toml").write_text(text if name == "left" else f'title = "The {name} hand"\n{text}')
    return tmp_path


def test_two_devices_are_run_and_judged_together(folder: Path) -> None:
    done = CliRunner().invoke(app, ["together", "left.toml", "right.toml"])
    assert done.exit_code == 0, done.output
    assert done.output.strip().startswith("Stable: all devices together")
    assert "device 2, the others held still" in done.output
    results = folder / "results" / "left-and-right"
    assert sorted(path.name for path in results.iterdir()) == [
        "device-1.h5", "device-1.html", "device-2.h5", "device-2.html", "report.html",
    ]  # fmt: skip
    whole, one, two = ((results / f"{name}.html").read_text("utf-8") for name in ("report", "device-1", "device-2"))
    assert "<title>left and The right hand</title>" in whole
    assert ("<title>Device 1: left</title>" in one, "<title>Device 2: The right hand</title>" in two) == (True, True)
    for page in (whole, one, two):
        assert "Stable: all devices together: small motions are stable" in page
    assert 'href="device-2.html"' in whole
    assert 'href="report.html"' in two
    assert '<h2 id="shared-body">' in whole
    assert Trace.load(results / "device-2.h5").verdict.settled


def test_two_bodies_are_refused_with_both_files_named(folder: Path) -> None:
    soft = (folder / "right.toml").read_text().replace("10 kPa", "5 kPa")
    (folder / "soft.toml").write_text(soft)
    done = CliRunner().invoke(app, ["together", "left.toml", "soft.toml"])
    assert done.exit_code == 2
    assert "soft.toml" in done.output
    assert "differs from that of left.toml; devices share one body" in done.output


def test_a_tip_pushed_through_the_body_is_told_as_of_a_single_device(folder: Path) -> None:
    alone = CliRunner().invoke(app, ["run", "hard.toml"])
    assert "contact lost: the tip is pushed through the body at t = " in alone.output
    done = CliRunner().invoke(app, ["together", "left.toml", "hard.toml"])
    assert done.exit_code == 1
    assert done.output.strip().startswith("Contact lost: device 2: the tip is pushed through the body at t = ")
    page = (folder / "results" / "left-and-hard" / "report.html").read_text("utf-8")
    assert "Contact lost: device 2: the tip is pushed through the body" in page


def test_a_device_off_the_body_has_lost_its_contact(folder: Path) -> None:
    done = CliRunner().invoke(app, ["together", "left.toml", "away.toml", "--out", "there"])
    assert done.exit_code == 1
    assert "Contact lost: device 2: the tip never touches the object" in done.output
    assert "no joint loop is known: the tip of device 2 does not touch the body" in done.output
    assert (folder / "there" / "device-1.h5").is_file()
