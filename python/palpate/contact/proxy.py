"""Proxy (god object): point or sphere that stays on the surface while the tip penetrates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.arrays import Array, Flags, Indices
from palpate.contact.mesh import Mesh, MeshError
from palpate.contact.surface import Surface, SurfaceError
from palpate.errors import PoseError
from palpate.units import bounded_to_si


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


class Proxy:
    """Proxy of a tip on a mesh: a point, or a sphere.

    The proxy starts at the first tip, or at the nearest surface point if the tip is inside a closed mesh. Each tip is
    one tick. A tip that is not finite is counted in `invalid_input_count`, and the last contact is repeated.

    Args:
        mesh: the mesh.
        surface: stiffness, damping and friction; None for `Surface()`.
        radius: of a spherical proxy, m or text; 0 for a point.

    Raises:
        MeshError: `mesh` is not a mesh.
        SurfaceError: `surface` is not a surface or does not match the mesh, or the radius is negative.
    """

    def __init__(self, mesh: Mesh, surface: Surface | None = None, radius: float | str = 0.0) -> None:
        if not isinstance(mesh, Mesh):
            raise MeshError(f"a proxy needs a palpate.Mesh, not {mesh!r}; Mesh.load(path, unit=...) reads a file")
        if surface is not None and not isinstance(surface, Surface):
            raise SurfaceError(f"surface must be a palpate.Surface, such as Surface(stiffness={surface!r})")
        size = bounded_to_si(radius, "m", "radius", zero=True, error=SurfaceError)
        self.mesh = mesh
        self.surface = Surface() if surface is None else surface
        self.radius = size
        self.core = _core.Proxy(mesh.core, self.surface.core_for(mesh), size)

    def step(self, tip: ArrayLike) -> Contact:
        """Advance one tick with the tip at `tip` (3,), m, and return the contact."""
        point = _numbers(tip, "a tip is three numbers in m")
        if point.shape != (3,):
            raise PoseError(f"a tip is three numbers in m; this has shape {point.shape}")
        return self.simulate_path(point[None, :])[0]

    def simulate_path(self, path: ArrayLike) -> Contacts:
        """Advance one tick per row of `path` (n, 3), m, and return all contacts."""
        points = _numbers(path, "a path is (n, 3) numbers in m")
        if points.ndim != 2 or points.shape[1] != 3:
            raise PoseError(f"a path is (n, 3) numbers in m; this has shape {points.shape}")
        rows, triangle = self.core.simulate_path(points)
        return Contacts(
            touching=np.asarray(triangle) >= 0,
            position=rows[:, 0:3],
            normal=rows[:, 3:6],
            force=rows[:, 6:9],
            triangle=np.asarray(triangle),
            depth=rows[:, 9],
            stiffness=rows[:, 10],
        )

    def reset(self) -> None:
        """Release the contact, so that the next tip is the first one."""
        self.core.reset()

    @property
    def invalid_input_count(self) -> int:
        """Number of tips that were not finite."""
        return int(self.core.invalid_input_count)

    @property
    def iteration_limit_count(self) -> int:
        """Number of ticks that reached the iteration limit and continued in the next tick."""
        return int(self.core.iteration_limit_count)

    @property
    def sliding(self) -> bool:
        """Whether the proxy slid in the last tick."""
        return bool(self.core.sliding)


def _numbers(value: ArrayLike, requirement: str) -> NDArray[np.float64]:
    try:
        return np.ascontiguousarray(value, dtype=float)
    except (TypeError, ValueError):
        raise PoseError(f"{requirement}, without units; this is {value!r}") from None
