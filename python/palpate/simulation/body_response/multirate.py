"""Small-signal response of a body whose model is updated at a slow rate, while the servo uses a local model.

Every m ticks an update samples the tip. Its result is published after m ticks and blended in over as many. About a
state of rest the force is therefore

    f[k] = K x[k] + sum over the updates u of g[k - m u] x[m u],

with K the stiffness of the local model and g the correction that follows one sampled displacement. Both are measured in
the core's own model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.arrays import Array
from palpate.errors import StabilityError
from palpate.simulation.body_response.held_tip import HeldTip

__all__ = ["MultirateResponse", "multirate_response"]

_STEPS = (3e-3, 1e-3, 3e-4, 1e-4)  # displacement of the tip, relative to its radius: smaller ones drown in round-off
_DECAYED = 1e-5  # correction of the last update, relative to the stiffness, that ends the record
_RESTING = 1e-2  # change of it from update to update, relative to it, that does so: round-off remains
_MOST_MOVING, _MOST_LEFT = 1e-2, 5e-2  # largest change, and correction, of the last update, relative to the stiffness
_UPDATES, _MOST_UPDATES = 6, 48


@dataclass(frozen=True)
class MultirateResponse:
    """Force on a body per displacement of the tip, about one state of rest.

    Matrices are in the axes of the contact: the first is the normal.

    Attributes:
        frame: axes of the contact in columns (3, 3), device frame.
        local: K (3, 3), N/m, of the local model.
        correction: g (n, 3, 3), N/m, n a multiple of `every`; g[0] is zero.
        static: change of the force under a lasting displacement (3, 3), N/m, as measured, mean over an update.
        every: m, ticks of an update.
        error: bound of the gain of the omitted dynamics, by entry (3, 3), N/m. It includes the difference between
            `static` and what K and g give, as the energy tank may delay an update.
        asymmetry: difference of the answers to opposite displacements, relative.
        nodes: number of nodes in contact.
    """

    frame: Array
    local: Array
    correction: Array
    static: Array
    every: int
    error: Array
    asymmetry: float
    nodes: int

    @property
    def one_tick(self) -> Array:
        """Change of the force within the tick of a displacement (3, 3), N/m: that of the local model."""
        return self.local


def multirate_response(held: HeldTip) -> MultirateResponse:
    """Return the response of a body that is updated every `held.every` ticks.

    Raises:
        StabilityError: the corrections do not decay from update to update.
    """
    every = held.every
    for step in _steps(held):
        forth, back = _decayed_answers(held, step)
        mean, size = 0.5 * (forth + back), float(np.linalg.norm(0.5 * (forth + back)[0], ord=2))
        last, moving = _ending(mean, every)
        if moving <= _MOST_MOVING * size and last <= _MOST_LEFT * size:
            break
    else:
        raise StabilityError(
            f"the body's force has not settled {len(mean) // every} updates after a displacement of the tip; the "
            "updates do not converge there"
        )
    level = np.linalg.norm(mean, ord=2, axis=(1, 2)).reshape(-1, every).max(axis=1)
    kept = every * (1 + int(np.flatnonzero(level > max(_DECAYED * size, 2.0 * last)).max()))
    correction = mean[:kept].copy()
    correction[0] = 0.0
    odd = np.abs(0.5 * (forth - back))
    error = odd[0] + odd[1:].sum(axis=0) / every + np.abs(mean[-every:]).max(axis=0)
    lasting = 0.5 * sum(part[-every:].mean(axis=0) for part in _answers(held, step, 2 * len(mean), lasting=True))
    error += np.abs(lasting - mean[0] - correction.sum(axis=0) / every)
    asymmetry = float(odd.max()) / size
    return MultirateResponse(held.frame, mean[0], correction, lasting, every, error, asymmetry, held.nodes)


def _steps(held: HeldTip) -> list[float]:
    """Return steps, m, from that with the least difference of opposite displacements and the least answer left."""
    found = []
    for relative in _STEPS:
        forth, back = _answers(held, relative * held.radius, _UPDATES * held.every)
        odd, mean = np.abs(forth - back).max(), np.abs(forth + back)
        left = mean[-held.every :].max()  # of a solver that stops at its tolerance, the more the smaller the step
        found.append(((odd + left) / max(mean.max(), 1e-300), relative * held.radius))
    return [step for _, step in sorted(found)]


def _decayed_answers(held: HeldTip, step: float) -> tuple[Array, Array]:
    """Return `_answers` over as many updates as they take to decay or to come to rest, at most 48."""
    updates = _UPDATES
    while True:
        forth, back = _answers(held, step, updates * held.every)
        mean = 0.5 * (forth + back)
        last, moving = _ending(mean, held.every)
        decayed = last <= _DECAYED * np.linalg.norm(mean[0], ord=2)
        if decayed or moving <= _RESTING * last or updates >= _MOST_UPDATES:
            return forth, back
        updates *= 2


def _ending(mean: Array, every: int) -> tuple[float, float]:
    """Return the largest norm of a response (n, 3, 3), N/m, in the last update, and of its change in it."""
    last = np.linalg.norm(mean[-every:], ord=2, axis=(1, 2)).max()
    moving = np.linalg.norm(mean[-every:] - mean[-2 * every : -every], ord=2, axis=(1, 2)).max()
    return float(last), float(moving)


def _answers(held: HeldTip, step: float, ticks: int, lasting: bool = False) -> tuple[Array, Array]:
    """Return the responses (ticks, 3, 3), N/m, to displacements forth and back, from a tick on that an update samples.

    They last for that tick alone, or until the end.
    """
    answers = np.empty((2, ticks, 3, 3))
    still = np.zeros((ticks, 3))
    for axis in range(3):
        for row, sign in enumerate((1.0, -1.0)):
            before = held.move(np.zeros((1 + (-held.ticks - 1) % held.every, 3)))[0][-1]
            moved = still.copy()
            moved[: ticks if lasting else 1] = sign * step * held.frame[:, axis]
            forces = held.move(moved)[0]
            answers[row, :, :, axis] = (forces - before) @ held.frame / (sign * step)
            if lasting:
                held.move(still)
    return answers[0], answers[1]
