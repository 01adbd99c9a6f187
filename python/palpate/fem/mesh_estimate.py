"""Size of a body before it is meshed: nodes, memory, and parts without a fixed place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.integrate import trapezoid

from palpate.arrays import Array, Flags, Indices
from palpate.contact.simplices import area_vectors, components
from palpate.fem.checks import positive
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.errors import BodyError
from palpate.fem.modes_cost import fill, modes_cost
from palpate.fem.selectors import Selector

# Nodes per volume / spacing^3 and per area / spacing^2, by the order of the elements, and contact nodes per
# area / spacing^2: least squares over 24 bodies from 146 to 4,717 vertices, within -13 and +27 % of all.
_NODES: Final = {1: (1.65, 1.01), 2: (13.0, 4.0)}
_CONTACT: Final = 1.75
_MEMORY: Final = 400.0  # bytes per unknown^1.25: median of the same bodies 340 (order 2) and 260 (order 1), largest 614
_PROGRAM: Final = 0.15e9  # bytes of the program and its libraries
_MARGIN: Final = 1.5  # by which the estimate of memory may be too large
_SHARES: Final = (0.7, 0.85, 0.95)  # of a budget, tried in turn for the spacing to name
MAX_SPACING: Final = 1.3  # thicknesses of a body: cells with a larger spacing do not fill it
_SAMPLES: Final = 200_000  # points at which a surface is compared with the fixed regions


@dataclass(frozen=True)
class MeshEstimate:
    """Estimate of a body whose whole surface is touched.

    Attributes:
        nodes: of the finite elements.
        contact_nodes: of the condensed body.
        memory: of the build, bytes.
    """

    nodes: float
    contact_nodes: float
    memory: float


@dataclass(frozen=True)
class FineZone:
    """Part of a surface towards which a mesh is graded.

    Attributes:
        area: of the part, m^2.
        spacing: of the edges there, m.
        growth: of the edges, per distance from the part.
        largest: of the edges, m.
    """

    area: float
    spacing: float
    growth: float
    largest: float

    def estimate(self, order: int) -> tuple[float, float]:
        """Return the numbers of nodes and of contact nodes.

        The part is a flat disk. At the distance z from it the edges are h + g z, up to the largest ones.
        """
        by_volume, by_area = _NODES[order]
        edge = np.geomspace(self.spacing, max(self.largest, self.spacing), 200)
        z = (edge - self.spacing) / self.growth
        rim = 2.0 * np.sqrt(np.pi * self.area)  # circumference, m
        inside = (self.area + np.pi / 2.0 * rim * z + 2.0 * np.pi * z**2) / edge**3  # per distance
        around = (rim + 2.0 * np.pi * z) / edge**2
        places = self.area / self.spacing**2
        nodes = by_volume * trapezoid(inside, z) + by_area * (places + trapezoid(around, z))
        return float(nodes), _CONTACT * places


def estimate(surface: ClosedSurface, spacing: float, order: int, zone: FineZone | None = None) -> MeshEstimate:
    """Return the estimated size of the body that fills `surface` with edges of `spacing`, m, finer towards a zone."""
    nodes, contact = _uniform(surface, spacing, order), _CONTACT * surface.area / spacing**2
    if zone is not None:
        more, contact = zone.estimate(order)
        nodes = min(nodes + more, _uniform(surface, zone.spacing, order))
    return MeshEstimate(nodes, contact, _PROGRAM + 72.0 * contact**2 + _MEMORY * (3.0 * nodes) ** 1.25)


def _uniform(surface: ClosedSurface, spacing: float, order: int) -> float:
    """Return the number of nodes with edges of one spacing, m."""
    by_volume, by_area = _NODES[order]
    return by_volume * abs(surface.volume) / spacing**3 + by_area * surface.area / spacing**2


def check_memory_before(
    surface: ClosedSurface,
    spacing: float,
    order: int,
    memory: float | str,
    *,
    touched: bool,
    modes: int = 0,
    zone: FineZone | None = None,
) -> None:
    """Raise BodyError if the build clearly exceeds `memory`, and name a spacing that fits.

    Args:
        surface: to be filled.
        spacing: mean edge of the tetrahedra, m.
        order: of the elements.
        memory: budget, bytes or text.
        touched: whether the whole surface is touched. Otherwise its contact nodes are not counted, if there is no zone.
        modes: number of vibration modes.
        zone: towards which the mesh is graded.
    """
    allowed = positive(memory, "byte", "memory")
    size = _needed(surface, spacing, order, touched, modes, zone)
    if size <= _MARGIN * allowed:
        return
    guess = estimate(surface, spacing, order, zone)
    if zone is not None:
        fine = _fitting(
            lambda edge: _needed(surface, spacing, order, touched, modes, replace(zone, spacing=edge)),
            zone.spacing, spacing, allowed,
        )  # fmt: skip
        use = (
            ""
            if fine is None
            else f"{1e3 * fine:.2g} mm or more, a larger growth, a smaller contact surface (touch), or "
        )
        raise BodyError(
            f"memory: a spacing of {1e3 * zone.spacing:.3g} mm at the touched region gives about {guess.nodes:.2g} "
            f"nodes and {size / 1e9:.2g} GB, over the budget of {_budget(allowed)}: use {use}{_larger(fine)}"
        )
    fits = _fitting(
        lambda edge: _needed(surface, edge, order, touched, modes), spacing, MAX_SPACING * surface.thickness, allowed
    )
    dear = _needed(surface, spacing, order, touched, 0) < size
    fewer = "fewer modes, " if dear else ""
    use = "" if fits is None else f"a spacing of {1e3 * fits:.2g} mm or more, "
    remedy = f"{use}{fewer}a smaller contact surface (touch), or {_larger(fits)}"
    raise BodyError(
        f"memory: a spacing of {1e3 * spacing:.3g} mm {f'with {modes} modes ' if dear else ''}gives about "
        f"{guess.nodes:.2g} nodes and {size / 1e9:.2g} GB, over the budget of {_budget(allowed)}: use {remedy}"
    )


def _fitting(memory: Callable[[float], float], spacing: float, most: float, allowed: float) -> float | None:
    """Return a spacing with two digits, m, that needs 0.7 of `allowed` bytes, or more of them if none needs less.

    None if no spacing up to `most` fits.
    """
    for share in _SHARES:
        edge = spacing
        while edge <= most:
            rounded = _two_digits(edge)
            if memory(edge) <= share * allowed and memory(rounded) <= (share + 0.05) * allowed and rounded <= most:
                return rounded
            edge *= 1.05
    return None


def _two_digits(length: float) -> float:
    return 1e-3 * float(f"{1e3 * length:.2g}")


def _budget(allowed: float) -> str:
    return f"{allowed / 1e9:.3g} GB" if allowed >= 1e8 else f"{allowed / 1e6:.3g} MB"


def _larger(fits: float | None) -> str:
    return "a larger budget" if fits is not None else "a larger budget, as no spacing fits this one"


def check_parts(surface: ClosedSurface, fixed: Sequence[Selector], spacing: float) -> None:
    """Raise BodyError if a separate part of the surface has no fixed place."""
    part = _solid_parts(surface)
    count = int(part.max()) + 1
    points, triangle = surface_samples(surface, spacing / 4.0)
    place = np.zeros(len(points), dtype=bool)
    for region in fixed:
        place |= region.inside(points)
    supported = np.zeros(count, dtype=bool)
    supported[part[triangle[place]]] = True
    if supported.all():
        return
    inner = _inner_samples(surface, fixed, spacing)
    loose = []
    for number in np.flatnonzero(~supported).tolist():
        own = np.isin(part, number)
        if len(inner) and _inside(surface, own, inner).any():
            continue
        loose.append(surface.vertices[surface.triangles[np.argmax(own), 0]])
    if loose:
        if not place.any() and not len(inner):
            low, high = (1e3 * surface.vertices.min(axis=0)).tolist(), (1e3 * surface.vertices.max(axis=0)).tolist()
            extent = ", ".join(f"{a} from {x:.4g} to {y:.4g}" for a, x, y in zip("xyz", low, high, strict=True))
            regions = ", ".join(f'"{region}"' for region in fixed)
            raise BodyError(
                f"fixed: {regions} holds no place of the body, which has {extent} mm: choose another region"
            )
        x, y, z = (1e3 * loose[0]).tolist()
        raise BodyError(
            f"{len(loose)} of the {count} parts of the surface {'has' if len(loose) == 1 else 'have'} no fixed place, "
            f"the first at ({x:.4g}, {y:.4g}, {z:.4g}) mm: fix a place of each part, remove parts, or join them"
        )


def _needed(
    surface: ClosedSurface, spacing: float, order: int, touched: bool, modes: int, zone: FineZone | None = None
) -> float:
    """Return the largest memory of the stages of a build, bytes."""
    size = estimate(surface, spacing, order, zone)
    condensing = size.memory if touched or zone is not None else size.memory - 72.0 * size.contact_nodes**2
    if not modes:
        return condensing
    unknowns = 3.0 * size.nodes
    return max(condensing, _PROGRAM + modes_cost(unknowns, size.contact_nodes, modes, fill(unknowns)).memory)


def _solid_parts(surface: ClosedSurface) -> Indices:
    """Return the index of the solid part of each triangle (k,).

    A cavity belongs to the part around it. Of intersecting parts, those with common bounding boxes count as one.
    """
    part = surface.parts
    count = int(part.max()) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    corners = surface.vertices[surface.triangles]
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    vectors = area_vectors(surface.vertices, surface.triangles)
    hollow = np.bincount(part, np.einsum("ij,ij->i", corners[:, 0] - surface.vertices.mean(axis=0), vectors)) < 0.0
    apart = ((low[:, None] > high[None]) | (high[:, None] < low[None])).any(axis=2)
    joined = ~apart if not surface.simple else ~apart & (hollow[:, None] | hollow[None])
    one, two = np.nonzero(joined)
    return components(one, two, count)[part]


def surface_samples(surface: ClosedSurface, step: float) -> tuple[Array, Indices]:
    """Return the corners of the triangles and points within them about `step` apart, with their triangles."""
    corners = surface.vertices[surface.triangles]
    size = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(axis=1)
    count = np.clip(np.ceil(size / step), 1, 60).astype(np.int64)
    while (count * (count + 3)).sum() > 2 * _SAMPLES and (count > 1).any():
        count = np.maximum(1, count // 2)
    points, owner = [], []
    for n in np.unique(count).tolist():
        rows = np.flatnonzero(count == n)
        i, j = np.nonzero(np.add.outer(np.arange(n + 1), np.arange(n + 1)) <= n)
        weights = np.stack([n - i - j, i, j], axis=1) / n
        points.append(np.einsum("sk,tkx->tsx", weights, corners[rows]).reshape(-1, 3))
        owner.append(np.repeat(rows, len(weights)))
    return np.concatenate(points), np.concatenate(owner)


def _inner_samples(surface: ClosedSurface, fixed: Sequence[Selector], spacing: float) -> Array:
    """Return points of a grid (n, 3) in the fixed regions that are not restricted to the surface."""
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    counts = np.clip(np.ceil(4.0 * (high - low) / spacing), 2, 60).astype(int).tolist()
    lines = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
    grid = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    place = np.zeros(len(grid), dtype=bool)
    for region in fixed:
        if not region.surface:
            place |= region.inside(grid)
    return np.asarray(grid[place])


def _inside(surface: ClosedSurface, triangles: Flags, points: Array) -> Flags:
    """Return whether points (n, 3) lie inside of the part with the given triangles (k,)."""
    own = surface.triangles[triangles]
    return ClosedSurface(surface.vertices, own).inside(points)
