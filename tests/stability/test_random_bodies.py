"""Certificates of random loops on deformable bodies agree with the nonlinear loop, or are undecided.

PALPATE_ROUNDS=10 (`make nightly`) tests 100 loops instead of six quick ones.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.random import Generator
from palpate import fem
from palpate.scenario import Scenario
from palpate.simulation.simulator import build_simulation
from palpate.simulation.verdict import State
from palpate.stability import certify

ROUNDS = int(os.environ.get("PALPATE_ROUNDS", "1"))
LOOPS = (0, 5, 14, 16, 24, 32) if ROUNDS == 1 else range(10 * ROUNDS)
KINDS = ("compliance", "viscoelastic", "modal", "mass_spring", "signed_distance", "neo-hookean", "corotational")


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """24 x 24 x 12 mm of 20 kPa, bonded below, touched on its top, with 20 vibration modes."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    fem.build(
        fem.block((0.024, 0.024, 0.012), 0.004), young=20e3, fixed="z < 0.001 mm", touch="z > 11.9 mm", order=1,
        modes=20, output=path,
    )  # fmt: skip
    return path


def random_loop(rng: Generator, block: Path, kind: str) -> dict[str, Any]:
    """A press of 0.3 to 1.5 N by a random hand, at a random pose, rate, delay, stiffness, tip and friction."""
    period = float(np.exp(rng.uniform(np.log(0.5e-3), np.log(2e-3))))
    tip = str(rng.choice(["flat", "sphere"]))
    radius = rng.uniform(6e-3, 10e-3)
    options: dict[str, Any] = {}
    if kind == "viscoelastic":
        options = {"instantaneous_ratio": rng.uniform(1.5, 4.0), "retardation_time": f"{rng.uniform(0.01, 0.2)} s"}
    if kind in ("modal", "mass_spring"):
        options = {"rayleigh_beta": f"{rng.uniform(0.3e-3, 2e-3)} s"}
    if kind in ("neo-hookean", "corotational"):
        options = {"update_interval": f"{period * int(rng.integers(1, 40))!r} s"}
    if rng.random() < 0.4:
        options["static_friction"] = rng.uniform(0.2, 0.8)
    hand = {
        "kind": "arm",
        "mass": f"{rng.uniform(0.05, 0.3)} kg",
        "damping": f"{rng.uniform(1.0, 8.0)} N*s/m",
        "stiffness": f"{rng.uniform(50.0, 500.0)} N/m",
    }
    if rng.random() < 0.3:
        hand |= {"tissue_stiffness": f"{rng.uniform(300, 2000)} N/m", "tissue_damping": f"{rng.uniform(0.5, 5)} N*s/m"}
    press = ["0 N", "0 N", f"{-rng.uniform(0.3, 1.5)} N"]
    height = (radius if tip == "sphere" else 0.0) + 0.2e-3
    return {
        "device": {"name": "phantom-premium-1.5a", "delay": int(rng.integers(0, 3))},
        "start": {"pose": [f"{angle} rad" for angle in np.array([0.0, 2.2305, 3.2776]) + rng.uniform(-0.25, 0.25, 3)]},
        "servo": {"period": f"{period!r} s", "topology": "impedance_display"},
        "operator": {**hand, "shape": "ramp", "rise": "0.1 s", "force": press},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", f"{-height} m"],
            "body": {
                "file": str(block), "origin": ["12 mm", "12 mm", "12 mm"], "kind": kind, "tip": tip,
                "radius": f"{radius} m", "stiffness_scale": float(np.exp(rng.uniform(np.log(0.3), np.log(30.0)))),
                **options,
            },
        },
        "controller": {"kind": "none"},
        "run": {"duration": "0.6 s"},
    }  # fmt: skip


def rests(tables: dict[str, Any]) -> bool:
    """Whether the loop rests in contact 8 s after its run, 4 s after a push of 3 % of its force for 3 ticks."""
    simulation = build_simulation(tables)
    period = simulation.scenario.period
    ticks = round(4.0 / period)
    reference, operator = (
        np.vstack([table, np.tile(table[-1], (2 * ticks, 1))]) for table in (simulation.reference, simulation.operator)
    )
    pushed = len(operator) - ticks
    operator[pushed : pushed + 3] *= 1.03
    longer = replace(simulation, reference=reference, operator=operator)
    trace = longer.trace(*longer.run())
    if not trace.completed or not trace["touching"][-ticks // 2 :].all():
        return False
    swing = [np.ptp(trace["tip"][part], axis=0).max() for part in (slice(pushed, pushed + 200), slice(-200, None))]
    return bool(swing[1] < 0.5 * swing[0] or swing[1] < 1e-7)


def test_certificates_of_random_loops_agree_with_the_nonlinear_loop(block: Path) -> None:
    undecided, remembered = [], 0
    for index in LOOPS:
        rng = np.random.default_rng(1000 + index)
        tables = random_loop(rng, block, KINDS[index % len(KINDS)])
        certificate = certify(Scenario.from_dict(tables))
        if certificate.verdict.state is State.UNDECIDED:
            if KINDS[index % len(KINDS)] == "signed_distance" and "static_friction" in tables["object"]["body"]:
                remembered += 1  # this friction keeps a share of each displacement
                continue
            undecided.append(f"{index}: {certificate.claim}")
            continue
        assert rests(tables) == certificate.stable, f"{index}: {certificate.claim}"
    assert len(undecided) <= 0.03 * len(LOOPS), "\n".join(undecided)
    assert remembered <= 0.07 * len(LOOPS)
