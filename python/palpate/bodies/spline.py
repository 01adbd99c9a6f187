"""The law of force that goes with a free-form deformation: three numbers, calibrated on a body's own compliance.

Displacements are u_i = sum_c B_ic q_c with cubic B-splines B on a uniform grid of control points c (Sederberg & Parry
1986). The change of control points that satisfies a contact with the least |q|^2 (Hsu, Hughes & Kaufman 1992) is that
of springs on them, so that nodes have the compliance g B B^T; a layer under each node adds l / A_i to its own.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import nnls
from scipy.spatial import cKDTree

__all__ = ["SplineLaw", "calibrate", "weights"]

Array = NDArray[np.float64]
_PATCHES = 24  # that the calibration looks at


class SplineLaw(NamedTuple):
    """A grid of control points, how far each goes by a force on it, and how far a node's layer gives by a pressure."""

    spacing: float  # m
    give: float  # m/N
    layer: float  # m/Pa


def weights(points: Array, spacing: float) -> sparse.csr_matrix:
    """Return the weight of each control point that is used (c) at each of the points (n, 3), as (n, c)."""
    cell = np.floor(points / spacing).astype(np.int64)
    t = points / spacing - cell
    s = 1 - t
    line = np.stack([s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3]) / 6  # 4, n, 3
    value = np.einsum("in,jn,kn->nijk", line[:, :, 0], line[:, :, 1], line[:, :, 2]).reshape(len(points), 64)
    step = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(64, 3)
    control = (cell[:, None] + step).reshape(-1, 3)
    used, column = np.unique(control, axis=0, return_inverse=True)
    rows = np.repeat(np.arange(len(points)), 64)
    return sparse.csr_matrix((value.ravel(), (rows, column.ravel())), shape=(len(points), len(used)))


def calibrate(
    points: Array, normals: Array, areas: Array, compliance: NDArray[np.float32], spacing: float | None = None
) -> SplineLaw:
    """Return the law that comes nearest to a compliance (3n, 3n), m/N, of n nodes, areas in m^2.

    Give and layer fit, by least squares in patches of forty nodes, what a node does to others and to itself; both are
    then scaled so that a flat end on twelve nodes, all gone equally far, feels the right force (median). Of grids from
    one to twelve times as wide as the nodes' areas, the one of least misfit is taken unless `spacing`, m, is given.
    """
    centres = np.random.default_rng(0).permutation(len(points))[:_PATCHES]
    near = cKDTree(points).query(points[centres], min(len(points), 40))[1].reshape(len(centres), -1)
    along = []
    for patch in near:
        at = (3 * patch[:, None] + np.arange(3)).ravel()
        block = compliance[np.ix_(at, at)].reshape(len(patch), 3, len(patch), 3)
        along.append(np.einsum("ia,iajb,jb->ij", normals[patch], block, normals[patch], optimize=True))
    target = np.array(along, dtype=float)
    facing = np.einsum("pia,pja->pij", normals[near], normals[near])
    layers = np.einsum("ij,pi->pij", np.eye(near.shape[1]), 1.0 / areas[near])
    width = float(np.sqrt(areas.mean()))
    best, least = SplineLaw(width, 0.0, 0.0), np.inf
    for step in [spacing] if spacing is not None else width * np.geomspace(1.0, 12.0, 16):
        shape = np.array([(b @ b.T).toarray() for b in (weights(points[patch], step) for patch in near)]) * facing
        (give, layer), wrong = nnls(np.stack([shape.ravel(), layers.ravel()], axis=1), target.ravel())
        layer = max(layer, 0.02 * target.ravel() @ layers.ravel() / (layers**2).sum())  # nodes stay independent
        found = give * shape + layer * layers
        scale = float(np.median(_force(found) / _force(target)))
        if wrong < least:
            best, least = SplineLaw(float(step), float(give * scale), float(layer * scale)), wrong
    return best


def _force(compliance: Array) -> Array:
    """Force on each patch's first twelve nodes, moved by one metre (p,), N."""
    few = compliance[:, :12, :12]
    return np.asarray(np.linalg.solve(few, np.ones((*few.shape[:2], 1))).sum(axis=(1, 2)))
