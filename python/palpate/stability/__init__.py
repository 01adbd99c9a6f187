"""Stability of a haptic loop: criteria, passivity, exact maps of stable objects, and certificates."""

from palpate.errors import StabilityError
from palpate.stability.boundaries import (
    Boundary,
    StabilityInterval,
    critical_stiffness,
    stability_boundary,
    stability_interval,
    wall_spectral_radius,
)
from palpate.stability.certificate import Certificate, certify
from palpate.stability.contact_loop import ContactStability, contact_stability
from palpate.stability.counter_example import CounterExample, destabilizing_operator
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
from palpate.stability.energy import EnergyObserver, PassivityController, naive_energy, zoh_energy
from palpate.stability.measured import MeasuredResponse, MeasuredVerdict
from palpate.stability.passivity import (
    coulomb_amplitude,
    coupling_damping,
    field_damping,
    passive_damping,
    passive_stiffness,
    quantized_stiffness,
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
from palpate.stability.wall_verdict import WallVerdict, wall_limit
from palpate.stability.workspace_map import Workspace, workspace
from palpate.stability.zwidth_map import ZWidth, zwidth

__all__ = [
    "Boundary",
    "Certificate",
    "ContactStability",
    "CounterExample",
    "CouplingVerdict",
    "EnergyObserver",
    "Jury",
    "Lyapunov",
    "MeasuredResponse",
    "MeasuredVerdict",
    "PassivityController",
    "Routh",
    "StabilityError",
    "StabilityInterval",
    "WallVerdict",
    "Workspace",
    "ZWidth",
    "certify",
    "certify_coupling",
    "characteristic_polynomial",
    "contact_stability",
    "coulomb_amplitude",
    "coupling_damping",
    "critical_stiffness",
    "destabilizing_operator",
    "field_damping",
    "jury",
    "llewellyn",
    "lyapunov",
    "naive_energy",
    "passive_damping",
    "passive_stiffness",
    "positive_real_margin",
    "precise_tables",
    "quantized_stiffness",
    "routh",
    "stability_boundary",
    "stability_interval",
    "sufficient_damping",
    "two_port_limit",
    "two_port_margin",
    "wall_limit",
    "wall_polynomial",
    "wall_spectral_radius",
    "workspace",
    "zoh_energy",
    "zwidth",
]
