"""Poses at which a constant torque or a constant tip force keeps a device at rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Flags
from palpate.devices import Device
from palpate.errors import PoseError
from palpate.linear.linearization import _vector


@dataclass(frozen=True)
class Equilibrium:
    """One equilibrium of a device under a constant load.

    Attributes:
        q: pose (dof,), rad, each within [0, 2 pi).
        torque: joint torque (dof,), N m.
        free: number of directions along which the pose remains an equilibrium.
        stable: True if no undamped mode grows: no eigenvalue in the open right half-plane.
    """

    q: Array
    torque: Array
    free: int
    stable: bool


def equilibria(
    device: Device,
    *,
    torque: ArrayLike | None = None,
    force: ArrayLike | None = None,
    starts: int = 8,
) -> list[Equilibrium]:
    """Return every pose found at which ``torque`` or ``force`` balances gravity, stable ones first.

    Newton's method with exact derivatives solves acceleration(q, 0, tau) = 0 from ``starts`` angles per joint. A joint
    without gravity (the base yaw) stays at 0 rad.

    Args:
        torque: constant joint torque (dof,), N m. Exactly one of torque and force is given.
        force: constant tip force (3,), N, base frame: tau = J(q)^T force.
        starts: starting angles per joint, spread over the circle.

    Raises:
        PoseError: none or both of torque and force given, wrong shape, or no pose balances the load.
    """
    if (torque is None) == (force is None):
        raise PoseError("equilibria: give either torque (N m) or force (N)")
    ideal = device.frictionless()
    n = ideal.dof
    load = _vector(torque, n, "torque", "N m") if torque is not None else np.zeros(0)
    tip = _vector(force, 3, "force", "N") if force is not None else np.zeros(0)

    def balance(q: Array) -> tuple[Array, Array, Array]:
        """Return acceleration (dof,), its derivative by the pose (dof, dof) and torque (dof,)."""
        if force is None:
            tau, geometric_stiffness = load, np.zeros((n, n))
        else:
            tau = ideal.jacobian(q).T @ tip
            geometric_stiffness = np.einsum("k,kij->ij", tip, ideal.tip_hessian(q))
        rest = np.zeros(n)
        a_q, _, a_tau = ideal.linearization(q, rest, tau)
        return ideal.acceleration(q, rest, tau), a_q + a_tau @ geometric_stiffness, tau

    found: list[Equilibrium] = []
    grid = 2 * np.pi * np.arange(starts) / starts + 0.1
    free_joint = _free_joints(ideal) if force is None else np.zeros(n, dtype=bool)
    axes = [np.zeros(1) if is_free else grid for is_free in free_joint]
    for start in product(*axes):
        root = _newton(balance, np.array(start))
        if root is None:
            continue
        root = np.mod(root, 2 * np.pi)
        root = np.where(root < 2 * np.pi, root, 0.0)  # an angle just below zero is rounded up to 2 pi
        if not any(np.all(np.abs(np.angle(np.exp(1j * (root - e.q)))) < 1e-6) for e in found):
            _, slope, tau = balance(root)
            found.append(_classify(root, slope, tau))
    if not found:
        load_text = f"torque {load.tolist()} N m" if force is None else f"force {tip.tolist()} N"
        raise PoseError(
            f"{ideal.name} has no equilibrium under {load_text}: gravity cannot balance it at any pose, "
            "so reduce the load (a joint without gravity needs exactly zero)"
        )
    return sorted(found, key=lambda e: (not e.stable, *e.q.tolist()))


def _classify(q: Array, slope: Array, torque: Array) -> Equilibrium:
    """Return an equilibrium with its stability from the derivative of the acceleration by the pose, ``slope``."""
    eigenvalues = np.linalg.eigvals(slope)
    scale = max(1.0, float(np.abs(eigenvalues).max()))
    free = int(np.sum(np.abs(eigenvalues) < 1e-9 * scale))
    stable = bool(np.all((eigenvalues.real < 1e-9 * scale) & (np.abs(eigenvalues.imag) < 1e-9 * scale)))
    return Equilibrium(q, torque, free, stable)


def _free_joints(device: Device, samples: int = 8) -> Flags:
    """Return (dof,) whether gravity is independent of each joint (tested at seeded random poses)."""
    rng = np.random.default_rng(0)
    poses = rng.uniform(-np.pi, np.pi, (samples, device.dof))
    reference = np.array([device.gravity(p) for p in poses])
    free = np.zeros(device.dof, dtype=bool)
    for j in range(device.dof):
        shifted = poses.copy()
        shifted[:, j] += 1.0
        free[j] = np.allclose(np.array([device.gravity(p) for p in shifted]), reference, rtol=0, atol=1e-12)
    return free


def _newton(balance: Callable[[Array], tuple[Array, Array, Array]], q: Array, steps: int = 40) -> Array | None:
    """Return a root of the balance by damped Newton steps of at most 0.5 rad, or None."""
    for _ in range(steps):
        residual, slope, _ = balance(q)
        step = np.linalg.lstsq(slope, -residual, rcond=1e-10)[0]
        size = float(np.abs(step).max())
        q = q + step * min(1.0, 0.5 / size) if size > 0 else q
        if size < 1e-13:
            break
    residual, slope, _ = balance(q)
    tolerance = 1e-9 * max(1.0, float(np.abs(slope).max()))
    return q if float(np.abs(residual).max()) < tolerance else None
