"""Forms of a user's controller: what is made of each, and the sentence for what is none."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import pytest
from palpate import devices
from palpate.control import Controller, workspace
from palpate.control.controller_forms import (
    PythonCode,
    PythonController,
    as_controller,
    as_linear_controller,
    checked_force,
)
from palpate.control.stability_margins import frequency_response
from palpate.errors import DesignError

T = 1e-3
FORMS = (
    "controller: a palpate.Controller, a python-control system (6 to 3, or one input and one output for every axis), "
    "a function f(tick) -> force, or an object with command(tick), not "
)
LINEAR = (
    "controller: a palpate.Controller or a python-control system (6 to 3, or one input and one output for every "
    "axis), not "
)
TF = control.TransferFunction
ONE = control.StateSpace([[0.5]], [[1.0]], [[0.3]], [[2.0]], T)
TWO = control.StateSpace([[0.2]], [[1.0]], [[0.7]], [[1.0]], T)
CONTINUOUS = control.StateSpace([[-30.0, 5.0], [0.0, -80.0]], [[1.0], [2.0]], [[3.0, 4.0]], [[0.5]])
ARM = devices.load("phantom-premium-1.5a")


def law(tick: Any) -> Any:
    return 2.0 * tick.reference


class Law:
    def __init__(self) -> None:
        self.seen: list[Any] = []

    def command(self, tick: Any) -> Any:
        return [1.0, 2.0, 3.0] if tick.time < 1.0 else 1 / 0

    def applied(self, force: Any) -> None:
        self.seen.append(force[0])

    def reset(self) -> None:
        self.seen = []


def test_linear_forms_act_on_the_error_of_each_axis() -> None:
    """One system for all axes, three of them, transfer functions, and continuous ones by the bilinear rule."""
    whole = Controller.gain([1.0, 2.0, 3.0], T)
    assert as_controller(whole, T) is whole is as_linear_controller(whole, T)
    tenths = TF([0.3], [1, -0.5], True) + 2.0
    for given, each in (
        (ONE, [ONE] * 3), ([ONE, TWO, ONE], [ONE, TWO, ONE]), ((ONE, TWO, TWO), [ONE, TWO, TWO]), (tenths, [ONE] * 3),
        (TF([0.0, 0.3], [1, -0.5], T) + 2.0, [ONE] * 3),
    ):  # fmt: skip
        found = as_controller(given, T)
        assert isinstance(found, Controller)
        assert (found.period, found.kind, found.antiwindup) == (T, "state_space", None)
        for theta in (0.1, 2.0):
            part = np.diag([frequency_response(one, theta)[0, 0] for one in each])
            np.testing.assert_allclose(frequency_response(found.system, theta), np.hstack([part, -part]), rtol=1e-9)
    sampled = as_linear_controller(CONTINUOUS, T).system
    theta = 0.3
    s = 2j / T * np.tan(theta / 2)
    exact = (CONTINUOUS.C @ np.linalg.solve(s * np.eye(2) - CONTINUOUS.A, CONTINUOUS.B))[0, 0] + 0.5
    np.testing.assert_allclose(frequency_response(sampled, theta)[1, [1, 4]], [exact, -exact], rtol=1e-9)
    constant = as_linear_controller(control.StateSpace([], [], [], [[3.0]]), T)
    np.testing.assert_array_equal(constant.system.D, 3.0 * np.hstack([np.eye(3), -np.eye(3)]))
    assert constant.period == T
    six = control.StateSpace([[0.1]], np.arange(6.0)[None], np.ones((3, 1)), np.arange(18.0).reshape(3, 6), True)
    same = as_controller(six, T).system
    for one, other in zip((same.A, same.B, same.C, same.D), (six.A, six.B, six.C, six.D), strict=True):
        np.testing.assert_array_equal(one, other)
    assert same.dt == T
    near = workspace(ARM, T * (1 + 1e-10))
    assert as_controller(near, T) is near


def test_a_function_or_an_object_is_called_each_tick() -> None:
    tick = SimpleNamespace(time=0.5, reference=np.arange(3.0))
    made = as_controller(law, T)
    assert isinstance(made, PythonController)
    assert as_controller(made, T) is made
    assert (made.name, made.kind, made.notes) == ("law", "python", {"name": "law"})
    np.testing.assert_array_equal(made.command(tick), [0.0, 2.0, 4.0])
    assert not hasattr(made, "applied")
    made.restart()
    user = Law()
    whole: Any = as_controller(user, T)
    assert whole.name == "Law"
    np.testing.assert_array_equal(whole.command(tick), [1.0, 2.0, 3.0])
    whole.applied(np.array([7.0, 0, 0]))
    assert user.seen == [7.0]
    whole.restart()
    assert user.seen == []
    with pytest.raises(TypeError) as caught:
        whole.applied(None)
    assert caught.value.__notes__ == ["palpate: raised by applied() of the controller Law at t = 0.5 s"]
    with pytest.raises(ZeroDivisionError) as divided:
        whole.command(SimpleNamespace(time=1.25))
    assert divided.value.__notes__ == ["palpate: raised by the controller Law at t = 1.25 s"]
    assert PythonCode(law, "object", "force")._call(tick).tolist() == [0.0, 2.0, 4.0]


class Bare:
    pass


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: as_controller(workspace(ARM, 2e-3), T),
         "servo.period is 0.001 s, but the controller is sampled every 0.002 s"),
        (lambda: as_controller(Controller.gain(1.0, T * (1 + 3e-9)), T),
         "servo.period is 0.001 s, but the controller is sampled every 0.001 s"),
        (lambda: as_controller(Controller.gain(1.0, T * (1 - 3e-9)), T),
         "servo.period is 0.001 s, but the controller is sampled every 0.001 s"),
        (lambda: as_controller(control.StateSpace([], [], [], [[1.0]], 2e-3), T),
         "servo.period is 0.001 s, but the controller is sampled every 0.002 s"),
        (lambda: as_controller(Law, T), "controller: Law is a class; give an object of it, Law(...)"),
        (lambda: as_controller("abc", T), FORMS + "'abc'"),
        (lambda: as_controller(3.0, T), FORMS + "3.0"),
        (lambda: as_linear_controller("abc", T), LINEAR + "'abc'"),
        (lambda: as_controller([ONE, ONE, 3.0], T), LINEAR + "3.0"),
        (lambda: as_controller([ONE, ONE, control.append(ONE, ONE)], T),
         "controller: each of the three systems for x, y and z has one input and one output"),
        (lambda: as_linear_controller(workspace(ARM, T), T),
         "controller: a workspace controller is not linear; its linear model about a pose is linearized(pose), and a "
         'scenario with kind = "workspace" is linearized where it is judged'),
        (lambda: as_linear_controller(law, T),
         "controller: law is Python code, of which no linear model is known; linearize it yourself and give the "
         "python-control system, or run it with palpate.simulate"),
        (lambda: as_linear_controller(Law(), T),
         "controller: Law is Python code, of which no linear model is known; linearize it yourself and give the "
         "python-control system, or run it with palpate.simulate"),
        (lambda: as_linear_controller(PythonController(law), T),
         "controller: law is Python code, of which no linear model is known; linearize it yourself and give the "
         "python-control system, or run it with palpate.simulate"),
        (lambda: as_linear_controller(Bare, T),
         "controller: Bare is Python code, of which no linear model is known; linearize it yourself and give the "
         "python-control system, or run it with palpate.simulate"),
        (lambda: as_controller(TF([1, 0, 0], [1, 1]), T),
         "controller: a transfer function's numerator has a higher degree than its denominator; give it a pole more, "
         "such as a low-pass filter"),
        (lambda: as_controller(control.StateSpace([[np.nan]], [[1.0]], [[1.0]], [[0.0]], T), T),
         "controller: its matrices must be finite"),
        (lambda: checked_force("a", "object X", 0.25, DesignError),
         "object X, t = 0.25 s: it must return a force of three numbers, N, not 'a'"),
        (lambda: checked_force([1.0, 2.0], "object X", 0.25, DesignError),
         "object X, t = 0.25 s: it must return a force of three numbers, N, not an array of shape (2,)"),
        (lambda: checked_force([1.0, 2.0, np.inf], "object X", 0.25, DesignError),
         "object X, t = 0.25 s: it returned a force that is not finite, [1.0, 2.0, inf] N"),
        (lambda: Controller(ONE), "a controller maps 6 inputs [F_ref; F_object] to 3 outputs, not 1 to 1"),
        (lambda: Controller(control.StateSpace([], [], [], np.ones((3, 6)), 0)),
         "a controller is sampled with its servo period in s, not dt = 0"),
        (lambda: Controller(control.StateSpace([], [], [], np.ones((3, 6)), True)),
         "a controller is sampled with its servo period in s, not dt = True"),
        (lambda: Controller(control.StateSpace([], [], [], np.full((3, 6), np.nan), T)),
         "a controller's matrices must be finite"),
        (lambda: Controller(control.StateSpace([], [], [], np.ones((3, 6)), T), np.ones((1, 3))),
         "antiwindup must be 0 x 3 (states x forces), not (1, 3)"),
    ],
)  # fmt: skip
def test_what_is_no_controller_is_refused_in_a_sentence(call: Any, says: str) -> None:
    with pytest.raises(DesignError) as caught:
        call()
    assert str(caught.value) == says


def test_a_normalized_controller_has_one_stiffness_an_axis() -> None:
    plain = Controller.gain(2.0, "1 ms")
    assert (plain.period, plain.kind, plain.notes) == (1e-3, "gain", {"gain": [2.0, 2.0, 2.0]})
    np.testing.assert_array_equal(plain.system.D, 2.0 * np.hstack([np.eye(3), -np.eye(3)]))
    np.testing.assert_array_equal(plain.feedback.D, -2.0 * np.eye(3))
    assert plain.design_stiffness is None
    assert plain.normalized("1 N/mm").design_stiffness == (1000.0, 1000.0, 1000.0)
    assert plain.normalized([1.0, 2.0, 3.0]).design_stiffness == (1.0, 2.0, 3.0)
    for wrong in (0.0, -1.0, np.inf):
        with pytest.raises(DesignError, match=r"^normalized: stiffness"):
            plain.normalized([1.0, wrong, 1.0])
