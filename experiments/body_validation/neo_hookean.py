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
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu

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
    """Strain energy of a cylinder and its derivatives by the unknowns of a basis.

    At each quadrature point the energy is a function of the five entries (a, b, c, d, h) of the deformation gradient,
    which are linear in the unknowns of the element.
    """

    def __init__(self, cylinder: LayeredCylinder, basis: Any) -> None:
        self.basis, self.dofs = basis, basis.element_dofs.T
        r, z = basis.global_coordinates()
        self.weight = 2.0 * np.pi * r * basis.dx
        self.shear = cylinder.modulus(z) / (2.0 * (1.0 + cylinder.poisson))
        self.bulk = self.shear / (1.0 - 2.0 * cylinder.poisson)  # lambda + shear modulus
        # Derivatives of the entries by the unknowns: (elements, points, 5, unknowns of an element).
        entries = [
            [field.grad[0, 0], field.grad[0, 1], field.grad[1, 0], field.grad[1, 1], field[0] / r]
            for (field,) in basis.basis
        ]
        self.by_unknowns = np.ascontiguousarray(np.moveaxis(np.array(entries), (2, 3, 1, 0), (0, 1, 2, 3)))

    def energy(self, displacement: Array) -> float:
        """Return the strain energy, J; infinity if the volume vanishes at a quadrature point."""
        entries = self._entries(displacement)
        a, b, c, d, h = entries
        volume = (a * d - b * c) * h
        if not volume.min() > 0.0:
            return float(np.inf)
        distortion = 0.5 * ((entries**2).sum(axis=0) - 3.0) - (volume - 1.0)
        return float((self.weight * (self.shear * distortion + 0.5 * self.bulk * (volume - 1.0) ** 2)).sum())

    def force(self, displacement: Array) -> Array:
        """Return the gradient of the energy, N."""
        entries = self._entries(displacement)
        by_volume, volume = self._volumes(entries)
        pressure = self.bulk * (volume - 1.0) - self.shear
        stress = self.weight * (self.shear * entries + pressure * by_volume)
        local = np.einsum("eqki,keq->ei", self.by_unknowns, stress)
        return np.asarray(np.bincount(self.dofs.ravel(), local.ravel(), self.basis.N), float)

    def tangent(self, displacement: Array) -> Any:
        """Return the second derivative of the energy, N/m."""
        a, b, c, d, h = entries = self._entries(displacement)
        by_volume, volume = self._volumes(entries)
        pressure = self.bulk * (volume - 1.0) - self.shear
        second = self.bulk * by_volume[:, None] * by_volume[None, :]
        for (row, column), value in {(0, 3): h, (1, 2): -h, (0, 4): d, (1, 4): -c, (2, 4): -b, (3, 4): a}.items():
            second[row, column] += pressure * value
            second[column, row] += pressure * value
        second[range(5), range(5)] += self.shear
        weighted = np.moveaxis(self.weight * second, (0, 1), (2, 3))
        local = (np.swapaxes(self.by_unknowns, 2, 3) @ (weighted @ self.by_unknowns)).sum(axis=1)
        rows, columns = np.broadcast_arrays(self.dofs[:, :, None], self.dofs[:, None, :])
        shape = (self.basis.N, self.basis.N)
        return coo_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape).tocsc()

    def _entries(self, displacement: Array) -> Array:
        """Return the entries (5, elements, points) of the deformation gradient."""
        change = np.einsum("eqki,ei->keq", self.by_unknowns, displacement[self.dofs])
        return np.asarray(np.array([1.0, 0.0, 0.0, 1.0, 1.0])[:, None, None] + change)

    @staticmethod
    def _volumes(entries: Array) -> tuple[Array, Array]:
        """Return the derivatives (5, elements, points) of J by the entries, and J."""
        a, b, c, d, h = entries
        plane = a * d - b * c
        return np.array([d * h, -c * h, -b * h, a * h, plane]), plane * h


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
