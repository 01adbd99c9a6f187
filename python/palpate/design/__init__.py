"""Controllers from specifications, and the exact margins of the sampled loops that they close."""

from palpate.design.kalman import KalmanFilter, kalman
from palpate.design.lead_lag import Compensator, lead_lag
from palpate.design.loop import (
    closed_loop,
    closed_loop_matrix,
    loop_gain,
    rendering_plant,
    spectral_radius,
)
from palpate.design.lqg import lqg
from palpate.design.margins import Margins, critical_gain, gain_interval, loop_margins, margins
from palpate.design.virtual_coupling import virtual_coupling

__all__ = [
    "Compensator",
    "KalmanFilter",
    "Margins",
    "closed_loop",
    "closed_loop_matrix",
    "critical_gain",
    "gain_interval",
    "kalman",
    "lead_lag",
    "loop_gain",
    "loop_margins",
    "lqg",
    "margins",
    "rendering_plant",
    "spectral_radius",
    "virtual_coupling",
]
