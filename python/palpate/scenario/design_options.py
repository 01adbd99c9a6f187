"""Options of the design functions in a scenario's [controller], with their units."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any, Final

from palpate.units import parse_quantity, write

FLAG: Final = "true or false"

# kind: option: (unit or FLAG, whether it may differ between the axes)
OPTIONS: Final[dict[str, dict[str, tuple[str, bool]]]] = {
    "lead_lag": {
        "stiffness": ("N/m", True),
        "crossover": ("rad/s", True),
        "phase_margin": ("rad", True),
        "steady_error": ("", True),
        "decouple": (FLAG, False),
        "smooth_reference": (FLAG, False),
    },
    "lqg": {
        "stiffness": ("N/m", True),
        "integrators": (FLAG, False),
        "force_weight": ("", False),
        "speed_weight": ("s", False),
        "integral_rate": ("1/s", False),
        "disturbance": ("N", True),
        "noise": ("N", True),
        "windup_time": ("s", False),
    },
    "workspace": {
        "bandwidth": ("rad/s", False),
        "damping": ("", False),
        "observer": ("", False),
        "disturbance": ("", False),
        "reference": ("rad/s", False),
        "reference_damping": ("", False),
        "share": ("", False),
        "stiffness": ("N/m", True),
        "normal_only": (FLAG, False),
        "operator_mass": ("kg", False),
    },
}


def sort_options(table: Any, known: set[str]) -> Any:
    """Return the table with the design's options, in SI, gathered under `options`.

    Raises:
        ValueError: an unknown option, or a value with the wrong dimension.
    """
    if not isinstance(table, Mapping):
        return table
    kind = str(table.get("kind", "none"))
    if kind not in OPTIONS:
        return table
    kept = {key: value for key, value in table.items() if key in known and key != "options"}
    loose = {key: value for key, value in table.items() if key not in known}
    nested = table.get("options", {})
    if not isinstance(nested, Mapping):
        raise ValueError("options must be a table")
    return {**kept, "options": {key: _value(kind, key, value) for key, value in {**nested, **loose}.items()}}


def _value(kind: str, key: str, value: Any) -> Any:
    known = OPTIONS[kind]
    if key not in known:
        close = difflib.get_close_matches(key, [*known, "kind"], 1)
        hint = f"did you mean {close[0]}?" if close else f"{kind} takes {', '.join(known)}"
        raise ValueError(f'unknown key "{key}"; {hint}')
    unit, axes = known[key]
    if unit == FLAG:
        if not isinstance(value, bool):
            raise ValueError(f"{key}: {value!r} is neither true nor false")
        return value
    try:
        if axes and isinstance(value, (list, tuple)):
            return parse_quantity(value, unit, size=3)
        return parse_quantity(value, unit)
    except ValueError as problem:
        raise ValueError(f"{key}: {problem}") from None


def options_text(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return options as text with units, as `sort_options` reads them."""
    units = {key: unit for known in OPTIONS.values() for key, (unit, _) in known.items()}

    def text(key: str, value: Any) -> Any:
        if isinstance(value, (list, tuple)):
            return [text(key, entry) for entry in value]
        return value if isinstance(value, bool) or not units[key] else write(value, units[key])

    return {key: text(key, value) for key, value in options.items()}
