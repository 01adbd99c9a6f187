"""Loop of device, controller and operator around the response of a body at one contact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import control
import numpy as np
import scipy.linalg

from palpate.arrays import Array, Complex
from palpate.control.feedback_loop import series

__all__ = ["BodyLoop", "stiffness_margin", "unstable_poles", "worst_gain"]

_OUTSIDE = 1e-6  # distance of the Nyquist contour from the unit circle
_TURN = 0.3  # phase, rad, between two points of the contour
_HALVINGS = 24
_STRIDE, _LARGEST = 1.04, 1e4  # of the search for a margin
_SAME = 0.1  # of the distance from 1 of an eigenvalue and a zero of one motion
_ON_AXIS = 1e-9  # imaginary part of a real zero


@dataclass(frozen=True)
class BodyLoop:
    """Sampled loop around a body, about one contact.

    Attributes:
        path: from the force on the body, as the controller sees it (r, N), to the tip (r, m).
        body: from the tip (r, m) to the force on the body (r, N).
        markov: impulse response of the body as measured (n, r, r), N/m.
        axes: of the contact, in the directions of `path` (r, r), orthonormal, in columns; the first is the normal for
            r = 1 and r = 3.
        normal: of the contact, in the directions of `path` (r,).
        error: bound of the gain of what `body` leaves out, by entry in `axes` (r, r), N/m.
    """

    path: control.StateSpace
    body: control.StateSpace
    markov: Array
    axes: Array
    normal: Array
    error: Array

    @property
    def period(self) -> float:
        """T, s."""
        return float(self.path.dt)

    def along_normal(self, path: control.StateSpace) -> BodyLoop:
        """Return the loop along the normal only, around another path (1 x 1)."""
        b, n = self.body, self.normal[:, None]
        body = control.StateSpace(b.A, b.B @ n, n.T @ b.C, n.T @ b.D @ n, b.dt)
        return BodyLoop(path, body, n.T @ self.markov @ n, np.eye(1), np.ones(1), self.error[:1, :1])

    def gain(self) -> control.StateSpace:
        """Return L(z) (r x r), negative feedback understood, broken at the force of the body."""
        b = self.body
        return series(self.path, control.StateSpace(b.A, b.B, -b.C, -b.D, b.dt))

    def matrix(self, scale: float = 1.0, damping: float = 0.0) -> Array:
        """Return the closed loop's matrix with the force of the body times ``scale``.

        Args:
            scale: factor on the force.
            damping: of a damper beside the body, along the normal, by backward difference, N s/m.
        """
        p, b, n = self.path, self.body, self.normal[:, None]
        rate = damping / self.period
        plant = p.A + p.B @ (scale * b.D + rate * (n @ n.T)) @ p.C
        felt, last = scale * p.B @ b.C, -rate * p.B @ n
        size = b.nstates
        return np.block(
            [
                [plant, felt, last],
                [b.B @ p.C, b.A, np.zeros((size, 1))],
                [n.T @ p.C, np.zeros((1, size + 1))],
            ]
        )[: None if damping else -1, : None if damping else -1]

    def root(self, scale: float = 1.0, damping: float = 0.0) -> complex:
        """Return the eigenvalue of the closed loop with the largest modulus; arguments as `matrix`."""
        values = np.linalg.eigvals(self.matrix(scale, damping))
        return complex(values[int(np.argmax(np.abs(values)))])

    def radius(self, scale: float = 1.0) -> float:
        """Return the largest modulus of the closed loop's eigenvalues with the force of the body times ``scale``."""
        return abs(self.root(scale))

    def radius_along_normal(self, scale: float = 1.0) -> float:
        """Return `radius` of a loop tested along the normal, without motions of the device across the contact.

        Those are the zeros of `path`: the tip does not move along the normal, so no force of the body acts on them. A
        real one outside the unit circle is a tip that nothing holds. An eigenvalue of the loop within a tenth of its
        distance from 1 is that motion.
        """
        values = np.linalg.eigvals(self.matrix(scale))
        for zero in self._slides:
            nearest = int(np.argmin(np.abs(values - zero)))
            if abs(values[nearest] - zero) < _SAME * (zero - 1.0):
                values = np.delete(values, nearest)
        return float(np.abs(values).max(initial=0.0))

    @cached_property
    def _slides(self) -> Array:
        """Return the real zeros of `path` above 1."""
        p, r = self.path, len(self.normal)
        pencil = np.block([[p.A, p.B], [p.C, p.D]])
        zeros = scipy.linalg.eigvals(pencil, scipy.linalg.block_diag(np.eye(p.nstates), np.zeros((r, r))))
        zeros = zeros[np.isfinite(zeros)]
        return np.asarray(zeros.real[(np.abs(zeros.imag) < _ON_AXIS) & (zeros.real > 1.0)], dtype=float)

    def doubt(self) -> float:
        """Return the largest spectral radius of E |T|, T from a force on the body to the tip and E the error, by entry.

        Below 1 the error changes no verdict (small gain): no closed-loop pole can cross the unit circle.
        """
        matrix = self.matrix()
        n = self.path.nstates
        entry = np.vstack([self.path.B, np.zeros((len(matrix) - n, self.path.ninputs))])
        theta = _grid(np.asarray(np.linalg.eigvals(matrix), dtype=complex))
        z = np.exp(1j * theta)[:, None, None]
        answers = np.linalg.solve(z * np.eye(len(matrix)) - matrix, entry.astype(complex))
        return worst_gain(self.axes.T @ (self.path.C @ answers[:, :n]) @ self.axes, self.error)


def worst_gain(gains: Complex, error: Array) -> float:
    """Return the largest spectral radius of E |T| over some responses T (k, r, r), m/N, with E (r, r), N/m."""
    return float(np.abs(np.linalg.eigvals(error @ np.abs(gains))).max())


def stiffness_margin(radius: Callable[[float], float]) -> float:
    """Return the factor on the force of a body at which a stable loop becomes unstable; inf: none up to 10,000.

    Args:
        radius: spectral radius of the loop for a factor.
    """
    low, high = 1.0, _STRIDE
    while radius(high) < 1.0:
        low, high = high, high * _STRIDE
        if high > _LARGEST:
            return float("inf")
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if radius(middle) < 1.0 else (low, middle)
    return low


def unstable_poles(loop: BodyLoop) -> int:
    """Return the number of unstable closed-loop poles by Nyquist's criterion on the measured impulse response.

    The contour is the circle of radius 1 + 1e-6. It is refined until the determinant turns by less than 0.3 rad from
    point to point.
    """
    poles = np.linalg.eigvals(loop.path.A)
    theta = _grid(np.concatenate([np.linalg.eigvals(loop.matrix()), poles]))
    values = _determinant(loop, theta)
    for _ in range(_HALVINGS):
        turns = np.abs(np.angle(values[1:] / values[:-1]))
        wide = np.flatnonzero(turns > _TURN)
        if wide.size == 0:
            break
        middle = 0.5 * (theta[wide] + theta[wide + 1])
        theta, values = np.insert(theta, wide + 1, middle), np.insert(values, wide + 1, _determinant(loop, middle))
    winding = float(np.angle(values[1:] / values[:-1]).sum()) / np.pi  # of the half circle, twice
    return int(np.sum(np.abs(poles) > 1.0 + _OUTSIDE)) - round(winding)


def _determinant(loop: BodyLoop, theta: Array) -> Complex:
    """Return det(I - H(z) P(z)), (k,), on the contour, H by the sum of the measured response."""
    z = (1.0 + _OUTSIDE) * np.exp(1j * theta)
    path, r = loop.path, len(loop.normal)
    right = np.broadcast_to(path.B.astype(complex), (len(z), *path.B.shape))
    forward = path.C @ np.linalg.solve(z[:, None, None] * np.eye(path.nstates) - path.A, right)
    powers = z[:, None] ** -np.arange(len(loop.markov))
    felt = (powers @ loop.markov.reshape(len(loop.markov), -1)).reshape(-1, r, r)
    return np.asarray(np.linalg.det(np.eye(r) - felt @ forward), dtype=complex)


def _grid(poles: Complex) -> Array:
    """Return angles from 0 to pi, dense about some poles."""
    parts = [np.array([0.0]), np.geomspace(1e-6, np.pi, 200), np.linspace(0.01, np.pi, 200)]
    for z in poles:
        if abs(z) > 0.0:
            parts.append(abs(np.angle(z)) + max(abs(np.log(abs(z))), 1e-7) * np.linspace(-6, 6, 25))
    theta = np.unique(np.concatenate(parts))
    return np.asarray(theta[(theta >= 0.0) & (theta <= np.pi)], dtype=float)
