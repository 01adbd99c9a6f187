"""How stiff an object a loop can render, for whom, and how sure that is: exact where theory is exact."""

from palpate.stability.boundary import Boundary, Critical, boundary, critical, critical_stiffness, spectral_radius
from palpate.stability.certificate import Certificate, certify
from palpate.stability.checks import StabilityError
from palpate.stability.contact import ContactStability, contact_stability
from palpate.stability.counter_example import CounterExample, worst_hand
from palpate.stability.energy import EnergyObserver, PassivityController, held_energy, naive_energy
from palpate.stability.loop import WallLoop, wall_loop
from palpate.stability.measured import MeasuredResponse, MeasuredVerdict
from palpate.stability.one_line import WallVerdict, wall
from palpate.stability.passivity import (
    coulomb_amplitude,
    coupling_damping,
    field_damping,
    passive_damping,
    passive_stiffness,
    quantised_stiffness,
    sufficient_damping,
)
from palpate.stability.roads import (
    Jury,
    Lyapunov,
    Routh,
    characteristic_polynomial,
    jury,
    lyapunov,
    precise_tables,
    routh,
    wall_polynomial,
)
from palpate.stability.scenario_loop import ScenarioLoop, scenario_loop
from palpate.stability.tip import Arm, HeldTip, Tip, hold
from palpate.stability.two_port import (
    CouplingVerdict,
    certify_coupling,
    llewellyn,
    positive_real_margin,
    two_port_limit,
    two_port_margin,
)
from palpate.stability.workspace import Workspace, workspace
from palpate.stability.zwidth import ZWidth, zwidth

__all__ = [
    "Arm",
    "Boundary",
    "Certificate",
    "ContactStability",
    "CounterExample",
    "CouplingVerdict",
    "Critical",
    "EnergyObserver",
    "HeldTip",
    "Jury",
    "Lyapunov",
    "MeasuredResponse",
    "MeasuredVerdict",
    "PassivityController",
    "Routh",
    "ScenarioLoop",
    "StabilityError",
    "Tip",
    "WallLoop",
    "WallVerdict",
    "Workspace",
    "ZWidth",
    "boundary",
    "certify",
    "certify_coupling",
    "characteristic_polynomial",
    "contact_stability",
    "coulomb_amplitude",
    "coupling_damping",
    "critical",
    "critical_stiffness",
    "field_damping",
    "held_energy",
    "hold",
    "jury",
    "llewellyn",
    "lyapunov",
    "naive_energy",
    "passive_damping",
    "passive_stiffness",
    "positive_real_margin",
    "precise_tables",
    "quantised_stiffness",
    "routh",
    "scenario_loop",
    "spectral_radius",
    "sufficient_damping",
    "two_port_limit",
    "two_port_margin",
    "wall",
    "wall_loop",
    "wall_polynomial",
    "workspace",
    "worst_hand",
    "zwidth",
]
