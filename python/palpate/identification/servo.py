"""Closed-loop experiments: a joint-space servo stabilizes the pose, the excitation is added.

    torque[k] = bias_torque + kp (pose + sway[k] - angle[k]) - kd velocity[k] + excitation[k],  held for one period

`angle[k]` is the reading (encoder counts, noise), `velocity` its low-passed backward difference, as in a real servo.
Between samples the core moves the device in continuous time, dry friction and sticking included.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array
from palpate.devices import Device
from palpate.errors import RecordingError


def home(device: Device) -> Array:
    """Return the default pose for the identification of a device (dof,), rad or m."""
    return np.array(device.model.working_pose)


@dataclass(frozen=True)
class JointServo:
    """A joint-space PD loop.

    Attributes:
        pose: (dof,) rad.
        kp: (dof,) N*m/rad.
        kd: (dof,) N*m*s/rad.
        bias_torque: constant torque (dof,), N*m.
        cutoff: of the low-pass on the velocity, Hz.
    """

    pose: tuple[float, ...]
    kp: tuple[float, ...]
    kd: tuple[float, ...]
    bias_torque: tuple[float, ...]
    cutoff: float = 50.0

    @classmethod
    def tuned(
        cls,
        device: Device,
        pose: ArrayLike | None = None,
        *,
        frequency: float = 1.5,
        damping: float = 0.5,
        cutoff: float = 50.0,
    ) -> JointServo:
        """Return kp = M_ii w^2, kd = 2 damping M_ii w, w = 2 pi `frequency` (Hz), with the inertia at the pose.

        The servo is soft, so that the arm responds to the excitation. Gravity at the pose is compensated.

        Raises:
            RecordingError: the pose has the wrong shape or is not finite.
        """
        place = home(device) if pose is None else np.asarray(pose, dtype=float)
        if place.shape != (device.dof,) or not np.all(np.isfinite(place)):
            raise RecordingError(f"the pose must be {device.dof} finite joint coordinates, not {place.tolist()}")
        inertia = np.diag(device.mass_matrix(place))
        omega = 2 * np.pi * frequency
        return cls(
            tuple(place.tolist()),
            tuple((inertia * omega**2).tolist()),
            tuple((2 * damping * omega * inertia).tolist()),
            tuple(device.gravity(place).tolist()),
            cutoff,
        )

    def describe(self) -> dict[str, Any]:
        """Return the servo for JSON; `JointServo(**servo.describe())` restores it."""
        return asdict(self)

    @classmethod
    def from_metadata(cls, described: Any) -> JointServo | None:
        """Return the servo that `describe` wrote, or None if there is none or it is incomplete."""
        try:
            parts = {key: tuple(map(float, described[key])) for key in ("pose", "kp", "kd", "bias_torque")}
            return cls(**parts, cutoff=float(described["cutoff"]))
        except (KeyError, TypeError, ValueError):
            return None


@dataclass(frozen=True)
class Response:
    """Response of the servo loop: encoder reading, true angle and commanded torque, each (n, dof)."""

    reading: Array
    angle: Array
    torque: Array


class _Body:
    """Device between two samples, advanced by one period of the core's loop at a time.

    The kinematics are frozen at the begin of the period, so the tip force J^-T tau holds the joint torque tau.
    """

    def __init__(self, device: Device, period: float) -> None:
        self._dof = device.dof
        self._setup = device.setup()
        self._jacobian = self._setup.mechanism.jacobian
        self._setup.period = period
        self._setup.substeps = 1
        self._setup.frozen_kinematics = True
        feed = np.hstack([np.eye(3), np.zeros((3, 3))])
        empty = np.zeros((0, 0)), np.zeros((0, 6)), np.zeros((3, 0)), feed, np.zeros((0, 3))
        self._setup.controller = _core.StateSpace(*empty)
        self._nobody = np.zeros((2, 3))
        self._force = np.zeros((2, 3))

    def advance(self, q: Array, qd: Array, torque: Array) -> tuple[Array, Array]:
        """Return angles and speeds one period later."""
        jacobian = self._jacobian(q[None])[0]
        if self._dof == 1:
            self._force[0, 0] = torque[0] / jacobian[0, 0]
        else:
            self._force[0] = np.linalg.solve(jacobian.T, torque)
        self._setup.start, self._setup.start_speed = q, qd
        rows, count, _ = self._setup.run(self._force, self._nobody)
        if count < 2:
            raise RecordingError("the arm turns faster than 1000 rad/s")
        return rows[1, : self._dof], rows[1, self._dof : 2 * self._dof]


def respond(
    device: Device,
    servo: JointServo,
    excitation: Array,
    period: float,
    *,
    sway: Array | None = None,
    encoder: bool = True,
    angle_noise: Array | None = None,
    torque_noise: Array | None = None,
    start: ArrayLike | None = None,
) -> Response:
    """Run the servo on the device from rest at `start` (default: the servo's pose).

    `excitation`, `sway` and both noises are (n, dof).

    Raises:
        RecordingError: the arm diverges, with the time, or a signal has the wrong shape.
    """
    n, dof = len(excitation), device.dof
    silent = np.zeros((n, dof))
    offset, jitter, ripple = (silent if part is None else part for part in (sway, angle_noise, torque_noise))
    for name, values in (("excitation", excitation), ("sway", offset), ("noise", jitter), ("noise", ripple)):
        if values.shape != (n, dof):
            raise RecordingError(f"the {name} must be ({n}, {dof}), not {values.shape}")
    pose, kp, kd, bias = (np.array(part) for part in (servo.pose, servo.kp, servo.kd, servo.bias_torque))
    step = device.encoder_step
    counts = np.where(step > 0, step, 1.0)
    quantized = encoder & (step > 0)
    keep = float(np.exp(-2 * np.pi * servo.cutoff * period))
    wanted = bias + kp * (pose + offset) + excitation
    body = _Body(device, period)
    q = np.array(pose if start is None else start, dtype=float)
    qd = np.zeros(dof)
    reading, angle, torque = (np.empty((n, dof)) for _ in range(3))
    velocity = np.zeros(dof)
    before: Array | None = None
    for k in range(n):
        seen = q + jitter[k]
        seen = np.where(quantized, np.rint(seen / counts) * counts, seen)
        if before is not None:
            velocity = keep * velocity + (1 - keep) / period * (seen - before)
        before = seen
        command = wanted[k] - kp * seen - kd * velocity
        reading[k], angle[k], torque[k] = seen, q, command
        try:
            q, qd = body.advance(q, qd, command + ripple[k])
        except (RecordingError, np.linalg.LinAlgError):
            q = np.full(dof, np.nan)
        if not np.all(np.abs(q - pose) < 10.0):
            raise RecordingError(
                f"the experiment diverges at t = {k * period:g} s; stiffen the servo or lower the excitation"
            )
    return Response(reading, angle, torque)


def torque_response(device: Device, q: Array, qd: Array, torque: Array, period: float) -> Array:
    """Return the angles (n, dof) at t = 0, period, … from the state (q, qd) under `torque` (n, dof), held, no servo.

    Raises:
        RecordingError: the arm diverges, with the time.
    """
    body = _Body(device, period)
    out = np.empty((len(torque), device.dof))
    q, qd = np.array(q, dtype=float), np.array(qd, dtype=float)
    for k, tau in enumerate(torque):
        out[k] = q
        try:
            q, qd = body.advance(q, qd, tau)
        except (RecordingError, np.linalg.LinAlgError):
            raise RecordingError(f"the fitted device diverges at t = {k * period:g} s") from None
    return out
