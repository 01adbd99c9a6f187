"""Random loops on meshes, and what the nonlinear loop does with them when it is pushed where it rests."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
from palpate.errors import DesignError, PoseError
from palpate.scenario import Scenario
from palpate.simulation.simulator import Simulation
from palpate.units import write
from scipy.spatial.transform import Rotation

WATCHED = 6.0  # s after the push
SLIDES = 1e-4  # m/s: a proxy that moves faster does not rest
Outcome = Literal["rests", "decays", "moves", "slides", "apart"]


def random_loop(rng: np.random.Generator, folder: Path, roughest: float = 0.3) -> dict[str, Any]:
    """Return the tables of a random scenario that presses a tip on a mesh; meshes are written into `folder`."""
    device = str(rng.choice(["phantom-premium-1.5a", "slider"], p=[0.85, 0.15]))
    outward = np.array([1.0, 0.0, 0.0]) if device == "slider" else np.array([0.0, 0.0, 1.0])
    tilt = Rotation.from_rotvec(rng.uniform(-0.4, 0.4, 3)) * Rotation.align_vectors([outward], [[0.0, 0.0, 1.0]])[0]
    normal = tilt.apply([0.0, 0.0, 1.0])
    radius = 0.0 if rng.random() < 0.75 else float(rng.uniform(2e-3, 8e-3))
    tables: dict[str, Any] = {
        "device": {"name": device, "delay": int(rng.choice([0, 0, 1, 2]))},
        "servo": {"period": f"{rng.choice([0.5, 1.0, 2.0])} ms"},
        "object": {
            "kind": "mesh",
            "position": [write(float(x), "m") for x in -(radius + rng.uniform(1e-4, 1e-3)) * normal],
            "mesh": {
                **_shape(rng, folder),
                "radius": f"{radius} m",
                "rotation": [f"{a} rad" for a in tilt.as_euler("xyz")],
            },
            "surface": _surface(rng, roughest),
        },
        "run": {"duration": "1.5 s"},
    }
    if device != "slider":
        pose = np.array([0.0, 2.2305, 3.2776]) + rng.uniform(-0.35, 0.35, 3)
        tables["start"] = {"pose": [f"{q} rad" for q in pose]}
    deepest = 4e-3 * float(str(np.atleast_1d(tables["object"]["surface"]["stiffness"])[0]).split()[0])
    press = -min(float(np.exp(rng.uniform(np.log(0.3), np.log(3.0)))), deepest) * normal
    tracks = device != "slider" and rng.random() < 0.3
    sideways = float(np.linalg.norm(press)) * rng.standard_normal(3)
    press += 0.03 * sideways
    if tracks:
        tables["servo"]["topology"] = "force_tracking"
        tables["reference"] = {"shape": "ramp", "rise": "0.2 s", "force": [write(float(x), "N") for x in press]}
        surface = tables["object"]["surface"]
        rough = "static_friction" in surface and surface.get("tangential") != "0.0 N/m"
        kind = str(rng.choice(["lqg", "lead_lag"])) if rough else "lead_lag"  # integrators slide where nothing holds
        tables["controller"] = {"kind": kind, "stiffness": "1 N/mm"}
    else:
        tables["servo"]["topology"] = "impedance_display"
    hand = _hand(rng)
    if not tracks:
        steep = tables["object"]["mesh"].get("shape") != "box" or not tables["object"]["surface"].get("static_friction")
        if steep or rng.random() < 0.6:  # without friction on a flat face, an arm must hold the tip
            reach = press + 0.12 * sideways - hand.pop("k") * normal * 2e-3
            tables["operator"] = {"kind": "arm", **hand, "shape": "ramp", "rise": "0.2 s"}
        else:
            reach = press
            tables["operator"] = {"kind": "force", "shape": "ramp", "rise": "0.2 s"}
        tables["operator"]["force"] = [write(float(x), "N") for x in reach]
    elif rng.random() < 0.9 or not rough:
        hand.pop("k")
        tables["operator"] = {"kind": "arm", **hand}
    return tables


def _shape(rng: np.random.Generator, folder: Path) -> dict[str, Any]:
    kind = rng.choice(["box", "bumpy_ellipsoid", "file"])
    if kind == "box":
        return {"shape": "box", "edge": "80 mm", "divisions": int(rng.integers(1, 9))}
    if kind == "bumpy_ellipsoid":
        bump = float(rng.choice([0.0, 0.03, 0.06]))
        size = [f"{x} mm" for x in rng.uniform(60.0, 120.0, 3)]
        return {"shape": "bumpy_ellipsoid", "size": size, "bump": bump, "divisions": int(rng.integers(2, 4))}
    return {"file": str(_torus(rng, folder)), "unit": "mm"}


def _torus(rng: np.random.Generator, folder: Path) -> Path:
    """Write a torus whose top is at the origin, and return its file."""
    import trimesh

    tube = float(rng.uniform(15.0, 30.0))
    mesh = trimesh.creation.torus(60.0, tube, major_sections=int(rng.integers(16, 40)), minor_sections=16)
    path = folder / f"torus-{rng.integers(1 << 40)}.stl"
    mesh.apply_translation([-60.0 + rng.uniform(-3.0, 3.0), 0.0, -tube])
    mesh.export(path)
    return path


def _surface(rng: np.random.Generator, roughest: float) -> dict[str, Any]:
    k = float(np.exp(rng.uniform(np.log(30.0), np.log(2e4))))
    surface: dict[str, Any] = {"stiffness": f"{k} N/m"}
    if rng.random() < 0.25:
        surface |= {"stiffness": [f"{k} N/m", f"{1.3 * k} N/m"], "pattern": "checkerboard", "width": "7 mm"}
    if rng.random() < 0.4:
        surface["tangential"] = f"{k * rng.choice([0.0, 0.3, 0.7])} N/m"
    if rng.random() < 0.7:
        friction = float(rng.uniform(0.05, roughest))
        surface["static_friction"] = friction
        if rng.random() < 0.2:
            surface["dynamic_friction"] = 0.8 * friction
    if rng.random() < 0.2:
        surface["viscous"] = f"{rng.uniform(0.2, 3.0)} N*s/m"
    if rng.random() < 0.3:
        surface["damping"] = f"{rng.uniform(0.1, 3.0)} N*s/m"
    if rng.random() < 0.2:
        surface["field"] = "continuous"
    if rng.random() < 0.3:
        surface["shading"] = "40 deg"
    return surface


def _hand(rng: np.random.Generator) -> dict[str, Any]:
    k = float(np.exp(rng.uniform(np.log(100.0), np.log(800.0))))
    hand: dict[str, Any] = {
        "mass": f"{rng.uniform(0.05, 0.3)} kg",
        "damping": f"{rng.uniform(1.0, 8.0)} N*s/m",
        "stiffness": f"{k} N/m",
        "k": k,
    }
    if rng.random() < 0.4:
        hand |= {"tissue_stiffness": f"{rng.uniform(300, 2000)} N/m", "tissue_damping": f"{rng.uniform(0.3, 2)} N*s/m"}
    return hand


def outcome(tables: dict[str, Any], seed: int, push: float = 0.05) -> tuple[Outcome, str]:
    """Return whether the loop rests in contact long after a push of `push` of its contact force, and what it did.

    A loop whose motion or slide decays slowly is watched four times as long.
    """
    found = _pushed(tables, seed, push, WATCHED)
    return _pushed(tables, seed, push, 4.0 * WATCHED) if found[0] == "decays" else found


def _pushed(tables: dict[str, Any], seed: int, push: float, watched: float) -> tuple[Outcome, str]:
    scenario = Scenario.from_dict(tables)
    pushed_at = scenario.run.duration + 2.0
    run = scenario.run.model_copy(update={"duration": pushed_at + watched})
    simulation = Simulation.of(scenario.model_copy(update={"run": run}))
    rows, count, unstable = simulation.setup.run(simulation.reference, simulation.operator)
    if unstable >= 0:
        return "moves", f"diverges at {unstable * scenario.period:.3g} s"
    free = simulation.trace(np.asarray(rows)[:count], unstable)
    at = round(pushed_at / scenario.period)
    direction = np.random.default_rng(seed).standard_normal(3)
    size = push * max(float(np.linalg.norm(free["object_force"][at])), 0.02)
    force = simulation.operator.copy()
    force[at : at + round(0.03 / scenario.period)] += size * direction / np.linalg.norm(direction)
    rows, count, unstable = simulation.setup.run(simulation.reference, np.ascontiguousarray(force))
    if unstable >= 0:
        return "moves", f"diverges at {unstable * scenario.period:.3g} s after a push"
    trace = simulation.trace(np.asarray(rows)[:count], unstable)
    last = round(1.0 / scenario.period)
    if not trace["touching"][-last:, 0].any():
        return "apart", "off the mesh"
    rms = [_swing(part, scenario.period) for part in (trace["tip"][at : at + last], trace["tip"][-last:])]
    lost = int(np.count_nonzero(trace["touching"][-last:, 0] == 0.0))
    text = f"{rms[0] * 1e3:.3g} -> {rms[1] * 1e3:.3g} mm/s, apart for {lost} of {last} ticks"
    if rms[1] < 1e-4 and not lost:
        proxy = trace["proxy"]
        slide = [float(np.linalg.norm(b - a)) for a, b in ((proxy[at], proxy[at + last]), (proxy[-last], proxy[-1]))]
        if slide[1] > SLIDES:  # over one second
            return ("decays" if slide[1] < 0.8 * slide[0] else "slides"), f"slides on at {1e3 * slide[1]:.2g} mm/s"
        return "rests", text
    return ("decays" if rms[1] < 0.8 * rms[0] and not lost else "moves"), text


def _swing(tip: Any, period: float) -> float:
    """Return the rms speed of a tip about its smooth motion, m/s."""
    smooth = np.polynomial.Legendre
    at = np.linspace(-1.0, 1.0, len(tip))
    rest = np.stack([x - smooth.fit(at, x, 3)(at) for x in tip.T], axis=1)
    return float(np.sqrt(np.mean(np.sum((np.diff(rest, axis=0) / period) ** 2, axis=1))))


def loops(seed: int, count: int, folder: Path) -> list[dict[str, Any]]:
    """Return `count` random loops that run and touch the mesh."""
    rng = np.random.default_rng(seed)
    found: list[dict[str, Any]] = []
    while len(found) < count:
        tables = random_loop(rng, folder)
        try:
            simulation = Simulation.of(Scenario.from_dict(tables))
        except (DesignError, PoseError):
            continue  # a pose that cannot be reached, or no controller
        rows, n, unstable = simulation.setup.run(simulation.reference, simulation.operator)
        if simulation.trace(np.asarray(rows)[:n], unstable)["touching"].any():
            found.append(tables)
    return found
