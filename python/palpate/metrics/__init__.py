"""Metrics of a run and of a loop: step response, contact, impedance, rate hardness, bandwidth and ripple."""

from palpate.metrics.body_contact import Palpation, palpation
from palpate.metrics.hardness import rate_hardness
from palpate.metrics.loop_response import LoopResponse, hand_stiffness, hold_response
from palpate.metrics.mesh_contact import Slide, slide
from palpate.metrics.performance import Performance, measure
from palpate.metrics.step import StepResponse, step_response
from palpate.metrics.summary import summarize
from palpate.metrics.vibration import Buzz, buzz, vibration_threshold

__all__ = [
    "Buzz",
    "LoopResponse",
    "Palpation",
    "Performance",
    "Slide",
    "StepResponse",
    "buzz",
    "hand_stiffness",
    "hold_response",
    "measure",
    "palpation",
    "rate_hardness",
    "slide",
    "step_response",
    "summarize",
    "vibration_threshold",
]
