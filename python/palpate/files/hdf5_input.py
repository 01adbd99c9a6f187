"""Reading of HDF5 files from unknown sources.

The files of palpate end with a seal (see `hdf5_output`), which is checked before HDF5 parses a byte, so a damaged file
never reaches HDF5. A seal can be forged, and other programs write none. Every file that this process did not write is
therefore read once by a process with limits of time and memory first.

A file is an untrusted description of data. Each object is reached by hard links within the file; it is a data set of
numbers of an expected type, its size is bounded by that of the file, and neither external storage nor virtual data
sets nor filters from plugins are used.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Final, NamedTuple, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from palpate.errors import PalpateError, shorten
from palpate.files.hdf5_output import SEAL, SEAL_LIMIT, Range, digest, known_digests
from palpate.files.isolated import IsolatedError, try_isolated
from palpate.files.reading import HDF5_SIGNATURE, begins_with, check_readable

_EXPANSION: Final = 256  # bytes of data per byte of the file; channels that are always zero compress well
_ALWAYS: Final = 1 << 24  # bytes of data that any file may hold
_MOST_NAMES: Final = 1000  # of a group
_TEXT_LIMIT: Final = 16_000_000  # bytes
_FILTERS: Final = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
_SEAL: Final = re.compile(re.escape(SEAL) + rb"([0-9a-f]{64}) (-|\d{1,18}\+\d{1,18}(?:,\d{1,18}\+\d{1,18})*)\n\Z")
_SECONDS: Final = 4  # of computing by the process that reads a file first
_SPEED: Final = 50_000_000  # bytes of the file for which that process has a second more
_MEMORY: Final = 1_000_000_000  # bytes of that process


class Sealed(NamedTuple):
    """Sealed content of a file."""

    digest: str  # "" for a file without a seal
    later: tuple[Range, ...]  # ranges that the digest leaves out


class Hdf5Reader:
    """Open HDF5 file; a context manager that closes it. Every failure raises `error` with the name of the file."""

    def __init__(
        self, path: Path, error: type[PalpateError], what: str, remedy: str = "", later: tuple[Range, ...] = ()
    ) -> None:
        """Open a file.

        Args:
            path: of the file.
            error: exception to raise.
            what: the kind of file, for messages: "trace".
            remedy: end of the messages, such as "build it again".
            later: ranges that the digest of the file leaves out.
        """
        self.path, self.later = path, later
        self.broken = ""  # last failure of HDF5
        self._error, self._what, self._remedy = error, what, remedy
        self._left = _ALWAYS + _EXPANSION * path.stat().st_size
        with self._guard():
            try:
                self._file = h5py.File(path, "r", locking=False)
            except OSError as problem:
                if "locking" not in str(problem):
                    raise
                self._file = h5py.File(path, "r")  # the caller has it open with locks

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, at: TracebackType | None) -> None:
        with self._guard():
            self._file.close()

    def fail(self, reason: str) -> PalpateError:
        """Return the error for a reason."""
        remedy = f"; {self._remedy}" if self._remedy else ""
        return self._error(f"{self.path}: not a complete {self._what}: {shorten(reason, 300)}{remedy}")

    def names(self, group: str = "/", *, optional: bool = False) -> list[str]:
        """Return the names in a group; none if it is missing and `optional`."""
        with self._guard():
            found = self._object(group)
            if found is None and optional:
                return []
            if not isinstance(found, h5py.Group):
                raise self.fail(f"{group} is {'missing' if found is None else 'no group'}")
            if len(found) > _MOST_NAMES:
                raise self.fail(f"{group} has {len(found)} entries")
            return [str(name) for name in found]

    def has(self, name: str) -> bool:
        """Return whether there is a data set of that name."""
        with self._guard():
            return isinstance(self._object(name), h5py.Dataset)

    def array(self, name: str, kinds: str = "biuf", ndim: int | None = None) -> NDArray[Any]:
        """Return the numbers of a data set.

        Args:
            name: path in the file.
            kinds: allowed kinds of the type, as of `numpy.dtype.kind`.
            ndim: number of dimensions; None for any except a scalar.
        """
        with self._guard():
            data = self._data(name)
            if data.dtype.kind not in kinds or data.dtype.itemsize > 8:
                raise self.fail(f"{name} has the type {data.dtype}")
            if data.shape is None or data.ndim == 0 or (ndim is not None and data.ndim != ndim):
                raise self.fail(f"{name} has the shape {data.shape}")
            return np.asarray(data[()])

    def place(self, name: str, kind: str) -> Range:
        """Return where the values of a contiguous data set of a numpy type lie in the file."""
        with self._guard():
            data = self._data(name)
            begin, size = data.id.get_offset(), data.id.get_storage_size()
            if begin is None or data.dtype != np.dtype(kind) or size != data.size * data.dtype.itemsize:
                raise self.fail(f"{name} is not contiguous, or not of the type {kind}")
            return int(begin), int(size)

    def text(self, name: str) -> str:
        """Return the text of a scalar data set."""
        with self._guard():
            data = self._data(name)
            if h5py.check_string_dtype(data.dtype) is None or data.shape != ():
                raise self.fail(f"{name} is no text")
            return str(data[()].decode("utf-8"))

    def text_attribute(self, key: str, of: str = "/", default: str | None = None) -> str:
        """Return a text attribute of an object; `default` if it is missing."""
        value = self._attribute(key, of, default)
        value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        if not isinstance(value, str):
            raise self.fail(f"the attribute {key} of {of} is no text")
        return value

    def number_attribute(self, key: str, of: str = "/", default: float | None = None) -> float:
        """Return a number attribute of an object; `default` if it is missing."""
        value = self._attribute(key, of, default)
        if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.integer, np.floating)):
            raise self.fail(f"the attribute {key} of {of} is no number")
        return float(value)

    def _attribute(self, key: str, of: str, default: object) -> object:
        with self._guard():
            found = self._object(of)
            if found is None:
                raise self.fail(f"{of} is missing")
            if key not in found.attrs:
                if default is None:
                    raise self.fail(f"the attribute {key} of {of} is missing")
                return default
            attribute = found.attrs.get_id(key)
            if attribute.shape != () or attribute.get_storage_size() > _TEXT_LIMIT:
                raise self.fail(f"the attribute {key} of {of} has the shape {attribute.shape}")
            return found.attrs[key]

    def _data(self, name: str) -> Any:
        """Return a data set that can be read within the limits."""
        data = self._object(name)
        if not isinstance(data, h5py.Dataset):
            raise self.fail(f"{name} is missing" if data is None else f"{name} is no data set")
        if data.external is not None or data.is_virtual:
            raise self.fail(f"{name} lies in another file")
        properties = data.id.get_create_plist()
        filters = [properties.get_filter(i)[0] for i in range(properties.get_nfilters())]
        if len(set(filters)) < len(filters) or not set(filters) <= _FILTERS:
            raise self.fail(f"{name} is compressed in an unknown way")
        size = (data.size or 0) * data.dtype.itemsize
        chunk = int(np.prod(data.chunks, dtype=object)) * data.dtype.itemsize if data.chunks else 0
        stored = data.id.get_storage_size()
        if size > stored and not filters:
            raise self.fail(f"{name} declares {size} bytes and has {stored}")
        self._left -= max(size, chunk)
        if self._left < 0:
            raise self.fail(f"{name} declares {size} bytes, far more than the file has")
        return data

    def _object(self, name: str) -> Any:
        """Return an object reached by hard links only; None if there is none."""
        here: Any = self._file
        for part in name.strip("/").split("/") if name.strip("/") else ():
            if not isinstance(here, h5py.Group):
                return None
            link = here.get(part, getlink=True)
            if link is None:
                return None
            if not isinstance(link, h5py.HardLink):
                raise self.fail(f"{name} is a link to another place")
            here = here[part]
        return here

    @contextmanager
    def _guard(self) -> Iterator[None]:
        """Translate every exception of h5py, which raises any on a damaged file."""
        try:
            yield
        except PalpateError:
            raise
        except Exception as problem:
            reason = " ".join(str(problem).split()) or type(problem).__name__
            if isinstance(problem, MemoryError | OSError | RuntimeError | KeyError):
                self.broken = reason
            raise self.fail(reason) from None


def check_hdf5(path: object, error: type[PalpateError], what: str, otherwise: str = "") -> Path:
    """Return the path of an HDF5 file. Raise `error` if there is none, or it is not HDF5.

    Args:
        path: of the file.
        error: exception to raise.
        what: the kind of file, for messages: "trace".
        otherwise: remedy for a missing file.
    """
    file = check_readable(path, error, kind=f"the {what}'s file (.h5)", otherwise=otherwise)
    if not begins_with(file, HDF5_SIGNATURE):
        empty = file.stat().st_size == 0
        raise error(f"{file}: {'an empty file' if empty else 'not an HDF5 file'}, so not a {what}")
    return file


def read_seal(path: Path, error: type[PalpateError], what: str, remedy: str = "") -> Sealed:
    """Return the seal of a file of palpate. Raise `error` if its content was changed or cut short."""
    try:
        found = _find_seal(path)
    except OSError as problem:
        raise error(f"{path}: cannot be read: {problem.strerror}") from None
    if isinstance(found, Sealed):
        return found
    raise error(f"{path}: not a complete {what}: {found}{f'; {remedy}' if remedy else ''}")


def _find_seal(path: Path) -> Sealed | str:
    """Return the seal of a file, or why it has none. Raise OSError."""
    handle = os.open(path, os.O_RDONLY)
    try:
        begin = max(0, os.fstat(handle).st_size - SEAL_LIMIT)
        match = _SEAL.search(os.pread(handle, SEAL_LIMIT, begin))
        if match is None:
            return "no checksum at its end: truncated, changed by another program, or of another version"
        content = begin + match.start()
        pairs = [] if match[2] == b"-" else [pair.partition(b"+") for pair in match[2].split(b",")]
        later = tuple((int(offset), int(length)) for offset, _, length in pairs)
        same = digest(handle, content, later) == match[1].decode()
        return Sealed(match[1].decode(), later) if same else "it is damaged: its content differs from its checksum"
    finally:
        os.close(handle)


def open_sealed(path: Path, error: type[PalpateError], what: str, remedy: str = "") -> Hdf5Reader:
    """Return the reader of a file of palpate. Raise as `read_seal`, and if HDF5 cannot read it."""
    return _open(path, error, what, remedy, read_seal(path, error, what, remedy))


def open_foreign(path: Path, error: type[PalpateError], what: str) -> Hdf5Reader:
    """Return the reader of a file of any program. Raise `error` if HDF5 cannot read it."""
    try:
        sealed = read_seal(path, error, what)
    except error:
        sealed = Sealed("", ())
    return _open(path, error, what, "", sealed)


def _open(path: Path, error: type[PalpateError], what: str, remedy: str, sealed: Sealed) -> Hdf5Reader:
    if sealed.digest not in known_digests:
        _try_in_process(path, error, what)
        if sealed.digest and not sealed.later:
            known_digests.add(sealed.digest)
    return Hdf5Reader(path, error, what, remedy, sealed.later)


_PROGRAM: Final = """
import sys
from pathlib import Path
from palpate.files.hdf5_input import read_everything

sys.exit(read_everything(Path(sys.argv[1])) or 0)
"""


def _try_in_process(path: Path, error: type[PalpateError], what: str) -> None:
    """Read everything in a process with limits. Raise `error` if it crashes, takes too long or too much memory."""
    size = path.stat().st_size
    try:
        try_isolated(_PROGRAM, str(path.absolute()), seconds=_SECONDS + size // _SPEED, memory=_MEMORY + 8 * size)
    except IsolatedError as problem:
        raise error(f"{path}: not a {what} that HDF5 can read: {problem}") from None


def read_everything(path: Path) -> str:
    """Read all that `Hdf5Reader` may read of a file; return a failure of HDF5, or ""."""
    try:
        opened = Hdf5Reader(path, PalpateError, "file")
    except PalpateError as problem:
        return str(problem).removeprefix(f"{path}: not a complete file: ")
    with opened as reader:
        limit = reader._left
        for key in ("format", "version", "record", "sweep", "metadata", "period", "unstable_from"):
            with suppress(PalpateError):
                reader.text_attribute(key)
        groups = ["/"]
        for group in groups:
            for name in _names(reader, group):
                place = f"{group}{name}"
                groups += [f"{place}/"] if group == "/" else []
                for read in _READS:
                    reader._left = limit
                    with suppress(PalpateError):
                        read(reader, place)
        return reader.broken


_READS: Final[tuple[Callable[[Hdf5Reader, str], object], ...]] = (
    Hdf5Reader.array,
    Hdf5Reader.text,
    lambda reader, place: reader.place(place, "<f8"),
    *(
        partial(lambda reader, place, key: reader.text_attribute(key, place), key=key)
        for key in ("unit", "units", "description")
    ),
)


def _names(reader: Hdf5Reader, group: str) -> list[str]:
    try:
        return reader.names(group)
    except PalpateError:
        return []
