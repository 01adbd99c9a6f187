"""A triangle mesh that can be touched."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.contact.diagnosis import Diagnosis, lengths
from palpate.errors import PalpateError
from palpate.files import check_readable
from palpate.units import parse_quantity

__all__ = ["Mesh", "MeshError"]

Array = NDArray[np.float64]


class MeshError(PalpateError):
    """A mesh is empty, not finite, not manifold, open without being allowed to, or its file cannot be read."""


class Mesh:
    """Vertices (n, 3), m, and triangles (m, 3) of indices into them, anticlockwise seen from outside.

    Triangles without area, repeated triangles and mixed winding are mended, and `diagnose().mended` tells it. A surface
    that has a border has no inside: say `open=True` if that is on purpose, and it is touched from both sides.
    """

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike, *, open: bool = False, mend: bool = True) -> None:
        points = _numbers(vertices)
        faces = _indices(triangles, len(points))
        told: list[str] = []
        if mend:
            faces, degenerate, duplicate, turned = _core.repair_mesh(points, faces)
            for count, what in (
                (degenerate, "without area dropped"),
                (duplicate, "that were there twice dropped"),
                (turned, "turned round"),
            ):
                if count:
                    told.append(f"{count} triangle{'s'[: count != 1]} {what}")
            if len(faces) == 0:
                raise MeshError("the mesh is empty: none of its triangles has an area")
        self.vertices = points
        self.triangles = np.asarray(faces, dtype=np.int64)
        self.open = bool(open)
        self._mended = tuple(told)
        for array in (self.vertices, self.triangles):
            array.setflags(write=False)
        self.core = _core.TriangleMesh(self.vertices, self.triangles, self.open)
        if not self.core.usable:
            self._refuse()

    @classmethod
    def load(cls, path: str | Path, *, unit: str, open: bool = False, mend: bool = True) -> Mesh:
        """Read STL, OBJ, PLY, OFF, GLB, or what else meshio knows, written in `unit`, such as "mm".

        Vertices at exactly the same place become one. Raises MeshError if the file cannot be read or has no triangles.
        """
        try:
            scale = parse_quantity(f"1 {unit}", "m")
        except ValueError:
            raise MeshError(f'unit: "{unit}" is no unit of length; write for example "mm"') from None
        vertices, triangles = _read(path)
        try:
            vertices, triangles = _weld(_numbers(vertices), _indices(triangles, len(vertices)))
            return cls(vertices * scale, triangles, open=open, mend=mend)
        except MeshError as problem:
            raise MeshError(f"{path}: {problem}") from None

    def __repr__(self) -> str:
        return f"<Mesh: {len(self.triangles)} triangles, {lengths(self.size)}{', open' * (not self.closed)}>"

    @property
    def size(self) -> tuple[float, float, float]:
        """Edges of the box around it along x, y and z, m."""
        x, y, z = np.ptp(self.vertices[self.triangles].reshape(-1, 3), axis=0).tolist()
        return x, y, z

    @property
    def extent(self) -> float:
        """Diagonal of the box around it, m."""
        return float(self.core.extent)

    @cached_property
    def closed(self) -> bool:
        """No borders: there is an inside."""
        return int(self.core.diagnosis()["open"][0]) == 0

    def diagnose(self) -> Diagnosis:
        """Look for everything that could make touching it surprising (a second or two for a million triangles)."""
        d = self.core.diagnosis()
        return Diagnosis(
            triangles=len(self.triangles),
            vertices=len(self.vertices),
            parts=int(d["parts"]),
            size=self.size,
            volume=float(d["volume"]),
            open_edges=d["open"][0],
            non_manifold_edges=d["non_manifold"][0],
            mixed_winding_edges=d["mixed_winding"][0],
            degenerate=d["degenerate"][0],
            duplicate=d["duplicate"][0],
            self_intersections=self.core.self_intersections()[0],
            pinched_vertices=self.core.pinched_vertices()[0],
            mended=self._mended,
        )

    def nearest(self, points: ArrayLike) -> tuple[Array, NDArray[np.int64]]:
        """Return the surface's nearest points (n, 3), m, to `points` (n, 3), m, and their triangles (n,)."""
        at, facet = self.core.nearest(np.ascontiguousarray(points, dtype=float).reshape(-1, 3))
        return np.asarray(at), np.asarray(facet)

    def move(self, positions: ArrayLike, vertices: ArrayLike | None = None) -> None:
        """Move `vertices` (n,), numbers; all of them if None, to `positions` (n, 3), m. Proxies ride along.

        Only the triangles around them are refitted. Raises MeshError, with nothing moved, if a position is not finite
        or a triangle would lose its area. A free tip that a closed mesh has come over is put on its surface.
        """
        to = _numbers(positions)
        count = len(self.vertices)
        which = np.arange(count) if vertices is None else np.atleast_1d(np.asarray(vertices))
        if which.shape != (len(to),) or not np.issubdtype(which.dtype, np.integer):
            raise MeshError(
                f"{len(to)} positions need as many vertex numbers; there are {which.shape} of {which.dtype}"
            )
        if len(which) and not (which.min() >= 0 and which.max() < count):
            raise MeshError(f"the vertices are numbered 0 to {count - 1}; asked to move {which.min()} to {which.max()}")
        flat = self.core.move(which.tolist(), to)
        if flat >= 0:
            raise MeshError(f"triangle {flat} would have no area there; nothing was moved")
        moved = self.vertices.copy()
        moved[which] = to
        moved.setflags(write=False)
        self.vertices = moved

    def _refuse(self) -> NoReturn:
        d = self.core.diagnosis()
        for name, words, cure in (
            ("degenerate", "without area", "drop them, or leave mend=True"),
            ("duplicate", "that were there before", "drop them, or leave mend=True"),
            ("non_manifold", "on edges that more than two share", "split the surface there"),
            ("mixed_winding", "that turn the other way than a neighbour", "leave mend=True (a Moebius band stays so)"),
            ("open", "at a border", "close the surface, or declare it open (open=True; in a scenario open = true)"),
        ):
            count, first = d[name]
            if count:
                raise MeshError(f"the mesh has triangles {words} ({count}, the first is triangle {first}): {cure}")
        raise MeshError("the mesh cannot be touched")


def _numbers(vertices: ArrayLike) -> Array:
    points = np.array(vertices, dtype=float, order="C")
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise MeshError(f"vertices must be (n, 3) numbers in m, at least three of them; they are {points.shape}")
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        first = int(np.argmax(bad))
        raise MeshError(
            f"vertices must be finite; {int(bad.sum())} are not, the first is vertex {first}: {points[first].tolist()}"
        )
    return points


def _indices(triangles: ArrayLike, vertices: int) -> NDArray[np.int64]:
    raw = np.asarray(triangles)
    if raw.ndim != 2 or raw.shape[1] != 3 or len(raw) == 0:
        raise MeshError(f"triangles must be (m, 3) vertex numbers, at least one row; they are {raw.shape}")
    if not np.issubdtype(raw.dtype, np.integer):
        raise MeshError(f"triangles must be whole numbers, not {raw.dtype}")
    bad = ((raw < 0) | (raw >= vertices)).any(axis=1)
    if bad.any():
        first = int(np.argmax(bad))
        raise MeshError(f"triangle {first} is {raw[first].tolist()}, but the vertices are numbered 0 to {vertices - 1}")
    return np.array(raw, dtype=np.int64, order="C")


def _weld(points: Array, faces: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Make vertices with equal coordinates one, in the order of their first use."""
    _, first, same = np.unique(
        points + 0.0, axis=0, return_index=True, return_inverse=True
    )  # + 0.0: minus zero is zero
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return points[np.sort(first)], rank[same.reshape(-1)][faces]


def _read(name: str | Path) -> tuple[Any, Any]:
    path = check_readable(name, MeshError, kind="the mesh's file")
    import trimesh

    kind = path.suffix.lower().lstrip(".")
    try:
        if kind in trimesh.available_formats():
            whole: Any = trimesh.load(path, force="mesh", process=False)
            vertices, faces = whole.vertices, whole.faces
        else:
            vertices, faces = _read_with_meshio(path)
    except MeshError:
        raise
    except Exception as problem:  # readers raise whatever they like
        raise MeshError(f"{path}: not a readable {kind or 'mesh'} file ({problem})") from problem
    if len(faces) == 0:
        raise MeshError(f"{path}: the file holds no triangles that can be read: it is empty, cut short or no mesh")
    return np.asarray(vertices), np.asarray(faces)


def _read_with_meshio(path: Path) -> tuple[Any, Any]:
    import meshio

    if path.suffix.lower() not in meshio.extension_to_filetypes:
        raise MeshError(f"{path}: STL, OBJ, PLY, OFF and GLB are read, and what meshio knows; this is none of them")
    whole = meshio.read(path)
    cells = [block.data for block in whole.cells if block.type == "triangle"]
    return whole.points, np.concatenate(cells) if cells else np.empty((0, 3), dtype=int)
