"""Controllers and objects of the user's own: functions, objects, linear systems."""

from __future__ import annotations

import traceback
from typing import Any

import control
import numpy as np
import palpate
import pytest
from numpy.typing import NDArray
from palpate import Controller, simulate
from palpate.errors import PalpateError
from palpate.metrics.performance import measure_performance
from palpate.scenario import Scenario
from palpate.simulation import ContactResult
from palpate.stability import certify, zwidth

Array = NDArray[np.float64]
PERIOD = 5e-4
PRESS: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "0.5 ms"},
    "reference": {"force": ["0 N", "0 N", "-1 N"]},
    "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
    "object": {"kind": "spring", "stiffness": "1 N/mm", "damping": "2 N*s/m"},
    "run": {"duration": "0.1 s"},
}
WALL: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"topology": "impedance_display", "period": "1 ms"},
    "operator": {"kind": "force", "force": ["-1 N", "0 N", "0 N"]},
    "object": {"kind": "wall", "stiffness": "1 N/mm", "normal": [1, 0, 0]},
    "run": {"duration": "0.3 s"},
}
EYE = np.eye(3)
ERROR = np.hstack([EYE, -EYE])


def same(one: palpate.Trace, two: palpate.Trace) -> None:
    assert list(one.channels) == list(two.channels)
    for name in one.channels:
        np.testing.assert_array_equal(one[name], two[name], err_msg=name)


class Integrating:
    """The proportional-integral controller of force_error below, as an object."""

    def __init__(self) -> None:
        self.reset()

    def command(self, tick: Any) -> Array:
        error = tick.reference - tick.object_force
        force = self.state + error
        self.state = self.state + PERIOD * 5.0 * error
        self.wanted = force
        return np.asarray(force)

    def applied(self, force: Array) -> None:
        self.heard += 1
        self.state = self.state + (force - self.wanted)

    def reset(self) -> None:
        self.state, self.heard = np.zeros(3), 0


def test_a_function_is_a_controller() -> None:
    same(simulate(PRESS, lambda tick: tick.reference - tick.object_force), simulate(PRESS))


def test_an_object_with_command_is_a_controller_and_is_reset() -> None:
    system = control.ss(EYE, PERIOD * 5.0 * ERROR, EYE, ERROR, PERIOD)
    linear = simulate(PRESS, Controller(system, antiwindup=EYE))
    own = Integrating()
    for _ in range(2):
        trace = simulate(PRESS, own)
        assert own.heard == len(trace)
        for name in linear.channels:
            np.testing.assert_allclose(trace[name], linear[name], rtol=1e-9, atol=1e-12)
    loop = palpate.Loop(PRESS, own)
    loop.run()
    loop.reset()
    same(loop.run(), trace)
    assert trace.metadata["controller"] == {"kind": "python", "name": "Integrating"}


def test_a_controller_sees_the_signals_of_the_tick() -> None:
    seen = []

    def look(tick: Any) -> Array:
        seen.append((tick.time, tick.tip.copy(), tick.velocity.copy(), tick.object_force.copy(), tick.reference.copy()))
        return np.asarray(tick.reference - tick.object_force)

    trace = simulate(PRESS, look)
    time, tip, velocity, force, reference = (np.array(column) for column in zip(*seen, strict=True))
    np.testing.assert_allclose(time, trace.time, atol=1e-15)
    np.testing.assert_allclose(tip, trace["tip"], atol=1e-15)
    np.testing.assert_allclose(velocity[1:], np.diff(trace["tip"], axis=0) / PERIOD, atol=1e-9)
    np.testing.assert_array_equal(force, trace["object_force"])
    np.testing.assert_array_equal(reference, trace["reference_force"])


@pytest.mark.parametrize(
    "system",
    [
        control.ss(EYE, PERIOD * 5.0 * ERROR, EYE, ERROR, PERIOD),
        control.ss([[1.0]], [[PERIOD * 5.0]], [[1.0]], [[1.0]], PERIOD),
        control.ss([[1.0]], [[PERIOD * 5.0]], [[1.0]], [[1.0]], True),
        [control.ss([[1.0]], [[PERIOD * 5.0]], [[1.0]], [[1.0]], PERIOD)] * 3,
        control.tf([1.0, PERIOD * 5.0 - 1.0], [1.0, -1.0], PERIOD),
    ],
    ids=["6 to 3", "SISO", "SISO of any period", "three", "transfer function"],
)
def test_linear_systems_are_controllers(system: Any) -> None:
    wanted = simulate(PRESS, Controller(control.ss(EYE, PERIOD * 5.0 * ERROR, EYE, ERROR, PERIOD)))
    trace = simulate(PRESS, system)
    for name in wanted.channels:
        np.testing.assert_allclose(trace[name], wanted[name], rtol=1e-9, atol=1e-12)


def test_a_continuous_system_is_discretized_by_the_bilinear_rule() -> None:
    s = control.tf("s")
    law = 2.0 * (s + 30.0) / (s + 200.0)
    ours = palpate.control.as_linear_controller(law, PERIOD).system
    for frequency in (1.0, 30.0, 300.0):
        z = np.exp(1j * frequency * PERIOD)
        w = 2 / PERIOD * (z - 1) / (z + 1)
        np.testing.assert_allclose(ours(z)[:, :3], law(w) * EYE, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(ours(z)[:, 3:], -law(w) * EYE, rtol=1e-9, atol=1e-12)


def test_a_static_system_is_a_gain() -> None:
    same(simulate(PRESS, control.tf([2.0], [1.0])), simulate(PRESS, Controller.gain(2.0, PERIOD)))


@pytest.mark.parametrize(
    ("controller", "says"),
    [
        (3.0, "a function f.tick. -> force"),
        ("lqg", "a palpate.Controller, a python-control system"),
        (Integrating, r"Integrating is a class; give an object of it, Integrating\(\.\.\.\)"),
        (control.tf([1.0, 0.0, 0.0], [1.0, 1.0]), "numerator has a higher degree"),
        (control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], 1e-3), r"servo\.period is 0\.0005 s, but .* every 0\.001 s"),
        (control.ss([], [], [], np.eye(2), PERIOD), "6 inputs .* to 3 outputs"),
        (lambda tick: [1.0, 2.0], r"t = 0 s: it must return a force of three numbers, N, not an array of shape \(2,\)"),
        (lambda tick: None, "it must return a force of three numbers"),
        (lambda tick: "hard", "it must return a force of three numbers, N, not 'hard'"),
        (lambda tick: [np.nan if tick.time > 0.01 else 0.0] * 3, r"t = 0\.0105 s: it returned a force that is not fin"),
    ],
)
def test_a_wrong_controller_is_refused_in_a_sentence(controller: Any, says: str) -> None:
    with pytest.raises(PalpateError, match=says) as refused:
        simulate(PRESS, controller)
    assert "\n" not in str(refused.value)


def test_an_error_of_the_users_code_is_raised_with_its_traceback_and_the_time() -> None:
    def control_law(tick: Any) -> Array:
        if tick.time > 0.02:
            return np.ones(3) / {}["gain"]
        return np.zeros(3)

    with pytest.raises(KeyError) as caught:
        simulate(PRESS, control_law)
    assert "raised by the controller control_law at t = 0.0205 s" in caught.value.__notes__[0]
    assert "control_law" in [frame.name for frame in traceback.extract_tb(caught.value.__traceback__)]

    def touch(tip: Any) -> Array:
        raise RuntimeError("broken")

    with pytest.raises(RuntimeError, match="broken") as wrong:
        palpate.Loop(WALL, object=touch).step()
    assert wrong.value.__notes__ == ["palpate: raised by the object touch at t = 0 s"]


def test_a_function_is_an_object() -> None:
    place = simulate(WALL)["tip"][0]

    def wall(tip: Any) -> Array:
        return np.array([1000.0 * min(tip.position[0] - place[0], 0.0), 0.0, 0.0])

    trace, wanted = simulate(WALL, object=wall), simulate(WALL)
    np.testing.assert_allclose(trace["tip"], wanted["tip"], atol=1e-12)
    np.testing.assert_allclose(trace["object_force"], wanted["object_force"], atol=1e-9)
    np.testing.assert_array_equal(trace["touching"], wanted["touching"])
    assert trace.scenario["object"] == {"kind": "none"}
    assert trace.metadata["object"] == {"kind": "python", "name": "wall"}
    assert trace.verdict.linear is None  # the tip bounces, and a function has no linear loop


def test_an_object_with_a_memory_is_reset_and_may_return_a_contact() -> None:
    class Sticky:
        def reset(self) -> None:
            self.steps = 0

        def step(self, tip: Any) -> Any:
            self.steps += 1
            return ContactResult([min(500.0 * tip.position[0], 0.0), 0.0, 0.0], touching=self.steps > 5)

    sticky = Sticky()
    for _ in range(2):
        trace = simulate(WALL, object=sticky)
        assert sticky.steps == len(trace)
        np.testing.assert_array_equal(trace["touching"][:6, 0], [0, 0, 0, 0, 0, 1])


@pytest.mark.parametrize(
    ("user", "says"),
    [
        (3, "a function f.tip. -> force, or an object with step"),
        (dict, "dict is a class"),
        (lambda tip: [0.0, 1.0], "must return a force of three numbers"),
        (lambda tip: [np.inf, 0.0, 0.0], "not finite"),
        (lambda tip: ContactResult([0.0, 0.0, 0.0], depth=np.nan), "a contact that is not finite"),
    ],
)
def test_a_wrong_object_is_refused_in_a_sentence(user: Any, says: str) -> None:
    with pytest.raises(PalpateError, match=says):
        simulate(WALL, object=user)


def test_an_object_of_the_user_replaces_a_body_and_a_mesh() -> None:
    mesh = {
        "kind": "mesh",
        "mesh": {"shape": "box", "edge": "80 mm", "divisions": 2},
        "surface": {"stiffness": "1 N/mm"},
    }
    trace = simulate({**WALL, "object": mesh}, object=lambda tip: np.zeros(3))
    assert "proxy" not in trace
    assert not trace["object_force"].any()


def test_a_guard_stands_behind_an_object_of_the_user() -> None:
    hard = {**WALL, "object": {"kind": "none"}, "operator": {"kind": "force", "force": ["-0.5 N", "0 N", "0 N"]}}
    guarded = {**hard, "guard": {"kind": "passivity_controller"}}

    def wall(tip: Any) -> Array:
        return np.array([1500.0 * min(tip.position[0] + 1e-3, 0.0), 0.0, 0.0])

    bare, damped = simulate(hard, object=wall), simulate(guarded, object=wall)
    late = slice(len(bare) // 2, None)
    assert np.ptp(damped["tip"][late, 0]) < 0.5 * np.ptp(bare["tip"][late, 0])
    same(damped, simulate(guarded, object=wall))


@pytest.mark.parametrize("judge", [certify, zwidth, measure_performance])
def test_the_linear_judges_refuse_python_code(judge: Any) -> None:
    with pytest.raises(PalpateError, match=r"Integrating is Python code.*linearize it.*palpate\.simulate"):
        judge(PRESS, controller=Integrating())
    with pytest.raises(PalpateError, match="is Python code"):
        judge(PRESS, controller=lambda tick: tick.reference)


def test_a_certificate_of_a_controller_is_that_of_the_scenario_with_it() -> None:
    s = control.tf("s")
    law = 0.8 * (s + 3.0) / s
    rows = palpate.control.as_linear_controller(law, PERIOD).system
    table = {"kind": "state_space", **{name: np.asarray(getattr(rows, name)).tolist() for name in "ABCD"}}
    written = {**PRESS, "controller": table}
    given = certify(PRESS, controller=law)
    assert given.to_dict() == certify(written).to_dict()
    assert Scenario.from_dict(given.scenario) == Scenario.from_dict(written)
    one, two = zwidth(PRESS, controller=law, simulated=False), zwidth(written, simulated=False)
    assert one.to_dict() == two.to_dict()
    assert measure_performance(PRESS, controller=law).to_dict() == measure_performance(written).to_dict()


def test_a_gain_keeps_the_question_of_passivity() -> None:
    assert certify(WALL, controller=Controller.gain(1.0, 1e-3)).passive == certify(WALL).passive
