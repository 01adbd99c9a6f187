"""Critical and passive stiffness of a wall for a device with one axis."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from palpate.checks import finite, positive
from palpate.linear.linear_device import HumanArm, LinearDevice
from palpate.linear.wall import wall_loop
from palpate.stability.maps.wall_interval import stability_interval
from palpate.stability.passivity import passive_stiffness

__all__ = ["WallVerdict", "wall_limit"]


@dataclass(frozen=True)
class WallVerdict:
    """Limits of the stiffness of a wall for a mass with damping.

    Attributes:
        critical_stiffness: exact, N/m; 0 if no wall is stable.
        frequency: frequency of the oscillation at the critical stiffness, Hz.
        passive_stiffness: largest passive stiffness, N/m; a passive wall is stable with every passive operator.
        period: s; delay: samples; virtual_damping: N s/m; velocity_filter: alpha.
        device: device and operator in words.
    """

    critical_stiffness: float
    frequency: float
    passive_stiffness: float
    period: float
    delay: float
    virtual_damping: float
    velocity_filter: float
    device: str

    def __str__(self) -> str:
        late = "no delay" if self.delay == 0 else f"{self.delay:g} sample{'' if self.delay == 1 else 's'} of delay"
        loop = f"at {1 / self.period:g} Hz, {late}, with {self.virtual_damping:g} N s/m of virtual damping"
        if self.critical_stiffness == 0.0:
            return f"No wall is stable with {self.device}, {loop}."
        if self.critical_stiffness == float("inf"):
            stable = f"Every wall is stable with {self.device}, {loop}."
        else:
            stable = (
                f"Walls up to {self.critical_stiffness:.5g} N/m are stable with {self.device}, {loop}; beyond, it "
                f"oscillates at {self.frequency:.4g} Hz."
            )
        if self.passive_stiffness > 0:
            return f"{stable} Up to {self.passive_stiffness:.5g} N/m it is passive: stable with every passive operator."
        return f"{stable} No wall is passive: each is unstable with some passive operator."

    def to_dict(self) -> dict[str, Any]:
        """Return the verdict as plain numbers and text."""
        return {**asdict(self), "sentence": str(self)}


def wall_limit(
    *,
    mass: float | str,
    damping: float | str = 0.0,
    period: float | str,
    delay: float = 0.0,
    virtual_damping: float | str = 0.0,
    velocity_filter: float = 0.0,
    arm: HumanArm | None = None,
) -> WallVerdict:
    """Return the exact critical and passive stiffness of a wall for a device with one axis.

    Args:
        mass: kg, apparent at the tip.
        damping: b, N s/m, physical.
        period: servo period T, s.
        delay: between sample and force, in samples, may be fractional.
        virtual_damping: B of the wall, N s/m, by backward difference.
        velocity_filter: alpha of v <- alpha v + (1 - alpha) dx/T.
        arm: the operator; None: no operator.

    Raises:
        StabilityError: a mass or period that is not positive, a negative damping or delay, alpha outside [0, 1).
    """
    period, virtual_damping = positive(period, "period", "s"), finite(virtual_damping, "virtual_damping", "N*s/m")
    tip = LinearDevice.of_mass(mass, damping, arm)
    limit = stability_interval(wall_loop(tip, period, delay, velocity_filter), virtual_damping)
    passive = passive_stiffness(
        damping=damping,
        period=period,
        virtual_damping=virtual_damping,
        delay=delay,
        velocity_filter=velocity_filter,
    )
    return WallVerdict(
        limit.stiffness,
        limit.frequency,
        float(passive),
        period,
        delay,
        virtual_damping,
        velocity_filter,
        tip.name,
    )
