"""Time of a whole servo tick on a body of 2,000 surface nodes, with and without a drawing thread."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from palpate import _core
from palpate.arrays import Array, Indices, Single
from palpate.scenario.operators import OPERATOR_STIFFNESS, default_operator
from palpate.simulation.simulator import Simulation, build_simulation

from benchmarks.ball import ball
from benchmarks.section import Effort, Progress, Row, Rows, Section, figures
from experiments.palpation_phantom.stiffnesses import LAWS, POSE

__all__ = ["SECTION"]

PIECES = 14  # 1,962 nodes
RADIUS, BUMP = 0.04, 0.02  # m; of the radius
TIP = 12e-3  # m
MODULUS = 12.5e3  # E / (1 - nu^2), Pa
MODES = 60
BODY_MASS = 0.3  # kg
PASSES = 3
ASKED = 25.0  # us


def _experiment(duration: float, law: str) -> Simulation:
    """Return a loop without an object, in which the tip moves to and fro under a force of 1.3 N."""
    table = [["0 s", "0 N", "0 N", "0 N"], ["0.5 s", "0 N", "0 N", "0 N"]]
    for i in range(round(2.0 * (duration - 0.5))):  # 3 cm each half second
        way = OPERATOR_STIFFNESS * 0.015 * (1 if i % 2 == 0 else -1)
        table.append([f"{0.5 + (i + 1) / 2.0:g} s", f"{way:g} N", f"{way / 3:g} N", "0 N"])
    return build_simulation(
        {
            "device": {"name": "phantom-premium-1.5a", "saturation": True, "encoder": True},
            "start": {"pose": list(POSE)},
            "servo": {"period": "1 ms"},
            "reference": {"shape": "ramp", "rise": "0.3 s", "force": ["0 N", "0 N", "-1.3 N"]},
            "operator": default_operator(table),
            "object": {"kind": "none"},
            "controller": dict(LAWS[law] or {}),
            "run": {"duration": f"{duration:g} s"},
        }
    )


@dataclass(frozen=True)
class _Organ:
    """Nodes, normals, areas and the compliance of a half space, whose cost is that of any compliance; triangles."""

    points: Array
    normals: Array
    areas: Array
    compliance: Single
    triangles: Indices

    def cores(self) -> dict[str, _core.DeformableBody]:
        """Return a body by contact and memory."""
        node_contact = _core.ComplianceBody(self.points, self.normals, self.areas, self.compliance)
        count = len(self.points)
        nodes = np.arange(count, dtype=np.int32)
        surface = (self.points, self.triangles.astype(np.int32), nodes, np.full((count, 2), MODULUS))
        still = (np.zeros((3 * count, 0), dtype=np.float32), np.zeros(0))
        arrays = (self.points, self.normals, self.areas, self.compliance, *surface, 0.45)
        moving = self._modes()
        cores: dict[str, _core.DeformableBody] = {"node contact": node_contact}
        for words, (static, dynamic) in (("", (0.0, 0.0)), (", friction", (0.4, 0.3))):
            cores |= {
                f"signed distance{words}": _core.SignedDistanceBody(
                    *arrays, *still, static_friction=static, dynamic_friction=dynamic
                ),
                f"signed distance, creep{words}": _core.SignedDistanceBody(
                    *arrays,
                    *still,
                    instantaneous_ratio=2.0,
                    retardation_time=0.1,
                    static_friction=static,
                    dynamic_friction=dynamic,
                ),
                f"signed distance, {MODES} modes{words}": _core.SignedDistanceBody(
                    *arrays, *moving, rayleigh_beta=1e-4, static_friction=static, dynamic_friction=dynamic
                ),
            }
        return cores

    def _modes(self) -> tuple[Single, Array]:
        """Return shapes, 1/sqrt(kg), and frequencies, rad/s, of equal masses on the compliance of each axis."""
        count, each = len(self.points), MODES // 3
        eigenvalues, vectors = scipy.linalg.eigh(self.compliance[::3, ::3], subset_by_index=[count - each, count - 1])
        mass = BODY_MASS / count
        shapes = np.zeros((count, 3, each, 3), dtype=np.float32)
        for axis in range(3):
            shapes[:, axis, :, axis] = vectors / np.sqrt(mass)
        return shapes.reshape(3 * count, MODES), np.repeat(1.0 / np.sqrt(eigenvalues * mass), 3)


def _organ() -> _Organ:
    points, triangles = ball(PIECES, RADIUS, BUMP)
    a, b, c = (points[triangles[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normals = np.zeros_like(points)
    areas = np.zeros(len(points))
    for corner in range(3):
        np.add.at(normals, triangles[:, corner], normal)
        np.add.at(areas, triangles[:, corner], np.linalg.norm(normal, axis=1) / 6.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    apart = np.linalg.norm(points[:, None] - points[None], axis=2) + 0.3 * np.sqrt(areas.mean())
    along = (1.0 / (np.pi * MODULUS) / apart).astype(np.float32)
    full = np.zeros((3 * len(points), 3 * len(points)), dtype=np.float32)
    for axis in range(3):
        full[axis::3, axis::3] = along
    return _Organ(points, normals, areas, full, triangles)


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return times of a tick, us: "median_us", "p99.9_us" and "slowest_us", by "loop" and "drawn".

    Ticks follow one another directly, or are paced by the clock, one per period, with cold caches.
    """
    duration = 3.0 if effort.quick else 20.0
    tell("a body of 2,000 nodes", 0.0)
    organ = _organ()
    rows: list[Row] = []
    cores = organ.cores()
    cases = [("lead–lag", "node contact", duration, False, False), ("LQG", "node contact", duration, False, False)]
    cases += [("LQG", kind, duration, False, drawn) for kind in cores for drawn in (False, True)][1:]
    cases += [("LQG", kind, 3.0, True, False) for kind in cores]
    for number, (law, kind, lasts, paced, drawn) in enumerate(cases):
        experiment = _experiment(lasts, law)
        anchor = np.array(experiment.setup.wall.point)
        top = organ.points[:, 2].max()
        experiment.setup.set_body(
            _core.PlacedBody(cores[kind], anchor - [0.0, 0.0, top + TIP + 2e-4], np.eye(3), TIP, False)
        )
        name = f"{law}, {kind}{', paced' if paced else ''}"
        tell(f"{name}{', drawn' if drawn else ''}", 0.1 + 0.9 * number / len(cases))
        frames = _core.SurfaceFrames(organ.compliance, 60.0) if drawn else None
        if frames is not None:
            experiment.setup.set_observer(frames)
        seconds = np.min([_time(experiment, paced) for _ in range(PASSES)], axis=0)
        pressed = experiment.run()[0]
        rows.append(
            {
                "loop": name,
                "drawn": drawn,
                "nodes": len(organ.points),
                "pressed": int(np.median(pressed[:, -7])),
                "ticks": len(seconds),
                "median_us": 1e6 * float(np.median(seconds)),
                "p99.9_us": 1e6 * float(np.quantile(seconds, 0.999)),
                "slowest_us": 1e6 * float(seconds.max()),
                "asked_us": ASKED,
            }
        )
    return Rows(rows)


def _time(experiment: Simulation, paced: bool) -> Array:
    return np.asarray(experiment.setup.time_ticks(experiment.reference, experiment.operator, paced))


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    return (
        f"{row['loop']}, {row['nodes']:,} nodes, {row['pressed']} in contact{', drawn' if row['drawn'] else ''}",
        figures(row["median_us"], 2),
        figures(row["p99.9_us"], 2),
        figures(row["slowest_us"], 2),
        f"{row['asked_us']:g}{'' if row['p99.9_us'] <= row['asked_us'] else ' (missed)'}",
    )


SECTION = Section(
    "a whole servo tick (encoder, device, contact, body, control, drive) with a sphere of 24 mm at 6 cm/s on a body "
    "(minimum of three passes)",
    ("loop", "median [µs]", "p99.9 [µs]", "slowest [µs]", "required [µs]"),
    _cells,
    _measure,
)
