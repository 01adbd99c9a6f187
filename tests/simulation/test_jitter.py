"""Ticks that come late: each at its recorded time, the same wherever a cell runs, and as harmful as theory says."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from palpate import _core, linear, stability
from palpate.errors import ScenarioError
from palpate.simulation.simulator import build_simulation
from palpate.sweeps import SweepError, sweep
from scipy.stats import kstest

MASS, DAMPING, PERIOD = 0.06, 0.05, 1e-3  # the catalog's slider
SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"topology": "impedance_display", "jitter": "0.9 ms"},
    "object": {"kind": "spring", "stiffness": "80 N/m", "position": ["1 mm", "0 mm", "0 mm"]},
    "run": {"duration": "0.5 s", "seed": 3},
}
HAND = {"kind": "arm", "mass": "0.1 kg", "damping": "1 N*s/m", "stiffness": "200 N/m"}


def changed(**tables: dict[str, Any]) -> dict[str, Any]:
    return {**SLIDER, **{name: {**SLIDER.get(name, {}), **table} for name, table in tables.items()}}


@pytest.mark.parametrize("delay", [0, 2])
def test_the_motion_between_late_ticks_is_the_exact_one(delay: int) -> None:
    """Law: a mass with viscous friction under a held force, from one recorded tick to the next.

    The servo divides its difference by the period, whatever the time between.
    """
    stiffness, virtual = 400.0, 0.02
    trace = palpate.simulate(
        changed(
            device={"delay": delay},
            object={"stiffness": f"{stiffness} N/m", "damping": f"{virtual} N*s/m"},
            run={"substeps": 4},
        )
    )
    steps = np.diff(trace.time)
    assert steps.min() < 0.4 * PERIOD
    assert steps.max() > 1.6 * PERIOD
    x, v, before, line = 0.0, 0.0, 0.0, [0.0] * delay
    for k, h in enumerate(steps):
        assert trace["angle"][k, 0] == pytest.approx(x, abs=1e-12)
        deflection = x - 1e-3
        line.append(-stiffness * deflection - virtual * (deflection - before) / PERIOD)
        before = deflection
        end = line.pop(0) / DAMPING
        decay = np.exp(-DAMPING * h / MASS)
        x, v = x + end * h + (v - end) * MASS / DAMPING * (1 - decay), end + (v - end) * decay
    assert np.abs(trace["angle"]).max() > 1e-3


def test_lateness_is_uniform_and_every_seed_has_its_own() -> None:
    setup = build_simulation(SLIDER).setup
    drawn = []
    for seed in range(20):
        setup.seed = seed
        drawn.append(np.asarray(setup.lateness(4999)) / 0.9e-3)
        assert drawn[-1].min() >= 0.0
        assert drawn[-1].max() < 1.0
    table = np.array(drawn)
    assert kstest(table.ravel(), "uniform").pvalue > 1e-3
    assert len(np.unique(table)) == table.size
    between = np.corrcoef(table)  # of seeds, and of a tick and the next
    assert np.abs(between - np.eye(20)).max() < 5 / np.sqrt(5000)
    assert abs(np.corrcoef(table[:, :-1].ravel(), table[:, 1:].ravel())[0, 1]) < 5 / np.sqrt(table.size)


def test_without_jitter_nothing_changes() -> None:
    """Bit for bit: a jitter of zero, whatever the seed, is none."""
    on_time = {**SLIDER, "servo": {"topology": "impedance_display"}, "operator": {**HAND, "force": "0.1 N"}}
    plain = palpate.simulate(on_time)
    zero = palpate.simulate(
        {**on_time, "servo": {**on_time["servo"], "jitter": "0 ms"}, "run": {**SLIDER["run"], "seed": 9}}
    )
    np.testing.assert_array_equal(plain.time, zero.time)
    for name in plain.channels:
        np.testing.assert_array_equal(plain[name], zero[name])


@pytest.mark.parametrize("device", ["slider", "phantom-premium-1.5a-rotors"])
def test_a_cell_is_what_its_scenario_finds_alone(device: str) -> None:
    """With dry friction, a hand, delay; lanes on time beside late ones. (Bit for bit: see the batch's tests.)"""
    tables: dict[str, Any] = {
        "device": {"name": device, "delay": 1},
        "servo": {"topology": "impedance_display"},
        "operator": {**HAND, "shape": "ramp", "rise": "30 ms", "force": "-0.5 N"},
        "object": {"kind": "spring", "stiffness": "300 N/m"},
        "run": {"duration": "0.1 s"},
    }  # the force is constant from 30 ms on: the last fifth begins after 86 ms
    if device != "slider":
        tables["start"] = {"pose": ["0.1 rad", "2.2305 rad", "3.2776 rad"]}
    over = {"servo.jitter": ["0 ms", "0.3 ms", "0.9 ms"], "object.stiffness": [100.0, 200.0, 300.0]}
    found = sweep(tables, over, random={"operator.mass": "0.05 kg..0.3 kg"}, draws=2, seed=5)
    seeds = set()
    for index in np.ndindex(found.shape):
        scenario = found.scenario(*index)
        trace = palpate.simulate(scenario)
        seeds.add(scenario.run.seed)
        peak = np.linalg.norm(trace["object_force"], axis=1).max()
        assert found["peak_object_force"][index] == pytest.approx(peak, rel=1e-14)
        step = np.diff(trace.time, prepend=-PERIOD)[:, None] / PERIOD
        speed = np.diff(trace["tip"], axis=0, prepend=trace["tip"][:1]) / step
        bend = np.linalg.norm(np.diff(speed, axis=0), axis=1)
        assert found["oscillation_5"][index] == pytest.approx(bend[86:].max(), rel=1e-6)
    assert len(seeds) == 18


def test_the_result_does_not_depend_on_lanes_threads_or_who_runs_it(tmp_path: Path) -> None:
    experiment = build_simulation(changed(operator=HAND))
    count = 37
    columns = {"jitter": np.linspace(0.0, 9e-4, count)[:, None], "seed": np.arange(count, dtype=float)[:, None] * 10**9}
    rows = [
        np.asarray(
            _core.run_cells(experiment.setup, experiment.reference, experiment.operator, columns, count, threads, lanes)
        )
        for threads, lanes in ((1, 0), (2, 2), (3, 4))
    ]
    np.testing.assert_array_equal(rows[0], rows[1])
    np.testing.assert_array_equal(rows[0], rows[2])
    for i in range(count):
        experiment.setup.jitter, experiment.setup.seed = columns["jitter"][i, 0], int(columns["seed"][i, 0])
        np.testing.assert_array_equal(rows[0][i, -2:], experiment.run()[0][-1, :2])
    over = {"object.stiffness": "50 N/m..200 N/m:400", "servo.jitter": "0 ms..0.9 ms:4"}
    long = changed(run={"duration": "2 s"})
    sweep(long, over, seed=2, workers=1, out=tmp_path / "one.h5")
    with ThreadPoolExecutor(2) as pool:
        sweep(long, over, seed=2, executor=pool, workers=2, out=tmp_path / "two.h5")
    assert (tmp_path / "one.h5").read_bytes() == (tmp_path / "two.h5").read_bytes()
    same = sweep(long, {**over, "run.seed": [0]}, seed=2)  # all cells late alike
    assert not np.array_equal(same["oscillation_5"][:, 1, 0], sweep(long, over, seed=2)["oscillation_5"][:, 1])


@pytest.mark.parametrize("jitter", [0.5e-3, 0.9e-3])
def test_the_boundary_moves_in_as_far_as_late_ticks_feed_a_slow_swing(jitter: float) -> None:
    """Law: a held force gives a slow swing K h^2/2 of energy a tick, so that K_c = 2 b T / E[h^2].

    Times between ticks, h, differ by those of two uniform numbers: E[h^2] = T^2 + jitter^2/6. The passive bound,
    for the longest h alone, lies inside; the boundary of ticks on time, 2 b/T, outside.
    """
    scenario = changed(servo={"jitter": f"{jitter!r} s"}, run={"duration": "20 s"})
    found = sweep(scenario, {"object.stiffness": "40 N/m..110 N/m:71", "run.seed": list(range(16))})
    typical = np.median(np.log(found.outcomes.growth), axis=1)
    stiffness = found.values("object.stiffness")
    boundary = np.interp(0.0, typical, stiffness)
    on_time = stability.critical_stiffness(linear.LinearDevice.of_mass(MASS, DAMPING), period=PERIOD)
    assert boundary == pytest.approx(on_time / (1 + jitter**2 / (6 * PERIOD**2)), rel=0.01)
    passive = 2 * DAMPING / (PERIOD + jitter)
    assert stability.field_damping(lipschitz=passive, longest_period=PERIOD + jitter) == pytest.approx(DAMPING)
    assert passive < boundary < on_time
    assert not found.unstable[stiffness <= passive].any()
    assert found.unstable[stiffness >= on_time].all()


@pytest.mark.parametrize("delay", [0, 2])
def test_what_bears_late_ticks_is_calm_in_every_hand(delay: int) -> None:
    """Law: b >= K (T_max/2 + n T_max) + B T_max/T is passive; the servo divides its differences by T, however late."""
    jitter, virtual = 0.9e-3, 0.008
    longest = PERIOD + jitter
    stiffness = (DAMPING - virtual * longest / PERIOD) / (longest * (0.5 + delay))
    scenario = changed(
        device={"delay": delay},
        operator={**HAND, "shape": "step", "force": ["0.2 N", "0 N", "0 N"], "stop": "20 ms"},
        object={"stiffness": f"{stiffness!r} N/m", "damping": f"{virtual} N*s/m", "position": ["0 mm"] * 3},
        run={"duration": "4 s"},
    )
    hands = {"mass": "0 kg..0.3 kg", "damping": "0 N*s/m..0.5 N*s/m", "stiffness": "0 N/m..2 N/mm"}
    found = sweep(
        scenario,
        {"object.coupling": ["backward"]},
        random={f"operator.{key}": text for key, text in hands.items()},
        draws=400,
    )
    assert not found.unstable.any()
    certificate = stability.certify(changed(object={"stiffness": "40 N/m", "position": ["0 mm"] * 3}))
    assert certificate.passive is True
    assert "0.9 ms late" in " ".join((*certificate.method, *certificate.assumptions))
    assert stability.certify(changed(object={"stiffness": "60 N/m", "position": ["0 mm"] * 3})).passive is not True


def test_what_a_clock_cannot_be() -> None:
    with pytest.raises(ScenarioError, match=r"servo.jitter: a tick may come late by less than a servo period"):
        palpate.simulate(changed(servo={"jitter": "1 ms"}))
    with pytest.raises(ScenarioError, match=r"servo.jitter: a sampled model knows no time between ticks"):
        palpate.simulate(changed(device={"model": "linear"}))
    with pytest.raises(ScenarioError, match=r"run.seed: -1; it must be between 0 and 2\^53"):
        palpate.simulate(changed(run={"seed": -1}))
    with pytest.raises(ScenarioError, match="less than a servo period"):
        sweep(SLIDER, {"servo.jitter": "0 ms..2 ms:5"})
    with pytest.raises(SweepError, match="seed: 90071993"):
        sweep(SLIDER, {"object.stiffness": [1.0]}, seed=90071993)
