"""Admittance display: the measured force of the operator moves a tool, which the tip follows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from flexible_device import device_file
from palpate.arrays import Array
from palpate.control import workspace
from palpate.devices import load
from palpate.errors import ScenarioError, StabilityError
from palpate.linear import HumanArm
from palpate.linear.admittance_loop import admittance_loop, sensed_plant, tip_feedback
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.simulation import scenario_loop
from palpate.simulation.admittance import display_matrix
from palpate.simulation.verdict import State
from palpate.stability import admittance_coupling, certify, zwidth
from palpate.sweeps import sweep

POSE = np.array([0.0, 2.2305, 3.2776])
GRIP = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "100 N/m"}
TISSUE = {**GRIP, "tissue_stiffness": "700 N/m", "tissue_damping": "2 N*s/m"}
WALL = {"kind": "wall", "normal": [0, 0, 1], "stiffness": "20 N/mm"}


def display(**changed: Any) -> dict[str, Any]:
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": [f"{float(q)!r} rad" for q in POSE]},
        "servo": {
            "period": "0.5 ms",
            "topology": "admittance_display",
            "tool": {"mass": "0.1 kg", "damping": "2 N*s/m"},
        },
        "operator": {**GRIP, "force": ["0.1 N", "0 N", "-1 N"]},
        "object": WALL,
        "controller": {"kind": "workspace"},
        "run": {"duration": "0.4 s"},
        **changed,
    }


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"servo": {"topology": "admittance_display"}}, "servo.tool is missing: the operator moves a tool"),
        ({"servo": {"topology": "admittance_display", "tool": {"damping": "1 N*s/m"}}}, "mass"),
        ({"servo": {"topology": "admittance_display", "tool": {"mass": "0.1 kg"}}}, "damping"),
        (
            {"servo": {"topology": "admittance_display", "tool": {"mass": "0 kg", "damping": "1 N*s/m"}}},
            "0 kg; it must be positive",
        ),
        (
            {
                "servo": {"topology": "impedance_display", "tool": {"mass": "1 kg", "damping": "1 N*s/m"}},
                "controller": {"kind": "none"},
            },
            "only an admittance_display has a virtual tool",
        ),
        ({"controller": {"kind": "none"}}, 'follows the tool by the "workspace" controller'),
        ({"controller": {"kind": "workspace", "reference": "300 rad/s"}}, "controller.reference: the tool is"),
        ({"operator": {"kind": "none"}}, 'kind = "force" or "arm", not "none"'),
        ({"operator": {"kind": "fixed"}}, 'kind = "force" or "arm", not "fixed"'),
        ({"reference": {"force": "1 N"}}, "an admittance_display has no reference force"),
        ({"guard": {"kind": "half_sample"}}, "the motors of an admittance_display position the tip"),
        ({"device": {"name": "phantom-premium-1.5a", "model": "linear"}}, "leave out device.model"),
        ({"device": {"name": "phantom-premium-1.5a", "kinematics": "linear"}}, "leave out device.model"),
    ],
)
def test_parts_that_do_not_fit_are_refused(changed: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError) as error:
        Scenario.from_dict(display(**changed))
    assert says in str(error.value)


def test_a_controller_that_follows_no_tool_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"give palpate\.control\.workspace"):
        palpate.simulate(display(), lambda tick: tick.reference)
    given = workspace(load("phantom-premium-1.5a"), 5e-4, bandwidth=150.0)
    assert np.isfinite(palpate.simulate(display(run={"duration": "5 ms"}), given)["tool"]).all()


def test_a_scenario_keeps_its_tool_as_text_with_units() -> None:
    read = Scenario.from_dict(display())
    grams = display()
    grams["servo"] = {**grams["servo"], "tool": {"mass": "100 g", "damping": "0.002 N*s/mm"}}
    assert Scenario.from_dict(read.to_dict()) == read == Scenario.from_dict(grams)


@pytest.mark.parametrize("operator", [{"kind": "force"}, GRIP, TISSUE])
def test_the_steady_force_and_depth_on_a_wall_are_those_of_the_operator(operator: dict[str, Any]) -> None:
    """Law: at rest the wall's force is what the sensor reads, and the tool is F/K deep; the tip is at the tool."""
    force = {"force": ["0 N", "0 N", "-1 N"]}
    run = {"duration": "2 s"}
    trace = palpate.simulate(display(operator={**operator, **force}, run=run))
    assert trace["object_force"][-1, 2] == pytest.approx(trace["measured_force"][-1, 2], rel=1e-6)
    assert trace["object_force"][-1, 2] == pytest.approx(trace["operator_force"][-1, 2], rel=1e-6)
    assert trace["deflection"][-1, 2] == pytest.approx(trace["object_force"][-1, 2] / 20e3, rel=1e-9)
    assert np.abs(trace["tip"][-1] - trace["tool"][-1]).max() < 1e-7
    assert trace.verdict.state is State.SETTLED


def test_with_counts_the_tool_rests_exactly_and_the_tip_within_a_count() -> None:
    device = {"name": "phantom-premium-1.5a", "encoder": True, "saturation": True}
    push = {"kind": "force", "force": ["0 N", "0 N", "-1 N"]}
    trace = palpate.simulate(display(device=device, operator=push, run={"duration": "1 s"}))
    assert trace["object_force"][-1] == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    last = slice(-400, None)
    assert np.linalg.norm(trace["tip"][last] - trace["tool"][last], axis=1).max() < 1e-4


def test_the_display_turns_with_the_base_of_the_device() -> None:
    """Law: the first joint turns the arm about the vertical axis y, so turned inputs give a turned motion."""
    angle = 0.6
    turn = np.array([[np.cos(angle), 0.0, np.sin(angle)], [0.0, 1.0, 0.0], [-np.sin(angle), 0.0, np.cos(angle)]])
    device = load("phantom-premium-1.5a")
    yaw = np.array([angle, 0.0, 0.0])
    two = np.array([POSE, POSE - 0.3])
    two[1, 0] = POSE[0]
    way, turned = (np.subtract(*device.forward(poses)) for poses in (two, two + yaw))
    turn = turn if np.allclose(turn @ way, turned) else turn.T
    push, normal = np.array([0.2, 0.1, -1.0]), np.array([0.0, 0.0, 1.0])

    def run(pose: Array, f: Array, n: Array) -> Any:
        tables = display(start={"pose": [f"{float(q)!r} rad" for q in pose]}, run={"duration": "0.1 s"})
        tables["operator"] = {**GRIP, "force": [f"{float(x)!r} N" for x in f]}
        tables["object"] = {**WALL, "normal": n.tolist()}
        return palpate.simulate(tables)

    first, second = run(POSE, push, normal), run(POSE + yaw, turn @ push, turn @ normal)
    for name in ("tool", "tip", "object_force", "measured_force", "command_force"):
        one, other = (run[name] - (run[name][0] if name in ("tool", "tip") else 0.0) for run in (first, second))
        assert other == pytest.approx(one @ turn.T, rel=1e-6, abs=1e-9), name


@pytest.mark.parametrize(
    ("operator", "arm", "delay", "flexible"),
    [
        (GRIP, HumanArm(0.15, 4.5, 100.0), 0, False),
        (GRIP, HumanArm(0.15, 4.5, 100.0), 2, False),
        (TISSUE, HumanArm(0.15, 4.5, 100.0, 700.0, 2.0), 1, False),
        ({"kind": "force", "force": "0 N"}, None, 0, False),
        (GRIP, HumanArm(0.15, 4.5, 100.0), 1, True),
    ],
)
def test_the_linear_loop_is_the_small_motion_of_the_core(
    operator: dict[str, Any], arm: HumanArm | None, delay: int, flexible: bool, tmp_path: Path
) -> None:
    """A spring that is anchored beside the start is a small constant force on the tool."""
    rigid, stiffness, beside = load("phantom-premium-1.5a"), np.array([800.0, 500.0, 300.0]), 1e-6
    name = device_file(tmp_path, rigid, 60.0) if flexible else "phantom-premium-1.5a"

    def run(offset: float) -> Array:
        spring = {"kind": "spring", "stiffness": [f"{k} N/m" for k in stiffness], "position": [f"{offset!r} m"] * 3}
        chosen = {"name": name, "delay": delay}
        return palpate.simulate(display(device=chosen, operator=operator, object=spring, run={"duration": "40 ms"}))[
            "tool"
        ]

    device = load(name)
    feedback = tip_feedback(workspace(device, 5e-4), POSE, np.zeros(3))
    plant = sensed_plant(device, POSE, arm, np.zeros(3), 5e-4, feedback.axes)
    a, b, c = admittance_loop(plant, feedback, 0.1, 2.0, np.diag(stiffness), delay=delay)
    moved = run(beside) - run(0.0)
    state, tool = np.zeros(len(a)), [np.zeros(3)]
    for _ in range(len(moved) - 1):
        state = a @ state - b @ (stiffness * beside)
        tool.append(tool[-1] + 5e-4 * (c @ state))
    assert np.abs(moved).max() > 0.3 * beside
    assert np.abs(moved - tool).max() < 1e-3 * beside


@pytest.mark.parametrize("grip", [HumanArm(0.15, 4.5, 560.0), HumanArm(0.5, 20.0, 2000.0)])
def test_the_least_stable_tool_in_simulation_is_the_exact_limit(grip: HumanArm) -> None:
    mass = load("slider").mass_matrix(np.zeros(1))[0, 0]
    viscous = float(load("slider").viscous[0])
    least = admittance_coupling(mass=mass, damping=viscous, period=5e-4, operators=[grip]).exact
    assert 0.01 * mass < least < mass
    for share, decays in ((1.03, True), (0.97, False)):
        tool = {"mass": f"{share * least!r} kg", "damping": "0 N*s/m"}
        arm = {"kind": "arm", "mass": f"{grip.mass} kg", "damping": f"{grip.damping} N*s/m"}
        arm |= {"stiffness": f"{grip.stiffness} N/m", "rest": ["1 mm", "0 m", "0 m"]}
        tables = display(device={"name": "slider"}, start={}, operator=arm, object={"kind": "none"})
        tables["servo"] = {**tables["servo"], "tool": tool}
        trace = palpate.simulate(tables)
        change = np.abs(np.diff(trace["command_force"][:, 0], 2))
        assert bool(trace.completed and change[-100:].max() < change[200:300].max()) is decays


def test_the_tool_waits_for_a_tip_that_the_operator_pushes_through() -> None:
    """Law: 12 N for 20 ms exceed the motors' 8.5 N. Tip and tool go into the wall together, and rest at its surface."""
    pushes = [("0 ms", 1), ("50 ms", 1), ("51 ms", 12), ("70 ms", 12), ("71 ms", 1)]
    table = [[time, "0 N", "0 N", f"{-size} N"] for time, size in pushes]
    tables = display(operator={"kind": "force", "shape": "table", "table": table}, run={"duration": "1.5 s"})
    tables["device"] = {**tables["device"], "saturation": True}
    trace = palpate.simulate(tables)
    assert np.linalg.norm(trace["deflection"], axis=1).max() > 0.05
    assert np.linalg.norm(trace["tip"] - trace["tool"], axis=1).max() < 4e-3
    assert trace["object_force"][-1, 2] == pytest.approx(-1.0, abs=1e-3)


def test_a_stepped_loop_gives_the_trace_bit_for_bit() -> None:
    tables = display(run={"duration": "50 ms"})
    tables["servo"] = {**tables["servo"], "jitter": "0.1 ms"}
    whole, stepped = palpate.simulate(tables), palpate.Loop(tables).run()
    for name in ("tool", "measured_force", "torque", "angle"):
        assert np.array_equal(whole[name], stepped[name])


def test_a_certificate_agrees_with_the_run() -> None:
    stable = certify(display(run={"duration": "1 s"}))
    assert stable.verdict.state is State.STABLE
    assert all(stable.criteria.values())
    assert len(stable.criteria) == 4
    radius = stable.margin["spectral_radius_at_rest"]
    rest = display_matrix(Scenario.from_dict(display()))
    assert radius == pytest.approx(np.abs(np.linalg.eigvals(rest)).max(), rel=1e-3)
    light = display()
    light["servo"] = {**light["servo"], "tool": {"mass": "0.01 kg", "damping": "0 N*s/m"}}
    assert certify(light).verdict.state is State.UNSTABLE
    assert palpate.simulate(light).verdict.state is State.UNSTABLE


def test_the_loop_along_the_surface_counts() -> None:
    """At 0.05 kg the loop along the heaviest axis y is unstable in this grip, and that along the normal z is not."""
    light = display(run={"duration": "1 s"})
    light["servo"] = {**light["servo"], "tool": {"mass": "0.05 kg", "damping": "2 N*s/m"}}
    assert np.abs(np.linalg.eigvals(display_matrix(Scenario.from_dict(light)))).max() > 1.01
    assert certify(light).verdict.state is not State.STABLE


def test_a_free_direction_is_neutral_and_left_out() -> None:
    """A spring leaves no direction free, so a tool without damper is judged by its loop."""
    push = {"kind": "force", "force": ["0 N", "0 N", "-1 N"]}
    held = display(operator=push, object={"kind": "spring", "stiffness": "1 N/mm"})
    held["servo"] = {**held["servo"], "tool": {"mass": "0.1 kg", "damping": "0 N*s/m"}}
    slowest = np.abs(np.linalg.eigvals(display_matrix(Scenario.from_dict(held)))).max()
    assert slowest == pytest.approx(1.0 / np.sqrt(1.0 + 1000.0 * 5e-4**2 / 0.1), rel=1e-6)  # of the backward difference
    assert np.abs(np.linalg.eigvals(display_matrix(Scenario.from_dict(display(operator=push))))).max() < 0.999
    bare = display(operator=push)
    bare["servo"] = {**bare["servo"], "tool": {"mass": "0.1 kg", "damping": "0 N*s/m"}}
    with pytest.raises(StabilityError, match="nothing brakes a tool without damper"):
        certify(bare)


def test_an_analysis_without_an_admittance_display_says_so() -> None:
    with pytest.raises(StabilityError, match="in an admittance_display a tool touches the object"):
        scenario_loop(Scenario.from_dict(display()))
    with pytest.raises(StabilityError, match="in an admittance_display a tool touches the object"):
        zwidth(display())
    law = {"kind": "field", "field": {"kind": "viscous", "damping": "1 N*s/m"}}
    with pytest.raises(StabilityError, match="certified on a spring or a wall"):
        certify(display(object=law))
    verdict = palpate.simulate(display(object=law)).verdict
    assert "an admittance display has one on a spring or a wall" in str(verdict.linear)


def test_a_sweep_runs_the_display_of_each_cell() -> None:
    found = sweep(display(), {"servo.tool.mass": ["0.01 kg", "0.1 kg"]})
    assert [found.verdict(i) for i in range(2)] == [State.UNSTABLE, found.simulate(1).verdict.state]


def test_a_peak_that_is_not_an_overshoot_is_given_as_a_peak() -> None:
    """The tool hits a wall of 1 N/um and rests 1 um deep: the impact is far beyond 5 % of that rest."""
    row = summarize(palpate.simulate(Path(__file__).parents[2] / "scenarios" / "admittance-display.toml"))["axes"]["z"]
    assert row["overshoot_percent"] is None
    assert abs(row["peak_deflection_m"]) > 20.0 * abs(row["steady_deflection_m"])


@pytest.mark.parametrize(
    ("operator", "tool", "stiffness", "says"),
    [
        ({"mass": "0.037 kg", "damping": "0.027 N*s/m", "stiffness": "16 N/m", "force": ["0 N", "0 N", "-0.128 N"]},
         {"mass": "0.186 kg", "damping": "0.22 N*s/m"}, "995 N/m", "the command still changes"),
        ({"mass": "0.02 kg", "damping": "8.7 N*s/m", "stiffness": "126 N/m", "force": ["0 N", "0 N", "-0.675 N"]},
         {"mass": "0.067 kg", "damping": "0.244 N*s/m"}, "18.72 N/mm", "from the tool"),
    ],
)  # fmt: skip
def test_a_tip_that_sticks_off_its_tool_has_not_settled(
    operator: dict[str, Any], tool: dict[str, str], stiffness: str, says: str
) -> None:
    """Dry friction of the rotors holds the tip without any motion; the controller pulls on until it slips."""
    trace = palpate.simulate(
        display(
            device={"name": "phantom-premium-1.5a-rotors"},
            servo={"period": "0.5 ms", "topology": "admittance_display", "tool": tool},
            operator={"kind": "arm", **operator},
            object={"kind": "spring", "stiffness": stiffness},
            controller={"kind": "workspace", "bandwidth": "120 rad/s"},
            run={"duration": "0.2 s"},
        )
    )
    assert float(np.ptp(trace["tip"][-80:], axis=0).max()) < 1e-9
    assert trace.verdict.state is State.UNDECIDED
    assert says in trace.verdict.reason


def test_a_display_behind_a_flexible_mode_settles_though_the_load_bends_it_off_its_tool(tmp_path: Path) -> None:
    """The bend is the load over the stiffness of the mode; the tip that the servo knows is on the tool."""
    name = device_file(tmp_path, load("slider"), 40.0, 0.3, 0.05)
    trace = palpate.simulate(
        display(
            device={"name": name}, start={"pose": ["0 mm"]}, controller={"kind": "workspace", "bandwidth": "60 rad/s"},
            servo=display()["servo"] | {"period": "1 ms", "tool": {"mass": "0.3 kg", "damping": "4 N*s/m"}},
            operator={"kind": "force", "shape": "step", "force": ["-0.2 N", "0 N", "0 N"]},
            object={"kind": "wall", "normal": [1, 0, 0], "stiffness": "20 N/mm"}, run={"duration": "2 s"},
        )
    )  # fmt: skip
    mode = load(name).flexible
    assert mode is not None
    bend = -0.2 / (0.06 * mode.stiffness)
    assert trace["tip_offset"][-1, 0] == pytest.approx(bend, rel=1e-3)
    assert abs(bend) > 2.0 * abs(trace["deflection"][-1, 0])
    assert trace.verdict.state is State.SETTLED


def test_a_display_that_comes_to_rest_before_its_wall_has_settled() -> None:
    run = display(
        object={**WALL, "position": ["0 m", "0 m", "-50 mm"]},
        operator={**GRIP, "stiffness": "500 N/m", "force": ["0 N", "0 N", "-0.5 N"]},
        run={"duration": "1 s"},
    )
    trace = palpate.simulate(Scenario.from_dict(run))
    assert not trace["touching"].any()
    assert 1e-7 < np.ptp(trace["command_force"][-400:], axis=0).max() < 1e-4
    assert trace.verdict.state is State.SETTLED
    assert trace.verdict.reason.endswith("off the object")
