"""Linear models of a device and of its sampled loop: linearization, discretization, equilibria and modes."""

from palpate.linear.discretization import discretize, rendering_plant
from palpate.linear.eigenmodes import Mode, damping_effect, modes
from palpate.linear.equilibrium import Equilibrium, equilibria
from palpate.linear.linear_device import HumanArm, LinearDevice, SampledDevice, discretize_zoh
from palpate.linear.linearization import linearize
from palpate.linear.wall import WallLoop, causal_controller, wall_loop

__all__ = [
    "Equilibrium",
    "HumanArm",
    "LinearDevice",
    "Mode",
    "SampledDevice",
    "WallLoop",
    "causal_controller",
    "damping_effect",
    "discretize",
    "discretize_zoh",
    "equilibria",
    "linearize",
    "modes",
    "rendering_plant",
    "wall_loop",
]
