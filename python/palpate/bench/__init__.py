"""How fast the loop runs, beside peers that do the same work in the same run."""

from palpate.bench.run import run

__all__ = ["run"]
