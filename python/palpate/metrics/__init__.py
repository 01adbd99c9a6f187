"""Metrics of a run and of a loop: step response, contact, impedance, rate hardness, bandwidth and ripple."""

from palpate.metrics.body_contact import PalpationMetrics, palpation_metrics
from palpate.metrics.device_performance import (
    DeviceMeasures,
    TwoPort,
    device_measures,
    moving_force,
    peak_acceleration,
    peak_force,
    tip_inertia,
    two_port,
)
from palpate.metrics.guard_comparison import GuardComparison, GuardRow, TipAxis, compare_guards, tip_axis
from palpate.metrics.hardness import rate_hardness
from palpate.metrics.loop_response import LoopResponse, arm_stiffness, hold_response
from palpate.metrics.mesh_contact import SlidingMetrics, sliding_metrics
from palpate.metrics.performance import Performance, measure_performance
from palpate.metrics.summary import summarize
from palpate.metrics.vibration import Ripple, ripple, vibration_threshold
from palpate.simulation.step_response import StepResponse, step_response

__all__ = [
    "DeviceMeasures",
    "GuardComparison",
    "GuardRow",
    "LoopResponse",
    "PalpationMetrics",
    "Performance",
    "Ripple",
    "SlidingMetrics",
    "StepResponse",
    "TipAxis",
    "TwoPort",
    "arm_stiffness",
    "compare_guards",
    "device_measures",
    "hold_response",
    "measure_performance",
    "moving_force",
    "palpation_metrics",
    "peak_acceleration",
    "peak_force",
    "rate_hardness",
    "ripple",
    "sliding_metrics",
    "step_response",
    "summarize",
    "tip_axis",
    "tip_inertia",
    "two_port",
    "vibration_threshold",
]
