"""`python -m experiments.palpation_phantom`: bodies of several stiffnesses in closed loop, and the phantom."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer
from palpate.cli.command import one_sentence
from palpate.cli.console import output, progress
from palpate.files import write_folder
from rich.markup import escape

__all__ = ["app", "palpation"]


def palpation(
    contrast: Annotated[float, typer.Option("--contrast", help="Nodule's modulus over the block's.")] = 5.0,
    depth: Annotated[str, typer.Option("--depth", help="Of the nodule's top under the phantom's.")] = "5 mm",
    spacing: Annotated[str, typer.Option("--spacing", help="Of the phantom's cells.")] = "5 mm",
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write to.")] = Path("results/palpation"),
) -> None:
    """Press bodies of 2 to 100 kPa with the Premium 1.5A at 1 kHz, and sweep over the palpation phantom.

    Writes report.html and palpation.json. Bodies are stored in the user's cache.

    Example: python -m experiments.palpation_phantom --contrast 10 --depth "10 mm"
    """
    with progress("starting") as report:
        from experiments.palpation_phantom import palpation_page, press_all, sweep_phantom

        sweep = sweep_phantom(
            contrast=contrast,
            depth=depth,
            spacing=spacing,
            progress=lambda text, fraction: report(f"phantom: {text}", 0.6 * fraction),
        )
        results = press_all(progress=lambda text, fraction: report(text, 0.6 + 0.3 * fraction))
        report("drawing", 0.9)
        page = palpation_page(results, sweep)
        content = {"bodies": [result.to_dict() for result in results], "phantom": sweep.to_dict()}
        text = json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        paths = write_folder(
            out, {"report.html": page.save, "palpation.json": lambda path: path.write_text(text, "utf-8")}
        )
    good = sum(result.stable for result in results)
    color = "green" if good == len(results) else "red"
    output.print(f"[bold {color}]{good} of {len(results)}[/] loops on bodies of 2 to 100 kPa are stable in contact")
    verdict = "detectable" if sweep.detectable else "not detectable"
    output.print(f"{escape(sweep.title)}: {100 * sweep.contrast:.3g} % stiffer, {verdict}", soft_wrap=True)
    for path in paths:
        output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)
    if good < len(results):
        raise typer.Exit(1)


app = typer.Typer(
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(one_sentence(palpation))

if __name__ == "__main__":
    app(prog_name="python -m experiments.palpation_phantom")
