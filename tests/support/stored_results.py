"""Comparison of whole results with stored ones."""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np
import pytest


def plain(value: Any) -> Any:
    """Return a result as lists of numbers and texts, which a list of stored ones equals."""
    if isinstance(value, dict):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return str(value) if isinstance(value, Enum) else value


def assert_same(found: Any, stored: Any, place: str = "", absolute: float = 1e-13, relative: float = 1e-6) -> None:
    """Compare two results of `plain`, numbers within a relative or an absolute tolerance."""
    if isinstance(stored, dict):
        assert list(found) == list(stored), place
        for key, entry in stored.items():
            assert_same(found[key], entry, f"{place}.{key}", absolute, relative)
    elif isinstance(stored, list):
        assert len(found) == len(stored), place
        for number, (one, other) in enumerate(zip(found, stored, strict=True)):
            assert_same(one, other, f"{place}[{number}]", absolute, relative)
    elif isinstance(stored, float):
        assert found == pytest.approx(stored, rel=relative, abs=absolute, nan_ok=True), place
    else:
        assert found == stored, place
