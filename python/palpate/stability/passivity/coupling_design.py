"""Design of virtual couplings for impedance and admittance displays (Adams & Hannaford 1999).

Their criterion is Llewellyn's on a sampled two-port with an approximate hold. The exact limit of the sampled loop
stands beside each design: passivity of an impedance display, stability with given operators for an admittance display
as the core runs it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.optimize import minimize_scalar

from palpate import _core
from palpate.arrays import Array, Complex
from palpate.checks import not_negative, positive
from palpate.devices import Device
from palpate.errors import PoseError, StabilityError
from palpate.linear.admittance_loop import SensedPlant, TipFeedback, admittance_loop
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
    for damping in (4.5, 20.0)
    for stiffness in (0.0, 560.0, 2000.0)
)
LIGHTEST, HEAVIEST = 1e-4, 1e2  # virtual mass over that of the tip


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
        exact: least mass without damper with which the admittance display is stable for each operator, kg; inf: none.
        heaviest: mass up to which it is, kg; inf: beyond a hundred times that of the tip.
        worst: operator that needs this mass; None without operators.
    """

    mass: float
    damping: float
    exact: float
    heaviest: float
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

    The servo measures the operator's force F_h and moves a virtual tool, m_c v' + b_c v = F_h - F_e, which the tip
    follows with the gains of a `WorkspaceController`. The two limits are those of two laws:

    - Two-port, the law of Adams & Hannaford, whose motors do not know F_h:
      u = m (v_d' + k_p (x_d - x) + k_d (v_d - v)) + b v_d. The two-port is
      [v_h; -F_e] = [Y T_v; -1 Z_c] [F_h; v_e] with the tip's admittance Y, its tracking T_v and Z_c of the tool, all
      sampled; v_h is the mean over a period, so that a held F_h does the exact work. It requires
      2 Re Y Re Z_c >= |T_v| - Re T_v.
    - Exact, the law of the core (`admittance_loop`), with its observer. Its motors supply what F_h lacks, so Y = 0 and
      the two-port accepts no tool.

    A grip without damping needs a damper of the tool as well, and is not among the default operators.

    Args:
        mass: of the tip, m, kg.
        damping: viscous friction, b, N s/m.
        period: T, s.
        bandwidth: of the feedback, rad/s.
        damping_ratio: of the feedback, at most 1.
        operators: rigid grips, for the exact limit; the device by itself feels no force. Behind a grip much heavier
            than the tip the range of stable tools also ends above, at `heaviest`.

    Raises:
        StabilityError: a value out of range.
    """
    m, b = positive(mass, "mass", "kg"), not_negative(damping, "damping", "N*s/m")
    t, rate = positive(period, "period", "s"), positive(bandwidth, "bandwidth", "rad/s")
    if not 0.0 < damping_ratio <= 1.0:
        raise StabilityError(f"damping_ratio must be above 0 and at most 1, not {damping_ratio:g}")
    parameters = _core.WorkspaceParameters()
    parameters.bandwidth, parameters.damping = rate, damping_ratio
    gains = _core.WorkspaceGains(parameters, t)
    loop = _AdmittanceLoop(m, b, t, gains.position, gains.velocity)
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
    one, axis = np.ones((1, 1)), np.eye(3, 1)
    observer = np.asarray(gains.observer)
    feedback = TipFeedback(axis, one, m * one, b * one[0], 0.0 * one, gains.position, gains.velocity, observer, t)
    ranges = [_stable_masses(m, b, feedback, arm) for arm in operators]
    least, most = max((low for low, _ in ranges), default=0.0), min((high for _, high in ranges), default=float("inf"))
    worst = operators[int(np.argmax([low for low, _ in ranges]))] if ranges else None
    exact = least if least < most else float("inf")
    return AdmittanceCoupling(least_mass, least_damping, exact, most, worst)


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


@dataclass(frozen=True)
class _AdmittanceLoop:
    """Admittance display of Adams & Hannaford along one direction: mass m, friction b, period T, gains k_p and k_d."""

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


def _stable_masses(mass: float, damping: float, feedback: TipFeedback, arm: HumanArm) -> tuple[float, float]:
    """Return the ends of the widest range of tool masses with which the display is stable, kg; (inf, 0): none is."""
    a, held = _motion(mass, damping, feedback.period, arm)
    total = mass + arm.mass
    # the force that the sensor reads is what accelerates the tip: m x'' + b x' - u
    felt = np.array([[-mass * arm.stiffness, damping * total - mass * (damping + arm.damping)]]) / total
    plant = SensedPlant(a, held[:, None], np.eye(1, 2), felt, np.array([[mass / total - 1.0]]))

    def stable(tool: float) -> bool:
        values = np.linalg.eigvals(admittance_loop(plant, feedback, tool, 0.0)[0])
        return bool(np.abs(values).max() < 1.0 + 1e-7)  # a tool without operator or spring drifts

    ladder = np.geomspace(LIGHTEST * mass, HEAVIEST * mass, 49)
    fits = np.array([stable(float(tool)) for tool in ladder])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], fits.astype(int), [0]])))
    if not len(edges):
        return float("inf"), 0.0
    begin, end = max(zip(edges[::2], edges[1::2], strict=True), key=lambda pair: pair[1] - pair[0])

    def edge(bad: float, good: float) -> float:
        for _ in range(24):
            middle = float(np.sqrt(bad * good))
            bad, good = (bad, middle) if stable(middle) else (middle, good)
        return good

    least = 0.0 if begin == 0 else edge(float(ladder[begin - 1]), float(ladder[begin]))
    return least, float("inf") if end == len(ladder) else edge(float(ladder[end]), float(ladder[end - 1]))


@lru_cache(maxsize=64)
def _motion(mass: float, damping: float, period: float, arm: HumanArm) -> tuple[Array, Array]:
    """Return the sampled motion of tip and operator, (2, 2), and the effect of a held force, (2,)."""
    total = mass + arm.mass
    rates = np.zeros((3, 3))
    rates[0, 1] = 1.0
    rates[1] = np.array([-arm.stiffness, -damping - arm.damping, 1.0]) / total
    flow = expm(rates * period)
    return np.asarray(flow[:2, :2], dtype=float), np.asarray(flow[:2, 2], dtype=float)
