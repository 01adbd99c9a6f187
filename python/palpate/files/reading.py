"""Reading of files from unknown sources: regular files only, of bounded size."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from stat import S_ISREG
from typing import Final

from palpate.errors import PalpateError
from palpate.files.output import as_path, finish_folder

HDF5_SIGNATURE: Final = b"\x89HDF\r\n\x1a\n"  # with which every HDF5 file begins
TEXT_LIMIT: Final = 4_000_000  # bytes: larger than any scenario or device; a table of forces may be long


def check_readable(
    path: object, error: type[PalpateError], *, kind: str, otherwise: str = "", limit: int | None = None
) -> Path:
    """Return the path of an existing regular file. Devices and pipes are refused, because reading them may not end.

    Args:
        path: of the file.
        error: exception to raise if there is no file, or a folder.
        kind: description of the file for the message about a folder: "the mesh's file".
        otherwise: remedy for a missing file.
        limit: largest size, bytes; None for any.
    """
    file = as_path(path, error)
    with suppress(OSError):  # the folder of a run that was interrupted while it replaced files
        finish_folder(file.parent)
    try:
        status = file.stat()
    except FileNotFoundError:
        raise error(f"{file}: there is no such file" + (f"; {otherwise}" if otherwise else "")) from None
    except (OSError, ValueError) as problem:  # no permission, a name that is too long or has a null character
        raise error(f"{file}: cannot be read: {getattr(problem, 'strerror', None) or problem}") from None
    if file.is_dir():
        raise error(f"{file}: a folder; give {kind} in it")
    if not S_ISREG(status.st_mode):
        raise error(f"{file}: a device or a pipe; give {kind}, a regular file")
    if limit is not None and status.st_size > limit:
        raise error(f"{file}: {status.st_size / 1e6:.4g} MB; {kind} has at most {limit / 1e6:g} MB")
    return file


def read_bytes(path: object, error: type[PalpateError], *, kind: str, otherwise: str = "", limit: int) -> bytes:
    """Return the content of a file of at most `limit` bytes. Raise as `check_readable`."""
    file = check_readable(path, error, kind=kind, otherwise=otherwise, limit=limit)
    try:
        with file.open("rb") as opened:
            return opened.read(limit)
    except OSError as problem:
        raise error(f"{file}: cannot be read: {problem.strerror}") from None


def read_utf8(
    path: object, error: type[PalpateError], *, kind: str, otherwise: str = "", limit: int = TEXT_LIMIT
) -> str:
    """Return the UTF-8 text of a file. Raise as `check_readable`, and if it is no text."""
    data = read_bytes(path, error, kind=kind, otherwise=otherwise, limit=limit)
    try:
        return data.decode("utf-8").replace("\r\n", "\n")
    except UnicodeDecodeError:
        raise error(f"{os.fspath(path)}: not UTF-8 text; give {kind}") from None  # type: ignore[call-overload]


def begins_with(file: Path, signature: bytes) -> bool:
    """Return whether a regular file begins with these bytes; False if it cannot be read."""
    try:
        if not file.is_file():
            return False
        with file.open("rb") as opened:
            return opened.read(len(signature)) == signature
    except (OSError, ValueError):
        return False
