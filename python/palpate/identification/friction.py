"""Estimation of friction by matching closed-loop responses, and by the direct regressor.

Matching (Hosseini-Zadeh 2004, 3.7): the nonlinear model runs in the same servo loop under the same excitation. Its
damping minimizes the error of the angles, by Gauss-Newton. The inertia is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from palpate.arrays import Array
from palpate.devices import Device
from palpate.errors import RecordingError
from palpate.identification.parameters import estimate_parameters
from palpate.identification.recording import Recording
from palpate.identification.servo import JointServo, respond


@dataclass(frozen=True)
class FrictionFit:
    """Viscous and Coulomb friction with confidence intervals.

    Attributes:
        viscous: (dof,) N*m*s/rad.
        viscous_half: (dof,) half the width of its confidence interval.
        coulomb: (dof,) N*m, or None if the device's was used.
        coulomb_half: (dof,) or None.
        level: confidence.
        misfit: (dof,) rms residual: of the angles in rad (matching), of the torque in percent (regressor).
        runs: number of simulated experiments; 0 for the regressor.
    """

    viscous: Array
    viscous_half: Array
    coulomb: Array | None
    coulomb_half: Array | None
    level: float
    misfit: Array
    runs: int


def friction_by_regressor(recording: Recording, device: Device, *, level: float = 0.95) -> FrictionFit:
    """Estimate viscous and Coulomb friction together with inertia and gravity; see `estimate_parameters`."""
    fit = estimate_parameters(recording, device, level=level)
    names = [p.name for p in fit.parameters]

    def pick(letter: str) -> tuple[Array, Array]:
        places = [names.index(f"{letter}{j + 1}") for j in range(device.dof)]
        return fit.value[places], fit.half_width[places]

    return FrictionFit(*pick("k"), *pick("c"), level, fit.torque_error, 0)


def friction_by_matching(
    recording: Recording,
    device: Device,
    *,
    servo: JointServo | None = None,
    start: ArrayLike | None = None,
    seconds: float = 8.0,
    level: float = 0.95,
    rounds: int = 6,
) -> FrictionFit:
    """Estimate viscous friction by matching the closed-loop response from rest.

    Args:
        recording: with its excitation.
        device: gives inertia, gravity and Coulomb friction.
        servo: loop of the recording; None for the one in its metadata.
        start: first guess of the viscous friction (dof,); None for a tenth of critical damping in that loop.
        seconds: length of the response that is matched.
        level: of the confidence intervals.
        rounds: maximum number of Gauss-Newton steps.

    Raises:
        RecordingError: the recording lacks its excitation or its servo, or the steps do not converge.
    """
    loop = JointServo.from_metadata(recording.metadata.get("servo")) if servo is None else servo
    if recording.excitation is None or loop is None or len(loop.pose) != device.dof:
        raise RecordingError("matching needs a recording that holds its excitation and its servo; give `servo`")
    matching = _Matching(recording, device, loop, min(len(recording), round(seconds / recording.period)))
    k = np.maximum(0.2 * matching.scale if start is None else np.asarray(start, dtype=float), 0.0)
    rest = matching.error(k)
    slope = matching.sensitivity(k, rest)
    for turn in range(rounds):
        size = np.sqrt(np.mean(rest**2, axis=0))
        flat, left = (slope / size[:, None]).reshape(-1, device.dof), (rest / size).ravel()
        move = np.linalg.lstsq(flat, left, rcond=None)[0]
        new = np.maximum(k + move, 0.1 * k)
        settled = bool(np.all(np.abs(new - k) < 1e-3 * np.maximum(new, 1e-4 * matching.scale)))
        if settled:
            break
        far = bool(np.any(np.abs(new - k) > 0.1 * new))
        k, rest = new, matching.error(new)
        if far or turn == 0:
            slope = matching.sensitivity(k, rest)
    else:
        raise RecordingError(f"matching does not converge in {rounds} steps: try another start, or more rounds")
    size = np.sqrt(np.mean(rest**2, axis=0))
    spread, freedom = _block_covariance(slope / size[:, None], rest / size, recording.period)
    half = stats.t.ppf(0.5 + 0.5 * level, freedom) * np.sqrt(np.diag(spread))
    return FrictionFit(k, np.asarray(half, dtype=float), None, None, level, size, matching.runs)


class _Matching:
    """Error of the simulated response for a viscous friction (dof,), N*m*s/rad.

    Attributes:
        scale: geometric mean of inertia and servo stiffness (dof,), N*m*s/rad.
        runs: number of simulated experiments.
    """

    def __init__(self, recording: Recording, device: Device, servo: JointServo, samples: int) -> None:
        assert recording.excitation is not None  # checked
        self._device, self._servo, self._period = device, servo, recording.period
        self._push, self._measured = recording.excitation[:samples], recording.angle[:samples]
        stiff = np.diag(device.mass_matrix(np.array(servo.pose))) * np.array(servo.kp)
        self.scale = np.sqrt(np.maximum(stiff, 1e-300))
        self.runs = 0

    def error(self, viscous: Array) -> Array:
        """Return measured minus simulated angles (n, dof), rad."""
        self.runs += 1
        trial, start = self._device.with_viscous(viscous), self._measured[0]
        run = respond(trial, self._servo, self._push, self._period, encoder=False, start=start)
        return np.asarray(self._measured - run.angle, dtype=float)

    def sensitivity(self, at: Array, rest: Array) -> Array:
        """Return the derivative of the angles by the friction (n, dof, dof), by finite differences."""
        columns = []
        for joint in range(len(at)):
            step = np.zeros(len(at))
            step[joint] = max(0.05 * at[joint], 1e-3 * self.scale[joint])
            columns.append((rest - self.error(at + step)) / step[joint])
        return np.stack(columns, axis=2)


def _block_covariance(slope: Array, rest: Array, period: float, block: float = 0.5) -> tuple[Array, float]:
    """Return the covariance of the estimate, from moments summed over blocks longer than the loop's response."""
    length = max(1, round(block / period))
    count = len(rest) // length
    if count < 8:
        raise RecordingError(f"{len(rest) * period:g} s are too short for confidence intervals; match at least 4 s")
    cut = count * length
    moments = np.einsum("nij,ni->nj", slope[:cut], rest[:cut]).reshape(count, length, -1).sum(axis=1)
    inverse = np.linalg.inv(np.einsum("nij,nik->jk", slope, slope))
    freedom = count - slope.shape[2]
    return inverse @ (moments.T @ moments) @ inverse * count / freedom, float(freedom)
