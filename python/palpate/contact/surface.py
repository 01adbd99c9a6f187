"""How a surface answers to being touched."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.contact.mesh import Mesh
from palpate.errors import PalpateError
from palpate.units import parse_quantity, to_si

__all__ = ["SHADED_MOST", "Surface", "SurfaceError"]

SHADED_MOST: Final = math.radians(85.0)  # edges that turn by more are edges


class SurfaceError(PalpateError):
    """A stiffness, damping or friction has the wrong length, sign or unit."""


@dataclass(frozen=True)
class Surface:
    """Stiffness, damping and friction of a mesh's surface. Numbers are SI; text carries its unit ("3.5 N/mm").

    `stiffness` (N/m) and `damping` (N*s/m), both along the normal, are one value, one per triangle or one per vertex.
    `tangential` (N/m) joins tip and proxy along the surface: None for as stiff as along the normal, 0 for nothing, and
    then there is no friction either. The frictions are coefficients: the proxy holds until the tangential force exceeds
    static_friction times the normal force (infinity: it never slips), and slides with dynamic_friction (None: the
    same). `viscous` (N*s/m) drags a sliding proxy. `period` (s) is the servo's, for damping and drag.

    The "discrete" field gives each triangle its own stiffness (Hosseini-Zadeh 2004, ch. 5). The "continuous" one
    spreads the values over the surface, with a continuous slope; its force is the slope of the potential
    stiffness * depth^2 / 2, so there is a part depth^2 / 2 times the slope of the stiffness, along the surface.

    `shading` (rad, or text such as "30 deg"; below 85 deg) makes the normal turn smoothly over edges that turn by less,
    so that the facets of a rounded surface are not felt (Morgenbesser & Srinivasan 1996); 0 for none.
    """

    stiffness: ArrayLike | str = 1000.0
    tangential: float | str | None = None
    static_friction: float = 0.0
    dynamic_friction: float | None = None
    viscous: float | str = 0.0
    damping: ArrayLike | str = 0.0
    field: Literal["discrete", "continuous"] = "discrete"
    shading: float | str = 0.0
    period: float | str = "1 ms"

    def __post_init__(self) -> None:
        if self.field not in ("discrete", "continuous"):
            raise SurfaceError(f'field must be "discrete" or "continuous", not {self.field!r}')
        static = _coefficient(self.static_friction, "static_friction")
        if self.dynamic_friction is not None and _coefficient(self.dynamic_friction, "dynamic_friction") > static:
            raise SurfaceError(
                f"dynamic_friction {self.dynamic_friction} must not exceed static_friction {self.static_friction}"
            )

    def core_for(self, mesh: Mesh) -> Any:
        """Return the core's surface for `mesh`. Raises SurfaceError."""
        core = _core.Surface()
        core.stiffness = _list(self.stiffness, "stiffness", "N/m", mesh).tolist()
        core.damping = _list(self.damping, "damping", "N*s/m", mesh).tolist()
        core.tangential = -1.0 if self.tangential is None else number(self.tangential, "tangential", "N/m")
        core.static_friction = float(self.static_friction)
        core.dynamic_friction = core.static_friction if self.dynamic_friction is None else float(self.dynamic_friction)
        core.viscous = number(self.viscous, "viscous", "N*s/m")
        core.shading = _angle(self.shading)
        core.period = number(self.period, "period", "s")
        if core.period <= 0.0:
            raise SurfaceError("period must be positive")
        core.field = getattr(_core.FieldKind, self.field)
        return core


def number(value: float | str, name: str, unit: str) -> float:
    """Return `value` in SI: a number as it is, text with its unit. Raises SurfaceError if negative or not finite."""
    found = to_si(value, unit, name, error=SurfaceError)
    if not (math.isfinite(found) and found >= 0.0):
        raise SurfaceError(f"{name} must be finite and not negative; it is {found:g} {unit}")
    return found


def _angle(value: float | str) -> float:
    found = to_si(value, "rad", "shading", error=SurfaceError)
    if not 0.0 <= found <= SHADED_MOST:
        raise SurfaceError(f"shading must be an angle from 0 to 85 deg; it is {math.degrees(found):g} deg")
    return found


def _coefficient(value: float, name: str) -> float:
    coefficient = float(value)
    if math.isnan(coefficient) or coefficient < 0.0:
        raise SurfaceError(f"{name} must be a coefficient of zero or more; it is {value}")
    return coefficient


def _list(value: ArrayLike | str, name: str, unit: str, mesh: Mesh) -> NDArray[np.float64]:
    entries: Any = [value] if isinstance(value, str) else value
    if isinstance(entries, (list, tuple)):
        entries = [parse_quantity(e, unit, name, error=SurfaceError) if isinstance(e, str) else e for e in entries]
    numbers = np.atleast_1d(np.asarray(entries, dtype=float))
    allowed = (1, len(mesh.triangles), len(mesh.vertices))
    if numbers.ndim != 1 or len(numbers) not in allowed:
        raise SurfaceError(
            f"{name} must be one value, one per triangle ({allowed[1]}) or one per vertex ({allowed[2]}); "
            f"it has shape {numbers.shape}"
        )
    bad = ~(np.isfinite(numbers) & (numbers >= 0.0))
    if bad.any():
        first = int(np.argmax(bad))
        raise SurfaceError(f"{name} must be finite and not negative; number {first} is {numbers[first]} {unit}")
    return numbers
