"""Reference solution by axisymmetric finite elements under large displacements: the cylinder is neo-Hookean.

The strain energy is that of `palpate.fem.HyperelasticModel`. With the displacement (u, w) by r and z, the deformation
gradient has the entries a = 1 + du/dr, b = du/dz, c = dw/dr, d = 1 + dw/dz and h = 1 + u/r, and J = (a d - b c) h.
Contact is without friction.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import skfem
from palpate.arrays import Array
from scipy.sparse.linalg import splu
from skfem.helpers import grad

from experiments.body_validation.axisymmetric import PENALTY, LayeredCylinder, SphereContact, axial

__all__ = ["NeoHookeanCylinder", "Solid"]

_INCREMENT: Final = 0.5e-3  # of the depth, m
_TOLERANCE: Final = 1e-7  # of the imbalance of forces
_ITERATIONS: Final = 80  # of Newton's method for an increment
_STEPS: Final = (1.0, 0.5, 0.25, 0.1, 0.03)  # parts of a Newton step, of which the first that lowers the energy is made


@dataclass(frozen=True)
class NeoHookeanCylinder(LayeredCylinder):
    """Layered cylinder under large displacements."""

    def sphere_force(self, radius: float, depth: float, cell: float = 5e-4) -> float:
        """Return the force, N, on a sphere of `radius` at `depth`, m, with cells of `cell`, m, under it.

        Raises:
            ArithmeticError: Newton's method does not converge.
        """
        basis, _, fixed = self._elements(radius, cell)
        near = basis.mesh.facets_satisfying(lambda x: (x[1] > -1e-9) & (x[0] < 1.5 * radius))
        surface = skfem.FacetBasis(basis.mesh, basis.elem, facets=near, intorder=6)
        free = np.setdiff1d(np.arange(basis.N), fixed)
        solid = Solid(self, basis)
        displacement, load = np.zeros(basis.N), np.zeros(basis.N)
        for reached in _increments(depth):
            contact = SphereContact(radius, reached, PENALTY * max(self.young, self.skin_young), surface)
            for _ in range(_ITERATIONS):
                load = contact.load(displacement)
                imbalance = (load - solid.force(displacement))[free]
                if np.linalg.norm(imbalance) < _TOLERANCE * np.linalg.norm(load):
                    break
                tangent = (solid.tangent(displacement) + contact.stiffness(displacement))[free][:, free]
                step = np.zeros(basis.N)
                step[free] = splu(tangent.tocsc()).solve(imbalance)
                displacement = _descend(solid, contact, displacement, step)
            else:
                raise ArithmeticError("the contact of the sphere did not converge")
        return -float(load[axial(basis)].sum())

    def flat_end_force(self, radius: float, depth: float, cell: float = 3e-4) -> float:
        """Return the force, N, on a flat end of `radius` at `depth`, m, with cells of `cell`, m, at its edge.

        Raises:
            ArithmeticError: Newton's method does not converge.
        """
        basis, _, fixed = self._elements(radius, cell)
        r, z = basis.doflocs
        under = np.intersect1d(np.flatnonzero((z > -1e-9) & (r < radius + 1e-9)), axial(basis))
        free = np.setdiff1d(np.arange(basis.N), np.concatenate([fixed, under]))
        solid = Solid(self, basis)
        displacement = np.zeros(basis.N)
        for reached in _increments(depth):
            for _ in range(_ITERATIONS):
                step, tangent = np.zeros(basis.N), solid.tangent(displacement)
                step[under] = -reached - displacement[under]
                imbalance = solid.force(displacement) + tangent @ step
                step[free] = splu(tangent[free][:, free].tocsc()).solve(-imbalance[free])
                displacement += step
                force = solid.force(displacement)
                if np.linalg.norm(force[free]) < _TOLERANCE * np.linalg.norm(force[under]):
                    break
            else:
                raise ArithmeticError("the body under the flat end did not converge")
        return -float(force[under].sum())


class Solid:
    """Strain energy of a cylinder and its derivatives by the unknowns of a basis."""

    def __init__(self, cylinder: LayeredCylinder, basis: Any) -> None:
        self.cylinder, self.basis = cylinder, basis

    def energy(self, displacement: Array) -> float:
        """Return the strain energy, J; infinity if the volume vanishes at a quadrature point."""
        least = np.inf

        def stored(w: Any) -> Any:
            nonlocal least
            shear, bulk, (a, b, c, d, h) = self._state(w)
            volume = (a * d - b * c) * h
            least = min(least, float(volume.min()))
            square = a**2 + b**2 + c**2 + d**2 + h**2
            density = 0.5 * shear * (square - 3.0) - shear * (volume - 1.0) + 0.5 * bulk * (volume - 1.0) ** 2
            return 2.0 * np.pi * w.x[0] * density

        total = float(skfem.Functional(stored).assemble(self.basis, moved=self.basis.interpolate(displacement)))
        return total if least > 0.0 else np.inf

    def force(self, displacement: Array) -> Array:
        """Return the gradient of the energy, N."""

        def resist(v: Any, w: Any) -> Any:
            shear, bulk, (a, b, c, d, h) = self._state(w)
            plane, test = a * d - b * c, grad(v)
            pressure = bulk * (plane * h - 1.0) - shear
            sum_ = (shear * a + pressure * d * h) * test[0, 0] + (shear * b - pressure * c * h) * test[0, 1]
            sum_ += (shear * c - pressure * b * h) * test[1, 0] + (shear * d + pressure * a * h) * test[1, 1]
            return 2.0 * np.pi * w.x[0] * (sum_ + (shear * h + pressure * plane) * v[0] / w.x[0])

        moved = self.basis.interpolate(displacement)
        return np.asarray(skfem.LinearForm(resist).assemble(self.basis, moved=moved))

    def tangent(self, displacement: Array) -> Any:
        """Return the second derivative of the energy, N/m."""

        def stiff(u: Any, v: Any, w: Any) -> Any:
            shear, bulk, (a, b, c, d, h) = self._state(w)
            plane = a * d - b * c
            pressure = bulk * (plane * h - 1.0) - shear
            one, two = grad(u), grad(v)
            hoop, other = u[0] / w.x[0], v[0] / w.x[0]
            in_plane = a * one[1, 1] + d * one[0, 0] - b * one[1, 0] - c * one[0, 1]
            in_other = a * two[1, 1] + d * two[0, 0] - b * two[1, 0] - c * two[0, 1]
            twice = one[0, 0] * two[1, 1] + one[1, 1] * two[0, 0] - one[0, 1] * two[1, 0] - one[1, 0] * two[0, 1]
            product = sum(one[i, j] * two[i, j] for i in (0, 1) for j in (0, 1)) + hoop * other
            volumes = (in_plane * h + plane * hoop) * (in_other * h + plane * other)
            second = h * twice + in_plane * other + hoop * in_other
            return 2.0 * np.pi * w.x[0] * (shear * product + bulk * volumes + pressure * second)

        moved = self.basis.interpolate(displacement)
        return skfem.BilinearForm(stiff).assemble(self.basis, moved=moved).tocsc()

    def _state(self, w: Any) -> tuple[Any, Any, tuple[Any, ...]]:
        """Return the shear modulus, lambda + shear modulus, Pa, and the deformation gradient."""
        gradient, poisson = grad(w["moved"]), self.cylinder.poisson
        shear = self.cylinder.modulus(w.x[1]) / (2.0 * (1.0 + poisson))
        hoop = 1.0 + w["moved"][0] / w.x[0]
        entries = (1.0 + gradient[0, 0], gradient[0, 1], gradient[1, 0], 1.0 + gradient[1, 1], hoop)
        return shear, shear / (1.0 - 2.0 * poisson), entries


def _increments(depth: float) -> Array:
    return np.linspace(0.0, depth, 1 + max(2, int(np.ceil(depth / _INCREMENT))))[1:]


def _descend(solid: Solid, contact: SphereContact, displacement: Array, step: Array) -> Array:
    """Return the displacement after the largest part of a step that lowers the energy."""
    energies = (solid.energy, contact.energy)
    start = sum(energy(displacement) for energy in energies)
    for part in _STEPS:
        tried = displacement + part * step
        if sum(energy(tried) for energy in energies) <= start:
            break
    return tried
