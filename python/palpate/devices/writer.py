"""Device files written from a `Device`."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

from palpate.devices.catalog import parse_device
from palpate.devices.device import Device
from palpate.errors import OutputError
from palpate.files import as_path, write_text


def write_device(
    path: str | os.PathLike[str],
    device: Device,
    sources: Mapping[str, str],
    source_of: Mapping[str, str],
    notes: Mapping[str, str] | None = None,
    comments: Sequence[str] = (),
) -> Path:
    """Write a device file with every number of a device, in SI and exact.

    Args:
        path: of the TOML file, which is written whole or not at all.
        device: to write; its linear identified model is left out.
        sources: full text of each source by its key.
        source_of: key of the source by the key of the number ("geometry.l1").
        notes: by the key of the number.
        comments: lines at the top of the file.

    Raises:
        DeviceError: a number is outside its allowed range, so that no device file can hold it.
        OutputError: the file cannot be written.
    """
    text = _text(device, sources, source_of, notes or {}, comments)
    parse_device(text, str(as_path(path, OutputError)))
    return write_text(path, text)


def _text(
    device: Device,
    sources: Mapping[str, str],
    source_of: Mapping[str, str],
    notes: Mapping[str, str],
    comments: Sequence[str],
) -> str:
    lines = [f"# {' '.join(line.split(chr(10)))}".rstrip() for line in comments]
    lines += ["", *(f"{key} = {_quoted(getattr(device, key))}" for key in ("name", "description", "mechanism"))]
    tables: dict[str, list[str]] = {"": [], "sources": [f"{key} = {_quoted(text)}" for key, text in sources.items()]}
    for key, field in device.model.fields.items():
        if key not in device.parameters.values:
            continue
        table, _, name = key.rpartition(".")
        values = [
            _quoted(f"{float(v)!r} {field.unit}") if field.unit else repr(float(v))
            for v in device.parameters.values[key]
        ]
        value = f"[{', '.join(values)}]" if field.size > 1 else values[0]
        note = f", note = {_quoted(notes[key])}" if key in notes else ""
        tables.setdefault(table, []).append(f"{name} = {{ value = {value}, source = {_quoted(source_of[key])}{note} }}")
    for table, entries in tables.items():
        lines += [*(["", f"[{table}]"] if table else []), *entries]
    return "\n".join(lines).lstrip("\n") + "\n"


def _quoted(text: str) -> str:
    """Return a TOML basic string, whose escapes are those of JSON."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
