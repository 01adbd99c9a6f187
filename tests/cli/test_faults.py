"""Commands under faults: disks that refuse, signals, terminals that obey control characters."""

from __future__ import annotations

import builtins
import hashlib
import io
import logging
import os
import re
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Future
from contextlib import suppress
from errno import EIO, ENOSPC
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from nightly import NIGHTLY
from palpate.cli.command import one_sentence
from palpate.cli.interrupt import control_c
from palpate.cli.main import app
from palpate.devices import load
from palpate.errors import PalpateError
from palpate.files import check_readable, hdf5_output, output
from palpate.identification import simulate_experiment
from palpate.report import Page
from palpate.sweeps import SweepError, store
from palpate.sweeps.run import _result
from slider_text import SLIDER_TEXT
from typer import Exit, Typer
from typer.testing import CliRunner

from experiments.hosseini2004 import reproduce
from experiments.hosseini2004.__main__ import app as thesis
from experiments.hosseini2004.checks import tally

PACKAGE = str(Path(output.__file__).parents[1])
_OPEN = open
_TIMES = re.compile(rb"<dc:date>.*?</dc:date>")


def palpate(*words: object, program: Typer = app) -> tuple[int, str]:
    done = CliRunner().invoke(program, [str(word) for word in words])
    assert done.exception is None or isinstance(done.exception, SystemExit), repr(done.exception)
    return done.exit_code, done.output


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    (tmp_path / "in").mkdir()
    path = tmp_path / "in" / "slider.toml"
    path.write_text(SLIDER_TEXT.format(title="plain", duration="1 s"), "utf-8")
    return path


class _FaultyFile(io.FileIO):
    """File that counts its writes among the calls of a `_FaultySystem`."""

    system: _FaultySystem

    def write(self, data: Any) -> int:
        return int(self.system.counted(super().write)(data))


class _FaultySystem:
    """The module `os` and `open`, in which the n-th call that changes the disk and all later ones fail."""

    changing = ("pwrite", "fsync", "ftruncate", "posix_fallocate", "replace", "rename", "mkdir")

    def __init__(self, failing: int, number: int) -> None:
        self.made, self.failing, self.number = 0, failing, number

    def __getattr__(self, name: str) -> Any:
        real = getattr(os, name)
        return self.counted(real) if name in self.changing else real

    def counted(self, real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **options: Any) -> Any:
            self.made += 1
            if self.failing and self.made >= self.failing:
                raise OSError(self.number, os.strerror(self.number))
            return real(*args, **options)

        return call

    def install(self, patch: pytest.MonkeyPatch) -> None:
        for module in (output, hdf5_output, store):
            patch.setattr(module, "os", self)
        for name in ("replace", "rename"):
            patch.setattr(Path, name, self.counted(getattr(Path, name)))
        for module in (io, builtins):
            patch.setattr(module, "open", self.open_file)

    def open_file(self, file: Any, mode: str = "r", buffering: int = -1, *args: Any, **options: Any) -> Any:
        """Open a file as `io.open`; its writes are counted if it is one of a result."""
        if not {"w", "x", "a"} & set(mode) or ".part" not in str(file):
            return _OPEN(file, mode, buffering, *args, **options)
        raw = _FaultyFile(os.fspath(file), mode.replace("b", "").replace("t", ""))
        raw.system = self
        buffered = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
        return buffered if "b" in mode else io.TextIOWrapper(buffered, *args, **options)


COMMANDS: dict[str, list[str]] = {
    "run": ["run", "{scenario}", "-o", "{out}/r"],
    "resolve": ["resolve", "{scenario}", "-o", "{out}/l"],
    "sweep": ["sweep", "{scenario}", "--over", "object.stiffness=50 N/m,100 N/m", "-o", "{out}/s.h5"],
    "body phantom": ["body", "phantom", "--contrast", "1", "--spacing", "25 mm", "-o", "{out}/b.h5"],
    "identify": ["identify", "{recording}", "-d", "slider", "-o", "{out}/i", "--write", "{out}/device.toml"],
    "reproduce": ["-o", "{out}/t"],
}


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    whole = simulate_experiment(load("slider"), duration=4.0)
    return whole.save(tmp_path_factory.mktemp("recording") / "slider.csv")


def _write_reproduction(out: Path, _progress: object) -> reproduce.Reproduction:
    """Write the files of a reproduction without computing it."""
    page = Page("The thesis")
    picture = Figure()
    page.figure(picture, "an empty figure")
    reproduce._write(out, page, picture, [{"id": "a"}])
    return reproduce.Reproduction([], tally([]), [])


@pytest.mark.parametrize("command", COMMANDS)
def test_the_nth_call_that_fails_ends_a_command_in_one_sentence(
    command: str, scenario: Path, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With exit code 2; every file is the former or the new one; the next run succeeds, and no other file remains.

    Nightly each call fails once.
    """
    out = tmp_path / "out"
    words = [word.format(scenario=scenario, recording=recording, out=out) for word in COMMANDS[command]]
    program = thesis if command == "reproduce" else app
    monkeypatch.setattr(reproduce, "run", _write_reproduction)
    with monkeypatch.context() as patch:
        system = _FaultySystem(0, ENOSPC)
        system.install(patch)
        assert palpate(*words, program=program)[0] == 0
    whole, sentences = _contents(out), 0
    assert system.made > 4
    for failing in range(1, system.made + 1) if NIGHTLY else (1, system.made // 2, system.made - 1):
        number = ENOSPC if failing % 2 else EIO
        for file in out.glob("s.*"):
            file.unlink()
        before = _contents(out)
        with monkeypatch.context() as patch:
            _FaultySystem(failing, number).install(patch)
            code, said = palpate(*words, program=program)
        last = [line for line in said.splitlines() if line.strip()][-1]
        synced_folder = code == 0  # a file system may refuse to flush a folder; the files are on the disk
        assert synced_folder or (code == 2 and last.startswith("error: ") and os.strerror(number) in last), said
        assert "Traceback" not in said
        sentences += code
        for folder in "rlit":
            with suppress(PalpateError):
                check_readable(out / folder / "a", PalpateError, kind="a file")  # completes the renames
        assert command == "sweep" or code == 0 or _contents(out) == before
    assert sentences
    assert palpate(*words, program=program)[0] == 0
    assert _contents(out).keys() == whole.keys()


@pytest.mark.parametrize("command", COMMANDS)
def test_the_nth_allocation_that_fails_ends_a_command_in_one_sentence(
    command: str, scenario: Path, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the arrays that palpate makes in Python; former files remain. Nightly each of the first 200 fails."""
    out = tmp_path / "out"
    words = [word.format(scenario=scenario, recording=recording, out=out) for word in COMMANDS[command]]
    program = thesis if command == "reproduce" else app
    monkeypatch.setattr(reproduce, "run", _write_reproduction)
    made, failing, sentences = 0, 0, 0

    def counted(real: Callable[..., Any]) -> Callable[..., Any]:
        def call(*args: Any, **options: Any) -> Any:
            nonlocal made
            made += sys._getframe(1).f_code.co_filename.startswith(PACKAGE)  # scikit-fem drops exceptions
            if made == failing:
                raise MemoryError("Unable to allocate 9 GiB")
            return real(*args, **options)

        return call

    assert palpate(*words, program=program)[0] == 0
    for name in ("empty", "zeros", "ones", "full", "arange", "linspace", "stack", "concatenate"):
        monkeypatch.setattr(np, name, counted(getattr(np, name)))
    before = _contents(out)
    for failing in range(1, 200) if NIGHTLY else (3,):
        made = 0
        for file in out.glob("s.*"):
            file.unlink()
        code, said = palpate(*words, program=program)
        if made < failing:
            break
        assert code in (0, 1, 2)
        if code:
            sentences += 1
            assert "error: " in said
            assert "Traceback" not in said
            assert command == "sweep" or _contents(out) == before
    failing = 0
    assert sentences or made == 0
    assert palpate(*words, program=program)[0] == 0
    assert _contents(out).keys() == before.keys()


@pytest.mark.parametrize(("reason", "said"), [("", ""), ("Unable to allocate 9 GiB", ": Unable to allocate 9 GiB")])
def test_memory_that_is_missing_is_one_sentence(reason: str, said: str, capsys: pytest.CaptureFixture[str]) -> None:
    def command() -> None:
        raise MemoryError(reason)

    with pytest.raises(Exit) as end:
        one_sentence(command)()
    assert end.value.exit_code == 2
    assert capsys.readouterr().err == f"error: not enough memory{said}\n"


def _contents(folder: Path) -> dict[str, str]:
    """Return a digest of each file without the date of a figure."""
    found = {}
    for file in sorted(folder.rglob("*")):
        data = file.read_bytes() if file.is_file() else b""
        found[str(file.relative_to(folder))] = hashlib.sha256(_TIMES.sub(b"", data)).hexdigest()
    return found


@pytest.mark.parametrize("name", ["...toml", ".. .toml"])
def test_a_scenario_without_a_name_writes_nowhere(
    name: str, scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`results/..` is the folder above."""
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    scenario.rename(tmp_path / "work" / name)
    for command in ("run", "certify", "resolve"):
        code, said = palpate(command, name)
        assert code == 2
        assert "name them with --out" in " ".join(said.split())
    assert [file.name for file in (tmp_path / "work").iterdir()] == [name]


def test_control_characters_reach_no_terminal(scenario: Path, tmp_path: Path) -> None:
    """Neither of titles nor of messages; and square brackets are text, not markup."""
    scenario.write_text(SLIDER_TEXT.format(duration="0.1 s", title="[/x] a\\u001b]0;PWN\\u0007\\u202e"), "utf-8")
    for command in ("run", "certify"):
        code, said = palpate(command, scenario, "-o", tmp_path / command)
        assert code in (0, 1)
        assert "[/x] a\\x1b]0;PWN\\x07\\u202e" in said
        assert not set("\x1b\x07\u202e") & set(said)
    code, said = palpate("run", scenario, "--set", "object.\x1b[2Jkind=x")
    assert code == 2
    assert "\x1b" not in said
    device = tmp_path / "device.toml"
    device.write_text('based_on = "slider"\nname = "[/x]\\u001b"\ndescription = "[bold\\u0007"\n', "utf-8")
    code, said = palpate("devices", device)
    assert code == 0
    assert "[/x]\\x1b" in said
    assert not set("\x1b\x07") & set(said)


@pytest.fixture
def restored() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


class _Thing:
    pass


@pytest.mark.usefixtures("restored")
def test_an_interrupt_in_a_callback_is_neither_printed_nor_lost(capfd: pytest.CaptureFixture[str]) -> None:
    """Python prints "Exception ignored" with a traceback for one in a weak reference's callback, and goes on."""

    def command() -> None:
        with control_c():
            thing = _Thing()
            reference = weakref.ref(thing, lambda _: (os.kill(os.getpid(), signal.SIGINT), time.sleep(0.01)))
            del thing
            assert reference() is None
            time.sleep(10.0)

    with pytest.raises(KeyboardInterrupt):
        command()
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("restored")
def test_an_interrupt_that_a_library_replaces_by_another_error_is_an_interrupt() -> None:
    """As code of pybind11 does while it converts an argument; an error without an interrupt stays itself."""

    def convert(number: int | None) -> None:
        try:
            if number is not None:
                signal.raise_signal(number)
        except KeyboardInterrupt:
            raise TypeError("incompatible function arguments") from None
        raise ValueError("a mistake")

    def end() -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise Exit(1)

    with pytest.raises(KeyboardInterrupt), control_c():
        convert(signal.SIGINT)
    with pytest.raises(ValueError, match="a mistake"), control_c():
        convert(None)
    with pytest.raises(Exit), control_c():
        end()


@pytest.mark.usefixtures("restored")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_that_a_library_swallows_is_raised_at_the_end(number: int) -> None:
    done = []

    def command() -> None:
        with control_c():
            try:
                os.kill(os.getpid(), number)
                time.sleep(1.0)
            except BaseException:
                logging.getLogger(__name__).debug("swallowed")
            done.append("the rest")

    with pytest.raises(KeyboardInterrupt):
        command()
    assert done == ["the rest"]


def test_sigterm_ends_a_command_as_control_c_does(scenario: Path) -> None:
    """A job scheduler sends it: one line, exit code 130, nothing written."""
    text = scenario.read_text("utf-8").replace("0.1 s", "20 s")
    scenario.write_text(text, "utf-8")
    words = [sys.executable, "-m", "palpate", "sweep", scenario.name, "--over=object.stiffness=50 N/m..99 N/m:9999"]
    running = subprocess.Popen(words, cwd=scenario.parent, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    file = scenario.parent / "results" / "slider-sweep.h5"
    end = time.monotonic() + 60.0
    while not file.exists() and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(0.1)
    running.send_signal(signal.SIGTERM)
    said = running.communicate(timeout=60)
    assert running.returncode == 130
    assert said[1].splitlines()[-1].startswith("stopped: ")
    assert "Traceback" not in said[0] + said[1]


@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (type("KilledWorker", (Exception,), {})("x"), "several workers died"),
        (CancelledError("x"), "the Dask scheduler no longer answers"),
        (BrokenExecutor("x"), "a worker process died"),
        (ZeroDivisionError("a\nb"), "a worker failed: ZeroDivisionError: a b"),
    ],
)
def test_a_worker_that_dies_is_named(problem: Exception, reason: str) -> None:
    future: Future[dict[str, Any]] = Future()
    future.set_exception(problem)
    with pytest.raises(SweepError, match=f"^{reason}[^\n]*; what is done is kept, and the same command continues$"):
        _result(future)
