"""Scenario: every choice of an experiment, checked, in SI.

Each class is one table of the file and is named after it. Values are text with a unit in the file, and floats in SI
after reading. `Scenario.to_dict` returns the text, so that a trace can contain its scenario.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from palpate.devices import Device, load
from palpate.errors import DesignError, DeviceError, PoseError, ScenarioError, StabilityError
from palpate.files import find_line
from palpate.scenario.design_options import options_text, sort_options
from palpate.scenario.fields import (
    Duration,
    Flag,
    Matrix,
    MistakesError,
    Normalization,
    Number3,
    OneDamping,
    OneMass,
    OneStiffness,
    Position3,
    Section,
    Time,
    Whole,
    between,
    must,
)
from palpate.scenario.guard import Guard, OneGuard
from palpate.scenario.objects import NamedObjects, Object
from palpate.scenario.reader import lay_settings, read_file, read_text, validate
from palpate.scenario.signal import Signal
from palpate.scenario.tool import Tool, check_tool
from palpate.units import parse_quantity, write


class DeviceChoice(Section):
    """[device]: haptic device and its model.

    Attributes:
        name: catalog name, or path of a TOML file, relative to the scenario's file; absolute after reading.
        model: "nonlinear", "linear" (exact linearization at the start pose) or "experimental" (the model identified
            from measurements, `identified_model` in the device's file).
        kinematics: "nonlinear", or "linear" (tip and torques with the Jacobian frozen at the start pose).
        encoder: whether angles are whole encoder counts.
        saturation: whether the drive has its force and torque limits.
        delay: servo periods from the computation of a torque to its application.
        rigid: whether the lowest flexible mode of the device is left out.
    """

    name: str = Field(examples=['"phantom-premium-1.5a"'])
    model: Literal["nonlinear", "linear", "experimental"] = "nonlinear"
    kinematics: Literal["nonlinear", "linear"] = "nonlinear"
    encoder: Flag = False
    saturation: Flag = False
    delay: Annotated[Whole, between(0, 64, " servo periods")] = 0
    rigid: Flag = False

    @field_validator("name")
    @classmethod
    def _resolve(cls, name: str, info: ValidationInfo) -> str:
        base = (info.context or {}).get("base")
        if name.endswith(".toml") and base is not None:
            name = str((Path(base) / name).resolve())
        try:
            load(name)
        except DeviceError as problem:
            raise ValueError(str(problem)) from None
        return name


def _joints(value: object) -> tuple[tuple[float, ...], str]:
    """Return joint values and their unit, "rad" or "m", from a list of text or from one."""
    entries = list(value) if isinstance(value, (list, tuple)) else [value]
    if not entries:
        raise ValueError('a pose has one value per joint, ["0 rad", "2.2305 rad", "3.2776 rad"] or ["0 mm"]')
    try:
        return tuple(parse_quantity(entry, "rad") for entry in entries), "rad"
    except ValueError as problem:
        try:
            return tuple(parse_quantity(entry, "m") for entry in entries), "m"
        except ValueError:
            raise problem from None


class Pose(tuple[float, ...]):
    """Joint values (dof,) in rad, or in m for a sliding joint; `unit` says which."""

    unit: str

    def __new__(cls, values: tuple[float, ...], unit: str) -> Self:
        """Make the pose with its unit."""
        pose = super().__new__(cls, values)
        pose.unit = unit
        return pose


def _pose(value: object) -> Pose:
    return value if isinstance(value, Pose) else Pose(*_joints(value))


def _pose_text(pose: Pose | None) -> list[str] | None:
    return None if pose is None else [write(value, pose.unit) for value in pose]


class Start(Section):
    """[start]: pose of the device at rest at t = 0. One of `pose` and `tip`.

    Attributes:
        pose: joint values (dof,), rad, or m for the slider.
        tip: tip position (3,), m, in the device's frame.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    pose: Annotated[Any, BeforeValidator(_pose), PlainSerializer(_pose_text)] = None
    tip: Position3 | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        if self.pose is not None and self.tip is not None:
            raise ValueError("give pose or tip, not both")
        return self


class Servo(Section):
    """[servo]: the loop around the device.

    Attributes:
        period: s; default: that of the device.
        topology: "force_tracking" (the object force tracks the reference), "impedance_display" (the operator moves the
            tip, the device renders the object force) or "admittance_display" (the operator's measured force moves a
            virtual tool that touches the object, and the tip follows it).
        tool: of an admittance_display.
        jitter: s, less than a period: upper bound of the random delay of each tick. Delays are uniform, independent
            and unknown to the loop. Only for the nonlinear device.
        gravity_compensation: whether a constant tip force balances gravity at the start pose.
    """

    period: Duration | None = None
    jitter: Time = 0.0
    topology: Literal["force_tracking", "impedance_display", "admittance_display"] = "force_tracking"
    tool: Tool | None = None
    gravity_compensation: Flag = True


class Operator(Signal):
    """[operator]: operator of the device; with force_tracking "none" or "arm".

    Attributes:
        kind: "none", "force" (at the tip, as a function of time), "fixed" (the tip stays at its start) or "arm" (mass,
            damper and spring to the shoulder, and a force as a function of time if given).
        mass: of the arm, kg.
        damping: of the arm, N*s/m.
        stiffness: of the arm, N/m.
        tissue_stiffness: of the fingertip between arm and tip, N/m; None for a rigid grip.
        tissue_damping: of the fingertip, N*s/m.
        rest: position at which the arm's spring is unstretched, from the start tip, m.
    """

    kind: Literal["none", "force", "fixed", "arm"] = "none"
    mass: OneMass | None = None
    damping: OneDamping | None = None
    stiffness: OneStiffness | None = None
    tissue_stiffness: OneStiffness | None = None
    tissue_damping: OneDamping | None = None
    rest: Position3 = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _complete(self) -> Self:
        given = self.model_fields_set - {"kind"}
        signal = given & set(Signal.model_fields)
        if self.kind in ("none", "fixed") and given:
            raise ValueError(f'{min(given)} has no meaning for kind = "{self.kind}"')
        if self.kind == "force" and given - signal:
            raise ValueError(f'{min(given - signal)} belongs to kind = "arm"')
        if self.kind == "force" or signal:
            self.check_signal()
        if self.kind == "arm":
            for key in ("mass", "damping", "stiffness"):
                if getattr(self, key) is None:
                    raise ValueError(f"{key} is missing: an arm has mass, damping and stiffness")
            if self.mass == 0.0 and self.tissue_stiffness is not None:
                raise ValueError("mass must be positive for an arm behind fingertip tissue")
            if self.tissue_damping is not None and self.tissue_stiffness is None:
                raise ValueError("tissue_damping needs tissue_stiffness beside it")
        return self

    @property
    def moves(self) -> bool:
        """Whether a force in time is given."""
        return self.force is not None or self.table is not None


class Controller(Section):
    """[controller]: controller of the loop.

    Attributes:
        kind: "none" (u = F_ref - F_object, or the object force in an impedance display), "gain", "lead_lag", "lqg",
            "state_space" or "workspace" (alike at every pose and stiffness; with force_tracking, and the only one of an
            admittance_display).
        gain: N/N per axis.
        A, B, C, D: state space from [F_ref; F_object] (6) to u (3), sampled with the servo period.
        antiwindup: (n, 3), see palpate.control.Controller.
        normalize: whether the forces of each tick are scaled to the design stiffness, see palpate.control.Controller;
            only with force_tracking. True: that of the design, its `stiffness`, by default 1 N/mm. A stiffness, N/m per
            axis: that one, for every kind.
        options: of palpate.control.lead_lag, lqg or workspace, any other key of the table, in SI.
    """

    kind: Literal["none", "gain", "lead_lag", "lqg", "state_space", "workspace"] = "none"
    gain: Number3 | None = None
    A: Matrix | None = None
    B: Matrix | None = None
    C: Matrix | None = None
    D: Matrix | None = None
    antiwindup: Matrix | None = None
    normalize: Normalization = False
    options: Annotated[dict[str, Any], PlainSerializer(options_text)] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _sort(cls, table: Any) -> Any:
        return sort_options(table, set(cls.model_fields))

    @field_validator("gain", mode="before")
    @classmethod
    def _spread(cls, gain: object) -> object:
        return gain if isinstance(gain, (list, tuple)) else (gain,) * 3

    @model_validator(mode="after")
    def _complete(self) -> Self:
        matrices = {name: getattr(self, name) for name in ("A", "B", "C", "D")}
        if self.normalize and self.kind == "workspace":
            raise ValueError("normalize: a workspace controller divides by the stiffness in any case; leave it out")
        if self.normalize is True and self.kind not in ("lead_lag", "lqg"):
            raise ValueError(
                f'normalize: kind = "{self.kind}" has no design stiffness; write it, for example normalize = "1 N/mm"'
            )
        if self.kind == "gain" and self.gain is None:
            raise ValueError("gain is missing; write for example gain = 2.0")
        if self.kind != "gain" and self.gain is not None:
            raise ValueError('gain belongs to kind = "gain"')
        if self.kind == "state_space":
            self._check_shapes(matrices)
        elif self.antiwindup is not None or any(matrix is not None for matrix in matrices.values()):
            raise ValueError('A, B, C, D and antiwindup belong to kind = "state_space"')
        return self

    @property
    def normalizes(self) -> bool:
        """Whether the controller divides the forces by the object's stiffness of their tick."""
        return bool(self.normalize) or self.kind == "workspace"

    def _check_shapes(self, matrices: Mapping[str, tuple[tuple[float, ...], ...] | None]) -> None:
        for name, matrix in matrices.items():
            if matrix is None:
                raise ValueError(f"{name} is missing: a state space needs A, B, C and D")
        n = len(self.A or ())
        wanted = {"A": (n, n), "B": (n, 6), "C": (3, n), "D": (3, 6), "antiwindup": (n, 3)}
        for name, matrix in {**matrices, "antiwindup": self.antiwindup}.items():
            if matrix is None or (n == 0 and name != "D"):
                continue
            shape = (len(matrix), len(matrix[0]) if matrix else 0)
            if shape != wanted[name]:
                raise ValueError(
                    f"{name} is {shape[0]} x {shape[1]}; with {n} states, 6 inputs [F_ref; F_object] and "
                    f"3 outputs it must be {wanted[name][0]} x {wanted[name][1]}"
                )


class Run(Section):
    """[run]: duration, integration and recording.

    Attributes:
        duration: s.
        substeps: integration steps of the device's motion per servo period.
        record_every: servo periods between recorded samples.
        seed: of the jitter, 0 to 2^53.
    """

    duration: Duration = 1.0
    substeps: Annotated[Whole, between(1, 10_000)] = 2
    record_every: Annotated[Whole, between(1, 10_000)] = 1
    seed: Annotated[Whole, must(lambda seed: 0 <= seed <= 2**53, "{}; it must be between 0 and 2^53")] = 0


class Scenario(Section):
    """Experiment: device, loop, operator or reference, object or objects, controller, guard and run.

    The forces of several objects, [objects.NAME], add.
    """

    title: str = "Untitled scenario"
    description: str = ""
    device: DeviceChoice
    start: Start = Field(default_factory=Start)
    servo: Servo = Field(default_factory=Servo)
    reference: Signal | None = None
    operator: Operator = Field(default_factory=Operator)
    object: Object
    objects: NamedObjects | None = None
    controller: Controller = Field(default_factory=Controller)
    guard: OneGuard = Field(default_factory=Guard)
    run: Run = Field(default_factory=Run)
    _source: str = PrivateAttr("")
    _name: str = PrivateAttr("scenario")
    _text: str | None = PrivateAttr(None)
    _place: str = PrivateAttr("object")

    @model_validator(mode="before")
    @classmethod
    def _one_or_several(cls, tables: Any) -> Any:
        """Give a scenario with [objects] an empty [object]."""
        if isinstance(tables, Mapping) and tables.get("objects") is not None and "object" not in tables:
            return {**tables, "object": {"kind": "none"}}
        return tables

    @model_validator(mode="after")
    def _agree(self) -> Self:
        device = self.load_device()
        if self.servo.period is None:
            self._fill("servo", self.servo.model_copy(update={"period": device.servo_period}))
        MistakesError.collect(
            lambda: self._check_start(device),
            self._check_topology,
            lambda: self._check_workspace(device),
            lambda: check_tool(self.servo.topology, self.servo.tool, self.controller, self.operator.kind),
            lambda: self._check_model(device),
            lambda: self.guard.check(self.servo.topology, self.device.model, self.device.delay, device),
            self._check_jitter,
            self._check_length,
            self._check_objects,
        )
        return self

    def _check_objects(self) -> None:
        if self.objects is not None and self.object.kind != "none":
            raise ValueError("object: with [objects.NAME] tables there is no [object]; give it a name among them")

    def _check_model(self, device: Device) -> None:
        if self.device.model == "experimental" and device.identified_model is None:
            raise ValueError(
                f'device.model: "experimental" is the identified model of a device, and {device.name} has none; '
                'use "nonlinear" or "linear"'
            )

    def _check_workspace(self, device: Device) -> None:
        if self.controller.kind != "workspace":
            return
        if self.device.model != "nonlinear" or self.device.kinematics != "nonlinear":
            raise ValueError(
                'controller.kind: "workspace" knows the mechanism itself; leave out device.model and device.kinematics'
            )
        if self.servo.topology == "impedance_display":
            raise ValueError(
                'controller.kind: "workspace" tracks a force; write servo.topology = "force_tracking", or take another'
            )

    def _check_jitter(self) -> None:
        if self.servo.jitter >= self.period:
            raise ValueError(
                f"servo.jitter: a tick may come late by less than a servo period ({write(self.period, 's')}), "
                f"not by {write(self.servo.jitter, 's')}"
            )
        if self.servo.jitter > 0.0 and self.device.model != "nonlinear":
            raise ValueError(
                f'servo.jitter: a sampled model knows no time between ticks; write device.model = "nonlinear", '
                f'not "{self.device.model}"'
            )

    def _check_length(self) -> None:
        ticks = self.run.duration / self.period
        if ticks < 1.0:
            raise ValueError("run.duration: shorter than one servo period")
        if ticks > 2e7:
            raise ValueError("run.duration: more than 20 million servo periods; that would not fit in memory")
        if ticks / self.run.record_every > 5e6:
            raise ValueError("run.duration: more than 5 million samples; raise run.record_every")

    def _check_start(self, device: Device) -> None:
        pose, tip = self.start.pose, self.start.tip
        if pose is None and tip is None:
            if device.dof > 1:
                raise ValueError(
                    'start: pose or tip is missing; write for example pose = ["0 rad", "2.2305 rad", "3.2776 rad"]'
                )
            self._fill("start", Start(pose=Pose((0.0,), device.joint_unit)))
            return
        if pose is None:
            try:
                device.inverse(np.array(tip))
            except PoseError as problem:
                raise ValueError(f"start.tip: {str(problem).removeprefix('inverse: ')}") from None
            return
        unit = device.joint_unit
        if len(pose) != device.dof:
            raise ValueError(f"start.pose: {len(pose)} values, but {device.name} has {device.dof} joints")
        if pose.unit != unit:
            wanted = "lengths, such as 5 mm" if unit == "m" else "angles, such as 2.2305 rad"
            raise ValueError(f"start.pose: the joints of {device.name} take {wanted}")

    def _check_topology(self) -> None:
        if self.servo.topology == "impedance_display" and self.controller.normalize:
            raise ValueError(
                "controller.normalize: in an impedance_display the operator feels the object's stiffness, so it cannot "
                'be divided out; remove normalize, or write servo.topology = "force_tracking"'
            )
        if self.servo.topology == "force_tracking":
            if self.operator.kind not in ("none", "arm"):
                raise ValueError(
                    "operator: a force_tracking loop takes the operator's force as [reference]; "
                    'remove [operator], hold the stylus in a hand with kind = "arm", or write '
                    'servo.topology = "impedance_display"'
                )
            if self.reference is None:
                raise ValueError(
                    "reference is missing: a force_tracking loop follows a force; "
                    'write [reference] force = ["8.5 N", "0 N", "0 N"]'
                )
        elif self.reference is not None:
            raise ValueError(
                f"reference: an {self.servo.topology} has no reference force; the operator pushes: "
                'write [operator] kind = "force" or "arm" instead'
            )

    def _fill(self, name: str, section: Section) -> None:
        """Set a section that depends on the device; the scenario is frozen."""
        self.__dict__[name] = section
        self.__pydantic_fields_set__.add(name)

    @property
    def source(self) -> str:
        """Path of the file that the scenario was read from; "" if it was not."""
        return self._source

    @property
    def period(self) -> float:
        """Servo period, s."""
        assert self.servo.period is not None  # filled in by validation
        return self.servo.period

    def with_every_tick(self) -> Scenario:
        """Return the scenario with every tick recorded, whatever `run.record_every` is."""
        return self.model_copy(update={"run": self.run.model_copy(update={"record_every": 1})})

    @property
    def each_object(self) -> dict[str, Scenario]:
        """The scenario with each of its objects as its [object], by name; the name of a single one is ""."""
        if self.objects is None:
            return {"": self}
        alone = {}
        for name, chosen in self.objects.items():
            alone[name] = self.model_copy(update={"object": chosen, "objects": None})
            alone[name]._place = f"objects.{name}"
        return alone

    @property
    def contact_kind(self) -> str:
        """Kind of the object; "moving" for one in a moving frame, and "scene" for several objects."""
        if self.objects is not None:
            return "scene"
        return self.object.kind if self.object.frame is None else "moving"

    def mistake(self, field: str, sentence: str) -> ScenarioError:
        """Return the error for a mistake in `field`, such as "object.body.file", with the line where it stands."""
        if field.startswith("object."):
            field = f"{self._place}.{field.removeprefix('object.')}"
        line = None if self._text is None else find_line(self._text, field.split("."))
        file = "" if self._text is None else f"{self._name}: "
        place = file if line is None else f"{self._name}, line {line}: "
        return ScenarioError(f"{place}{field}: {sentence}")

    @contextmanager
    def naming_place(self) -> Iterator[None]:
        """Name the file and the line in errors of an analysis of the scenario, as `mistake` does.

        The line is that of the key with which the message begins. Without such a key, the file alone is named. The
        errors of a scenario without a file remain as they are.

        Raises:
            StabilityError, DesignError, PoseError: one of them was raised within; the place precedes its message.
        """
        try:
            yield
        except (StabilityError, DesignError, PoseError) as problem:
            text = str(problem)
            if self._text is None or text.startswith((f"{self._name}:", f"{self._name}, line ")):
                raise
            raise type(problem)(self._with_place(text)) from problem

    def _with_place(self, message: str) -> str:
        """Return a message with the file, and with the line of the key of this scenario with which it begins."""
        key, colon, sentence = message.partition(": ")
        if colon and key.partition(".")[0] in type(self).model_fields:
            return str(self.mistake(key, sentence))
        return f"{self._name}: {message}"

    def load_device(self) -> Device:
        """Return the device that [device] names."""
        device = load(self.device.name)
        return device.rigid() if self.device.rigid else device

    def to_dict(self) -> dict[str, Any]:
        """Return tables that JSON can hold, values as text with units; `Scenario.from_dict` reads them back, equal."""
        return self.model_dump(mode="json", exclude_unset=True, exclude_none=True)

    @classmethod
    def from_file(cls, path: str | Path, settings: Mapping[str, Any] | None = None) -> Scenario:
        """Read a TOML file; paths in it are relative to its folder.

        Args:
            path: of the file.
            settings: values that replace those of the file, by dotted key: {"object.stiffness": "2 N/mm"}.

        Raises:
            ScenarioError: the file cannot be read, or has mistakes. The message has file, line and field of each.
        """
        text, name, base = read_file(path)
        scenario = cls.from_text(text, name, base, settings)
        scenario._source = name
        return scenario

    @classmethod
    def from_text(
        cls,
        text: str,
        name: str = "scenario",
        base: str | Path | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> Scenario:
        """Read TOML text; `name` is that of the file in messages, `base` the folder of relative paths."""
        settings = settings or {}
        tables = lay_settings(read_text(text, name), settings)
        scenario = validate(cls, tables, name, text, base, settings)
        scenario._text, scenario._name = text, name
        return scenario

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], base: str | Path | None = None) -> Scenario:
        """Read tables with the structure of the file; values with units are text."""
        return validate(cls, tables, "scenario", None, base)
