"""What a body is made of: one linear elastic solid, and regions in it of another stiffness."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from palpate.fem.checks import number, positive
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.selectors import Selector, parse_selector

__all__ = ["Material", "Region", "SurfaceLayer"]

Array = NDArray[np.float64]
_SOFTEST: Final = 50.0  # Pa, below the softest tissue and above what it has in kPa


@dataclass(frozen=True, init=False)
class Region:
    """A place, or its text, of another Young's modulus, Pa or text: a nodule."""

    where: Selector
    young: float

    def __init__(self, where: Selector | str, young: float | str) -> None:
        found = parse_selector(where)
        _set(self, where=found, young=_young(young, f"region {found}"))

    def __str__(self) -> str:
        return f"{self.where} = {1e-3 * self.young:g} kPa"

    @classmethod
    def parse(cls, text: str) -> Region:
        """Read "sphere 50 50 40 radius 7.5 mm = 25 kPa"."""
        where, young = _halves(text, "region", "sphere 50 50 40 radius 7.5 mm = 25 kPa")
        return cls(where, young)


@dataclass(frozen=True, init=False)
class SurfaceLayer:
    """A layer of `thickness`, m or text, under the touchable surface, of another Young's modulus, Pa or text."""

    thickness: float
    young: float

    def __init__(self, thickness: float | str, young: float | str) -> None:
        _set(self, thickness=positive(thickness, "m", "skin"), young=_young(young, "skin"))

    def __str__(self) -> str:
        return f"{1e3 * self.thickness:g} mm = {1e-3 * self.young:g} kPa"

    @classmethod
    def parse(cls, text: str) -> SurfaceLayer:
        """Read "2 mm = 50 kPa"."""
        return cls(*_halves(text, "skin", "2 mm = 50 kPa"))


@dataclass(frozen=True, init=False)
class Material:
    """What a solid is made of; regions and a skin, or their texts: the later one wins where two meet.

    Args:
        young: Young's modulus, Pa, or text such as "5 kPa".
        poisson: Poisson's ratio, above -1 and below 0.5.
        density: kg/m^3, or text with its unit.
        regions: of another stiffness.
        skin: under the touchable surface.

    Raises:
        BodyError: a number is impossible, or a text cannot be read.

    Warns of a Young's modulus below 50 Pa, as one given in kPa without its unit would be.
    """

    young: float
    poisson: float
    density: float
    regions: tuple[Region, ...]
    skin: SurfaceLayer | None

    def __init__(
        self,
        young: float | str,
        poisson: float | str = 0.45,
        density: float | str = 1000.0,
        regions: Region | str | Sequence[Region | str] = (),
        skin: SurfaceLayer | str | None = None,
    ) -> None:
        ratio = number(poisson, "", "poisson")
        if not -1.0 < ratio < 0.5:
            raise BodyError(
                f"poisson: Poisson's ratio is below 0.5 (soft tissue: 0.45 to 0.495) and above -1, not {ratio:g}"
            )
        heavy = number(density, "kg/m^3", "density")
        if not 1e-3 <= heavy <= 1e6:
            raise BodyError(f"density: the density is positive, in kg/m^3 (soft tissue: about 1000), not {heavy:g}")
        if skin is not None and not isinstance(skin, SurfaceLayer | str):
            raise BodyError(f'skin: {skin!r} is none; write "2 mm = 50 kPa", or Skin("2 mm", "50 kPa")')
        each = [regions] if isinstance(regions, Region | str) else list(regions or ())
        for region in each:
            if not isinstance(region, Region | str):
                raise BodyError(f'regions: {region!r} is none; write "sphere 50 50 40 radius 7.5 mm = 25 kPa"')
        _set(
            self,
            young=_young(young, "young"),
            poisson=ratio,
            density=heavy,
            regions=tuple(Region.parse(region) if isinstance(region, str) else region for region in each),
            skin=SurfaceLayer.parse(skin) if isinstance(skin, str) else skin,
        )

    def young_at(self, points: Array, depth: Callable[[Array], Array]) -> Array:
        """Return Young's modulus (n,), Pa, at `points` (n, 3), m; `depth` tells how far points lie under the skin."""
        young = np.full(len(points), self.young)
        if self.skin is not None:
            young[depth(points) < self.skin.thickness] = self.skin.young
        for region in self.regions:
            young[region.where.inside(points)] = region.young
        return young


def _young(value: float | str, field: str) -> float:
    found = number(value, "Pa", field)
    if not 1e-3 <= found <= 1e13:
        raise BodyError(f"{field}: Young's modulus is positive, in Pa (liver: 5 kPa; diamond: 1 TPa), not {found:g}")
    if found < _SOFTEST:
        warnings.warn(
            f'{field}: {found:g} Pa is softer than any tissue; if kPa are meant, write "{found:g} kPa"',
            BodyWarning,
            stacklevel=4,
        )
    return found


def _halves(text: str, field: str, example: str) -> tuple[str, str]:
    halves = [part.strip() for part in re.split("(?<![<>])=", text)]
    if len(halves) != 2 or not all(halves):
        raise BodyError(f'{field}: "{text}" is written as "{example}"')
    return halves[0], halves[1]


def _set(made: object, **values: object) -> None:
    for name, value in values.items():
        object.__setattr__(made, name, value)
