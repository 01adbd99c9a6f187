"""Output of HDF5 files that a full disk cannot break, sealed by a digest at their end.

HDF5 loses its internal state when the system refuses a write, and may crash the process afterwards. It therefore
writes to a `_Sink`, which accepts every write, keeps the first error of the system, and raises it after HDF5 has closed
the file.

The seal is a line of text behind the end of the HDF5 data, which other programs ignore. It holds a SHA-256 digest of
all bytes outside the ranges that are written later, such as the cells of a sweep.
"""

from __future__ import annotations

import hashlib
import io
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from palpate.files.output import atomic_write

if TYPE_CHECKING:
    from collections.abc import Buffer  # type: ignore[attr-defined,unused-ignore]

Range = tuple[int, int]  # offset and size, bytes
Fill = Callable[[Any], "Sequence[Range] | None"]  # of an h5py.File; returns the ranges that are written later
SEAL: Final = b"\npalpate seal sha256 "
SEAL_LIMIT: Final = 4096  # bytes of a seal
_BLOCK: Final = 1 << 20
known_digests: Final[set[str]] = set()  # of the files that this process wrote, or that HDF5 has read without failure


def write_hdf5(path: str | os.PathLike[str], fill: Fill, *, reserve: int = 0) -> Path:
    """Let `fill` write an HDF5 file, seal it and rename it to `path`.

    Args:
        path: of the file.
        fill: writes into the open `h5py.File`; returns ranges that the digest leaves out, or None.
        reserve: space to allocate on the disk first, bytes.

    Raises:
        OutputError: as `atomic_write`.
    """

    def write(part: Path) -> None:
        handle = os.open(part, os.O_RDWR)
        try:
            if reserve and hasattr(os, "posix_fallocate"):
                os.posix_fallocate(handle, 0, reserve)
            later = _write_through_sink(handle, fill)
            line = seal(handle, later)
            known_digests.add(line.split()[3].decode())
            write_at(handle, os.fstat(handle).st_size, line)
        finally:
            os.close(handle)

    return atomic_write(path, write)


def write_at(handle: int, offset: int, data: Buffer) -> None:
    """Write all bytes of `data` at `offset` of an open file. Raise OSError."""
    rest = memoryview(data).cast("B")
    while rest:
        written = os.pwrite(handle, rest, offset)
        offset, rest = offset + written, rest[written:]


def seal(handle: int, later: Sequence[Range]) -> bytes:
    """Return the seal of the content of an open file."""
    ranges = ",".join(f"{offset}+{size}" for offset, size in later) or "-"
    return SEAL + f"{digest(handle, os.fstat(handle).st_size, later)} {ranges}\n".encode()


def digest(handle: int, size: int, later: Sequence[Range]) -> str:
    """Return the digest of the first `size` bytes of an open file outside the ranges."""
    state = hashlib.sha256(repr((size, list(later))).encode())
    at = 0
    for offset, length in [*sorted(later), (size, 0)]:
        while at < offset:
            block = os.pread(handle, min(_BLOCK, offset - at), at)
            if not block:
                return ""
            state.update(block)
            at += len(block)
        at = max(at, offset + length)
    return state.hexdigest()


def _write_through_sink(handle: int, fill: Fill) -> Sequence[Range]:
    import h5py

    sink = _Sink(handle)
    try:
        with h5py.File(sink, "w") as file:
            later = fill(file)
    finally:
        if sink.problem is not None:
            raise sink.problem
    os.ftruncate(handle, sink.size)
    return later or ()


class _Sink(io.RawIOBase):
    """File for HDF5 whose writes never fail."""

    def __init__(self, handle: int) -> None:
        self.problem: BaseException | None = None  # the first
        self.size = 0
        self._handle, self._at = handle, 0

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self._at = offset + (0, self._at, self.size)[whence]
        return self._at

    def tell(self) -> int:
        return self._at

    def truncate(self, size: int | None = None) -> int:
        self.size = self._at if size is None else size
        return self.size

    def readinto(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        data = b""
        try:
            data = os.pread(self._handle, len(view), self._at)
        except BaseException as problem:  # an interrupt included: HDF5 must not see it
            self._keep(problem)
        view[:] = data.ljust(len(view), b"\0")
        self._at += len(view)
        return len(view)

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        try:
            if self.problem is None:
                write_at(self._handle, self._at, view)
        except BaseException as problem:
            self._keep(problem)
        self._at += len(view)
        self.size = max(self.size, self._at)
        return len(view)

    def flush(self) -> None:
        pass

    def _keep(self, problem: BaseException) -> None:
        if self.problem is None:
            self.problem = problem
