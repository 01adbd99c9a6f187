"""Frequency responses of sampled systems from their modes, for stacks of systems and many angles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array, Complex

__all__ = ["ModalResponse"]


class ModalResponse:
    """Response C (z - A)^-1 B + D of a sampled system, or of a stack of systems, evaluated from its modes.

    Attributes:
        values: eigenvalues of A, (..., n).
        complete: (...), whether the eigenvectors are independent; else the modes do not represent the system.
    """

    def __init__(self, a: Array, b: Array, c: Array, d: Array | None = None) -> None:
        if a.shape[-1]:
            self.values, vectors = (np.asarray(m, dtype=complex) for m in np.linalg.eig(a))
            self.complete = np.linalg.cond(vectors) < 1e9
            projection = np.linalg.solve(np.where(self.complete[..., None, None], vectors, np.eye(a.shape[-1])), b)
            residues = np.swapaxes(c @ vectors, -1, -2)[..., :, :, None] * projection[..., :, None, :]
        else:
            self.values, self.complete = np.zeros(a.shape[:-1], dtype=complex), np.array(True)
            residues = np.zeros((*a.shape[:-1], c.shape[-2], b.shape[-1]), dtype=complex)
        self.shape = residues.shape[-2:]
        self.residues = residues.reshape(*residues.shape[:-2], b.shape[-1] * c.shape[-2])
        self.direct = 0.0 if d is None else d

    def grid(self, z: Complex) -> Complex:
        """Return the response (..., k, outputs, inputs) of every system at each z (k,)."""
        poles = 1 / (z[:, None] - self.values[..., None, :])
        flat = poles @ self.residues
        return np.asarray(flat.reshape(*flat.shape[:-1], *self.shape) + self.direct, dtype=complex)

    def pairs(self, z: Complex, index: NDArray[np.int64]) -> Complex:
        """Return the response (k, outputs, inputs) of system index[i] of the stack at z[i]."""
        poles = 1 / (z[:, None] - self.values[index])
        flat = (poles[:, None, :] @ self.residues[index])[:, 0, :]
        return np.asarray(flat.reshape(len(z), *self.shape) + self.direct, dtype=complex)
