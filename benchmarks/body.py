"""Time of one tick of a body in contact, and of one step of MuJoCo's flex on the same tetrahedra."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from palpate import _core
from palpate.arrays import Array
from palpate.fem import Body, block, build

from benchmarks.section import Effort, Progress, Rows, Section, figures

__all__ = ["SECTION"]

SIZE, CELLS = (0.1, 0.1, 0.05), 5e-3  # m; 4,851 vertices, 24,000 tetrahedra
SMALL = (0.06, 0.06, 0.03)
FINE = (2.5e-3, 2.5e-3, 10e-3)
TICKS = 20_000
PERIOD = 1e-3
ASKED = {10: 2.5, 30: 20.0}  # µs
ASKED_DISTANCE = {10: 2.8, 30: 10.0}  # µs
ASKED_MODAL = 5.0


def _measure(effort: Effort, tell: Progress) -> Rows:
    """Return times, us: "median_us", "p99.9_us" and "asked_us", the required median.

    "pressed" is the median number of nodes in contact, None for MuJoCo. "ratio" is the median of a MuJoCo
    step over that of the tick on the same mesh with about 30 nodes.
    """
    ticks, rows = effort.runs(TICKS), []
    tell("a body of 4,851 vertices", 0.0)
    begin = time.perf_counter()
    body = _made(CELLS, modes=300)
    built = time.perf_counter() - begin
    tell("a body with four times the contact nodes", 0.4)
    for made, step in ((body, CELLS), (_made(FINE), FINE[0])):
        rows += [_row("compliance", made, step, pressed, ticks, ASKED[pressed]) for pressed in ASKED]
    same = rows[1]["median_us"]
    rough = body.with_friction(0.5, 0.4)
    rows += [_row("compliance, friction", rough, CELLS, pressed, ticks, None) for pressed in ASKED]
    exact = body.signed_distance()
    rows += [_row("signed_distance", exact, CELLS, pressed, ticks, ASKED_DISTANCE[pressed]) for pressed in ASKED]
    rough = body.signed_distance(static_friction=0.5, dynamic_friction=0.4)
    rows += [_row("signed_distance, friction", rough, CELLS, pressed, ticks, None) for pressed in ASKED]
    moving = body.modal(PERIOD, rayleigh_beta=1e-4, contact="signed_distance")
    rows.append(_row("modal, signed distance, 300 modes", moving, CELLS, 10, ticks, None))
    creeping = body.viscoelastic(PERIOD, instantaneous_ratio=2.0, retardation_time="0.1 s")
    rows.append(_row("viscoelastic", creeping, CELLS, 10, ticks, None))
    tell("300 modes", 0.6)
    rows.append(_row("modal, 300 modes", body.modal(PERIOD, rayleigh_beta=1e-4), CELLS, 10, ticks, ASKED_MODAL))
    rough = body.modal(PERIOD, rayleigh_beta=1e-4, static_friction=0.5, dynamic_friction=0.4)
    rows.append(_row("modal, 300 modes, friction", rough, CELLS, 10, ticks, None))
    tell("a mass-spring model", 0.7)
    small = build(block(SMALL, CELLS), young=20e3, fixed="z <= 0 mm", touch="z >= 30 mm", order=1)
    network = small.mass_spring(PERIOD, rayleigh_beta=2e-3)
    rows.append(_row("mass_spring, 1,183 vertices", network, CELLS, 10, effort.runs(TICKS // 10), None, SMALL))
    seconds = body.record["seconds"]
    times = f"{built - seconds['modes']:.2g} s, and its 300 modes {seconds['modes']:.2g} s"
    notes = [f"the body of {len(body.nodes)} nodes was built in {times}"]
    for number, (name, reduced, runs) in enumerate((("reduced (trilinear)", True, 400), ("all vertices", False, 30))):
        tell(f"MuJoCo: flex, {name}", 0.75 + 0.1 * number)
        try:
            rows.append(_flex(name, reduced, effort.runs(runs), same))
        except ImportError as problem:
            notes.append(f"MuJoCo: {problem.name} is not installed (pip install 'palpate[bench]')")
        except ValueError as problem:
            notes.append(f"MuJoCo: flex, {name}: {problem}")
    return Rows(rows, notes)


def _made(spacing: float | tuple[float, float, float], modes: int = 0) -> Body:
    cells = list(spacing) if isinstance(spacing, tuple) else spacing
    return build(block(SIZE, cells), young=20e3, fixed="z <= 0 mm", touch="z >= 50 mm", order=1, modes=modes)


def _row(
    what: str,
    body: Body,
    step: float,
    pressed: int,
    ticks: int,
    asked: float | None,
    size: tuple[float, float, float] = SIZE,
) -> dict[str, Any]:
    """Return the times of a sphere that slides in a circle, as deep as about `pressed` nodes in contact need."""
    radius = 6.0 * step
    turn = np.linspace(0.0, 2.0 * np.pi, ticks)
    around = 2.3 * step * np.stack([np.cos(turn), np.sin(turn), np.zeros(ticks)], axis=1)

    def course(depth: float, every: int = 1) -> Array:
        return np.add(around[::every], [size[0] / 2, size[1] / 2, size[2] + radius - depth])

    depth = pressed * step**2 / (np.pi * radius)  # Hertz
    for _ in range(8):
        met = np.median(body.simulate_path(course(depth, 10), radius, outward=[0, 0, 1]).nodes)
        if abs(met - pressed) <= 0.05 * pressed:
            break
        depth *= (pressed / max(met, 1.0)) ** 0.7
    path = course(depth)
    nodes = body.simulate_path(path, radius, outward=[0, 0, 1]).nodes
    axes = np.tile([0.0, 0.0, 1.0], (ticks, 1))
    times = []
    assert not isinstance(body.core, _core.HyperelasticBody)  # its model updates are not part of the ticks
    for _ in range(3):
        body.core.reset()
        times.append(1e6 * np.asarray(body.core.step_durations(path, axes, radius, False)))
    best = np.min(times, axis=0)
    return {
        "what": f"palpate: {what}, {len(body.nodes)} nodes",
        "pressed": int(np.median(nodes)),
        "median_us": float(np.median(best)),
        "p99.9_us": float(np.quantile(best, 0.999)),
        "asked_us": asked,
        "ratio": None,
    }


def _flex(name: str, reduced: bool, runs: int, same: float) -> dict[str, Any]:
    """Return the times of a step of MuJoCo's flex on the same grid, in contact with a sphere.

    With all vertices the integrator is explicit, because a step of the implicit one takes over a second. The step is
    0.02 ms, because longer ones diverge. The bottom is pinned, or the lower corners of the reduced model.
    """
    import mujoco

    count = [round(side / CELLS) + 1 for side in SIZE]
    pin = "0 0 0 1 1 0" if reduced else f"0 0 0 {count[0] - 1} {count[1] - 1} 0"
    xml = f"""
    <mujoco>
      <option timestep="{2e-4 if reduced else 2e-5}" integrator="{"discrete" if reduced else "Euler"}" gravity="0 0 0"/>
      <size memory="200M"/>
      <worldbody>
        <flexcomp name="body" type="grid" count="{" ".join(map(str, count))}" spacing="{CELLS} {CELLS} {CELLS}" dim="3"
                  mass="0.5" radius="0.0005" {'dof="trilinear"' if reduced else ""}>
          <pin gridrange="{pin}"/><contact selfcollide="none"/>
          <elasticity young="20e3" poisson="0.45" damping="0.002"/></flexcomp>
        <body name="tip" mocap="true" pos="0 0 {SIZE[2] / 2 + 8e-3}"><geom type="sphere" size="0.01"/></body>
      </worldbody>
    </mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    times = np.empty(runs)
    for i in range(runs):
        begin = time.perf_counter()
        mujoco.mj_step(model, data)
        times[i] = 1e6 * (time.perf_counter() - begin)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0:
            times = times[: max(i, 1)]  # it resets itself and continues without contact
            break
    return {
        "what": f"MuJoCo: flex, {name}, {model.nv} unknowns" + (f", diverged at step {i}" if len(times) < runs else ""),
        "pressed": None,
        "median_us": float(np.median(times)),
        "p99.9_us": float(np.quantile(times, 0.999)),
        "asked_us": None,
        "ratio": float(np.median(times) / same),
    }


def _cells(row: dict[str, Any]) -> tuple[str, ...]:
    asked = row["asked_us"]
    met = "" if asked is None else f"{asked:g}{'' if row['median_us'] <= asked else ' (missed)'}"
    return (
        row["what"],
        "" if row["pressed"] is None else str(row["pressed"]),
        figures(row["median_us"]),
        figures(row["p99.9_us"]),
        met,
        "" if row["ratio"] is None else figures(row["ratio"]),
    )


SECTION = Section(
    "one tick of a body in contact (minimum of three passes) and one step of MuJoCo's flex on the same 24,000 "
    "tetrahedra; a tick computes the force of a condensed, linear surface; a step moves the whole solid, with inertia "
    "and large rotations",
    ("program", "nodes in contact", "median [µs]", "p99.9 [µs]", "required", "over the tick"),
    _cells,
    _measure,
)
