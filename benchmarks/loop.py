"""Speed and error of the closed loop in palpate, MuJoCo and python-control."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from palpate.arrays import Array
from palpate.simulation.simulator import build_simulation, simulate

from benchmarks.peers import mujoco_loop, python_control_loop
from benchmarks.section import Effort, Progress, Rows, Section, figures
from benchmarks.workload import DURATION, Workload

__all__ = ["SECTION"]


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return speeds as multiples of real time.

    Each row has "program", "times_real_time" (median), "worst_times_real_time", "runs", "error_rad" (largest, relative
    to the reference trajectory) and "ratio", palpate's median speed over that of the program. The worst speed is p99.9
    of the run times, or the slowest of fewer than a thousand. Peers that are not installed are listed as missing.
    """
    work = Workload.standard()
    tell("reference trajectory (DOP853)", 0.0)
    reference = work.reference()
    prepared = build_simulation(work.scenario(substeps=1))

    def core() -> Array:
        return np.asarray(prepared.run()[0])[:, :3]

    jobs: list[tuple[str, Callable[[], Array], int]] = [
        ("palpate: C++ core", core, 2000),
        ("palpate: simulate(), with its trace", lambda: simulate(work.scenario(substeps=1))["angle"], 50),
        ("MuJoCo: mj_step from Python", lambda: mujoco_loop(work), 10),
        ("python-control: nlsys", lambda: python_control_loop(work), 6),
    ]
    rows, missing = [], []
    for number, (name, job, runs) in enumerate(jobs):
        tell(name, 0.2 + 0.8 * number / len(jobs))
        try:
            rows.append(_row(name, job, effort.runs(runs), reference))
        except ImportError as problem:
            missing.append(f"{name}: {problem.name} is not installed (pip install 'palpate[bench]')")
    for row in rows:
        row["ratio"] = rows[0]["times_real_time"] / row["times_real_time"]
    return Rows(rows, missing)


def _row(name: str, job: Callable[[], Array], runs: int, reference: Array) -> dict[str, Any]:
    angles = job()  # also warms up
    seconds = np.empty(runs)
    for i in range(runs):
        begin = time.perf_counter()
        job()
        seconds[i] = time.perf_counter() - begin
    slow = np.quantile(seconds, 0.999) if runs >= 1000 else seconds.max()
    return {
        "program": name,
        "times_real_time": float(DURATION / np.median(seconds)),
        "worst_times_real_time": float(DURATION / slow),
        "runs": runs,
        "error_rad": float(np.abs(angles - reference).max()),
    }


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    return (
        row["program"],
        figures(row["times_real_time"], 4),
        figures(row["worst_times_real_time"], 4),
        str(row["runs"]),
        f"{row['error_rad']:.1e}",
        figures(row["ratio"], 4),
    )


SECTION = Section(
    "nonlinear PHANToM Premium 1.5A, 1 kHz force law at a sampled spring and damper, 1 s",
    ("program", "× real time", "slow tail", "runs", "error [rad]", "ratio"),
    _cells,
    _measure,
)
