"""[object.law], [object.field] and [object.texture]: force laws, force fields and textures."""

from __future__ import annotations

import math
from typing import Annotated, Any, Final, Literal, Self

import numpy as np
from pydantic import BeforeValidator, PlainSerializer, model_validator

from palpate.arrays import Array
from palpate.contact.force_law import law_fault
from palpate.scenario.fields import (
    Damping3,
    Duration,
    Flag,
    Force3,
    Frequency,
    Length,
    Number3,
    OneDamping,
    OneLength,
    OneMass,
    OneStiffness,
    Section,
    Whole,
    between,
)
from palpate.scenario.formula import evaluate_formula
from palpate.units import parse_quantity, write

MOST: Final = 100_000  # entries of a table


def _column(unit: str, example: str) -> Any:
    def read(value: object) -> tuple[float, ...]:
        if not isinstance(value, (list, tuple)) or not 2 <= len(value) <= MOST:
            raise ValueError(f"a list of 2 to {MOST} values such as {example}")
        return tuple(parse_quantity(entry, unit) for entry in value)

    return Annotated[
        tuple[float, ...], BeforeValidator(read), PlainSerializer(lambda values: [write(one, unit) for one in values])
    ]


Depths = _column("m", '["0 mm", "1 mm", "3 mm"]')
Forces = _column("N", '["0 N", "0.5 N", "3.5 N"]')
OneForce = Annotated[
    float, BeforeValidator(lambda value: parse_quantity(value, "N")), PlainSerializer(lambda value: write(value, "N"))
]


class LawChoice(Section):
    """[object.law]: force over depth, a table or a formula; both columns rise strictly from 0.

    Attributes:
        depth: of the table, m.
        force: of the table, N; linear between the entries, and beyond the last one.
        formula: force, N, of the depth x, m; plain numbers, + - * / ^, brackets, pi, abs, atan, cos, exp, log, sin,
            sqrt and tanh. It is tabulated; nothing is executed.
        deepest: last depth of the formula's table, m.
        entries: of the formula's table.
    """

    depth: Depths | None = None  # type: ignore[valid-type]
    force: Forces | None = None  # type: ignore[valid-type]
    formula: str | None = None
    deepest: Length | None = None
    entries: Annotated[Whole, between(2, MOST, " entries")] = 1001

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if (self.formula is None) == (self.depth is None and self.force is None):
            raise ValueError('give depth and force, a table, or formula and deepest, for example formula = "500 * x"')
        if self.formula is None:
            for key in ("depth", "force"):
                if getattr(self, key) is None:
                    raise ValueError(f"{key} is missing: a table has depth and force")
            if self.deepest is not None:
                raise ValueError("deepest belongs to a formula")
        elif self.deepest is None:
            raise ValueError('deepest is missing: the last depth of the formula, for example deepest = "10 mm"')
        fault = law_fault(*self.table())
        if fault:
            raise ValueError(fault)
        return self

    def table(self) -> tuple[Array, Array]:
        """Return depths, m, and forces, N, (n,) each."""
        if self.formula is None:
            return np.array(self.depth, dtype=float), np.array(self.force, dtype=float)
        assert self.deepest is not None  # checked
        depth = np.linspace(0.0, self.deepest, self.entries)
        try:
            return depth, evaluate_formula(self.formula, depth)
        except ValueError as problem:
            raise ValueError(f"formula: {problem}") from None


_NEEDS: Final = {
    "constant": {"force": '["0 N", "-1 N", "0 N"]'},
    "viscous": {"damping": '"2 N*s/m"'},
    "gravity_well": {"stiffness": '"200 N/m"', "radius": '"20 mm"'},
    "vibration": {"force": '["0 N", "0 N", "0.5 N"]', "frequency": '"150 Hz"'},
    "virtual_mass": {"mass": '"0.2 kg"', "stiffness": '"500 N/m"'},
}
_MAY: Final = {
    "gravity_well": ("largest_force",),
    "vibration": ("decay", "at_contact"),
    "virtual_mass": ("coupling_damping",),
}


class FieldChoice(Section):
    """[object.field]: force field that acts without a surface.

    Attributes:
        kind: "constant", "viscous" (drag), "gravity_well" (attraction to [object] position), "vibration" or
            "virtual_mass" (a free mass on a spring and a damper, carried by the tip).
        force: of a constant field on the tip, or amplitude of a vibration, N.
        damping: of a viscous field per axis, N*s/m.
        stiffness: of a gravity well, or of the spring that carries a virtual mass, N/m.
        radius: beyond which a gravity well has no force, m.
        largest_force: of a gravity well, N; None: stiffness times radius.
        frequency: of a vibration, Hz.
        decay: time constant of a vibration, s; None: it does not decay.
        at_contact: whether a vibration begins anew whenever the tip enters the half-space below the plane through
            [object] position with [object] normal, and ends when it leaves.
        mass: virtual, kg.
        coupling_damping: of the damper that carries a virtual mass, N*s/m.
    """

    kind: Literal["constant", "viscous", "gravity_well", "vibration", "virtual_mass"]
    force: Force3 | None = None
    damping: Damping3 | None = None
    stiffness: OneStiffness | None = None
    radius: Length | None = None
    largest_force: OneForce | None = None
    frequency: Frequency | None = None
    decay: Duration | None = None
    at_contact: Flag = False
    mass: OneMass | None = None
    coupling_damping: OneDamping = 0.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needs = _NEEDS[self.kind]
        for key, example in needs.items():
            if getattr(self, key) is None:
                raise ValueError(f'{key} is missing: kind = "{self.kind}" needs for example {key} = {example}')
        stray = sorted(self.model_fields_set - {"kind", *needs, *_MAY.get(self.kind, ())})
        if stray:
            raise ValueError(f'{stray[0]} has no meaning for kind = "{self.kind}"')
        for key in ("stiffness", "mass", "largest_force"):
            value = getattr(self, key)
            if value is not None and not value > 0.0:
                raise ValueError(f"{key} must be positive")
        return self

    @property
    def cap(self) -> float:
        """Largest force of a gravity well, N."""
        return math.inf if self.largest_force is None else self.largest_force


class TextureChoice(Section):
    """[object.texture]: sinusoidal texture of a wall, along one direction; it gives `height` or `lateral_force`.

    Attributes:
        wavelength: m.
        across: direction in which the texture varies; its part along the normal is removed, and its length is 1 then.
        height: amplitude of the surface's height, m.
        lateral_force: amplitude of a force along `across` while the tip touches, N.
    """

    wavelength: Length
    across: Number3
    height: OneLength = 0.0
    lateral_force: OneForce = 0.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.lateral_force < 0.0:
            raise ValueError("lateral_force must not be negative")
        if self.height == 0.0 and self.lateral_force == 0.0:
            raise ValueError('height is missing; write height = "0.1 mm" or lateral_force = "0.2 N"')
        return self

    def direction(self, normal: tuple[float, float, float]) -> Array:
        """Return the unit direction in which the texture varies on a plane (3,).

        Raises:
            ValueError: `across` is along the normal.
        """
        n, across = np.array(normal), np.array(self.across)
        along: Array = across - float(across @ n) * n
        if not np.linalg.norm(along) > 1e-6 * np.linalg.norm(across):
            raise ValueError("texture.across: it must not be along the normal, for example [1, 0, 0]")
        unit = along / np.linalg.norm(along)
        unit -= (unit @ n) * n  # rounding
        return np.asarray(unit / np.linalg.norm(unit), dtype=float)
