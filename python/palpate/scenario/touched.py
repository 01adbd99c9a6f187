"""[object.mesh] and [object.surface]: mesh and its surface properties."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, PlainSerializer, ValidationInfo, field_validator, model_validator

from palpate.contact.surface import SHADED_MOST
from palpate.scenario.fields import (
    Angle,
    Angle3,
    Flag,
    Fraction,
    Length,
    Number,
    OneDamping,
    OneLength,
    OneStiffness,
    Section,
    Size3,
    Whole,
)
from palpate.units import parse_quantity, write


class MeshChoice(Section):
    """[object.mesh]: mesh from a file, or a shape by formula; its origin lies at [object] position.

    Attributes:
        shape: "file"; "box", a cube with its origin at the center of its top (+z); or "bumpy_ellipsoid", an ellipsoid
            with smooth bumps and its origin at its top.
        file: STL, OBJ, PLY, OFF or GLB file, relative to the scenario's file; absolute after reading.
        unit: of the coordinates in the file, such as "mm".
        open: whether the surface may have a border.
        edge: of the box, m.
        size: of the ellipsoid along x, y, z without its bumps, m.
        bump: height of the bumps over the radius.
        divisions: of a box: squares of two triangles along an edge; of an ellipsoid: subdivisions of an icosahedron.
        rotation: rotation about the mesh's origin, about x, then y, then z of the device, rad.
        radius: of the tip, m; 0 for a point.
    """

    shape: Literal["file", "box", "bumpy_ellipsoid"] = "file"
    file: str | None = None
    unit: str | None = None
    open: Flag = False
    edge: Length | None = None
    size: Size3 | None = None
    bump: Fraction | None = None
    divisions: Whole | None = None
    rotation: Angle3 = (0.0, 0.0, 0.0)
    radius: OneLength = 0.0

    @field_validator("file")
    @classmethod
    def _resolve(cls, file: str | None, info: ValidationInfo) -> str | None:
        base = (info.context or {}).get("base")
        return str((Path(base) / file).resolve()) if file is not None and base is not None else file

    @model_validator(mode="after")
    def _complete(self) -> Self:
        needs = {
            "file": ("file", "unit"),
            "box": ("edge", "divisions"),
            "bumpy_ellipsoid": ("size", "bump", "divisions"),
        }
        examples = {"file": '"liver.stl"', "unit": '"mm"', "edge": '"80 mm"', "divisions": "8", "bump": "0.06",
                    "size": '["90 mm", "70 mm", "60 mm"]'}  # fmt: skip
        for key in needs[self.shape]:
            if getattr(self, key) is None:
                raise ValueError(f"{key} is missing; write for example {key} = {examples[key]}")
        for key in ("file", "unit", "edge", "size", "bump", "divisions"):
            if key not in needs[self.shape] and getattr(self, key) is not None:
                raise ValueError(f'{key} has no meaning for shape = "{self.shape}"')
        if self.divisions is not None:
            most = 500 if self.shape == "box" else 7
            if not 1 <= self.divisions <= most:
                raise ValueError(f"divisions: {self.divisions}; it must be between 1 and {most}")
        return self


def _values(value: object) -> tuple[float, ...]:
    entries = list(value) if isinstance(value, (list, tuple)) else [value]
    if not entries:
        raise ValueError('there must be at least one value, such as "1 N/mm"')
    numbers = tuple(parse_quantity(entry, "N/m") for entry in entries)
    if min(numbers) < 0.0:
        raise ValueError("must not be negative")
    return numbers


def _values_text(values: tuple[float, ...]) -> Any:
    texts = [write(value, "N/m") for value in values]
    return texts[0] if len(texts) == 1 else texts


class SurfaceChoice(Section):
    """[object.surface]: properties of the mesh's surface, as of palpate.Surface, with patterns of stiffness.

    Attributes:
        stiffness: along the normal, N/m: one value, or the values of the pattern in turn.
        pattern: "stripes" along the mesh's x, "checkerboard" along its x and y, or "listed". A listed stiffness has
            one value per triangle or per vertex. The other patterns begin at the lowest corner of the mesh.
        width: of a stripe or square, m.
        damping: along the normal, N*s/m.
        tangential: stiffness between tip and proxy along the surface, N/m; 0 for no tangential force and no friction.
            Default: the normal stiffness.
        static_friction: coefficient.
        dynamic_friction: coefficient; default: the static one.
        viscous: friction of a sliding proxy, N*s/m.
        field: "discrete" (one stiffness per triangle) or "continuous" (gradient of a potential).
        shading: angle of edges that force shading smooths, rad; 0 for none.
    """

    stiffness: Annotated[tuple[float, ...], BeforeValidator(_values), PlainSerializer(_values_text)] = Field(
        examples=['"1 N/mm"']
    )
    pattern: Literal["stripes", "checkerboard", "listed"] | None = None
    width: Length | None = None
    damping: OneDamping = 0.0
    tangential: OneStiffness | None = None
    static_friction: Number = 0.0
    dynamic_friction: Number | None = None
    viscous: OneDamping = 0.0
    field: Literal["discrete", "continuous"] = "discrete"
    shading: Angle = 0.0

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if len(self.stiffness) > 1 and self.pattern is None:
            raise ValueError('pattern is missing: several values need one, for example pattern = "stripes"')
        laid = self.pattern in ("stripes", "checkerboard")
        if laid and self.width is None:
            raise ValueError('width is missing: the width of a field of the pattern, for example width = "10 mm"')
        if not laid and self.width is not None:
            raise ValueError("width: belongs to a pattern of stripes or a checkerboard")
        if self.shading > SHADED_MOST:
            raise ValueError(f"shading: {math.degrees(self.shading):g} deg; it must be at most 85 deg")
        if self.dynamic_friction is not None and self.dynamic_friction > self.static_friction:
            raise ValueError(
                f"dynamic_friction: {self.dynamic_friction:g} must not exceed static_friction "
                f"({self.static_friction:g})"
            )
        return self
