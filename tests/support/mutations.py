"""Mutations of valid files for fuzzing: by byte, by token of a text, and by object of an HDF5 file."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
from palpate.files import hdf5_output
from resealed import reseal

_BYTES: Final = (b"\0", b"\xff", b"\n", b"\x1b[2J", b'"', b"[", b"{", b"=", b"nan", b"-1", b"\xff\xff\xff\x7f")
_VALUES: Final = (
    *("nan", "inf", "-inf", "1e308", "1e-320", "-0.0", "9" * 400, "9" * 5000, "0xff", "true", '""', "[]", "{}"),
    *('"1 s^0"', '"1 m()"', '"5e-324 N/m"', '"1e999 N"', '"a\x1b]0;b\x07"', '"../../etc/passwd"', '"/dev/zero"'),
    *("[" * 200 + "]" * 200, "[[1], [2, 3]]", "1979-05-27", "'''x'''", "{a = 1}", '"\\ud800"', '"ü\u202e"', "-1", "0"),
)
_LINES: Final = ("[a]", "[[a]]", "a = 1", "a." * 30 + "a = 1", "[object]", "title = 3", "# {", "\x00", '"""')


def mutate_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return data with a few bytes changed, inserted, deleted, repeated or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        at, size = rng.randrange(len(out) + 1), rng.choice((1, 1, 2, 4, 8, 64))
        kind = rng.randrange(6)
        if kind == 0 and at < len(out):
            out[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            out[at:at] = rng.choice(_BYTES)
        elif kind == 2:
            del out[at : at + size]
        elif kind == 3:
            out[at:at] = out[at : at + size] * rng.choice((1, 2, 50))
        elif kind == 4:
            out[at : at + size] = rng.randbytes(size)
        else:
            del out[at + rng.randrange(200) :]
    return bytes(out)


def mutate_text(data: bytes, rng: random.Random) -> bytes:
    """Return text with a few values, keys or lines exchanged."""
    lines = data.decode("utf-8").split("\n")
    for _ in range(rng.choice((1, 1, 2, 4))):
        at = rng.randrange(len(lines))
        kind, (key, equals, _) = rng.randrange(7), lines[at].partition("=")
        if kind <= 2 and equals:
            lines[at] = f"{key}= {rng.choice(_VALUES)}"
        elif kind == 3:
            lines.insert(at, rng.choice(_LINES))
        elif kind == 4 and len(lines) > 1:
            del lines[at]
        elif kind == 5:
            lines.insert(at, lines[rng.randrange(len(lines))])
        else:
            cells = lines[at].split(",")
            cells[rng.randrange(len(cells))] = rng.choice(_VALUES)
            lines[at] = ",".join(cells)
    return "\n".join(lines).encode("utf-8", "surrogatepass")


def mutate_hdf5(data: bytes, path: Path, rng: random.Random) -> None:
    """Write a sealed HDF5 file of which a few objects and attributes are exchanged."""
    path.write_bytes(data)
    with h5py.File(path, "r+") as file:
        later = [_range(file[name]) for name in file if "done" in file and isinstance(file[name], h5py.Dataset)]
        names: list[str] = []
        file.visit(names.append)
        for _ in range(rng.choice((1, 1, 2))):
            name = rng.choice(names)
            if not _names(file, name):
                continue
            if rng.random() < 0.5:
                _exchange(file, name, rng)
            else:
                place = file if rng.random() < 0.5 or not _opens(file, name) else file[name]
                key = rng.choice([*place.attrs, "unit", "format"])
                _set_attribute(place, key, rng)
    reseal(path, later)


def reforge(data: bytes, rng: random.Random) -> bytes:
    """Return an HDF5 file with changed bytes and the seal of its old content removed."""
    return mutate_bytes(data.partition(hdf5_output.SEAL)[0], rng)


def _names(file: h5py.File, name: str) -> bool:
    try:
        return file.get(name, getlink=True) is not None
    except (KeyError, RuntimeError, OSError):  # a group became a soft link to itself
        return False


def _opens(file: h5py.File, name: str) -> bool:
    try:
        return file[name] is not None
    except (KeyError, RuntimeError, OSError):
        return False


def _range(data: Any) -> tuple[int, int]:
    return data.id.get_offset(), data.id.get_storage_size()


def _set_attribute(place: Any, key: str, rng: random.Random) -> None:
    values: tuple[Any, ...] = (
        *(3, -1.5, np.nan, np.inf, "", "text", "[" * 5000, "9" * 5000, "{}", "[]", '{"source": 3}', b"\xff\xfe"),
        *(np.zeros(3), h5py.Empty("f8"), h5py.Empty("S1"), np.zeros((), dtype=[("a", "f8")]), 1 + 2j, True),
    )
    if key in place.attrs:
        old = place.attrs[key]
        del place.attrs[key]
        if isinstance(old, str) and len(old) > 2 and rng.random() < 0.6:
            place.attrs[key] = (
                mutate_text(old.replace(",", "\n").encode(), rng)
                .decode("utf-8", "replace")
                .replace("\0", "")
                .replace("\n", ",")
            )
            return
    if rng.random() < 0.9:
        place.attrs[key] = rng.choice(values)


def _exchange(file: h5py.File, name: str, rng: random.Random) -> None:
    old = file[name] if _opens(file, name) else None
    shape = old.shape if isinstance(old, h5py.Dataset) and (old.size or 0) < 100_000 else (60, 3)
    del file[name]
    kind = rng.randrange(12)
    if kind == 0:
        return
    if kind == 1:
        file[name] = rng.choice(
            [h5py.SoftLink("/time"), h5py.SoftLink(f"/{name}"), h5py.ExternalLink("/dev/zero", "/x")]
        )
    elif kind == 2:
        file.create_dataset(name, shape=(30000, 30000), chunks=(300, 300), compression="gzip", dtype="f8")
    elif kind == 3:
        file.create_dataset(name, shape=(100,), dtype="u1", external=[("/etc/passwd", 0, 100)])
    elif kind == 4:
        layout = h5py.VirtualLayout((60, 3), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "x", (60, 3))
        file.create_virtual_dataset(name, layout)
    elif kind == 5:
        group = file.create_group(name)
        group["x"] = group
    elif kind == 6:
        file[name] = rng.choice([h5py.Empty("f8"), "text", 3.0, True, np.zeros(0), np.zeros((0, 3)), "[" * 5000])
    elif kind == 7:
        file[name] = np.zeros(shape or (3,), dtype=rng.choice(["c16", "i1", "u8", "f2", "S3", "?"]))
    elif kind == 8:
        file[name] = np.full(shape or (3,), rng.choice([np.nan, np.inf, -1.0, 1e300, 1e-320, 0.0]))
    elif kind == 9:
        file.create_dataset(
            name, shape=shape or (3,), maxshape=(None,) * max(1, len(shape or (3,))), chunks=True, dtype="f8"
        )
    elif kind == 10:
        file[name] = np.zeros((2,) * rng.randrange(1, 6))
    else:
        file[name] = np.zeros(shape or (3,), dtype="i8") + rng.choice([-1, 2**62, 7])
