"""The servo loop of a scenario, stepped by the caller: one sample at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.errors import ScenarioError
from palpate.fem.errors import BodyError
from palpate.fem.support_changes import SupportChange, SupportPlan
from palpate.scenario import Scenario
from palpate.scenario.body import SupportChoice
from palpate.simulation.bodies import scenario_body, support_changes
from palpate.simulation.placed_objects import columns_of
from palpate.simulation.simulator import BEYOND, Simulation, build_simulation
from palpate.simulation.trace import Trace
from palpate.units import write


@dataclass(frozen=True)
class Sample:
    """Signals of one sample of a loop. SI units, device frame.

    Attributes:
        time: s.
        tip: (3,), m; velocity: of the tip (3,), m/s; by the joints, without the offset of a flexible mode.
        angles: of the joints (dof,), rad or m; speeds: (dof,), rad/s or m/s.
        object_force: of the tip on the object (3,), N.
        command: tip force of the controller after the drive's limits, without the gravity compensation (3,), N.
        torque: of the motors at the joints (dof,), N*m or N.
        reference: reference force (3,), N.
        operator_force: force of the operator on the tip (3,), N; nan if the tip is fixed.
        touching: whether the tip touches the object.
        saturated: whether the drive is at a limit.
        diverged: whether the loop has diverged within the period after this sample.
    """

    time: float
    tip: Array
    velocity: Array
    angles: Array
    speeds: Array
    object_force: Array
    command: Array
    torque: Array
    reference: Array
    operator_force: Array
    touching: bool
    saturated: bool
    diverged: bool


class Loop:
    """Servo loop of a scenario that the caller steps, in a notebook or in a program.

    Stepped with the scenario's own signals, it gives the trace of `palpate.simulate` bit for bit.

    Example::

        loop = palpate.Loop("scenarios/press-stiff-cube-lqg.toml")
        for _ in range(100):
            sample = loop.step()
        print(sample.time, sample.object_force)
    """

    def __init__(
        self, scenario: Scenario | Mapping[str, Any] | str | Path, controller: Any = None, object: Any = None
    ) -> None:
        """Build the loop at its first sample; arguments and errors as `palpate.simulate`."""
        self._simulation: Simulation = build_simulation(scenario, controller, object)
        self._scenario = self._simulation.scenario
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Return to the first sample, and to the scenario's own supports.

        Args:
            seed: of the jitter, 0 to 2^53; None: the last one.
        """
        self._simulation = replace(self._simulation, scenario=self._scenario)
        simulation = self._simulation
        if seed is not None:
            simulation.setup.seed = int(seed)
        simulation.restart()
        self._core = simulation.device.model.loop(simulation.setup)
        self._rows: list[Array] = []
        self._references: list[Array] = []
        self._last: Sample | None = None
        self._unstable_tick = -1
        self._moved = -1  # last sample for which the tool was moved
        self._lateness = np.zeros(0)

    @property
    def simulation(self) -> Simulation:
        """The simulation that is stepped."""
        return self._simulation

    @property
    def scenario(self) -> Scenario:
        """The scenario that is run."""
        return self._simulation.scenario

    @property
    def period(self) -> float:
        """Servo period, s."""
        return self.scenario.period

    @property
    def samples(self) -> int:
        """Number of samples of the scenario's run, the first and the last included."""
        return len(self._simulation.reference)

    @property
    def count(self) -> int:
        """Number of samples since the first: the index of the next one."""
        return int(self._core.count)

    @property
    def time(self) -> float:
        """Time of the next sample, s."""
        return float(self._core.time)

    @property
    def done(self) -> bool:
        """Whether every sample of the scenario's run has been stepped, or the loop has diverged."""
        return self.diverged or self.count >= self.samples

    @property
    def diverged(self) -> bool:
        """Whether the loop has diverged; it cannot be stepped until `reset`."""
        return self._unstable_tick >= 0

    @property
    def angles(self) -> Array:
        """Joint coordinates now (dof,), rad or m."""
        return np.asarray(self._core.angles, dtype=float)

    @property
    def speeds(self) -> Array:
        """Joint velocities now (dof,), rad/s or m/s."""
        return np.asarray(self._core.speeds, dtype=float)

    @property
    def tip(self) -> Array:
        """Tip position now (3,), m."""
        return np.asarray(self._simulation.tip(self.angles[None])[0], dtype=float)

    @property
    def velocity(self) -> Array:
        """Tip velocity now (3,), m/s."""
        return self._tip_velocity(self.angles, self.speeds)

    @property
    def last(self) -> Sample | None:
        """The last sample that was stepped; None before the first step."""
        return self._last

    @property
    def observation(self) -> Array:
        """Tip position (m) and velocity (m/s) now, object force of the last sample and reference now (N), (12,)."""
        force = np.zeros(3) if self._last is None else self._last.object_force
        wanted = self._simulation.reference[min(self.count, self.samples - 1)]
        return np.concatenate([self.tip, self.velocity, force, wanted])

    @property
    def trace(self) -> Trace:
        """Trace of the samples since the first, every `run.record_every` of them."""
        # `simulate` ends with its last sample and does not see the period after it.
        unstable = -1 if self._unstable_tick == self.samples else self._unstable_tick
        simulation = self._simulation
        width = 3 * simulation.device.dof + 12 + columns_of(simulation.objects) + simulation.tail_width
        rows = np.array(self._rows) if self._rows else np.zeros((0, width))
        return simulation.trace(rows, unstable, np.array(self._references).reshape(-1, 3))

    def step(self, force: ArrayLike | None = None, reference: ArrayLike | None = None) -> Sample:
        """Run the servo at this sample, move the device by one period, and return the signals of the sample.

        Args:
            force: of the operator on the tip (3,), N, held over the period; None: the scenario's. After the end of its
                run the scenario's signals keep their last value.
            reference: reference force (3,), N; None: the scenario's.

        Raises:
            ScenarioError: the loop has diverged, a force is not three finite numbers, the tip is fixed and cannot be
                pushed, or the user's controller or object returned no finite force.
        """
        time = self.time
        row, wanted = self._step(force, reference)
        q, qd, object_force, command, torque, operator, touching, saturated, _, _ = (
            part[0] for part in self._simulation.columns(row[None])
        )
        if self.scenario.operator.kind == "fixed":
            operator = np.full(3, np.nan)
        tip, velocity = self._simulation.tip(q[None])[0], self._tip_velocity(q, qd)
        self._last = Sample(
            time, tip, velocity, q, qd, object_force, command, torque, wanted, operator,
            bool(touching[0]), bool(saturated[0]), self.diverged,
        )  # fmt: skip
        return self._last

    def run(self, steps: int | None = None) -> Trace:
        """Step with the scenario's own signals, and return the trace since the first sample.

        Args:
            steps: number of samples; None: to the end of the scenario's run. A loop that diverges ends sooner.

        Raises:
            ScenarioError: `steps` is not a whole number of 0 or more.
        """
        if steps is not None and (not isinstance(steps, int | np.integer) or steps < 0):
            raise ScenarioError(f"steps: a number of samples, 0 or more, is needed, not {steps!r}")
        left = max(self.samples - self.count, 0) if steps is None else steps
        for _ in range(left):
            if self.diverged:
                break
            self._step(None, None)
        return self.trace

    def change_supports(
        self, held: str | Sequence[str] | None = None, touchable: str | Sequence[str] | None = None
    ) -> None:
        """Change the supports or the touchable nodes of the body at the next sample.

        The trace, its verdict and a resolved loop count the change as one of the scenario. The update is computed here,
        outside the tick, which takes it over without a lock.

        Args:
            held: regions whose contact nodes are held from then on, in place of those before; []: none. None: as
                before.
            touchable: regions whose contact nodes can be touched from then on; []: all. None: as before.

        Raises:
            ScenarioError: [object.body] has no key `supports` (an empty list permits changes), the scenario changes
                them later or at this sample, there is no sample yet, or the regions are as
                `palpate.fem.Body.with_support_changes` refuses them.
        """
        scenario, at = self.scenario, self.count * self.period
        choice = scenario.object.body
        if choice is None or choice.supports is None or scenario.object.frame is not None:
            raise scenario.mistake(
                "object.body.supports", "a loop changes those of a body with that key, such as supports = [], at rest"
            )
        later = [change.at for change in choice.supports if change.at >= at - 0.5 * self.period]
        if later or self.count == 0:
            when = (
                "before the first sample" if self.count == 0 else f"no later than that at {later[0]:g} s: step the loop"
            )
            raise scenario.mistake("object.body.supports", f"a change at {at:g} s comes {when}")
        regions = {key: value for key, value in (("held", held), ("touchable", touchable)) if value is not None}
        for key, value in regions.items():
            if not all(isinstance(region, str) for region in (value if isinstance(value, list | tuple) else [value])):
                text = f'{key}: the scenario records the regions: write them as text such as "x < 1 mm", not {value!r}'
                raise scenario.mistake("object.body.supports", text)
        body = scenario_body(scenario)
        try:
            change = SupportChange.of({"at": at, **regions})
            plan = SupportPlan((*support_changes(choice), change), self.period)
            self._core.change_supports(plan.roles(body.nodes)[-1])
        except (BodyError, ValueError) as problem:
            raise scenario.mistake("object.body.supports", str(problem).removeprefix("supports: ")) from None
        supports = (*choice.supports, SupportChoice.model_validate({"at": write(at, "s"), **regions}))
        changed = scenario.object.model_copy(update={"body": choice.model_copy(update={"supports": supports})})
        self._simulation = replace(self._simulation, scenario=scenario.model_copy(update={"object": changed}))

    def move_tool(self, rotation: ArrayLike = (0.0, 0.0, 0.0), opening: float = 1.0) -> None:
        """Turn the tool about the device's tip, and open or close it, from the next sample on.

        The trace, its verdict and a resolved loop count the motion as one of the scenario. Between samples without a
        call the tool rests.

        Args:
            rotation: angles about x, then y, then z of the device (3,), rad.
            opening: 1 for the body's `contact_points`, 0 for the tool's `closed_points`.

        Raises:
            ScenarioError: the object is no body at rest with a table [object.body.tool] (an empty table permits
                motions), the scenario moves the tool later or at this sample, or a number is out of range.
        """
        scenario, at = self.scenario, self.count * self.period
        choice = scenario.object.body
        if choice is None or choice.tool is None or scenario.object.frame is not None:
            raise scenario.mistake(
                "object.body.tool", "a loop moves the tool of a body at rest with that table, which may be empty"
            )
        if (
            not isinstance(opening, Real)
            or not 0.0 <= opening <= 1.0
            or (opening < 1.0 and not choice.tool.closed_points)
        ):
            known = "from 0 to 1" if choice.tool.closed_points else "1 without closed_points"
            raise scenario.mistake("object.body.tool", f"the opening is {known}, not {opening!r}")
        pose = np.array([*_vector(rotation, "rotation", "rad"), opening], dtype=float)
        rows, half = choice.tool.rows(), 0.5 * self.period
        if self._moved < 0 and len(rows) > 1 and rows[-1, 0] > at - half:
            raise scenario.mistake(
                "object.body.tool", f"a motion at {at:g} s comes before that at {rows[-1, 0]:g} s of the scenario"
            )
        rows = rows[rows[:, 0] < at - half]
        if len(rows) and rows[-1, 0] < at - 3.0 * half:  # at rest until the last sample
            rows = np.vstack([rows, [at - self.period, *rows[-1, 1:]]])
        tool = choice.tool.following(np.vstack([rows, [at, *pose]]))
        try:
            tool.check(choice.contact_points, choice.radius, choice.flat_axis)
        except ValueError as mistake:
            raise scenario.mistake("object.body.tool", str(mistake)) from None
        self._core.move_tool(pose[:3], pose[3])
        self._moved = self.count
        changed = choice.model_copy(update={"tool": tool})
        touched = scenario.object.model_copy(update={"body": changed})
        self._simulation = replace(self._simulation, scenario=scenario.model_copy(update={"object": touched}))

    def _step(self, force: ArrayLike | None, reference: ArrayLike | None) -> tuple[Array, Array]:
        """Return the core's row of this sample, and the reference force (3,), N."""
        if self.diverged:
            raise ScenarioError(f"the loop diverged at {self._unstable_tick * self.period:g} s; call reset() first")
        tick, last = self.count, self.samples - 1
        wanted = self._simulation.reference[min(tick, last)] if reference is None else as_force(reference, "reference")
        if force is None:
            begin, end = self._operator_force(tick)
        elif self.scenario.operator.kind == "fixed":
            raise ScenarioError('force: the tip is fixed and cannot be pushed; give operator.kind = "force" or "arm"')
        else:
            begin = end = as_force(force, "force")
        row = np.asarray(self._core.tick(wanted, begin))
        if tick % self.scenario.run.record_every == 0:
            self._rows.append(row)
            self._references.append(wanted)
            if not (np.abs(row) < BEYOND).all():
                self._unstable_tick = tick
                return row, wanted
        if not self._core.advance(begin, end):
            self._unstable_tick = tick + 1
        return row, wanted

    def _operator_force(self, tick: int) -> tuple[Array, Array]:
        """Return the scenario's force of the operator (3,), N, at this sample and at the next, late as they come."""
        late, later = self._late(tick), self._late(tick + 1)
        return self._force_after(tick, late), self._force_after(tick + 1, later)

    def _force_after(self, tick: int, late: float) -> Array:
        table, last = self._simulation.operator, self.samples - 1
        here, following = table[min(tick, last)], table[min(tick + 1, last)]
        if self.scenario.servo.jitter == 0.0:
            return np.asarray(here, dtype=float)
        return np.asarray(here + (late / self.period) * (following - here), dtype=float)

    def _late(self, tick: int) -> float:
        """Return how late a sample comes, s."""
        if self.scenario.servo.jitter == 0.0:
            return 0.0
        if tick >= len(self._lateness):
            self._lateness = np.asarray(self._simulation.setup.lateness(max(2 * tick, self.samples)))
        return float(self._lateness[tick])

    def _tip_velocity(self, q: Array, qd: Array) -> Array:
        """Return the velocity of the tip (3,), m/s, with the Jacobian that the servo uses."""
        simulation = self._simulation
        at = simulation.start if self.scenario.device.kinematics == "linear" else q
        return np.asarray(simulation.device.jacobian(at) @ qd, dtype=float)


def as_force(value: ArrayLike, name: str) -> Array:
    """Return a force (3,), N. Raise ScenarioError, naming it, for any other value."""
    return _vector(value, name, "N")


def _vector(value: ArrayLike, name: str, unit: str) -> Array:
    try:
        vector = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ScenarioError(f"{name}: three numbers, {unit}, not {value!r}") from None
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ScenarioError(f"{name}: three finite numbers, {unit}, not {vector.tolist()}")
    return vector
