"""How fast palpate is: the loop beside peers that do the same work in the same run, the exact answers, the proxy."""

from palpate.bench.run import SECTIONS, run

__all__ = ["SECTIONS", "run"]
