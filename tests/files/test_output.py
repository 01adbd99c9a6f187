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
from palpate.errors import OutputError, ScenarioError
from palpate.files import atomic_write, check_readable, default_name, output, write_folder, write_json, write_text
from palpate.files.output import Writer, check_suffix, check_writable, finish_folder

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


@pytest.fixture
def flushed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the names of the files and folders that are flushed to the disk from now on, in this order."""
    names: list[str] = []
    real = os.fsync

    def fsync(handle: int) -> None:
        names.append(Path(os.readlink(f"/proc/self/fd/{handle}")).name)
        real(handle)

    monkeypatch.setattr(os, "fsync", fsync)
    return names


def _lowest_handle(folder: Path) -> int:
    handle = os.open(folder, os.O_RDONLY)
    os.close(handle)
    return handle


def test_a_file_is_flushed_before_it_is_renamed_and_its_folder_after(tmp_path: Path, flushed: list[str]) -> None:
    lowest, target = _lowest_handle(tmp_path), tmp_path / "new" / "inner" / "a.txt"
    assert write_text(target, "é") == target
    assert target.read_bytes() == "é".encode()
    part, folder = flushed
    assert part.startswith(".a.txt.")
    assert part.endswith(".part")
    assert len(part) == len(".a.txt.") + 8 + len(".part")
    assert folder == "inner"
    assert write_text(target, "again").read_text() == "again"
    assert [entry.name for entry in target.parent.iterdir()] == ["a.txt"]
    assert _lowest_handle(tmp_path) == lowest


@pytest.mark.parametrize("new", [True, False])
def test_the_files_of_a_folder_are_flushed_before_it_is_committed(
    new: bool, tmp_path: Path, flushed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The names of the committed folder, of the finished one and of a new one are flushed after it."""
    lowest, folder, modes = _lowest_handle(tmp_path), tmp_path / "out", []
    if not new:
        folder.mkdir()
    real = output._commit
    monkeypatch.setattr(
        output, "_commit", lambda part, commit: modes.append(part.stat().st_mode & 0o777) or real(part, commit)
    )
    assert write_folder(folder, _writers("x")) == [folder / name for name in NAMES]
    assert tuple(flushed[:3]) == NAMES
    assert flushed[3].endswith(".part")
    assert flushed[4:] == ["out", "out", *([tmp_path.name] if new else [])]
    (tmp_path / "plain").mkdir()
    assert modes == [(tmp_path / "plain").stat().st_mode & 0o777]  # so that others can complete the renames
    assert _lowest_handle(tmp_path) == lowest
    assert output._umask() == output._umask() == output._UMASK


def test_a_folder_is_made_with_those_around_it(tmp_path: Path) -> None:
    write_folder(tmp_path / "a" / "b" / "c", _writers("x"))
    assert _content(tmp_path / "a" / "b" / "c") == {"x"}


def test_other_files_of_a_folder_stay_unless_only_the_new_ones_are_wanted(tmp_path: Path) -> None:
    (tmp_path / "old.txt").write_text("old")
    (tmp_path / "kept").mkdir()
    write_folder(tmp_path, _writers("x"))
    assert {entry.name for entry in tmp_path.iterdir()} == {*NAMES, "old.txt", "kept"}
    write_folder(tmp_path, _writers("y"), only=True)
    assert {entry.name for entry in tmp_path.iterdir()} == {*NAMES, "kept"}
    assert _content(tmp_path) == {"y"}


def test_a_writer_that_fails_leaves_no_new_folder_and_names_the_file(tmp_path: Path) -> None:
    def fails(part: Path) -> None:
        part.write_text("half")
        raise OutputError(f"{part}: full")

    for folder, there in ((tmp_path / "new", False), (tmp_path, True)):
        with pytest.raises(OutputError) as caught:
            write_folder(folder, {"a": fails})
        assert str(caught.value) == f"{folder / 'a'}: full"
        assert folder.exists() is there
    with pytest.raises(OutputError) as caught:
        atomic_write(tmp_path / "b", fails)
    assert str(caught.value) == f"{tmp_path / 'b'}: full"

    def other(_: Path) -> None:
        raise ScenarioError("another reason")

    with pytest.raises(ScenarioError, match=r"^another reason$"):
        atomic_write(tmp_path / "b", other)
    (tmp_path / "c").mkdir()
    with pytest.raises(OutputError) as caught:
        write_folder(tmp_path, {"c": fails})
    assert str(caught.value) == f"{tmp_path / 'c'}: cannot be written: Is a directory"
    assert [entry.name for entry in tmp_path.iterdir()] == ["c"]


@pytest.mark.parametrize(
    ("problem", "reason"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "No space left on device"),
        (OSError("write failed (error message = 'Disk quota exceeded', buf = 0x1)"), "Disk quota exceeded"),
        (OSError("of a library"), "of a library"),
        (ValueError("embedded null byte"), "a name has no null character in it"),
        (ValueError("embedded null character in path"), "a name has no null character in it"),
        (ValueError("of the caller"), None),
    ],
)
def test_a_failure_of_the_system_is_one_sentence_with_its_reason(
    problem: Exception, reason: str | None, tmp_path: Path
) -> None:
    def fails(_: Path) -> None:
        raise problem

    file = tmp_path / "a"
    with pytest.raises(ValueError, match=r".") as caught:
        atomic_write(file, fails)
    shown = repr(str(file)) if isinstance(problem, ValueError) else str(file)
    assert str(caught.value) == ("of the caller" if reason is None else f"{shown}: cannot be written: {reason}")
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_found_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("x")
    for path in (tmp_path / "new", tmp_path / "a" / "b" / "c", tmp_path / "file"):
        check_writable(path)
        check_writable(str(path))
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]
    refused: list[tuple[object, str]] = [
        (tmp_path, f"{tmp_path}: cannot be written: Is a directory"),
        (
            tmp_path / "file" / "a" / "b",
            f"{tmp_path / 'file' / 'a' / 'b'}: cannot be written: {tmp_path / 'file'} is a file, not a folder",
        ),
        ("a\0b", "a\\x00b: cannot be written: a name has no null character in it"),
        (3, "a file is named by text or a Path, not by 3"),
    ]
    for place, says in refused:
        with pytest.raises(OutputError) as caught:
            check_writable(place)  # type: ignore[arg-type]
        assert str(caught.value) == says
    monkeypatch.setattr(os, "access", lambda _folder, mode: mode != os.W_OK | os.X_OK)
    with pytest.raises(OutputError) as caught:
        check_writable(tmp_path / "a" / "b")
    told = f"{tmp_path / 'a' / 'b'}: cannot be written: no permission to write to the folder {tmp_path}"
    assert str(caught.value) == told


def test_a_reader_finishes_the_folder_of_a_killed_writer_once(
    tmp_path: Path, flushed: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files that another reader renamed meanwhile are no failure."""
    finish_folder(tmp_path)
    assert flushed == []
    commit = tmp_path / ".palpate-commit"
    commit.mkdir()
    (commit / "a").write_text("new")
    (tmp_path / "a").write_text("old")
    finish_folder(tmp_path)
    assert flushed == [tmp_path.name]
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"a": "new"}
    commit.mkdir()
    (commit / "b").write_text("new")
    listed = [commit / "gone", commit / "b"]
    monkeypatch.setattr(Path, "iterdir", lambda _: iter(listed))
    finish_folder(tmp_path)
    assert (tmp_path / "b").read_text() == "new"
    assert not commit.exists()


def test_a_folder_waits_for_the_renames_of_another_writer(tmp_path: Path) -> None:
    commit = tmp_path / ".palpate-commit"
    part = tmp_path / "part"
    for folder, name in ((commit, "first"), (part, "second")):
        folder.mkdir()
        (folder / name).write_text(name)
    output._commit(part, commit)
    assert (tmp_path / "first").read_text() == "first"
    assert [entry.name for entry in commit.iterdir()] == ["second"]
    with pytest.raises(FileNotFoundError):
        output._commit(part, commit)


def test_leftovers_are_removed_through_no_link_and_of_no_living_writer(tmp_path: Path) -> None:
    lowest, kept = _lowest_handle(tmp_path), tmp_path / "kept"
    kept.write_text("x")
    folder, link = tmp_path / ".a.abcdefgh.part", tmp_path / ".a.ABCDEFGH.part"
    folder.mkdir()
    (folder / "inner").write_text("x")
    link.symlink_to(kept)
    alive = tmp_path / ".a.12345678.part"
    handle = os.open(alive, os.O_RDWR | os.O_CREAT)
    try:
        output._lock(handle)
        output._lock(None)
        output._remove_leftovers(tmp_path, "a")
    finally:
        os.close(handle)
    assert {entry.name for entry in tmp_path.iterdir()} == {"kept", link.name, alive.name}
    output._remove_leftovers(tmp_path, "a")
    assert {entry.name for entry in tmp_path.iterdir()} == {"kept", link.name}
    assert _lowest_handle(tmp_path) == lowest
    output._remove_leftovers(tmp_path / "missing", "a")


def test_without_locks_no_leftover_is_touched_and_files_are_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As on Windows, where a part may be that of a living writer."""
    monkeypatch.setattr(output, "fcntl", None)
    (tmp_path / ".a.abcdefgh.part").write_text("x")
    write_text(tmp_path / "a", "1")
    write_folder(tmp_path, {"b": lambda part: part.write_text("2")})
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        ".a.abcdefgh.part": "x",
        "a": "1",
        "b": "2",
    }


def test_json_is_written_with_its_letters_and_refuses_what_json_has_not(tmp_path: Path) -> None:
    path = write_json(tmp_path / "a.json", {"é": [1.5, None, True]})
    assert path.read_text("utf-8") == '{\n "é": [\n  1.5,\n  null,\n  true\n ]\n}\n'
    assert write_json(path, [1], None).read_text() == "[1]\n"
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(path, [float("nan")])
    assert path.read_text() == "[1]\n"
