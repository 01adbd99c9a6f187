"""How a command ends after an error of the user or Ctrl-C."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import typer

from palpate.cli.console import errors, warnings_in_a_line
from palpate.cli.interrupt import control_c
from palpate.errors import PalpateError


def one_sentence(command: Callable[..., None]) -> Callable[..., None]:
    """End a command after a mistake of the user with one sentence, and after Ctrl-C or SIGTERM with one line."""

    @wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        done = False
        try:
            with control_c(), warnings_in_a_line():
                command(*args, **kwargs)
                done = True
        except PalpateError as problem:
            errors.print("[bold red]error:[/] ", end="")
            errors.print(str(problem), markup=False, soft_wrap=True)
            raise typer.Exit(2) from None
        except MemoryError as problem:
            errors.print(f"[bold red]error:[/] not enough memory{': ' * bool(str(problem))}", end="")
            errors.print(str(problem), markup=False, soft_wrap=True)
            raise typer.Exit(2) from None
        except KeyboardInterrupt:
            errors.print("stopped at the end: the results are written" if done else "stopped: nothing was written")
            raise typer.Exit(130) from None

    return wrapped
