"""What a hand feels: closed forms, limits, and the simulated loop shaken by a sine."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.cli.main import app
from palpate.errors import StabilityError
from palpate.linear import HumanArm
from palpate.metrics import (
    LoopResponse,
    arm_stiffness,
    hold_response,
    measure_performance,
    performance,
    rate_hardness,
    ripple,
    vibration_threshold,
)
from palpate.metrics.performance import _bandwidth
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from typer.testing import CliRunner

SCENARIOS = Path(__file__).parents[2] / "scenarios"
MASS, B, T = 0.06, 0.05, 1e-3  # the slider


def slider(stiffness: str = "80 N/m", damping: str = "0 N*s/m", delay: int = 0, **tables: Any) -> dict[str, Any]:
    return {
        "device": {"name": "slider", "delay": delay},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": stiffness, "damping": damping},
        **tables,
    }


def response(tables: dict[str, Any]) -> LoopResponse:
    return LoopResponse.of(Scenario.from_dict(tables))


def felt(tables: dict[str, Any], frequency: Any) -> np.ndarray:
    """Force per motion along x."""
    return np.asarray(1 / response(tables).displacement(frequency)[:, 0, 0])


@pytest.mark.parametrize("delay", [0, 2])
def test_the_slider_in_closed_form(delay: int) -> None:
    """X/F = G (1 - H z^-n W G / (1 + W z^-n R)) with G = 1/(ms^2 + bs), R its zero-order hold, written out."""
    k, v = 300.0, 2.0
    f = np.array([0.3, 3.0, 30.0, 150.0, 400.0])
    s, z = 2j * np.pi * f, np.exp(2j * np.pi * f * T)
    g = 1 / (MASS * s**2 + B * s)
    a, tau = np.exp(-B * T / MASS), MASS / B
    r = ((T - tau * (1 - a)) / B * z + (tau * (1 - a) - a * T) / B) / ((z - 1) * (z - a))
    w, late, h = k + v * (1 - 1 / z) / T, z**-delay, (1 - np.exp(-s * T)) / (s * T)
    exact = g * (1 - h * late * w * g / (1 + w * late * r))
    assert felt(slider("300 N/m", "2 N*s/m", delay), f) == pytest.approx(1 / exact, rel=1e-8)


def test_limits_of_what_is_felt() -> None:
    """At rest the object's stiffness, at high frequency the device's mass, without object the device."""
    tables = slider("500 N/m", "1 N*s/m")
    assert felt(tables, [0.01])[0].real == pytest.approx(500, rel=1e-5)
    high = 450.0
    assert felt(tables, [high])[0].real == pytest.approx(-MASS * (2 * np.pi * high) ** 2, rel=0.01)
    f = np.array([1.0, 20.0])
    alone = 1 / response(tables).displacement(f, object_on=False)[:, 0, 0]
    s = 2j * np.pi * f
    assert alone == pytest.approx(MASS * s**2 + B * s, rel=1e-10)


@pytest.mark.parametrize("compensated", [True, False])
def test_a_slow_push_moves_the_arm_as_statics_says(compensated: bool) -> None:
    """J^T (N + F - K (x - x0)) = g(q) with the weight N at the tip; without compensation, constant torques."""
    tables = {**slider("9 N/m"), "device": {"name": "phantom-premium-1.5a"}}
    tables["start"] = {"pose": ["0.2 rad", "2.1 rad", "3.2 rad"]}
    loop = replace(response(tables), gravity_compensation=compensated)
    arm, pose, k = loop.device, loop.pose, 9.0
    weight = np.linalg.solve(arm.jacobian(pose).T, arm.gravity(pose))

    def torque(q: np.ndarray) -> np.ndarray:
        jacobian, spring = arm.jacobian(q), -k * (arm.forward(q) - arm.forward(pose))
        held = jacobian.T @ weight if compensated else arm.gravity(pose)
        return np.asarray(held + jacobian.T @ spring - arm.gravity(q))

    step = 1e-5 * np.eye(3)
    by_pose = np.column_stack([(torque(pose + e) - torque(pose - e)) / 2e-5 for e in step])
    moved = -arm.jacobian(pose) @ np.linalg.solve(by_pose, arm.jacobian(pose).T)
    found = loop.displacement([1e-3])[0]
    np.testing.assert_allclose(found.real, moved, atol=1e-5 * np.abs(moved).max())


@pytest.mark.parametrize("frequency", [4.0, 12.0, 40.0])
def test_the_simulated_slider_shaken_by_a_sine(frequency: float) -> None:
    """Amplitude of the steady swing in the full simulation: as the response says, within 0.02 %."""
    tables = slider("300 N/m", "3 N*s/m", 1)
    tables["operator"] = {
        "kind": "force", "shape": "sine", "force": ["0.2 N", "0 N", "0 N"], "frequency": f"{frequency} Hz"
    }  # fmt: skip
    tables["run"] = {"duration": "3 s", "substeps": 8}
    trace = simulate(tables)
    tail = slice(-round(1 / T), None)  # a whole number of periods
    turn = np.exp(-2j * np.pi * frequency * trace.time[tail])
    moved, pushed = (2 * np.mean(trace[name][tail, 0] * turn) for name in ("tip", "operator_force"))
    assert abs(pushed) == pytest.approx(0.2, rel=1e-6)
    pushed *= np.sinc(frequency * T) ** 2  # the run draws the hand's force straight from sample to sample
    assert abs(pushed / moved) == pytest.approx(abs(felt(tables, [frequency])[0]), rel=2e-4)


def test_the_simulated_arm_under_lqg_shaken_by_a_sine() -> None:
    """The nonlinear arm with a controller: a millinewton of the reference moves the object's force as it should."""
    tables = Scenario.from_file(SCENARIOS / "press-stiff-cube-lqg.toml").to_dict()
    frequency = 8.0
    tables["reference"] = {"shape": "sine", "force": ["0.01 N", "0 N", "0 N"], "frequency": f"{frequency} Hz"}
    tables["run"] = {"duration": "2 s", "substeps": 4}
    trace = simulate(tables)
    tail = slice(-round(1 / trace.time[1]), None)
    turn = np.exp(-2j * np.pi * frequency * trace.time[tail])
    answered = 2 * np.mean(trace["object_force"][tail, 0] * turn)
    asked = 2 * np.mean(trace["reference_force"][tail, 0] * turn)
    ours = LoopResponse.of(Scenario.from_dict(tables)).reference([frequency])[0, 0, 0]
    assert answered / asked == pytest.approx(ours, rel=3e-3)


def test_a_hold_has_lost_half_its_power_at_443_thousandths_of_the_rate() -> None:
    """|sin x / x| = 1/sqrt 2 at f T = 0.44295; a half-period delay at low frequency."""
    assert abs(hold_response([442.946], T)[0]) == pytest.approx(1 / np.sqrt(2), rel=1e-6)
    assert np.angle(hold_response([1.0], T)[0]) == pytest.approx(-np.pi * 1e-3, rel=1e-9)
    said: list[tuple[str, float]] = []
    found = measure_performance(slider(title="shaken"), progress=lambda *one: said.append(one))
    assert found.hold_bandwidth == pytest.approx(442.946, rel=1e-6)
    assert (found.title, found.topology) == ("shaken", "impedance_display")
    assert said == [("frequency response", 0.1), ("simulating", 0.5)]


def test_a_guard_is_refused_before_a_run_on_a_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("palpate.metrics.performance.simulate", lambda _scenario: pytest.fail("a run"))
    mesh = {"shape": "box", "edge": "40 mm", "divisions": 2, "radius": "2 mm"}
    touched = {"kind": "mesh", "mesh": mesh, "surface": {"stiffness": "100 N/m"}}
    with pytest.raises(StabilityError, match="a guard makes the loop nonlinear"):
        measure_performance(slider(object=touched, guard={"kind": "half_sample"}))


def test_force_on_a_hand_is_divided_between_hand_and_device() -> None:
    """F_hand/F = Z_h/(Z_h + Z_d) H, in closed form; all of it at rest."""
    arm = HumanArm(0.15, 4.5, 560.0, 500.0, 0.5)
    f = np.array([0.1, 5.0, 60.0])
    s = 2j * np.pi * f
    bone, tissue = 560 + 4.5 * s + 0.15 * s**2, 500 + 0.5 * s
    hand, device = bone * tissue / (bone + tissue), MASS * s**2 + B * s
    assert arm_stiffness(arm, f) == pytest.approx(hand, rel=1e-12)
    through = response(slider()).transmitted(f, arm, (1, 0, 0))
    assert through == pytest.approx(hand / (hand + device) * hold_response(f, T), rel=1e-8)
    assert abs(through[0]) == pytest.approx(1.0, rel=1e-3)


def test_force_on_a_hand_at_an_arm_is_that_of_the_joints_with_the_hand_as_their_spring() -> None:
    """n^T H J (Z + J^T H J)^-1 J^T n, solved in joint coordinates in place of those of the tip."""
    pose = ["0 rad", "2.2305 rad", "3.2776 rad"]
    loop = response({**slider(), "device": {"name": "phantom-premium-1.5a"}, "start": {"pose": pose}})
    arm, f = HumanArm(0.15, 4.5, 560.0, 500.0, 0.5), np.array([0.7, 7.0, 70.0])
    jacobian = loop.device.jacobian(loop.pose)
    for n in (np.eye(3)[0], np.eye(3)[2], np.array([0.6, 0.0, 0.8])):
        for one, told in zip(f, loop.transmitted(f, arm, n), strict=True):
            hand = complex(arm_stiffness(arm, [one])[0])
            joints = np.linalg.inv(loop._device(np.array([one]))[0]) + hand * jacobian.T @ jacobian
            force = hand * jacobian @ np.linalg.solve(joints, jacobian.T @ n)
            assert told == pytest.approx(hold_response([one], T)[0] * (n @ force), rel=1e-8)


@pytest.mark.parametrize(("stiffness", "damping", "delay"), [(200.0, 0.0, 0), (200.0, 1.0, 0), (200.0, 1.0, 3)])
def test_rate_hardness_of_a_bounce_written_out(stiffness: float, damping: float, delay: int) -> None:
    """A mass with friction against a held spring and damper, its motion between samples in closed form."""
    x, v, before, line = 0.0, 1.0, 0.0, [0.0] * delay
    commands = []
    a, tau = np.exp(-B * T / MASS), MASS / B
    for _ in range(10):
        commands.append(stiffness * x + damping * (x - before) / T)
        line.append(-commands[-1])
        force, before = line.pop(0), x
        x, v = x + tau * (1 - a) * v + (T - tau * (1 - a)) / B * force, a * v + (1 - a) / B * force
    held = commands[9 - delay]
    loop = response(slider(f"{stiffness} N/m", f"{damping} N*s/m", delay))
    assert rate_hardness(loop, (1, 0, 0)) == pytest.approx(held / 10e-3, rel=1e-8)
    if delay == 0 and damping == 0.0:
        assert held / 10e-3 == pytest.approx(stiffness * 0.9, rel=0.1)  # nine samples' way, and the bounce
    with pytest.raises(StabilityError, match="longer than the delay"):
        rate_hardness(loop, (1, 0, 0), window=T if delay else 4e-4)


def test_threshold_of_touch() -> None:
    """0.1 um at 250 Hz, four times as much an octave off, flat below 40 Hz (Verrillo 1963)."""
    um = 1e6 * vibration_threshold([250.0, 125.0, 500.0, 40.0, 10.0])
    assert um == pytest.approx([0.1, 0.4, 0.4, 3.90625, 3.90625])


def test_ripple_finds_the_most_perceptible_line() -> None:
    """Half a micrometre at 250 Hz is five times the threshold; twenty at 25 Hz would be felt, three are not."""
    t = np.arange(2000) * T
    drift = 1e-3 * t
    found = ripple(drift + 0.5e-6 * np.sin(2 * np.pi * 250 * t), T)
    assert found.worst == pytest.approx(250, abs=0.6)
    assert found.ratio == pytest.approx(5.0, rel=0.01)
    assert found.perceptible
    assert "is perceptible" in str(found)
    between = ripple(0.5e-6 * np.sin(2 * np.pi * 250.23 * t), T)  # a sine between two lines keeps its height
    assert between.ratio == pytest.approx(5.0, rel=0.02)
    for size, there in ((20e-6, True), (3e-6, False)):
        assert ripple(np.outer(size * np.sin(2 * np.pi * 25 * t), [0.6, 0.0, 0.8]), T).perceptible is there
    with pytest.raises(StabilityError, match="too short a stretch"):
        ripple(t[:100], T)


def test_encoder_counts_cause_ripple_of_the_arm() -> None:
    """The same wall with counts and without: a stiff, damped wall rattles between counts."""
    tables = Scenario.from_file(SCENARIOS / "arm-through-tissue-on-a-wall.toml").to_dict()
    ratios = []
    for encoder in (False, True):
        tables["device"] = {**tables["device"], "encoder": encoder}
        found = measure_performance(tables)
        assert found.ripple is not None
        assert ("switched off" in found.remark) is not encoder
        ratios.append(found.ripple.ratio)
    assert ratios[1] > 10 * ratios[0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"object": {"kind": "none"}}, "has no stiffness; give a spring or a wall"),
        (
            {
                "device": {"name": "phantom-premium-1.5a", "model": "experimental"},
                "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
                "operator": {"kind": "none"},
            },
            "no motion between samples",
        ),
    ],
)
def test_what_cannot_be_felt_is_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(StabilityError, match=says):
        measure_performance(slider(**change))
    with pytest.raises(StabilityError, match="below half the sampling rate, 500 Hz"):
        response(slider()).displacement([600.0])


def test_performance_from_the_command_line(tmp_path: Path) -> None:
    """Numbers in JSON, a page with its pictures, one line per direction."""
    scenario = SCENARIOS / "arm-through-tissue-on-a-wall.toml"
    done = CliRunner().invoke(app, ["performance", str(scenario), "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "rate-hardness" in done.output
    written = json.loads((tmp_path / "performance.json").read_text("utf-8"))
    assert written["directions"][0]["static_stiffness_N_per_m"] == pytest.approx(1000, rel=0.01)
    assert (tmp_path / "performance.html").read_text("utf-8").count("<svg") == 2


def test_guards_are_compared_from_the_command_line(tmp_path: Path) -> None:
    """One line for each way to render a wall, with what it guarantees; the scenario gives device, pose and normal."""
    scenario = SCENARIOS / "slider-wall-stable.toml"
    done = CliRunner().invoke(app, ["performance", str(scenario), "--guards", "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    lines = [re.split(r"  +", line.strip()) for line in done.output.splitlines()]
    table = {line[0]: line[1:] for line in lines if len(line) > 4}
    assert list(table["guard"]) == ["wall", "felt", "step", "swing", "passive for"]
    assert table["no guard"][:3] == ["none", "–", "–"]
    assert table["energy bound"][-1] == "every stiffness, if b is true"
    assert re.fullmatch(r"[\d.]+ N/m with [\d.]+ N s/m", table["x"][0])
    written = json.loads((tmp_path / "guards.json").read_text("utf-8"))
    assert written["axis"]["mass"] == pytest.approx(0.06)
    assert len(written["rows"]) == 15
    axis, walls = written["axis"], written["stiffnesses"]
    assert f"slider: m = 60 g, b = 0.05 N s/m, {axis['coulomb']:.3g} N of dry friction, counts of" in done.output
    assert f"T = 1 ms; walls of {walls[0]:g} to {walls[-1]:g} N/m" in done.output
    assert written["rows"][0]["felt"] is None


def test_the_loop_on_a_mesh_is_that_of_the_wall_under_the_last_contact() -> None:
    """Its normal, stiffness and pose are those of the last sample in contact, not of those before or after."""
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0 N", "0 N", "-0.5 N"]},
        "object": {
            "kind": "mesh",
            "mesh": {"shape": "box", "edge": "80 mm", "divisions": 1},
            "surface": {"stiffness": "400 N/m", "damping": "1.5 N*s/m"},
        },
    }
    scenario = Scenario.from_dict(tables)
    touching = np.array([0.0, 1.0, 1.0, 1.0, 0.0])[:, None]
    turn = np.array([0.3, 0.4, 0.5, 0.6, 0.7])
    channels = {
        "touching": touching,
        "surface_stiffness": 100.0 * np.arange(1.0, 6.0)[:, None],
        "normal": np.stack([0.0 * turn, np.sin(turn), np.cos(turn)], axis=1),
        "angle": np.array(scenario.start.pose) + 0.01 * np.arange(5)[:, None],
    }
    found = LoopResponse.on_mesh(scenario, Trace.of(1e-3 * np.arange(5), channels))
    normal = channels["normal"][3]
    np.testing.assert_allclose(found.stiffness, 400.0 * np.outer(normal, normal), atol=1e-9)
    np.testing.assert_allclose(found.damping, 1.5 * np.outer(normal, normal), atol=1e-9)
    np.testing.assert_allclose(found.pose, channels["angle"][3])
    np.testing.assert_allclose(found.directions(), [normal], atol=1e-9)
    with pytest.raises(StabilityError, match="never touches the mesh in this run; move the mesh"):
        LoopResponse.on_mesh(scenario, Trace.of(1e-3 * np.arange(5), channels | {"touching": 0.0 * touching}))


def test_the_dynamic_stiffness_of_an_object_is_that_of_its_spring_and_damper() -> None:
    """K + j 2 pi f B, and its directions are those in which it acts and the device moves."""
    stiffness, damping = np.diag([1000.0, 0.0, 500.0]), np.diag([2.0, 0.0, 0.0])
    device = SimpleNamespace(jacobian=lambda _: np.diag([0.1, 0.1, 0.0]))
    loop: Any = SimpleNamespace(stiffness=stiffness, damping=damping, device=device, pose=None)
    found = LoopResponse.desired(loop, np.array([1.0, 30.0]))
    assert found.shape == (2, 3, 3)
    np.testing.assert_allclose(found[1], stiffness + 60j * np.pi * damping)
    np.testing.assert_array_equal(LoopResponse.directions(loop), [[1.0, 0.0, 0.0]])
    loop.device = SimpleNamespace(jacobian=lambda _: np.eye(3))
    np.testing.assert_array_equal(LoopResponse.directions(loop), [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    normal = np.array([0.6, 0.0, 0.8])
    loop.stiffness, loop.damping = 300.0 * np.outer(normal, normal), 0.1 * np.outer(normal, normal)
    np.testing.assert_allclose(np.abs(LoopResponse.directions(loop)), [normal], atol=1e-12)


@pytest.mark.parametrize("corner", [0.31, 4.7, 61.0])
def test_a_bandwidth_lies_between_the_frequencies_of_its_grid(corner: float) -> None:
    frequency = np.geomspace(0.01, 1000.0, 400)
    gain = np.abs(1.0 / (1.0 + 1j * frequency / corner))
    exact = corner * np.sqrt(2.0 / gain[0] ** 2 - 1.0)  # 3 dB below the gain at the first frequency
    assert _bandwidth(frequency, gain) == pytest.approx(exact, rel=2e-4)
    assert _bandwidth(frequency, np.ones(400)) == np.inf


@pytest.mark.parametrize("stiffness", ["40 N/m", "80 N/m"])
def test_at_the_transparency_bandwidth_the_stiffness_deviates_by_the_noticeable_difference(stiffness: str) -> None:
    tables = slider(stiffness, "0.03 N*s/m")
    found = measure_performance({**tables, "run": {"duration": "0.1 s"}}).along[0].transparency_bandwidth
    deviation = felt(tables, [found]) / response(tables).desired(np.array([found]))[:, 0, 0] - 1.0
    assert abs(deviation[0]) == pytest.approx(0.23, rel=1e-3)


def test_the_least_and_largest_stiffness_of_the_band_are_those_of_a_dense_grid() -> None:
    """The weight of the arm off its start turns it into an oscillator with little friction in the band."""
    tables = {
        "device": {"name": "phantom-premium-1.5a-rotors"},
        "start": {"pose": ["0.2 rad", "2.2 rad", "3.3 rad"]},
        "servo": {"period": "0.25 ms", "topology": "impedance_display"},
        "object": {"kind": "spring", "stiffness": "260 N/m"},
        "run": {"duration": "0.05 s"},
    }
    found, loop = measure_performance(tables), response(tables)
    dense = np.linspace(0.5, 8.0, 6000)
    for one in found.along:
        n = np.array(one.direction)
        values = (1.0 / (n @ loop.displacement(dense) @ n)).real
        size = np.ptp(values)
        assert one.band_stiffness[0] <= values.min() + 1e-9 * size
        assert one.band_stiffness[1] >= values.max() - 1e-9 * size


def test_an_unstable_loop_has_no_ripple_and_its_page_no_green_tick() -> None:
    found = measure_performance(slider("300 N/m", run={"duration": "1 s"}))
    assert found.ripple is None
    assert found.remark.startswith("The run is unstable, an oscillation by ")


@pytest.mark.parametrize("slow", [11.0, 15.0])
def test_a_motion_slower_than_a_ripple_is_none(slow: float) -> None:
    """The window spreads its line over 20 Hz; a ripple beside it keeps its line."""
    t = T * np.arange(500)
    motion = 1e-3 * np.sin(2 * np.pi * slow * t)
    assert ripple(motion, T).ratio < 0.05
    beside = ripple(motion + 0.5e-6 * np.sin(2 * np.pi * 250 * t), T)
    assert beside.worst == pytest.approx(250.0)
    assert beside.ratio == pytest.approx(5.0, rel=0.02)


@pytest.mark.parametrize(("length", "first"), [(80, 70), (10, 7), (7, 3)])
def test_the_ripple_is_that_of_the_quietest_half_second_in_contact(
    length: int, first: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows begin an eighth of their length apart, or at every sample; one off its object does not count."""
    seen: list[Any] = []
    monkeypatch.setattr(performance, "ripple", lambda tip, period: seen.append((tip, period)) or "the ripple")
    rng = np.random.default_rng(0)
    scenario: Any = SimpleNamespace(
        period=0.5 / length / 2, run=SimpleNamespace(record_every=2), device=SimpleNamespace(encoder=True)
    )
    tip = rng.normal(size=(4 * length, 3))
    tip[first : first + length] *= 0.1
    tip[3 * length - length // 2 :] *= 0.01  # off the object
    touching = np.ones((len(tip), 1))
    touching[3 * length - length // 2 :: 3] = 0.0
    trace: Any = {"tip": tip, "touching": touching}
    run = SimpleNamespace(
        completed=True, verdict=SimpleNamespace(state=State.SETTLED, reason="it swings"), __getitem__=None,
        unstable_from=0.25,
    )  # fmt: skip

    class Run(dict):
        def __getattr__(self, name: str) -> Any:
            return getattr(run, name)

    assert performance._ripple(scenario, Run(trace)) == ("the ripple", "the ripple")
    np.testing.assert_array_equal(seen[0][0], tip[first : first + length])
    assert seen[0][1] == pytest.approx(0.5 / length)
    scenario.device.encoder = False
    assert performance._ripple(scenario, Run(trace))[1] == (
        "the ripple Encoder counts, the main cause of ripple, are switched off (device.encoder)."
    )
    short = Run({"tip": tip, "touching": np.zeros_like(touching)})
    assert performance._ripple(scenario, short) == (
        None, "The contact is shorter than 0.5 s: too short to measure the ripple."
    )  # fmt: skip
    run.verdict.state = State.UNSTABLE
    assert performance._ripple(scenario, short)[1].startswith("The run is unstable, it swings: ")
    run.completed = False
    assert performance._ripple(scenario, short)[1].startswith("The run diverges at 0.25 s: ")
