"""Watching the energy a display gives, and damping it when it gives more than it got (Hannaford & Ryu 2002).

A force held over a period does exactly F_k (x_{k+1} - x_k) of work. The usual F_k (x_k - x_{k-1}) pairs the force with
the way before it: its sign can be wrong, and an observer built on it never acts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.checks import not_negative, positive
from palpate.errors import StabilityError
from palpate.simulation.user_object import as_object

__all__ = ["EnergyObserver", "PassivityController", "naive_energy", "zoh_energy"]

Array = NDArray[np.float64]


def zoh_energy(force: ArrayLike, position: ArrayLike) -> float:
    """Return the work (J) of forces held from sample to sample on the tip: the sum of F_k (x_{k+1} - x_k), exact.

    Args:
        force: of the display on the tip, N, (n,) or (n, axes); the last one acts after the record and does not count.
        position: of the tip at the samples, m, the same shape.

    Raises:
        StabilityError: the shapes differ, or hold fewer than two samples.
    """
    f, x = _pair(force, position)
    return float(np.sum(f[:-1] * np.diff(x, axis=0)))


def naive_energy(force: ArrayLike, position: ArrayLike) -> float:
    """Return the sum of F_k (x_k - x_{k-1}), J: what a careless observer adds up, for comparison only."""
    f, x = _pair(force, position)
    return float(np.sum(f[1:] * np.diff(x, axis=0)))


def _pair(force: ArrayLike, position: ArrayLike) -> tuple[Array, Array]:
    f, x = np.asarray(force, dtype=float), np.asarray(position, dtype=float)
    if f.shape != x.shape or len(f) < 2:
        raise StabilityError(
            f"force and position must have one shape and two samples or more, not {f.shape}, {x.shape}"
        )
    return f, x


@dataclass
class EnergyObserver:
    """The work that held forces have done on the tip so far, known exactly at each sample.

    Attributes:
        given: energy given to the tip, J; negative while the display has taken more than it gave.
    """

    given: float = 0.0
    _force: float = 0.0
    _position: float | None = None

    def update(self, position: float) -> float:
        """Take the tip's position (m) at a sample, and return the energy (J) given up to it."""
        if self._position is not None:
            self.given += self._force * (position - self._position)
        self._position = position
        return self.given

    def set_force(self, force: float) -> None:
        """Take the force (N) on the tip that is held from the sample on."""
        self._force = force


class PassivityController:
    """Adds damping, never more than the cap, when the display has given energy that it never got.

    With an `object` it stands between the tip and that object in a simulated loop, and acts along `normal`:
    `palpate.simulate(scenario, object=PassivityController(..., object=wall))`.

    Args:
        period: T, s.
        largest_damping: cap of the injected damping, N s/m. Sampled damping above the device's limits destabilizes by
            itself: keep it at half of mass/period or less.
        credit: energy, J, that the display may give before it is damped.
        object: as for `palpate.simulate`; needed in a loop only.
        normal: direction along which the energy is observed (3,); its length does not matter.

    Raises:
        StabilityError: a period that is not positive, a negative cap or credit, a normal of no length.
    """

    def __init__(
        self,
        period: float,
        largest_damping: float,
        credit: float = 0.0,
        *,
        object: Any = None,
        normal: ArrayLike = (1.0, 0.0, 0.0),
    ) -> None:
        self.period = positive(period, "period", "s")
        self.largest = not_negative(largest_damping, "largest_damping", "N s/m")
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
        """Return the force (N) on the tip at a sample: the wall's force ``wall`` (N), damped if energy is owed."""
        given = self.observer.update(position)
        velocity = 0.0 if self._position is None else (position - self._position) / self.period
        self._position = position
        owed = given - self.credit
        damping = 0.0
        if owed > 0.0 and velocity != 0.0:
            damping = min(self.largest, owed / (self.period * velocity**2))
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
