"""Steps of force at many poses of a device: the bound of its drive, and the settling of a controller."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.control import WorkspaceController
from palpate.devices import Device, load
from palpate.errors import DesignError, PoseError
from palpate.linear.linearization import static_tip_force
from palpate.metrics.device_performance import most_within_limits, moving_axes, tip_inertia
from palpate.simulation import simulate
from palpate.tuning.axis import BAND
from palpate.units import write

__all__ = [
    "FEW",
    "Press",
    "Settled",
    "choose",
    "draw_poses",
    "draw_presses",
    "drive_bound",
    "hold_time",
    "run_presses",
    "share_within_reach",
]

CONDITION: Final = 4.0  # largest condition number of the Jacobian of a pose and along a way
TURN: Final = np.pi / 2  # rad, range of a joint without limits about the working pose
SLIDE: Final = 0.1  # m, the same of a sliding joint
WORST: Final = 10  # presses with the largest bound that are simulated
OTHERS: Final = 6  # more, at random
FEW: Final = 0.1  # share of presses within reach below which the range of stiffness is refused
NEAR: Final = 1.5  # rad or m, largest change of the pose along a way


@dataclass(frozen=True, eq=False)
class Press:
    """Step of force from rest.

    Attributes:
        pose: (dof,), rad.
        direction: unit vector (3,).
        bound: least settling time that the drive allows, s.
    """

    pose: Array
    direction: Array
    bound: float


@dataclass(frozen=True, eq=False)
class Settled:
    """Settling of several presses.

    Attributes:
        times: last time outside 5 % of the target, s; inf: not settled within the run.
        overshoot: relative.
    """

    times: Array
    overshoot: Array


def drive_bound(device: Device, pose: ArrayLike, direction: ArrayLike, force: float, stiffness: float) -> float:
    """Return the least time in which the drive brings the tip to 5 % of a force on a spring and keeps it there, s.

    The tip starts at rest and moves straight, with the inertia of the start and without friction. The operator exerts
    the force from the first tick. The motors accelerate with all that they have, then brake with all that they have,
    which is less. The way ends at 105 % of the target. With equal limits F_max of both it is

        (2 sqrt(1.05) - sqrt(0.2)) sqrt(d |L e| / F_max),    d = force / stiffness.

    Args:
        device: with one to three joints.
        pose: (dof,), rad or m.
        direction: of the force, (3,), in which the tip can move.
        force: N.
        stiffness: of the spring, N/m.

    Returns:
        inf: the motors cannot hold the force or brake.
    """
    q = np.asarray(pose, dtype=float)
    along = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    jacobian = device.jacobian(q)
    motors = static_tip_force(jacobian, device.gravity(q)) - force * along  # that hold the tip at the target
    axes = moving_axes(device, q)
    inertia = axes @ tip_inertia(device, q) @ axes.T @ along
    most = device.peak_force
    go, brake = (most_within_limits(device, jacobian, motors, side * inertia, most) for side in (1.0, -1.0))
    if not (go > 0.0 and brake > 0.0):
        return float("inf")
    if np.isinf(go) and np.isinf(brake):
        return 0.0
    way = force / stiffness
    speed = np.sqrt(2.1 * way / (1.0 / go + 1.0 / brake))
    return float(speed / go + speed / brake - np.sqrt(0.2 * way / brake))


def hold_time(device: Device, pose: ArrayLike, direction: ArrayLike, force: float, stiffness: float = np.inf) -> float:
    """Return the time for which cold motors hold a force at the tip, s; inf if it is at most the continuous force.

    The motors carry the weight as well. The pose on the way counts at which they carry most. Until the least time of
    `drive_bound` they have given their peak force. Then `Device.limit_time` counts.

    Args:
        device: with one to three joints.
        pose: at which the press begins (dof,), rad or m.
        direction: of the force, (3,).
        force: N.
        stiffness: of the spring, N/m; inf: the tip stays where it is.

    Raises:
        PoseError: the target is beyond the device's reach.
    """
    q = np.asarray(pose, dtype=float)
    along = np.asarray(direction, dtype=float) / np.linalg.norm(direction)
    rating, peak = device.continuous_force, device.peak_force
    if np.isinf(rating):
        return float("inf")
    held = max(
        float(np.linalg.norm(static_tip_force(device.jacobian(at), device.gravity(at)) - force * along))
        for at in _way(device, q, along * force / stiffness)
    )
    if held <= rating:
        return float("inf")
    bound = 0.0 if np.isinf(stiffness) or np.isinf(peak) else drive_bound(device, q, along, force, stiffness)
    warm = -((peak / rating) ** 2) * np.expm1(-bound / device.thermal_time) if 0.0 < bound < np.inf else 0.0
    return device.limit_time(held, warm)


def _way(device: Device, pose: Array, way: Array) -> list[Array]:
    """Return poses along a way of the tip (3,), m, from a pose on; the pose alone without a way."""
    found = [pose]
    if way.any():
        tip = device.forward(pose)
        for share in np.linspace(0.0, 1.0, 5)[1:]:
            found.append(device.inverse(tip + share * way, found[-1]))
    return found


def draw_poses(device: Device, start: Array, count: int, seed: int = 1) -> Array:
    """Return random poses (count, dof) on the start's side of singular poses, the start first.

    The condition number of the Jacobian is at most 4. A joint lies within its limits, or within a quarter turn of the
    start.

    Raises:
        DesignError: hardly any pose meets this.
    """
    generator = np.random.default_rng(seed)
    low, high = device.joint_limits
    spread = TURN if device.model.revolute else SLIDE
    low, high = np.where(np.isfinite(low), low, start - spread), np.where(np.isfinite(high), high, start + spread)
    own = device.jacobian(start).T
    found = [start]
    for _ in range(200):
        batch = generator.uniform(low, high, (200, device.dof))
        jacobian = device.jacobian(batch)
        usable = np.asarray(np.isfinite(jacobian).all(axis=(1, 2)), dtype=bool)
        usable[usable] &= np.linalg.cond(jacobian[usable]) <= CONDITION
        usable[usable] &= np.linalg.det(own @ jacobian[usable]) > 0.0
        found += list(batch[usable])
        if len(found) >= count:
            return np.array(found[:count])
    raise DesignError(
        f"design: {device.name} has hardly a pose near {np.round(start, 3).tolist()} whose Jacobian has a condition "
        f"number up to {CONDITION:g}; choose another pose"
    )


def draw_presses(device: Device, poses: Array, force: float, stiffness: float) -> list[Press]:
    """Return presses along the principal axes of the tip's inertia whose way stays well conditioned."""
    found = []
    for pose in poses:
        axes = (moving_axes(device, pose) @ np.linalg.eigh(tip_inertia(device, pose))[1]).T
        for direction in np.concatenate([axes, -axes]):
            if within_reach(device, pose, direction * force / stiffness):
                found.append(Press(pose, direction, drive_bound(device, pose, direction, force, stiffness)))
    return found


def share_within_reach(presses: Sequence[Press], poses: Array) -> float:
    """Return the share of the presses from poses (n, dof) that `draw_presses` has kept."""
    return len(presses) / (2.0 * np.size(poses))


def choose(presses: Sequence[Press]) -> list[Press]:
    """Return the presses with the largest bounds and some others."""
    ordered = sorted(presses, key=lambda press: -press.bound)
    rest = ordered[WORST:]
    picked = np.random.default_rng(2).permutation(len(rest))[:OTHERS]
    return ordered[:WORST] + [rest[i] for i in picked]


def within_reach(device: Device, pose: Array, way: Array) -> bool:
    """Return whether the tip can move from a pose along a way (3,), m, and 5 % farther, and stays well conditioned."""
    tip, last = device.forward(pose), pose
    low, high = device.joint_limits
    for share in np.linspace(0.0, 1.05, 6)[1:]:
        try:
            last = device.inverse(tip + share * way, last)
        except PoseError:
            return False
        jacobian = device.jacobian(last)
        if np.any((last < low) | (last > high)) or np.linalg.cond(jacobian) > CONDITION:
            return False
        if np.linalg.norm(last - pose) > NEAR:
            return False
    return True


def run_presses(
    controller: WorkspaceController,
    name: str,
    presses: Sequence[Press],
    force: float,
    stiffness: float,
    duration: float,
    delay: int = 0,
) -> Settled:
    """Return how presses settle in the nonlinear simulation, with the limits of the drive and without encoder counts.

    Args:
        controller: knows its own device.
        name: of the real device, as in a scenario.
        presses: their bounds are ignored.
        force: N.
        stiffness: N/m.
        duration: of the run, s.
        delay: samples.
    """
    times, overshoot = np.full(len(presses), np.inf), np.zeros(len(presses))
    for i, press in enumerate(presses):
        tables = press_tables(press, name, force, stiffness, controller.period, delay, duration)
        trace = simulate(tables | {"controller": {"kind": "workspace"}}, controller)
        share = trace["deflection"] * stiffness / force
        outside = np.flatnonzero(np.linalg.norm(share - press.direction, axis=1) > BAND)
        overshoot[i] = float((share @ press.direction).max()) - 1.0
        last = int(outside[-1]) + 1 if outside.size else 0
        if trace.completed and last < len(share) - round(0.1 * duration / controller.period):
            times[i] = last * controller.period
    return Settled(times, overshoot)


def press_tables(
    press: Press, name: str, force: float, stiffness: float, period: float, delay: int, duration: float
) -> dict[str, Any]:
    """Return the tables of a scenario of one press, without controller."""
    device = load(name)
    return {
        "device": {"name": name, "saturation": True, "delay": delay},
        "start": {"pose": [write(q, device.joint_unit) for q in press.pose]},
        "servo": {"period": write(period, "s")},
        "reference": {"shape": "step", "force": [write(force * part, "N") for part in press.direction]},
        "object": {"kind": "spring", "stiffness": write(stiffness, "N/m")},
        "run": {"duration": write(duration, "s")},
    }
