"""Time of a whole servo tick on a wall with each guard."""

from __future__ import annotations

from typing import Any

import numpy as np
from palpate.simulation.simulator import build_simulation

from benchmarks.section import Effort, Progress, Row, Rows, Section, figures

__all__ = ["SECTION"]

POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]
PASSES = 5
GUARDS: dict[str, dict[str, Any]] = {
    "no guard": {"kind": "none"},
    "energy bound": {"kind": "energy_bound"},
    "passivity controller": {"kind": "passivity_controller"},
    "half-sample, backward difference": {"kind": "half_sample"},
    "half-sample, adaptive window": {"kind": "half_sample", "velocity": "adaptive_window"},
    "half-sample, observer": {"kind": "half_sample", "velocity": "observer"},
}


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return times of a tick, us, the clock's own included: "median_us" and "p99.9_us", by "guard"."""
    rows: list[Row] = []
    for number, (name, guard) in enumerate(GUARDS.items()):
        tell(name, number / len(GUARDS))
        experiment = build_simulation(
            {
                "device": {"name": "phantom-premium-1.5a", "encoder": True},
                "start": {"pose": POSE},
                "servo": {"period": "1 ms", "topology": "impedance_display"},
                "operator": {"kind": "force", "shape": "sine", "force": ["0 N", "0 N", "-1 N"], "frequency": "5 Hz"},
                "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "2 N/mm"},
                "guard": guard,
                "run": {"duration": "2 s" if effort.quick else "20 s"},
            }
        )
        passes = [experiment.setup.time_ticks(experiment.reference, experiment.operator, False) for _ in range(PASSES)]
        seconds = np.min(passes, axis=0)
        rows.append(
            {
                "guard": name,
                "ticks": len(seconds),
                "median_us": 1e6 * float(np.median(seconds)),
                "p99.9_us": 1e6 * float(np.quantile(seconds, 0.999)),
            }
        )
    return Rows(rows)


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    return row["guard"], figures(row["median_us"], 3), figures(row["p99.9_us"], 3)


SECTION = Section(
    "a whole servo tick of the PHANToM Premium 1.5A on a wall, with each guard (minimum of five passes)",
    ("guard", "median [µs]", "p99.9 [µs]"),
    _cells,
    _measure,
)
