"""A recording as CSV: a header with units, one line per sample, metadata as JSON in a comment."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from palpate.arrays import Array
from palpate.errors import RecordingError
from palpate.identification.channel_units import (
    ANGLE_UNITS,
    FORCE_UNITS,
    LENGTH_UNITS,
    TIME_UNITS,
    TORQUE_UNITS,
    joint_scale,
    scale_of,
)
from palpate.identification.samples import MINIMUM_SAMPLES, Columns, check_samples

_HEADER = re.compile(r"^\s*([A-Za-z_]+?)\s*_?(\d*)\s*(?:\[\s*(.*?)\s*\])?\s*$")
_ANGLE_NAMES = {"theta", "angle", "q", "position", "x"}
_TORQUE_NAMES = {"tau", "torque", "force", "f"}
_EXCITATION_NAMES = {"excitation"}


def read_csv(file: Path) -> Columns:
    """Return the samples in `file`; raises RecordingError that names the line or the column."""
    with file.open(newline="", encoding="utf-8-sig", errors="replace") as stream:
        metadata: dict[str, Any] = {}
        rows: list[list[float]] = []
        lines: list[int] = []
        header: list[str] | None = None
        reader = csv.reader(stream)
        for fields in reader:
            line = reader.line_num
            if not fields or all(not cell.strip() for cell in fields):
                continue
            if fields[0].startswith("#"):
                text = ",".join(fields)[1:].strip()
                if text.startswith("{"):
                    try:
                        metadata = json.loads(text)
                    except json.JSONDecodeError as error:
                        raise RecordingError(f"{file}, line {line}: the metadata is not JSON ({error.msg})") from None
                continue
            if header is None:
                header = fields
                continue
            if len(fields) != len(header):
                raise RecordingError(f"{file}, line {line}: {len(fields)} fields where the header has {len(header)}")
            try:
                rows.append([float(cell) for cell in fields])
            except ValueError:
                bad = next(i for i, cell in enumerate(fields) if not _is_number(cell))
                raise RecordingError(
                    f"{file}, line {line}: '{fields[bad].strip()}' in column '{header[bad].strip()}' is not a number"
                ) from None
            lines.append(line)
    if header is None:
        raise RecordingError(
            f"{file}: the file is empty; a header 'time [s], theta1 [rad], ..., tau1 [N*m]' is expected"
        )
    columns = _sort_header(header, file)
    table = np.array(rows, dtype=float).reshape(len(rows), len(header))

    def place(index: int) -> str:
        return f"{file}, line {lines[index]}"

    groups = {name: _gather(table, columns[name]) for name in ("angle", "torque", "excitation")}
    time_index, _, time_scale = columns["time"][0]
    time = table[:, time_index] * time_scale
    if len(time) < MINIMUM_SAMPLES:
        raise RecordingError(f"{file}: {len(time)} samples are too short; at least {MINIMUM_SAMPLES} are needed")
    check_samples(time, dict(groups), place)
    units = ("m", "N") if columns["slides"] else ("rad", "N*m")
    angle, torque = groups["angle"], groups["torque"]
    assert angle is not None
    assert torque is not None
    return Columns(time, angle, torque, 0.0, {**metadata, "file": file.name}, groups["excitation"], units)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _gather(table: Array, columns: list[tuple[int, int, float]]) -> Array | None:
    if not columns:
        return None
    return np.column_stack([table[:, index] * scale for index, _, scale in columns])


def _sort_header(header: list[str], file: Path) -> dict[str, Any]:
    """Return which column is what: {"time", "angle", …: [(column, joint, scale to SI)], "slides": bool}."""
    found: dict[str, Any] = {"time": [], "angle": [], "torque": [], "excitation": []}
    slides: list[bool] = []
    for index, cell in enumerate(header):
        match = _HEADER.match(cell)
        where = f"{file}, header: column '{cell.strip()}'"
        if match is None:
            continue
        name, number, unit = match.group(1).rstrip("_").lower(), int(match.group(2) or 1), match.group(3) or ""
        if name in {"time", "t"}:
            found["time"].append((index, 1, scale_of(unit, TIME_UNITS, where, "time")))
        elif name in _ANGLE_NAMES:
            scale, linear = joint_scale(unit, ANGLE_UNITS, LENGTH_UNITS, where, "a joint")
            found["angle"].append((index, number, scale))
            slides.append(linear)
        elif name in _TORQUE_NAMES | _EXCITATION_NAMES:
            scale, linear = joint_scale(unit, TORQUE_UNITS, FORCE_UNITS, where, "a torque")
            found["torque" if name in _TORQUE_NAMES else "excitation"].append((index, number, scale))
            slides.append(linear)
    for name, example in (("time", "time [s]"), ("angle", "theta1 [rad]"), ("torque", "tau1 [N*m]")):
        if not found[name]:
            raise RecordingError(f"{file}, header: there is no {name} column, such as '{example}'")
        found[name].sort(key=lambda column: column[1])
    found["excitation"].sort(key=lambda column: column[1])
    if len(found["time"]) > 1:
        raise RecordingError(f"{file}, header: there are {len(found['time'])} time columns; one is expected")
    joints = list(range(1, len(found["angle"]) + 1))
    for name, word in (("angle", "theta"), ("torque", "tau"), ("excitation", "excitation")):
        numbers = [column[1] for column in found[name]]
        if numbers and numbers != joints:
            raise RecordingError(
                f"{file}, header: the {name} columns are numbered {numbers} but the joints are {joints}; "
                f"name them {word}1 … {word}{len(joints)}"
            )
    if any(slides) != all(slides):
        raise RecordingError(f"{file}, header: rad goes with N*m and m with N, for all joints alike")
    found["slides"] = all(slides)
    return found


def write_csv(recording: Columns, path: Path) -> None:
    """Write header, units and every sample with all its digits."""
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
