"""A solid that deforms as far as it is pushed: linear tetrahedra, co-rotational or Neo-Hookean, without inertia."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.fem.body import Law
from palpate.fem.checks import positive, whole
from palpate.fem.elements import Elements
from palpate.fem.errors import BodyError
from palpate.fem.material import Material
from palpate.fem.selectors import Selector, parse_selector, parse_selectors
from palpate.fem.volume import Volume

__all__ = ["HyperelasticModel", "Law", "Strain"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Strain(NamedTuple):
    """What a displaced solid holds."""

    energy: float  # J
    forces: Array  # that hold it there, on each free point (N, 3), N; none on points that are held


class HyperelasticModel:
    """N points, some of them held, of a solid under large displacements.

    Args:
        volume: its tetrahedra.
        material: Young's modulus, Poisson's ratio, regions and skin, each tetrahedron of its mean stiffness.
        fixed: one or more places that do not move.
        touch: the part of the surface that can be touched; None for all of it.
        law: "neo-hookean", psi = mu/2 (|F|^2 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2, or "corotational",
            psi = mu |F - R|^2 + lambda/2 (tr S - 3)^2 with F = R S. For small strains both are linear elasticity.

    Linear tetrahedra lock as Poisson's ratio nears 0.5, and are too stiff in bending: see docs/bodies.md.

    Raises:
        BodyError: a piece of it could move as a whole, nothing can be touched, the law is unknown.
    """

    def __init__(
        self,
        volume: Volume,
        material: Material,
        fixed: str | Selector | Sequence[str | Selector],
        touch: str | Selector | None = None,
        *,
        law: Law = "neo-hookean",
    ) -> None:
        if law not in ("neo-hookean", "corotational"):
            raise BodyError(f"a solid's law is neo-hookean or corotational, not {law!r}")
        if not isinstance(volume, Volume) or not isinstance(material, Material):
            raise BodyError(f"a solid is made of a Volume and a Material, not of {volume!r} and {material!r}")
        self.law: Law = law
        self.elements = Elements(
            volume, material, parse_selectors(fixed), None if touch is None else parse_selector(touch), order=1
        )
        self.core = _core.HyperelasticModel(*self.arrays())

    def __repr__(self) -> str:
        return f"<Solid: {self.law}, of {self.elements.volume!r}>"

    def arrays(self) -> tuple[Array, Indices, Array, Array, NDArray[np.bool_], bool]:
        """Points, tetrahedra, shear modulus and Lame's lambda of each, Pa, points held, whether co-rotational."""
        volume, poisson = self.elements.volume, self.elements.material.poisson
        young = self.elements.young.mean(axis=1)
        return (
            np.ascontiguousarray(volume.points),
            np.ascontiguousarray(volume.tetrahedra, dtype=np.int64),
            np.ascontiguousarray(young / (2 * (1 + poisson))),
            np.ascontiguousarray(young * poisson / ((1 + poisson) * (1 - 2 * poisson))),
            np.ascontiguousarray(self.elements.held),
            self.law == "corotational",
        )

    @property
    def points(self) -> Array:
        """Places at rest (N, 3), m."""
        return self.elements.volume.points

    def evaluate(self, displacement: ArrayLike) -> Strain:
        """Put all points to `displacement` (N, 3), m, held ones too; return the energy, and the forces on free ones."""
        return Strain(*self.core.evaluate(self._vectors(displacement)))

    def relax(self, load: ArrayLike, *, tolerance: float = 1e-8, most: int = 60) -> Array:
        """Return the displacement (N, 3), m, at which it rests under `load` (N, 3), N, starting from where it is.

        Held points stay where `evaluate` last put them.

        Newton's steps, each by preconditioned conjugate gradients, shortened until the energy falls; they end when what
        is left of the load is `tolerance` of it. Raises BodyError if `most` steps did not bring it to rest.
        """
        limit = positive(tolerance, "", "tolerance")
        if self.core.relax(self._vectors(load), limit, whole(most, "most", 1)) < 0:
            raise BodyError(f"the solid did not come to rest in {most} steps: put the load on little by little")
        return np.asarray(self.core.displacement())

    def reset(self) -> None:
        """Go back to rest."""
        self.core.reset()

    def _vectors(self, values: ArrayLike) -> Array:
        try:
            vectors = np.ascontiguousarray(values, dtype=float)
        except (TypeError, ValueError):
            raise BodyError(f"numbers are needed, three for each point, not {values!r}") from None
        if vectors.shape != self.points.shape or not np.isfinite(vectors).all():
            raise BodyError(f"one finite vector for each of the {len(self.points)} points is needed")
        return vectors
