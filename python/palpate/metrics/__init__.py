"""Metrics of a run and of a loop: step response, contact, impedance, rate hardness, bandwidth and ripple."""

from palpate.metrics.body_contact import PalpationMetrics, palpation_metrics
from palpate.metrics.hardness import rate_hardness
from palpate.metrics.loop_response import LoopResponse, arm_stiffness, hold_response
from palpate.metrics.mesh_contact import SlidingMetrics, sliding_metrics
from palpate.metrics.performance import Performance, measure_performance
from palpate.metrics.summary import summarize
from palpate.metrics.vibration import Ripple, ripple, vibration_threshold
from palpate.simulation.step_response import StepResponse, step_response

__all__ = [
    "LoopResponse",
    "PalpationMetrics",
    "Performance",
    "Ripple",
    "SlidingMetrics",
    "StepResponse",
    "arm_stiffness",
    "hold_response",
    "measure_performance",
    "palpation_metrics",
    "rate_hardness",
    "ripple",
    "sliding_metrics",
    "step_response",
    "summarize",
    "vibration_threshold",
]
