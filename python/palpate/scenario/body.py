"""[object.body]: deformable body, its material model and pose, and the tip."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from itertools import pairwise
from os.path import isfile
from pathlib import Path
from typing import Annotated, Any, Final, Literal, NamedTuple, Self

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    PlainSerializer,
    ValidationInfo,
    field_validator,
    model_validator,
)

from palpate.checks import tool_mistake
from palpate.scenario.fields import (
    NOT_NEGATIVE,
    POSITIVE,
    Angle3,
    Length,
    Number,
    OneLength,
    Position3,
    Pressure,
    Section,
    Size3,
    Time,
    Whole,
    must,
)
from palpate.scenario.tool_motion import ToolMotion, turned
from palpate.units import parse_quantity, write


class Option(NamedTuple):
    """Option of a material model: its SI unit, its check, and whether it is required."""

    unit: str
    check: AfterValidator = NOT_NEGATIVE
    needed: bool = False


_RATIO: Final = must(
    lambda value: value >= 1.0, "must be 1 or more: the instantaneous stiffness is at least the long-term stiffness"
)
_COUNT: Final = must(lambda value: value in range(4, 65), "must be a whole number, from 4 to 64")
_FRICTION: Final = {"static_friction": Option(""), "dynamic_friction": Option("")}
_DAMPING: Final = {"rayleigh_alpha": Option("1/s"), "rayleigh_beta": Option("s")}
_CREEP: Final = {"instantaneous_ratio": Option("", _RATIO), "retardation_time": Option("s", POSITIVE)}
_UPDATE: Final = {"update_interval": Option("s", POSITIVE)}
_SPRINGS: Final = {
    "hardening_strain": Option("", POSITIVE),
    "exponent": Option("", must(lambda value: value != 0.0, "must not be zero")),
    "stiffness_limit": Option("", must(lambda value: 1.0 < value <= 100.0, "must be above 1 and at most 100")),
}
_SLOW: Final = {
    **_UPDATE,
    "nodes_per_tip": Option("", _COUNT),
    "density": Option("kg/m^3", POSITIVE),
    **_DAMPING,
    **_CREEP,
    **_FRICTION,
}
# A kind stands for `Body.kind(period, **options)`, a law for `Body.hyperelastic(period, law=kind, **options)`.
KINDS: Final[dict[str, dict[str, Option]]] = {
    "compliance": {**_UPDATE, **_FRICTION},
    "signed_distance": {"sideways_fraction": Option(""), **_UPDATE, **_FRICTION},
    "modal": {**_DAMPING, **_CREEP, **_UPDATE, **_FRICTION},
    "mass_spring": {**_DAMPING, **_SPRINGS, **_UPDATE, **_FRICTION},
    "viscoelastic": {**{key: option._replace(needed=True) for key, option in _CREEP.items()}, **_UPDATE, **_FRICTION},
    "neo-hookean": _SLOW,
    "corotational": _SLOW,
}
LARGE: Final = ("neo-hookean", "corotational")  # kinds with inertia if they have a density
WITH_CONTACT: Final = ("modal", "viscoelastic")  # kinds whose contact is a choice
ContactLaw = Literal["node_normals", "signed_distance"]
# shape: its keys, with an example of a required one
_SHAPES: Final[dict[str, dict[str, str]]] = {
    "file": {"file": '"liver.h5"'},
    "block": {"size": '["100 mm", "100 mm", "50 mm"]', "young": '"10 kPa"', "spacing": '"5 mm"', "poisson": "",
              "modes": ""},
    "phantom": dict.fromkeys(("young", "spacing", "poisson", "modes", "contrast", "depth", "diameter",
                              "layer_thickness", "layer_young"), ""),
}  # fmt: skip


def _options_text(options: Mapping[str, float]) -> dict[str, Any]:
    units = {key: option.unit for known in KINDS.values() for key, option in known.items()}
    return {key: write(value, units[key]) if units[key] else value for key, value in options.items()}


Poisson = Annotated[Number, must(lambda value: value < 0.5, "must be below 0.5 (soft tissue: 0.45 to 0.495)")]


def _listed(regions: Any) -> Any:
    return (regions,) if isinstance(regions, str) else regions


class SupportChoice(Section):
    """[[object.body.supports]]: supports and contact area from a time on; a key that is missing stays as before.

    Attributes:
        at: s, after the start of the run.
        held: regions whose contact nodes are held; none: released.
        touchable: regions whose contact nodes the tip can touch; none: all of them.
    """

    at: Time = Field(examples=['"1 s"'])
    held: Annotated[tuple[str, ...] | None, BeforeValidator(_listed)] = None
    touchable: Annotated[tuple[str, ...] | None, BeforeValidator(_listed)] = None

    @model_validator(mode="after")
    def _changes(self) -> Self:
        if self.held is None and self.touchable is None:
            raise ValueError('it changes nothing; write for example held = ["x < 10 mm"], or held = [] to release')
        return self


class BodyChoice(Section):
    """[object.body]: body from a file, or a block or phantom; its `origin` lies at [object] position.

    Attributes:
        shape: "file"; "block", fixed at its bottom, with contact at its top; or "phantom", see `palpate.fem.phantom`.
        file: of `palpate body build` (.h5), relative to the scenario's file; absolute after reading.
        size: of the block along x, y, z, m.
        young: Young's modulus, Pa; poisson: Poisson's ratio, below 0.5.
        spacing: of the cells, m.
        modes: number of vibration modes, for the kind "modal".
        contrast, depth, diameter, layer_thickness, layer_young: of the phantom, as `palpate.fem.phantom`.
        kind: material model, a key of `KINDS`; "neo-hookean" and "corotational" are for large displacements.
        contact: "signed_distance" or "node_normals", of the kinds "modal" and "viscoelastic"; None: "node_normals".
        options: of the kind, in SI: any other key of the table.
        origin: point in the body frame that lies at [object] position, m. Default: the center of the top of a block or
            phantom, the origin of the frame of a file.
        rotation: rotation about that point, about x, then y, then z of the device, rad.
        stiffness_scale: factor on every Young's modulus.
        held: regions whose contact nodes are held in place, see `palpate.fem.Body.held`.
        supports: changes at run time, see `palpate.fem.Body.with_support_changes`; (): `palpate.Loop` may change them.
            None: they do not change.
        tip: "sphere", or "flat" for the end of a rod along the body's z axis.
        radius: of the tip, m.
        contact_points: of a tool: centers of its equal tips less the device's tip, device frame, m, 8 at most. None:
            the device's tip touches the body itself. Contact by signed distance only.
        tool: motion of the contact points, of a tool that turns or a gripper; None: they move with the tip.
    """

    shape: Literal["file", "block", "phantom"] = "file"
    file: str | None = None
    size: Size3 | None = None
    young: Pressure | None = None
    poisson: (
        Annotated[Number, must(lambda value: value < 0.5, "must be below 0.5 (soft tissue: 0.45 to 0.495)")] | None
    ) = None
    spacing: Length | None = None
    modes: Annotated[Whole, NOT_NEGATIVE] | None = None
    contrast: Annotated[Number, POSITIVE] | None = None
    depth: Length | None = None
    diameter: Length | None = None
    layer_thickness: OneLength | None = None
    layer_young: Pressure | None = None
    kind: str = "compliance"
    contact: ContactLaw | None = None
    origin: Position3 | None = None
    rotation: Angle3 = (0.0, 0.0, 0.0)
    tip: Literal["sphere", "flat"] = "sphere"
    radius: Length = Field(examples=['"8 mm"'])
    contact_points: tuple[Position3, ...] = ()
    tool: ToolMotion | None = None
    stiffness_scale: Annotated[Number, POSITIVE] = 1.0
    held: Annotated[tuple[str, ...], BeforeValidator(_listed)] = ()
    supports: tuple[SupportChoice, ...] | None = None
    options: Annotated[dict[str, float], PlainSerializer(_options_text)] = Field(default_factory=dict)

    @property
    def by_distance(self) -> bool:
        """Whether the contact is by signed distance."""
        return "signed_distance" in (self.kind, self.contact)

    @model_validator(mode="before")
    @classmethod
    def _sort(cls, table: Any) -> Any:
        """Gather the options of the kind under `options`, in SI."""
        kind = table.get("kind", "compliance") if isinstance(table, Mapping) else None
        if not isinstance(kind, str) or kind not in KINDS:
            return table
        known = KINDS[kind]
        mine = [key for key in cls.model_fields if key != "options"]
        for key in table:
            if key in known or key in cls.model_fields:
                continue
            takers = ", ".join(kind for kind, of in KINDS.items() if key in of)
            if takers:
                raise ValueError(f'unknown key "{key}"; {kind} does not take it, only {takers}')
            close = difflib.get_close_matches(str(key), [*mine, *known], 1)
            hint = f"did you mean {close[0]}?" if close else f"there are {', '.join([*mine, *known])}"
            raise ValueError(f'unknown key "{key}"; {hint}')
        loose = {key: value for key, value in table.items() if key in known}
        nested = table.get("options", {})
        if not isinstance(nested, Mapping):
            raise ValueError(f"options: {nested!r} is not a table")
        given = {**nested, **loose}
        options = {}
        for key, value in given.items():
            if key not in known:
                raise ValueError(f'unknown key "{key}"; {kind} takes {", ".join(known)}')
            try:
                options[key] = parse_quantity(value, known[key].unit)
            except ValueError as problem:
                raise ValueError(f"{key}: {problem}") from None
            try:
                known[key].check.func(options[key])  # type: ignore[call-arg]
            except ValueError as problem:
                shown = f'"{value}"' if isinstance(value, str) else value
                raise ValueError(f"{key}: {shown} {problem}") from None
        return {**{key: value for key, value in table.items() if key not in known}, "options": options}

    @field_validator("kind")
    @classmethod
    def _known(cls, kind: str) -> str:
        if kind not in KINDS:
            close = difflib.get_close_matches(kind, KINDS, 1)
            hint = f"; did you mean {close[0]}?" if close else ""
            raise ValueError(f'"{kind}" is not one of {", ".join(KINDS)}{hint}')
        return kind

    @field_validator("file")
    @classmethod
    def _resolve(cls, file: str | None, info: ValidationInfo) -> str | None:
        base = (info.context or {}).get("base")
        if file is None:
            return None
        path = Path(file) if base is None else (Path(base) / file).resolve()
        if not isfile(path):  # unlike Path.is_file(), no error for a name that is too long
            raise ValueError(f"{path}: there is no such file; palpate body build or palpate body phantom makes one")
        return str(path)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        mine = _SHAPES[self.shape]
        for key, example in mine.items():
            if example and getattr(self, key) is None:
                raise ValueError(f"{key} is missing; write for example {key} = {example}")
        for key in sorted({key for keys in _SHAPES.values() for key in keys} - set(mine)):
            if getattr(self, key) is not None:
                raise ValueError(f'{key} has no meaning for shape = "{self.shape}"')
        if self.contact is not None and self.kind not in WITH_CONTACT:
            raise ValueError(f"contact has no meaning for {self.kind}, only for {', '.join(WITH_CONTACT)}")
        if self.contact_points:
            if "signed_distance" not in (self.kind, self.contact):
                raise ValueError(
                    'contact_points: a tool needs the contact by signed distance; write kind = "signed_distance", or '
                    f'contact = "signed_distance" with {" or ".join(WITH_CONTACT)}'
                )
            if mistake := tool_mistake(self.contact_points, self.radius):
                raise ValueError(f"contact_points: {mistake}")
        if self.tool is not None:
            try:
                self.tool.check(self.contact_points, self.radius, self.flat_axis)
            except ValueError as mistake:
                raise ValueError(f"tool: {mistake}") from None
        for key, option in KINDS[self.kind].items():
            if option.needed and key not in self.options:
                example = f'"20 {option.unit}"' if option.unit else "2.0"
                raise ValueError(f"{key} is missing: {self.kind} needs it, for example {key} = {example}")
        if self.kind in LARGE and "density" not in self.options:
            for key in _DAMPING:
                if self.options.get(key, 0.0) > 0.0:
                    raise ValueError(
                        f"{key}: without density {self.kind} has no inertia, so it takes no damping; write for example "
                        'density = "1000 kg/m^3"'
                    )
        if self.supports is not None:
            self._check_supports(self.supports)
        static, dynamic = (self.options.get(key, 0.0) for key in _FRICTION)
        if dynamic > static:
            raise ValueError(f"dynamic_friction: {dynamic:g} must not exceed static_friction ({static:g})")
        return self

    @property
    def flat_axis(self) -> tuple[float, float, float] | None:
        """Axis of a flat tip, device frame; None of a sphere."""
        if self.tip != "flat":
            return None
        x, y, z = turned((0.0, 0.0, 1.0), [self.rotation])[0].tolist()
        return x, y, z

    def _check_supports(self, changes: tuple[SupportChoice, ...]) -> None:
        for_all = "held holds nodes of any kind over the whole run"
        if self.kind in ("viscoelastic", "modal") and self.contact != "signed_distance":
            raise ValueError(
                "supports: supports that change at run time need the contact by signed distance; write "
                f'contact = "signed_distance"; {for_all}'
            )
        if self.kind not in ("compliance", "signed_distance", "viscoelastic", "modal"):
            raise ValueError(
                "supports: supports that change at run time need a body of the kind compliance, signed_distance, "
                f"viscoelastic or modal; {for_all}"
            )
        if self.kind == "modal" and self.options.get("instantaneous_ratio", 1.0) > 1.0:
            raise ValueError(
                "supports: the supports of a body with inertia that relaxes do not change; remove "
                f'instantaneous_ratio, or write kind = "viscoelastic"; {for_all}'
            )
        if self.kind == "compliance" and self.options.get("static_friction", 0.0) > 0.0:
            raise ValueError(
                f'supports: with friction, supports that change at run time need kind = "signed_distance"; {for_all}'
            )
        for before, change in pairwise(changes):
            if change.at <= before.at:
                raise ValueError(f"supports: the times must increase, and {change.at:g} s follows {before.at:g} s")
