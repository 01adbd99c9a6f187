"""Linear law of a contact: from small motions of the tip to the force on the object, sampled."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from palpate.arrays import Array

__all__ = ["ContactLaw", "closed_matrix"]


@dataclass(frozen=True, eq=False)
class ContactLaw:
    """Sampled law from the tip's motion x (3,), m, to the force on the object f (3,), N.

    xi <- A xi + B x,  f = C xi + D x.
    """

    A: Array
    B: Array
    C: Array
    D: Array

    @classmethod
    def stiffness(cls, matrix: Array) -> ContactLaw:
        """Return the law of a stiffness matrix (3, 3), N/m."""
        return cls(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), np.asarray(matrix, dtype=float))

    def scaled(self, ratio: float, normal: Array | None = None) -> ContactLaw:
        """Return the law with its force, or only the part along ``normal`` (3,), multiplied by ``ratio``."""
        eye = np.eye(3)
        scale = ratio * eye if normal is None else eye + (ratio - 1.0) * np.outer(normal, normal)
        return replace(self, C=scale @ self.C, D=scale @ self.D)

    def damped(self, damping: float, normal: Array, period: float) -> ContactLaw:
        """Return the law with a damper along the normal, N s/m, by backward difference."""
        if damping == 0.0:
            return self
        m, rate = len(self.A), damping / period
        a = np.zeros((m + 1, m + 1))
        a[:m, :m] = self.A
        return ContactLaw(
            a,
            np.vstack([self.B, normal[None]]),
            np.hstack([self.C, -rate * normal[:, None]]),
            self.D + rate * np.outer(normal, normal),
        )


def closed_matrix(path: Any, law: ContactLaw, directions: Array, scale: float = 1.0) -> Array:
    """Return the matrix of the loop of a tip's ``path`` (force to motion, r x r) and a contact law times ``scale``.

    Args:
        path: strictly proper (A, B, C), as in ``ScenarioLoop.path``.
        law: the law.
        directions: (3, r), orthonormal, along which the tip moves.
        scale: factor on the force.
    """
    bl, cl = law.B @ directions, scale * directions.T @ law.C
    dl = scale * directions.T @ law.D @ directions
    return np.block([[path.A + path.B @ dl @ path.C, path.B @ cl], [bl @ path.C, law.A]])
