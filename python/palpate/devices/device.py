"""Haptic device: kinematics, dynamics, friction and drive, computed by the core."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array
from palpate.devices.flexible_mode import FlexibleMode
from palpate.devices.mechanisms import MECHANISMS, Mechanism
from palpate.errors import DeviceError, PoseError
from palpate.units import array_to_si


@dataclass(frozen=True)
class Parameters:
    """Numbers of a device in SI, by the keys of its file ("geometry.l1")."""

    values: Mapping[str, tuple[float, ...]]

    def one(self, key: str, default: float | None = None) -> float:
        """Return the single number under `key`. Raise as `many`."""
        return float(self.many(key, 1, default)[0])

    def many(self, key: str, size: int, default: float | None = None) -> Array:
        """Return the numbers under `key` (size,), or `default` for each if the file has none.

        Raises:
            DeviceError: the key is missing and has no default.
        """
        if key not in self.values:
            if default is None:
                raise DeviceError(f"{key} is missing")
            return np.full(size, default)
        return np.array(self.values[key], dtype=float)

    def with_values(self, **values: ArrayLike) -> Parameters:
        """Return a copy with other numbers; a key is written with `__` for its dot ("friction__viscous")."""
        new = {key.replace("__", "."): tuple(np.atleast_1d(np.asarray(v, float))) for key, v in values.items()}
        return Parameters({**self.values, **new})


@dataclass(frozen=True)
class Device:
    """Haptic device. Angles q in rad, torques in N*m (m and N for prismatic joints), tip positions in m, base frame.

    Numbers are SI. A list may also hold text with a unit: `device.forward(["0 deg", "120 deg", "190 deg"])`.
    Every method takes one state, (dof,), or a stack of them, (n, dof), and returns one result or a stack of results.

    Attributes:
        name: as in the catalog or the file.
        description: one line.
        mechanism: name of the mechanism, a key of `palpate.devices.MECHANISMS`.
        parameters: every number in SI.
        identified_model: name or file of a linear model identified from measurements, or None.
    """

    name: str
    description: str
    mechanism: str
    parameters: Parameters
    identified_model: str | None = None

    @property
    def model(self) -> Mechanism:
        """Mechanism of the device: joints, units and parameters."""
        return MECHANISMS[self.mechanism]

    @property
    def dof(self) -> int:
        """Number of joints."""
        return self.model.dof

    @property
    def joint_unit(self) -> str:
        """Unit of the joint coordinates: "rad" or "m"."""
        return self.model.joint_unit

    @property
    def torque_unit(self) -> str:
        """Unit of the joint torques: "N*m" or "N"."""
        return self.model.torque_unit

    # parameters

    @property
    def viscous(self) -> Array:
        """Viscous friction of the joints (dof,), N*m*s/rad."""
        return self.parameters.many("friction.viscous", self.dof)

    @property
    def coulomb(self) -> Array:
        """Coulomb friction of the sliding joints (dof,), N*m."""
        return self.parameters.many("friction.coulomb", self.dof, 0.0)

    @property
    def breakaway(self) -> Array:
        """Breakaway friction (dof,), N*m; the Coulomb friction unless the file gives it."""
        if "friction.breakaway" in self.parameters.values:
            return self.parameters.many("friction.breakaway", self.dof)
        return self.coulomb

    @property
    def stribeck_speed(self) -> Array:
        """Stribeck speed, above which the friction approaches Coulomb friction (dof,), rad/s."""
        return self.parameters.many("friction.stribeck_speed", self.dof, 1e-2)

    @property
    def encoder_step(self) -> Array:
        """Angle of one encoder count (dof,), rad; 0 without an encoder."""
        if not self.model.revolute:
            return self.parameters.many("drive.encoder_step", self.dof, 0.0)
        if "drive.encoder_counts" not in self.parameters.values:
            return np.zeros(self.dof)
        counts = self.parameters.many("drive.encoder_counts", self.dof)
        return np.asarray(2 * np.pi / (counts * self.parameters.many("drive.gear", self.dof, 1.0)), dtype=float)

    @property
    def peak_force(self) -> float:
        """Peak force at the tip, N; inf if the file gives none."""
        return self.parameters.one("drive.peak_force", np.inf)

    @property
    def continuous_force(self) -> float:
        """Continuous force at the tip, N; inf if the file gives none."""
        return self.parameters.one("drive.continuous_force", np.inf)

    @property
    def thermal_time(self) -> float:
        """Time constant of the windings' temperature, s."""
        return self.parameters.one("drive.thermal_time", 1.0)

    def limit_time(self, force: float, temperature: float = 0.0) -> float:
        """Return the time after which the hot drive limits a constant force of the motors, s; inf: never.

        The temperature follows (F/F_c)^2 with the thermal time. Over its last tenth, from 0.9 to 1, the limit falls
        from the peak to the continuous force F_c (`actuation::Drive` of the core).

        Args:
            force: F, of the motors at the tip, N.
            temperature: of the windings now; 1 is that under the continuous force for ever.
        """
        rating, peak = self.continuous_force, self.peak_force
        if force <= rating:
            return float("inf")
        fading = 0.1 * (force - rating) / (peak - rating) if np.isfinite(peak) else 0.0
        left, steady = 1.0 - fading - temperature, (force / rating) ** 2 - temperature
        return 0.0 if force > peak or left <= 0.0 else float(-self.thermal_time * np.log1p(-left / steady))

    @property
    def peak_torque(self) -> Array:
        """Torque limit of the motors at the joints (dof,), N*m; inf if the file gives none."""
        return self.parameters.many("drive.peak_torque", self.dof, np.inf)

    @property
    def flexible(self) -> FlexibleMode | None:
        """Lowest flexible mode between motors and tip; None: the device is taken as rigid."""
        if "flexible.frequency" not in self.parameters.values:
            return None
        one = self.parameters.one
        return FlexibleMode(one("flexible.frequency"), one("flexible.tip_share"), one("flexible.damping_ratio"))

    @property
    def joint_limits(self) -> tuple[Array, Array]:
        """Least and largest joint coordinates, (dof,) each, rad; infinite if the file gives none."""
        many = self.parameters.many
        return many("limits.lower", self.dof, -np.inf), many("limits.upper", self.dof, np.inf)

    @property
    def servo_period(self) -> float:
        """Nominal servo period, s."""
        return self.parameters.one("servo_period")

    # variants

    def rigid(self) -> Device:
        """Return the same device without its flexible mode."""
        values = {key: value for key, value in self.parameters.values.items() if not key.startswith("flexible.")}
        return self if self.flexible is None else replace(self, parameters=Parameters(values))

    def frictionless(self) -> Device:
        """Return the same device without viscous and dry friction."""
        return self.with_friction(viscous=np.zeros(self.dof), coulomb=np.zeros(self.dof))

    def with_viscous(self, viscous: ArrayLike) -> Device:
        """Return the same device with other viscous friction (dof,), N*m*s/rad."""
        return self.with_friction(viscous=viscous)

    def with_friction(
        self,
        *,
        viscous: ArrayLike | None = None,
        coulomb: ArrayLike | None = None,
        breakaway: ArrayLike | None = None,
        stribeck_speed: ArrayLike | None = None,
    ) -> Device:
        """Return the same device with other friction, each (dof,) or one value for all joints.

        A new Coulomb friction without a breakaway sets both.

        Raises:
            DeviceError: a value is negative or not finite, or breakaway is below Coulomb.
        """
        if coulomb is not None and breakaway is None:
            breakaway = coulomb
        changes = {"viscous": viscous, "coulomb": coulomb, "breakaway": breakaway, "stribeck_speed": stribeck_speed}
        new = {
            f"friction__{key}": np.broadcast_to(
                array_to_si(value, self.model.fields[f"friction.{key}"].unit, key, error=DeviceError), (self.dof,)
            )
            for key, value in changes.items()
            if value is not None
        }
        device = replace(self, parameters=self.parameters.with_values(**new))
        device.check()
        return device

    def _check_flexible(self) -> None:
        keys = [f"flexible.{name}" for name in ("frequency", "tip_share", "damping_ratio")]
        missing = [key for key in keys if key not in self.parameters.values]
        if missing and len(missing) < len(keys):
            raise DeviceError(f"{missing[0]} is missing: a flexible mode has frequency, tip_share and damping_ratio")
        mode = self.flexible
        if mode is not None and not (mode.tip_share < 1.0 and mode.damping_ratio < 1.0):
            raise DeviceError("flexible.tip_share and flexible.damping_ratio must be below 1")

    def check(self) -> None:
        """Raise DeviceError unless friction and inertia are physical."""
        for name in ("viscous", "coulomb", "breakaway", "stribeck_speed"):
            value = getattr(self, name)
            if not np.all(np.isfinite(value)) or np.any(value < 0):
                raise DeviceError(f"friction.{name} must be finite and not negative, not {value.tolist()}")
        self._check_flexible()
        low, high = self.joint_limits
        if np.any(low >= high):
            raise DeviceError(f"limits.lower {low.tolist()} must be below limits.upper {high.tolist()} for every joint")
        if np.any(self.breakaway < self.coulomb):
            raise DeviceError("friction.breakaway must not be below friction.coulomb: use the same value or more")
        angles = np.linspace(-np.pi, np.pi, 13)
        grid = np.array(np.meshgrid(*[angles] * self.dof)).reshape(self.dof, -1).T
        inertia = self.mass_matrix(grid)
        inertia = inertia[np.isfinite(inertia).all(axis=(1, 2))]  # a closed loop cannot be assembled at some poses
        if not len(inertia):
            raise DeviceError("the mechanism cannot be assembled at any pose: check its lengths")
        try:
            least = np.linalg.eigvalsh(inertia).min()
        except np.linalg.LinAlgError:  # numbers near the largest one
            least = 0.0
        if least <= 0.0:
            raise DeviceError("the inertia matrix is not positive definite at every pose: check masses and inertias")

    # kinematics

    def forward(self, q: ArrayLike) -> Array:
        """Return the tip position (3,), m."""
        return self._call(self.core.forward, q)

    def jacobian(self, q: ArrayLike) -> Array:
        """Return dp/dq (3, dof), m/rad: v = J qd and tau = J^T f."""
        return self._call(self.core.jacobian, q)

    def tip_hessian(self, q: ArrayLike) -> Array:
        """Return d2p/dq2 (3, dof, dof), m/rad^2, exact by dual numbers."""
        return self._call(self.core.tip_hessian, q)

    def inverse(self, p: ArrayLike, nearest_to: ArrayLike | None = None) -> Array:
        """Return the pose (dof,) with the tip at p (3,), m.

        Of several poses, the one nearest to `nearest_to` (dof,) is returned, including multiples of 2 pi. Default:
        nearest to q = 0.

        Raises:
            PoseError: p is unreachable, not finite or has the wrong shape.
        """
        points = array_to_si(p, "m", "inverse: p", error=PoseError)
        if points.ndim == 2:
            return np.array([self.inverse(point, nearest_to) for point in points]).reshape(-1, self.dof)
        if points.shape != (3,) or not np.all(np.isfinite(points)):
            raise PoseError(f"inverse: a tip position is three finite numbers in m, not {points.tolist()}")
        reference = np.zeros(self.dof) if nearest_to is None else self._state(nearest_to, "nearest_to")[0][0]
        poses, reason = self.core.inverse(points, reference)
        if not len(poses):
            position = np.array2string(points * 1e3, precision=1, separator=", ")
            raise PoseError(f"inverse: the tip cannot be at {position} mm: {reason}")
        if self.model.revolute:
            poses = [reference + np.angle(np.exp(1j * (q - reference))) for q in poses]
        return np.asarray(min(poses, key=lambda q: float(np.sum((q - reference) ** 2))), dtype=float)

    # dynamics: M(q) qdd + C(q, qd) qd + N(q) + friction = tau

    def mass_matrix(self, q: ArrayLike) -> Array:
        """Return M(q) (dof, dof), kg*m^2."""
        return self._call(self.core.mass_matrix, q)

    def coriolis(self, q: ArrayLike, qd: ArrayLike) -> Array:
        """Return C(q, qd) (dof, dof), kg*m^2/s, such that dM/dt - 2C is skew-symmetric."""
        return self._call(self.core.coriolis, q, qd)

    def gravity(self, q: ArrayLike) -> Array:
        """Return the gravity compensation torque N(q) (dof,), N*m."""
        return self._call(self.core.gravity, q)

    def energy(self, q: ArrayLike, qd: ArrayLike) -> Any:
        """Return kinetic plus potential energy, J: a float, or (n,) for stacked states."""
        value = self._call(self.core.energy, q, qd)
        return float(value) if np.ndim(value) == 0 else value

    def acceleration(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> Array:
        """Return qdd (dof,), rad/s^2, under motor torque tau, with joints at rest held by dry friction if possible."""
        return self._call(lambda *s: self.core.acceleration(self.core_friction, *s), q, qd, tau)

    def linearization(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> tuple[Array, Array, Array]:
        """Return (dqdd/dq, dqdd/dqd, dqdd/dtau), each (dof, dof), exact by dual numbers, with viscous friction.

        Dry friction has no derivative at rest and is left out.

        Raises:
            PoseError: there is more than one state.
        """
        states = [self._state(value, name) for value, name in ((q, "q"), (qd, "qd"), (tau, "tau"))]
        if any(stacked for _, stacked in states):
            raise PoseError("linearization: give one state (dof,), not a stack")
        d = np.asarray(self.core.linearization(self.viscous, *(rows[0] for rows, _ in states)))
        n = self.dof
        return d[:, :n], d[:, n : 2 * n], d[:, 2 * n :]

    # core objects

    @cached_property
    def core(self) -> Any:
        """Mechanism of the core: batched functions on (n, dof) rows, without checks."""
        return self.model.create(self.parameters.values)

    @cached_property
    def core_mode(self) -> Any:
        """Lowest flexible mode of the core; None: the device is taken as rigid."""
        mode = self.flexible
        return mode and _core.FlexibleMode(mode.frequency, mode.tip_share, mode.damping_ratio)

    @cached_property
    def core_flexible(self) -> Any:
        """Mechanism of the core with the flexible mode: the joints of the motors, then those of the tip's side.

        Raises:
            DeviceError: the device is rigid.
        """
        if self.core_mode is None:
            raise DeviceError(f"{self.name} has no flexible mode: give its file a [flexible] table")
        return self.model.with_mode(self.core, self.core_mode)

    @cached_property
    def core_friction(self) -> Any:
        """Joint friction of the core."""
        friction = self.model.friction()
        friction.viscous, friction.coulomb = self.viscous, self.coulomb
        friction.breakaway, friction.stribeck_speed = self.breakaway, self.stribeck_speed
        return friction

    def setup(self) -> Any:
        """Return a new simulation setup of the core with the mechanism and friction of this device."""
        setup = self.model.setup()
        setup.mechanism, setup.friction = self.core, self.core_friction
        return setup

    def _state(self, value: ArrayLike, name: str) -> tuple[Array, bool]:
        """Return `value` as contiguous rows (n, dof), and whether it was stacked."""
        unit = self.torque_unit if name == "tau" else self.joint_unit + ("/s" if name == "qd" else "")
        rows = np.ascontiguousarray(array_to_si(value, unit, name, error=PoseError))
        if rows.ndim not in (1, 2) or rows.shape[-1] != self.dof:
            shape = f"({self.dof},) or (n, {self.dof})"
            raise PoseError(f"{name} must have shape {shape} for {self.name}, not {rows.shape}")
        if not np.all(np.isfinite(rows)):
            raise PoseError(f"{name} must be finite; it is {rows.tolist()}")
        return rows.reshape(-1, self.dof), rows.ndim == 2

    def _call(self, function: Any, *values: ArrayLike) -> Array:
        states = [self._state(value, name) for value, name in zip(values, ("q", "qd", "tau"), strict=False)]
        count = max(len(rows) for rows, _ in states)
        if any(len(rows) not in (1, count) for rows, _ in states):
            raise PoseError(f"stacked states must have one length; they have {[len(rows) for rows, _ in states]}")
        stacked = any(flag for _, flag in states)
        full = [np.ascontiguousarray(np.broadcast_to(rows, (count, self.dof))) for rows, _ in states]
        result = np.asarray(function(*full))
        return result if stacked else np.asarray(result[0])
