"""Plane whose force is a table or a formula of the depth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array
from palpate.errors import ScenarioError
from palpate.units import array_to_si, to_si

__all__ = ["ForceLaw", "law_fault"]


def law_fault(depth: Array, force: Array) -> str:
    """Return the first thing that is wrong with a table of depths, m, and forces, N; "" if nothing is."""
    if depth.ndim != 1 or depth.shape != force.shape or len(depth) < 2:
        return f"depth and force need the same number of entries, at least two, not {depth.shape} and {force.shape}"
    for name, column, unit in (("depth", depth, "m"), ("force", force, "N")):
        if not np.isfinite(column).all():
            row = int(np.flatnonzero(~np.isfinite(column))[0])
            return f"{name} {row + 1} is {column[row]}; every entry must be finite"
        if column[0] != 0.0:
            return f"the first {name} must be 0 {unit}, not {column[0]:g} {unit}"
        if np.any(fall := np.diff(column) <= 0.0):
            row = int(np.flatnonzero(fall)[0])
            return (
                f"{name} must rise from entry to entry, but it goes from {column[row]:g} to {column[row + 1]:g} {unit} "
                f"at entry {row + 2}; sort or smooth the table"
            )
    with np.errstate(over="ignore", divide="ignore"):
        steep = ~np.isfinite(np.diff(force) / np.diff(depth))
    return "a slope is not finite; the depths are too close to each other" if steep.any() else ""


@dataclass(frozen=True, eq=False)
class ForceLaw:
    """Plane that resists by a force of the depth, linear between the entries of a table.

    Both columns rise strictly from zero, so the force is the gradient of an energy, and its slope has a least and a
    largest value. Beyond the last entry the law goes on with the last slope. `palpate.simulate` takes it as `object`,
    and a scenario describes it with kind = "force_law".

    Attributes:
        depth: (n,), m; force: (n,), N.
        point: of the plane (3,), m.
        normal: outward unit vector (3,).

    Raises:
        ScenarioError: fewer than two entries, a value that is not finite, columns that do not rise from zero, or a
            normal without length.
    """

    depth: Array
    force: Array
    point: Array
    normal: Array

    def __post_init__(self) -> None:
        fault = law_fault(self.depth, self.force)
        if fault:
            raise ScenarioError(f"force law: {fault}")
        if self.point.shape != (3,) or self.normal.shape != (3,) or not np.isfinite([self.point, self.normal]).all():
            raise ScenarioError("force law: point and normal must be three finite numbers each")
        if not np.linalg.norm(self.normal) > 0.0:
            raise ScenarioError("force law: the normal has no length; give the outward direction, such as [0, 0, 1]")
        object.__setattr__(self, "normal", self.normal / np.linalg.norm(self.normal))

    @classmethod
    def table(cls, depth: ArrayLike, force: ArrayLike, point: ArrayLike, normal: ArrayLike) -> ForceLaw:
        """Return the law of a table; numbers in SI or texts with a unit."""
        error = ScenarioError
        d, f, p = (
            array_to_si(values, unit, f"force law: {name}", error=error)
            for values, unit, name in ((depth, "m", "depth"), (force, "N", "force"), (point, "m", "point"))
        )
        return cls(d, f, p, np.asarray(normal, dtype=float))

    @classmethod
    def formula(
        cls,
        force: Callable[[float], float],
        deepest: float | str,
        point: ArrayLike,
        normal: ArrayLike,
        entries: int = 1001,
    ) -> ForceLaw:
        """Return the law of a function of the depth, m, to the force, N, as a table down to a depth.

        The table is what runs and what is judged, so its slopes are exact.
        """
        last = to_si(deepest, "m", "force law: deepest", error=ScenarioError)
        depth = np.linspace(0.0, last, entries)
        try:
            values = np.array([float(force(float(x))) for x in depth])
        except (TypeError, ValueError) as problem:
            raise ScenarioError(f"force law: the formula must give one number for each depth: {problem}") from None
        return cls.table(depth, values, point, normal)

    @cached_property
    def slopes(self) -> Array:
        """Slopes between the entries (n - 1,), N/m."""
        return np.asarray(np.diff(self.force) / np.diff(self.depth), dtype=float)

    @property
    def stiffest(self) -> float:
        """Largest slope, N/m."""
        return float(self.slopes.max())

    @property
    def softest(self) -> float:
        """Least slope, N/m."""
        return float(self.slopes.min())

    def at(self, depth: float) -> float:
        """Return the force at a depth, N; 0 outside."""
        return float(_core.force_law_values(self.depth.tolist(), self.force.tolist(), depth)[0])

    def energy(self, depth: float) -> float:
        """Return the energy stored at a depth, J: the exact integral of the force."""
        return float(_core.force_law_values(self.depth.tolist(), self.force.tolist(), depth)[2])
