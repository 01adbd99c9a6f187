"""Comparison of whole results with stored ones.

`PALPATE_STORE=1 pytest tests/report tests/plotting` writes the files of `check_stored` anew; read the difference before
it is committed.
"""

from __future__ import annotations

import json
import os
from enum import Enum
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

REMEDY: Final = "if it is meant, write the stored results anew with PALPATE_STORE=1 and read their difference"


def check_stored(file: Path, found: Any, relative: float = 2e-5) -> None:
    """Compare texts, numbers, lists and tables of them with those in a JSON file."""
    found = json.loads(json.dumps(plain(found)))
    if os.environ.get("PALPATE_STORE"):
        file.parent.mkdir(exist_ok=True)
        file.write_text(_written(found), "utf-8")
    stored = json.loads(file.read_text("utf-8"))
    places = _differences(stored, found, file.stem, relative, 1e-9)
    assert not places, "\n".join([*places[:10], REMEDY])


def assert_same(found: Any, stored: Any, place: str = "", absolute: float = 1e-13, relative: float = 1e-6) -> None:
    """Compare two results of `plain`, numbers within a relative or an absolute tolerance."""
    places = _differences(stored, found, place, relative, absolute)
    assert not places, "\n".join(places[:10])


def plain(value: Any) -> Any:
    """Return a result as tables and lists of numbers and texts."""
    if isinstance(value, dict):
        return {key if isinstance(key, str | int) else str(key): plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [plain(part) for part in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    kept = value is None or isinstance(value, str | bool | int | float)
    return value if kept and not isinstance(value, Enum) else str(value)


def _written(found: Any) -> str:
    """Return JSON with a line for each entry, and ten digits of each number."""
    rounded = json.loads(json.dumps(found), parse_float=lambda digits: float(f"{float(digits):.10g}"))
    if isinstance(rounded, dict):
        rows = [f"{json.dumps(key)}: {json.dumps(entry, ensure_ascii=False)}" for key, entry in rounded.items()]
        return "{\n" + ",\n".join(rows) + "\n}\n"
    if not isinstance(rounded, list):
        return json.dumps(rounded, ensure_ascii=False) + "\n"
    return "[\n" + ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in rounded) + "\n]\n"


def _differences(stored: Any, found: Any, place: str, relative: float, absolute: float) -> list[str]:
    pairs: list[tuple[str, Any, Any]] = []
    if isinstance(stored, dict) and isinstance(found, dict) and stored.keys() == found.keys():
        pairs = [(f"{place}.{key}", stored[key], found[key]) for key in stored]
    elif isinstance(stored, list) and isinstance(found, list) and len(stored) == len(found):
        pairs = [(f"{place}[{i}]", a, b) for i, (a, b) in enumerate(zip(stored, found, strict=True))]
    elif isinstance(stored, float) and isinstance(found, int | float):
        same = found == pytest.approx(stored, rel=relative, abs=absolute, nan_ok=True)
        return [] if same else [_line(place, stored, found)]
    elif isinstance(stored, dict | list) or stored != found:
        return [_line(place, stored, found)]
    return [line for at, a, b in pairs for line in _differences(a, b, at, relative, absolute)]


def _line(place: str, stored: Any, found: Any) -> str:
    return f"{place}: stored {str(stored)[:100]}, found {str(found)[:100]}"
