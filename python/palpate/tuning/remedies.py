"""Changes of a specification that make it feasible, each tried."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from palpate.arrays import Array
from palpate.control import WorkspaceController
from palpate.tuning.axis import ENCODER, OPERATOR, AxisData, AxisDesign, tune_axis
from palpate.tuning.presses import FEW, Press, Settled, choose, draw_presses, hold_time, run_presses, share_within_reach
from palpate.tuning.specification import Specification, rounded

__all__ = [
    "DRIVE",
    "FRICTION",
    "RANGE",
    "Trial",
    "drive_remedies",
    "friction_remedies",
    "most_reachable",
    "sampling_remedies",
]

DRIVE: Final = "drive limit"
FRICTION: Final = "dry friction"
RANGE: Final = "stiffness range"
LONGEST: Final = 1.0  # s, of a run
HALVINGS: Final = 3
SMALLEST: Final = 1e-3  # of the force that is tried


@dataclass(frozen=True, eq=False)
class Trial:
    """Presses of a controller.

    Attributes:
        specification: its force and stiffness are arguments of `run`.
        controller: knows its own device.
        poses: (n, dof), at which presses begin.
        presses: that are simulated.
        bound: largest bound of the drive, s.
        name: of the real device; None: that of the specification.
    """

    specification: Specification
    controller: WorkspaceController
    poses: Array
    presses: Sequence[Press]
    bound: float
    name: str | None = None

    def run(self, force: float, stiffness: float) -> Settled:
        """Return how the presses settle while the motors can hold the force; none settles if that is too short."""
        s = self.specification
        least = 4.0 * self.bound if np.isfinite(self.bound) else 0.0
        duration = min(LONGEST, max(0.1, 4.0 * s.settle, least), 0.9 * self.hold(force, stiffness))
        if duration < 1.25 * s.settle:
            return Settled(np.full(len(self.presses), np.inf), np.zeros(len(self.presses)))
        name = s.name if self.name is None else self.name
        return run_presses(self.controller, name, self.presses, force, stiffness, duration, s.delay)

    def hold(self, force: float, stiffness: float) -> float:
        """Return the time for which the motors hold a force on a spring at every press, s."""
        device = self.specification.device
        return min(hold_time(device, p.pose, p.direction, force, stiffness) for p in self.presses)

    def settles(self, force: float, stiffness: float) -> bool:
        """Return whether a design for this force and stiffness has presses enough, and all of them settle in time."""
        s = self.specification
        presses = draw_presses(s.device, self.poses, force, stiffness)
        bound = max((press.bound for press in presses), default=np.inf)
        if share_within_reach(presses, self.poses) < FEW or not bound <= s.settle:
            return False
        trial = replace(self, presses=choose(presses), bound=bound)
        return bool(trial.run(force, stiffness).times.max() <= s.settle)


def drive_remedies(trial: Trial, settling: dict[float, float]) -> tuple[str, ...]:
    """Return what to relax if the drive is too weak: settling time, stiffness or force."""
    s = trial.specification
    low, high = s.stiffness
    found = []
    slowest = max(settling.values())
    if np.isfinite(slowest):
        found.append(f'--settle "{rounded(1e3 * slowest, 3, up=True):g} ms"')
    stiffer = _first(_round_numbers(low, high), lambda k: trial.settles(s.force, k))
    if stiffer is not None:
        found.append(f'--stiffness "{stiffer:g} N/m..{high:g} N/m"')
    forces = _round_numbers(SMALLEST * s.force, s.force)[::-1]
    weaker = _first(forces, lambda f: trial.settles(f, low))
    if weaker is not None:
        found.append(f'--force "{weaker:g} N"')
    if stiffer is None and low < high:
        weaker = _first(forces, lambda f: trial.settles(f, high))
        if weaker is not None:
            found.append(f'--force "{weaker:g} N" --stiffness "{high:g} N/m"')
    return tuple(found)


def friction_remedies(trial: Trial, settling: dict[float, float]) -> tuple[str, ...]:
    """Return what to relax if only the softer objects settle in time: settling time or stiffness."""
    s = trial.specification
    low, high = s.stiffness
    slowest = max(settling.values())
    found = [f'--settle "{rounded(1e3 * slowest, 3, up=True):g} ms"'] if np.isfinite(slowest) else []
    softer = _first(_round_numbers(low, high)[::-1], lambda k: trial.settles(s.force, k))
    if softer is not None:
        found.append(f'--stiffness "{low:g} N/m..{softer:g} N/m"')
    return tuple(found)


def sampling_remedies(s: Specification, data: AxisData, axis: AxisDesign, slowest: float) -> tuple[str, ...]:
    """Return what to relax if the axis is too slow: settling time, servo period, encoder or operators.

    Args:
        s: the specification.
        data: of the device.
        axis: the design that is too slow.
        slowest: simulated settling time, s.
    """
    found = [f'--settle "{rounded(1e3 * slowest, 3, up=True):g} ms"'] if np.isfinite(slowest) else []

    def enough(period: float, changed: AxisData) -> bool:
        tuned = tune_axis(period, s.delay, changed)
        return tuned is not None and tuned.settling <= s.settle

    if axis.limit == OPERATOR:
        return (*found, "no operator at the tip") if enough(s.period, replace(data, operators=())) else tuple(found)
    for part in (2.0 ** np.arange(1, HALVINGS + 1)).tolist():
        counts = f"an encoder with {part:g} times the counts"
        period = f'--period "{1e3 * s.period / part:g} ms"'
        finer = replace(data, count=data.count / part)
        if axis.limit != ENCODER and enough(s.period / part, data):
            return *found, period
        if axis.limit == ENCODER and enough(s.period, finer):
            return *found, counts
        if enough(s.period / part, finer):
            return *found, f"{counts} and {period}"
    return tuple(found)


def most_reachable(s: Specification, poses: Array) -> tuple[str, tuple[str, ...]]:
    """Return the reason and the remedies if ways on the softest object leave the reach."""
    low, high = s.stiffness

    def reached(stiffness: float) -> bool:
        return share_within_reach(draw_presses(s.device, poses, s.force, stiffness), poses) >= FEW

    least = _first(_round_numbers(low, max(high, 1e3 * low)), reached)
    reason = (
        f"{s.force:g} N on {low:g} N/m deflect it by {1e3 * s.force / low:.3g} mm, and of the ways of this length from "
        f"{len(poses)} poses hardly one stays within reach and well conditioned."
    )
    if least is None:
        return reason, ()
    if least > high:
        return reason, (f'--force "{rounded(s.force * low / least, 2, up=False):g} N"',)
    return reason, (
        f'--stiffness "{least:g} N/m..{high:g} N/m"',
        f'--force "{rounded(s.force * low / least, 2, up=False):g} N"',
    )


def _round_numbers(low: float, high: float) -> list[float]:
    """Return the numbers with two significant digits from low to high, and both ends."""
    inside = {rounded(float(x), 2, up=True) for x in np.geomspace(low, high, 400)}
    return sorted({low, high} | {x for x in inside if low < x < high})


def _first(values: Sequence[float], meets: Callable[[float], bool]) -> float | None:
    """Return the first value that meets a condition, by bisection: later ones meet it too; None: no value does."""
    if not meets(values[-1]):
        return None
    low, high = -1, len(values) - 1
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (low, middle) if meets(values[middle]) else (middle, high)
    return values[high]
