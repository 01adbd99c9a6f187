"""Experiments on the nonlinear device: simulated recordings with encoder counts and noise, and labelled as such.

No recordings of a PHANToM are public, so identification is shown and tested on these.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np

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
    """Return a multisine of torque, 0.3 to 6 Hz, that swings each joint by about half a radian (or 20 mm).

    Joint 1 gets twice as much: it is the most damped, and only its speed shows how M11 depends on the pose.
    """
    inertia = np.diag(device.mass_matrix(home(device)))
    reach = np.resize([1.0, 0.5, 0.6] if device.model.revolute else [0.02], device.dof)
    peak = reach * inertia * (2 * np.pi * 2.0) ** 2 + 2.0 * device.coulomb
    return multisine(peak, (0.3, 6.0), lines=12, seed=seed, logarithmic=True)


def default_sway(device: Device, duration: float, seed: int = 0) -> Excitation:
    """Return slow changes of the pose, below 0.35 Hz: they show how inertia and gravity change with it."""
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
    """Run a closed-loop experiment on the nonlinear device, recorded as a real one would be.

    Args:
        device: from `palpate.devices.load`.
        excitation: torque added to the servo's, N*m per joint (default: `default_excitation`).
        duration: s.
        period: s.
        seed: of the noise.
        sway: slow change of the servo's pose, rad per joint (default: `default_sway` with the default excitation,
            none with one's own).
        noise: see `Noise`.
        encoder: read whole counts.
        servo: default `Servo.tuned(device)`.

    Raises:
        RecordingError: the excitation does not fit the device, or the arm runs away.
    """
    if excitation is None:
        excitation = default_excitation(device)
        sway = default_sway(device, duration) if sway is None else sway
    level = _noise(device) if noise is None else noise
    loop = JointServo.tuned(device) if servo is None else servo
    push = excitation.sample(duration, period)
    swing = None if sway is None else sway.sample(duration, period)
    for name, values in (("excitation", push), ("sway", swing)):
        if values is not None and values.shape[1] != device.dof:
            raise RecordingError(f"the {name} has {values.shape[1]} channels; {device.name} has {device.dof} joints")
    draw = np.random.default_rng(seed)
    run = respond(
        device,
        loop,
        push,
        period,
        sway=swing,
        encoder=encoder,
        angle_noise=draw.normal(0.0, 1.0, push.shape) * level.angle,
        torque_noise=draw.normal(0.0, 1.0, push.shape) * level.torque,
    )
    injected = push if swing is None else push + np.array(loop.kp) * swing
    metadata = {
        "source": "simulated on the nonlinear device",
        "device": device.name,
        "seed": int(seed),
        "encoder": encoder,
        "noise": asdict(level),
        "servo": loop.describe(),
        "excitation": excitation.describe(),
        "sway": None if sway is None else sway.describe(),
    }
    units = (device.joint_unit, device.torque_unit)
    time = np.asarray(np.arange(len(push)) * period, dtype=float)
    return Recording(time, run.reading, run.torque, period, metadata, injected, units)


def _noise(device: Device) -> Noise:
    return Noise() if device.model.revolute else Noise(angle=2e-6, torque=1e-3)
