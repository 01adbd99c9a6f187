"""Commands that a signal ends at a random moment, their start included. Nightly only."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from nightly import nightly
from palpate import fem
from palpate.cli.main import app
from palpate.errors import PalpateError
from palpate.files import check_readable
from palpate.simulation.trace import Trace
from palpate.sweeps import open_sweep
from slider_text import SLIDER_TEXT
from typer.testing import CliRunner

ROUNDS = 17 * int(os.environ.get("PALPATE_ROUNDS", "1"))


def _whole_folder(trace: Path) -> bytes:
    """Return the files of a run, if the trace can be read. Hidden ones are of the command that was ended."""
    Trace.load(trace)
    return b"".join(file.read_bytes() for file in sorted(trace.parent.iterdir()) if not file.name.startswith("."))


def _whole_sweep(path: Path) -> bytes:
    """Return the file of a sweep, if it can be read."""
    open_sweep(path)
    return path.read_bytes()


# command: its words, its file, and the value of the file that every complete run gives
COMMANDS: dict[str, tuple[list[str], str, Callable[[Path], bytes]]] = {
    "run": (["run", "a.toml", "-o", "out"], "trace.h5", _whole_folder),
    "sweep": (
        ["sweep", "a.toml", "--over", "object.stiffness=50 N/m..99 N/m:2000", "-o", "out/sweep.h5"],
        "sweep.h5",
        _whole_sweep,
    ),
    "body phantom": (
        ["body", "phantom", "--contrast", "1", "--spacing", "20 mm", "-o", "out/body.h5"],
        "body.h5",
        lambda path: np.asarray(fem.load(path).compliance).tobytes(),
    ),
}


@nightly
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
@pytest.mark.parametrize("command", COMMANDS)
def test_a_command_that_a_signal_ends_leaves_whole_files(
    command: str, number: signal.Signals, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """No partial file can be read, the next run gives the same bytes and removes the rest, and no traceback appears."""
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(SLIDER_TEXT.format(title="slider", duration="0.2 s"), "utf-8")
    words, name, value = COMMANDS[command]
    rng, out, codes = random.Random(f"{command} {number}"), tmp_path / "out", Counter[int]()
    began = time.monotonic()
    assert subprocess.run([sys.executable, "-m", "palpate", *words], check=False, capture_output=True).returncode == 0
    longest = 1.1 * (time.monotonic() - began)
    whole, names = value(out / name), {file.name for file in out.iterdir()}
    for _ in range(ROUNDS):
        if rng.random() < 0.7:
            for file in out.iterdir():
                file.unlink()
        started = subprocess.Popen(
            [sys.executable, "-m", "palpate", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        time.sleep(rng.uniform(0.0, longest))
        started.send_signal(number)
        said = "".join(started.communicate(timeout=60))
        codes[started.returncode] += 1
        # Otherwise Python itself was still starting: its module runpy, or site, which reads files of other packages.
        own = "init_import_site" not in said and ("palpate" in said or "Traceback" not in said)
        assert started.returncode in (0, -number, 130) or not own, said
        assert "Traceback" not in said or not own
        if (out / name).exists() or (out / ".palpate-commit").exists():
            check_readable(out / name, PalpateError, kind="a result")
            assert command == "sweep" or value(out / name) == whole
        assert CliRunner().invoke(app, words).exit_code == 0
        assert value(out / name) == whole
        assert {file.name for file in out.iterdir()} == names
    print(f"{command}, {number.name}: {dict(codes)}")
    assert codes.total() - codes[0] > ROUNDS / 3
