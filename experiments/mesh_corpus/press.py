"""Fill a surface, press it, and compare with Hertz and with fTetWild."""

from __future__ import annotations

import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from palpate import PalpateError, fem
from palpate.arrays import Array
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.mesh_improvement import min_angles
from palpate.fem.volume import closed_surface

from experiments.mesh_corpus.shapes import Surface

__all__ = ["Pressed", "press"]

_EXTENT, _RADIUS, _DEPTH = 0.1, 0.008, 0.002  # m; every surface is scaled to this extent
_YOUNG, _POISSON = 5e3, 0.45


@dataclass(frozen=True)
class Pressed:
    """Filled and pressed surface, or the reason of its refusal."""

    seconds: float  # of processor time until the body or the refusal
    refusal: str = ""
    warnings: tuple[str, ...] = ()
    repairs: tuple[str, ...] = ()
    vertices: int = 0
    spacing: float = 0.0  # mean distance of contact nodes, m
    angle: float = 0.0  # smallest dihedral angle, degrees
    volume_error: float = np.nan  # relative
    force: float = np.nan  # of the sphere, N
    hertz: float = np.nan  # of the sphere on a half-space, N


def press(surface: Surface, *, mesher: Any = "stuffing", spacing: float | None = None) -> Pressed:
    """Scale a surface to 100 mm, fix its lowest 15 %, and press a sphere of 8 mm by 2 mm onto its top."""
    begin = time.process_time()
    used = surface.vertices[np.unique(surface.triangles)]
    scale = _EXTENT / float(np.linalg.norm(np.ptp(used, axis=0)))
    vertices = (surface.vertices - used.min(axis=0)) * scale
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            repaired = closed_surface(vertices, surface.triangles, "surface")
            top = _top(repaired)
            body = _build(surface, vertices, top, mesher, spacing)
        except PalpateError as problem:
            return Pressed(time.process_time() - begin, str(problem))
        seconds = time.process_time() - begin
        try:
            force = float(np.linalg.norm(body.signed_distance().indent(top, _RADIUS, _DEPTH).force))
        except PalpateError as problem:
            return Pressed(time.process_time() - begin, f"press: {problem}")
    contents = body.contents
    size = float(np.abs(_volumes(contents.vertices, contents.tetrahedra)).sum())
    return Pressed(
        seconds,
        warnings=tuple(str(warning.message) for warning in caught),
        repairs=tuple(repaired.repairs),
        vertices=len(contents.vertices),
        spacing=float(np.sqrt(2.0 / 3.0**0.5 * contents.areas.mean())),
        angle=float(min_angles(contents.vertices, contents.tetrahedra).min()),
        volume_error=size / repaired.volume - 1.0 if repaired.simple else np.nan,
        force=force,
        hertz=4.0 / 3.0 * _YOUNG / (1.0 - _POISSON**2) * _RADIUS**0.5 * _DEPTH**1.5,
    )


def _build(surface: Surface, vertices: Array, top: Array, mesher: Any, spacing: float | None) -> fem.Body:
    """Return the body of a file of the surface, fixed below and touched within 20 mm of the top."""
    height = float(np.ptp(vertices[np.unique(surface.triangles)][:, 2]))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "surface.off"
        rows = [f"OFF\n{len(vertices)} {len(surface.triangles)} 0\n"]
        rows += [f"{x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist()]
        rows += [f"3 {a} {b} {c}\n" for a, b, c in surface.triangles.tolist()]
        file.write_text("".join(rows))
        return fem.build(
            file,
            unit="m",
            young=_YOUNG,
            poisson=_POISSON,
            fixed=f"z < {150.0 * height} mm",
            touch=f"sphere {' '.join(str(1e3 * x) for x in top)} radius 20 mm",
            mesher=mesher,
            spacing=spacing,
        )


def _top(surface: ClosedSurface) -> Array:
    """Return the surface point below the highest place nearest to the middle."""
    corners = surface.vertices[surface.triangles]
    centers = np.concatenate([corners.mean(axis=1), surface.vertices[np.unique(surface.triangles)]])
    high = centers[centers[:, 2] > centers[:, 2].max() - 0.003]
    middle = high.mean(axis=0)
    return np.asarray(high[np.argmin(np.linalg.norm(high - middle, axis=1))])


def _volumes(points: Array, cells: Any) -> Array:
    a, b, c = (points[cells[:, i]] - points[cells[:, 0]] for i in (1, 2, 3))
    return np.asarray(np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0)
