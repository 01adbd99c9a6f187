"""Speed of palpate and of peers on the same work; `python -m benchmarks`."""

from benchmarks.runner import SECTIONS, run

__all__ = ["SECTIONS", "run"]
