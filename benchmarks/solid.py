"""Time of the model updates of a hyperelastic solid, and of servo ticks at the same time."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.section import Effort, Progress, Rows, Section, figures

__all__ = ["SECTION"]

SIZE, CELL = (0.1, 0.1, 0.05), 0.005  # m: 4,851 nodes
YOUNG, POISSON, RADIUS, DEPTH = 10e3, 0.45, 12e-3, 10e-3
SECONDS = 10.0
PERIOD = 1e-3


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return model updates per second and times of ticks, by "law" and "motion", with and without updates.

    Without updates the tip stays over one place: it would leave the nodes of its only local model.
    """
    from palpate.fem import HyperelasticModel, Material, QuasiStaticSolver, block
    from palpate.fem.selectors import half_space

    volume = block(SIZE, CELL)
    bottom, top = half_space("z", "<", 1e-9), half_space("z", ">", SIZE[2] - 1e-9)
    t = np.arange(0.0, SECONDS / (10 if effort.quick else 1), PERIOD)
    rows: list[dict[str, Any]] = []
    motions = {"pressed at up to 30 mm/s": (0.0, True), "sliding at up to 50 mm/s": (20e-3, False)}
    for number, law in enumerate(("neo-hookean", "corotational")):
        body = QuasiStaticSolver(HyperelasticModel(volume, Material(YOUNG, POISSON), bottom, top, law=law))  # type: ignore[arg-type]
        for motion, (way, pumps) in motions.items():
            tell(f"{len(volume.points):,} nodes, {law}, {motion}", number / 2)
            depth = DEPTH * (0.5 - 0.5 * np.cos(5.0 * t) if pumps else np.minimum(t / 0.4, 1.0))
            path = np.stack(
                [
                    SIZE[0] / 2 + way * np.sin(2.5 * t),
                    np.full_like(t, SIZE[1] / 2),
                    SIZE[2] + RADIUS - depth,
                ],
                axis=1,
            )
            body.reset()
            on = body.simulate_realtime(path, RADIUS, outward=(0, 0, 1), period=PERIOD)
            pressed = on.touches.nodes[:, 0]
            path[:, 0] = SIZE[0] / 2
            off = body.simulate_realtime(path, RADIUS, outward=(0, 0, 1), period=PERIOD, thread=False)
            deep = t > 0.5
            rows.append(
                {
                    "law": law,
                    "motion": motion,
                    "nodes": len(volume.points),
                    "pressed": int(np.median(pressed[deep])),
                    "steps_per_s": float(1.0 / np.median(on.steps)),
                    "steps_per_s_slowest": float(1.0 / np.percentile(on.steps, 95)),
                    "tick_median_us": float(np.median(on.ticks[deep]) * 1e6),
                    "tick_p99.9_us": float(np.percentile(on.ticks[deep], 99.9) * 1e6),
                    "tick_without_p99.9_us": float(np.percentile(off.ticks[deep], 99.9) * 1e6),
                    "late_p99.9_us": float(np.percentile(on.late, 99.9) * 1e6),
                    "late_without_p99.9_us": float(np.percentile(off.late, 99.9) * 1e6),
                    "waiting_ticks": int(on.touches.tank_empty.sum()),
                    "ticks_without_force": int(np.count_nonzero(~on.found)),
                }
            )
    return Rows(rows)


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    return (
        f"{row['law']}, {row['motion']}",
        str(row["pressed"]),
        figures(row["steps_per_s"]),
        figures(row["steps_per_s_slowest"]),
        figures(row["tick_median_us"], 2),
        f"{figures(row['tick_p99.9_us'], 2)} / {figures(row['tick_without_p99.9_us'], 2)}",
        f"{figures(row['late_p99.9_us'], 2)} / {figures(row['late_without_p99.9_us'], 2)}",
    )


SECTION = Section(
    "a solid of 4,851 nodes (100 x 100 x 50 mm, nu 0.45) under a sphere of 12 mm, up to 10 mm deep: model updates in "
    "their own thread, and the servo at 1 kHz with that thread / without it (required: 50 updates per second)",
    ("solid", "nodes in\ncontact", "updates/s", "5th\npercentile", "tick [µs]", "p99.9 [µs]", "late, p99.9 [µs]"),
    _cells,
    _measure,
)
