"""Recording as CSV: a header with units, one line per sample, metadata as JSON in a comment."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, TextIO

import numpy as np

from palpate.arrays import Array
from palpate.errors import RecordingError, shorten
from palpate.files.json_text import load_table
from palpate.identification.channel_units import CHANNELS, channel_scale
from palpate.identification.samples import MINIMUM_SAMPLES, Columns, check_samples

_HEADER = re.compile(r"^\s*([A-Za-z_]+?)\s*_?(\d*)\s*(?:\[\s*(.*?)\s*\])?\s*$")
_EXAMPLE = "'time [s], theta1 [rad], ..., tau1 [N*m]'"
_LARGEST = 200_000_000  # bytes
_NAMES = {
    "time": ("time", "t"),
    "angle": ("theta", "angle", "q", "position", "x"),
    "torque": ("tau", "torque", "force", "f"),
    "excitation": ("excitation",),
}
_CHANNEL_OF = {name: channel for channel, names in _NAMES.items() for name in names}


class _Table(NamedTuple):
    header: list[str]
    rows: list[list[float]]
    lines: list[int]  # line of each row in the file
    metadata: dict[str, Any]


class _Column(NamedTuple):
    joint: int  # from 1
    place: int  # in the table
    scale: float  # to SI


def read_csv(file: Path) -> Columns:
    """Return the samples of a file. Raise RecordingError, naming the line or the column, if there is a mistake."""
    header, rows, lines, metadata = _read_table(file)
    columns, slides = _sort_header(header, file)
    table = np.array(rows, dtype=float).reshape(len(rows), len(header))

    def values(channel: str) -> Array:
        return np.column_stack([table[:, column.place] * column.scale for column in columns[channel]])

    time = values("time")[:, 0]
    if len(time) < MINIMUM_SAMPLES:
        raise RecordingError(f"{file}: {len(time)} samples are too few; at least {MINIMUM_SAMPLES} are needed")
    angle, torque = values("angle"), values("torque")
    excitation = values("excitation") if columns["excitation"] else None
    check_samples(
        time, {"angle": angle, "torque": torque, "excitation": excitation}, lambda row: f"{file}, line {lines[row]}"
    )
    units = ("m", "N") if slides else ("rad", "N*m")
    return Columns(time, angle, torque, 0.0, {**metadata, "file": file.name}, excitation, units)


def write_csv(recording: Columns, path: Path) -> None:
    """Write the header with units and every sample with all its digits."""
    joints = range(1, recording.angle.shape[1] + 1)
    angle_unit, torque_unit = recording.units
    names = ["time [s]", *(f"theta{j} [{angle_unit}]" for j in joints), *(f"tau{j} [{torque_unit}]" for j in joints)]
    parts = [recording.time[:, None], recording.angle, recording.torque]
    if recording.excitation is not None:
        names += [f"excitation{j} [{torque_unit}]" for j in joints]
        parts.append(recording.excitation)
    with path.open("w", newline="", encoding="utf-8") as stream:
        if recording.metadata:
            stream.write(f"# {json.dumps(recording.metadata)}\n")
        stream.write(", ".join(names) + "\n")
        writer = csv.writer(stream)
        writer.writerows([repr(value) for value in row] for row in np.hstack(parts).tolist())


def _read_table(file: Path) -> _Table:
    """Return the numbers of a file; raise as `read_csv`."""
    metadata: dict[str, Any] = {}
    rows: list[list[float]] = []
    lines: list[int] = []
    header: list[str] | None = None
    with _open(file) as stream:
        reader = csv.reader(stream)
        for fields in _rows(reader, file):
            where = f"{file}, line {reader.line_num}"
            if not any(cell.strip() for cell in fields):
                continue
            if fields[0].startswith("#"):
                text = ",".join(fields)[1:].strip()
                if text.startswith("{"):
                    metadata = load_table(text, RecordingError, f"{where}: metadata")
                continue
            if header is None:
                if any(
                    not cell.replace("\t", " ").isprintable() or "\ufffd" in cell for cell in map(str.strip, fields)
                ):
                    raise RecordingError(
                        f"{where}: this is not a text file; a recording is CSV with a header {_EXAMPLE}, or HDF5"
                    )
                _check_header(fields, where)
                header = fields
                continue
            if len(fields) != len(header):
                raise RecordingError(f"{where}: {len(fields)} fields where the header has {len(header)}")
            try:
                rows.append([float(cell) for cell in fields])
            except ValueError:
                _refuse_text(fields, header, where)
            lines.append(reader.line_num)
    if header is None:
        raise RecordingError(f"{file}: the file is empty; a header {_EXAMPLE} is expected")
    return _Table(header, rows, lines, metadata)


@contextmanager
def _open(file: Path) -> Iterator[TextIO]:
    """Open a CSV file of bounded size. Raise RecordingError for errors of the system."""
    if file.stat().st_size > _LARGEST:
        raise RecordingError(f"{file}: larger than {_LARGEST / 1e6:g} MB; save a recording of that length as .h5")
    try:
        with file.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
            yield stream
    except OSError as problem:
        raise RecordingError(f"{file}: cannot be read: {problem.strerror}") from None


def _rows(reader: Any, file: Path) -> Iterator[list[str]]:
    """Yield the fields of each line. Raise RecordingError for a line that is no CSV."""
    try:
        yield from reader
    except csv.Error as problem:  # a field of more than 131,072 characters, a null character
        raise RecordingError(f"{file}, line {reader.line_num}: not CSV: {problem}") from None


def _check_header(fields: list[str], where: str) -> None:
    """Raise RecordingError unless a field of the first line names a channel."""
    cells = [cell.strip() for cell in fields]
    for separator, name in ((";", "semicolons"), ("\t", "tabs")):
        if len(cells) == 1 and any(map(_channel_of, cells[0].split(separator)[1:])):
            raise RecordingError(f"{where}: {name} separate the columns; separate them by commas")
    if any(map(_channel_of, fields)):
        return
    if all(re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", cell) for cell in cells):
        raise RecordingError(
            f"{where}: numbers stand where the columns are named; write {_EXAMPLE} as the first line, with the units "
            "of the file"
        )
    raise RecordingError(
        f"{where}: this is not a recording, as no column is a time, angle or torque; give CSV with the header "
        f"{_EXAMPLE}, or HDF5"
    )


def _channel_of(cell: str) -> str | None:
    """Return the channel that a field of the header names; None if it names none."""
    match = _HEADER.match(cell)
    return _CHANNEL_OF.get(match[1].rstrip("_").lower()) if match else None


def _refuse_text(fields: list[str], header: list[str], where: str) -> NoReturn:
    """Raise RecordingError, naming the first field that is not a number."""
    for cell, name in zip(fields, header, strict=True):
        try:
            float(cell)
        except ValueError:
            raise RecordingError(
                f"{where}: '{shorten(cell.strip(), 60)}' in column '{shorten(name.strip(), 60)}' is not a number"
            ) from None
    raise AssertionError("every field is a number")


def _sort_header(header: list[str], file: Path) -> tuple[dict[str, list[_Column]], bool]:
    """Return the columns of each channel by joint, and whether the joints slide."""
    found: dict[str, list[_Column]] = {channel: [] for channel in CHANNELS}
    slides: set[bool] = set()
    for index, cell in enumerate(header):
        match, channel = _HEADER.match(cell), _channel_of(cell)
        if match is None or channel is None:
            continue
        scale, sliding = channel_scale(channel, match[3] or "", f"{file}, header: column '{cell.strip()}'")
        found[channel].append(_Column(int(match[2] or 1), index, scale))
        if channel != "time":
            slides.add(sliding)
    for name, example in (("time", "time [s]"), ("angle", "theta1 [rad]"), ("torque", "tau1 [N*m]")):
        if not found[name]:
            raise RecordingError(f"{file}, header: there is no {name} column, such as '{example}'")
    if len(found["time"]) > 1:
        raise RecordingError(f"{file}, header: there are {len(found['time'])} time columns; one is expected")
    joints = list(range(1, len(found["angle"]) + 1))
    for channel, word in (("angle", "theta"), ("torque", "tau"), ("excitation", "excitation")):
        found[channel].sort()
        numbers = [column.joint for column in found[channel]]
        if numbers and numbers != joints:
            raise RecordingError(
                f"{file}, header: the {channel} columns are numbered {numbers} but the joints are {joints}; "
                f"name them {word}1 … {word}{len(joints)}"
            )
    if len(slides) > 1:
        raise RecordingError(f"{file}, header: rad goes with N*m and m with N, for all joints alike")
    return found, True in slides
