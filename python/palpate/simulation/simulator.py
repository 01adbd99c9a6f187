"""Simulation of a scenario by the core."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from palpate import _core
from palpate.arrays import Array
from palpate.contact.force_law import ForceLaw
from palpate.control.controller import Controller
from palpate.control.controller_forms import PythonController, as_controller
from palpate.control.workspace_controller import WorkspaceController
from palpate.devices import Device
from palpate.errors import DesignError, ScenarioError
from palpate.linear.linearization import static_tip_force
from palpate.scenario import Object, Scenario
from palpate.scenario.tool import Tool
from palpate.simulation.continuation import durations_on, later_motion, resting_window
from palpate.simulation.controllers import build_law, read_scenario, written_out
from palpate.simulation.force_objects import with_law
from palpate.simulation.guards import guard_numbers, set_guard
from palpate.simulation.meshes import sensed_tip
from palpate.simulation.placed_objects import PlacedObject, object_channels, place_objects
from palpate.simulation.plants import check_mode, sampled_plant
from palpate.simulation.trace import Trace
from palpate.simulation.user_object import PythonObject, as_object

MOST_TICKS = 2_000_000  # up to which every tick is judged if fewer are recorded: half a gigabyte
BEYOND = 1e100  # bound of every signal, in any unit; its square is finite


def simulate(scenario: Scenario | Mapping[str, Any] | str | Path, controller: Any = None, object: Any = None) -> Trace:
    """Run a scenario and return its trace.

    The same scenario gives the same trace, bit for bit, on one machine.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        controller: replaces the one of [controller]. A Controller, or a python-control StateSpace or TransferFunction
            from [F_ref; F_object] (6) to the force (3). A system with one input and output acts on F_ref - F_object of
            each axis; a list has three of them, for x, y and z. A continuous system is discretized by the bilinear rule
            with the servo period. In Python: a function f(tick) -> force (3,), N, or an object with `command(tick)`,
            and optionally `applied(force)` and `reset()`. A tick has `time`, `reference`, `object_force`, `deflection`,
            `tip` and `velocity`.
        object: replaces the one of [object]. A function f(tip) -> force of the tip on the object (3,), N, or an object
            with `step(tip)` and optionally `reset()`. The tip has `time`, `position` and `velocity`. The scenario of
            the trace then has the object kind "none". A `palpate.simulation.ForceLaw` runs in the core; the scenario
            of the trace then has it as its object.

    An error in the user's code ends the run. It is raised unchanged, with a note that gives the time.

    Raises:
        ScenarioError: the scenario has a mistake or a feature that its device model lacks, or `controller` or `object`
            has another form or period, or does not return a finite force.
        PoseError: the pose is singular for what is asked.
        DesignError: no controller meets the options in [controller].
    """
    return build_simulation(scenario, controller, object).simulate()


def build_simulation(
    scenario: Scenario | Mapping[str, Any] | str | Path, controller: Any = None, object: Any = None
) -> Simulation:
    """Return the simulation of a scenario, which may run many times; arguments as of `simulate`."""
    return Simulation.of(read_scenario(scenario), controller, object)


@dataclass(frozen=True)
class Simulation:
    """Scenario with the core's setup and the forces at every sample (ticks + 1, 3), N.

    `objects` are those of the scenario by name; `given` says whether the controller is the caller's own instead of the
    scenario's.
    """

    scenario: Scenario
    device: Device
    start: Array
    hold: Array
    controller: Controller | PythonController | WorkspaceController
    setup: Any
    objects: Mapping[str, PlacedObject]
    reference: Array
    operator: Array
    user_object: PythonObject | None = None
    given: bool = False

    @classmethod
    def of(cls, scenario: Scenario, controller: Any = None, object: Any = None) -> Simulation:
        """Return the simulation of a scenario; `controller` and `object` replace those of the scenario."""
        device = scenario.load_device()
        check_mode(scenario, device)
        start = device.inverse(scenario.start.tip) if scenario.start.tip is not None else np.array(scenario.start.pose)
        _check_limits(device, start)
        hold = np.zeros(3)
        if scenario.servo.gravity_compensation:
            hold = static_tip_force(device.jacobian(start), device.gravity(start))
        chosen = build_law(scenario, device, start) if controller is None else _chosen(controller, scenario)
        if scenario.servo.tool is not None and not isinstance(chosen, WorkspaceController):
            raise ScenarioError(
                "controller: the tip of an admittance_display follows the tool by a workspace controller; give "
                "palpate.control.workspace(...)"
            )
        if isinstance(object, ForceLaw):
            plain = written_out(scenario) if controller is None else scenario
            scenario, object = with_law(plain, object, sensed_tip(scenario, device, start)), None
        touched = None if object is None else as_object(object)
        if touched is not None:
            scenario = scenario.model_copy(update={"object": Object(kind="none"), "objects": None})
        ticks = round(scenario.run.duration / scenario.period)
        time = scenario.period * np.arange(ticks + 1)
        silent = np.zeros((ticks + 1, 3))
        reference = silent if scenario.reference is None else scenario.reference.values(time)
        operator = scenario.operator.values(time) if scenario.operator.moves else silent
        setup = _setup(scenario, device, start, hold, chosen)
        objects = place_objects(setup, scenario, device, start)
        if touched is not None:
            setup.set_python_object(touched)
        reference = np.ascontiguousarray(reference)
        given = controller is not None
        return cls(scenario, device, start, hold, chosen, setup, objects, reference, operator, touched, given)

    def simulate(self) -> Trace:
        """Run the scenario and return its trace.

        The verdict is that of every tick, whatever `run.record_every` is, up to MOST_TICKS ticks.
        """
        every = self.scenario.run.record_every
        if every == 1 or len(self.reference) > MOST_TICKS:
            return self._continued(self.trace(*self.run()))
        return self.every_tick().recorded(self.scenario)

    def every_tick(self) -> Trace:
        """Run the scenario and return the trace of every tick, whatever `run.record_every` is."""
        every = self.scenario.run.record_every
        whole = replace(self, scenario=self.scenario.with_every_tick())
        self.setup.record_every = 1
        try:
            return whole._continued(whole.trace(*whole.run()))
        finally:
            self.setup.record_every = every

    def _continued(self, trace: Trace) -> Trace:
        """Return the trace; its metadata say how far its tip moves on, where encoder counts and friction may let it.

        The run is repeated for so much longer, without the limits of the drive, whose windings would warm up meanwhile.
        """
        durations = durations_on(self.scenario)
        more = durations * (len(self.reference) - 1)
        if isinstance(self.controller, PythonController) or len(self.reference) + more > MOST_TICKS:
            return trace
        rest = resting_window(trace)
        if rest is None:
            return trace
        window, band = rest
        reference, operator = (np.vstack([f, np.tile(f[-1], (more, 1))]) for f in (self.reference, self.operator))
        longer = replace(self, reference=reference, operator=operator)
        _limit(self.setup, self.device, limited=False)
        try:
            rows, unstable_tick = longer.run()
        finally:
            _limit(self.setup, self.device, self.scenario.device.saturation)
        if unstable_tick < 0:
            moved = later_motion(longer.trace(rows, unstable_tick), window, band)
        else:
            moved = {"moved_m": BEYOND, "band_m": band, "onward_m": BEYOND}
        found = {"durations": durations, "duration_s": more * self.scenario.period, **moved}
        return replace(trace, metadata={**trace.metadata, "continued": found})

    def run(self) -> tuple[Array, int]:
        """Return the core's rows and the tick at which the loop diverged or -1.

        A row has 3 dof + 12 numbers, then those of the objects (`palpate.simulation.placed_objects`), then with a
        flexible mode the joint coordinates and velocities of the tip's side, then those of an admittance display.
        """
        self.restart()
        rows, count, unstable_tick = self.setup.run(self.reference, self.operator)
        return np.asarray(rows)[:count], unstable_tick

    def restart(self) -> None:
        """Reset the controller and the object if they are the user's own Python code."""
        if isinstance(self.controller, PythonController):
            self.controller.restart()
        if self.user_object is not None:
            self.user_object.restart()

    def columns(self, rows: Array) -> list[Array]:
        """Split rows (n, k) into columns.

        They are q, qd, object force, command, torque, operator force, touching, saturated, guarded, contact.
        """
        dof = self.device.dof
        return np.split(
            rows[:, : rows.shape[1] - self.tail_width], np.cumsum([dof, dof, 3, 3, dof, 3, 1, 1, 1]), axis=1
        )

    @property
    def mode_width(self) -> int:
        """Numbers of a row that belong to a flexible mode."""
        return 0 if self.device.flexible is None else 2 * self.device.dof

    @property
    def tool_width(self) -> int:
        """Numbers of a row that belong to an admittance display: position of the tool, m, and measured force, N."""
        return 0 if self.scenario.servo.tool is None else 6

    @property
    def tail_width(self) -> int:
        """Numbers of a row after those of the objects."""
        return self.mode_width + self.tool_width

    def trace(self, rows: Array, unstable_tick: int, reference: Array | None = None) -> Trace:
        """Return the trace of the core's rows.

        Args:
            rows: of the core, (n, k).
            unstable_tick: tick of divergence; -1 for none.
            reference: at each row (n, 3), N; None for the scenario's.
        """
        device = self.device
        every = self.scenario.run.record_every
        wild = np.flatnonzero(~(np.abs(rows) < BEYOND).all(axis=1))
        if len(wild):  # the force diverged within one sample, before the speed, which the core checks
            rows, unstable_tick = rows[: wild[0]], int(wild[0]) * every
        q, qd, object_force, command, torque, operator, touching, saturated, guarded, met = self.columns(rows)
        if reference is None:
            reference = self.reference[::every]
        reference = reference[: len(rows)]
        tip = self.tip(q)
        tool, measured = np.split(rows[:, rows.shape[1] - self.tool_width :], [3], axis=1)
        contact = object_channels(self.objects, met, tool if self.tool_width else tip)
        if self.scenario.operator.kind == "fixed":
            # The operator balances gravity and motors: J^T f = N - tau, with the smallest f.
            needed = device.gravity(q) - torque
            operator = np.einsum("nij,nj->ni", np.linalg.pinv(np.swapaxes(device.jacobian(q), 1, 2)), needed)
        values = {
            "angle": q,
            "velocity": qd,
            "tip": tip,
            "deflection": contact.pop("deflection"),
            "object_force": object_force,
            "command_force": command,
            "motor_force": command - reference,
            "torque": torque,
            "motor_torque": torque - self._reference_torque(q, reference),
            "reference_force": reference,
            "operator_force": operator,
            "touching": touching,
            "saturated": saturated,
        }
        if self.scenario.guard.kind != "none":
            values["guarded"] = guarded
        if self.tool_width:
            values |= {"tool": tool, "measured_force": measured}
        values |= contact
        if self.mode_width:
            own = rows.shape[1] - self.tail_width
            far, far_speed = np.split(rows[:, own : own + self.mode_width], 2, axis=1)
            values["tip_offset"] = device.forward(far) - device.forward(q)
            states = [np.ascontiguousarray(np.hstack(pair)) for pair in ((q, far), (qd, far_speed))]
            values["energy"] = np.asarray(device.core_flexible.energy(*states))
        elif self.scenario.device.model == "nonlinear":
            values["energy"] = device.energy(q, qd)
        sliding = {"angle": "m", "velocity": "m/s", "torque": "N", "motor_torque": "N"}
        return Trace.of(
            self._times(len(rows)),
            values,
            units=None if device.joint_unit == "rad" else sliding,
            unstable_from=None if unstable_tick < 0 else unstable_tick * self.scenario.period,
            metadata=self._metadata(),
        )

    def _metadata(self) -> dict[str, Any]:
        given = {"given": True} if self.given and self.controller.kind != "python" else {}
        controller = {"kind": self.controller.kind, **given, **_plain(self.controller.notes)}
        metadata: dict[str, Any] = {
            "scenario": self.scenario.to_dict(),
            "version": package_version(),
            "controller": controller,
        }
        if self.scenario.guard.kind != "none":
            metadata["guard"] = guard_numbers(self.scenario, self.device)
        if self.user_object is not None:
            metadata["object"] = {"kind": "python", **self.user_object.notes}
        return metadata

    def _reference_torque(self, q: Array, reference: Array) -> Array:
        """Return the joint torques (n, dof) of the operator's reference force, delayed as those of the motors."""
        late = self.scenario.device.delay // self.scenario.run.record_every
        if not np.any(reference):
            return np.zeros_like(q)
        jacobian = self.device.jacobian(self.start) if self.scenario.device.kinematics == "linear" else None
        jacobian = self.device.jacobian(q) if jacobian is None else np.broadcast_to(jacobian, (len(q), 3, q.shape[1]))
        torque = np.einsum("nij,ni->nj", jacobian, reference)
        return np.vstack([np.zeros((min(late, len(q)), q.shape[1])), torque[: max(len(q) - late, 0)]])

    def _times(self, rows: int) -> Array:
        """Return the times of the recorded ticks, s."""
        every = self.scenario.run.record_every
        time = self.scenario.period * every * np.arange(rows)
        if self.scenario.servo.jitter > 0.0 and rows:
            time = time + np.asarray(self.setup.lateness((rows - 1) * every))[::every]
        return np.asarray(time, dtype=float)

    def tip(self, q: Array) -> Array:
        """Return tip positions (n, 3), m, as the servo computes them, without the rounding of the encoders."""
        if self.scenario.device.kinematics == "linear":
            shift = (q - self.start) @ np.asarray(self.device.jacobian(self.start)).T
            return np.asarray(self.device.forward(self.start) + shift, dtype=float)
        return self.device.forward(q)


def _check_limits(device: Device, start: Array) -> None:
    """Raise ScenarioError if a joint starts beyond its limits."""
    low, high = device.joint_limits
    for joint in np.flatnonzero((start < low) | (start > high)):
        unit, scale = ("deg", 180.0 / np.pi) if device.joint_unit == "rad" else ("mm", 1e3)
        raise ScenarioError(
            f"start: joint {joint + 1} of {device.name} is at {start[joint] * scale:.4g} {unit}, beyond its limits of "
            f"{low[joint] * scale:.4g} to {high[joint] * scale:.4g} {unit}; choose another start"
        )


def _setup(
    scenario: Scenario,
    device: Device,
    start: Array,
    hold: Array,
    controller: Controller | PythonController | WorkspaceController,
) -> Any:
    setup = device.setup()
    setup.start = start
    setup.flexible = device.core_mode
    setup.period, setup.substeps, setup.record_every = scenario.period, scenario.run.substeps, scenario.run.record_every
    setup.jitter, setup.seed = scenario.servo.jitter, scenario.run.seed
    setup.gravity_compensation = hold
    setup.frozen_kinematics = scenario.device.kinematics == "linear"
    setup.delay = scenario.device.delay
    if scenario.device.encoder:
        if not np.any(device.encoder_step):
            raise ScenarioError(
                f"device.encoder: {device.name} has no encoder; give its file one, or set encoder = false"
            )
        setup.encoder_step = device.encoder_step
    _limit(setup, device, scenario.device.saturation)
    _hold(setup, scenario, device, start)
    set_guard(setup, guard_numbers(scenario, device))
    if isinstance(controller, PythonController):
        setup.set_python_controller(controller)
    elif isinstance(controller, WorkspaceController):
        _set_workspace(setup, controller, device, scenario.servo.tool)
    else:
        setup.controller = _state_space(controller)
    if scenario.device.model != "nonlinear":
        plant = sampled_plant(scenario.device.model, device, start, scenario.period)
        setup.linear = True
        setup.plant_a, setup.plant_b, setup.plant_c = plant.a, plant.b, plant.c
        setup.working_torque = plant.working_torque
    return setup


def _limit(setup: Any, device: Device, limited: bool) -> None:
    """Give the setup the limits of the device's drive, or none."""
    limits = type(setup.limits)()
    if limited:
        limits.peak_force, limits.continuous_force = device.peak_force, device.continuous_force
        limits.thermal_time, limits.peak_torque = device.thermal_time, device.peak_torque
    setup.limits = limits


def _set_workspace(setup: Any, controller: WorkspaceController, device: Device, tool: Tool | None) -> None:
    known = controller.device
    if known.model is not device.model:
        raise ScenarioError(f"controller: it is of {known.name}, another mechanism than {device.name}")
    knows = (known.setup().mechanism, known.viscous, controller.parameters)
    if tool is None:
        setup.set_workspace_controller(*knows)
    else:
        setup.set_admittance_controller(*knows, tool.mass, tool.damping)


def _chosen(controller: Any, scenario: Scenario) -> Controller | PythonController | WorkspaceController:
    """Return the caller's controller."""
    try:
        return as_controller(controller, scenario.period)
    except DesignError as problem:
        raise ScenarioError(str(problem)) from None


def _state_space(controller: Controller) -> _core.StateSpace:
    system = controller.system
    none = np.zeros((system.nstates, 3))
    antiwindup = none if controller.antiwindup is None else controller.antiwindup
    out = _core.StateSpace(
        np.asarray(system.A, float).reshape(system.nstates, system.nstates),
        np.asarray(system.B, float).reshape(system.nstates, 6),
        np.asarray(system.C, float).reshape(3, system.nstates),
        np.asarray(system.D, float),
        antiwindup,
    )
    if controller.design_stiffness is not None:
        out.normalize(np.array(controller.design_stiffness))
    return out


def _hold(setup: Any, scenario: Scenario, device: Device, start: Array) -> None:
    operator = scenario.operator
    if operator.kind == "fixed":
        setup.fixed = True
    if operator.kind != "arm":
        return
    if scenario.device.model != "nonlinear":
        raise ScenarioError(
            f'operator.kind: an arm moves with the nonlinear device; with device.model = "{scenario.device.model}" '
            'use kind = "force"'
        )
    hand = _core.HumanArm()
    hand.mass, hand.damping, hand.stiffness = operator.mass or 0.0, operator.damping or 0.0, operator.stiffness or 0.0
    if operator.tissue_stiffness is not None:
        hand.tissue = True
        hand.tissue_stiffness, hand.tissue_damping = operator.tissue_stiffness, operator.tissue_damping or 0.0
    hand.rest = device.forward(start) + np.array(operator.rest)
    setup.human_arm = hand


@cache
def package_version() -> str:
    """Return the version of the installed package, or "unknown" in a source tree that is not installed."""
    try:
        return version("palpate")
    except PackageNotFoundError:
        return "unknown"


def _plain(value: Any) -> Any:
    """Return a value for JSON: arrays as lists, unknown types as text."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [_plain(entry) for entry in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)
