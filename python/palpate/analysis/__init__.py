"""Where the device rests, how it behaves near there, and what sampling makes of that."""

from palpate.analysis.discretize import discretize
from palpate.analysis.equilibrium import Equilibrium, equilibria
from palpate.analysis.linearize import linearize
from palpate.analysis.modes import Mode, damping_effect, modes

__all__ = ["Equilibrium", "Mode", "damping_effect", "discretize", "equilibria", "linearize", "modes"]
