"""Workspace controller: force tracking that responds alike at every pose and for every stiffness of the object.

The forces are divided by the object's stiffness of their tick, the inertia of the tip is decoupled (Khatib 1987), a
reference model moves to the target within the drive's limit (Workman 1987), and an observer driven by the applied force
estimates a constant disturbance in place of an integrator. The law itself is in the core, `WorkspaceController`.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, Final

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.devices import Device
from palpate.errors import DesignError, PalpateWarning, PoseError
from palpate.units import to_si

_STIFFNESS: Final = 1000.0  # N/m
_DAMPED_ABOVE: Final = 12.0  # |J| |J^+|, as in the core
_MOTION_DAMPING: Final = 0.02  # of the mobility's trace, largest damping, as in the core
_WEIGHT_DAMPING: Final = 2e-4
OPTIONS: Final = {
    "bandwidth": "rad/s",
    "damping": "",
    "observer": "",
    "disturbance": "",
    "reference": "rad/s",
    "reference_damping": "",
    "share": "",
    "stiffness": "N/m",
    "normal_only": None,
    "operator_mass": "kg",
}  # option: unit; None: true or false


@dataclass(frozen=True)
class WorkspaceController:
    """Workspace controller of a device; with fewer than three joints, in the directions in which the tip can move.

    Attributes:
        device: as the controller knows it: kinematics, inertia, gravity and viscous friction.
        period: servo period, s.
        bandwidth: of the feedback, rad/s.
        damping: ratio of the feedback, at most 1.
        observer: rate of the observer of position and velocity over the bandwidth.
        disturbance: rate of the observer of the disturbance over the bandwidth.
        reference: bandwidth of the reference model, rad/s.
        reference_damping: ratio of the reference model, at most 1.
        share: of the drive's limit that the reference model uses, at most 1.
        stiffness: by which forces without a known stiffness are divided, per axis, N/m.
        normal_only: whether an object with a normal is tracked along it alone. Along the surface the motors then
            display the object's force, such as friction, and the operator moves the tip.
        operator_mass: that the operator adds to the tip, kg. With that of the operator or a larger one, a change of
            the object's stiffness neither overshoots nor ends the contact.
    """

    device: Device
    period: float
    bandwidth: float = 200.0
    damping: float = 0.9
    observer: float = 6.0
    disturbance: float = 0.05
    reference: float = 250.0
    reference_damping: float = 1.0
    share: float = 0.85
    stiffness: tuple[float, float, float] = (_STIFFNESS, _STIFFNESS, _STIFFNESS)
    normal_only: bool = False
    operator_mass: float = 0.0

    kind: Final = "workspace"

    def __post_init__(self) -> None:
        if not (self.period > 0 and np.isfinite(self.period)):
            raise DesignError(f"workspace: the servo period must be positive, not {self.period:g} s")
        if fault := self.parameters.fault():
            raise DesignError(f"workspace: {fault}")

    @property
    def parameters(self) -> Any:
        """Parameters of the core's controller."""
        out = _core.WorkspaceParameters()
        for name, unit in OPTIONS.items():
            value = getattr(self, name)
            setattr(
                out, name, np.asarray(value, float) if name == "stiffness" else value if unit is None else float(value)
            )
        return out

    @property
    def gains(self) -> Any:
        """Gains of one axis: `position` (1/s^2), `velocity` (1/s), `observer` (3,), and of the reference model."""
        return _core.WorkspaceGains(self.parameters, self.period)

    @property
    def notes(self) -> dict[str, Any]:
        """Specification and gains, for reports."""
        gains = self.gains
        return {
            **{name: getattr(self, name) for name in OPTIONS},
            "position_gain": gains.position,
            "velocity_gain": gains.velocity,
            "observer_gain": np.asarray(gains.observer).tolist(),
        }

    def linearized(self, pose: ArrayLike) -> Controller:
        """Return the law for small motions about rest at a pose (dof,), rad, without limits, exact to first order.

        Its states are, per axis, the estimate of deflection, velocity and disturbance, and the position and velocity
        of the reference model. It is normalized. With `normal_only` it is that on an object without a normal.

        Raises:
            PoseError: the pose is singular.
        """
        q: Array = np.array(pose, dtype=float)
        jacobian = self.device.jacobian(q)
        if np.linalg.cond(jacobian) > 1e9:
            raise PoseError("workspace: the pose is singular, so the tip's inertia is not defined")
        reach = reachable_axes(jacobian)
        inverse: Array = np.asarray(np.linalg.pinv(jacobian) @ reach, dtype=float)  # (dof, dof)
        inertia = inverse.T @ self.device.mass_matrix(q) @ inverse + self.operator_mass * np.eye(len(inverse))
        friction = inverse.T @ np.diag(self.device.viscous) @ inverse
        scale = reach.T @ np.diag(1.0 / np.asarray(self.stiffness))
        g, t = self.gains, self.period
        correct = np.eye(5)
        correct[:3, 0] -= g.observer
        entry = np.zeros((5, 2))  # from reference and deflection
        entry[:3, 1] = g.observer
        model = np.array([0.0, 0.0, 0.0, -g.reference_position, -g.reference_velocity])
        law = model + np.array([-g.position, -g.velocity, -1.0, g.position, g.velocity])
        step = np.eye(5)
        step[0, 1] = step[3, 4] = t
        step[0, 2], step[1, 2] = 0.5 * t * t, t
        push = np.array([0.5 * t * t, t, 0.0, 0.0, 0.0])  # of the acceleration on the estimate
        follow = np.array([0.0, 0.0, 0.0, 0.5 * t * t, t])  # of the model's acceleration on the model
        ahead = np.array([g.reference_position, 0.0])  # of the reference on both accelerations
        a = (step + np.outer(push, law) + np.outer(follow, model)) @ correct
        b = (step + np.outer(push, law)) @ entry + np.outer(push + follow, ahead)  # the model does not see the entry
        c, d = law @ correct, law @ entry + ahead
        weight = reach.T @ self._gravity_slope(q, inverse)
        eye = np.eye(len(inertia))
        big_a, big_c = np.kron(a, eye), np.kron(c, inertia) + np.kron(np.eye(5)[4], friction)
        big_b = np.hstack([np.kron(b[:, :1], eye) @ scale, np.kron(b[:, 1:], eye) @ scale])
        big_d = np.hstack([d[0] * inertia @ scale, d[1] * inertia @ scale])
        carried = np.hstack([np.zeros_like(weight @ scale), weight @ scale])
        # shares of the forces that act near a singular pose
        motion, held = (_damped_share(jacobian, inertia, share) for share in (_MOTION_DAMPING, _WEIGHT_DAMPING))
        missing = np.kron(push[:, None], np.linalg.inv(inertia))
        big_a = big_a + missing @ (motion - eye) @ big_c
        big_b = big_b + missing @ ((motion - eye) @ big_d + (held - eye) @ carried)
        system = control.StateSpace(big_a, big_b, reach @ motion @ big_c, reach @ (motion @ big_d + held @ carried), t)
        back = np.kron(push[:, None], np.linalg.inv(inertia)) @ reach.T
        return Controller(system, back, self.kind, self.notes).normalized(self.stiffness)

    def _gravity_slope(self, pose: Array, inverse: Array) -> Array:
        """Return the derivative of the tip force that balances gravity by the tip position, (3, dof), N/m."""

        def force(q: Array) -> Array:
            return np.asarray(np.linalg.pinv(self.device.jacobian(q)).T @ self.device.gravity(q), dtype=float)

        h = 1e-5
        slope = np.array([(force(pose + h * e) - force(pose - h * e)) / (2 * h) for e in np.eye(len(pose))]).T
        return np.asarray(slope @ inverse, dtype=float)


def _damped_share(jacobian: Array, inertia: Array, share: float) -> Array:
    """Return the factor (dof, dof) of the tip force near a singular pose, (A + e)^-1 A (A + e)^-1 A with A = L^-1."""
    eye = np.eye(len(inertia))
    if not is_damped(jacobian):
        return eye
    excess = 1.0 - (_DAMPED_ABOVE / _condition(jacobian)) ** 2
    mobility = np.linalg.inv(inertia)
    inverse = np.linalg.inv(mobility + share * excess**2 * np.trace(mobility) * eye)
    return np.asarray(inverse @ mobility @ inverse @ mobility, dtype=float)


def is_damped(jacobian: Array) -> bool:
    """Return whether a pose with this Jacobian (3, dof) is so near a singular one that the force is bounded."""
    return _condition(jacobian) > _DAMPED_ABOVE


def _condition(jacobian: Array) -> float:
    return float(np.linalg.norm(jacobian) * np.linalg.norm(np.linalg.pinv(jacobian)))


def reachable_axes(jacobian: Array) -> Array:
    """Return an orthonormal basis (3, dof) of the directions in which a tip with this Jacobian (3, dof) can move."""
    if jacobian.shape[1] == 3:
        return np.eye(3)
    return np.asarray(np.linalg.svd(jacobian)[0][:, : jacobian.shape[1]], dtype=float)


def workspace(device: Device, period: float | str, **options: Any) -> WorkspaceController:
    """Return the workspace controller of a device.

    A rate above the Nyquist frequency is warned of: it acts within one tick, so noise and encoder counts pass.

    Args:
        device: as the controller knows it.
        period: servo period, s, or text with a unit.
        **options: numbers in SI or text with a unit:

            - bandwidth: of the feedback, rad/s; 200. A larger one settles faster and passes more noise.
            - damping: ratio of the feedback, at most 1; 0.9.
            - observer: rate of the observer of position and velocity over the bandwidth; 6.
            - disturbance: rate of the observer of the disturbance over the bandwidth; 0.05.
            - reference: bandwidth of the reference model, which sets the settling time, rad/s; 250.
            - reference_damping: ratio of the reference model, at most 1; 1.
            - share: of the drive's limit that the reference model uses, at most 1; 0.85.
            - stiffness: by which forces without a known stiffness are divided, N/m, one value or three; 1000.
            - normal_only: True tracks an object with a normal along it alone, and the operator moves the tip along
              the surface; False.
            - operator_mass: that the operator adds to the tip, kg; 0.

    Raises:
        DesignError: an unknown option, or a value out of range.
    """
    unknown = sorted(set(options) - set(OPTIONS))
    if unknown:
        raise DesignError(f'workspace: "{unknown[0]}" is no option; known are {", ".join(OPTIONS)}')
    values: dict[str, Any] = {}
    for name, value in options.items():
        unit = OPTIONS[name]
        if unit is None and not isinstance(value, bool):
            raise DesignError(f"workspace: {name} must be True or False, not {value!r}")
        text = unit is not None and isinstance(value, str)
        values[name] = to_si(value, unit or "", f"workspace: {name}", error=DesignError) if text else value
    if "stiffness" in values:
        values["stiffness"] = tuple(np.broadcast_to(np.asarray(values["stiffness"], dtype=float), (3,)).tolist())
    found = WorkspaceController(device, to_si(period, "s", "workspace: period", error=DesignError), **values)
    _warn_of_fast_rates(found)
    return found


def _warn_of_fast_rates(law: WorkspaceController) -> None:
    """Warn of rates above the Nyquist frequency."""
    nyquist = np.pi / law.period
    observer = law.bandwidth * max(law.observer, law.disturbance)
    for name, rate, remedy in (
        ("feedback", law.bandwidth, "bandwidth"),
        ("observer", observer, "bandwidth or observer"),
        ("reference model", law.reference, "reference"),
    ):
        if rate > nyquist:
            warnings.warn(
                f"workspace: the {name} has a rate of {rate:.4g} rad/s, above the Nyquist frequency of {nyquist:.4g} "
                f"rad/s, so it acts within one tick and passes noise and encoder counts: lower {remedy}, or shorten "
                "the servo period",
                PalpateWarning,
                stacklevel=3,
            )
            return
