"""Friction two ways: by matching closed-loop responses, and by the direct regressor.

Matching (Hosseini-Zadeh 2004, 3.7): the damping is chosen so that the nonlinear model, in the same servo loop and under
the same excitation, answers like the recorded device. The inertia is taken as known. Gauss-Newton on the angles.
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
        coulomb: (dof,) N*m, or None where it was taken from the device.
        coulomb_half: (dof,) or None.
        level: confidence.
        misfit: (dof,) what the fit leaves, rms: of the angles in rad (matching), of the torque in percent (regressor).
        runs: simulated experiments it took; 0 for the regressor.
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
        recording: must hold its excitation.
        device: inertia, gravity and Coulomb friction are taken as known from it.
        servo: the loop the recording was made in (default: as its metadata says).
        start: (dof,) first guess of the viscous friction; default a tenth of critical damping in that loop.
        seconds: length of the response that is matched.
        level: of the confidence intervals.
        rounds: most Gauss-Newton steps.

    Raises:
        RecordingError: the recording lacks its excitation or its servo, or no damping brings the responses together.
    """
    loop = JointServo.from_metadata(recording.metadata.get("servo")) if servo is None else servo
    if recording.excitation is None or loop is None or len(loop.pose) != device.dof:
        raise RecordingError("matching needs a recording that holds its excitation and its servo; give `servo`")
    n = min(len(recording), round(seconds / recording.period))
    push, measured = recording.excitation[:n], recording.angle[:n]
    stiff = np.diag(device.mass_matrix(np.array(loop.pose))) * np.array(loop.kp)
    scale = np.sqrt(np.maximum(stiff, 1e-300))  # damping's natural size, N*m*s/rad
    guess = 0.2 * scale if start is None else np.asarray(start, dtype=float)
    runs = 0

    def error(viscous: Array) -> Array:
        nonlocal runs
        runs += 1
        trial = device.with_viscous(viscous)
        run = respond(trial, loop, push, recording.period, encoder=False, start=measured[0])
        return np.asarray(measured - run.angle, dtype=float)

    def sensitivity(at: Array, rest: Array) -> Array:
        columns = []
        for joint in range(device.dof):
            step = np.zeros(device.dof)
            step[joint] = max(0.05 * at[joint], 1e-3 * scale[joint])
            columns.append((rest - error(at + step)) / step[joint])
        return np.stack(columns, axis=2)  # (n, dof, k): angle per damping

    k = np.maximum(guess, 0.0)
    rest = error(k)
    slope = sensitivity(k, rest)
    for turn in range(rounds):
        size = np.sqrt(np.mean(rest**2, axis=0))
        flat, left = (slope / size[:, None]).reshape(-1, device.dof), (rest / size).ravel()
        move = np.linalg.lstsq(flat, left, rcond=None)[0]
        new = np.maximum(k + move, 0.1 * k)
        settled = bool(np.all(np.abs(new - k) < 1e-3 * np.maximum(new, 1e-4 * scale)))
        if settled:
            break
        far = bool(np.any(np.abs(new - k) > 0.1 * new))
        k, rest = new, error(new)
        if far or turn == 0:
            slope = sensitivity(k, rest)
    else:
        raise RecordingError(f"no damping brings the simulated response to the recorded one in {rounds} steps")
    size = np.sqrt(np.mean(rest**2, axis=0))
    spread, freedom = _block_covariance(slope / size[:, None], rest / size, recording.period)
    half = stats.t.ppf(0.5 + 0.5 * level, freedom) * np.sqrt(np.diag(spread))
    return FrictionFit(k, np.asarray(half, dtype=float), None, None, level, size, runs)


def _block_covariance(slope: Array, rest: Array, period: float, block: float = 0.5) -> tuple[Array, float]:
    """Return the covariance of the estimate from moments summed over blocks that outlast the loop's memory."""
    length = max(1, round(block / period))
    count = len(rest) // length
    if count < 8:
        raise RecordingError(f"{len(rest) * period:g} s are too short for confidence intervals; match at least 4 s")
    cut = count * length
    moments = np.einsum("nij,ni->nj", slope[:cut], rest[:cut]).reshape(count, length, -1).sum(axis=1)
    inverse = np.linalg.inv(np.einsum("nij,nik->jk", slope, slope))
    freedom = count - slope.shape[2]
    return inverse @ (moments.T @ moments) @ inverse * count / freedom, float(freedom)
