"""The loop sample by sample against its equations, and whole runs against independent solutions."""

from __future__ import annotations

import copy
import json
import re
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from numpy.typing import NDArray
from palpate import Scenario, devices, linear, simulate
from palpate import control as design
from palpate.control import Controller
from palpate.errors import PalpateError, ScenarioError
from palpate.linear.linearization import static_tip_force
from palpate.metrics import summarize
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from scipy.integrate import solve_ivp
from scipy.linalg import expm

Array = NDArray[np.float64]
ARM = devices.load("phantom-premium-1.5a")
POSE = np.array([0.0, 2.2305, 3.2776])  # rad
PERIOD = 5e-4  # s
START = {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]}


def press(**changes: Any) -> dict[str, Any]:
    """The arm presses a cube with 2 N under an LQG; a change lays keys over a table."""
    return _lay(
        {
            "device": {"name": "phantom-premium-1.5a"},
            "start": START,
            "servo": {"period": "0.5 ms"},
            "reference": {"force": ["0.5 N", "-1 N", "2 N"]},
            "object": {"stiffness": ["1 N/mm", "2 N/mm", "3 N/mm"]},
            "controller": {"kind": "lqg", "stiffness": "1 N/mm"},
            "run": {"duration": "0.1 s"},
        },
        changes,
    )


def display(**changes: Any) -> dict[str, Any]:
    """The operator pushes the arm onto a wall below it, and along it."""
    return _lay(
        {
            "device": {"name": "phantom-premium-1.5a"},
            "start": START,
            "servo": {"period": "1 ms", "topology": "impedance_display"},
            "operator": {"kind": "force", "shape": "sine", "frequency": "5 Hz", "force": ["0.3 N", "-1.5 N", "0.2 N"]},
            "object": {
                "kind": "wall", "stiffness": "1 N/mm", "damping": "2 N*s/m", "position": "-1 mm",
                "normal": [0.1, 1, -0.2],
            },
            "run": {"duration": "0.5 s"},
        },
        changes,
    )  # fmt: skip


def slide(**changes: Any) -> dict[str, Any]:
    """The slider, free, pushed by an arm with 1 N."""
    return _lay(
        {
            "device": {"name": "slider"},
            "servo": {"topology": "impedance_display"},
            "operator": {
                "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m",
                "force": ["1 N", "0 N", "0 N"],
            },
            "object": {"kind": "none"},
            "run": {"duration": "0.3 s"},
        },
        changes,
    )  # fmt: skip


def _lay(base: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    out = copy.deepcopy(base)
    for name, change in changes.items():
        fresh = isinstance(change, dict) and "kind" in change
        out[name] = {**({} if fresh else out.get(name, {})), **change} if isinstance(change, dict) else change
    return out


def bits(trace: Trace) -> bytes:
    return b"".join([trace.time.tobytes(), *(channel.values.tobytes() for channel in trace.channels.values())])


def torque_of(force: Array, angles: Array) -> Array:
    """J^T f, row by row."""
    return np.einsum("nij,ni->nj", ARM.jacobian(angles), force)


# what a run promises


@pytest.mark.parametrize(
    "scenario",
    [
        press(),
        press(device={"encoder": True, "saturation": True, "delay": 3, "model": "nonlinear"}),
        press(device={"model": "linear", "kinematics": "linear"}),
        display(),
        slide(),
    ],
    ids=["press", "drive", "linear", "wall", "arm"],
)
def test_the_same_scenario_gives_the_same_trace_bit_for_bit(scenario: dict[str, Any]) -> None:
    """Promise of the house; and a run leaves the tables it was given as they were."""
    before = copy.deepcopy(scenario)
    assert bits(simulate(scenario)) == bits(simulate(scenario))
    assert scenario == before


def test_tables_a_scenario_and_a_file_run_alike(tmp_path: Path) -> None:
    """The three ways in are one."""
    (tmp_path / "s.toml").write_text(
        '[device]\nname = "slider"\n[reference]\nforce = "1 N"\n[object]\nstiffness = "50 N/m"\n'
    )
    tables = {"device": {"name": "slider"}, "reference": {"force": "1 N"}, "object": {"stiffness": "50 N/m"}}
    runs = [simulate(given) for given in (tables, Scenario.from_dict(tables), tmp_path / "s.toml")]
    runs.append(simulate(str(tmp_path / "s.toml")))
    assert len({bits(run) for run in runs}) == 1


@pytest.mark.parametrize("every", [2, 7])
def test_recording_fewer_samples_changes_none(every: int) -> None:
    """record_every thins the trace, not the loop: under an operator's sine, and under a reference's ramp."""
    for scenario in (display, press):
        given = {"reference": {"shape": "ramp", "rise": "0.08 s"}} if scenario is press else {}
        full, thin = simulate(scenario(**given)), simulate(scenario(**given, run={"record_every": every}))
        assert np.array_equal(thin.time, full.time[::every])
        for name in full.channels:
            assert np.array_equal(thin[name], full[name][::every]), name


@pytest.mark.parametrize(
    "controller",
    [
        {"kind": "none"},
        {"kind": "gain", "gain": [0.1, 0.2, 0.1]},
        {"kind": "lead_lag"},
        {"kind": "lqg", "integrators": False},
        {"kind": "state_space", "A": [[0.5]], "B": [[0.0] * 6], "C": [[0.0]] * 3, "D": [[0.1] * 6] * 3},
    ],
    ids=lambda table: str(table["kind"]),
)
def test_what_made_a_trace_is_in_its_metadata(controller: dict[str, Any], tmp_path: Path) -> None:
    """Scenario, version and the controller's notes: strict JSON, whatever the controller."""
    trace = simulate(press(controller=controller, run={"duration": "5 ms"}))
    assert json.loads(json.dumps(trace.metadata, allow_nan=False)) == trace.metadata
    assert set(trace.metadata) == {"scenario", "version", "controller"}
    assert Trace.load(trace.save(tmp_path / "t.h5")).scenario == trace.scenario


# the equations of one tick


def test_force_tracking_feeds_back_what_the_object_feels() -> None:
    """u = C [F_ref; F_object], F_object = K (p - p0), torque = J^T (u + hold): on every recorded sample."""
    gain, stiffness = np.array([0.02, 0.03, 0.01]), np.array([1000.0, 2000.0, 3000.0])
    trace = simulate(press(controller={"kind": "gain", "gain": gain.tolist()}))
    np.testing.assert_allclose(trace["tip"], ARM.forward(trace["angle"]), atol=1e-15)
    np.testing.assert_allclose(trace["deflection"], trace["tip"] - ARM.forward(POSE), atol=1e-15)
    np.testing.assert_allclose(trace["object_force"], stiffness * trace["deflection"], atol=1e-11)
    np.testing.assert_allclose(
        trace["command_force"], gain * (trace["reference_force"] - trace["object_force"]), atol=1e-12
    )
    hold = static_tip_force(ARM.jacobian(POSE), ARM.gravity(POSE))
    np.testing.assert_allclose(trace["torque"], torque_of(trace["command_force"] + hold, trace["angle"]), atol=1e-12)
    assert np.abs(trace["deflection"]).max() > 1e-4


def test_an_impedance_display_answers_with_the_objects_force() -> None:
    """torque = -J^T F_object + hold: the operator's force is not in it, it acts on the tip."""
    trace = simulate(display())
    np.testing.assert_array_equal(trace["command_force"], -trace["object_force"])
    time = trace.time[:, None]
    np.testing.assert_allclose(trace["operator_force"], np.sin(10 * np.pi * time) * [0.3, -1.5, 0.2], atol=1e-12)
    hold = static_tip_force(ARM.jacobian(POSE), ARM.gravity(POSE))
    np.testing.assert_allclose(trace["torque"], torque_of(hold - trace["object_force"], trace["angle"]), atol=1e-12)
    assert trace["touching"].any()


def test_a_wall_never_pulls() -> None:
    """F.n <= 0, none along the wall, none outside: also where the damper would pull on the way out."""
    trace = simulate(display())
    normal = np.array([0.1, 1.0, -0.2]) / np.linalg.norm([0.1, 1.0, -0.2])
    depth = -(trace["tip"] - ARM.forward(POSE) + 1e-3) @ normal  # m, into the wall
    pressed = -trace["object_force"] @ normal
    rate = np.diff(depth, prepend=depth[0]) / 1e-3
    assert pressed.min() == 0.0
    assert np.linalg.norm(trace["object_force"] + pressed[:, None] * normal, axis=1).max() < 1e-12
    np.testing.assert_array_equal(trace["touching"][:, 0] > 0, depth > 0)
    assert not np.any(pressed[depth <= 0])
    assert np.any((depth > 0) & (1000.0 * depth + 2.0 * rate < 0)), "the run never leaves fast enough to test it"
    inside = (depth > 0) & np.roll(depth > 0, 1)
    np.testing.assert_allclose(pressed[inside], np.maximum(0, 1000 * depth + 2 * rate)[inside], atol=1e-10)
    np.testing.assert_allclose(trace["deflection"], -np.maximum(depth, 0)[:, None] * normal, atol=1e-15)


@pytest.mark.parametrize("coupling", ["backward", "bilinear"])
def test_the_objects_damper_is_sampled_as_it_says(coupling: str) -> None:
    """Backward difference; or Tustin, v_k = 2/T (d_k - d_(k-1)) - v_(k-1) (Hosseini-Zadeh 2004, 3.34)."""
    trace = simulate(
        press(
            object={"stiffness": "1 N/mm", "damping": ["1 N*s/m", "2 N*s/m", "3 N*s/m"], "coupling": coupling},
            controller={"kind": "gain", "gain": 0.02},
        )
    )
    step = np.diff(trace["deflection"], axis=0, prepend=np.zeros((1, 3)))
    speed = step / PERIOD
    if coupling == "bilinear":
        for k in range(1, len(speed)):
            speed[k] = 2 / PERIOD * step[k] - speed[k - 1]
    wanted = 1000 * trace["deflection"] + speed * [1.0, 2.0, 3.0]
    np.testing.assert_allclose(trace["object_force"], wanted, atol=1e-8)


def test_encoders_count() -> None:
    """The servo sees whole counts, of the start pose too, where the object stands; the joints move smoothly."""
    trace = simulate(press(device={"encoder": True}, object={"stiffness": "1 N/mm"}))
    step = ARM.encoder_step
    np.testing.assert_allclose(step, 2 * np.pi / (4096 * np.array([13.3, 11.2, 11.2])), rtol=1e-12)
    counted = np.rint(trace["angle"] / step) * step
    seen = 1000.0 * (ARM.forward(counted) - ARM.forward(counted[0]))
    np.testing.assert_allclose(trace["object_force"], seen, atol=1e-9)
    assert not np.any(trace["object_force"][0])  # at rest nothing pushes
    exact = 1000.0 * trace["deflection"]
    assert 1e-3 < np.abs(trace["object_force"] - exact).max() < 0.05  # 30 um times 1 N/mm


@pytest.mark.parametrize("delay", [0, 1, 5, 64])
def test_a_delay_shifts_the_torque_by_whole_periods(delay: int) -> None:
    """torque_k = J^T (u + hold) of k - n; before that the hold alone."""
    trace = simulate(press(device={"delay": delay}, controller={"kind": "gain", "gain": 0.003}))
    assert trace.completed
    hold = static_tip_force(ARM.jacobian(POSE), ARM.gravity(POSE))
    computed = torque_of(trace["command_force"] + hold, trace["angle"])
    resting = np.tile(ARM.jacobian(POSE).T @ hold, (delay, 1))
    np.testing.assert_allclose(trace["torque"], np.vstack([resting, computed])[: len(trace)], atol=1e-12)
    assert np.ptp(computed, axis=0).min() > 1e-5


@pytest.mark.parametrize("model", ["nonlinear", "linear"])
def test_frozen_kinematics_are_the_jacobian_of_the_start(model: str) -> None:
    """p = p0 + J (q - q0); torque = J^T (u + hold) + d(J^T hold)/dq (q - q0)."""
    trace = simulate(press(device={"kinematics": "linear", "model": model}))
    jacobian, turn = ARM.jacobian(POSE), trace["angle"] - POSE
    hold = static_tip_force(jacobian, ARM.gravity(POSE))
    np.testing.assert_allclose(trace["tip"], ARM.forward(POSE) + turn @ jacobian.T, atol=1e-15)
    turning = np.einsum("k,kij->ij", hold, ARM.tip_hessian(POSE))
    wanted = (trace["command_force"] + hold) @ jacobian + turn @ turning.T
    np.testing.assert_allclose(trace["torque"], wanted, atol=1e-12)


def test_frozen_kinematics_err_with_the_square_of_the_force() -> None:
    """Taylor: half the force, a quarter of the difference to the exact kinematics."""

    def apart(force: float) -> float:
        both = [
            simulate(press(device={"kinematics": kind}, reference={"force": f"{force} N"}))["deflection"]
            for kind in ("linear", "nonlinear")
        ]
        return float(np.abs(both[0] - both[1]).max())

    assert apart(0.2) / apart(0.1) == pytest.approx(4.0, rel=0.05)


def test_a_state_space_and_its_antiwindup_run_as_written() -> None:
    """u = C x + D v, x <- A x + B v + L (applied - u), replayed from the recorded forces, at the drive's limit too."""
    chosen = design.lqg(linear.rendering_plant(ARM, POSE, stiffness=1000.0, period=PERIOD))
    trace = simulate(
        press(device={"saturation": True}, reference={"force": "8.5 N"}, object={"stiffness": "2 N/mm"}), chosen
    )
    assert 0.0 < trace["saturated"].mean() < 1.0
    s, antiwindup = chosen.system, chosen.antiwindup
    assert antiwindup is not None
    x, replayed = np.zeros(s.nstates), []
    for reference, felt, applied in zip(
        trace["reference_force"], trace["object_force"], trace["command_force"], strict=True
    ):
        v = np.concatenate([reference, felt])
        u = s.C @ x + s.D @ v
        replayed.append(u)
        x = s.A @ x + s.B @ v + antiwindup @ (applied - u)
    free = trace["saturated"][:, 0] == 0
    np.testing.assert_allclose(trace["command_force"][free], np.array(replayed)[free], rtol=1e-7, atol=1e-8)


# the drive and the operator


def test_the_drive_gives_its_peak_for_a_moment_and_its_continuous_force_for_ever() -> None:
    """Windings: dh/dt = ((F/1.4)^2 - h)/10 s, limit fading from 8.5 to 1.4 N over the last tenth: solved apart."""
    trace = simulate(
        display(
            device={"saturation": True},
            operator={"kind": "fixed"},
            object={"kind": "wall", "stiffness": "3.5 N/mm", "position": ["0 mm", "4 mm", "0 mm"], "normal": [0, 1, 0]},
            servo={"gravity_compensation": False},
            run={"duration": "20 s", "record_every": 10},
        )
    )
    force = np.linalg.norm(trace["command_force"], axis=1)
    np.testing.assert_allclose(trace["object_force"][:, 1], -14.0, atol=1e-9)

    def limit(heat: Array) -> Array:
        return np.asarray(1.4 + np.clip((1 - heat) / 0.1, 0, 1) * (8.5 - 1.4))

    solution = solve_ivp(
        lambda _, h: ((limit(h) / 1.4) ** 2 - h) / 10.0, (0, 20), [0.0], t_eval=trace.time, rtol=1e-10, atol=1e-12
    )
    np.testing.assert_allclose(force, limit(solution.y[0]), rtol=0.02)  # sampled every 1 ms, not continuous
    assert force[0] == pytest.approx(8.5)
    assert np.all(np.diff(force) <= 1e-12)
    assert 1.4 < force[-1] < 1.5
    assert trace["saturated"].all()


def test_a_limited_force_keeps_its_direction_and_the_hold_counts() -> None:
    """|u + hold| <= 8.5 N, along what was asked: what the motors carry anyway is part of what they can give."""
    trace = simulate(
        display(
            device={"saturation": True},
            operator={"kind": "fixed"},
            object={"kind": "spring", "stiffness": "3.5 N/mm", "position": ["3 mm", "-3 mm", "3 mm"]},
            run={"duration": "0.01 s"},
        )
    )
    hold = static_tip_force(ARM.jacobian(POSE), ARM.gravity(POSE))
    given, asked = trace["command_force"][0] + hold, hold - trace["object_force"][0]
    assert np.linalg.norm(given) == pytest.approx(8.5, rel=1e-12)
    np.testing.assert_allclose(given / np.linalg.norm(given), asked / np.linalg.norm(asked), atol=1e-12)


def test_who_holds_the_tip_still_bears_what_the_motors_do_not() -> None:
    """Statics: torque + J^T f = N(q), nothing moves."""
    trace = simulate(
        display(
            operator={"kind": "fixed"},
            object={"kind": "spring", "stiffness": "2 N/mm", "position": ["1 mm", "2 mm", "-3 mm"]},
            servo={"gravity_compensation": False},
        )
    )
    assert not np.any(trace["velocity"])
    assert np.array_equal(trace["angle"], np.tile(POSE, (len(trace), 1)))
    borne = trace["torque"] + torque_of(trace["operator_force"], trace["angle"])
    np.testing.assert_allclose(borne, ARM.gravity(trace["angle"]), atol=1e-12)


def test_an_arm_grips_rigidly_as_one_mass_damper_and_spring() -> None:
    """Linear: (m + m_arm) x'' + (b + b_arm) x' + k_arm x = F, solved by the matrix exponential."""
    trace = simulate(slide())
    mass, damping = 0.06 + 0.15, 0.05 + 4.5
    motion = _answer(np.array([[0, 1], [-560 / mass, -damping / mass]]), np.array([0, 1 / mass]), trace.time)
    np.testing.assert_allclose(trace["angle"][:, 0], motion[:, 0], atol=1e-8 * np.abs(motion[:, 0]).max())
    np.testing.assert_allclose(trace["velocity"][:, 0], motion[:, 1], atol=1e-7 * np.abs(motion[:, 1]).max())


def test_an_arm_behind_fingertip_tissue_is_two_masses() -> None:
    """Tip and hand joined by the tissue; the hand's force on the tip is the tissue's."""
    trace = simulate(
        slide(
            operator={
                "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m",
                "tissue_stiffness": "500 N/m", "tissue_damping": "0.5 N*s/m", "force": ["1 N", "0 N", "0 N"],
            },
            run={"substeps": 4},
        )
    )  # fmt: skip
    k, b, m, hand = 500.0, 0.5, 0.06, 0.15
    a = np.array(
        [
            [0, 1, 0, 0],
            [-k / m, -(b + 0.05) / m, k / m, b / m],
            [0, 0, 0, 1],
            [k / hand, b / hand, -(k + 560) / hand, -(b + 4.5) / hand],
        ]
    )
    motion = _answer(a, np.array([0, 0, 0, 1 / hand]), trace.time)
    np.testing.assert_allclose(trace["angle"][:, 0], motion[:, 0], atol=1e-7 * np.abs(motion[:, 0]).max())
    tissue = k * (motion[:, 2] - motion[:, 0]) + b * (motion[:, 3] - motion[:, 1])
    np.testing.assert_allclose(trace["operator_force"][:, 0], tissue, atol=1e-6 * np.abs(tissue).max())


def _answer(a: Array, b: Array, time: Array) -> Array:
    """States (n, order) of x' = A x + B from rest."""
    order = len(a)
    block = np.zeros((order + 1, order + 1))
    block[:order, :order], block[:order, order] = a, b
    step = expm(block * (time[1] - time[0]))
    states = [np.eye(order + 1)[-1]]
    for _ in time[1:]:
        states.append(step @ states[-1])
    return np.array(states)[:, :order]


def test_an_arms_spring_pulls_to_where_it_rests() -> None:
    """Statics: without any other force the tip ends where the shoulder's spring is unstretched."""
    trace = simulate(
        slide(
            operator={
                "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m",
                "rest": ["7 mm", "0 mm", "0 mm"],
            },
            run={"duration": "3 s"},
        )
    )  # fmt: skip
    assert trace["tip"][0, 0] == 0.0
    assert trace["tip"][-1, 0] == pytest.approx(7e-3, rel=1e-6)


def test_a_voluntary_force_is_linear_between_samples() -> None:
    """Not a staircase: a sine on the free slider moves it as the ODE says, to second order in the period."""
    trace = simulate(slide(operator={"kind": "force", "shape": "sine", "frequency": "5 Hz", "force": "1 N"}))
    w, m, b = 10 * np.pi, 0.06, 0.05
    exact = solve_ivp(
        lambda t, x: [x[1], (np.sin(w * t) - b * x[1]) / m], (0, 0.3), [0, 0], "DOP853", trace.time, rtol=1e-11,
        atol=1e-13,
    )  # fmt: skip
    np.testing.assert_allclose(trace["angle"][:, 0], exact.y[0], atol=2e-4 * np.abs(exact.y[0]).max())


def test_gravity_is_held_where_it_is_balanced() -> None:
    """With the hold the arm rests at its start; without it falls."""
    rest = simulate(press(reference={"force": "0 N"}, object={"kind": "none"}, controller={"kind": "none"}))
    assert np.abs(rest["angle"] - POSE).max() < 1e-12
    fall = simulate(
        press(reference={"force": "0 N"}, object={"kind": "none"}, controller={"kind": "none"},
              servo={"gravity_compensation": False})
    )  # fmt: skip
    first = 0.5 * PERIOD**2 * ARM.acceleration(POSE, np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(fall["angle"][1] - POSE, first, atol=0.05 * np.abs(first).max())


# whole loops by independent roads


@pytest.mark.parametrize("kind", ["lqg", "lead_lag"])
def test_the_linear_loop_is_python_controls(kind: str) -> None:
    """The same closed loop built and run by python-control: equal to 1e-9 of the largest deflection."""
    stiffness = np.array([1000.0, 2000.0, 3000.0])
    chosen = getattr(design, kind)(linear.rendering_plant(ARM, POSE, stiffness=1000.0, period=PERIOD))
    trace = simulate(press(device={"model": "linear", "kinematics": "linear"}), chosen)

    a_q, a_qd, a_tau = ARM.linearization(POSE, np.zeros(3), ARM.gravity(POSE))
    continuous = control.ss(
        np.block([[np.zeros((3, 3)), np.eye(3)], [a_q, a_qd]]), np.vstack([np.zeros((3, 3)), a_tau]),
        np.eye(3, 6), np.zeros((3, 3)),
    )  # fmt: skip
    arm = control.c2d(continuous, PERIOD, "zoh")
    jacobian = ARM.jacobian(POSE)
    hold = static_tip_force(jacobian, ARM.gravity(POSE))
    turning = control.ss([], [], [], np.einsum("k,kij->ij", hold, ARM.tip_hessian(POSE)), PERIOD)
    plant = control.feedback(arm, turning, sign=1) * control.ss([], [], [], jacobian.T, PERIOD)
    felt = control.ss([], [], [], stiffness[:, None] * jacobian, PERIOD) * plant
    s = chosen.system
    reference_path = control.ss(s.A, s.B, s.C, s.D, PERIOD)
    # [F_ref; F_object] -> u -> F_object, and back into the second half of the inputs.
    forward = felt * reference_path
    opened = control.ss(forward.A, forward.B, forward.C, forward.D, PERIOD)
    back = control.ss([], [], [], np.vstack([np.zeros((3, 3)), np.eye(3)]), PERIOD)
    closed = control.feedback(opened, back, sign=1)
    inputs = np.zeros((6, len(trace)))
    inputs[:3] = np.array([[0.5], [-1.0], [2.0]])
    response = control.forced_response(closed, inputs=inputs, timepts=np.arange(len(trace)) * PERIOD)
    wanted = response.outputs.T / stiffness
    np.testing.assert_allclose(trace["deflection"], wanted, atol=1e-9 * np.abs(wanted).max())


def test_the_nonlinear_loop_is_scipys() -> None:
    """The same sampled loop around scipy's DOP853 at 1e-12: equal to 1e-9 rad."""
    gain, stiffness = 0.03, np.array([1000.0, 2000.0, 3000.0])
    trace = simulate(press(controller={"kind": "gain", "gain": gain}, run={"duration": "0.05 s", "substeps": 4}))
    hold = static_tip_force(ARM.jacobian(POSE), ARM.gravity(POSE))
    reference = np.array([0.5, -1.0, 2.0])
    state, anchor = np.concatenate([POSE, np.zeros(3)]), ARM.forward(POSE)
    for k in range(len(trace)):
        np.testing.assert_allclose(trace["angle"][k], state[:3], atol=1e-9)
        q = state[:3]
        command = gain * (reference - stiffness * (ARM.forward(q) - anchor))
        tau = ARM.jacobian(q).T @ (command + hold)
        state = solve_ivp(
            lambda _, y, tau=tau: np.concatenate([y[3:], ARM.acceleration(y[:3], y[3:], tau)]),
            (0, PERIOD), state, "DOP853", rtol=1e-12, atol=1e-14,
        ).y[:, -1]  # fmt: skip


def test_integrators_bring_the_force_to_its_reference() -> None:
    """Internal model principle: a constant reference is met exactly in the end, on any stable object."""
    trace = simulate(press(run={"duration": "1 s"}))
    np.testing.assert_allclose(trace["object_force"][-1], [0.5, -1.0, 2.0], atol=1e-3)
    assert trace.verdict.state is State.SETTLED


# loops that fail, and what cannot be run


@pytest.mark.parametrize("model", ["nonlinear", "linear"])
def test_a_loop_that_diverges_says_since_when_and_keeps_what_came_before(model: str) -> None:
    """ "unstable from t = ...": a whole number of periods, the trace finite and cut there."""
    trace = simulate(press(device={"model": model}, controller={"kind": "gain", "gain": 3.0}, run={"duration": "2 s"}))
    assert trace.unstable_from is not None
    assert trace.unstable_from / PERIOD == pytest.approx(round(trace.unstable_from / PERIOD))
    assert trace.time[-1] == pytest.approx(trace.unstable_from - PERIOD)
    assert all(np.all(np.isfinite(channel.values)) for channel in trace.channels.values())
    summary = json.loads(json.dumps(summarize(trace), allow_nan=False))
    assert summary["stable"] is False
    assert trace.verdict.state is State.UNSTABLE
    assert trace.verdict.since == trace.unstable_from
    assert summary["verdict"].startswith(f"unstable: diverges at t = {trace.unstable_from:.4g} s, most along ")
    assert summary["axes"] == {}


@pytest.mark.parametrize("gain", [1e150, 1e300, 1e308])
@pytest.mark.parametrize("model", ["nonlinear", "linear"])
@pytest.mark.filterwarnings("error")
def test_a_loop_that_overflows_at_once_still_leaves_a_trace(model: str, gain: float, tmp_path: Path) -> None:
    """Forces past every number: no NaN and no infinity in a file or a summary, only the samples before."""
    trace = simulate(
        press(device={"model": model}, reference={"force": "8.5 N"}, controller={"kind": "gain", "gain": gain})
    )
    assert trace.unstable_from is not None
    assert trace.unstable_from <= 2 * PERIOD
    read = Trace.load(trace.save(tmp_path / "t.h5"))
    assert read.unstable_from == trace.unstable_from
    assert len(read) == len(trace)
    assert json.dumps(summarize(read), allow_nan=False)


def test_a_swing_that_grows_is_called_unstable_before_it_diverges() -> None:
    """Sampled wall, exact limit 100.01 N/m: 3 % above, the run ends bounded and the verdict is yet right."""
    verdicts = {}
    for stiffness in (97, 103):
        trace = simulate(
            slide(
                operator={"kind": "force", "force": "0.5 N"},
                object={"kind": "spring", "stiffness": f"{stiffness} N/m"},
                run={"duration": "30 s"},
            )
        )
        assert trace.completed
        verdicts[stiffness] = summarize(trace)["stable"], summarize(trace)["verdict"]
    assert verdicts[97][0] is True
    assert verdicts[97][1].startswith("settled: its oscillation of ")
    assert "decays by a factor of" in verdicts[97][1]
    assert verdicts[103][0] is False
    assert verdicts[103][1].startswith("unstable: an oscillation by ")


def test_the_decay_of_a_swing_is_that_of_the_linear_loop_and_differs_from_1() -> None:
    """Just below the limit, an oscillation decays by the spectral radius to the power of the ticks of a fifth."""
    trace = simulate(
        slide(
            operator={"kind": "force", "force": "0.5 N"},
            object={"kind": "spring", "stiffness": "99.9 N/m"},
            run={"duration": "1 s"},
        )
    )
    found = re.search(r"decays by a factor of ([\d.]+) in 0.199 s; .*radius ([\d.]+)", trace.verdict.reason)
    assert found, trace.verdict.reason
    assert 1.0 - float(found[1]) == pytest.approx(1.0 - float(found[2]) ** 200, rel=0.3)


@pytest.mark.parametrize(("frequency", "start"), [("20 Hz", "2.24 s"), ("4.594 Hz", "0 s")], ids=["late", "resonance"])
def test_a_swing_that_is_driven_is_no_instability(frequency: str, start: str) -> None:
    """Growth is judged only where nothing from outside changes: a sine swings a stable loop up at its resonance."""
    driven = {"kind": "force", "shape": "sine", "frequency": frequency, "start": start, "force": "0.05 N"}
    trace = simulate(slide(operator=driven, object={"kind": "spring", "stiffness": "50 N/m"}, run={"duration": "3 s"}))
    quarters = np.split(np.abs(trace["tip"][1:, 0]), 4)
    assert quarters[3].max() > 1.1 * quarters[2].max(), "the swing does not grow: nothing is tested"
    assert summarize(trace)["axes"]["x"]["swing_growth"] is None
    assert trace.verdict.state is State.UNDECIDED
    assert "the external force changes until the end" in trace.verdict.reason
    assert "the linear loop is stable" in trace.verdict.reason


def test_what_is_no_controller_is_refused() -> None:
    with pytest.raises(PalpateError, match=r"controller: a palpate\.Controller, a python-control system.*, not 3"):
        simulate(press(), 3)


def test_a_controller_of_another_period_is_refused() -> None:
    with pytest.raises(PalpateError, match=r"servo\.period is 0\.0005 s, but the controller is sampled every 0\.001 s"):
        simulate(press(), Controller.gain(1.0, 1e-3))


@pytest.mark.parametrize(
    ("scenario", "says"),
    [
        (press(device={"model": "experimental"}, servo={"period": "1 ms"}), r"sampled every 0\.0005 s, not 0\.001 s"),
        (slide(device={"model": "linear"}), "an arm moves with the nonlinear device"),
    ],
)
def test_what_a_device_model_cannot_do_is_said(scenario: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        simulate(scenario)


def test_a_device_without_encoder_cannot_count(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(
        'name = "bare"\ndescription = "no encoder"\nmechanism = "slider"\n'
        'servo_period = { value = "1 ms", source = "me" }\n[mass]\ntip = { value = "1 kg", source = "me" }\n'
        '[friction]\nviscous = { value = "1 N*s/m", source = "me" }\n'
    )
    with pytest.raises(ScenarioError, match=r"device\.encoder: bare has no encoder"):
        simulate(slide(device={"name": str(tmp_path / "own.toml"), "encoder": True}))
