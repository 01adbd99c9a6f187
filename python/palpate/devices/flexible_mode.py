"""Lowest flexible mode of a device, between the motors with their encoders and the tip."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["FlexibleMode"]


@dataclass(frozen=True)
class FlexibleMode:
    """Lowest flexible mode: the same in every direction of the tip, with motors and tip free.

    A share of the inertia moves with the tip, behind a spring and a damper; the rest moves with motors and encoders.

    Attributes:
        frequency: Hz.
        tip_share: of the inertia on the tip's side, above 0 and below 1.
        damping_ratio: at least 0 and below 1.
    """

    frequency: float
    tip_share: float
    damping_ratio: float

    @property
    def stiffness(self) -> float:
        """Stiffness of the spring over the whole inertia, 1/s^2."""
        return (2.0 * math.pi * self.frequency) ** 2 * self._reduced

    @property
    def damping(self) -> float:
        """Damping of the damper over the whole inertia, 1/s."""
        return 2.0 * self.damping_ratio * 2.0 * math.pi * self.frequency * self._reduced

    @property
    def _reduced(self) -> float:
        """Reduced mass over the whole mass."""
        return self.tip_share * (1.0 - self.tip_share)

    def __str__(self) -> str:
        return (
            f"lowest mode of {self.frequency:.4g} Hz, {self.tip_share:.3g} of the mass at the tip, damping ratio "
            f"{self.damping_ratio:.3g}"
        )
