"""Forms of a user's controller: linear systems of python-control, functions and objects."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final, Protocol, runtime_checkable

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.workspace_controller import WorkspaceController
from palpate.errors import DesignError, PalpateError

_FORMS: Final = (
    "a palpate.Controller, a python-control system (6 to 3, or one input and one output for every axis), a function "
    "f(tick) -> force, or an object with command(tick)"
)
_LINEAR: Final = "a palpate.Controller or a python-control system (6 to 3, or one input and one output for every axis)"


@runtime_checkable
class CommandController(Protocol):
    """Controller as an object; it may also have `applied(force)` and `reset()`."""

    def command(self, tick: Any) -> ArrayLike:
        """Return the tip force (3,), N, for the signals of this tick."""


class PythonCode:
    """Function or object of the user, as the simulated loop calls it.

    Attributes:
        kind: "python".
        notes: name of the function or of the object's class.
    """

    kind: Final = "python"

    def __init__(self, user: Any, role: str, method: str) -> None:
        """Wrap a function, or the `method` of an object; `role` is "controller" or "object", for messages."""
        self.user = user
        self.name = _name(user)
        self.notes: dict[str, Any] = {"name": self.name}
        self._role = role
        self._function: Callable[[Any], Any] = getattr(user, method, user)

    def restart(self) -> None:
        """Call `reset()` of the user's object, if it has one."""
        if hasattr(self.user, "reset"):
            self.user.reset()

    def _call(self, signals: Any) -> Any:
        """Return the result of the user's code; add the time as a note to an error."""
        try:
            return self._function(signals)
        except Exception as problem:
            problem.add_note(f"palpate: raised by the {self._role} {self.name} at t = {signals.time:.9g} s")
            raise


class PythonController(PythonCode):
    """Controller written in Python: a function, or an object with `command(tick)`."""

    def __init__(self, user: Any) -> None:
        super().__init__(user, "controller", "command")
        self._time = 0.0
        if hasattr(user, "applied"):  # the core checks whether it exists
            self.applied = self._applied

    def command(self, tick: Any) -> Array:
        """Return the user's force (3,), N. Raise DesignError if it is not three finite numbers."""
        self._time = tick.time
        return checked_force(self._call(tick), f"controller {self.name}", tick.time, DesignError)

    def _applied(self, force: Array) -> None:
        try:
            self.user.applied(force)
        except Exception as problem:
            problem.add_note(f"palpate: raised by applied() of the controller {self.name} at t = {self._time:.9g} s")
            raise


def as_controller(value: Any, period: float) -> Controller | PythonController | WorkspaceController:
    """Return a controller with the given period, s, from any form.

    Args:
        value: a Controller; a WorkspaceController; a linear system (see `as_linear_controller`); a function f(tick) ->
            force (3,), N; or an object with `command(tick)`, and if needed `applied(force)` and `reset()`. A tick has
            `time`, `reference`, `object_force`, `deflection`, `normal`, `depth`, `stiffness`, `tip` and `velocity`, in
            SI units and the device's frame.
        period: s.

    Raises:
        DesignError: another form, or a linear system of the wrong shape or period.
    """
    if isinstance(value, PythonController):
        return value
    if isinstance(value, WorkspaceController):
        _check_period(value.period, period)
        return value
    if _is_linear(value):
        return as_linear_controller(value, period)
    if isinstance(value, type):
        raise DesignError(f"controller: {value.__name__} is a class; give an object of it, {value.__name__}(...)")
    if callable(value) or hasattr(value, "command"):
        return PythonController(value)
    raise DesignError(f"controller: {_FORMS}, not {value!r}")


def as_linear_controller(value: Any, period: float) -> Controller:
    """Return a linear controller, sampled with `period`, s.

    Args:
        value: a Controller, or a python-control StateSpace or TransferFunction from [F_ref; F_object] (6) to the force
            (3). A system with one input and output acts on F_ref - F_object of each axis; a list has three of them, for
            x, y and z. A continuous system is discretized by the bilinear rule with `period`. A sampled one has that
            period, or dt = True.
        period: s.

    Raises:
        DesignError: another form (a Python function has no linear model), another shape or period, or an improper
            transfer function.
    """
    if isinstance(value, Controller):
        _check_period(value.period, period)
        return value
    if isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 3:
        systems = [_sampled(one, period) for one in value]
        if any((s.ninputs, s.noutputs) != (1, 1) for s in systems):
            raise DesignError("controller: each of the three systems for x, y and z has one input and one output")
        return _per_axis(systems, period)
    if isinstance(value, WorkspaceController):
        raise DesignError(
            "controller: a workspace controller is not linear; its linear model about a pose is linearized(pose), and "
            'a scenario with kind = "workspace" is linearized where it is judged'
        )
    if isinstance(value, PythonController):
        value = value.user
    if (callable(value) and not isinstance(value, control.InputOutputSystem)) or hasattr(value, "command"):
        raise DesignError(
            f"controller: {_name(value)} is Python code, of which no linear model is known; linearize it yourself and "
            "give the python-control system, or run it with palpate.simulate"
        )
    system = _sampled(value, period)
    if (system.ninputs, system.noutputs) == (1, 1):
        return _per_axis([system] * 3, period)
    return Controller(system)


def checked_force(answer: Any, who: str, time: float, error: type[PalpateError]) -> Array:
    """Return a force (3,), N, or raise `error` with the time at which the user's code returned something else."""
    at = f"{who}, t = {time:.9g} s"
    try:
        force = np.asarray(answer, dtype=float)
    except (TypeError, ValueError):
        raise error(f"{at}: it must return a force of three numbers, N, not {answer!r}") from None
    if force.shape != (3,):
        raise error(f"{at}: it must return a force of three numbers, N, not an array of shape {force.shape}")
    if not np.isfinite(force).all():
        raise error(f"{at}: it returned a force that is not finite, {force.tolist()} N")
    return force


def _is_linear(value: Any) -> bool:
    three = isinstance(value, Sequence) and not isinstance(value, str) and len(value) == 3
    return isinstance(value, Controller | control.InputOutputSystem) or three


def _check_period(own: float, period: float) -> None:
    if abs(own - period) > 1e-9 * period:
        raise DesignError(f"servo.period is {period:g} s, but the controller is sampled every {own:g} s")


def _sampled(value: Any, period: float) -> control.StateSpace:
    """Return a system as a state space that is sampled with `period`, s."""
    if not isinstance(value, control.StateSpace | control.TransferFunction):
        raise DesignError(f"controller: {_LINEAR}, not {value!r}")
    if isinstance(value, control.TransferFunction):
        for row_n, row_d in zip(value.num, value.den, strict=True):
            for top, bottom in zip(row_n, row_d, strict=True):
                if len(np.trim_zeros(top, "f")) > len(np.trim_zeros(bottom, "f")):
                    raise DesignError(
                        "controller: a transfer function's numerator has a higher degree than its denominator; give "
                        "it a pole more, such as a low-pass filter"
                    )
    try:
        system = control.ss(value)
    except (control.ControlMIMONotImplemented, ValueError, TypeError) as problem:
        raise DesignError(f"controller: it has no state space: {problem}; give a StateSpace") from None
    if not all(np.all(np.isfinite(m)) for m in (system.A, system.B, system.C, system.D)):
        raise DesignError("controller: its matrices must be finite")
    if system.isdtime(strict=True):
        if system.dt is not True:
            _check_period(float(system.dt), period)
    elif system.nstates:
        system = control.sample_system(control.ss(system.A, system.B, system.C, system.D), period, "bilinear")
    return control.StateSpace(system.A, system.B, system.C, system.D, period)


def _per_axis(systems: Sequence[control.StateSpace], period: float) -> Controller:
    """Return the controller that applies a system to F_ref - F_object of each axis."""
    together = control.append(*systems)
    error = np.hstack([np.eye(3), -np.eye(3)])
    a, c = np.asarray(together.A), np.asarray(together.C)
    return Controller(control.StateSpace(a, together.B @ error, c, together.D @ error, period))


def _name(user: Any) -> str:
    return str(getattr(user, "__qualname__", type(user).__qualname__)).rpartition("<locals>.")[2]
