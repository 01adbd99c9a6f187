"""The stepped loop gives the traces of `simulate`, bit for bit; the environment keeps Gymnasium's rules."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.simulation import Environment

FOLDER = Path(__file__).parents[2] / "scenarios"
SCENARIOS = sorted(path.stem for path in FOLDER.glob("*.toml"))
HEAVY = {"palpate-phantom": "0.05 s", "press-deep": "0.02 s"}
WALL = {
    "device": {"name": "slider"},
    "servo": {"topology": "impedance_display", "period": "1 ms"},
    "operator": {"kind": "force", "force": ["-1 N", "0 N", "0 N"]},
    "object": {"kind": "wall", "stiffness": "1 N/mm", "damping": "2 N*s/m", "normal": [1, 0, 0]},
    "run": {"duration": "0.1 s"},
}
PRESS = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "0.5 ms"},
    "reference": {"force": ["0 N", "0 N", "-1 N"]},
    "object": {"kind": "spring", "stiffness": "1 N/mm"},
    "run": {"duration": "0.05 s"},
}


def same(one: palpate.Trace, two: palpate.Trace) -> None:
    assert one.unstable_from == two.unstable_from
    assert list(one.channels) == list(two.channels)
    np.testing.assert_array_equal(one.time, two.time)
    for name in one.channels:
        np.testing.assert_array_equal(one[name], two[name], err_msg=name)


def shortened(name: str, jitter: bool) -> Scenario:
    tables: dict[str, Any] = tomllib.loads((FOLDER / f"{name}.toml").read_text("utf-8"))
    scenario = Scenario.from_dict(tables, FOLDER)
    limit = HEAVY.get(name, "0.4 s")
    run = {**tables.get("run", {}), "duration": limit}
    if name == "slider-wall-unstable":
        run = tables["run"]  # to its divergence
    servo = dict(tables.get("servo", {}))
    if jitter:
        servo["jitter"] = f"{0.4 * scenario.period!r} s"
    return Scenario.from_dict({**tables, "run": run, "servo": servo}, FOLDER)


@pytest.mark.parametrize("jitter", [False, True], ids=["on time", "late"])
@pytest.mark.parametrize("name", SCENARIOS)
def test_a_stepped_scenario_gives_the_trace_of_simulate(name: str, jitter: bool) -> None:
    if jitter and Scenario.from_file(FOLDER / f"{name}.toml").device.model != "nonlinear":
        pytest.skip("a sampled model knows no jitter")
    scenario = shortened(name, jitter)
    loop = palpate.Loop(scenario)
    stepped = loop.run()
    whole = palpate.simulate(scenario)
    same(stepped, whole)
    assert loop.done
    loop.reset()
    same(loop.run(), whole)


def test_record_every_is_kept() -> None:
    tables = {**PRESS, "run": {"duration": "0.05 s", "record_every": 3}}
    same(palpate.Loop(tables).run(), palpate.simulate(tables))


def test_a_sample_is_the_traces_row() -> None:
    loop, trace = palpate.Loop(PRESS), palpate.simulate(PRESS)
    for k in range(20):
        sample = loop.step()
        assert sample.time == trace.time[k]
        np.testing.assert_array_equal(sample.tip, trace["tip"][k])
        np.testing.assert_array_equal(sample.object_force, trace["object_force"][k])
        np.testing.assert_array_equal(sample.command, trace["command_force"][k])
        np.testing.assert_array_equal(sample.torque, trace["torque"][k])
        np.testing.assert_array_equal(sample.angles, trace["angle"][k])
        assert sample.touching == bool(trace["touching"][k, 0])
        assert not sample.diverged
    np.testing.assert_array_equal(loop.tip, trace["tip"][20])
    np.testing.assert_array_equal(loop.angles, trace["angle"][20])
    np.testing.assert_array_equal(loop.speeds, trace["velocity"][20])
    moved = (trace["tip"][21] - trace["tip"][19]) / (2 * loop.period)
    np.testing.assert_allclose(loop.velocity, moved, rtol=0.02, atol=1e-6)
    np.testing.assert_array_equal(loop.observation[:3], loop.tip)
    np.testing.assert_array_equal(loop.observation[6:9], sample.object_force)
    np.testing.assert_array_equal(loop.observation[9:], [0.0, 0.0, -1.0])


def test_the_forces_of_the_caller_replace_the_scenarios() -> None:
    own = palpate.Loop({**WALL, "operator": {"kind": "none"}})
    for _ in range(101):
        own.step(force=[-1.0, 0.0, 0.0])
    np.testing.assert_array_equal(own.trace["tip"], palpate.simulate(WALL)["tip"])
    np.testing.assert_array_equal(own.trace["operator_force"], np.tile([-1.0, 0.0, 0.0], (101, 1)))
    led = palpate.Loop(PRESS)
    for _ in range(10):
        sample = led.step(reference=[0.5, 0.0, 0.0])
    np.testing.assert_array_equal(sample.reference, [0.5, 0.0, 0.0])
    np.testing.assert_array_equal(led.trace["reference_force"], np.tile([0.5, 0.0, 0.0], (10, 1)))


def test_after_its_end_the_scenarios_signals_stay() -> None:
    loop = palpate.Loop(WALL)
    loop.run()
    assert loop.done
    sample = loop.step()
    np.testing.assert_array_equal(sample.operator_force, [-1.0, 0.0, 0.0])


def test_another_seed_gives_another_jitter() -> None:
    tables = {**WALL, "servo": {**WALL["servo"], "jitter": "0.3 ms"}, "run": {"duration": "0.1 s", "seed": 1}}
    loop = palpate.Loop(tables)
    first = loop.run()
    loop.reset(seed=2)
    second = loop.run()
    assert not np.array_equal(first.time, second.time)
    same(second, palpate.simulate({**tables, "run": {"duration": "0.1 s", "seed": 2}}))


def test_a_diverged_loop_stops() -> None:
    hard = {**WALL, "object": {"kind": "spring", "stiffness": "1000 N/mm"}, "run": {"duration": "3 s"}}
    loop = palpate.Loop(hard)
    trace = loop.run()
    assert loop.diverged
    assert loop.done
    same(trace, palpate.simulate(hard))
    with pytest.raises(PalpateError, match=r"diverged at .* s; call reset\(\) first"):
        loop.step()
    loop.reset()
    assert not loop.diverged
    loop.step()


@pytest.mark.parametrize(
    ("force", "says"),
    [([1.0, 2.0], "force: three finite numbers"), ([1, np.nan, 0], "three finite numbers"), ("much", "force: three")],
)
def test_a_wrong_force_is_refused(force: Any, says: str) -> None:
    with pytest.raises(PalpateError, match=says):
        palpate.Loop(WALL).step(force=force)


def test_a_fixed_tip_cannot_be_pushed() -> None:
    loop = palpate.Loop({**WALL, "operator": {"kind": "fixed"}})
    assert np.isnan(loop.step().operator_force).all()
    with pytest.raises(PalpateError, match="the tip is fixed"):
        loop.step(force=[1.0, 0.0, 0.0])


def test_the_environment_keeps_the_rules() -> None:
    env = Environment(PRESS, periods=10)
    observation, information = env.reset(seed=3)
    assert observation.shape == env.observation_low.shape == (12,)
    for low, high in ((env.observation_low, env.observation_high), (env.action_low, env.action_high)):
        assert np.all(low == -high)
        assert np.all(high > 0.0)
    assert information["time"] == 0.0
    steps, total = 0, 0.0
    while True:
        observation, reward, terminated, truncated, information = env.step(observation[9:] - observation[6:9])
        steps, total = steps + 1, total + reward
        assert isinstance(reward, float)
        if terminated or truncated:
            break
    assert (terminated, truncated) == (False, True)
    assert steps == 11  # 101 samples
    assert -101.0 * 4.0 < total < 0.0
    assert information["sample"].command.shape == (3,)
    with pytest.raises(PalpateError, match=r"the episode is over; call reset\(\)"):
        env.step(np.zeros(3))
    again, _ = env.reset()
    np.testing.assert_array_equal(again, env.reset()[0])


def test_the_reward_is_the_sum_over_the_periods_of_an_action() -> None:
    coarse, fine = Environment(WALL, acts="operator", periods=4), Environment(WALL, acts="operator")
    coarse.reset()
    fine.reset()
    for action in ([-0.3, 0.0, 0.0], [-0.6, 0.0, 0.0], [0.0, 0.0, 0.0]):
        together = coarse.step(action)[1]
        assert together == pytest.approx(sum(fine.step(action)[1] for _ in range(4)), rel=1e-12)
    assert together < 0.0


def test_an_environment_pushes_as_the_operator_and_clips() -> None:
    env = Environment(WALL, acts="operator", largest_force=1.0, reward=lambda sample: sample.object_force[0])
    env.reset()
    for _ in range(101):
        *_, truncated, _ = env.step([-5.0, 0.0, 0.0])
    assert truncated
    np.testing.assert_array_equal(env.loop.trace["tip"], palpate.simulate(WALL)["tip"])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"acts": "me"}, 'acts must be "controller"'),
        ({"largest_force": 0.0}, "largest_force must be positive"),
        ({"periods": 0}, "periods must be at least 1"),
        ({"controller": lambda tick: tick.reference}, "the action is the command"),
    ],
)
def test_a_wrong_environment_is_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(PalpateError, match=says):
        Environment(PRESS, **options)


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_loop_has_a_trace_without_samples_before_its_first_step(name: str) -> None:
    loop = palpate.Loop(FOLDER / f"{name}.toml")
    empty = loop.trace
    assert len(empty) == 0
    assert "no samples" in empty.verdict.reason
    loop.step()
    one = {key: channel.values.shape[1] for key, channel in loop.trace.channels.items()}
    assert {key: channel.values.shape[1] for key, channel in empty.channels.items()} == one
