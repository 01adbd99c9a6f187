"""Tetrahedral mesh: a block, a file, or the interior of a surface."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Indices
from palpate.contact.diagnosis import format_size
from palpate.contact.mesh import check_triangles, check_vertices
from palpate.contact.simplices import adjacent_faces, parts_of_cells, volumes
from palpate.fem.checks import length, lengths, positive, unit_of_length, warn_of_size
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.isosurface_stuffing import lattice_over, stuff
from palpate.fem.mesh_estimate import MAX_SPACING
from palpate.fem.mesh_improvement import improve, manifold
from palpate.fem.mesh_parts import check_joints, unresolved_parts
from palpate.fem.mesher import tetrahedra
from palpate.fem.refinement import Size, refine
from palpate.files import check_readable
from palpate.files.isolated import IsolatedError, run_isolated

Mesher: TypeAlias = Literal["stuffing", "ftetwild"]

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
    ".bdf",
    ".nas",
)

_MESHIO: Final = """
import numpy as np
import meshio

mesh = meshio.read(str(np.load("inputs.npz")["path"]))
cells = [block.data[:, :4] for block in mesh.cells if block.type in ("tetra", "tetra10")]
others = ("hexahedron", "wedge", "pyramid", "voxel", "penta", "polyhedron")
other = np.array([block.type for block in mesh.cells if block.type.startswith(others) for _ in block.data], dtype=str)
cells = np.concatenate(cells) if cells else np.empty((0, 4), dtype=int)
np.savez("result.npz", points=np.asarray(mesh.points, dtype=float), cells=cells.astype(np.int64), other=other)
"""

# Faces of a tetrahedron of positive volume, counterclockwise seen from outside.
_MAX_COUNT: Final = 2e7  # tetrahedra; far more than fit in memory
_MAX_GRADED: Final = 2e6  # tetrahedra of a graded mesh, ten times those of 50,000 nodes
_SAMPLED: Final = 5_000  # tetrahedra tested for an overlap
_SPECK: Final = 5e-3  # volume of a shell, relative to the body's, that is no detail
_VOLUME_ERROR: Final = 0.1  # relative, of a filled surface


@dataclass(frozen=True, eq=False, repr=False)
class Volume:
    """Tetrahedral mesh: points (n, 3), m, and tetrahedra (m, 4) of indices into them.

    Tetrahedra are oriented to positive volume, and unused points are dropped. Warns if the extent is not within 1 mm
    and 2 m.

    Raises:
        BodyError: a tetrahedron has no volume, an index is out of range, or a number is not finite.
    """

    points: Array
    tetrahedra: Indices
    source: str = "given points and tetrahedra"

    def __post_init__(self) -> None:
        points, cells = lengths(self.points, "points"), np.array(self.tetrahedra)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise BodyError(
                f"the points of a volume are (n, 3) finite numbers in m; these are {points.shape}{_not_finite(points)}"
            )
        if cells.ndim != 2 or cells.shape[1] != 4 or len(cells) == 0 or not np.issubdtype(cells.dtype, np.integer):
            raise BodyError(f"tetrahedra are (m, 4) point indices, at least one row; these are {cells.shape}")
        if cells.min() < 0 or cells.max() >= len(points):
            wrong = int(cells.min() if cells.min() < 0 else cells.max())
            raise BodyError(f"a tetrahedron has the point index {wrong}; indices are 0 to {len(points) - 1}")
        used, cells = np.unique(cells, return_inverse=True)
        points, cells = points[used], cells.reshape(-1, 4).astype(np.int64)
        size = volumes(points, cells)
        cells[size < 0] = cells[size < 0][:, [0, 2, 1, 3]]
        edges = points[cells[:, [1, 2, 3, 2, 3, 3]]] - points[cells[:, [0, 0, 0, 1, 1, 2]]]
        flat = np.abs(size) <= 1e-9 * np.linalg.norm(edges, axis=2).max(axis=1) ** 3
        if flat.any():
            raise BodyError(
                f"{int(flat.sum())} tetrahedra have no volume, the first has index {int(np.argmax(flat))}: mesh again"
            )
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "tetrahedra", cells)
        warn_of_size(self.extent, stacklevel=4)

    def __repr__(self) -> str:
        x, y, z = np.ptp(self.points, axis=0).tolist()
        counts = f"{len(self.tetrahedra)} tetrahedra, {len(self.points)} points"
        return f"<Volume: {counts}, {format_size((x, y, z))}, {self.source}>"

    @property
    def extent(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.points, axis=0)))

    @cached_property
    def size(self) -> float:
        """Volume, m^3."""
        return float(volumes(self.points, self.tetrahedra).sum())

    @cached_property
    def surface(self) -> Indices:
        """Triangles of the surface (k, 3), counterclockwise seen from outside."""
        faces, one, other = adjacent_faces(self.tetrahedra)
        if np.isin(one, other).any():
            raise BodyError("more than two tetrahedra share a face: the mesh overlaps itself; mesh again")
        return np.delete(faces, np.append(one, other), axis=0)

    def check_joints(self) -> None:
        """Check that no parts overlap or touch each other without being joined; see `mesh_parts.check_joints`."""
        if self.parts.max() == 0:
            return
        step = max(1, len(self.tetrahedra) // _SAMPLED)
        check_joints(self.points, self.surface, self.points[self.tetrahedra[::step]].mean(axis=1))

    @cached_property
    def parts(self) -> Indices:
        """Index of the connected component of each point (n,)."""
        return parts_of_cells(self.tetrahedra, len(self.points))


def block(
    size: float | str | Sequence[float | str],
    spacing: float | str | Sequence[float | str],
    *,
    layers: Sequence[float | str] = (),
) -> Volume:
    """Return a block from (0, 0, 0) to `size`, with each cell split into six congruent tetrahedra (Kuhn 1960).

    Args:
        size: one or three edges, m or text.
        spacing: approximate edges of the cells, one or three, m or text.
        layers: depths below the top, m or text, at which a plane of points lies, such as the bottom of a surface layer.

    Raises:
        BodyError: a length is not positive, a layer is outside of the block, or there are too many cells.
    """
    sides = _three(size, "size")
    steps = _three(spacing, "spacing")
    depths = sorted({0.0, sides[2], *(length(value, "layers") for value in layers)})
    if depths[0] < 0 or depths[-1] > sides[2]:
        raise BodyError(f"layers: their depths lie between 0 and the block's height of {sides[2]:g} m")
    _check_count(6.0 * float(np.prod([side / step for side, step in zip(sides, steps, strict=True)])), "the block")
    lines = [np.linspace(0.0, side, max(1, round(side / step)) + 1) for side, step in zip(sides, steps, strict=True)]
    stack = [np.linspace(a, b, max(1, round((b - a) / steps[2])) + 1) for a, b in pairwise(depths)]
    lines[2] = sides[2] - np.unique(np.concatenate(stack))[::-1]
    return grid(lines, f"block of {' x '.join(f'{s * 1e3:g}' for s in sides)} mm")


def grid(lines: Sequence[Array], source: str = "grid") -> Volume:
    """Return a rectilinear grid with cells split as in `block`.

    Args:
        lines: coordinates of the planes along x, y and z, three increasing lists, m.
        source: description of the mesh.

    Raises:
        BodyError: a list has fewer than two coordinates or is not increasing, or there are too many cells.
    """
    if len(lines) != 3 or any(len(line) < 2 or not (np.diff(line) > 0).all() for line in lines):
        raise BodyError("a grid needs three increasing lists of two coordinates or more, in m")
    nx, ny, nz = (len(line) for line in lines)
    _check_count(6.0 * (nx - 1) * (ny - 1) * (nz - 1), source)
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(nx * ny * nz).reshape(nx, ny, nz)
    corner = [
        index[i : nx - 1 + i, j : ny - 1 + j, k : nz - 1 + k].ravel() for i in (0, 1) for j in (0, 1) for k in (0, 1)
    ]
    paths = ((4, 6), (4, 5), (2, 6), (2, 3), (1, 5), (1, 3))  # along the axes from corner 0 to corner 7
    cells = np.concatenate([np.stack([corner[0], corner[a], corner[b], corner[7]], axis=1) for a, b in paths])
    return Volume(points, cells, source)


def read_volume(path: str | Path, *, unit: str) -> Volume:
    """Read the tetrahedra of a file of `VOLUMES`, by meshio in a process of its own.

    Args:
        path: file.
        unit: of its coordinates, such as "mm".

    Raises:
        BodyError: the file is missing, cannot be read, or has no tetrahedra or other cells as well.
    """
    file, scale = check_mesh_file(path), unit_of_length(unit)
    if file.suffix.lower() not in VOLUMES:
        raise BodyError(
            f"{file}: the suffix is not that of a mesh: closed surfaces are {', '.join(SURFACES)}; tetrahedra are "
            f"{', '.join(VOLUMES)}"
        )
    size = file.stat().st_size
    try:
        mesh = run_isolated(
            _MESHIO, {"path": str(file.absolute())}, seconds=60.0 + 1e-5 * size, memory=2_000_000_000 + 100 * size
        )
    except IsolatedError as problem:
        raise BodyError(f"{file}: not a complete volume mesh that meshio can read ({problem})") from None
    if mesh["points"].ndim != 2 or mesh["points"].shape[1] < 3 or not len(mesh["cells"]):
        raise BodyError(f"{file}: the file has no tetrahedra; give a volume mesh, or a closed surface (STL, OBJ, PLY)")
    if len(mesh["other"]):
        raise BodyError(
            f"{file}: the file has {len(mesh['other'])} cells of another kind ({mesh['other'][0]}) besides tetrahedra; "
            "divide them into tetrahedra"
        )
    try:
        return Volume(mesh["points"].astype(float)[:, :3] * scale, mesh["cells"], file.name)
    except BodyError as problem:
        raise BodyError(f"{file}: {problem}") from None


def check_mesh_file(path: str | Path) -> Path:
    """Return the path of a mesh file. Raise BodyError if there is no file, or it is a folder or a body."""
    file = check_readable(path, BodyError, kind="the mesh's file")
    if file.suffix.lower() == ".h5":
        raise BodyError(f"{file}: not a mesh; if it is a body, show it by palpate body show {file}")
    return file


def fill(
    vertices: ArrayLike,
    triangles: ArrayLike,
    spacing: float | str,
    *,
    mesher: Mesher = "stuffing",
    source: str = "given surface",
) -> Volume:
    """Fill a surface with tetrahedra.

    "stuffing" is isosurface stuffing (Labelle & Shewchuk 2007) with sharp edges: the same surface and spacing give the
    same tetrahedra, bit for bit. "ftetwild" is fTetWild (Hu et al. 2020), whose surface deviates from the input by at
    most a thousandth of its extent, and which is not deterministic. Small holes are closed with a warning.

    Args:
        vertices: (n, 3), m.
        triangles: (k, 3), indices of vertices.
        spacing: mean edge of the tetrahedra, m or text.
        mesher: "stuffing" or "ftetwild".
        source: description of the surface.

    Raises:
        BodyError: the surface has a large hole, the volume of the result is not the enclosed volume, because the
            spacing is too large, or fTetWild is not installed.
    """
    check_mesher(mesher)
    step = positive(spacing, "m", "spacing")
    surface = closed_surface(vertices, triangles, source)
    warn_of_size(surface.extent, stacklevel=3)
    for text in surface.warnings:
        warnings.warn(f"{source}: {text}", BodyWarning, stacklevel=2)
    return fill_surface(surface, step, mesher=mesher, source=source)


def closed_surface(vertices: ArrayLike, triangles: ArrayLike, source: str) -> ClosedSurface:
    """Return the repaired surface. Raise BodyError if it encloses no volume."""
    points = check_vertices(vertices)
    try:
        return ClosedSurface(points, check_triangles(triangles, len(points)))
    except BodyError as problem:
        raise BodyError(f"{source}: {problem}") from None


def check_mesher(mesher: str) -> None:
    """Raise BodyError unless `mesher` is known."""
    if mesher not in get_args(Mesher):
        raise BodyError(f'mesher: "stuffing" or "ftetwild", not {mesher!r}')


def fill_surface(
    surface: ClosedSurface, step: float, *, mesher: Mesher, source: str, size: Size | None = None
) -> Volume:
    """Fill a closed surface with edges of about `step`, m, or of `size` where that is smaller; see `fill`."""
    _check_count(6.0 * 2.0**0.5 * surface.volume / step**3, source)  # count of regular tetrahedra
    thick = surface.thickness
    if mesher == "stuffing" and step > MAX_SPACING * thick:
        raise BodyError(
            f"spacing: {source}: the body is {1e3 * thick:.2g} mm thick on average, too thin for a spacing of "
            f"{1e3 * step:.3g} mm: use a smaller one, such as {1e3 * thick / 2.0:.2g} mm"
        )
    try:
        if mesher == "ftetwild":
            points, cells = tetrahedra(surface.vertices, surface.triangles.astype(np.int32), step)
        else:
            points, cells = _stuffed(surface, step)
            if size is not None and len(cells):
                points, cells = refine(surface, points, cells, size, _MAX_GRADED)
                points = improve(surface, points, cells, float(size(points).min()))
    except BodyError as problem:
        raise BodyError(f"{source}: {problem}") from None
    enclosed = surface.volume
    filled = float(np.abs(volumes(points, cells)).sum())
    if abs(filled - enclosed) > _VOLUME_ERROR * enclosed and (surface.simple or filled < 0.5 * enclosed):
        raise BodyError(
            f"spacing: {source}: the surface encloses {enclosed * 1e6:.4g} cm^3 but tetrahedra of {1e3 * step:.3g} mm "
            f"fill {filled * 1e6:.4g} cm^3: it is too thin for them, so use a smaller spacing, such as "
            f"{1e3 * min(surface.thickness, step) / 2.0:.2g} mm"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BodyWarning)  # of its size, given before
        volume = Volume(points, cells, source)
    pieces, parts = int(volume.parts.max()) + 1, surface.shells
    if pieces > parts:
        raise BodyError(
            f"spacing: {source}: tetrahedra of {1e3 * step:.3g} mm fill {pieces} pieces of a surface of {parts} "
            f"part{'s'[: parts != 1]}: it is too thin in places, so use a smaller spacing, such as "
            f"{1e3 * step / 2.0:.2g} mm"
        )
    _check_parts(volume, surface, step, source)
    return volume


def _check_parts(volume: Volume, surface: ClosedSurface, step: float, source: str) -> None:
    """Raise BodyError if the tetrahedra join parts that do not touch, or fill a cavity; warn if these are specks."""
    count = int(surface.parts.max()) + 1
    if count == 1:
        return
    lost = unresolved_parts(volume.points, volume.surface, volume.parts, surface, step)
    if len(lost) == 0:
        return
    text = (
        f"tetrahedra of {1e3 * step:.3g} mm do not resolve {len(lost)} of the {count} parts and cavities of the "
        "surface: they join or fill what lies closer than that, or is thinner"
    )
    if (np.abs(surface.part_volumes[lost]) > _SPECK * surface.volume).any():
        raise BodyError(
            f"spacing: {source}: {text}; use a smaller spacing, such as {1e3 * step / 2.0:.2g} mm, or a surface with "
            "the parts united and the cavities closed"
        )
    warnings.warn(f"{source}: {text}", BodyWarning, stacklevel=4)


def _stuffed(surface: ClosedSurface, step: float) -> tuple[Array, Indices]:
    lattice = lattice_over(surface.vertices.min(axis=0), surface.vertices.max(axis=0), step)
    _check_count(12.0 * float(np.prod(lattice.shape)), "the lattice around the surface")
    points, cells = stuff(surface, lattice)
    if len(cells) == 0:
        return points, cells
    points, cells = manifold(points, cells)
    return improve(surface, points, cells, step), cells


def _three(values: float | str | Sequence[float | str], field: str) -> list[float]:
    """Return three positive lengths, m, from one or three values."""
    each = lengths(values, field).ravel().tolist()
    if len(each) not in (1, 3):
        raise BodyError(f"{field}: a block needs three values, or one for all axes, not {len(each)}")
    return [positive(value, "m", field) for value in each] * (3 // len(each))


def _not_finite(points: Array) -> str:
    bad = np.flatnonzero(~np.isfinite(points).reshape(len(points), -1).all(axis=1)) if points.ndim else np.empty(0)
    return f", {len(bad)} of them not finite, the first has index {bad[0]}" if len(bad) else ""


def _check_count(count: float, source: str) -> None:
    if count > _MAX_COUNT:
        raise BodyError(
            f"spacing: {source} would need about {count:.1g} tetrahedra: use a larger spacing, and check size, spacing "
            "and unit"
        )
