"""Certificates of random loops with springs and walls against the nonlinear run, judged without the linear loop."""

from __future__ import annotations

import os
from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.errors import PalpateError
from palpate.simulation.decision import decide
from palpate.simulation.evidence import evidence
from palpate.simulation.recorded import external_forces, recorded_scenario
from palpate.simulation.verdict import State
from palpate.simulation.windows import windows
from palpate.stability import Certificate, certify

ROUNDS = int(os.environ.get("PALPATE_ROUNDS", "1"))
SEED = int(os.environ.get("PALPATE_SEED", "7000"))
LOOPS = 10
MOST_UNDECIDED = 0.03
GROWTHS, LONGEST = (1e5, 1e7), 400.0  # factors over which a rate is measured: a motion may first have to be excited
SMALL = 1e-6  # share of the scenario's force that starts it
OF_RATE = 0.2  # largest relative error of a measured rate


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
    period = period_of(tables)
    duration = np.clip(8.0 * period / max(abs(np.log(radius)), 1e-9), 4.0, 120.0)
    trace = simulate({**tables, "run": {"duration": f"{duration} s", "record_every": 1}})
    if not trace.completed:
        return State.UNSTABLE, np.inf
    scenario = recorded_scenario(trace)
    found = evidence(trace, scenario, windows(external_forces(trace, scenario))[-1], None)
    return State(int(decide(found)[0])), float(found.late[0] / max(found.prior[0], 1e-300))


class Plane:
    """Spring and damper along a normal on both sides of the start: a wall that the tip does not leave."""

    def __init__(self, wall: dict[str, Any], period: float) -> None:
        self.normal = np.array(wall["normal"]) / np.linalg.norm(wall["normal"])
        self.stiffness, damping = (float(wall[key].split()[0]) for key in ("stiffness", "damping"))
        self.damping = damping / period
        self.start: Any = None
        self.last = 0.0

    def step(self, tip: Any) -> Any:
        """Return the force of the tip on the plane, N."""
        self.start = np.array(tip.position) if self.start is None else self.start
        depth = float(self.normal @ (tip.position - self.start))
        force, self.last = self.stiffness * depth + self.damping * (depth - self.last), depth
        return force * self.normal


def about_the_equilibrium(tables: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the loop of a certificate's statement, with a small force, and the options of its run.

    Its contact is not lost: a wall along an axis becomes a spring, and another one a `Plane`.
    """
    small = deepcopy(tables)
    for table in ("reference", "operator"):
        if "force" in small.get(table, {}):
            force = small[table]["force"]
            values = [force] * 3 if isinstance(force, str) else force
            small[table]["force"] = [f"{SMALL * float(value.split()[0])} N" for value in values]
    normal = small["object"].get("normal")
    if normal is None:
        return small, {}
    if np.count_nonzero(normal) > 1:
        plane = Plane(small["object"], period_of(tables))
        small["object"] = {"kind": "none"}
        return small, {"object": plane}
    units = {"stiffness": "N/m", "damping": "N*s/m"}
    sizes = {key: [small["object"][key] if part else f"0 {unit}" for part in normal] for key, unit in units.items()}
    small["object"] = {"kind": "spring", **sizes}
    return small, {}


def measured_rate(tables: dict[str, Any], radius: float, angle: float, factor: float = GROWTHS[0]) -> float:
    """Return the rate at which small motions about the equilibrium grow in the nonlinear run, 1/s.

    Args:
        tables: of the loop.
        radius, angle: predicted, of its largest eigenvalue; they choose the duration and the sampling alone.
        factor: by which the motion is to grow meanwhile.
    """
    period = period_of(tables)
    cycle = 2.0 * np.pi / angle if angle > 1e-6 else 10.0
    ticks = int(max(min(np.log(factor) / np.log(radius), LONGEST / period), 3.0 * cycle))
    every = int(np.clip(min(cycle / 16.0, ticks / 2000), 1, 100))
    small, options = about_the_equilibrium(tables)
    trace = simulate({**small, "run": {"duration": f"{ticks * period} s", "record_every": every}}, **options)
    step = np.linalg.norm(np.diff(trace["tip"], axis=0), axis=1)
    whole = cycle / every  # a window has whole cycles, so that a slow oscillation does not look like growth
    count = int(np.clip(len(step) / 4.0 / whole, 2, 20))
    length = round(max(np.floor(len(step) / 4.0 / count / whole), 1.0) * whole)
    windows = step[len(step) - count * length :].reshape(count, length)
    times = np.arange(count) * length * every * period
    return float(np.polyfit(times, 0.5 * np.log(np.mean(windows**2, axis=1)), 1)[0])


def period_of(tables: dict[str, Any]) -> float:
    """Return the servo period, s."""
    return 1e-3 * float(tables["servo"]["period"].split()[0])


def judged(tables: dict[str, Any]) -> tuple[Certificate, State, str]:
    """Return the certificate of a loop, the state of its run alone, and what is wrong; empty: nothing.

    A stable loop does not grow. The run of an unstable one grows or diverges by itself, or small motions about its
    equilibrium grow at the predicted rate, wherever the run of the scenario goes from there.
    """
    certificate = certify(tables)
    radius = certificate.margin.get("spectral_radius", 1.0)
    state, growth = run_alone(tables, radius)
    if certificate.stable and state is State.UNSTABLE:
        return certificate, state, f"the run grows by {growth:.3g}"
    if certificate.verdict.state is State.UNSTABLE and radius > 1.0 and state is not State.UNSTABLE:
        period = period_of(tables)
        angle = 2.0 * np.pi * certificate.margin["frequency_Hz"] * period
        predicted = np.log(radius) / period
        rates = [measured_rate(tables, radius, angle, factor) for factor in GROWTHS]
        if not any(abs(rate / predicted - 1.0) < OF_RATE for rate in rates):
            return certificate, state, f"small motions grow by {rates} 1/s, not {predicted:.4g} 1/s"
    return certificate, state, ""


# Tips over by itself at a pose near the stretched arm, and rests 63 mm away.
LEAVES: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a", "delay": 2},
    "start": {"pose": ["-0.10817 rad", "1.9567 rad", "3.5308 rad"]},
    "servo": {"period": "0.5 ms", "topology": "impedance_display"},
    "object": {"kind": "wall", "stiffness": "306.4 N/m", "damping": "0 N*s/m", "normal": [0, 1, 0]},
    "controller": {"kind": "none"},
    "operator": {"kind": "arm", "shape": "step", "force": ["0 N", "-0.026 N", "0 N"], "mass": "0.0628 kg"}
    | {"damping": "5.909 N*s/m", "stiffness": "710.2 N/m"}
    | {"tissue_stiffness": "1018.2 N/m", "tissue_damping": "0.5 N*s/m"},
    "run": {"duration": "4 s"},
}
# Doubles every 210 s, longer than a run.
SLOW: dict[str, Any] = {
    "device": {"name": "slider", "delay": 2},
    "start": {"pose": ["0 mm"]},
    "servo": {"period": "0.25 ms", "topology": "force_tracking"},
    "object": {"kind": "spring", "stiffness": "395.8597536773325 N/m", "damping": "0.01449121799014088 N*s/m"},
    "controller": {"kind": "gain", "gain": 0.216380809477216},
    "reference": {"shape": "step", "force": "0.15572355284046044 N"},
    "run": {"duration": "4 s"},
}


@pytest.mark.parametrize(
    ("tables", "alone"), [(LEAVES, State.SETTLED), (SLOW, State.BOUNDED_OSCILLATION)], ids=["leaves", "slow"]
)
def test_an_unstable_equilibrium_is_judged_by_the_growth_about_it(tables: dict[str, Any], alone: State) -> None:
    """Both are unstable, though no run of 4 s shows growth; the certificate names the run beside the equilibrium."""
    certificate = certify(tables)
    assert certificate.verdict.state is State.UNSTABLE
    end = "the run" if alone is State.SETTLED else f"{alone.label} at the end of the run"
    assert f"The verdict of the run is unstable: {end}" in certificate.claim
    radius, period = certificate.margin["spectral_radius"], period_of(tables)
    angle = 2.0 * np.pi * certificate.margin["frequency_Hz"] * period
    assert run_alone(tables, 1.0 - 1e-3)[0] is alone
    assert measured_rate(tables, radius, angle) == pytest.approx(np.log(radius) / period, rel=0.1)


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_no_certificate_of_a_random_loop_is_wrong(seed: int) -> None:
    """Stable: the run does not grow. Unstable: motions about the equilibrium do. At most 3 % (or one) are undecided."""
    rng, count, undecided = np.random.default_rng(SEED + seed), 0, 0
    while count < LOOPS:
        tables = loop(rng)
        try:
            certificate, state, wrong = judged(tables)
        except PalpateError:
            continue  # no design, or no loop in this direction
        count += 1
        assert not wrong, f"{certificate.claim} The run alone: {state.label}; {wrong}: {tables}"
        undecided += certificate.verdict.state is State.UNDECIDED
    assert undecided <= max(1, MOST_UNDECIDED * LOOPS)
