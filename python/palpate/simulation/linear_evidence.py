"""What the linear loop says about a recorded run, at its start and where it comes to rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.arrays import Array
from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.scenario.guard import Guard
from palpate.simulation.admittance import display_matrix
from palpate.simulation.equivalent_spring import as_spring
from palpate.simulation.linear_contact import contact_radius, swings_in_place
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.recorded import Recorded, held_tip

__all__ = [
    "LinearRadii",
    "display_at_rest",
    "has_display_loop",
    "linear_radii_of",
    "linear_sign",
    "loop_at_rest",
    "touches_at_rest",
]

AT_REST = 5e-3  # m/s: largest speed of a tip at rest
AT_LIMIT = 1e-9  # distance of a spectral radius from 1 within which the linear loop is at its limit
GUARDED = (1.0, 0.3, 0.1, 0.0)  # shares of an object's stiffness that a guard may leave
DAMPED = (0.0, 1.0, 10.0, 100.0)  # damping that it may add, times the stiffness and the period
SLOWEST = 1e-6  # growth per tick of a guarded loop that counts; double roots at the limit are rounded by less
LAST = 20  # samples over which the speed at rest is measured


def linear_sign(radius: float) -> int:
    """Return +1 for a stable spectral radius, -1 for an unstable one, 0 at the limit or if it is nan."""
    return 0 if not abs(radius - 1.0) >= AT_LIMIT else 1 if radius < 1.0 else -1


@dataclass(frozen=True)
class LinearRadii:
    """Spectral radii of the linear loop at the `start` of a run and at its `rest`; None: it did not come to rest."""

    start: float
    rest: float | None

    @property
    def worst(self) -> float:
        """The larger one."""
        return self.start if self.rest is None else max(self.start, self.rest)

    @property
    def leaves(self) -> bool:
        """Whether the run leaves a start where the loop is unstable and comes to rest where it is stable."""
        return self.rest is not None and linear_sign(self.start) < 0 < linear_sign(self.rest)

    def __str__(self) -> str:
        if self.leaves:
            return (
                f"the linear loop is unstable at the start (spectral radius {self.start:.9g}) and stable where the run "
                f"rests ({self.rest:.9g})"
            )
        kind = {1: "stable", -1: "unstable", 0: "at its limit"}[linear_sign(self.worst)]
        return f"the linear loop is {kind} (spectral radius {self.worst:.9g})"


def linear_radii_of(trace: Recorded, scenario: Scenario | None) -> tuple[LinearRadii | None, str]:
    """Return the spectral radii of the linear loop of a run, or None and the reason; it is empty if it is trivial.

    On a mesh or a body the loop is that of the contact mode in which the run rests, and counts as that at the start.
    """
    own: Mapping[str, Any] = trace.metadata.get("controller", {})
    if scenario is None or own.get("given") or own.get("kind") == "python" or "object" in trace.metadata:
        return None, ""
    if scenario.guard.kind != "none":
        found = _guarded(trace, scenario)
        alone = "a guard makes the loop nonlinear, and the linear loop is that without it"
        return found, "" if found is not None else alone
    found, reason = _of_kind(trace, scenario)
    if found is not None and scenario.servo.jitter > 0.0 and linear_sign(found.worst) > 0:
        return None, "late ticks destabilize a loop, and the linear loop is that without them"
    return found, reason


def _guarded(trace: Recorded, scenario: Scenario) -> LinearRadii | None:
    """Return the least spectral radius of a loop that no guard stabilizes; None if one may.

    A guard adds damping to an object or takes some of its spring's force. An energy bound takes a damper's force as
    well; other guards leave a damper that is unstable by itself. No guard holds an arm that tips over along a wall.
    """
    touched = "touching" not in trace or bool(trace["touching"].any())
    if scenario.contact_kind not in ("spring", "wall") or not touched:
        return None
    try:
        loop = scenario_loop(scenario.model_copy(update={"guard": Guard()}))
    except PalpateError:
        return None
    k, b = loop.stiffness, loop.damping
    dampers = [share * float(k.max()) * loop.period * np.eye(len(k)) for share in DAMPED]
    bounded = scenario.guard.kind == "energy_bound"
    shares = [(share, share if bounded else 1.0) for share in GUARDED]
    least = min(loop.spectral_radius(of_k * k, of_b * b + damper) for of_k, of_b in shares for damper in dampers)
    return LinearRadii(least, None) if least > 1.0 + SLOWEST else None


def _of_kind(trace: Recorded, scenario: Scenario) -> tuple[LinearRadii | None, str]:
    """Return the spectral radii of the linear loop without late ticks, or None and the reason, as `linear_radii_of`."""
    if scenario.contact_kind == "wall" and "touching" in trace and len(trace.time) and not trace["touching"].any():
        return None, "the tip never touches the object"
    if scenario.servo.tool is not None:
        return _display(trace, scenario)
    if scenario.contact_kind in ("mesh", "body"):
        return _contact(trace, scenario)
    if scenario.contact_kind in ("force_law", "field"):
        return _by_formula(trace, scenario)
    if scenario.contact_kind not in ("spring", "wall"):
        return None, ""
    return _spring(trace, scenario), ""


def _spring(trace: Recorded, scenario: Scenario) -> LinearRadii | None:
    """Return the spectral radii of a run on a spring or a wall; None if it has no linear loop."""
    try:
        start, rest = scenario_loop(scenario), loop_at_rest(trace, scenario)[0]
    except PalpateError:
        return None
    return LinearRadii(start.spectral_radius(), None if rest is None else rest.spectral_radius())


def _display(trace: Recorded, scenario: Scenario) -> tuple[LinearRadii | None, str]:
    """Return the spectral radii of an admittance display on a spring or a wall, or None and the reason."""
    if not has_display_loop(scenario):
        return None, "an admittance display has one on a spring or a wall with backward difference alone"
    try:
        start, rest = display_matrix(scenario), display_at_rest(trace, scenario)
    except PalpateError as problem:
        return None, str(problem)
    return LinearRadii(_radius(start), None if rest is None else _radius(rest)), ""


def has_display_loop(scenario: Scenario) -> bool:
    """Return whether the object of an admittance display has a linear loop."""
    return scenario.contact_kind in ("spring", "wall") and scenario.object.coupling == "backward"


def display_at_rest(trace: Recorded, scenario: Scenario) -> Array | None:
    """Return the `display_matrix` where a run came to rest, or None if it did not."""
    if not touches_at_rest(trace, scenario)[0]:
        return None
    return display_matrix(scenario, pose=trace["angle"][-1], operator_force=trace["operator_force"][-1])


def _radius(matrix: Array) -> float:
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))


def _by_formula(trace: Recorded, scenario: Scenario) -> tuple[LinearRadii | None, str]:
    """Return the spectral radii of a run in a field or, at its rest, on a force law; None and the reason if none."""
    spring, reason = as_spring(scenario, trace)
    if spring is None:
        return None, reason
    found = _spring(trace, spring)
    if found is None or scenario.contact_kind == "field":
        return found, ""
    return (
        (None, "the run on the force law does not rest") if found.rest is None else (LinearRadii(found.rest, None), "")
    )


def _contact(trace: Recorded, scenario: Scenario) -> tuple[LinearRadii | None, str]:
    """Return the spectral radius about the contact with a mesh or body where a run rests or swings, or None and why."""
    rests, reason = _rests(trace, scenario)
    if not rests and not (reason and swings_in_place(trace)):
        return None, reason
    radius, reason = contact_radius(trace, scenario)
    return (None if radius is None else LinearRadii(radius, None)), reason


def loop_at_rest(trace: Recorded, scenario: Scenario) -> tuple[ScenarioLoop | None, str]:
    """Return the linear loop where a run came to rest, or None and the reason, empty if it is trivial."""
    rests, reason = touches_at_rest(trace, scenario)
    if not rests:
        return None, reason
    force, operator = trace["command_force"][-1], trace["operator_force"][-1]
    return scenario_loop(scenario, pose=trace["angle"][-1], tip_force=force, operator_force=operator), ""


def touches_at_rest(trace: Recorded, scenario: Scenario) -> tuple[bool, str]:
    """Return whether a run has come to rest on its spring or wall, and the reason if not, empty if it is trivial."""
    rests, reason = _rests(trace, scenario)
    if rests and scenario.object.kind == "wall" and not trace["touching"][-1, 0]:
        return False, "the tip is off the wall"
    return rests, reason


def _rests(trace: Recorded, scenario: Scenario) -> tuple[bool, str]:
    """Return whether a run has come to rest, and the reason if not, empty if it is trivial.

    It is trivial where device and kinematics are linear: such a loop is the same at every pose.
    """
    linear = scenario.device.model != "nonlinear" and scenario.device.kinematics == "linear"
    if trace.unstable_from is not None or linear or len(trace.time) < LAST:
        return False, ""
    steps = np.diff(trace.time[-LAST:])[:, None]
    speed = float(np.abs(np.diff(held_tip(trace)[-LAST:], axis=0) / steps).max())
    return speed <= AT_REST, "" if speed <= AT_REST else f"the tip does not rest (tip speed {speed:.2g} m/s)"
