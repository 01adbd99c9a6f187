"""Certificate of a scenario whose object is a mesh: every contact mode near the run's path, and their switching."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.scenario import Scenario
from palpate.simulation.judgment import judge
from palpate.simulation.verdict import FAILED, OSCILLATES, State, Verdict
from palpate.stability.assumptions import assumptions
from palpate.stability.certificate import Certificate
from palpate.stability.contact_run import MOVING, Observed, PushedRun, run_pushed
from palpate.stability.counter_example import CounterExample
from palpate.stability.criteria import check_stability
from palpate.stability.mesh_contact import MeshContact, mesh_contact
from palpate.stability.mesh_rest import no_rest
from palpate.stability.mesh_sites import NEAR
from palpate.stability.mode_stability import (
    CORNERS,
    ModeStability,
    Switching,
    contact_matrix,
    gain_margin,
    site_switching,
)
from palpate.stability.sticking import largest_disturbance
from palpate.stability.switching import has_solver

__all__ = ["certify_mesh"]

FEW_STATES = 14  # of the loop, up to which switching is tested at three sites and not at the last alone
NEARLY = 0.9995  # spectral radius above which the decay may not be visible in the run
STICKS = 1e-3  # of the contact's force: a smaller disturbance under which the proxy sticks counts as none
SECURE = 0.05  # the same beside a mode that is unstable
WATCH = (0.5, 8.0)  # s, shortest and longest time that a pushed run is watched
HOLD = (20.0, 60.0)  # s, shortest and longest time that the last forces are held for a run that is undecided


def certify_mesh(s: Scenario) -> Certificate:
    """Return the certificate of a scenario whose object is a mesh; see ``palpate.stability.certify``.

    A run that leaves it undecided is continued under its last forces and judged again.

    Raises:
        StabilityError, ScenarioError, DesignError, PoseError: as ``mesh_contact``.
    """
    contact = mesh_contact(s)
    found = _certify(contact)
    if found.verdict.state is State.UNDECIDED and contact.observed.constant:
        contact = mesh_contact(s, hold=_hold(contact))
        found = _certify(contact)
        if found.verdict.state is State.UNDECIDED and (reason := no_rest(contact)):
            found = replace(found, verdict=Verdict(State.UNSTABLE, reason))
    return found


def _certify(contact: MeshContact) -> Certificate:
    """Return the certificate that one run admits."""
    s, resting, worst = contact.scenario, contact.resting, contact.worst
    margin = {"spectral_radius": resting.radius, "spectral_radius_worst_mode": worst.radius}
    criteria, agree = _criteria(resting, worst)
    steps = _method(contact)
    if contact.observed.fails and not _near_limit(contact):
        return _failed(contact, margin, criteria, steps)
    if not agree:
        reason = f"a mode is so near its limit ({worst.mode.name}) that the criteria disagree."
        return _certificate(contact, criteria, State.UNDECIDED, reason, {}, steps)
    pushed = run_pushed(s, contact.observed, _watch(contact), _judged_radius(contact))
    steps.append(_push_sentence(pushed))
    if resting.radius >= 1.0:
        return _unstable(contact, pushed, margin, criteria, steps)
    if not worst.stable and contact.observed.verdict.state is State.CONTACT_LOST and not contact.touching:
        reason = f"small motions grow {_where(worst)}, and the verdict of the run is {contact.observed.verdict}."
        example = CounterExample(_lasting(s, contact.observed), math.inf, f"the scenario itself, {reason}")
        return _certificate(contact, criteria, State.UNSTABLE, reason, margin, steps, example)
    if not all(one.stable for one in contact.here) and (reason := _unstable_beside(contact, pushed)):
        return _certificate(contact, criteria, State.UNDECIDED, reason, margin, steps)
    modes = "every contact mode is stable" if worst.stable else "every contact mode where it rests is stable"
    if resting.drift > 0.0:
        reason = (
            f"{modes}, but {resting.mode.name} nothing holds the tip along the "
            "surface, so it may slide to another part of the mesh; give friction (object.surface.static_friction) or "
            "an arm (operator)."
        )
        return _certificate(contact, criteria, State.UNDECIDED, reason, margin, steps)
    if not contact.touching:
        reason = f"{modes}, but at its end the tip is off the mesh; let the run end in contact."
        return _certificate(contact, criteria, State.UNDECIDED, reason, margin, steps)
    if pushed.fails or pushed.slide > MOVING:
        slides = f"the run slides on at {1e3 * pushed.slide:.2g} mm/s under constant forces"
        how = f"the verdict of the run is {pushed.verdict}" if pushed.fails else slides
        reason = f"{modes}, but after a push of {pushed.push:.2g} N {how}."
        return _certificate(contact, criteria, State.UNDECIDED, reason, margin, steps)
    run = contact.observed.verdict
    if contact.observed.constant and run.state in FAILED:
        reason = f"{modes}, but the verdict of the run is {run}."
        return _certificate(contact, criteria, State.UNDECIDED, reason, margin, steps)
    return _stable(contact, pushed, margin, criteria, steps)


def _certificate(
    contact: MeshContact,
    criteria: dict[str, bool],
    state: State,
    reason: str,
    margin: dict[str, float],
    steps: Sequence[str],
    example: CounterExample | None = None,
) -> Certificate:
    s = contact.scenario
    holds = (*assumptions(s), *_assumptions(contact))
    return Certificate(
        s.title, Verdict(state, reason), holds, margin, tuple(steps), criteria, None, example, s.to_dict()
    )


def _failed(contact: MeshContact, margin: dict[str, float], criteria: dict[str, bool], steps: list[str]) -> Certificate:
    """Return the certificate of a scenario whose own run diverges, bounces or oscillates."""
    s, run = contact.scenario, contact.observed.verdict
    unstable = [one for one in contact.found if not one.stable]
    why = f"and {len(unstable)} of {len(contact.found)} contact modes are unstable"
    if not unstable:
        why = "although every contact mode by itself is stable"
    elif len(unstable) == 1:
        why = f"and the loop is unstable {unstable[0].mode.name}"
    if _decays_slowly(contact, contact.resting.radius):
        reason = f"stable where it rests, but so near its limit that the verdict of the run is {run}."
        return _certificate(contact, criteria, State.UNDECIDED, reason, margin, steps)
    example = CounterExample(_lasting(s, contact.observed), math.inf, f"the scenario itself, {run}.")
    reason = f"the verdict of the run is {run}, {why}."
    return _certificate(contact, criteria, State.UNSTABLE, reason, margin, steps, example)


def _unstable(
    contact: MeshContact, pushed: PushedRun, margin: dict[str, float], criteria: dict[str, bool], steps: list[str]
) -> Certificate:
    """Return the certificate of a scenario whose mode at rest is unstable."""
    resting, period = contact.resting, contact.scenario.period
    doubling = math.log(2.0) / math.log(resting.radius) * period
    margin = {**margin, "doubling_time_s": doubling, "frequency_Hz": resting.angle / (2.0 * math.pi * period)}
    motion = f"an oscillation at {margin['frequency_Hz']:.4g} Hz" if resting.angle > 0 else "a motion"
    grows = f"{resting.mode.name}, {motion} doubles every {doubling:.3g} s"
    runs = (contact.observed.verdict, pushed.verdict)
    shown = [f"the verdict of the run is {run}" for run in runs if run.state in (*OSCILLATES, State.CONTACT_LOST)]
    if pushed.kept > 1.0:
        shown.append(f"the response of the run to a push grows by a factor of {pushed.kept:.3g}")
    if not shown:
        reason = f"{grows}, but the run does not show it; its verdict after a push is {pushed.verdict}."
        return _certificate(contact, criteria, State.UNDECIDED, reason, margin, steps)
    reason = f"{grows}; {shown[0]}."
    return _certificate(contact, criteria, State.UNSTABLE, reason, margin, steps)


def _where(one: ModeStability) -> str:
    """Return the name of a mode, its pose and its spectral radius."""
    return f"{one.mode.name}, at the pose at t = {one.site.time:.3g} s (spectral radius {one.radius:.6g})"


def _unstable_beside(contact: MeshContact, pushed: PushedRun) -> str:
    """Return why a run is undecided that rests beside unstable modes.

    It is empty if the proxy provably keeps its mode under disturbances of a twentieth of the contact's force.
    """
    worst = max(contact.here, key=lambda one: one.radius)
    if _largest_disturbance(contact, pushed, SECURE) > 0.0:
        return ""
    return (
        f"stable where the run rests, but unstable {_where(worst)}; it is not proven that the contact keeps its mode "
        f"under disturbances of {SECURE:.0%} of its force."
    )


def _stable(
    contact: MeshContact, pushed: PushedRun, margin: dict[str, float], criteria: dict[str, bool], steps: list[str]
) -> Certificate:
    away = contact.away
    covered = contact.here if away else contact.found
    stable = [one for one in covered if one.stable]
    factor, limiting = gain_margin(stable)
    margin["gain_margin"] = factor
    margin["gain_margin_at_rest"] = gain_margin([contact.resting])[0]
    order, decided = _switching(contact, pushed, bool(away), margin, steps)
    kinds = Counter(one.mode.kind for one in stable)
    drift = max(one.drift for one in stable)
    if drift > 1.0 + 1e-6:
        margin["drift_doubling_time_s"] = math.log(2.0) / math.log(drift) * contact.scenario.period
    stiffer = (
        "at any stiffness of the surface"
        if math.isinf(factor)
        else f"with forces of the surface up to {factor:.4g} times as large at the same depths "
        f"(then unstable {limiting.mode.name})"
    )
    count = f"each of {len(stable)}" if len(stable) == len(covered) else f"{len(stable)} of {len(covered)}"
    verb = "is" if len(stable) == len(covered) else "are"
    place = "where the run rests" if away else "along the run"
    reason = f"{count} contact modes ({', '.join(sorted(kinds))}) {place} {verb} stable, {stiffer}; {order}."
    if away:
        worst = max(away, key=lambda one: one.radius)
        reason += f" Before it rests, small motions grow {_where(worst)}."
    return _certificate(contact, criteria, State.STABLE if decided else State.UNDECIDED, reason, margin, steps)


def _switching(
    contact: MeshContact, pushed: PushedRun, rest_alone: bool, margin: dict[str, float], steps: list[str]
) -> tuple[str, bool]:
    """Return what is proven about changes of the mode, as part of the claim, and whether that suffices.

    Args:
        contact: the contact.
        pushed: its run after a push.
        rest_alone: whether the claim holds for the last site alone.
        margin, steps: of the certificate, which are extended.
    """
    largest = _largest_disturbance(contact, pushed, STICKS)
    force = float(np.linalg.norm(contact.observed.trace["object_force"][contact.observed.rest]))
    point = contact.sites[-1].point
    keeps = "sticking" if point.rubs and point.friction > 0.0 else "on its face"
    sticks = (
        f"disturbances of the contact's force up to {largest:.3g} N ({100.0 * largest / force:.2g} %) leave the proxy "
        f"{keeps}, so no mode changes"
    )
    worst = max(contact.here, key=lambda one: one.radius)
    if not worst.stable:
        margin["disturbance_that_keeps_mode_N"] = largest
        doubling = math.log(2.0) / math.log(worst.radius) * contact.scenario.period
        if all(one.slides_away for one in contact.here if not one.stable):
            return f"{sticks}; beyond it the tip may slide away, its speed doubles in {doubling:.3g} s", True
        return f"{sticks}; beyond it motions may grow {worst.mode.name}, and double in {doubling:.3g} s", True
    last = len(contact.sites) - 1
    few = contact.sites[last].path.nstates <= FEW_STATES and not rest_alone
    switching = [site_switching(contact.sites[i]) for i in (sorted({0, last // 2, last}) if few else [last])]
    steps.append(_switching_method(switching))
    order = _order(contact, switching, margin)
    if all(one.proof != "undecided" for one in switching):
        return order, True
    if largest == 0.0:
        return order, False
    margin["disturbance_that_keeps_mode_N"] = largest
    return f"{sticks}; beyond it {order}", True


def _largest_disturbance(contact: MeshContact, pushed: PushedRun, least: float) -> float:
    """Return the disturbance under which the proxy sticks where it rests, N; 0 below `least` of the contact's force."""
    if not pushed.free.completed:
        return 0.0
    largest = largest_disturbance(contact.sites[-1], pushed.free)
    force = np.linalg.norm(contact.observed.trace["object_force"][contact.observed.rest])
    return largest if largest >= least * float(force) else 0.0


def _order(contact: MeshContact, switching: Sequence[Switching], margin: dict[str, float]) -> str:
    """Return what is proven about the order of the modes, as part of the claim, and add its numbers to ``margin``."""
    undecided = [one for one in switching if one.proof == "undecided"]
    if undecided:
        return f"their switching is undecided, because friction on {undecided[0].pair[0]} has no Lyapunov function"
    waits = [one for one in switching if one.proof == "dwell"]
    if waits:
        longest = max(waits, key=lambda one: one.dwell)
        margin["dwell_time_s"] = longest.dwell * contact.scenario.period
        return (
            f"motions stay bounded if a mode lasts {margin['dwell_time_s']:.3g} s on average (worst between "
            f"{longest.pair[0]} and {longest.pair[1]})"
        )
    apart = all(one.separates for one in switching)
    return f"motions stay bounded in any order of the modes{', and if contact is lost' if apart else ' in contact'}"


def _criteria(resting: ModeStability, worst: ModeStability) -> tuple[dict[str, bool], bool]:
    """Return the verdict of each criterion on both modes, and whether the criteria agree on each."""
    verdicts = [check_stability(contact_matrix(one.site, one.mode))[1] for one in (resting, worst)]
    criteria = {name: all(verdict[name] for verdict in verdicts) for name in verdicts[0]}
    agree = all(
        len(set(verdict.values())) == 1 or (one.drift > 0.0 and one.stable)
        for verdict, one in zip(verdicts, (resting, worst), strict=True)
    )
    return criteria, agree


def _near_limit(contact: MeshContact) -> bool:
    """Return whether the run oscillates so near the limit of stable modes that its decay is not visible in it."""
    return contact.resting.stable and _decays_slowly(contact, contact.worst.radius)


def _decays_slowly(contact: MeshContact, radius: float) -> bool:
    """Return whether the run oscillates no longer than motions of a spectral radius below 1 do."""
    return NEARLY < radius < 1.0 and judge(contact.observed.trace, radius).state not in OSCILLATES


def _judged_radius(contact: MeshContact) -> float:
    """Return the spectral radius with which a pushed run is judged: of the slowest mode where it rests.

    It is nan if that mode is unstable and is not the one in which the tip rests.
    """
    radius = contact.resting.radius if contact.resting.radius >= 1.0 else _slowest(contact)
    return radius if radius < 1.0 or not contact.resting.stable else math.nan


def _slowest(contact: MeshContact) -> float:
    """Return the spectral radius of the slowest mode where the run rests."""
    return max(one.radius for one in contact.found if one.site is contact.sites[-1])


def _watch(contact: MeshContact) -> float:
    """Return how long a pushed run is watched, s: six time constants of the slowest mode where it rests."""
    rate = abs(math.log(min(max(_slowest(contact), 1e-6), 2.0))) / contact.scenario.period
    return float(np.clip(6.0 / max(rate, 1e-9), *WATCH))


def _hold(contact: MeshContact) -> float:
    """Return how long the last forces are held for a run that is undecided, s: four time constants of the slowest."""
    rate = abs(math.log(min(max(_slowest(contact), 1e-6), 2.0))) / contact.scenario.period
    return float(np.clip(4.0 / max(rate, 1e-9), *HOLD))


def _lasting(s: Scenario, observed: Observed) -> dict[str, object]:
    """Return the tables of a scenario that lasts as long as the run that was observed."""
    tables = s.to_dict()
    duration = max(s.run.duration, observed.rest * s.period)
    return {**tables, "run": {**tables.get("run", {}), "duration": f"{duration:.6g} s"}}


def _push_sentence(pushed: PushedRun) -> str:
    kept = "" if math.isinf(pushed.kept) else f" It kept {100.0 * pushed.kept:.2g} % of its response."
    return (
        f"Where the run ends it was pushed with {pushed.push:.2g} N for 20 ms, without limits of the drive and watched "
        f"for {pushed.time:.3g} s; its verdict is {pushed.verdict}.{kept}"
    )


def _method(contact: MeshContact) -> list[str]:
    times = ", ".join(f"{site.time:.3g}" for site in contact.sites)
    faces = sum(len(site.points) for site in contact.sites)
    resolution = math.degrees(max(site.resolution for site in contact.sites))
    return [
        f"The loop was linearized at {len(contact.sites)} poses of the run (t = {times} s), and sampled exactly for "
        f"forces held over {contact.scenario.period * 1e3:g} ms.",
        f"At each pose every contact mode of the faces near the path was tested: sticking, sliding, valley edges and "
        f"vertices; {len(contact.found)} in all, on {faces} pairs of a normal (within {resolution:.2g} degrees) and a "
        "stiffness.",
        "The law of the mode at rest was measured on the proxy itself.",
        "Eigenvalues, Jury's table, Routh's array and a Lyapunov matrix were computed independently for the mode at "
        "rest and the worst mode.",
        f"The scenario was run for {contact.observed.rest * contact.scenario.period:.3g} s; its verdict is "
        f"{contact.observed.verdict}.",
    ]


def _switching_method(switching: Sequence[Switching]) -> str:
    where = ", ".join(f"{one.site.time:.3g}" for one in switching)
    if all(one.proof == "common" for one in switching):
        least = min(one.decrease for one in switching)
        return (
            f"At t = {where} s one Lyapunov matrix decreases by at least {least:.2g} of its value in every sample, for "
            f"every stiffness between the extremes and every force of Coulomb friction (a polygon of {CORNERS} corners "
            "about its disk); it was verified without the solver."
        )
    missing = "" if has_solver() else " The solver (pip install clarabel) is not installed."
    return (
        f"At t = {where} s no common Lyapunov matrix was found for all; the dwell time follows from the Lyapunov "
        f"matrices of slides in four directions at the extremes of stiffness.{missing}"
    )


def _assumptions(contact: MeshContact) -> list[str]:
    s = contact.scenario
    surface = s.object.surface
    assert surface is not None
    place = "the place where this run rests" if contact.away else "the path of this run"
    sentences = [
        f"The contact stays within {1e3 * NEAR:.0f} mm of {place}; other parts need another run.",
        "A step of the force at an edge of the mesh is a bounded disturbance.",
        "While the tip slides, motions along the surface slower than 2 Hz are the operator's.",
    ]
    if surface.dynamic_friction is not None and surface.dynamic_friction < surface.static_friction:
        sentences.append(
            "Static friction above dynamic friction can make a slowly driven tip stick and slip; its motions are "
            "bounded, not excluded."
        )
    if surface.shading > 0.0 or surface.field == "continuous":
        sentences.append("The proof for any order of the modes neglects shading and the slope of the stiffness.")
    if s.object.mesh is not None and s.object.mesh.radius > 0.0:
        sentences.append("A sphere is tested on the faces, and over an edge where it is at one of the poses above.")
    return sentences
