"""`python -m experiments.mesh_corpus [FILES]`: fill and press the generated surfaces, and the surfaces of files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from palpate import PalpateError
from palpate.contact.mesh import read_triangles

from experiments.mesh_corpus.press import Pressed, press
from experiments.mesh_corpus.shapes import SHAPES, Surface


def show(
    files: Annotated[list[Path] | None, typer.Argument(help="Surfaces; default: the generated ones.")] = None,
) -> None:
    """Print a row of a table for each surface."""
    for name, shape in SHAPES.items() if not files else ():
        typer.echo(_row(name, press(shape())))
    for file in files or ():
        try:
            vertices, triangles, _ = read_triangles(file, unit="m")
        except PalpateError as problem:
            typer.echo(f"| {file.name} | refused: {problem} |")
            continue
        surface = Surface(np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64))
        typer.echo(_row(file.name, press(surface)))


def _row(name: str, found: Pressed) -> str:
    if found.refusal:
        return f"| {name} | refused after {found.seconds:.1f} s: {found.refusal} |"
    volume = "" if np.isnan(found.volume_error) else f"{100 * found.volume_error:+.1f} %"
    return (
        f"| {name} | {found.vertices:,} | {found.angle:.0f}° | {volume} | {found.force / found.hertz:.2f} | "
        f"{found.seconds:.1f} | {'; '.join(found.repairs)} |"
    )


if __name__ == "__main__":
    typer.run(show)
