"""Stationary Kalman filter of a sampled plant in current form, which includes the newest measurement."""

from __future__ import annotations

from dataclasses import dataclass

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_discrete_are

from palpate.arrays import Array, Complex
from palpate.errors import DesignError
from palpate.units import array_to_si


@dataclass(frozen=True)
class KalmanFilter:
    """x_hat(k|k) = x_hat(k|k-1) + gain (y - C x_hat(k|k-1) - D u);  x_hat(k+1|k) = A x_hat(k|k) + B u.

    Attributes:
        gain: (n, p), state units per N.
        covariance: covariance of the prediction error, (n, n).
        poles: eigenvalues of A (I - gain C), per sample.
    """

    gain: Array
    covariance: Array
    poles: Complex


def kalman(plant: control.StateSpace, disturbance: ArrayLike, noise: ArrayLike) -> KalmanFilter:
    """Return the stationary filter for white force disturbances at the input and white noise on the output.

    Args:
        plant: sampled, n states, m inputs, p outputs.
        disturbance: standard deviation per sample of a force added to each input, one value or (m,), N; or the
            covariance of the state's process noise itself, (n, n).
        noise: standard deviation per sample of each output's noise, one value or (p,), N; positive.

    Raises:
        DesignError: the noise is not positive, the plant is not detectable, or an undisturbed mode is on the unit
            circle, so that no stationary filter exists.
    """
    a, b, c = plant.A, plant.B, plant.C
    n = len(a)
    v = np.broadcast_to(array_to_si(noise, "N", "kalman: noise", error=DesignError), (c.shape[0],))
    if not np.all(np.isfinite(v)) or np.any(v <= 0):
        raise DesignError(f"kalman: measurement noise must be positive and finite in N, not {v.tolist()}")
    w = array_to_si(disturbance, "N", "kalman: disturbance", error=DesignError)
    if not np.all(np.isfinite(w)):
        raise DesignError("kalman: the disturbance must be finite")
    q = w if w.ndim == 2 else b @ np.diag(np.broadcast_to(w, (b.shape[1],)) ** 2) @ b.T
    if q.shape != (n, n):
        raise DesignError(f"kalman: a process covariance must be {n} x {n}, not {q.shape[0]} x {q.shape[1]}")
    _require(a, c, "kalman: the plant is not detectable", "no output sees")
    try:
        p = solve_discrete_are(a.T, c.T, q, np.diag(v**2))
    except (np.linalg.LinAlgError, ValueError) as error:
        raise DesignError(
            "kalman: no stationary filter: a mode on the unit circle is never disturbed; give a process covariance "
            "that excites it"
        ) from error
    gain = p @ c.T @ np.linalg.inv(c @ p @ c.T + np.diag(v**2))
    poles = np.linalg.eigvals(a @ (np.eye(n) - gain @ c))
    if n and np.abs(poles).max() >= 1.0 - 1e-12:
        raise DesignError("kalman: no stable stationary filter; the disturbance must excite every undamped mode")
    return KalmanFilter(np.asarray(gain), np.asarray(p), np.asarray(poles, dtype=complex))


def require_stabilizable(a: Array, b: Array, message: str) -> None:
    """Raise DesignError unless every eigenvalue of ``a`` on or outside the unit circle is controllable."""
    _require(a.T, b.T, message, "no input reaches")


def _require(a: Array, c: Array, message: str, verb: str) -> None:
    """Raise DesignError unless the modes that do not decay pass the Popov-Belevitch-Hautus test, rows scaled to 1."""
    n = len(a)
    size = np.linalg.norm(c, axis=1, keepdims=True)
    rows = c / np.where(size > 0, size, 1.0)
    for z in np.linalg.eigvals(a):
        if abs(z) < 1.0 - 1e-9:
            continue
        smallest = np.linalg.svd(np.vstack([z * np.eye(n) - a, rows]), compute_uv=False)[-1]
        if smallest < 1e-9:
            raise DesignError(f"{message}: {verb} the mode at z = {complex(z):.6g}, which does not decay by itself")
