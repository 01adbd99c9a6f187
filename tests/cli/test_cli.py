"""The command line: what it writes, what it says, and how it ends."""

from __future__ import annotations

import importlib
import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import Trace
from palpate.cli.body import _print_size
from palpate.cli.console import print_columns
from palpate.cli.interrupt import control_c
from palpate.cli.main import app
from palpate.cli.performance import _guard_rows
from palpate.errors import OutputError
from palpate.files import atomic_write, write_folder
from palpate.metrics import GuardComparison, GuardRow, TipAxis
from typer.testing import CliRunner

SCENARIO = """
title = "Press a cube"
[device]
name = "phantom-premium-1.5a"
[start]
pose = ["0 rad", "2.2305 rad", "3.2776 rad"]
[servo]
period = "0.5 ms"
[reference]
force = "8.5 N"
[object]
kind = "spring"
stiffness = "{stiffness}"
[controller]
kind = "{controller}"
[run]
duration = "0.3 s"
"""


def scenario(folder: Path, stiffness: str = "3.5 N/mm", controller: str = "lqg") -> Path:
    path = folder / "cube.toml"
    path.write_text(SCENARIO.format(stiffness=stiffness, controller=controller))
    return path


def palpate(*arguments: object) -> tuple[int, str]:
    """Return exit code and all that was printed, in one line."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, " ".join(result.output.split())


def test_run_writes_trace_summary_and_report(tmp_path: Path) -> None:
    """Three files, none left over, and the summary's numbers are the trace's."""
    code, text = palpate("run", scenario(tmp_path), "--out", tmp_path / "out")
    assert code == 0
    assert "settled to 5 %" in text
    assert sorted(file.name for file in (tmp_path / "out").iterdir()) == ["report.html", "summary.json", "trace.h5"]
    assert sorted(file.name for file in tmp_path.iterdir()) == ["cube.toml", "out"]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    trace = Trace.load(tmp_path / "out" / "trace.h5")
    steady = summary["axes"]["z"]["steady_deflection_m"]
    assert steady == pytest.approx(float(np.mean(trace["deflection"][-30:, 2])), rel=1e-9)
    assert steady == pytest.approx(8.5 / 3500, rel=1e-3)


def test_run_of_a_diverging_loop_says_from_when_and_keeps_the_trace(tmp_path: Path) -> None:
    """Exit code 1, "diverges at t = …", and a finite trace that ends there."""
    code, text = palpate("run", scenario(tmp_path, "30 N/mm", "none"), "--out", tmp_path / "out")
    assert code == 1
    trace = Trace.load(tmp_path / "out" / "trace.h5")
    assert trace.unstable_from is not None
    assert f"unstable: diverges at t = {trace.unstable_from:.4g} s" in text
    assert trace.time[-1] < trace.unstable_from
    assert all(np.isfinite(channel.values).all() for channel in trace.channels.values())


def test_resolve_writes_a_folder_of_plain_data(tmp_path: Path) -> None:
    """Exit code 0 and the files' names; a folder of other files is left alone with exit code 2."""
    code, text = palpate("resolve", scenario(tmp_path), "--out", tmp_path / "loop")
    assert code == 0
    assert f"{tmp_path / 'loop' / 'loop.json'}" in text
    assert sorted(file.name for file in (tmp_path / "loop").iterdir()) == ["loop.json", "reference.float64"]
    code, text = palpate("resolve", scenario(tmp_path), "--out", tmp_path)
    assert code == 2
    assert "the folder holds other files" in text


def test_a_mistake_ends_in_one_sentence_with_file_line_and_field(tmp_path: Path) -> None:
    """Exit code 2; nothing is written."""
    path = scenario(tmp_path, "3.5 N")
    code, text = palpate("run", path, "--out", tmp_path / "out")
    assert code == 2
    assert f'{path}, line 13: object.stiffness: "3.5 N" is a force' in text
    assert not (tmp_path / "out").exists()


def test_control_c_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C while the report is written: exit code 130, no folder, no temporary files."""

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("palpate.report.Page.save", interrupted)
    code, text = palpate("run", scenario(tmp_path), "--out", tmp_path / "out")
    assert code == 130
    assert "nothing was written" in text
    assert [file.name for file in tmp_path.iterdir()] == ["cube.toml"]


@pytest.mark.parametrize("begun", [False, True])
def test_a_stopped_sweep_names_its_file_only_if_there_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, begun: bool
) -> None:
    def interrupted(*_: object, out: Path, **__: object) -> None:
        if begun:
            out.write_bytes(b"cells")
        raise KeyboardInterrupt

    monkeypatch.setattr("palpate.sweeps.sweep", interrupted)
    file = tmp_path / "sweep.h5"
    code, text = palpate("sweep", scenario(tmp_path), "--over", "object.stiffness=1 N/mm..2 N/mm:3", "--out", file)
    assert code == 130
    said = f"stopped: {file} has the cells that are done" if begun else "stopped: nothing was written"
    assert said in text.replace("\n", "")


@pytest.fixture
def heard() -> Iterator[Any]:
    """Ctrl-C as a terminal sends it, though what runs in the background of a shell begins with it ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield signal.default_int_handler
    signal.signal(signal.SIGINT, before)


def test_control_c_is_not_lost_in_an_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, heard: Any) -> None:
    """A module that would swallow it is imported whole, KeyboardInterrupt comes right after; the handler is back."""
    (tmp_path / "greedy.py").write_text(
        "import os, signal, time\n"
        "swallowed = False\n"
        "try:\n    os.kill(os.getpid(), signal.SIGINT)\n    time.sleep(0.1)\n"
        "except BaseException:\n    swallowed = True\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    seen = []

    def command() -> None:
        with control_c():
            seen.append(importlib.import_module("greedy").swallowed)
            time.sleep(10.0)

    with pytest.raises(KeyboardInterrupt):
        command()
    assert seen == [False]
    assert signal.getsignal(signal.SIGINT) is heard


def test_control_c_before_a_command_has_begun_ends_without_a_word(tmp_path: Path) -> None:
    """While the command line itself is imported: ended by the signal, with no traceback."""
    (tmp_path / "typer.py").write_text("import os, signal, time; os.kill(os.getpid(), signal.SIGINT); time.sleep(10)")
    path = os.pathsep.join([str(tmp_path), *sys.path])
    heard = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    done = subprocess.run(
        [sys.executable, "-c", f"{heard}; from palpate.__main__ import main; main()", "devices"],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "", "")


def test_a_warning_is_told_in_a_line_once(tmp_path: Path) -> None:
    """Whichever command it comes from: what is not meant, without the place in the code that found it."""
    soft = ["body", "phantom", "--young", "5 Pa", "--contrast", "1", "--spacing", "10 mm", "-o", tmp_path / "soft.h5"]
    code, text = palpate(*soft)
    assert code == 0
    assert text.count('warning: young: 5 Pa is softer than any tissue; for a value in kPa, write "5 kPa"') == 1
    assert "BodyWarning" not in text
    assert ".py" not in text
    (size,) = re.findall(r"([\d,]+) tetrahedra, ([\d,]+) vertices, [\d,]+ contact nodes", text)
    cells, vertices = (int(number.replace(",", "")) for number in size)
    assert cells % 600 == 0  # of 10 x 10 cubes a layer
    assert vertices == 121 * (cells // 600 + 1)


def test_a_folder_keeps_its_old_files_when_a_new_one_fails(tmp_path: Path) -> None:
    """All of a run's files are replaced, or none."""
    write_folder(tmp_path / "out", {"a": lambda path: path.write_text("old"), "b": lambda path: path.write_text("old")})

    def fail(path: Path) -> None:
        raise ValueError(path.name)

    with pytest.raises(ValueError, match="b"):
        write_folder(tmp_path / "out", {"a": lambda path: path.write_text("new"), "b": fail})
    assert [(tmp_path / "out" / name).read_text() for name in "ab"] == ["old", "old"]
    assert [file.name for file in tmp_path.iterdir()] == ["out"]


def test_a_full_disk_is_told_by_the_name_that_was_asked_for(tmp_path: Path) -> None:
    """Not by that of the temporary folder; and of HDF5's long line the reason alone."""

    def full(path: Path) -> None:
        raise OSError("Unable to create file (errno = 28, error message = 'No space left on device', buf = 0x5)")

    with pytest.raises(OutputError) as told:
        write_folder(tmp_path / "out", {"trace.h5": lambda path: atomic_write(path, full)})
    assert str(told.value) == f"{tmp_path / 'out' / 'trace.h5'}: cannot be written: No space left on device"
    assert list(tmp_path.iterdir()) == []


def test_devices_lists_the_catalog_and_shows_sources() -> None:
    """Each device by name; each number with the mark of its source."""
    code, text = palpate("devices")
    assert "Your own is a TOML file of the same kind: palpate devices path/to/file.toml" in " ".join(text.split())
    assert code == 0
    assert "phantom-premium-1.5a-rotors" in text
    code, text = palpate("devices", "slider")
    assert code == 0
    assert "mass.tip 60 g [1]" in text
    code, text = palpate("devices", "slidr")
    assert code == 2
    assert "did you mean slider?" in text


def test_identify_makes_a_recording_and_reads_it(tmp_path: Path) -> None:
    """The simulated experiment comes back as the device that was simulated: mass within 5 %."""
    path = tmp_path / "recording.csv"
    assert palpate("identify", "--simulate", path, "--device", "slider")[0] == 0
    code, text = palpate("identify", path, "--device", "slider", "--out", tmp_path / "found")
    assert code == 0
    assert "95 % interval" in text
    found = json.loads((tmp_path / "found" / "identification.json").read_text())
    mass = next(row for row in found["parameters"] if row["name"] == "m")
    assert mass["value"] == pytest.approx(0.060, rel=0.05)


def test_square_brackets_in_a_device_s_name_are_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("palpate.identification.identify_recording", lambda *_args, **_options: {"summary": "[red] 1"})
    assert palpate("identify", tmp_path / "recording.csv") == (0, "[red] 1")


@pytest.mark.parametrize("command", ["run", "certify", "zwidth", "workspace", "performance", "sweep", "resolve"])
def test_help_tells_where_files_go(command: str) -> None:
    """Nothing in angle brackets is used: the help's renderer takes it for a tag and leaves it out."""
    code, said = palpate(command, "--help")
    assert code == 0
    words = " ".join(said.replace("│", " ").split())
    assert "name" in words.partition("results/ and ")[2]


def test_help_answers_without_the_numerical_packages() -> None:
    """`palpate --help` loads neither numpy nor python-control, so it answers at once."""
    code = (
        "import sys; from palpate.cli.main import main; sys.argv = ['palpate', '--help']\n"
        "try: main()\nfinally: print('loaded', [n for n in ('numpy', 'control', 'matplotlib') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "loaded []" in done.stdout, done.stdout + done.stderr


def test_columns_are_aligned_and_a_line_is_never_broken(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [["guard", "wall"], ["a very " * 20, "500 N/m"], ["b", "[none]"]]
    print_columns(rows)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert {line.index(row[1]) for line, row in zip(lines, rows, strict=True)} == {4 + len(rows[1][0])}


def test_the_table_of_guards_has_the_unit_of_every_number() -> None:
    reaches = GuardRow("damper", 3500.0, 0.987, 2.08, 2.3e-3, "none")
    never = GuardRow("coupling", 0.0, math.nan, math.nan, math.inf, "every stiffness")
    found = GuardComparison("slider", TipAxis(0.06, 0.05, 0.0, 0.0), 1e-3, 0, (500.0,), (0.1,), 1.0, (reaches, never))
    assert _guard_rows(found)[1:] == [
        ["damper", "3500 N/m", "99%", "2.08 N", "2.3 mm", "none"],
        ["coupling", "none", "–", "–", "diverges", "every stiffness"],
    ]


def test_the_size_of_a_body_names_its_elements_and_the_time_without_its_meshing(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """36 bytes for each pair of contact nodes; a body of boundary elements has triangles alone."""
    for cells, elements in ((1200, "1,200 tetrahedra"), (0, "30 triangles")):
        body: Any = SimpleNamespace(
            contents=SimpleNamespace(tetrahedra=range(cells), vertices=range(4000)), triangles=range(30),
            nodes=range(500),
            record={"source": "a [mesh]", "seconds": {"meshing": 7.0, "solving": 1.5, "writing": 2.0}},
        )  # fmt: skip
        _print_size(body)
        said = " ".join(capsys.readouterr().out.split())
        assert said == f"a [mesh]: {elements}, 4,000 vertices, 500 contact nodes; 9 MB, solved in 3.5 s"
