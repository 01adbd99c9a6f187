"""`palpate`: all commands of the command line.

Exit codes: 0 done; 1 done, with a bad result (not settled, not stable, a number differs); 2 wrong input; 130 Ctrl-C.
"""

from __future__ import annotations

from typing import Annotated

import typer

from palpate.cli import body
from palpate.cli.command import one_sentence
from palpate.cli.design import design
from palpate.cli.devices import devices
from palpate.cli.identify import identify
from palpate.cli.new import new
from palpate.cli.performance import performance
from palpate.cli.resolve import resolve
from palpate.cli.run import run
from palpate.cli.stability import certify, workspace, zwidth
from palpate.cli.sweep import merge, sweep
from palpate.cli.together import together

app = typer.Typer(
    name="palpate",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Model a haptic device, design its controller, run the servo loop, and see whether it is stable.\n\n"
    "Begin with **palpate new scenario wall**, then **palpate run wall.toml**. More scenarios lie in scenarios/ of the "
    "repository. Every command explains itself with --help.",
    epilog="Exit codes: 0 done · 1 done, but not settled or stable, or a number differs · 2 wrong input · 130 Ctrl-C",
)


for function in (
    run, together, new, design, certify, zwidth, workspace, performance, sweep, merge, identify, devices, resolve,
):  # fmt: skip
    app.command()(one_sentence(function))

bodies = typer.Typer(no_args_is_help=True, help="Deformable bodies: build one from a mesh, or describe one.")
for name, command in (("build", body.build), ("phantom", body.phantom), ("show", body.show)):
    bodies.command(name)(one_sentence(command))
app.add_typer(bodies, name="body")


@app.callback(invoke_without_command=True)
def _version(version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False) -> None:
    if version:
        from importlib.metadata import version as installed

        print(installed("palpate"))
        raise typer.Exit


def main() -> None:
    """Run the command line and exit with its code."""
    app()
