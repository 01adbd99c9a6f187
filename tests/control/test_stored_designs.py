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
        np.float64(38.29299),
        np.float64(22.698228),
        np.float64(15.666347),
        np.float64(22.795654),
        np.float64(39.683502),
        np.float64(9.946885),
        np.float64(29.128464),
        np.float64(28.025887),
        np.float64(18.571493),
        np.float64(8.258356),
        np.float64(23.763301),
        np.float64(24.052307),
        np.float64(23.8759),
        0.0,
    ],
    "lead-lag, coupled": [
        np.float64(27.329751),
        np.float64(15.636414),
        np.float64(-7.373635),
        np.float64(18.282848),
        np.float64(25.055995),
        np.float64(9.946885),
        np.float64(29.285911),
        np.float64(28.187298),
        np.float64(20.586396),
        np.float64(27.699066),
        np.float64(23.636833),
        np.float64(23.859713),
        np.float64(23.121503),
        0.0,
    ],
    "lead-lag of a slider": [
        np.float64(25.912684),
        np.float64(11.507007),
        np.float64(11.444099),
        np.float64(14.14444),
        np.float64(12.435047),
        np.float64(9.946885),
        np.float64(28.592763),
        np.float64(27.899616),
        np.float64(17.185199),
        np.float64(27.699066),
        np.float64(22.869417),
        0.0,
    ],
    "lead-lag of a direct path": [
        np.float64(27.699062),
        np.float64(15.274742),
        np.float64(20.955685),
        np.float64(15.57623),
        np.float64(33.746318),
        np.float64(11.33318),
        np.float64(27.088686),
        np.float64(27.494151),
        np.float64(17.185199),
        np.float64(26.478043),
        np.float64(23.669208),
        np.float64(23.443211),
        np.float64(22.972123),
        0.0,
    ],
    "LQG": [
        np.float64(29.186666),
        np.float64(45.683299),
        np.float64(21.663052),
        np.float64(25.573184),
        np.float64(52.220951),
        np.float64(11.33318),
        np.float64(17.547788),
        np.float64(17.191113),
        np.float64(14.04123),
        np.float64(19.157226),
        np.float64(45.45467),
        np.float64(28.670485),
        0.0,
    ],
    "LQG by default": [
        np.float64(20.180519),
        np.float64(9.87066),
        np.float64(20.630097),
        np.float64(-0.345506),
        np.float64(-0.562224),
        np.float64(9.946885),
        np.float64(17.547788),
        np.float64(18.240935),
        np.float64(13.124939),
        np.float64(19.627229),
        np.float64(52.47972),
        np.float64(43.13259),
        0.0,
    ],
    "LQG without integrators": [
        np.float64(4.232927),
        np.float64(52.610371),
        np.float64(13.499314),
        np.float64(17.310158),
        np.float64(43.813418),
        np.float64(11.33318),
        0.0,
        np.float64(18.240935),
        np.float64(13.124939),
        np.float64(30.201033),
        np.float64(28.903045),
        0.0,
    ],
    "LQG of the state": [
        np.float64(39.323444),
        np.float64(30.422944),
        np.float64(42.279681),
        np.float64(11.059548),
        np.float64(56.084718),
        np.float64(11.33318),
        np.float64(17.547788),
        np.float64(18.240935),
        np.float64(13.124939),
        np.float64(19.627229),
        np.float64(45.252068),
        np.float64(17.826215),
        0.0,
    ],
    "LQG of a slider": [
        np.float64(21.380458),
        np.float64(21.976238),
        np.float64(23.201987),
        np.float64(16.301368),
        np.float64(14.843222),
        np.float64(9.946885),
        np.float64(17.547788),
        np.float64(18.240935),
        np.float64(12.249471),
        np.float64(18.6464),
        np.float64(24.047165),
        np.float64(21.298626),
        0.0,
    ],
    "Kalman": [np.float64(51.532658), np.float64(48.790843), np.float64(29.966698)],
    "workspace": [
        np.float64(51.460901),
        np.float64(49.259095),
        np.float64(46.521447),
        np.float64(22.459297),
        np.float64(43.92099),
        np.float64(9.946885),
        np.float64(22.846105),
        np.float64(17.442427),
        np.float64(19.339547),
        np.float64(14.552056),
        np.float64(23.069249),
        np.float64(17.547788),
        np.float64(17.385269),
        np.float64(31.000709),
        0.0,
        0.0,
        np.float64(28.054939),
        np.float64(23.372618),
        np.float64(25.171882),
        np.float64(31.000709),
    ],
    "workspace, options": [
        np.float64(23.972637),
        np.float64(18.738858),
        np.float64(20.571439),
        np.float64(16.302741),
        np.float64(24.260319),
        np.float64(18.856641),
        np.float64(18.605327),
        np.float64(30.895349),
        np.float64(18.962001),
        np.float64(15.966269),
        np.float64(28.923403),
        np.float64(24.406397),
        np.float64(24.769147),
        np.float64(51.436463),
        np.float64(49.101107),
        np.float64(46.472074),
        np.float64(21.515198),
        np.float64(42.869515),
        np.float64(9.946885),
        np.float64(22.558423),
        np.float64(17.324644),
        np.float64(19.157226),
        np.float64(14.888528),
        np.float64(22.846105),
        np.float64(17.442427),
        np.float64(17.191113),
        np.float64(30.895349),
        np.float64(17.547788),
        np.float64(14.552056),
        np.float64(27.50919),
        np.float64(22.992183),
        np.float64(24.769147),
        np.float64(30.895349),
    ],
    "workspace near a singular pose": [
        np.float64(51.843063),
        np.float64(48.77862),
        np.float64(42.814272),
        np.float64(19.337324),
        np.float64(42.467387),
        np.float64(9.946885),
        np.float64(22.846105),
        np.float64(17.442427),
        np.float64(19.339547),
        np.float64(14.552056),
        np.float64(23.069249),
        np.float64(17.547788),
        np.float64(17.385269),
        np.float64(30.901871),
        0.0,
        np.float64(14.552056),
        np.float64(28.054939),
        np.float64(23.372618),
        np.float64(25.171882),
        np.float64(30.901871),
    ],
    "workspace of a slider": [
        np.float64(32.311645),
        np.float64(40.173854),
        np.float64(29.068279),
        np.float64(35.024108),
        np.float64(25.29579),
        np.float64(9.946885),
    ],
    "H-infinity": [
        np.float64(19.413869),
        np.float64(1.09542),
        np.float64(1.751852),
        np.float64(-1.760263),
        np.float64(-7.804429),
    ],
    "robustness": [np.float64(20.937565), np.float64(15.620254)],
    "robustness of a slider": [np.float64(21.818287)],
    "gap margins": [np.float64(15.873983), np.float64(17.264598)],
    "margins of lead-lag": [
        np.float64(47.867001),
        np.float64(6.415121),
        np.float64(2090.156193),
        np.float64(12.159002),
    ],
    "margins of LQG": [np.float64(47.423137), np.float64(21.783859), np.float64(2082.513831), np.float64(10.273302)],
    "margins at the command": [np.float64(47.24177)],
    "critical gain": [np.float64(14.149152), 0.0, np.float64(20.36376)],
    "closed loop": [
        np.float64(18.244131),
        np.float64(11.947271),
        np.float64(16.12561),
        np.float64(57.137493),
        np.float64(38.642279),
        np.float64(48.124127),
        np.float64(19.81381),
    ],
}


@pytest.mark.parametrize("case", CASES)
def test_a_result_is_the_stored_one_in_every_number(case: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found = [fingerprint(one) for one in CASES[case]()]
    assert found == pytest.approx(STORED[case], abs=2e-5)
