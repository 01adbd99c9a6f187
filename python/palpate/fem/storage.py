"""HDF5 file of a body: arrays with units, and the build record."""

from __future__ import annotations

import json
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Final

import numpy as np

from palpate.arrays import Array, Flags, Indices, Single
from palpate.fem.errors import BodyError
from palpate.fem.volume import SURFACES, VOLUMES
from palpate.files import HDF5_SIGNATURE, as_path, begins_with, check_readable, check_writable
from palpate.files.hdf5_input import open_sealed
from palpate.files.hdf5_output import write_hdf5
from palpate.files.json_text import load_table

_FORMAT: Final = "palpate body"
VERSION: Final = 5
SPRINGS: Final = "springs"  # method of a body of springs, in its record
_UNITS: Final = {
    "points": "m",
    "areas": "m^2",
    "compliance": "m/N",
    "normals": "1",
    "frequencies": "rad/s",
    "residual_frequencies": "rad/s",
    "vertices": "m",
    "young": "Pa",
    "masses": "kg",
    "spring_stiffness": "N/m",
    "rest_lengths": "m",
    "spring_damping": "N s/m",
}
# array: (kinds of its type, dimensions)
_ARRAYS: Final = {
    "points": ("f", 2),
    "triangles": ("iu", 2),
    "contact_triangles": ("b", 1),
    "nodes": ("iu", 1),
    "normals": ("f", 2),
    "areas": ("f", 1),
    "compliance": ("f", 2),
    "frequencies": ("f", 1),
    "shapes": ("f", 2),
    "residual_frequencies": ("f", 1),
    "residual_shapes": ("f", 2),
    "vertices": ("f", 2),
    "tetrahedra": ("iu", 2),
    "young": ("f", 1),
    "dirichlet": ("b", 1),
}
_SPRINGS: Final = {  # arrays of a body of springs
    "masses": ("f", 1),
    "springs": ("iu", 2),
    "spring_stiffness": ("f", 1),
    "rest_lengths": ("f", 1),
    "spring_damping": ("f", 1),
}
_NUMBER: Final = (int, float)
_RECORD: Final[dict[str, tuple[Any, Any]]] = {  # entry: (its type, type of its own entries)
    **dict.fromkeys(("source", "method", "surface_layer", "touch", "unit"), (str, str)),
    **dict.fromkeys(("regions", "fixed", "held"), (list, str)),
    **dict.fromkeys(("order", "tetrahedra", "nodes", "unknowns", "modes"), (int, int)),
    **dict.fromkeys(("young_Pa", "poisson", "density_kg_per_m3", "volume_m3"), (_NUMBER, int)),
    **dict.fromkeys(("memory_bytes", "operations", "scaled_stiffness", "asymmetry"), (_NUMBER, int)),
    "seconds": (dict, _NUMBER),
    "versions": (dict, str),
}
# quantity: (smallest, largest), SI; beyond the properties of any body that is built
RANGES: Final = {
    "areas": (1e-18, 1e2),
    "young": (1e-3, 1e15),
    "frequencies": (1e-9, 1e12),
    "residual_frequencies": (1e-9, 1e12),
    "points": (-1e4, 1e4),
    "vertices": (-1e4, 1e4),
    "compliance": (-1e6, 1e6),
    "shapes": (-1e12, 1e12),
    "residual_shapes": (-1e12, 1e12),
    "masses": (1e-15, 1e9),
    "spring_stiffness": (1e-9, 1e15),
    "rest_lengths": (1e-9, 1e4),
    "spring_damping": (0.0, 1e15),
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
    residual_frequencies: Array = field(default_factory=lambda: np.empty(0))  # of `vibration.modes` (r,), rad/s
    residual_shapes: Single = field(default_factory=lambda: np.empty((0, 0), dtype=np.float32))  # (3n, r), 1/sqrt(kg)
    masses: Array = field(default_factory=lambda: np.empty(0))  # of a body of springs, of the vertices (v,), kg
    springs: Indices = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))  # end vertices (k, 2)
    spring_stiffness: Array = field(default_factory=lambda: np.empty(0))  # (k,), N/m
    rest_lengths: Array = field(default_factory=lambda: np.empty(0))  # (k,), m
    spring_damping: Array = field(default_factory=lambda: np.empty(0))  # (k,), N s/m

    def modes_and_residuals(self) -> tuple[Array, Single]:
        """Return the frequencies (m + r,), rad/s, and shapes (3n, m + r) of the modes, then of the residual vectors."""
        residual = self.residual_shapes.reshape(len(self.shapes), -1)
        return np.concatenate([self.frequencies, self.residual_frequencies]), np.hstack([self.shapes, residual])


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
    unused = {"record"} if len(contents.springs) else {"record", *_SPRINGS}
    arrays = {entry.name: getattr(contents, entry.name) for entry in fields(contents) if entry.name not in unused}

    def fill(store: Any) -> None:
        store.attrs["format"] = _FORMAT
        store.attrs["version"] = VERSION
        store.attrs["record"] = json.dumps(contents.record, allow_nan=False)
        for name, array in arrays.items():
            data = store.create_dataset(name, data=array, track_times=False)
            if name in _UNITS:
                data.attrs["unit"] = _UNITS[name]

    return write_hdf5(path, fill, reserve=sum(array.nbytes for array in arrays.values()))


def read(path: str | Path) -> BodyData:
    """Read a body. Raise BodyError if the file is missing, incomplete, or not a body."""
    file = check_readable(path, BodyError, kind="the body's file (.h5)", otherwise="palpate body build makes one")
    _check_signature(file)
    with open_sealed(file, BodyError, "body", "build it again") as store:
        if store.text_attribute("format", default="") != _FORMAT:
            raise BodyError(f"{file}: an HDF5 file, but not a body; palpate body build makes a body")
        if (version := store.number_attribute("version", default=0)) != VERSION:
            raise BodyError(
                f"{file}: written in version {version:g} of the format; this palpate reads version {VERSION}: "
                "build it again"
            )
        record = load_table(store.text_attribute("record"), BodyError, f"{file}: record")
        known = _ARRAYS | (_SPRINGS if record.get("method") == SPRINGS else {})
        arrays = {name: store.array(name, kinds, ndim) for name, (kinds, ndim) in known.items()}
    _check_record(record, file)
    contents = BodyData(**arrays, record=record)
    _check(contents, file)
    return contents


def _check_record(record: Mapping[str, Any], file: Path) -> None:
    """Raise BodyError if an entry of the build record has another type than a build writes."""
    if "source" not in record:
        raise BodyError(f"{file}: its record names no source; build the body again")
    for name, (kind, inner) in _RECORD.items():
        value = record.get(name)
        entries = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
        if value is not None and not (isinstance(value, kind) and all(isinstance(entry, inner) for entry in entries)):
            raise BodyError(f"{file}: the entry {name} of its record has the wrong type; build the body again")


def _check_signature(file: Path) -> None:
    """Raise BodyError with a remedy if a file is not HDF5."""
    if begins_with(file, HDF5_SIGNATURE):
        return
    if file.stat().st_size == 0:
        raise BodyError(f"{file}: an empty file; palpate body build makes a body")
    if file.suffix.lower() in (*SURFACES, *VOLUMES):
        raise BodyError(
            f"{file}: a mesh, not a body; build a body from it, for example with: "
            f"""palpate body build {shlex.quote(str(file))} --unit mm --young "5 kPa" --fixed "z < 1 mm\""""
        )
    raise BodyError(f"{file}: not a body (.h5); palpate body build makes one from a mesh")


def _check(c: BodyData, file: Path) -> None:
    """Raise BodyError if an array has the wrong type, shape or values."""
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
        and (c.residual_shapes.shape == (3 * n, len(c.residual_frequencies)) or c.residual_shapes.size == 0)
        and c.residual_shapes.dtype == np.float32
        and c.tetrahedra.shape == (len(c.young), 4)
        and c.vertices.shape == (len(c.dirichlet), 3)
        and c.springs.shape == (len(c.spring_stiffness), 2)
        and c.rest_lengths.shape == c.spring_damping.shape == c.spring_stiffness.shape
        and len(c.masses) == (len(c.vertices) if len(c.springs) else 0)
        and (len(c.springs) == 0 or s == len(c.vertices))
    )
    solid = len(c.tetrahedra) > 0 or len(c.springs) > 0 or c.record.get("method") == "boundary elements"
    if not shapes or n == 0 or not solid:
        raise BodyError(f"{file}: the shapes of its arrays do not match; build the body again")
    indices = np.concatenate([c.triangles.ravel(), c.nodes])
    finite = all(np.isfinite(array).all() for array in (c.normals, *(getattr(c, name) for name in RANGES)))
    plausible = finite and all(
        array.size == 0 or (array.min() >= low and array.max() <= high)
        for array, (low, high) in ((getattr(c, name), limits) for name, limits in RANGES.items())
    )
    corners = np.concatenate([c.tetrahedra.ravel(), c.springs.ravel(), [0]])
    in_range = indices.min() >= 0 and indices.max() < s and corners.min() >= 0 and corners.max() < len(c.vertices)
    positive = (np.diag(c.compliance) > 1e-15).all()
    outward = np.abs(np.linalg.norm(c.normals, axis=1) - 1.0).max() < 1e-6 if finite else False
    if not (plausible and in_range and positive and outward):
        raise BodyError(
            f"{file}: it holds invalid numbers (not finite, a stiffness or area that no body has, or an index out of "
            "range); build the body again"
        )
