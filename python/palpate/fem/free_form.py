"""The law of force that goes with a free-form deformation: five numbers, calibrated on a body's own compliance.

Displacements are u_i = sum_c B_ic q_c with cubic B-splines B on a uniform grid of control points c (Sederberg & Parry
1986). The change of control points that satisfies a contact with the least |q|^2 (Hsu, Hughes & Kaufman 1992) is that
of springs on them, so that nodes have the compliance g B B^T; a layer under each node adds l / A_i to its own. What
drags nodes along the surface finds springs and layers of its own on the same grid, calibrated in the same way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import nnls
from scipy.spatial import cKDTree

__all__ = ["FreeFormLaw", "calibrate", "weights"]

Array = NDArray[np.float64]
_PATCHES = 24  # that the calibration looks at


class FreeFormLaw(NamedTuple):
    """A grid of control points, how far each goes by a force on it, and how far a node's layer gives by a pressure."""

    spacing: float  # m
    give: float  # along the normals, m/N
    layer: float  # along the normals, m/Pa
    give_across: float  # along the surface, m/N
    layer_across: float  # along the surface, m/Pa


def weights(points: Array, spacing: float) -> sparse.csr_matrix:
    """Return the weight of each control point that is used (c) at each of the points (n, 3), as (n, c)."""
    cell = np.floor(points / spacing).astype(np.int64)
    t = points / spacing - cell
    s = 1 - t
    line = np.stack([s**3, 3 * t**3 - 6 * t**2 + 4, 3 * s**3 - 6 * s**2 + 4, t**3]) / 6  # 4, n, 3
    value = np.einsum("in,jn,kn->nijk", line[:, :, 0], line[:, :, 1], line[:, :, 2]).reshape(len(points), 64)
    step = np.stack(np.meshgrid(*[np.arange(4)] * 3, indexing="ij"), axis=-1).reshape(64, 3)
    control = (cell[:, None] + step).reshape(-1, 3)
    low = control.min(axis=0)
    used, column = np.unique(np.ravel_multi_index((control - low).T, np.ptp(control, axis=0) + 1), return_inverse=True)
    rows = np.repeat(np.arange(len(points)), 64)
    return sparse.csr_matrix((value.ravel(), (rows, column.ravel())), shape=(len(points), len(used)))


def calibrate(
    points: Array, normals: Array, areas: Array, compliance: NDArray[np.float32], spacing: float | None = None
) -> FreeFormLaw:
    """Return the law that comes nearest to a compliance (3n, 3n), m/N, of n nodes, areas in m^2.

    Give and layer fit, by least squares in patches of forty nodes, what a node does to others and to itself, along the
    normals and then along the surface; both are then scaled so that a flat end on twelve nodes, all gone equally far,
    feels the right force (median). Of grids from one to twelve times as wide as the nodes' areas, the one of least
    misfit along the normals is taken unless `spacing`, m, is given.
    """
    centres = np.random.default_rng(0).permutation(len(points))[:_PATCHES]
    near = cKDTree(points).query(points[centres], min(len(points), 40))[1].reshape(len(centres), -1)
    frames = np.stack([_frames(normals[patch]) for patch in near])  # patch, node, axis, direction: normal first
    blocks = []
    for patch in near:
        at = (3 * patch[:, None] + np.arange(3)).ravel()
        blocks.append(compliance[np.ix_(at, at)].reshape(len(patch), 3, len(patch), 3))
    along, across = (_Part(np.array(blocks, dtype=float), frames[..., some], areas[near]) for some in ([0], [1, 2]))
    width = float(np.sqrt(areas.mean()))
    best, step, least = (0.0, 0.0), width, np.inf
    for wide in [spacing] if spacing is not None else width * np.geomspace(1.0, 12.0, 16):
        found, wrong = along.fit(_shared(points, near, wide))
        if wrong < least:
            best, step, least = found, float(wide), wrong
    return FreeFormLaw(step, *best, *across.fit(_shared(points, near, step))[0])


class _Part:
    """What patches of k nodes do along some directions of their own (p, k, 3, d), and the law that comes nearest."""

    def __init__(self, blocks: Array, directions: Array, areas: Array) -> None:
        size = directions.shape[1] * directions.shape[3]
        self.target = np.einsum("piad,piajb,pjbe->pidje", directions, blocks, directions, optimize=True)
        self.target = self.target.reshape(-1, size, size)
        self.facing = np.einsum("piad,pjae->pidje", directions, directions)
        each = np.repeat(1.0 / areas, directions.shape[3], axis=1)
        self.layers = np.einsum("ij,pi->pij", np.eye(size), each)
        # A flat end on twelve nodes, moved by a metre as the first of them is directed.
        few = directions[:, :12]
        self.way = np.einsum("piad,pa->pid", few, directions[:, 0, :, 0]).reshape(len(few), -1)

    def fit(self, shared: Array) -> tuple[tuple[float, float], float]:
        """Return give, m/N, and layer, m/Pa, for (p, k, k) that nodes share of control points, and the misfit."""
        shape = (self.facing * shared[:, :, None, :, None]).reshape(self.target.shape)
        columns = np.stack([shape.ravel(), self.layers.ravel()], axis=1)
        (give, layer), wrong = nnls(columns, self.target.ravel())
        least = 0.02 * self.target.ravel() @ self.layers.ravel() / (self.layers**2).sum()  # nodes stay independent
        layer = max(layer, least)
        scale = float(np.median(self._force(give * shape + layer * self.layers) / self._force(self.target)))
        return (float(give * scale), float(layer * scale)), float(wrong)

    def _force(self, compliance: Array) -> Array:
        size = self.way.shape[1]
        forces = np.linalg.solve(compliance[:, :size, :size], self.way[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("pi,pi->p", forces, self.way))


def _shared(points: Array, near: NDArray[np.int64], spacing: float) -> Array:
    """Return B B^T of each patch (p, k, k)."""
    return np.array([(b @ b.T).toarray() for b in (weights(points[patch], spacing) for patch in near)])


def _frames(normals: Array) -> Array:
    """Return the normal and two directions across it, each (k, 3), as (k, 3, 3)."""
    aside = np.eye(3)[np.abs(normals).argmin(axis=1)]
    one = np.cross(normals, aside)
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return np.stack([normals, one, np.cross(normals, one)], axis=2)
