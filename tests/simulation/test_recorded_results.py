"""Runs and loops drawn at random are measured and judged as recorded: every number and every sentence."""

from __future__ import annotations

import re
import zlib
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.decision import Evidence, ahead, chatters, decide, generates, growth, slips
from palpate.simulation.energy_balance import energy_balance
from palpate.simulation.evidence import evidence, interruption, lossy, resolution
from palpate.simulation.friction_hold import friction_of
from palpate.simulation.judgment import _explained, judge, judge_pushed
from palpate.simulation.linear_evidence import LinearRadii
from palpate.simulation.outcome_rows import excursions, name_rows, outcome_of
from palpate.simulation.statics import expected_deflection
from palpate.simulation.step_response import step_response
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.simulation.windows import Window
from stored import assert_same, plain

PERIOD = 1e-3


# Values of each measure: those of its thresholds, of rest, and some on either side.
CHOICES: dict[str, list[Any]] = {
    "unstable_from": [np.nan, np.nan, np.nan, np.nan, np.nan, np.nan, 0.3],
    "early": [1e-6, 1e-14, 1e-8, 2e-5, 0.5e-6, 1e-7],
    "prior": [1e-8, 1e-14, 0.9e-14, 1e-6, 1e-7, 2e-5, 1e-10],
    "late": [1e-10, 1e-14, 1.1e-14, 1.02e-6, 0.9e-6, 0.95e-6, 1.5e-6, 2e-5, 1e-6, 3e-11, 1e-8],
    "ripple": [1e-7, 5e-5, 1.25e-5, 1.02e-6, 2e-5, 3e-8, 1e-4, 3e-6, 4.9e-5],
    "ripple_before": [1e-6, 7.5e-5, np.nan, 1e-5, 2e-5, 1e-4],
    "swing": [1e-8, 1e-5, 1e-7, 1e-6, 2e-5, 5e-7, 1.5e-5, 1e-9],
    "swing_before": [1e-7, 1e-5, 2e-5, np.nan, 1e-6],
    "shift": [np.nan, 1e-9, 2e-5, 1e-6, 5e-5, 1e-4, 3e-6],
    "shift_ratio": [np.nan, 1.0, 0.5, 0.94, 0.97, 1.5, 0.2],
    "shift_fifths": [1, 2],
    "deflection": [1e-3, 1e-4, 0.0, 2e-2],
    "error": [np.nan, 0.05, -0.05, 0.051, -0.06, 0.01],
    "drift": [np.nan, 0.05, 0.06, 0.0],
    "creep": [0.0, 5e-5, 6e-5],
    "touching": [1.0, 0.0, 0.5, 0.4],
    "contacts": [0, 1, 3, 4],
    "apart": [0.0, 0.05, 0.06],
    "saturated": [0.0, 0.01, 0.02],
    "pressed": [False, True],
    "beyond": [False, False, True],
    "constant": [True, True, False],
    "resolution": [0.0, 1e-6, 1e-4, 2e-5, 3e-5],
    "linear": [1, 0, -1],
    "decay": [1e-4, 0.1, 0.09, 0.7, 0.95, 1.0, np.nan, 0.0016, 0.999],
    "kept": [np.nan, 0.3, 0.31, 0.9, 0.91, 0.1, 0.72],
    "local": [False, True],
    "fluctuation": [np.nan, 0.15, 0.2],
    "traction": [np.nan, 0.4, 0.5],
    "release": [np.nan, 2e-4, 5e-5, np.inf],
    "lossy": [False, True],
    "generated": [np.nan, 0.01, 0.02, 0.1],
    "generated_before": [np.nan, 0.01, 0.1, 0.11],
}


def drawn(change: float, seed: int, count: int = 20000, **always: Any) -> Evidence:
    """Return the evidence of loops at rest in which each measure has another value with a probability."""
    rng = np.random.default_rng(seed)
    values = {}
    for name, choices in CHOICES.items():
        other = np.array(choices)[rng.integers(len(choices), size=count)]
        values[name] = np.where(rng.random(count) < change, other, always.get(name, choices[0]))
    values["trend"] = np.maximum(values["ripple"] - values["swing"], 0.0)
    values["trend_before"] = values["ripple_before"] - values["swing_before"]
    return Evidence.of(count, **values)


def decided(change: float, seed: int, **always: Any) -> dict[str, Any]:
    """Return how many loops have each state, and sums over all loops that change with the result of any of them."""
    e = drawn(change, seed, **always)
    weight = 1.0 + np.arange(len(e.late)) % 97
    left = np.nan_to_num(np.clip(ahead(e), -1.0, 1.0), nan=0.5)
    grown = np.nan_to_num(np.minimum(growth(e.unstable_from, e.early, e.prior, e.late), 1e3), nan=0.5)
    return {
        "states": np.bincount(decide(e), minlength=8),
        "weighted": weight @ decide(e),
        "ahead": weight @ np.log1p(1e7 * np.abs(left)),
        "growth": weight @ np.log1p(grown),
        "others": [weight @ rule(e) for rule in (generates, chatters, slips)],
    }


STEADY = {"early": 1e-6, "prior": 1e-6, "late": 1e-6, "swing": 2e-5, "swing_before": 2e-5, "ripple": 2e-5}
SHAKEN = {"resolution": 1e-4, "fluctuation": 0.2, "traction": 0.5, "release": 2e-4, "linear": 0}


def wave(n: int, seed: int, columns: int = 3, size: float = 1.0) -> np.ndarray:
    """Return a smooth signal (n, columns): four oscillations of random frequency, decay and phase."""
    rng = np.random.default_rng(seed)
    x = np.linspace(0.0, 1.0, n)[:, None]
    found = np.zeros((n, columns))
    for _ in range(4):
        f, decay, phase, amplitude = (rng.uniform(*ends, columns) for ends in ((2, 60), (0, 3), (0, 6), (0, 1)))
        found += amplitude * np.exp(-decay * x) * np.sin(2 * np.pi * f * x + phase)
    return size * found


HAND = {
    "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m", "force": ["0 N", "0.2 N", "-1 N"],
    "tissue_stiffness": "900 N/m", "tissue_damping": "2 N*s/m",
}  # fmt: skip
GRIP = {key: value for key, value in HAND.items() if not key.startswith("tissue")}
SPRING = {"kind": "spring", "stiffness": ["900 N/m", "700 N/m", "600 N/m"]}
WALL = {"kind": "wall", "stiffness": "800 N/m", "normal": [0.0, 0.6, 0.8]}
MESH = {
    "kind": "mesh",
    "position": ["0.5 mm", "0.3 mm", "-0.5 mm"],
    "mesh": {"shape": "box", "edge": "80 mm", "divisions": 2},
    "surface": {"stiffness": "800 N/m", "static_friction": 0.3, "dynamic_friction": 0.2},
}
SCENE = {"wall": {**WALL, "position": ["0 mm", "0 mm", "-1 mm"]}, "cube": MESH}


def tables(topology: str = "impedance_display", **other: Any) -> dict[str, Any]:
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0.1 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": topology},
        "run": {"duration": "0.6 s"},
        **other,
    }


SCENARIOS: dict[str, dict[str, Any]] = {
    "tracking": tables(
        "force_tracking", object=SPRING, reference={"shape": "step", "force": ["1 N", "0 N", "-2 N"]},
        device={"name": "phantom-premium-1.5a", "encoder": True, "saturation": True}, controller={"kind": "none"},
    ),
    "hand": tables(object=WALL, operator=HAND),
    "grip": tables(object=WALL, operator=GRIP),
    "mesh": tables(object=MESH, operator=HAND, device={"name": "phantom-premium-1.5a", "encoder": True}),
    "scene": tables(objects=SCENE, operator=GRIP),
    "slider": {
        "device": {"name": "slider"},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "80 N/m"},
        "run": {"duration": "0.6 s"},
    },
}  # fmt: skip


def run(name: str, seed: int, factor: float, bounce: bool = False, **other: Any) -> Trace:
    """Return a run of a scenario made of smooth signals, whose last part moves by a factor more."""
    scenario = Scenario.from_dict(SCENARIOS[name])
    n, dof = 601, scenario.load_device().dof
    later = np.where(np.arange(n) > 360, factor, 1.0)[:, None]
    contact = np.ones(n)
    contact[:40] = contact[55:60] = 0.0
    if bounce:
        contact[70:90] = contact[300:340] = contact[500:505] = contact[530:534] = contact[590:] = 0.0
    force = wave(n, seed + 1, size=0.01) + np.array([0.3, 0.4, -1.0])
    limited = np.zeros(n)
    limited[520:523] = 1.0
    start = np.array([0.0] if dof == 1 else [0.1, 2.2305, 3.2776])
    values = {
        "angle": start + wave(n, seed + 2, dof, 0.01),
        "velocity": wave(n, seed + 3, dof, 0.1),
        "tip": wave(n, seed, size=2e-4) * later + np.array([0.1, 0.2, 0.3]) + np.linspace(0, 1e-4, n)[:, None],
        "deflection": wave(n, seed + 4, size=1e-5) * later + np.array([1e-3, 2e-4, -2e-3]),
        "object_force": force * contact[:, None],
        "command_force": -force + wave(n, seed + 5, size=0.003),
        "motor_force": -force + wave(n, seed + 6, size=0.003),
        "torque": wave(n, seed + 7, dof, 0.02),
        "reference_force": np.tile([1.0, 0.0, -2.0] if name == "tracking" else [0.0] * 3, (n, 1)),
        "operator_force": wave(n, seed + 8, size=0.05) + np.array([0.1, 0.2, -1.0]),
        "touching": contact,
        "saturated": limited,
        **other,
    }
    return Trace.of(PERIOD * np.arange(n), values, metadata={"scenario": scenario.to_dict()})


def values_of(e: Evidence) -> dict[str, Any]:
    """Return the evidence of one loop by name."""
    return {name: value[0] for name, value in vars(e).items()}


def measured(name: str, seed: int, factor: float, bounce: bool = False) -> dict[str, Any]:
    """Return all that is measured of a run, in two windows."""
    trace, scenario = run(name, seed, factor, bounce), Scenario.from_dict(SCENARIOS[name])
    device = scenario.load_device()
    balance = energy_balance(trace, scenario, Window(101, 600))
    return {
        "whole": values_of(evidence(trace, scenario, Window(100, 600), 0.98)),
        "part": values_of(evidence(trace, scenario, Window(31, 488), 1.002, 0.4)),
        "short": values_of(evidence(trace, None, Window(560, 600), None)),
        "balance": None if balance is None else {**vars(balance), "relative": balance.relative},
        "resolution": resolution(scenario, device, trace["angle"][::200]),
        "lossy": lossy(scenario, device),
        "friction": friction_of(scenario),
        "interruption": interruption(trace, scenario),
        "expected": expected_deflection(scenario),
        "outcome": outcome_of(trace, PERIOD, Window(102, 600)),
    }


def verdicts(name: str, seed: int, factor: float, bounce: bool = False) -> list[Any]:
    """Return the verdicts on a run, alone and beside linear loops, as it is and after a push."""
    trace = run(name, seed, factor, bounce, saturated=np.zeros(601))
    radii = (np.nan, 0.9, 0.995, 1.01)
    return [judge(trace, radius).to_dict() for radius in radii] + [judge_pushed(trace, 200, 0.2, 0.99).to_dict()]


def sentences(name: str, seed: int, **always: Any) -> dict[str, Any]:
    """Return how many random loops have each kind of reason, and sums over all."""
    trace, scenario, e = run(name, seed, 0.1), Scenario.from_dict(SCENARIOS[name]), drawn(0.1, seed, 200, **always)
    radii = (None, LinearRadii(0.99, None), LinearRadii(1.01, 0.99), LinearRadii(0.9, 1.02))
    found = []
    for number, state in enumerate(decide(e)):
        one = replace(e, **{key: value[number : number + 1] for key, value in vars(e).items()})
        window, linear = Window(100, 600 - number % 7), radii[number % 4]
        found.append(_explained(trace, scenario, window, one, State(int(state)), linear).to_dict())
    kinds = Counter(re.sub(r"[\d.]+(e-\d+)?", "#", one["reason"])[:50] for one in found)
    texts = "".join(one["reason"] for one in found)
    numbers = [sum(one[key] or 0.0 for one in found) for key in ("since", "amplitude", "frequency")]
    axes = Counter(str(one["axis"]) for one in found)
    return {
        "kinds": dict(sorted(kinds.items())),
        "sum": zlib.crc32(texts.encode()),
        "axes": [axes[key] for key in ("x", "y", "z", "None")],
        "numbers": numbers,
    }


def responses() -> list[Any]:
    """Return the metrics of the step responses of oscillators."""
    t = np.linspace(0.0, 1.0, 401)
    found = []
    for rate, frequency, level, start, expected, band in (
        (8.0, 12.0, 1.0, 0.0, None, 0.05), (4.0, 30.0, -2.0, 0.2, -1.9, 0.02), (0.5, 40.0, 0.3, 0.1, 0.3, 0.1),
        (-1.0, 25.0, 0.5, 0.0, 0.0, 0.05), (12.0, 9.0, 0.0, 0.0, 1.0, 0.05), (30.0, 0.1, 1.0, 0.3, 1.1, 0.05),
    ):  # fmt: skip
        after = np.maximum(t - start, 0.0)
        y = level * (1.0 - np.exp(-rate * after) * np.cos(2 * np.pi * frequency * after))
        y = y + (1e-3 if level else 1.0) * np.exp(-rate * after) * np.sin(2 * np.pi * frequency * after)
        found.append(vars(step_response(t, y, start=start, expected=expected, band=band)))
    return found


MEASURES: dict[str, Any] = {
    "loops at rest with one change or two": lambda: decided(0.05, 1),
    "loops at rest with many changes": lambda: decided(0.15, 2),
    "loops at rest without a linear loop": lambda: decided(0.06, 3, linear=0),
    "loops that oscillate": lambda: decided(0.06, 4, **STEADY),
    "loops that oscillate without a linear loop": lambda: decided(0.06, 5, **STEADY, linear=0),
    "contacts with friction that counts shake": lambda: decided(0.06, 6, **SHAKEN),
    "a tip that drifts": lambda: decided(0.06, 7, shift=2e-5, shift_ratio=0.94, decay=0.95, resolution=3e-5),
    "displays that generate energy": lambda: decided(
        0.06, 8, linear=0, swing=2e-6, generated=0.02, generated_before=0.01, resolution=1e-6
    ),
    "a run under a tracked force": lambda: measured("tracking", 10, 1.3),
    "a run of a hand on a wall": lambda: measured("hand", 20, 0.5),
    "a run of a gripping hand that bounces": lambda: measured("grip", 30, 0.2, True),
    "a run on a mesh": lambda: measured("mesh", 40, 0.1),
    "a run in a scene": lambda: measured("scene", 50, 1.0, True),
    "a run of a slider": lambda: measured("slider", 60, 0.7),
    "verdicts on a tracked force": lambda: verdicts("tracking", 10, 1.3),
    "verdicts on a hand": lambda: verdicts("hand", 20, 0.1),
    "verdicts on a hand that bounces": lambda: verdicts("grip", 30, 0.05, True),
    "verdicts on a mesh": lambda: verdicts("mesh", 40, 0.01),
    "verdicts on a scene": lambda: verdicts("scene", 50, 0.002, True),
    "verdicts on a slider": lambda: verdicts("slider", 60, 0.001),
    "reasons at rest": lambda: sentences("hand", 70),
    "reasons at rest without a linear loop": lambda: sentences("tracking", 71, linear=0),
    "reasons of oscillations": lambda: sentences("slider", 72, **STEADY, linear=0),
    "reasons of drifts": lambda: sentences("mesh", 73, shift=2e-5, shift_ratio=0.94, decay=0.95, resolution=3e-5),
    "reasons of contacts that slip": lambda: sentences("mesh", 74, **SHAKEN),
    "reasons of displays that generate energy": lambda: sentences(
        "grip", 75, linear=0, swing=2e-6, generated=0.02, generated_before=0.01, resolution=1e-6
    ),
    "reasons of motions to a target": lambda: sentences("hand", 76, linear=0, error=0.06, ripple=3e-5),
    "reasons of a body that creeps": lambda: sentences("grip", 77, linear=0, creep=6e-5, resolution=1e-6),
    "step responses": responses,
}
nan, inf = np.nan, np.inf
# fmt: off
STORED: dict[str, Any] = {
    "loops at rest with one change or two": {"states": [16169, 523, 486, 327, 282, 334, 1879, 0], "weighted": 820730.0,
    "ahead": 544104.387, "growth": 351371.323, "others": [0.0, 190.0, 0.0]},
    "loops at rest with many changes": {"states": [10444, 1253, 1429, 1018, 822, 942, 4092, 0], "weighted": 1933949.0,
    "ahead": 1414797.34, "growth": 895572.703, "others": [132.0, 2809.0, 34.0]},
    "loops at rest without a linear loop": {"states": [15166, 132, 553, 344, 364, 386, 3055, 0], "weighted": 1154824.0,
    "ahead": 906759.706, "growth": 401011.085, "others": [0.0, 461.0, 104.0]},
    "loops that oscillate": {"states": [1610, 15325, 731, 383, 346, 375, 1230, 0], "weighted": 1390482.0, "ahead":
    90036.2495, "growth": 982531.056, "others": [1351.0, 33647.0, 0.0]},
    "loops that oscillate without a linear loop": {"states": [494, 15576, 750, 397, 363, 378, 2042, 0], "weighted":
    1654597.0, "ahead": 359945.195, "growth": 969457.791, "others": [572.0, 32732.0, 0.0]},
    "contacts with friction that counts shake": {"states": [2027, 591, 557, 356, 394, 380, 15695, 0], "weighted":
    4917164.0, "ahead": 753995.779, "growth": 408546.054, "others": [0.0, 293.0, 823624.0]},
    "a tip that drifts": {"states": [1019, 163, 519, 429, 363, 403, 17104, 0], "weighted": 5311741.0, "ahead":
    8040004.87, "growth": 372989.822, "others": [0.0, 7807.0, 51.0]},
    "displays that generate energy": {"states": [2251, 628, 1332, 389, 356, 377, 14667, 0], "weighted": 4695000.0,
    "ahead": 631624.271, "growth": 392502.713, "others": [843347.0, 41851.0, 919.0]},
    "a run under a tracked force": {"whole": {"unstable_from": nan, "early": 7.16922302e-05, "prior": 7.27180199e-05,
    "late": 6.60885563e-05, "ripple": 0.000219184014, "ripple_before": 0.000223279076, "swing": 0.000214955201,
    "swing_before": 0.000212881364,
    "widening": 0.0, "turns": 7.9390493,
    "trend": 4.22881351e-06, "trend_before": 1.03977124e-05, "shift": 2.09390455e-05,
    "shift_ratio": 1.3175572, "shift_fifths": 1, "deflection": 0.00224508084, "error": 0.400079916, "drift":
    0.000554979144, "creep": 0.0, "touching": 1.0, "contacts": 0.0, "apart": 0.0, "saturated": 0.03, "pressed": False,
    "beyond": False, "constant": True, "resolution": 0.000114197448, "linear": 1, "decay": 0.132619556, "kept": nan,
    "local": False, "fluctuation": nan, "traction": nan, "release": nan, "onward": nan, "lossy": True, "generated": nan,
    "generated_before": nan}, "part": {"unstable_from": nan, "early": 8.26626292e-05, "prior": 0.000135585159, "late":
    7.27180199e-05, "ripple": 0.000223279076, "ripple_before": 0.00026291491, "swing": 0.00022535034, "swing_before":
    0.000264179974,
    "widening": 0.0, "turns": 7.57601282,
    "trend": -2.07126337e-06, "trend_before": -1.2650641e-06, "shift": 8.68027487e-06, "shift_ratio":
    0.657802768, "shift_fifths": 1, "deflection": 0.00224506271, "error": 0.399964168, "drift": 0.00175446436, "creep":
    0.0, "touching": 1.0, "contacts": 0.0, "apart": 0.0, "saturated": 0.0, "pressed": False, "beyond": False,
    "constant": True, "resolution": 0.000113883944, "linear": -1, "decay": 1.19939617, "kept": 0.4, "local": False,
    "fluctuation": nan, "traction": nan, "release": nan, "onward": nan, "lossy": True, "generated": nan,
    "generated_before": nan},
    "short": {"unstable_from": nan, "early": 6.00255695e-05, "prior": 5.9229961e-05, "late": 5.48813653e-05, "ripple":
    0.000134786072, "ripple_before": 0.000153208294, "swing": 1.73362889e-05, "swing_before": 4.68654259e-05,
    "widening": 0.0, "turns": 0.748555973,
    "trend":
    0.000117449783, "trend_before": 0.000106342868, "shift": 6.38273802e-05, "shift_ratio": 0.335786077,
    "shift_fifths": 1, "deflection": 0.00224771462, "error": nan, "drift": nan, "creep": 0, "touching": 1.0,
    "contacts": 0.0, "apart": 0, "saturated": 0.0, "pressed": False, "beyond": False, "constant": True, "resolution":
    0, "linear": 0, "decay": nan, "kept": nan, "local": False, "fluctuation": nan, "traction": nan, "release": nan,
    "onward": nan,
    "lossy": False, "generated": nan, "generated_before": nan}, "balance": None, "resolution": [0.000113594932,
    0.000114634065, 0.000113709331, 0.000114197448], "lossy": True, "friction": 0.0, "interruption": 0.0, "expected":
    [0.00111111111, 0.0, -0.00333333333], "outcome": {"unstable_from": nan, "oscillation_2": 7.16922302e-05,
    "oscillation_4": 7.27180199e-05, "oscillation_5": 6.60885563e-05, "ripple": 0.000219184014, "steady_tip":
    [-5.21371041e-05, 0.00014673066, -0.000136248645], "peak_object_force": 1.12473589, "peak_command_force":
    1.12983984, "touching": 0.925124792, "saturated": 0.00499168053, "touching_5": 1.0, "saturated_5": 0.0303030303,
    "contacts_5": 0.0}},
    "a run of a hand on a wall": {"whole": {"unstable_from": nan, "early": 4.05472439e-05, "prior": 1.50779803e-05,
    "late": 1.37201128e-05, "ripple": 8.34652535e-05, "ripple_before": 9.84697471e-05, "swing": 7.1543545e-05,
    "swing_before": 8.30271176e-05, "widening": 0.0, "turns": 4.08932871, "trend": 1.19217085e-05, "trend_before":
    1.54426295e-05, "shift": 2.31586515e-05, "shift_ratio": 0.721689878, "shift_fifths": 1, "deflection":
    0.00224483702, "error": nan, "drift": nan, "creep": 0.0, "touching": 1.0, "contacts": 0.0, "apart": 0.0,
    "saturated": 0.03, "pressed": True, "beyond": False, "constant": True, "resolution": 0.0, "linear": 1, "decay":
    0.132619556, "kept": nan, "local": False, "fluctuation": nan, "traction": nan, "release": nan, "onward": nan,
    "lossy": False, "generated": -0.273154932, "generated_before": -0.910369104}, "part": {"unstable_from": nan,
    "early": 4.45873555e-05, "prior": 8.17512635e-05, "late": 1.50779803e-05, "ripple": 9.84697471e-05,
    "ripple_before": 0.000209453056, "swing": 7.3200614e-05, "swing_before": 0.000210889903, "widening": 0.0, "turns":
    3.90785581, "trend": 2.52691331e-05, "trend_before": -1.43684638e-06, "shift": 3.30190772e-05, "shift_ratio":
    0.780683455, "shift_fifths": 1, "deflection": 0.00224491961, "error": nan, "drift": nan, "creep": 0.0, "touching":
    1.0, "contacts": 0.0, "apart": 0.0, "saturated": 0.0, "pressed": True, "beyond": False, "constant": True,
    "resolution": 0.0, "linear": -1, "decay": 1.19939617, "kept": 0.4, "local": False, "fluctuation": nan, "traction":
    nan, "release": nan, "onward": nan, "lossy": False, "generated": -1.09180318, "generated_before": 0.760572605},
    "short": {"unstable_from": nan, "early": 5.34252867e-06, "prior": 9.50112822e-06, "late": 9.10435459e-06, "ripple":
    3.9872153e-05, "ripple_before": 3.3164056e-05, "swing": 6.43927489e-06, "swing_before": 4.10670384e-06, "widening":
    0.0, "turns": 0.611862707, "trend": 3.34328782e-05, "trend_before": 2.90573522e-05, "shift": 8.11822971e-05,
    "shift_ratio": 0.726870584, "shift_fifths": 2, "deflection": 0.00224629024, "error": nan, "drift": nan, "creep": 0,
    "touching": 1.0, "contacts": 0.0, "apart": 0, "saturated": 0.0, "pressed": False, "beyond": False, "constant":
    True, "resolution": 0, "linear": 0, "decay": nan, "kept": nan, "local": False, "fluctuation": nan, "traction": nan,
    "release": nan, "onward": nan, "lossy": False, "generated": nan, "generated_before": nan}, "balance": {"supplied":
    0.000250973322, "generated": -6.2935716e-05, "generated_before": -0.000202021161, "relative": [-0.250766558,
    -0.804950738]}, "resolution": [0.0, 0.0, 0.0, 0.0], "lossy": False, "friction": 0.0, "interruption": 0.005,
    "expected": [None, None, None], "outcome": {"unstable_from": nan, "oscillation_2": 4.05472439e-05, "oscillation_4":
    1.50779803e-05, "oscillation_5": 1.37201128e-05, "ripple": 8.34652535e-05, "steady_tip": [-4.03368609e-05,
    -0.000108035205, -2.01356109e-05], "peak_object_force": 1.12882893, "peak_command_force": 1.12921494, "touching":
    0.925124792, "saturated": 0.00499168053, "touching_5": 1.0, "saturated_5": 0.0303030303, "contacts_5": 0.0}},
    "a run of a gripping hand that bounces": {"whole": {"unstable_from": nan, "early": 2.71382059e-05, "prior":
    3.43445456e-06, "late": 2.42180593e-06, "ripple": 1.61182561e-05, "ripple_before": 1.86327585e-05, "swing":
    1.118376e-05, "swing_before": 1.5539149e-05, "widening": 0.0, "turns": 2.50432004, "trend": 4.93449612e-06,
    "trend_before": 3.0936095e-06, "shift": 2.82593403e-05, "shift_ratio": 0.704910717, "shift_fifths": 1,
    "deflection": 0.00224530938, "error": nan, "drift": nan, "creep": 0.0, "touching": 0.81, "contacts": 2.0, "apart":
    0.151515152, "saturated": 0.03, "pressed": True, "beyond": False, "constant": True, "resolution": 0.0, "linear": 1,
    "decay": 0.132619556, "kept": nan, "local": False, "fluctuation": nan, "traction": nan, "release": nan, "onward":
    nan, "lossy": False, "generated": -0.141412965, "generated_before": 0.346506653}, "part": {"unstable_from": nan,
    "early": 3.72958594e-05, "prior": 4.32827239e-05, "late": 3.43445456e-06, "ripple": 1.86327585e-05,
    "ripple_before": 9.16953373e-05, "swing": 1.45083738e-05, "swing_before": 7.56024913e-05, "widening": 0.0, "turns":
    2.41399338, "trend": 4.12438469e-06, "trend_before": 1.60928459e-05, "shift": 4.12258233e-05, "shift_ratio":
    1.8714126, "shift_fifths": 1, "deflection": 0.00224467284, "error": nan, "drift": nan, "creep": 0.0, "touching":
    1.0, "contacts": 0.0, "apart": 0.0, "saturated": 0.0, "pressed": True, "beyond": False, "constant": True,
    "resolution": 0.0, "linear": -1, "decay": 1.19939617, "kept": 0.4, "local": False, "fluctuation": nan, "traction":
    nan, "release": nan, "onward": nan, "lossy": False, "generated": 0.054954787, "generated_before": 0.546009089},
    "short": {"unstable_from": nan, "early": 1.51944429e-06, "prior": 1.23406348e-06, "late": 1.41397652e-06, "ripple":
    2.99180207e-06, "ripple_before": 3.13579678e-06, "swing": 7.91366411e-07, "swing_before": 2.57757879e-07,
    "widening": 0.0, "turns": 0.76783346, "trend": 2.20043565e-06, "trend_before": 2.8780389e-06, "shift":
    9.88046884e-06, "shift_ratio": 1.45001472, "shift_fifths": 2, "deflection": 0.00224468448, "error": nan, "drift":
    nan, "creep": 0, "touching": 0.0, "contacts": 0.0, "apart": 0, "saturated": 0.0, "pressed": False, "beyond": False,
    "constant": True, "resolution": 0, "linear": 0, "decay": nan, "kept": nan, "local": False, "fluctuation": nan,
    "traction": nan, "release": nan, "onward": nan, "lossy": False, "generated": nan, "generated_before": nan},
    "balance": {"supplied": 0.000576700706, "generated": -0.000103812536, "generated_before": 0.000238120103,
    "relative": [-0.180011113, 0.412900662]}, "resolution": [0.0, 0.0, 0.0, 0.0], "lossy": False, "friction": 0.0,
    "interruption": 0.0, "expected": [None, None, None], "outcome": {"unstable_from": nan, "oscillation_2":
    2.71382059e-05, "oscillation_4": 3.43445456e-06, "oscillation_5": 2.42180593e-06, "ripple": 1.61182561e-05,
    "steady_tip": [-6.29877599e-05, 0.000182275806, -0.000216824896], "peak_object_force": 1.13312542,
    "peak_command_force": 1.13501718, "touching": 0.792013311, "saturated": 0.00499168053, "touching_5": 0.818181818,
    "saturated_5": 0.0303030303, "contacts_5": 2.0}},
    "a run on a mesh": {"whole": {"unstable_from": nan, "early": 3.98748696e-05, "prior": 3.43905027e-06, "late":
    3.33743484e-06, "ripple": 2.65606779e-05, "ripple_before": 2.35054127e-05, "swing": 1.90504846e-05, "swing_before":
    1.96079318e-05, "widening": 0.0, "turns": 2.22803823, "trend": 7.51019329e-06, "trend_before": 3.89748092e-06,
    "shift": 3.10565351e-05, "shift_ratio": 0.462106697, "shift_fifths": 1, "deflection": 0.00224497228, "error": nan,
    "drift": nan, "creep": 0.0, "touching": 1.0, "contacts": 0.0, "apart": 0.0, "saturated": 0.03, "pressed": True,
    "beyond": False, "constant": True, "resolution": 0.00011399115, "linear": 1, "decay": 0.132619556, "kept": nan,
    "local": True, "fluctuation": nan, "traction": nan, "release": nan, "onward": nan, "lossy": True, "generated":
    -1.50412481, "generated_before": -3.20163541}, "part": {"unstable_from": nan, "early": 4.4037325e-05, "prior":
    0.000173359084, "late": 3.43905027e-06, "ripple": 2.35054127e-05, "ripple_before": 0.000171117934, "swing":
    1.9129116e-05, "swing_before": 0.00017249426, "widening": 0.0, "turns": 1.70000674, "trend": 4.37629673e-06,
    "trend_before": -1.37632556e-06, "shift": 6.92190911e-05, "shift_ratio": 1.02572284, "shift_fifths": 1,
    "deflection": 0.002245005, "error": nan, "drift": nan, "creep": 0.0, "touching": 1.0, "contacts": 0.0, "apart":
    0.0, "saturated": 0.0, "pressed": True, "beyond": False, "constant": True, "resolution": 0.000114135827, "linear":
    -1, "decay": 1.19939617, "kept": 0.4, "local": True, "fluctuation": nan, "traction": nan, "release": nan, "onward":
    nan, "lossy": True, "generated": -2.77603859, "generated_before": 1.05312029}, "short": {"unstable_from": nan,
    "early": 2.81020972e-06, "prior": 3.16763576e-06, "late": 3.33743484e-06, "ripple": 1.53828229e-05,
    "ripple_before": 1.89503401e-05, "swing": 2.15187535e-06, "swing_before": 2.16123508e-06, "widening": 0.0, "turns":
    0.540632072, "trend": 1.32309476e-05, "trend_before": 1.6789105e-05, "shift": 1.37367244e-05, "shift_ratio":
    1.96919997, "shift_fifths": 2, "deflection": 0.00224485159, "error": nan, "drift": nan, "creep": 0, "touching":
    1.0, "contacts": 0.0, "apart": 0, "saturated": 0.0, "pressed": False, "beyond": False, "constant": True,
    "resolution": 0, "linear": 0, "decay": nan, "kept": nan, "local": False, "fluctuation": nan, "traction": nan,
    "release": nan, "onward": nan, "lossy": False, "generated": nan, "generated_before": nan}, "balance": {"supplied":
    0.000339081912, "generated": -0.000496847838, "generated_before": -0.00113794731, "relative": [-1.46527379,
    -3.35596582]}, "resolution": [0.000112727648, 0.000113839773, 0.000114244283, 0.00011399115], "lossy": True,
    "friction": 0.2, "interruption": 0.005, "expected": [None, None, None], "outcome": {"unstable_from": nan,
    "oscillation_2": 3.98748696e-05, "oscillation_4": 3.43905027e-06, "oscillation_5": 3.33743484e-06, "ripple":
    2.65606779e-05, "steady_tip": [2.88614003e-05, -4.10707736e-05, -0.000133091372], "peak_object_force": 1.13246742,
    "peak_command_force": 1.13649524, "touching": 0.925124792, "saturated": 0.00499168053, "touching_5": 1.0,
    "saturated_5": 0.0303030303, "contacts_5": 0.0}},
    "a run in a scene": {"whole": {"unstable_from": nan, "early": 4.7120803e-05, "prior": 3.53813544e-05, "late":
    3.13792913e-05, "ripple": 0.000144081584, "ripple_before": 0.00015822419, "swing": 0.000142495818, "swing_before":
    0.000160783354, "widening": 0.0, "turns": 6.26483385, "trend": 1.5857666e-06, "trend_before": -2.5591645e-06,
    "shift": 2.19290702e-05, "shift_ratio": 1.03874071, "shift_fifths": 1, "deflection": 0.00224499376, "error": nan,
    "drift": nan, "creep": 0.0, "touching": 0.81, "contacts": 2.0, "apart": 0.151515152, "saturated": 0.03, "pressed":
    True, "beyond": False, "constant": True, "resolution": 0.0, "linear": 1, "decay": 0.132619556, "kept": nan,
    "local": True, "fluctuation": nan, "traction": nan, "release": nan, "onward": nan, "lossy": True, "generated":
    -7.34654552, "generated_before": 1.52420716}, "part": {"unstable_from": nan, "early": 5.55515254e-05, "prior":
    3.96316978e-05, "late": 3.53813544e-05, "ripple": 0.000156102345, "ripple_before": 0.000203228976, "swing":
    0.000159839336, "swing_before": 0.00020623262, "widening": 0.0, "turns": 5.53566242, "trend": -3.73699055e-06,
    "trend_before": -3.00364374e-06, "shift": 1.88902386e-05, "shift_ratio": 0.886082983, "shift_fifths": 1,
    "deflection": 0.0022451708, "error": nan, "drift": nan, "creep": 0.0, "touching": 1.0, "contacts": 0.0, "apart":
    0.0, "saturated": 0.0, "pressed": True, "beyond": False, "constant": True, "resolution": 0.0, "linear": -1,
    "decay": 1.19939617, "kept": 0.4, "local": True, "fluctuation": nan, "traction": nan, "release": nan, "onward":
    nan, "lossy": True, "generated": -2.22832973, "generated_before": 29.1383796}, "short": {"unstable_from": nan,
    "early": 2.61474299e-05, "prior": 2.64281676e-05, "late": 2.69690678e-05, "ripple": 9.87638405e-05,
    "ripple_before": 0.000102275517, "swing": 1.87638887e-05, "swing_before": 1.94613373e-05, "widening": 0.0, "turns":
    0.621307507, "trend": 7.99999517e-05, "trend_before": 8.28141799e-05, "shift": 0.000119104238, "shift_ratio":
    0.242770378, "shift_fifths": 2, "deflection": 0.00224359991, "error": nan, "drift": nan, "creep": 0, "touching":
    0.0, "contacts": 0.0, "apart": 0, "saturated": 0.0, "pressed": False, "beyond": False, "constant": True,
    "resolution": 0, "linear": 0, "decay": nan, "kept": nan, "local": False, "fluctuation": nan, "traction": nan,
    "release": nan, "onward": nan, "lossy": False, "generated": nan, "generated_before": nan}, "balance": {"supplied":
    2.86416847e-05, "generated": -0.000252514791, "generated_before": 8.1606714e-05, "relative": [-8.8163386,
    2.84922883]}, "resolution": [0.0, 0.0, 0.0, 0.0], "lossy": True, "friction": 0.2, "interruption": 0.0, "expected":
    [None, None, None], "outcome": {"unstable_from": nan, "oscillation_2": 4.7120803e-05, "oscillation_4":
    3.53813544e-05, "oscillation_5": 3.13792913e-05, "ripple": 0.000144081584, "steady_tip": [0.000209637319,
    8.7533178e-05, 8.16857712e-05], "peak_object_force": 1.13312717, "peak_command_force": 1.13649174, "touching":
    0.792013311, "saturated": 0.00499168053, "touching_5": 0.818181818, "saturated_5": 0.0303030303, "contacts_5":
    2.0}},
    "a run of a slider": {"whole": {"unstable_from": nan, "early": 3.92159686e-05, "prior": 1.80487795e-05, "late":
    1.44808545e-05, "ripple": 8.38348933e-05, "ripple_before": 0.000106579364, "swing": 6.17172458e-05, "swing_before":
    7.77792839e-05,
    "widening": 0.0, "turns": 4.93968811,
    "trend": 2.21176475e-05, "trend_before": 2.88000798e-05, "shift": 3.46987697e-05, "shift_ratio":
    1.89930511, "shift_fifths": 1, "deflection": 0.00224495703, "error": nan, "drift": nan, "creep": 0.0, "touching":
    1.0, "contacts": 0.0, "apart": 0.0, "saturated": 0.03, "pressed": False, "beyond": False, "constant": True,
    "resolution": 0.0, "linear": 1, "decay": 0.132619556, "kept": nan, "local": False, "fluctuation": nan, "traction":
    nan, "release": nan, "onward": nan, "lossy": False, "generated": -0.0146019751,
    "generated_before": -0.0347747309}, "part":
    {"unstable_from": nan, "early": 4.91506962e-05, "prior": 3.01141683e-05, "late": 1.80487795e-05, "ripple":
    0.000106579364, "ripple_before": 0.000126853475, "swing": 7.69267891e-05, "swing_before": 0.000117814896,
    "widening": 0.0, "turns": 4.63156669,
    "trend":
    2.96525747e-05, "trend_before": 9.03857962e-06, "shift": 2.70051728e-05, "shift_ratio": 0.298071072,
    "shift_fifths": 1, "deflection": 0.00224486986, "error": nan, "drift": nan, "creep": 0.0, "touching": 1.0,
    "contacts": 0.0, "apart": 0.0, "saturated": 0.0, "pressed": False, "beyond": False, "constant": True, "resolution":
    0.0, "linear": -1, "decay": 1.19939617, "kept": 0.4, "local": False, "fluctuation": nan, "traction": nan,
    "release": nan, "onward": nan, "lossy": False, "generated": 0.016963891, "generated_before": -0.00692638031},
    "short":
    {"unstable_from": nan, "early": 1.30121964e-05, "prior": 3.53302926e-06, "late": 1.0074347e-05, "ripple":
    5.0821366e-05, "ripple_before": 2.09206446e-05, "swing": 7.47849062e-06, "swing_before": 2.11966181e-06,
    "widening": 0.0, "turns": 0.575866501,
    "trend":
    4.33428754e-05, "trend_before": 1.88009828e-05, "shift": 3.03440274e-05, "shift_ratio": 1.12511381, "shift_fifths":
    2, "deflection": 0.00224652297, "error": nan, "drift": nan, "creep": 0, "touching": 1.0, "contacts": 0.0, "apart":
    0, "saturated": 0.0, "pressed": False, "beyond": False, "constant": True, "resolution": 0, "linear": 0, "decay":
    nan, "kept": nan, "local": False, "fluctuation": nan, "traction": nan, "release": nan, "onward": nan,
    "lossy": False, "generated":
    nan, "generated_before": nan}, "balance": {"supplied": 0.000407296013, "generated": -6.19940689e-06,
    "generated_before": -1.71271608e-05, "relative": [-0.0152208877, -0.0420508924]}, "resolution": [0.0, 0.0, 0.0,
    0.0], "lossy": False, "friction": 0.0, "interruption": 0.0, "expected": [None, None, None], "outcome":
    {"unstable_from": nan, "oscillation_2": 3.92159686e-05, "oscillation_4": 1.80487795e-05, "oscillation_5":
    1.44808545e-05, "ripple": 8.38348933e-05, "steady_tip": [0.000202634793, 9.30167473e-05, -7.51036255e-05],
    "peak_object_force": 1.13283778, "peak_command_force": 1.13318827, "touching": 0.925124792, "saturated":
    0.00499168053, "touching_5": 1.0, "saturated_5": 0.0303030303, "contacts_5": 0.0}},
    "verdicts on a tracked force": [{"state": "undecided", "reason":
    "after 0.6 s it is 40 % from force over stiffness, and still moves by 0.219 mm along x at 96.6 Hz: give a "
    "longer run.duration",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear": None}, {"state": "undecided",
    "reason":
    "after 0.6 s it is 40 % from force over stiffness, and still moves by 0.219 mm along x at 96.6 Hz: give a "
    "longer run.duration; the linear loop is stable (spectral radius 0.9)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.9)"}, {"state": "undecided", "reason":
    "after 0.6 s it is 40 % from force over stiffness, and still moves by 0.219 mm along x at 96.6 Hz: give a "
    "longer run.duration; the linear loop is stable (spectral radius 0.995)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.995)"}, {"state": "undecided", "reason":
    "the run settles, but friction, encoder counts or drive limits may hide an instability; the linear loop is "
    "unstable (spectral radius 1.01)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is unstable (spectral radius 1.01)"}, {"state": "undecided", "reason":
    "after 0.6 s it is 40 % from force over stiffness, and still moves by 0.207 mm along x at 94.9 Hz: give a "
    "longer run.duration; the linear loop is stable (spectral radius 0.99)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.99)"}],
    "verdicts on a hand": [{"state": "undecided", "reason":
    "its mean position still shifts, and 0.635 mm may be left: give a longer run.duration; contact lost for 5 ms on "
    "the way",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear": None}, {"state": "undecided",
    "reason":
    "its mean position still shifts, and 0.635 mm may be left: give a longer run.duration; contact lost for 5 ms on "
    "the way; the linear loop is stable (spectral radius 0.9)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.9)"}, {"state": "settled", "reason":
    "the tip rests within 0.022 mm; contact lost for 5 ms on the way", "since": None, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.995)"}, {"state": "unstable", "reason":
    "the run of 0.6 s does not show the growth; it ends with an oscillation by 0.0224 mm along z at 50.4 Hz; the "
    "linear loop is unstable (spectral radius 1.01)",
    "since": None, "axis": "z", "amplitude": 2.24456247e-05, "frequency": 50.4201681, "linear":
    "the linear loop is unstable (spectral radius 1.01)"}, {"state": "settled", "reason":
    "the tip rests within 0.02 mm; contact lost for 5 ms on the way", "since": None, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.99)"}],
    "verdicts on a hand that bounces": [{"state": "contact lost", "reason":
    "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.119 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": None}, {"state": "contact lost", "reason":
    "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.119 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.9)"}, {"state": "contact lost",
    "reason": "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.119 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.995)"}, {"state": "unstable", "reason":
    "contact lost at the end of the run, with an oscillation by 0.0108 mm along y at 16.8 Hz; the linear "
    "loop is unstable (spectral radius 1.01)", "since": None, "axis": "y", "amplitude": 1.08025822e-05, "frequency":
    16.8067227, "linear": "the linear loop is unstable (spectral radius 1.01)"}, {"state": "contact lost", "reason":
    "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.079 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.99)"}],
    "verdicts on a mesh": [{"state": "undecided", "reason":
    "its mean position still shifts, and 0.655 mm may be left: give a longer run.duration; contact lost for 5 ms on "
    "the way",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear": None}, {"state": "undecided",
    "reason":
    "its mean position still shifts, and 0.655 mm may be left: give a longer run.duration; contact lost for 5 ms on "
    "the way; the linear loop is stable (spectral radius 0.9)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.9)"}, {"state": "undecided", "reason":
    "its mean position still shifts, and 0.655 mm may be left: give a longer run.duration; contact lost for 5 ms on "
    "the way; the linear loop is stable (spectral radius 0.995)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.995)"}, {"state": "undecided", "reason":
    "the run settles, but friction, encoder counts or drive limits may hide an instability; contact lost for 5 ms "
    "on the way; the linear loop is unstable (spectral radius 1.01)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is unstable (spectral radius 1.01)"}, {"state": "undecided", "reason":
    "its mean position still shifts, and 0.447 mm may be left: give a longer run.duration; contact lost for 5 ms on "
    "the way; the linear loop is stable (spectral radius 0.99)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.99)"}],
    "verdicts on a scene": [{"state": "contact lost", "reason":
    "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.119 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": None}, {"state": "contact lost", "reason":
    "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.119 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.9)"}, {"state": "contact lost",
    "reason": "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.119 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.995)"}, {"state": "unstable", "reason":
    "contact lost at the end of the run, with an oscillation by 0.00992 mm along x at 25.2 Hz; the linear "
    "loop is unstable (spectral radius 1.01)", "since": None, "axis": "x", "amplitude": 9.91916733e-06, "frequency":
    25.210084, "linear": "the linear loop is unstable (spectral radius 1.01)"}, {"state": "contact lost", "reason":
    "the tip is off the object from t = 0.589 s on, under a force that presses it on; it touches it within "
    "the last 0.079 s and may bounce on: give a longer run.duration", "since": 0.589, "axis": None, "amplitude": None,
    "frequency": None, "linear": "the linear loop is stable (spectral radius 0.99)"}],
    "verdicts on a slider": [{"state": "undecided", "reason":
    "its mean position still shifts, and 0.375 mm may be left: give a longer run.duration", "since": None, "axis":
    None, "amplitude": None, "frequency": None, "linear": None}, {"state": "undecided", "reason":
    "its mean position still shifts, and 0.375 mm may be left: give a longer run.duration; the linear loop is "
    "stable (spectral radius 0.9)",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.9)"}, {"state": "settled", "reason": "the tip rests within 0.01 mm",
    "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.995)"}, {"state": "unstable", "reason":
    "the run of 0.6 s does not show the growth; it ends with an oscillation by 0.00996 mm along z at 58.8 Hz; the "
    "linear loop is unstable (spectral radius 1.01)",
    "since": None, "axis": "z", "amplitude": 9.96239228e-06, "frequency": 58.8235294, "linear":
    "the linear loop is unstable (spectral radius 1.01)"}, {"state": "settled", "reason":
    "the tip rests within 0.0066 mm", "since": None, "axis": None, "amplitude": None, "frequency": None, "linear":
    "the linear loop is stable (spectral radius 0.99)"}],
    "reasons at rest": {"kinds": {"after # s it is # % from force over stiffness, and": 1,
    "an oscillation by # mm along y at # Hz grows by a ": 2, "an oscillation by # mm along z at # Hz grows by a ": 1,
    "at the end the drive is at its limit # % of the ti": 11, "contact lost at the end of the run, with an oscill": 1,
    "it has not settled after # s, and still moves by #": 1, "it oscillates by # mm along y at # Hz, and keeps #": 6,
    "it oscillates by # mm along z at # Hz, and keeps #": 3, "it rests # % from force over stiffness; contact lo": 1,
    "it rests -# % from force over stiffness; contact l": 2, "its mean position still shifts, and # mm may be le": 4,
    "its mean position still shifts, and inf mm may be ": 1, "the body may creep by another # mm: give a run#dur": 7,
    "the command still changes, by # % of the largest f": 5, "the device cannot reach the rest, the deflection o": 5,
    "the external force changes until the end: hold it ": 5, "the run leaves its start, where the loop is unstab": 2,
    "the run of # s does not show the growth; it ends w": 7, "the tip is off the object in # % of the time since": 6,
    "the tip rests within # mm, off the object; contact": 3, "the tip rests within # mm; contact lost for # ms o":
    126}, "sum": 1213190797, "axes": [0, 16, 6, 178], "numbers": [6.344, 0.000274624183, 780.000191]},
    "reasons at rest without a linear loop": {"kinds": {"an oscillation by # mm along x at # Hz grows by a ": 1,
    "an oscillation by # mm along z at # Hz grows by a ": 3, "at the end the drive is at its limit # % of the ti": 1,
    "it has not settled after # s, and still moves by #": 9, "it oscillates by # mm along z at # Hz, and keeps #": 2,
    "it rests # % from force over stiffness": 1, "it rests # % from force over stiffness; the linear": 2,
    "it rests -# % from force over stiffness": 1, "it rests -# % from force over stiffness; the linea": 6,
    "it rests in the last fifth alone, and moved by # m": 3, "its mean position still shifts, and # mm may be le": 10,
    "the body may creep by another # mm: give a run#dur": 3, "the command still changes, by # % of the largest f": 7,
    "the device cannot reach the rest, the deflection o": 5, "the external force changes until the end: hold it ": 6,
    "the run of # s does not show the growth; it ends w": 4, "the tip is off the object in # % of the time since": 10,
    "the tip rests within # mm": 126}, "sum": 1769749957, "axes": [1, 0, 9, 190], "numbers": [1.46, 0.000186441539,
    766.214108]},
    "reasons of oscillations": {"kinds": {"an oscillation by # mm along y at # Hz grows by a ": 10,
    "at the end the drive is at its limit # % of the ti": 6, "bounded oscillation at the end of the run, with an": 6,
    "it has not settled after # s, and still moves by #": 15, "it oscillates by # mm along y at # Hz": 26,
    "it oscillates by # mm along y at # Hz, and keeps #": 13, "it oscillates by # mm along y at # Hz, within two ": 4,
    "it oscillates by # mm along y at # Hz; the linear ": 78, "it rests -# % from force over stiffness": 1,
    "it rests in the last fifth alone, and moved by # m": 1, "the body may creep by another # mm: give a run#dur": 1,
    "the command still changes, by # % of the largest f": 1, "the device cannot reach the rest, the deflection o": 2,
    "the external force changes until the end: hold it ": 4, "the run leaves its start, where the loop is unstab": 3,
    "the run of # s does not show the growth; it ends w": 1, "the tip bounces, # contacts in # s, and oscillates": 8,
    "the tip is off the object in # % of the time since": 12, "the tip rests within # mm": 8}, "sum": 1218851516,
    "axes": [0, 145, 0, 55], "numbers": [4.768, 0.00344832886, 13844.5708]},
    "reasons of drifts": {"kinds": {"an oscillation by # mm along z grows by a factor o": 1,
    "at the end the drive is at its limit # % of the ti": 4, "it has not settled after # s, and still moves by #": 1,
    "it oscillates by # mm along z, and keeps #% of its": 3, "it rests # % from force over stiffness; contact lo": 3,
    "it rests -# % from force over stiffness; contact l": 1, "it rests in the last fifth alone, and moved by # m": 3,
    "its mean position still shifts, and # mm may be le": 131, "its mean position still shifts, and inf mm may be ": 2,
    "the body may creep by another # mm: give a run#dur": 6, "the command still changes, by # % of the largest f": 6,
    "the device cannot reach the rest, the deflection o": 6, "the external force changes until the end: hold it ": 5,
    "the run leaves its start, where the loop is unstab": 1, "the run of # s does not show the growth; it ends w": 6,
    "the tip is off the object in # % of the time since": 5, "the tip rests within # mm; contact lost for # ms o": 16},
    "sum": 2951263077, "axes": [0, 0, 11, 189], "numbers": [2.45, 0.000172801101, 0.0]},
    "reasons of contacts that slip": {"kinds": {"an oscillation by # mm along z at # Hz grows by a ": 3,
    "at the end the drive is at its limit # % of the ti": 5, "it oscillates by # mm along z at # Hz, and keeps #": 7,
    "it oscillates by # mm along z at # Hz, within two ": 100, "it rests # % from force over stiffness; contact lo": 5,
    "it rests -# % from force over stiffness; contact l": 2, "its mean position still shifts, and # mm may be le": 17,
    "out of reach at the end of the run, with an oscill": 1, "the body may creep by another # mm: give a run#dur": 1,
    "the command still changes, by # % of the largest f": 4, "the device cannot reach the rest, the deflection o": 7,
    "the external force changes until the end: hold it ": 6, "the run leaves its start, where the loop is unstab": 2,
    "the run of # s does not show the growth; it ends w": 4, "the run settles, but friction, encoder counts or d": 1,
    "the tip is off the object in # % of the time since": 7, "the tip rests within # mm, off the object; contact": 1,
    "the tip rests within # mm; contact lost for # ms o": 27}, "sum": 1963629566, "axes": [0, 0, 17, 183], "numbers":
    [3.278, 0.00026840875, 433.415791]},
    "reasons of displays that generate energy": {"kinds": {"after # s it is # % from force over stiffness, and": 1,
    "an oscillation by # mm along z at # Hz grows by a ": 17, "at the end the drive is at its limit # % of the ti": 6,
    "it has not settled after # s, and still moves by #": 2, "it moves by # mm along z at # Hz, and its motors k": 90,
    "it oscillates by # mm along z at # Hz, and keeps #": 1, "it oscillates by # mm along z at # Hz, within two ": 10,
    "it rests # % from force over stiffness; contact lo": 1, "it rests -# % from force over stiffness; contact l": 3,
    "it rests in the last fifth alone, and moved by # m": 3, "its mean position still shifts, and # mm may be le": 9,
    "the body may creep by another # mm: give a run#dur": 4, "the command still changes, by # % of the largest f": 2,
    "the device cannot reach the rest, the deflection o": 4, "the external force changes until the end: hold it ": 14,
    "the run leaves its start, where the loop is unstab": 1, "the tip is off the object in # % of the time since": 6,
    "the tip rests within # mm; contact lost for # ms o": 26}, "sum": 4084447519, "axes": [0, 0, 24, 176], "numbers":
    [5.144, 0.000429431905, 2420.3459]},
    "reasons of motions to a target": {"kinds": {"after # s it is # % from force over stiffness, and": 126,
    "after # s it is -# % from force over stiffness, an": 4, "an oscillation by # mm along x at # Hz grows by a ": 2,
    "at the end the drive is at its limit # % of the ti": 8, "it has not settled after # s, and still moves by #": 2,
    "it rests # % from force over stiffness; contact lo": 17, "it rests in the last fifth alone, and moved by # m": 1,
    "its mean position still shifts, and # mm may be le": 9, "the body may creep by another # mm: give a run#dur": 1,
    "the command still changes, by # % of the largest f": 4, "the device cannot reach the rest, the deflection o": 5,
    "the external force changes until the end: hold it ": 6, "the run of # s does not show the growth; it ends w": 5,
    "the tip is off the object in # % of the time since": 10},
    "sum": 1324737162, "axes": [7, 0, 0, 193], "numbers": [4.9, 0.000201754965, 219.137514]},
    "reasons of a body that creeps": {"kinds": {"after # s it is -# % from force over stiffness, an": 1,
    "an oscillation by # mm along y at # Hz grows by a ": 4, "at the end the drive is at its limit # % of the ti": 8,
    "bounded oscillation at the end of the run, with an": 1, "it oscillates by # mm along y at # Hz, and keeps #": 11,
    "it rests # % from force over stiffness; contact lo": 5, "it rests -# % from force over stiffness; contact l": 2,
    "its mean position still shifts, and # mm may be le": 1, "the body may creep by another # mm: give a run#dur": 122,
    "the command still changes, by # % of the largest f": 5, "the device cannot reach the rest, the deflection o": 4,
    "the external force changes until the end: hold it ": 5, "the run leaves its start, where the loop is unstab": 1,
    "the run of # s does not show the growth; it ends w": 5, "the tip bounces, # contacts in # s, and oscillates": 2,
    "the tip is off the object in # % of the time since": 10, "the tip rests within # mm, off the object; contact": 1,
    "the tip rests within # mm; contact lost for # ms o": 12}, "sum": 4270596723, "axes": [0, 24, 0, 176], "numbers":
    [5.1, 0.000635894047, 1825.68426]},
    "step responses": [{"steady": 1.00007889, "expected": None, "error_percent": None, "overshoot_percent": 72.0378419,
    "settling_time": 0.3425, "peak": 1.72051415, "ripple": 0.000403324269, "swing_growth": 0.135335283, "returns":
    False}, {"steady": -1.98668923, "expected": -1.9, "error_percent": -4.56259108, "overshoot_percent": 93.3858003,
    "settling_time": None, "peak": -3.84197487, "ripple": 0.0890294035, "swing_growth": 0.449328964, "returns": False},
    {"steady": 0.312242096, "expected": 0.3, "error_percent": 4.08069862, "overshoot_percent": 91.5599642,
    "settling_time": None, "peak": 0.598130847, "ripple": 0.194301749, "swing_growth": 0.893597347, "returns": False},
    {"steady": 0.30214688, "expected": 0.0, "error_percent": None, "overshoot_percent": 506.403125, "settling_time":
    None, "peak": 1.83222812, "ripple": 1.34568452, "swing_growth": 1.29693009, "returns": False}, {"steady":
    -5.8354667e-06, "expected": 1.0, "error_percent": -100.000584, "overshoot_percent": 0.0, "settling_time": 0.2625,
    "peak": 0.731697519, "ripple": 4.37662317e-06, "swing_growth": None, "returns": True}, {"steady": 0.999999999,
    "expected": 1.1, "error_percent": -9.0909092, "overshoot_percent": 4.89114527e-08, "settling_time": 0.1, "peak":
    0.999999999, "ripple": 5.74726211e-10, "swing_growth": None, "returns": False}],
}
# fmt: on


@pytest.mark.parametrize("name", MEASURES)
def test_every_number_of_a_given_run_is_as_recorded(name: str) -> None:
    assert_same(plain(MEASURES[name]()), STORED[name], name)


def test_the_rows_of_the_core_are_read_by_name_in_their_order() -> None:
    """Columns 0 to 14 are quantities, then five joint vectors of equal length."""
    rows = np.arange(60.0).reshape(2, 30)
    rows[1, 0] = -1.0
    named = name_rows(rows, 0.5)
    np.testing.assert_array_equal(named.pop("unstable_from"), [0.0, np.nan])
    assert list(named) == [
        *("oscillation_2", "oscillation_4", "oscillation_5", "ripple", "steady_tip", "peak_object_force"),
        *("peak_command_force", "touching", "saturated", "touching_5", "saturated_5", "contacts_5"),
    ]
    firsts = [1, 2, 3, 4, [5, 6, 7], 8, 9, 10, 11, 12, 13, 14]
    assert [plain(value[0]) for value in named.values()] == firsts
    reached = excursions(rows)
    joints = (reached.least, reached.greatest, reached.worst, reached.end)
    assert [plain(part[0]) for part in joints] == [[15, 16, 17], [18, 19, 20], [21, 22, 23], [24, 25, 26]]
