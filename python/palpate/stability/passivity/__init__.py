"""Passivity of a sampled display: walls, virtual couplings, and observers of the generated energy."""

from palpate.stability.passivity.coupling_design import (
    AdmittanceCoupling,
    ImpedanceCoupling,
    admittance_coupling,
    design_couplings,
    impedance_coupling,
)
from palpate.stability.passivity.energy import EnergyObserver, naive_energy, zoh_energy
from palpate.stability.passivity.sampled_wall import (
    coulomb_amplitude,
    coupling_damping,
    field_damping,
    passive_damping,
    passive_stiffness,
    quantized_stiffness,
    sufficient_damping,
)
from palpate.stability.passivity.two_port import (
    CouplingVerdict,
    certify_coupling,
    llewellyn,
    positive_real_margin,
    two_port_limit,
    two_port_margin,
)

__all__ = [
    "AdmittanceCoupling",
    "CouplingVerdict",
    "EnergyObserver",
    "ImpedanceCoupling",
    "admittance_coupling",
    "certify_coupling",
    "coulomb_amplitude",
    "coupling_damping",
    "design_couplings",
    "field_damping",
    "impedance_coupling",
    "llewellyn",
    "naive_energy",
    "passive_damping",
    "passive_stiffness",
    "positive_real_margin",
    "quantized_stiffness",
    "sufficient_damping",
    "two_port_limit",
    "two_port_margin",
    "zoh_energy",
]
