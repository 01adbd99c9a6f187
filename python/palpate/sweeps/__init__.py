"""Sweeps: a scenario run over every combination of values, and the boundary of stability between them."""

from palpate.simulation.verdict import State
from palpate.sweeps.axes import SweepError
from palpate.sweeps.outcomes import Outcomes
from palpate.sweeps.refinement import Refined, refine
from palpate.sweeps.run import Sweep, open_sweep, sweep
from palpate.sweeps.store import merge

__all__ = ["Outcomes", "Refined", "State", "Sweep", "SweepError", "merge", "open_sweep", "refine", "sweep"]
