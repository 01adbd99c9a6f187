"""What a hand feels: closed forms, limits, and the simulated loop shaken by a sine."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flexible_device import device_file
from palpate import simulate
from palpate.cli.main import app
from palpate.devices import Device, load
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
from palpate.metrics.performance import (
    DirectionalPerformance,
    Performance,
    _bandwidth,
    _least,
    _precision,
    _static_stiffness,
    _transparent_up_to,
)
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_arm
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


HAND = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"}
FINGER = {**HAND, "tissue_stiffness": "500 N/m", "tissue_damping": "0.5 N*s/m"}


@pytest.mark.parametrize("operator", [None, HAND, FINGER], ids=["no arm", "rigid grip", "fingertip"])
def test_the_simulated_arm_under_lqg_shaken_by_a_sine(operator: dict[str, Any] | None) -> None:
    """The nonlinear arm with a controller: a millinewton of the reference moves the object's force as it should."""
    tables = Scenario.from_file(SCENARIOS / "press-stiff-cube-lqg.toml").to_dict()
    tables |= {} if operator is None else {"operator": operator}
    frequency = 8.0
    tables["reference"] = {"shape": "sine", "force": ["0.01 N", "0 N", "0 N"], "frequency": f"{frequency} Hz"}
    tables["run"] = {"duration": "2 s", "substeps": 4}
    trace = simulate(tables)
    tail = slice(-round(1 / trace.time[1]), None)
    turn = np.exp(-2j * np.pi * frequency * trace.time[tail])
    answered = 2 * np.mean(trace["object_force"][tail, 0] * turn)
    asked = 2 * np.mean(trace["reference_force"][tail, 0] * turn)
    scenario = Scenario.from_dict(tables)
    ours = LoopResponse.of(scenario).reference([frequency], scenario_arm(scenario))[0, 0, 0]
    assert answered / asked == pytest.approx(ours, rel=3e-3)


def test_a_textured_wall_acts_along_its_normal_as_a_plain_one() -> None:
    wall = {"kind": "wall", "stiffness": "0.5 N/mm", "normal": [0, 0, 1]}
    texture = {"wavelength": "2 mm", "across": [1, 0, 0], "lateral_force": "0.01 N"}
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"topology": "impedance_display"},
    }
    plain, textured = (
        response({**tables, "object": o}) for o in (wall, {**wall, "kind": "textured_wall", "texture": texture})
    )
    np.testing.assert_array_equal(textured.directions(), plain.directions())
    np.testing.assert_array_equal(textured.displacement([3.0]), plain.displacement([3.0]))


def test_a_tip_that_sticks_to_a_mesh_meets_the_spring_of_its_proxy_in_all_directions() -> None:
    """On a tilted mesh the device's inertia couples them: the response is that of a spring, not of a wall."""
    surface = {"stiffness": "0.5 N/mm", "damping": "1 N*s/m"}
    mesh = {
        "kind": "mesh",
        "position": ["0 mm", "0 mm", "-0.5 mm"],
        "mesh": {"shape": "box", "edge": "100 mm", "divisions": 4, "rotation": ["30 deg", "20 deg", "0 deg"]},
    }
    tables = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "ramp", "rise": "0.2 s", "force": ["-0.2962 N", "0.5 N", "-0.8138 N"]},
        "run": {"duration": "2 s"},
    }
    rough = {"static_friction": 0.9}
    for extra, across in ((rough, 500.0), ({**rough, "tangential": "0.2 N/mm"}, 200.0), ({}, 0.0)):
        scenario = Scenario.from_dict({**tables, "object": {**mesh, "surface": {**surface, **extra}}})
        trace = simulate(scenario)
        loop, n = LoopResponse.on_mesh(scenario, trace), trace["normal"][-1]
        np.testing.assert_allclose(loop.directions(), [n])
        np.testing.assert_allclose(loop.stiffness, 500.0 * np.outer(n, n) + across * (np.eye(3) - np.outer(n, n)))
        if across == 500.0:  # a sine of the force along the normal, about the rest
            time = np.arange(0.0, 4.0, 0.002)
            force = np.outer(-1.0 + 0.05 * np.sin(8 * np.pi * time), n)
            rows = [[f"{0.2 + t:.4f} s", *(f"{x} N" for x in f)] for t, f in zip(time, force, strict=True)]
            table = [["0 s", "0 N", "0 N", "0 N"], *rows]
            shaken = simulate(
                {
                    **scenario.to_dict(),
                    "operator": {"kind": "force", "shape": "table", "table": table},
                    "run": {"duration": "4.2 s"},
                }
            )
            tail = slice(-1000, None)  # four periods of 4 Hz
            turn = np.exp(-8j * np.pi * shaken.time[tail])
            moved, pushed = (np.mean(shaken[name][tail] @ n * turn) for name in ("tip", "operator_force"))
            assert pushed / moved == pytest.approx(1.0 / (n @ loop.displacement([4.0])[0] @ n), rel=0.02)


def test_the_desired_stiffness_is_that_of_the_object_and_not_of_the_design() -> None:
    """A normalized controller sees its design stiffness; transparency is about the object."""
    tables = Scenario.from_file(SCENARIOS / "press-stiff-cube-lqg.toml").to_dict()
    controller = {**tables["controller"], "stiffness": "1 N/mm", "normalize": True}
    spring = {"kind": "spring", "stiffness": "0.55 N/mm", "damping": "1 N*s/m"}
    loop = response({**tables, "controller": controller, "object": spring})
    np.testing.assert_allclose(loop.stiffness, 1000.0 * np.eye(3))
    np.testing.assert_allclose(loop.desired(np.array([2.0]))[0], (550.0 + 4j * np.pi) * np.eye(3))


def test_a_device_with_a_flexible_mode_is_refused(tmp_path: Path) -> None:
    """The frequency responses are those of a rigid device."""
    tables = slider("80 N/m")
    tables["device"] = {"name": device_file(tmp_path, load("slider"), 40.0)}
    with pytest.raises(StabilityError, match=r"device\.rigid: .* has a flexible mode: write rigid = true"):
        measure_performance(tables)
    tables["device"]["rigid"] = True
    assert measure_performance(tables).along[0].static_stiffness > 0.0


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


def test_an_arm_that_the_force_bandwidth_assumes_is_stated() -> None:
    """The same number as with that arm in the scenario, which is then no assumption. Force tracking has no such arm."""
    run = {"duration": "20 ms"}
    bare = measure_performance(slider(run=run))
    arm = {"kind": "arm", "mass": "150 g", "damping": "4.5 N*s/m", "stiffness": "560 N/m",
           "tissue_stiffness": "500 N/m", "tissue_damping": "0.5 N*s/m"}  # fmt: skip
    held = measure_performance(slider(operator=arm, run=run))
    assert bare.along[0].bandwidth == held.along[0].bandwidth
    assert bare.assumption == bare.to_dict()["assumption"] == (
        "The scenario has no arm; the force bandwidth assumes one of 0.15 kg, 4.5 N s/m and 560 N/m behind tissue of "
        "500 N/m and 0.5 N s/m."
    )  # fmt: skip
    assert held.assumption == ""
    tracking = {"servo": {"period": "1 ms", "topology": "force_tracking"}, "operator": {"kind": "none"}}
    assert measure_performance(slider(**tracking, reference={"force": "0.1 N"}, run=run)).assumed_arm is None


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
    with pytest.raises(StabilityError, match="at least one period, 1 ms"):
        rate_hardness(loop, (1, 0, 0), window=4e-4)


@pytest.mark.parametrize("period", [2e-3, 1e-3, 1e-4])
@pytest.mark.parametrize("delay", [0, 1, 4])
def test_rate_hardness_of_a_spring_at_a_heavy_device_is_that_of_the_last_sample_that_acts(
    period: float, delay: int
) -> None:
    """The held force at 10 ms is that of the sample one period and the delay before."""
    tables = slider("200 N/m", delay=delay)
    tables["servo"]["period"] = f"{1e3 * period} ms"
    loop = response(tables)
    heavy = Device(loop.device.name, "", "slider", loop.device.parameters.with_values(mass__tip=1e4))
    found = rate_hardness(replace(loop, device=heavy), (1, 0, 0))
    assert found == pytest.approx(200.0 * (1.0 - (delay + 1) * period / 10e-3), rel=1e-3)


def test_no_force_arrives_within_a_delay_of_the_window() -> None:
    found = measure_performance(slider(delay=12, run={"duration": "20 ms"}))
    assert found.along[0].rate_hardness == 0.0


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


@pytest.mark.parametrize("every", [4, 40])
def test_the_ripple_does_not_depend_on_the_samples_that_a_run_records(every: int) -> None:
    """A ripple of five times the threshold near 240 Hz; every fourth sample shows it as one below the threshold."""
    arm = {"kind": "arm", "mass": "150 g", "damping": "4.5 N*s/m", "stiffness": "560 N/m",
           "tissue_stiffness": "500 N/m", "tissue_damping": "0.5 N*s/m"}  # fmt: skip
    push = {"shape": "step", "force": ["3 N", "0 N", "0 N"]}
    tables = slider("500 N/m", "4 N*s/m", operator={**arm, **push})
    tables["device"]["encoder"] = True
    all_of_them, few = (
        measure_performance({**tables, "run": {"duration": "2 s", "record_every": n}}).ripple for n in (1, every)
    )
    assert all_of_them is not None
    assert few is not None
    assert all_of_them.ratio > 3.0
    assert (few.worst, few.ratio) == (all_of_them.worst, all_of_them.ratio)


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
    loop: Any = SimpleNamespace(stiffness=stiffness, damping=damping, device=device, pose=None, normal=None, own=None)
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


@pytest.mark.parametrize("length", [80, 10, 7])
@pytest.mark.parametrize("lifted", [True, False])
def test_the_ripple_is_that_of_the_last_half_second_in_contact(
    length: int, lifted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A quieter one before does not count, nor does one in which the tip leaves its object."""
    seen: list[Any] = []
    monkeypatch.setattr(performance, "ripple", lambda tip, period: seen.append((tip, period)) or "the ripple")
    rng = np.random.default_rng(0)
    scenario: Any = SimpleNamespace(
        period=0.5 / length / 2, run=SimpleNamespace(record_every=2), device=SimpleNamespace(encoder=True)
    )
    tip = rng.normal(size=(4 * length, 3))
    tip[:length] *= 0.1
    touching, end = np.ones((len(tip), 1)), len(tip)
    if lifted:
        end = 3 * length - length // 2
        touching[end::3] = 0.0
    trace: Any = {"tip": tip, "touching": touching}
    run = SimpleNamespace(
        completed=True, verdict=SimpleNamespace(state=State.SETTLED, reason="it swings"), __getitem__=None,
        unstable_from=0.25,
    )  # fmt: skip

    class Run(dict):
        def __getattr__(self, name: str) -> Any:
            return getattr(run, name)

    assert performance._ripple(scenario, Run(trace)) == ("the ripple", "the ripple")
    np.testing.assert_array_equal(seen[0][0], tip[end - length : end])
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


def test_a_line_of_the_spectrum_keeps_its_amplitude_whatever_the_drift() -> None:
    """Sines on lines of the spectrum: exact amplitudes, each axis by itself, and a straight motion adds nothing."""
    t = T * np.arange(1000)
    waves = np.stack([3e-6 * np.sin(2 * np.pi * 60 * t), 4e-6 * np.cos(2 * np.pi * 60 * t), 0.0 * t], axis=1)
    waves[:, 2] = 0.5e-6 * np.sin(2 * np.pi * 250 * t)
    found = ripple(waves, T)
    assert found.frequency[-1] == 499.0
    np.testing.assert_allclose(np.diff(found.frequency), 1.0)

    def amplitudes(motion: np.ndarray) -> dict[int, float]:
        one = ripple(motion, T)
        return {round(f): a for f, a in zip(one.frequency, one.amplitude, strict=True)}

    at = amplitudes(waves)
    assert (at[60], at[250]) == pytest.approx((5e-6, 0.5e-6), rel=1e-3)  # less the trend of the sine itself
    np.testing.assert_allclose(found.threshold, vibration_threshold(found.frequency))
    assert (found.worst, found.ratio) == (250.0, pytest.approx(5.0, rel=1e-4))
    drifting = amplitudes(waves + np.outer(1.0 + 5.0 * t, [1.0, -2.0, 3.0]))
    assert all(drifting[f] == pytest.approx(at[f], abs=1e-12) for f in range(58, 500))
    even = 2e-6 * np.cos(2 * np.pi * 100 * (t - t.mean()))  # without a trend of its own
    assert amplitudes(even)[100] == pytest.approx(2e-6, rel=1e-9)
    lowest = np.cos(2 * np.pi * 20 * (T * np.arange(500) - T * 249.5))  # of ten periods, the least that count
    least = ripple(1e-6 * lowest, T)
    assert least.frequency[0] == 20.0
    assert least.amplitude[0] == pytest.approx(1e-6, rel=1e-11)
    assert str(found) == "The ripple is perceptible: 0.5 µm at 250 Hz, 5 times the threshold of a fingertip."
    faint = replace(found, amplitude=0.1 * found.amplitude, ratio=0.5)
    assert str(faint) == "The ripple is not perceptible: 0.05 µm at 250 Hz, 0.5 of the threshold of a fingertip."
    assert [replace(found, ratio=ratio).perceptible for ratio in (1.0, 1.01)] == [False, True]


@pytest.mark.parametrize(("samples", "lowest"), [(500, 20.0), (499, 20.0), (250, 40.0), (249, 40.0)])
def test_a_ripple_needs_ten_periods_of_its_lowest_frequency(samples: int, lowest: float) -> None:
    tip = np.random.default_rng(0).normal(size=samples)
    if samples % 10:
        with pytest.raises(StabilityError) as caught:
            ripple(tip, T, lowest)
        assert str(caught.value) == (
            f"tip: {samples / 1e3:g} s is too short a stretch to resolve {lowest:g} Hz, which takes {10 / lowest:g} s"
        )
    else:
        assert ripple(tip, T, lowest).frequency[0] >= lowest
    with pytest.raises(StabilityError, match=r"^tip: a motion must be finite$"):
        ripple(np.append(tip, np.nan), T, lowest)
    with pytest.raises(StabilityError, match="period must be positive"):
        ripple(tip, 0.0, lowest)


@pytest.mark.parametrize("crossing", [0.2, 23.0, 311.0])
def test_a_transparent_range_ends_at_the_last_of_a_thousand_steps_below_the_noticeable_difference(
    crossing: float,
) -> None:
    """Between two frequencies of the grid, in steps of a 1024th of their ratio; 23 % belong to it."""
    grid = np.geomspace(0.1, 499.0, 400)
    ratio = math.log(4990.0) / 399 / 1024
    steps = math.floor(math.log(crossing / 0.1) / ratio)
    found = _transparent_up_to(grid, lambda f: 0.23 * np.asarray(f) / crossing)
    assert found == pytest.approx(0.1 * math.exp(ratio * steps), rel=1e-9)
    assert _transparent_up_to(grid, lambda f: np.full(len(f), 0.23)) == pytest.approx(499.0)
    assert _transparent_up_to(grid, lambda f: np.where(f < 0.2, 0.2300001, 0.0)) == 0.0


@pytest.mark.parametrize("least", [0.5, 1.234567, 3.3, 8.0])
def test_the_least_of_a_band_is_found_within_a_four_thousandth_of_its_grid(least: float) -> None:
    step = 7.5 / 599 / 4096
    nearest = abs((least - 0.5) - step * round((least - 0.5) / step))
    assert _least(lambda f: 5.0 + np.abs(f - least)) == pytest.approx(5.0 + nearest, abs=1e-12)
    assert (_least(lambda f: f), -_least(lambda f: -f)) == pytest.approx((0.5, 8.0))


def test_a_gain_falls_by_3_db_from_that_at_the_first_frequency() -> None:
    """Linear in the logarithm of the frequency between two; a gain that touches the level does not fall below it."""
    f = np.array([1.0, 10.0, 100.0, 1000.0])
    level = 2.0 / np.sqrt(2.0)
    assert _bandwidth(f, np.array([2.0, 1.5, 1.0, 0.1])) == pytest.approx(10.0 ** (1.0 + (1.5 - level) / 0.5))
    assert _bandwidth(f, np.array([2.0, 1.0, 3.0, 0.1])) == pytest.approx(10.0 ** (2.0 - level))
    assert _bandwidth(f, np.array([2.0, 2.0, level, level])) == np.inf


def test_a_static_stiffness_is_that_at_a_thousandth_of_a_hertz_unless_it_doubles() -> None:
    def loop(slow: complex, slower: complex) -> Any:
        values = {2e-3: slow, 1e-3: slower}
        return SimpleNamespace(
            displacement=lambda f: np.array([np.diag([1.0 / values[one], 1.0, 1.0]) for one in f]),
            reference=lambda f, _arm: np.array([np.diag([values[one], 1.0, 1.0]) for one in f]),
            desired=lambda f: np.array([np.diag([values[one], 1.0, 1.0]) for one in f]),
        )

    x = np.array([1.0, 0.0, 0.0])
    assert _static_stiffness(loop(100.0, 149.0 + 1j), x) == pytest.approx(149.0)
    assert _static_stiffness(loop(100.0, 151.0), x) == np.inf
    assert _static_stiffness(loop(100j, 151j), x) == np.inf
    for value, error in ((0.75 + 1j, 0.25), (1.5, 0.5)):
        assert _precision(loop(100.0, value), x, None) == pytest.approx(error)
    for static, error in ((300.0, 0.5), (100.0, 0.5)):
        assert _precision(loop(7.0, 200.0 + 9j), x, static) == pytest.approx(error)


def test_a_direction_of_the_slider_in_closed_form() -> None:
    """Every number of one direction from the formulas of a mass behind a hold, and as JSON."""
    tables = slider("80 N/m", "0.5 N*s/m", 1, run={"duration": "20 ms"}, title="it")
    found = measure_performance(tables)
    (one,) = found.along
    loop = response(tables)
    f = np.geomspace(0.1, 499.0, 400)
    s, z = 2j * np.pi * f, np.exp(2j * np.pi * f * T)
    np.testing.assert_allclose(one.frequency, f)
    np.testing.assert_allclose(one.rendered, felt(tables, f), rtol=1e-9)
    np.testing.assert_allclose(one.desired, 80.0 + 0.5 * s, rtol=1e-9)
    np.testing.assert_allclose(one.free, MASS * s**2 + B * s, rtol=1e-9)
    np.testing.assert_allclose(one.impedance, felt(tables, f) / s, rtol=1e-9)
    assert one.direction == (1.0, 0.0, 0.0)
    assert one.static_stiffness == pytest.approx(felt(tables, [1e-3])[0].real, rel=1e-9)
    assert one.precision == pytest.approx(abs(one.static_stiffness / 80.0 - 1.0))
    arm = HumanArm(0.15, 4.5, 560.0, 500.0, 0.5)
    assert one.bandwidth == pytest.approx(_bandwidth(f, np.abs(loop.transmitted(f, arm, [1, 0, 0]))))
    assert one.rate_hardness == pytest.approx(rate_hardness(loop, [1, 0, 0]))
    assert one.rate_hardness == pytest.approx(rate_hardness(loop, [-7.0, 0, 0]))
    assert abs(z[0]) == pytest.approx(1.0)
    whole = found.to_dict()
    direction = whole["directions"][0]
    assert direction == {
        "direction": [1.0, 0.0, 0.0],
        "static_stiffness_N_per_m": one.static_stiffness,
        "stiffness_0.5_to_8_Hz_N_per_m": list(one.band_stiffness),
        "transparency_bandwidth_Hz": one.transparency_bandwidth,
        "rate_hardness_N_per_m": one.rate_hardness,
        "force_bandwidth_Hz": one.bandwidth,
        "static_precision": one.precision,
        "frequency_Hz": one.frequency.tolist(),
        "impedance_real_N_s_per_m": one.impedance.real.tolist(),
        "impedance_imag_N_s_per_m": one.impedance.imag.tolist(),
    }
    assert (whole["title"], whole["ripple"]) == ("it", None)
    assert whole["remark"] == found.remark == "The contact is shorter than 0.5 s: too short to measure the ripple."


def test_a_loop_that_tracks_a_force_has_the_bandwidth_of_its_reference_and_no_rate_hardness() -> None:
    tables = slider("80 N/m", "0.5 N*s/m")
    tables["servo"]["topology"] = "force_tracking"
    del tables["operator"]
    tables |= {"reference": {"force": ["0.1 N", "0 N", "0 N"]}, "run": {"duration": "20 ms"}}
    (one,) = measure_performance(tables).along
    loop, f = response(tables), np.geomspace(0.1, 499.0, 400)
    assert np.isnan(one.rate_hardness)
    assert one.bandwidth == pytest.approx(_bandwidth(f, np.abs(loop.reference(f)[:, 0, 0])))
    assert one.precision == pytest.approx(abs(loop.reference([1e-3])[0, 0, 0].real - 1.0), abs=1e-12)


def test_performance_is_written_with_null_for_what_is_not_finite(tmp_path: Path) -> None:
    device = measure_performance(slider(run={"duration": "20 ms"})).device
    one = DirectionalPerformance(
        (0.0, 0.0, 1.0), np.array([1.0]), np.array([1j]), np.array([2j]), np.array([3j]),
        np.inf, (1.0, np.inf), 2.0, np.nan, np.inf, np.inf,
    )  # fmt: skip
    line = ripple(1e-6 * np.sin(2 * np.pi * 250 * T * np.arange(1000)), T)
    whole = Performance("it", "impedance_display", np.inf, (one,), line, "said", device).to_dict()
    assert whole["hold_bandwidth_Hz"] is None
    assert whole["ripple"] == {"frequency_Hz": 250.0, "over_threshold": line.ratio, "perceptible": True}
    direction = whole["directions"][0]
    assert [direction[key] for key in (
        "static_stiffness_N_per_m", "stiffness_0.5_to_8_Hz_N_per_m", "transparency_bandwidth_Hz",
        "rate_hardness_N_per_m", "force_bandwidth_Hz", "static_precision",
    )] == [None, [1.0, None], 2.0, None, None, None]  # fmt: skip
    assert whole["device"] == {
        "peak_force_N": [None if np.isinf(x) else x for x in device.peak_force],
        "continuous_force_N": [None if np.isinf(x) else x for x in device.continuous_force],
        "peak_acceleration_m_per_s2": [None if np.isinf(x) else x for x in device.peak_acceleration],
        "tip_mass_kg": list(device.tip_mass),
        "kinematic_isotropy": device.kinematic_isotropy,
        "inertial_isotropy": device.inertial_isotropy,
        "moving_force_N": list(device.moving_force),
        "dynamic_range_dB": None if np.isinf(device.dynamic_range) else device.dynamic_range,
        "resolution_m": device.resolution,
    }
    made = Performance("it", "impedance_display", np.inf, (one,), None, "said", device)
    assert json.loads(made.save(tmp_path / "a.json").read_text())["ripple"] is None
    with pytest.raises(ValueError, match=r"performance is saved as \.json"):
        made.save(tmp_path / "a.csv")


ARM_LOOP: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a", "delay": 1},
    "start": {"pose": ["0.2 rad", "2.1 rad", "3.2 rad"]},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
}


@pytest.mark.parametrize("coupling", ["backward", "bilinear"])
def test_an_object_before_a_controller_acts_by_its_sampled_law(coupling: str) -> None:
    """The closed loop is written out by a solve at the tip: x = (1 - R z^-n C O)^-1 ... for one frequency at a time."""
    tables = {
        **ARM_LOOP,
        "object": {"kind": "spring", "stiffness": ["300 N/m", "100 N/m", "50 N/m"], "coupling": coupling,
                   "damping": ["1 N*s/m", "0.5 N*s/m", "0 N*s/m"]},
        "operator": {"kind": "force", "force": ["0.1 N", "0 N", "0 N"]},
    }  # fmt: skip
    one = np.eye(3)
    turn = np.array([[0.6, 0.2, 0.0], [-0.1, 0.7, 0.1], [0.0, 0.3, 0.5]])
    tables["controller"] = {
        "kind": "state_space", "A": (0.6 * one).tolist(), "B": np.hstack([0 * one, one]).tolist(),
        "C": (-0.15 * turn).tolist(), "D": np.hstack([0 * one, -0.5 * turn]).tolist(),
    }  # fmt: skip
    loop = replace(response(tables), gravity_compensation=False)
    assert loop.coupling == coupling
    jacobian = loop.device.jacobian(loop.pose)
    stiffness, damping = np.diag([300.0, 100.0, 50.0]), np.diag([1.0, 0.5, 0.0])
    for f in (1.0, 30.0, 210.0):
        z = np.exp(2j * np.pi * f * T)
        rate = (1 - 1 / z) / T if coupling == "backward" else 2 / T * (z - 1) / (z + 1)
        law = (-0.5 * turn - 0.15 * turn / (z - 0.6)) @ (stiffness + rate * damping)
        free = jacobian @ loop._device(np.array([f]))[0] @ jacobian.T
        held = jacobian @ loop._sampled(np.array([f]))[0] @ jacobian.T
        samples = np.linalg.solve(one - held @ law / z, free)
        expected = free + hold_response([f], T)[0] / z * free @ law @ samples
        np.testing.assert_allclose(loop.displacement([f])[0], expected, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(loop.desired(np.array([f]))[0], stiffness + 2j * np.pi * f * damping)
        np.testing.assert_allclose(loop.displacement([f], object_on=False)[0], free, rtol=1e-9, atol=1e-15)


def test_the_force_of_an_object_per_reference_is_that_of_the_loop_at_the_tip() -> None:
    one = np.eye(3)
    turn = np.array([[0.6, 0.2, 0.0], [-0.1, 0.7, 0.1], [0.0, 0.3, 0.5]])
    tables = {
        **ARM_LOOP,
        "servo": {"period": "1 ms"},
        "reference": {"force": ["0.1 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": ["300 N/m", "100 N/m", "50 N/m"], "damping": "0.5 N*s/m"},
        "controller": {
            "kind": "state_space", "A": (0.6 * one).tolist(), "B": np.hstack([turn, one]).tolist(),
            "C": (0.3 * one).tolist(), "D": np.hstack([0.8 * one, -0.5 * turn]).tolist(),
        },
    }  # fmt: skip
    loop = replace(response(tables), gravity_compensation=False)
    jacobian = loop.device.jacobian(loop.pose)
    for f in (1.0, 30.0, 210.0):
        z = np.exp(2j * np.pi * f * T)
        touched = np.diag([300.0, 100.0, 50.0]) + (1 - 1 / z) / T * 0.5 * one
        forward = 0.8 * one + 0.3 * turn / (z - 0.6)
        back = (-0.5 * turn + 0.3 * one / (z - 0.6)) @ touched
        held = jacobian @ loop._sampled(np.array([f]))[0] @ jacobian.T / z
        expected = touched @ np.linalg.solve(one - held @ back, held @ forward)
        np.testing.assert_allclose(loop.reference([f])[0], expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("design", [None, (400.0, 100.0, 50.0), (201.0, 200.0, 200.0)])
def test_a_wall_acts_along_its_normal_alone(design: tuple[float, ...] | None) -> None:
    """A normalized controller sees its own stiffness on each axis, and the damping in that ratio."""
    normal = np.array([0.6, 0.0, 0.8])
    wall = {"kind": "wall", "normal": normal.tolist(), "stiffness": "200 N/m", "damping": "2 N*s/m"}
    scenario = Scenario.from_dict({**ARM_LOOP, "object": wall, "operator": {"kind": "none"}})
    law = replace(LoopResponse.of(scenario).controller, design_stiffness=None if design is None else np.array(design))
    loop = LoopResponse.of(scenario, law)
    k = 200.0 if design is None else 0.36 * design[0] + 0.64 * design[2]
    np.testing.assert_allclose(loop.stiffness, k * np.outer(normal, normal), atol=1e-9)
    np.testing.assert_allclose(loop.damping, 0.01 * k * np.outer(normal, normal), atol=1e-12)
    assert loop.controller is law
    assert (loop.period, loop.delay, loop.coupling, loop.gravity_compensation) == (T, 1, "backward", True)
    np.testing.assert_allclose(loop.pose, [0.2, 2.1, 3.2])


def test_a_soft_object_and_a_damper_alone_act_in_their_directions() -> None:
    tables = {**ARM_LOOP, "operator": {"kind": "none"}}
    soft = {
        "kind": "spring",
        "stiffness": ["0.5 N/m", "0 N/m", "0 N/m"],
        "damping": ["0 N*s/m", "0.2 N*s/m", "0 N*s/m"],
    }
    loop = response({**tables, "object": soft})
    np.testing.assert_array_equal(loop.directions(), np.eye(3)[:2])
    equal = {**soft, "damping": ["0.5 N*s/m", "0.2 N*s/m", "0 N*s/m"]}
    np.testing.assert_array_equal(response({**tables, "object": equal}).directions(), np.eye(3)[:2])
    device = SimpleNamespace(jacobian=lambda _: np.diag([1e-9, 2e-10, 1e-19]))
    small: Any = SimpleNamespace(
        stiffness=np.eye(3), damping=0 * np.eye(3), device=device, pose=None, normal=None, own=None
    )
    np.testing.assert_array_equal(LoopResponse.directions(small), np.eye(3)[:2])
    small.device = SimpleNamespace(jacobian=lambda _: np.diag([1e-9, 2e-10, 1.5e-18]))
    np.testing.assert_array_equal(LoopResponse.directions(small), np.eye(3))
    guarded = {**tables, "object": soft, "guard": {"kind": "half_sample"}}
    with pytest.raises(StabilityError, match="a guard makes the loop nonlinear"):
        response(guarded)
    for wrong in ([0.0], [500.0], [-1.0], [1.0, 500.1]):
        with pytest.raises(
            StabilityError, match=r"^frequencies must lie above 0 and below half the sampling rate, 500 Hz$"
        ):
            loop.displacement(wrong)


def test_rate_hardness_behind_a_controller_with_a_state_written_out() -> None:
    """Its state adds to the force of a tick what it kept of the ticks before."""
    x, v, kept, commands = 0.0, 1.0, 0.0, []
    a, tau = np.exp(-B * T / MASS), MASS / B
    for _ in range(10):
        force = 200.0 * x
        commands.append(0.2 * kept + 0.5 * force)
        kept = 0.6 * kept + force
        x, v = (
            x + tau * (1 - a) * v - (T - tau * (1 - a)) / B * commands[-1],
            a * v - (1 - a) / B * commands[-1],
        )
    one = np.eye(3)
    tables = slider("200 N/m")
    tables["controller"] = {
        "kind": "state_space", "A": (0.6 * one).tolist(), "B": np.hstack([0 * one, one]).tolist(),
        "C": (-0.2 * one).tolist(), "D": np.hstack([0 * one, -0.5 * one]).tolist(),
    }  # fmt: skip
    assert rate_hardness(response(tables), (1, 0, 0)) == pytest.approx(commands[9] / 10e-3, rel=1e-8)
