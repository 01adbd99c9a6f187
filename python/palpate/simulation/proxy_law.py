"""Linear law of a contact, measured on the proxy itself by central differences."""

from __future__ import annotations

import numpy as np

from palpate import _core
from palpate.arrays import Array
from palpate.contact import Mesh
from palpate.simulation.contact_law import ContactLaw

__all__ = ["ProxyProbe"]

STEPS = (1e-7, 4e-7)  # m, of the differences
SMOOTH = 1e-3  # relative difference of the laws of both steps, above which the contact is not smooth
PLACED = 1e-9  # m, depth at which the proxy is placed


class ProxyProbe:
    """Proxy of a mesh whose linear law can be measured at any point of contact.

    Args:
        mesh: the mesh, in the device frame.
        surface: the core's surface, without damping.
        radius: of the tip, m.
    """

    def __init__(self, mesh: Mesh, surface: _core.Surface, radius: float) -> None:
        self.proxy = _core.Proxy(mesh.core, surface, radius)
        corners = mesh.vertices[mesh.triangles]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self.radius = radius

    def law(self, triangle: int, normal: Array, place: Array, tip: Array) -> ContactLaw | None:
        """Return the law of small motions of the tip about ``tip`` with the proxy at ``place``.

        The state is the proxy's position along the surface. A proxy that keeps its place has none. None without
        contact, or if the law is not smooth there: two sizes of the differences give different laws.

        Args:
            triangle: on which the proxy is.
            normal: of the contact, without shading (3,).
            place: of the proxy (3,), m.
            tip: of the tip (3,), m.
        """
        if self.radius == 0.0:
            facet = self.normals[triangle]
            normal = facet if facet @ normal >= 0.0 else -facet
        along = np.linalg.svd(normal[None])[2][1:]
        parts = [self._differences(normal, along, place, tip, step) for step in STEPS]
        if any(part is None for part in parts):
            return None
        (d, c, b, a), (d2, c2, b2, a2) = (part for part in parts if part is not None)
        size = float(np.abs(d).max())
        if max(np.abs(d - d2).max(), np.abs(c - c2).max()) > SMOOTH * size or (
            max(np.abs(a - a2).max(), np.abs(b - b2).max()) > SMOOTH
        ):
            return None
        if np.abs(b).max() < SMOOTH:  # the proxy keeps its place whatever the tip does
            return ContactLaw.stiffness(d)
        return ContactLaw(a, b, c, d)

    def _differences(
        self, normal: Array, along: Array, place: Array, tip: Array, step: float
    ) -> tuple[Array, Array, Array, Array] | None:
        """Return D (3, 3), C (3, 2), B (2, 3) and A (2, 2) by central differences; None without contact."""
        still = np.zeros(3)
        moves = [(still, step * axis) for axis in np.eye(3)] + [(step * axis, still) for axis in along]
        columns = []
        for proxy, point in moves:
            high, low = (self._respond(normal, place + sign * proxy, tip + sign * point) for sign in (1.0, -1.0))
            if high is None or low is None:
                return None
            columns.append((high - low) / (2.0 * step))
        both = np.stack(columns, axis=1)
        force, moved = both[:3], along @ both[3:]
        return force[:, :3], force[:, 3:], moved[:, :3], moved[:, 3:]

    def _respond(self, normal: Array, at: Array, tip: Array) -> Array | None:
        """Return the force on the object and the proxy (6,) once the proxy at ``at`` has followed the tip."""
        self.proxy.reset()
        path = np.ascontiguousarray([at + PLACED * normal, at - PLACED * normal, tip])
        rows, met = self.proxy.simulate_path(path)
        if met[1] < 0 or met[2] < 0:
            return None
        return np.concatenate([-rows[2, 6:9], rows[2, 0:3]])
