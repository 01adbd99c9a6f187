"""Critical stiffness of a device's walls over its workspace."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.devices import Device, load
from palpate.devices.reach import check_reach
from palpate.errors import DeviceError, StabilityError
from palpate.files import as_path, check_suffix, load_toml, read_utf8, write_json
from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_loop import require_linear_parts, scenario_arm
from palpate.stability.maps.pose_loops import PoseLoops
from palpate.stability.maps.reachable_poses import reachable_poses, shoulder

__all__ = ["Workspace", "workspace"]

Progress = Callable[[str, float], None]
TILT = math.radians(12.0)  # between the weakest direction and the additional ones
FINGERTIP = HumanArm(0.15, 4.5, 560.0, 500.0, 0.5)  # default operator


@dataclass(frozen=True)
class Workspace:
    """Critical stiffness over the workspace.

    Attributes:
        title: title of the scenario or name of the device.
        loop: rate, delay, damping of the wall and operator in words.
        tips: (n, 3), m, relative to the tip at zero angles: x right, y up, z towards the operator.
        poses: (n, dof), rad.
        directions: (n, d, 3), unit normals of the walls: the axes, the principal directions of the device's mobility
            J M^-1 J^T from heavy to light, and four tilted from the weakest of these.
        stiffness: (n, d), critical stiffness of a wall with that normal, N/m; 0: no wall is stable, inf: every wall is.
        frequency: (n, d), frequency of the oscillation at the critical stiffness, Hz.
        softest: (n, d), N/m: softer walls are unstable; above 0 where the device is unstable without a wall.
        start: (3,), m: start of the scenario, through which the sections pass.
        hinge: (3,), m: shoulder joint, on the base axis.
        sections: name of a plane ("y-z", "x-z") to the indices (k,) of its poses, on a grid of ``spacing``.
        spacing: grid spacing of the sections, m.
    """

    title: str
    loop: str
    tips: Array
    poses: Array
    directions: Array
    stiffness: Array
    frequency: Array
    softest: Array
    start: Array
    hinge: Array
    sections: Mapping[str, NDArray[np.int64]]
    spacing: float

    @property
    def worst(self) -> Array:
        """Least critical stiffness over the directions, (n,), N/m."""
        return np.asarray(self.stiffness.min(axis=1), dtype=float)

    @property
    def least(self) -> tuple[int, int]:
        """(pose, direction) of the least critical stiffness."""
        pose, direction = np.unravel_index(int(np.argmin(self.stiffness)), self.stiffness.shape)
        return int(pose), int(direction)

    @property
    def falling(self) -> float:
        """Fraction of the poses at which no wall is stable because the device tips over."""
        return float(np.mean(self.worst == 0))

    @property
    def least_stable(self) -> float:
        """Least stiffness above which walls are stable at every pose that has a stable wall, N/m."""
        return float(self.softest[self.worst > 0].max(initial=0.0))

    @property
    def stable(self) -> bool:
        """Whether every wall from zero up to the least critical stiffness is stable at every pose."""
        return bool(self.worst.min() > 0) and self.least_stable == 0.0

    def __str__(self) -> str:
        i, j = self.least
        tip = _millimetres(self.tips[i])
        normal = ", ".join(f"{part:.3g}" for part in np.round(self.directions[i, j], 3) + 0.0)
        if self.worst[i] == 0:
            others = self.worst[self.worst > 0]
            remainder = (
                f" At the others the least limit in any direction is {others.min():.5g} N/m, the median "
                f"{np.median(others):.5g} N/m.{self._soft_walls}"
                if len(others)
                else ""
            )
            return (
                f"At {np.sum(self.worst == 0)} of {len(self.tips)} poses no wall of any stiffness is stable: the "
                "device tips over there under the constant force of its motors, or the controller designed for the "
                f"start does not fit. Describe the operator in the scenario.{remainder}"
            )
        if self.least_stable < self.worst[i]:
            softest = f"from {self.least_stable:.5g} N/m " if self.least_stable > 0 else ""
            claim = (
                f"Walls {softest}up to {self.worst[i]:.5g} N/m are stable at each of {len(self.tips)} poses in every "
                f"direction ({self.stiffness.shape[1]} tested at each pose). The minimum is"
            )
        else:
            claim = (
                f"No stiffness is stable at each of {len(self.tips)} poses in every direction. The least limit is "
                f"{self.worst[i]:.5g} N/m"
            )
        return (
            f"{claim} at {tip} mm with the normal ({normal}), where the loop oscillates at "
            f"{self.frequency[i, j]:.4g} Hz. The median is {np.median(self.worst):.5g} N/m.{self._soft_walls}"
        )

    @property
    def _soft_walls(self) -> str:
        """Softest stable walls, in a sentence; "" if walls are stable from zero up."""
        if self.least_stable == 0.0:
            return ""
        soft = (self.softest.max(axis=1) > 0) & (self.worst > 0)
        return (
            f" At {np.sum(soft)} poses the device is unstable without a wall. At the worst of them walls below "
            f"{self.least_stable:.5g} N/m are unstable too."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers for JSON; inf becomes text."""
        i, j = self.least
        return {
            "title": self.title,
            "loop": self.loop,
            "least": {
                "stiffness_N_per_m": _plain(self.worst[i]),
                "frequency_Hz": _plain(self.frequency[i, j]),
                "tip_m": self.tips[i].tolist(),
                "pose_rad": self.poses[i].tolist(),
                "normal": self.directions[i, j].tolist(),
            },
            "directions": self.directions.tolist(),
            "tip_m": self.tips.tolist(),
            "pose_rad": self.poses.tolist(),
            "stiffness_N_per_m": [[_plain(k) for k in row] for row in self.stiffness],
            "frequency_Hz": [[_plain(f) for f in row] for row in self.frequency],
            "min_stable_stiffness_N_per_m": self.softest.tolist(),
        }

    def save(self, path: str | Path) -> Path:
        """Write the numbers atomically as `.json` and return the path.

        Raises:
            OutputError: the suffix is not `.json`, or the file cannot be written.
        """
        return write_json(check_suffix(path, (".json",), "a workspace"), self.to_dict(), indent=None)


def workspace(
    subject: Scenario | Device | Mapping[str, Any] | str | Path,
    *,
    poses: int = 2000,
    progress: Progress | None = None,
) -> Workspace:
    """Return the exact critical stiffness of an impedance display's walls over the reachable workspace.

    At each pose the loop consists of the device linearized there, with the gravity compensation of that pose, and a
    wall with the damping of the scenario's object. Operator, delay and controller are those of the scenario. The
    controller is one fixed design for the scenario's start. A device without a scenario runs at its usual rate, without
    delay and wall damping. An arm of 0.15 kg, 4.5 N s/m and 560 N/m holds it through fingertip tissue.

    Motions that the wall does not observe must be stable too; a certificate does not require this.

    Reachable poses are on the start's side of the base axis, with the elbow configuration of the start and the base
    rotated by up to 90 degrees, within the joint limits of the device. The ratio of the Jacobian's smallest to largest
    singular value is at least 0.1.

    Args:
        subject: a Scenario, its tables or file (.toml with [object]); or a Device, its name or file.
        poses: approximate number; half of them on two planes through the start, half in the volume.
        progress: called with a text and the fraction done.

    Raises:
        StabilityError: the device has fewer than three joints or is not nonlinear; or the wall is not damped by
            backward difference.
        ScenarioError, DeviceError, DesignError, PoseError: as ``palpate.simulate``.
    """
    report = progress or (lambda _text, _fraction: None)
    s, title = _scenario(subject)
    with s.naming_place():
        return _map(s, title, poses, report)


def _map(s: Scenario, title: str, poses: int, report: Progress) -> Workspace:
    """Return the workspace map of a scenario; errors as `workspace`, without their place."""
    device = s.load_device()
    _require_mappable(s, device)
    start = device.inverse(s.start.tip) if s.start.tip is not None else np.array(s.start.pose)
    check_reach(device, start, "workspace")
    controller = build_controller(s, device, start)
    report("reachable poses", 0.05)
    spacing, tips, angles, sections = reachable_poses(device, start, poses)
    damping = np.asarray(s.object.damping, float)
    arm = scenario_arm(s)
    rest_force = (arm.stiffness if arm is not None and arm.tissue_stiffness is None else 0.0) * np.array(
        s.operator.rest
    )
    parts = []
    for first in range(0, len(angles), 256):
        report("critical stiffness of every wall", 0.1 + 0.85 * first / len(angles))
        part = angles[first : first + 256]
        loops = PoseLoops.of(
            device, part, controller, s.period, s.device.delay, arm, rest_force, s.servo.gravity_compensation
        )
        parts.append(_tested_walls(loops, _directions(device, part), damping))
    directions, stiffness, frequency, softest = (np.concatenate([part[i] for part in parts]) for i in range(4))
    return Workspace(
        title, _loop_in_words(s, device, arm), tips, angles, directions, stiffness, frequency, softest,
        device.forward(start), shoulder(device)[0], sections, spacing,
    )  # fmt: skip


def _require_mappable(s: Scenario, device: Device) -> None:
    """Raise StabilityError unless the scenario has walls that a workspace can map."""
    require_linear_parts(s)
    if device.dof < 3:
        raise StabilityError(
            f"device.name: {device.name} has {device.dof} of the three joints that a workspace map needs; "
            "use certify or zwidth at single poses instead"
        )
    if s.device.model != "nonlinear" or s.device.kinematics != "nonlinear":
        raise StabilityError('device: a workspace needs the nonlinear device; leave out "model" and "kinematics"')
    if s.servo.topology != "impedance_display":
        raise StabilityError(
            'servo.topology: a workspace maps the walls of an "impedance_display"; certify a force_tracking loop at '
            "each pose instead"
        )
    if s.operator.kind == "fixed":
        raise StabilityError('operator.kind: "fixed" keeps the tip still, so nothing can oscillate; give another')
    if s.object.coupling != "backward":
        raise StabilityError('object.coupling: the walls of a workspace are damped by backward difference, "backward"')


def _directions(device: Device, poses: Array) -> Array:
    """Return (n, 6, 3): the axes and the eigenvectors of the mobility at each pose, from heavy to light."""
    jacobian = device.jacobian(poses)
    mobility = jacobian @ np.linalg.solve(device.mass_matrix(poses), np.swapaxes(jacobian, 1, 2))
    principal = np.swapaxes(np.linalg.eigh(mobility)[1], 1, 2)
    return np.concatenate([np.broadcast_to(np.eye(3), (len(poses), 3, 3)), principal], axis=1)


def _tested_walls(loops: PoseLoops, directions: Array, damping: Array) -> tuple[Array, Array, Array, Array]:
    """Return walls in ``directions`` and in four tilted from the weakest: K, frequency and softest."""

    def interval(along: Array) -> tuple[Array, Array, Array]:
        return loops.critical_stiffness(along, np.einsum("ndk,k,ndk->nd", along, damping, along))

    given = interval(directions)
    weak = np.take_along_axis(directions, given[0].argmin(axis=1)[:, None, None], axis=1)[:, 0]
    across = np.cross(weak, np.eye(3)[np.abs(weak).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    sides = np.stack([across, -across, np.cross(weak, across), np.cross(across, weak)], axis=1)
    tilted = np.cos(TILT) * weak[:, None] + np.sin(TILT) * sides
    stiffness, frequency, softest = (np.concatenate(pair, axis=1) for pair in zip(given, interval(tilted), strict=True))
    return np.concatenate([directions, tilted], axis=1), stiffness, frequency, softest


def _scenario(subject: Scenario | Device | Mapping[str, Any] | str | Path) -> tuple[Scenario, str]:
    if isinstance(subject, Scenario):
        return subject, subject.title
    if isinstance(subject, Mapping):
        s = Scenario.from_dict(subject)
        return s, s.title
    if isinstance(subject, Device):
        name = subject.name
    else:
        path = as_path(subject, DeviceError)
        if path.suffix == ".toml" and not _is_device(path):
            s = Scenario.from_file(path)
            return s, s.title
        name = str(subject)
    device = load(name)
    tables: dict[str, Any] = {
        "device": {"name": name},
        "servo": {"topology": "impedance_display"},
        "operator": {
            "kind": "arm",
            "mass": f"{FINGERTIP.mass} kg",
            "damping": f"{FINGERTIP.damping} N*s/m",
            "stiffness": f"{FINGERTIP.stiffness} N/m",
            "tissue_stiffness": f"{FINGERTIP.tissue_stiffness} N/m",
            "tissue_damping": f"{FINGERTIP.tissue_damping} N*s/m",
        },
        "object": {"kind": "spring", "stiffness": "1 N/m"},
    }
    if device.dof > 1:
        tables["start"] = {"pose": ["0 rad"] * device.dof}
    return Scenario.from_dict(tables), device.name


def _is_device(path: Path) -> bool:
    """Return whether a TOML file describes a device: it names a mechanism."""
    try:
        return "mechanism" in load_toml(read_utf8(path, DeviceError, kind="a TOML file"), DeviceError, str(path))
    except DeviceError:
        return False  # the scenario reader raises the error


def _loop_in_words(s: Scenario, device: Device, arm: HumanArm | None) -> str:
    delay = f"{s.device.delay} sample{'' if s.device.delay == 1 else 's'} of delay" if s.device.delay else "no delay"
    b = max(s.object.damping)
    law = "" if s.controller.kind == "none" else f", controller {s.controller.kind} designed for the start"
    if arm is None:
        operator = "no operator"
    else:
        grip = (
            "rigidly" if arm.tissue_stiffness is None else f"through fingertip tissue of {arm.tissue_stiffness:g} N/m"
        )
        operator = f"operator of {arm.mass:g} kg, {arm.damping:g} N·s/m, {arm.stiffness:g} N/m, held {grip}"
    return f"{device.name} at {1 / s.period:g} Hz, {delay}, walls damped with {b:g} N·s/m{law}; {operator}"


def _millimetres(tip: Array) -> str:
    return "(" + ", ".join(f"{x:.0f}" for x in np.round(1e3 * tip) + 0.0) + ")"


def _plain(number: float) -> float | str | None:
    if math.isnan(number):
        return None
    return float(number) if math.isfinite(number) else "inf"
