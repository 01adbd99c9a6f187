"""States that each cell of a map over stiffness and damping must have: from statics, the arm's lengths, the exact loop.

Nothing here uses the verdict of a run, the device's inverse or its Jacobian, which is differenced where it is needed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from palpate import simulate
from palpate.arrays import Array, Flags
from palpate.devices import Device
from palpate.scenario import Scenario
from palpate.simulation.controllers import build_controller
from palpate.simulation.decision import BAND
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.verdict import State
from palpate.stability.maps.zwidth_map import loop_radii
from scipy.optimize import root

UPPER, FORE = 0.215, 0.170  # m, lengths of the PHANToM Premium 1.5A
SHOULDER = np.array([0.0, FORE, -UPPER])  # m, from the tip at zero angles
NEAR = 0.98  # of the reach: rests beyond it have a linear run, whose overshoot may leave the reach
CLASSES = ("settles", "unstable", "beyond reach", "overshoots the reach", "drive limit", "rests off")
RIGHT = {
    "settles": {State.SETTLED},
    "unstable": {State.UNSTABLE, State.BOUNDED_OSCILLATION},
    "beyond reach": {State.OUT_OF_REACH},
    "overshoots the reach": {State.OUT_OF_REACH},
    "drive limit": {State.DRIVE_LIMIT},
    "rests off": {State.UNDECIDED},  # more than BAND from force over stiffness
}


def expected_classes(tables: dict[str, Any], k: Array, b: Array) -> tuple[NDArray[np.int_], NDArray[np.bool_]]:
    """Return the class of each cell (n, m) as an index of CLASSES, and whether its linear loop is stable.

    Args:
        tables: of the scenario; its controller is kept in all cells.
        k, b: stiffness, N/m, and damping, N s/m, of the cells (n, m).
    """
    s = Scenario.from_dict(tables)
    stable = np.asarray(loop_radii(scenario_loop(s), k.ravel(), b.ravel()).reshape(k.shape) < 1.0)
    classes = np.where(stable, 0, 1)
    if s.device.saturation:
        classes[_warm(s, _held_by_motors(s, k))] = 4
    if s.reference is not None and s.load_device().dof == 3:
        assert s.reference.force is not None
        start = s.load_device().forward(np.array(s.start.pose))
        rest = start + np.array(s.reference.force) / k[..., None]
        classes[stable & _outside(rest)] = 2
        if s.device.model == "nonlinear":
            near = (classes == 0) & _outside(rest, NEAR)
            classes[near] = np.where(_overshoots(tables, k[near], b[near]), 3, 0)
        if s.device.model == "experimental":
            classes[(classes == 0) & (static_error(s, k) > BAND)] = 5
    return classes, stable


def static_error(s: Scenario, k: Array) -> Array:
    """Return the relative error from force over stiffness of the rest of an identified model under a gain (n, m).

    Its poles at z = 1 rest where the torque is the working torque: J(q)^T (G (F - K d) + h) = J(q0)^T h, with the
    constant hold h of gravity. J changes with the pose, so the command G (F - K d) is not zero there.
    """
    assert s.reference is not None
    assert s.reference.force is not None
    device, start = s.load_device(), np.array(s.start.pose)
    force, gain = np.array(s.reference.force), np.diag(build_controller(s, device, start).system.D)
    at_start = device.gravity(start)
    hold = np.linalg.solve(_jacobian(device, start).T, at_start)
    tip = device.forward(start)

    def error(stiffness: float) -> float:
        def torque(q: Array) -> Array:
            wanted = force - stiffness * (device.forward(q) - tip)
            return np.asarray(_jacobian(device, q).T @ (gain * wanted + hold) - at_start)

        rest = root(torque, start, tol=1e-12)
        assert rest.success
        return float(np.abs(stiffness * (device.forward(rest.x) - tip) / force - 1.0).max())

    values, index = np.unique(k, return_inverse=True)
    return np.array([error(float(value)) for value in values])[index].reshape(k.shape)


def right_states(classes: NDArray[np.int_], states: NDArray[np.int_], stable: Flags) -> NDArray[np.bool_]:
    """Return whether cells have a right state; an unstable loop at a limit of reach or drive may have either."""
    right = np.zeros(classes.shape, dtype=bool)
    for index, name in enumerate(CLASSES):
        right |= (classes == index) & np.isin(states, list(RIGHT[name]))
    return right | (~stable & np.isin(states, list(RIGHT["unstable"])))


def far(stable: Flags) -> NDArray[np.bool_]:
    """Return which cells are more than two cells from the exact boundary between stable and unstable ones."""
    padded = np.pad(stable, 2, mode="edge")
    window = np.lib.stride_tricks.sliding_window_view(padded, (5, 5))
    return np.asarray(np.all(window == stable[..., None, None], axis=(2, 3)))


def _outside(tip: Array, share: float = 1.0) -> NDArray[np.bool_]:
    """Return whether tips (..., 3) are farther from the shoulder than a share of the stretched arm."""
    return np.asarray(np.linalg.norm(tip - SHOULDER, axis=-1) > share * (UPPER + FORE))


def _jacobian(device: Device, q: Array, step: float = 1e-5) -> Array:
    """Return the tip's motion per joint angle (3, dof), m/rad, by central differences of the forward kinematics."""
    columns = [(device.forward(q + d) - device.forward(q - d)) / (2.0 * step) for d in step * np.eye(len(q))]
    return np.stack(columns, axis=1)


def _overshoots(tables: dict[str, Any], k: Array, b: Array) -> NDArray[np.bool_]:
    """Return whether the tip of the linear device leaves the arm's reach on its way to rest (n,)."""
    s = Scenario.from_dict(tables)
    law = build_controller(s, s.load_device(), np.array(s.start.pose))
    linear = {**tables["device"], "model": "linear", "kinematics": "linear"}
    out = []
    for stiffness, damping in zip(k, b, strict=True):
        spring = {"kind": "spring", "stiffness": f"{stiffness} N/m", "damping": f"{damping} N*s/m"}
        trace = simulate({**tables, "device": linear, "object": spring}, law)
        out.append(bool(_outside(trace["tip"]).any()))
    return np.array(out, dtype=bool)


def _warm(s: Scenario, force: Array) -> NDArray[np.bool_]:
    """Return whether motors that hold a force, N, get so warm within 0.8 of the run that they cannot.

    The temperature follows (force / continuous force)^2 with one time constant. From 0.9 on the limit falls from the
    peak force to the continuous force at 1.
    """
    device = s.load_device()
    peak, continuous = device.peak_force, device.continuous_force
    reached = (force / continuous) ** 2 * -np.expm1(
        -0.8 * s.run.duration / device.parameters.one("drive.thermal_time", 1.0)
    )
    return np.asarray(reached > 0.9 + 0.1 * (peak - force) / (peak - continuous), dtype=bool)


def _held_by_motors(s: Scenario, k: Array) -> Array:
    """Return the force of a wall of stiffness K on a rigidly gripped tip, which the motors give at rest, N."""
    assert s.operator.force is not None
    assert s.operator.tissue_stiffness is None
    push = float(np.linalg.norm(s.operator.force))
    return np.asarray(push * k / (k + (s.operator.stiffness or 0.0)))
