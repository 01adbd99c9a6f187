"""Where the commands print, how they show progress, and how they write a folder whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from palpate.errors import PalpateError

__all__ = ["errors", "output", "progress", "write_folder"]

output = Console(highlight=False)
errors = Console(stderr=True, highlight=False)


@contextmanager
def progress(text: str) -> Iterator[Callable[[str, float], None]]:
    """Show a bar on stderr until the block ends; it yields what moves it: a text, and the fraction done, 0 to 1."""
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), TimeElapsedColumn())
    with Progress(*columns, console=errors, transient=True) as bar:
        task = bar.add_task(text, total=1.0)
        yield lambda now, fraction: bar.update(task, description=now, completed=fraction)


def write_folder(folder: Path, writers: Mapping[str, Callable[[Path], object]]) -> list[Path]:
    """Write several files into `folder`: all of them, or none if one fails. Returns their paths.

    Args:
        folder: made if missing; files of other names in it stay.
        writers: file name to what writes it, given the path to write to.

    Raises:
        PalpateError: the folder cannot be written.
    """
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".part", dir=folder.parent))
    except OSError as problem:
        raise PalpateError(f"{folder}: cannot be written: {problem.strerror}") from None
    try:
        for name, write in writers.items():
            write(part / name)
        folder.mkdir(exist_ok=True)
        for name in writers:
            os.replace(part / name, folder / name)
    except OSError as problem:
        raise PalpateError(f"{folder}: cannot be written: {problem.strerror}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return [folder / name for name in writers]
