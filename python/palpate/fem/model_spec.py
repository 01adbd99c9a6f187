"""Of which kind a body is: what made it answer as it does, so that it can be made again, and said."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

__all__ = ["PLAIN", "ModelSpec"]

# option: (unit that it is told in, how many of them an SI unit is)
_UNITS: Final = {
    "period": ("ms", 1e3),
    "slow_step": ("ms", 1e3),
    "rayleigh_beta": ("ms", 1e3),
    "retardation_time": ("ms", 1e3),
    "control_spacing": ("mm", 1e3),
    "rayleigh_alpha": ("1/s", 1.0),
}


class ModelSpec(NamedTuple):
    """A method of `Body`, what it was given, and the coefficients of friction."""

    name: str  # "compliance": none
    options: Mapping[str, float | str]  # in SI
    friction: tuple[float, float] = (0.0, 0.0)  # static, dynamic

    def __str__(self) -> str:
        elastic = self.options.get("instantaneous_ratio") == 1.0
        idle = {"instantaneous_ratio", "retardation_time"} if elastic else set()
        told = ", ".join(_told(o, value) for o, value in self.options.items() if value != 0.0 and o not in idle)
        static, dynamic = self.friction
        rough = f"friction {static:g}{f', {dynamic:g} sliding' if dynamic < static else ''}"
        return f"{self.name}{told and f' ({told})'}, {rough if static > 0.0 else 'no friction'}"


PLAIN: Final = ModelSpec("compliance", {})


def _told(option: str, value: float | str) -> str:
    if isinstance(value, str):
        return value
    unit, size = _UNITS.get(option, ("", 1.0))
    return f"{option} {value * size:g} {unit}".rstrip()
