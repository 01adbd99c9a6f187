"""Rate hardness: initial rate of force over initial velocity of a contact."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from palpate.checks import positive
from palpate.errors import StabilityError
from palpate.linear.sampled_loop import assemble_loop, sampled_plants
from palpate.metrics.loop_response import LoopResponse

__all__ = ["rate_hardness"]


def rate_hardness(loop: LoopResponse, along: ArrayLike, window: float = 10e-3) -> float:
    """Return the mean initial rate of the tip force over the velocity at contact, N/m.

    Initial force rate over initial velocity (Lawrence, Lee, Pao & Novoselov 1996). The free device moves along
    ``along``, is sampled at the moment of contact, and its linear loop is simulated exactly. The force is the held and
    delayed command at the end of the window, so a pure spring in contact with a heavy device gives 1 - (n + 1) T/window
    of its stiffness with a delay of n samples. Damping adds B over the window; the rebound of a light device reduces
    the result. A delay of the window or more gives 0.

    Args:
        loop: device, servo and object.
        along: surface normal of the object (3,).
        window: averaging time from contact on, s.

    Raises:
        StabilityError: a window that is not positive or shorter than a period.
    """
    length = round(positive(window, "window", "s") / loop.period)
    if length < 1:
        raise StabilityError(f"window must be at least one period, {1e3 * loop.period:g} ms")
    if loop.coupling != "backward":
        raise StabilityError('rate hardness needs an object damped by backward difference; write coupling = "backward"')
    if length <= loop.delay:
        return 0.0
    n = np.asarray(along, dtype=float) / np.linalg.norm(along)
    device, pose = loop.device, loop.pose
    jacobian = device.jacobian(pose)
    plant = sampled_plants(device, pose[None], None, np.zeros(3), loop.period)
    matrices = (plant[0][0], plant[1][0], plant[2][0])
    a, entry, out = assemble_loop(matrices, jacobian, loop._geometric_stiffness(), loop.controller, loop.delay)
    velocity = np.linalg.solve(device.mass_matrix(pose), jacobian.T @ n)
    state = np.zeros(len(a))
    state[device.dof : 2 * device.dof] = velocity / (n @ jacobian @ velocity)  # 1 m/s along the normal
    previous, feedback = np.zeros(3), loop.controller.feedback
    commands = []
    m = feedback.nstates
    for _ in range(length):
        tip = out @ state
        force = loop.stiffness @ tip + loop.damping @ (tip - previous) / loop.period
        output = feedback.C @ state[len(a) - m :] if m else np.zeros(3)
        commands.append(-float(n @ (output + feedback.D @ force)))
        state, previous = a @ state + entry @ force, tip
    # the force at the end of the window is the command of `delay` samples before the last sample in it
    return commands[length - 1 - loop.delay] / (length * loop.period)
