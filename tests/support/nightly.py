"""Long tests: PALPATE_NIGHTLY runs them, as `make nightly` does."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Final, TypeVar

import pytest

NIGHTLY: Final = os.environ.get("PALPATE_NIGHTLY", "") not in {"", "0"}
nightly: Final = pytest.mark.skipif(not NIGHTLY, reason="a long test: set PALPATE_NIGHTLY")
T = TypeVar("T")


def some(values: Sequence[T], count: int = 1) -> Sequence[T]:
    """Return the first values, `count` of them; with PALPATE_NIGHTLY all."""
    return values if NIGHTLY else values[:count]
