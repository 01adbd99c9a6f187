"""Where a tip touches and how hard: one tick, or a path's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Contact", "Contacts"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Contact:
    """One tick. All vectors are in the mesh's frame; apart from the surface, normal and force are zero."""

    touching: bool
    position: Array
    """Of the proxy, a sphere's centre (3,), m."""
    normal: Array
    """Unit, out of the surface (3,)."""
    force: Array
    """Of the surface on the tip (3,), N."""
    triangle: int
    """-1 if apart."""
    depth: float
    """Of the tip under the proxy, along the normal, m."""
    stiffness: float
    """Of the surface at the proxy, along the normal, N/m."""


@dataclass(frozen=True)
class Contacts:
    """The ticks of a path, n of them; `contacts[i]` is one."""

    touching: NDArray[np.bool_]
    """(n,)"""
    position: Array
    """(n, 3), m."""
    normal: Array
    """(n, 3), unit, or zero where apart."""
    force: Array
    """(n, 3), N."""
    triangle: NDArray[np.int64]
    """(n,), -1 where apart."""
    depth: Array
    """(n,), m."""
    stiffness: Array
    """(n,), N/m."""

    def __len__(self) -> int:
        return len(self.depth)

    def __getitem__(self, tick: int) -> Contact:
        return Contact(
            bool(self.touching[tick]),
            self.position[tick],
            self.normal[tick],
            self.force[tick],
            int(self.triangle[tick]),
            float(self.depth[tick]),
            float(self.stiffness[tick]),
        )
