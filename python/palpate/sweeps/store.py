"""HDF5 file of a sweep, allocated before the first cell runs, filled by chunks and resumable at any time.

All datasets are allocated at the start, so a disk that is too small is reported before the computation. A chunk is
written, flushed and then marked as done, so an interrupted run leaves complete chunks.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.errors import OutputError
from palpate.files import HDF5_SIGNATURE, as_path, atomic_write
from palpate.simulation.verdict import State
from palpate.sweeps.axes import SweepError
from palpate.sweeps.outcomes import QUANTITIES
from palpate.sweeps.plan import Plan

__all__ = ["FileStore", "MemoryStore", "StoredValues", "merge", "read", "tally"]


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


class FileStore:
    """Outcomes in a new or existing file; a context manager that closes it."""

    def __init__(self, path: str | Path, plan: Plan) -> None:
        """Open the file of this sweep, or create it.

        Raises:
            SweepError: the file holds another sweep, or something else.
            OutputError: it cannot be written: no permission, a full disk.
        """
        self.path = as_path(path, OutputError)
        if self.path.is_dir():
            raise OutputError(f"{self.path} is a folder; give the name of a file, as in {self.path / 'sweep.h5'}")
        if not self.path.exists():
            atomic_write(self.path, lambda part: _lay_out(part, plan))
        held = _plan_text(self.path)
        if held != plan.text():
            what = "something else" if held is None else "another sweep"
            raise SweepError(f"{self.path} holds {what}: give another file, or delete it")
        self._chunk = plan.chunk
        try:
            self._file = h5py.File(self.path, "r+")
        except OSError as problem:
            raise OutputError(f"{self.path}: cannot be written: {problem}") from problem

    def missing(self) -> list[int]:
        """Return the numbers of the chunks that have not been run."""
        return [int(i) for i in np.flatnonzero(self._file["done"][:] == 0)]

    def put(self, chunk: int, values: Mapping[str, Array]) -> None:
        """Write a chunk and mark it as done.

        Raises:
            OutputError: the disk refused. What was marked before is on it.
        """
        first = chunk * self._chunk
        try:
            for name, rows in values.items():
                self._file[name][first : first + len(rows)] = rows
            self._file.flush()
            self._file["done"][chunk] = 1
            self._file.flush()
        except OSError as problem:
            raise OutputError(f"{self.path}: cannot be written: {problem}; what is done is kept") from problem

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, value: BaseException | None, at: TracebackType | None) -> None:
        self.close()


class StoredValues(Mapping[str, Array]):
    """A file's outcomes by name of QUANTITIES, shaped as the sweep; each is read on access."""

    def __init__(self, path: Path, shape: tuple[int, ...]) -> None:
        self._path, self._shape = path, shape

    def __getitem__(self, name: str) -> Array:
        if name not in QUANTITIES:
            raise KeyError(name)
        with h5py.File(self._path, "r") as file:
            rows = np.asarray(file[name][:], dtype=float)
        return rows.reshape(*self._shape, *rows.shape[1:])

    def __iter__(self) -> Iterator[str]:
        return iter(QUANTITIES)

    def __len__(self) -> int:
        return len(QUANTITIES)


def tally(path: str | Path) -> list[int]:
    """Return the number of cells of a file in each State, read in blocks."""
    counts = np.zeros(len(State), dtype=np.int64)
    with h5py.File(path, "r") as file:
        verdict = file["verdict"]
        for first in range(0, verdict.shape[0], 1_000_000):
            part = np.asarray(verdict[first : first + 1_000_000])
            counts += np.bincount(part[~np.isnan(part)].astype(int), minlength=len(State))
    return [int(count) for count in counts]


def read(path: str | Path) -> tuple[Plan, StoredValues, NDArray[np.bool_]]:
    """Return a file's plan, its outcomes, and whether each chunk is done.

    Raises:
        SweepError: it is no sweep's file.
    """
    whole = as_path(path, SweepError)
    text = _plan_text(whole)
    if text is None:
        raise SweepError(f"{path} is not the file of a sweep")
    with h5py.File(whole, "r") as file:
        plan = Plan.of_text(text)
        return plan, StoredValues(whole, plan.shape), np.asarray(file["done"][:] != 0)


def merge(parts: Sequence[str | Path], out: str | Path) -> Path:
    """Put the files of one sweep's shards together into `out` and return its path.

    Raises:
        SweepError: the files are of different sweeps, or a chunk is done in none of them.
        OutputError: `out` cannot be written.
    """
    if isinstance(parts, str | Path) or not isinstance(parts, Sequence):
        raise SweepError(f"a list of files is put together, not {parts!r}")
    if not parts:
        raise SweepError("no files to put together")
    texts = [_plan_text(as_path(part, SweepError)) for part in parts]
    for part, text in zip(parts, texts, strict=True):
        if not Path(part).exists():
            raise SweepError(f"{part}: there is no such file")
        if text is None:
            raise SweepError(f"{part} is not the file of a sweep")
        if text != texts[0]:
            raise SweepError(f"{part} is of another sweep than {parts[0]}")
    plan = Plan.of_text(str(texts[0]))
    chunk = plan.chunk

    def write(target: Path) -> None:
        _lay_out(target, plan)
        with h5py.File(target, "r+") as whole:
            for part in parts:
                with h5py.File(part, "r") as file:
                    for index in np.flatnonzero(file["done"][:] != 0):
                        cells = slice(int(index) * chunk, (int(index) + 1) * chunk)
                        for name in QUANTITIES:
                            whole[name][cells] = file[name][cells]
                        whole["done"][index] = 1
            left = int(np.sum(whole["done"][:] == 0))
        if left:
            raise SweepError(f"{left} chunks are done in none of these files: run the missing shards first")

    return atomic_write(out, write)


def _plan_text(path: Path) -> str | None:
    try:
        with h5py.File(path, "r") as file:
            found: Any = file.attrs.get("sweep")
            if found is not None and (missing := [name for name in QUANTITIES if name not in file]):
                raise SweepError(f"{path} has no {', '.join(missing)}: another version wrote it; run its sweep anew")
            return None if found is None else str(found)
    except FileNotFoundError:
        return None
    except OSError:
        with suppress(OSError), path.open("rb") as raw:
            if raw.read(len(HDF5_SIGNATURE)) == HDF5_SIGNATURE:
                raise SweepError(f"{path} is being written by another sweep: wait for it, or stop it") from None
        return None


def _lay_out(path: Path, plan: Plan) -> None:
    """Create a file with all datasets allocated."""
    _reserve(path, plan)
    with h5py.File(path, "w", track_order=True) as file:
        file.attrs["sweep"] = plan.text()
        file.attrs["shape"] = plan.shape
        file.attrs["title"] = str(plan.tables.get("title", ""))
        for number, axis in enumerate(plan.axes):
            values = list(axis.values)
            words = not all(isinstance(value, (int, float)) for value in values)
            file[f"over/{axis.path}"] = [str(value) for value in values] if words else np.asarray(values, dtype=float)
            file[f"over/{axis.path}"].attrs.update({"unit": axis.unit, "dimension": number})
        for name, (columns, unit, meaning) in QUANTITIES.items():
            shape = (plan.count, columns) if columns > 1 else (plan.count,)
            _place(file, name, shape, "f8", np.nan)
            file[name].attrs.update({"unit": unit, "meaning": meaning})
        _place(file, "done", (plan.chunks,), "u1", 0)


def _reserve(path: Path, plan: Plan) -> None:
    """Allocate the disk space of the file, because HDF5 handles a full disk poorly."""
    numbers = sum(columns for columns, _, _ in QUANTITIES.values())
    with path.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, 8 * numbers * plan.count + 2 * len(plan.text()) + 65536)


def _place(file: h5py.File, name: str, shape: tuple[int, ...], kind: str, fill: float) -> None:
    """Create a contiguous dataset that is allocated immediately."""
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
    properties.set_fill_time(h5py.h5d.FILL_TIME_ALLOC)
    properties.set_obj_track_times(False)  # the same sweep gives the same bytes
    properties.set_fill_value(np.asarray(fill, dtype=kind))
    space = h5py.h5s.create_simple(shape)
    h5py.h5d.create(file.id, name.encode(), h5py.h5t.py_create(np.dtype(kind)), space, dcpl=properties)
