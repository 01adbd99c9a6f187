"""`palpate sweep`: a scenario over every combination of values; `palpate merge`: the shards of a sweep."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from palpate.cli.console import ScenarioFile, errors, output, print_paths, progress
from palpate.cli.settings import Settings, load_scenario
from palpate.files import default_name

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from palpate.sweeps.run import Sweep


def sweep(
    scenario: ScenarioFile,
    over: Annotated[list[str], typer.Option("--over", help="KEY=FROM..TO:COUNT with units, or KEY=A,B,C.")],
    random: Annotated[
        list[str] | None, typer.Option("--random", help="KEY=FROM..TO, drawn uniformly for each cell.")
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Cells for each combination.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the draws, and of late ticks.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="HDF5 file; the default is results/ and the scenario's name with -sweep.h5."),
    ] = None,
    engine: Annotated[str, typer.Option(help="threads (this machine's cores) or dask.")] = "threads",
    scheduler: Annotated[str | None, typer.Option(help="Address of the Dask scheduler, tcp://host:8786.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Threads; all cores if not given.")] = None,
    design: Annotated[
        str, typer.Option(help="cell: design the controller for each cell; once: for the scenario as it stands.")
    ] = "cell",
    shard: Annotated[str | None, typer.Option(help="I/N: every N-th chunk from the I-th on, for job arrays.")] = None,
    settings: Settings = None,
) -> None:
    r"""Run a scenario for every combination of values, with the whole nonlinear loop.

    The result is one HDF5 file and, once complete, a page with a map of the verdicts. The file is filled as cells are
    done. After an interruption the same command continues. The file does not depend on the number of workers, threads
    or vector lanes.

    Keys are those of the scenario, such as object.stiffness, operator.mass, device.delay or servo.jitter. A suffix .x,
    .y or .z selects one axis. A range includes both ends; " log" after its count selects geometric spacing.

    Example: palpate sweep scenarios/slider-wall-stable.toml --over "object.stiffness=50 N/m..150 N/m:50"
    --over "object.damping=0 N\*s/m..0.2 N\*s/m:20"
    """
    path = out if out is not None else Path("results") / f"{default_name(scenario)}-sweep.h5"
    try:
        with ExitStack() as stack:
            tell = stack.enter_context(progress("reading the scenario"))
            from palpate.sweeps import sweep as run

            part = _shard(shard)
            executor, threads = _executor(stack, engine, scheduler, workers)
            found = run(
                load_scenario(scenario, settings),
                _pairs(over),
                random=_pairs(random or ()),
                draws=draws,
                seed=seed,
                design=design,  # type: ignore[arg-type]
                out=path,
                executor=executor,
                workers=threads,
                shard=part,
                progress=tell,
            )
    except KeyboardInterrupt:
        kept = f"{escape(str(path))} has the cells that are done; the same command continues"
        errors.print(f"stopped: {kept if path.exists() else 'nothing was written'}", soft_wrap=True)
        raise typer.Exit(130) from None
    idle = part is not None and part[0] > found.plan.chunks
    page = None
    if found.done == 1.0:
        from palpate.report import sweep_page

        page = sweep_page(found).save(path.with_suffix(".html"))
    _print_result(found, path, shard, idle)
    if page is not None:
        print_paths([page])


def _executor(
    stack: ExitStack, engine: str, scheduler: str | None, workers: int | None
) -> tuple[Executor | None, int | None]:
    """Return the executor of an engine, None for this machine's threads, and the number of workers."""
    from palpate.sweeps import SweepError
    from palpate.sweeps.run import dask_executor

    if engine == "dask":
        if scheduler is None:
            raise SweepError("--engine dask needs the scheduler's address: --scheduler tcp://host:8786")
        return stack.enter_context(dask_executor(scheduler))
    if engine != "threads":
        raise SweepError(f"--engine {engine}: choose threads, or dask with --scheduler ADDRESS")
    if scheduler is not None:
        raise SweepError("--scheduler is for --engine dask: add that, or leave the address out")
    return None, workers


def _print_result(found: Sweep, path: Path, shard: str | None, idle: bool) -> None:
    """Print the cells that were run and their outcomes; `idle` if the shard has none."""
    from palpate.simulation.verdict import State
    from palpate.sweeps.store import tally

    cells, chunks = found.plan.count, found.plan.chunks
    done = f"{cells:,} cells" if found.done == 1 else f"{found.done:.1%} of {cells:,} cells are done"
    if idle:
        run_by = "1 runs it all" if chunks == 1 else f"1 to {chunks:,} run them all"
        done = (
            f"nothing for shard {shard} to run: the {cells:,} cells are {chunks:,} chunk{'s' * (chunks > 1)} of up to "
            f"{found.plan.chunk:,}, and shard {run_by}"
        )
    output.print(f"[bold]{escape(str(found.plan.tables.get('title') or path.stem))}[/]: {done}", soft_wrap=True)
    if not idle:
        counts = ", ".join(f"{count:,} {state.label}" for state, count in zip(State, tally(path), strict=True) if count)
        output.print(f"  {counts}", soft_wrap=True)
        output.print(f"  {found.excitation}", style="dim", markup=False, soft_wrap=True)
    print_paths([path])


def merge(
    parts: Annotated[list[Path], typer.Argument(help="Files of one sweep's shards.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="HDF5 file to write.")],
) -> None:
    """Merge the files of a sweep's shards into one."""
    from palpate.sweeps import merge as merge_files

    print_paths([merge_files(parts, out)])


def _pairs(texts: Iterable[str]) -> dict[str, str]:
    from palpate.sweeps import SweepError

    pairs: dict[str, str] = {}
    for text in texts:
        name, sign, values = text.partition("=")
        key = name.strip()
        if not sign or not values.strip():
            raise SweepError(f'"{text}" is no key with values; write for example "object.stiffness=1 N/mm..5 N/mm:100"')
        if key in pairs:
            raise SweepError(f"{key} is given twice")
        pairs[key] = values
    return pairs


def _shard(text: str | None) -> tuple[int, int] | None:
    from palpate.sweeps import SweepError

    if text is None:
        return None
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None:
        raise SweepError(f'--shard "{text}": write it as 2/8, the second of eight')
    return int(match[1]), int(match[2])
