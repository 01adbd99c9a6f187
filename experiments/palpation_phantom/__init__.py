"""Palpation in closed loop: bodies from soft to stiff under the Premium 1.5A, and the nodule of the phantom."""

from experiments.palpation_phantom.page import palpation_page
from experiments.palpation_phantom.stiffnesses import PressResult, press_all, press_scenario
from experiments.palpation_phantom.sweep import (
    JND,
    PalpationSweep,
    StiffnessProfile,
    stiffness_profile,
    sweep_phantom,
    sweep_scenario,
)

__all__ = [
    "JND",
    "PalpationSweep",
    "PressResult",
    "StiffnessProfile",
    "palpation_page",
    "press_all",
    "press_scenario",
    "stiffness_profile",
    "sweep_phantom",
    "sweep_scenario",
]
