"""Evidence of recorded runs: oscillation, steady error, contact, reach and drive limits in one window."""

from __future__ import annotations

from dataclasses import asdict
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Flags
from palpate.devices import Device
from palpate.devices.reach import beyond_reach, unreachable
from palpate.scenario import Scenario
from palpate.simulation.bodies import depth_without_contact
from palpate.simulation.decision import BAND, FLOOR, GROWING, STILL, Evidence
from palpate.simulation.energy_balance import energy_balance, own_motions
from palpate.simulation.friction_hold import arm_spring, friction_hold, friction_of
from palpate.simulation.linear_evidence import linear_sign
from palpate.simulation.recorded import Recorded, each_recorded, held_tip, of_each_object, without_trend
from palpate.simulation.statics import force_over_stiffness, presses, steady_error
from palpate.simulation.windows import Window

FASTEST: Final = 1e100  # growth in a fifth of the window above which it is all the same
ROUNDING: Final = 1e-5  # of a body's deflection: single precision, and the iterations of its contact and equilibrium
CLEAR, SIDE_LOBE = 2.0, 0.0275  # periods from which a Hann window passes at most that share of an oscillation
ONE_SIDED: Final = ("wall", "mesh", "body", "force_law", "textured_wall")  # kinds of objects

__all__ = [
    "evidence",
    "interruption",
    "is_one_sided",
    "leaves_reach",
    "lossy",
    "moved_until",
    "pushed_through",
    "resolution",
    "second_differences",
    "swing",
]


def lossy(scenario: Scenario, device: Device) -> bool:
    """Return whether dry friction, encoder counts or drive limits may hide what the linear loop does."""
    return (
        scenario.device.encoder
        or scenario.device.saturation
        or bool(np.any(device.coulomb))
        or friction_of(scenario) > 0.0
    )


def resolution(scenario: Scenario, device: Device, angles: ArrayLike) -> Array:
    """Return the tip displacement of two encoder counts at `angles` (n, dof): (n,), m; 0 without encoders."""
    q = np.atleast_2d(angles)
    if not scenario.device.encoder:
        return np.zeros(len(q))
    jacobian = np.reshape(device.jacobian(q), (len(q), 3, device.dof))
    return np.asarray(2.0 * np.linalg.norm(np.abs(jacobian) @ device.encoder_step, axis=1), dtype=float)


def evidence(
    trace: Recorded, scenario: Scenario | None, window: Window, radius: float | None, kept: float = np.nan
) -> Evidence:
    """Return the evidence of one run in one window, as a batch measures it.

    Args:
        trace: of the run.
        scenario: None if it is not known.
        window: the window.
        radius: spectral radius of the linear loop; None or nan if it is not known.
        kept: as in Evidence.
    """
    first, last, fifth, ending = window.begin, window.end, window.fifth, window.ending
    before = window.part(3, 4)
    moved = 0 if scenario is None else moved_until(trace, scenario)
    resting = slice(max(before.start, moved), before.stop)
    tip, every = held_tip(trace), 1 if scenario is None else scenario.run.record_every
    interval = None if scenario is None else scenario.period * every
    bend = second_differences(trace.time, tip, interval)

    def largest(begin: int, end: int) -> float:
        return float(bend[begin + 1 : end + 1].max(initial=0.0))

    late = largest(last - fifth, last)
    deflection = trace["deflection"] if "deflection" in trace else tip - tip[0]
    touching = trace["touching"][:, 0] > 0.0
    body = scenario is not None and _has_body(scenario)
    lost = pushed_through(trace) is not None or (
        body and any(_left_inside(one, window) for one in each_recorded(trace))
    )
    swings = [swing(trace.time[rows], tip[rows]) for rows in (window.part(k, k + 1) for k in range(1, 5))]
    deep = float(np.linalg.norm(deflection[ending].mean(axis=0)))
    rounded = swings[-1] <= ROUNDING * deep and body
    known: dict[str, Any] = {} if scenario is None else _known(trace, scenario, window, deflection, touching)
    if not np.isnan(kept):
        known["creep"] = 0.0  # a push is judged by the response to it
    return Evidence.of(
        1,
        unstable_from=np.nan,
        early=largest(first + fifth, first + 2 * fifth),
        prior=largest(last - 2 * fifth, last - fifth),
        late=0.0 if rounded else late,
        ripple=float(np.ptp(tip[ending], axis=0).max(initial=0.0)) / 2.0,
        ripple_before=float(np.ptp(tip[resting], axis=0).max()) / 2.0 if resting.start < resting.stop else np.nan,
        swing=swings[-1],
        swing_before=swings[-2],
        widening=_widening(swings),
        turns=_turns(fifth, late, swing(trace.time[window.part(2, 5)], tip[window.part(2, 5)])),
        **_shifts(tip[: last + 1], window, late, swings[-1]),
        deflection=deep,
        touching=0.0 if lost else float(touching[ending].mean()),  # lost in a body, the tip may still touch others
        contacts=float(np.count_nonzero(touching[ending] & ~touching[last - fifth : last])),
        saturated=float(trace["saturated"][ending].mean()),
        constant=window.constant and moved <= ending.start,
        linear=0 if radius is None else linear_sign(radius),
        decay=np.nan if radius is None else min(radius, FASTEST ** (1.0 / (fifth * every or 1))) ** (fifth * every),
        kept=kept,
        **(known | {"pressed": lost or known.get("pressed", False)}),
    )


def _left_inside(trace: Recorded, window: Window) -> bool:
    """Return whether a tip touches a body no longer and ends in it."""
    touching = trace["touching"][window.part(3, 5), 0] > 0.0
    return not touching.any() and depth_without_contact(trace) > 0.0


def _has_body(scenario: Scenario) -> bool:
    return any(one.object.body is not None for one in scenario.each_object.values())


def _known(trace: Recorded, scenario: Scenario, window: Window, deflection: Array, touching: Flags) -> dict[str, Any]:
    """Return the evidence that the scenario of a run adds to its samples."""
    device, last, ending = scenario.load_device(), window.end, window.ending
    balance = energy_balance(trace, scenario, window)
    generated, generated_before = (np.nan, np.nan) if balance is None else balance.relative
    one_sided = is_one_sided(scenario)
    expected = _expected(trace, scenario, window)
    counts = float(resolution(scenario, device, trace["angle"][last : last + 1])[0])
    others = float(trace.metadata.get("object", {}).get("resolution_m", 0.0))  # of devices on the same body
    counts = max(counts, others)
    error = np.nan if expected is None else float(steady_error(deflection[ending].mean(axis=0), expected)[0])
    if "tool" in trace:
        error = _tool_error(trace, ending, deflection, counts)
    return {
        "resolution": counts,
        "beyond": leaves_reach(trace, scenario, window),
        "pressed": one_sided and _pressed(trace, scenario, touching, last),
        "apart": _apart(trace, touching) if one_sided and _interrupted(touching[window.ending]) else 0.0,
        "local": any(one.object.kind in ("mesh", "body") for one in scenario.each_object.values()),
        **_friction(trace, scenario, ending),
        "lossy": lossy(scenario, device) or others > 0.0,
        "generated": generated,
        "generated_before": generated_before,
        "error": error,
        "creep": _creep(trace, scenario, window, deflection, touching),
        "drift": _drift(trace, ending) if scenario.reference is not None or "tool" in trace else np.nan,
    }


def _friction(trace: Recorded, scenario: Scenario, ending: slice) -> dict[str, float]:
    """Return the evidence about the friction of a run's contact."""
    hold = friction_hold(trace, scenario, ending)
    continued = trace.metadata.get("continued", {})
    onward = float(continued.get("onward_m", continued.get("moved_m", np.nan)))
    return {"onward": onward} if hold is None else {**asdict(hold), "onward": onward}


def moved_until(trace: Recorded, scenario: Scenario) -> int:
    """Return the row in which objects and tools that move by themselves come to rest; 0 if none moves."""
    rows = [np.flatnonzero(np.diff(motion, axis=0).any(axis=1)) for motion in own_motions(trace, scenario)]
    return max((int(moved[-1]) + 1 for moved in rows if len(moved)), default=0)


def _creep(trace: Recorded, scenario: Scenario, window: Window, deflection: Array, touching: Flags) -> float:
    """Return how far the tip can follow the creep of a body after the run, m; 0 without creep.

    The body is a standard linear solid with instantaneous ratio r and retardation time tau. After a time t in contact
    under a constant force, its stiffness K still falls to q K, with q = 1 - (1 - 1/r) exp(-t/tau). The deflection under
    an arm of stiffness k grows by the factor (k + K)/(k + q K). Under a tracked force k is zero.
    """
    solids = [one.object.body.options for one in scenario.each_object.values() if one.object.body is not None]
    ending, held = window.ending, np.flatnonzero(~touching[: window.end + 1])
    begin = max(window.begin, int(held[-1]) + 1 if len(held) else 0)
    if begin > window.end:
        return 0.0
    since = float(trace.time[window.end] - trace.time[begin])
    deep = float(np.linalg.norm(deflection[ending].mean(axis=0)))
    force = float(np.linalg.norm(trace["object_force"][ending].mean(axis=0)))
    arm = _arm_stiffness(scenario)
    left = [0.0]
    for options in solids:
        ratio, tau = float(options.get("instantaneous_ratio", 1.0)), float(options.get("retardation_time", np.inf))
        remains = 1.0 - (1.0 - 1.0 / ratio) * float(np.exp(-since / tau))
        if remains < 1.0 and force > 0.0:
            left.append(deep * ((arm * deep + force) / (arm * deep + remains * force) - 1.0))
    return max(left)


def _arm_stiffness(scenario: Scenario) -> float:
    """Return the stiffness of the arm against a slow motion of a display's tip, N/m; 0 where the force is imposed."""
    return arm_spring(scenario) if scenario.servo.topology == "impedance_display" else 0.0


def _tool_error(trace: Recorded, ending: slice, deflection: Array, counts: float) -> float:
    """Return the distance of the tip from the tool of an admittance display at the end, over the deflection.

    A tip that sticks off its tool is pulled on until it slips. Within the counts of the encoder it does not rest apart.
    The tip is that of the encoders: behind a flexible mode the load bends the device off the tool.
    """
    off = float(np.linalg.norm(trace["tool"][ending][-1] - trace["tip"][ending][-1]))
    return max(off - max(counts, FLOOR), 0.0) / max(float(np.linalg.norm(deflection[ending].mean(axis=0))), FLOOR)


def is_one_sided(scenario: Scenario) -> bool:
    """Return whether the tip can leave every object of the scenario."""
    return all(one.object.kind in ONE_SIDED for one in scenario.each_object.values())


def interruption(trace: Recorded, scenario: Scenario | None) -> float:
    """Return for how long a run that ends in contact was off its object after the bounces of an impact, s."""
    touching = trace["touching"][:, 0] > 0.0
    if scenario is None or not is_one_sided(scenario) or len(touching) < 2 or not touching[-1]:
        return 0.0
    return float(np.median(np.diff(trace.time)) * np.count_nonzero(~touching[_established(touching) :]))


def _drift(trace: Recorded, ending: slice) -> float:
    """Return the change of the mean command between the halves of the last fifth, over the largest force on the tip."""
    command = trace["command_force"][ending]
    if len(command) < 2:
        return 0.0
    half = len(command) // 2
    change = np.linalg.norm(command[half:].mean(axis=0) - command[:half].mean(axis=0))
    forces = [trace[name] for name in ("object_force", "reference_force", "operator_force") if name in trace]
    largest = max(float(np.linalg.norm(force, axis=1).max()) for force in forces)
    return float(change / max(largest, 1e-12))


def second_differences(time: Array, tip: Array, interval: float | None) -> Array:
    """Return the size of the second differences of tip positions (n, 3), m: (n,); 0 for the first two.

    Each is the change of the mean speed between times (n,), s, that may come late, times the nominal interval, s; None
    is their median.
    """
    bend = np.zeros(len(tip))
    if len(tip) > 2:
        rate = np.diff(time)
        velocity = np.diff(tip, axis=0) / (rate / (interval or np.median(rate)))[:, None]
        bend[2:] = np.linalg.norm(np.diff(velocity, axis=0), axis=1)
    return bend


def swing(time: Array, tip: Array) -> float:
    """Return half the range of the tip (n, 3) without its quadratic trend in time (n,), m, largest of the axes."""
    if len(time) < 8:
        return float(np.ptp(tip, axis=0).max(initial=0.0)) / 2.0 if len(time) else 0.0
    return float(np.ptp(without_trend(tip), axis=0).max()) / 2.0


def _shifts(tip: Array, window: Window, late: float, amplitude: float) -> dict[str, float]:
    """Return `shift`, `shift_ratio` and `shift_fifths` of a tip (n, 3), m; {} if the window is short.

    Args:
        tip: up to the last sample of the window.
        window: judged.
        late: largest second difference in the last fifth, m.
        amplitude: of the oscillation there, m.
    """
    fifth, n = window.fifth, len(tip)
    if fifth < 8 or n - 4 * fifth < window.begin:
        return {}

    def moved(size: int, back: int = 0) -> float:
        end = n - back * size
        return float(np.linalg.norm(_mean(tip[end - size : end]) - _mean(tip[end - 2 * size : end - size])))

    turns = _turns(fifth, late, amplitude)
    span = 1 if turns >= CLEAR else 2
    leak = 2.0 * _passed(span * turns) * amplitude
    return {
        "shift": max(moved(span * fifth) - leak, 0.0),
        "shift_ratio": moved(fifth) / max(moved(fifth, 1), 1e-300),
        "shift_fifths": span,
    }


def _turns(rows: int, late: float, amplitude: float) -> float:
    """Return the periods in so many rows of an oscillation, m, whose largest second difference is `late`, m."""
    return rows * float(np.sqrt(late / amplitude)) / (2.0 * np.pi) if amplitude > 0.0 else np.inf


def _widening(swings: list[float]) -> float:
    """Return the mean factor from each of the swings to the next; 0 unless each is larger than the one before."""
    if not all(later > GROWING * earlier for earlier, later in pairwise(swings)):
        return 0.0
    return float((swings[-1] / max(swings[0], STILL)) ** (1.0 / (len(swings) - 1)))


def _mean(tip: Array) -> Array:
    """Return the mean (3,) of tip positions (n, 3) with the weights of a Hann window, m."""
    weights = np.hanning(len(tip) + 2)[1:-1]
    return np.asarray(weights @ tip / weights.sum())


def _passed(turns: float) -> float:
    """Return the share of an oscillation with at least so many periods that its weighted mean passes."""
    if turns >= CLEAR:
        return SIDE_LOBE
    return max(0.5 if turns == 1.0 else abs(float(np.sinc(turns)) / (1.0 - turns**2)), SIDE_LOBE)


def leaves_reach(trace: Recorded, scenario: Scenario, window: Window) -> bool:
    """Return whether a pose in the window, or the rest of a tip on a spring, is beyond the reach of the device."""
    q, expected = trace["angle"], _expected(trace, scenario, window)
    beyond = beyond_reach(scenario.load_device(), q[0], q[window.begin : window.end + 1])
    return bool(beyond.any()) or (expected is not None and _rest_beyond(trace, scenario, expected))


def _rest_beyond(trace: Recorded, scenario: Scenario, expected: Array) -> bool:
    """Return whether the device cannot reach the rest of a tip on a spring: force over stiffness from its anchor."""
    if scenario.device.kinematics == "linear" or np.isnan(expected).all():
        return False
    device, anchor = scenario.load_device(), np.array(scenario.object.position)
    return bool(unreachable(device, trace["angle"][0], np.nan_to_num(expected) + anchor)[0])


def _expected(trace: Recorded, scenario: Scenario, window: Window) -> Array | None:
    """Return force over stiffness on a spring under a constant reference (3,), m; None if unknown."""
    if scenario.contact_kind != "spring" or scenario.reference is None or not window.constant:
        return None
    dof = scenario.load_device().dof
    expected = force_over_stiffness(trace["reference_force"][window.end], scenario.object.stiffness or 0.0, dof)
    return np.asarray(expected[0], dtype=float)


def _apart(trace: Recorded, touching: Flags) -> float:
    """Return the fraction of the run since the contact is established in which a pressed tip is off its object.

    The normal is that of the last contact before.
    """
    if not touching.any():
        return 0.0
    rows = np.arange(len(touching))
    last = np.maximum.accumulate(np.where(touching, rows, -1))
    load = trace["reference_force"] + trace["operator_force"]
    force = np.linalg.norm(load, axis=1)
    pressed = presses(load, -trace["object_force"][np.maximum(last, 0)]) & (force > BAND * force.max())
    since = rows >= _established(touching)
    return float(np.count_nonzero(since & ~touching & pressed) / np.count_nonzero(since))


def _interrupted(touching: Flags) -> bool:
    """Return whether a contact comes and goes: if not, the bounces of an impact have ended, on the object or off it."""
    return bool(touching.any() and not touching.all())


def _established(touching: Flags) -> int:
    """Return the first row of the contact in which the bounces of an impact have ended.

    It lasts at least as long as the flight after it, and half as long as the bounces before it. Without one, and for a
    tip that starts on its object, it is the first contact.
    """
    edges = np.diff(touching.astype(np.int8), prepend=0, append=0)
    begins, ends = np.flatnonzero(edges > 0), np.flatnonzero(edges < 0)
    if begins[0] == 0:
        return 0
    flights = np.append(begins[1:], len(touching)) - ends
    lasts = ends - begins >= np.maximum(flights, (begins - begins[0]) / 2.0)
    return int(begins[np.argmax(lasts)] if lasts.any() else begins[0])


def pushed_through(trace: Recorded) -> float | None:
    """Return the time from which on a tip is in a body without contact until the end; None if it is not."""
    begins = []
    for lost in of_each_object(trace, "contact_lost"):
        if lost[-1, 0] > 0.0:
            there = np.flatnonzero(lost[:, 0] <= 0.0)
            begins.append(float(trace.time[there[-1] + 1 if len(there) else 0]))
    return min(begins, default=None)


def _pressed(trace: Recorded, scenario: Scenario, touching: Flags, last: int) -> bool:
    """Return whether a force at the end presses the tip against the object, as far as the run shows its normal.

    It is the load. On an object whose surface may end it is also the reference alone: the arm pulls a tip back that the
    reference has pressed off it. The normal is that of the mean force in the last stretch of contact.
    """
    reference = trace["reference_force"]
    loads = reference + trace["operator_force"]

    def acts(force: Array) -> bool:  # the rounding of an arm at rest has a direction, too
        sizes = np.linalg.norm(force[: last + 1], axis=1)
        return bool(sizes[last] > BAND * sizes.max())

    if scenario.contact_kind in ("wall", "force_law") and scenario.object.normal is not None:
        return acts(loads) and bool(presses(loads[last], scenario.object.normal)[0])
    contact = np.flatnonzero(touching[: last + 1])
    if len(contact) == 0:
        return acts(loads)
    stretch = slice(int(np.max(np.flatnonzero(~touching[: contact[-1]]), initial=-1)) + 1, int(contact[-1]) + 1)
    outward = -trace["object_force"][stretch].mean(axis=0)
    return any(acts(force) and bool(presses(force[last], outward)[0]) for force in (loads, reference))
