"""What a press into a body shows: how deep and how hard, the stiffness felt, and where the energy went."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.metrics.mesh_contact import LAST
from palpate.simulation.trace import Trace

__all__ = ["FEW", "JND", "PalpationMetrics", "palpation_metrics", "stiffness_along_path", "work_so_far"]

Array = NDArray[np.float64]
JND = 0.23  # of stiffness: what a hand just notices (Jones & Hunter 1990)
SWEEP = 10e-3  # m: a shorter way is a press, not a sweep
FEW = 4  # nodes under the tip: fewer carry no force to believe
HOLDING = ("modal", "viscoelastic", "mass_spring")  # kinds that hold each force over the tick that ends with its sample


@dataclass(frozen=True)
class PalpationMetrics:
    """A tip's way in and over a body, from its first touch to the end of the run. m, N, J.

    Attributes:
        touches: how often contact began.
        deepest: largest deflection of the pressed patch.
        deepest_force: size of the object force at that moment; the largest may be of another.
        stiffness: force over deflection there, N/m.
        nodes: pressed there.
        path: length of the tip's way in contact.
        path_stiffness_median, path_stiffness_max: force over deflection along the path, N/m (`stiffness_along_path`);
            None for a path under 10 mm.
        work: of the tip on the body (`work_so_far`).
        stored: in the body at the end: its elastic energy, internal springs of a standard linear solid with it, and
            its kinetic energy.
        saved: put in besides, and kept at the end for snapshots to come (large displacements).
        at_start: stored and saved at the first sample: above zero if the run begins in contact.
        lost: work and what was there at the start, less what is stored and saved: what the body took for good (damping,
            creep, friction; what was saved when the tip left), or, below zero, gave. Without any of these it is what
            adding up finite steps misses; of kinds that hold forces over a tick also what their steps df put into what
            has no inertia, df C df / 2 each.
        held: `work` less what it is when each force is held until the next sample, as motors hold it: what sampling
            adds to a loop that shows the body's force as it is. None if not every tick was recorded.
        final_deflection: mean over the last 0.1 s.
        final_force: size of the object force, mean over the last 0.1 s.
        final_swing: peak-to-peak swing of the object force over the last 0.1 s, largest of the axes.
        touching_at_end: whether contact held over the last 0.1 s.
        unsolved: samples at which more nodes lay under the tip than are looked at.
    """

    touches: int
    deepest: float
    deepest_force: float
    stiffness: float
    nodes: int
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

    @property
    def settled(self) -> bool:
        """Whether the tip rests in the body at the end: in contact, its force steady to 1 % (or 1 mN)."""
        return self.touching_at_end and self.final_swing <= max(1e-3, 0.01 * self.final_force)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds, each number's unit at the end of its name."""
        units = {"deepest": "m", "path": "m", "final_deflection": "m", "stiffness": "N_per_m"}
        units |= dict.fromkeys(("path_stiffness_median", "path_stiffness_max"), "N_per_m")
        units |= dict.fromkeys(("deepest_force", "final_force", "final_swing"), "N")
        units |= dict.fromkeys(("work", "stored", "saved", "at_start", "lost", "held"), "J")
        named = {f"{key}_{units[key]}" if key in units else key: value for key, value in asdict(self).items()}
        return {**named, "settled": self.settled}


def palpation_metrics(trace: Trace) -> PalpationMetrics | None:
    """Return what a trace on a body shows; None if there is no body, or it was touched in fewer than two samples."""
    if "pressed_nodes" not in trace or np.count_nonzero(trace["touching"]) < 2:
        return None
    first = max(int(np.argmax(trace["touching"][:, 0] > 0.0)) - 1, 0)  # the sample before, where nothing is stored
    names = ("touching", "tip", "object_force", "deflection", "pressed_nodes", "solved")
    touching, tip, force, deflection, nodes, solved = (trace[name][first:] for name in names)
    stored, saved = trace["stored_energy"][first:], trace["saved_energy"][first:]
    time, on = trace.time[first:], touching[:, 0] > 0.0
    deep = np.linalg.norm(deflection, axis=1)
    size = np.linalg.norm(force, axis=1)
    at = int(np.argmax(deep))
    move = np.diff(tip, axis=0)
    work = float(work_so_far(trace)[-1])
    kept, spare, begun = float(stored[-1, 0]), float(saved[-1, 0]), float(stored[0, 0] + saved[0, 0])
    every_tick = int(trace.scenario.get("run", {}).get("record_every", 1)) == 1
    last = time >= time[-1] - LAST
    way, felt = stiffness_along_path(trace)
    swept = len(way) > 0 and way[-1] > SWEEP
    return PalpationMetrics(
        touches=int(on[0]) + int(np.count_nonzero(on[1:] & ~on[:-1])),
        deepest=float(deep[at]),
        deepest_force=float(size[at]),
        stiffness=float(size[at] / deep[at]) if deep[at] > 0.0 else 0.0,
        nodes=int(nodes[at, 0]),
        path=float(np.sum(np.linalg.norm(move, axis=1)[on[1:] & on[:-1]])),
        path_stiffness_median=float(np.median(felt)) if swept else None,
        path_stiffness_max=float(np.max(felt)) if swept else None,
        work=work,
        stored=kept,
        saved=spare,
        at_start=begun,
        lost=work + begun - kept - spare,
        held=work - float(np.sum(force[:-1] * move)) if every_tick else None,
        final_deflection=float(np.mean(deep[last])),
        final_force=float(np.mean(size[last])),
        final_swing=float(np.max(np.ptp(force[last], axis=0))),
        touching_at_end=bool(on[last].all()),
        unsolved=int(np.count_nonzero(solved[:, 0] == 0.0)),
    )


def work_so_far(trace: Trace) -> Array:
    """Return the work of the tip on the body until each sample (n,), J.

    The force F is taken as linear between samples: the sum of (F_k + F_k-1) . (x_k - x_k-1) / 2. A body with a state
    (`modal`, `viscoelastic`, `mass_spring`) goes through a tick with the force held that its end asks for, so that the
    tick's work is F_k . (x_k - x_k-1), and F at a sample is that of half a tick before: of samples n ticks apart the
    later one counts (1 + 1/n) / 2.
    """
    force, tip = trace["object_force"], trace["tip"]
    choice, run = trace.scenario.get("object", {}).get("body") or {}, trace.scenario.get("run", {})
    later = 0.5 + (0.5 / int(run.get("record_every", 1)) if choice.get("kind") in HOLDING else 0.0)
    each = ((later * force[1:] + (1.0 - later) * force[:-1]) * np.diff(tip, axis=0)).sum(axis=1)
    return np.concatenate([[0.0], np.cumsum(each)])


def stiffness_along_path(trace: Trace) -> tuple[Array, Array]:
    """Return the tip's way across its mean force (n,), m, and force over deflection there (n,), N/m.

    Samples in which the tip moves across the force, pressing with at least half of the median force, one for each
    tenth of a millimetre or more.
    """
    on = trace["touching"][:, 0] > 0.0
    force, tip = trace["object_force"], trace["tip"]
    size = np.linalg.norm(force, axis=1)
    pressed = on & (size > 0.5 * np.median(size[on])) if on.any() else on
    if not pressed.any():
        return np.empty(0), np.empty(0)
    mean = force[pressed].mean(axis=0)
    down = mean / np.linalg.norm(mean)
    move = np.diff(tip, axis=0, prepend=tip[:1])
    across = np.cumsum(np.where(pressed, np.linalg.norm(move - np.outer(move @ down, down), axis=1), 0.0))
    _, first = np.unique(np.floor(across / 1e-4), return_index=True)
    kept = first[pressed[first]]
    deflection = np.linalg.norm(trace["deflection"][kept], axis=1)
    return across[kept], size[kept] / deflection
