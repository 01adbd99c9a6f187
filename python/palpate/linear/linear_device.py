"""Linear model of a device along one line, with or without an operator, and its exact discretization.

M q'' + D q' + S q = J^T f, tip = J q, with f and the tip motion along a unit vector. A mass has one coordinate, an arm
one per joint. An operator behind fingertip tissue adds one per axis.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm

from palpate.arrays import Array, Complex
from palpate.checks import not_negative, positive
from palpate.devices import Device, load
from palpate.errors import PoseError, StabilityError
from palpate.linear.linearization import static_tip_force

MAX_DELAY = 1000  # samples


@dataclass(frozen=True)
class HumanArm:
    """A human arm at the tip, the same along every axis. Text with a unit is converted to SI.

    Attributes:
        mass: kg.
        damping: N s/m.
        stiffness: N/m, between hand and shoulder.
        tissue_stiffness: stiffness of the fingertip between arm and tip, N/m; None: rigid grip.
        tissue_damping: damping of the fingertip, N s/m.

    Raises:
        StabilityError: a negative value, or no mass behind tissue.
    """

    mass: float
    damping: float
    stiffness: float
    tissue_stiffness: float | None = None
    tissue_damping: float = 0.0

    def __post_init__(self) -> None:
        units = {
            "mass": "kg",
            "damping": "N*s/m",
            "stiffness": "N/m",
            "tissue_damping": "N*s/m",
            "tissue_stiffness": "N/m",
        }
        for field, unit in units.items():
            owner, _, name = field.rpartition("_")
            if (value := getattr(self, field)) is not None:
                said = f"the {'fingertip' if owner else 'arm'}'s {name}"
                object.__setattr__(self, field, not_negative(value, said, unit))
        if self.tissue_stiffness is not None:
            positive(self.mass, "the mass of an arm behind fingertip tissue", "kg")


@dataclass(frozen=True)
class LinearDevice:
    """A linear device along one line.

    Attributes:
        inertia: M (n, n), kg m^2 (kg for a slider).
        damping: D (n, n), N m s/rad.
        stiffness: S (n, n), N m/rad.
        jacobian: J (axes, n), m/rad, tip motion per coordinate.
        along: unit normal of the wall (axes,).
        name: description for verdicts.
    """

    inertia: Array
    damping: Array
    stiffness: Array
    jacobian: Array
    along: Array
    name: str = "the device"

    @classmethod
    def of_mass(cls, mass: float | str, damping: float | str = 0.0, arm: HumanArm | None = None) -> LinearDevice:
        """Return a mass (kg) with viscous damping (N s/m) on one axis, held by ``arm`` if given.

        Raises:
            StabilityError: the mass is not positive, or the damping negative.
        """
        m = positive(mass, "mass", "kg")
        b = not_negative(damping, "damping", "N*s/m")
        one = np.ones((1, 1))
        tip = cls(m * one, b * one, 0 * one, one, np.ones(1), f"a mass of {m:g} kg with {b:g} N s/m")
        return tip if arm is None else tip.coupled_to(arm)

    @classmethod
    def at_pose(
        cls,
        device: Device | str | PathLike[str],
        pose: ArrayLike,
        along: ArrayLike = (1.0, 0.0, 0.0),
        arm: HumanArm | None = None,
    ) -> LinearDevice:
        """Return ``device`` linearized at rest in ``pose``, moved along a direction in the base frame.

        A constant tip force holds it against gravity; its torque turns with the pose, and is counted as stiffness.
        Dry friction and coordinates that ``along`` does not excite are neglected.

        Args:
            device: a device, or its name in the catalog or the path of its file.
            pose: (dof,), rad (m for a slider).
            along: direction (3,), not zero.
            arm: operator at the tip; None: no operator.

        Raises:
            PoseError: a wrong shape, or a pose at which the direction cannot be pushed.
            StabilityError: ``along`` has no direction.
            DeviceError: there is no such device.
        """
        device = load(device)
        if device.flexible is not None:
            raise StabilityError(
                f"{device.name} has a {device.flexible}, which acts between motors and tip: judge a scenario with "
                "palpate.stability.certify, or pass device.rigid()"
            )
        direction = np.asarray(along, dtype=float)
        length = float(np.linalg.norm(direction))
        if direction.shape != (3,) or not np.isfinite(length) or length == 0.0:
            raise StabilityError(f"along must be a direction (3,) in the base frame, not {direction.tolist()}")
        q = np.asarray(pose, dtype=float)
        torque = np.asarray(device.gravity(q), dtype=float)
        a_q, a_v, _ = device.linearization(q, np.zeros(device.dof), torque)
        inertia, jacobian = device.mass_matrix(q), device.jacobian(q)
        geometric_stiffness = np.einsum("k,kij->ij", static_tip_force(jacobian, torque), device.tip_hessian(q))
        if np.linalg.norm(direction @ jacobian) <= 1e-9 * length * max(float(np.linalg.norm(jacobian)), 1e-300):
            raise PoseError(
                f"{device.name} cannot be pushed along {direction.tolist()} at {q.tolist()}: choose another direction "
                "or a pose off the singularity"
            )
        tip = cls(
            inertia,
            -inertia @ a_v,
            -inertia @ a_q - geometric_stiffness,
            jacobian,
            direction / length,
            f"{device.name} along {np.round(direction / length, 6).tolist()}",
        )
        return tip if arm is None else tip.coupled_to(arm)

    def coupled_to(self, arm: HumanArm) -> LinearDevice:
        """Return this device coupled to ``arm``, rigidly or through fingertip tissue."""
        grip = (
            "gripped rigidly by"
            if arm.tissue_stiffness is None
            else f"held through fingertip tissue of {arm.tissue_stiffness:g} N/m by"
        )
        inertia, damping, stiffness, jacobian = couple_arm(
            self.inertia, self.damping, self.stiffness, self.jacobian, arm
        )
        return replace(
            self,
            inertia=inertia,
            damping=damping,
            stiffness=stiffness,
            jacobian=jacobian,
            name=f"{self.name}, {grip} an arm of {arm.mass:g} kg, {arm.damping:g} N s/m, {arm.stiffness:g} N/m",
        )

    @property
    def apparent_mass(self) -> float:
        """Apparent mass at the tip along the line, kg."""
        jacobian_along = self.along @ self.jacobian
        return float(1 / (jacobian_along @ np.linalg.solve(self.inertia, jacobian_along)))

    @property
    def state_space(self) -> control.StateSpace:
        """Continuous system from force (N) to motion (m) along the line, without unreachable modes."""
        root = np.linalg.cholesky(self.inertia)
        inverse = np.linalg.inv(root)
        jacobian_along = inverse @ (self.jacobian.T @ self.along)
        d, s = inverse @ self.damping @ inverse.T, inverse @ self.stiffness @ inverse.T
        basis = _reachable(jacobian_along, (d, s))
        n = basis.shape[1]
        zero = np.zeros((n, n))
        force = basis.T @ jacobian_along
        return control.StateSpace(
            np.block([[zero, np.eye(n)], [-basis.T @ s @ basis, -basis.T @ d @ basis]]),
            np.concatenate([np.zeros(n), force])[:, None],
            np.concatenate([force, np.zeros(n)])[None, :],
            np.zeros((1, 1)),
        )


def couple_arm(
    inertia: Array, damping: Array, stiffness: Array, jacobian: Array, arm: HumanArm
) -> tuple[Array, Array, Array, Array]:
    """Return M, D, S (..., n, n) and J (..., axes, n) of a device, or of a stack of devices, coupled to ``arm``.

    A rigid grip adds to the device. Behind fingertip tissue the arm is one more coordinate per axis, after those of
    the device.
    """
    transposed = np.swapaxes(jacobian, -1, -2)
    if arm.tissue_stiffness is None:
        extra = transposed @ jacobian
        return inertia + arm.mass * extra, damping + arm.damping * extra, stiffness + arm.stiffness * extra, jacobian
    axes, n = jacobian.shape[-2:]
    eye = np.broadcast_to(np.eye(axes), (*jacobian.shape[:-2], axes, axes))
    stretch = np.concatenate([jacobian, -eye], axis=-1)  # of the tissue
    between = np.swapaxes(stretch, -1, -2) @ stretch

    def join(device: Array, hand: float, tissue: float) -> Array:
        joined = tissue * between
        joined[..., :n, :n] += device
        joined[..., n:, n:] += hand * eye
        return np.asarray(joined, dtype=float)

    return (
        join(inertia, arm.mass, 0.0),
        join(damping, arm.damping, arm.tissue_damping),
        join(stiffness, arm.stiffness, arm.tissue_stiffness),
        np.concatenate([jacobian, np.zeros_like(eye)], axis=-1),
    )


def _reachable(start: Array, maps: tuple[Array, ...], tolerance: float = 1e-10) -> Array:
    """Return an orthonormal basis (n, k) of the smallest invariant subspace of ``maps`` that contains ``start``."""
    columns = [start / np.linalg.norm(start)]
    index = 0
    while index < len(columns) < len(start):
        for matrix in maps:
            image = matrix @ columns[index]
            size = np.linalg.norm(matrix)
            for _ in range(2):  # second pass of Gram-Schmidt, for accuracy
                for column in columns:
                    image = image - column * (column @ image)
            if np.linalg.norm(image) > tolerance * max(float(size), 1e-300):
                columns.append(image / np.linalg.norm(image))
        index += 1
    return np.array(columns[: len(start)]).T


@dataclass(frozen=True)
class SampledDevice:
    """Exact discretization of a device with zero-order hold and delay.

    x_{k+1} = x_k + step x_k + now u_{k-n} + before u_{k-n-1}; tip = out x_k, with n whole samples of delay.

    Attributes:
        step: A - I (n, n), stored as a difference for the accuracy of slow modes.
        now: response to the force in the last part of a period (n,).
        before: response to the previous force in the first part (n,); zero for a whole number of samples.
        out: (n,).
        whole: whole samples of delay.
        period: s.
    """

    step: Array
    now: Array
    before: Array
    out: Array
    whole: int
    period: float

    @property
    def fractional(self) -> bool:
        """Whether the delay is not a whole number of samples."""
        return bool(np.any(self.before))

    def response(self, angle: Array) -> Complex:
        """Return tip motion per force (k,), m/N, delay included, at e^{j angle}; angle (k,) in rad per sample."""
        theta = np.asarray(angle, dtype=float)
        z_minus_one = -2 * np.sin(theta / 2) ** 2 + 1j * np.sin(theta)  # without cancellation
        n = len(self.step)
        force = self.now[None, :] + self.before[None, :] * np.exp(-1j * theta)[:, None]
        if n == 2:  # closed form for a mass
            (a, b), (c, d) = -self.step
            det = (z_minus_one + a) * (z_minus_one + d) - b * c
            first = ((z_minus_one + d) * force[:, 0] - b * force[:, 1]) / det
            second = ((z_minus_one + a) * force[:, 1] - c * force[:, 0]) / det
            compliance = self.out[0] * first + self.out[1] * second
        else:
            matrix = z_minus_one[:, None, None] * np.eye(n) - self.step
            compliance = np.linalg.solve(matrix, force[:, :, None])[:, :, 0] @ self.out
        return np.asarray(compliance * np.exp(-1j * self.whole * theta), dtype=complex)


def discretize_zoh(device: LinearDevice | control.StateSpace, period: float | str, delay: float = 0.0) -> SampledDevice:
    """Return ``device`` behind a zero-order hold of ``period`` (s) and ``delay`` (samples, may be fractional).

    Args:
        device: a LinearDevice, or a continuous SISO state space from force (N) to motion (m).

    Raises:
        StabilityError: a period that is not positive, a negative delay, a device that is sampled, has several
            inputs or outputs, or has a direct feedthrough.
    """
    t = positive(period, "period", "s (a rate of zero has none)")
    n = not_negative(delay, "delay", "samples (a negative one would not be causal)")
    if n > MAX_DELAY:
        raise StabilityError(f"delay: {n:g} samples; the most is {MAX_DELAY}")
    system = device.state_space if isinstance(device, LinearDevice) else device
    if not isinstance(system, control.StateSpace):
        raise StabilityError(
            f"the device must be a LinearDevice or a continuous control.StateSpace, not {type(device).__name__}; "
            "for an arm use LinearDevice.at_pose(arm, pose, along=(0, 0, 1))"
        )
    if system.isdtime(strict=True) or (system.ninputs, system.noutputs) != (1, 1):
        raise StabilityError(
            "the device must be continuous, from one force to one displacement; palpate discretizes it exactly"
        )
    if np.any(system.D):
        raise StabilityError("the device has a direct feedthrough: its D must be zero; add inertia")
    whole = int(np.floor(n + 1e-12))
    part = n - whole
    part = 0.0 if part < 1e-12 else part
    step, after = _zoh(system.A, system.B[:, 0], (1 - part) * t)
    before = np.zeros_like(after)
    if part > 0:
        early, first = _zoh(system.A, system.B[:, 0], part * t)
        before = first + step @ first
        step = early + step + step @ early
    return SampledDevice(step, after, before, np.asarray(system.C[0], float), whole, t)


def _zoh(a: Array, b: Array, time: float) -> tuple[Array, Array]:
    """Return e^{a t} - I (n, n) and the integral of e^{a s} b over [0, t] (n,), each to full relative accuracy."""
    n = len(a)
    # blocks of expm([[a, I], [0, 0]] t): the integral of e^{as}, from which both follow without cancellation
    big = np.zeros((2 * n, 2 * n))
    big[:n, :n], big[:n, n:] = a, np.eye(n)
    integral = np.asarray(expm(big * time)[:n, n:], dtype=float)
    return a @ integral, integral @ b
