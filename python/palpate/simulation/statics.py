"""Statics of a loop at rest: the deflection that a force causes, its error, and whether a force presses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Flags
from palpate.scenario import Scenario
from palpate.simulation.decision import BAND

__all__ = ["expected_deflection", "force_over_stiffness", "presses", "steady_error"]


def force_over_stiffness(force: ArrayLike, stiffness: ArrayLike, dof: int) -> Array:
    """Return the deflection that a force (n, 3), N, causes in springs of `stiffness` (n, 3), N/m: (n, 3), m.

    It is nan on axes without stiffness, and on axes that a device with `dof` joints does not move.
    """
    f, k = np.broadcast_arrays(np.atleast_2d(force).astype(float), np.atleast_2d(stiffness).astype(float))
    with np.errstate(divide="ignore", invalid="ignore"):
        expected = np.where(k > 0.0, f / k, np.nan)
    expected[:, dof:] = np.nan
    return np.asarray(expected, dtype=float)


def expected_deflection(scenario: Scenario | None) -> list[float | None]:
    """Return force over stiffness per axis, m, for a constant reference force; None for other axes.

    On a wall that the force presses it is the deflection along the normal.
    """
    unknown: list[float | None] = [None, None, None]
    if scenario is None or scenario.reference is None or scenario.contact_kind not in ("spring", "wall"):
        return unknown
    reference, stiffness = scenario.reference, scenario.object.stiffness
    if reference.shape not in ("step", "ramp") or reference.stop is not None or reference.force is None:
        return unknown
    assert stiffness is not None  # springs and walls have one
    force = np.array(reference.force)
    if scenario.contact_kind == "wall":
        normal = np.array(scenario.object.normal, dtype=float)
        if not presses(force, normal)[0]:
            return unknown
        normal /= np.linalg.norm(normal)
        force = np.where(normal != 0.0, force @ normal * normal, np.nan)
    expected = force_over_stiffness(force, stiffness, scenario.load_device().dof)[0]
    return [None if np.isnan(value) else float(value) for value in expected]


def steady_error(deflection: ArrayLike, expected: ArrayLike) -> Array:
    """Return the largest relative error of a steady deflection (n, 3) over the driven axes: (n,); nan without one.

    Driven are the axes whose expected deflection is above 5 % of the largest.
    """
    target = np.atleast_2d(expected).astype(float)
    size = np.nan_to_num(np.abs(target))
    driven = size > BAND * size.max(axis=1, initial=0.0)[:, None]
    relative = np.where(driven, np.abs(np.atleast_2d(deflection) / np.where(driven, target, 1.0) - 1.0), 0.0)
    return np.where(driven.any(axis=1), relative.max(axis=1), np.nan)


def presses(load: ArrayLike, outward: ArrayLike) -> Flags:
    """Return whether forces on the tip (n, 3) point against the outward normals (n, 3), of any length, of a surface."""
    f, n = np.atleast_2d(load), np.atleast_2d(outward)
    along = np.sum(f * n, axis=1)
    return np.asarray(along < -BAND * np.linalg.norm(f, axis=1) * np.linalg.norm(n, axis=1), dtype=bool)
