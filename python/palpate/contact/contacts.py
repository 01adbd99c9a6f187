"""Contact of a tip with a mesh: one tick, or a path."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.arrays import Array, Flags, Indices


@dataclass(frozen=True)
class Contact:
    """Contact in one tick. Vectors are in the mesh frame; without contact, normal and force are zero."""

    touching: bool
    position: Array
    """Position of the proxy or of the center of its sphere (3,), m."""
    normal: Array
    """Outward unit normal (3,)."""
    force: Array
    """Force of the surface on the tip (3,), N."""
    triangle: int
    """Triangle in contact; -1 without contact."""
    depth: float
    """Penetration of the tip below the proxy along the normal, m."""
    stiffness: float
    """Normal stiffness of the surface at the proxy, N/m."""


@dataclass(frozen=True)
class Contacts:
    """Contact in the n ticks of a path; `contacts[i]` is a `Contact`."""

    touching: Flags
    """(n,)"""
    position: Array
    """(n, 3), m."""
    normal: Array
    """(n, 3), unit, or zero without contact."""
    force: Array
    """(n, 3), N."""
    triangle: Indices
    """(n,), -1 without contact."""
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
