"""HDF5 file of a sweep, allocated before the first cell runs, filled by chunks and resumable at any time.

All datasets are allocated at the start, so a disk that is too small is reported before the computation. HDF5 lays the
file out once; the cells are then written to their places without it, so an interruption cannot damage its structure.
The seal covers all other bytes. `done` holds the checksum of each chunk, so a chunk that was written in part, or
changed afterwards, does not count as done.
"""

from __future__ import annotations

import os
import warnings
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.errors import OutputError, PalpateError, PalpateWarning
from palpate.files import as_path, atomic_write
from palpate.files.hdf5_input import check_hdf5, open_sealed
from palpate.files.hdf5_output import Range, write_at, write_hdf5
from palpate.simulation.verdict import State
from palpate.sweeps.axes import SweepError
from palpate.sweeps.outcomes import QUANTITIES
from palpate.sweeps.plan import Plan

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

__all__ = ["FileStore", "MemoryStore", "StoredValues", "bytes_of", "merge", "read", "tally"]

_DONE: Final = 1 << 32  # added to the CRC-32 of a chunk that is done
_PART: Final = 1 << 20  # cells that are counted at once
_SYNC: Final = 1 << 24  # bytes after which the file is flushed to the disk


class MemoryStore:
    """Outcomes in memory."""

    def __init__(self, plan: Plan) -> None:
        self._plan, self._chunk = plan, plan.chunk
        self._values = {
            name: np.full((plan.count, columns)[: 1 + (columns > 1)], np.nan)
            for name, (columns, _, _) in QUANTITIES.items()
        }
        self._done = np.zeros(plan.chunks, dtype=bool)

    def missing(self) -> list[int]:
        """Return the numbers of the chunks that have not been run."""
        return [int(i) for i in np.flatnonzero(~self._done)]

    def put(self, chunk: int, values: Mapping[str, Array]) -> None:
        """Store the outcomes of a chunk."""
        first = chunk * self._chunk
        for name, rows in values.items():
            self._values[name][first : first + len(rows)] = rows
        self._done[chunk] = True

    def values(self) -> dict[str, Array]:
        """Return all outcomes by name of QUANTITIES."""
        return self._values

    def close(self) -> None:
        """Do nothing; no file is open."""


class _Cells:
    """Cells of an open file: where they lie, and their checksums.

    Every dataset is contiguous, so a chunk is a range of bytes in each of them.
    """

    def __init__(self, handle: int, plan: Plan, places: Mapping[str, Range]) -> None:
        self._handle, self._places = handle, places
        self._chunk, self._count, self._chunks = plan.chunk, plan.count, plan.chunks

    def marks(self) -> NDArray[np.uint64]:
        """Return the mark of each chunk: 0, or `_DONE` plus its checksum."""
        return np.frombuffer(self._read("done", 0, 8 * self._chunks), dtype="<u8")

    def write(self, chunk: int, values: Mapping[str, Array]) -> int:
        """Write the cells of a chunk and its mark; return the number of bytes."""
        blocks = {name: np.ascontiguousarray(values[name], dtype="<f8").tobytes() for name in QUANTITIES}
        for name, block in blocks.items():
            write_at(self._handle, self._places[name][0] + 8 * QUANTITIES[name][0] * chunk * self._chunk, block)
        self._mark(chunk, _DONE + _checksum(chunk, blocks.values()))
        return sum(map(len, blocks.values()))

    def clear(self, chunk: int) -> None:
        """Mark a chunk as not done."""
        self._mark(chunk, 0)

    def read(self, chunk: int) -> dict[str, Array]:
        """Return the cells of a chunk by name of QUANTITIES."""
        return {name: _rows(self._block(name, chunk), name) for name in QUANTITIES}

    def damaged(self) -> list[int]:
        """Return the numbers of the chunks that are marked as done and differ from their checksum."""
        return [
            chunk
            for chunk, mark in enumerate(self.marks().tolist())
            if mark and mark != _DONE + _checksum(chunk, (self._block(name, chunk) for name in QUANTITIES))
        ]

    def _mark(self, chunk: int, mark: int) -> None:
        write_at(self._handle, self._places["done"][0] + 8 * chunk, np.array([mark], dtype="<u8").tobytes())

    def _block(self, name: str, chunk: int) -> bytes:
        size = 8 * QUANTITIES[name][0]
        first, last = chunk * self._chunk, min((chunk + 1) * self._chunk, self._count)
        return self._read(name, size * first, size * (last - first))

    def _read(self, name: str, offset: int, size: int) -> bytes:
        return os.pread(self._handle, size, self._places[name][0] + offset)


class FileStore:
    """Outcomes in a new or existing file; a context manager that closes it."""

    def __init__(self, path: str | Path, plan: Plan) -> None:
        """Open the file of this sweep, or create it. Chunks that differ from their checksums are run again.

        Raises:
            SweepError: the file holds another sweep or something else, is damaged, or another process writes it.
            OutputError: it cannot be written: no permission, a full disk.
        """
        self.path = as_path(path, OutputError)
        if self.path.is_dir():
            raise OutputError(f"{self.path} is a folder; give the name of a file, as in {self.path / 'sweep.h5'}")
        if not self.path.exists():
            _lay_out(self.path, plan)
        try:
            held, places = _structure(self.path)
        except SweepError as problem:
            raise SweepError(f"{problem}; give another file, or delete it") from None
        if held.text() != plan.text():
            changed = [name for name, checksum in plan.files.items() if held.files.get(name, checksum) != checksum]
            why = f"{changed[0]} has changed since it was run" if changed else "it holds another sweep"
            raise SweepError(f"{self.path}: {why}: give another file, or delete it")
        try:
            self._handle = os.open(self.path, os.O_RDWR)
        except OSError as problem:
            raise OutputError(f"{self.path}: cannot be written: {problem.strerror}") from problem
        self._unwritten = 0
        self._cells = _Cells(self._handle, plan, places)
        try:
            _lock(self._handle, self.path)
            if damaged := self._cells.damaged():
                text = f"{self.path}: {len(damaged)} chunks differ from their checksums; they are run again"
                warnings.warn(text, PalpateWarning, stacklevel=3)
            for chunk in damaged:
                self._cells.clear(chunk)
        except BaseException:
            os.close(self._handle)
            raise

    def missing(self) -> list[int]:
        """Return the numbers of the chunks that have not been run."""
        return [int(i) for i in np.flatnonzero(self._cells.marks() == 0)]

    def put(self, chunk: int, values: Mapping[str, Array]) -> None:
        """Write a chunk and mark it as done.

        Raises:
            OutputError: the disk refused. What was marked before is on it.
        """
        try:
            self._unwritten += self._cells.write(chunk, values)
            if self._unwritten > _SYNC:
                os.fsync(self._handle)
                self._unwritten = 0
        except OSError as problem:
            reason = problem.strerror or str(problem)
            raise OutputError(f"{self.path}: cannot be written: {reason}; what is done is kept") from problem

    def close(self) -> None:
        """Flush the file to the disk and close it. Raise OutputError if the disk refuses."""
        try:
            os.fsync(self._handle)
        except OSError as problem:
            raise OutputError(f"{self.path}: cannot be written: {problem.strerror}; what is done is kept") from problem
        finally:
            os.close(self._handle)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, at: TracebackType | None) -> None:
        self.close()


class StoredValues(Mapping[str, Array]):
    """A file's outcomes by name of QUANTITIES, shaped as the sweep; each is read on access. Cells not run are nan."""

    def __init__(self, path: Path, plan: Plan, places: Mapping[str, Range], done: NDArray[np.bool_]) -> None:
        self._path, self._places, self._shape = path, places, plan.shape
        self._left = ~np.repeat(done, plan.chunk)[: plan.count]

    def __getitem__(self, name: str) -> Array:
        if name not in QUANTITIES:
            raise KeyError(name)
        columns = QUANTITIES[name][0]
        rows: Array = np.empty(self._places[name][1] // 8)
        with _opened(self._path) as handle:
            _fill(handle, rows, self._places[name][0])
        rows = rows.reshape(-1, columns) if columns > 1 else rows
        rows[self._left] = np.nan
        return rows.reshape(*self._shape, *rows.shape[1:])

    def tally(self) -> list[int]:
        """Return the number of cells in each State, from a part of the file at a time."""
        counts = np.zeros(len(State), dtype=np.int64)
        offset, size = self._places["verdict"]
        with _opened(self._path) as handle:
            for first in range(0, size // 8, _PART):
                part = np.empty(min(_PART, size // 8 - first))
                _fill(handle, part, offset + 8 * first)
                known = part[~self._left[first : first + len(part)]]
                counts += [np.count_nonzero(known == state.value) for state in State]
        return counts.tolist()

    def __iter__(self) -> Iterator[str]:
        return iter(QUANTITIES)

    def __len__(self) -> int:
        return len(QUANTITIES)


def tally(path: str | Path) -> list[int]:
    """Return the number of cells of a file in each State. Raise as `read`."""
    return read(path)[1].tally()


def read(path: str | Path) -> tuple[Plan, StoredValues, NDArray[np.bool_]]:
    """Return a file's plan, its outcomes, and whether each chunk is done.

    Raises:
        SweepError: it is no sweep's file, or it was changed since it was written.
    """
    whole = as_path(path, SweepError)
    plan, places = _structure(whole)
    with _opened(whole) as handle:
        cells = _Cells(handle, plan, places)
        if damaged := cells.damaged():
            raise SweepError(
                f"{path}: {len(damaged)} of {plan.chunks} chunks differ from their checksums, the first is "
                f"{damaged[0]}; the command that made the file runs them again"
            )
        done = cells.marks() != 0
    return plan, StoredValues(whole, plan, places, done), done


def merge(parts: Sequence[str | Path], out: str | Path) -> Path:
    """Put the files of one sweep's shards together into `out` and return its path.

    Raises:
        SweepError: the files are of different sweeps, one is damaged, or a chunk is done in none of them.
        OutputError: `out` cannot be written.
    """
    if isinstance(parts, str | Path) or not isinstance(parts, Sequence):
        raise SweepError(f"a list of files is put together, not {parts!r}")
    if not parts:
        raise SweepError("no files to put together")
    plans = [read(part)[0] for part in parts]
    for part, plan in zip(parts, plans, strict=True):
        if plan.text() != plans[0].text():
            raise SweepError(f"{part} is of another sweep than {parts[0]}")

    def write(target: Path) -> None:
        _lay_out(target, plans[0])
        with FileStore(target, plans[0]) as store:
            for part in map(Path, parts):
                with _opened(part) as handle:
                    cells = _Cells(handle, plans[0], _structure(part)[1])
                    for chunk in np.flatnonzero(cells.marks()).tolist():
                        store.put(chunk, cells.read(chunk))
            left = len(store.missing())
        if left:
            raise SweepError(f"{left} chunks are done in none of these files: run the missing shards first")

    return atomic_write(out, write)


def _structure(path: Path) -> tuple[Plan, dict[str, Range]]:
    """Return the plan of a file, and where each dataset lies. Raise SweepError if it is no sweep or was changed."""
    check_hdf5(path, SweepError, "sweep")
    with open_sealed(path, SweepError, "sweep") as file:
        text = file.text_attribute("sweep", default="")
        if not text:
            raise SweepError(f"{path} is not the file of a sweep")
        try:
            plan = Plan.of_text(text)
        except PalpateError as problem:
            raise SweepError(f"{path}: {problem}") from None
        sizes = {name: 8 * columns * plan.count for name, (columns, _, _) in QUANTITIES.items()}
        sizes["done"] = 8 * plan.chunks
        if missing := [name for name in sizes if not file.has(name)]:
            raise SweepError(f"{path} has no {', '.join(missing)}: another version wrote it; run its sweep anew")
        places = {name: file.place(name, "<u8" if name == "done" else "<f8") for name in sizes}
    if any(places[name][1] != size for name, size in sizes.items()) or sorted(places.values()) != sorted(file.later):
        raise SweepError(f"{path}: its datasets have other sizes or places than those of its sweep")
    return plan, places


@contextmanager
def _opened(path: Path) -> Iterator[int]:
    """Yield the handle of a file that is open for reading. Raise SweepError if it cannot be opened."""
    try:
        handle = os.open(path, os.O_RDONLY)
    except OSError as problem:
        raise SweepError(f"{path}: cannot be read: {problem.strerror}") from None
    try:
        yield handle
    finally:
        os.close(handle)


def _lock(handle: int, path: Path) -> None:
    """Lock an open file until it is closed, where the file system has locks. Raise SweepError if it is locked."""
    if fcntl is None:
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise SweepError(f"{path} is being written by another sweep: wait for it, or stop it") from None
    except OSError:
        return


def bytes_of(cells: int) -> int:
    """Return the size of the outcomes of so many cells, bytes."""
    return 8 * sum(columns for columns, _, _ in QUANTITIES.values()) * cells


def _fill(handle: int, values: Array, offset: int) -> None:
    """Fill an array with the numbers at `offset` of an open file; nan beyond its end."""
    view, done = values.data.cast("B"), 0
    while done < len(view):
        count = os.preadv(handle, [view[done:]], offset + done)
        if count == 0:
            values[done // 8 :] = np.nan
            return
        done += count


def _rows(data: bytes, name: str) -> Array:
    """Return the values of a dataset, one row per cell."""
    flat = np.frombuffer(data, dtype="<f8")
    return flat.reshape(-1, QUANTITIES[name][0]) if QUANTITIES[name][0] > 1 else flat


def _checksum(chunk: int, blocks: Iterable[bytes]) -> int:
    """Return the CRC-32 of a chunk's number and cells."""
    value = zlib.crc32(str(chunk).encode())
    for block in blocks:
        value = zlib.crc32(block, value)
    return value


def _lay_out(path: Path, plan: Plan) -> None:
    """Create a file with all datasets allocated on the disk. Raise OutputError."""

    def fill(file: h5py.File) -> list[Range]:
        file.attrs["sweep"] = plan.text()
        file.attrs["shape"] = plan.shape
        file.attrs["title"] = str(plan.tables.get("title", ""))
        for number, axis in enumerate(plan.axes):
            values = list(axis.values)
            words = not all(isinstance(value, (int, float)) for value in values)
            file[f"over/{axis.path}"] = [str(value) for value in values] if words else np.asarray(values, dtype=float)
            file[f"over/{axis.path}"].attrs.update({"unit": axis.unit, "dimension": number})
        ranges = []
        for name, (columns, unit, meaning) in QUANTITIES.items():
            shape = (plan.count, columns) if columns > 1 else (plan.count,)
            ranges.append(_place(file, name, shape, "<f8", np.nan))
            file[name].attrs.update({"unit": unit, "meaning": meaning})
        ranges.append(_place(file, "done", (plan.chunks,), "<u8", 0))
        file["done"].attrs["meaning"] = "of each chunk of cells: 0 not run, else 2^32 plus the CRC-32 of its cells"
        return ranges

    write_hdf5(path, fill, reserve=bytes_of(plan.count) + 8 * plan.chunks + 2 * len(plan.text()) + 65536)


def _place(file: h5py.File, name: str, shape: tuple[int, ...], kind: str, fill: float) -> Range:
    """Create a contiguous dataset that is allocated immediately; return where it lies."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    properties.set_obj_track_times(False)  # the same sweep gives the same bytes
    properties.set_fill_value(np.asarray(fill, dtype=kind))
    space = h5py.h5s.create_simple(shape)
    data = h5py.h5d.create(file.id, name.encode(), h5py.h5t.py_create(np.dtype(kind)), space, dcpl=properties)
    return int(data.get_offset()), int(data.get_storage_size())
