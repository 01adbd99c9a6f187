"""Passivity observer and passivity controller for a sampled display (Hannaford & Ryu 2002)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.checks import not_negative, positive
from palpate.errors import StabilityError
from palpate.simulation.user_object import as_object

__all__ = ["EnergyObserver", "PassivityController"]


@dataclass
class EnergyObserver:
    """Exact work of sampled and held forces on the tip.

    Attributes:
        energy: energy delivered to the tip, J; negative while the display has absorbed more than it delivered.
    """

    energy: float = 0.0
    _force: float = 0.0
    _position: float | None = None

    def update(self, position: float) -> float:
        """Add the work up to a sample with the tip at ``position`` (m) and return the energy (J)."""
        if self._position is not None:
            self.energy += self._force * (position - self._position)
        self._position = position
        return self.energy

    def set_force(self, force: float) -> None:
        """Set the force (N) on the tip that is held from this sample on."""
        self._force = force


class PassivityController:
    """Passivity controller: injects limited damping while the display has delivered more energy than it absorbed.

    With an `object` it stands between the tip and that object in a simulated loop, and acts along `normal`:
    `palpate.simulate(scenario, object=PassivityController(..., object=wall))`.

    Args:
        period: T, s.
        max_damping: upper limit of the injected damping, N s/m. Sampled damping is itself destabilizing above about
            half of mass/period.
        credit: energy, J, that the display may deliver before damping is injected.
        object: as for `palpate.simulate`; needed in a loop only.
        normal: direction along which the energy is observed (3,); its length does not matter.

    Raises:
        StabilityError: a period that is not positive, a negative cap or credit, a normal of no length.
    """

    def __init__(
        self,
        period: float | str,
        max_damping: float | str,
        credit: float | str = 0.0,
        *,
        object: Any = None,
        normal: ArrayLike = (1.0, 0.0, 0.0),
    ) -> None:
        self.period = positive(period, "period", "s")
        self.max_damping = not_negative(max_damping, "max_damping", "N*s/m")
        self.credit = not_negative(credit, "credit", "J")
        self.object = None if object is None else as_object(object)
        direction = np.asarray(normal, dtype=float)
        length = float(np.linalg.norm(direction))
        if direction.shape != (3,) or not 0.0 < length < np.inf:
            raise StabilityError(f"normal must be three finite numbers that are not all zero, not {normal!r}")
        self.normal = direction / length
        self.reset()

    def reset(self) -> None:
        """Forget the energy and the motion so far; reset the object behind."""
        self.observer = EnergyObserver()
        self._position: float | None = None
        if self.object is not None:
            self.object.restart()

    def force(self, position: float, wall: float) -> float:
        """Return the force (N) on the tip: ``wall`` (N) with injected damping if the energy exceeds the credit."""
        energy = self.observer.update(position)
        velocity = 0.0 if self._position is None else (position - self._position) / self.period
        self._position = position
        excess = energy - self.credit
        damping = 0.0
        if excess > 0.0 and velocity != 0.0:
            damping = min(self.max_damping, excess / (self.period * velocity**2))
        command = wall - damping * velocity
        self.observer.set_force(command)
        return command

    def step(self, tip: Any) -> Array:
        """Return the force of the tip on the object (3,), N, at a sample of a simulated loop.

        Raises:
            StabilityError: there is no object behind.
        """
        if self.object is None:
            raise StabilityError("a PassivityController in a loop needs the object behind it: give object=...")
        answer = self.object.step(tip)
        contact = np.asarray(getattr(answer, "force", answer), dtype=float)
        wall = -float(contact @ self.normal)  # on the tip
        return contact - (self.force(float(tip.position @ self.normal), wall) - wall) * self.normal
