"""Atomic output of files and folders.

A file is written under a temporary name in its folder, flushed to the disk and renamed. The files of a folder are
written to a temporary folder within it, which is renamed to a commit folder; then each file is renamed to its place. A
process that is killed in between leaves the commit folder, and the next reader or writer completes the renames.

A temporary name is locked while its process lives, so the next writer of the same file removes those of dead processes.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from errno import EACCES, EINVAL, EISDIR, ENOTDIR, ENOTEMPTY
from os import strerror
from pathlib import Path
from typing import Final

from palpate.errors import OutputError, PalpateError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

Writer = Callable[[Path], object]
_COMMIT: Final = ".palpate-commit"
_PART: Final = ".part"
_RANDOM: Final = 8  # characters of a temporary name that tempfile draws


def as_path(path: object, error: type[PalpateError]) -> Path:
    """Return a file name as a path. Raise `error` unless it is text or a Path."""
    if not isinstance(path, str | os.PathLike):
        raise error(f"a file is named by text or a Path, not by {path!r}")
    return Path(path)


def default_name(source: str | os.PathLike[str]) -> str:
    """Return the name of the results of a file: its own name without the suffix.

    Raises:
        OutputError: the name stands for another folder ("..").
    """
    name = Path(source).name.removesuffix(".toml")
    if name.strip(". ") == "":
        raise OutputError(f"{os.fspath(source)!r}: the name gives no name for its results; name them with --out")
    return name


def atomic_write(path: str | os.PathLike[str], write: Writer) -> Path:
    """Let `write` fill a temporary file, flush it to the disk and rename it to `path`; delete it after a failure.

    Raises:
        OutputError: the folder cannot be written, the disk is full, or a folder has that name.
    """
    target = as_path(path, OutputError)
    with _translate_os_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(target.parent, target.name)
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=_PART, dir=target.parent)
        part = Path(name)
        try:
            _lock(handle)
            _write_named(write, part, target)
            part.chmod(0o666 & ~_UMASK)
            _sync(part)
            part.replace(target)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise
        finally:
            os.close(handle)
        _sync_folder(target.parent)
    return target


def check_suffix(path: object, suffixes: Sequence[str], what: str, error: type[PalpateError] = OutputError) -> Path:
    """Return the path of `what`. Raise `error` unless it has one of the suffixes."""
    file = as_path(path, error)
    if file.suffix.lower() not in suffixes:
        raise error(f"{file}: {what} is saved as {' or '.join(suffixes)}, not as {file.suffix!r}")
    return file


def write_text(path: str | os.PathLike[str], text: str) -> Path:
    """Write `text` as UTF-8, atomically. Raise as `atomic_write`."""
    return atomic_write(path, lambda part: part.write_text(text, "utf-8"))


def write_json(path: str | os.PathLike[str], value: object, indent: int | None = 1) -> Path:
    """Write `value` as JSON, atomically.

    Raises:
        OutputError: as `atomic_write`.
        ValueError: a number is not finite.
    """
    return write_text(path, json.dumps(value, indent=indent, ensure_ascii=False, allow_nan=False) + "\n")


def check_writable(path: str | Path) -> None:
    """Check before a long computation that `atomic_write` can write a file.

    Raises:
        OutputError: a folder has that name, or its folder is a file or cannot be written.
    """
    target = as_path(path, OutputError)
    with _translate_os_errors(target):
        if "\0" in str(target):
            raise OSError(EINVAL, "a name has no null character in it")
        if target.is_dir():
            raise IsADirectoryError(EISDIR, strerror(EISDIR))
        there = next(folder for folder in target.absolute().parents if folder.exists())
        if not there.is_dir():
            raise NotADirectoryError(ENOTDIR, f"{there} is a file, not a folder")
        if not os.access(there, os.W_OK | os.X_OK):
            raise PermissionError(EACCES, f"no permission to write to the folder {there}")
        with tempfile.TemporaryFile(dir=there):  # some folders allow writing, but hold no files: /proc
            pass


def write_folder(folder: str | Path, writers: Mapping[str, Writer], *, only: bool = False) -> list[Path]:
    """Write several files into a folder, all or none; return their paths.

    Args:
        folder: created if missing.
        writers: function of a path that writes the file, by file name.
        only: whether to remove other files of the folder; otherwise they remain.

    Raises:
        OutputError: the folder cannot be written, the disk is full, or it is a file.
    """
    target = as_path(folder, OutputError)
    with _translate_os_errors(target):
        new = not target.exists()
        target.mkdir(parents=True, exist_ok=True)
        try:
            _write_into(target, writers)
        except BaseException:
            if new:
                with suppress(OSError):
                    target.rmdir()
            raise
        if only:
            for entry in target.iterdir():
                if entry.name not in writers and entry.is_file():
                    entry.unlink()
        if new:
            _sync_folder(target.parent)
    return [target / name for name in writers]


def finish_folder(folder: Path) -> None:
    """Complete the renames of a writer of the folder that was killed during them. Raise OSError if that fails."""
    commit = folder / _COMMIT
    if not commit.is_dir():
        return
    for entry in list(commit.iterdir()):
        with suppress(FileNotFoundError):  # another process renamed it
            entry.replace(folder / entry.name)
    _sync_folder(folder)
    with suppress(FileNotFoundError):
        commit.rmdir()


def _write_into(target: Path, writers: Mapping[str, Writer]) -> None:
    finish_folder(target)
    _remove_leftovers(target, "")
    part = Path(tempfile.mkdtemp(prefix="..", suffix=_PART, dir=target))
    handle = os.open(part, os.O_RDONLY) if fcntl is not None else None
    try:
        _lock(handle)
        for name, write in writers.items():
            if (target / name).is_dir():
                raise OutputError(f"{target / name}: cannot be written: {strerror(EISDIR)}")
            _write_named(write, part / name, target / name)
            _sync(part / name)
        part.chmod(0o777 & ~_UMASK)
        _sync_folder(part)
        _commit(part, target / _COMMIT)
        finish_folder(target)
    finally:
        if handle is not None:
            os.close(handle)
        shutil.rmtree(part, ignore_errors=True)


def _write_named(write: Writer, part: Path, target: Path) -> None:
    """Let `write` fill a temporary file; an error names the target in its place."""
    try:
        write(part)
    except PalpateError as problem:
        if str(part) not in str(problem):
            raise
        raise type(problem)(str(problem).replace(str(part), str(target))) from problem


def _commit(part: Path, commit: Path) -> None:
    """Rename the temporary folder to the commit folder, once that of another process is empty."""
    while True:
        try:
            part.rename(commit)
        except OSError as problem:
            if problem.errno != ENOTEMPTY:
                raise
            finish_folder(commit.parent)
        else:
            _sync_folder(commit.parent)
            return


def _remove_leftovers(folder: Path, name: str) -> None:
    """Remove the temporary files and folders of processes that were killed while they wrote `name`."""
    if fcntl is None:
        return
    begin, length = f".{name}.", len(name) + 2 + _RANDOM + len(_PART)
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if len(entry.name) == length and entry.name.startswith(begin) and entry.name.endswith(_PART):
                with suppress(OSError):
                    _remove_unlocked(Path(entry.path))


def _remove_unlocked(part: Path) -> None:
    """Remove a file or folder unless its writer holds the lock."""
    handle = os.open(part, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if part.is_dir():
            shutil.rmtree(part, ignore_errors=True)
        else:
            part.unlink()
    finally:
        os.close(handle)


def _lock(handle: int | None) -> None:
    """Lock an open file or folder until it is closed, where the file system has locks."""
    if handle is not None and fcntl is not None:
        with suppress(OSError):
            fcntl.flock(handle, fcntl.LOCK_SH)


def _sync(file: Path) -> None:
    """Flush a file to the disk."""
    handle = os.open(file, os.O_RDWR)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _sync_folder(folder: Path) -> None:
    """Flush the names in a folder to the disk, where the file system can."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


@contextmanager
def _translate_os_errors(target: Path) -> Iterator[None]:
    """Translate errors of the operating system to OutputError with one sentence."""
    try:
        yield
    except OSError as problem:
        # libraries give the reason within a long line
        match = re.search(r"error message = '([^']+)'", str(problem))
        reason = problem.strerror or (match[1] if match else str(problem))
        raise OutputError(f"{target}: cannot be written: {reason}") from problem
    except ValueError as problem:
        if "null byte" not in str(problem) and "null character" not in str(problem):
            raise
        raise OutputError(f"{str(target)!r}: cannot be written: a name has no null character in it") from problem


def _umask() -> int:
    """Return the permissions that new files lack; read once, while no other thread makes files."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


_UMASK: Final = _umask()
