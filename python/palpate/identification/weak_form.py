"""Weak form of the dynamics with smooth test functions, which avoids second derivatives of the angles.

With a test function φ that vanishes at both ends of its support, integration by parts of the momentum M qd gives

    ∫ φ τ dt = - ∫ φ' M qd dt - ∫ φ C^T qd dt + ∫ φ N dt + friction       (d/dt(M qd) = M qdd + (C + C^T) qd)

The torque, held between samples, is integrated exactly. Speeds come from local polynomials over a few samples; at
the bandwidth of the test functions their error is four orders of magnitude below the signal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import signal

from palpate.arrays import Array
from palpate.devices import Device
from palpate.errors import RecordingError
from palpate.identification.base import fictitious
from palpate.identification.recording import Recording


@dataclass(frozen=True)
class TestFunctions:
    """Test functions cos^4(pi t / width), |t| < width / 2, one every `spacing`; both in s.

    Their Fourier transform falls to one half at about 1.1 / width Hz.
    """

    __test__ = False  # not a pytest class

    width: float = 0.1
    spacing: float = 0.025
    smoothing: float = 0.025  # s, window of the local polynomials

    def kernels(self, period: float) -> tuple[Array, Array, Array, int]:
        """Return φ and φ' at the samples, the integral of φ over each hold, and the stride in samples."""
        half = round(0.5 * self.width / period)
        if half < 4:
            raise RecordingError(
                f"samples every {period:g} s are too slow for test functions {self.width:g} s wide; "
                f"sample at {self.width / 8:g} s or less"
            )
        angle = np.pi * np.arange(-half, half + 1) / (2 * half)
        phi = np.cos(angle) ** 4
        slope = -4 * np.cos(angle) ** 3 * np.sin(angle) * np.pi / (2 * half * period)
        integral = (3 * angle / 8 + np.sin(2 * angle) / 4 + np.sin(4 * angle) / 32) * (2 * half * period) / np.pi
        return phi, slope, np.append(np.diff(integral), 0.0), max(1, round(self.spacing / period))


@dataclass(frozen=True)
class WeakRows:
    """torque[r, i] = sum over j of columns[r, i, j] * value_j, row r for one test function, joint i.

    Attributes:
        torque: (rows, dof) N*m*s.
        columns: (rows, dof, parameters), base parameters, then viscous, then Coulomb.
        moving: (rows, dof) 1 if the direction of motion is known over the whole test function, else 0.
        time: (rows,) s, middle of each test function.
    """

    torque: Array
    columns: Array
    moving: Array
    time: Array


def smooth(angle: Array, period: float, window: float) -> tuple[Array, Array]:
    """Return angle and speed (n, dof) by local polynomials of order 4 over `window` s.

    Raises:
        RecordingError: the recording is shorter than that.
    """
    length = max(2 * round(0.5 * window / period) + 1, 7)
    if len(angle) < length:
        raise RecordingError(
            f"{len(angle) * period:g} s are too short: angles are smoothed over {length * period:g} s; record "
            "longer, or check the unit of the time"
        )
    return (
        np.asarray(signal.savgol_filter(angle, length, 4, axis=0), dtype=float),
        np.asarray(signal.savgol_filter(angle, length, 4, deriv=1, delta=period, axis=0), dtype=float),
    )


def weak_rows(
    device: Device,
    recording: Recording,
    tests: TestFunctions,
    *,
    angle: Array | None = None,
    slowest: Array | None = None,
) -> WeakRows:
    """Return the rows of `recording`.

    Args:
        device: gives the mechanism and its lengths; its masses, inertias and friction are not used.
        recording: angles and torques.
        tests: the test functions.
        angle: (n, dof) to use instead of the recorded angles (for instruments).
        slowest: (dof,) speed below which dry friction is taken as proportional to speed; default twenty times the
            error of the speeds from the encoder's counts.
    """
    period = recording.period
    phi, slope, hold, stride = tests.kernels(period)
    position = recording.angle if angle is None else angle
    q, qd = smooth(position, period, tests.smoothing)
    if slowest is None:
        slowest = slowest_speed(recording, tests)

    def project(kernel: Array, values: Array) -> Array:
        return _project(kernel, values, stride)

    columns = []
    for one in fictitious(device):
        momentum = np.einsum("nij,nj->ni", one.mass_matrix(q), qd)
        pull = one.gravity(q) - np.einsum("nji,nj->ni", one.coriolis(q, qd), qd)
        columns.append(period * (project(phi, pull) - project(slope, momentum)))
    diagonal = np.eye(device.dof)
    middle = position.mean(axis=0)
    speed = -period * project(slope, position - middle)
    direction = np.clip(qd / slowest, -1.0, 1.0)
    sign = period * project(phi, direction)
    columns += [speed * row for row in diagonal] + [sign * row for row in diagonal]
    rest = recording.torque.mean(axis=0)
    torque = project(hold, recording.torque - rest) + rest * hold.sum()
    moving = clear_rows(_reverses(qd, slowest), period, tests)
    time = recording.time[len(phi) // 2 :: stride][: len(torque)]
    return WeakRows(torque, np.stack(columns, axis=2), moving, time)


def _reverses(speed: Array, slowest: Array) -> Array:
    """Return where a speed (n, dof) is too slow for its direction to be certain, or has changed its sign, (n, dof)."""
    marked = np.abs(speed) <= slowest
    marked[1:] |= speed[1:] * speed[:-1] <= 0.0
    return np.asarray(marked)


def _project(kernel: Array, values: Array, stride: int) -> Array:
    """Return the sums (rows, ...) of `values` (n, ...) weighted by the kernel at each test function."""
    flat = values.reshape(len(values), -1)
    out = signal.oaconvolve(flat, kernel[::-1, None], mode="valid", axes=0)[::stride]
    return np.asarray(out.reshape(len(out), *values.shape[1:]), dtype=float)


def delay_column(torque: Array, period: float, tests: TestFunctions) -> Array:
    """Return the regressor (rows, dof) of a delay of the torque (n, dof), N*m; its coefficient is the delay, s.

    If the torque acts a short time d after its sample, its recorded integral is that of the motion plus d times this
    column.
    """
    phi, _, _, stride = tests.kernels(period)
    return -_project(np.append(np.diff(phi), 0.0), torque - torque.mean(axis=0), stride)


def clear_rows(marked: Array, period: float, tests: TestFunctions) -> Array:
    """Return 1 for each test function that is clear of marked samples (n, columns), else 0: (rows, columns)."""
    phi, _, _, stride = tests.kernels(period)
    return np.asarray(_project(np.ones_like(phi), marked.astype(float), stride) < 0.5, dtype=float)


def slowest_speed(recording: Recording, tests: TestFunctions) -> Array:
    """Return the speed (dof,) at which the direction of motion is still certain: twenty standard errors."""
    period = recording.period
    length = max(2 * round(0.5 * tests.smoothing / period) + 1, 7)
    rough = recording.angle - smooth(recording.angle, period, tests.smoothing)[0]
    noise = np.sqrt(np.mean(rough**2, axis=0))
    gain = float(np.linalg.norm(signal.savgol_coeffs(length, 4, deriv=1, delta=period)))
    return np.asarray(np.maximum(20 * gain * noise, 1e-12), dtype=float)
