"""HDF5 files of palpate that a test changes: the seal is made anew, as by someone who knows the format."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
from palpate.files.hdf5_output import Range, seal, write_at


def reseal(path: Path, later: Sequence[Range] = ()) -> None:
    """Seal the present content of a file."""
    handle = os.open(path, os.O_RDWR)
    try:
        write_at(handle, os.fstat(handle).st_size, seal(handle, later))
    finally:
        os.close(handle)


@contextmanager
def changed(path: Path) -> Iterator[Any]:
    """Yield the open file, and seal what was made of it. HDF5 drops the former seal when it closes the file."""
    with h5py.File(path, "r+") as file:
        yield file
    reseal(path)
