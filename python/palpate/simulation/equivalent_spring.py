"""Spring or wall that acts as a force law or a field does about a rest."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.scenario import Scenario
from palpate.scenario.force_objects import FieldChoice
from palpate.simulation.controllers import written_out
from palpate.simulation.recorded import Recorded
from palpate.units import write

__all__ = ["as_spring", "linear_radius", "with_wall"]


def as_spring(scenario: Scenario, trace: Recorded) -> tuple[Scenario | None, str]:
    """Return the scenario with a spring or wall that gives the same forces near the end of a run.

    A viscous field is a spring without stiffness, and a gravity well is a spring as long as the run stays where its
    force is linear. A force law is a wall with its slope at the end. Without one, the result is None and the reason,
    which is empty if no loop depends on the object.
    """
    touched = scenario.object
    if touched.law is not None:
        if not trace["touching"][-1, 0]:
            return None, "the tip is off the force law"
        return with_wall(scenario, float(trace["slope"][-1, 0])), ""
    field = touched.field
    if field is None or field.kind in ("constant", "vibration", "virtual_mass"):
        return None, ""
    if field.kind == "gravity_well":
        inside = (trace["touching"][:, 0] > 0.0) & (np.linalg.norm(trace["deflection"], axis=1) <= linear_radius(field))
        if not inside.all():
            return None, "the tip leaves the distance within which the force of the gravity well is linear"
    return _with_spring(scenario, field), ""


def linear_radius(field: FieldChoice) -> float:
    """Return the distance from the center of a gravity well within which its force is linear, m."""
    assert field.stiffness is not None  # checked: a well has them
    assert field.radius is not None
    return min(field.radius, field.cap / field.stiffness)


def with_wall(scenario: Scenario, stiffness: float) -> Scenario:
    """Return the scenario with a wall of one stiffness, N/m, in place of its force law."""
    normal = list(scenario.object.normal or ())
    return _replaced(scenario, {"kind": "wall", "stiffness": write(stiffness, "N/m"), "normal": normal})


def _with_spring(scenario: Scenario, field: FieldChoice) -> Scenario:
    stiffness = [write(field.stiffness or 0.0, "N/m")] * 3
    damping = [write(b, "N*s/m") for b in field.damping or (0.0, 0.0, 0.0)]
    return _replaced(scenario, {"kind": "spring", "stiffness": stiffness, "damping": damping})


def _replaced(scenario: Scenario, spring: dict[str, Any]) -> Scenario:
    position = [write(x, "m") for x in scenario.object.position]
    tables = {**written_out(scenario).to_dict(), "object": {**spring, "position": position}}
    tables.pop("objects", None)
    return Scenario.from_dict(tables)
