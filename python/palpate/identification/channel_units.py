"""Units of the channels of a recording, and their size in SI."""

from __future__ import annotations

from typing import Final

import numpy as np

from palpate.errors import RecordingError

_TORQUE: Final = ("a torque", {"N*m": 1.0, "mN*m": 1e-3, "N*mm": 1e-3}, {"N": 1.0, "mN": 1e-3})
# channel: (name in messages, units of a revolute joint, units of a sliding joint)
CHANNELS: Final[dict[str, tuple[str, dict[str, float], dict[str, float]]]] = {
    "time": ("time", {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6}, {}),
    "angle": (
        "a joint",
        {"rad": 1.0, "mrad": 1e-3, "deg": np.pi / 180.0},
        {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6},
    ),
    "torque": _TORQUE,
    "excitation": _TORQUE,
}


def channel_scale(channel: str, unit: str, where: str) -> tuple[float, bool]:
    """Return the size of `unit` in SI, and whether it belongs to a sliding joint.

    Raises:
        RecordingError: the channel does not have this unit; the message begins with `where`.
    """
    name, revolute, sliding = CHANNELS[channel]
    plain = unit.replace("·", "*").replace("⋅", "*").replace(" ", "*").replace("μ", "µ")
    if plain in {"Nm", "mNm"}:
        plain = plain[:-1] + "*m"
    known = revolute | sliding
    if plain not in known:
        said = f"has unit '{unit}'" if unit else "has no unit"
        raise RecordingError(f"{where} {said}; {name} is in {', '.join(known)}")
    return known[plain], plain in sliding
