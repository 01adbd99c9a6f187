"""Disturbance under which a proxy that rests on a mesh goes on sticking, or stays on its face: one contact mode.

While the proxy sticks, the loop is linear: x+ = M x + B w, with a disturbance w of the contact's force. It sticks while
the friction f_t stays within Coulomb's cone, |f_t| <= mu f_n. Let h_u[k] be the impulse response of u.f_t - mu f_n to
w, for a unit vector u along the surface. A disturbance of any course in time with |w| <= F changes u.f_t - mu f_n by at
most F times the sum of |h_u[k]|, so the proxy sticks if F sum |h_u| < mu f_n - |f_t| for every u. On the right is what
the run without the disturbance leaves of the cone, at its least from the sample on.

Without friction the proxy follows the tip. It stays on its face while its distance from each edge, and the depth, are
positive: the same bound, with the impulse responses of these distances.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_discrete_lyapunov

from palpate.arrays import Array
from palpate.simulation.contact_law import closed_matrix
from palpate.simulation.trace import Trace
from palpate.stability.mesh_sites import Site

__all__ = ["largest_disturbance"]

CORNERS = 16  # of the polygon about the disk of directions u
TICKS = 1 << 14  # of the impulse response that are summed; the rest is bounded
BLOCK = 256
STAYS = 1e-9  # m: a proxy that moves less sticks


def largest_disturbance(site: Site, trace: Trace) -> float:
    """Return the largest disturbance of the contact's force, N, under which a resting proxy keeps its contact mode.

    With friction it sticks; the lower dynamic friction counts. Without friction it stays on its flat face.

    Args:
        site: where the proxy rests.
        trace: of the run, every tick; it may go on after the site, and then the proxy has to rest until its end.

    Returns:
        F, N; 0 if the proxy does not rest there, is at the limit, or its motions do not decay.
    """
    point, path = site.point, site.path
    if not trace["touching"][site.row :, 0].all():
        return 0.0
    if np.isinf(point.friction):
        return float("inf") if site.resting.kind == "sticking" else 0.0
    limits = _cone(site, trace) if point.friction > 0.0 and point.rubs else _edges(site, trace)
    if limits is None:
        return 0.0
    rows, left = limits
    last = left[-max(len(left) // 5, 1) :]
    slack = left.min(axis=0) - np.ptp(last, axis=0)  # a transient that decays changes it by less after the end
    matrix = closed_matrix(path, site.resting.law, site.loop.directions)
    if slack.min() <= 0.0 or np.abs(np.linalg.eigvals(matrix)).max() >= 1.0:
        return 0.0
    entry = np.vstack([path.B, np.zeros((len(matrix) - path.nstates, path.ninputs))])
    return float((slack / np.maximum(_peak_gain(matrix, entry, rows), 1e-300)).min())


def _cone(site: Site, trace: Trace) -> tuple[Array, Array] | None:
    """Return rows (16, n) of the loop's states for u.f_t - mu f_n, and what is left of the cone (k, 16), N.

    The directions u are rounded to the safe side. None if the proxy does not stick.
    """
    point, proxy = site.point, trace["proxy"][site.row :]
    if site.resting.kind != "sticking" or np.linalg.norm(proxy - proxy[0], axis=1).max() > STAYS:
        return None
    force, n = trace["object_force"][site.row :], point.normal
    pressed = point.stiffness * trace["depth"][site.row :, 0]
    left = point.friction * pressed - np.linalg.norm(force - np.outer(force @ n, n), axis=1)
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ point.tangents() / np.cos(np.pi / CORNERS)
    rows = point.tangential * around + point.friction * point.stiffness * n  # the depth is -n.x
    return _of_states(site, rows, np.zeros((CORNERS, 3))), np.tile(left[:, None], (1, CORNERS))


def _edges(site: Site, trace: Trace) -> tuple[Array, Array] | None:
    """Return rows (4, n) of the loop's states for the proxy's distances from the edges of its face, and for the depth.

    With them the distances and depths of the run (k, 4), m; None if the face is not flat, or the tip not on it.
    """
    if site.face is None or np.any(trace["triangle"][site.row :] != trace["triangle"][site.row]):
        return None
    corners, k_t = site.face, site.point.tangential
    edges = np.roll(corners, -1, axis=0) - corners
    normal = np.cross(edges[0], edges[1])
    inward = np.cross(normal, edges)
    inward /= np.linalg.norm(inward, axis=1, keepdims=True)
    proxy = trace["proxy"][site.row :]
    away = np.einsum("kij,ij->ki", proxy[:, None, :] - corners, inward)
    depth = trace["depth"][site.row :]
    n = site.point.normal
    tip = np.vstack([inward, -n])
    lag = np.vstack([-inward / k_t, np.zeros(3)]) if k_t > 0.0 else np.zeros((4, 3))  # f_t = k_t (x - p)
    return _of_states(site, tip, lag), np.hstack([away, depth])


def _of_states(site: Site, tip: Array, force: Array) -> Array:
    """Return rows (m, n) of the loop's states for motions of the tip (m, 3) plus forces on the object (m, 3)."""
    law, directions = site.resting.law, site.loop.directions
    moved = (tip + force @ law.D) @ directions @ site.path.C
    return np.asarray(np.hstack([moved, force @ law.C]), dtype=float)


def _peak_gain(matrix: Array, entry: Array, out: Array) -> Array:
    """Return the sum over k of |c M^k B|, for each row c of ``out`` (m, n): (m,), or an upper bound of it.

    The tail after TICKS is bounded by the norm of a Lyapunov matrix.
    """
    total, state = np.zeros(len(out)), entry
    powers = [out]
    for _ in range(BLOCK - 1):
        powers.append(powers[-1] @ matrix)
    rows, step = np.array(powers), np.linalg.matrix_power(matrix, BLOCK)  # (block, m, n)
    for _ in range(TICKS // BLOCK):
        total += np.linalg.norm(rows @ state, axis=2).sum(axis=0)
        state = step @ state
    # x'Px decays by 1 - 1/sigma in a tick: M'PM = P - I with P <= sigma I, and |c x| <= |c P^-1/2| |x|_P
    p = np.asarray(solve_discrete_lyapunov(matrix.T, np.eye(len(matrix)), method="bilinear"), dtype=float)
    root = np.linalg.cholesky(0.5 * (p + p.T)).T
    sigma = float(np.linalg.eigvalsh(p)[-1])
    size = float(np.linalg.norm(root @ state, 2)) / (1.0 - np.sqrt(max(1.0 - 1.0 / sigma, 0.0)))
    tail = np.linalg.norm(np.linalg.solve(root.T, out.T), axis=0) * size
    return np.asarray(total + tail, dtype=float)
