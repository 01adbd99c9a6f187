"""Whole results of the designs for plants without symmetry, against stored values.

Each value is a `fingerprint` of every number of a result. The laws that the results obey are in the other files.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from dataclasses import astuple
from typing import Any

import control
import numpy as np
import pytest
from fingerprint import fingerprint
from palpate import devices
from palpate.control import (
    Controller,
    closed_loop,
    gap_margin,
    h_infinity,
    lead_lag,
    loop_gain,
    loop_margins,
    lqg,
    margins,
    optimal_gap_margin,
    robustness,
    workspace,
)
from palpate.control.h_infinity_design import bilinear, lower_feedback
from palpate.control.kalman_filter import kalman
from palpate.control.stability_margins import (
    _at_level,
    _grid,
    _unit_crossings,
    critical_gain,
    frequency_response,
    gain_interval,
    peak_gain,
)
from palpate.linear import rendering_plant

T = 5e-4
POSE = np.array([0.3, 2.2305, 3.2776])
ARM = devices.load("phantom-premium-1.5a").with_viscous([2e-3, 1e-3, 3e-3])
SLIDER = devices.load("slider")
SOFT = rendering_plant(ARM, POSE, stiffness=[1000.0, 1300.0, 800.0], period=T)
ONE = rendering_plant(SLIDER, [0.0], stiffness=1000.0, period=T)
DIRECT = control.StateSpace(
    [[0.9, 0.1, 0.0, 0.02], [-0.2, 0.85, 0.1, 0.0], [0.0, -0.1, 0.95, 0.05], [0.1, 0.0, -0.1, 0.8]],
    [[0.1, 0.02, 0.0], [0.0, 0.3, 0.05], [0.02, 0.0, 0.2], [0.1, 0.1, 0.1]],
    [[1.0, 0.1, 0.0, 0.3], [0.0, 0.8, 0.1, 0.1], [0.2, 0.0, 1.2, 0.0]],
    [[0.02, 0.01, 0.0], [0.0, 0.03, 0.01], [0.01, 0.0, 0.05]],
    2e-3,
)


def parts(system: control.StateSpace) -> list[Any]:
    return [system.A, system.B, system.C, system.D]


def responses(system: control.StateSpace) -> Any:
    return np.array([frequency_response(system, t) for t in (0.01, 0.1, 0.7, 2.0, 3.1)])


def designed(controller: Controller) -> list[Any]:
    back = controller.antiwindup
    found = [*parts(controller.system), np.zeros(0) if back is None else back, controller.period]
    for name, value in controller.notes.items():
        if name.endswith("poles"):
            found.append(np.sort(np.abs(value)))
        elif name == "compensators":
            found += [np.array([c["gain"], *(c["lead"] or ()), *(c["lag"] or ())]) for c in value.values()]
        elif value is not None:
            found.append(np.asarray(value, dtype=float))
    return [*found, np.asarray(controller.design_stiffness or 0.0)]


@functools.cache
def regulator() -> Controller:
    return lqg(DIRECT, force_weight=0.7, speed_weight=0.03, integral_rate=5.0, disturbance=[1.0, 2.0, 0.5], noise=0.2)


@functools.cache
def leads() -> Controller:
    return lead_lag(SOFT, crossover=[150.0, 180.0, 220.0], phase_margin=[50.0, 60.0, 55.0], steady_error=0.004)


def synthesis() -> list[Any]:
    draw = np.random.default_rng(5)
    d = np.array([[0.1, 0.2, 0.0, 0.0], [0.0, 0.1, 1.0, 0.2], [0.05, 0.0, 0.1, 0.8], [0.3, 1.1, 0.05, 0.02]])
    plant = control.StateSpace(
        np.diag([1.1, 0.6, -0.4]) + 0.1 * draw.normal(size=(3, 3)), draw.normal(size=(3, 4)), draw.normal(size=(4, 3)),
        d, 0.01,
    )  # fmt: skip
    found = h_infinity(plant, 1, 2)
    closed = lower_feedback(plant, found.controller)
    loop = bilinear(*(np.asarray(p) for p in parts(plant)))
    back = bilinear(*loop, back=True)
    for one, other in zip(back, parts(plant), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)
    assert peak_gain(closed)[0] == pytest.approx(found.level, rel=1e-5)
    return [found.level, *loop]


def margin_values(loop: control.StateSpace) -> list[Any]:
    crossings = np.array(sorted(_unit_crossings(loop)))
    return [np.array(astuple(loop_margins(loop))), crossings, _grid(loop), np.array(gain_interval(loop))]


def near_singular() -> Controller:
    return workspace(ARM, T, stiffness=[900.0, 1000.0, 1200.0], operator_mass=0.05).linearized([0.2, 2.0, 3.4])


def unsigned(controller: Controller) -> list[Any]:
    """The response and the sizes of the entries: the direction of a state is that of a singular vector."""
    return [responses(controller.system), *(np.abs(one) for one in parts(controller.system)), controller.period]


def peaks() -> list[Any]:
    closed = closed_loop(regulator(), DIRECT)
    peak, where = peak_gain(closed)
    return [peak, where, np.sort(_at_level(closed, 0.9 * peak)), *parts(closed)]


def options() -> Any:
    law = workspace(
        ARM, "0.5 ms", bandwidth=150.0, damping=0.8, observer=5.0, disturbance=0.07, reference=200.0,
        reference_damping=0.9, share=0.7, stiffness="0.9 N/mm", normal_only=True, operator_mass="50 g",
    )  # fmt: skip
    return [np.ravel(np.asarray(v, float)) for v in law.notes.values()] + designed(law.linearized(POSE))


CASES: dict[str, Callable[[], list[Any]]] = {
    "lead-lag": lambda: designed(leads()),
    "lead-lag, coupled": lambda: designed(lead_lag(SOFT, decouple=False, smooth_reference=False, steady_error=0.03)),
    "lead-lag of a slider": lambda: designed(lead_lag(ONE, crossover=90.0, phase_margin=45.0)),
    "lead-lag of a direct path": lambda: designed(lead_lag(DIRECT, crossover=20.0, phase_margin=30.0)),
    "LQG": lambda: designed(regulator()),
    "LQG by default": lambda: designed(lqg(SOFT)),
    "LQG without integrators": lambda: designed(lqg(DIRECT, integrators=False, noise=[0.1, 0.2, 0.3])),
    "LQG of the state": lambda: designed(
        lqg(DIRECT, state_weight=np.diag(np.arange(1.0, 8.0)) + np.eye(7, k=2), disturbance=np.diag([1, 2, 3, 4.0]))
    ),
    "LQG of a slider": lambda: designed(lqg(ONE, windup_time="20 ms", speed_weight="5 ms", integral_rate=3.0)),
    "Kalman": lambda: [(k := kalman(DIRECT, 0.3, [0.1, 0.2, 0.3])).gain, k.covariance, np.sort(np.abs(k.poles))],
    "workspace": lambda: designed(workspace(ARM, T).linearized(POSE)),
    "workspace, options": options,
    "workspace near a singular pose": lambda: designed(near_singular()),
    "workspace of a slider": lambda: unsigned(workspace(SLIDER, T, operator_mass=0.1).linearized([0.0])),
    "H-infinity": synthesis,
    "robustness": lambda: [np.array(astuple(r := robustness(leads(), SOFT))), r.share],
    "robustness of a slider": lambda: [np.array(astuple(robustness(lead_lag(ONE), ONE, 150.0)))],
    "gap margins": lambda: [gap_margin(DIRECT, regulator().feedback), optimal_gap_margin(DIRECT)],
    "margins of lead-lag": lambda: margin_values(loop_gain(leads(), SOFT)),
    "margins of LQG": lambda: margin_values(loop_gain(regulator(), DIRECT, "object_force")),
    "margins at the command": lambda: [np.array(astuple(margins(regulator(), DIRECT)))],
    "critical gain": lambda: [
        critical_gain(500.0 * loop_gain(leads(), SOFT)),
        *gain_interval(loop_gain(leads(), SOFT)),
    ],
    "closed loop": peaks,
}
STORED: dict[str, list[float]] = {
    "lead-lag": [
        38.29299,
        22.698228,
        15.666347,
        22.795654,
        39.683502,
        9.946885,
        29.128464,
        28.025887,
        18.571493,
        8.258356,
        23.763301,
        24.052307,
        23.8759,
        0.0,
    ],
    "lead-lag, coupled": [
        27.329751,
        15.636414,
        -7.373635,
        18.282848,
        25.055995,
        9.946885,
        29.285911,
        28.187298,
        20.586396,
        27.699066,
        23.636833,
        23.859713,
        23.121503,
        0.0,
    ],
    "lead-lag of a slider": [
        25.912684,
        11.507007,
        11.444099,
        14.14444,
        12.435047,
        9.946885,
        28.592763,
        27.899616,
        17.185199,
        27.699066,
        22.869417,
        0.0,
    ],
    "lead-lag of a direct path": [
        27.699062,
        15.274742,
        20.955685,
        15.57623,
        33.746318,
        11.33318,
        27.088686,
        27.494151,
        17.185199,
        26.478043,
        23.669208,
        23.443211,
        22.972123,
        0.0,
    ],
    "LQG": [
        29.186666,
        45.683299,
        21.663052,
        25.573184,
        52.220951,
        11.33318,
        17.547788,
        17.191113,
        14.04123,
        19.157226,
        45.45467,
        28.670485,
        0.0,
    ],
    "LQG by default": [
        20.180519,
        9.87066,
        20.630097,
        -0.345506,
        -0.562224,
        9.946885,
        17.547788,
        18.240935,
        13.124939,
        19.627229,
        52.47972,
        43.13259,
        0.0,
    ],
    "LQG without integrators": [
        4.232927,
        52.610371,
        13.499314,
        17.310158,
        43.813418,
        11.33318,
        0.0,
        18.240935,
        13.124939,
        30.201033,
        28.903045,
        0.0,
    ],
    "LQG of the state": [
        39.323444,
        30.422944,
        42.279681,
        11.059548,
        56.084718,
        11.33318,
        17.547788,
        18.240935,
        13.124939,
        19.627229,
        45.252068,
        17.826215,
        0.0,
    ],
    "LQG of a slider": [
        21.380458,
        21.976238,
        23.201987,
        16.301368,
        14.843222,
        9.946885,
        17.547788,
        18.240935,
        12.249471,
        18.6464,
        24.047165,
        21.298626,
        0.0,
    ],
    "Kalman": [51.532658, 48.790843, 29.966698],
    "workspace": [
        51.460901,
        49.259095,
        46.521447,
        22.459297,
        43.92099,
        9.946885,
        22.846105,
        17.442427,
        19.339547,
        14.552056,
        23.069249,
        17.547788,
        17.385269,
        31.000709,
        0.0,
        0.0,
        28.054939,
        23.372618,
        25.171882,
        31.000709,
    ],
    "workspace, options": [
        23.972637,
        18.738858,
        20.571439,
        16.302741,
        24.260319,
        18.856641,
        18.605327,
        30.895349,
        18.962001,
        15.966269,
        28.923403,
        24.406397,
        24.769147,
        51.436463,
        49.101107,
        46.472074,
        21.515198,
        42.869515,
        9.946885,
        22.558423,
        17.324644,
        19.157226,
        14.888528,
        22.846105,
        17.442427,
        17.191113,
        30.895349,
        17.547788,
        14.552056,
        27.50919,
        22.992183,
        24.769147,
        30.895349,
    ],
    "workspace near a singular pose": [
        51.843063,
        48.77862,
        42.814272,
        19.337324,
        42.467387,
        9.946885,
        22.846105,
        17.442427,
        19.339547,
        14.552056,
        23.069249,
        17.547788,
        17.385269,
        30.901871,
        0.0,
        14.552056,
        28.054939,
        23.372618,
        25.171882,
        30.901871,
    ],
    "workspace of a slider": [32.311645, 40.173854, 29.068279, 35.024108, 25.29579, 9.946885],
    "H-infinity": [19.413869, 1.09542, 1.751852, -1.760263, -7.804429],
    "robustness": [20.937565, 15.620254],
    "robustness of a slider": [21.818287],
    "gap margins": [15.873983, 17.264598],
    "margins of lead-lag": [47.867001, 6.415121, 2090.156193, 12.159002],
    "margins of LQG": [47.423137, 21.783859, 2082.513831, 10.273302],
    "margins at the command": [47.24177],
    "critical gain": [14.149152, 0.0, 20.36376],
    "closed loop": [18.244131, 11.947271, 16.12561, 57.137493, 38.642279, 48.124127, 19.81381],
}


@pytest.mark.parametrize("case", CASES)
def test_a_result_is_the_stored_one_in_every_number(case: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [fingerprint(one) for one in CASES[case]()]
    assert found == pytest.approx(STORED[case], abs=2e-5)
