"""Controllers, their design from specifications, and exact margins of the sampled closed loop."""

from palpate.control.controller import Controller
from palpate.control.controller_forms import CommandController, as_controller, as_linear_controller
from palpate.control.coupling import virtual_coupling
from palpate.control.feedback_loop import closed_loop, closed_loop_matrix, loop_gain, spectral_radius
from palpate.control.h_infinity_design import (
    HInfinityDesign,
    Robustness,
    gap_margin,
    h_infinity,
    optimal_gap_margin,
    robustness,
)
from palpate.control.kalman_filter import KalmanFilter, kalman
from palpate.control.lead_lag_design import Compensator, lead_lag
from palpate.control.lqg_design import lqg
from palpate.control.stability_margins import Margins, critical_gain, gain_interval, loop_margins, margins
from palpate.control.workspace_controller import WorkspaceController, workspace

__all__ = [
    "CommandController",
    "Compensator",
    "Controller",
    "HInfinityDesign",
    "KalmanFilter",
    "Margins",
    "Robustness",
    "WorkspaceController",
    "as_controller",
    "as_linear_controller",
    "closed_loop",
    "closed_loop_matrix",
    "critical_gain",
    "gain_interval",
    "gap_margin",
    "h_infinity",
    "kalman",
    "lead_lag",
    "loop_gain",
    "loop_margins",
    "lqg",
    "margins",
    "optimal_gap_margin",
    "robustness",
    "spectral_radius",
    "virtual_coupling",
    "workspace",
]
