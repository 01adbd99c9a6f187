"""Time closed loops side by side, and MuJoCo's native batch on the same arm: loops of one second, a second and core."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from palpate import _core
from palpate.simulation.simulator import Simulation, build_simulation

from benchmarks.peers import mujoco_rollout
from benchmarks.section import Effort, Progress, Rows, Section, figures
from benchmarks.workload import STIFFNESS, Workload

__all__ = ["SECTION"]

Array = NDArray[np.float64]
LANES = {8: "AVX-512", 4: "AVX2", 2: "SSE2 or the like"}
ASKED = 20_000.0


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return loops a second of one core's time.

    Each row: "program", "loops_per_second" (median), "best_loops_per_second", "runs", "error_rad" (largest distance of
    the last angles from the reference trajectory's; in a hand or with dry friction from those of 64 substeps), "asked"
    (loops a second, or None).
    """
    work = Workload.standard()
    tell("a tight reference trajectory (DOP853)", 0.0)
    last = work.reference()[-1]
    prepared = build_simulation(work.scenario(substeps=1))
    rows, missing = [], []
    widest = _core.max_lanes()
    for number, (lanes, name) in enumerate(LANES.items()):
        tell(f"{lanes} lanes", 0.3 + 0.2 * number)
        if lanes > widest:
            missing.append(f"palpate, {lanes} lanes: this machine or build has no {name}")
            continue
        cells = 64 * lanes
        # The first cell is the reference's; the others have their own stiffness, as in a sweep.
        stiffness = np.repeat(np.linspace(STIFFNESS, 2 * STIFFNESS, cells)[:, None], 3, axis=1)

        def run(lanes: int = lanes, cells: int = cells, stiffness: Array = stiffness) -> Array:
            found = _core.run_cells(
                prepared.setup, prepared.reference, prepared.operator, {"stiffness": stiffness}, cells, 1, lanes
            )
            return np.asarray(found)[0, -6:-3]

        asked = ASKED if lanes == 8 else None
        rows.append(_row(f"palpate: {lanes} lanes ({name})", run, cells, effort.runs(30), last, asked))
        if lanes == widest:
            for what, columns in _burdens(prepared.start, work).items():
                tell(f"{lanes} lanes, {what}", 0.35 + 0.2 * number)

                def burdened(
                    ready: Simulation = prepared,
                    count: int = cells,
                    columns: dict[str, Array] = columns,
                    lanes: int = lanes,
                    stiffness: Array = stiffness,
                ) -> Array:
                    own = {name: np.tile(value, (count, 1)) for name, value in columns.items()}
                    own["stiffness"] = stiffness[:count].copy()
                    found = _core.run_cells(ready.setup, ready.reference, ready.operator, own, count, 1, lanes)
                    return np.asarray(found)[0, -6:-3]

                fine = burdened(build_simulation(work.scenario(substeps=64)), 1)
                rows.append(_row(f"palpate: {lanes} lanes, {what}", burdened, cells, effort.runs(15), fine, None))
    tell("MuJoCo: rollout", 0.9)
    try:
        rows.append(_row("MuJoCo: rollout", lambda: mujoco_rollout(work, 4), 4, effort.runs(10), last, None))
    except ImportError as problem:
        missing.append(f"MuJoCo: rollout: {problem.name} is not installed (pip install 'palpate[bench]')")
    return Rows(rows, missing)


def _burdens(start: Array, work: Workload) -> dict[str, dict[str, Array]]:
    """Return what makes a loop heavier: an arm that grips the tip, dry friction as in the arm with its rotors."""
    tip = np.asarray(work.device.forward(start))[None]
    arm = {"mass": 0.15, "damping": 4.5, "stiffness": 560.0}
    hand = {**{f"hand_{key}": np.array([[value]]) for key, value in arm.items()}, "hand_rest": tip}
    rubbing = {"coulomb": np.full((1, 3), 0.01), "breakaway": np.full((1, 3), 0.01)}
    return {"in a hand": hand, "dry friction": rubbing, "in a hand, dry friction": {**hand, **rubbing}}


def _row(
    name: str, job: Callable[[], Array], loops: int, runs: int, last: Array, asked: float | None
) -> dict[str, Any]:
    angles = job()  # also warms up
    seconds = np.empty(runs)
    for i in range(runs):
        begin = time.thread_time()  # a core's time, also where others use it
        job()
        seconds[i] = time.thread_time() - begin
    return {
        "program": name,
        "loops_per_second": float(loops / np.median(seconds)),
        "best_loops_per_second": float(loops / seconds.min()),
        "runs": runs,
        "error_rad": float(np.abs(angles - last).max()),
        "asked": asked,
    }


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    asked = row["asked"]
    met = "" if asked is None else f"{asked:,.0f}{'' if row['loops_per_second'] >= asked else ' (missed)'}"
    return (
        row["program"],
        figures(row["loops_per_second"], 4),
        figures(row["best_loops_per_second"], 4),
        str(row["runs"]),
        f"{row['error_rad']:.1e}",
        met,
    )


SECTION = Section(
    "1-s closed loops of the nonlinear arm at 1 kHz, a second of one core's time (MuJoCo: torques given beforehand)",
    ("program", "loops/s", "best", "runs", "error [rad]", "asked"),
    _cells,
    _measure,
)
