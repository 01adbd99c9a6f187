"""[object] and [objects.NAME]: virtual objects."""

from __future__ import annotations

import math
import re
from typing import Annotated, Final, Literal, Self

from pydantic import AfterValidator, field_validator, model_validator

from palpate.scenario.body import BodyChoice
from palpate.scenario.fields import Damping3, Number3, Position3, Section, Stiffness3
from palpate.scenario.frame import FrameMotion
from palpate.scenario.touched import MeshChoice, SurfaceChoice

_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,31}")
_TAKEN: Final = ("object", "command", "motor", "reference", "operator", "frame")  # beginnings of channel names


class Object(Section):
    """[object]: virtual object.

    Attributes:
        kind: "none", "spring" (bilateral, anchored at the start tip), "wall" (unilateral), "mesh" or "body"
            (deformable).
        stiffness: N/m per axis; the same for all axes of a wall. Not for a mesh or a body.
        damping: N*s/m per axis. Not for a mesh or a body.
        coupling: difference that samples the damper's speed, "backward" or "bilinear" (Hosseini-Zadeh 2004, 3.34).
        position: from the start tip, m: of the spring's anchor, of a point on the wall, or of the origin of a mesh or
            body.
        normal: outward normal of the wall; of unit length after reading.
        mesh: of the kind "mesh".
        surface: of the kind "mesh".
        body: of the kind "body".
        frame: motion of the object over time; None: it rests.
    """

    kind: Literal["none", "spring", "wall", "mesh", "body"] = "spring"
    stiffness: Stiffness3 | None = None
    damping: Damping3 = (0.0, 0.0, 0.0)
    coupling: Literal["backward", "bilinear"] = "backward"
    position: Position3 = (0.0, 0.0, 0.0)
    normal: Number3 | None = None
    mesh: MeshChoice | None = None
    surface: SurfaceChoice | None = None
    body: BodyChoice | None = None
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
        elif self.kind in ("mesh", "body"):
            self._check_tables()
        elif self.stiffness is None:
            raise ValueError('stiffness is missing; write for example stiffness = "3.5 N/mm"')
        if self.kind == "wall" and self.normal is None:
            raise ValueError("a wall needs its outward normal, for example normal = [0, 0, 1]")
        if self.kind != "wall" and self.normal is not None:
            raise ValueError('normal belongs to kind = "wall"')
        if self.kind == "wall" and self.stiffness is not None and len({*self.stiffness}) > 1:
            raise ValueError("a wall has one stiffness, along its normal")
        for key, kind in (("mesh", "mesh"), ("surface", "mesh"), ("body", "body")):
            if self.kind != kind and getattr(self, key) is not None:
                raise ValueError(f'{key} belongs to kind = "{kind}"')
        return self

    def _check_tables(self) -> None:
        """Raise ValueError for a mesh or body without its tables, or with keys of another kind."""
        tables = {
            "mesh": {"mesh": 'shape = "box"', "surface": 'stiffness = "1 N/mm"'},
            "body": {"body": 'shape = "phantom" and radius = "8 mm"'},
        }[self.kind]
        for key, example in tables.items():
            if getattr(self, key) is None:
                raise ValueError(f"{key} is missing; write a table [object.{key}] with for example {example}")
        stray = sorted(self.model_fields_set - {"kind", "position", "frame", *tables})
        if stray:
            whose = {
                "mesh": "a mesh has its own in [object.surface]",
                "body": "a body's follows from its material",
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
