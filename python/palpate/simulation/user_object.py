"""Objects that the tip touches, written in Python: functions of the tip, and objects with a memory."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.control.controller_forms import checked_force
from palpate.errors import ScenarioError


class ContactResult(NamedTuple):
    """What an object of the user may return instead of a force: the contact at one sample. SI units, device frame.

    Attributes:
        force: of the tip on the object (3,), N.
        deflection: of the touched surface (3,), m: the controller sees it.
        normal: of the surface, outward (3,).
        depth: of the tip under the surface, m.
        stiffness: of the surface, N/m.
        touching: whether the tip touches; None: if the force is not zero.
    """

    force: ArrayLike
    deflection: ArrayLike = (0.0, 0.0, 0.0)
    normal: ArrayLike = (0.0, 0.0, 0.0)
    depth: float = 0.0
    stiffness: float = 0.0
    touching: bool | None = None


class PythonObject:
    """A function or an object of the user, as the simulated loop calls it.

    Attributes:
        kind: "python".
        notes: the name of the function or of the object's class.
    """

    kind: Final = "python"

    def __init__(self, user: Any) -> None:
        self.user = user
        self.name = str(getattr(user, "__qualname__", type(user).__qualname__)).rpartition("<locals>.")[2]
        self.notes: dict[str, Any] = {"name": self.name}
        self._call: Callable[[Any], Any] = user.step if hasattr(user, "step") else user

    def restart(self) -> None:
        """Call `reset()` of the user's object, if it has one."""
        if hasattr(self.user, "reset"):
            self.user.reset()

    def step(self, tip: Any) -> Any:
        """Return the user's force on the object, checked; a note on an error of the user gives the time."""
        try:
            answer = self._call(tip)
        except Exception as problem:
            problem.add_note(f"palpate: raised by the object {self.name} at t = {tip.time:.9g} s")
            raise
        who = f"object {self.name}"
        if not isinstance(answer, ContactResult):
            return checked_force(answer, who, tip.time, ScenarioError)
        force = checked_force(answer.force, who, tip.time, ScenarioError)
        try:
            deflection, normal = (np.asarray(v, dtype=float) for v in (answer.deflection, answer.normal))
            depth, stiffness = float(answer.depth), float(answer.stiffness)
        except (TypeError, ValueError):
            raise ScenarioError(f"{who}, t = {tip.time:.9g} s: it returned a contact that is not of numbers") from None
        numbers = [*deflection.ravel(), *normal.ravel(), depth, stiffness]
        if len(numbers) != 8 or not np.isfinite(numbers).all():
            raise ScenarioError(f"{who}, t = {tip.time:.9g} s: it returned a contact that is not finite, or no vectors")
        return _core.ContactResult(force, deflection, normal, depth, stiffness, answer.touching)


def as_object(value: Any) -> PythonObject:
    """Return an object that the loop touches, from a function or an object of the user.

    Args:
        value: a function f(tip) -> force of the tip on the object (3,), N, or an object with such a method `step(tip)`
            and if needed `reset()`. The tip has `time`, `position` and `velocity`, in SI units and the device's frame.
            Instead of a force it may return a `palpate.simulation.ContactResult`.

    Raises:
        ScenarioError: it is neither.
    """
    if isinstance(value, PythonObject):
        return value
    if isinstance(value, type):
        raise ScenarioError(f"object: {value.__name__} is a class; give an object of it, {value.__name__}(...)")
    if callable(value) or hasattr(value, "step"):
        return PythonObject(value)
    raise ScenarioError(f"object: a function f(tip) -> force, or an object with step(tip), not {value!r}")
