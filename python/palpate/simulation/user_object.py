"""Virtual objects written in Python: functions of the tip, and objects with a state."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.control.controller_forms import PythonCode, checked_force
from palpate.errors import ScenarioError


class ContactResult(NamedTuple):
    """Contact at one sample, which a user's object may return in place of a force. SI units, device frame.

    Attributes:
        force: of the tip on the object (3,), N.
        deflection: of the surface (3,), m, for the controller.
        normal: of the surface, outward (3,).
        depth: of the tip under the surface, m.
        stiffness: of the surface, N/m.
        touching: whether the tip touches; None: whether the force is not zero.
    """

    force: ArrayLike
    deflection: ArrayLike = (0.0, 0.0, 0.0)
    normal: ArrayLike = (0.0, 0.0, 0.0)
    depth: float = 0.0
    stiffness: float = 0.0
    touching: bool | None = None


class PythonObject(PythonCode):
    """Object written in Python: a function, or an object with `step(tip)`."""

    def __init__(self, user: Any) -> None:
        super().__init__(user, "object", "step")

    def step(self, tip: Any) -> Any:
        """Return the user's force (3,), N, or contact. Raise ScenarioError if it is not made of finite numbers."""
        answer, who = self._call(tip), f"object {self.name}"
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
        if stiffness > 0.0 and answer.touching is not False and force.any() and not normal.any():
            raise ScenarioError(
                f"{who}, t = {tip.time:.9g} s: it returned a stiffness without the normal along which it acts"
            )
        return _core.ContactResult(force, deflection, normal, depth, stiffness, answer.touching)


def as_object(value: Any) -> PythonObject:
    """Return a virtual object from a function or an object of the user.

    Args:
        value: a function f(tip) -> force of the tip on the object (3,), N, or an object with such a method `step(tip)`
            and optionally `reset()`. The tip has `time`, `position` and `velocity`, in SI units and the device frame.
            The result may also be a `palpate.simulation.ContactResult`.

    Raises:
        ScenarioError: another form.
    """
    if isinstance(value, PythonObject):
        return value
    if isinstance(value, type):
        raise ScenarioError(f"object: {value.__name__} is a class; give an object of it, {value.__name__}(...)")
    if callable(value) or hasattr(value, "step"):
        return PythonObject(value)
    raise ScenarioError(f"object: a function f(tip) -> force, or an object with step(tip), not {value!r}")
