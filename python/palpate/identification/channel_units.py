"""Units that a recording may be written in, and their size in SI."""

from __future__ import annotations

import numpy as np

from palpate.errors import RecordingError

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}
ANGLE_UNITS = {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0}
LENGTH_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6}
TORQUE_UNITS = {"N*m": 1.0, "mN*m": 1e-3, "N*mm": 1e-3}
FORCE_UNITS = {"N": 1.0, "mN": 1e-3}


def scale_of(unit: str, table: dict[str, float], where: str, what: str) -> float:
    """Return the size in SI of `unit`; raises RecordingError that says `where` and which units `what` may have."""
    plain = unit.replace("·", "*").replace("⋅", "*").replace(" ", "*").replace("μ", "µ")
    if plain in {"Nm", "mNm"}:
        plain = plain[:-1] + "*m"
    if plain not in table:
        said = f"has unit '{unit}'" if unit else "has no unit"
        raise RecordingError(f"{where} {said}; {what} is in {', '.join(dict.fromkeys(table))}")
    return table[plain]


def joint_scale(
    unit: str, angular: dict[str, float], linear: dict[str, float], where: str, what: str
) -> tuple[float, bool]:
    """Scale to SI, and whether the joint slides."""
    table = linear if unit.replace("μ", "µ") in linear else angular | linear
    return scale_of(unit, table, where, what), table is linear
