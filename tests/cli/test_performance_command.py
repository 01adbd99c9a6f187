"""What `performance` prints of a loop and of the guards, line by line."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.cli.main import app
from palpate.metrics import GuardComparison, GuardRow, TipAxis
from typer.testing import CliRunner

SCENARIO = """title = "A [slider]"
device.name = "slider"
servo = { period = "1 ms", topology = "impedance_display" }
object = { kind = "spring", stiffness = "50 N/m" }
run.duration = "0.1 s"
"""


def printed(arguments: list[str], tmp_path: Path) -> list[str]:
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO, "utf-8")
    result = CliRunner().invoke(app, ["performance", str(path), *arguments])
    assert result.exit_code == 0, result.output
    return [line.strip() for line in result.stdout.splitlines()]


def along(**changes: Any) -> Any:
    values = {
        "direction": (1.0, 0.0, -0.12345), "static_stiffness": 1234.56, "transparency_bandwidth": 12.345,
        "rate_hardness": 543.21, "bandwidth": 98.765, "precision": 0.012345,
    }  # fmt: skip
    return SimpleNamespace(**{**values, **changes})


def test_the_measures_of_a_loop_are_told_line_by_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    device = SimpleNamespace(
        peak_force=(8.5, 9.25), peak_acceleration=(1.0, math.inf), tip_mass=(0.06, 0.1234), kinematic_isotropy=0.456,
        inertial_isotropy=0.789, dynamic_range=45.678, resolution=3.2109e-5,
    )  # fmt: skip
    bare = SimpleNamespace(**{**vars(device), "dynamic_range": math.inf, "resolution": 0.0})
    nothing = along(static_stiffness=math.inf, transparency_bandwidth=0.0, rate_hardness=math.nan)
    fractions: list[float] = []

    def bar(text: str) -> Any:
        class Bar:
            def __enter__(self) -> Any:
                return lambda _now, fraction: fractions.append(fraction)

            def __exit__(self, *_: object) -> None:
                assert text == "reading the scenario"

        return Bar()

    monkeypatch.setattr("palpate.cli.performance.progress", bar)
    monkeypatch.setattr("palpate.report.performance_page", lambda _: SimpleNamespace(save=lambda p: p.write_text("p")))
    for one, end in (
        (device, ", dynamic range 45.7 dB, resolution 32.1 µm"),
        (bare, ""),
    ):
        found = SimpleNamespace(
            device=one,
            along=[along(), nothing],
            remark="a [remark] " * 12,
            assumption="An arm.",
            save=lambda p: p.write_text("{}"),
        )
        monkeypatch.setattr("palpate.metrics.measure_performance", lambda *_, found=found, **__: found)
        out = tmp_path / ("[o]" * 30)
        assert printed(["--out", str(out)], tmp_path) == [
            "A [slider]",
            "device: peak force 8.5 to 9.25 N, tip mass 60 to 123 g, isotropy 0.46 (Jacobian), 0.79 (inertia)" + end,
            "along (1, 0, -0.123): stiffness at rest 1235 N/m; transparent to within 23 % up to 12.3 Hz; rate-hardness "
            "543.2 N/m; force bandwidth 98.8 Hz; static error 1.23 %",
            "along (1, 0, -0.123): infinite stiffness at rest (an integrator admits no steady deflection); not "
            "transparent to within 23 % at 0.1 Hz; force bandwidth 98.8 Hz; static error 1.23 %",
            "An arm.",
            ("a [remark] " * 12).strip(),
            str(out / "performance.html"),
            str(out / "performance.json"),
        ]
    assert all(0.0 < fraction < 1.0 for fraction in fractions)


def test_the_comparison_of_guards_is_told_line_by_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reaches = GuardRow("damper", 3500.0, 0.987, 2.08, 9.99e-4, "none")
    found = GuardComparison(
        "slider", TipAxis(0.0612, 0.0512, 0.123, 3.21e-5), 5e-4, 2, (500.0, 1e4), (0.1,), 1.0, (reaches,)
    )
    monkeypatch.setattr(GuardComparison, "save", lambda _self, path: path.write_text("{}"))
    asked: dict[str, Any] = {}
    monkeypatch.setattr(
        "palpate.metrics.compare_guards", lambda *given, **named: asked.update(given=given, **named) or found
    )
    stiff, light = (
        SimpleNamespace(stiffness=12345.6, damping=7.891, exact=23456.7),
        SimpleNamespace(mass=0.01234, exact=0.005678),
    )
    couplings = tuple((axis, stiff, light) for axis in np.eye(3)[[1, 2]])
    monkeypatch.setattr("palpate.stability.design_couplings", lambda *_, **__: couplings)
    lines = printed(["--guards", "--out", str(tmp_path / "out")], tmp_path)
    assert lines[0] == (
        "slider: m = 61.2 g, b = 0.0512 N s/m, 0.123 N of dry friction, counts of 32.1 µm, T = 0.5 ms; walls of 500 to "
        "10000 N/m"
    )
    table = [line.split("  ") for line in lines]
    cells = [[part.strip() for part in line if part.strip()] for line in table]
    assert cells[1] == ["guard", "wall", "felt", "step", "swing", "passive for"]
    assert cells[2] == ["damper", "3500 N/m", "99%", "2.08 N", "999 µm", "none"]
    assert lines[3].startswith("wall: the largest up to which the tip rests and 90 % is felt; felt: share")
    assert lines[3].endswith("Passivity does not make the tip rest.")
    assert lines[4] == "virtual couplings (Adams & Hannaford 1999), without delay:"
    assert cells[5] == ["axis", "impedance, two-port", "exactly", "admittance, two-port", "exactly"]
    numbers = ["12346 N/m with 7.89 N s/m", "23457 N/m", "0.0123 kg", "0.00568 kg"]
    assert cells[6:8] == [["y", *numbers], ["z", *numbers]]
    assert lines[8].startswith("impedance display: stiffest coupling; admittance display: least mass of the tool.")
    assert lines[9:] == [str(tmp_path / "out" / "guards.json")]
    assert (asked["period"], asked["delay"]) == (1e-3, 0)
    np.testing.assert_array_equal(asked["given"][1], [0.0])


def test_a_loop_that_is_transparent_above_the_lowest_frequency_is_not_called_nowhere_transparent(
    tmp_path: Path,
) -> None:
    """A gain of 1.3 deviates by 30 % at rest; the mass of the device takes some of it from 1.6 to 4.2 Hz."""
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO + 'controller = { kind = "gain", gain = [1.3, 1.3, 1.3] }\n', "utf-8")
    result = CliRunner().invoke(app, ["performance", str(path), "--out", str(tmp_path)])
    assert "not transparent to within 23 % at 0.1 Hz" in result.stdout
    (along,) = json.loads((tmp_path / "performance.json").read_text("utf-8"))["directions"]
    f = np.array(along["frequency_Hz"])
    impedance = np.array(along["impedance_real_N_s_per_m"]) + 1j * np.array(along["impedance_imag_N_s_per_m"])
    assert np.abs(2j * np.pi * f * impedance / 50.0 - 1.0).min() < 0.23


def test_a_damper_without_stiffness_has_no_static_error(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    path.write_text(SCENARIO.replace('"50 N/m"', '"0 N/m", damping = "1 N*s/m"'), "utf-8")
    result = CliRunner().invoke(app, ["performance", str(path), "--out", str(tmp_path)])
    assert result.exit_code == 0, result.output
    assert "static error" not in result.stdout
    (along,) = json.loads((tmp_path / "performance.json").read_text("utf-8"))["directions"]
    assert along["static_precision"] is None
    assert along["static_stiffness_N_per_m"] == pytest.approx(0.0, abs=1e-3)
