"""Closed surface of any triangles: repair, distance and inside.

Repairs depend on the coordinates only, not on the order of the triangles.
"""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np

from palpate import _core
from palpate.arrays import Array, Flags, Indices
from palpate.contact.mesh import weld
from palpate.contact.pseudonormals import Pseudonormals
from palpate.contact.simplices import area_vectors, components, equal_neighbors, half_edges, unique_rows
from palpate.fem.errors import BodyError
from palpate.fem.winding_number import WindingNumber

_LARGEST_HOLE: Final = 0.02  # of the area of the surface
_ALL_HOLES: Final = 0.1
_SAMPLE: Final = 500  # triangles at which intersecting parts are looked for
_FEATURE: Final = np.cos(np.radians(35.0))  # of the angle between normals at a sharp edge


class ClosedSurface:
    """Triangles that enclose a volume, and the repairs that made them do so.

    Welds vertices closer than 1e-6 of the extent, drops triangles without area and repeated ones, orients the triangles
    outwards, closes small holes, and makes a part inside of another one a cavity. If cavities are given inwards, a part
    given outwards that crosses one is solid, such as a strut. Edges with more than two triangles and intersecting parts
    remain: inside is a winding number above one half.

    Attributes:
        vertices: (n, 3), m, in the order of their coordinates.
        triangles: (k, 3), indices of vertices.
        repairs: one phrase each.
        warnings: repairs that may change the shape.

    Raises:
        BodyError: the surface is empty, has a large hole, or has one side only.
    """

    def __init__(self, vertices: Array, triangles: Indices) -> None:
        self.repairs: list[str] = []
        self.warnings: list[str] = []
        count = len(np.unique(triangles))
        points, faces = _sorted(*weld(vertices, triangles))
        if len(np.unique(faces)) < count:
            self.repairs.append(
                _count(count - len(np.unique(faces)), "duplicate vertex", "welded", "duplicate vertices")
            )
        given = faces
        faces, degenerate, duplicate, flipped = _core.repair_mesh(points, given)
        faces = np.asarray(faces, dtype=np.int64)
        for number, change in ((degenerate, "without area dropped"), (duplicate, "repeated and dropped")):
            if number:
                self.repairs.append(_count(number, "triangle", change))
        if len(faces) == 0:
            raise BodyError("the surface is empty: none of its triangles has an area")
        points, faces = self._close(points, faces)
        self.vertices, self.triangles = points, self._orient(points, faces, given, int(flipped))
        if self.volume <= 1e-9 * self.extent * self.area:
            raise BodyError("the surface encloses no volume: its triangles are flat, or inside and outside cancel")
        soup = np.ascontiguousarray(points[self.triangles].reshape(-1, 3))  # searched whatever its edges
        own = np.asarray(_core.repair_mesh(soup, np.arange(len(soup)).reshape(-1, 3))[0])
        self._number = own[:, 0] // 3  # of the triangles with an area
        self._tree = _core.TriangleMesh(soup, np.ascontiguousarray(own), True)

    def _close(self, points: Array, faces: Indices) -> tuple[Array, Indices]:
        """Close the borders by fans around their centers."""
        loops = _border(faces)
        if not loops:
            return points, faces
        total = float(np.linalg.norm(area_vectors(points, faces), axis=1).sum())
        centers: list[Array] = []
        fans: list[Indices] = []
        areas: list[float] = []
        for loop in loops:
            center = points[loop].mean(axis=0)
            fan = np.stack([np.roll(loop, -1), loop, np.full(len(loop), len(points) + len(centers))], axis=1)
            centers.append(center)
            fans.append(fan)
            areas.append(
                float(np.linalg.norm(area_vectors(np.vstack([points, *[c[None] for c in centers]]), fan), axis=1).sum())
            )
        seams = sum(area <= 1e-9 * total for area in areas)
        holes = len(loops) - seams
        if max(areas) > _LARGEST_HOLE * total or sum(areas) > _ALL_HOLES * total:
            raise BodyError(self._hole_message(faces, max(areas) / total, sum(areas) / total))
        if seams:
            self.repairs.append(_count(seams, "seam", "of vertices on an edge closed"))
        if holes:
            self.repairs.append(_count(holes, "hole", f"closed, {100.0 * sum(areas) / total:.2g} % of the area"))
            self.warnings.append(self.repairs[-1])
        return np.vstack([points, np.array(centers)]), np.concatenate([faces, *fans])

    def _hole_message(self, faces: Indices, largest: float, whole: float) -> str:
        open_edges = int((np.bincount(unique_rows(np.sort(half_edges(faces), axis=1))[1]) == 1).sum())
        if not open_edges:
            return "the surface has one side only (as a Moebius band), so it encloses no volume: mesh again"
        return (
            f"the surface has {open_edges} edges at a border, so it encloses no volume: close it; its holes have "
            f"{100.0 * whole:.3g} % of the area, the largest {100.0 * largest:.3g} %, and holes below "
            f"{100.0 * _LARGEST_HOLE:g} %, together {100.0 * _ALL_HOLES:g} %, are closed"
        )

    def _orient(self, points: Array, faces: Indices, given: Indices, flipped: int) -> Indices:
        """Orient parts outwards, and cavities inwards."""
        part = parts_of(faces)
        faces = faces.copy()
        volume = part_volumes(points, faces, part)
        inward = volume[part] < 0.0
        faces[inward] = faces[inward][:, ::-1]
        if flipped or inward.any():
            self.repairs.append(_count(max(flipped, int(inward.sum())), "triangle", "oriented outwards"))
        depth = _depths(points, faces, part)
        cavity = depth % 2 == 1
        crossing = _crossing(points, faces, part, np.flatnonzero(cavity))
        if crossing.any():
            solid = _given_outwards(points, given, faces, part, depth == 0)
            if solid[cavity].all():
                self.warnings.append("cavities cross each other: to make one a solid, orient the others inwards")
            else:
                cavity &= ~(crossing & solid)
        if cavity.any():
            faces[cavity[part]] = faces[cavity[part]][:, ::-1]
            self.warnings.append(
                _count(int(cavity.sum()), "cavity", "inside of a part; give an inclusion as a region", "cavities")
            )
            self.repairs.append(self.warnings[-1])
        return np.ascontiguousarray(faces)

    @cached_property
    def extent(self) -> float:
        """Diagonal of the bounding box, m."""
        return float(np.linalg.norm(np.ptp(self.vertices[self.triangles].reshape(-1, 3), axis=0)))

    @cached_property
    def area(self) -> float:
        """Area, m^2."""
        return float(np.linalg.norm(area_vectors(self.vertices, self.triangles), axis=1).sum())

    @cached_property
    def volume(self) -> float:
        """Enclosed volume, m^3; intersecting parts count twice."""
        middle = self.vertices.mean(axis=0)
        vectors = area_vectors(self.vertices, self.triangles)
        return float(np.einsum("ij,ij->", self.vertices[self.triangles[:, 0]] - middle, vectors) / 3.0)

    @property
    def thickness(self) -> float:
        """Twice the volume over the area, m: the thickness of a plate, two thirds of the radius of a sphere."""
        return 2.0 * self.volume / self.area

    @cached_property
    def parts(self) -> Indices:
        """Index of the part of each triangle (k,). Parts share no vertex."""
        return parts_of(self.triangles)

    @cached_property
    def part_volumes(self) -> Array:
        """Volume enclosed by each part (p,), m^3; that of a cavity is negative."""
        return part_volumes(self.vertices, self.triangles, self.parts)

    @cached_property
    def shells(self) -> int:
        """Number of shells: sets of triangles connected through edges of two triangles."""
        one, two = equal_neighbors(np.sort(half_edges(self.triangles), axis=1))
        crowded = np.isin(one, two) | np.isin(two, one)  # edges of more than two triangles
        return int(components(one[~crowded] // 3, two[~crowded] // 3, len(self.triangles)).max()) + 1

    @cached_property
    def winding_number(self) -> WindingNumber:
        """Winding number."""
        return WindingNumber(self.vertices, self.triangles)

    def nearest(self, points: Array) -> tuple[Array, Indices]:
        """Return the nearest points of the surface (n, 3), m, and their triangles (n,)."""
        nearest, faces = self._tree.nearest(np.ascontiguousarray(points))
        return np.asarray(nearest), self._number[np.asarray(faces)]

    def distance(self, points: Array) -> Array:
        """Return the distance of points (n, 3) from the surface (n,), m."""
        return np.asarray(np.linalg.norm(points - self.nearest(points)[0], axis=1))

    def inside(self, points: Array) -> Flags:
        """Return whether points (n, 3) lie inside (n,)."""
        return np.asarray(self.winding_number(points) > 0.5)

    @cached_property
    def simple(self) -> bool:
        """Whether the winding number is 1 below and 0 above a sample of the triangles: no parts intersect."""
        big = np.linalg.norm(area_vectors(self.vertices, self.triangles), axis=1) > 1e-10 * self.extent**2
        chosen = np.flatnonzero(big)[:: max(1, int(big.sum()) // _SAMPLE)]
        centers = self.vertices[self.triangles[chosen]].mean(axis=1)
        step = 1e-6 * self.extent * self.pseudonormals.of_faces[chosen]
        below, above = self.winding_number(centers - step), self.winding_number(centers + step)
        return bool(((below == 1.0) & (above == 0.0)).all())

    def signed(self, points: Array) -> Array:
        """Return the distance of points (n, 3) near the surface (n,), m, positive inside.

        The sign is that of the pseudonormal at the nearest point (Baerentzen & Aanaes 2005). It is wrong where parts of
        the surface intersect.
        """
        nearest, faces = self.nearest(points)
        way = points - nearest
        outside = np.einsum("ij,ij->i", way, self.pseudonormals.at(nearest, faces)) > 0.0
        return np.asarray(np.linalg.norm(way, axis=1) * np.where(outside, -1.0, 1.0))

    @cached_property
    def pseudonormals(self) -> Pseudonormals:
        """Normals of the faces, edges and vertices."""
        return Pseudonormals(self.vertices, self.triangles)

    @cached_property
    def sharp_edges(self) -> Indices:
        """Edges (e, 2), as vertices, at which the normals differ by more than 35 degrees."""
        halves = np.sort(half_edges(self.triangles), axis=1)
        one, two = equal_neighbors(halves)
        cosine = np.einsum("ij,ij->i", self.pseudonormals.of_faces[one // 3], self.pseudonormals.of_faces[two // 3])
        sharp = halves[one[cosine < _FEATURE]]
        return np.asarray(sharp[unique_rows(sharp)[0]])

    def spikes(self, least: float) -> Indices:
        """Return the vertices, with edges of `least`, m, or more, whose triangles all turn 35 degrees from the normal.

        The apex of a cone is one, without a sharp edge.
        """
        normal = self.pseudonormals.of_vertices
        cosine, edge = np.full(len(self.vertices), -1.0), np.full(len(self.vertices), np.inf)
        corners = self.vertices[self.triangles]
        length = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2)  # of the edge before each corner
        for i in range(3):
            vertex = self.triangles[:, i]
            np.maximum.at(cosine, vertex, np.einsum("ij,ij->i", self.pseudonormals.of_faces, normal[vertex]))
            np.minimum.at(edge, vertex, np.minimum(length[:, i], length[:, (i + 1) % 3]))
        flat = (cosine >= _FEATURE) | (cosine < 0.0)
        flat[self.sharp_edges] = True
        return np.flatnonzero(~flat & (edge >= least))


def parts_of(faces: Indices) -> Indices:
    """Return the index of the part of each triangle (k,). Triangles with a common vertex belong to one part."""
    a, b = faces[:, [0, 0]].ravel(), faces[:, 1:].ravel()
    label = components(a, b, int(faces.max()) + 1)[faces[:, 0]]
    return np.asarray(np.unique(label, return_inverse=True)[1], dtype=np.int64)


def part_volumes(points: Array, faces: Indices, part: Indices) -> Array:
    """Return the volume enclosed by each part (p,), m^3, negative inside out; `part` is the index of each face (k,)."""
    arm = points[faces[:, 0]] - points.mean(axis=0)
    return np.asarray(np.bincount(part, np.einsum("ij,ij->i", arm, area_vectors(points, faces)) / 3.0), dtype=float)


def _sorted(points: Array, faces: Indices) -> tuple[Array, Indices]:
    """Return vertices and triangles in the order of their coordinates; drop unused vertices."""
    used, faces = np.unique(faces, return_inverse=True)
    points, faces = points[used], faces.reshape(-1, 3)
    order = np.lexsort(points.T[::-1])
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    faces = rank[faces]
    first = np.argmin(faces, axis=1)
    faces = np.stack([faces[np.arange(len(faces)), (first + i) % 3] for i in range(3)], axis=1)
    return np.ascontiguousarray(points[order]), np.ascontiguousarray(faces[np.lexsort(faces.T[::-1])])


def _border(faces: Indices) -> list[Indices]:
    """Return closed loops of vertices along the directed edges that no triangle runs in the opposite direction."""
    halves = half_edges(faces)
    size = int(faces.max()) + 1
    keys = np.minimum(halves[:, 0], halves[:, 1]) * size + np.maximum(halves[:, 0], halves[:, 1])
    edges, number = np.unique(keys, return_inverse=True)
    surplus = np.bincount(number, np.where(halves[:, 0] < halves[:, 1], 1.0, -1.0)).astype(np.int64)
    after: dict[int, list[int]] = {}
    for edge, times in zip(edges[surplus != 0].tolist(), surplus[surplus != 0].tolist(), strict=True):
        a, b = divmod(edge, size)
        first, second = (a, b) if times > 0 else (b, a)
        after.setdefault(first, []).extend([second] * abs(times))
    loops = []
    for start in sorted(after):
        while after[start]:
            loops += _loops_from(start, after)
    return loops


def _loops_from(start: int, after: dict[int, list[int]]) -> list[Indices]:
    """Remove a closed walk from `start` and return the simple loops that it consists of."""
    path, place, loops = [start], {start: 0}, []
    while True:
        vertex = after[path[-1]].pop(0)
        if vertex not in place:
            place[vertex] = len(path)
            path.append(vertex)
            continue
        loop = path[place[vertex] :]
        loops.append(np.array(loop, dtype=np.int64))
        for old in loop[1:]:
            del place[old]
        path = path[: place[vertex] + 1]
        if len(path) == 1:
            return loops


def _depths(points: Array, faces: Indices, part: Indices) -> Indices:
    """Return the number of parts that each part lies inside of."""
    parts = _split(faces, part)
    own = [points[np.unique(one)] for one in parts]
    low, high = _boxes(own)
    level = np.zeros(len(parts), dtype=np.int64)
    for other, outer in enumerate(parts):
        within = (low >= low[other]).all(axis=1) & (high <= high[other]).all(axis=1)
        within[other] = False
        if within.any():
            winding = WindingNumber(points, outer)
            for k in np.flatnonzero(within):
                level[k] += bool((winding(own[k][:: max(1, len(own[k]) // 30)]) > 0.5).all())
    return level


def _split(faces: Indices, part: Indices) -> list[Indices]:
    """Return the triangles of each part; `part` is the index of each triangle (k,)."""
    order = np.argsort(part, kind="stable")
    return np.split(faces[order], np.flatnonzero(np.diff(part[order])) + 1)


def _boxes(sets: list[Array]) -> tuple[Array, Array]:
    """Return the lowest and the highest coordinates (s, 3) of sets of points (n, 3)."""
    return np.array([one.min(axis=0) for one in sets]), np.array([one.max(axis=0) for one in sets])


def _crossing(points: Array, faces: Indices, part: Indices, chosen: Indices) -> Flags:
    """Return whether each part (p,), of the `chosen`, crosses another one of these."""
    result = np.zeros(int(part.max()) + 1, dtype=bool)
    parts = _split(faces, part)
    own = [parts[k] for k in chosen]
    low, high = _boxes([points[one].reshape(-1, 3) for one in own])
    for i in range(len(chosen)):
        for j in i + 1 + np.flatnonzero(((low[i + 1 :] <= high[i]) & (high[i + 1 :] >= low[i])).all(axis=1)):
            both = _core.TriangleMesh(points, np.concatenate([own[i], own[j]]), True)
            if both.self_intersections()[0] > 0:
                result[chosen[i]] = result[chosen[j]] = True
    return result


def _given_outwards(points: Array, given: Indices, faces: Indices, part: Indices, outer: Flags) -> Flags:
    """Return whether each part (p,) had the orientation of the `outer` parts (p,) in the triangles as given."""
    owner = np.full(len(points), -1)
    owner[faces] = part[:, None]
    kept = given[owner[given[:, 0]] >= 0]
    volume = part_volumes(points, kept, owner[kept[:, 0]])
    return np.asarray(volume * volume[outer].sum() > 0.0)


def _count(number: int, thing: str, change: str, plural: str | None = None) -> str:
    return f"{number} {thing if number == 1 else plural or thing + 's'} {change}"
