"""Where the commands print, and how they show progress."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

__all__ = ["errors", "output", "progress"]

output = Console(highlight=False)
errors = Console(stderr=True, highlight=False)


@contextmanager
def progress(text: str) -> Iterator[Callable[[str, float], None]]:
    """Show a bar on stderr until the block ends; it yields what moves it: a text, and the fraction done, 0 to 1."""
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), TimeElapsedColumn())
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task(text, total=1.0)
        yield lambda now, fraction: bar.update(task, description=now, completed=fraction)
