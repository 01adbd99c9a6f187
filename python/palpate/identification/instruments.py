"""Instruments: the angles of an experiment without noise, computed from its excitation.

In a closed loop the torque noise moves the arm, and the servo responds. Regressors and noise are correlated, so least
squares is biased even for long recordings. The excitation is independent of the noise, and so is any signal computed
from it (Söderström & Stoica 1989, ch. 8).
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from palpate.arrays import Array
from palpate.identification.arx_models import arx_from_excitation
from palpate.identification.recording import Recording


def expected_angles(recording: Recording, order: int = 6, bandwidth: float = 25.0) -> Array | None:
    """Return the response (n, dof) of a linear closed loop to the excitation, or None if there is no stable loop.

    The loop is an ARX model sampled at four times `bandwidth`, Hz. Its response is interpolated to the full rate.
    """
    if recording.excitation is None or np.any(np.ptp(recording.excitation, axis=0) == 0):
        return None
    factor = max(1, round(0.25 / (bandwidth * recording.period)))
    coarse = recording.decimate(factor)
    model = arx_from_excitation(coarse, order, order)
    poles = np.abs(np.linalg.eigvals(np.asarray(model.to_statespace().A)))
    if poles.max() >= 1.0 or coarse.excitation is None:
        return None
    out = model.simulate(coarse.excitation)
    fine = np.empty_like(recording.angle)
    for joint in range(recording.dof):
        fine[:, joint] = np.interp(recording.time, coarse.time, out[:, joint])
    window = 2 * factor + 1  # smooths the interpolation
    if factor > 1:
        fine = np.asarray(signal.savgol_filter(fine, max(window, 5), 2, axis=0), dtype=float)
    return fine
