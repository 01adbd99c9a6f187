"""`palpate body`: build a body that yields, and look at one."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from palpate.cli.console import errors, output, progress, stages

__all__ = ["build", "phantom", "show", "validate"]


def build(
    source: Annotated[
        Path, typer.Argument(help="Closed surface (.stl, .obj, .ply, .off, .glb) or tetrahedra (.msh, .vtk, ...).")
    ],
    young: Annotated[str, typer.Option("--young", help='Young\'s modulus, such as "5 kPa".')],
    fixed: Annotated[
        list[str] | None,
        typer.Option("--fixed", help='What does not move: "z < 1 mm", "box 0 0 0 to 9 9 1 mm", "surface ..."; repeat.'),
    ] = None,
    unit: Annotated[str | None, typer.Option("--unit", help="Unit that the file is written in, such as mm.")] = None,
    poisson: Annotated[float, typer.Option("--poisson", help="Poisson's ratio, below 0.5.")] = 0.45,
    density: Annotated[str, typer.Option("--density", help="Mass per volume.")] = "1000 kg/m^3",
    region: Annotated[
        list[str] | None,
        typer.Option("--region", help='Of another stiffness: "sphere 50 50 40 radius 7.5 mm = 25 kPa"; repeat.'),
    ] = None,
    skin: Annotated[str | None, typer.Option("--skin", help='Under the touchable surface: "2 mm = 50 kPa".')] = None,
    touch: Annotated[
        str | None, typer.Option("--touch", help="What can be touched, as --fixed; all if absent.")
    ] = None,
    spacing: Annotated[
        str | None, typer.Option("--spacing", help="Edges of the tetrahedra in a filled surface.")
    ] = None,
    order: Annotated[int, typer.Option("--order", help="2: quadratic elements; 1: linear, which lock near 0.5.")] = 2,
    modes: Annotated[int, typer.Option("--modes", help="Vibration modes to find too, for a body with inertia.")] = 0,
    memory: Annotated[str, typer.Option("--memory", help="Budget that the build must keep.")] = "8 GB",
    out: Annotated[Path | None, typer.Option("--out", "-o", help="File to write; the source's name with .h5.")] = None,
) -> None:
    """Build a body from a mesh: fill it, solve how its surface yields, write that to a file.

    Says first how large the result will be and how long it will take, and stops with a proposal if that is over the
    budget. The file appears whole or not at all.

    Example: palpate body build liver.stl --unit mm --young "5 kPa" --fixed "z < 2 mm" -o liver.h5
    """
    with stages("starting") as tell, warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        from palpate.bodies import BodyWarning
        from palpate.bodies import build as make

        target = out if out is not None else source.with_suffix(".h5")
        body = make(
            source,
            young=young,
            fixed=fixed or [],
            unit=unit,
            poisson=poisson,
            density=density,
            regions=region or [],
            skin=skin,
            touch=touch,
            spacing=spacing,
            order=order,
            modes=modes,
            memory=memory,
            output=target,
            progress=tell,
        )
    for warning in told:
        if issubclass(warning.category, BodyWarning):
            errors.print(f"[yellow]warning:[/] {escape(str(warning.message))}", soft_wrap=True)
    _tell(body.record, len(body.nodes))
    output.print(f"  {target}", style="dim", markup=False, soft_wrap=True)


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
        from palpate.bodies import BodyError
        from palpate.bodies import phantom as make
        from palpate.units import quantity

        body = make(
            young=quantity(young, "Pa", "young", error=BodyError),
            contrast=contrast,
            depth=quantity(depth, "m", "depth", error=BodyError),
            spacing=quantity(spacing, "m", "spacing", error=BodyError),
            output=out,
            progress=tell,
        )
    _tell(body.record, len(body.nodes))
    output.print(f"  {out}", style="dim", markup=False, soft_wrap=True)


def show(file: Annotated[Path, typer.Argument(help="A body (.h5).")]) -> None:
    """Say what a body is and how it was made."""
    from palpate.bodies import load

    body = load(file)
    _tell(body.record, len(body.nodes))
    for key, value in body.record.items():
        output.print(f"  {key}: {value}", style="dim", markup=False, soft_wrap=True)


def _tell(record: object, nodes: int) -> None:
    assert isinstance(record, dict)
    output.print(
        f"[bold]{escape(str(record['source']))}[/]: {record['tetrahedra']} tetrahedra, {record['nodes']} nodes, "
        f"{nodes} of them touchable; {36e-6 * nodes**2:.3g} MB, solved in "
        f"{sum(s for stage, s in record['seconds'].items() if stage != 'meshing'):.3g} s",
        soft_wrap=True,
    )


def validate(
    paths: Annotated[int, typer.Option("--paths", help="Random closed paths for each kind of body.")] = 10_000,
) -> None:
    """Hold bodies against converged finite elements, against Hertz and against the law of energy; takes minutes.

    Example: palpate body validate
    """
    with progress("starting") as tell:
        from palpate.bodies.validation import validate as run

        rows = run(tell, paths=paths)
    missed = False
    for row in rows:
        good = abs(row["off"]) <= row["asked"]
        missed = missed or not good
        output.print(
            f"  [{'green' if good else 'red'}]{100 * row['off']:+.2g} %[/] {escape(row['what'])} "
            f"[dim](asked: within {100 * row['asked']:g} %)[/]",
            soft_wrap=True,
        )
    if missed:
        raise typer.Exit(1)
