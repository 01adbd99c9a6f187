"""Contact properties of a mesh's surface: stiffness, damping and friction."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.contact.mesh import Mesh
from palpate.errors import PalpateError
from palpate.units import bounded_to_si, parse_quantity, to_si

SHADED_MOST: Final = math.radians(85.0)  # of force shading; sharper edges are not smoothed


class SurfaceError(PalpateError):
    """A stiffness, damping or friction has the wrong length, sign or unit."""


@dataclass(frozen=True)
class Surface:
    """Stiffness, damping and friction of a mesh's surface. Numbers are SI; text has a unit ("3.5 N/mm").

    The "discrete" field gives each triangle its own stiffness (Hosseini-Zadeh 2004, ch. 5). The "continuous" field
    interpolates the values over the surface with a continuous gradient. Its force is the gradient of the potential
    stiffness * depth^2 / 2, so it has a tangential part depth^2 / 2 times the gradient of the stiffness.

    Attributes:
        stiffness: along the normal, N/m; one value, one per triangle or one per vertex.
        tangential: stiffness between tip and proxy along the surface, N/m; None for the normal stiffness, 0 for no
            tangential force and no friction.
        static_friction: coefficient below which the proxy sticks; infinity for no slip.
        dynamic_friction: coefficient of a sliding proxy; None for the static coefficient.
        viscous: friction of a sliding proxy, N*s/m.
        damping: along the normal, N*s/m; one value, one per triangle or one per vertex.
        field: "discrete" or "continuous".
        shading: angle of force shading, rad or text such as "30 deg", up to 85 deg. The normal turns smoothly over
            edges with smaller angles (Morgenbesser & Srinivasan 1996); 0 for no shading.
        period: of the servo, s, for damping and viscous friction.

    Raises:
        SurfaceError: a value has the wrong length, sign or unit.
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
        """Return the core's surface for `mesh`. Raise SurfaceError if a value does not match the mesh."""
        core = _core.Surface()
        core.stiffness = _list(self.stiffness, "stiffness", "N/m", mesh).tolist()
        core.damping = _list(self.damping, "damping", "N*s/m", mesh).tolist()
        core.tangential = -1.0 if self.tangential is None else _number(self.tangential, "N/m", "tangential")
        core.static_friction = float(self.static_friction)
        core.dynamic_friction = core.static_friction if self.dynamic_friction is None else float(self.dynamic_friction)
        core.viscous = _number(self.viscous, "N*s/m", "viscous")
        core.shading = _angle(self.shading)
        core.period = bounded_to_si(self.period, "s", "period", error=SurfaceError)
        core.field = getattr(_core.FieldKind, self.field)
        return core


_number = partial(bounded_to_si, zero=True, error=SurfaceError)


def _angle(value: float | str) -> float:
    result = to_si(value, "rad", "shading", error=SurfaceError)
    if not 0.0 <= result <= SHADED_MOST:
        raise SurfaceError(f"shading must be an angle from 0 to 85 deg; it is {math.degrees(result):g} deg")
    return result


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
        raise SurfaceError(f"{name} must be finite and not negative; value {first} is {numbers[first]} {unit}")
    return numbers
