"""Small-signal response of a body under the tip: impulse response of the core's own model at the contact found."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import control
import numpy as np

from palpate import _core
from palpate.arrays import Array
from palpate.errors import StabilityError
from palpate.simulation.body_response.held_tip import HeldTip
from palpate.simulation.body_response.realization import realize
from palpate.simulation.body_response.relaxation import relaxation_record

__all__ = ["BodyResponse", "body_response"]

_STEPS = (2e-3, 5e-4, 1e-4, 1e-5, 1e-6)  # displacement of the tip, relative to its radius
_FIRST, _LONGEST = 256, 4096  # ticks of the impulse response
_DECAYED = 1e-5  # share of the last quarter in the whole response that ends the record
_NOISE = 0.15  # share of the last quarter below which a level that stays is noise
_CONSTANT = 0.98  # level of the last quarter, relative to the one before, that stays
_WINDOW = 16  # ticks over which the level of the noise is compared
_ROUNDING = 5e-6  # change of the force left by the contact's iterations after a displacement, relative
_KNOWN, _UNKNOWN = 0.02, 0.1  # difference from a lasting displacement's force: measured again above; refused above
_LASTING_STEPS = (2e-3, 5e-4, 1e-2)  # displacements of the tip that last, relative to its radius
_LASTING = 4 * _LONGEST  # ticks for which a displacement is held that tests the static response


@dataclass(frozen=True)
class BodyResponse:
    """Force on a body per displacement of the tip, about one state of rest, contact nodes and slip unchanged.

    Matrices are in the axes of the contact: the first is the normal. Here r is 3, or 3 for each of several tips
    (`HeldTips`), whose axes follow each other.

    Attributes:
        frame: axes of the contact in columns (r, r), device frame.
        system: sampled, displacement of the tip (r,), m, to the force on the body (r,), N.
        markov: impulse response as measured (n, r, r), N/m.
        error: bound of the gain of what `system` leaves out, by entry (r, r), N/m: realization, tail and asymmetry of
            the record, and difference of the static response from that to a lasting displacement.
        asymmetry: difference of the answers to opposite displacements, relative.
        nodes: number of nodes in contact.
    """

    frame: Array
    system: control.StateSpace
    markov: Array
    error: Array
    asymmetry: float
    nodes: int

    @property
    def one_tick(self) -> Array:
        """Change of the force within the tick of a displacement (r, r), N/m; includes the body's inertia."""
        return np.asarray(self.system.D, dtype=float)

    @property
    def static(self) -> Array:
        """Change of the force under a lasting displacement (r, r), N/m."""
        s = self.system
        return np.asarray(s.D + s.C @ np.linalg.solve(np.eye(s.nstates) - s.A, s.B), dtype=float)

    def of_tip(self, tip: int, nodes: int) -> BodyResponse:
        """Return the response to one of several tips with the others held, `nodes` of the contact its own."""
        at, s = slice(3 * tip, 3 * tip + 3), self.system
        system = control.StateSpace(s.A, s.B[:, at], s.C[at], s.D[at, at], s.dt)
        return BodyResponse(
            self.frame[at, at], system, self.markov[:, at, at], self.error[at, at], self.asymmetry, nodes
        )


def body_response(held: HeldTip) -> BodyResponse:
    """Return the response of a body about the state in which a tip is held.

    The tip is displaced for one tick by a small step along each axis, forth and back, in the core's own model. Nothing
    is assumed about the kind of body: inertia, creep, friction that sticks, and the partly covered patches at the edge
    of a flat end are all in the record.

    Args:
        held: the body and its tip, or tips; not a body that is updated outside the tick.

    Raises:
        StabilityError: the response does not decay while the tip is held.
    """
    if held.relaxation > 0.0 and held.rounds:
        return _relaxing_response(held)
    step = _choose_step(held)
    response = _response(held, step)
    if held.memoryless or not held.rounds:
        return response
    left = np.abs(_lasting(held, step) - response.static)
    for larger in (2e-3, 1e-2):  # leaves smaller constants
        if left.max() <= _KNOWN * np.abs(response.static).max():
            break
        step = larger * held.radius
        with suppress(StabilityError):  # a large step may lose the contact
            other = _response(held, step)
            beside = np.abs(_lasting(held, step) - other.static)
            if beside.max() < left.max():
                response, left = other, beside
    if left.max() > _UNKNOWN * np.abs(response.static).max():
        raise StabilityError(
            f"the body's response to a displacement of the tip was not found: held for {_LASTING} ticks, its stiffness "
            f"differs by {left.max():.3g} N/m; give more damping or a shorter retardation_time, or judge the run"
        )
    return replace(response, error=response.error + left)


def _response(held: HeldTip, step: float) -> BodyResponse:
    """Return the response to displacements by `step`, m, for one tick."""
    if held.memoryless and _is_static(*_impulses(held, step, 16)):
        forth, back = (part[:1] for part in _impulses(held, step, 2))
        tail = np.zeros_like(held.frame)
    else:
        forth, back, tail = _record(held, step)
    mean, difference = 0.5 * (forth + back), 0.5 * (forth - back)
    system, error = realize(mean, held.period)
    odd = np.abs(difference).sum(axis=0)
    asymmetry = float(odd.sum() / max(np.abs(mean).sum(), 1e-300))
    return BodyResponse(held.frame, system, mean, error + odd + tail, asymmetry, held.nodes)


def _relaxing_response(held: HeldTip) -> BodyResponse:
    """Return the response of a body that relaxes without inertia, from the displacement whose response is surest.

    Raises:
        StabilityError: its error is above a tenth of the response.
    """
    found: list[BodyResponse] = []
    for relative in _LASTING_STEPS:
        try:
            mean, odd, left = relaxation_record(held, relative * held.radius)
        except StabilityError:  # a large step may lose the contact; it is the last one
            if not found:
                raise
            continue
        system, error = realize(mean, held.period)
        asymmetry = float(odd.sum() / np.abs(mean).sum(axis=0).sum())
        found.append(BodyResponse(held.frame, system, mean, error + odd + left, asymmetry, held.nodes))
        if found[-1].error.max() <= _KNOWN * np.abs(mean).sum(axis=0).max():
            break
    best = min(found, key=lambda one: float(one.error.max()))
    if best.error.max() > _UNKNOWN * np.abs(best.markov).sum(axis=0).max():
        raise StabilityError(
            f"the body's response to a displacement of the tip was not found: its error is {best.error.max():.3g} N/m; "
            "give a shorter retardation_time, or judge the run"
        )
    return best


def _lasting(held: HeldTip, step: float) -> Array:
    """Return the response (r, r), N/m, to displacements along each axis that last.

    Rounding leaves a constant in an impulse response, whose sum over the ticks grows. It does not grow here.
    """
    size = len(held.frame)
    answers, ticks = np.empty((size, size)), np.ones((_LASTING, 1))
    for axis in range(size):
        moved = step * held.frame[:, axis]
        ends = [held.move(ticks * (sign * moved))[0][-1] for sign in (1.0, -1.0)]
        answers[:, axis] = (ends[0] - ends[1]) @ held.frame / (2.0 * step)
    held.move(0.0 * ticks * moved)
    return answers


def _choose_step(held: HeldTip) -> float:
    """Return the step, m, whose opposite displacements are answered most alike.

    Large steps leave the linear range or change the nodes in contact, and small ones drown in rounding.
    """
    found = []
    for relative in _STEPS if held.rounds else _STEPS[2:]:
        forth, back = _impulses(held, relative * held.radius, 64)
        odd = float(np.abs(forth - back).sum()) / max(float(np.abs(forth + back).sum()), 1e-300)
        found.append((odd, relative * held.radius))
    return min(found)[1]


def _impulses(held: HeldTip, step: float, ticks: int) -> tuple[Array, Array]:
    """Return the responses (ticks, r, r), N/m, to displacements of one tick forth and back along each axis."""
    size = len(held.frame)
    answers = np.empty((2, ticks, size, size))
    still = np.zeros((ticks, size))
    before = held.move(still[:1])[0][-1]
    for axis in range(size):
        for row, sign in enumerate((1.0, -1.0)):
            moved = still.copy()
            moved[0] = sign * step * held.frame[:, axis]
            forces = held.move(moved)[0]
            answers[row, :, :, axis] = (forces - before) @ held.frame / (sign * step)
            before = forces[-1]
    return answers[0], answers[1]


def _is_static(forth: Array, back: Array) -> bool:
    return float(np.abs([forth[1:], back[1:]]).max()) <= 1e-9 * float(np.abs(forth[0]).max())


def _record(held: HeldTip, step: float) -> tuple[Array, Array, Array]:
    """Return responses forth and back until they have decayed, and the gain of the noise cut off (r, r), N/m.

    A level that stays, of single precision or of the friction's iterations, ends the record where it begins.
    """
    ticks = _FIRST
    while True:
        forth, back = _impulses(held, step, ticks)
        if held.rounds and not held.friction:
            most = _ROUNDING * float(np.linalg.norm(held.force)) / step
            forth, back = _without_offset(forth, most), _without_offset(back, most)
        mean = 0.5 * (forth + back)
        size = np.linalg.norm(mean, ord=2, axis=(1, 2))
        third, last = (float(part.sum()) for part in np.split(size, 4)[2:])
        share = last / float(size.sum())
        if share <= _DECAYED:
            return forth, back, np.zeros_like(mean[0])
        if share <= _NOISE and _is_noise(mean[-ticks // 4 :], third, held.rounds):
            level = float(np.median(size[-ticks // 4 :]))
            above = np.convolve(size, np.ones(_WINDOW) / _WINDOW, "valid") > 2.0 * level
            end = min(int(np.flatnonzero(above).max(initial=0)) + 2 * _WINDOW, ticks)
            return forth[:end], back[:end], 2.0 * _WINDOW * np.median(np.abs(mean[-ticks // 4 :]), axis=0)
        if ticks >= _LONGEST:
            break
        ticks *= 2
    if last < 0.9 * third:
        return forth, back, np.zeros_like(mean[0])
    remedy = "give the body more damping (rayleigh_beta), or a shorter retardation_time"
    if held.friction and isinstance(held.core, _core.SignedDistanceBody):
        remedy = "its friction keeps a share of each displacement; judge the loop without friction, or its run"
    raise StabilityError(
        f"the body's response to a displacement of the tip has not decayed after {ticks} ticks: {remedy}"
    )


def _without_offset(answers: Array, most: float) -> Array:
    """Return a response (k, r, r), N/m, less the constant of its last half if that is at most `most`, N/m."""
    before, level = (np.median(part, axis=0) for part in np.split(answers, 4)[2:])
    size = float(np.linalg.norm(level, ord=2))
    if size > most or float(np.linalg.norm(level - before, ord=2)) > (1.0 - _CONSTANT) * size:
        return answers
    return np.concatenate([answers[:1], answers[1:] - level])


def _is_noise(quarter: Array, before: float, rounds: bool) -> bool:
    """Return whether the last quarter of a response (k, r, r) has random signs, or is a constant left by rounding.

    Args:
        quarter: N/m.
        before: sum of the norms of the quarter before, N/m.
        rounds: whether the body's model leaves such a constant (`HeldTip.rounds`).
    """
    size = float(np.linalg.norm(quarter, ord=2, axis=(1, 2)).sum())
    mean = len(quarter) * float(np.linalg.norm(quarter.mean(axis=0), ord=2))
    return size >= 0.5 * before and (mean < 0.3 * size or (rounds and size >= _CONSTANT * before))
