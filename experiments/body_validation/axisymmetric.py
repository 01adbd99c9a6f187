"""Reference solution by axisymmetric finite elements: a rigid tip pressed along the axis into a layered cylinder.

The cylinder is fixed at its bottom and linear elastic. Its elements are biquadratic quadrilaterals. Contact is without
friction, integrated over the surface, along the normals of the tip in the deformed position.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import skfem
from palpate.arrays import Array
from scipy.sparse.linalg import splu
from skfem.helpers import ddot, sym_grad

__all__ = ["PENALTY", "LayeredCylinder", "SphereContact", "axial"]

_GROWTH: Final = 1.12  # ratio of the sizes of adjacent cells away from the contact
PENALTY: Final = 3e5  # pressure of the contact over modulus and depth, 1/m
_TOLERANCE: Final = 1e-8  # of the imbalance of forces
_STEPS: Final = (1.0, 0.7, 0.5, 0.3, 0.1)  # parts of a Newton step, of which the one of least energy is made


@dataclass(frozen=True)
class LayeredCylinder:
    """Cylinder with a skin on its top: lengths in m, moduli in Pa."""

    young: float
    skin_young: float
    skin: float  # thickness
    radius: float = 30e-3
    height: float = 20e-3
    poisson: float = 0.45

    def flat_end(self, radius: float, cell: float = 3e-4) -> float:
        """Return force over depth, N/m, of a flat end of `radius`, m, with cells of `cell`, m, at its edge."""
        basis, stiffness, fixed = self._elements(radius, cell)
        r, z = basis.doflocs
        under = np.intersect1d(np.flatnonzero((z > -1e-9) & (r < radius + 1e-9)), axial(basis))
        displacement = np.zeros(basis.N)
        displacement[under] = -1.0
        free = np.setdiff1d(np.arange(basis.N), np.concatenate([fixed, under]))
        displacement[free] = splu(stiffness[free][:, free]).solve(-(stiffness[free] @ displacement))
        return -float((stiffness @ displacement)[under].sum())

    def sphere(self, radius: float, depth: float, cell: float = 5e-4) -> float:
        """Return the force, N, on a sphere of `radius` at `depth`, m, with cells of `cell`, m, under it."""
        basis, stiffness, fixed = self._elements(radius, cell)
        mesh = basis.mesh
        near = mesh.facets_satisfying(lambda x: (x[1] > -1e-9) & (x[0] < 1.5 * radius))
        surface = skfem.FacetBasis(mesh, basis.elem, facets=near, intorder=6)
        free = np.setdiff1d(np.arange(basis.N), fixed)
        contact = SphereContact(radius, depth, PENALTY * max(self.young, self.skin_young), surface)
        displacement = np.zeros(basis.N)
        for _ in range(100):
            load = contact.load(displacement)
            imbalance = (load - stiffness @ displacement)[free]
            if np.linalg.norm(imbalance) < _TOLERANCE * np.linalg.norm(load):
                return -float(load[axial(basis)].sum())
            tangent = (stiffness + contact.stiffness(displacement))[free][:, free]
            step = np.zeros(basis.N)
            step[free] = splu(tangent.tocsc()).solve(imbalance)
            energies = []
            for part in _STEPS:  # the whole step may cycle between sets of points in contact
                tried = displacement + part * step
                energies.append(0.5 * float(tried @ (stiffness @ tried)) + contact.energy(tried))
            displacement += _STEPS[int(np.argmin(energies))] * step
        raise ArithmeticError("the contact of the sphere did not converge")

    def modulus(self, z: Array) -> Array:
        """Return Young's modulus, Pa, at the height `z` over the top, m."""
        return np.where(-z < self.skin, self.skin_young, self.young)

    def _elements(self, contact: float, cell: float) -> tuple[Any, Any, Array]:
        """Return the basis, the stiffness matrix, N/m, and the fixed unknowns; `cell` up to the radius `contact`, m."""
        inner = np.linspace(0.0, contact, 1 + round(contact / cell))
        skin = np.linspace(0.0, self.skin, 1 + round(self.skin / cell))
        r = np.append(inner, _graded(contact, self.radius, cell))
        depth = np.append(skin, _graded(self.skin, self.height, cell))
        mesh = skfem.MeshQuad.init_tensor(r, -depth[::-1])
        basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()), intorder=4)

        def energy(u: Any, v: Any, w: Any) -> Any:
            radius, z = w.x
            modulus = self.modulus(z)
            lame = modulus * self.poisson / ((1.0 + self.poisson) * (1.0 - 2.0 * self.poisson))
            shear = modulus / (2.0 * (1.0 + self.poisson))
            one, two, hoop, other = sym_grad(u), sym_grad(v), u[0] / radius, v[0] / radius
            volume = (one[0, 0] + one[1, 1] + hoop) * (two[0, 0] + two[1, 1] + other)
            return 2.0 * np.pi * radius * (lame * volume + 2.0 * shear * (ddot(one, two) + hoop * other))

        stiffness = skfem.BilinearForm(energy).assemble(basis).tocsc()
        on_axis = np.setdiff1d(np.flatnonzero(basis.doflocs[0] < 1e-9), axial(basis))
        bottom = np.flatnonzero(basis.doflocs[1] < 1e-9 - self.height)
        return basis, stiffness, np.union1d(on_axis, bottom)


class SphereContact:
    """Pressure of a sphere on the deformed surface: proportional to the depth of each point in it."""

    def __init__(self, radius: float, depth: float, penalty: float, surface: Any) -> None:
        self.radius, self.center, self.penalty, self.surface = radius, radius - depth, penalty, surface

    def energy(self, displacement: Array) -> float:
        """Return the energy of the pressure, J."""

        def stored(w: Any) -> Any:
            return np.pi * w.x[0] * self.penalty * self._place(w)[3] ** 2

        moved = self.surface.interpolate(displacement)
        return float(skfem.Functional(stored).assemble(self.surface, moved=moved))

    def load(self, displacement: Array) -> Array:
        """Return the force on each unknown, N."""

        def push(v: Any, w: Any) -> Any:
            r, z, distance, depth = self._place(w)
            return 2.0 * np.pi * w.x[0] * self.penalty * depth * (r * v[0] + z * v[1]) / distance

        moved = self.surface.interpolate(displacement)
        return np.asarray(skfem.LinearForm(push).assemble(self.surface, moved=moved))

    def stiffness(self, displacement: Array) -> Any:
        """Return the negative derivative of the load by the displacement, N/m, for a constant normal: positive."""

        def resist(u: Any, v: Any, w: Any) -> Any:
            r, z, distance, depth = self._place(w)
            along, across = (r * u[0] + z * u[1]) / distance, (r * v[0] + z * v[1]) / distance
            return 2.0 * np.pi * w.x[0] * self.penalty * (depth > 0.0) * along * across

        moved = self.surface.interpolate(displacement)
        return skfem.BilinearForm(resist).assemble(self.surface, moved=moved)

    def _place(self, w: Any) -> tuple[Any, Any, Any, Any]:
        r, z = w.x[0] + w["moved"][0], w.x[1] + w["moved"][1] - self.center
        distance = np.hypot(r, z)
        return r, z, distance, np.maximum(self.radius - distance, 0.0)


def axial(basis: Any) -> Array:
    """Return the numbers of the unknowns along the axis."""
    return np.concatenate([basis.nodal_dofs[1], basis.facet_dofs[1], basis.interior_dofs[1]])


def _graded(begin: float, end: float, cell: float) -> Array:
    """Return the coordinates after `begin` of cells that grow from `cell` up to `end`, m."""
    count = int(np.ceil(np.log1p((end - begin) * (_GROWTH - 1.0) / cell) / np.log(_GROWTH)))
    parts = np.cumsum(_GROWTH ** np.arange(count))
    return np.asarray(begin + (end - begin) * parts / parts[-1])
