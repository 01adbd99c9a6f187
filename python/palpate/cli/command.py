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
