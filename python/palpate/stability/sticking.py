"""Disturbance under which a proxy that sticks to a mesh goes on sticking, so that its contact has one mode.

While the proxy sticks, the loop is linear: x+ = M x + B w, with a disturbance w of the contact's force. It sticks while
the friction f_t stays within Coulomb's cone, |f_t| <= mu f_n. Let h_u[k] be the impulse response of u.f_t - mu f_n to
w, for a unit vector u along the surface. A disturbance of any course in time with |w| <= F changes u.f_t - mu f_n by at
most F times the sum of |h_u[k]|, so the proxy sticks if F sum |h_u| < mu f_n - |f_t| for every u. On the right is what
the run without the disturbance leaves of the cone, at its least from the sample on.
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
    """Return the largest disturbance of the contact's force, N, under which a resting proxy goes on sticking.

    The lower dynamic friction counts. Rounded to the nearest of 16 directions u, the bound is on the safe side.

    Args:
        site: where the proxy rests.
        trace: of the run, every tick; it may go on after the site, and then the proxy has to stick until its end.

    Returns:
        F, N; 0 if the proxy does not stick there, is at the limit of friction, or its motions do not decay.
    """
    point = site.point
    if site.resting.kind != "sticking" or not point.friction > 0.0 or not trace["touching"][site.row :, 0].all():
        return 0.0
    proxy = trace["proxy"][site.row :]
    if np.linalg.norm(proxy - proxy[0], axis=1).max() > STAYS:
        return 0.0
    if np.isinf(point.friction):
        return float("inf")
    directions, path = site.loop.directions, site.path
    matrix = closed_matrix(path, site.resting.law, directions)
    force, n = trace["object_force"][site.row :], point.normal
    pressed = point.stiffness * trace["depth"][site.row :, 0]
    left = point.friction * pressed - np.linalg.norm(force - np.outer(force @ n, n), axis=1)
    last = left[-max(len(left) // 5, 1) :]
    slack = float(left.min() - np.ptp(last))  # a transient that decays does not change it by more after the end
    if slack <= 0.0 or np.abs(np.linalg.eigvals(matrix)).max() >= 1.0:
        return 0.0
    angle = 2.0 * np.pi * np.arange(CORNERS) / CORNERS
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ point.tangents() / np.cos(np.pi / CORNERS)
    rows = point.tangential * around + point.friction * point.stiffness * n  # the depth is -n.x
    entry = np.vstack([path.B, np.zeros((len(matrix) - path.nstates, path.ninputs))])
    out = np.zeros((CORNERS, len(matrix)))
    out[:, : path.nstates] = rows @ directions @ path.C
    return slack / float(_peak_gain(matrix, entry, out).max())


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
