"""Linear models of a device and of its sampled loop: linearization, discretization, equilibria and modes."""

from palpate.linear.design_plant import rendering_plant
from palpate.linear.discretization import discretize
from palpate.linear.eigenmodes import Mode, damping_effect, modes
from palpate.linear.equilibrium import Equilibrium, equilibria
from palpate.linear.linear_device import Arm, HeldTip, Tip, hold
from palpate.linear.linearization import linearize
from palpate.linear.wall import WallLoop, causal_controller, wall_loop

__all__ = [
    "Arm",
    "Equilibrium",
    "HeldTip",
    "Mode",
    "Tip",
    "WallLoop",
    "causal_controller",
    "damping_effect",
    "discretize",
    "equilibria",
    "hold",
    "linearize",
    "modes",
    "rendering_plant",
    "wall_loop",
]
