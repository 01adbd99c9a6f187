"""Reading of JSON text from unknown sources: bounded length, depth and digits, finite numbers."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, Final, NoReturn

from palpate.errors import PalpateError

_LARGEST: Final = 16_000_000  # characters
_DEEPEST: Final = 100  # levels of tables and lists


def load_json(text: object, error: type[PalpateError], where: str) -> Any:
    """Return the value of JSON text.

    Raises:
        error: it is no text, no JSON, too long or too deeply nested, or a number is not finite or has too many digits.
    """
    if not isinstance(text, str):
        raise error(f"{where}: not JSON text")
    if len(text) > _LARGEST:
        raise error(f"{where}: {len(text)} characters; JSON text has at most {_LARGEST}")
    try:
        value = json.loads(text, parse_constant=_refuse, parse_float=_finite)
    except json.JSONDecodeError as problem:
        raise error(f"{where}: not JSON ({problem.msg})") from None
    except RecursionError:
        raise error(f"{where}: not usable JSON (nested too deeply)") from None
    except ValueError as problem:
        reason = "an integer of thousands of digits" if "digits" in str(problem) else str(problem)
        raise error(f"{where}: not usable JSON ({reason})") from None
    if reason := unusable([value]):
        raise error(f"{where}: not usable JSON ({reason})")
    return value


def unusable(value: Mapping[str, Any] | list[Any]) -> str:
    """Return why nested tables and lists cannot be used by other code; "" if they can.

    They are nested so deeply that recursion exceeds Python's stack, or an integer exceeds 64 bits, so that it may have
    no text and no floating-point number.
    """
    level: list[Any] = [value]
    for _ in range(_DEEPEST):
        inner: list[Any] = []
        for entry in level:
            for one in entry.values() if isinstance(entry, Mapping) else entry:
                if isinstance(one, Mapping | list):
                    inner.append(one)
                elif isinstance(one, int) and not -(2**63) <= one < 2**63:
                    return "an integer of more than 64 bits"
        if not inner:
            return ""
        level = inner
    return f"nested more than {_DEEPEST} deep"


def load_table(text: object, error: type[PalpateError], where: str) -> dict[str, Any]:
    """Return the value of JSON text that is an object. Raise as `load_json`."""
    value = load_json(text, error, where)
    if not isinstance(value, dict):
        raise error(f"{where}: a JSON object is expected")
    return value


def _refuse(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a finite number")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is not a finite number")
    return value
