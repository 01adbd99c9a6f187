"""Output, progress and common options of the commands."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, TextIO

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from palpate.errors import PalpateWarning, printable

ScenarioFile = Annotated[Path, typer.Argument(help="Scenario file (TOML). Examples lie in scenarios/.")]
OutFolder = Annotated[
    Path | None,
    typer.Option(
        "--out", "-o", help="Folder to write; the default is results/ and the name of the scenario or device."
    ),
]

COLORS = {"good": "green", "note": "yellow", "bad": "red"}  # of the tone of a verdict


class SafeConsole(Console):
    """Console that shows the control characters of a text escaped, so that a terminal does not obey them."""

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as `rich.console.Console.print`."""
        super().print(*(printable(one) if isinstance(one, str) else one for one in objects), **options)


output = SafeConsole(highlight=False)
errors = SafeConsole(stderr=True, highlight=False)


def print_paths(paths: Iterable[Path]) -> None:
    """Print the files that a command wrote."""
    for path in paths:
        output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)


def print_columns(rows: Sequence[Sequence[str]]) -> None:
    """Print rows of one length as columns, the first row as their header; lines are as long as they have to be."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for number, row in enumerate(rows):
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        output.print(f"  {line.rstrip()}", style=None if number else "bold", markup=False, soft_wrap=True)


@contextmanager
def warnings_in_a_line() -> Iterator[None]:
    """Print each warning of palpate once, without its place in the code, and other warnings as Python does."""
    with warnings.catch_warnings():
        others, seen = warnings.showwarning, set[str]()

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if not issubclass(category, PalpateWarning):
                others(message, category, filename, lineno, file, line)
            elif str(message) not in seen:
                seen.add(str(message))
                errors.print(f"[yellow]warning:[/] {escape(str(message))}", soft_wrap=True)

        warnings.simplefilter("always", PalpateWarning)
        warnings.showwarning = show
        yield


@contextmanager
def progress(text: str) -> Iterator[Callable[[str, float], None]]:
    """Show a bar on stderr until the block ends; yield a function of a text and the fraction done, 0 to 1."""
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), TimeElapsedColumn())
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task(text, total=1.0)
        yield lambda now, fraction: bar.update(task, description=escape(printable(now)), completed=fraction)


@contextmanager
def stages(text: str) -> Iterator[Callable[[str, float], None]]:
    """Show long stages on stderr as `progress` does; the text of each remains, with its duration."""
    now, begin = text, time.perf_counter()
    with Progress(TextColumn("{task.description}"), BarColumn(30), TimeElapsedColumn(), console=errors) as bar:
        task = bar.add_task(text, total=None)

        def tell(next_text: str, _fraction: float) -> None:
            nonlocal now, begin
            done, (now, begin) = (now, begin), (next_text, time.perf_counter())
            errors.print(f"  {escape(done[0])} [dim]{begin - done[1]:.1f} s[/]", soft_wrap=True)
            bar.reset(task, description=escape(printable(next_text)), total=None)

        yield tell
        tell("", 1.0)
        bar.remove_task(task)
