"""Stability of a haptic loop: criteria, passivity, exact maps of stable objects, and certificates."""

from palpate.errors import StabilityError
from palpate.stability.boundaries import Boundary, Critical, boundary, critical, critical_stiffness, spectral_radius
from palpate.stability.certificate import Certificate, certify
from palpate.stability.contact_loop import ContactStability, contact_stability
from palpate.stability.counter_example import CounterExample, worst_hand
from palpate.stability.criteria import (
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
from palpate.stability.energy import EnergyObserver, PassivityController, held_energy, naive_energy
from palpate.stability.measured import MeasuredResponse, MeasuredVerdict
from palpate.stability.passivity import (
    coulomb_amplitude,
    coupling_damping,
    field_damping,
    passive_damping,
    passive_stiffness,
    quantised_stiffness,
    sufficient_damping,
)
from palpate.stability.two_port import (
    CouplingVerdict,
    certify_coupling,
    llewellyn,
    positive_real_margin,
    two_port_limit,
    two_port_margin,
)
from palpate.stability.wall_verdict import WallVerdict, wall
from palpate.stability.workspace_map import Workspace, workspace
from palpate.stability.zwidth_map import ZWidth, zwidth

__all__ = [
    "Boundary",
    "Certificate",
    "ContactStability",
    "CounterExample",
    "CouplingVerdict",
    "Critical",
    "EnergyObserver",
    "Jury",
    "Lyapunov",
    "MeasuredResponse",
    "MeasuredVerdict",
    "PassivityController",
    "Routh",
    "StabilityError",
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
    "spectral_radius",
    "sufficient_damping",
    "two_port_limit",
    "two_port_margin",
    "wall",
    "wall_polynomial",
    "workspace",
    "worst_hand",
    "zwidth",
]
