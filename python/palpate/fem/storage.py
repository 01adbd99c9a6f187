"""HDF5 file of a body: arrays with units, and the build record."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np

from palpate.arrays import Array, Flags, Indices, Single
from palpate.fem.errors import BodyError
from palpate.fem.volume import SURFACES, VOLUMES
from palpate.files import HDF5_SIGNATURE, as_path, atomic_write, check_readable, check_writable

_FORMAT: Final = "palpate body"
VERSION: Final = 3
_UNITS: Final = {
    "points": "m",
    "areas": "m^2",
    "compliance": "m/N",
    "normals": "1",
    "frequencies": "rad/s",
    "vertices": "m",
    "young": "Pa",
}


@dataclass(frozen=True, eq=False)
class BodyData:
    """Content of a body's file, with n contact nodes, s surface points and k surface triangles."""

    points: Array  # of the whole surface at rest (s, 3), m
    triangles: Indices  # of the whole surface (k, 3), counterclockwise seen from outside
    contact_triangles: Flags  # whether each triangle belongs to the contact surface (k,)
    nodes: Indices  # contact nodes, as indices of points (n,)
    normals: Array  # outward unit normals at the contact nodes (n, 3)
    areas: Array  # of the patches of the contact nodes (n,), m^2
    compliance: Single  # (3n, 3n), m/N, row 3 x node + axis
    frequencies: Array  # of the vibration modes (m,), rad/s; m = 0 if the body was built without modes
    shapes: Single  # of the modes at the contact nodes (3n, m), 1/sqrt(kg), row 3 x node + axis
    vertices: Array  # of the mesh at rest (v, 3), m; those on its surface, in their order, are `points`
    tetrahedra: Indices  # of the mesh (t, 4)
    young: Array  # mean Young's modulus of each tetrahedron (t,), Pa
    dirichlet: Flags  # whether each vertex is fixed (v,)
    record: Mapping[str, Any]  # inputs, sizes, times and versions of the build


def check_target(path: str | Path) -> None:
    """Check, before a build, that a body can be written to `path`.

    Raises:
        BodyError: the path is not that of an .h5 file.
        OutputError: the file cannot be written.
    """
    file = as_path(path, BodyError)
    if file.suffix.lower() != ".h5":
        raise BodyError(f"{file}: a body is an HDF5 file, named for example {(file.stem or 'body') + '.h5'}")
    check_writable(file)


def write(contents: BodyData, path: str | Path) -> Path:
    """Write a body to `path` (.h5) atomically. Raise as `check_target`."""
    check_target(path)

    def fill(part: Path) -> None:
        with h5py.File(part, "w") as store:
            store.attrs["format"] = _FORMAT
            store.attrs["version"] = VERSION
            store.attrs["record"] = json.dumps(contents.record)
            for field in fields(contents):
                if field.name != "record":
                    data = store.create_dataset(field.name, data=getattr(contents, field.name))
                    if field.name in _UNITS:
                        data.attrs["unit"] = _UNITS[field.name]

    return atomic_write(path, fill)


def read(path: str | Path) -> BodyData:
    """Read a body. Raise BodyError if the file is missing, incomplete, or not a body."""
    file = check_readable(path, BodyError, kind="the body's file (.h5)", otherwise="palpate body build makes one")
    _check_signature(file)
    try:
        with h5py.File(file, "r") as store:
            if store.attrs.get("format") != _FORMAT:
                raise BodyError(f"{file}: an HDF5 file, but not a body; palpate body build makes a body")
            if store.attrs.get("version") != VERSION:
                raise BodyError(
                    f"{file}: written in version {store.attrs.get('version')} of the format; "
                    f"this palpate reads version {VERSION}: build it again"
                )
            record = json.loads(store.attrs["record"])
            arrays = {f.name: np.asarray(store[f.name]) for f in fields(BodyData) if f.name != "record"}
    except (OSError, KeyError, ValueError) as problem:
        if isinstance(problem, BodyError):
            raise
        missing = "" if isinstance(problem, OSError) else f" ({problem})"
        raise BodyError(f"{file}: not a complete body, perhaps truncated{missing}; build it again") from None
    contents = BodyData(**arrays, record=record)
    _check(contents, file)
    return contents


def _check_signature(file: Path) -> None:
    """Raise BodyError with a remedy if a file is not HDF5."""
    try:
        with file.open("rb") as opened:
            signature = opened.read(len(HDF5_SIGNATURE))
    except OSError as problem:
        raise BodyError(f"{file}: cannot be read: {problem.strerror}") from None
    if signature == HDF5_SIGNATURE:
        return
    if not signature:
        raise BodyError(f"{file}: an empty file; palpate body build makes a body")
    if file.suffix.lower() in (*SURFACES, *VOLUMES):
        raise BodyError(
            f"{file}: a mesh, not a body; build a body from it, for example with: "
            f"""palpate body build {shlex.quote(str(file))} --unit mm --young "5 kPa" --fixed "z < 1 mm\""""
        )
    raise BodyError(f"{file}: not a body (.h5); palpate body build makes one from a mesh")


def _check(c: BodyData, file: Path) -> None:
    """Raise BodyError if an array has the wrong type, shape or values."""
    arrays = {field.name: getattr(c, field.name) for field in fields(c) if field.name != "record"}
    broken = [name for name, array in arrays.items() if array.ndim == 0 or array.dtype.kind not in "bifu"]
    if broken or not isinstance(c.record, dict) or "source" not in c.record:
        raise BodyError(f"{file}: {broken[0] if broken else 'record'} has the wrong type; build the body again")
    n, s = len(c.nodes), len(c.points)
    shapes = (
        c.points.shape == (s, 3)
        and c.triangles.shape == (len(c.contact_triangles), 3)
        and c.normals.shape == (n, 3)
        and c.areas.shape == (n,)
        and c.compliance.shape == (3 * n, 3 * n)
        and c.compliance.dtype == np.float32
        and c.shapes.shape == (3 * n, len(c.frequencies))
        and c.shapes.dtype == np.float32
        and c.tetrahedra.shape == (len(c.young), 4)
        and c.vertices.shape == (len(c.dirichlet), 3)
    )
    if not shapes or n == 0:
        raise BodyError(f"{file}: the shapes of its arrays do not match; build the body again")
    indices = np.concatenate([c.triangles.ravel(), c.nodes])
    numbers = (c.points, c.normals, c.areas, c.compliance, c.frequencies, c.shapes, c.vertices, c.young)
    finite = all(np.isfinite(a).all() for a in numbers)
    in_range = (
        indices.min() >= 0 and indices.max() < s and c.tetrahedra.min() >= 0 and c.tetrahedra.max() < len(c.vertices)
    )
    positive = all((a > 0).all() for a in (np.diag(c.compliance), c.areas, c.young, c.frequencies))
    outward = np.abs(np.linalg.norm(c.normals, axis=1) - 1.0).max() < 1e-6 if finite else False
    if not (finite and in_range and positive and outward):
        raise BodyError(
            f"{file}: it holds invalid numbers (not finite, a stiffness or area that is not positive, or an index out "
            "of range); build the body again"
        )
