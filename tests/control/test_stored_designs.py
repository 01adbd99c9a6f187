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
    "workspace of a slider": lambda: designed(workspace(SLIDER, T, operator_mass=0.1).linearized([0.0])),
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
        22.337152,
        19.756434,
        17.110927,
        18.808206,
        18.418554,
        9.946885,
        20.890093,
        19.704378,
        10.181763,
        9.142017,
        15.501893,
        15.802532,
        15.564258,
        0.0,
    ],
    "lead-lag, coupled": [
        15.160365,
        14.750036,
        4.775194,
        17.40218,
        12.902693,
        9.946885,
        20.896181,
        19.797569,
        12.196666,
        15.525551,
        15.430457,
        15.55923,
        15.132812,
        0.0,
    ],
    "lead-lag of a slider": [
        16.093459,
        11.572506,
        9.300996,
        14.621768,
        8.786224,
        9.946885,
        20.203034,
        19.509887,
        8.795469,
        15.525551,
        14.989083,
        0.0,
    ],
    "lead-lag of a direct path": [
        15.525547,
        14.345706,
        10.382855,
        15.084591,
        17.364845,
        11.33318,
        18.698957,
        19.104422,
        8.795469,
        15.905183,
        15.458573,
        15.328093,
        15.05611,
        0.0,
    ],
    "LQG": [
        23.04711,
        24.123814,
        18.147537,
        16.961265,
        22.183752,
        11.33318,
        17.547788,
        17.191113,
        14.04123,
        19.157226,
        23.33456,
        16.998028,
        0.0,
    ],
    "LQG by default": [
        32.994018,
        22.442905,
        25.870993,
        12.705487,
        12.300467,
        9.946885,
        17.547788,
        18.240935,
        13.124939,
        19.627229,
        25.975844,
        22.480592,
        0.0,
    ],
    "LQG without integrators": [
        10.141996,
        23.133809,
        10.572117,
        15.397711,
        19.46033,
        11.33318,
        0.0,
        18.240935,
        13.124939,
        17.852042,
        17.131559,
        0.0,
    ],
    "LQG of the state": [
        24.495221,
        21.715825,
        22.375433,
        14.077297,
        23.017194,
        11.33318,
        17.547788,
        18.240935,
        13.124939,
        19.627229,
        23.260511,
        11.607345,
        0.0,
    ],
    "LQG of a slider": [
        17.547168,
        15.808771,
        19.689136,
        16.343427,
        8.299032,
        9.946885,
        17.547788,
        18.240935,
        12.249471,
        18.6464,
        15.676154,
        15.756277,
        0.0,
    ],
    "Kalman": [21.687744, 18.610492, 17.669085],
    "workspace": [
        55.233726,
        34.720122,
        41.399385,
        19.241092,
        25.517777,
        9.946885,
        22.846105,
        17.442427,
        19.339547,
        14.552056,
        23.069249,
        17.547788,
        17.385269,
        22.61098,
        0.0,
        0.0,
        28.054939,
        23.372618,
        19.838045,
        22.61098,
    ],
    "workspace, options": [
        23.972637,
        18.738858,
        20.571439,
        16.302741,
        24.260319,
        18.856641,
        18.605327,
        22.505619,
        18.962001,
        15.966269,
        28.923403,
        24.406397,
        19.316202,
        54.593186,
        34.185333,
        40.512761,
        18.458459,
        24.492635,
        9.946885,
        22.558423,
        17.324644,
        19.157226,
        14.888528,
        22.846105,
        17.442427,
        17.191113,
        22.505619,
        17.547788,
        14.552056,
        27.50919,
        22.992183,
        19.316202,
        22.505619,
    ],
    "workspace near a singular pose": [
        55.259203,
        34.76373,
        42.623966,
        20.101102,
        24.43243,
        9.946885,
        22.846105,
        17.442427,
        19.339547,
        14.552056,
        23.069249,
        17.547788,
        17.385269,
        22.630974,
        0.0,
        14.552056,
        28.054939,
        23.372618,
        19.838045,
        22.630974,
    ],
    "workspace of a slider": [
        22.898216,
        20.727745,
        22.069309,
        17.992145,
        7.973703,
        9.946885,
        22.846105,
        17.442427,
        19.339547,
        14.552056,
        23.069249,
        17.547788,
        17.385269,
        22.61098,
        0.0,
        15.245203,
        28.054939,
        23.372618,
        19.838045,
        22.61098,
    ],
    "H-infinity": [19.413869, 7.107686, 9.00854, 8.091748, 8.459851],
    "robustness": [16.161066, 15.620254],
    "robustness of a slider": [16.507689],
    "gap margins": [15.873983, 17.264598],
    "margins of lead-lag": [28.494873, 7.664272, 1769.775032, 10.250919],
    "margins of LQG": [27.987005, 14.723454, 1761.336334, 8.365219],
    "margins at the command": [27.929652],
    "critical gain": [14.149152, 0.0, 20.36376],
    "closed loop": [18.244131, 11.947271, 16.12561, 36.656892, 22.143788, 30.769283, 14.715733],
}


@pytest.mark.parametrize("case", CASES)
def test_a_result_is_the_stored_one_in_every_number(case: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [fingerprint(one) for one in CASES[case]()]
    assert found == pytest.approx(STORED[case], abs=2e-5)
