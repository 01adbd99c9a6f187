"""Certificate of a loop on a deformable body: at the rest of its run, at other depths, and by the run itself."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from palpate.control.stability_margins import loop_margins
from palpate.errors import StabilityError
from palpate.fem.model_spec import LAWS
from palpate.metrics.body_contact import palpation_metrics
from palpate.scenario import Scenario
from palpate.simulation.observed_run import LONGEST, SHORTEST, ObservedRun, observe
from palpate.simulation.support_phase import last_change
from palpate.simulation.tool_motion import last_motion
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import FAILED, State, Verdict
from palpate.stability.assumptions import assumptions
from palpate.stability.body.body_loop import BodyLoop, stiffness_margin
from palpate.stability.body.multirate_loop import MultirateLoop
from palpate.stability.body.update_rate import slowest_update
from palpate.stability.certificate import Certificate
from palpate.stability.contact_loop import ContactStability, contact_at
from palpate.stability.counter_example import CounterExample

__all__ = ["certify_body", "contact_of"]

_DEPTHS = (0.25, 0.5, 0.75)  # of the depth at rest, tested as well
_QUANTILES = (0.5, 0.25, 0.1, 0.75)  # of the depth in contact, tried in turn for a run that does not rest
_APART = 0.05  # difference of two depths, relative to the depth at rest, that counts
_REAL = 1e-9  # angle of an eigenvalue, rad per sample, below which its motion does not oscillate
_NEVER = (
    "the tip does not touch the body in the run; move the body (object.position) to where its surface is not held, "
    "press longer (run.duration), or mesh it finer (object.body.spacing): a tip between its nodes touches none"
)
_CANCELLED = 0.2  # of the forces of a tool's tips: sum below which the contact has no normal
_FIRST = 0.999  # ratio of two margins below which the lower one counts as another
_DECAYS = 4.0  # time constants of the slowest motion for which the run is watched


@dataclass(frozen=True)
class _Findings:
    """Contacts of a run and the run: the material of a verdict."""

    rest: ContactStability | None
    depths: tuple[ContactStability, ...]
    untested: str
    run: ObservedRun


def certify_body(s: Scenario) -> Certificate:
    """Return the certificate of a loop on a deformable body.

    Raises:
        StabilityError: the operator holds the tip still, so there is no loop.
    """
    if s.operator.kind == "fixed":
        raise StabilityError(
            'operator.kind: "fixed" keeps the tip still, so nothing can oscillate; give another operator'
        )
    found = _find(s)
    verdict = _verdict(found, _scales_mass(s))
    if verdict.state is State.STABLE and (cancelled := _cancelled(s, found.run)) is not None:
        verdict = Verdict(State.UNDECIDED, cancelled)
    steps = [*_method(s, found), found.run.sentence]
    margin = _margins(found)
    if found.rest is not None and isinstance(found.rest.loop, MultirateLoop) and verdict.state is State.STABLE:
        interval, sentence = slowest_update(s, found.run.trace, found.run.held, found.rest.loop.every, _is_stable_at)
        steps.append(sentence)
        if interval is not None:
            margin["slowest_update_s"] = interval
    example = None
    if verdict.state is State.UNSTABLE:
        ratio = float("inf") if math.isnan(found.run.kept) else found.run.kept
        example = CounterExample(s.to_dict(), ratio, f"the scenario itself. {found.run.sentence}")
    criteria = {} if found.rest is None else dict(found.rest.criteria)
    holds = (*_assumptions(s), *_accuracy(found.run.trace))
    return Certificate(s.title, verdict, holds, margin, tuple(steps), criteria, None, example, s.to_dict())


def contact_of(s: Scenario) -> tuple[ContactStability, ObservedRun, int]:
    """Return the contact where a scenario's run rests, the run, and the sample of the contact.

    For a run that does not rest it is a contact of the median depth.

    Raises:
        StabilityError: the tip never touches the body, or the body's response does not decay.
    """
    run, contact, row, problem = _find_rest(s)
    if contact is None:
        raise StabilityError(f"object: the response of the body is unknown: {problem}")
    return contact, run, row


def _is_stable_at(s: Scenario, trace: Trace, row: int) -> bool | None:
    state = contact_at(s, trace, row).state
    return None if state is State.UNDECIDED else state is State.STABLE


def _find(s: Scenario) -> _Findings:
    run, rest, _, problem = _find_rest(s)
    if rest is None:
        return _Findings(None, (), problem, run)
    needed = _DECAYS / max(abs(math.log(max(rest.radius, 1e-3))), 1e-9)
    if run.lasts and needed > SHORTEST:
        run = observe(s, math.ceil(min(needed, _longest(s) / s.period)), (run.held - run.end) * s.period)
    others = _other_depths(s, run, rest.depth)
    depths, problems = [], []
    for other in others:
        try:
            depths.append(_at_depth(s, run.trace, other))
        except StabilityError as trouble:
            problems.append(str(trouble))
    untested = ""
    if problems:
        untested = (
            f"at {len(problems)} of {len(others)} other depths the body's response could not be measured: {problems[0]}"
        )
    return _Findings(rest, tuple(sorted(depths, key=lambda one: one.depth)), untested, run)


def _find_rest(s: Scenario) -> tuple[ObservedRun, ContactStability | None, int, str]:
    """Return a run, held until it rests, and its contact there as `_at_rest`."""
    run = observe(s)
    rest, row, problem = _at_rest(s, run)
    if rest is not None and rest.radius >= 1.0 and (run.lasts or not run.oscillates):
        run = observe(s, SHORTEST, _longest(s))  # the tip may slide slowly to a place where it rests
        rest, row, problem = _at_rest(s, run)
    return run, rest, row, problem


def _at_depth(s: Scenario, trace: Trace, row: int) -> ContactStability:
    """Return the contact at a sample at which the tip was moving.

    The energy tank of a hyperelastic body may have stiffened the local model there; then the body in equilibrium
    counts. If only motions across the contact grow, the stiffness margin is that of motions along its normal.
    """
    found = contact_at(s, trace, row, along_normal=True)
    if found.stable:
        return found
    if isinstance(found.loop, MultirateLoop):
        return contact_at(s, trace, row, along_normal=True, equilibrium=True)
    loop = found.loop
    if found.state is State.UNSTABLE and len(loop.normal) == 1 and loop.radius_along_normal() < 1.0:
        return replace(found, stiffness_margin=stiffness_margin(loop.radius_along_normal))
    return found


def _slides(one: ContactStability) -> bool:
    """Return whether motions across a contact grow, and those along its normal decay."""
    return one.state is State.UNSTABLE and not math.isnan(one.stiffness_margin)


def _longest(s: Scenario) -> float:
    """Return the longest time for which a run is held or watched, s."""
    choice = s.object.body
    assert choice is not None
    return (LONGEST if choice.kind == "compliance" else LONGEST // 3) * s.period


def _at_rest(s: Scenario, run: ObservedRun) -> tuple[ContactStability | None, int, str]:
    """Return the contact at the rest of a run, its sample, and a reason; the reason says why the contact is None.

    If there is no rest, it is the contact of the median depth, or of another depth if nothing can be told there.
    """
    trace = run.trace
    last = min(run.held, len(trace) - 1)
    touching = trace["touching"][: last + 1, 0] > 0.0
    inside = np.flatnonzero(touching)
    if inside.size == 0:
        return None, 0, _NEVER
    rows = [last]
    if not run.lasts or not touching[last]:
        depth = np.linalg.norm(trace["deflection"], axis=1)
        late = inside[inside >= min(last // 2, inside[-1])]
        rows = [int(late[np.argmin(np.abs(depth[late] - np.quantile(depth[late], q)))]) for q in _QUANTILES]
    tries = [(row, row != last) for row in rows] + [(row, False) for row in rows if row != last and _hyperelastic(s)]
    best: tuple[ContactStability | None, int, str] = None, rows[0], ""
    for row, equilibrium in tries:
        try:
            found = contact_at(s, trace, row, equilibrium=equilibrium)
        except StabilityError as problem:
            best = (best[0], best[1], best[2] or str(problem))
            continue
        if found.state is not State.UNDECIDED:
            return found, row, ""
        if best[0] is None:
            best = found, row, ""
    return best


def _hyperelastic(s: Scenario) -> bool:
    return s.object.body is not None and s.object.body.kind in LAWS


def _other_depths(s: Scenario, run: ObservedRun, rest: float) -> list[int]:
    """Return samples of the scenario's own run at other depths than `rest`, m, under its last supports and tool."""
    choice = s.object.body
    assert choice is not None
    trace = run.trace
    inside = np.flatnonzero(trace["touching"][: run.end + 1, 0])
    inside = inside[trace.time[inside] >= _last_change(s) - 1e-6 * s.period]
    depth = np.linalg.norm(trace["deflection"], axis=1)
    if inside.size == 0:
        return []
    deepest = int(inside[np.argmax(depth[inside])])
    rows = [deepest] if trace.completed and depth[deepest] > (1.0 + _APART) * rest else []
    for share in _DEPTHS[1:2] if choice.kind == "mass_spring" else _DEPTHS:
        near = int(inside[np.argmin(np.abs(depth[inside] - share * rest))])
        if abs(depth[near] - share * rest) < _APART * rest:
            rows.append(near)
    return rows


def _last_change(s: Scenario) -> float:
    """Return the time after which supports and tool of the body stay as they are, s."""
    choice = s.object.body
    assert choice is not None
    return max(last_motion(choice), last_change(s) or 0.0)


def _cancelled(s: Scenario, run: ObservedRun) -> str | None:
    """Return that the forces of a tool's tips without friction cancel, so that its contact has no normal; else None."""
    choice = s.object.body
    assert choice is not None
    row = min(run.held, len(run.trace) - 1)
    forces = [run.trace[f"point{k}_force"][row] for k in range(1, len(choice.contact_points) + 1)]
    each, left = sum(map(np.linalg.norm, forces)), float(np.linalg.norm(sum(forces)))
    if choice.options.get("static_friction", 0.0) > 0.0 or not left < _CANCELLED * each:
        return None
    return (
        f"the tips press against each other with {0.5 * each:.3g} N, and {left:.2g} N are left for the device: without "
        "friction there is no direction in which the body resists it; give the body a static_friction"
    )


def _scales_mass(s: Scenario) -> bool:
    """Return whether the margin of a body scales its mass as well: the whole of a force with inertia."""
    return s.object.body is not None and s.object.body.kind in ("modal", "mass_spring")


def _verdict(found: _Findings, scales_mass: bool = False) -> Verdict:
    rest, run = found.rest, found.run
    if rest is None:
        return Verdict(State.UNDECIDED, f"{found.untested}. {run.sentence}")
    linear = _about(rest)
    if rest.state is State.UNDECIDED:
        return Verdict(State.UNDECIDED, f"{linear} {run.sentence}")
    if rest.state is State.UNSTABLE:
        if run.lasts and run.oscillates and not _oscillates(rest.loop):
            return Verdict(State.UNDECIDED, f"{linear} They do not oscillate: the tip slides. {run.sentence}")
        if run.oscillates or (run.verdict.state in FAILED and not run.lasts):
            return Verdict(State.UNSTABLE, f"{linear} {run.sentence}")
        return Verdict(State.UNDECIDED, f"{linear} But the run does not show it. {run.sentence}")
    if not run.rests:
        return Verdict(State.UNDECIDED, f"{linear} But the run does not rest. {run.sentence}")
    doubtful = [one for one in found.depths if not one.stable and not _slides(one)]
    if doubtful:
        where = ", ".join(f"{1e3 * one.depth:.3g} mm ({_state(one)})" for one in doubtful)
        return Verdict(State.UNDECIDED, f"{linear} But not at other depths of the run: {where}.")
    if found.untested:
        return Verdict(State.UNDECIDED, f"{linear} But {found.untested}.")
    about = linear[0].upper() + linear[1:]
    least = min(one.stiffness_margin for one in (rest, *found.depths))
    slide = min(one.slide_margin for one in (rest, *found.depths))
    scaled = "times as stiff and as heavy" if scales_mass else "times as stiff"
    factor = "of any stiffness" if math.isinf(min(least, slide)) else f"{min(least, slide):.4g} {scaled}"
    slides = "the tip slides across the contact, which has no friction"
    end = slides if slide < _FIRST * least else "the loop oscillates"
    sentence = f"the body may be {factor} at every depth tested before {end}. {about}"
    if sliding := [f"{1e3 * one.depth:.3g}" for one in found.depths if _slides(one)]:
        sentence += f" Held at {', '.join(sliding)} mm, the tip would slide across the contact, which has no friction."
    return Verdict(State.STABLE, sentence)


def _state(one: ContactStability) -> str:
    return f"{one.state.label}, spectral radius {one.radius:.6g}" if one.state is State.UNSTABLE else one.state.label


def _oscillates(loop: BodyLoop | MultirateLoop) -> bool:
    """Return whether an unstable eigenvalue of a loop oscillates; a faster real one may grow beside it."""
    values = np.linalg.eigvals(loop.matrix())
    return bool(np.any((np.abs(values) >= 1.0) & (np.abs(np.angle(values)) >= _REAL)))


def _about(one: ContactStability) -> str:
    """Return a contact's stability as a sentence."""
    where = f"at {1e3 * one.depth:.3g} mm"
    if one.state is State.UNDECIDED and not one.doubt < 1.0:
        return f"{where} the error of the body's response is {one.doubt:.2g} times what the loop tolerates."
    where += f", where the body's stiffness is {one.static_stiffness / 1e3:.4g} N/mm"
    if one.state is State.UNDECIDED:
        return f"{where}, the criteria disagree (spectral radius 1 {one.radius - 1.0:+.1e})."
    motion = "decay" if one.stable else "grow"
    return f"small motions {motion} {where} (spectral radius {one.radius:.6g})."


def _margins(found: _Findings) -> dict[str, float]:
    rest = found.rest
    if rest is None:
        return {}
    margin = {"depth_m": rest.depth, "response_error_over_tolerable": rest.doubt}
    if rest.state is State.UNDECIDED and not rest.doubt < 1.0:  # the numbers of an unknown response are none
        return margin
    margin |= {
        "spectral_radius": rest.radius,
        "static_stiffness_N_per_m": rest.static_stiffness,
        "one_tick_stiffness_N_per_m": rest.one_tick_stiffness,
    }
    if rest.radius >= 1.0:
        return margin
    margin["gain_margin"] = rest.stiffness_margin
    if rest.slide_margin < _FIRST * rest.stiffness_margin:
        margin["slide_margin"] = rest.slide_margin
    if found.depths and all(one.radius < 1.0 or _slides(one) for one in found.depths):
        margin["least_gain_margin_of_depths"] = min(one.stiffness_margin for one in found.depths)
    if isinstance(rest.loop, BodyLoop):
        m = loop_margins(rest.loop.gain())
        margin |= {"phase_margin_deg": m.phase, "delay_margin_s": m.delay, "disk_margin": m.disk}
    return margin


def _accuracy(trace: Trace) -> list[str]:
    """Return how far the force of the rendered body may be from that of its material."""
    found = palpation_metrics(trace)
    if found is None:
        return []
    text = "The body is the one that is rendered. Its force"
    if found.mesh_error is None:
        text += " has an error by the mesh that is not known"
    else:
        text += f" has an error by the mesh of up to {100 * found.mesh_error:.0f} % (nodes in contact: {found.nodes})"
    if found.softening is not None:
        text += f", and may be up to {100 * found.softening:.0f} % too small, as small strains are assumed"
    return [f"{text}."]


def _states(count: int) -> str:
    return "1 state" if count == 1 else f"{count} states"


def _method(s: Scenario, found: _Findings) -> list[str]:
    rest = found.rest
    if rest is None:
        return []
    if isinstance(rest.loop, MultirateLoop):
        how = (
            f"The loop is one matrix over an update of {rest.loop.every} ticks: the local model within it, and the "
            "corrections of the last updates, measured in the core's own model."
        )
    else:
        how = (
            "The body's force per displacement of the tip is the impulse response of the core's own model, measured "
            f"with its {rest.nodes} nodes in contact and realized with {_states(rest.loop.body.nstates)}."
        )
    steps = [how, f"Criteria, each on its own: {', '.join(rest.criteria)}."]
    if found.depths:
        at = ", ".join(f"{1e3 * one.depth:.3g} mm: factor {one.stiffness_margin:.4g}" for one in found.depths)
        steps.append(f"Other depths of the run and the stiffness margin there: {at}.")
    elif (changed := _last_change(s)) > 0.0:
        steps.append(f"No other depth is tested: after {changed:g} s, the last change, the run passes none.")
    return steps


def _assumptions(s: Scenario) -> tuple[str, ...]:
    choice = s.object.body
    assert choice is not None
    sentences = [*assumptions(s), "The nodes in contact stay the same, and those that stick go on sticking."]
    if s.operator.kind != "arm" and not choice.options.get("static_friction", 0.0):
        sentences.append("Without friction the operator controls motions along the surface.")
    if _scales_mass(s):
        sentences.append("The margin scales the body's whole force: modulus and density together, not one of them.")
    if choice.supports:
        last = choice.supports[-1].at
        sentences.append(f"The supports of the body are those after their last change, at {last:g} s.")
    if (moved := last_motion(choice)) > 0.0:
        sentences.append(f"The tool stays as it is after its last motion, which ends at {moved:g} s.")
    return tuple(sentences)
