"""[object] and [objects.NAME]: virtual objects."""

from __future__ import annotations

import math
import re
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, field_validator, model_validator

from palpate.scenario.body import BodyChoice
from palpate.scenario.fields import Damping3, Number3, Position3, Section, Stiffness3
from palpate.scenario.force_objects import FieldChoice, LawChoice, TextureChoice
from palpate.scenario.frame import FrameMotion
from palpate.scenario.touched import MeshChoice, SurfaceChoice

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
_TAKEN: Final = ("object", "command", "motor", "reference", "operator", "frame")  # beginnings of channel names
_TABLES: Final = {  # of a kind, each with an example of its content
    "mesh": {"mesh": 'shape = "box"', "surface": 'stiffness = "1 N/mm"'},
    "body": {"body": 'shape = "phantom" and radius = "8 mm"'},
    "force_law": {"law": 'formula = "500 * x" and deepest = "10 mm"'},
    "field": {"field": 'kind = "viscous" and damping = "2 N*s/m"'},
    "textured_wall": {"texture": 'wavelength = "2 mm", across = [1, 0, 0] and height = "0.1 mm"'},
}
_KEYS: Final = {  # of a kind, besides its tables, kind, position and frame
    "force_law": {"normal"},
    "field": {"normal"},
    "textured_wall": {"normal", "stiffness", "damping"},
}


class Object(Section):
    """[object]: virtual object.

    Attributes:
        kind: "none", "spring" (bilateral, anchored at the start tip), "wall" (unilateral), "textured_wall", "force_law"
            (a plane with a force over the depth), "field" (a force without a surface), "mesh" or "body" (deformable).
        stiffness: N/m per axis; the same for all axes of a wall. Of springs and walls.
        damping: N*s/m per axis. Of springs and walls.
        coupling: difference that samples the damper's speed, "backward" or "bilinear" (Hosseini-Zadeh 2004, 3.34).
        position: from the start tip, m: of the spring's anchor, of a point on the wall or plane, of the center of a
            field, or of the origin of a mesh or body.
        normal: outward normal of a wall or plane; of unit length after reading.
        mesh: of the kind "mesh".
        surface: of the kind "mesh".
        body: of the kind "body".
        law: of the kind "force_law".
        field: of the kind "field".
        texture: of the kind "textured_wall".
        frame: motion of the object over time; None: it rests.
    """

    kind: Literal["none", "spring", "wall", "mesh", "body", "force_law", "field", "textured_wall"] = "spring"
    stiffness: Stiffness3 | None = None
    damping: Damping3 = (0.0, 0.0, 0.0)
    coupling: Literal["backward", "bilinear"] = "backward"
    position: Position3 = (0.0, 0.0, 0.0)
    normal: Number3 | None = None
    mesh: MeshChoice | None = None
    surface: SurfaceChoice | None = None
    body: BodyChoice | None = None
    law: LawChoice | None = None
    field: FieldChoice | None = None
    texture: TextureChoice | None = None
    frame: FrameMotion | None = None

    @field_validator("normal")
    @classmethod
    def _unit(cls, normal: tuple[float, float, float] | None) -> tuple[float, float, float] | None:
        if normal is None:
            return None
        length = math.hypot(*normal)
        if length == 0.0:
            raise ValueError("a normal must point somewhere, for example [0, 0, 1]")
        x, y, z = (component / length for component in normal)
        return x, y, z

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.kind == "none":
            stray = sorted(self.model_fields_set - {"kind"})
            if stray:
                raise ValueError(f'{stray[0]} has no meaning for kind = "none"')
        elif self.kind in _TABLES:
            self._check_tables()
        if self.kind in ("spring", "wall", "textured_wall") and self.stiffness is None:
            raise ValueError('stiffness is missing; write for example stiffness = "3.5 N/mm"')
        self._check_normal()
        if self.kind in ("wall", "textured_wall"):
            for key in ("stiffness", "damping"):
                if len({*(getattr(self, key) or ())}) > 1 and (key == "stiffness" or self.kind == "textured_wall"):
                    raise ValueError(f"a wall has one {key}, along its normal")
        for key in (key for tables in _TABLES.values() for key in tables):
            kind = next(kind for kind, tables in _TABLES.items() if key in tables)
            if self.kind != kind and getattr(self, key) is not None:
                raise ValueError(f'{key} belongs to kind = "{kind}"')
        if self.body is not None and self.body.contact_points and self.frame is not None and self.frame.rotation:
            raise ValueError("body.contact_points: a tool does not go with a body that turns; remove frame.rotation")
        if self.texture is not None and self.normal is not None:
            self.texture.direction(self.normal)
        return self

    def _check_normal(self) -> None:
        """Raise ValueError for a plane without a normal, or a normal without a plane."""
        at_contact = self.field is not None and self.field.at_contact
        names = {"wall": "a wall", "textured_wall": "a wall", "force_law": "a force law"}
        if (self.kind in names or at_contact) and self.normal is None:
            name = "a vibration at contact" if at_contact else names[self.kind]
            raise ValueError(f"{name} needs its outward normal, for example normal = [0, 0, 1]")
        if self.kind not in names and not at_contact and self.normal is not None:
            raise ValueError('normal belongs to kind = "wall", "textured_wall" and "force_law"')

    def _check_tables(self) -> None:
        """Raise ValueError for a kind without its tables, or with keys of another kind."""
        tables = _TABLES[self.kind]
        for key, example in tables.items():
            if getattr(self, key) is None:
                raise ValueError(f"{key} is missing; write a table [object.{key}] with for example {example}")
        stray = sorted(self.model_fields_set - {"kind", "position", "frame", *tables, *_KEYS.get(self.kind, set())})
        if stray:
            whose = {
                "mesh": "a mesh has its own in [object.surface]",
                "body": "a body's follows from its material",
                "force_law": "the law has its own in [object.law]",
                "field": "a field has its own in [object.field]",
            }
            where = f" ({whose[self.kind]})" if stray[0] in ("stiffness", "damping") else ""
            raise ValueError(f'{stray[0]} has no meaning for kind = "{self.kind}"{where}')


def _named(objects: dict[str, Object]) -> dict[str, Object]:
    if not 1 <= len(objects) <= 64:
        raise ValueError(f"{len(objects)} tables [objects.NAME]; a scene has 1 to 64")
    for name, chosen in objects.items():
        if not _NAME.fullmatch(name) or name in _TAKEN:
            raise ValueError(
                f'"{name}" cannot name an object, as its channels are NAME_force and so on: take letters, digits and '
                f"underscores, and none of {', '.join(_TAKEN)}"
            )
        if chosen.kind == "none":
            raise ValueError(f'the object {name} has kind = "none"; remove its table')
    return objects


NamedObjects = Annotated[dict[str, Object], AfterValidator(_named)]
