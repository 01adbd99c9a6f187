"""`palpate`: the commands put together, and how a mistake or Ctrl-C ends.

Exit codes: 0 done; 1 done, and the answer is bad (a loop diverges, a number differs); 2 the input is wrong; 130 Ctrl-C.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

import typer

from palpate.cli import body
from palpate.cli.bench import bench
from palpate.cli.console import errors, warnings_in_a_line
from palpate.cli.devices import devices
from palpate.cli.identify import identify
from palpate.cli.interrupt import control_c
from palpate.cli.palpation import palpation
from palpate.cli.performance import performance
from palpate.cli.reproduce import reproduce
from palpate.cli.run import run
from palpate.cli.stability import certify, workspace, zwidth
from palpate.cli.sweep import merge, sweep
from palpate.errors import PalpateError

__all__ = ["app", "main"]

app = typer.Typer(
    name="palpate",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Model a haptic device, design its controller, run the servo loop, and see whether it is stable.\n\n"
    "Begin with **palpate run** on a file from scenarios/, or with **palpate reproduce** for the thesis from "
    "which palpate grew. Every command explains itself with --help.",
    epilog="Exit codes: 0 done · 1 done, but a loop diverges or a number differs · 2 wrong input · 130 Ctrl-C",
)


def one_sentence(command: Callable[..., None]) -> Callable[..., None]:
    """Let a mistake end a command in one sentence, and Ctrl-C in one line, never in a traceback."""

    @wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            with control_c(), warnings_in_a_line():
                command(*args, **kwargs)
        except PalpateError as problem:
            errors.print("[bold red]error:[/] ", end="")
            errors.print(str(problem), markup=False, soft_wrap=True)
            raise typer.Exit(2) from None
        except KeyboardInterrupt:
            errors.print("stopped: nothing was written")
            raise typer.Exit(130) from None

    return wrapped


for function in (
    run,
    certify,
    zwidth,
    workspace,
    performance,
    palpation,
    sweep,
    merge,
    reproduce,
    identify,
    devices,
    bench,
):
    app.command()(one_sentence(function))

bodies = typer.Typer(no_args_is_help=True, help="Bodies that yield: build one from a mesh, or look at one.")
for name, command in (
    ("build", body.build),
    ("phantom", body.phantom),
    ("show", body.show),
    ("validate", body.validate),
):
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
