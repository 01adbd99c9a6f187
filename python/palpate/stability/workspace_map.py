"""The stiffest wall that a device renders at every pose it can reach, for whom, and where it renders least."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.devices import Device, load
from palpate.errors import DeviceError, StabilityError
from palpate.files import as_path, check_suffix, write_json
from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_loop import scenario_arm
from palpate.stability.pose_loops import PoseLoops

__all__ = ["Workspace", "workspace"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
SINGULAR = 0.1  # least over largest singular value of the Jacobian: nearer to a singularity the map ends
TURN = math.pi / 2  # rad, of the base to either side of the start
ASIDE = math.radians(12.0)  # of the directions tried about the weakest
FINGERTIP = HumanArm(0.15, 4.5, 560.0, 500.0, 0.5)


@dataclass(frozen=True)
class Workspace:
    """Critical stiffness over the workspace.

    Attributes:
        title: the scenario's, or the device's.
        loop: in words: rate, delay, damping of the wall, who holds the device.
        tips: (n, 3), m, from where the tip is with all angles zero: x right, y up, z towards the operator.
        poses: (n, dof), rad.
        directions: (n, d, 3), unit normals of the walls: the axes, the principal directions of the device's mobility
            J M^-1 J^T from heavy to light, and four about the weakest of these.
        stiffness: (n, d), N/m, at which a wall with that normal loses stability; 0: no wall is stable, inf: all are.
        frequency: (n, d), Hz, of the oscillation there.
        start: (3,), m: the scenario's start, through which the sections go.
        hinge: (3,), m: where the upper arm is hinged, on the base's axis.
        sections: name of a plane ("y-z", "x-z") to the indices (k,) of its poses, on a grid of ``spacing``.
        spacing: of the sections' grids, m.
    """

    title: str
    loop: str
    tips: Array
    poses: Array
    directions: Array
    stiffness: Array
    frequency: Array
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
        pose, way = np.unravel_index(int(np.argmin(self.stiffness)), self.stiffness.shape)
        return int(pose), int(way)

    @property
    def falling(self) -> float:
        """Share of the poses at which no wall is stable: the device tips over, whatever it renders."""
        return float(np.mean(self.worst == 0))

    def __str__(self) -> str:
        i, j = self.least
        tip, normal = _millimetres(self.tips[i]), np.round(self.directions[i, j], 3).tolist()
        if self.worst[i] == 0:
            standing = self.worst[self.worst > 0]
            rest = (
                f" At the others walls up to {standing.min():.5g} N/m are stable, whatever way they face; half of them "
                f"bear {np.median(standing):.5g} N/m or more."
                if len(standing)
                else ""
            )
            return (
                f"At {np.sum(self.worst == 0)} of {len(self.tips)} poses no wall of any stiffness is stable: the "
                "device tips over there under the constant force of its motors, or a controller made for the start "
                f"does not fit. Say in the scenario who holds it, and how firmly.{rest}"
            )
        return (
            f"Walls up to {self.worst[i]:.5g} N/m are stable at each of {len(self.tips)} poses, whatever way they "
            f"face ({self.stiffness.shape[1]} tried at each); the least is at {tip} mm with the normal {normal}, "
            f"oscillating at {self.frequency[i, j]:.4g} Hz. Half of the poses bear {np.median(self.worst):.5g} N/m or "
            "more."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as JSON can hold them; inf becomes text."""
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
        }

    def save(self, path: str | Path) -> Path:
        """Write the numbers as `.json`, whole or not at all; return the path.

        Raises:
            OutputError: the suffix is another one, or the file cannot be written.
        """
        return write_json(check_suffix(path, (".json",), "a workspace"), self.to_dict(), indent=None)


def workspace(
    subject: Scenario | Device | Mapping[str, Any] | str | Path,
    *,
    poses: int = 2000,
    progress: Progress | None = None,
) -> Workspace:
    """Return the critical stiffness of an impedance display's walls at every pose that the arm can reach, exactly.

    At each pose the scenario is thought to start there: the device linearised, the motors' hold for its weight there,
    the scenario's hand, delay and controller (one fixed design, made for the scenario's own start), and a wall with the
    damping of its object. A device by itself is taken at its usual rate, without delay or damping of the wall, held
    through fingertip tissue by a hand of 0.15 kg, 4.5 N s/m, 560 N/m.

    A motion that the wall does not feel must not run away either; a certificate leaves that to the hand.

    Reachable is what the links reach on the start's side of the base's axis, elbow as there, base turned by up to 90
    degrees, no nearer to a singularity than a tenth (of the Jacobian's singular values, least over largest).

    Args:
        subject: a Scenario, its tables or file (.toml with [object]); or a Device, its name or file.
        poses: about how many; half of them on two planes through the start, half throughout the space.
        progress: called with a text and the share done.

    Raises:
        StabilityError: the device has one joint only, is not the nonlinear one, or its wall is not damped by backward
            difference.
        ScenarioError, DeviceError, DesignError, PoseError: as ``palpate.simulate``.
    """
    tell = progress or (lambda _text, _share: None)
    s, title = _scenario(subject)
    device = s.load_device()
    if device.dof < 3:
        raise StabilityError(f"{device.name} has one joint: every pose renders alike, and certify answers for all")
    if s.device.model != "nonlinear" or s.device.kinematics != "nonlinear":
        raise StabilityError('device: a workspace needs the nonlinear device; leave out "model" and "kinematics"')
    if s.servo.topology != "impedance_display":
        raise StabilityError(
            'servo.topology: a workspace maps the walls of an "impedance_display"; a force_tracking loop holds its '
            "object from all sides: certify it at one pose after the other"
        )
    if s.operator.kind == "fixed":
        raise StabilityError('operator.kind: "fixed" keeps the tip still, so nothing can oscillate; give another')
    if s.object.coupling != "backward":
        raise StabilityError('object.coupling: the walls of a workspace are damped by backward difference, "backward"')
    start = device.inverse(s.start.tip) if s.start.tip is not None else np.array(s.start.pose)
    law = build_controller(s, device, start)
    tell("poses within reach", 0.05)
    spacing, tips, angles, sections = _reached(device, start, poses)
    damping = np.asarray(s.object.damping, float)
    arm = scenario_arm(s)
    pull = (arm.stiffness if arm is not None and arm.tissue_stiffness is None else 0.0) * np.array(s.operator.rest)
    parts = []
    for first in range(0, len(angles), 256):
        tell("critical stiffness of every wall", 0.1 + 0.85 * first / len(angles))
        part = angles[first : first + 256]
        loops = PoseLoops.of(device, part, law, s.period, s.device.delay, arm, pull, s.servo.gravity_compensation)
        parts.append(_weakest(loops, _directions(device, part), damping))
    directions, stiffness, frequency = (np.concatenate([part[i] for part in parts]) for i in range(3))
    return Workspace(
        title, _words(s, device, arm), tips, angles, directions, stiffness, frequency,
        device.forward(start), _shoulder(device)[0], sections, spacing,
    )  # fmt: skip


def _directions(device: Device, poses: Array) -> Array:
    """Return (n, 6, 3): x, y, z and the eigenvectors of the mobility at each pose, from heavy to light."""
    jacobian = device.jacobian(poses)
    mobility = jacobian @ np.linalg.solve(device.mass_matrix(poses), np.swapaxes(jacobian, 1, 2))
    principal = np.swapaxes(np.linalg.eigh(mobility)[1], 1, 2)
    return np.concatenate([np.broadcast_to(np.eye(3), (len(poses), 3, 3)), principal], axis=1)


def _weakest(loops: PoseLoops, directions: Array, damping: Array) -> tuple[Array, Array, Array]:
    """Return (directions, stiffness, frequency) of walls in these directions and in four about the weakest of each."""

    def judged(along: Array) -> tuple[Array, Array]:
        return loops.critical_stiffness(along, np.einsum("ndk,k,ndk->nd", along, damping, along))

    stiffness, frequency = judged(directions)
    weak = np.take_along_axis(directions, stiffness.argmin(axis=1)[:, None, None], axis=1)[:, 0]
    across = np.cross(weak, np.eye(3)[np.abs(weak).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    sides = np.stack([across, -across, np.cross(weak, across), np.cross(across, weak)], axis=1)
    about = np.cos(ASIDE) * weak[:, None] + np.sin(ASIDE) * sides
    more, there = judged(about)
    return (
        np.concatenate([directions, about], axis=1),
        np.concatenate([stiffness, more], axis=1),
        np.concatenate([frequency, there], axis=1),
    )


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
    import tomllib

    try:
        return "mechanism" in tomllib.loads(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return False  # the reader of scenarios says what is wrong


def _reached(device: Device, start: Array, count: int) -> tuple[float, Array, Array, dict[str, NDArray[np.int64]]]:
    """Return the sections' spacing (m), tips (n, 3), poses (n, dof), and the indices of each section."""
    home = device.forward(start)
    hinge, reach = _shoulder(device)
    size = float(np.sqrt(0.8 * np.pi * reach**2 / max(0.5 * count, 8)))  # two planes, about half of each in reach
    volume = float(np.cbrt(2 * np.pi / 3 * reach**3 / max(0.5 * count, 8)))
    line, coarse = (np.arange(-np.ceil(reach / step), np.ceil(reach / step) + 1) * step for step in (size, volume))
    u, v = (g.ravel() for g in np.meshgrid(line, line, indexing="ij"))
    planes = {
        "y-z": np.stack([np.full(u.size, home[0]), u + hinge[1], v + hinge[2]], axis=1),
        "x-z": np.stack([u + hinge[0], np.full(u.size, home[1]), v + hinge[2]], axis=1),
    }
    space = np.stack([g.ravel() for g in np.meshgrid(coarse, coarse, coarse, indexing="ij")], axis=1) + hinge
    tips: list[Array] = [home[None, :]]
    poses: list[Array] = [start[None, :]]
    sections: dict[str, NDArray[np.int64]] = {}
    total = 1
    for name, points in (*planes.items(), ("space", space)):
        found = [(p, q) for p in points if (q := _pose(device, p, start, hinge, reach)) is not None]
        if found:
            tips.append(np.array([p for p, _ in found]))
            poses.append(np.array([q for _, q in found]))
        if name != "space":
            sections[name] = np.arange(total, total + len(found))
        total += len(found)
    return size, np.concatenate(tips), np.concatenate(poses), sections


def _shoulder(device: Device) -> tuple[Array, float]:
    """Return where the upper arm is hinged (3,), m, and how far the arm reaches from there, m."""
    l1, l2 = device.parameters.one("geometry.l1"), device.parameters.one("geometry.l2")
    return np.array([0.0, l2, -l1]), l1 + l2


def _pose(device: Device, tip: Array, start: Array, hinge: Array, reach: float) -> Array | None:
    """Return the pose at ``tip`` with the elbow as at the start; None if it is not within reach."""
    if np.linalg.norm(tip - hinge) > reach:
        return None
    elbow, side = np.linalg.det(device.jacobian(start)), _radius(device, start)
    poses, _ = device.core.inverse(tip, start)
    for q in poses:
        near = start + np.angle(np.exp(1j * (np.asarray(q) - start)))
        if abs(near[0] - start[0]) > TURN + 1e-9 or _radius(device, near) * side <= 0:
            continue
        jacobian = device.jacobian(near)
        sizes = np.linalg.svd(jacobian, compute_uv=False)
        if np.linalg.det(jacobian) * elbow > 0 and sizes[-1] >= SINGULAR * sizes[0]:
            return np.asarray(near, dtype=float)
    return None


def _radius(device: Device, pose: Array) -> float:
    """Return how far the tip is from the base's axis, m; negative where the arm reaches back over it."""
    hinge, _ = _shoulder(device)
    x, _, z = device.forward(pose) - hinge
    return float(x * np.sin(pose[0]) + z * np.cos(pose[0]))


def _words(s: Scenario, device: Device, arm: HumanArm | None) -> str:
    delay = f"{s.device.delay} sample{'' if s.device.delay == 1 else 's'} of delay" if s.device.delay else "no delay"
    b = max(s.object.damping)
    law = "" if s.controller.kind == "none" else f", controller {s.controller.kind} designed for the start"
    if arm is None:
        who = "nobody holds it"
    else:
        grip = (
            "rigidly" if arm.tissue_stiffness is None else f"through fingertip tissue of {arm.tissue_stiffness:g} N/m"
        )
        who = f"a hand of {arm.mass:g} kg, {arm.damping:g} N·s/m, {arm.stiffness:g} N/m holds it {grip}"
    return f"{device.name} at {1 / s.period:g} Hz, {delay}, walls damped with {b:g} N·s/m{law}; {who}"


def _millimetres(tip: Array) -> str:
    return "(" + ", ".join(f"{1e3 * part:.0f}" for part in tip) + ")"


def _plain(number: float) -> float | str | None:
    if math.isnan(number):
        return None
    return float(number) if math.isfinite(number) else "inf"
