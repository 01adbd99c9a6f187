"""`python -m experiments.palpation_phantom`: soft to stiff bodies in closed loop, and the nodule of the phantom."""

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

    Writes report.html and palpation.json. Bodies that are made are kept in the user's cache.

    Example: python -m experiments.palpation_phantom --contrast 10 --depth "10 mm"
    """
    with progress("starting") as tell:
        from experiments.palpation_phantom import palpation_page, press_all, sweep_phantom

        sweep = sweep_phantom(
            contrast=contrast,
            depth=depth,
            spacing=spacing,
            progress=lambda text, share: tell(f"phantom: {text}", 0.6 * share),
        )
        held = press_all(progress=lambda text, share: tell(text, 0.6 + 0.3 * share))
        tell("drawing", 0.9)
        page = palpation_page(held, sweep)
        found = {"bodies": [one.to_dict() for one in held], "phantom": sweep.to_dict()}
        text = json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        paths = write_folder(
            out, {"report.html": page.save, "palpation.json": lambda path: path.write_text(text, "utf-8")}
        )
    good = sum(one.stable for one in held)
    colour = "green" if good == len(held) else "red"
    output.print(f"[bold {colour}]{good} of {len(held)}[/] loops on bodies of 2 to 100 kPa come to rest in contact")
    told = "a hand can tell" if sweep.detectable else "too little for a hand to tell"
    output.print(f"{escape(sweep.title)}: feels {100 * sweep.contrast:.3g} % stiffer, {told}", soft_wrap=True)
    for path in paths:
        output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)
    if good < len(held):
        raise typer.Exit(1)


app = typer.Typer(
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(one_sentence(palpation))

if __name__ == "__main__":
    app(prog_name="python -m experiments.palpation_phantom")
