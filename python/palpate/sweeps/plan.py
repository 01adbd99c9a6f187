"""Cells of a sweep and their simulation; the result does not depend on where or in which order cells run."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from functools import lru_cache
from os.path import isfile
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.arrays import Array
from palpate.control.controller import Controller
from palpate.control.controller_forms import PythonController
from palpate.control.workspace_controller import WorkspaceController
from palpate.errors import PalpateError, shorten
from palpate.files.json_text import load_table
from palpate.scenario import Scenario
from palpate.simulation.evidence import leaves_reach
from palpate.simulation.judgment import judge
from palpate.simulation.linear_evidence import linear_radii_of, linear_sign
from palpate.simulation.outcome_rows import outcome_of
from palpate.simulation.simulator import Simulation, build_simulation
from palpate.simulation.trace import Trace
from palpate.simulation.windows import Window
from palpate.sweeps.axes import COLUMNS, LARGEST, Axis, SweepError, key_of, stored_axis, stored_limits, with_value
from palpate.sweeps.excitation import Excitation, excited
from palpate.sweeps.judged_rows import judge_rows, linear_radii

__all__ = ["Design", "Plan", "checksums"]

Design = Literal["cell", "once"]
FILES = (".file", ".name")  # ends of keys that may name a file
TICKS_A_CHUNK = 5e6  # of a batch: about 0.3 s of one core
CHUNK_LIMITS = (64, 16384)  # cells
TICKS_SINGLY = 2e4  # of cells that run one at a time: seconds, as they may also go on for twelve durations


def checksums(tables: Mapping[str, Any], axes: Sequence[Axis]) -> dict[str, str]:
    """Return the SHA-256 of each file that a scenario or a value of an axis names: of a device, body or mesh."""
    names = {str(value) for axis in axes if axis.path.endswith(FILES) for value in axis.values}
    found = {}
    for name in sorted(names.union(_file_names(tables))):
        if isfile(name):  # unlike Path.is_file(), no error for a name that is too long
            with Path(name).open("rb") as file:
                found[name] = hashlib.file_digest(file, "sha256").hexdigest()
    return found


def in_folder_of(source: str, axis: Axis) -> Axis:
    """Return an axis with absolute paths for files in the folder of a scenario's file `source`, "" if it has none."""
    if not axis.path.endswith(FILES):
        return axis
    paths = [Path(source).parent / str(value) for value in axis.values]
    found = (str(path.resolve()) if isfile(path) else value for path, value in zip(paths, axis.values, strict=True))
    return replace(axis, values=tuple(found))


def _file_names(tables: Mapping[str, Any]) -> Iterator[str]:
    """Yield what may be the name of a file."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _file_names(value)
        elif isinstance(value, str) and f".{key}" in FILES:
            yield value


@dataclass(frozen=True)
class Plan:
    """Definition of a sweep, as plain data for other processes and for files.

    Attributes:
        tables: the scenario's, as text with units.
        axes: varied keys; the last one varies fastest.
        random: key of COLUMNS to its two limits, SI, drawn uniformly for each cell.
        draws: cells for each combination of the axes.
        design: "cell": the controller is designed for each cell; "once": for the scenario as it stands.
        files: checksum of each file that the scenario or an axis names (`checksums`).
        seed: of the draws, whose generator is spawned from it for each cell, and of late ticks. `run.seed` of a cell
            is its number plus 10^8 times this seed, unless run.seed is varied.
    """

    tables: Mapping[str, Any]
    axes: tuple[Axis, ...]
    random: Mapping[str, tuple[float, float]]
    draws: int
    seed: int
    design: Design = "cell"
    files: Mapping[str, str] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis; the draws last if there are several."""
        return (*(len(axis) for axis in self.axes), *((self.draws,) if self.draws > 1 else ()))

    @property
    def count(self) -> int:
        """Number of cells."""
        return int(np.prod(self.shape, dtype=np.int64))

    @property
    def period(self) -> float:
        """Servo period of the scenario as it stands, s."""
        return Scenario.from_dict(self.tables).period

    @property
    def chunk(self) -> int:
        """Number of cells that are run and stored together."""
        scenario = Scenario.from_dict(self.tables)
        together = _runs_as_batch(self.tables, self.axes)
        cells = (TICKS_A_CHUNK if together else TICKS_SINGLY) / (scenario.run.duration / scenario.period)
        low, high = CHUNK_LIMITS if together else (1, CHUNK_LIMITS[0])
        return int(np.clip(2 ** round(np.log2(cells)), low, high))

    @property
    def chunks(self) -> int:
        """Number of chunks."""
        return -(-self.count // self.chunk)

    def text(self) -> str:
        """Return the plan as JSON: equal plans give equal text."""
        return json.dumps(
            {
                "scenario": self.tables,
                "over": [[axis.path, axis.unit, list(axis.values)] for axis in self.axes],
                "random": {path: list(limits) for path, limits in self.random.items()},
                "draws": self.draws,
                "seed": self.seed,
                "design": self.design,
                "files": dict(self.files),
            },
            sort_keys=True,
        )

    @classmethod
    def of_text(cls, text: str) -> Plan:
        """Return the plan of JSON text that `text` wrote.

        Raises:
            SweepError: it is no JSON, or not that of a plan.
        """
        raw = load_table(text, SweepError, "the plan of the sweep")
        try:
            axes = tuple(stored_axis(*entry) for entry in raw["over"])
            random = {path: stored_limits(path, *limits) for path, limits in raw["random"].items()}
            Scenario.from_dict(raw["scenario"])
            files = {str(name): str(checksum) for name, checksum in raw["files"].items()}
            plan = cls(raw["scenario"], axes, random, raw["draws"], raw["seed"], raw["design"], files)
            whole = all(type(one) is int and one >= least for one, least in ((plan.draws, 1), (plan.seed, 0)))
            if not axes or not whole or plan.design not in ("cell", "once") or not 1 <= plan.count <= LARGEST:
                raise ValueError("a number or word of it is not that of a sweep")
        except (LookupError, TypeError, ValueError, AttributeError, OverflowError) as problem:
            raise SweepError(f"the plan of the sweep cannot be used: {shorten(str(problem), 300)}") from None
        return plan

    def check(self, scenario: Scenario | None = None) -> None:
        """Build the scenario at the ends of every axis and range, to find mistakes before the run.

        The other axes have their first values then: one key may need another.

        Args:
            scenario: the one of `tables` as it was read; its file and lines appear in messages.

        Raises:
            ScenarioError, DesignError, PoseError: as `palpate.simulate`; the message names the varied value.
            SweepError: the batch cannot run it.
        """
        excited(_check(self.tables if scenario is None else scenario))
        for number, axis in enumerate(self.axes):
            tables = self.tables
            for other in (*self.axes[:number], *self.axes[number + 1 :]):
                tables = with_value(tables, other, 0)
            if axis.key in COLUMNS:
                ends = {int(np.argmin(axis.values)), int(np.argmax(axis.values))}
            else:
                ends = set(range(len(axis)))
            for index in sorted(ends):
                _check_value(tables, axis, index)
        for path, limits in self.random.items():
            axis = Axis(path, COLUMNS[key_of(path)][1], limits)
            for index in (0, 1):
                _check_value(self.tables, axis, index)

    def controller(self) -> Controller | WorkspaceController | None:
        """Return the controller of every cell if it is designed once; None: each cell's own."""
        return None if self.design == "cell" else _own_controller(self.text())

    def run(self, first: int, last: int, threads: int = 1) -> dict[str, Array]:
        """Run cells `first` to `last` (not included) and return their outcomes by name of QUANTITIES."""
        return self.run_cells(np.arange(first, last), threads)

    def run_cells(self, cells: NDArray[np.int64], threads: int = 1) -> dict[str, Array]:
        """Run the cells of these numbers and return their outcomes by name of QUANTITIES."""
        text = self.text()
        if not _runs_as_batch(self.tables, self.axes):
            return self._run_singly(cells, threads)
        indices = dict(zip([axis.path for axis in self.axes], np.unravel_index(cells, self.shape), strict=False))
        lane, rebuilt = _split(text)
        combination = np.zeros(len(cells), dtype=np.int64)
        for axis in rebuilt:
            combination = combination * len(axis) + indices[axis.path]
        drawn = self._draw(cells)
        out: dict[str, Array] = {}
        for one in np.unique(combination):
            here = np.flatnonzero(combination == one)
            chosen = tuple(int(indices[axis.path][here[0]]) for axis in rebuilt)
            experiment = _prepared(text, chosen)
            columns: dict[str, Array] = {}
            for axis in lane:
                _put(columns, experiment, axis.path, np.asarray(axis.values, dtype=float)[indices[axis.path][here]])
            for path, values in drawn.items():
                _put(columns, experiment, path, values[here])
            columns.setdefault("seed", self._seeds(cells[here])[:, None].astype(float))
            count = len(here)
            rows = _core.run_cells(experiment.setup, experiment.reference, experiment.operator, columns, count, threads)
            radii = linear_radii(experiment, columns, count)
            for name, values in judge_rows(experiment, np.asarray(rows), columns, radii).items():
                whole = out.setdefault(name, np.empty((len(cells), *values.shape[1:])))
                whole[here] = values
        return out

    def _run_singly(self, cells: NDArray[np.int64], threads: int) -> dict[str, Array]:
        """Run cells one loop at a time: meshes, bodies and guards do not run in a batch."""

        def outcome(cell: int) -> dict[str, Array]:
            simulation = self._simulation(cell)
            trace, scenario = simulation.every_tick(), simulation.scenario
            window = Window(simulation.setup.window_start, len(simulation.reference) - 1)
            found = outcome_of(trace, scenario.period, window)
            ended = trace.unstable_from is None
            radii = linear_radii_of(trace, scenario)[0]
            radius = np.nan if radii is None else radii.worst
            own = {
                "beyond_reach": float(leaves_reach(trace, scenario, window)) if ended else np.nan,
                "linear": float(linear_sign(radius)),
                "verdict": float(judge(trace, radius).state),
            }
            return {**found, **{name: np.array(value) for name, value in own.items()}}

        with ThreadPoolExecutor(max(threads, 1)) as pool:
            found = list(pool.map(outcome, [int(cell) for cell in cells]))
        return {name: np.array([one[name] for one in found]) for name in found[0]}

    def scenario(self, cell: int) -> Scenario:
        """Return the scenario of one cell, by its number: a simulation of it reproduces the cell."""
        tables: Mapping[str, Any] = self.tables
        for axis, index in zip(self.axes, np.unravel_index(cell, self.shape), strict=False):
            tables = with_value(tables, axis, int(index))
        one = np.array([cell])
        own = {path: float(values[0]) for path, values in self._draw(one).items()}
        if "run.seed" not in {axis.path for axis in self.axes} | set(own):
            own["run.seed"] = float(self._seeds(one)[0])
        for path, value in own.items():
            unit = COLUMNS[key_of(path)][1]
            tables = with_value(tables, Axis(path, unit, (value,)), 0)
        return Scenario.from_dict(tables)

    def simulate(self, cell: int) -> Trace:
        """Return the trace of one cell, under the forces of the sweep."""
        return self._simulation(cell).simulate()

    def _simulation(self, cell: int) -> Simulation:
        return excited(build_simulation(self.scenario(cell), self.controller()))[0]

    def excitation(self) -> Excitation:
        """Return what the sweep does with the forces of the scenario as it stands."""
        return excited(_check(self.tables))[1]

    def _seeds(self, cells: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the seed of the late ticks of each cell (n,)."""
        return np.asarray(self.seed * LARGEST + cells, dtype=np.int64)

    def _draw(self, cells: NDArray[np.int64]) -> dict[str, Array]:
        """Return the random values of each cell by path, from one generator per cell spawned from the seed."""
        out = {path: np.empty(len(cells)) for path in self.random}
        if not out:
            return out
        for row, cell in enumerate(cells):
            generator = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(int(cell),)))
            for path in sorted(self.random):  # `text` sorts them too
                low, high = self.random[path]
                if COLUMNS[key_of(path)][1]:
                    out[path][row] = generator.uniform(low, high)
                else:
                    out[path][row] = generator.integers(int(low), int(high), endpoint=True)  # a delay or a seed
        return out


def _check(
    tables: Scenario | Mapping[str, Any], controller: Controller | WorkspaceController | None = None
) -> Simulation:
    experiment = build_simulation(tables, controller)
    scenario = experiment.scenario
    if (model := scenario.device.model) != "nonlinear":
        raise SweepError(
            scenario.mistake("device.model", f'a sweep runs the "nonlinear" device, not its "{model}" model')
        )
    if scenario.operator.kind == "fixed":
        raise SweepError(
            scenario.mistake("operator.kind", 'a sweep runs a device that is free to move; "fixed" keeps the tip still')
        )
    return experiment


def _check_value(tables: Mapping[str, Any], axis: Axis, index: int) -> None:
    """Check the scenario with one value of an axis; an error begins with the value."""
    try:
        _check(with_value(tables, axis, index))
    except PalpateError as problem:
        value = f"{axis.path} = {axis.text(index)}"
        raise type(problem)(f"{value}: {str(problem).removeprefix('scenario: ')}") from None


def _runs_as_batch(tables: Mapping[str, Any], axes: tuple[Axis, ...]) -> bool:
    """Return True if the core runs the cells of the scenario as a batch: springs and walls, no guard, no tool."""
    s = Scenario.from_dict(tables)
    guarded = s.guard.kind != "none" or any(axis.path.startswith("guard.") for axis in axes)
    return s.contact_kind in ("none", "spring", "wall") and not guarded and s.servo.tool is None


@lru_cache(maxsize=8)
def _own_controller(plan_text: str) -> Controller | WorkspaceController:
    """Return the controller that is designed for the scenario as it stands."""
    own = build_simulation(Plan.of_text(plan_text).tables).controller
    assert not isinstance(own, PythonController)  # a scenario has none
    return own


@lru_cache(maxsize=64)
def _split(plan_text: str) -> tuple[tuple[Axis, ...], tuple[Axis, ...]]:
    """Return the axes that vary between lanes, and those that need a new simulation for each value.

    An axis that changes the designed controller is of the second kind.
    """
    plan = Plan.of_text(plan_text)
    lane, shape = [], []
    for axis in plan.axes:
        if axis.key in COLUMNS and _same_controller(plan, axis):
            lane.append(axis)
        else:
            shape.append(axis)
    return tuple(lane), tuple(shape)


def _same_controller(plan: Plan, axis: Axis) -> bool:
    if plan.design == "once" or plan.tables.get("controller", {}).get("kind", "none") in (
        "none",
        "gain",
        "state_space",
        "workspace",
    ):
        return True
    ends = (int(np.argmin(axis.values)), int(np.argmax(axis.values)))
    one, other = (build_simulation(with_value(plan.tables, axis, index)).controller for index in ends)
    assert isinstance(one, Controller)  # a scenario's own is linear
    assert isinstance(other, Controller)
    a, b = one.system, other.system
    same = all(np.array_equal(x, y) for x, y in zip((a.A, a.B, a.C, a.D), (b.A, b.B, b.C, b.D), strict=True))
    return same and one.design_stiffness == other.design_stiffness


@lru_cache(maxsize=256)
def _prepared(plan_text: str, chosen: tuple[int, ...]) -> Simulation:
    """Return the excited simulation with the chosen value of each axis that is not a lane axis."""
    plan = Plan.of_text(plan_text)
    tables: Mapping[str, Any] = plan.tables
    for axis, index in zip(_split(plan_text)[1], chosen, strict=True):
        tables = with_value(tables, axis, index)
    return excited(_check(tables, plan.controller()))[0]


def _put(columns: dict[str, Array], experiment: Simulation, path: str, values: Array) -> None:
    """Set one key of every cell: values (n,), SI."""
    name, axis = COLUMNS[key_of(path)][0], path.removeprefix(key_of(path))
    if name not in ("stiffness", "damping"):
        columns[name] = np.ascontiguousarray(values[:, None])
        return
    if not axis:
        columns[name] = np.ascontiguousarray(np.repeat(values[:, None], 3, axis=1))
        return
    base = np.asarray(getattr(experiment.setup, name), dtype=float)
    whole = columns.setdefault(name, np.tile(base, (len(values), 1)))
    whole[:, "xyz".index(axis[-1])] = values
