"""Certificate of an admittance display on a spring or a wall: the exact one-tick matrix, and the run."""

from __future__ import annotations

from collections.abc import Mapping

from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.admittance import display_matrix
from palpate.simulation.drive_hold import drive_hold
from palpate.simulation.linear_evidence import display_at_rest, has_display_loop
from palpate.simulation.simulator import simulate
from palpate.simulation.verdict import FAILED, State, Verdict
from palpate.stability.assumptions import assumptions, method
from palpate.stability.certificate import Certificate
from palpate.stability.counter_example import CounterExample
from palpate.stability.criteria import check_stability

__all__ = ["certify_display"]

LIMIT = 1e-12  # distance of the spectral radius from 1 within which nothing is claimed


def certify_display(s: Scenario) -> Certificate:
    """Return the certificate of an admittance display for small motions about its start and its rest.

    Raises:
        StabilityError: the object is no spring or wall, or its damper is no backward difference.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`; or the pose is near a singular one.
    """
    if not has_display_loop(s):
        raise StabilityError(
            "object: an admittance_display is certified on a spring or a wall with backward difference; judge it on "
            "another object by its run"
        )
    matrix = display_matrix(s)  # refuses first what has no loop
    trace = simulate(s)
    run = trace.verdict
    told = "; ".join([run.state.label, *([hold] if (hold := drive_hold(trace, s)) else [])])
    steps = (*method(s), f"The full scenario was run for {s.run.duration:g} s; its verdict is {told}.")
    loops = {"start": matrix}
    if (rest := display_at_rest(trace, s)) is not None:
        loops["rest"] = rest
    found = {place: check_stability(one) for place, one in loops.items()}
    criteria: Mapping[str, bool] = found["start"][1]
    margin = {f"spectral_radius_at_{place}": radius for place, (radius, _) in found.items()}
    worst = max(found, key=lambda place: found[place][0])
    radius, agreed = found[worst]
    example = None
    if run.state is State.UNSTABLE and run.since is not None:
        example = CounterExample(s.to_dict(), float("inf"), f"the scenario itself {run.reason}.")
    if len(set(agreed.values())) > 1 or abs(radius - 1.0) < LIMIT:
        state, reason = State.UNDECIDED, f"the loop is within rounding of its limit at the {worst}"
    elif radius > 1.0:
        state = State.UNDECIDED if example is None else State.UNSTABLE
        reason = f"a small motion about the {worst} grows (spectral radius {radius:.9g}), and the run is {run}"
    elif example is not None:
        state, reason = State.UNSTABLE, f"small motions decay (spectral radius {radius:.9g}), but the run {run.reason}"
    elif run.state in FAILED:
        state, reason = State.UNDECIDED, f"small motions decay, but the verdict of the run is {run}"
    else:
        state, reason = State.STABLE, f"every small motion decays (spectral radius {radius:.9g})"
    verdict = Verdict(state, reason)
    return Certificate(s.title, verdict, assumptions(s), margin, steps, criteria, None, example, s.to_dict())
