"""Reference solution by finite elements: a rigid flat end bonded to a block that is fixed at its bottom.

The nodes under the end have one common displacement, so there is no contact and no condensation. The mesh follows the
circular edge of the end and is graded toward it, where the stress is singular. One quarter is solved.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from palpate.arrays import Array
from palpate.fem.elements import Elements
from palpate.fem.material import Material
from palpate.fem.selectors import Selector, half_space
from palpate.fem.volume import Volume, grid
from scipy.sparse.linalg import spsolve

__all__ = ["HEIGHT", "POISSON", "SIDE", "YOUNG", "extrapolate", "stiffness"]

YOUNG, POISSON, SIDE, HEIGHT = 20e3, 0.45, 0.1, 0.05  # Pa, -, m, m: of the block
_GRADING = 3.0  # exponent of the cell size; preserves most of the order under a stress of 1 / sqrt(distance)
_CORE = 0.4  # half side of the central square over the radius of the end


def stiffness(radius: float, cells: int) -> float:
    """Return force over depth, N/m, with `cells` rings of cells under the end; it converges from above."""
    volume, edge = _quarter(radius, cells)
    end = Selector("end", lambda x: (x[:, 2] > HEIGHT - 1e-9) & (np.hypot(x[:, 0], x[:, 1]) < edge * (1 + 1e-6)))
    elements = Elements(volume, Material(YOUNG, POISSON), [half_space("z", "<", 1e-9)], end)
    x = elements.nodes
    under = np.flatnonzero(np.diff(elements.load.tocsr().indptr))  # nodes of the triangles under the end
    moved = 3 * under + 2
    mirrored = np.concatenate([3 * np.flatnonzero(x[:, axis] < 1e-9) + axis for axis in (0, 1)])
    free = np.setdiff1d(elements.free, np.concatenate([moved, mirrored]))
    load = np.asarray(elements.stiffness[:, moved].sum(axis=1)).ravel()  # per unit displacement of the end
    displacement = spsolve(elements.stiffness[free][:, free].tocsc(), -load[free])
    return 4.0 * float(load[moved].sum() + (elements.stiffness[moved][:, free] @ displacement).sum())


def extrapolate(values: Sequence[float], ratio: float) -> tuple[float, float]:
    """Return the limit of values on three meshes, refined by `ratio`, and the observed order (Richardson)."""
    coarse, middle, fine = values
    order = float(np.log((coarse - middle) / (middle - fine)) / np.log(ratio))
    return fine - (middle - fine) / (ratio**order - 1.0), order


def _quarter(radius: float, cells: int) -> tuple[Volume, float]:
    """Return the mesh of a quarter of the block, with the origin on the axis, and the radius of the end's corners, m.

    The mesh has a square at the center and rings around it, circular at the edge of the end and square at the side of
    the block. The edge is a polygon with the area of the circle.
    """
    half, core = SIDE / 2, _CORE * radius
    part, outward, down = (np.linspace(0.0, 1.0, count + 1) for count in (cells, round(1.5 * cells), 2 * cells))
    inner = radius - (radius - core) * (1.0 - part) ** _GRADING
    outer = radius + (half - radius) * outward[1:] ** _GRADING
    rings = np.concatenate([inner, outer])
    roundness = np.concatenate([1.0 - ((radius - inner) / (radius - core)) ** 2, (half - outer) / (half - radius)])
    angles = np.pi / 4 * part
    heights: Array = np.asarray(HEIGHT - (HEIGHT * down**_GRADING)[::-1], dtype=float)
    step = np.pi / 4 / cells
    edge = radius * np.sqrt(step / np.sin(step))
    across: Array = np.asarray(core * np.tan(angles), dtype=float)
    middle = grid([across, across, heights])
    numbers: list[Array] = [np.asarray(1e-3 * np.arange(count), dtype=float) for count in (len(rings), cells + 1)]
    sector = grid([*numbers, heights])  # in rings and angles; mapped below
    i, j = (np.rint(sector.points[:, axis] * 1e3).astype(int) for axis in (0, 1))
    radii = rings[i] * ((1.0 - roundness[i]) / np.cos(angles[j]) + roundness[i] * edge / radius)
    mapped = np.stack([radii * np.cos(angles[j]), radii * np.sin(angles[j]), sector.points[:, 2]], axis=1)
    parts = [middle.points, mapped, mapped[:, [1, 0, 2]]]
    first = np.cumsum([0, len(parts[0]), len(parts[1])])
    tetrahedra = [middle.tetrahedra, sector.tetrahedra, sector.tetrahedra]
    points = np.concatenate(parts)
    _, one, same = np.unique(np.round(points, 9) + 0.0, axis=0, return_index=True, return_inverse=True)
    joined = np.concatenate([t + f for t, f in zip(tetrahedra, first, strict=True)])
    return Volume(points[one], same.reshape(-1)[joined], "quarter of a block, round at the end's edge"), edge
