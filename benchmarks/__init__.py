"""Speed of palpate beside peers that do the same work in the same run; `python -m benchmarks`."""

from benchmarks.runner import SECTIONS, run

__all__ = ["SECTIONS", "run"]
