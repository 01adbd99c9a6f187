"""Palpation in closed loop: bodies from soft to stiff under the Premium 1.5A, and the nodule of the phantom."""

from experiments.palpation_phantom.page import palpation_page
from experiments.palpation_phantom.stiffnesses import Held, press_all, press_scenario
from experiments.palpation_phantom.sweep import JND, Felt, Sweep, felt, sweep_phantom, sweep_scenario

__all__ = [
    "JND",
    "Felt",
    "Held",
    "Sweep",
    "felt",
    "palpation_page",
    "press_all",
    "press_scenario",
    "sweep_phantom",
    "sweep_scenario",
]
