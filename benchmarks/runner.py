"""Run of the sections of the benchmark, with a description of the machine."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path
from typing import Any

from palpate.errors import PalpateError
from palpate.files import write_json

from benchmarks import batch, body, guards, loop, solid, stability, tick, touch
from benchmarks.section import Effort, Progress, Section

__all__ = ["SECTIONS", "run"]

SECTIONS: dict[str, Section] = {
    "loop": loop.SECTION,
    "batch": batch.SECTION,
    "stability": stability.SECTION,
    "touch": touch.SECTION,
    "solid": solid.SECTION,
    "tick": tick.SECTION,
    "body": body.SECTION,
    "guards": guards.SECTION,
}


def run(
    sections: Iterable[str] = (),
    out: str | Path | None = None,
    *,
    quick: bool = False,
    large: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Return the results of the sections, and write them to `out` (JSON) if given.

    The result has "sections" (by name: "work", "rows" and "missing"), "machine" and "versions".

    Args:
        sections: keys of SECTIONS; empty for all.
        out: file to write.
        quick: whether to run a tenth of the repetitions.
        large: whether to include sizes whose preparation takes minutes.
        progress: called with a text and the fraction done, 0 to 1.

    Raises:
        PalpateError: an unknown section.
        OutputError: `out` cannot be written.
    """
    names = list(dict.fromkeys(sections)) or list(SECTIONS)
    for name in names:
        if name not in SECTIONS:
            raise PalpateError(f"there is no section {name!r} in the benchmark: choose from {', '.join(SECTIONS)}")
    found: dict[str, Any] = {}
    for number, name in enumerate(names):

        def tell(text: str, share: float, first: int = number) -> None:
            if progress is not None:
                progress(text, (first + share) / len(names))

        measured = SECTIONS[name].measure(Effort(quick, large), tell)
        found[name] = {"work": SECTIONS[name].work, "rows": measured.rows, "missing": measured.missing}
    result = {
        "sections": found,
        "machine": {"processor": _processor(), "cores": os.cpu_count(), "python": platform.python_version()},
        "versions": {name: _version(name) for name in ("palpate", "mujoco", "control", "numpy", "scipy")},
    }
    if out is not None:
        write_json(out, result, indent=2)
    return result


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _version(name: str) -> str | None:
    try:
        return version(name)
    except Exception:
        return None
