"""Certificates of random loops with springs and walls against the nonlinear run, judged without the linear loop."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.errors import PalpateError
from palpate.simulation.evidence import evidence
from palpate.simulation.recorded import external_forces, recorded_scenario
from palpate.simulation.verdict import State, decide
from palpate.simulation.windows import windows
from palpate.stability import certify

ROUNDS = int(os.environ.get("PALPATE_ROUNDS", "1"))
LOOPS = 10
MOST_UNDECIDED = 0.03


def loop(rng: np.random.Generator) -> dict[str, Any]:
    """Return the tables of a random loop: device, pose, rate, delay, operator, object and controller."""
    slider, tracking = bool(rng.random() < 0.4), bool(rng.random() < 0.5)
    force = 10 ** rng.uniform(-2.0, -0.5)
    stiffness = 10 ** rng.uniform(1.5, 3.3 if slider else 4.3)
    damping = float(rng.choice([0.0, 10 ** rng.uniform(-2.0, 0.5)])) * (0.05 if slider else 1.0)
    wall = not tracking and bool(rng.random() < 0.5)
    normal = [1, 0, 0] if slider else [int(i == rng.integers(3)) for i in range(3)]
    normal = normal if any(normal) else [0, 0, 1]
    angles = rng.uniform([-0.3, 1.93, 2.98], [0.3, 2.53, 3.58])
    pose = ["0 mm"] if slider else [f"{angle} rad" for angle in angles]
    tables: dict[str, Any] = {
        "device": {"name": "slider" if slider else "phantom-premium-1.5a", "delay": int(rng.choice([0, 0, 0, 1, 2]))},
        "start": {"pose": pose},
        "servo": {"period": f"{rng.choice([0.25, 0.5, 1.0, 2.0])} ms"},
        "object": {"kind": "spring", "stiffness": f"{stiffness} N/m", "damping": f"{damping} N*s/m"},
        "controller": {"kind": "none"},
        "run": {"duration": "4 s"},
    }
    if tracking:
        tables["servo"]["topology"] = "force_tracking"
        tables["reference"] = {"shape": "step", "force": f"{force} N"}
        kinds = ["gain"] if slider else ["gain", "lead_lag", "lqg"]
        tables["controller"] = {"kind": str(rng.choice(kinds))}
        if tables["controller"]["kind"] == "gain":
            tables["controller"]["gain"] = float(rng.uniform(0.05, 1.5))
        return tables
    tables["servo"]["topology"] = "impedance_display"
    push = [f"{-force * n} N" for n in normal]
    tables["operator"] = {"kind": "force", "shape": "step", "force": push}
    if rng.random() < 0.6:
        arm = {"mass": rng.uniform(0.05, 0.3), "damping": rng.uniform(0.5, 8.0), "stiffness": rng.uniform(50.0, 800.0)}
        units = {"mass": "kg", "damping": "N*s/m", "stiffness": "N/m"}
        tables["operator"] |= {"kind": "arm", **{key: f"{value} {units[key]}" for key, value in arm.items()}}
        if rng.random() < 0.5:
            tables["operator"] |= {"tissue_stiffness": f"{rng.uniform(200, 1500)} N/m", "tissue_damping": "0.5 N*s/m"}
    if wall:
        tables["object"] |= {"kind": "wall", "normal": normal}
    return tables


def run_alone(tables: dict[str, Any], radius: float) -> tuple[State, float]:
    """Return the state of a run judged without its linear loop, and the growth of its oscillation.

    The run is as long as eight time constants of the linear loop's slowest motion, 4 to 120 s.
    """
    period = 1e-3 * float(tables["servo"]["period"].split()[0])
    duration = np.clip(8.0 * period / max(abs(np.log(radius)), 1e-9), 4.0, 120.0)
    trace = simulate({**tables, "run": {"duration": f"{duration} s", "record_every": 1}})
    if not trace.completed:
        return State.UNSTABLE, np.inf
    scenario = recorded_scenario(trace)
    found = evidence(trace, scenario, windows(external_forces(trace, scenario))[-1], None)
    return State(int(decide(found)[0])), float(found.late[0] / max(found.prior[0], 1e-300))


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_no_certificate_of_a_random_loop_is_wrong(seed: int) -> None:
    """Stable: the run does not grow. Unstable: it does not settle. At most 3 % (or one) are undecided."""
    rng, judged, undecided = np.random.default_rng(7000 + seed), 0, 0
    while judged < LOOPS:
        tables = loop(rng)
        try:
            certificate = certify(tables)
        except PalpateError:
            continue  # no design, or no loop in this direction
        judged += 1
        state, growth = run_alone(tables, certificate.margin.get("spectral_radius", 1.0))
        if certificate.stable:
            assert state is not State.UNSTABLE, f"{certificate.claim} The run grows by {growth:.3g}: {tables}"
        elif certificate.verdict.state is State.UNSTABLE:
            assert state is not State.SETTLED, f"{certificate.claim} The run settles: {tables}"
        else:
            undecided += 1
    assert undecided <= max(1, MOST_UNDECIDED * LOOPS)
