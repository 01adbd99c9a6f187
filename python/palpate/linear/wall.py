"""Sampled loop of a tip and a wall, as one matrix that is affine in the wall's stiffness K and damping B.

At each sample f = K x + B v, where v <- alpha v + (1 - alpha) dx/T is the filtered backward difference of x. The
command -f passes through the controller, if any, is held for a period and acts after the delay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Complex
from palpate.checks import fraction
from palpate.errors import StabilityError
from palpate.linear.linear_device import LinearDevice, SampledDevice, discretize_zoh
from palpate.units import array_to_si


@dataclass(frozen=True)
class WallLoop:
    """x_{k+1} = (base + entry (K position + B velocity)) x_k.

    Attributes:
        base: (n, n), the loop without the wall.
        entry: (n,), input of the wall's force to the next state.
        position: (n,), tip position of a state, m.
        velocity: (n,), the servo's estimate of the tip's velocity, m/s.
        tip: the discretized device.
        velocity_filter: alpha.
        controller: between the wall's force and the command; None: a gain of one.
    """

    base: Array
    entry: Array
    position: Array
    velocity: Array
    tip: SampledDevice
    velocity_filter: float
    controller: control.StateSpace | None

    @property
    def period(self) -> float:
        """T, s."""
        return self.tip.period

    def matrix(self, stiffness: ArrayLike, damping: ArrayLike = 0.0) -> Array:
        """Return the closed loop's matrix (..., n, n) for K (N/m) and B (N s/m), broadcast against each other."""
        k, b = np.broadcast_arrays(
            array_to_si(stiffness, "N/m", "stiffness", error=StabilityError),
            array_to_si(damping, "N*s/m", "damping", error=StabilityError),
        )
        row = k[..., None] * self.position + b[..., None] * self.velocity
        return np.asarray(self.base + self.entry[:, None] * row[..., None, :], dtype=float)

    def spectral_radius(self, stiffness: float | str, damping: float | str = 0.0) -> float:
        """Return the largest modulus of the loop's eigenvalues, per sample."""
        return float(np.abs(np.linalg.eigvals(self.matrix(stiffness, damping))).max())

    def required_wall_response(self, angle: Array) -> Complex:
        """Return W(theta) (k,), N/m: the response K + B V with a root at e^{j theta}; theta (k,), rad per sample."""
        theta = np.asarray(angle, dtype=float)
        gain = self.tip.response(theta)
        if self.controller is not None:
            gain = gain * frequency_values(self.controller, np.exp(1j * theta))
        return np.asarray(-1 / gain, dtype=complex)

    def velocity_response(self, angle: Array) -> Complex:
        """Return V(theta) (k,), the servo's velocity per position, 1/s; theta (k,), rad per sample."""
        theta = np.asarray(angle, dtype=float)
        z, a = np.exp(1j * theta), self.velocity_filter
        z_minus_one = -2 * np.sin(theta / 2) ** 2 + 1j * np.sin(theta)
        return np.asarray((1 - a) / self.period * z_minus_one / (z - a), dtype=complex)


def wall_loop(
    device: LinearDevice | control.StateSpace | SampledDevice,
    period: float | str | None = None,
    delay: float = 0.0,
    velocity_filter: float = 0.0,
    controller: Any = None,
) -> WallLoop:
    """Return the loop of ``device`` against a wall.

    Args:
        device: a LinearDevice, a continuous SISO state space from force (N) to motion (m), or a SampledDevice.
        period: T, s; not for a SampledDevice, which has one.
        delay: in samples, may be fractional.
        velocity_filter: alpha of v <- alpha v + (1 - alpha) dx/T, 0 for none.
        controller: sampled SISO system from the wall's force to the command; None: unity.

    Raises:
        StabilityError: as ``discretize_zoh`` and ``causal_controller``.
    """
    alpha = fraction(velocity_filter, "velocity_filter")
    if isinstance(device, SampledDevice):
        tip = device
    else:
        if period is None:
            raise StabilityError("period is missing: the loop's servo period in s")
        tip = discretize_zoh(device, period, delay)
    feedback = None if controller is None else causal_controller(controller, tip.period)
    n = len(tip.step)
    line = tip.whole + (1 if tip.fractional else 0)  # length of the delay line
    m = 0 if feedback is None else feedback.nstates
    size = n + line + 1 + m
    base = np.zeros((size, size))
    base[:n, :n] = np.eye(n) + tip.step
    direct = np.zeros(size)  # input of the newest command
    if tip.whole == 0:
        direct[:n] += tip.now
    else:
        base[:n, n + tip.whole - 1] += tip.now
    if tip.fractional:
        base[:n, n + tip.whole] += tip.before
    for i in range(1, line):
        base[n + i, n + i - 1] = 1.0
    if line:
        direct[n] = 1.0
    # state of the filter: s <- alpha s + x; v = (1 - alpha)/T (x - (1 - alpha) s)
    filter_state = n + line
    base[filter_state, filter_state] = alpha
    base[filter_state, :n] = tip.out
    position, velocity = np.zeros(size), np.zeros(size)
    position[:n] = tip.out
    velocity[:n] = (1 - alpha) / tip.period * tip.out
    velocity[filter_state] = -((1 - alpha) ** 2) / tip.period
    entry = -direct
    if feedback is not None:
        tail = slice(filter_state + 1, size)
        base[tail, tail] = feedback.A
        base[:, tail] -= np.outer(direct, feedback.C[0])
        entry = -direct * feedback.D[0, 0]
        entry[tail] = feedback.B[:, 0]
    return WallLoop(base, entry, position, velocity, tip, alpha, feedback)


def causal_controller(controller: Any, period: float) -> control.StateSpace:
    """Return a sampled SISO controller as a state space, checked to be causal and stable.

    Raises:
        StabilityError: it is not causal (its numerator is of higher degree than its denominator), is unstable, is
            continuous or sampled otherwise, or has several inputs or outputs.
    """
    if isinstance(controller, control.TransferFunction) and (controller.ninputs, controller.noutputs) == (1, 1):
        top, bottom = (np.trim_zeros(np.asarray(c, float), "f") for c in (controller.num[0][0], controller.den[0][0]))
        if len(top) > len(bottom):
            raise StabilityError(
                f"the controller is not causal: its numerator has degree {len(top) - 1} and its denominator "
                f"{len(bottom) - 1}, so it would need samples of the future"
            )
        a, b, c, d = _companion(top, bottom)
        controller = control.StateSpace(a, b, c, d, controller.dt)
    if not isinstance(controller, control.StateSpace) or (controller.ninputs, controller.noutputs) != (1, 1):
        raise StabilityError("the controller must be a sampled control system from one force to one force")
    if not controller.isdtime(strict=True):
        raise StabilityError("the controller is continuous: sample it with the servo period first")
    if controller.dt is not True and not math.isclose(float(controller.dt), period, rel_tol=1e-6):
        raise StabilityError(
            f"the controller is sampled every {float(controller.dt):g} s and the loop every {period:g} s"
        )
    poles = np.linalg.eigvals(controller.A) if controller.nstates else np.zeros(0)
    if poles.size and np.abs(poles).max() > 1 + 1e-9:
        raise StabilityError(
            f"the controller itself is unstable (a pole of modulus {np.abs(poles).max():.6g}): give a stable one"
        )
    return controller


def _companion(top: Array, bottom: Array) -> tuple[Array, Array, Array, Array]:
    """Return the controllable companion form of top/bottom, deg top <= deg bottom."""
    n = len(bottom) - 1
    den = bottom / bottom[0]
    num = np.concatenate([np.zeros(n + 1 - len(top)), top]) / bottom[0]
    a = np.zeros((n, n))
    if n:
        a[0] = -den[1:]
        a[1:, :-1] = np.eye(n - 1)
    b = np.zeros((n, 1))
    b[:1] = 1.0
    return a, b, (num[1:] - num[0] * den[1:])[None, :], np.array([[num[0]]])


def frequency_values(system: control.StateSpace, z: Complex) -> Complex:
    """Return the response (k,) of a SISO system at each z (k,)."""
    if not system.nstates:
        return np.full(z.shape, complex(system.D[0, 0]))
    matrix = z[:, None, None] * np.eye(system.nstates) - system.A
    solved = np.linalg.solve(matrix, np.broadcast_to(system.B, (len(z), *system.B.shape)))
    return np.asarray((system.C @ solved)[:, 0, 0] + system.D[0, 0], dtype=complex)
