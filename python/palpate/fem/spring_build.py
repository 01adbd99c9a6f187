"""Build a body from a user's own masses, springs and dampers."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.linalg import eigsh, splu

from palpate.arrays import Array, Flags, Indices, Single
from palpate.contact.simplices import area_vectors, components
from palpate.fem.body import Body
from palpate.fem.builder import dirichlet_regions, versions
from palpate.fem.checks import lengths, number
from palpate.fem.errors import BodyError
from palpate.fem.hat_functions import hat_integrals, mean_normals
from palpate.fem.selectors import Selector
from palpate.fem.spring_network import SpringNetwork, contact_patches, unstable_row
from palpate.fem.storage import RANGES, SPRINGS, BodyData, check_target, write

_UNBALANCED: Final = 1e-6  # force on a free vertex at rest, relative to the largest force of a spring
_STORED: Final = {"stiffness": "spring_stiffness", "damping": "spring_damping"}  # in a body file
_MECHANISM: Final = 1e-9  # least eigenvalue of the stiffness, relative to its largest diagonal entry
_ONE: Final = {"springs": "spring", "vertices": "vertex"}
_BUCKLES: Final = "with negative stiffness, as when it buckles"
_MAX_MEMORY: Final = 4e9  # bytes of the right-hand sides of the compliance


def build_springs(
    points: ArrayLike,
    springs: ArrayLike,
    *,
    stiffness: ArrayLike,
    masses: ArrayLike,
    fixed: ArrayLike | str | Selector | Sequence[str | Selector],
    triangles: ArrayLike,
    rest_lengths: ArrayLike | None = None,
    damping: ArrayLike = 0.0,
    output: str | Path | None = None,
) -> Body:
    """Build a body from masses, springs and dampers; press it with `Body.mass_spring`.

    Without a model the body is the network's compliance near rest. Springs of other rest lengths than the distances of
    their vertices are under tension, which must balance at each free vertex.

    Args:
        points: positions of the v vertices at rest (v, 3), m or text.
        springs: pairs of vertices (s, 2), each pair once.
        stiffness: of the springs, N/m or text: one for all, or (s,).
        masses: of the vertices, kg or text: one for all, or (v,).
        fixed: vertices that do not move: their indices, a flag for each vertex (v,), or regions as in `build`.
        triangles: of the contact surface (k, 3), counterclockwise seen from outside.
        rest_lengths: of the springs, m or text: one for all, or (s,); None for the distances of the vertices.
        damping: of the springs, N s/m or text: one for all, or (s,). It resists any relative motion of the ends.
        output: file (.h5) to which the body is written atomically.

    Raises:
        BodyError: a number is out of range, an index does not exist, two springs join the same vertices, a part is not
            fixed, the tensions do not balance, or a vertex can move without stiffness.
        OutputError: the file cannot be written.
    """
    if output is not None:
        check_target(output)
    begin = time.perf_counter()
    x = _positions(points)
    pairs = _pairs(springs, x)
    network = _network(x, pairs, stiffness, masses, rest_lengths, damping)
    still = _fixed(fixed, x)
    faces = _triangles(triangles, x)
    _check_parts(pairs, still)
    _check_balance(network, still)
    nodes = np.setdiff1d(np.unique(faces), np.flatnonzero(still))
    if len(nodes) == 0:
        raise BodyError("triangles: all of their vertices are fixed, so nothing can be touched")
    compliance = _compliance(network, still, faces, nodes)
    record: dict[str, Any] = {
        "method": SPRINGS,
        "source": "springs",
        "modes": 0,
        "nodes": len(x),
        "unknowns": 3 * int(np.count_nonzero(~still)),
        "seconds": {"condensing": round(time.perf_counter() - begin, 3)},
        "versions": versions(),
    }
    contents = BodyData(
        points=x,
        triangles=faces,
        contact_triangles=np.ones(len(faces), dtype=bool),
        nodes=nodes,
        normals=_normals(x, faces, nodes),
        areas=hat_integrals(x, faces, nodes),
        compliance=compliance,
        frequencies=np.empty(0),
        shapes=np.empty((len(compliance), 0), dtype=np.float32),
        vertices=x,
        tetrahedra=np.empty((0, 4), dtype=np.int64),
        young=np.empty(0),
        dirichlet=still,
        record=record,
        masses=network.masses,
        springs=pairs,
        spring_stiffness=network.stiffness,
        rest_lengths=network.rest_lengths,
        spring_damping=network.damping,
    )
    if output is not None:
        write(contents, output)
    return Body(contents)


def _positions(points: ArrayLike) -> Array:
    x = np.ascontiguousarray(lengths(points, "points"))
    if x.ndim != 2 or x.shape[1] != 3 or len(x) < 2:
        raise BodyError(f"points: two or more rows of three numbers in m are needed, not an array of shape {x.shape}")
    if (bad := ~np.isfinite(x).all(axis=1)).any():
        raise BodyError(f"points: vertex {int(np.argmax(bad))} has a number that is not finite")
    if np.abs(x).max() > 1e4:
        raise BodyError(f"points: {np.abs(x).max():.3g} m is more than 10 km: positions are in m")
    return x


def _indices(values: ArrayLike, width: int, name: str, count: int) -> Indices:
    """Return rows of `width` vertices below `count`."""
    try:
        rows = np.asarray(values)
    except ValueError:
        rows = np.empty(0)
    if rows.ndim != 2 or rows.shape[1] != width or len(rows) == 0 or rows.dtype.kind not in "iu":
        raise BodyError(f"{name}: one or more rows of {width} whole numbers are needed, the indices of vertices")
    bad = (rows < 0) | (rows >= count)
    if bad.any():
        row = int(np.argmax(bad.any(axis=1)))
        vertex = int(rows[row][bad[row]][0])
        raise BodyError(f"{name}: row {row} names vertex {vertex}, but there are {count}, from 0 to {count - 1}")
    return np.ascontiguousarray(rows, dtype=np.int64)


def _pairs(springs: ArrayLike, x: Array) -> Indices:
    pairs = _indices(springs, 2, "springs", len(x))
    if (loop := pairs[:, 0] == pairs[:, 1]).any():
        row = int(np.argmax(loop))
        raise BodyError(f"springs: row {row} joins vertex {pairs[row, 0]} to itself")
    _, first, counts = np.unique(np.sort(pairs, axis=1), axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        a, b = pairs[first[np.argmax(counts > 1)]]
        raise BodyError(
            f"springs: vertices {a} and {b} are joined twice; give one spring with the sum of the stiffness"
        )
    apart = np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
    if apart.min() < 1e-9:
        row = int(np.argmin(apart))
        raise BodyError(
            f"springs: row {row} joins vertices {pairs[row, 0]} and {pairs[row, 1]}, which are in one place"
        )
    return pairs


def _each(values: ArrayLike, unit: str, name: str, count: int, what: str, *, zero: bool = False) -> Array:
    """Return one positive number in SI for each of `count` springs or vertices."""
    given = np.asarray(values, dtype=object)
    if given.ndim > 1 or (given.ndim == 1 and len(given) != count):
        raise BodyError(f"{name}: one number is needed, or one for each of the {count} {what}, not {given.shape}")
    if given.ndim == 1 and isinstance(values, np.ndarray) and values.dtype.kind in "fiu":
        numbers = values.astype(float)
    else:
        numbers = np.array([number(value, unit, name) for value in given.ravel()], dtype=float)
    good = np.isfinite(numbers) & ((numbers >= 0.0) if zero else (numbers > 0.0))
    if not good.all():
        row = int(np.argmin(good))
        where = f" of {_ONE[what]} {row}" if given.ndim == 1 else ""
        rule = "must not be negative" if zero else "must be positive"
        raise BodyError(f"{name}: {numbers[row]:g} {unit}{where} {rule}")
    low, high = RANGES[_STORED.get(name, name)]
    if not (low <= numbers.min() and numbers.max() <= high):
        wrong = numbers.min() if numbers.min() < low else numbers.max()
        raise BodyError(f"{name}: {wrong:g} {unit} must be between {low:g} and {high:g} {unit}")
    return np.ascontiguousarray(np.broadcast_to(numbers.reshape(-1) if given.ndim else numbers[0], count), dtype=float)


def _network(
    x: Array,
    pairs: Indices,
    stiffness: ArrayLike,
    masses: ArrayLike,
    rest_lengths: ArrayLike | None,
    damping: ArrayLike,
) -> SpringNetwork:
    count, distances = len(pairs), np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
    given = distances if rest_lengths is None else rest_lengths
    return SpringNetwork(
        x,
        _each(masses, "kg", "masses", len(x), "vertices"),
        pairs,
        _each(stiffness, "N/m", "stiffness", count, "springs"),
        np.empty((0, 4), dtype=np.int64),
        np.zeros(len(x)),
        0.0,
        _each(given, "m", "rest_lengths", count, "springs"),
        _each(damping, "N*s/m", "damping", count, "springs", zero=True),
    )


def _fixed(fixed: Any, x: Array) -> Flags:
    still = np.zeros(len(x), dtype=bool)
    listed = list(fixed) if isinstance(fixed, Sequence | np.ndarray) and not isinstance(fixed, str) else [fixed]
    if listed and all(isinstance(one, str) or callable(getattr(one, "inside", None)) for one in listed):
        for region in dirichlet_regions(listed):
            still |= region.inside(x)
    else:
        values = np.asarray(listed)
        if values.dtype == bool and values.shape == (len(x),):
            still = values.copy()
        elif values.ndim == 1 and values.size > 0 and values.dtype.kind in "iu":
            still[_indices(values[:, None], 1, "fixed", len(x))[:, 0]] = True
        elif values.size > 0:
            raise BodyError("fixed: indices of vertices, a flag for each vertex, or regions are needed")
    if not still.any():
        raise BodyError('fixed: no vertex is fixed, so the body moves as a whole: give indices, or "z < 1 mm"')
    if still.all():
        raise BodyError("fixed: all vertices are fixed, so nothing can move")
    return still


def _triangles(triangles: ArrayLike, x: Array) -> Indices:
    faces = _indices(triangles, 3, "triangles", len(x))
    area = np.linalg.norm(area_vectors(x, faces), axis=1)
    longest = np.linalg.norm(x[faces] - x[np.roll(faces, 1, axis=1)], axis=2).max(axis=1)
    if (flat := area <= 1e-9 * longest**2).any():
        row = int(np.argmax(flat))
        raise BodyError(f"triangles: row {row} with vertices {', '.join(map(str, faces[row]))} has no area")
    _, first, counts = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    if (counts > 1).any():
        vertices = ", ".join(map(str, faces[first[np.argmax(counts > 1)]]))
        raise BodyError(f"triangles: the one with vertices {vertices} is given twice")
    return faces


def _normals(x: Array, faces: Indices, nodes: Indices) -> Array:
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = mean_normals(x, faces, nodes)
    if (bad := ~np.isfinite(normals).all(axis=1)).any():
        vertex = int(nodes[np.argmax(bad)])
        raise BodyError(f"triangles: those around vertex {vertex} face opposite ways; orient them alike, outward")
    return normals


def _check_parts(pairs: Indices, still: Flags) -> None:
    """Raise BodyError if a part of the network has no fixed vertex."""
    part = components(pairs[:, 0], pairs[:, 1], len(still))
    loose = np.setdiff1d(part, part[still])
    if loose.size:
        vertex = int(np.argmax(part == loose[0]))
        raise BodyError(
            f"springs: vertex {vertex} belongs to a part without a fixed vertex; fix it, or join it to the rest"
        )


def _check_balance(network: SpringNetwork, still: Flags) -> None:
    """Raise BodyError if the tensions of the springs do not balance at a free vertex."""
    force = np.linalg.norm(network.forces, axis=1) * ~still
    distance = np.linalg.norm(np.diff(network.points[network.springs], axis=1)[:, 0], axis=1)
    largest = float(np.abs(network.stiffness * (distance - network.rest_lengths)).max())
    if force.max() > _UNBALANCED * largest + 1e-12 * float((network.stiffness * distance).max()):
        vertex = int(np.argmax(force))
        raise BodyError(
            f"rest_lengths: the springs pull vertex {vertex} by {force[vertex]:.3g} N at rest; give points at which "
            "they balance, or leave out rest_lengths"
        )


def _compliance(network: SpringNetwork, still: Flags, faces: Indices, nodes: Indices) -> Single:
    """Return the displacement of the nodes' patches per force on them (3n, 3n), m/N; raise BodyError of a mechanism."""
    free = np.flatnonzero(np.repeat(~still, 3))
    if 16.0 * len(free) * 3 * len(nodes) > _MAX_MEMORY:
        raise BodyError(
            "triangles: the compliance of so many vertices needs more than 4 GB; use a smaller contact surface"
        )
    stiffness = network.free_matrix(still).tocsc()
    _check_mechanism(stiffness, free)
    begin, vertices, weights = contact_patches(network.points, faces, nodes)
    patches = sparse.csr_matrix((weights, vertices, begin), shape=(len(nodes), len(still)))
    load = sparse.kron(patches, sparse.eye(3), format="csr")[:, free]
    compliance = np.asarray(load @ splu(stiffness).solve(load.T.toarray()))
    return np.ascontiguousarray(0.5 * (compliance + compliance.T), dtype=np.float32)


def _check_mechanism(stiffness: sparse.csc_matrix, free: Indices) -> None:
    """Raise BodyError if a motion of the free rows (f,) has no or a negative stiffness."""
    scale = float(stiffness.diagonal().max())
    if len(free) < 12:
        values, shapes = np.linalg.eigh(stiffness.toarray())
    else:
        start = np.random.default_rng(1).normal(size=len(free))
        values, shapes = eigsh(stiffness, k=1, sigma=-0.1 * _MECHANISM * scale, which="LM", v0=start)
    if values[0] > _MECHANISM * scale:
        buckled = unstable_row(stiffness, 0.0)  # the eigenvalue nearest to zero may not be the lowest one
        if buckled is None:
            return
        row, what = int(free[buckled]), _BUCKLES
    else:
        row = int(free[np.argmax(np.abs(shapes[:, 0]))])
        what = "without stiffness" if values[0] > -_MECHANISM * scale else _BUCKLES
    raise BodyError(
        f"springs: vertex {row // 3} can move along {'xyz'[row % 3]} {what}; add springs across, or tension by shorter "
        "rest_lengths"
    )
