"""Proof that a tip cannot rest on a mesh: integral action demands a force that friction does not admit.

At rest every state of the controller is constant. If its poles at z = 1 have a residue of full rank, the error
F_ref - F is then zero, so the object bears exactly the reference. A face of normal n bears it only within the cone of
its static friction, |F_t| <= mu_s |F_n|. Outside of it the tip slides, and the command grows without bound.
"""

from __future__ import annotations

import math

import numpy as np

from palpate.arrays import Array
from palpate.stability.contact_run import MOVING
from palpate.stability.mesh_contact import MeshContact
from palpate.stability.mesh_sites import TouchedSurface

__all__ = ["integrates_every_axis", "no_rest"]

AT_ONE = 1e-9  # singular value of A - I, relative to the largest, below which the controller has a pole at z = 1
RANK = 1e-6  # singular value of the residue, relative to the largest, below which an axis is not integrated


def integrates_every_axis(a: Array, b: Array, c: Array) -> bool:
    """Return whether a controller x <- a x + b e, u = c x has simple poles at z = 1 for every direction of e (3,)."""
    if len(a) == 0:
        return False
    u, values, vt = np.linalg.svd(a - np.eye(len(a)))
    null = values <= AT_ONE * max(float(values[0]), 1.0)
    left, right = u[:, null], vt[null].T
    pairing = left.T @ right
    if null.sum() < 3 or np.linalg.cond(pairing) > 1.0 / RANK:
        return False
    residue = c @ right @ np.linalg.solve(pairing, left.T @ b)
    sizes = np.linalg.svd(residue, compute_uv=False)
    return bool(len(sizes) >= 3 and sizes[2] > RANK * sizes[0])


def no_rest(contact: MeshContact) -> str:
    """Return why the tip cannot rest on any face that it crosses in the last half of its contact; empty if it may.

    The run shows it: at its end the tip slides on under constant forces, or is off the mesh.
    """
    s, trace, rest = contact.scenario, contact.observed.trace, contact.observed.rest
    surface = s.object.surface
    assert surface is not None
    if s.servo.topology != "force_tracking" or s.device.saturation or surface.shading != 0.0:
        return ""
    law = TouchedSurface(s).controller
    if law.design_stiffness is not None or not integrates_every_axis(law.system.A, law.system.B, law.system.C):
        return ""
    touching = np.flatnonzero(trace["touching"][: rest + 1, 0] > 0.0)
    rows = touching[len(touching) // 2 :]
    reference, normal = trace["reference_force"][rows], trace["normal"][rows]
    if np.ptp(reference, axis=0).any():
        return ""
    inward = -np.sum(reference * normal, axis=1)
    along = np.linalg.norm(reference + inward[:, None] * normal, axis=1)
    friction = float(surface.static_friction) if surface.tangential is None or float(surface.tangential) > 0.0 else 0.0
    if math.isinf(friction) or not np.all(along > friction * np.maximum(inward, 0.0)):
        return ""
    fifth = max(len(rows) // 5, 2)
    moved = np.linalg.norm(trace["proxy"][rows[-1]] - trace["proxy"][rows[-fifth]]) / (fifth * s.period)
    if contact.touching and not moved > MOVING:
        return ""
    steepest = math.degrees(float(np.arctan2(along, inward).min()))
    end = f"slides on at {1e3 * moved:.2g} mm/s" if contact.touching else "is off the mesh"
    return (
        f"the tip cannot rest: the controller integrates the error of the reference, which is {steepest:.3g} degrees "
        f"or more from the normal of every face crossed from t = {trace.time[rows[0]]:.3g} s on, and friction holds "
        f"{math.degrees(math.atan(friction)):.3g} degrees; at t = {trace.time[rest]:.3g} s, under constant forces, the "
        f"tip {end}. Give more friction (object.surface.static_friction) or turn the reference to the normal."
    )
