"""What dry friction holds at the end of a run: its share of the load, and the way of the tip if it let go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.scenario import Scenario
from palpate.simulation.bodies import surface_normal
from palpate.simulation.recorded import Recorded

__all__ = ["FrictionHold", "arm_spring", "friction_hold", "friction_of"]


@dataclass(frozen=True)
class FrictionHold:
    """Friction of the contact in the last fifth of the judged window.

    Attributes:
        fluctuation: standard deviation of the object's force over its mean.
        traction: force along the surface over the force at which the whole contact slides; 1 if the normal is unknown.
        release: way of the tip until the arm's spring takes that force, m; inf without a spring.
    """

    fluctuation: float
    traction: float
    release: float


def friction_hold(trace: Recorded, scenario: Scenario, ending: slice) -> FrictionHold | None:
    """Return the friction of a run's contact over the rows `ending`; None without a body, friction or force."""
    friction, forces = friction_of(scenario), trace["object_force"][ending]
    mean = forces.mean(axis=0)
    force = float(np.linalg.norm(mean))
    if friction == 0.0 or force == 0.0 or all(one.object.body is None for one in scenario.each_object.values()):
        return None
    normal = surface_normal(trace, -1)
    most = friction * force / float(np.hypot(1.0, friction))
    along, traction = most, 1.0
    if normal is not None:
        pressing = float(mean @ normal)
        along = float(np.linalg.norm(mean - pressing * normal))
        traction = along / max(friction * abs(pressing), 1e-300)
    spring = arm_spring(scenario)
    release = along / spring if spring > 0.0 else np.inf
    return FrictionHold(float(np.linalg.norm(forces.std(axis=0))) / force, traction, release)


def friction_of(scenario: Scenario) -> float:
    """Return the largest coefficient of dry friction of the scenario's meshes and bodies; 0 without.

    It is the dynamic one; the static one where that is zero.
    """
    found = [0.0]
    for one in scenario.each_object.values():
        surface, body = one.object.surface, one.object.body
        if surface is not None:
            found.append(surface.dynamic_friction or surface.static_friction)
        if body is not None:
            found.append(float(body.options.get("dynamic_friction") or body.options.get("static_friction", 0.0)))
    return max(found)


def arm_spring(scenario: Scenario) -> float:
    """Return the stiffness of the operator's arm against a slow motion of the tip, N/m; 0 without one."""
    operator = scenario.operator
    if operator.kind != "arm" or not operator.stiffness:
        return 0.0
    tissue = operator.tissue_stiffness
    return operator.stiffness if tissue is None else operator.stiffness * tissue / (operator.stiffness + tissue)
