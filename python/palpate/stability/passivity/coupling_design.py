"""Design of virtual couplings for impedance and admittance displays (Adams & Hannaford 1999).

Their criterion is Llewellyn's on a sampled two-port with an approximate hold. The exact limit of the sampled loop
stands beside each design: passivity of an impedance display, stability with given operators for an admittance display.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from palpate.arrays import Array, Complex
from palpate.checks import not_negative, positive
from palpate.devices import Device
from palpate.errors import PoseError, StabilityError
from palpate.linear.linear_device import HumanArm

__all__ = [
    "AdmittanceCoupling",
    "ImpedanceCoupling",
    "admittance_coupling",
    "design_couplings",
    "impedance_coupling",
]

THETA: Final[Array] = np.concatenate([np.geomspace(1e-4, 1e-2, 100), np.linspace(0.0101, np.pi - 1e-4, 3000)])
OPERATORS: Final = tuple(
    HumanArm(mass, damping, stiffness)
    for mass in (0.0, 0.05, 0.15, 0.5)
    for damping in (0.0, 4.5, 20.0)
    for stiffness in (0.0, 560.0, 2000.0)
)
LIGHTEST, HEAVIEST = 1e-4, 1e4  # virtual mass over that of the tip


@dataclass(frozen=True)
class ImpedanceCoupling:
    """Stiffest virtual coupling k_c + b_c s of an impedance display along one direction.

    Attributes:
        stiffness: largest k_c with the best b_c that the two-port accepts, N/m.
        damping: that b_c, N s/m.
        undamped: largest k_c with b_c = 0 that the two-port accepts, N/m: 8 b/T.
        exact: largest k_c with which the sampled display is passive for every passive object, N/m: 2 b/T, with b_c = 0.
    """

    stiffness: float
    damping: float
    undamped: float
    exact: float


@dataclass(frozen=True)
class AdmittanceCoupling:
    """Least virtual tool of an admittance display along one direction: mass and damper beside the environment.

    Attributes:
        mass: least mass without damper that the two-port accepts, kg; inf: none.
        damping: least damper without mass that the two-port accepts, N s/m; inf: none.
        exact: least mass without damper with which the sampled loop is stable for each operator, kg; inf: none.
        worst: operator that needs this mass; None without operators.
    """

    mass: float
    damping: float
    exact: float
    worst: HumanArm | None


def impedance_coupling(*, damping: float | str, period: float | str) -> ImpedanceCoupling:
    """Return the stiffest virtual coupling of a device with viscous friction b.

    The two-port is that of `two_port_margin`. With R = b_c + k_c T/2, X = (k_c T/2) cot(theta/2) and c = cos(theta/2)
    it requires 2 b R >= c (1 - c) (R^2 + X^2) at every theta.

    Args:
        damping: b, N s/m.
        period: T, s.
    """
    b, t = not_negative(damping, "damping", "N*s/m"), positive(period, "period", "s")
    # in units of b: r = R/b, h = k_c T/(2 b); h = r = 4 is the undamped one, and r < 8 at theta with c = 1/2
    cosine, cotangent = np.cos(0.5 * THETA), 1.0 / np.tan(0.5 * THETA)
    weight = cosine * (1.0 - cosine)

    def half(r: float) -> float:
        room = (2.0 * r / weight - r * r) / cotangent**2
        return min(float(np.sqrt(max(room.min(), 0.0))), r)  # b_c is not negative

    best = minimize_scalar(lambda r: -half(r), bounds=(4.0, 8.0), method="bounded", options={"xatol": 1e-10})
    h, r = half(float(best.x)), float(best.x)
    return ImpedanceCoupling(2.0 * b * h / t, b * (r - h), 8.0 * b / t, 2.0 * b / t)


def admittance_coupling(
    *,
    mass: float | str,
    damping: float | str,
    period: float | str,
    bandwidth: float | str = 200.0,
    damping_ratio: float = 0.9,
    operators: Sequence[HumanArm] = OPERATORS,
) -> AdmittanceCoupling:
    """Return the least virtual tool of an admittance display.

    The servo measures the operator's force F_h and moves a virtual tool, m_c v' + b_c v = F_h - F_e. The tip follows
    it: u = m (v_d' + k_p (x_d - x) + k_d (v_d - v)) + b v_d, with the gains of a `WorkspaceController`. The two-port is
    [v_h; -F_e] = [Y T_v; -1 Z_c] [F_h; v_e] with the tip's admittance Y, its tracking T_v and Z_c of the tool, all
    sampled; v_h is the mean over a period, so that a held F_h does the exact work. It requires
    2 Re Y Re Z_c >= |T_v| - Re T_v.

    Args:
        mass: of the tip, m, kg.
        damping: viscous friction, b, N s/m.
        period: T, s.
        bandwidth: of the feedback, rad/s.
        damping_ratio: of the feedback, at most 1.
        operators: rigid grips, for the exact limit; the device by itself feels no force.

    Raises:
        StabilityError: a value out of range.
    """
    m, b = positive(mass, "mass", "kg"), not_negative(damping, "damping", "N*s/m")
    t, rate = positive(period, "period", "s"), positive(bandwidth, "bandwidth", "rad/s")
    if not 0.0 < damping_ratio <= 1.0:
        raise StabilityError(f"damping_ratio must be above 0 and at most 1, not {damping_ratio:g}")
    loop = _AdmittanceLoop(m, b, t, *_gains(rate, damping_ratio, t))
    admittance, tracking = loop.ports(THETA)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(tracking)
        lag = np.where(tracking.real > 0.0, tracking.imag**2 / (size + tracking.real), size - tracking.real)
        needed = lag / (2.0 * admittance.real)
    if (admittance.real <= 0.0).any():
        least_mass = least_damping = float("inf")
    else:
        least_mass = float((t * needed / (1.0 - np.cos(THETA))).max())
        least_damping = float(needed.max())
    limits = [loop.least_mass(one) for one in operators]
    worst = operators[int(np.argmax(limits))] if limits else None
    return AdmittanceCoupling(least_mass, least_damping, max(limits, default=0.0), worst)


def design_couplings(
    device: Device, pose: ArrayLike, *, period: float | str | None = None
) -> tuple[tuple[Array, ImpedanceCoupling, AdmittanceCoupling], ...]:
    """Return the couplings of both displays along x, y and z, as far as the tip can move along them.

    Args:
        device: whose mass and viscous friction count, along each direction as for a tip that moves along it.
        pose: (dof,), rad.
        period: T, s; that of the device if not given.

    Raises:
        PoseError: the tip can move along none of them.
    """
    q, t = np.asarray(pose, dtype=float), device.servo_period if period is None else period
    jacobian, inertia = device.jacobian(q), device.mass_matrix(q)
    inverse = np.linalg.pinv(jacobian)
    found = []
    for e in np.eye(3):
        speeds = inverse @ e
        if np.linalg.norm(jacobian @ speeds - e) > 1e-6:
            continue
        mass = 1.0 / float(e @ jacobian @ np.linalg.solve(inertia, jacobian.T @ e))
        damping = float(np.sum(device.viscous * speeds**2))
        found.append(
            (
                e,
                impedance_coupling(damping=damping, period=t),
                admittance_coupling(mass=mass, damping=damping, period=t),
            )
        )
    if not found:
        raise PoseError("the tip can move along none of the axes at this pose; choose another pose")
    return tuple(found)


def _gains(rate: float, ratio: float, t: float) -> tuple[float, float]:
    """Return k_p, 1/s^2, and k_d, 1/s, with the poles of a sampled double integrator at this rate and ratio."""
    radius = np.exp(-ratio * rate * t)
    a1, a0 = 2.0 * radius * np.cos(np.sqrt(1.0 - ratio**2) * rate * t), radius**2
    return float((1.0 - a1 + a0) / t**2), float((3.0 - a1 - a0) / (2.0 * t))


@dataclass(frozen=True)
class _AdmittanceLoop:
    """Admittance display along one direction: mass m, friction b, period T, gains k_p and k_d."""

    m: float
    b: float
    t: float
    kp: float
    kd: float

    def ports(self, theta: Array) -> tuple[Complex, Complex]:
        """Return Y and T_v (k,): mean tip velocity per held operator force, and per velocity of the virtual tool."""
        a, held = _motion(self.m, self.b, self.t, HumanArm(0.0, 0.0, 0.0))
        m, t = self.m, self.t
        # x, v, x_d and the last v_d; the command is `law` of them and `direct` of v_d
        law = np.array([-m * self.kp, -m * self.kd, m * self.kp, -m / t])
        direct = m / t + m * self.kd + self.b
        step = np.zeros((4, 4))
        step[:2, :2], step[2, 2] = a, 1.0
        step[:2] += np.outer(held, law)
        force, tool = np.zeros(4), np.zeros(4)
        force[:2] = held
        tool[:2], tool[2], tool[3] = held * direct, t, 1.0
        mean = np.array([1.0, 0.0, 0.0, 0.0]) / t
        z = np.exp(1j * theta)
        states = np.linalg.solve(z[:, None, None] * np.eye(4) - step, np.stack([force, tool], axis=1).astype(complex))
        found = (z - 1.0)[:, None] * (mean @ states)  # (x_{k+1} - x_k)/T
        return found[:, 0], found[:, 1]

    def least_mass(self, arm: HumanArm) -> float:
        """Return the least virtual mass, kg, above which the loop is stable with an operator; inf: none is."""
        low, high = LIGHTEST * self.m, HEAVIEST * self.m
        if not self._stable(high, arm):
            return float("inf")
        ladder = np.geomspace(high, low, 81)
        for heavy, light in pairwise(ladder):
            if self._stable(float(light), arm):
                continue
            low, high = float(light), float(heavy)
            for _ in range(40):
                middle = float(np.sqrt(low * high))
                low, high = (low, middle) if self._stable(middle, arm) else (middle, high)
            return high
        return 0.0

    def matrix(self, tool: float, arm: HumanArm) -> Array:
        """Return the closed loop's matrix (5, 5) of x, v, the last command, x_d and the last v_d."""
        m, b, t = self.m, self.b, self.t
        total = m + arm.mass
        a, held = _motion(m, b, t, arm)
        # operator's force on the tip at a sample, under the command held until then: m x'' + b x' - u
        felt = np.array([-m * arm.stiffness, b * total - m * (b + arm.damping), m - total, 0.0, 0.0]) / total
        velocity = felt * t / tool
        velocity[4] += 1.0  # v_d
        command = m / t * (velocity - np.eye(5)[4]) + (m * self.kd + b) * velocity
        command += np.array([-m * self.kp, -m * self.kd, 0.0, m * self.kp, 0.0])
        out = np.zeros((5, 5))
        out[:2, :2] = a
        out[:2] += np.outer(held, command)
        out[2], out[4] = command, velocity
        out[3] = np.eye(5)[3] + t * velocity
        return out

    def _stable(self, tool: float, arm: HumanArm) -> bool:
        values = np.abs(np.linalg.eigvals(self.matrix(tool, arm)))
        return bool(values.max() < 1.0 + 1e-7)  # a tool without operator or spring drifts


@lru_cache(maxsize=64)
def _motion(mass: float, damping: float, period: float, arm: HumanArm) -> tuple[Array, Array]:
    """Return the sampled motion of tip and operator, (2, 2), and the effect of a held force, (2,)."""
    total = mass + arm.mass
    rates = np.zeros((3, 3))
    rates[0, 1] = 1.0
    rates[1] = np.array([-arm.stiffness, -damping - arm.damping, 1.0]) / total
    flow = expm(rates * period)
    return np.asarray(flow[:2, :2], dtype=float), np.asarray(flow[:2, 2], dtype=float)
