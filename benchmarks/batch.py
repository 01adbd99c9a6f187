"""Speed of closed loops in vector lanes, and of MuJoCo's native batch: one-second loops per second and core."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from palpate import _core
from palpate.arrays import Array
from palpate.simulation.simulator import build_simulation

from benchmarks.peers import mujoco_rollout
from benchmarks.section import Effort, Progress, Rows, Section, figures
from benchmarks.workload import STIFFNESS, Workload

__all__ = ["SECTION"]

LANES = {8: "AVX-512", 4: "AVX2", 2: "SSE2 or the like"}
ASKED = 20_000.0
ASKED_WORKSPACE = 15_000.0


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return loops per second of one core.

    Each row has "program", "loops_per_second" (median), "best_loops_per_second", "runs", "error_rad" and "asked", the
    required loops per second or None. The error is the largest of the final angles, relative to the reference
    trajectory. With an operator, dry friction or a controller it is relative to 64 substeps.
    """
    work = Workload.standard()
    tell("reference trajectory (DOP853)", 0.0)
    last = work.reference()[-1]
    prepared = build_simulation(work.scenario(substeps=1))
    rows, missing = [], []
    widest = _core.max_lanes()
    for number, (lanes, name) in enumerate(LANES.items()):
        tell(f"{lanes} lanes", 0.3 + 0.2 * number)
        if lanes > widest:
            missing.append(f"palpate, {lanes} lanes: this machine or build lacks {name}")
            continue
        cells = 64 * lanes
        # The first cell is that of the reference; the others differ in stiffness, as in a sweep.
        stiffness = np.repeat(np.linspace(STIFFNESS, 2 * STIFFNESS, cells)[:, None], 3, axis=1)

        def run(lanes: int = lanes, cells: int = cells, stiffness: Array = stiffness) -> Array:
            found = _core.run_cells(
                prepared.setup, prepared.reference, prepared.operator, {"stiffness": stiffness}, cells, 1, lanes
            )
            return np.asarray(found)[0, -6:-3]

        asked = ASKED if lanes == 8 else None
        rows.append(_row(f"palpate: {lanes} lanes ({name})", run, cells, effort.runs(30), last, asked))
        if lanes == widest:
            for what, (controller, columns, required) in _burdens(prepared.start, work).items():
                tell(f"{lanes} lanes, {what}", 0.35 + 0.2 * number)

                def burdened(
                    substeps: int,
                    count: int,
                    columns: dict[str, Array] = columns,
                    controller: str | None = controller,
                    lanes: int = lanes,
                    stiffness: Array = stiffness,
                ) -> Callable[[], Array]:
                    ready = build_simulation(work.scenario(substeps, controller))
                    own = {name: np.tile(value, (count, 1)) for name, value in columns.items()}
                    own["stiffness"] = stiffness[:count].copy()

                    def last_angles() -> Array:
                        found = _core.run_cells(ready.setup, ready.reference, ready.operator, own, count, 1, lanes)
                        return np.asarray(found)[0, -6:-3]

                    return last_angles

                fine = burdened(64, 1)()
                title = f"palpate: {lanes} lanes, {what}"
                rows.append(_row(title, burdened(1, cells), cells, effort.runs(15), fine, required))
    tell("MuJoCo: rollout", 0.9)
    try:
        rows.append(_row("MuJoCo: rollout", lambda: mujoco_rollout(work, 4), 4, effort.runs(10), last, None))
    except ImportError as problem:
        missing.append(f"MuJoCo: rollout: {problem.name} is not installed (pip install 'palpate[bench]')")
    return Rows(rows, missing)


def _burdens(start: Array, work: Workload) -> dict[str, tuple[str | None, dict[str, Array], float | None]]:
    """Return variants with more work per loop: controller, columns and the required loops per second.

    They are an operator with a rigid grip, the dry friction of the rotors, and controllers.
    """
    tip = np.asarray(work.device.forward(start))[None]
    arm = {"mass": 0.15, "damping": 4.5, "stiffness": 560.0}
    hand = {**{f"arm_{key}": np.array([[value]]) for key, value in arm.items()}, "arm_rest": tip}
    rubbing = {"coulomb": np.full((1, 3), 0.01), "breakaway": np.full((1, 3), 0.01)}
    return {
        "in a hand": (None, hand, None),
        "dry friction": (None, rubbing, None),
        "in a hand, dry friction": (None, {**hand, **rubbing}, None),
        "LQG": ("lqg", {}, None),
        "workspace controller": ("workspace", {}, ASKED_WORKSPACE),
    }


def _row(
    name: str, job: Callable[[], Array], loops: int, runs: int, last: Array, asked: float | None
) -> dict[str, Any]:
    angles = job()  # also warms up
    seconds = np.empty(runs)
    for i in range(runs):
        begin = time.thread_time()  # of this thread, also on a shared core
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
    "one-second closed loops of the nonlinear device at 1 kHz, per second of one core (MuJoCo: torques precomputed)",
    ("program", "loops/s", "best", "runs", "error [rad]", "required"),
    _cells,
    _measure,
)
