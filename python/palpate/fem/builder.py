"""Build a body from a mesh and a material."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

import numpy as np

from palpate.contact.mesh import Mesh, read_triangles
from palpate.contact.simplices import area_vectors
from palpate.fem.body import Body
from palpate.fem.checks import not_negative, positive, unit_of_length, warn_of_size, whole
from palpate.fem.closed_surface import ClosedSurface
from palpate.fem.condensation import Condensation, check_memory, check_memory_of_modes
from palpate.fem.contact_accuracy import pressed, spacing_for
from palpate.fem.elements import Elements, check_order
from palpate.fem.errors import BodyError, BodyWarning
from palpate.fem.material import Material, Region, SurfaceLayer
from palpate.fem.mesh_estimate import FineZone, check_memory_before, check_parts, estimate, surface_samples
from palpate.fem.refinement import Size, graded_size
from palpate.fem.selectors import Selector, parse_selector, parse_selectors
from palpate.fem.storage import BodyData, check_target, write
from palpate.fem.vibration import Modes
from palpate.fem.vibration import modes as find_modes
from palpate.fem.volume import (
    SURFACES,
    Mesher,
    Volume,
    check_mesh_file,
    check_mesher,
    closed_surface,
    fill_surface,
    read_volume,
)

UNKNOWN_ACCURACY: Final = (
    "accuracy: the spacing is that for a body of one modulus; with regions or a surface layer the error is not known: "
    "compare the force with that of a body of half the spacing"
)
_LARGEST = 1e3  # m, extent of a body
_PLACES = 50  # at which the thickness of a body is measured
_GROWTH = 0.3  # of the edges, per distance from the touched region
_NODES = 4e4  # of a body whose spacing is not given; about a minute and 2 GB


def build(
    source: Volume | Mesh | str | Path,
    *,
    young: float | str,
    fixed: str | Selector | Sequence[str | Selector],
    poisson: float | str = 0.45,
    density: float | str = 1000.0,
    regions: str | Region | Sequence[str | Region] = (),
    surface_layer: str | SurfaceLayer | None = None,
    touch: str | Selector | None = None,
    unit: str | None = None,
    spacing: float | str | None = None,
    tip_radius: float | str | None = None,
    depth: float | str | None = None,
    accuracy: float | str | None = None,
    growth: float | None = None,
    mesher: Mesher = "stuffing",
    order: int = 2,
    modes: int = 0,
    memory: float | str = "8 GB",
    output: str | Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Body:
    """Build a linear elastic body, condensed to its contact surface.

    Args:
        source: tetrahedra (`Volume`, or a .msh, .vtk ... file), or a surface (`Mesh`, or an .stl, .obj, .ply, .off or
            .glb file), which is repaired and filled.
        young: Young's modulus, Pa, or text such as "5 kPa".
        fixed: one or more fixed regions, such as "z < 1 mm" or "sphere 0 0 0 radius 5 mm"; after "surface", only the
            surface of the region is fixed.
        poisson: Poisson's ratio, below 0.5.
        density: kg/m^3, or text with its unit.
        regions: of other stiffness, "sphere 50 50 40 radius 7.5 mm = 25 kPa".
        surface_layer: layer below the contact surface, "2 mm = 50 kPa".
        touch: region of the contact surface; None for the whole surface.
        unit: of the coordinates in a file; required for a file.
        spacing: mean edge of the tetrahedra in a filled surface, m or text; None for a fifteenth of its extent, or
            half the thickness of a thin body, with at most 40,000 nodes. Tetrahedra have their own edges.
        tip_radius: of a sphere, m or text, for which the spacing is chosen in place of `spacing`; see `spacing_for`.
        depth: of its presses, m or text; None for a quarter of its radius.
        accuracy: of its force on a thick body of one modulus, such as "5%" (default). A body with regions or a surface
            layer, or one that is thin under most of its contact surface, causes a warning.
        growth: by which the edges grow, per distance from the surface in `touch`, up to the default spacing; 0: all
            edges have one spacing. None for 0.3 with `tip_radius` and `touch`, otherwise 0.
        mesher: of a surface, "stuffing" (deterministic) or "ftetwild"; see `fill`.
        order: 2 for quadratic tetrahedra, 1 for linear ones, which lock as Poisson's ratio approaches 0.5.
        modes: number of vibration modes to compute for `Body.modal`.
        memory: budget, bytes or text.
        output: file (.h5) to which the body is written atomically.
        progress: called at the begin of each stage with its description and the fraction of the stages done.

    Raises:
        BodyError: the mesh cannot be filled, nothing is fixed, a number is out of range, or the memory is too small.
        OutputError: the file cannot be written.
    """
    check_files(source, unit, output)
    check_order(order)
    check_mesher(mesher)
    chosen = {"unit": unit, "spacing": spacing, "tip_radius": tip_radius, "accuracy": accuracy, "growth": growth}
    modes = whole(modes, "modes", 0)
    positive(memory, "byte", "memory")
    growth = _chosen_growth(growth, tip_radius, touch, mesher)
    spacing = _chosen_spacing(spacing, tip_radius, depth, accuracy)
    if isinstance(source, Volume):
        _refuse_choice([name for name, value in chosen.items() if value is not None])
    stages = _Stages(progress)
    material = Material(young, poisson, density, regions, surface_layer)
    if tip_radius is not None and not material.is_uniform:
        warnings.warn(UNKNOWN_ACCURACY, BodyWarning, stacklevel=2)
    dirichlet = dirichlet_regions(fixed)
    contact = None if touch is None else parse_selector(touch)
    stages.begin("meshing", "meshing")

    def check(surface: ClosedSurface, step: float, zone: FineZone | None) -> None:
        check_parts(surface, dirichlet, step)
        check_memory_before(surface, step, order, memory, touched=contact is None, modes=modes, zone=zone)

    volume = volume_of(
        source, unit=unit, spacing=spacing, mesher=mesher, check=check, growth=growth, touch=contact if growth else None
    )
    volume.check_joints()
    stages.begin("assembling", f"assembling {len(volume.tetrahedra):,} tetrahedra, {len(volume.points):,} vertices")
    elements = Elements(volume, material, dirichlet, contact, order)
    contents = _condense(elements, modes, memory, stages, {"unit": unit, "modes": modes, "growth": growth})
    body = Body(contents)
    if tip_radius is not None:
        _warn_of_thin(body, *pressed(tip_radius, depth))
    if output is not None:
        write(contents, output)
    return body


def _warn_of_thin(body: Body, radius: float, depth: float) -> None:
    """Warn if most of the contact surface lies on material too thin for a tip's accuracy; see `is_thin`."""
    places = body.nodes[:: max(1, len(body.nodes) // _PLACES)]
    thin = sum(body.is_thin_under(place, radius, depth) for place in places)
    if 2 * thin > len(places):
        contact = 1e3 * float(np.sqrt(radius * depth))
        warnings.warn(
            f"accuracy: under {100 * thin / len(places):.0f} % of the contact surface the body is less than 1.8 times "
            f"as thick as the contact radius of about {contact:.2g} mm: the error of the force is not known there; use "
            "a smaller depth or tip",
            BodyWarning,
            stacklevel=3,
        )


def check_files(source: object, unit: str | None, output: str | Path | None) -> None:
    """Raise BodyError or OutputError, before a long build, if a file cannot be read or written."""
    _check_source(source, unit)
    if output is not None:
        check_target(output)


def _refuse_choice(names: list[str]) -> None:
    """Raise BodyError if options of a surface or file are given for tetrahedra."""
    if names:
        raise BodyError(f"{names[0]}: the source is a Volume, whose tetrahedra have their size, in m; leave it out")


def dirichlet_regions(fixed: str | Selector | Sequence[str | Selector]) -> list[Selector]:
    """Return the fixed regions. Raise BodyError if there is none."""
    regions = parse_selectors(fixed)
    if not regions:
        raise BodyError(
            "nothing is fixed, so the body has rigid-body motions: fix a part of it, "
            'fixed="z < 1 mm" (--fixed "z < 1 mm")'
        )
    return regions


class _Stages:
    """Report each stage as it begins, and measure its duration, s."""

    _NAMES = ("meshing", "assembling", "ordering", "condensing", "modes")

    def __init__(self, progress: Callable[[str, float], None] | None) -> None:
        self._progress = progress if progress is not None else (lambda _text, _fraction: None)
        self._seconds: dict[str, float] = {}
        self._name, self._start = "", time.perf_counter()

    def begin(self, name: str, text: str) -> None:
        """End the current stage and begin another."""
        self.end()
        self._name = name
        self._progress(text, self._NAMES.index(name) / len(self._NAMES))

    def end(self) -> dict[str, float]:
        """End the current stage; return the duration of each stage, s."""
        now = time.perf_counter()
        if self._name:
            self._seconds[self._name] = round(now - self._start, 3)
        self._name, self._start = "", now
        return self._seconds


def _condense(elements: Elements, modes: int, memory: float | str, stages: _Stages, inputs: dict[str, Any]) -> BodyData:
    """Return the data of a body; `inputs` are entries of its record that `elements` do not have."""
    count = len(elements.contact_nodes)
    check_memory(count, elements.memory + 36.0 * count**2, memory)
    elements.stiffness  # noqa: B018  # assembles
    stages.begin("ordering", f"ordering {len(elements.free):,} unknowns")
    condensation = Condensation(elements)
    check_memory(count, condensation.memory, memory)
    cost = None
    if modes:
        cost = condensation.modes_cost(modes)
        check_memory_of_modes(cost, elements.memory + 36.0 * count**2, memory)
    stages.begin("condensing", str(condensation))
    compliance = condensation.compliance()
    nothing = np.empty((len(compliance), 0), dtype=np.float32)
    found = Modes(np.empty(0), nothing, np.empty(0), nothing)
    if modes:
        stages.begin("modes", str(cost))
        found = find_modes(elements, condensation.factor(), modes)
    seconds = stages.end()
    record = {**inputs, **_record(elements, condensation), "seconds": seconds, "versions": versions()}
    return _body_data(elements, compliance, found, record)


def _record(elements: Elements, condensation: Condensation) -> dict[str, Any]:
    volume, material = elements.volume, elements.material
    return {
        "source": volume.source,
        "young_Pa": material.young,
        "poisson": material.poisson,
        "density_kg_per_m3": material.density,
        "regions": [str(region) for region in material.regions],
        "surface_layer": None if material.surface_layer is None else str(material.surface_layer),
        "fixed": [str(region) for region in elements.fixed],
        "touch": None if elements.touch is None else str(elements.touch),
        "order": elements.order,
        "tetrahedra": len(volume.tetrahedra),
        "nodes": len(elements.nodes),
        "unknowns": len(elements.free),
        "volume_m3": volume.size,
        "memory_bytes": condensation.memory,
        "operations": condensation.operations,
    }


def volume_of(
    source: Volume | Mesh | str | Path,
    *,
    unit: str | None = None,
    spacing: float | str | None = None,
    mesher: Mesher = "stuffing",
    check: Callable[[ClosedSurface, float, FineZone | None], None] | None = None,
    growth: float = 0.0,
    touch: Selector | None = None,
) -> Volume:
    """Return the tetrahedral mesh of `source`, which is filled if it is a surface; see `build`.

    `check` is called with the surface, the largest spacing, m, and the zone towards which the mesh is graded, before
    the surface is filled. The mesh is graded if there is a region `touch`.
    """
    if isinstance(source, Volume):
        return source
    if isinstance(source, (str, Path)) and Path(source).suffix.lower() not in SURFACES:
        assert unit is not None  # checked
        return read_volume(source, unit=unit)
    surface, name = _surface_to_fill(source, unit)
    step = _spacing_of(surface, spacing)
    size, zone = None, None
    if touch is not None:
        size, step, zone = _graded(surface, step, growth, touch)
    if check is not None:
        check(surface, step, zone)
    try:
        return fill_surface(surface, step, mesher=mesher, source=name, size=size)
    except BodyError as problem:
        if size is None:
            raise
        raise BodyError(f"{problem}; the mesh is graded: growth=0 has the small spacing everywhere") from None


def _surface_to_fill(source: Mesh | str | Path, unit: str | None) -> tuple[ClosedSurface, str]:
    """Return the repaired surface of `source` and its name. Raise BodyError if it encloses no volume."""
    if isinstance(source, Mesh):
        surface, name = closed_surface(source.vertices, source.triangles, "given surface"), "given surface"
    else:
        assert unit is not None  # checked
        name = Path(source).name
        vertices, triangles, scale = read_triangles(source, unit=unit)
        surface = closed_surface(np.asarray(vertices, dtype=float) * scale, triangles, name)
    _check_extent(surface.extent, name)
    warn_of_size(surface.extent, stacklevel=5)
    for text in surface.warnings:
        warnings.warn(f"{name}: {text}", BodyWarning, stacklevel=4)
    return surface, name


def _chosen_spacing(
    spacing: float | str | None,
    tip_radius: float | str | None,
    depth: float | str | None,
    accuracy: float | str | None,
) -> float | str | None:
    """Return the spacing for a tip if one is given. Raise BodyError if that contradicts `spacing`."""
    if tip_radius is None:
        if depth is not None or accuracy is not None:
            raise BodyError("tip_radius: a depth or an accuracy chooses the spacing for a tip: give its radius too")
        return spacing
    if spacing is not None:
        raise BodyError("spacing: it follows from tip_radius and accuracy: leave out one of them")
    return spacing_for(tip_radius, depth, accuracy)


def _spacing_of(surface: ClosedSurface, spacing: float | str | None) -> float:
    """Return the edges of the tetrahedra, m.

    By default a fifteenth of the extent, or half the thickness of a thin body, but not more than `_NODES` nodes.
    """
    if spacing is None:
        step = min(surface.extent / 15.0, max(surface.thickness / 2.0, surface.extent / 60.0))
        while estimate(surface, step, 2).nodes > _NODES and step < surface.extent:
            step *= 1.05
        return step
    step = positive(spacing, "m", "spacing")
    if step > surface.extent:
        raise BodyError(
            f"spacing: {step:g} m exceeds the extent of the body, {surface.extent:.4g} m; use a smaller one"
        )
    return step


def _chosen_growth(growth: float | None, tip_radius: object, touch: object, mesher: str) -> float:
    """Return the growth of the edges. Raise BodyError if the mesh cannot be graded."""
    if growth is None:
        return 0.0 if tip_radius is None or touch is None or mesher != "stuffing" else _GROWTH
    growth = not_negative(growth, "", "growth")
    if growth and touch is None:
        raise BodyError('growth: edges grow from the touched region: give it, such as touch="z > 40 mm"')
    if growth and mesher != "stuffing":
        raise BodyError(f'growth: {mesher} has one spacing: use mesher="stuffing", or leave out the growth')
    return growth


def _graded(surface: ClosedSurface, step: float, growth: float, touch: Selector) -> tuple[Size, float, FineZone]:
    """Return the edges of a graded mesh, `step`, m, at the touched region, the largest of them, m, and that region."""
    places, triangle = surface_samples(surface, step)
    inside = touch.inside(places)
    if not inside.any():
        raise BodyError(f'touch: no place of the surface lies in "{touch}": choose another region')
    share = np.bincount(triangle, inside) / np.bincount(triangle)
    area = float(share @ np.linalg.norm(area_vectors(surface.vertices, surface.triangles), axis=1))
    largest = max(step, _spacing_of(surface, None))
    return graded_size(places[inside], step, growth, largest), largest, FineZone(area, step, growth, largest)


def _check_extent(extent: float, name: str) -> None:
    if not 1e-6 <= extent <= _LARGEST:
        raise BodyError(
            f"{name}: an extent of {extent:.3g} m; a body has 1e-06 to {_LARGEST:g} m: give the unit of its "
            'coordinates, such as "mm"'
        )


def surface_of(source: Mesh | str | Path, unit: str | None) -> tuple[Mesh, str]:
    """Return a closed surface and its name. Raise BodyError if the source is none."""
    mesh, name = source, "given surface"
    if not isinstance(source, Mesh):
        if Path(source).suffix.lower() not in SURFACES:
            raise BodyError(f"{source}: boundary elements need a closed surface, one of {', '.join(SURFACES)}")
        assert unit is not None  # checked
        mesh, name = Mesh.load(source, unit=unit, open=True), Path(source).name
    assert isinstance(mesh, Mesh)
    _check_extent(mesh.extent, name)
    if not mesh.closed:
        raise BodyError(
            f"{name}: the surface has {mesh.diagnose().open_edges} edges at a border, "
            "so it encloses no volume: close it"
        )
    return mesh, name


def _check_source(source: object, unit: str | None) -> None:
    """Raise BodyError if the source cannot be read."""
    if isinstance(source, Volume | Mesh):
        return
    if not isinstance(source, str | Path):
        raise BodyError(f"a body is built from a Volume, a Mesh or a mesh file, not from {source!r}")
    check_mesh_file(source)
    if unit is None:
        raise BodyError(f'{source}: the file has no unit: give it, such as unit="mm" (--unit mm)')
    unit_of_length(unit)


def _body_data(elements: Elements, compliance: Any, modes: Modes, record: dict[str, Any]) -> BodyData:
    faces = elements.volume.surface
    used, triangles = np.unique(faces, return_inverse=True)
    inside = np.ones(len(elements.volume.points), dtype=bool)
    if elements.touch is not None:
        inside = elements.touch.inside(elements.volume.points)
    return BodyData(
        points=elements.volume.points[used],
        triangles=triangles.reshape(-1, 3).astype(np.int64),
        contact_triangles=np.asarray(inside[faces].all(axis=1)),
        nodes=np.searchsorted(used, elements.contact_nodes).astype(np.int64),
        normals=elements.normals,
        areas=elements.areas,
        compliance=compliance,
        frequencies=modes.frequencies,
        shapes=modes.shapes,
        residual_frequencies=modes.residual_frequencies,
        residual_shapes=modes.residual_shapes,
        vertices=elements.volume.points,
        tetrahedra=elements.volume.tetrahedra,
        young=elements.young.mean(axis=1),
        dirichlet=elements.dirichlet[: len(elements.volume.points)],
        record=record,
    )


def versions() -> dict[str, str]:
    """Return the versions of the libraries that a build depends on."""
    versions = {}
    for name in ("palpate", "numpy", "scipy", "scikit-fem", "pytetwild", "meshio"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return versions
