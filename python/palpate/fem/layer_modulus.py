"""Young's modulus of the elastic layer of a contact, from the tissue below each node.

The layer stands for the local compliance that the mesh lacks. Where the stiffness varies with the depth z, as under a
skin, its modulus is a mean of the moduli below the node. With the radius b of a circle of the area of the node's patch:

* under round tips the weights are exp(-z / (1.15 b)), and the depths are springs in series;
* under flat ends the weights are 1 / (z + 3 b)^2, and the mean is that of the fourth roots.

Both end at 4 b: the mesh resolves what lies deeper. Moduli count as at most 5 times and at least a twentieth of that at
the surface: an indefinitely stiff part would otherwise make the layer indefinitely stiff, at any depth.

Both were fitted to layered cylinders of axisymmetric quadratic elements. Their skins of 1 to 4 mm were 0.2 to 5 times
as stiff as the tissue below. Cells of 3.3 to 10 mm were pressed by spheres of 8 and 12 mm and flat ends of 5 and 8 mm.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import cKDTree

from palpate.arrays import Array
from palpate.fem.volume import Volume

_SAMPLES: Final = 32  # depths below each node
_CANDIDATES: Final = 24  # nearest tetrahedra by centroid, one of which contains a point
_ON_FACE: Final = 1e-6  # barycentric coordinate of a point on a face
_ROUND, _FLAT, _DEEPEST = 1.15, 3.0, 4.0  # lengths over b, see above
_SOFTEST, _STIFFEST = 0.05, 5.0  # over the modulus at the surface


def layer_moduli(nodes: Array, normals: Array, areas: Array, volume: Volume, young: Array) -> Array:
    """Return Young's modulus of the layer of each node under round tips and under flat ends (n, 2), Pa.

    Args:
        nodes: positions at rest (n, 3), m.
        normals: outward unit normals (n, 3).
        areas: of the patches of the nodes (n,), m^2.
        volume: mesh of the body.
        young: Young's modulus of each tetrahedron (t,), Pa.
    """
    if np.ptp(young) == 0.0:
        return np.full((len(nodes), 2), young[0])
    share = _DEEPEST / (_DEEPEST + _FLAT)
    part = share * (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    z = _FLAT * part / (1.0 - part)  # over b: quantiles of the weights under flat ends
    depths = np.sqrt(areas / np.pi)[:, None] * z
    points = nodes[:, None] - depths[..., None] * normals[:, None]
    at = _moduli_at(points.reshape(-1, 3), volume, young).reshape(depths.shape)
    at = np.clip(at, _SOFTEST * at[:, :1], _STIFFEST * at[:, :1])
    weights = (_FLAT + z) ** 2 * np.exp(-z / _ROUND)
    return np.column_stack([weights.sum() / ((1.0 / at) @ weights), (at**0.25).mean(axis=1) ** 4])


def _moduli_at(points: Array, volume: Volume, young: Array) -> Array:
    """Return Young's modulus at each point (q,), Pa: that of the tetrahedron around it, or of a near one.

    On a face, an edge or a vertex it is the mean of the tetrahedra there, so that their order does not matter.
    """
    corners = volume.points[volume.tetrahedra]
    inverse = np.linalg.inv(np.transpose(corners[:, 1:] - corners[:, :1], (0, 2, 1)))
    tree = cKDTree(corners.mean(axis=1))
    found = np.empty(len(points))
    for part in np.array_split(np.arange(len(points)), len(points) // 20_000 + 1):
        near = tree.query(points[part], range(1, 1 + min(_CANDIDATES, len(corners))))[1]
        others = np.einsum("qcij,qcj->qci", inverse[near], points[part, None] - corners[near, 0])
        least = np.minimum(others.min(axis=2), 1.0 - others.sum(axis=2))  # barycentric coordinate
        equal = least >= np.minimum(least.max(axis=1, keepdims=True), 0.0) - _ON_FACE
        found[part] = (young[near] * equal).sum(axis=1) / equal.sum(axis=1)
    return found
