"""Performance measures of a device at a pose, by the names of Hayward & Astley (1996), and its hybrid two-port.

Hayward & Astley, Performance measures for haptic interfaces, Robotics Research: the 7th International Symposium, 1996,
name the measures; the formulas are those of the docstrings. A direction is a unit vector e in which the tip can move.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array, Complex
from palpate.checks import not_negative
from palpate.devices import Device
from palpate.errors import PoseError, StabilityError
from palpate.metrics.loop_response import LoopResponse, hold_response
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenario

__all__ = [
    "DeviceMeasures",
    "TwoPort",
    "device_measures",
    "moving_axes",
    "moving_force",
    "peak_acceleration",
    "peak_force",
    "tip_inertia",
    "two_port",
]

SINGULAR = 1e-6  # least ratio of the Jacobian's singular values


@dataclass(frozen=True)
class DeviceMeasures:
    """Performance measures of a device at a pose; pairs are the least and the largest along the tip's principal axes.

    Attributes:
        peak_force: tip force that the motors add to the weight, N; inf: no limit is given.
        continuous_force: the same that they hold for long, N.
        peak_acceleration: of the tip from rest, m/s^2.
        tip_mass: apparent mass, kg.
        kinematic_isotropy: least over largest singular value of the Jacobian, 0 to 1 (Salisbury & Craig 1982).
        inertial_isotropy: least over largest apparent mass, 0 to 1 (Asada 1983).
        moving_force: least tip force that moves a joint against its breakaway friction, N.
        dynamic_range: least ratio of peak force to moving force along one axis, dB; inf without dry friction or limit.
        resolution: tip motion of one encoder count, of the coarsest joint, m; 0 without encoder.
    """

    peak_force: tuple[float, float]
    continuous_force: tuple[float, float]
    peak_acceleration: tuple[float, float]
    tip_mass: tuple[float, float]
    kinematic_isotropy: float
    inertial_isotropy: float
    moving_force: tuple[float, float]
    dynamic_range: float
    resolution: float


def device_measures(device: Device, pose: ArrayLike) -> DeviceMeasures:
    """Return the performance measures of a device at a pose (dof,), rad.

    Raises:
        PoseError: the pose is singular.
    """
    q = np.asarray(pose, dtype=float)
    inertia = tip_inertia(device, q)
    masses, axes = np.linalg.eigh(inertia)
    directions = np.concatenate([axes.T, -axes.T]) @ moving_axes(device, q).T
    values = np.linalg.svd(device.jacobian(q), compute_uv=False)
    peak = np.array([peak_force(device, q, e) for e in directions])
    moving = np.array([moving_force(device, q, e) for e in directions])
    ratio = np.divide(peak, moving, out=np.full_like(peak, np.inf), where=moving > 0.0)
    steps = np.linalg.norm(device.jacobian(q), axis=0) * device.encoder_step
    return DeviceMeasures(
        _ends(peak),
        _ends(np.array([_most(device, q, e, device.continuous_force) for e in directions])),
        _ends(np.array([peak_acceleration(device, q, e) for e in directions])),
        _ends(masses),
        float(values[-1] / values[0]),
        float(masses[0] / masses[-1]),
        _ends(moving),
        float(20.0 * np.log10(ratio.min())),
        float(steps.max()),
    )


def tip_inertia(device: Device, pose: Array) -> Array:
    """Return the operational-space inertia J^-T M J^-1, kg (Khatib 1987).

    It is (3, 3) with three joints, and (dof, dof) in the axes along which the tip moves with fewer.

    Raises:
        PoseError: the pose is singular.
    """
    inverse = np.linalg.inv(moving_axes(device, pose).T @ device.jacobian(pose))
    return np.asarray(inverse.T @ device.mass_matrix(pose) @ inverse, dtype=float)


def peak_force(device: Device, pose: ArrayLike, direction: ArrayLike) -> float:
    """Return the largest s with motors that give N + s e within their limits; N carries the weight, N.

    The limits are those of the force at the tip and of the torque of each joint.
    """
    return _most(device, np.asarray(pose, dtype=float), np.asarray(direction, dtype=float), device.peak_force)


def peak_acceleration(device: Device, pose: ArrayLike, direction: ArrayLike) -> float:
    """Return the largest acceleration of the tip from rest along a direction with the motors' limits, m/s^2.

    It is the largest a with N + a L e within the limits, where L is the inertia of the tip and N carries the weight.
    """
    q, e = np.asarray(pose, dtype=float), np.asarray(direction, dtype=float)
    axes = moving_axes(device, q)
    force = axes @ tip_inertia(device, q) @ axes.T @ (e / np.linalg.norm(e))
    return most_within_limits(device, device.jacobian(q), _weight(device, q), force, device.peak_force)


def moving_force(device: Device, pose: ArrayLike, direction: ArrayLike) -> float:
    """Return the least tip force along a direction that moves a joint: min_i breakaway_i / |e . J_i|, N."""
    e = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    lever = np.abs(e @ device.jacobian(pose))
    seen = lever > 1e-9 * lever.max(initial=0.0)
    return float(np.min(device.breakaway[seen] / lever[seen], initial=np.inf))


def most_within_limits(device: Device, jacobian: Array, constant: Array, force: Array, limit: float) -> float:
    """Return the largest s >= 0 with constant + s force, N at the tip, within a force limit and the torque limits."""
    most = float("inf")
    if np.isfinite(limit):
        a, b, c = force @ force, force @ constant, constant @ constant - limit**2
        if c >= 0.0:
            return 0.0
        most = float((-b + np.sqrt(b * b - a * c)) / a)
    still, moving = jacobian.T @ constant, jacobian.T @ force
    for torque, held, share in zip(device.peak_torque, still, moving, strict=True):
        if np.isfinite(torque) and share != 0.0:
            most = min(most, float((np.copysign(torque, share) - held) / share))
    return max(most, 0.0)


def _most(device: Device, pose: Array, direction: Array, limit: float) -> float:
    e = direction / np.linalg.norm(direction)
    return most_within_limits(device, device.jacobian(pose), _weight(device, pose), e, limit)


def _weight(device: Device, pose: Array) -> Array:
    """Return the tip force (3,) that carries the weight, N."""
    axes = moving_axes(device, pose)
    return np.asarray(axes @ np.linalg.solve((axes.T @ device.jacobian(pose)).T, device.gravity(pose)), dtype=float)


def moving_axes(device: Device, pose: Array) -> Array:
    """Return an orthonormal basis (3, dof) of the directions in which the tip moves; the identity with three joints.

    Raises:
        PoseError: the pose is singular.
    """
    left, values, _ = np.linalg.svd(device.jacobian(pose), full_matrices=False)
    if len(values) < device.dof or values[-1] < SINGULAR * values[0]:
        raise PoseError("the pose is singular, so the tip's inertia is not defined; choose a pose off the singularity")
    return np.eye(3) if device.dof == 3 else np.asarray(left, dtype=float)


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


@dataclass(frozen=True, eq=False)
class TwoPort:
    """Hybrid two-port of an impedance display: [F_h; -v_e] = [h11 h12; h21 h22] [v_h; F_e].

    F_h and v_h are force and velocity at the operator, F_e and v_e those of the virtual environment. Perfect
    transparency is h11 = h22 = 0, h12 = 1, h21 = -1 (Hannaford 1989; Lawrence 1993).

    Attributes:
        frequency: (k,), Hz.
        h11: impedance of the free device, N s/m, (k,).
        h12: force transmission: hold, delay and controller, (k,).
        h21: velocity transmission, (k,).
        h22: admittance of the virtual coupling, m/(N s), (k,); 0 without.
    """

    frequency: Array
    h11: Complex
    h12: Complex
    h21: Complex
    h22: Complex

    def transmitted(self, environment: ArrayLike) -> Complex:
        """Return the impedance that the operator meets, h11 - h12 h21 Z_e/(1 + h22 Z_e), of Z_e (k,), N s/m."""
        z = np.asarray(environment, dtype=complex)
        return np.asarray(self.h11 - self.h12 * self.h21 * z / (1.0 + self.h22 * z), dtype=complex)

    @property
    def width(self) -> Complex:
        """Return the change of the transmitted impedance from no environment to a rigid one, -h12 h21/h22, N s/m."""
        with np.errstate(divide="ignore", invalid="ignore"):
            value = -self.h12 * self.h21 / self.h22
        return np.asarray(np.where(self.h22 == 0.0, np.inf, value), dtype=complex)

    @property
    def force_error(self) -> Array:
        """Return |h12 - 1|, relative error of the force that reaches the operator, (k,)."""
        return np.asarray(np.abs(self.h12 - 1.0), dtype=float)


def two_port(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    frequency: ArrayLike,
    along: ArrayLike,
    *,
    coupling_stiffness: float | str = 0.0,
    coupling_damping: float | str = 0.0,
) -> TwoPort:
    """Return the hybrid two-port of an impedance display at its start, along one direction.

    The samples of the environment are taken as its force at the same frequency: aliases are left out, which
    `LoopResponse.displacement` includes.

    Args:
        scenario: an impedance display on a spring or wall, which is not part of the two-port.
        frequency: (k,), Hz.
        along: direction (3,).
        coupling_stiffness: k_c of a virtual coupling before the environment, N/m.
        coupling_damping: b_c of it, N s/m, by backward difference.

    Raises:
        StabilityError: the loop tracks a force, or the frequencies are out of range.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`.
    """
    s = read_scenario(scenario)
    if s.servo.topology != "impedance_display":
        raise StabilityError('two_port: the loop tracks a force; write servo.topology = "impedance_display"')
    loop = LoopResponse.of(s)
    f, n = np.atleast_1d(np.asarray(frequency, dtype=float)), np.asarray(along, dtype=float)
    n = n / np.linalg.norm(n)
    stiffness = not_negative(coupling_stiffness, "coupling_stiffness", "N/m")
    damping = not_negative(coupling_damping, "coupling_damping", "N*s/m")
    free = np.array(1.0 / (2j * np.pi * f * (n @ loop.displacement(f, object_on=False) @ n)), dtype=complex)
    z = np.exp(2j * np.pi * f * loop.period)
    law = loop.controller.feedback
    gain = np.array([n @ (law.C @ np.linalg.solve(one * np.eye(law.nstates) - law.A, law.B) + law.D) @ n for one in z])
    force = -gain * hold_response(f, loop.period) * z**-loop.delay
    none = np.zeros(len(f), dtype=complex)
    coupled = stiffness > 0.0 or damping > 0.0
    admittance = 1.0 / (damping + stiffness * loop.period * z / (z - 1.0)) if coupled else none
    back = np.full(len(f), -1.0, dtype=complex)
    return TwoPort(f, free, np.asarray(force, dtype=complex), back, np.asarray(admittance, dtype=complex))
