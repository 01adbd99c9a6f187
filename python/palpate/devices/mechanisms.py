"""Mechanisms of the core: joints, units and the parameters that their device files hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from palpate import _core

Range = Literal["any", "nonnegative", "positive"]


@dataclass(frozen=True)
class Field:
    """One number, or list of numbers, that a device file holds.

    Attributes:
        unit: SI unit; "" for a plain number.
        size: 1, or one value for each joint or axis.
        range: the values allowed.
        required: every file of the mechanism must have it.
        description: one line.
    """

    unit: str
    size: int = 1
    range: Range = "any"
    required: bool = True
    description: str = ""


@dataclass(frozen=True)
class Mechanism:
    """A mechanism of the core's registry.

    Attributes:
        name: as device files give it.
        dof: number of joints.
        revolute: the joints are revolute (rad, N*m); otherwise prismatic (m, N).
        working_pose: a typical pose (dof,), rad or m.
        parameters: of the mechanism itself, by key ("geometry.l1").
        class_name: of the core's classes.
    """

    name: str
    dof: int
    revolute: bool
    working_pose: tuple[float, ...]
    parameters: Mapping[str, Field]
    class_name: str

    @property
    def joint_unit(self) -> str:
        """Unit of the joint coordinates: "rad" or "m"."""
        return "rad" if self.revolute else "m"

    @property
    def torque_unit(self) -> str:
        """Unit of the joint torques: "N*m" or "N"."""
        return "N*m" if self.revolute else "N"

    @property
    def fields(self) -> dict[str, Field]:
        """Every number of a device file by its key: those of the mechanism, of its friction and of its drive."""
        torque, n = self.torque_unit, self.dof
        out = {
            "servo_period": Field("s", 1, "positive"),
            **self.parameters,
            "friction.viscous": Field("N*m*s/rad" if self.revolute else "N*s/m", n, "nonnegative"),
            "friction.coulomb": Field(torque, n, "nonnegative", False),
            "friction.breakaway": Field(torque, n, "nonnegative", False),
            "friction.stribeck_speed": Field(f"{self.joint_unit}/s", n, "positive", False),
            "limits.lower": Field(self.joint_unit, n, "any", False, "least joint coordinates"),
            "limits.upper": Field(self.joint_unit, n, "any", False, "largest joint coordinates"),
            "flexible.frequency": Field("Hz", 1, "positive", False, "lowest mode between motors and tip"),
            "flexible.tip_share": Field("", 1, "positive", False, "of the moving mass, below 1"),
            "flexible.damping_ratio": Field("", 1, "nonnegative", False, "of the lowest mode, below 1"),
            "drive.peak_torque": Field(torque, n, "positive", False),
            "drive.peak_force": Field("N", 1, "positive", False),
            "drive.continuous_force": Field("N", 1, "positive", False),
            "drive.thermal_time": Field("s", 1, "positive", False),
        }
        if self.revolute:
            out["drive.gear"] = Field("", n, "positive", False, "motor turns per joint turn")
            out["drive.encoder_counts"] = Field("", n, "positive", False, "counts per motor turn")
        else:
            out["drive.encoder_step"] = Field("m", n, "nonnegative", False, "length of one count")
        return out

    def create(self, values: Mapping[str, Sequence[float]]) -> Any:
        """Return the core's mechanism with its parameters taken from `values`, SI; other keys are ignored."""
        return getattr(_core, self.class_name)({key: list(values[key]) for key in self.parameters if key in values})

    def with_mode(self, core: Any, mode: Any) -> Any:
        """Return the core's mechanism with a flexible mode, from the rigid one."""
        return getattr(_core, f"Flexible{self.class_name}")(core, mode)

    def friction(self) -> Any:
        """Return a new, frictionless joint friction of the core."""
        return getattr(_core, f"{self.class_name}Friction")()

    def setup(self) -> Any:
        """Return a new simulation setup of the core."""
        return getattr(_core, f"{self.class_name}Setup")()

    def loop(self, setup: Any) -> Any:
        """Return a new loop of the core at its first sample, for stepping."""
        return getattr(_core, f"{self.class_name}Loop")(setup)


def _mechanism(info: Any) -> Mechanism:
    parameters = {p.key: Field(p.unit, p.size, p.range, p.required, p.description) for p in info.parameters}
    revolute = info.joints[0] == "revolute"
    return Mechanism(info.name, info.dof, revolute, tuple(info.working_pose), parameters, info.class_name)


MECHANISMS: dict[str, Mechanism] = {info.name: _mechanism(info) for info in _core.mechanisms()}
