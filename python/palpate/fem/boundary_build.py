"""Build a homogeneous body from its surface alone, by boundary elements."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from palpate.contact.mesh import Mesh
from palpate.contact.simplices import components
from palpate.fem.body import Body
from palpate.fem.boundary_elements import BoundaryElements
from palpate.fem.builder import check_files, dirichlet_regions, surface_of, versions
from palpate.fem.checks import positive
from palpate.fem.condensation import check_memory
from palpate.fem.elements import check_order
from palpate.fem.errors import BodyError
from palpate.fem.hat_functions import mean_normals
from palpate.fem.material import Material
from palpate.fem.selectors import Selector, parse_selector
from palpate.fem.storage import BodyData, write


def build_boundary(
    source: Mesh | str | Path,
    *,
    young: float | str,
    fixed: str | Selector | Sequence[str | Selector],
    poisson: float | str = 0.45,
    touch: str | Selector | None = None,
    unit: str | None = None,
    order: int = 2,
    memory: float | str = "8 GB",
    output: str | Path | None = None,
    progress: Callable[[str, float], None] | None = None,
) -> Body:
    """Build a homogeneous linear elastic body by boundary elements, from a closed surface that is not filled.

    The nodes of the contact are the vertices of the surface, as in `build`. The body has no tetrahedra, so `modal`,
    `mass_spring` and `hyperelastic` need `build`. The build needs time and memory that grow with the third and second
    power of the number of vertices; a thousand vertices take about 2 GB and a minute.

    Args:
        source: closed surface (`Mesh`, or an .stl, .obj, .ply, .off or .glb file).
        young: Young's modulus, Pa, or text such as "5 kPa".
        fixed: one or more fixed regions, as in `build`; a triangle is fixed if its three vertices are. Where a region
            contains solid too, `build` fixes that as well and makes the body stiffer; "surface z < -4 mm" does not.
        poisson: Poisson's ratio, below 0.5.
        touch: region of the contact surface; None for the whole surface.
        unit: of the coordinates in a file; required for a file.
        order: 2 for quadratic displacements in each triangle, 1 for linear ones, which are less accurate.
        memory: budget, bytes or text.
        output: file (.h5) to which the body is written atomically.
        progress: called at the begin of each stage with its description and the fraction of the stages done.

    Raises:
        BodyError: the surface is not closed, intersects itself or is not manifold, no triangle is fixed, a number is
            out of range, or the memory is too small.
        OutputError: the file cannot be written.
    """
    check_files(source, unit, output)
    check_order(order)
    positive(memory, "byte", "memory")
    material = Material(young, poisson)
    regions = dirichlet_regions(fixed)
    where = None if touch is None else parse_selector(touch)
    tell = progress if progress is not None else (lambda _text, _fraction: None)
    mesh, name = surface_of(source, unit)
    volume = _volume(mesh, name)
    points, triangles = mesh.vertices, mesh.triangles.astype(np.int64)
    inside = np.ones(len(points), dtype=bool) if where is None else where.inside(points)
    held = np.asarray(np.any([region.inside(points) for region in regions], axis=0), dtype=bool)
    elements = BoundaryElements(
        points, triangles, np.asarray(inside[triangles].all(axis=1)), held, material.young, material.poisson, order
    )
    _check(elements, name)
    count = len(elements.contact_nodes)
    check_memory(count, elements.memory, memory)
    tell(f"integrating and solving {3 * len(elements.nodes):,} equations", 0.1)
    start = time.perf_counter()
    compliance, asymmetry = elements.compliance()
    seconds = round(time.perf_counter() - start, 3)
    record = {
        **_record(elements, material, volume, asymmetry),
        "source": name,
        "unit": unit,
        "fixed": [str(region) for region in regions],
        "touch": None if where is None else str(where),
        "seconds": {"condensing": seconds},
    }
    contents = _body_data(elements, compliance, record)
    if output is not None:
        write(contents, output)
    return Body(contents)


def _volume(mesh: Mesh, name: str) -> float:
    """Return the enclosed volume, m^3. Raise BodyError if the surface is not clean, so that it has no exact inside."""
    found = mesh.diagnose()
    if not found.clean or not found.volume > 0.0:
        raise BodyError(
            f"{name}: boundary elements need a clean surface, oriented outward; repair it, or build the body by finite "
            f"elements ({'; '.join(str(found).splitlines())})"
        )
    return found.volume


def _record(elements: BoundaryElements, material: Material, volume: float, asymmetry: float) -> dict[str, Any]:
    return {
        "method": "boundary elements",
        "modes": 0,
        "young_Pa": material.young,
        "poisson": material.poisson,
        "density_kg_per_m3": material.density,
        "order": elements.order,
        "tetrahedra": 0,
        "nodes": len(elements.nodes),
        "unknowns": 3 * len(elements.nodes),
        "volume_m3": volume,
        "memory_bytes": elements.memory,
        "asymmetry": asymmetry,
        "versions": versions(),
    }


def _check(elements: BoundaryElements, name: str) -> None:
    """Raise BodyError if a piece of the surface is not fixed, or nothing can be touched."""
    if len(elements.contact_nodes) == 0:
        raise BodyError(
            f"{name}: the body has no contact node: its vertices are fixed, or outside of the contact region"
        )
    around = np.roll(elements.triangles, 1, axis=1)
    parts = components(elements.triangles.ravel(), around.ravel(), len(elements.points))
    held = np.unique(parts[elements.triangles[elements.fixed_triangles].ravel()])
    if (alone := np.setdiff1d(parts[elements.triangles.ravel()], held)).size:
        x, y, z = 1e3 * elements.points[np.argmax(parts == alone[0])]
        raise BodyError(
            f"{name}: a piece or a cavity of the surface has no fixed triangle, the one with the point "
            f"({x:.4g}, {y:.4g}, {z:.4g}) mm: fix it, or build the body by finite elements"
        )


def _body_data(elements: BoundaryElements, compliance: Any, record: dict[str, Any]) -> BodyData:
    return BodyData(
        points=elements.points,
        triangles=elements.triangles,
        contact_triangles=np.asarray(elements.contact),
        nodes=elements.contact_nodes,
        normals=mean_normals(elements.points, elements.triangles[elements.contact], elements.contact_nodes),
        areas=elements.areas,
        compliance=compliance,
        frequencies=np.empty(0),
        shapes=np.empty((len(compliance), 0), dtype=np.float32),
        vertices=elements.points,
        tetrahedra=np.empty((0, 4), dtype=np.int64),
        young=np.empty(0),
        dirichlet=elements.dirichlet,
        record=record,
    )
