"""Parts of a mesh: whether tetrahedra keep those of the surface that they fill, and whether parts overlap or touch."""

from __future__ import annotations

import warnings
from typing import Final

import numpy as np

from palpate import _core
from palpate.arrays import Array, Flags, Indices
from palpate.contact.pseudonormals import Pseudonormals
from palpate.contact.simplices import area_vectors, components
from palpate.fem.closed_surface import ClosedSurface, parts_of
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.winding_number import WindingNumber

_CLOSE: Final = 1e-6  # of the extent: parts so near to each other touch
_FINEST: Final = 30  # points along an edge of a triangle that is sampled, at most


def unresolved_parts(points: Array, outside: Indices, piece: Indices, surface: ClosedSurface, step: float) -> Indices:
    """Return parts of a surface, cavities included, that tetrahedra do not resolve, one of each set that is joined.

    A part is missing if no point of the tetrahedra's surface is nearest to it, unless others cover half of its surface
    or more. Parts whose points belong to one piece of the tetrahedra, or of their surface, are joined. That is right of
    parts that overlap or touch; of the others the one with most points is resolved.

    Args:
        points: of the tetrahedra (n, 3), m.
        outside: triangles (k, 3) of their surface.
        piece: connected component of each point (n,).
        surface: the surface that they fill.
        step: mean edge of the tetrahedra, m.
    """
    used = np.unique(outside)
    part = surface.parts[surface.nearest(points[used])[1]]
    seen = np.bincount(part, minlength=int(surface.parts.max()) + 1)
    solid = surface.part_volumes > 0.0
    shell = np.zeros(len(points), dtype=np.int64)
    shell[outside] = parts_of(outside)[:, None]
    sets = _in_one(part, piece[used], (seen > 0) & solid) + _in_one(part, shell[used], seen > 0)
    group = np.arange(len(seen))
    if sets:
        group = components(*_touching(surface, np.unique(np.concatenate(sets)), step), len(seen))
    missing = np.flatnonzero(seen == 0).tolist()
    lost = {k for k in missing if not solid[k] or _covered(surface, k, step)[1].mean() < 0.5}
    for parts in sets:
        ordered = parts[np.argsort(-seen[parts], kind="stable")]
        first = np.sort(np.unique(group[ordered], return_index=True)[1])  # of each set that overlaps or touches
        lost.update(ordered[first[1:]].tolist())
    return np.array(sorted(lost), dtype=np.int64)


def _in_one(part: Indices, label: Indices, chosen: Flags) -> list[Indices]:
    """Return the sets of two and more of the `chosen` parts (p,) most of whose points have the same label.

    Args:
        part: of each point (n,).
        label: of each point (n,).
        chosen: parts that count (p,).
    """
    count = np.zeros((len(chosen), int(label.max()) + 1), dtype=np.int64)
    np.add.at(count, (part, label), 1)
    main = np.where(chosen, count.argmax(axis=1), -1)
    return [found for one in np.unique(main[chosen]) if len(found := np.flatnonzero(main == one)) > 1]


def _covered(surface: ClosedSurface, part: int, step: float) -> tuple[Array, Flags]:
    """Return points of the surface of a part (n, 3), m, and whether another part covers them (n,).

    Solid parts cover by a winding number of 1, cavities that overlap another one by -1.
    """
    points, normals = _sampled(surface.vertices, surface.triangles[surface.parts == part], step)
    outside = surface.winding_number(points + _CLOSE * surface.extent * normals)
    return points, (outside if surface.part_volumes[part] > 0.0 else np.abs(outside)) > 0.5


def _touching(surface: ClosedSurface, parts: Indices, step: float) -> tuple[Indices, Indices]:
    """Return pairs of `parts` that overlap or touch: a point of the one's surface is covered by the other."""
    close = _CLOSE * surface.extent
    covered = [points[under] for points, under in (_covered(surface, part, step) for part in parts.tolist())]
    pairs: list[tuple[int, int]] = []
    for k, part in enumerate(parts):
        faces = surface.triangles[surface.parts == part]
        corners = surface.vertices[np.unique(faces)]
        low, high = corners.min(axis=0) - close, corners.max(axis=0) + close
        winding = WindingNumber(surface.vertices, faces)
        for j, points in enumerate(covered):
            near = points[((points >= low) & (points <= high)).all(axis=1)]
            if j != k and len(near) and _covers(winding, surface, faces, near, close):
                pairs.append((int(parts[j]), int(part)))
    found = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    return found[:, 0], found[:, 1]


def _covers(winding: WindingNumber, surface: ClosedSurface, faces: Indices, points: Array, close: float) -> bool:
    """Return whether a point lies inside of a part, or on it."""
    if (np.abs(winding(points)) > 0.5).any():
        return True
    tree = _core.TriangleMesh(np.ascontiguousarray(surface.vertices), np.ascontiguousarray(faces), True)
    return bool((np.linalg.norm(np.asarray(tree.nearest(points)[0]) - points, axis=1) <= close).any())


def _sampled(vertices: Array, faces: Indices, step: float) -> tuple[Array, Array]:
    """Return points (n, 3), m, of triangles at distances of about half a step, and the normals there (n, 3)."""
    corners = vertices[faces]
    longest = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(axis=1)
    normal = area_vectors(vertices, faces)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.finfo(float).tiny)
    number = np.clip(np.ceil(2.0 * longest / step), 1, _FINEST).astype(np.int64)
    points, normals = [], []
    for n in np.unique(number):
        i, j = (index.ravel() for index in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
        i, j = (index[i + j < n] for index in (i, j))
        weights = np.stack([i, j, n - 1 - i - j], axis=1) + 1.0 / 3.0
        chosen = number == n
        points.append(np.einsum("wc,fcx->fwx", weights / n, corners[chosen]).reshape(-1, 3))
        normals.append(np.repeat(normal[chosen], len(weights), axis=0))
    return np.vstack(points), np.vstack(normals)


def check_joints(points: Array, outside: Indices, centers: Array) -> None:
    """Check that no parts of a mesh overlap or touch each other without being joined.

    Args:
        points: (n, 3), m.
        outside: triangles of the mesh's surface (k, 3), counterclockwise seen from outside.
        centers: of tetrahedra (m, 3), m.

    Raises:
        BodyError: a center lies in two parts.

    Warns if the center or a corner of a triangle of the surface is covered by another part.
    """
    winding = WindingNumber(points, outside)
    if (winding(centers) > 1.5).any():
        raise BodyError("parts of the mesh overlap each other: unite them, and mesh again")
    normals = Pseudonormals(points, outside)
    away = _CLOSE * float(np.linalg.norm(np.ptp(points, axis=0)))
    covered = winding(points[outside].mean(axis=1) + away * normals.of_faces) > 0.5
    used, corner = np.unique(outside, return_inverse=True)
    corners = winding(points[used] + away * normals.of_vertices[used]) > 0.5
    number = int((covered | corners[corner].reshape(-1, 3).any(axis=1)).sum())
    if number:
        warnings.warn(
            f"parts of the mesh touch each other at {number} triangles, whose points they do not share: they are not "
            "joined there, and may penetrate each other; merge the points to join them",
            BodyWarning,
            stacklevel=4,
        )
