"""What a body is made of: one linear elastic solid, and regions in it of another stiffness."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.bodies.errors import BodyError
from palpate.bodies.places import Place, place
from palpate.units import quantity

__all__ = ["Material", "Region", "Skin"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """A place of another Young's modulus, Pa: a nodule."""

    where: Place
    young: float

    def __post_init__(self) -> None:
        _check_young(self.young, f"region {self.where}")

    @classmethod
    def read(cls, text: str) -> Region:
        """Read "sphere 50 50 40 radius 7.5 mm = 25 kPa"."""
        where, _, young = text.partition("=")
        return cls(place(where.strip()), quantity(young.strip(), "Pa", f"region {where.strip()}", error=BodyError))


@dataclass(frozen=True)
class Skin:
    """A layer of `thickness`, m, under the touchable surface, of another Young's modulus, Pa."""

    thickness: float
    young: float

    def __post_init__(self) -> None:
        if not 0 < self.thickness < np.inf:
            raise BodyError(f"a skin has a positive thickness, not {self.thickness} m")
        _check_young(self.young, "skin")

    @classmethod
    def read(cls, text: str) -> Skin:
        """Read "2 mm = 50 kPa"."""
        thick, _, young = text.partition("=")
        return cls(
            quantity(thick.strip(), "m", "skin", error=BodyError),
            quantity(young.strip(), "Pa", "skin", error=BodyError),
        )


@dataclass(frozen=True)
class Material:
    """Young's modulus, Pa, Poisson's ratio, density, kg/m^3; regions and a skin, the later one wins where two meet."""

    young: float
    poisson: float = 0.45
    density: float = 1000.0
    regions: Sequence[Region] = ()
    skin: Skin | None = None

    def __post_init__(self) -> None:
        _check_young(self.young, "young")
        if not -1.0 < self.poisson < 0.5:
            raise BodyError(
                f"Poisson's ratio is below 0.5 (soft tissue: 0.45 to 0.495) and above -1, not {self.poisson:g}"
            )
        if not 0 < self.density < np.inf:
            raise BodyError(f"the density is positive, in kg/m^3 (soft tissue: about 1000), not {self.density:g}")

    def young_at(self, points: Array, depth: Callable[[Array], Array]) -> Array:
        """Return Young's modulus (n,), Pa, at `points` (n, 3), m; `depth` tells how far points lie under the skin."""
        young = np.full(len(points), self.young)
        if self.skin is not None:
            young[depth(points) < self.skin.thickness] = self.skin.young
        for region in self.regions:
            young[region.where.inside(points)] = region.young
        return young


def _check_young(value: float, name: str) -> None:
    if not 0 < value < np.inf:
        raise BodyError(f"{name}: Young's modulus is positive and finite, in Pa (liver: about 5 kPa), not {value:g}")
