"""Certificates of scenarios whose object is a force law or a force field."""

from __future__ import annotations

from dataclasses import replace

from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.equivalent_spring import as_spring, linear_radius
from palpate.simulation.force_objects import law_of
from palpate.simulation.simulator import simulate
from palpate.simulation.verdict import FAILED, State, Verdict
from palpate.stability.assumptions import assumptions
from palpate.stability.certificate import Certificate
from palpate.stability.certification import certify_spring
from palpate.stability.counter_example import CounterExample
from palpate.stability.force_law_verdict import ForceLawVerdict, certify_force_law
from palpate.stability.rest_certificate import certify_mass

__all__ = ["certify_field", "certify_law"]

_OPEN = {
    "constant": "a constant field depends on no motion, so it closes no loop; give a spring, a wall or a force law",
    "vibration": "a vibration depends on the time and not on the motion, so it closes no loop; simulate it",
}


def certify_law(s: Scenario) -> Certificate:
    """Return the certificate of a scenario on a force law, for every slope of the law; see `certify_force_law`.

    Raises:
        StabilityError: the controller divides by the stiffness, or the device cannot be pushed along the normal.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    if s.operator.kind == "fixed":
        raise StabilityError(
            'operator.kind: "fixed" keeps the tip still, so nothing can oscillate; give another operator'
        )
    found = certify_force_law(s, law_of(s))
    run = simulate(s).verdict
    state, reason, example = found.state, found.sentence.removeprefix(f"{found.state.label}: "), None
    if found.state is State.STABLE and run.state in FAILED:
        state, reason = State.UNDECIDED, f"the linear loop decays for every slope, but the verdict of the run is {run}"
    if found.state is State.UNDECIDED and run.state is State.UNSTABLE and run.since is not None:
        state, reason = State.UNSTABLE, f"{reason}, and the run itself {run.reason}"
        example = CounterExample(s.to_dict(), float("inf"), f"the scenario itself {run.reason}.")
    holds = (*assumptions(s), _scope(found))
    steps = (
        "The law is a monotone function of the depth: its slopes between the entries of the table are exact.",
        "Stability for every such function by a multiplier (O'Shea; Willems and Brockett), confirmed by an exact norm.",
        f"The scenario was simulated with the law itself: {run}.",
    )
    margin = {"least_slope_N_per_m": found.slopes[0], "largest_slope_N_per_m": found.slopes[1]}
    return Certificate(s.title, Verdict(state, reason), holds, margin, steps, {}, None, example, s.to_dict())


def _scope(found: ForceLawVerdict) -> str:
    if found.slopes[0] == 0.0:
        return "The device is linear about its start; the tip may leave the surface."
    return "The device is linear about its start, and the tip stays in contact."


def certify_field(s: Scenario) -> Certificate:
    """Return the certificate of a scenario in a viscous field or a gravity well, judged as a spring, or of a mass.

    Raises:
        StabilityError: the field closes no loop, or the scenario has none.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    field = s.object.field
    assert field is not None  # of this kind
    if field.kind == "virtual_mass":
        return certify_mass(s)
    if field.kind in _OPEN:
        raise StabilityError(f"object.field.kind: {_OPEN[field.kind]}")
    spring, reason = as_spring(s, simulate(s))
    if spring is None:
        return Certificate(s.title, Verdict(State.UNDECIDED, reason), assumptions(s), {}, (), {}, scenario=s.to_dict())
    found = certify_spring(spring)
    holds = found.assumptions
    if field.kind == "gravity_well":
        near = f"{1e3 * linear_radius(field):.4g} mm"
        holds = (*holds, f"The tip stays within {near} of the center, where the field is a spring; the run does.")
    return replace(found, assumptions=holds, scenario=s.to_dict())
