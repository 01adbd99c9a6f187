"""Exact linearization of a device about a pose, in joint torque or in tip force.

The derivatives come from dual numbers, not from finite differences.
"""

from __future__ import annotations

from os import PathLike
from typing import Literal

import control
import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.devices import Device, load
from palpate.errors import PoseError
from palpate.units import array_to_si

AXES = ("x", "y", "z")


def linearize(
    device: Device | str | PathLike[str],
    q: ArrayLike,
    qd: ArrayLike | None = None,
    tau: ArrayLike | None = None,
    *,
    inputs: Literal["torque", "force"] = "torque",
    outputs: Literal["angle", "tip", "object_force"] = "angle",
    force: ArrayLike | None = None,
    stiffness: ArrayLike | None = None,
) -> control.StateSpace:
    """Return the continuous linear model of small deviations from the pose ``q``.

    States are (dq, dqd), 2*dof of them, in rad and rad/s (m and m/s for a prismatic device).
    Numbers are SI; `q` to `stiffness` may also be text with a unit, or a list of such texts.

    Args:
        device: a device, or its name in the catalog or the path of its file.
        q: pose (dof,), rad.
        qd: joint velocity (dof,), rad/s; zero if not given.
        tau: joint torque (dof,), N m, of the working point; if not given, the gravity torque N(q).
        inputs: ``"torque"``: deviation of the joint torque (dof inputs, N m); ``"force"``: deviation
            u of a tip force (3 inputs, N, base frame) that acts through the transposed Jacobian,
            tau = J(q)^T (force + u).
        outputs: ``"angle"``: dq (dof, rad); ``"tip"``: dp = J dq (3, m); ``"object_force"``:
            diag(stiffness) dp (3, N), the force of a spring anchored at the start tip.
        force: for ``inputs="force"``, the constant tip force (3,), N, held at the pose; if not given,
            the smallest one with J^T force = tau. Because J changes with the pose, it adds
            M^-1 d(J^T force)/dq to the position columns.
        stiffness: N/m, one value or three (x, y, z); only for ``outputs="object_force"``.

    Raises:
        PoseError: wrong shape, a value that is not finite, or a pose where the tip force cannot
            produce the torque (singular Jacobian).
        DeviceError: there is no such device.

    With a_q, a_v, a_tau the derivatives of the acceleration, A = [0 I; a_q + a_tau F_q  a_v],
    B = [0; a_tau J^T], F_q = sum_k force_k d2p_k/dq2.
    """
    device = load(device)
    n = device.dof
    joint = device.joint_unit
    pose = _vector(q, n, "q", joint)
    speed = np.zeros(n) if qd is None else _vector(qd, n, "qd", f"{joint}/s")
    torque = device.gravity(pose) if tau is None else _vector(tau, n, "tau", device.torque_unit)
    a_q, a_v, a_tau = device.linearization(pose, speed, torque)
    jacobian = device.jacobian(pose)
    gain, geometric_stiffness, input_names = _input(device, pose, torque, jacobian, inputs, force)
    position, output_names = _output(jacobian, outputs, stiffness)
    zero = np.zeros((n, n))
    return control.StateSpace(
        np.block([[zero, np.eye(n)], [a_q + a_tau @ geometric_stiffness, a_v]]),
        np.vstack([np.zeros((n, gain.shape[1])), a_tau @ gain]),
        np.hstack([position, np.zeros((position.shape[0], n))]),
        np.zeros((position.shape[0], gain.shape[1])),
        states=[f"angle[{i + 1}]" for i in range(n)] + [f"velocity[{i + 1}]" for i in range(n)],
        inputs=input_names,
        outputs=output_names,
    )


def _input(
    device: Device, pose: Array, torque: Array, jacobian: Array, inputs: str, force: ArrayLike | None
) -> tuple[Array, Array, list[str]]:
    """Return the map from input to torque (dof, m), the geometric stiffness (dof, dof), N m/rad, and input names."""
    n = device.dof
    if inputs == "torque":
        if force is not None:
            raise PoseError('linearize: force is only for inputs="force"; with inputs="torque" pass tau')
        return np.eye(n), np.zeros((n, n)), [f"torque[{i + 1}]" for i in range(n)]
    if inputs == "force":
        require_regular(jacobian, pose)
        constant = static_tip_force(jacobian, torque) if force is None else _vector(force, 3, "force", "N")
        geometric_stiffness = np.einsum("k,kij->ij", constant, device.tip_hessian(pose))
        return jacobian.T, geometric_stiffness, [f"force[{a}]" for a in AXES]
    raise PoseError(f'linearize: inputs must be "torque" or "force", not {inputs!r}')


def _output(jacobian: Array, outputs: str, stiffness: ArrayLike | None) -> tuple[Array, list[str]]:
    """Return the map from pose to output (p, dof), and output names."""
    n = jacobian.shape[1]
    if outputs == "object_force":
        if stiffness is None:
            raise PoseError('linearize: outputs="object_force" needs the object\'s stiffness in N/m')
        k = np.broadcast_to(array_to_si(stiffness, "N/m", "linearize: stiffness", error=PoseError), (3,))
        if not np.all(np.isfinite(k)) or np.any(k < 0):
            raise PoseError(f"linearize: stiffness must be finite and not negative in N/m, not {k.tolist()}")
        return k[:, None] * jacobian, [f"object_force[{a}]" for a in AXES]
    if stiffness is not None:
        raise PoseError('linearize: stiffness is only for outputs="object_force"')
    if outputs == "tip":
        return jacobian, [f"tip[{a}]" for a in AXES]
    if outputs == "angle":
        return np.eye(n), [f"angle[{i + 1}]" for i in range(n)]
    raise PoseError(f'linearize: outputs must be "angle", "tip" or "object_force", not {outputs!r}')


def static_tip_force(jacobian: Array, torque: Array) -> Array:
    """Return the smallest tip force (3,), N, with J^T force = torque; J is (3, dof) m/rad."""
    return np.asarray(np.linalg.lstsq(jacobian.T, torque, rcond=None)[0], dtype=float)


def require_regular(jacobian: Array, pose: Array, limit: float = 1e-9) -> None:
    """Raise PoseError if the smallest singular value of J is under ``limit`` times the largest."""
    s = np.linalg.svd(jacobian, compute_uv=False)
    if s[-1] <= limit * s[0]:
        raise PoseError(
            f"the Jacobian is singular at q = {np.round(pose, 6).tolist()} rad (singular values "
            f"{', '.join(f'{v:.3g}' for v in s)} m/rad): choose a pose off the singularity, or inputs in torque"
        )


def _vector(value: ArrayLike, n: int, name: str, unit: str) -> Array:
    v = array_to_si(value, unit, name, error=PoseError)
    if v.shape != (n,):
        raise PoseError(f"{name} must be {n} values in {unit}, not an array of shape {v.shape}")
    if not np.all(np.isfinite(v)):
        raise PoseError(f"{name} must be finite in {unit}, not {v.tolist()}")
    return v
