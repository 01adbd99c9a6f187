"""Decision of a servo loop's state from evidence: one function for a run and for the cells of a sweep."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.simulation.verdict import State

__all__ = ["Evidence", "ahead", "band_of", "chatters", "decide", "generates", "growth", "slips"]

STILL = 1e-14  # m, second differences of tip positions at rounding level
GROWING = 1.02  # growth factor of an oscillation per fifth of the window above which it grows
SUSTAINED = 0.9  # the same below which it decays; the maxima of endless impacts scatter by a tenth
LINGERS = 0.7  # growth factor without a linear loop above which an oscillation beyond `SWING` does not count as rest
STEADILY = (0.25, 2.0)  # shares of the mean rate of decay between which an oscillation decays steadily
COUNTED = 5.0  # of two encoder counts: oscillation above which counts do not bound its decay
IMPACT_GROWTH = 1.5  # growth factor that irregular impacts may have without growing
WIDENING = 1.2  # growth factor of the swing per fifth above which impacts grow whose swing grows in each fifth
PERIOD = 1.0  # periods per fifth below which the maxima in two fifths may differ by their phase
SMALL = 1e-9  # m, likewise
BAND = 0.05  # of the deflection: a settled loop stays within it, and this near to force over stiffness
VISIBLE = 1e-4  # of the deflection: a smaller oscillation grows only if it did so from the second fifth on
SWING = 0.01  # of the deflection: a sustained oscillation below it counts as rest
BEFORE = 1.5  # of the band: a tip that moved more in the fourth fifth may be at a turning point
CREEP = 0.0125  # of the deflection: a motion above it that becomes faster is not rest
FLOOR = 1e-6  # m: the smallest oscillation and band that matter
LASTING = 0.95  # largest factor per fifth by which a trend is taken to decay where no linear loop is known
FAST = 0.1  # factor per fifth of the linear loop's slowest motion below which it does not explain a lasting trend
TREND = 1.5  # ripple over swing above which a motion has a trend; an oscillation of a period per fifth has less
WANDERS = 0.2  # of two encoder counts: shift of that mean which chatter explains where no linear loop is known
SHAKEN = 0.15  # of its mean: fluctuation of a contact's force by encoder counts above which friction lets it slip
HELD = 0.4  # of the friction force: force along a surface above which a tip that nothing else holds may slip
STAYS = 0.4  # of the band: way of the tip in a continued run above which encoder counts may move it on
CHATTER = 0.5  # of two encoder counts: oscillation above which it may be a growing one where no linear loop is known
TRAVEL = 3.0  # range of the motion over its oscillation above which the tip travels
MOST_CONTACTS = 3  # contacts begun in the last fifth of the window above which the tip bounces
RETURNS = 2  # the same from which on bounces that grow or last are no loss of contact
PERSISTS, MOST = 0.3, 0.9  # share of the response to a push that counts as persistent; the same near the limit
SLOWER = 3.0  # factor on what the linear loop's slowest motion keeps, above which a response persists
APART = 0.05  # share of the time since contact is established off the object, though pressed: contact is lost above
SHARE = 0.01  # fraction of the last fifth at the drive's limits above which the drive limits the loop
GENERATED = 0.01  # of the energy that the operator supplies: a display that generates more in a fifth does not rest


@dataclass(frozen=True)
class Evidence:
    """Evidence of loops in their judged window, in which the external force is constant; arrays (n,), a row per loop.

    An oscillation is the largest second difference of the tip position in a fifth of the window.

    Attributes:
        unstable_from: time of divergence, s; nan: it did not diverge.
        early, prior, late: oscillation in the second, fourth and last fifth, m.
        ripple: half the range of the tip in the last fifth, along the axis with the largest range, m.
        ripple_before: the same in the fourth fifth; nan if unknown.
        swing: amplitude of the oscillation in the last fifth: the same without the trend of the motion, m.
        swing_before: the same in the fourth fifth, m; nan if unknown.
        widening: growth factor of the swing per fifth from the second to the last; 0 unless it grows in each, nan if
            unknown.
        turns: periods of the oscillation per fifth; nan if unknown.
        trend: half the range of the trend in the last fifth, m: ripple without swing.
        trend_before: the same in the fourth fifth, m; nan if unknown.
        shift: distance of the tip's weighted means in the last two stretches of `shift_fifths`, less the oscillation's
            part in it, m; nan if unknown. The weights are those of a Hann window, which averages oscillations out.
        shift_ratio: ratio of that distance of the last two fifths to the one before; nan if unknown.
        shift_fifths: 1, or 2 if the oscillation has less than two periods per fifth.
        deflection: magnitude of the object's mean deflection in the last fifth, m.
        error: relative difference of that deflection from force over stiffness; nan if that is unknown. Of an
            admittance display: the distance of tip and tool over the deflection.
        drift: relative change of the commanded force over the last fifth; nan if unknown.
        creep: way that a creeping body has left at most, m; 0 without one.
        touching: fraction of the last fifth in contact.
        contacts: number of contacts that begin in the last fifth.
        apart: share of the time since contact is established in which the tip is off the object though pressed on.
        saturated: fraction of the last fifth at the drive's limits.
        pressed: whether the external force presses the tip against a one-sided object.
        beyond: whether a joint is beyond its limits, has turned round, the pose is singular, or force over stiffness is
            beyond reach.
        constant: whether there is a window, i.e. the external force is constant at the end.
        resolution: tip displacement of two encoder counts, m; 0 without encoders.
        linear: +1 if the linear loop is stable, -1 if it is unstable, 0 if that is not known.
        decay: factor of the linear loop's slowest motion per fifth of the window; nan if unknown.
        kept: response to a push in the last fifth of the window, relative to that in the first; nan without a push.
        local: whether the linear loop holds near the tip's place alone: on a mesh or body.
        fluctuation, traction, release: of a contact with dry friction, as in `FrictionHold`; nan without one.
        onward: way of the tip in a continued run, as in `continuation`, m; nan if the run was not continued.
        lossy: whether dry friction, encoder counts or drive limits may hide what the linear loop does.
        generated: energy that an impedance display generates in the last fifth, relative to that which the operator
            supplies (`EnergyBalance`); nan if unknown.
        generated_before: the same in the fourth fifth; nan if unknown.
    """

    unstable_from: Array
    early: Array
    prior: Array
    late: Array
    ripple: Array
    ripple_before: Array
    swing: Array
    swing_before: Array
    widening: Array
    turns: Array
    trend: Array
    trend_before: Array
    shift: Array
    shift_ratio: Array
    shift_fifths: NDArray[np.int_]
    deflection: Array
    error: Array
    drift: Array
    creep: Array
    touching: Array
    contacts: Array
    apart: Array
    saturated: Array
    pressed: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    constant: NDArray[np.bool_]
    resolution: Array
    linear: NDArray[np.int_]
    decay: Array
    kept: Array
    local: NDArray[np.bool_]
    fluctuation: Array
    traction: Array
    release: Array
    onward: Array
    lossy: NDArray[np.bool_]
    generated: Array
    generated_before: Array

    @classmethod
    def of(cls, count: int, **values: Any) -> Evidence:
        """Return the evidence of `count` loops; what is not given is unknown, absent or zero."""
        names = ("ripple_before", "swing_before", "widening", "turns", "shift", "shift_ratio", "error", "drift")
        friction = ("fluctuation", "traction", "release", "onward")
        others = ("decay", "kept", "generated", "generated_before")
        unknown = dict.fromkeys((*names, *friction, *others), np.nan)
        none = dict.fromkeys(("contacts", "apart", "saturated", "resolution", "linear", "creep"), 0)
        swing = values.get("swing", values["ripple"])
        before = values.get("ripple_before", np.nan) - values.get("swing_before", np.nan)
        defaults: Mapping[str, Any] = {
            **unknown,
            **none,
            "shift_fifths": 1,
            "swing": swing,
            "trend": values["ripple"] - swing,
            "trend_before": before,
            "touching": 1.0,
            "pressed": False,
            "beyond": False,
            "constant": True,
            "local": False,
            "lossy": False,
        }
        return cls(**{name: np.broadcast_to(value, (count,)) for name, value in {**defaults, **values}.items()})


def growth(unstable_from: Array, early: Array, prior: Array, late: Array) -> Array:
    """Return the growth factor of an oscillation per fifth of the window: inf where the loop diverged, 0 at rest.

    It is the larger of the ratio of the last to the fourth fifth and the mean ratio from the second to the last. An
    oscillation that grew and is now bounded counts as growing, and a hard first impact does not hide later growth.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.where(late <= STILL, 0.0, np.maximum(late / prior, np.cbrt(late / early)))
    return np.asarray(np.where(np.isnan(unstable_from), ratio, np.inf), dtype=float)


def generates(e: Evidence) -> NDArray[np.bool_]:
    """Return whether displays keep generating energy (n,), in motions above the resolution of the encoders.

    Such a loop is not at rest. Motions within two encoder counts may generate energy in any loop.
    """
    steady = (e.generated > GENERATED) & (e.generated >= SUSTAINED * e.generated_before)
    return np.asarray(steady & (e.swing > np.maximum(e.resolution, FLOOR)), dtype=bool)


def ahead(e: Evidence) -> Array:
    """Return how far tips (n,) have yet to go if their trend, or the shift of their mean, goes on, m.

    The trend is that of the largest axis; the shift shows below an oscillation as well.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        slowing = e.trend / e.trend_before
    trends = (e.trend > SMALL) & (e.trend > (TREND - 1.0) * e.swing)
    shifts = (e.shift > SMALL) & (_explained(e, e.shift_ratio) | (e.shift > WANDERS * e.resolution))
    left = np.where(trends, _remaining(e, 2.0 * e.trend, slowing), 0.0)
    return np.fmax(left, np.where(shifts, _remaining(e, e.shift, e.shift_ratio, e.shift_fifths), 0.0))


def _explained(e: Evidence, ratio: Array) -> NDArray[np.bool_]:
    """Return whether the linear loop's slowest motion explains motions (n,) with a `ratio` per fifth.

    It does not if it is far too fast, as for a tip that slides on, or if the tip speeds up on a mesh or body. Nor does
    it if encoder counts shake a contact with friction.
    """
    with np.errstate(invalid="ignore"):
        slow = (e.local & (ratio >= 1.0)) | ((e.decay < FAST) & (ratio > np.sqrt(np.sqrt(e.decay))))
    shaken = ~np.isnan(e.release) & (e.resolution > 0.0) & _outlasts(e)
    return np.asarray((e.linear > 0) & ~slow & ~shaken, dtype=bool)


def _outlasts(e: Evidence) -> NDArray[np.bool_]:
    """Return whether oscillations (n,) outlast the slowest motion of the linear loop; true without a stable one."""
    return np.asarray((e.linear <= 0) | (e.late > np.sqrt(e.decay) * e.prior), dtype=bool)


def _remaining(e: Evidence, motion: Array, ratio: Array, fifths: NDArray[np.int_] | int = 1) -> Array:
    """Return the sum of motions (n,), m, of all later stretches of so many fifths.

    They decay as the linear loop's slowest motion if that explains them. Otherwise they decay by the measured `ratio`,
    and by `LASTING` per fifth at least.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(_explained(e, ratio), e.decay, np.fmin(ratio, LASTING)) ** fifths
        return np.asarray(motion * factor / (1.0 - factor), dtype=float)


def chatters(e: Evidence) -> NDArray[np.bool_]:
    """Return whether tips (n,) oscillate by more than one encoder count, within the two that count as rest.

    Such an oscillation may grow in a loop that no linear loop shows to be stable.
    """
    return np.asarray(
        (e.resolution > 0.0) & (e.swing > np.maximum(SWING * e.deflection, CHATTER * e.resolution)), dtype=bool
    )


def slips(e: Evidence) -> NDArray[np.bool_]:
    """Return whether tips (n,) move on behind a guard, or by encoder counts along a surface with dry friction.

    An oscillation within the counts lets the contact slip a little in some of its periods, in bursts between which the
    tip may rest for long. A continued run shows them. Where there is none, a contact is taken to slip whose force
    fluctuates much, up to the rest without friction, and where friction alone holds the tip along the surface. A stable
    linear loop is no evidence against it where the oscillation outlasts that loop's slowest motion. The response to a
    push is judged by itself.
    """
    shaken = _outlasts(e) & (e.fluctuation > SHAKEN) & (e.release > band_of(e))
    unheld = (e.linear <= 0) & np.isinf(e.release) & (e.traction > HELD)
    moves = np.where(np.isnan(e.onward), shaken | unheld, e.onward > STAYS * band_of(e))
    known = (e.resolution > 0.0) | ~np.isnan(e.onward)
    return np.asarray(known & np.isnan(e.kept) & moves, dtype=bool)


def band_of(e: Evidence) -> Array:
    """Return the distance within which tips (n,) rest, m."""
    return np.asarray(np.maximum(BAND * e.deflection, np.maximum(e.resolution, FLOOR)), dtype=float)


def _visible(e: Evidence) -> Array:
    """Return the swing above which an oscillation (n,) does not count as rest, m."""
    rest = np.where(e.linear < 0, 0.0, SWING * e.deflection)  # an unstable linear loop explains any oscillation
    return np.asarray(np.maximum(rest, np.maximum(e.resolution, FLOOR)), dtype=float)


def _travels(e: Evidence) -> NDArray[np.bool_]:
    """Return whether tips (n,) slide on: they are not judged by their bumps."""
    return np.asarray(e.ripple > TRAVEL * e.swing, dtype=bool)


def _grows(e: Evidence, ratio: Array, mean: Array) -> NDArray[np.bool_]:
    """Return whether oscillations (n,) grow, by the last two fifths and by the mean from the second on."""
    wider = (mean > GROWING) | ((e.linear <= 0) & ~(e.swing <= GROWING * e.swing_before))  # not a transient's tail
    visible = e.swing > np.maximum(np.maximum(e.resolution, SMALL), VISIBLE * e.deflection)
    real = visible | ((e.resolution == 0.0) & (mean > GROWING) & (e.prior > STILL))
    grows = ~(e.turns < PERIOD) & (ratio > np.where(e.contacts >= 1, IMPACT_GROWTH, GROWING)) & wider & real
    impacts = (e.contacts >= 1) & (e.widening > WIDENING) & visible
    return np.asarray(~_travels(e) & (grows | impacts), dtype=bool)


def _lost(e: Evidence) -> NDArray[np.bool_]:
    """Return whether tips (n,) have lost contact, unless their bounces grow or last; one that bounces often has not."""
    off = e.pressed & ((e.touching == 0.0) | ((e.touching < 0.5) & (e.contacts <= MOST_CONTACTS)))
    return np.asarray(off | ((e.apart > APART) & (e.contacts <= MOST_CONTACTS)), dtype=bool)


def _sustained(e: Evidence, ratio: Array, mean: Array) -> NDArray[np.bool_]:
    """Return whether visible oscillations (n,) last from the fourth fifth to the last."""
    impact = (e.contacts >= 1) & (mean < SUSTAINED)  # its bounces decay, if not from each fifth to the next
    lasts = (ratio >= SUSTAINED) & (e.swing > _visible(e)) & ~(e.turns < PERIOD)
    return np.asarray(~_travels(e) & lasts & ~impact, dtype=bool)


def _falls(e: Evidence, ratio: Array, mean: Array) -> NDArray[np.bool_]:
    """Return whether oscillations (n,) decay steadily, without contacts, in loops that are not known as unstable."""
    with np.errstate(divide="ignore", invalid="ignore"):
        decay = np.log(ratio) / np.log(mean)  # of the last fifth over the mean
    steadily = (mean < 1.0 / GROWING) & (decay > STEADILY[0]) & (decay < STEADILY[1])
    return np.asarray(steadily & (e.linear >= 0) & (e.contacts == 0) & (e.swing > COUNTED * e.resolution), dtype=bool)


def _rests(e: Evidence, ratio: Array, decays: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return whether tips (n,) rest, or come to rest as oscillations decay in a stable linear loop."""
    stable, band = e.linear > 0, band_of(e)
    creep = np.maximum(CREEP * e.deflection, np.maximum(e.resolution, FLOOR))
    creeps = (e.ripple > creep) & (e.ripple > GROWING * e.ripple_before)
    # where contact slips, encoder counts move the tip on more slowly than the linear loop decays
    ratchets = e.local & (e.resolution > 0.0) & (ratio > np.sqrt(e.decay))
    # and a swing of a few counts near the limit of the loop may be kept up by them
    ratchets |= e.local & (e.swing < COUNTED * e.resolution) & (ratio > LINGERS)
    # on a mesh or body, or without a linear loop, a visible oscillation that decays slowly may not end in rest
    enough = np.where(stable, np.sqrt(np.sqrt(np.fmin(e.decay, 1.0))), LINGERS)
    lingers = (e.local | ~stable) & (e.swing > _visible(e)) & (ratio > enough)
    rests = (((e.ripple <= band) & ~creeps) | (decays & ~ratchets)) & ~lingers & ~slips(e)
    rests &= ~(np.abs(e.error) > BAND) & ~(e.drift > BAND) & ~(ahead(e) > band) & ~(e.creep > band)
    turning = e.ripple_before > BEFORE * band  # a turning point of a slow motion looks like rest
    return np.asarray(rests & (stable | ~(turning | generates(e) | chatters(e))), dtype=bool)


def decide(e: Evidence) -> NDArray[np.int8]:
    """Return the State of each loop (n,). Every command that judges a loop uses this function.

    The worst finding decides: divergence or growth, contact, drive, reach, then the oscillation that remains.

    A run whose linear loop is unstable is never "settled". It is "undecided" if friction, encoder counts or drive
    limits may hide the instability. Otherwise it is "unstable", unless friction, counts or impacts bound its
    oscillation. An oscillation that decays in a stable linear loop is "settled" before it has come to rest. Without a
    stable linear loop the tip must rest in the fourth fifth of the window as well.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.where(e.late <= STILL, 0.0, e.late / e.prior)
        mean = np.where(e.late <= STILL, 0.0, np.cbrt(e.late / e.early))
    stable, lost, returns = e.linear > 0, _lost(e), e.contacts >= RETURNS
    limited = stable & (e.saturated > SHARE)  # the motion to a new rest when the drive gets warm
    unstable = ~np.isnan(e.unstable_from) | (_grows(e, ratio, mean) & (~lost | returns) & ~limited & e.constant)
    decays = stable & (ratio < np.fmax(1.0 / GROWING, np.sqrt(e.decay)))
    sustained, falls = _sustained(e, ratio, mean) & ~decays, _falls(e, ratio, mean)
    lost &= ~(returns & sustained & (mean > 1.0 / GROWING))
    lasting = np.where(np.isnan(e.decay), 0.0, np.minimum(e.decay, 1.0)) ** 4
    persists = e.kept > np.clip(SLOWER * lasting, PERSISTS, MOST)
    bounces = e.pressed & (e.contacts > MOST_CONTACTS)
    swings = bounces | (persists & ~(falls & (e.linear == 0))) | (sustained & ~falls)
    rests = _rests(e, ratio, decays) & ~sustained & ~persists
    state = np.select(
        [
            unstable,
            lost,
            e.saturated > SHARE,
            e.beyond,
            ~e.constant,
            swings,
            rests,
        ],
        [
            State.UNSTABLE,
            State.CONTACT_LOST,
            State.DRIVE_LIMIT,
            State.OUT_OF_REACH,
            State.UNDECIDED,
            State.BOUNDED_OSCILLATION,
            State.SETTLED,
        ],
        State.UNDECIDED,
    )
    quiet = np.isin(state, (State.SETTLED, State.UNDECIDED)) & ~generates(e)
    bounded = (state == State.BOUNDED_OSCILLATION) & (e.lossy | (e.contacts >= 1))
    hidden = np.where(e.lossy & quiet, State.UNDECIDED, np.where(bounded, state, State.UNSTABLE))
    return np.asarray(np.where((e.linear < 0) & (state != State.DRIVE_LIMIT), hidden, state), dtype=np.int8)
