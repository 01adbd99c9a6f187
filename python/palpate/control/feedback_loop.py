"""Sampled closed loop of controller and plant: loop gain, state matrix and spectral radius.

Convention: u = C(z) [F_ref; F_object] and F_object = P(z) u. With the feedback part H of the controller (F_object to u)
the loop gain, broken at the force command, is L = -H P. The loop is stable if every eigenvalue of the closed loop lies
inside the unit circle.
"""

from __future__ import annotations

import math
from typing import Any, Literal

import control
import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array, Complex
from palpate.control.controller import Controller
from palpate.errors import DesignError


def require_sampled(plant: control.StateSpace, caller: str) -> float:
    """Return the period (s) of a plant with 3 force inputs and 3 force outputs.

    Raises:
        DesignError: another shape, a continuous plant, or a value that is not finite; the message names ``caller``.
    """
    if (plant.ninputs, plant.noutputs) != (3, 3):
        raise DesignError(
            f"{caller}: the plant maps 3 tip forces to 3 object forces, not {plant.ninputs} to {plant.noutputs}"
        )
    if not plant.isdtime(strict=True) or plant.dt is True:
        raise DesignError(f"{caller}: the plant must be sampled with its period in s; discretize it first")
    if not all(np.all(np.isfinite(m)) for m in (plant.A, plant.B, plant.C, plant.D)):
        raise DesignError(f"{caller}: the plant's matrices must be finite")
    return float(plant.dt)


def active_axes(plant: control.StateSpace) -> NDArray[np.intp]:
    """Return the axes along which the command acts on the object force (x alone for the slider)."""
    strength = np.abs(plant.C).sum(1) * np.abs(plant.B).sum(0) + np.abs(np.diag(plant.D))
    axes = np.nonzero(strength > 1e-12 * max(float(strength.max(initial=0.0)), 1e-300))[0]
    if axes.size == 0:
        raise DesignError("the plant connects no force with any object force: give the object a stiffness")
    return axes


def series(first: control.StateSpace, second: control.StateSpace) -> control.StateSpace:
    """Return the series of ``first`` and ``second``, states stacked in this order."""
    a = np.block([[first.A, np.zeros((first.nstates, second.nstates))], [second.B @ first.C, second.A]])
    return control.StateSpace(
        a,
        np.vstack([first.B, second.B @ first.D]),
        np.hstack([second.D @ first.C, second.C]),
        second.D @ first.D,
        first.dt,
    )


def loop_gain(
    controller: Controller, plant: control.StateSpace, at: Literal["command", "object_force"] = "command"
) -> control.StateSpace:
    """Return L(z) (3 x 3) under negative feedback, broken at the force command or at the object force.

    Raises:
        DesignError: controller and plant have different periods or shapes.
    """
    period = require_sampled(plant, "loop_gain")
    if not math.isclose(period, controller.period, rel_tol=1e-6):
        raise DesignError(
            f"the plant's period is {period:g} s and the controller's {controller.period:g} s; sample both alike"
        )
    h = controller.feedback
    negative = control.StateSpace(h.A, h.B, -h.C, -h.D, h.dt)
    return series(plant, negative) if at == "command" else series(negative, plant)


def closed_loop_matrix(loop: control.StateSpace, gain: complex | Array = 1.0) -> Complex:
    """Return the state matrix of negative unity feedback around ``gain`` times ``loop``.

    A - B (I + g D)^-1 g C, where ``gain`` is a number (complex: a rotation of every channel) or a matrix (m x m) at the
    output of the loop.
    """
    m = loop.noutputs
    g = np.asarray(gain) * np.eye(m) if np.ndim(gain) == 0 else np.asarray(gain)
    return np.asarray(_fed_back(loop, g), dtype=complex)


def closed_loop_matrices(loop: control.StateSpace, gains: Array) -> Array:
    """Return the state matrices (k, n, n) of `closed_loop_matrix` for real gains (k,)."""
    return np.asarray(_fed_back(loop, gains[:, None, None] * np.eye(loop.noutputs)), dtype=float)


def _fed_back(loop: control.StateSpace, g: Any) -> Any:
    """Return A - B (I + g D)^-1 g C of ``loop`` for gains g (..., m, m)."""
    return loop.A - loop.B @ np.linalg.solve(np.eye(loop.noutputs) + g @ loop.D, g @ loop.C)


def spectral_radius(loop: control.StateSpace, gain: complex | Array = 1.0) -> float:
    """Return the largest modulus of the closed loop's eigenvalues, per sample; below 1 is stable."""
    a = closed_loop_matrix(loop, gain)
    return float(np.abs(np.linalg.eigvals(a)).max()) if a.size else 0.0


def closed_loop(controller: Controller, plant: control.StateSpace) -> control.StateSpace:
    """Return the sampled closed loop from F_ref (3, N) to [F_object; u] (6, N).

    Raises:
        DesignError: as in ``loop_gain``.
    """
    loop_gain(controller, plant)
    c, p = controller.system, plant
    br, by, dr, dy = c.B[:, :3], c.B[:, 3:], c.D[:, :3], c.D[:, 3:]
    # u = e (C x_c + dr r + dy C_p x_p), e = (I - dy D_p)^-1
    e = np.linalg.inv(np.eye(3) - dy @ p.D)
    u_x = e @ np.hstack([dy @ p.C, c.C])
    u_r = e @ dr
    y_x = np.hstack([p.C, np.zeros((3, c.nstates))]) + p.D @ u_x
    y_r = p.D @ u_r
    a = np.block([[p.A, np.zeros((p.nstates, c.nstates))], [np.zeros((c.nstates, p.nstates)), c.A]])
    a = a + np.vstack([p.B @ u_x, by @ y_x])
    b = np.vstack([p.B @ u_r, br + by @ y_r])
    return control.StateSpace(a, b, np.vstack([y_x, u_x]), np.vstack([y_r, u_r]), p.dt)
