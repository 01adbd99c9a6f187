"""A volume mesh of tetrahedra: a block of its own, a file's, or the inside of a closed surface."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cached_property
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.contact.diagnosis import lengths as sizes
from palpate.contact.mesh import Mesh
from palpate.fem.checks import length, lengths, point_of, positive, unit_of_length
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.mesher import tetrahedra
from palpate.files import check_readable

__all__ = ["SURFACES", "VOLUMES", "Volume", "block", "check_mesh_file", "fill", "grid", "read_volume"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SURFACES: Final = (".stl", ".obj", ".ply", ".off", ".glb")
VOLUMES: Final = (
    ".msh",
    ".vtk",
    ".vtu",
    ".mesh",
    ".med",
    ".inp",
    ".node",
    ".ele",
    ".xdmf",
    ".bdf",
    ".nas",
)  # some of them

# The faces of a tetrahedron of positive volume, anticlockwise seen from outside.
_FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
_MOST = 2e7  # tetrahedra; far more than any build has memory for


@dataclass(frozen=True, eq=False, repr=False)
class Volume:
    """Points (n, 3), m, and tetrahedra (m, 4) of indices into them.

    Tetrahedra are turned to positive volume, and points that none of them uses are dropped. Raises BodyError if one
    has no volume, an index does not exist, or a number is not finite; warns of a body beyond 1 mm to 2 m.
    """

    points: Array
    tetrahedra: Indices
    source: str = "given points and tetrahedra"

    def __post_init__(self) -> None:
        points, cells = lengths(self.points, "points"), np.array(self.tetrahedra)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise BodyError(
                f"the points of a volume are (n, 3) finite numbers in m; these are {points.shape}{_odd(points)}"
            )
        if cells.ndim != 2 or cells.shape[1] != 4 or len(cells) == 0 or not np.issubdtype(cells.dtype, np.integer):
            raise BodyError(f"tetrahedra are (m, 4) point numbers, at least one row; these are {cells.shape}")
        if cells.min() < 0 or cells.max() >= len(points):
            wrong = int(cells.min() if cells.min() < 0 else cells.max())
            raise BodyError(f"a tetrahedron names point {wrong}, but points are numbered 0 to {len(points) - 1}")
        used, cells = np.unique(cells, return_inverse=True)
        points, cells = points[used], cells.reshape(-1, 4).astype(np.int64)
        volumes = _volumes(points, cells)
        cells[volumes < 0] = cells[volumes < 0][:, [0, 2, 1, 3]]
        edges = points[cells[:, [1, 2, 3, 2, 3, 3]]] - points[cells[:, [0, 0, 0, 1, 1, 2]]]
        flat = np.abs(volumes) <= 1e-9 * np.linalg.norm(edges, axis=2).max(axis=1) ** 3
        if flat.any():
            raise BodyError(
                f"{int(flat.sum())} tetrahedra have no volume, the first is number {int(np.argmax(flat))}: mesh again"
            )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "tetrahedra", cells)
        if not 1e-3 <= self.extent <= 2.0:
            across = f"{self.extent:.3g} m" if self.extent > 1.0 else f"{1e3 * self.extent:.3g} mm"
            warnings.warn(
                f"the body is {across} across; if that is not meant, say its unit, such as mm",
                BodyWarning,
                stacklevel=3,
            )

    def __repr__(self) -> str:
        x, y, z = np.ptp(self.points, axis=0).tolist()
        return (
            f"<Volume: {len(self.tetrahedra)} tetrahedra, {len(self.points)} points, {sizes((x, y, z))}, {self.source}>"
        )

    def contains(self, point: ArrayLike) -> bool:
        """Return whether a point (3,), m, lies in one of the tetrahedra."""
        at = point_of(point)
        corners = self.points[self.tetrahedra]
        near = ((corners.min(axis=1) <= at) & (at <= corners.max(axis=1))).all(axis=1)
        first, others = corners[near, 0], corners[near, 1:] - corners[near, :1]
        share = np.linalg.solve(others.transpose(0, 2, 1), (at - first)[:, :, None])[:, :, 0]
        return bool(((share >= 0.0).all(axis=1) & (share.sum(axis=1) <= 1.0)).any())

    @property
    def extent(self) -> float:
        """Diagonal of the box around it, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @cached_property
    def size(self) -> float:
        """Volume, m^3."""
        return float(_volumes(self.points, self.tetrahedra).sum())

    @cached_property
    def surface(self) -> Indices:
        """Triangles (k, 3) of the surface, anticlockwise seen from outside."""
        faces = np.concatenate([self.tetrahedra[:, face] for face in _FACES])
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        if (count > 2).any():
            raise BodyError("more than two tetrahedra share a face: the mesh overlaps itself")
        return np.asarray(faces[np.sort(first[count == 1])])

    @cached_property
    def parts(self) -> NDArray[np.int64]:
        """The connected piece that each point belongs to (n,), numbered from 0."""
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        a, b = self.tetrahedra[:, [0, 0, 0]].ravel(), self.tetrahedra[:, 1:].ravel()
        graph = coo_matrix((np.ones(len(a)), (a, b)), shape=(len(self.points),) * 2)
        return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def block(
    size: float | str | Sequence[float | str],
    spacing: float | str | Sequence[float | str],
    *,
    layers: Sequence[float | str] = (),
) -> Volume:
    """Return a block from (0, 0, 0) to `size`, of cells of about `spacing`: one or three, m or text with units, each.

    Each cell is cut into six tetrahedra around one diagonal, all alike (Kuhn 1960). `layers` are depths under the top,
    m, where a plane of points shall lie, such as the lower side of a skin.
    """
    sides = _three(size, "size")
    steps = _three(spacing, "spacing")
    depths = sorted({0.0, sides[2], *(length(value, "layers") for value in layers)})
    if depths[0] < 0 or depths[-1] > sides[2]:
        raise BodyError(f"layers: they lie between 0 and the block's height of {sides[2]:g} m under its top")
    _check_count(6.0 * float(np.prod([side / step for side, step in zip(sides, steps, strict=True)])), "the block")
    lines = [np.linspace(0.0, side, max(1, round(side / step)) + 1) for side, step in zip(sides, steps, strict=True)]
    stack = [np.linspace(a, b, max(1, round((b - a) / steps[2])) + 1) for a, b in pairwise(depths)]
    lines[2] = sides[2] - np.unique(np.concatenate(stack))[::-1]
    return grid(lines, f"block of {' x '.join(f'{s * 1e3:g}' for s in sides)} mm")


def grid(lines: Sequence[Array], source: str = "grid") -> Volume:
    """Return cells between the planes at `lines` (three rising lists, m) along x, y and z, cut as in `block`."""
    if len(lines) != 3 or any(len(line) < 2 or not (np.diff(line) > 0).all() for line in lines):
        raise BodyError("a grid lies between planes at three rising lists of two places or more, in m")
    nx, ny, nz = (len(line) for line in lines)
    _check_count(6.0 * (nx - 1) * (ny - 1) * (nz - 1), source)
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(nx * ny * nz).reshape(nx, ny, nz)
    corner = [
        number[i : nx - 1 + i, j : ny - 1 + j, k : nz - 1 + k].ravel() for i in (0, 1) for j in (0, 1) for k in (0, 1)
    ]
    ways = ((4, 6), (4, 5), (2, 6), (2, 3), (1, 5), (1, 3))  # from corner 0 to corner 7, one axis at a time
    cells = np.concatenate([np.stack([corner[0], corner[a], corner[b], corner[7]], axis=1) for a, b in ways])
    return Volume(points, cells, source)


def read_volume(path: str | Path, *, unit: str) -> Volume:
    """Read the tetrahedra of a .msh, .vtk or other file that meshio knows, written in `unit`, such as "mm".

    Raises BodyError if there is no such file, it cannot be read, or it holds no tetrahedra.
    """
    file, scale = check_mesh_file(path), unit_of_length(unit)
    import meshio

    if not any(file.name.lower().endswith(ending) for ending in meshio.extension_to_filetypes):
        closed, filled = ", ".join(SURFACES), ", ".join(VOLUMES)
        raise BodyError(f"{file}: no mesh by its name: closed surfaces are {closed}; tetrahedra {filled} and more")
    said = StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(said):
            whole = meshio.read(file)
        cells = [cells.data[:, :4] for cells in whole.cells if cells.type in ("tetra", "tetra10")]
    except (Exception, SystemExit) as problem:  # readers raise whatever they like, and meshio prints and exits
        told = " ".join(said.getvalue().split()) if isinstance(problem, SystemExit) else str(problem)
        raise BodyError(f"{file}: not a whole volume mesh that meshio can read ({told})") from None
    if not cells:
        raise BodyError(f"{file}: the file holds no tetrahedra; a closed surface (STL, OBJ, PLY) is filled with them")
    return Volume(np.asarray(whole.points, dtype=float)[:, :3] * scale, np.concatenate(cells), file.name)


def check_mesh_file(path: str | Path) -> Path:
    """Return the file's path, or raise BodyError if a mesh cannot lie in it: there is none, or it is something else."""
    file = check_readable(path, BodyError, kind="the mesh's file")
    if file.suffix.lower() == ".h5":
        raise BodyError(f"{file}: no mesh; if it is a body, it is built already: palpate body show {file}")
    return file


def fill(vertices: ArrayLike, triangles: ArrayLike, spacing: float | str, *, source: str = "given surface") -> Volume:
    """Fill a closed surface with tetrahedra of edges of about `spacing`, m or text, by fTetWild (Hu et al. 2020).

    The surface of the result follows the given one to a thousandth of its extent. Raises BodyError if fTetWild is not
    installed, or what it makes has another volume than the surface encloses (the surface is open or pierces itself).
    """
    step = positive(spacing, "m", "spacing")
    surface = Mesh(vertices, triangles, open=True)
    corners, faces = np.ascontiguousarray(surface.vertices), surface.triangles.astype(np.int32)
    enclosed = _enclosed(corners, faces)
    if enclosed < 0.0:  # seen from inside
        enclosed, faces = -enclosed, np.ascontiguousarray(faces[:, ::-1])
    _check_count(6.0 * 2.0**0.5 * abs(enclosed) / step**3, source)  # as many as regular ones would be
    try:
        points, cells = tetrahedra(corners, faces, step)
    except BodyError as problem:
        raise BodyError(f"{source}: {problem}") from None
    if len(cells) == 0:
        raise BodyError(f"{source}: the surface cannot be filled: no tetrahedron lies inside; is it closed?")
    found = Volume(points, cells, source)
    if abs(found.size - enclosed) > 0.1 * abs(enclosed):
        raise BodyError(
            f"{source}: the surface encloses {enclosed * 1e6:.4g} cm^3 but its filling has "
            f"{found.size * 1e6:.4g} cm^3: close its borders, or ask for a smaller spacing"
        )
    return found


def _three(values: float | str | Sequence[float | str], field: str) -> list[float]:
    """Return three positive lengths, m, from as many or from one."""
    each = lengths(values, field).ravel().tolist()
    if len(each) not in (1, 3):
        raise BodyError(f"{field}: a block has three of them, or one for all, not {len(each)}")
    return [positive(value, "m", field) for value in each] * (3 // len(each))


def _odd(points: Array) -> str:
    bad = np.flatnonzero(~np.isfinite(points).reshape(len(points), -1).all(axis=1)) if points.ndim else np.empty(0)
    return f", {len(bad)} of them not finite, the first is number {bad[0]}" if len(bad) else ""


def _check_count(count: float, source: str) -> None:
    if count > _MOST:
        raise BodyError(
            f"spacing: {source} would take about {count:.1g} tetrahedra: take a larger spacing, and see that size, "
            "spacing and unit are meant"
        )


def _enclosed(vertices: Array, triangles: NDArray[Any]) -> float:
    a, b, c = (vertices[triangles[:, i]] - vertices.mean(axis=0) for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)


def _volumes(points: Array, cells: Indices) -> Array:
    a, b, c = (points[cells[:, i]] - points[cells[:, 0]] for i in (1, 2, 3))
    return np.asarray(np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0)
