"""Metrics of a run on a deformable body: indentation, force, stiffness and energy balance."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from palpate.arrays import Array
from palpate.checks import MAX_TIPS
from palpate.fem import softening
from palpate.metrics.mesh_contact import LAST
from palpate.scenario.tool_motion import ToolMotion
from palpate.simulation.bodies import mesh_error, overlaps_untouched, tip_depths
from palpate.simulation.moving_frame import touching_tip, turned_to_object
from palpate.simulation.recorded import recorded_scenario
from palpate.simulation.tool_motion import tick_times
from palpate.simulation.trace import Trace
from palpate.units import parse_quantity

__all__ = [
    "FEW",
    "JND",
    "PalpationMetrics",
    "deepest_sample",
    "palpation_metrics",
    "stiffness_along_path",
    "work_so_far",
]

JND = 0.23  # just noticeable relative difference of stiffness (Jones & Hunter 1990)
MIN_SWEEP = 10e-3  # m, path length from which a run counts as a sweep
FEW = 4  # nodes under the tip, below which the force is unreliable
HOLDING = ("modal", "viscoelastic", "mass_spring")  # models that hold each force over the tick that ends at its sample


@dataclass(frozen=True)
class PalpationMetrics:
    """Metrics of a tip in contact with a body, from the first contact to the end of the run, in m, N and J.

    Paths and energies are those in the frame of the body, if that moves. The tip of an admittance display is its
    virtual tool.

    Attributes:
        touches: number of times contact began.
        deepest: largest deflection of the contact patch, of the samples whose contact force was found.
        deepest_force: magnitude of the object force at that moment; the largest force may occur at another.
        stiffness: force over deflection at that moment, N/m.
        nodes: number of nodes in contact at that moment.
        mesh_error: relative error of that force by the mesh (`palpate.fem.force_error`) for a sphere on the kinds
            "compliance", "viscoelastic", "modal" and "signed_distance" of quadratic elements and one modulus, at least
            as large as the distance of the nodes; None otherwise.
        softening: by how much that force may be too small, as the model assumes small strains, relative
            (`palpate.fem.softening`), for a deep tip by signed distance; None otherwise.
        path: length of the tip path in contact.
        path_stiffness_median, path_stiffness_max: force over deflection along the path, N/m (`stiffness_along_path`);
            None for a path under 10 mm.
        work: work of the tip or the tips of a tool on the body (`work_so_far`).
        stored: kinetic and elastic energy of the body at the end, with the internal springs of a standard linear solid.
        saved: energy in the tank of the passive model switch at the end (large displacements).
        at_start: stored and saved energy at the first sample; above zero if the run begins in contact.
        lost: dissipated energy: work plus `at_start` minus stored and saved energy. Without dissipation it is the error
            of the numerical integration. Models that hold forces over a tick contribute df C df / 2 for each step df of
            the force on massless coordinates.
        held: difference of `work` from the work with each force held until the next sample, as by motors: the energy
            that sampling adds to a direct rendering of the body. None if not every tick was recorded.
        final_deflection: mean over the last 0.1 s.
        final_force: magnitude of the object force, mean over the last 0.1 s.
        final_swing: peak-to-peak object force over the last 0.1 s, largest of the axes.
        touching_at_end: whether contact was kept over the last 0.1 s.
        unsolved: number of samples whose contact force was not found: more than 128 nodes lie under the tip, or it
            inverts tetrahedra of the body or moves too far between two updates of its model.
        contact_lost: number of samples without contact inside the body, after the tip was pushed through.
        over_untouched: whether the tip overlaps a part of the surface that is fixed, held or not touched, at the
            deepest deflection or at one of 200 other samples since the first contact. No force acts there, so the
            object force is too small.
        final_tip_forces: magnitudes of the forces of a tool's tips, each the mean over the last 0.1 s; () for one tip.
        tip_depth: of the tip below the surface at rest, at the moment of the deepest deflection (`tip_depths`); None if
            the body is no longer there.
        final_tip_depth: mean over the last 0.1 s; None likewise.
    """

    touches: int
    deepest: float
    deepest_force: float
    stiffness: float
    nodes: int
    mesh_error: float | None
    path: float
    path_stiffness_median: float | None
    path_stiffness_max: float | None
    work: float
    stored: float
    saved: float
    at_start: float
    lost: float
    held: float | None
    final_deflection: float
    final_force: float
    final_swing: float
    touching_at_end: bool
    unsolved: int
    contact_lost: int
    over_untouched: bool = False
    final_tip_forces: tuple[float, ...] = ()
    tip_depth: float | None = None
    final_tip_depth: float | None = None
    softening: float | None = None

    @property
    def settled(self) -> bool:
        """Whether the tip is at rest in contact at the end, with a force steady to 1 % or 1 mN."""
        return self.touching_at_end and self.final_swing <= max(1e-3, 0.01 * self.final_force)

    def to_dict(self) -> dict[str, Any]:
        """Return the metrics for JSON, with the unit as suffix of each name."""
        units = {"deepest": "m", "path": "m", "final_deflection": "m", "stiffness": "N_per_m"}
        units |= dict.fromkeys(("tip_depth", "final_tip_depth"), "m")
        units |= dict.fromkeys(("path_stiffness_median", "path_stiffness_max"), "N_per_m")
        units |= dict.fromkeys(("deepest_force", "final_force", "final_swing", "final_tip_forces"), "N")
        units |= dict.fromkeys(("work", "stored", "saved", "at_start", "lost", "held"), "J")
        named = {f"{key}_{units[key]}" if key in units else key: value for key, value in asdict(self).items()}
        return {**named, "settled": self.settled}


def deepest_sample(trace: Trace) -> int | None:
    """Return the sample with the largest deflection, of those in contact whose force was found; None without any."""
    known = (trace["touching"][:, 0] > 0.0) & (trace["solved"][:, 0] > 0.0)
    depth = np.linalg.norm(trace["deflection"], axis=1)
    return int(np.argmax(np.where(known, depth, -1.0))) if known.any() else None


def some_samples(trace: Trace, first: int = 0) -> Array:
    """Return up to 200 samples of a trace from `first` on, evenly spaced, with both ends."""
    return np.asarray(np.linspace(first, len(trace) - 1, min(len(trace) - first, 200)).astype(int))


def palpation_metrics(trace: Trace) -> PalpationMetrics | None:
    """Return the metrics of a trace on a body; None without a body or with fewer than two samples in contact."""
    if "contact_nodes" not in trace or np.count_nonzero(trace["touching"]) < 2:
        return None
    first = max(int(np.argmax(trace["touching"][:, 0] > 0.0)) - 1, 0)  # the sample before, without stored energy
    names = ("touching", "deflection", "contact_nodes", "solved")
    touching, deflection, nodes, solved = (trace[name][first:] for name in names)
    tip, force = touching_tip(trace)[first:], turned_to_object(trace, trace["object_force"])[first:]
    stored, saved = trace["stored_energy"][first:], trace["tank_energy"][first:]
    time, contact = trace.time[first:], touching[:, 0] > 0.0
    depth = np.linalg.norm(deflection, axis=1)
    magnitude = np.linalg.norm(force, axis=1)
    row = deepest_sample(trace)
    at = int(np.argmax(depth)) if row is None else row - first
    move = np.diff(tip, axis=0)
    work = float(work_so_far(trace)[-1])
    final, tank, initial = float(stored[-1, 0]), float(saved[-1, 0]), float(stored[0, 0] + saved[0, 0])
    every_tick = int(trace.scenario.get("run", {}).get("record_every", 1)) == 1
    last = time >= time[-1] - LAST
    path, path_stiffness = stiffness_along_path(trace)
    swept = len(path) > 0 and path[-1] > MIN_SWEEP
    below = None if (whole := tip_depths(trace)) is None else whole[first:]
    return PalpationMetrics(
        touches=int(contact[0]) + int(np.count_nonzero(contact[1:] & ~contact[:-1])),
        deepest=float(depth[at]),
        deepest_force=float(magnitude[at]),
        stiffness=float(magnitude[at] / depth[at]) if depth[at] > 0.0 else 0.0,
        nodes=int(nodes[at, 0]),
        mesh_error=mesh_error(trace, first + at, int(nodes[at, 0])),
        path=float(np.sum(np.linalg.norm(move, axis=1)[contact[1:] & contact[:-1]])),
        path_stiffness_median=float(np.median(path_stiffness)) if swept else None,
        path_stiffness_max=float(np.max(path_stiffness)) if swept else None,
        work=work,
        stored=final,
        saved=tank,
        at_start=initial,
        lost=work + initial - final - tank,
        held=work - _held_work(trace) if every_tick else None,
        final_deflection=float(np.mean(depth[last])),
        final_force=float(np.mean(magnitude[last])),
        final_swing=float(np.max(np.ptp(trace["object_force"][first:][last], axis=0))),
        touching_at_end=bool(contact[last].all()),
        unsolved=int(np.count_nonzero(solved[:, 0] == 0.0)),
        contact_lost=int(np.count_nonzero(trace["contact_lost"][first:] > 0.0)) if "contact_lost" in trace else 0,
        over_untouched=overlaps_untouched(trace, np.append(some_samples(trace, first), first + at)),
        final_tip_forces=tuple(
            float(np.mean(np.linalg.norm(trace[name][first:][last], axis=1))) for name in _tip_forces(trace)
        ),
        tip_depth=None if below is None else float(below[at]),
        final_tip_depth=None if below is None else float(np.mean(below[last])),
        softening=None if below is None else _softening(trace, float(below[at])),
    )


def _tip_forces(trace: Trace) -> list[str]:
    """Return the names of the channels of the forces of a tool's tips."""
    names = (f"point{number}_force" for number in range(1, MAX_TIPS + 1))
    return [name for name in names if name in trace]


def _softening(trace: Trace, depth: float) -> float | None:
    """Return by how much the force at a depth, m, may be too small, relative; None if it is not known."""
    choice = trace.scenario.get("object", {}).get("body") or {}
    if "signed_distance" not in (choice.get("kind"), choice.get("contact")):
        return None
    return softening(depth, parse_quantity(choice["radius"], "m"), choice.get("tip", "sphere"))


def work_so_far(trace: Trace) -> Array:
    """Return the work of the tip, or of all tips of a tool, on the body until each sample (n,), J.

    The force F is linear between samples: the work is the sum of (F_k + F_k-1) . (x_k - x_k-1) / 2. A model with states
    (`modal`, `viscoelastic`, `mass_spring`) holds the force F_k over the tick that ends at sample k. The work of a tick
    is then F_k . (x_k - x_k-1). For samples n ticks apart the later force then has the weight (1 + 1/n) / 2.
    """
    choice, run = trace.scenario.get("object", {}).get("body") or {}, trace.scenario.get("run", {})
    later = 0.5 + (0.5 / int(run.get("record_every", 1)) if choice.get("kind") in HOLDING else 0.0)
    each = sum(
        ((later * force[1:] + (1.0 - later) * force[:-1]) * np.diff(path, axis=0)).sum(axis=1)
        for force, path in _forces_on_paths(trace)
    )
    return np.concatenate([[0.0], np.cumsum(each)])


def _held_work(trace: Trace) -> float:
    """Return the work on the body if each force were held until the next sample, J."""
    return float(sum(np.sum(force[:-1] * np.diff(path, axis=0)) for force, path in _forces_on_paths(trace)))


def _forces_on_paths(trace: Trace) -> list[tuple[Array, Array]]:
    """Return forces on the body (n, 3), N, and the paths of their points (n, 3), m, in the frame of the body.

    They are those of the tip, or of each tip of a tool that moves about it: such a tool supplies work of its own.
    """
    tip, whole = touching_tip(trace), turned_to_object(trace, trace["object_force"])
    choice = trace.scenario.get("object", {}).get("body") or {}
    if choice.get("tool") is None:
        return [(whole, tip)]
    points = np.array([parse_quantity(point, "m", size=3) for point in choice["contact_points"]])
    scenario = recorded_scenario(trace)  # None if the file of the body is gone
    times = trace.time if scenario is None else tick_times(scenario.period, trace.time)
    places = ToolMotion.model_validate(choice["tool"]).places(points, times)
    return [(trace[name], tip + places[:, k]) for k, name in enumerate(_tip_forces(trace))]


def stiffness_along_path(trace: Trace) -> tuple[Array, Array]:
    """Return the tip path across its mean force (n,), m, and force over deflection along it (n,), N/m.

    The samples are at least 0.1 mm apart and have at least half of the median force.
    """
    contact = trace["touching"][:, 0] > 0.0
    force, tip = turned_to_object(trace, trace["object_force"]), touching_tip(trace)
    magnitude = np.linalg.norm(force, axis=1)
    pressed = contact & (magnitude > 0.5 * np.median(magnitude[contact])) if contact.any() else contact
    if not pressed.any():
        return np.empty(0), np.empty(0)
    mean = force[pressed].mean(axis=0)
    down = mean / np.linalg.norm(mean)
    move = np.diff(tip, axis=0, prepend=tip[:1])
    across = np.cumsum(np.where(pressed, np.linalg.norm(move - np.outer(move @ down, down), axis=1), 0.0))
    _, first = np.unique(np.floor(across / 1e-4), return_index=True)
    kept = first[pressed[first]]
    deflection = np.linalg.norm(trace["deflection"][kept], axis=1)
    return across[kept], magnitude[kept] / deflection
