"""Simulated experiments on the nonlinear device: recordings with encoder counts and noise, labeled as simulated.

No recordings of a PHANToM are public, so identification is shown and tested on these.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

from palpate.arrays import Array
from palpate.devices import Device
from palpate.errors import RecordingError
from palpate.identification.excitation import Excitation, multisine
from palpate.identification.recording import Recording
from palpate.identification.servo import JointServo, home, respond


@dataclass(frozen=True)
class Noise:
    """Standard deviations of white noise.

    Attributes:
        angle: added to the angle before it is counted, rad or m.
        torque: reaches the device but not the recording (amplifier, cable, commutation ripple), N*m or N.
    """

    angle: float = 2e-5
    torque: float = 1e-3

    def __post_init__(self) -> None:
        if not (np.isfinite([self.angle, self.torque]).all() and min(self.angle, self.torque) >= 0):
            raise RecordingError(f"noise must be finite and not negative, not {self.angle}, {self.torque}")


def default_excitation(device: Device, seed: int = 0) -> Excitation:
    """Return a multisine of torque, 0.3 to 6 Hz, that moves each joint by about half a radian (or 20 mm).

    Joint 1 gets twice as much: it has the most damping, and only its speed depends on the changes of M11.
    """
    inertia = np.diag(device.mass_matrix(home(device)))
    reach = np.resize([1.0, 0.5, 0.6] if device.model.revolute else [0.02], device.dof)
    peak = reach * inertia * (2 * np.pi * 2.0) ** 2 + 2.0 * device.coulomb
    return multisine(peak, (0.3, 6.0), lines=12, seed=seed, logarithmic=True)


def default_sway(device: Device, duration: float, seed: int = 0) -> Excitation:
    """Return slow changes of the pose, below 0.35 Hz, which excite the changes of inertia and gravity with it."""
    low = 1.0 / duration
    reach = np.resize([0.4, 0.4, 0.7] if device.model.revolute else [0.01], device.dof)
    return multisine(reach, (low, max(0.35, 4 * device.dof * low)), lines=2, seed=seed + 1)


def simulate_experiment(
    device: Device,
    excitation: Excitation | None = None,
    duration: float = 20.0,
    period: float = 1e-3,
    seed: int = 0,
    *,
    sway: Excitation | None = None,
    noise: Noise | None = None,
    encoder: bool = True,
    servo: JointServo | None = None,
) -> Recording:
    """Run a closed-loop experiment on the nonlinear device, and return its recording.

    Args:
        device: from `palpate.devices.load`.
        excitation: torque added to the servo's, N*m per joint; None for `default_excitation`.
        duration: s.
        period: s.
        seed: of the noise.
        sway: slow change of the servo's pose, rad per joint; None for `default_sway` if `excitation` is None, and for
            no sway otherwise.
        noise: None for the default of the device.
        encoder: whether angles are whole counts.
        servo: None for `JointServo.tuned(device)`.

    Raises:
        RecordingError: the excitation does not fit the device, or the arm diverges.
    """
    if excitation is None:
        excitation = default_excitation(device)
        sway = default_sway(device, duration) if sway is None else sway
    if noise is None:
        noise = Noise() if device.model.revolute else Noise(angle=2e-6, torque=1e-3)
    loop = JointServo.tuned(device) if servo is None else servo
    push = excitation.sample(duration, period)
    swing = None if sway is None else sway.sample(duration, period)
    _check_channels(device, excitation=push, sway=swing)
    draw = np.random.default_rng(seed)
    jitter, ripple = (draw.normal(0.0, 1.0, push.shape) * size for size in (noise.angle, noise.torque))
    run = respond(device, loop, push, period, sway=swing, encoder=encoder, angle_noise=jitter, torque_noise=ripple)
    injected = push if swing is None else push + np.array(loop.kp) * swing
    metadata = {
        "source": "simulated on the nonlinear device",
        "device": device.name,
        "seed": int(seed),
        "encoder": encoder,
        "noise": asdict(noise),
        "servo": loop.describe(),
        "excitation": excitation.describe(),
        "sway": None if sway is None else sway.describe(),
    }
    units = (device.joint_unit, device.torque_unit)
    time = np.asarray(np.arange(len(push)) * period, dtype=float)
    return Recording(time, run.reading, run.torque, period, metadata, injected, units)


def _check_channels(device: Device, **signals: Array | None) -> None:
    """Raise RecordingError unless each signal (n, channels) has one channel per joint."""
    for name, values in signals.items():
        if values is not None and values.shape[1] != device.dof:
            raise RecordingError(f"the {name} has {values.shape[1]} channels; {device.name} has {device.dof} joints")
