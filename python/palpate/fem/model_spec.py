"""Specification of a body's material model: enough to make the body again, and to print it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple, get_args

from palpate.fem.support_changes import SupportPlan

Law = Literal["neo-hookean", "corotational"]
LAWS: Final = get_args(Law)
ContactLaw = Literal["node_normals", "signed_distance"]
CONTACTS: Final = get_args(ContactLaw)

# option: (unit in which it is printed, that unit per SI unit)
_UNITS: Final = {
    "period": ("ms", 1e3),
    "update_interval": ("ms", 1e3),
    "rayleigh_beta": ("ms", 1e3),
    "retardation_time": ("ms", 1e3),
    "rayleigh_alpha": ("1/s", 1.0),
    "density": ("kg/m^3", 1.0),
}


class ModelSpec(NamedTuple):
    """Name of a method of `Body`, its options and the friction coefficients."""

    name: str  # "compliance": linear elastic and massless, without a method
    options: Mapping[str, float | str]  # SI
    friction: tuple[float, float] = (0.0, 0.0)  # static, dynamic
    contact_points: tuple[tuple[float, ...], ...] = ()  # of a tool, see `Body.with_contact_points`
    supports: SupportPlan | None = None  # see `Body.with_support_changes`

    @property
    def by_distance(self) -> bool:
        """Whether the contact is by signed distance."""
        return "signed_distance" in (self.name, self.options.get("contact"))

    def __str__(self) -> str:
        elastic = self.options.get("instantaneous_ratio") == 1.0
        unused = {"instantaneous_ratio", "retardation_time"} if elastic else set()
        options = ", ".join(
            _format_option(option, value)
            for option, value in self.options.items()
            if value != 0.0 and option not in unused
        )
        static, dynamic = self.friction
        friction = f"friction {static:g}{f', {dynamic:g} sliding' if dynamic < static else ''}"
        tool = f", tool of {len(self.contact_points)} tips" if self.contact_points else ""
        count = 0 if self.supports is None else len(self.supports.changes)
        changes = f", {count} change{'' if count == 1 else 's'} of supports" if self.supports is not None else ""
        return f"{self.name}{options and f' ({options})'}, {friction if static > 0.0 else 'no friction'}{tool}{changes}"


COMPLIANCE: Final = ModelSpec("compliance", {})


def _format_option(option: str, value: float | str) -> str:
    if isinstance(value, str):
        return value
    unit, size = _UNITS.get(option, ("", 1.0))
    return f"{option} {value * size:g} {unit}".rstrip()
