"""Time the closed loop in palpate, MuJoCo and python-control, and hold each trajectory against a tight reference."""

from __future__ import annotations

import json
import os
import platform
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.bench.peers import mujoco_loop, python_control_loop
from palpate.bench.workload import DURATION, Workload
from palpate.files import write_whole
from palpate.loop.simulate import prepare, simulate

__all__ = ["run"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]


def run(out: str | Path | None = None, *, quick: bool = False, progress: Progress | None = None) -> dict[str, Any]:
    """Return speeds as multiples of real time, and write them to `out` (JSON) if given.

    Each row: "program", "times_real_time" (median), "worst_times_real_time" (p99.9 of the run times where there are
    a thousand, else the slowest), "runs", "error_rad" (largest distance from the reference trajectory), "ratio"
    (palpate's median speed over this one's). `quick` takes a tenth of the runs. A peer that is not installed is
    left out, and named under "missing".
    """
    tell = progress or (lambda _text, _fraction: None)
    work = Workload.standard()
    tell("a tight reference trajectory (DOP853)", 0.0)
    reference = work.reference()
    scale = 10 if quick else 1
    prepared = prepare(work.scenario(substeps=1))

    def core() -> Array:
        return np.asarray(prepared.run()[0])[:, :3]

    jobs: list[tuple[str, Callable[[], Array], int]] = [
        ("palpate: the loop (C++ core)", core, 2000 // scale),
        ("palpate: simulate(), trace and all", lambda: simulate(work.scenario(substeps=1))["angle"], 50 // scale),
        ("MuJoCo: mj_step from Python", lambda: mujoco_loop(work), 10 // scale),
        ("python-control: nlsys", lambda: python_control_loop(work), 5 // scale + 1),
    ]
    rows, missing = [], []
    for number, (name, job, runs) in enumerate(jobs):
        tell(name, 0.2 + 0.8 * number / len(jobs))
        try:
            rows.append(_measure(name, job, runs, reference))
        except ImportError as problem:
            missing.append(f"{name}: {problem.name} is not installed (pip install 'palpate[bench]')")
    for row in rows:
        row["ratio"] = rows[0]["times_real_time"] / row["times_real_time"]
    tell("done", 1.0)
    result = {
        "work": "nonlinear PHANToM Premium 1.5A, 1 kHz force law at a sampled spring and damper, 1 s",
        "rows": rows,
        "missing": missing,
        "machine": {"processor": _processor(), "cores": os.cpu_count(), "python": platform.python_version()},
        "versions": {name: _version(name) for name in ("palpate", "mujoco", "control", "numpy", "scipy")},
    }
    if out is not None:
        write_whole(out, lambda path: path.write_text(json.dumps(result, indent=2) + "\n", "utf-8"))
    return result


def _measure(name: str, job: Callable[[], Array], runs: int, reference: Array) -> dict[str, Any]:
    angles = job()  # also warms up
    seconds = np.empty(max(runs, 1))
    for i in range(len(seconds)):
        begin = time.perf_counter()
        job()
        seconds[i] = time.perf_counter() - begin
    slow = np.quantile(seconds, 0.999) if len(seconds) >= 1000 else seconds.max()
    return {
        "program": name,
        "times_real_time": float(DURATION / np.median(seconds)),
        "worst_times_real_time": float(DURATION / slow),
        "runs": len(seconds),
        "error_rad": float(np.abs(angles - reference).max()),
    }


def _processor() -> str:
    try:
        for line in Path("/proc/cpuinfo").read_text("utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    except OSError:
        pass
    return platform.processor() or platform.machine()


def _version(name: str) -> str | None:
    try:
        return version(name)
    except Exception:
        return None
