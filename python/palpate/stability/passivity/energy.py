"""Work of sampled and held forces on the tip.

A force held over a period does exactly F_k (x_{k+1} - x_k) of work. The usual F_k (x_k - x_{k-1}) pairs the force with
the displacement before it. Its sign can be wrong, so an observer based on it may never act.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.errors import StabilityError

__all__ = ["EnergyObserver", "naive_energy", "zoh_energy"]


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


def zoh_energy(force: ArrayLike, position: ArrayLike) -> float:
    """Return the exact work (J) of sampled and held forces on the tip, the sum of F_k (x_{k+1} - x_k).

    Args:
        force: force of the display on the tip, N, (n,) or (n, axes); the last one acts after the record and is ignored.
        position: position of the tip at the samples, m, the same shape.

    Raises:
        StabilityError: the shapes differ, or there are fewer than two samples.
    """
    f, x = _pair(force, position)
    return float(np.sum(f[:-1] * np.diff(x, axis=0)))


def naive_energy(force: ArrayLike, position: ArrayLike) -> float:
    """Return the sum of F_k (x_k - x_{k-1}), J: the usual but inexact estimate, for comparison only."""
    f, x = _pair(force, position)
    return float(np.sum(f[1:] * np.diff(x, axis=0)))


def _pair(force: ArrayLike, position: ArrayLike) -> tuple[Array, Array]:
    f, x = np.asarray(force, dtype=float), np.asarray(position, dtype=float)
    if f.shape != x.shape or len(f) < 2:
        raise StabilityError(
            f"force and position must have one shape and two samples or more, not {f.shape}, {x.shape}"
        )
    return f, x
