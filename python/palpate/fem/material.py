"""Material of a body: a linear elastic solid with regions and a surface layer of other stiffness."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from palpate.arrays import Array
from palpate.fem.checks import number, positive
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.selectors import Selector, parse_selector

_SOFTEST: Final = 50.0  # Pa; below any tissue, and above the numerical value of a tissue's modulus in kPa
_STIFFEST: Final = 1e8  # Pa; above any tissue but bone, and any rubber


@dataclass(frozen=True, init=False)
class Region:
    """Region with its own Young's modulus, Pa or text, such as a nodule."""

    where: Selector
    young: float

    def __init__(self, where: Selector | str, young: float | str) -> None:
        selector = parse_selector(where)
        _set(self, where=selector, young=_young(young, f"region {selector}"))

    def __str__(self) -> str:
        return f"{self.where} = {1e-3 * self.young:g} kPa"

    @classmethod
    def parse(cls, text: str) -> Region:
        """Parse text such as "sphere 50 50 40 radius 7.5 mm = 25 kPa". Raise BodyError for any other form."""
        where, young = _sides(text, "region", "sphere 50 50 40 radius 7.5 mm = 25 kPa")
        return cls(where, young)


@dataclass(frozen=True, init=False)
class SurfaceLayer:
    """Layer below the contact surface: thickness, m or text, and Young's modulus, Pa or text."""

    thickness: float
    young: float

    def __init__(self, thickness: float | str, young: float | str) -> None:
        _set(self, thickness=positive(thickness, "m", "surface_layer"), young=_young(young, "surface_layer"))

    def __str__(self) -> str:
        return f"{1e3 * self.thickness:g} mm = {1e-3 * self.young:g} kPa"

    @classmethod
    def parse(cls, text: str) -> SurfaceLayer:
        """Parse text such as "2 mm = 50 kPa". Raise BodyError for any other form."""
        return cls(*_sides(text, "surface_layer", "2 mm = 50 kPa"))


@dataclass(frozen=True, init=False)
class Material:
    """Linear elastic material with a density.

    Warns of a Young's modulus below 50 Pa, which may be a value in kPa without its unit, and above 100 MPa.

    Args:
        young: Young's modulus, Pa, or text such as "5 kPa".
        poisson: Poisson's ratio, above -1 and below 0.5.
        density: kg/m^3, or text with its unit.
        regions: of other stiffness, or their text. They override the surface layer, and later ones override earlier.
        surface_layer: layer at the contact surface, or its text.

    Raises:
        BodyError: a number is out of range, or a text cannot be parsed.
    """

    young: float
    poisson: float
    density: float
    regions: tuple[Region, ...]
    surface_layer: SurfaceLayer | None

    def __init__(
        self,
        young: float | str,
        poisson: float | str = 0.45,
        density: float | str = 1000.0,
        regions: Region | str | Sequence[Region | str] = (),
        surface_layer: SurfaceLayer | str | None = None,
    ) -> None:
        ratio = number(poisson, "", "poisson")
        if not -1.0 < ratio < 0.5:
            raise BodyError(
                f"poisson: Poisson's ratio is below 0.5 (soft tissue: 0.45 to 0.495) and above -1, not {ratio:g}"
            )
        rho = number(density, "kg/m^3", "density")
        if not 1e-3 <= rho <= 1e6:
            raise BodyError(f"density: the density is positive, in kg/m^3 (soft tissue: about 1000), not {rho:g}")
        if surface_layer is not None and not isinstance(surface_layer, SurfaceLayer | str):
            raise BodyError(
                f'surface_layer: {surface_layer!r} is no layer; write "2 mm = 50 kPa", or SurfaceLayer(2e-3, 50e3)'
            )
        each: list[Any] = [regions]
        if isinstance(regions, Sequence | None) and not isinstance(regions, str):
            each = list(regions or ())
        for region in each:
            if not isinstance(region, Region | str):
                raise BodyError(f'regions: {region!r} is no region; write "sphere 50 50 40 radius 7.5 mm = 25 kPa"')
        _set(
            self,
            young=_young(young, "young"),
            poisson=ratio,
            density=rho,
            regions=tuple(Region.parse(region) if isinstance(region, str) else region for region in each),
            surface_layer=SurfaceLayer.parse(surface_layer) if isinstance(surface_layer, str) else surface_layer,
        )

    @property
    def is_uniform(self) -> bool:
        """Whether it has one modulus."""
        return not self.regions and self.surface_layer is None

    def young_at(self, points: Array, depth: Callable[[Array], Array]) -> Array:
        """Return Young's modulus (n,), Pa, at `points` (n, 3), m; `depth` returns their distance from the surface."""
        young = np.full(len(points), self.young)
        if self.surface_layer is not None:
            young[depth(points) < self.surface_layer.thickness] = self.surface_layer.young
        for region in self.regions:
            young[region.where.inside(points)] = region.young
        return young


def _young(value: float | str, field: str) -> float:
    modulus = number(value, "Pa", field)
    if not 1e-3 <= modulus <= 1e13:
        raise BodyError(f"{field}: Young's modulus is positive, in Pa (liver: 5 kPa; diamond: 1 TPa), not {modulus:g}")
    if modulus < _SOFTEST:
        warnings.warn(
            f'{field}: {modulus:g} Pa is softer than any tissue; for a value in kPa, write "{modulus:g} kPa"',
            BodyWarning,
            stacklevel=4,
        )
    elif modulus > _STIFFEST:
        warnings.warn(
            f"{field}: {modulus:g} Pa is stiffer than any tissue but bone (cartilage: 10 MPa): check its unit, such as "
            '"5 kPa"; a scenario renders a rigid object as a mesh with a stiffness',
            BodyWarning,
            stacklevel=4,
        )
    return modulus


def _sides(text: str, field: str, example: str) -> tuple[str, str]:
    """Return the two sides of the equals sign in `text`."""
    sides = [part.strip() for part in re.split("(?<![<>])=", text)]
    if len(sides) != 2 or not all(sides):
        raise BodyError(f'{field}: "{text}" cannot be read; write for example "{example}"')
    return sides[0], sides[1]


def _set(instance: object, **values: object) -> None:
    """Set attributes of a frozen dataclass."""
    for name, value in values.items():
        object.__setattr__(instance, name, value)
