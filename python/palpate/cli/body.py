"""`palpate body`: build a deformable body, and describe one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.markup import escape

from palpate.cli.console import output, print_paths, stages

if TYPE_CHECKING:
    from palpate.fem import Body


def build(
    source: Annotated[
        Path, typer.Argument(help="Closed surface (.stl, .obj, .ply, .off, .glb) or tetrahedra (.msh, .vtk, ...).")
    ],
    young: Annotated[str, typer.Option("--young", help='Young\'s modulus, such as "5 kPa".')],
    fixed: Annotated[
        list[str] | None,
        typer.Option("--fixed", help='Fixed region: "z < 1 mm", "box 0 0 0 to 9 9 1 mm", "surface ..."; repeat.'),
    ] = None,
    unit: Annotated[str | None, typer.Option("--unit", help="Unit of the coordinates in the file, such as mm.")] = None,
    poisson: Annotated[float, typer.Option("--poisson", help="Poisson's ratio, below 0.5.")] = 0.45,
    density: Annotated[str, typer.Option("--density", help="Mass per volume.")] = "1000 kg/m^3",
    region: Annotated[
        list[str] | None,
        typer.Option("--region", help='Region of other stiffness: "sphere 50 50 40 radius 7.5 mm = 25 kPa"; repeat.'),
    ] = None,
    surface_layer: Annotated[
        str | None, typer.Option("--surface-layer", help='Layer at the contact surface: "2 mm = 50 kPa".')
    ] = None,
    touch: Annotated[
        str | None, typer.Option("--touch", help="Contact surface, as --fixed; default: the whole surface.")
    ] = None,
    spacing: Annotated[
        str | None, typer.Option("--spacing", help="Edge length of the tetrahedra in a filled surface.")
    ] = None,
    tip_radius: Annotated[
        str | None, typer.Option("--tip-radius", help="Of a sphere, for which the spacing is chosen.")
    ] = None,
    depth: Annotated[
        str | None, typer.Option("--depth", help="Of its presses; default: a quarter of its radius.")
    ] = None,
    accuracy: Annotated[str | None, typer.Option("--accuracy", help="Of its force; default: 5%.")] = None,
    growth: Annotated[
        float | None,
        typer.Option(
            "--growth", help="Of the edges, per distance from --touch; default: 0.3 with --tip-radius, else 0."
        ),
    ] = None,
    mesher: Annotated[
        Literal["stuffing", "ftetwild"],
        typer.Option("--mesher", help="Of a surface: stuffing (deterministic) or ftetwild (extra mesher)."),
    ] = "stuffing",
    order: Annotated[int, typer.Option("--order", help="2: quadratic elements; 1: linear, which lock near 0.5.")] = 2,
    modes: Annotated[int, typer.Option("--modes", help="Number of vibration modes, for a body with inertia.")] = 0,
    memory: Annotated[str, typer.Option("--memory", help="Memory budget of the build.")] = "8 GB",
    boundary: Annotated[
        bool, typer.Option("--boundary", help="Boundary elements: from the surface alone; one material, no modes.")
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="File to write; default: source name with .h5.")
    ] = None,
) -> None:
    """Build a deformable body from a mesh: fill the mesh, compute the compliance of its surface, and write a file.

    The size of the result and the time are estimated first. The build stops with a proposal if they exceed the budget.
    The file is written atomically.

    Example: palpate body build liver.stl --unit mm --young "5 kPa" --fixed "z < 2 mm" -o liver.h5
    """
    with stages("starting") as tell:
        from palpate.fem import BodyError, build_boundary
        from palpate.fem import build as make

        target = out if out is not None else source.parent / f"{source.stem}.h5"
        common: dict[str, Any] = {
            "young": young,
            "fixed": fixed or [],
            "unit": unit,
            "poisson": poisson,
            "touch": touch,
            "order": order,
            "memory": memory,
            "output": target,
            "progress": tell,
        }
        interior: dict[str, Any] = {
            "regions": region or [],
            "surface_layer": surface_layer,
            "spacing": spacing,
            "tip_radius": tip_radius,
            "depth": depth,
            "accuracy": accuracy,
            "growth": growth,
            "modes": modes,
        }
        if boundary and any(interior.values()):
            raise BodyError(
                "--boundary: boundary elements have one material, no mesh of the interior and no modes: leave out "
                "--region, --surface-layer, --spacing, --tip-radius and --modes, or leave out --boundary"
            )
        body = (
            build_boundary(source, **common)
            if boundary
            else make(source, density=density, mesher=mesher, **interior, **common)
        )
    _print_size(body)
    print_paths([target])


def phantom(
    out: Annotated[Path, typer.Option("--out", "-o", help="File to write.")] = Path("phantom.h5"),
    young: Annotated[str, typer.Option("--young", help="Young's modulus of the block.")] = "10 kPa",
    contrast: Annotated[float, typer.Option("--contrast", help="Nodule's modulus over the block's; 1: none.")] = 5.0,
    depth: Annotated[str, typer.Option("--depth", help="Of the nodule's top under the block's.")] = "10 mm",
    spacing: Annotated[str, typer.Option("--spacing", help="Of the cells.")] = "5 mm",
) -> None:
    """Build the palpation phantom: 100 x 100 x 50 mm, 2 mm of skin at 50 kPa, a nodule of 15 mm.

    Example: palpate body phantom --contrast 5 --depth "10 mm" -o phantom.h5
    """
    with stages("starting") as tell:
        from palpate.fem import phantom as make

        body = make(young=young, contrast=contrast, depth=depth, spacing=spacing, output=out, progress=tell)
    _print_size(body)
    print_paths([out])


def show(file: Annotated[Path, typer.Argument(help="A body (.h5).")]) -> None:
    """Print the contents of a body and how it was built."""
    from palpate.fem import load

    body = load(file)
    _print_size(body)
    for name, text in _rows(body):
        output.print(f"  {name:<12}{text}", markup=False, soft_wrap=True)


def _print_size(body: Body) -> None:
    cells, faces = len(body.contents.tetrahedra), len(body.triangles)
    counts = f"{cells:,} tetrahedra" if cells else f"{faces:,} triangles"
    seconds = sum(time for stage, time in body.record.get("seconds", {}).items() if stage != "meshing")
    output.print(
        f"[bold]{escape(str(body.record['source']))}[/]: {counts}, "
        f"{len(body.contents.vertices):,} vertices, {len(body.nodes):,} contact nodes; "
        f"{36e-6 * len(body.nodes) ** 2:.3g} MB, solved in {seconds:.3g} s",
        soft_wrap=True,
    )


def _rows(body: Body) -> Iterator[tuple[str, str]]:
    """Yield name and text of each property of a body."""
    import numpy as np

    from palpate.contact.diagnosis import format_size
    from palpate.fem.storage import SPRINGS

    record = body.record.get
    x, y, z = np.ptp(body.points, axis=0).tolist()
    network = record("method") == SPRINGS
    volume = "" if network else f", {1e6 * record('volume_m3', 0.0):.4g} cm³"
    yield "size", f"{format_size((x, y, z))}{volume}"
    if network:
        yield from _network_rows(body)
        return
    young = (body.contents.young if len(body.contents.young) else np.array([record("young_Pa", 0.0)])) / 1e3
    spread = f"{young.min():.4g}" if np.ptp(young) < 1e-6 * young.max() else f"{young.min():.4g} to {young.max():.4g}"
    density = f"{record('density_kg_per_m3', 0.0):g} kg/m³"
    yield "material", f"Young's modulus {spread} kPa, Poisson's ratio {record('poisson')}, {density}"
    for region in record("regions") or ():
        yield "region", str(region)
    if record("surface_layer"):
        yield "layer", str(record("surface_layer"))
    yield "fixed", ", ".join(record("fixed") or ["?"])
    if held := record("held"):
        yield "held", ", ".join(held)
    yield "contact", record("touch") or "whole surface that is not fixed"
    elements = {1: "linear", 2: "quadratic"}.get(record("order", 0), "?")
    if record("method"):
        elements = f"boundary elements, {elements}"
    yield "elements", f"{elements}, {record('nodes', 0):,} nodes, {record('unknowns', 0):,} unknowns"
    hertz = body.contents.frequencies / (2 * np.pi)
    modes = f"{len(hertz)}, {hertz.min():.3g} to {hertz.max():.3g} Hz" if len(hertz) else "none"
    yield "modes", modes
    stages = ", ".join(f"{stage} {time:.3g} s" for stage, time in record("seconds", {}).items())
    memory, operations = 1e-9 * record("memory_bytes", 0.0), 1e-9 * record("operations", 0.0)
    yield "build", f"{memory:.2g} GB, {operations:.3g} Gflop; {stages}"
    yield "versions", ", ".join(f"{name} {version}" for name, version in record("versions", {}).items())


def _network_rows(body: Body) -> Iterator[tuple[str, str]]:
    """Yield name and text of each property of a body of springs."""
    contents = body.contents
    stiffness, total = contents.spring_stiffness, 1e3 * contents.masses.sum()
    spread = (
        f"{stiffness.min():.4g}"
        if stiffness.min() == stiffness.max()
        else f"{stiffness.min():.4g} to {stiffness.max():.4g}"
    )
    yield "springs", f"{len(stiffness):,}, {spread} N/m"
    yield "vertices", f"{len(contents.vertices):,}, {total:.4g} g, {int(contents.dirichlet.sum()):,} fixed"
    if held := body.record.get("held"):
        yield "held", ", ".join(held)
    yield "versions", ", ".join(f"{name} {version}" for name, version in body.record.get("versions", {}).items())
