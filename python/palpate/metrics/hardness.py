"""How hard a first touch feels: the rate at which force rises, over the speed at which the tip comes in."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.checks import positive
from palpate.errors import StabilityError
from palpate.linear.sampled_loop import assemble_loop, sampled_plants
from palpate.metrics.loop_response import LoopResponse

__all__ = ["rate_hardness"]

Array = NDArray[np.float64]


def rate_hardness(loop: LoopResponse, along: ArrayLike, window: float = 10e-3) -> float:
    """Return the mean rate of the tip's force in the first moment of a touch over the speed at contact, N/m.

    Initial force rate over initial velocity (Lawrence, Lee, Pao & Novoselov 1996). The device alone flies in along
    ``along``, is sampled just as it touches, and its linear loop is followed exactly, sample by sample; the force is
    the command as it is held and late. A wall that is pure spring, met by a heavy device without delay, has its own
    stiffness; damping adds B over the window, the bounce of a light device and delay take away.

    Args:
        loop: device, servo and object.
        along: direction (3,) of the object's surface normal.
        window: s, from contact on.

    Raises:
        StabilityError: a window that is not positive, or shorter than the time until a force can act.
    """
    length = round(positive(window, "window", "s") / loop.period)
    if length <= loop.delay:
        raise StabilityError(
            f"window must be longer than the delay and one period, {1e3 * (loop.delay + 1) * loop.period:g} ms"
        )
    if loop.coupling != "backward":
        raise StabilityError('rate-hardness is of objects damped by backward difference; write coupling = "backward"')
    n = np.asarray(along, dtype=float) / np.linalg.norm(along)
    device, pose = loop.device, loop.pose
    jacobian = device.jacobian(pose)
    plant = sampled_plants(device, pose[None], None, np.zeros(3), loop.period)
    plain = (plant[0][0], plant[1][0], plant[2][0])
    a, entry, out = assemble_loop(plain, jacobian, loop._geometric_stiffness(), loop.law, loop.delay)
    push = np.linalg.solve(device.mass_matrix(pose), jacobian.T @ n)
    state = np.zeros(len(a))
    state[device.dof : 2 * device.dof] = push / (n @ jacobian @ push)  # 1 m/s along the normal
    before, feedback = np.zeros(3), loop.law.feedback
    commands = []
    m = feedback.nstates
    for _ in range(length):
        tip = out @ state
        force = loop.stiffness @ tip + loop.damping @ (tip - before) / loop.period
        memory = feedback.C @ state[len(a) - m :] if m else np.zeros(3)
        commands.append(-float(n @ (memory + feedback.D @ force)))
        state, before = a @ state + entry @ force, tip
    # the force at the end of the window is the command of `delay` samples before the last sample in it
    return commands[length - 1 - loop.delay] / (length * loop.period)
