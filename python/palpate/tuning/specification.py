"""Specification of a design, checked: device, range of stiffness, force, settling time, servo."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.devices import Device, load
from palpate.devices.reach import check_reach
from palpate.errors import DesignError
from palpate.linear.linear_device import HumanArm
from palpate.units import array_to_si, bounded_to_si, write

__all__ = ["Specification", "specify"]

MOST_DELAY = 16  # samples


@dataclass(frozen=True, eq=False)
class Specification:
    """Specification of a design in SI.

    Attributes:
        name: of the device, as in a scenario.
        device: with one to three joints.
        stiffness: range of the object, N/m.
        force: largest reference force in any direction, N.
        settle: wanted settling time to 5 %, s.
        period: servo period, s.
        delay: samples from a command to its application.
        start: pose (dof,), rad or m.
        operators: that must be stable.
        against: names of devices that the controller does not know, on which it must not overshoot.
    """

    name: str
    device: Device
    stiffness: tuple[float, float]
    force: float
    settle: float
    period: float
    delay: int
    start: Array
    operators: tuple[HumanArm, ...]
    against: tuple[str, ...]

    @property
    def objects(self) -> str:
        """The range of stiffness in words."""
        low, high = self.stiffness
        return f"{high:g} N/m" if low == high else f"{low:g} to {high:g} N/m"


def specify(
    device: str | PathLike[str],
    stiffness: str | Sequence[float | str],
    force: float | str,
    settle: float | str,
    period: float | str | None,
    delay: int,
    pose: ArrayLike | None,
    tip: ArrayLike | None,
    operators: Sequence[HumanArm],
    against: Sequence[str | PathLike[str]],
) -> Specification:
    """Return the checked specification; arguments and errors as `palpate.design`."""
    if isinstance(device, Device):
        raise DesignError("design: give the device by its name in the catalog or by the path of its file")
    name = _absolute(device)
    known = load(name)
    if known.dof > 3:
        raise DesignError(
            f"design: {known.name} has {known.dof} joints, and the workspace controller needs at most three; write a "
            'scenario with [controller] kind = "lqg" and normalize = true instead'
        )
    if not isinstance(delay, int) or not 0 <= delay <= MOST_DELAY:
        raise DesignError(f"design: delay: a whole number of samples from 0 to {MOST_DELAY} is needed, not {delay!r}")
    low, high = _range(stiffness)
    wanted = bounded_to_si(force, "N", "design: force", error=DesignError)
    if wanted > known.peak_force:
        raise DesignError(
            f"design: force: {wanted:g} N, but the motors of {known.name} give at most {known.peak_force:g} N at the "
            f'tip; ask for less, as in "{0.5 * known.peak_force:g} N"'
        )
    return Specification(
        name,
        known,
        (low, high),
        wanted,
        bounded_to_si(settle, "s", "design: settle", error=DesignError),
        bounded_to_si(known.servo_period if period is None else period, "s", "design: period", error=DesignError),
        delay,
        _start(known, pose, tip),
        tuple(operators),
        tuple(_same_joints(other, known) for other in against),
    )


def _range(stiffness: str | Sequence[float | str]) -> tuple[float, float]:
    """Return the ends of "50 N/m..10 N/mm", or of two values, in N/m; one value stands for both."""
    parts = stiffness.split("..") if isinstance(stiffness, str) else list(stiffness)
    if not 1 <= len(parts) <= 2:
        raise DesignError(f'design: stiffness: {stiffness!r} is no range; write it as "50 N/m..10 N/mm"')
    ends = [bounded_to_si(part, "N/m", "design: stiffness", error=DesignError) for part in parts]
    low, high = ends[0], ends[-1]
    if low > high:
        raise DesignError(
            f"design: stiffness: the range runs down from {low:g} to {high:g} N/m; write the smaller value first, "
            f'"{write(high, "N/m")}..{write(low, "N/m")}"'
        )
    return low, high


def _start(device: Device, pose: ArrayLike | None, tip: ArrayLike | None) -> Array:
    """Return the start pose (dof,); the working pose of the mechanism unless pose or tip is given."""
    if pose is not None and tip is not None:
        raise DesignError("design: give either pose or tip, not both")
    if tip is not None:
        q = device.inverse(tip, device.model.working_pose)
    elif pose is None:
        q = np.array(device.model.working_pose, dtype=float)
    else:
        q = array_to_si(pose, device.joint_unit, "design: pose", error=DesignError)
        if q.shape != (device.dof,) or not np.isfinite(q).all():
            raise DesignError(f"design: pose: {device.dof} finite values in {device.joint_unit} are needed")
    check_reach(device, q, "design")
    return q


def _absolute(device: str | PathLike[str]) -> str:
    """Return the name of a device; the path of a file in full, because a scenario may lie in another folder."""
    name = fspath(device)
    return str(Path(name).resolve()) if name.endswith(".toml") else name


def _same_joints(other: str | PathLike[str], device: Device) -> str:
    name = _absolute(other)
    if load(name).model is not device.model:
        raise DesignError(f"design: against: {name} must have the mechanism of {device.name}")
    return name


def rounded(value: float, digits: int, up: bool) -> float:
    """Return a positive value with a number of significant digits, rounded up or down."""
    unit = 10.0 ** (math.floor(math.log10(value)) - digits + 1)
    steps = value / unit
    return float(f"{(math.ceil(steps - 1e-9) if up else math.floor(steps + 1e-9)) * unit:.{digits}g}")
