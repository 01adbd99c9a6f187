"""Equations of the thesis as printed, to show the effect of misprints."""

from __future__ import annotations

import numpy as np
from palpate.arrays import Array
from palpate.devices import Device

__all__ = ["PrintedArm", "body_jacobian", "rotation"]


def rotation(q: Array) -> Array:
    """Return R(q) (3, 3) of (2.10): attitude of the forearm in the base frame."""
    s1, c1, s3, c3 = np.sin(q[0]), np.cos(q[0]), np.sin(q[2]), np.cos(q[2])
    return np.array([[c1, -s1 * s3, c3 * s1], [0.0, c3, s3], [-s1, -c1 * s3, c1 * c3]])


def body_jacobian(q: Array, l1: float, l2: float) -> Array:
    """Return the linear rows (3, 3) of the Jacobian in the forearm's frame, (2.14), m/rad."""
    return np.array(
        [
            [l1 * np.cos(q[1]) + l2 * np.sin(q[2]), 0.0, 0.0],
            [0.0, l1 * np.cos(q[1] - q[2]), 0.0],
            [0.0, -l1 * np.sin(q[1] - q[2]), l2],
        ]
    )


class PrintedArm:
    """The arm with the printed signs: M23 = M32 = +h/2 sin(θ2-θ3) (2.64, 2.65) and C32 = +h/2 cos(θ2-θ3) θ2' (2.73)."""

    def __init__(self, device: Device, *, inertia: bool = True, coriolis: bool = True) -> None:
        """Take the arm of `device`; without `inertia` or `coriolis`, M23 or C32 has its correct sign."""
        self.device = device
        self.inertia = inertia
        self.wrong_coriolis = coriolis

    def mass_matrix(self, q: Array) -> Array:
        """Return M(q) (3, 3) as printed, kg m²."""
        mass = np.array(self.device.mass_matrix(q))
        if not self.inertia:
            return mass
        mass[1, 2] *= -1
        mass[2, 1] *= -1
        return mass

    def coriolis(self, q: Array, qd: Array) -> Array:
        """Return C(q, qd) (3, 3) as printed, kg m²/s."""
        matrix = np.array(self.device.coriolis(q, qd))
        if self.wrong_coriolis:
            matrix[2, 1] *= -1
        return matrix

    def acceleration(self, q: Array, qd: Array, tau: Array) -> Array:
        """Return qdd (3,), rad/s²: M and C as printed, the leading minus of (2.79) and (2.81) left out."""
        torque = tau - self.device.viscous * qd - self.coriolis(q, qd) @ qd - self.device.gravity(q)
        return np.asarray(np.linalg.solve(self.mass_matrix(q), torque), dtype=float)

    def energy(self, q: Array, qd: Array) -> float:
        """Return kinetic energy with the printed M plus the potential energy, J."""
        potential = float(self.device.energy(q, np.zeros(3)))
        return potential + 0.5 * float(qd @ self.mass_matrix(q) @ qd)
