"""Generated surfaces, clean and defective. Each has an extent between 40 and 200 mm."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import trimesh
from palpate.arrays import Array, Flags, Indices
from palpate.contact.simplices import boundary
from palpate.fem.isosurface_stuffing import lattice_over, stuff
from scipy.spatial.transform import Rotation

__all__ = ["SHAPES", "Surface"]


class Surface(NamedTuple):
    """Vertices (n, 3), m, and triangles (m, 3)."""

    vertices: Array
    triangles: Indices


def _of(mesh: Any) -> Surface:
    return Surface(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64))


def _joined(*surfaces: Surface) -> Surface:
    return _of(trimesh.util.concatenate([trimesh.Trimesh(*surface, process=False) for surface in surfaces]))


def _moved(surface: Surface, *shift: float) -> Surface:
    return Surface(surface.vertices + np.array(shift), surface.triangles)


def _sphere(radius: float = 0.04, level: int = 3) -> Surface:
    return _of(trimesh.creation.icosphere(level, radius))


def _box(*sides: float) -> Surface:
    return _of(trimesh.creation.box(sides))


def _turned() -> Surface:
    box = _box(0.06, 0.05, 0.04)
    turn = Rotation.from_rotvec(0.6 * np.array([1.0, 2.0, 3.0]) / 14.0**0.5)
    return Surface(np.asarray(turn.apply(box.vertices)), box.triangles)


def _tube(path: Array, radius: float, sides: int = 16) -> Surface:
    """Return the tube around a closed path (n, 3), m."""
    way = np.roll(path, -1, axis=0) - np.roll(path, 1, axis=0)
    way /= np.linalg.norm(way, axis=1)[:, None]
    across = np.cross(way, np.roll(way, 1, axis=0) - way)  # along the binormal
    across /= np.linalg.norm(across, axis=1)[:, None]
    other = np.cross(way, across)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    rings = radius * (np.cos(angle)[:, None] * across[:, None] + np.sin(angle)[:, None] * other[:, None])
    return Surface((path[:, None] + rings).reshape(-1, 3), _grid(len(path), sides))


def _grid(rows: int, columns: int) -> Indices:
    """Return the triangles of a torus of rows x columns vertices."""
    i, j = (index.ravel() for index in np.indices((rows, columns)))
    a, b = i * columns + j, (i + 1) % rows * columns + j
    c, d = i * columns + (j + 1) % columns, (i + 1) % rows * columns + (j + 1) % columns
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])


def _knot() -> Surface:
    t = 2.0 * np.pi * np.arange(160) / 160
    path = np.stack([np.sin(t) + 2 * np.sin(2 * t), np.cos(t) - 2 * np.cos(2 * t), -np.sin(3 * t)], axis=1)
    return _tube(0.016 * path, 0.009)


def _bumpy_torus() -> Surface:
    surface = _of(trimesh.creation.torus(0.04, 0.014))
    angle = np.arctan2(surface.vertices[:, 1], surface.vertices[:, 0])
    return Surface(surface.vertices * (1.0 + 0.08 * np.sin(7 * angle))[:, None], surface.triangles)


def _twisted() -> Surface:
    box = trimesh.creation.box((0.03, 0.03, 0.09)).subdivide().subdivide().subdivide().subdivide()
    turn = 20.0 * box.vertices[:, 2]
    x, y, z = box.vertices.T
    return Surface(
        np.stack([np.cos(turn) * x - np.sin(turn) * y, np.sin(turn) * x + np.cos(turn) * y, z], axis=1),
        np.asarray(box.faces, dtype=np.int64),
    )


def _organ() -> Surface:
    ball = trimesh.creation.icosphere(4)
    x, y, z = ball.vertices.T
    bumps = 1.0 + 0.08 * np.sin(5 * x) * np.sin(4 * y + 1.0) * np.cos(3 * z)
    return Surface(ball.vertices * bumps[:, None] * [0.036, 0.030, 0.021], np.asarray(ball.faces, dtype=np.int64))


class _Gyroid:
    """Piece of a thickened gyroid in a sphere, as an implicit surface."""

    vertices = 0.045 * np.array([[-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]])

    def signed(self, points: Array) -> Array:
        """Return a lower bound of the distance, m, positive inside."""
        k = 2.0 * np.pi / 0.05
        x, y, z = (k * points).T
        value = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
        return np.asarray(np.minimum((0.7 - np.abs(value)) / (2.0 * k), 0.04 - np.linalg.norm(points, axis=1)))

    def distance(self, points: Array) -> Array:
        """Return a lower bound of the distance from the surface, m."""
        return np.abs(self.signed(points))

    def inside(self, points: Array) -> Flags:
        """Return whether points lie inside."""
        return np.asarray(self.signed(points) > 0.0)


def _gyroid() -> Surface:
    piece = _Gyroid()
    points, cells = stuff(piece, lattice_over(piece.vertices[0], piece.vertices[1], 0.004))
    return Surface(points, boundary(cells))


def _concave() -> Surface:
    return _of(
        trimesh.creation.extrude_triangulation(
            np.array([[0, 0], [0.08, 0], [0.08, 0.03], [0.03, 0.03], [0.03, 0.08], [0, 0.08]]),
            np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]),
            0.04,
        )
    )


def _moebius() -> Surface:
    angle = 2.0 * np.pi * np.arange(80) / 80
    width = np.array([-1.0, 1.0])[:, None] * 0.012
    radius = 0.04 + width * np.cos(angle / 2.0)
    rows = np.stack([radius * np.cos(angle), radius * np.sin(angle), width * np.sin(angle / 2.0)], axis=-1)
    one, two = np.arange(80), np.roll(np.arange(80), -1)
    low, high = np.where(two == 0, 80, two), np.where(two == 0, 0, two + 80)
    faces = np.concatenate([np.stack([one, low, high], axis=1), np.stack([one, high, one + 80], axis=1)])
    return Surface(rows.reshape(-1, 3), faces)


def _klein() -> Surface:
    rows, columns = 60, 24
    u, v = (
        index.ravel() * 2.0 * np.pi / n for index, n in zip(np.indices((rows, columns)), (rows, columns), strict=True)
    )
    radius = 0.03 + 0.01 * (np.cos(u / 2) * np.sin(v) - np.sin(u / 2) * np.sin(2 * v))
    height = 0.01 * (np.sin(u / 2) * np.sin(v) + np.cos(u / 2) * np.sin(2 * v))
    faces = _grid(rows, columns)
    last = faces >= (rows - 1) * columns
    seam = last.any(axis=1) & (faces < columns).any(axis=1)  # closes with v reversed
    turned = np.where(faces[seam] < columns, (-faces[seam]) % columns, faces[seam])
    faces = np.concatenate([faces[~seam], turned])
    return Surface(np.stack([radius * np.cos(u), radius * np.sin(u), height], axis=1), faces)


def _without(surface: Surface, keep: Flags) -> Surface:
    return Surface(surface.vertices, surface.triangles[keep])


def _soup(surface: Surface) -> Surface:
    corners = surface.vertices[surface.triangles].reshape(-1, 3)
    noise = 1e-8 * np.random.default_rng(0).uniform(-1.0, 1.0, corners.shape)
    return Surface(corners + noise, np.arange(len(corners)).reshape(-1, 3))


def _mixed() -> Surface:
    ball = _sphere()
    faces = ball.triangles.copy()
    faces[::3] = faces[::3, ::-1]
    return Surface(ball.vertices, np.concatenate([faces, faces[:40], faces[:7, [0, 0, 1]]]))


def _torn() -> Surface:
    ball = _sphere()
    return _without(ball, np.random.default_rng(2).permutation(len(ball.triangles)) > 12)


def _bowl() -> Surface:
    ball = _sphere()
    return _without(ball, ball.vertices[ball.triangles].mean(axis=1)[:, 2] < 0.01)


def _fin() -> Surface:
    """Return a sphere with a sheet inside, on whose border three triangles meet at an edge."""
    ball = _sphere()
    a, b, _ = ball.triangles[0]
    vertices = np.vstack([ball.vertices, [[0.0, 0.0, 0.0]]])
    new = len(ball.vertices)
    return Surface(vertices, np.vstack([ball.triangles, [[a, b, new], [b, a, new]]]))


def _flat() -> Surface:
    box = _box(0.08, 0.08, 0.02)
    return Surface(box.vertices * [1.0, 1.0, 0.0], box.triangles)


SHAPES: Final[dict[str, Callable[[], Surface]]] = {
    "sphere": _sphere,
    "block": lambda: _box(0.06, 0.05, 0.04),
    "turned block": _turned,
    "cylinder": lambda: _of(trimesh.creation.cylinder(0.03, 0.04, sections=64)),
    "cone": lambda: _of(trimesh.creation.cone(0.03, 0.06, sections=64)),
    "capsule": lambda: _of(trimesh.creation.capsule(0.05, 0.02)),
    "organ": _organ,
    "torus": lambda: _of(trimesh.creation.torus(0.04, 0.014)),
    "bumpy torus": _bumpy_torus,
    "knot": _knot,
    "twisted bar": _twisted,
    "gyroid piece": _gyroid,
    "concave L": _concave,
    "plate, 60 x 60 x 6 mm": lambda: _box(0.06, 0.06, 0.006),
    "plate, 80 x 80 x 0.5 mm": lambda: _box(0.08, 0.08, 0.0005),
    "rod, 8 x 8 x 120 mm": lambda: _box(0.008, 0.008, 0.12),
    "needles: 4 triangles": lambda: Surface(
        np.array([[0, 0, 0], [0.08, 0, 0], [0, 0.06, 0], [0.01, 0.01, 0.08]]),
        np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
    ),
    "sphere with cavity": lambda: _joined(_sphere(), Surface(_sphere(0.02).vertices, _sphere().triangles[:, ::-1])),
    "cavity oriented outwards": lambda: _joined(_sphere(), _sphere(0.02, 2)),
    "two parts, both fixed": lambda: _joined(_box(0.04, 0.04, 0.04), _moved(_box(0.04, 0.04, 0.04), 0.05, 0, 0)),
    "two parts, one above": lambda: _joined(_box(0.04, 0.04, 0.04), _moved(_box(0.04, 0.04, 0.04), 0, 0, 0.05)),
    "intersecting spheres": lambda: _joined(_sphere(0.03), _moved(_sphere(0.03), 0.03, 0.01, 0.0)),
    "touching blocks": lambda: _joined(_box(0.04, 0.04, 0.04), _moved(_box(0.04, 0.04, 0.04), 0.04, 0, 0)),
    "inverted sphere": lambda: Surface(_sphere().vertices, _sphere().triangles[:, ::-1]),
    "mixed orientation, repeated": _mixed,
    "soup with rounding errors": lambda: _soup(_sphere()),
    "twelve triangles missing": _torn,
    "sheet on three-triangle edge": _fin,
    "open bowl": _bowl,
    "Moebius band": _moebius,
    "Klein bottle": _klein,
    "no volume": _flat,
}
