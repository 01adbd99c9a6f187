"""Judge a recorded run: the state that follows from its evidence, and the reason in a sentence."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from palpate.arrays import Array
from palpate.contact.unfound import MOST_NODES, MOST_PLACES, crowded, unfound
from palpate.devices.reach import beyond_reach
from palpate.fem.model_spec import LAWS
from palpate.scenario import Scenario
from palpate.simulation.bodies import (
    depth_at_end,
    depth_in_unmoved_body,
    depth_where_untouched,
    depth_without_contact,
    is_behind_fixed,
)
from palpate.simulation.continuation import may_slide, moves_on
from palpate.simulation.decision import (
    BAND,
    BEFORE,
    FLOOR,
    GROWING,
    SHARE,
    SUSTAINED,
    Evidence,
    ahead,
    chatters,
    decide,
    generates,
    slips,
)
from palpate.simulation.drive_hold import drive_hold
from palpate.simulation.evidence import evidence, interruption, is_one_sided, moved_until, pushed_through
from palpate.simulation.linear_contact import UNHELD
from palpate.simulation.linear_evidence import LinearRadii, linear_radii_of
from palpate.simulation.recorded import (
    OneOfScene,
    Recorded,
    each_recorded,
    external_forces,
    held_tip,
    of_each_object,
    recorded_scenario,
)
from palpate.simulation.support_phase import last_change
from palpate.simulation.tool_motion import closed_over, tool_poses
from palpate.simulation.verdict import FAILED, OSCILLATES, State, Verdict
from palpate.simulation.windows import Window, windows

__all__ = ["judge", "judge_pushed"]

AXES = "xyz"
STILL = 1e-7  # m: a tip that moves less was not excited
STAYS_OFF = 0.1  # of a run: a tip that was off the object for so long at its end does not bounce
APPROACHES = 1e-3  # of the deflection: a tip that moves more in the last fifth does not rest yet


def judge(trace: Recorded, radius: float | None = None) -> Verdict:
    """Return the verdict of a recorded run.

    The run is judged where it ends, in the window in which the external force stays constant. An oscillation in an
    earlier stretch of constant force counts as well. The linear loop of a spring or wall is evaluated at the start pose
    and at the pose of rest, and the worse of the two counts.

    Args:
        trace: of the run.
        radius: spectral radius of the linear loop; None: it is evaluated; nan: the run alone is judged.
    """
    scenario = recorded_scenario(trace)
    if scenario is not None and scenario.operator.kind == "fixed" and trace.unstable_from is None:
        return _fixed(trace, scenario)
    linear, unknown = linear_radii_of(trace, scenario) if radius is None else (_alone(radius), "")
    if trace.unstable_from is not None or len(trace.time) < 2:
        return _diverged(trace, linear)
    *earlier, final = windows(external_forces(trace, scenario))
    of_all = trace.metadata.get("object", {}).get("growth_of_all", [np.inf] * (len(earlier) + 1))
    for window, growth in zip(earlier, of_all, strict=False):
        found = evidence(trace, scenario, window, None)
        state = State(int(decide(found)[0]))
        if state in OSCILLATES and not growth < SUSTAINED:  # it counts even if the force changes later
            return _explained(trace, scenario, window, found, state, linear)
    found = evidence(trace, scenario, final, None if linear is None else linear.worst)
    state = State(int(decide(found)[0]))
    if state in OSCILLATES and of_all[-1] < SUSTAINED:
        kept = f"{100 * of_all[-1]:.3g} % of that in the fifth before"
        reason = f"the tip oscillates, but the oscillation of all tips together decays, to {kept}: run longer"
        return Verdict(State.UNDECIDED, reason)
    if state is State.SETTLED and scenario is None and trace.metadata.get("scenario"):
        reason = "the scenario of the run cannot be read any more, as where a file that it names is gone"
        return Verdict(State.UNDECIDED, reason)
    if state is State.SETTLED and not _excited(trace):
        reason = "nothing excites the loop: give [reference] or [operator] a force"
        return Verdict(State.UNDECIDED, reason, linear=_text(linear))
    contact = scenario is not None and scenario.object.kind in ("mesh", "body")  # small motions are not all there
    if (
        state is State.SETTLED
        and (linear is None or contact)
        and scenario is not None
        and scenario.run.record_every > 1
    ):
        reason = f"one of {scenario.run.record_every} ticks is recorded, and an oscillation between them does not show"
        return Verdict(State.UNDECIDED, reason)
    unheld = unknown.startswith(UNHELD)
    if state is State.SETTLED and may_slide(trace, unheld):
        why = unknown if unheld else "its mean position still shifts"
        return Verdict(State.UNDECIDED, f"it rests at the end, but {why}, and the tip may slide off after the run")
    verdict = _explained(trace, scenario, final, found, state, linear)
    if scenario is not None and (changed := last_change(scenario)) is not None and final.constant:
        since = f"judged after the last change of supports, at {changed:g} s"
        verdict = replace(verdict, reason=f"{verdict.reason}; {since}")
    return replace(verdict, linear=f"no linear loop is known: {unknown}") if unknown else verdict


def _fixed(trace: Recorded, scenario: Scenario) -> Verdict:
    """Return the verdict of a run whose tip is fixed: without a loop, but with a drive and a controller."""
    lacking = _without_force(trace)
    if lacking is not None or len(trace.time) < 2:
        return Verdict(State.UNDECIDED, lacking or "the run has no samples to judge")
    window = windows(external_forces(trace, scenario))[-1]
    if float(trace["saturated"][window.ending].mean()) > SHARE:
        since, reason = _limited(trace, window)
        return Verdict(State.DRIVE_LIMIT, reason, since)
    if pushed_through(trace) is not None:
        lost, reason = _lost(trace, 0.0)
        return Verdict(State.CONTACT_LOST, reason, lost)
    command = trace["command_force"][window.ending]
    change, largest = float(np.ptp(command, axis=0).max()), float(np.linalg.norm(trace["object_force"], axis=1).max())
    if not np.isfinite(change) or change > BAND * max(largest, 1e-12):
        span = f"{trace.time[window.ending][-1] - trace.time[window.ending][0]:.3g} s"
        return Verdict(State.UNDECIDED, f"the tip is fixed, but the command still changes, by {change:.3g} N in {span}")
    return Verdict(State.SETTLED, "the tip is fixed, so there is no loop that could oscillate")


def _limited(trace: Recorded, window: Window) -> tuple[float, str]:
    """Return when the drive came to its limit, and for which share of the end of the run it is there."""
    since = float(trace.time[np.flatnonzero(trace["saturated"][:, 0])[0]])
    share = f"{100 * float(trace['saturated'][window.ending].mean()):.3g} %"
    return since, f"at the end the drive is at its limit {share} of the time, first at t = {since:.4g} s"


def judge_pushed(trace: Recorded, begin: int, kept: float, radius: float | None = None) -> Verdict:
    """Return the verdict of a run from a sample on, after a push, under forces that stay constant from there.

    Args:
        trace: of the run, every tick.
        begin: first sample after the push.
        kept: response to the push at the end, relative to that right after it.
        radius: spectral radius of the linear loop; None or nan: the run alone is judged.
    """
    linear = _alone(radius)
    if trace.unstable_from is not None:
        return _diverged(trace, linear)
    scenario, window = recorded_scenario(trace), Window(begin, len(trace.time) - 1)
    found = evidence(trace, scenario, window, radius, kept)
    return _explained(trace, scenario, window, found, State(int(decide(found)[0])), linear)


def _excited(trace: Recorded) -> bool:
    """Return whether a force or an initial displacement has moved the tip."""
    forces = [trace[name] for name in ("reference_force", "operator_force") if name in trace]
    return any(np.any(force) for force in forces) or float(np.ptp(held_tip(trace), axis=0).max()) > STILL


def _text(linear: LinearRadii | None) -> str | None:
    return None if linear is None else str(linear)


def _alone(radius: float | None) -> LinearRadii | None:
    """Return one spectral radius as that of a run; None if it is not known."""
    return None if radius is None or np.isnan(radius) else LinearRadii(radius, None)


def _diverged(trace: Recorded, linear: LinearRadii | None) -> Verdict:
    since = trace.unstable_from
    if since is None:
        return Verdict(State.UNDECIDED, "the run has no samples to judge", linear=_text(linear))
    axis = None
    if len(trace.time) > 1:
        tip = held_tip(trace)
        axis = AXES[int(np.argmax(np.abs(tip[-1] - tip[0])))]
    reason = f"diverges at t = {since:.4g} s" + (f", most along {axis}" if axis else "")
    return Verdict(State.UNSTABLE, reason, since, axis, linear=_text(linear))


def _explained(
    trace: Recorded,
    scenario: Scenario | None,
    window: Window,
    e: Evidence,
    state: State,
    linear: LinearRadii | None,
) -> Verdict:
    """Return the verdict with its reason."""
    time = trace.time
    lacking = _without_force(trace) or _without_force(trace, window.ending)
    never = state is State.CONTACT_LOST and not trace["touching"].any() and pushed_through(trace) is None
    if lacking is not None and (never or state in (State.SETTLED, State.UNDECIDED)):
        return Verdict(State.UNDECIDED, lacking, linear=_text(linear))
    if state is State.SETTLED and (why := next(filter(None, map(_not_held, each_recorded(trace))), None)) is not None:
        return Verdict(State.UNDECIDED, why, linear=_text(linear))
    last_fifth = time[window.ending]
    axis, amplitude, frequency = _oscillation(last_fifth, held_tip(trace)[window.ending])
    swing = f"{1e3 * amplitude:.3g} mm along {axis}" + (f" at {frequency:.3g} Hz" if frequency else "")
    span = f"{last_fifth[-1] - last_fifth[0]:.3g} s"
    ratio = float(e.late[0]) / max(float(e.prior[0]), 1e-300)
    since: float | None = None
    without_loop = replace(e, linear=np.zeros(1, dtype=int))
    alone = State(int(decide(without_loop)[0])) if state is State.UNSTABLE else state
    if alone is not state:
        reason = _hidden(trace, e, alone, swing, linear)
    elif state is State.UNSTABLE:
        since = float(time[window.begin])
        factor = _factor(ratio if ratio > GROWING else float(np.fmax(ratio, e.widening[0])))
        reason = f"an oscillation by {swing} grows by a factor of {factor} in {span}"
    elif state is State.OUT_OF_REACH:
        since, reason = _reach(trace, scenario, window)
    elif state is State.CONTACT_LOST:
        since, reason = _lost(trace, float(e.apart[0]))
        if e.touching[0] > 0.0 and pushed_through(trace) is None:
            reason += f"; it touches it within the last {span} and may bounce on: give a longer run.duration"
    elif state is State.DRIVE_LIMIT:
        since, reason = _limited(trace, window)
    elif state is State.BOUNDED_OSCILLATION:
        bounces = f"the tip bounces, {int(e.contacts[0])} contacts in {span}, and " if e.contacts[0] else "it "
        reason = f"{bounces}oscillates by {swing}"
        if not np.isnan(e.kept[0]):
            reason += f", and keeps {float(e.kept[0]):.0%} of its response to a push"
    elif state is State.SETTLED:
        still = max(BAND * float(e.deflection[0]), float(e.resolution[0]), 1e-6)
        reason = f"the tip rests within {1e3 * float(e.ripple[0]):.2g} mm"
        if e.ripple[0] > still:
            reason = f"its oscillation of {swing} decays by a factor of {_factor(ratio)} in {span}; {linear}"
        if scenario is not None and is_one_sided(scenario) and e.touching[0] == 0.0:
            reason += ", off the object"
        if on := moves_on(trace):
            reason += f"; {on}"
        if scenario is not None and (hold := drive_hold(trace, scenario)) is not None:
            reason += f"; {hold}"
    else:
        moves = scenario is not None and window.constant and moved_until(trace, scenario) > window.ending.start
        tools = scenario is not None and bool(tool_poses(scenario, time[[-1]]).size)
        what = "tool" if tools else "object"
        moving = f"the {what} moves until the end: hold it at rest for the last fifth of the run"
        reason = moving if moves else _undecided(trace, e, swing)
        if not window.constant and (supports := _unsupported(trace, scenario)) is not None:
            reason = supports
    if state in (State.SETTLED, State.UNDECIDED) and (off := interruption(trace, scenario)) > 0.0:
        reason += f"; contact lost for {1e3 * off:.4g} ms on the way"
    swings = state in OSCILLATES
    if lacking is not None:
        reason += f"; {lacking}"
    if linear is not None and (swings or state is State.UNDECIDED):
        reason += f"; {linear}"
    if not swings:
        return Verdict(state, reason, since, linear=_text(linear))
    return Verdict(state, reason, since, axis, amplitude, frequency, _text(linear))


def _factor(ratio: float) -> str:
    """Return a ratio with three digits, or with as many as distinguish it from 1."""
    from_one = abs(ratio - 1.0)
    return f"{ratio:.{max(3, 1 - math.floor(math.log10(from_one))) if from_one > 0.0 else 3}g}"


def _without_force(trace: Recorded, rows: slice = slice(None)) -> str | None:
    """Return why the force on a body is not known in the last rows of a trace, or in all; None if it is."""
    missing, solved = np.zeros(1, dtype=bool), of_each_object(trace, "solved")
    for found in solved:
        missing = missing | (found[rows, 0] == 0.0)
    if np.mean(missing) <= SHARE:
        return None
    scenario = recorded_scenario(trace)
    most = MOST_PLACES if scenario is None or _by_distance(scenario) else MOST_NODES
    full = any(
        nodes[rows, 0][found[rows, 0] == 0.0].max(initial=0.0) >= most - 1
        for found, nodes in zip(solved, of_each_object(trace, "contact_nodes"), strict=False)
    )
    samples = f"{np.count_nonzero(missing)} of {'the last ' if rows.start else ''}{len(missing)} samples"
    return unfound(samples, crowded(most) if full else None)


def _by_distance(scenario: Scenario) -> bool:
    """Return whether a body of a scenario has contact by signed distance."""
    objects = [scenario.object, *(scenario.objects or {}).values()]
    return any(one.body is not None and one.body.by_distance for one in objects)


def _not_held(trace: Recorded) -> str | None:
    """Return why a body does not hold a tip at the end of a run as a real one would; None if it does.

    Its surface is fixed, held or not touched there, or it hardly yields. Tips of a gripper overlap. Or a body of small
    strains is pressed through a fixed part or, by signed distance, deeper than the tip's radius, where forces fall.
    """
    scenario = recorded_scenario(trace)
    body = None if scenario is None else scenario.object.body
    if body is None:
        return None
    if (depth := depth_where_untouched(trace)) > 0.0:
        return (
            f"the tip is {1e3 * depth:.3g} mm deep where the surface of the body is fixed, held or not touched: it "
            "does not push back there; use another place"
        )
    if (depth := depth_in_unmoved_body(trace)) > 0.0:
        moved = f"{1e3 * float(np.linalg.norm(trace['deflection'][-1])):.2g} mm"
        return (
            f"the tip is {1e3 * depth:.3g} mm deep in the body, which yields by {moved} only: a support was released "
            "under it, or its nodes are too far apart for the tip"
        )
    if (closed := closed_over(body, trace.time[-1:])) is not None:
        return closed
    if body.kind in LAWS:
        return None
    remedy = "use a larger tip, a smaller force, or hyperelastic"
    if is_behind_fixed(trace):
        depth = 1e3 * float(np.linalg.norm(trace["deflection"][-1]))
        where = "through its fixed or stiff part, as no real body can be"
        return f"the body is pressed in by {depth:.3g} mm, {where}: {remedy}"
    if not body.by_distance:
        return None
    below, radius = depth_at_end(trace), body.radius
    if not below > radius:
        return None
    return (
        f"the tip rests {1e3 * below:.3g} mm deep, more than its radius of {1e3 * radius:.3g} mm: contact by "
        f"signed distance does not hold it there as a body would; {remedy}"
    )


def _hidden(trace: Recorded, e: Evidence, alone: State, swing: str, linear: LinearRadii | None) -> str:
    """Return what a run does whose linear loop is unstable, if no oscillation grows at its end."""
    if linear is not None and linear.leaves:
        away = float(np.linalg.norm(trace["tip"][-1] - trace["tip"][0]))
        return f"the run leaves its start, where the loop is unstable, and comes to rest {1e3 * away:.3g} mm away"
    if alone in FAILED:
        return f"{alone.label} at the end of the run, with an oscillation by {swing}"
    if bool(generates(e)[0]):
        share = f"{100 * float(e.generated[0]):.3g} % of the energy that the operator supplied"
        return f"it moves by {swing}, and its motors keep generating energy: {share} in the last fifth"
    return f"the run of {trace.time[-1]:.4g} s does not show the growth; it ends with an oscillation by {swing}"


def _lost(trace: Recorded, apart: float) -> tuple[float | None, str]:
    """Return when the tip left the object, and the reason."""
    tip = "a tip of the tool" if of_each_object(trace, "point1_force") else "the tip"
    if (pushed := pushed_through(trace)) is not None:
        if pushed == 0.0:
            where = "inside the body or behind its contact surface, where it has no contact"
            return pushed, f"{tip} starts {where}: check object.position"
        return pushed, f"{tip} is pushed through the body at t = {pushed:.4g} s, and in it without contact at the end"
    touching = np.flatnonzero(trace["touching"][:, 0])
    for one in each_recorded(trace):
        if isinstance(one, OneOfScene) and depth_without_contact(one) > 0.0:
            off = np.flatnonzero(one["touching"][:, 0] > 0.0)
            since = float(trace.time[off[-1]]) if len(off) else None
            return since, _inside(one, f'the tip is in the body "{one.name}" without contact')
    if not len(touching):
        return None, _inside(trace, "the tip never touches the object")
    after = [np.flatnonzero(lost[touching[-1] :, 0] > 0.0) for lost in of_each_object(trace, "contact_lost")]
    if rows := [int(found[0]) for found in after if len(found)]:
        pushed = float(trace.time[touching[-1] + min(rows)])
        return pushed, f"{tip} is pushed through the body at t = {pushed:.4g} s, and off it at the end"
    if touching[-1] >= 0.99 * (len(trace.time) - 1):
        first = touching[np.flatnonzero(np.diff(touching) > 1)[0]] if np.any(np.diff(touching) > 1) else touching[-1]
        share = f"{100 * apart:.3g} % of the time since the contact is established"
        return float(trace.time[first]), f"the tip is off the object in {share}, under a force that presses it on"
    since, stays = float(trace.time[touching[-1]]), touching[-1] <= (1.0 - STAYS_OFF) * (len(trace.time) - 1)
    if stays and (inside := _inside(trace, "")):
        return since, f"{tip} is off the object from t = {since:.4g} s on{inside}"
    why = "under a force that presses it on"
    forces = [trace[name][-1] for name in ("reference_force", "operator_force") if name in trace]
    if len(forces) == 2 and np.linalg.norm(sum(forces)) <= BAND * np.linalg.norm(forces[0]):
        why = "where the arm holds it against the reference that presses it on: give more force or a softer arm"
    return since, f"the tip is off the object from t = {since:.4g} s on, {why}"


def _inside(trace: Recorded, text: str) -> str:
    """Return a text, with the depth if a tip ends below the surface of a body without contact."""
    if not (deep := depth_without_contact(trace)) > 0.0:
        return text
    scenario = recorded_scenario(trace)
    where, remedy = "it is between the nodes", "a finer mesh, a larger tip or another place"
    if depth_where_untouched(trace) > 0.0:
        where, remedy = "the surface is fixed, held or not touchable there", "another place"
    elif scenario is not None and _by_distance(scenario) and trace["touching"].any():
        where, remedy = "the body has moved away from it", "another place"
    return f"{text}, {1e3 * deep:.2g} mm below the surface of the body at rest: {where}; use {remedy}"


def _unsupported(trace: Recorded, scenario: Scenario | None) -> str | None:
    """Return that the supports change too late to judge a run, if that is why; otherwise None."""
    changed = None if scenario is None else last_change(scenario)
    if changed is None or not windows(external_forces(trace, scenario)[:, :-1])[-1].constant:
        return None
    return (
        f"the supports of the body change at {changed:g} s, too late to judge what follows: give a longer "
        "run.duration, so that it is a twentieth of the run or longer"
    )


def _undecided(trace: Recorded, e: Evidence, swing: str) -> str:
    end = f"{trace.time[-1]:.4g} s"
    if not e.constant[0]:
        return "the external force changes until the end: hold it for the last twentieth of the run or longer"
    if int(e.linear[0]) < 0:
        return "the run settles, but friction, encoder counts or drive limits may hide an instability"
    if float(e.drift[0]) > BAND:
        return f"the command still changes, by {100 * float(e.drift[0]):.3g} % of the largest force at the end"
    if abs(float(e.error[0])) > BAND:
        off = f"{100 * float(e.error[0]):.3g} % from {'the tool' if 'tool' in trace else 'force over stiffness'}"
        if e.ripple[0] > max(APPROACHES * float(e.deflection[0]), float(e.resolution[0])):
            return f"after {end} it is {off}, and still moves by {swing}: give a longer run.duration"
        return f"it rests {off}"
    band = max(BAND * float(e.deflection[0]), float(e.resolution[0]), FLOOR)
    if e.creep[0] > band:
        left = f"{1e3 * float(e.creep[0]):.3g} mm"
        return f"the body may creep by another {left}: give a run.duration of several retardation times"
    if e.ripple[0] <= band and e.ripple_before[0] > BEFORE * band:
        before = f"{1e3 * float(e.ripple_before[0]):.3g} mm"
        return f"it rests in the last fifth alone, and moved by {before} in the fourth: give a longer run.duration"
    if e.ripple[0] <= band and ahead(e)[0] > band:
        left = f"{1e3 * float(ahead(e)[0]):.3g} mm"
        return f"its mean position still shifts, and {left} may be left: give a longer run.duration"
    if e.ripple[0] <= band and int(e.linear[0]) <= 0 and bool(chatters(e)[0]):
        return f"it oscillates by {swing}, within two encoder counts, in which a growing oscillation begins as well"
    if bool(slips(e)[0]) and not np.isnan(e.onward[0]):
        return moves_on(trace) or "the tip moves on after the run"
    if e.ripple[0] <= band and bool(slips(e)[0]):
        return f"it oscillates by {swing}, within two encoder counts, in which a contact with friction may slip on"
    if bool(generates(e)[0]) and int(e.linear[0]) <= 0:
        share = f"{100 * float(e.generated[0]):.3g} % of the energy that the operator supplied"
        return f"it moves by {swing}, and its motors keep generating energy: {share} in the last fifth"
    return f"it has not settled after {end}, and still moves by {swing}: give a longer run.duration"


def _reach(trace: Recorded, scenario: Scenario | None, window: Window) -> tuple[float | None, str]:
    """Return when the device left its reach, and how."""
    assert scenario is not None
    device, q = scenario.load_device(), trace["angle"]
    rows = np.flatnonzero(beyond_reach(device, q[0], q[window.begin :]))
    if not len(rows):
        return None, "the device cannot reach the rest, the deflection of force over stiffness"
    row = window.begin + int(rows[0])
    low, high = device.joint_limits
    if np.any(outside := (q[row] < low) | (q[row] > high)):
        how = f"joint {int(np.flatnonzero(outside)[0]) + 1} is beyond its limit"
    elif device.model.revolute and np.any(turned := np.abs(q[row] - q[0]) > 2.0 * np.pi):
        how = f"joint {int(np.flatnonzero(turned)[0]) + 1} has turned round"
    else:
        how = "the pose is singular, so the device cannot move the tip in every direction,"
    return float(trace.time[row]), f"{how} at t = {trace.time[row]:.4g} s"


def _oscillation(time: Array, tip: Array) -> tuple[str, float, float | None]:
    """Return the axis with the largest range of the tip, half that range, m, and the frequency there, Hz."""
    span = np.ptp(tip, axis=0)
    axis = int(np.argmax(span))
    away = tip[:, axis] - np.polynomial.Polynomial.fit(time, tip[:, axis], 1)(time) if len(time) > 2 else np.zeros(1)
    away[np.abs(away) <= 1e-9 * span[axis]] = 0.0  # rounding of a straight motion
    crossings = int(np.count_nonzero(np.diff(np.signbit(away))))
    frequency = crossings / (2.0 * (time[-1] - time[0])) if crossings > 3 else None
    return AXES[axis], float(span[axis]) / 2.0, frequency
