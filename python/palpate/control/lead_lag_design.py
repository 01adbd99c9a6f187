"""Design of a lead-lag controller for force tracking, per axis, from crossover, phase margin and steady error.

Each axis gets c(z) = gain * lead * lag, designed on the exact response of the sampled plant at the crossover, which
includes the delay of the hold. With w = (2/T) (z-1)/(z+1) and W = (2/T) tan(omega T/2):

- gain: |L| = 1 at the crossover.
- lead: (1 + w sqrt(r)/W) / (1 + w/(sqrt(r) W)), r = (1 + sin phi)/(1 - sin phi); added if the loop lacks phase phi > 0.
- lag: (w + W/10) / (w + W/(10 ratio)); added if the static gain leaves too large a steady error.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.feedback_loop import active_axes, loop_gain, require_sampled, spectral_radius
from palpate.control.stability_margins import frequency_response
from palpate.errors import DesignError
from palpate.units import array_to_si

AXES = "xyz"
MAX_LEAD = np.radians(75.0)  # a larger lead would amplify noise by over 50
LAG_DECADE = 10.0  # ratio of the crossover to the zero of the lag, which costs arctan(1/10) = 5.7 deg of phase


@dataclass(frozen=True)
class Compensator:
    """Compensator c(z) of one axis: gain, lead (1 at z = 1) and lag (1 at z = -1), each (z - zero)/(z - pole).

    Attributes:
        gain: c at z = 1 without the lag, N/N.
        lead: (zero, pole) in z; None if the loop has enough phase.
        lag: (zero, pole) in z; None if the steady error is small enough.
    """

    gain: float
    lead: tuple[float, float] | None
    lag: tuple[float, float] | None

    def realize(self, period: float) -> control.StateSpace:
        """Return c(z) as a state space with at most two states."""
        system = control.StateSpace([], [], [], [[self.gain]], period)
        if self.lead is not None:
            zero, pole = self.lead
            system = _chain(system, zero, pole, (1 - pole) / (1 - zero))
        if self.lag is not None:
            zero, pole = self.lag
            system = _chain(system, zero, pole, (1 + pole) / (1 + zero))
        return system


def lead_lag(
    plant: control.StateSpace,
    *,
    crossover: ArrayLike = 180.0,
    phase_margin: ArrayLike = 60.0,
    steady_error: ArrayLike = 0.001,
    decouple: bool = True,
    smooth_reference: bool = True,
) -> Controller:
    """Return a lead-lag controller for a sampled plant from tip force to object force.

    Args:
        plant: 3 inputs (N), 3 outputs (N), sampled; see ``rendering_plant``. Axes without connection
            get no controller.
        crossover: frequency at which each loop's gain is 1, rad/s, one value or three (x, y, z).
        phase_margin: of each loop with the others open, deg. As text, these two have units: "180 rad/s", "60 deg".
        steady_error: largest |F_ref - F_object| / F_ref at rest, for the loop of each axis.
        decouple: precede the plant by a constant matrix that makes its response at the crossover diagonal (for a
            mechanism: its apparent mass at the tip, relative to that of the axis). Otherwise y and z stay coupled.
        smooth_reference: filter F_ref by a first-order low-pass at the zero of each lead, which reduces the response
            of the lead to a step. The loop and its margins do not change.

    Raises:
        DesignError: the plant does not fit, a specification is out of range or not reachable with one lead, or the
            coupling between the axes makes the loop unstable.
    """
    period = require_sampled(plant, "lead_lag")
    target = _three(crossover, "crossover", "rad/s", 0.0, np.pi / period)
    margin = np.radians(_three(phase_margin, "phase_margin", "deg", 0.0, 90.0))
    error = _three(steady_error, "steady_error", "of F_ref", 0.0, 1.0)
    axes = active_axes(plant)
    matrix = _decoupler(plant, axes, target) if decouple else np.eye(3)

    blocks: dict[int, Compensator] = {}
    for i in axes:
        loop = control.StateSpace(
            plant.A, plant.B @ matrix[:, [i]], plant.C[[i]], plant.D[[i]] @ matrix[:, [i]], period
        )
        blocks[int(i)] = _compensate(loop, float(target[i]), float(margin[i]), float(error[i]), AXES[i])
    system = _assemble(blocks, matrix, smooth_reference, period)
    notes: dict[str, Any] = {
        "crossover": target.tolist(),
        "phase_margin": np.degrees(margin).tolist(),
        "steady_error": error.tolist(),
        "decoupling": matrix.tolist(),
        "compensators": {AXES[i]: asdict(block) for i, block in blocks.items()},
    }
    controller = Controller(system, _conditioning(system), "lead_lag", notes)
    radius = spectral_radius(loop_gain(controller, plant))
    if radius >= 1.0:
        advice = "lower the crossover or raise the phase margin" if decouple else "use decouple=True"
        raise DesignError(
            f"lead_lag: each axis alone meets its margins, but together the loops are unstable (spectral radius "
            f"{radius:.6f}); {advice}"
        )
    return controller


def _compensate(loop: control.StateSpace, crossover: float, margin: float, error: float, axis: str) -> Compensator:
    """Return the compensator of one axis from the exact response of its sampled loop (1 x 1)."""
    period = float(loop.dt)
    response = complex(frequency_response(loop, crossover * period)[0, 0])
    if response == 0:
        raise DesignError(f"lead_lag: axis {axis} has no response at {crossover:g} rad/s; choose another crossover")
    rest = _static_gain(loop)
    sign = _gain_sign(loop)
    phase = float(np.angle(sign * response))
    phase = phase - 2 * np.pi if phase > np.pi / 2 else phase
    big = 2 / period * np.tan(crossover * period / 2)

    lack = margin - (np.pi + phase)
    lead_angle = max(0.0, lack)
    lag_ratio = 1.0
    for _ in range(2):  # the lead must compensate the phase of the lag
        if lead_angle > MAX_LEAD:
            raise DesignError(
                f"lead_lag: axis {axis} needs {np.degrees(lead_angle):.0f} deg of lead for a margin of "
                f"{np.degrees(margin):.0f} deg at {crossover:g} rad/s and one lead gives {np.degrees(MAX_LEAD):.0f}; "
                "ask for a lower crossover or a smaller margin"
            )
        spread = (1 + np.sin(lead_angle)) / (1 - np.sin(lead_angle))
        gain = 1 / (abs(response) * np.sqrt(spread))  # the gain of the lead at its center is sqrt(spread)
        if rest == 0:  # a lag would not help
            break
        at_rest = abs(rest) * gain  # inf of an integrating plant, which has no steady error
        lag_ratio = max(1.0, (1 / error - np.sign(rest * sign)) / at_rest)
        zero = 1j * LAG_DECADE
        lag = (zero + 1) / (zero + 1 / lag_ratio)
        lead_angle = max(0.0, lack - float(np.angle(lag)))
        gain = gain / abs(lag)

    lead = None
    if lead_angle > 0:
        root = np.sqrt(spread)
        lead = (_to_z(big / root, period), _to_z(big * root, period))
    lag_pair = None
    if lag_ratio > 1.0:
        lag_pair = (_to_z(big / LAG_DECADE, period), _to_z(big / (LAG_DECADE * lag_ratio), period))
    return Compensator(sign * float(gain), lead, lag_pair)


def _gain_sign(loop: control.StateSpace) -> float:
    """Return the sign of the first nonzero sample of the impulse response, which is the sign of the gain."""
    state, size = loop.B[:, 0], float(np.abs(loop.B).sum() * np.abs(loop.C).sum())
    samples = [float(loop.D[0, 0])]
    for _ in range(loop.nstates):
        samples.append(float(loop.C[0] @ state))
        state = loop.A @ state
    return next((float(np.sign(s)) for s in samples if abs(s) > 1e-9 * size), 1.0)


def _static_gain(loop: control.StateSpace) -> float:
    """Return the gain at z = 1; inf for an integrating loop (a pole within 1e-9 of 1)."""
    n = loop.nstates
    left = np.eye(n) - loop.A
    if n and np.linalg.svd(left, compute_uv=False)[-1] < 1e-12:
        return np.inf
    return float((loop.D + loop.C @ np.linalg.solve(left, loop.B))[0, 0])


def _to_z(corner: float, period: float) -> float:
    """Return the z of a real root at -corner (rad/s) in the w plane."""
    half = corner * period / 2
    return float((1 - half) / (1 + half))


def _chain(system: control.StateSpace, zero: float, pole: float, scale: float) -> control.StateSpace:
    """Return scale (z - zero)/(z - pole) after a single-channel system."""
    a = np.block([[system.A, np.zeros((system.nstates, 1))], [system.C, np.array([[pole]])]])
    b = np.vstack([system.B, system.D])
    c = np.hstack([system.C, np.array([[pole - zero]])]) * scale
    return control.StateSpace(a, b, c, system.D * scale, system.dt)


def _decoupler(plant: control.StateSpace, axes: NDArray[np.intp], crossover: Array) -> Array:
    """Return the constant matrix (3, 3), unit diagonal, that makes the real response at the crossover diagonal."""
    theta = float(np.exp(np.mean(np.log(crossover[axes])))) * float(plant.dt)
    response = frequency_response(plant, theta)[np.ix_(axes, axes)]
    # The response of a mechanism is in counterphase (real), that of an integrating model in quadrature.
    rotation = np.exp(-0.5j * np.angle(np.sum(response**2)))
    real = (response * rotation).real
    if np.linalg.cond(real) > 1e8:
        raise DesignError("lead_lag: the axes cannot be decoupled at the crossover; use decouple=False")
    inverse = np.linalg.inv(real)
    diagonal = np.diag(inverse)
    if np.any(np.abs(diagonal) < 1e-8 * np.abs(inverse).max()):
        raise DesignError("lead_lag: the axes cannot be decoupled at the crossover; use decouple=False")
    matrix = np.eye(3)
    matrix[np.ix_(axes, axes)] = inverse / diagonal
    return matrix


def _assemble(blocks: dict[int, Compensator], matrix: Array, smooth: bool, period: float) -> control.StateSpace:
    """Return u = matrix @ diag(c) (filtered F_ref - F_object) as one state space."""
    a_parts: list[Array] = []
    b_rows: list[Array] = []
    c_columns: list[Array] = []
    d = np.zeros((3, 6))
    for i, block in blocks.items():
        c = block.realize(period)
        n = c.nstates
        entry, feed = np.zeros((n, 6)), np.zeros((1, 6))
        entry[:, 3 + i], feed[0, 3 + i] = -c.B[:, 0], -c.D[0, 0]
        a, out = c.A, c.C
        if smooth and block.lead is not None:
            # x+ = zero x + (1 - zero) F_ref = the filtered reference at this sample
            zero = block.lead[0]
            a = np.block([[np.array([[zero]]), np.zeros((1, n))], [c.B * zero, c.A]])
            entry = np.vstack([np.zeros((1, 6)), entry])
            entry[0, i] = 1 - zero
            entry[1:, i] = c.B[:, 0] * (1 - zero)
            feed[0, i] = c.D[0, 0] * (1 - zero)
            out = np.hstack([c.D * zero, c.C])
        else:
            entry[:, i], feed[0, i] = c.B[:, 0], c.D[0, 0]
        a_parts.append(a)
        b_rows.append(entry)
        c_columns.append(matrix[:, [i]] @ out)
        d += matrix[:, [i]] @ feed
    size = sum(len(a) for a in a_parts)
    a = np.zeros((size, size))
    at = 0
    for part in a_parts:
        a[at : at + len(part), at : at + len(part)] = part
        at += len(part)
    return control.StateSpace(a, np.vstack(b_rows), np.hstack(c_columns), d, period)


def _conditioning(system: control.StateSpace) -> Array | None:
    """Return the anti-windup matrix B_e D_e^+ of Hanus's conditioning technique; None without states.

    The state evolves as if the error had requested the applied force. B_e and D_e are the inputs from -F_object.
    """
    if system.nstates == 0:
        return None
    return np.asarray(system.B[:, 3:] @ np.linalg.pinv(system.D[:, 3:]), dtype=float)


def _has_text(value: Any) -> bool:
    return isinstance(value, str) or (isinstance(value, (list, tuple)) and all(isinstance(one, str) for one in value))


def _three(value: ArrayLike, name: str, unit: str, low: float, high: float) -> Array:
    si = {"deg": "rad", "of F_ref": ""}.get(unit, unit)
    v = array_to_si(value, si, f"lead_lag: {name}", error=DesignError)
    if unit == "deg" and _has_text(value):
        v = np.degrees(v)
    if v.shape not in ((), (3,)) or not np.all(np.isfinite(v)) or np.any(v <= low) or np.any(v >= high):
        raise DesignError(
            f"lead_lag: {name} must be one value or three between {low:g} and {high:.6g} {unit}, not {v.tolist()}"
        )
    return np.broadcast_to(v, (3,)).astype(float)
