"""Atomic file output, and lines of keys in TOML files."""

from __future__ import annotations

import json
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from errno import EACCES, EINVAL, EISDIR, ENOTDIR
from os import strerror
from pathlib import Path
from typing import Final

from palpate.errors import OutputError, PalpateError

HDF5_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"  # with which every HDF5 file begins
_HEADER: Final = re.compile(r"\s*\[\[?\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY: Final = re.compile(r"""\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=""")
Writer = Callable[[Path], object]


def as_path(path: object, error: type[PalpateError]) -> Path:
    """Return a file name as a path. Raise `error` unless it is text or a Path."""
    if not isinstance(path, str | os.PathLike):
        raise error(f"a file is named by text or a Path, not by {path!r}")
    return Path(path)


def atomic_write(path: str | os.PathLike[str], write: Writer) -> Path:
    """Let `write` fill a temporary file, then rename it to `path`; delete it after a failure.

    Raises:
        OutputError: the folder cannot be written, the disk is full, or a folder has that name.
    """
    target = as_path(path, OutputError)
    with _translate_os_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        os.close(handle)
        part = Path(name)
        try:
            write(part)
            part.chmod(0o666 & ~_umask())
            part.replace(target)
        except BaseException:
            with suppress(OSError):
                part.unlink()
            raise
    return target


def check_suffix(path: object, suffixes: Sequence[str], what: str, error: type[PalpateError] = OutputError) -> Path:
    """Return the path of `what`. Raise `error` unless it has one of the suffixes."""
    file = as_path(path, error)
    if file.suffix.lower() not in suffixes:
        raise error(f"{file}: {what} is saved as {' or '.join(suffixes)}, not as {file.suffix!r}")
    return file


def write_json(path: str | os.PathLike[str], value: object, indent: int | None = 1) -> Path:
    """Write `value` as JSON, atomically.

    Raises:
        OutputError: as `atomic_write`.
        ValueError: a number is not finite.
    """
    text = json.dumps(value, indent=indent, allow_nan=False) + "\n"
    return atomic_write(path, lambda part: part.write_text(text, "utf-8"))


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


def check_readable(path: str | os.PathLike[str], error: type[PalpateError], *, kind: str, otherwise: str = "") -> Path:
    """Return the path of an existing file.

    Args:
        path: of the file.
        error: exception to raise if there is no file, or a folder.
        kind: description of the file for the message about a folder: "the mesh's file".
        otherwise: remedy for a missing file.
    """
    file = as_path(path, error)
    try:
        folder, there = file.is_dir(), file.is_file()
    except OSError as problem:  # a name that is too long
        raise error(f"{file}: cannot be read: {problem.strerror}") from None
    if folder:
        raise error(f"{file}: a folder; give {kind} in it")
    if not there:
        raise error(f"{file}: there is no such file" + (f"; {otherwise}" if otherwise else ""))
    return file


def write_folder(folder: str | Path, writers: Mapping[str, Writer]) -> list[Path]:
    """Write several files into a folder, all or none; return their paths.

    Args:
        folder: created if missing; other files in it remain.
        writers: function of a path that writes the file, by file name.

    Raises:
        OutputError: the folder cannot be written, the disk is full, or it is a file.
    """
    target = as_path(folder, OutputError)
    with _translate_os_errors(target):
        target.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent))
        try:
            for name, write in writers.items():
                try:
                    write(part / name)
                except OutputError as problem:  # it names the temporary folder
                    raise OutputError(str(problem).replace(str(part), str(target))) from problem
            target.mkdir(exist_ok=True)
            for name in writers:
                os.replace(part / name, target / name)
        finally:
            shutil.rmtree(part, ignore_errors=True)
    return [target / name for name in writers]


def find_line(text: str, field: Sequence[str | int]) -> int | None:
    """Return the line, from 1, of a field such as ("object", "stiffness") in TOML text.

    For a missing field it is the line of the innermost table around it, or None.
    """
    wanted = tuple(part for part in field if isinstance(part, str))
    best: tuple[int, int] | None = None  # length of the match, line
    table: tuple[str, ...] = ()
    depth, fence = 0, ""  # nesting of brackets over lines; open triple quotes
    for number, line in enumerate(text.splitlines(), start=1):
        here: tuple[str, ...] | None = None
        if depth == 0 and not fence:
            if header := _HEADER.match(line):
                here = table = _parts(header[1])
            elif key := _KEY.match(line):
                here = (*table, *_parts(key[1]))
        if here is not None:
            # A field of an inline table is on the line of the table.
            matched = len(here) if here == wanted[: len(here)] else 0
            if matched and (best is None or matched > best[0]):
                best = (matched, number)
        depth, fence = _nesting(line, depth, fence)
    return best[1] if best else None


def _parts(dotted: str) -> tuple[str, ...]:
    return tuple(part.strip().strip("\"'") for part in dotted.split("."))


def _nesting(line: str, depth: int, fence: str) -> tuple[int, str]:
    """Return bracket depth and open triple quote after a line."""
    if _HEADER.match(line) and depth == 0 and not fence:
        return 0, ""
    quote, at = "", 0
    while at < len(line):
        three, char = line[at : at + 3], line[at]
        if fence:
            if three == fence:
                fence, at = "", at + 2
        elif quote:
            if char == "\\" and quote == '"':
                at += 1
            elif char == quote:
                quote = ""
        elif three in ('"""', "'''"):
            fence, at = three, at + 2
        elif char in "\"'":
            quote = char
        elif char == "#":
            break
        elif char in "[{":
            depth += 1
        elif char in "]}":
            depth = max(0, depth - 1)
        at += 1
    return depth, fence


@contextmanager
def _translate_os_errors(target: Path) -> Iterator[None]:
    """Translate errors of the operating system to OutputError with one sentence."""
    try:
        yield
    except OSError as problem:
        # HDF5 gives the reason within a long line
        match = re.search(r"error message = '([^']+)'", str(problem))
        reason = problem.strerror or (match[1] if match else str(problem))
        raise OutputError(f"{target}: cannot be written: {reason}") from problem


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
