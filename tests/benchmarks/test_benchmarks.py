"""The benchmark: its sections can be asked for one by one, and every number belongs to a row that was measured."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from palpate.errors import PalpateError
from typer.testing import CliRunner

from benchmarks import SECTIONS, run, tick
from benchmarks.__main__ import app
from benchmarks.section import Effort, Rows, Section, timed, timed_cells


def test_a_timed_row_counts_its_runs() -> None:
    """One call to warm up, then as many as asked; the slowest is no faster than the median."""
    calls: list[int] = []
    row = timed("counting", lambda: calls.append(1), 7, asked=1e-12)
    assert len(calls) == 8
    assert row["runs"] == 7
    assert 0 < row["fastest_s"] <= row["median_s"] <= row["slowest_s"]
    assert "missed" in timed_cells(row)[-1]
    assert "missed" not in timed_cells({**row, "asked_s": 1e3})[-1]


def test_quick_is_a_tenth() -> None:
    assert [Effort(quick=True).runs(n) for n in (2000, 50, 3)] == [200, 5, 1]
    assert Effort().runs(50) == 50


def test_sections_are_run_as_asked(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Only the sections named, each once and in their order; an unknown one is answered with those there are."""
    asked: list[str] = []
    for name in SECTIONS:

        def measure(_effort: Effort, tell: object, mine: str = name) -> Rows:
            asked.append(mine)
            tell("half way", 0.5)  # type: ignore[operator]
            return Rows([{"a": 1.0}], ["a peer is not installed"])

        monkeypatch.setitem(SECTIONS, name, Section("work", ("a [s]",), lambda row: (str(row["a"]),), measure))
    told: list[float] = []
    result = run(["touch", "loop", "touch"], progress=lambda _text, share: told.append(share))
    assert asked == ["touch", "loop"]
    assert told == [0.25, 0.75]
    assert list(result["sections"]) == asked
    assert list(run()["sections"]) == list(SECTIONS)
    with pytest.raises(
        PalpateError, match="no section 'speed' in the benchmark: choose from loop, batch, stability, touch, solid"
    ):
        run(["speed"])
    out = tmp_path / "numbers.json"
    done = CliRunner().invoke(app, ["loop", "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert "a  \n[s]" in done.output
    assert "a peer is not installed" in done.output
    assert json.loads(out.read_text("utf-8"))["sections"]["loop"]["rows"] == [{"a": 1.0}]


def test_every_section_fills_its_table() -> None:
    """Quick runs of the real thing: rows have as many cells as the table has columns, and errors are small."""
    for name in ("loop", "touch"):
        found = SECTIONS[name].measure(Effort(quick=True), lambda _text, _share: None)
        assert found.rows
        for row in found.rows:
            assert len(SECTIONS[name].cells(row)) == len(SECTIONS[name].headings)
            assert row.get("error_rad", 0.0) < 1e-6
            assert row.get("lost_ticks", 0) == 0


def test_the_bodies_of_the_tick_run(monkeypatch: pytest.MonkeyPatch) -> None:
    """The section builds its bodies by itself, so a change of their constructors reaches it; here with few nodes."""
    monkeypatch.setattr(tick, "PIECES", 4)
    monkeypatch.setattr(tick, "MODES", 6)
    organ = tick._organ()
    top = organ.points[:, 2].max()
    path = np.linspace([0.0, 0.0, top + tick.TIP + 1e-3], [0.0, 0.0, top + tick.TIP - 5e-3], 50)
    for name, core in organ.cores().items():
        force = core.simulate_path(path, np.tile([0.0, 0.0, 1.0], (50, 1)), tick.TIP, False)[:, :3]
        assert not force[0].any(), name
        assert force[-1, 2] > 0.1, name
