"""`python -m experiments.body_validation`: the validation of deformable bodies."""

from __future__ import annotations

from typing import Annotated

import typer
from palpate.cli.command import one_sentence
from palpate.cli.console import output, progress
from rich.markup import escape

__all__ = ["app", "validate"]


def validate(
    paths: Annotated[int, typer.Option("--paths", help="Number of random closed paths for each model.")] = 10_000,
) -> None:
    """Compare bodies with converged finite elements, with Hertz, and with conservation of energy; takes minutes.

    Example: python -m experiments.body_validation
    """
    with progress("starting") as report:
        from experiments.body_validation.validation import validate as run

        rows = run(report, paths=paths)
    failed = False
    for row in rows:
        good = abs(row["deviation"]) <= row["tolerance"]
        failed = failed or not good
        output.print(
            f"  [{'green' if good else 'red'}]{100 * row['deviation']:+.2g} %[/] {escape(row['name'])} "
            f"[dim](tolerance: {100 * row['tolerance']:g} %)[/]",
            soft_wrap=True,
        )
    if failed:
        raise typer.Exit(1)


app = typer.Typer(
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(one_sentence(validate))

if __name__ == "__main__":
    app(prog_name="python -m experiments.body_validation")
