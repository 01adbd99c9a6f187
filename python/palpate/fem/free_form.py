"""Force law of a free-form deformation: five numbers, calibrated to the compliance of a body.

Displacements are u_i = sum_c B_ic q_c with cubic B-splines B on a uniform grid of control points c (Sederberg & Parry
1986). The control points that satisfy a contact with minimal |q|^2 (Hsu, Hughes & Kaufman 1992) are those of springs on
the control points. The nodes then have the compliance g B B^T. A surface layer under each node adds l / A_i to its own
compliance. The tangential compliance has its own g and l on the same grid.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from scipy import sparse
from scipy.optimize import nnls
from scipy.spatial import cKDTree

from palpate.arrays import Array, Indices, Single
from palpate.fem.errors import BodyWarning

Press: TypeAlias = Callable[[Array, float, float], float]

_PATCHES = 24  # sampled for the calibration
_PATCH_NODES, _INDENTER_NODES = 40, 12  # nodes of a patch, and under the flat indenter that sets the scale

_PLACES: Final = 8
_MISFIT: Final = 0.3  # of the force, beyond which a fit is warned of


class FreeFormLaw(NamedTuple):
    """Spacing of the control points, and the compliance of control points and of the surface layer."""

    spacing: float  # m
    control_compliance: float  # along the normals, m/N
    layer_compliance: float  # along the normals, m/Pa
    tangential_control_compliance: float  # m/N
    tangential_layer_compliance: float  # m/Pa


def weights(points: Array, spacing: float) -> sparse.csr_matrix:
    """Return the B-spline weight of each control point in use (c) at points (n, 3), m, as (n, c)."""
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
    points: Array, normals: Array, areas: Array, compliance: Single, spacing: float | None = None
) -> FreeFormLaw:
    """Return the law of least misfit to a compliance.

    Control and layer compliance are fitted by nonnegative least squares in patches of forty nodes, along the normals
    and then along the surface. They are then scaled to the right force (median) on a flat indenter that moves twelve
    nodes equally.

    Args:
        points: positions of the nodes (n, 3), m.
        normals: outward unit normals (n, 3).
        areas: of the nodes' patches (n,), m^2.
        compliance: (3n, 3n), m/N.
        spacing: of the control points, m. None selects the one of least normal misfit among 16 from one to twelve
            times the node spacing.
    """
    centers = np.random.default_rng(0).permutation(len(points))[:_PATCHES]
    patches = cKDTree(points).query(points[centers], min(len(points), _PATCH_NODES))[1].reshape(len(centers), -1)
    frames = np.stack([_frames(normals[patch]) for patch in patches])  # patch, node, axis, direction: normal first
    blocks = []
    for patch in patches:
        rows = (3 * patch[:, None] + np.arange(3)).ravel()
        blocks.append(compliance[np.ix_(rows, rows)].reshape(len(patch), 3, len(patch), 3))
    normal, tangential = (
        _Calibration(np.array(blocks, dtype=float), frames[..., columns], areas[patches]) for columns in ([0], [1, 2])
    )
    width = float(np.sqrt(areas.mean()))
    best, best_spacing, min_misfit = (0.0, 0.0), width, np.inf
    for candidate in [spacing] if spacing is not None else width * np.geomspace(1.0, 12.0, 16):
        law, misfit = normal.fit(_overlaps(points, patches, candidate))
        if misfit < min_misfit:
            best, best_spacing, min_misfit = law, float(candidate), misfit
    return FreeFormLaw(best_spacing, *best, *tangential.fit(_overlaps(points, patches, best_spacing))[0])


def check_fit(points: Array, areas: Array, law_force: Press, body_force: Press) -> None:
    """Warn if flat ends at eight places need a force that differs by more than 30 % from that of the body.

    The law is the same everywhere, so it misses that a body is softer far from its fixed places.

    Args:
        points: positions of the nodes (n, 3), m.
        areas: of the nodes' patches (n,), m^2.
        law_force: returns the force, N, of a flat end at a place, of a radius and pressed in by a depth, m.
        body_force: returns the same for the body's compliance.
    """
    radius = 2.0 * float(np.sqrt(areas.mean()))
    ratios = []
    for node in _spread(points, _PLACES):
        force = body_force(points[node], radius, radius / 4.0)
        if force > 0.0:
            ratios.append(law_force(points[node], radius, radius / 4.0) / force)
    if ratios and (min(ratios) < 1.0 - _MISFIT or max(ratios) > 1.0 + _MISFIT):
        warnings.warn(
            f"free_form: flat ends at {len(ratios)} places need {min(ratios):.2g} to {max(ratios):.2g} times the force "
            "of the body's compliance: use the compliance or a mass-spring model for forces",
            BodyWarning,
            stacklevel=3,
        )


def _spread(points: Array, count: int) -> list[int]:
    """Return nodes far from each other, from the one nearest to the mean on."""
    node = int(np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1)))
    chosen, distance = [node], np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    return chosen


class _Calibration:
    """Compliance of patches of k nodes along directions of their own (p, k, 3, d), and the fit of the law to it."""

    def __init__(self, blocks: Array, directions: Array, areas: Array) -> None:
        size = directions.shape[1] * directions.shape[3]
        self.target = np.einsum("piad,piajb,pjbe->pidje", directions, blocks, directions, optimize=True)
        self.target = self.target.reshape(-1, size, size)
        self.cosines = np.einsum("piad,pjae->pidje", directions, directions)
        inverse_areas = np.repeat(1.0 / areas, directions.shape[3], axis=1)
        self.layers = np.einsum("ij,pi->pij", np.eye(size), inverse_areas)
        # Unit displacement of a flat indenter along the direction of the first node.
        indented = directions[:, :_INDENTER_NODES]
        self.displacement = np.einsum("piad,pa->pid", indented, directions[:, 0, :, 0]).reshape(len(indented), -1)

    def fit(self, overlaps: Array) -> tuple[tuple[float, float], float]:
        """Return control, m/N, and layer compliance, m/Pa, and the misfit, for products B B^T (p, k, k)."""
        shape = (self.cosines * overlaps[:, :, None, :, None]).reshape(self.target.shape)
        columns = np.stack([shape.ravel(), self.layers.ravel()], axis=1)
        (control, layer), misfit = nnls(columns, self.target.ravel())
        min_layer = 0.02 * self.target.ravel() @ self.layers.ravel() / (self.layers**2).sum()  # keeps full rank
        layer = max(layer, min_layer)
        scale = float(np.median(self._force(control * shape + layer * self.layers) / self._force(self.target)))
        return (float(control * scale), float(layer * scale)), float(misfit)

    def _force(self, compliance: Array) -> Array:
        """Return the force on the flat indenter per unit displacement (p,), N/m."""
        size = self.displacement.shape[1]
        forces = np.linalg.solve(compliance[:, :size, :size], self.displacement[:, :, None])[:, :, 0]
        return np.asarray(np.einsum("pi,pi->p", forces, self.displacement))


def _overlaps(points: Array, patches: Indices, spacing: float) -> Array:
    """Return B B^T of each patch (p, k, k)."""
    return np.array([(b @ b.T).toarray() for b in (weights(points[patch], spacing) for patch in patches)])


def _frames(normals: Array) -> Array:
    """Return orthonormal frames (k, 3, 3) whose first column is the normal (k, 3)."""
    other = np.eye(3)[np.abs(normals).argmin(axis=1)]
    tangent = np.cross(normals, other)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    return np.stack([normals, tangent, np.cross(normals, tangent)], axis=2)
