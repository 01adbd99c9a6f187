"""Loop around a body whose model is updated at a slow rate (`MultirateResponse`).

The loop is periodic. Its stability is that of the map over one update, the monodromy matrix.
"""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np

from palpate.arrays import Array
from palpate.stability.body.body_loop import worst_gain

__all__ = ["MultirateLoop"]


@dataclass(frozen=True)
class MultirateLoop:
    """Loop around a body that is updated at a slow rate, about one contact.

    Attributes:
        path: from the force on the body, as the controller sees it (r, N), to the tip (r, m).
        local: K (r, r), N/m; correction: g (n, r, r), N/m; every: m, ticks.
        axes: of the contact, in the directions of `path` (r, r), orthonormal, in columns; the first is the normal for
            r = 1 and r = 3.
        normal: of the contact, in the directions of `path` (r,).
        error: bound of the gain of what the response leaves out, by entry in `axes` (r, r), N/m.
    """

    path: control.StateSpace
    local: Array
    correction: Array
    every: int
    axes: Array
    normal: Array
    error: Array

    @property
    def period(self) -> float:
        """T, s."""
        return float(self.path.dt)

    def along_normal(self, path: control.StateSpace) -> MultirateLoop:
        """Return the loop along the normal only, around another path (1 x 1)."""
        n = self.normal[:, None]
        local, correction = n.T @ self.local @ n, n.T @ self.correction @ n
        return MultirateLoop(path, local, correction, self.every, np.eye(1), np.ones(1), self.error[:1, :1])

    def matrix(self, scale: float = 1.0, damping: float = 0.0) -> Array:
        """Return the monodromy matrix, over one update, with the force of the body times ``scale``.

        The states are those of `path`, the tip at the last updates, newest first, and with a damper the last tip.

        Args:
            scale: factor on the force.
            damping: of a damper beside the body, along the normal, by backward difference, N s/m.
        """
        p, r, m, normal = self.path, len(self.normal), self.every, self.normal
        n, kept, more = p.nstates, len(self.correction) // m * r, 1 if damping else 0
        size = n + kept + more
        state, samples, last = np.eye(n, size), np.eye(kept, size, n), np.eye(1, size, n + kept)
        for tick in range(m):
            tip = p.C @ state
            if tick == 0:
                samples = np.vstack([tip, samples[:-r]])
            felt = self.correction[tick::m].transpose(1, 0, 2).reshape(r, kept)
            force = scale * (self.local @ tip + felt @ samples)
            if damping:
                force = force + damping / self.period * np.outer(normal, normal @ tip - last[0])
                last = (normal @ tip)[None]
            state = p.A @ state + p.B @ force
        return np.asarray(np.vstack([state, samples, last[:more]]), dtype=float)

    def root(self, scale: float = 1.0, damping: float = 0.0) -> complex:
        """Return the loop's largest Floquet multiplier, per tick; arguments as `matrix`."""
        values = np.linalg.eigvals(self.matrix(scale, damping))
        return complex(values[int(np.argmax(np.abs(values)))] ** (1.0 / self.every))

    def radius(self, scale: float = 1.0) -> float:
        """Return the largest modulus of the loop's Floquet multipliers, per tick."""
        return abs(self.root(scale))

    def doubt(self) -> float:
        """Return the largest spectral radius of E |T|, T from a force on the body to the tip and E the error, by entry.

        T is that of the loop around the local model alone. Below 1 the error changes no verdict.
        """
        p = self.path
        matrix = p.A + p.B @ self.local @ p.C
        theta = np.concatenate([np.geomspace(1e-5, np.pi, 400), np.abs(np.angle(np.linalg.eigvals(matrix)))])
        z = np.exp(1j * theta)[:, None, None]
        answers = p.C @ np.linalg.solve(
            z * np.eye(len(matrix)) - matrix, np.broadcast_to(p.B, (len(theta), *p.B.shape))
        )
        return worst_gain(self.axes.T @ answers @ self.axes, self.error)
