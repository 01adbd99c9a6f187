"""Identification of a device: experiments, recordings, ARX models, parameters and friction."""

from palpate.identification.arx_models import ArxModel, Fit, arx
from palpate.identification.base import Parameter, base_parameters, base_values, true_values, with_base_values
from palpate.identification.excitation import Excitation, chirp, crest_factor, multisine, prbs
from palpate.identification.friction import FrictionFit, friction_by_matching, friction_by_regressor
from palpate.identification.order import Candidate, OrderTable, select_order
from palpate.identification.parameters import ParameterFit, estimate_parameters, summary_rows
from palpate.identification.recording import Recording
from palpate.identification.residuals import Independence, Whiteness, independence, whiteness
from palpate.identification.servo import JointServo
from palpate.identification.simulated_experiment import Noise, default_excitation, default_sway, simulate_experiment
from palpate.identification.study import identify_recording
from palpate.identification.weak_form import TestFunctions

__all__ = [
    "ArxModel",
    "Candidate",
    "Excitation",
    "Fit",
    "FrictionFit",
    "Independence",
    "JointServo",
    "Noise",
    "OrderTable",
    "Parameter",
    "ParameterFit",
    "Recording",
    "TestFunctions",
    "Whiteness",
    "arx",
    "base_parameters",
    "base_values",
    "chirp",
    "crest_factor",
    "default_excitation",
    "default_sway",
    "estimate_parameters",
    "friction_by_matching",
    "friction_by_regressor",
    "identify_recording",
    "independence",
    "multisine",
    "prbs",
    "select_order",
    "simulate_experiment",
    "summary_rows",
    "true_values",
    "whiteness",
    "with_base_values",
]
