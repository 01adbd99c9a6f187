"""Identification: experiments, recordings, ARX models, the device's own parameters and its friction."""

from palpate.identify.arx import ArxModel, Fit, arx
from palpate.identify.base import Parameter, base_parameters, base_values, true_values, with_base_values
from palpate.identify.excitation import Excitation, crest_factor, multisine, prbs, sweep
from palpate.identify.experiments import Noise, default_excitation, default_sway, experiment
from palpate.identify.friction import FrictionFit, friction_by_matching, friction_by_regressor
from palpate.identify.order import Candidate, OrderTable, select_order
from palpate.identify.parameters import ParameterFit, estimate_parameters, summary_rows
from palpate.identify.recording import Recording
from palpate.identify.residuals import Independence, Whiteness, independence, whiteness
from palpate.identify.servo import Servo
from palpate.identify.study import identify_recording
from palpate.identify.weak_form import TestFunctions

__all__ = [
    "ArxModel",
    "Candidate",
    "Excitation",
    "Fit",
    "FrictionFit",
    "Independence",
    "Noise",
    "OrderTable",
    "Parameter",
    "ParameterFit",
    "Recording",
    "Servo",
    "TestFunctions",
    "Whiteness",
    "arx",
    "base_parameters",
    "base_values",
    "crest_factor",
    "default_excitation",
    "default_sway",
    "estimate_parameters",
    "experiment",
    "friction_by_matching",
    "friction_by_regressor",
    "identify_recording",
    "independence",
    "multisine",
    "prbs",
    "select_order",
    "summary_rows",
    "sweep",
    "true_values",
    "whiteness",
    "with_base_values",
]
