"""`palpate sweep`: a scenario over every combination of values, in bulk; and `palpate merge` for its shards."""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from palpate.cli.console import errors, output, progress


def sweep(
    scenario: Annotated[Path, typer.Argument(help="Scenario file (TOML). Examples lie in scenarios/.")],
    over: Annotated[
        list[str],
        typer.Option("--over", help="KEY=FROM..TO:COUNT with units, or KEY=A,B,C."),
    ],
    random: Annotated[
        list[str] | None, typer.Option("--random", help="KEY=FROM..TO, drawn uniformly for each cell.")
    ] = None,
    draws: Annotated[int, typer.Option(min=1, help="Cells for each combination.")] = 1,
    seed: Annotated[int, typer.Option(min=0, help="Of the draws, and of late ticks.")] = 0,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="HDF5 file; if not given, results/ and in it the scenario's name with -sweep.h5."
        ),
    ] = None,
    engine: Annotated[str, typer.Option(help="threads (this machine's cores) or dask.")] = "threads",
    scheduler: Annotated[str | None, typer.Option(help="Address of the Dask scheduler, tcp://host:8786.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Threads; all cores if not given.")] = None,
    shard: Annotated[str | None, typer.Option(help="I/N: every N-th chunk from the I-th on, for job arrays.")] = None,
) -> None:
    """Run a scenario for every combination of values: the whole nonlinear loop, thousands of times a second.

    Writes one HDF5 file, laid out at the start and filled as cells are done. Stopped or killed, the same command goes
    on where it was. The file does not depend on the number of workers, threads or vector lanes.

    Keys are those of the scenario, as object.stiffness, object.damping, operator.mass, device.delay, servo.jitter; .x,
    .y or .z after one means that axis alone. A range has both ends; " log" after its count spaces it by equal ratios.

    Example: palpate sweep scenarios/slider-wall-stable.toml --over "object.stiffness=50 N/m..150 N/m:50"
    --over "object.damping=0 N*s/m..0.2 N*s/m:20"
    """
    path = out if out is not None else Path("results") / f"{scenario.stem}-sweep.h5"
    try:
        with ExitStack() as stack:
            tell = stack.enter_context(progress("reading the scenario"))
            from palpate.sweeps import SweepError
            from palpate.sweeps import sweep as run
            from palpate.sweeps.run import dask_executor
            from palpate.sweeps.store import tally

            part = _shard(shard)
            executor, threads = None, workers
            if engine == "dask":
                if scheduler is None:
                    raise SweepError("--engine dask needs the scheduler's address: --scheduler tcp://host:8786")
                executor, threads = stack.enter_context(dask_executor(scheduler))
            elif engine != "threads":
                raise SweepError(f"--engine {engine}: choose threads, or dask with --scheduler ADDRESS")
            elif scheduler is not None:
                raise SweepError("--scheduler is for --engine dask: add that, or leave the address out")
            found = run(
                scenario,
                _pairs(over),
                random=_pairs(random or ()),
                draws=draws,
                seed=seed,
                out=path,
                executor=executor,
                workers=threads,
                shard=part,
                progress=tell,
            )
    except KeyboardInterrupt:
        errors.print(f"stopped: what is done is in {path}; the same command goes on")
        raise typer.Exit(130) from None
    cells, chunks = found.plan.count, found.plan.chunks
    done = f"{cells:,} cells" if found.done == 1 else f"{found.done:.1%} of {cells:,} cells are done"
    if idle := part is not None and part[0] > chunks:
        run_by = "1 runs it all" if chunks == 1 else f"1 to {chunks:,} run them all"
        done = (
            f"nothing for shard {shard} to run: the {cells:,} cells are {chunks:,} chunk{'s' * (chunks > 1)} of up to "
            f"{found.plan.chunk:,}, and shard {run_by}"
        )
    output.print(f"[bold]{escape(str(found.plan.tables.get('title', '')))}[/]: {done}", soft_wrap=True)
    if not idle:
        dies, swings, grows, diverges = tally(path)
        output.print(f"  {dies:,} die out, {swings:,} keep swinging, {grows:,} grow, {diverges:,} diverge")
    output.print(f"  {path}", style="dim", markup=False, soft_wrap=True)


def merge(
    parts: Annotated[list[Path], typer.Argument(help="Files of one sweep's shards.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="HDF5 file to write.")],
) -> None:
    """Put the files of a sweep's shards together into one."""
    from palpate.sweeps import merge as together

    output.print(f"  {together(parts, out)}", style="dim", markup=False, soft_wrap=True)


def _pairs(texts: Iterable[str]) -> dict[str, str]:
    from palpate.sweeps import SweepError

    out: dict[str, str] = {}
    for key, values in map(_pair, texts):
        if key in out:
            raise SweepError(f"{key} is given twice")
        out[key] = values
    return out


def _pair(text: str) -> tuple[str, str]:
    from palpate.sweeps import SweepError

    key, sign, values = text.partition("=")
    if not sign or not values.strip():
        raise SweepError(f'"{text}" is no key with values; write for example "object.stiffness=100 N/m..5 N/mm:100"')
    return key.strip(), values


def _shard(text: str | None) -> tuple[int, int] | None:
    from palpate.sweeps import SweepError

    if text is None:
        return None
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
    if match is None:
        raise SweepError(f'--shard "{text}": write it as 2/8, the second of eight')
    return int(match[1]), int(match[2])
