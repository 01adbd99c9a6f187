"""One axis of a workspace controller: the fastest one that meets every constraint, exact on the sampled loop.

The controller decouples the tip's inertia, so a bare axis is a sampled double integrator whatever its mass. An operator
or an inertia that the controller does not know changes it. Four numbers remain: the bandwidth, the two rates of the
observer over it, and the bandwidth of the reference model.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import control
import numpy as np
from scipy.linalg import expm

from palpate.arrays import Array
from palpate.control import Controller, Margins, Robustness, WorkspaceController, loop_margins, robustness, workspace
from palpate.control.stability_margins import peak_gain
from palpate.devices import Device
from palpate.devices.device import Parameters
from palpate.devices.flexible_mode import FlexibleMode
from palpate.linear.flexible_tip import sampled_axis
from palpate.linear.linear_device import HumanArm, couple_arm

__all__ = ["OPERATORS", "AxisData", "AxisDesign", "tune_axis"]

OPERATORS: Final = tuple(
    HumanArm(mass, damping, stiffness)
    for mass, damping, stiffness in product((0.05, 0.15, 0.3, 0.5), (0.0, 1.0, 4.5, 20.0), (0.0, 100.0, 560.0, 2000.0))
)  # that must be stable by default, besides no operator
INERTIA: Final = (0.83, 1.0, 1.17)  # of the axis over that which the controller knows
OBSERVER: Final = (2.5, 4.0, 6.0)  # rates of the observer over the bandwidth that are tried
DISTURBANCE: Final = (0.03, 0.05)
LEAST_DISK: Final = 0.6
FURTHER_DELAY: Final = 2  # samples
LEAST_GAIN: Final = 0.5
MOST_COUNT_FORCE: Final = 0.3  # N, of one encoder count
MOST_OVERSHOOT: Final = 0.05
BAND: Final = 0.05  # about the target, that counts as settled
FASTEST_REFERENCE: Final = 1.5  # of the bandwidth: beyond it, the coupled arm overshoots more than one axis
SLOWEST: Final = 10.0  # rad/s
GRID: Final = 20  # bandwidths from the slowest to one per period that are tried before the bisection
RUN: Final = 0.5  # s, of a step response

SAMPLING: Final = "sampling"
ENCODER: Final = "encoder"
OPERATOR: Final = "operator"
FLEXIBLE: Final = "flexible mode"
DETUNED: Final = (0.9, 1.0, 1.1)  # of the mode's frequency


@dataclass(frozen=True)
class AxisData:
    """Numbers of a device that constrain one axis.

    Attributes:
        masses: of the tip in the workspace, the extremes and between, kg.
        count: inertia of the tip times the tip motion of one encoder count, kg m; 0: no encoder.
        operators: that must be stable; each also without operator.
        mode: lowest flexible mode; None: a rigid device.
    """

    masses: tuple[float, ...]
    count: float
    operators: tuple[HumanArm, ...] = OPERATORS
    mode: FlexibleMode | None = None


@dataclass(frozen=True)
class AxisDesign:
    """Fastest axis that meets the constraints.

    Attributes:
        options: of `palpate.control.workspace`.
        limit: constraint that forbids a larger bandwidth: "sampling", "encoder", "operator" or "flexible mode".
        reason: the same in words, with its number.
        margins: of the bare loop.
        count_force: change of the command by one encoder count, N.
        settling: to 5 % of a step without limits of the drive, s; nan: not within 0.5 s.
        overshoot: of a step with any inertia of `INERTIA`, relative.
        robustness: gap margin of the axis beside the optimum of any controller.
    """

    options: dict[str, float]
    limit: str
    reason: str
    margins: Margins
    count_force: float
    settling: float
    overshoot: float
    robustness: Robustness


@dataclass(frozen=True)
class _Violation:
    limit: str
    reason: str


def tune_axis(period: float, delay: int, data: AxisData) -> AxisDesign | None:
    """Return the axis with the largest bandwidth that meets every constraint; None: no bandwidth does.

    Constraints: every operator and every inertia of `INERTIA` is stable, the disk margin is at least 0.6, the loop is
    stable with two more samples of delay and with half the gain, and an encoder count changes the command by at most
    0.3 N. A flexible mode is stable with 0.9 to 1.1 of its frequency and every inertia. The reference model is then
    the fastest whose overshoot is at most 5 % with any inertia of `INERTIA`.

    Args:
        period: s.
        delay: samples.
        data: masses, encoder and operators.
    """
    axis = _Axis(period, delay, data)
    best: tuple[float, dict[str, float], _Violation] | None = None
    for observer, disturbance in product(OBSERVER, DISTURBANCE):
        found = axis.fastest({"observer": observer, "disturbance": disturbance}, 0.0 if best is None else best[0])
        if found is not None:
            best = (found[0]["bandwidth"], *found)
    if best is None:
        return None
    _, options, violation = best
    options, overshoot = axis.with_reference(options)
    law = axis.law(options)
    loop = axis.loop(law, delay)
    margins = loop_margins(loop)
    return AxisDesign(
        options, violation.limit, violation.reason, margins, axis.count_force(law), axis.settling(law), overshoot,
        _share(loop, margins.crossover, delay, period, law),
    )  # fmt: skip


def first_limit(period: float, delay: int, data: AxisData) -> tuple[str, str]:
    """Return the constraint that forbids every bandwidth, and the reason in words."""
    axis = _Axis(period, delay, data)
    found = [
        axis.violation(axis.law({"bandwidth": bandwidth, "observer": OBSERVER[0], "disturbance": DISTURBANCE[0]}))
        for bandwidth in np.geomspace(SLOWEST, 1.0 / period, GRID)[::-1].tolist()
    ]
    known = [one for one in found if one is not None]
    chosen = next((one for one in known if one.limit == OPERATOR), known[-1])
    return chosen.limit, chosen.reason


@dataclass(frozen=True)
class AxisLaw:
    """Acceleration of one axis from reference and deflection, m; states: the estimate (3), the reference model (2)."""

    a: Array
    b: Array
    c: Array
    d: Array


_UNIT_MASS: Final = Device(
    "unit mass", "", "tip_device", Parameters({"mass.apparent": (1.0,) * 3, "friction.viscous": (0.0,) * 3})
)


def unit_law(controller: WorkspaceController) -> AxisLaw:
    """Return the law of one axis of a workspace controller, linear, for a mass of 1 kg."""
    return _law(replace(controller, device=_UNIT_MASS, stiffness=(1.0,) * 3))


def _law(controller: WorkspaceController) -> AxisLaw:
    s = controller.linearized(np.zeros(3)).system
    return AxisLaw(s.A[::3, ::3], s.B[::3, ::3], s.C[0, ::3], s.D[0, ::3])


def unit_radii(axes: list[tuple[Array, Array]], law: AxisLaw, delay: int) -> Array:
    """Return the spectral radii (n,) of the loops of axes (A, B) of one size, from known acceleration to deflection."""
    return _radii((np.array([a for a, _ in axes]), np.array([b for _, b in axes])), law, delay)


class _Axis:
    """Loops of one axis around a workspace controller."""

    def __init__(self, period: float, delay: int, data: AxisData) -> None:
        self.period, self.delay, self.data = period, delay, data
        self._known = workspace(_UNIT_MASS, period, stiffness=1.0)
        self._held = _held_axes(period, data)
        self._modes = _flexible_axes(period, data.mode)

    def law(self, options: dict[str, float]) -> AxisLaw:
        """Return the law of the core, linear, for a mass of 1 kg."""
        return _law(replace(self._known, **options))  # type: ignore[arg-type]

    def count_force(self, law: AxisLaw) -> float:
        """Return the change of the command by one encoder count, N."""
        return abs(float(law.d[1])) * self.data.count

    def loop(self, law: AxisLaw, delay: int) -> control.StateSpace:
        """Return the loop gain of the bare axis."""
        a, b = _double_integrator(self.period)
        n = 2 + delay
        plant, entry = np.zeros((n, n)), np.zeros((n, 1))
        plant[:2, :2] = a
        if delay:
            plant[:2, n - 1] = b
            plant[3:, 2:-1] = np.eye(delay - 1)
            entry[2, 0] = 1.0
        else:
            entry[:, 0] = b
        tip = np.eye(1, n)
        into, out, through = law.b[:3, 1:], law.c[None, :3], law.d[1]
        return control.StateSpace(
            np.block([[plant, np.zeros((n, 3))], [into @ tip, law.a[:3, :3]]]),
            np.vstack([entry, np.zeros((3, 1))]),
            -np.hstack([through * tip, out]),
            np.zeros((1, 1)),
            self.period,
        )

    def violation(self, law: AxisLaw) -> _Violation | None:
        """Return the first constraint that a law does not meet; None: it meets all."""
        if (force := self.count_force(law)) > MOST_COUNT_FORCE:
            return _Violation(
                ENCODER, f"one encoder count changes the command by more than {MOST_COUNT_FORCE:g} N ({force:.4g} N)"
            )
        for further in range(FURTHER_DELAY + 1):
            if _radius(self.loop(law, self.delay + further)) >= 1.0:
                return _Violation(SAMPLING, f"the loop must be stable with {FURTHER_DELAY} more samples of delay")
        bare = self.loop(law, self.delay)
        if any(_radius(bare, gain) >= 1.0 for gain in np.linspace(LEAST_GAIN, 1.0, 4)[:-1]):
            return _Violation(SAMPLING, f"the loop must be stable with {LEAST_GAIN:g} of its gain")
        for plants, names in self._modes:
            radius = _radii(plants, law, self.delay)
            if radius.max() >= 1.0:
                return _Violation(FLEXIBLE, f"unstable with {names[int(np.argmax(radius))]}")
        for plants, names in self._held:
            radius = _radii(plants, law, self.delay)
            if radius.max() >= 1.0:
                return _Violation(OPERATOR, f"unstable with {names[int(np.argmax(radius))]}")
        closed = control.StateSpace(bare.A - bare.B @ bare.C, bare.B, -bare.C, 0.5 * np.eye(1), bare.dt)
        if (disk := 1.0 / peak_gain(closed)[0]) < LEAST_DISK:
            return _Violation(SAMPLING, f"the disk margin would be below {LEAST_DISK:g} ({disk:.3g})")
        return None

    def fastest(self, ratios: dict[str, float], least: float) -> tuple[dict[str, float], _Violation] | None:
        """Return the largest bandwidth above `least` that meets every constraint, and what forbids a larger one."""

        def violated(bandwidth: float) -> _Violation | None:
            return self.violation(self.law({**ratios, "bandwidth": bandwidth}))

        high, low, found = 0.0, max(least * 1.002, SLOWEST), None
        for bandwidth in np.geomspace(low, 1.0 / self.period, GRID)[::-1]:  # slow loops may lose an operator
            there = violated(float(bandwidth))
            if there is None:
                low = float(bandwidth)
                break
            high, found = float(bandwidth), there
        else:
            return None
        if found is None:
            return {**ratios, "bandwidth": low}, _Violation(SAMPLING, "no bandwidth above one per period was tried")
        while high - low > 2e-3 * low:
            middle = 0.5 * (low + high)
            there = violated(middle)
            if there is None:
                low = middle
            else:
                high, found = middle, there
        return {**ratios, "bandwidth": _floored(low)}, found

    def with_reference(self, options: dict[str, float]) -> tuple[dict[str, float], float]:
        """Return the options with the fastest reference model that overshoots little with every inertia."""
        bandwidth = options["bandwidth"]

        def overshoot(ratio: float) -> float:
            law = self.law({**options, "reference": ratio * bandwidth})
            return max(float(self.step(law, inertia).max()) - 1.0 for inertia in INERTIA)

        low, high = 0.1, FASTEST_REFERENCE
        if overshoot(high) <= MOST_OVERSHOOT:
            low = high
        for _ in range(0 if low == high else 10):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if overshoot(middle) <= MOST_OVERSHOOT else (low, middle)
        return {**options, "reference": _floored(low * bandwidth)}, overshoot(low)

    def settling(self, law: AxisLaw) -> float:
        """Return the settling time of a step without limits of the drive, s."""
        outside = np.flatnonzero(np.abs(self.step(law, 1.0) - 1.0) > BAND)
        count = int(outside[-1]) + 1
        return count * self.period if count < round(RUN / self.period) else float("nan")

    def step(self, law: AxisLaw, inertia: float) -> Array:
        """Return the deflection of a unit step with a share of the known inertia, one per sample."""
        a, b = _double_integrator(self.period)
        state, model = np.zeros(2), np.zeros(5)
        late = [0.0] * self.delay
        out = np.zeros(round(RUN / self.period))
        for k in range(len(out)):
            out[k] = state[0]
            entry = np.array([1.0, state[0]])
            late.append(float(law.c @ model + law.d @ entry))
            model = law.a @ model + law.b @ entry
            state = a @ state + b / inertia * late.pop(0)
        return out


def _floored(rate: float) -> float:
    """Return a rate with one digit after the point, not above it, rad/s."""
    return float(np.floor(10.0 * rate) / 10.0)


def _double_integrator(period: float) -> tuple[Array, Array]:
    return np.array([[1.0, period], [0.0, 1.0]]), np.array([0.5 * period * period, period])


def _radius(loop: control.StateSpace, gain: float = 1.0) -> float:
    return float(np.abs(np.linalg.eigvals(loop.A - gain * loop.B @ loop.C)).max())


def _held_axes(period: float, data: AxisData) -> list[tuple[tuple[Array, Array], list[str]]]:
    """Return axes with every mass, inertia and operator: (A, B) from known acceleration, stacked by size; names."""
    groups: dict[int, tuple[list[Array], list[Array], list[str]]] = {}
    none, tip = np.zeros((1, 1)), np.eye(1)
    arms: Iterable[HumanArm | None] = (None, *data.operators)
    for arm, mass, inertia in product(arms, data.masses, INERTIA):
        m, d, s = np.full((1, 1), mass * inertia), none, none
        if arm is not None:
            m, d, s, _ = couple_arm(m, d, s, tip, arm)
        n = len(m)
        inverse = np.linalg.inv(m)
        block = np.zeros((2 * n + 1, 2 * n + 1))
        block[:n, n : 2 * n] = np.eye(n)
        block[n : 2 * n, : 2 * n] = -inverse @ np.hstack([s, d])
        block[n : 2 * n, 2 * n] = mass * inverse[:, 0]
        step = expm(block * period)
        a, b, names = groups.setdefault(n, ([], [], []))
        a.append(step[: 2 * n, : 2 * n])
        b.append(step[: 2 * n, 2 * n])
        names.append(_named(arm, mass, inertia))
    return [((np.array(a), np.array(b)), names) for a, b, names in groups.values()]


def _flexible_axes(period: float, mode: FlexibleMode | None) -> list[tuple[tuple[Array, Array], list[str]]]:
    """Return free axes with a mode, detuned, with every inertia, as `_held_axes`; empty for a rigid device."""
    if mode is None:
        return []
    pairs = list(product(DETUNED, INERTIA))
    axes = [sampled_axis(replace(mode, frequency=f * mode.frequency), inertia, period) for f, inertia in pairs]
    names = [f"a mode of {f * mode.frequency:.4g} Hz and {inertia:g} of the known inertia" for f, inertia in pairs]
    return [((np.array([a for a, _ in axes]), np.array([b for _, b in axes])), names)]


def _named(arm: HumanArm | None, mass: float, inertia: float) -> str:
    tip = f"a tip of {1e3 * mass:.3g} g whose inertia is {inertia:g} of the known one"
    if arm is None:
        return f"no operator at {tip}"
    grip = "" if arm.tissue_stiffness is None else f" through fingertip tissue of {arm.tissue_stiffness:g} N/m"
    return f"an operator of {arm.mass:g} kg, {arm.damping:g} N s/m and {arm.stiffness:g} N/m{grip}, at {tip}"


def _radii(plants: tuple[Array, Array], law: AxisLaw, delay: int) -> Array:
    """Return the spectral radii of the loops around a stack of axes."""
    a, b = plants
    count, n = b.shape
    size = n + delay + 3
    matrix = np.zeros((count, size, size))
    matrix[:, :n, :n] = a
    matrix[:, n + delay :, n + delay :] = law.a[:3, :3]
    matrix[:, n + delay :, 0] = law.b[:3, 1]
    command = np.zeros(size)
    command[0], command[n + delay :] = law.d[1], law.c[:3]
    if delay:
        matrix[:, :n, n + delay - 1] = b
        for i in range(1, delay):
            matrix[:, n + i, n + i - 1] = 1.0
        matrix[:, n, :] += command
    else:
        matrix[:, :n, :] += b[:, :, None] * command
    return np.asarray(np.abs(np.linalg.eigvals(matrix)).max(axis=1), dtype=float)


def _share(loop: control.StateSpace, crossover: float, delay: int, period: float, law: AxisLaw) -> Robustness:
    """Return the robustness of the bare axis beside the optimum, for one axis of three."""
    n = 2 + delay
    wide = np.zeros((n, 3))
    wide[:, 0] = loop.B[:n, 0]
    plant = control.StateSpace(
        loop.A[:n, :n], wide, np.vstack([np.eye(1, n), np.zeros((2, n))]), np.zeros((3, 3)), period
    )
    entry, out, through = np.zeros((3, 6)), np.zeros((3, 3)), np.zeros((3, 6))
    entry[:, 3], out[0], through[0, 3] = law.b[:3, 1], law.c[:3], law.d[1]
    return robustness(Controller(control.StateSpace(law.a[:3, :3], entry, out, through, period)), plant, crossover)
