"""Triangle mesh for contact."""

from __future__ import annotations

import itertools
import logging
import re
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from palpate import _core
from palpate.arrays import Array, Indices
from palpate.contact.diagnosis import Diagnosis, format_size
from palpate.contact.simplices import components, half_edges, unique_rows
from palpate.errors import PalpateError, shorten
from palpate.files import check_readable
from palpate.units import parse_quantity

_FORMATS: Final = ("stl", "obj", "ply", "off", "glb")
_LARGEST: Final = 2_000_000_000  # bytes
_ZERO: Final = re.compile(rb"^f\b[^#\n]*\s0+(?=[/\s]|$)", re.MULTILINE)  # in a face of an OBJ file
_QUIET: Final = logging.NullHandler()  # trimesh logs the tracebacks of a broken file, to the terminal by default


class MeshError(PalpateError):
    """A mesh is empty, not finite, not manifold, or open without `open=True`, or its file cannot be read."""


class Mesh:
    """Triangle mesh: vertices (n, 3), m, and triangles (m, 3) of indices into them, counterclockwise from outside.

    Args:
        vertices: (n, 3), m.
        triangles: (m, 3), indices of vertices.
        open: whether the surface may have a border. An open surface has contact on both sides.
        repair: whether to drop triangles without area and repeated triangles, and to reorient triangles. The repairs
            are listed in `diagnose().repairs`.

    Raises:
        MeshError: the mesh is empty, not finite, not manifold, or has a border without `open=True`.
    """

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike, *, open: bool = False, repair: bool = True) -> None:
        points = check_vertices(vertices)
        faces = check_triangles(triangles, len(points))
        repairs: list[str] = []
        if repair:
            faces, degenerate, duplicate, flipped = _core.repair_mesh(points, faces)
            for count, change in (
                (degenerate, "without area dropped"),
                (duplicate, "repeated and dropped"),
                (flipped, "flipped"),
            ):
                if count:
                    repairs.append(f"{count} triangle{'s'[: count != 1]} {change}")
            if len(faces) == 0:
                raise MeshError("the mesh is empty: none of its triangles has an area")
        self.vertices = points
        self.triangles = np.asarray(faces, dtype=np.int64)
        self.open = bool(open)
        self._repairs = tuple(repairs)
        for array in (self.vertices, self.triangles):
            array.setflags(write=False)
        self.core = self._make_core()
        if not self.core.usable:
            self._refuse()

    def _make_core(self) -> Any:
        return _core.TriangleMesh(self.vertices, self.triangles, self.open)

    @classmethod
    def load(cls, path: str | Path, *, unit: str, open: bool = False, repair: bool = True) -> Mesh:
        """Read an STL, OBJ, PLY, OFF or GLB file.

        Vertices closer than 1e-6 of the extent are merged.

        Args:
            path: file.
            unit: of its coordinates, such as "mm".
            open: as in `Mesh`.
            repair: as in `Mesh`.

        Raises:
            MeshError: the file cannot be read or has no triangles, or the mesh is invalid.
        """
        vertices, triangles, scale = read_triangles(path, unit=unit)
        try:
            vertices, triangles = weld(check_vertices(vertices), check_triangles(triangles, len(vertices)))
            return cls(vertices * scale, triangles, open=open, repair=repair)
        except MeshError as problem:
            raise MeshError(f"{path}: {problem}") from None

    def __repr__(self) -> str:
        return f"<Mesh: {len(self.triangles)} triangles, {format_size(self.size)}{', open' * (not self.closed)}>"

    @property
    def size(self) -> tuple[float, float, float]:
        """Edges of the bounding box along x, y and z, m."""
        x, y, z = np.ptp(self.vertices[self.triangles].reshape(-1, 3), axis=0).tolist()
        return x, y, z

    @property
    def extent(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(self.core.extent)

    @cached_property
    def closed(self) -> bool:
        """Whether the mesh has no border, and so encloses a volume."""
        return int(self.core.diagnosis()["open"][0]) == 0

    def diagnose(self) -> Diagnosis:
        """Return the counts of all defects; takes one or two seconds for a million triangles."""
        d = self.core.diagnosis()
        return Diagnosis(
            triangles=len(self.triangles),
            vertices=len(self.vertices),
            components=int(d["components"]),
            size=self.size,
            volume=float(d["volume"]),
            open_edges=d["open"][0],
            non_manifold_edges=d["non_manifold"][0],
            mixed_winding_edges=d["mixed_winding"][0],
            degenerate=d["degenerate"][0],
            duplicate=d["duplicate"][0],
            self_intersections=self.core.self_intersections()[0],
            pinched_vertices=self.core.pinched_vertices()[0],
            repairs=self._repairs,
        )

    def nearest(self, points: ArrayLike) -> tuple[Array, Indices]:
        """Return the points of the surface (n, 3), m, nearest to `points` (n, 3), m, and their triangles (n,).

        Raises:
            MeshError: a point is not finite, or its squared distance overflows.
        """
        nearest, faces = (
            np.asarray(x) for x in self.core.nearest(np.ascontiguousarray(points, dtype=float).reshape(-1, 3))
        )
        if np.any(faces < 0):
            row = int(np.flatnonzero(faces < 0)[0])
            raise MeshError(f"point {row} is not finite or too far from the mesh: give coordinates in meters")
        return nearest, faces

    def move(self, positions: ArrayLike, vertices: ArrayLike | None = None) -> None:
        """Move vertices, and the proxies on the surface with them.

        Only the triangles around the vertices are updated. If a closed mesh moves over a free tip, the proxy is placed
        on its surface.

        Args:
            positions: new positions (n, 3), m.
            vertices: indices of the vertices (n,); None for all.

        Raises:
            MeshError: a position is not finite, an index is out of range, or a triangle would lose its area. The mesh
                is unchanged.
        """
        target = check_vertices(positions)
        count = len(self.vertices)
        index = np.arange(count) if vertices is None else np.atleast_1d(np.asarray(vertices))
        if index.shape != (len(target),) or not np.issubdtype(index.dtype, np.integer):
            raise MeshError(
                f"{len(target)} positions need as many vertex indices; there are {index.shape} of {index.dtype}"
            )
        if len(index) and not (index.min() >= 0 and index.max() < count):
            raise MeshError(f"vertex indices are 0 to {count - 1}; given are {index.min()} to {index.max()}")
        degenerate = self.core.move(index.tolist(), target)
        if degenerate >= 0:
            raise MeshError(f"triangle {degenerate} would have no area there; nothing was moved")
        moved = self.vertices.copy()
        moved[index] = target
        moved.setflags(write=False)
        self.vertices = moved

    def _refuse(self) -> NoReturn:
        """Raise MeshError with the first defect."""
        d = self.core.diagnosis()
        for name, defect, remedy in (
            ("degenerate", "without area", "drop them, or use repair=True"),
            ("duplicate", "that repeat another one", "drop them, or use repair=True"),
            ("non_manifold", "on edges that more than two share", "split the surface there"),
            ("mixed_winding", "oriented opposite to a neighbor", "use repair=True (a Moebius band cannot be repaired)"),
            ("open", "at a border", "close the surface, or declare it open (open=True; in a scenario open = true)"),
        ):
            count, first = d[name]
            if count:
                raise MeshError(f"the mesh has triangles {defect} ({count}, the first is triangle {first}): {remedy}")
        raise MeshError("the mesh is not usable for contact: mesh again")


class BodySurface(Mesh):
    """Surface of a body, or a part of it. It may have a border, and edges that more than two triangles share.

    There tetrahedra join along an edge only, as in a body made of voxels. The core has copies of the vertices of such
    edges, so that `nearest` finds the triangles on them.
    """

    def __init__(self, vertices: ArrayLike, triangles: ArrayLike) -> None:
        super().__init__(vertices, triangles, open=True, repair=False)

    def _make_core(self) -> Any:
        halves = half_edges(self.triangles)
        number = unique_rows(np.sort(halves, axis=1))[1]
        face, side = np.divmod(np.flatnonzero(np.bincount(number)[number] > 2), 3)
        face, corner = np.tile(face, 2), np.concatenate([side, (side + 1) % 3])
        faces, copies = self.triangles.copy(), self.vertices[self.triangles[face, corner]]
        faces[face, corner] = len(self.vertices) + np.arange(len(face))
        return _core.TriangleMesh(np.concatenate([self.vertices, copies]), faces, True)


def check_vertices(vertices: ArrayLike) -> Array:
    """Return vertices (n, 3), m, as an array. Raise MeshError if one is not finite."""
    try:
        points = np.array(vertices, dtype=float, order="C")
    except (TypeError, ValueError):
        raise MeshError(f"vertices must be (n, 3) numbers in m, not {type(vertices).__name__}") from None
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0:
        raise MeshError(f"vertices must be (n, 3) numbers in m, at least three of them; they are {points.shape}")
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        first = int(np.argmax(bad))
        raise MeshError(
            f"vertices must be finite; {int(bad.sum())} are not, the first is vertex {first}: {points[first].tolist()}"
        )
    return points


def check_triangles(triangles: ArrayLike, vertices: int) -> Indices:
    """Return triangles (m, 3) as an array. Raise MeshError if an index is not below `vertices`."""
    raw = np.asarray(triangles)
    if raw.ndim != 2 or raw.shape[1] != 3 or len(raw) == 0:
        raise MeshError(f"triangles must be (m, 3) vertex indices, at least one row; they are {raw.shape}")
    if not np.issubdtype(raw.dtype, np.integer):
        raise MeshError(f"triangles must be whole numbers, not {raw.dtype}")
    bad = ((raw < 0) | (raw >= vertices)).any(axis=1)
    if bad.any():
        first = int(np.argmax(bad))
        raise MeshError(f"triangle {first} is {raw[first].tolist()}, but vertex indices are 0 to {vertices - 1}")
    return np.array(raw, dtype=np.int64, order="C")


def weld(points: Array, faces: Indices, tolerance: float = 1e-6) -> tuple[Array, Indices]:
    """Merge vertices closer than `tolerance` of the extent, in the order of their first use.

    Chains of close vertices become one vertex. STL files repeat each vertex, with different last bits.
    """
    first, same = unique_rows(points)
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    pairs = cKDTree(points[first]).query_pairs(tolerance * extent, output_type="ndarray")
    if len(pairs):
        group = components(pairs[:, 0], pairs[:, 1], len(first))
        earliest = np.full(group.max() + 1, len(points))
        np.minimum.at(earliest, group, first)
        first, same = earliest, group[same]
    rank = np.empty(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return points[np.sort(first)], rank[same][faces]


def read_triangles(path: str | Path, *, unit: str) -> tuple[Any, Any, float]:
    """Return the vertices and triangles of a file, as they are written, and its unit, m.

    Raises:
        MeshError: as `Mesh.load`.
    """
    try:
        scale = parse_quantity(f"1 {unit}", "m")
    except ValueError:
        raise MeshError(f'unit: "{unit}" is not a unit of length; write for example "mm"') from None
    return *_read(path), scale


def _read(name: str | Path) -> tuple[Any, Any]:
    path = check_readable(name, MeshError, kind="the mesh's file", limit=_LARGEST)
    kind = path.suffix.lower().lstrip(".")
    if kind not in _FORMATS:
        raise MeshError(f"{path}: not a known format: STL, OBJ, PLY, OFF and GLB are read")
    import trimesh

    logging.getLogger("trimesh").addHandler(_QUIET)
    try:
        data = BytesIO(path.read_bytes())  # has no neighbors that trimesh could read as well
        mesh: Any = trimesh.load(data, file_type=kind, force="mesh", process=False)
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except ImportError as problem:  # a reader guesses the encoding of bytes that are no text
        raise MeshError(f"{path}: not a readable {kind} file: truncated or damaged; export it again") from problem
    except Exception as problem:  # readers raise any exception
        if kind == "obj" and (mistake := _face_mistake(path)):
            raise MeshError(f"{path}: {mistake}") from problem
        raise MeshError(f"{path}: not a readable {kind} file ({shorten(str(problem), 200)})") from problem
    if len(faces) == 0:
        raise MeshError(f"{path}: the file has no triangles that can be read: it is empty, truncated or not a mesh")
    if kind == "obj" and _ZERO.search(data.getvalue()):  # trimesh takes the number 0 for the last vertex
        raise MeshError(f"{path}: {_face_mistake(path)}")
    return vertices, faces


def _face_mistake(path: Path) -> str:
    """Return the first face of an OBJ file that names a vertex which the file does not have; "" without any."""
    vertices = 0
    for number, line in enumerate(path.read_text(errors="replace").splitlines(), 1):
        word, *corners = line.split() or [""]
        vertices += word == "v"
        if word != "f":
            continue
        for corner in itertools.takewhile(lambda text: not text.startswith("#"), corners):
            index = corner.split("/")[0]
            if not index.lstrip("-").isdigit():
                return f'line {number}: "{corner}" is not the number of a vertex'
            if int(index) == 0 or abs(int(index)) > vertices:
                return f"line {number}: a face names vertex {index}; the {vertices} vertices before it count from 1"
    return ""
