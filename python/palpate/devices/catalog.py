"""Device files: TOML in which every number has a unit and a source."""

from __future__ import annotations

import difflib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.devices.device import Device, Parameters
from palpate.devices.mechanisms import MECHANISMS, Field
from palpate.errors import DeviceError, PalpateError, shorten
from palpate.files import find_line, load_toml, read_utf8
from palpate.units import parse_quantity


@dataclass(frozen=True)
class Number:
    """One number of a device file.

    Attributes:
        key: "section.name", as in the file.
        values: in SI; one, or one per axis or joint.
        unit: SI unit; "" for a plain number.
        text: the values as written in the file.
        source: full reference of the publication.
        note: description; may be empty.
    """

    key: str
    values: tuple[float, ...]
    unit: str
    text: str
    source: str
    note: str


@dataclass(frozen=True)
class IdentifiedModel:
    """Linear model of a device, identified from measurements: x[k+1] = a x[k] + b torque[k], angle[k] = c x[k].

    Attributes:
        name: of the model.
        description: one line.
        source: full reference of the publication.
        period: s.
        a: (n, n).
        b: (n, dof), per N*m.
        c: (dof, n), rad.
    """

    name: str
    description: str
    source: str
    period: float
    a: NDArray[np.float64]
    b: NDArray[np.float64]
    c: NDArray[np.float64]


# Numbers of a device file, by mechanism. A name is "section.key", or a key at the top of the file.
FIELDS: dict[str, dict[str, Field]] = {name: mechanism.fields for name, mechanism in MECHANISMS.items()}
_MOST_MISTAKES = 50  # that are reported
_LARGEST = 1e9  # SI, of any number of a device
_TEXTS = ("name", "description", "mechanism", "based_on", "identified_model")


def names() -> list[str]:
    """Return the names of the devices in the catalog."""
    return sorted(_catalog())


@cache
def _catalog() -> dict[str, str]:
    """Return the text of each device's file in the package. They stay as they are while a program runs."""
    files = resources.files("palpate.devices").iterdir()
    return {file.name.removesuffix(".toml"): file.read_text("utf-8") for file in files if file.name.endswith(".toml")}


def load(name_or_path: Device | str | os.PathLike[str]) -> Device:
    """Return a device of the catalog by name, or the device of a TOML file; return a `Device` unchanged.

    Raises:
        DeviceError: no such name or file; or the file has an unknown key, a missing one, a value with the wrong
            dimension, a negative mass, inertia or friction, a number that is not finite, or one without a source. The
            message has a line for each mistake, with file, line and key.
    """
    return name_or_path if isinstance(name_or_path, Device) else parse_device(*_text(name_or_path))


@lru_cache(maxsize=64)
def parse_device(text: str, where: str) -> Device:
    """Return the device of a file's text, found at `where`. The result is cached: scenarios load a device repeatedly.

    Raises:
        DeviceError: as `load`.
    """
    where, tables = _tables(text, where)
    values = {number.key: number.values for number in _numbers(where, tables, text)}
    name, description, mechanism = (str(tables[key]) for key in ("name", "description", "mechanism"))
    identified = tables.get("identified_model")
    if identified is not None and not isinstance(identified, str):
        raise DeviceError(f"{where}: identified_model must be the name of a model or the path of its file")
    device = Device(name, description, mechanism, Parameters(MappingProxyType(values)), identified)
    try:
        device.check()
    except PalpateError as problem:
        raise DeviceError(f"{where}: {problem}") from None
    return device


def read_numbers(name_or_path: str | os.PathLike[str]) -> list[Number]:
    """Return every number of a device file with its unit, source and note, in the order of the file.

    Raises:
        DeviceError: as `load`.
    """
    text, where = _text(name_or_path)
    return _numbers(*_tables(text, where), text)


def identified_model(device: Device) -> IdentifiedModel:
    """Return the model of a device that was identified from measurements.

    Raises:
        DeviceError: the device has none, or its file cannot be read, has a matrix of the wrong shape, or a number that
            is not finite.
    """
    if device.identified_model is None:
        raise DeviceError(f"{device.name} has no identified model; give one as identified_model in its file")
    return _identified(device.identified_model, device.dof)


@lru_cache(maxsize=8)
def _identified(name: str, dof: int) -> IdentifiedModel:
    folder = resources.files("palpate.devices").joinpath("identified")
    if name in {file.name.removesuffix(".toml") for file in folder.iterdir()}:
        text, where = folder.joinpath(f"{name}.toml").read_text("utf-8"), f"identified model {name}"
    else:
        text, where = read_utf8(name, DeviceError, kind="the file of the identified model"), name
    tables = load_toml(text, DeviceError, where)
    for key in ("name", "description", "source", "period", "a", "b", "c"):
        if key not in tables:
            raise DeviceError(f"{where}: {key} is missing")
    period = parse_quantity(tables["period"], "s", f"{where}: period", error=DeviceError)
    if not period > 0.0:
        raise DeviceError(f"{where}: period is {period:g} s; it must be positive")
    n = len(tables["a"]) if isinstance(tables["a"], list) else 0
    shapes = {"a": (n, n), "b": (n, dof), "c": (dof, n)}
    matrices = {key: _matrix(tables[key], shape, f"{where}: {key}") for key, shape in shapes.items()}
    return IdentifiedModel(str(tables["name"]), str(tables["description"]), str(tables["source"]), period, **matrices)


def _matrix(rows: Any, shape: tuple[int, int], at: str) -> NDArray[np.float64]:
    try:
        matrix = np.array(rows, dtype=float)
    except (TypeError, ValueError):
        raise DeviceError(f"{at} must be a matrix: a list of rows of numbers") from None
    if matrix.shape != shape:
        raise DeviceError(f"{at} must be {shape[0]} x {shape[1]}, not of shape {matrix.shape}")
    if not np.all(np.isfinite(matrix)):
        raise DeviceError(f"{at} has a number that is not finite")
    return matrix


def _tables(text: str, where: str) -> tuple[str, dict[str, Any]]:
    """Return the location of a file and its tables, merged into those of the device on which it is based."""
    tables = load_toml(text, DeviceError, where)
    if "based_on" in tables:
        base = tables["based_on"]
        if not isinstance(base, str) or base not in names():
            known = ", ".join(names())
            raise DeviceError(f"{where}: based_on must be a device of the catalog ({known}), not {base!r}")
        _, merged = _tables(*_text(base))
        for key, value in tables.items():
            table = isinstance(value, dict) and key != "servo_period"
            merged[key] = {**_table(merged.get(key)), **value} if table else value
        tables = merged
    if "mechanism" not in tables and isinstance(tables.get("device"), dict):
        raise DeviceError(f"{where}: a scenario; its device is the file or the name in its table [device]")
    absent = [key for key in ("name", "description", "mechanism") if not isinstance(tables.get(key), str)]
    if absent:
        raise DeviceError(
            "\n".join(f'{where}: {key} is missing; write {key} = "…" at the top of the file' for key in absent)
        )
    sources = tables.get("sources", {})
    if not isinstance(sources, dict) or not all(isinstance(text, str) for text in sources.values()):
        raise DeviceError(f"{where}: sources must be a table of texts, written [sources]")
    if tables["mechanism"] not in MECHANISMS:
        known = " or ".join(", ".join(f'"{m}"' for m in MECHANISMS).rsplit(", ", 1))
        raise DeviceError(f"{where}: mechanism must be {known}, not {tables['mechanism']!r}")
    return where, tables


def _table(value: object) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def _text(name_or_path: str | os.PathLike[str]) -> tuple[str, str]:
    if not isinstance(name_or_path, str | os.PathLike):
        raise DeviceError(
            f"a device is given by its name in the catalog ({', '.join(names())}) or the path of its file, not by "
            f"{name_or_path!r}"
        )
    name = os.fspath(name_or_path)
    path = Path(name)
    if (text := _catalog().get(name)) is not None:
        return text, f"device {name}"
    if path.suffix != ".toml":
        close = difflib.get_close_matches(name, names(), 1)
        hint = f"did you mean {close[0]}? For" if close else "for"
        raise DeviceError(
            f"there is no device {name!r} in the catalog ({', '.join(names())}); "
            f"{hint} your own, give the path of a .toml file"
        )
    return read_utf8(path, DeviceError, kind="the device's file (.toml)"), str(path)


def _numbers(where: str, tables: Mapping[str, Any], text: str) -> list[Number]:
    fields = FIELDS[tables["mechanism"]]
    sources = tables.get("sources", {})
    entries: dict[str, Any] = {}
    for name, value in tables.items():
        if name == "sources" or name in _TEXTS:
            continue
        if name in fields or not isinstance(value, dict):
            entries[name] = value
        else:
            entries.update({f"{name}.{key}": entry for key, entry in value.items()})
    mistakes: list[tuple[int, str]] = []

    def add(name: str, sentence: str) -> None:
        line = find_line(text, name.split("."))
        place = where if line is None else f"{where}, line {line}"
        mistakes.append((line or 0, f"{place}: {sentence}"))

    unknown = [name for name in entries if name not in fields][:_MOST_MISTAKES]
    for name in unknown:
        close = difflib.get_close_matches(name, fields, 1)
        add(name, f"unknown key {name}" + (f"; did you mean {close[0]}?" if close else ""))
    meant = {match for name in unknown for match in difflib.get_close_matches(name, fields, 1)}
    for name, field in fields.items():
        if field.required and name not in entries and name not in meant:
            add(name, f"{name} is missing (a value in {field.unit})")
    numbers = []
    for name, entry in entries.items():
        if name in fields:
            try:
                numbers.append(_number(name, entry, fields[name], sources))
            except DeviceError as problem:
                add(name, str(problem))
    if mistakes:
        raise DeviceError("\n".join(shorten(sentence) for _, sentence in sorted(mistakes)[:_MOST_MISTAKES]))
    return numbers


def _number(name: str, entry: Any, field: Field, sources: Mapping[str, str]) -> Number:
    if not isinstance(entry, dict) or "value" not in entry or "source" not in entry:
        raise DeviceError(f'{name} must be written {{ value = "…", source = "…" }}: each number needs a source')
    unknown = set(entry) - {"value", "source", "note"}
    if unknown:
        raise DeviceError(f"{name}: unknown key {sorted(unknown)[0]}; the keys are value, source and note")
    value = entry["value"]
    if field.size > 1:
        if not isinstance(value, list):
            raise DeviceError(f"{name} needs a list of {field.size} values, one per joint or axis")
        values = parse_quantity(value, field.unit, name, size=field.size, error=DeviceError)
    else:
        values = (parse_quantity(value, field.unit, name, error=DeviceError),)
    if max(map(abs, values)) > _LARGEST:
        raise DeviceError(f"{name} is {max(values, key=abs):g} {field.unit}, which no device has: check its unit")
    smallest = f"{min(values):g} {field.unit}".rstrip()
    if field.range == "nonnegative" and min(values) < 0.0:
        raise DeviceError(f"{name} is {smallest}; it must not be negative")
    if field.range == "positive" and min(values) <= 0.0:
        raise DeviceError(f"{name} is {smallest}; it must be positive")
    if not isinstance(entry["source"], str):
        raise DeviceError(f"{name}: source must be text: a key of [sources], or the reference")
    source = entry["source"]
    shown = ", ".join(str(v) for v in value) if isinstance(value, list) else str(value)
    return Number(name, values, field.unit, shown, sources.get(source, source), str(entry.get("note", "")))
