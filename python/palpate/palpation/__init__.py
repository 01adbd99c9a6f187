"""Palpation in closed loop: soft to stiff bodies under the Premium 1.5A, and what a hand finds in the phantom."""

from palpate.palpation.page import palpation_page
from palpate.palpation.stiffnesses import Held, press_all, press_scenario
from palpate.palpation.sweep import JND, Felt, Sweep, felt, sweep_phantom, sweep_scenario

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
