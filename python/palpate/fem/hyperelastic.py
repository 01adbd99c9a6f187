"""Hyperelastic solid of smoothed linear tetrahedra under large displacements, without inertia; it may relax."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array, Flags, Indices
from palpate.fem.checks import not_negative, positive, stiffness_ratio, whole
from palpate.fem.elements import Elements
from palpate.fem.errors import BodyError
from palpate.fem.material import Material
from palpate.fem.model_spec import LAWS, Law
from palpate.fem.selectors import Selector, parse_selector, parse_selectors
from palpate.fem.volume import Volume


class Strain(NamedTuple):
    """Strain energy and forces of a deformed solid."""

    energy: float  # J
    forces: Array  # external, in equilibrium with the stress (N, 3), N; zero at Dirichlet points


class HyperelasticModel:
    """Hyperelastic solid of N points under large displacements.

    The deformation gradient is smoothed over edges and the volume change over nodes (ES/NS-FEM), so Poisson's ratio may
    approach 0.5. See docs/theory/large-displacements.md.

    With `instantaneous_ratio` above 1 it is a standard linear solid at large strain (Simo 1987; Holzapfel 1996): the
    second Piola-Kirchhoff stress is S + Q with Q' + Q / tau = (instantaneous_ratio - 1) S', where S is the stress of
    the law and tau = `retardation_time` / `instantaneous_ratio`. A step is exact if S changes linearly in it.

    Args:
        volume: tetrahedral mesh.
        material: Young's modulus, Poisson's ratio, regions and surface layer. Each tetrahedron has its mean stiffness.
        fixed: one or more regions with a Dirichlet boundary condition.
        touch: region of the contact surface; None for the whole surface.
        law: "neo-hookean", psi = mu/2 (|F|^2 - 3) - mu (J - 1) + (lambda + mu)/2 (J - 1)^2, or "corotational",
            psi = mu |F - R|^2 + lambda/2 (tr S - 3)^2 with F = R S. For small strains both are linear elasticity.
        instantaneous_ratio: stiffness under a step over that in the long term, at least 1.
        retardation_time: time constant of the creep under a constant force at small strains, s or text.

    Raises:
        BodyError: a part of the body has a rigid-body motion, there is no contact node, the law is unknown, or a number
            is out of range.
    """

    def __init__(
        self,
        volume: Volume,
        material: Material,
        fixed: str | Selector | Sequence[str | Selector],
        touch: str | Selector | None = None,
        *,
        law: Law = "neo-hookean",
        instantaneous_ratio: float | str = 1.0,
        retardation_time: float | str = 1.0,
    ) -> None:
        if law not in LAWS:
            raise BodyError(f"a model's law is neo-hookean or corotational, not {law!r}")
        if not isinstance(volume, Volume) or not isinstance(material, Material):
            raise BodyError(f"a model is made of a Volume and a Material, not of {volume!r} and {material!r}")
        self.law: Law = law
        self.elements = Elements(
            volume, material, parse_selectors(fixed), None if touch is None else parse_selector(touch), order=1
        )
        self.instantaneous_ratio = stiffness_ratio(instantaneous_ratio)
        self.retardation_time = positive(retardation_time, "s", "retardation_time")
        self.core = _core.HyperelasticModel(*self.arrays(), self.instantaneous_ratio, self.retardation_time)

    def __repr__(self) -> str:
        return f"<HyperelasticModel: {self.law}, of {self.elements.volume!r}>"

    def arrays(self) -> tuple[Array, Indices, Array, Array, Flags, bool]:
        """Return the arguments of the core's model.

        Points (N, 3), m, tetrahedra (m, 4), shear modulus and Lame's lambda of each tetrahedron (m,), Pa, whether each
        point is fixed (N,), and whether the law is corotational.
        """
        volume, poisson = self.elements.volume, self.elements.material.poisson
        young = self.elements.young.mean(axis=1)
        return (
            np.ascontiguousarray(volume.points),
            np.ascontiguousarray(volume.tetrahedra, dtype=np.int64),
            np.ascontiguousarray(young / (2 * (1 + poisson))),
            np.ascontiguousarray(young * poisson / ((1 + poisson) * (1 - 2 * poisson))),
            np.ascontiguousarray(self.elements.dirichlet),
            self.law == "corotational",
        )

    @property
    def points(self) -> Array:
        """Points at rest (N, 3), m."""
        return self.elements.volume.points

    def evaluate(self, displacement: ArrayLike, *, duration: float | str | None = None) -> Strain:
        """Set the displacement of all points (N, 3), m, fixed ones included; return the strain energy and forces.

        A solid that relaxes takes a step of a `duration`, s or text, from its last state to this displacement; 0 is a
        sudden step, and None relaxes the solid completely. The energy of the overstress is that of small strains.
        """
        return Strain(*self.core.evaluate(self._vectors(displacement), _seconds(duration)))

    def solve_equilibrium(
        self,
        load: ArrayLike,
        *,
        tolerance: float = 1e-8,
        max_steps: int = 60,
        duration: float | str | None = None,
    ) -> Array:
        """Return the equilibrium displacement (N, 3), m, under `load` (N, 3), N.

        Newton's method with a line search on the energy starts from the current displacement. Each step is solved by
        preconditioned conjugate gradients. Fixed points stay where `evaluate` last put them.

        Args:
            load: nodal forces (N, 3), N.
            tolerance: on the residual over the load.
            max_steps: maximum number of Newton steps.
            duration: of the step of a solid that relaxes, as in `evaluate`.

        Raises:
            BodyError: there is no convergence within `max_steps` steps.
        """
        limit, step = positive(tolerance, "", "tolerance"), _seconds(duration)
        if self.core.solve_equilibrium(self._vectors(load), limit, whole(max_steps, "max_steps", 1), step) < 0:
            raise BodyError(f"no equilibrium was found in {max_steps} Newton steps: apply the load in increments")
        return np.asarray(self.core.displacement())

    def reset(self) -> None:
        """Return to the undeformed state."""
        self.core.reset()

    def _vectors(self, values: ArrayLike) -> Array:
        try:
            vectors = np.ascontiguousarray(values, dtype=float)
        except (TypeError, ValueError):
            raise BodyError(f"numbers are needed, three for each point, not {values!r}") from None
        if vectors.shape != self.points.shape or not np.isfinite(vectors).all():
            raise BodyError(f"one finite vector for each of the {len(self.points)} points is needed")
        return vectors


def _seconds(duration: float | str | None) -> float:
    """Return the duration of a step, s; infinity without one."""
    return np.inf if duration is None else not_negative(duration, "s", "duration")
