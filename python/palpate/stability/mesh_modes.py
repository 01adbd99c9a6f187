"""Linear laws of a tip's contact with a mesh, one for each contact mode of its proxy.

Each tick the proxy p follows the tip x. With the outward normal n, the depth d = n.(p - x) and the lag
l = (I - n n^T)(x - p), the tip pushes on the object with

    f = -k d n + k_t l.

The proxy keeps its place while |l| <= mu k d / k_t (sticking). Otherwise it reduces the lag along its direction s to
(mu k d / k_t + c |l|) / (1 + c). Here c = b / (T k_t) is the viscous friction. About steady sliding with a share
a = |l after| / |l before| of the lag kept in a tick, small motions obey

    l' = (g s s^T + a (I - n n^T - s s^T)) (l + dx) - (1 - g) (mu k / k_t) s n^T x,      g = c / (1 + c).

A fast slide has a = g, a slow one has a near 1. Without friction the proxy is the nearest point of the surface. A face
then has the stiffness k n n^T, a valley edge k (I - t t^T), and a vertex k I.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.arrays import Array
from palpate.simulation.contact_law import ContactLaw

__all__ = [
    "ContactMode",
    "SurfacePoint",
    "edge_modes",
    "face_modes",
    "friction_law",
    "sliding_mode",
    "vertex_mode",
]

SLIP_DIRECTIONS = 8
LAG_KEPT = (0.9, 1.0)  # shares of the lag, besides the least


@dataclass(frozen=True, eq=False)
class SurfacePoint:
    """Surface of a mesh at one point of contact.

    Attributes:
        normal: outward unit normal (3,).
        stiffness: k, N/m.
        tangential: k_t, N/m.
        friction: coefficient mu; infinity: the proxy never slides.
        drag: c = b / (T k_t) of the viscous friction b.
        damping: along the normal, N s/m.
        period: T, s.
    """

    normal: Array
    stiffness: float
    tangential: float
    friction: float
    drag: float
    damping: float
    period: float

    @property
    def rubs(self) -> bool:
        """Whether there is friction; without a tangential spring there is none."""
        return self.tangential > 0.0 and (self.friction > 0.0 or self.drag > 0.0)

    @property
    def least_kept(self) -> float:
        """Return g = c / (1 + c), the least share of the lag that a slide keeps."""
        return self.drag / (1.0 + self.drag)

    def tangents(self) -> Array:
        """Return two unit vectors along the surface, (2, 3)."""
        axis = np.eye(3)[int(np.argmin(np.abs(self.normal)))]
        first = axis - (axis @ self.normal) * self.normal
        first /= np.linalg.norm(first)
        return np.array([first, np.cross(self.normal, first)])


@dataclass(frozen=True, eq=False)
class ContactMode:
    """Contact mode: its kind, a description, and its law.

    Attributes:
        kind: "sticking", "sliding", "face", "edge" or "vertex".
        name: description in words.
        law: the law.
        normal: out of the surface (3,).
    """

    kind: str
    name: str
    law: ContactLaw
    normal: Array


def face_modes(point: SurfacePoint, directions: int = SLIP_DIRECTIONS) -> list[ContactMode]:
    """Return the modes of a contact with a face: sticking, and sliding in each of ``directions`` directions."""
    n, k = point.normal, point.stiffness
    normal = k * np.outer(n, n)
    if not point.rubs:
        return [_mode(point, "face", f"on a face of {k:.4g} N/m", ContactLaw.stiffness(normal))]
    modes = []
    across = np.eye(3) - np.outer(n, n)
    if point.friction > 0.0:
        law = ContactLaw.stiffness(normal + point.tangential * across)
        modes.append(_mode(point, "sticking", f"sticking to a face of {k:.4g} N/m", law))
    if np.isinf(point.friction):
        return modes
    if point.friction == 0.0:  # viscous friction alone is linear, and the same in every direction
        law = _lagging(normal, point.least_kept * across, 0.0 * across, point.tangential)
        return [_mode(point, "face", f"on a face of {k:.4g} N/m with viscous friction", law)]
    for angle in 2.0 * np.pi * np.arange(directions) / directions:
        s = np.array([np.cos(angle), np.sin(angle)]) @ point.tangents()
        shares = sorted({point.least_kept, *(a for a in LAG_KEPT if a > point.least_kept)})
        modes += [sliding_mode(point, s, kept) for kept in shares]
    return modes


def sliding_mode(point: SurfacePoint, s: Array, kept: float) -> ContactMode:
    """Return the mode of a proxy that slides on a face along the unit vector s (3,), and keeps a share of its lag."""
    n, k = point.normal, point.stiffness
    name = f"sliding on a face of {k:.4g} N/m along ({s[0]:.2f}, {s[1]:.2f}, {s[2]:.2f})"
    return _mode(point, "sliding", name, _slide(point, k * np.outer(n, n), np.eye(3) - np.outer(n, n), s, kept))


def edge_modes(point: SurfacePoint, along: Array) -> list[ContactMode]:
    """Return the modes of a proxy that slides along a valley edge of unit direction ``along`` (3,).

    With friction a proxy that sticks there obeys the law of one of its faces.
    """
    t, k = along, point.stiffness
    valley = k * (np.eye(3) - np.outer(t, t))
    if not point.rubs:
        return [_mode(point, "edge", f"in a valley of {k:.4g} N/m", ContactLaw.stiffness(valley))]
    if np.isinf(point.friction):
        return []
    name = f"sliding along a valley of {k:.4g} N/m"
    return [
        _mode(point, "edge", name, _slide(point, valley, np.outer(t, t), sign * t, point.least_kept))
        for sign in (1.0, -1.0)
    ]


def vertex_mode(point: SurfacePoint) -> ContactMode:
    """Return the mode of a proxy that is held by a vertex."""
    name = f"held by a vertex of {point.stiffness:.4g} N/m"
    return _mode(point, "vertex", name, ContactLaw.stiffness(point.stiffness * np.eye(3)))


def friction_law(point: SurfacePoint, along: Array) -> ContactLaw:
    """Return the law of a contact whose friction acts along ``along`` = u (2,), in the basis ``point.tangents()``.

    In every mode, and between modes, l' = g (l + dx) + (1 - g) (mu d k / k_t) u for some u with |u| <= 1. A law whose
    proxy never slides has the spring k_t instead. The states are the same for every normal. With viscous friction they
    include the proxy's lag less the tip (3); on a damped surface, the last position of the tip (3).
    """
    n, k, g = point.normal, point.stiffness, point.least_kept
    across = np.eye(3) - np.outer(n, n)
    normal, rub = k * np.outer(n, n), np.zeros((3, 3))
    if point.rubs and np.isinf(point.friction):
        normal, g = normal + point.tangential * across, 0.0
    elif point.rubs:
        rub = -(1.0 - g) * point.friction * k * np.outer(np.asarray(along) @ point.tangents(), n)
    law = ContactLaw.stiffness(normal + rub)
    if g > 0.0:
        kt = point.tangential
        memory = g * across
        law = ContactLaw(memory, memory + rub / kt - np.eye(3), kt * memory, normal + kt * memory + rub)
    return law if point.damping == 0.0 else _damped_by_tip(law, point)


def _damped_by_tip(law: ContactLaw, point: SurfacePoint) -> ContactLaw:
    """Return the law with a damper whose state is the last position of the tip."""
    m = len(law.A)
    a = np.zeros((m + 3, m + 3))
    a[:m, :m] = law.A
    rate = point.damping / point.period * np.outer(point.normal, point.normal)
    return ContactLaw(a, np.vstack([law.B, np.eye(3)]), np.hstack([law.C, -rate]), law.D + rate)


def _slide(point: SurfacePoint, normal: Array, plane: Array, s: Array, kept: float) -> ContactLaw:
    """Return the law of a proxy that slides along s, in a tangent ``plane`` given by its projector (3, 3)."""
    g = point.least_kept
    rub = -(1.0 - g) * point.friction * point.stiffness / point.tangential * np.outer(s, point.normal)
    side = plane - np.outer(s, s)
    if kept == 1.0:  # the lag across s stays as it is: a stiffness, and no state
        law = ContactLaw.stiffness(normal + point.tangential * (rub + side))
        return (
            law if g == 0.0 else _lagging(normal + point.tangential * side, g * np.outer(s, s), rub, point.tangential)
        )
    memory = g * np.outer(s, s) + kept * side
    if not memory.any():
        return ContactLaw.stiffness(normal + point.tangential * rub)
    return _lagging(normal, memory, rub, point.tangential)


def _lagging(normal: Array, memory: Array, rub: Array, tangential: float) -> ContactLaw:
    """Return the law f = normal x + k_t l', l' = memory (xi + x) + rub x, whose state xi = l' - x is the proxy."""
    basis, values, _ = np.linalg.svd(memory)
    basis = basis[:, values > 1e-12]  # other directions of the lag have no memory
    # with eta = basis^T xi and memory = M = U S U^T: M xi = U S eta, and eta <- U^T (l' - x)
    small = basis.T @ memory @ basis
    inward = memory + rub
    return ContactLaw(
        small,
        basis.T @ (inward - np.eye(3)),
        tangential * (basis @ small),
        normal + tangential * inward,
    )


def _mode(point: SurfacePoint, kind: str, name: str, law: ContactLaw) -> ContactMode:
    return ContactMode(kind, name, law.damped(point.damping, point.normal, point.period), point.normal)
