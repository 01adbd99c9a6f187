"""Output: a file or folder changes as a whole or not at all, whatever interrupts it."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from palpate.errors import OutputError
from palpate.files import atomic_write, check_readable, default_name, write_folder, write_text
from palpate.files.output import Writer, check_suffix

NAMES = ("trace.h5", "summary.json", "report.html")


def _writers(text: str) -> dict[str, Writer]:
    return {name: lambda path: path.write_text(text) for name in NAMES}


def _content(folder: Path) -> set[str]:
    return {(folder / name).read_text() for name in NAMES}


def _refused(folder: Path) -> str | None:
    """Write new files; return the sentence of the failure, if any."""
    try:
        write_folder(folder, _writers("new"))
    except OutputError as problem:
        return str(problem)
    return None


class _FailError(Exception):
    pass


@pytest.fixture
def fail_at(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[int, Exception], list[str]]]:
    """Return a function that lets the n-th call of the system that changes a disk raise an exception."""
    real = {name: getattr(os, name) for name in ("open", "fsync", "rename", "replace", "mkdir")}

    def arm(number: int, problem: Exception) -> list[str]:
        calls: list[str] = []
        for name, function in real.items():

            def call(
                *args: object, _name: str = name, _function: Callable[..., object] = function, **kw: object
            ) -> object:
                calls.append(_name)
                if len(calls) == number:
                    raise problem
                return _function(*args, **kw)

            monkeypatch.setattr(os, name, call)
        return calls

    yield arm
    monkeypatch.undo()


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_folder_whose_nth_call_fails_is_old_or_new(
    tmp_path: Path, fail_at: Callable[[int, Exception], list[str]], number: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After the next writing it is new, and there is no other file."""
    folder, calls, n = tmp_path / "out", [], 0
    while n <= len(calls):
        n += 1
        monkeypatch.undo()
        write_folder(folder, _writers("old"))
        calls = fail_at(n, OSError(number, os.strerror(number)))
        sentence = _refused(folder)
        assert sentence is None or (os.strerror(number) in sentence and "\n" not in sentence)
        monkeypatch.undo()
        check_readable(folder / "trace.h5", OutputError, kind="a trace")  # completes the renames
        assert len(_content(folder)) == 1
    assert n > 15
    write_folder(folder, _writers("newer"))
    assert _content(folder) == {"newer"}
    assert sorted(entry.name for entry in folder.iterdir()) == sorted(NAMES)


def test_a_folder_killed_at_any_call_is_old_or_new_after_the_next_reading(
    tmp_path: Path, fail_at: Callable[[int, Exception], list[str]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No code runs after a kill: the removal of temporary files is skipped as well."""
    folder, calls, n = tmp_path / "out", [], 0
    while n <= len(calls):
        n += 1
        monkeypatch.undo()
        write_folder(folder, _writers("old"))
        calls = fail_at(n, _FailError())
        monkeypatch.setattr("palpate.files.output.shutil.rmtree", lambda *_args, **_kw: None)
        with suppress(_FailError):
            write_folder(folder, _writers("new"))
        monkeypatch.undo()
        check_readable(folder / "trace.h5", OutputError, kind="a trace")
        assert len(_content(folder)) == 1
    assert n > 15
    write_folder(folder, _writers("newer"))
    assert sorted(entry.name for entry in folder.iterdir()) == sorted(NAMES)


def test_the_next_writer_removes_the_files_of_dead_writers_only(tmp_path: Path) -> None:
    target = tmp_path / "a.json"
    stale = [tmp_path / ".a.json.abcdefgh.part", tmp_path / ".a.json.ABCDEFGH.part"]
    others = [tmp_path / ".b.json.abcdefgh.part", tmp_path / "mine.part", tmp_path / ".a.json.part"]
    for file in (*stale, *others):
        file.write_text("x")

    def write(part: Path) -> None:
        write_text(target, "inner")  # another writer of the same file meanwhile
        part.write_text("outer")

    atomic_write(target, write)
    assert target.read_text() == "outer"
    assert not any(file.exists() for file in stale)
    assert all(file.exists() for file in others)


def test_a_killed_writer_leaves_what_the_next_one_removes(tmp_path: Path) -> None:
    for write in ("write_folder('out', {'a': kill})", "atomic_write('out/a', kill)"):
        code = (
            "import os, signal\nfrom palpate.files import atomic_write, write_folder\n"
            f"def kill(part): part.write_text('x'); os.kill(os.getpid(), signal.SIGKILL)\n{write}"
        )
        assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False).returncode < 0
    assert len(list((tmp_path / "out").iterdir())) == 2
    write_folder(tmp_path / "out", {"a": lambda path: write_text(path, "x")})
    write_text(tmp_path / "out" / "a", "x")
    assert [entry.name for entry in (tmp_path / "out").iterdir()] == ["a"]


def test_a_file_has_the_permissions_of_a_new_file(tmp_path: Path) -> None:
    (tmp_path / "plain").write_text("x")
    write_text(tmp_path / "own", "x")
    assert (tmp_path / "own").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("name", ["...toml", "..", "/", "", ".toml", "a/...toml", " .toml"])
def test_results_never_leave_the_results_folder(name: str) -> None:
    with pytest.raises(OutputError, match="name them with --out"):
        default_name(name)
    assert default_name("scenarios/press.v2.toml") == "press.v2"


@pytest.mark.parametrize("name", ["page.html", "PAGE.HTML", "page.htm"])
def test_a_suffix_is_one_of_those_that_are_written(name: str) -> None:
    assert check_suffix(name, (".html", ".htm"), "a page") == Path(name)
    with pytest.raises(OutputError, match=r"page\.\w+: a table is saved as \.json or \.csv, not as '\.html?'"):
        check_suffix(name.lower(), (".json", ".csv"), "a table")


def test_two_writers_of_a_folder_leave_each_other_alone(tmp_path: Path) -> None:
    """The second one begins and ends while the first one writes: both files are there, and nothing else."""

    def slow(part: Path) -> None:
        write_folder(tmp_path, {"second": lambda file: file.write_text("2")})
        part.write_text("1")

    write_folder(tmp_path, {"first": slow})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"first": "1", "second": "2"}
