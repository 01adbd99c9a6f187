"""Error of a sphere's force by the mesh, against the number of nodes in contact and against the spacing.

Measured on meshes of isosurface stuffing with a spacing of 3.3, 4 and 5 mm: a cylinder of 20 x 60 mm, bonded below,
Poisson's ratio 0.45, a sphere of 8 mm at 24 places, 0.2 to 6 mm deep. The reference is converged linear elasticity
(axisymmetric quadratic elements). Large strains, another tip and locking add their own errors: spheres of other radii
exceeded the bound of contact along the normals by up to 1.6 times.

The estimate holds for spheres of at least the distance of the contact nodes. A smaller one meets nodes beside its axis
or none: of 200 random presses into each of three meshes, up to half exceeded it, by factors of up to 4.4. Flat ends are
within 20 % from 0.8 of the distance on; below 0.6 their force is between zero and 1.8 times that of a punch.

On a curved surface the contact radius is that of the effective radius (`CondensedBody.effective_radius`), and the mesh
misplaces the surface by a part of the sagitta over the distance of its nodes. The sagitta over the depth adds to the
error (root of the squares). On balls of 10 and 20 mm with cells of 2.5 to 6 mm, 499 of 517 presses by spheres of 4 to
9 mm were within the estimate of Hertz' force, the others up to 3 points beyond. With cells of 3 to 5 mm against 2 mm,
192 of 195 were in bowls of 10, 15 and 25 mm, and 212 of 224 on ellipsoids, saddles, ridges and bumps. A hollow that a
sphere fits closely is excluded (`fits_closely`).

Nor does it hold for shallow presses (`is_shallow`), of which there were none: with contact radii of 0.2 distances a
sphere on a node of a block felt 9 to 39 % of Hertz' force, as the points of a node lie beside it.

It is known for bodies of one modulus only (`has_known_error`). On skins of 0.2 to 20 times the modulus below it would
be 7 to 17 %, and the force was up to 40 % wrong; with a nodule ten times as stiff, 1 mm below the surface, up to 70 %.

Nor is it known for thin bodies (`is_thin`). By signed distance the force of a sphere of 8 mm was 11 to 23 % too small
on pads of 2 and 4 mm, bonded below, with contact radii of 0.77 to 1.1 thicknesses. With 0.5 thicknesses it was up to
4 %. Poisson's ratio was 0 to 0.45, cells a third to a whole thickness, the reference converged axisymmetric elasticity.

`softening` was measured against a neo-Hookean body of the same cells, of 3 and 4 mm, with spheres of 6 to 10 mm: blocks
of 60 x 60 mm, 12 and 30 mm thick, that cylinder, and a bumpy ellipsoid of 36 x 30 x 21 mm; with flat ends of 6 and 8 mm
on the thin block and the cylinder. It is the largest of them all, that of a tip of 8 mm on the block of 12 mm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from palpate.arrays import Array
from palpate.fem.checks import TipShape, number, positive
from palpate.fem.errors import BodyError

# Number of nodes in contact, and the relative error that 95 of 100 presses stay below.
_BY_NODES: Final[dict[bool, tuple[tuple[int, ...], tuple[float, ...]]]] = {
    False: ((1, 2, 3, 4, 5, 7, 10, 14, 20), (1.8, 0.60, 0.43, 0.39, 0.24, 0.14, 0.11, 0.09, 0.08)),
    True: ((1, 2, 3, 5, 7, 10), (0.53, 0.17, 0.13, 0.07, 0.05, 0.04)),
}
# Contact radius over the distance of contact nodes, and the largest relative error of contact by signed distance.
_RATIOS: Final = (0.38, 0.5, 0.65, 0.75, 0.92, 1.2, 1.5)
_BY_RATIO: Final = (0.33, 0.20, 0.15, 0.11, 0.09, 0.056, 0.04)
# Depth over radius, and by how much contact by signed distance was softer than a neo-Hookean body at most.
_SOFTER: Final = {
    "sphere": ((0.4, 0.5, 0.6, 0.8, 1.0), (0.14, 0.22, 0.29, 0.44, 0.60)),
    "flat": ((0.2, 0.4, 0.5, 0.6, 0.8, 1.0), (0.16, 0.18, 0.22, 0.30, 0.48, 0.60)),
}
_NODE_DISTANCE: Final = 0.672  # median distance of contact nodes over the spacing of the same meshes
_DEPTH: Final = 0.25  # default depth of a press over the radius of the tip
_SMALLEST: Final = {"sphere": 1.0, "flat": 0.7}  # radius over the distance of the nodes below which it is not resolved
_THIN: Final = 0.55  # contact radius over the thickness of the body
_CLOSE: Final = 0.2  # sagitta of a hollow times effective radius over radius of the sphere, relative to the depth
_NEIGHBORS: Final = 4  # nearest nodes to a node whose median distance is that of the nodes there


def has_known_error(record: Mapping[str, Any]) -> bool:
    """Return whether a body of this build record is like those of the measurement: quadratic elements, one modulus."""
    return record.get("order") == 2 and not record.get("regions") and record.get("surface_layer") is None


def is_thin(radius: float, depth: float, thickness: float) -> bool:
    """Return whether a body is too thin for the error of a sphere's force to be known.

    Args:
        radius: of the sphere, m; on a curved surface the effective one.
        depth: of its lowest point, m.
        thickness: of the body under it, m.
    """
    return float(np.sqrt(radius * depth)) > _THIN * thickness


def is_shallow(radius: float, depth: float, distance: float) -> bool:
    """Return whether a sphere presses too little for the error of its force to be known.

    Args:
        radius: of the sphere, m; on a curved surface the effective one.
        depth: of its lowest point, m.
        distance: of the contact nodes, m (`node_distance`).
    """
    return float(np.sqrt(radius * depth)) < _RATIOS[0] * distance * (1.0 - 1e-6)


def fits_closely(height: float, depth: float, curvature: float, radius: float) -> bool:
    """Return whether a sphere fits a hollow too closely for the error of its force to be known.

    Hertz' effective radius is then uncertain: of a sphere of 8 mm in a bowl of 10 mm with cells of 4 mm, 0.25 mm deep,
    the force was twice that with cells of 2 mm.

    Args:
        height: of the surface over the distance of the nodes, m (`CondensedBody.sagitta_at`).
        depth: of the sphere's lowest point, m.
        curvature: mean curvature of the surface, 1/m, negative in a hollow.
        radius: of the sphere, m.
    """
    return curvature < 0.0 and height > _CLOSE * depth * max(1.0 + radius * curvature, 0.0)


def force_error(nodes: int, *, signed_distance: bool, sagitta: float = 0.0) -> float | None:
    """Return the relative error of a sphere's force by the mesh that 95 of 100 presses stay below.

    Args:
        nodes: number of nodes in contact; None is returned for none.
        signed_distance: whether the contact is that by signed distance, else along the nodes' normals.
        sagitta: of the surface over the distance of the nodes, relative to the depth of the sphere; 0: it is flat.
    """
    if nodes < 1:
        return None
    counts, errors = _BY_NODES[signed_distance]
    return math.hypot(errors[int(np.searchsorted(counts, nodes, side="right")) - 1], sagitta)


def softening(depth: float, radius: float, tip: TipShape = "sphere") -> float | None:
    """Return by how much a tip's force by signed distance may be too small, as it assumes small strains, relative.

    Args:
        depth: of the tip, m; None is returned up to 0.4 radii of a sphere and 0.2 of a flat end.
        radius: of the tip, m.
        tip: "sphere" or "flat".
    """
    ratio, (depths, softer) = depth / radius, _SOFTER[tip]
    return float(np.interp(ratio, depths, softer)) if ratio > depths[0] * (1.0 + 1e-6) else None


def node_distance(nodes: Array, point: Array) -> float:
    """Return the distance of contact nodes (n, 3), m, about a point (3,), m: the median to four neighbors of a node.

    It is 0 for fewer than two nodes.
    """
    if len(nodes) < 2:
        return 0.0
    nearest = nodes[np.argmin(np.linalg.norm(nodes - point, axis=1))]
    return float(np.median(np.sort(np.linalg.norm(nodes - nearest, axis=1))[1 : _NEIGHBORS + 1]))


def unresolved(nodes: Array, point: Array, radius: float, tip: TipShape) -> str:
    """Return why contact nodes (n, 3), m, about a point (3,), m, do not resolve a tip; "" if they do."""
    distance = node_distance(nodes, point)
    if radius >= _SMALLEST[tip] * distance * (1.0 - 1e-6):
        return ""
    return (
        f"radius: the tip of {1e3 * radius:.3g} mm is too small for contact nodes that are {1e3 * distance:.3g} mm "
        "apart there"
    )


def pressed(tip_radius: float | str, depth: float | str | None) -> tuple[float, float]:
    """Return the radius of a tip and the depth of its presses, m; by default a quarter of the radius."""
    radius = positive(tip_radius, "m", "tip_radius")
    return radius, _DEPTH * radius if depth is None else positive(depth, "m", "depth")


def spacing_for(
    tip_radius: float | str, depth: float | str | None = None, accuracy: float | str | None = None
) -> float:
    """Return the spacing of tetrahedra, m, for a sphere's force by signed-distance contact of a given accuracy.

    The contact radius is sqrt(tip_radius * depth) (Hertz, on a flat surface). The body must be twice as thick as that
    (`is_thin`): on thinner ones the force is too small, on any mesh.

    Args:
        tip_radius: of the sphere, m or text.
        depth: of the press, m or text; None for a quarter of the radius.
        accuracy: relative error, or text such as "5%", which is the default.

    Raises:
        BodyError: a number is not positive, or the accuracy is not between 4 and 33 %.
    """
    radius, deep = pressed(tip_radius, depth)
    error = number("5%" if accuracy is None else accuracy, "", "accuracy")
    if not _BY_RATIO[-1] <= error <= _BY_RATIO[0]:
        raise BodyError(
            f"accuracy: {100.0 * error:g} %; the error of the mesh is known from {100 * _BY_RATIO[-1]:g} to "
            f'{100 * _BY_RATIO[0]:g} %: write for example "5%", or give a spacing'
        )
    ratio = float(np.interp(error, _BY_RATIO[::-1], _RATIOS[::-1]))
    return float(np.sqrt(radius * deep) / (ratio * _NODE_DISTANCE))
