"""Run a sweep on threads, an executor or Dask, in memory or in a file that can be resumed."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.errors import PalpateError, shorten
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.sweeps.axes import LARGEST, Axis, SweepError, axes_of, check_count, limits_of
from palpate.sweeps.excitation import Excitation
from palpate.sweeps.outcomes import Outcomes
from palpate.sweeps.plan import Design, Plan, checksums, in_folder_of
from palpate.sweeps.store import FileStore, MemoryStore, bytes_of, read
from palpate.sweeps.sweep_plot import plot_sweep

__all__ = ["Sweep", "open_sweep", "plan_of", "sweep"]

if TYPE_CHECKING:
    from matplotlib.axes import Axes as MatplotlibAxes

Progress = Callable[[str, float], None]
MOST_SEEDS = 2**53 // LARGEST  # a cell's own seed travels as a double
IN_MEMORY = 10_000_000  # cells whose outcomes a sweep without a file holds, at most: 1.4 GB
IN_FLIGHT = 3  # chunks asked of an executor for each of its workers


@dataclass(frozen=True, repr=False)
class Sweep:
    """Result of a sweep, complete or partial.

    Attributes:
        plan: definition of the sweep.
        outcomes: by name, cells shaped as `shape`, the last axis fastest; nan where a cell was not run. Those of a
            file are read on access.
        done: fraction of the cells that were run, 0 to 1.
        path: path of the file, if any.
    """

    plan: Plan
    outcomes: Outcomes
    done: float
    path: Path | None = None

    def __repr__(self) -> str:
        sizes = " × ".join(f"{axis.path} ({len(axis)})" for axis in self.axes)
        draws = f", {self.plan.draws} draws each" if self.plan.draws > 1 else ""
        where = "" if self.path is None else f", in {self.path}"
        return f"<Sweep: {sizes}{draws}; {self.done:.0%} of {self.plan.count:,} cells run{where}>"

    @property
    def axes(self) -> tuple[Axis, ...]:
        """Axes of the sweep."""
        return self.plan.axes

    @property
    def shape(self) -> tuple[int, ...]:
        """Cells along each axis; the draws last if there are several."""
        return self.plan.shape

    def values(self, path: str) -> Array:
        """Return the values of one axis: numbers, SI, or words as text."""
        for axis in self.axes:
            if axis.path == path:
                words = any(isinstance(value, str) for value in axis.values)
                return np.asarray(axis.values, dtype=None if words else float)
        raise SweepError(f"{path} was not varied; {', '.join(axis.path for axis in self.axes)} were")

    def scenario(self, *index: int) -> Scenario:
        """Return the scenario of one cell."""
        return self.plan.scenario(int(np.ravel_multi_index(index, self.shape)))

    def simulate(self, *index: int) -> Trace:
        """Return the trace of one cell, under the forces of the sweep (see `excitation`)."""
        return self.plan.simulate(int(np.ravel_multi_index(index, self.shape)))

    def plot(self, ax: MatplotlibAxes | None = None) -> MatplotlibAxes:
        """Draw the verdicts over one or two axes, with the exact boundary where it is known; see `plot_sweep`."""
        return plot_sweep(self, ax)

    @property
    def excitation(self) -> Excitation:
        """Forces under which the cells were judged."""
        return self.plan.excitation()

    def __getitem__(self, name: str) -> Array:
        return self.outcomes[name]

    @property
    def unstable(self) -> NDArray[np.bool_]:
        """Where the verdict is "unstable"."""
        return self.outcomes.unstable

    @property
    def settled(self) -> NDArray[np.bool_]:
        """Where the verdict is "settled"."""
        return self.outcomes.settled

    def verdict(self, *index: int) -> State:
        """Return the state of one cell."""
        return State(int(self.outcomes["verdict"][index]))


def sweep(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    over: Mapping[str, Any],
    *,
    random: Mapping[str, str] | None = None,
    draws: int = 1,
    seed: int = 0,
    design: Design = "cell",
    out: str | Path | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    shard: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> Sweep:
    """Run a scenario for every combination of values, each cell the whole nonlinear loop.

    The result of a cell is bitwise independent of the worker and of the other cells. Its verdict follows the rule of a
    run. Forces that change late in the run are held from then on (`Sweep.excitation`), because a loop can only be
    judged under a constant force. Over stiffness and damping the linear loop is evaluated as well (`outcomes.linear`).

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        over: path to values: {"object.stiffness": "100 N/m..5 N/mm:100", "object.damping": [0.0, 1.0, 2.0]}. A range
            has both ends and a count ("log" after it: equal ratios). A list has values as the file has them, or
            numbers in SI. "object.stiffness.z" is one spatial axis.
        random: path to a range, "0.05 kg..0.3 kg", drawn uniformly for each cell by itself.
        draws: cells for each combination.
        seed: of the draws, and of how late the ticks of each cell come (servo.jitter).
        design: "cell": the controller is designed anew for the stiffness of each cell; "once": for the scenario as it
            stands, as `zwidth` does.
        out: HDF5 file, created, or resumed if it holds the same sweep. None: results stay in memory, of at most 10^7
            cells.
        executor: runs the chunks; None: the cores of this machine.
        workers: threads here, or workers of the executor (chunks are kept ready for each); all cores if not given.
        shard: (i, n): only every n-th chunk, from the i-th on, 1 <= i <= n; `merge` puts the files together.
        progress: called with a text and the fraction done, 0 to 1.

    Raises:
        SweepError: an unknown key, more than 10^5 values of a key or 10^8 cells, a scenario that the batch does not
            run, another sweep's file.
        ScenarioError, DesignError, PoseError: as `palpate.simulate`, for any combination of ends.
        OutputError: the file cannot be written; finished chunks are kept.
    """
    scenario = _read(scenario)
    plan = plan_of(scenario, over, random=random, draws=draws, seed=seed, design=design)
    if out is None and plan.count > IN_MEMORY:
        raise SweepError(
            f"out: {plan.count:,} cells take {bytes_of(plan.count) / 1e9:.2g} GB, and a sweep in memory has at most "
            f'{IN_MEMORY:,} cells: name a file, as in out="sweep.h5"'
        )
    plan.check(scenario)
    _share([], shard)  # refused before a file is made
    store: FileStore | MemoryStore = MemoryStore(plan) if out is None else FileStore(out, plan)
    try:
        todo = _share(store.missing(), shard)
        _run(plan, todo, store, executor, workers, progress or (lambda _text, _share: None))
        left = len(store.missing())
    finally:
        store.close()
    if out is not None:
        return open_sweep(out)
    assert isinstance(store, MemoryStore)
    return Sweep(plan, _shaped(plan, store.values()), 1.0 - left / plan.chunks)


def open_sweep(path: str | Path) -> Sweep:
    """Return the sweep of a file, finished or not.

    Raises:
        SweepError: it is no sweep's file.
    """
    plan, values, done = read(path)
    return Sweep(plan, Outcomes(values), float(np.mean(done)), Path(path))


def plan_of(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    over: Mapping[str, Any],
    *,
    random: Mapping[str, str] | None = None,
    draws: int = 1,
    seed: int = 0,
    design: Design = "cell",
) -> Plan:
    """Return the plan that `sweep` runs."""
    scenario = _read(scenario)
    for name, number in (("draws", draws), ("seed", seed)):
        if not isinstance(number, Integral):
            raise SweepError(f"{name}: {number!r} is not a whole number")
    if draws < 1:
        raise SweepError(f"draws: {draws}; at least one cell for each combination is needed")
    if not 0 <= seed < MOST_SEEDS:
        raise SweepError(f"seed: {seed}; from 0 to {MOST_SEEDS - 1:,}")
    if design not in ("cell", "once"):
        raise SweepError(f'design: {design!r}; it is "cell" or "once"')
    limits = {path: limits_of(path, text) for path, text in (random or {}).items()}
    axes = tuple(in_folder_of(scenario.source, axis) for axis in axes_of(over))
    if twice := limits.keys() & {axis.path for axis in axes}:
        raise SweepError(f"{min(twice)} is varied and drawn at random")
    check_count([*map(len, axes), *([int(draws)] if draws > 1 else [])])
    tables = scenario.to_dict()
    return Plan(tables, axes, limits, draws, seed, design, checksums(tables, axes))


@contextmanager
def dask_executor(scheduler: str, timeout: float = 10.0) -> Iterator[tuple[Executor, int]]:
    """Yield an executor on the Dask workers of `scheduler` ("tcp://host:8786"), and how many there are.

    Raises:
        SweepError: Dask is not installed, no scheduler answers, or it has no workers.
    """
    try:
        from distributed import Client
    except ImportError:
        raise SweepError("dask: not installed; pip install 'palpate[dask]'") from None
    try:
        client = Client(scheduler, timeout=timeout, set_as_default=False)
    except (OSError, ValueError, TimeoutError) as problem:
        raise SweepError(
            f"no Dask scheduler answers at {scheduler} ({str(problem).splitlines()[0]}); "
            "start one with `dask scheduler`, and workers with `dask worker ADDRESS`"
        ) from None
    for name in ("distributed", "distributed.client", "distributed.core", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # they print tracebacks when the scheduler dies
    with client:
        workers = client.scheduler_info(n_workers=-1)["workers"]
        threads = sum(int(worker["nthreads"]) for worker in workers.values())
        if not threads:
            raise SweepError(f"the Dask scheduler at {scheduler} has no workers; start some with `dask worker`")
        executor = client.get_executor(pure=False)
        try:
            yield executor, threads
        finally:
            executor.shutdown(wait=False)


def _read(scenario: Scenario | Mapping[str, Any] | str | Path) -> Scenario:
    if isinstance(scenario, Scenario):
        return scenario
    return Scenario.from_dict(scenario) if isinstance(scenario, Mapping) else Scenario.from_file(scenario)


def _shaped(plan: Plan, values: Mapping[str, Array]) -> Outcomes:
    return Outcomes({name: rows.reshape(*plan.shape, *rows.shape[1:]) for name, rows in values.items()})


def _share(chunks: list[int], shard: tuple[int, int] | None) -> list[int]:
    if shard is None:
        return chunks
    if not isinstance(shard, tuple | list) or len(shard) != 2 or not all(isinstance(n, Integral) for n in shard):
        raise SweepError(f"shard: {shard!r}; it is two whole numbers, such as (2, 8), the second of eight")
    part, parts = shard
    if not 1 <= part <= parts:
        raise SweepError(f"shard {part}/{parts}: the first number goes from 1 to the second")
    return [chunk for chunk in chunks if chunk % parts == part - 1]


def _run(
    plan: Plan,
    todo: list[int],
    store: FileStore | MemoryStore,
    executor: Executor | None,
    workers: int | None,
    tell: Progress,
) -> None:
    """Run chunks and store each as it comes."""
    size, count = plan.chunk, plan.count
    finished = 0

    def done(chunk: int, values: Mapping[str, Array]) -> None:
        nonlocal finished
        store.put(chunk, values)
        finished += 1
        cells = min(finished * size, count)
        tell(f"{cells:,} of {min(len(todo) * size, count):,} cells", finished / len(todo))

    def ends(chunk: int) -> tuple[int, int]:
        return chunk * size, min((chunk + 1) * size, count)

    if executor is None:
        threads = workers or os.cpu_count() or 1
        for chunk in todo:
            done(chunk, plan.run(*ends(chunk), threads=threads))
        return
    waiting: dict[Future[dict[str, Array]], int] = {}
    queue = iter(todo)
    most = IN_FLIGHT * (workers or os.cpu_count() or 1)
    try:
        while True:
            for chunk in queue:
                waiting[executor.submit(plan.run, *ends(chunk))] = chunk
                if len(waiting) >= most:
                    break
            if not waiting:
                return
            for future in wait(list(waiting), return_when=FIRST_COMPLETED).done:
                done(waiting.pop(future), _result(future))
    finally:
        for future in waiting:
            with suppress(Exception):
                future.cancel()


def _result(future: Future[dict[str, Array]]) -> dict[str, Array]:
    try:
        return future.result()
    except PalpateError:
        raise
    except Exception as problem:
        raise SweepError(f"{_reason(problem)}; what is done is kept, and the same command continues") from None


def _reason(problem: Exception) -> str:
    """Return why an executor has no result for a chunk."""
    kind = type(problem).__name__
    if kind == "KilledWorker":
        return "several workers died while they ran the same cells (killed, or out of memory)"
    if kind.endswith("CancelledError") or kind == "CommClosedError":
        return "the Dask scheduler no longer answers, or it cancelled the work"
    if kind.startswith("Broken"):
        return "a worker process died (killed, or out of memory)"
    return f"a worker failed: {kind}: {shorten(' '.join(str(problem).split()), 300)}"
