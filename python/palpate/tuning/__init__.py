"""Design of a controller from a specification: the fastest that meets every constraint, or the one that forbids it."""

from palpate.tuning.axis import OPERATORS, AxisData, AxisDesign, tune_axis
from palpate.tuning.designer import design
from palpate.tuning.flexible import flexible_bands
from palpate.tuning.outcome import ControllerDesign
from palpate.tuning.presses import drive_bound
from palpate.tuning.specification import Specification

__all__ = [
    "OPERATORS",
    "AxisData",
    "AxisDesign",
    "ControllerDesign",
    "Specification",
    "design",
    "drive_bound",
    "flexible_bands",
    "tune_axis",
]
