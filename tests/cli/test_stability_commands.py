"""What `zwidth` prints of a map, line by line, and the errors of the commands that analyze a loop."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.cli.main import app
from palpate.stability.maps.zwidth_map import ZWidth
from typer.testing import CliRunner

SCENARIO = """title = "A [slider]"
device.name = "slider"
servo = { period = "1 ms", topology = "impedance_display" }
object = { kind = "spring", stiffness = "50 N/m" }
run.duration = "0.1 s"
"""


def found(**changes: Any) -> Any:
    values = {
        "verdict": "K = 50 N/m is stable", "stable_here": True, "here": (0.5, 50.0), "stiffest_here": 123.456,
        "curves": {"nobody": SimpleNamespace(stiffest=(1.5, 2000.0)), "a hand": SimpleNamespace(stiffest=(2.5, 3e4))},
        "gap_remarks": ["a band is unstable"], "never": ["a fist"], "passive": (np.zeros(2), np.array([10.0, 20.0])),
        "not_passive": "its reason", "simulated": SimpleNamespace(runs=1234, furthest=0.0123),
        "not_simulated": "no wish",
    }  # fmt: skip
    given = SimpleNamespace(**{**values, **changes}, save=lambda path: path.write_text("{}", "utf-8"))
    given.facts = ZWidth.facts.fget(given)  # type: ignore[attr-defined]
    return given


LINES = [
    "A [slider]", "K = 50 N/m is stable", "nobody: up to 2 N/mm, with 1.5 N·s/m of damping",
    "a hand: up to 30 N/mm, with 2.5 N·s/m of damping", "with the 0.5 N·s/m of the scenario: up to 123.5 N/m",
    "a band is unstable", "a fist: no object of any size is stable", "passive in every hand: up to 20 N/m",
    "simulated boundary (1,234 runs): at most 1.2 % of the map off the exact curve",
]  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "code", "replaced"),
    [
        ({}, 0, {}),
        ({"stable_here": False}, 1, {}),
        ({"stiffest_here": None, "gap_remarks": [], "never": []}, 0, {4: None, 5: None, 6: None}),
        ({"passive": None}, 0, {7: "passive walls: none known; its reason"}),
        ({"simulated": None}, 0, {8: "no simulated boundary: no wish"}),
    ],
)
def test_a_z_width_is_told_line_by_line(
    changes: dict[str, Any], code: int, replaced: dict[int, str | None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[tuple[str, bool]] = []

    def zwidth(scenario: Any, *, simulated: bool, progress: Any) -> Any:
        asked.append((scenario.title, simulated))
        progress("tracing", 0.5)
        return found(**changes)

    monkeypatch.setattr("palpate.stability.zwidth", zwidth)
    page = SimpleNamespace(save=lambda path: path.write_text("a page", "utf-8"))
    monkeypatch.setattr("palpate.report.zwidth_page", lambda _: page)
    path, out = tmp_path / "s.toml", tmp_path / ("o" * 90)  # longer than a line
    path.write_text(SCENARIO, "utf-8")
    result = CliRunner().invoke(app, ["zwidth", str(path), "--out", str(out), "--no-simulate"])
    assert result.exit_code == code, result.output
    lines = [replaced.get(k, line) for k, line in enumerate(LINES)]
    written = [str(out / name) for name in ("zwidth.html", "zwidth.json")]
    assert [line.strip() for line in result.stdout.splitlines()] == [*(line for line in lines if line), *written]
    assert asked == [("A [slider]", False)]
    assert (out / "zwidth.html").read_text("utf-8") == "a page"


DISPLAY = """title = "A display"
device = { name = "phantom-premium-1.5a" }
start = { pose = ["0 rad", "2.2305 rad", "3.2776 rad"] }
servo = { period = "1 ms", topology = "impedance_display" }
run = { duration = "0.1 s" }

[operator]
kind = "arm"
mass = "0.15 kg"
damping = "4.5 N*s/m"
stiffness = "200 N/m"
force = ["0 N", "0 N", "-0.4 N"]

"""
FREE = DISPLAY + '[object]\nkind = "none"\n'
GUARDED = DISPLAY + '[object]\nkind = "spring"\nstiffness = "50 N/m"\n\n[guard]\nkind = "energy_bound"\n'
MOVING = DISPLAY + (
    '[object]\nkind = "spring"\nstiffness = "50 N/m"\n\n[object.frame]\n'
    'displacement = [["0 s", "0 mm", "0 mm", "0 mm"], ["1 s", "0 mm", "0 mm", "5 mm"]]\n'
)
BEYOND = DISPLAY + (
    '[object]\nkind = "body"\nposition = ["0 mm", "0 mm", "-60 mm"]\n\n[object.body]\nshape = "block"\n'
    'size = ["24 mm", "24 mm", "16 mm"]\nyoung = "10 kPa"\nspacing = "8 mm"\nradius = "6 mm"\n'
)


@pytest.mark.parametrize(
    ("text", "command", "place"),
    [
        (FREE, "certify", "one.toml, line 15: object.kind: nothing is touched"),
        (FREE, "zwidth", "one.toml, line 15: object.kind: nothing is touched"),
        (FREE, "performance", 'one.toml, line 15: object.kind: "none" has no stiffness'),
        (GUARDED, "certify", "one.toml, line 19: guard.kind: a guard makes the loop nonlinear"),
        (GUARDED, "workspace", "one.toml, line 19: guard.kind: a guard makes the loop nonlinear"),
        (MOVING, "zwidth", "one.toml, line 18: object.frame: an analysis takes an object at rest"),
        (BEYOND, "zwidth", "one.toml, line 14: object: the response of the body is unknown: the tip does not touch"),
        (BEYOND, "performance", "one.toml, line 14: object: the performance is that of a contact that lasts"),
        (SCENARIO.replace("A [slider]", "one"), "workspace", "one.toml, line 2: device.name: slider has 1 of the"),
    ],
)
def test_an_analysis_that_does_not_suit_the_scenario_names_the_file_and_the_line(
    text: str, command: str, place: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    Path("one.toml").write_text(text, "utf-8")
    done = CliRunner().invoke(app, [command, "one.toml"])
    assert done.exit_code == 2, done.output
    assert done.stderr.strip().splitlines()[-1].startswith(f"error: {place}")
