"""The Z-width of a scenario: every stiffness and damping that its loop bears, exact and as the simulation finds it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from palpate.scenario import Scenario
from palpate.stability.boundary import Boundary, boundary, trace
from palpate.stability.checks import StabilityError
from palpate.stability.counter_example import growth
from palpate.stability.loop import WallLoop, wall_loop
from palpate.stability.passivity import passive_stiffness
from palpate.stability.scenario_loop import ScenarioLoop, scenario_loop
from palpate.stability.tip import Arm, HeldTip

if TYPE_CHECKING:
    from palpate.report.html import Page

__all__ = ["SimulatedPoint", "ZWidth", "simulated_boundary", "wall_loops", "zwidth"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
HAND = Arm(0.15, 4.5, 560.0)
TISSUE = (500.0, 0.5)  # N/m, N s/m


@dataclass(frozen=True)
class SimulatedPoint:
    """Where the simulated loop begins to grow.

    Attributes:
        damping: B, N s/m.
        stiffness: K, N/m, by bisection.
        exact: K of the exact boundary, N/m.
    """

    damping: float
    stiffness: float
    exact: float

    @property
    def error(self) -> float:
        """Simulated over exact, less one."""
        return self.stiffness / self.exact - 1


@dataclass(frozen=True)
class ZWidth:
    """The stable walls of a scenario.

    Attributes:
        title: the scenario's.
        curves: exact boundaries by who holds the device; the first is the scenario's own operator.
        passive: (B, K) of the edge of the passive walls, each (k,); None where passivity is not asked.
        simulated: points of the scenario's own boundary, found by running it.
        here: (B, K) of the scenario's object.
        never: operators with whom no wall of any size is stable, as where the arm tips over along the surface.
    """

    title: str
    curves: Mapping[str, Boundary]
    passive: tuple[Array, Array] | None
    simulated: tuple[SimulatedPoint, ...]
    here: tuple[float, float]
    never: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers as JSON can hold them, in N/m and N s/m."""
        return {
            "title": self.title,
            "curves": {
                name: {"damping_N_s_per_m": c.damping.tolist(), "stiffness_N_per_m": c.stiffness.tolist()}
                for name, c in self.curves.items()
            },
            "passive": None
            if self.passive is None
            else {"damping_N_s_per_m": self.passive[0].tolist(), "stiffness_N_per_m": self.passive[1].tolist()},
            "simulated": [
                {"damping_N_s_per_m": p.damping, "stiffness_N_per_m": p.stiffness, "exact_N_per_m": p.exact}
                for p in self.simulated
            ],
            "never_stable": list(self.never),
            "object": {"damping_N_s_per_m": self.here[0], "stiffness_N_per_m": self.here[1]},
        }

    def write_json(self, path: str | Path) -> None:
        """Write the numbers."""
        Path(path).write_text(json.dumps(self.to_dict(), indent=1) + "\n", "utf-8")

    def page(self) -> Page:
        """Return the picture and its tables as one page."""
        from palpate.stability.zwidth_page import zwidth_page

        return zwidth_page(self)


def zwidth(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    simulated: int = 7,
    progress: Progress | None = None,
) -> ZWidth:
    """Return the Z-width of a scenario's loop: the exact boundary, the passive walls, and points found by running it.

    The object of the scenario is replaced by spring and damper of every size, the same in all directions in which it is
    felt, damped by backward difference. An impedance display is also judged in other hands.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        simulated: points of the boundary to find by simulation.
        progress: called with a text and the share done.

    Raises:
        StabilityError: no object of any stiffness is stable, or the loop has none.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    tell = progress or (lambda _text, _share: None)
    if isinstance(scenario, Scenario):
        s = scenario
    else:
        s = Scenario.from_dict(scenario) if isinstance(scenario, Mapping) else Scenario.from_file(scenario)
    own = scenario_loop(s)
    if s.object.coupling != "backward":
        raise StabilityError('object.coupling: a Z-width is of walls damped by backward difference; write "backward"')
    tell("exact boundary", 0.05)
    curves = {_holder(s): _edge(own)}
    never = []
    for name, arm in _other_hands(s):
        try:
            curves[name] = _edge(scenario_loop(s, arm=arm, operator_force=(0.0, 0.0, 0.0)))
        except StabilityError:
            never.append(name)
    tell("passive walls", 0.15)
    passive = _passive(s, own, curves[_holder(s)])
    points = simulated_boundary(s, curves[_holder(s)], simulated, lambda share: tell("simulating", 0.2 + 0.7 * share))
    return ZWidth(
        s.title, curves, passive, points, (float(own.damping.max()), float(own.stiffness.max())), tuple(never)
    )


def _holder(s: Scenario) -> str:
    o = s.operator
    if o.kind != "arm":
        return "nobody holds it" if s.servo.topology == "impedance_display" else "the loop"
    return "the scenario's arm" + (", through tissue" if o.tissue_stiffness is not None else ", rigid grip")


def _other_hands(s: Scenario) -> list[tuple[str, Arm | None]]:
    """Return other operators to draw, where the device can be held at all."""
    if s.servo.topology != "impedance_display" or s.device.model != "nonlinear":
        return []
    tissue = Arm(HAND.mass, HAND.damping, HAND.stiffness, *TISSUE)
    if s.operator.kind != "arm":
        return [("a rigid grip", HAND), ("through fingertip tissue", tissue)]
    o = s.operator
    other = Arm(
        o.mass or 0.0,
        o.damping or 0.0,
        o.stiffness or 0.0,
        None if o.tissue_stiffness is not None else TISSUE[0],
        0.0 if o.tissue_stiffness is not None else TISSUE[1],
    )
    name = "the same arm, rigid grip" if o.tissue_stiffness is not None else "the same arm, through tissue"
    return [(name, other), ("nobody holds it", Arm(0.0, 0.0, 0.0))]


def wall_loops(loop: ScenarioLoop) -> list[WallLoop]:
    """Return a scenario's loop as loops against a wall (K, B), one per direction that the others leave alone.

    Raises:
        StabilityError: the directions are coupled through device or controller.
    """
    path = loop.path
    r = loop.directions.shape[1]
    if r == 1:
        return [_single(path.A, path.B[:, 0], path.C[0], loop.period)]
    raise StabilityError("the directions are coupled: one (K, B) for all of them has no single curve")


def _single(a: Array, b: Array, c: Array, period: float) -> WallLoop:
    n = len(a)
    return wall_loop(HeldTip(np.asarray(a - np.eye(n)), -np.asarray(b), np.zeros(n), np.asarray(c), 0, period))


class _Coupled(WallLoop):
    """A wall of one (K, B) in several coupled directions: W is an eigenvalue of the inverse response."""

    loop: ScenarioLoop
    index: int

    @classmethod
    def of(cls, loop: ScenarioLoop, index: int) -> _Coupled:
        """Return the loop as seen by the eigenvalue that is ``index``-th in modulus."""
        path, r = loop.path, loop.directions.shape[1]
        n = path.nstates
        tip = HeldTip(path.A - np.eye(n), path.B[:, 0], np.zeros(n), path.C[0], 0, loop.period)
        base = np.block([[path.A, np.zeros((n, r))], [path.C, np.zeros((r, r))]])
        empty = np.zeros(n + r)
        made = cls(np.asarray(base, float), empty, empty, empty, tip, 0.0, None)
        object.__setattr__(made, "loop", loop)
        object.__setattr__(made, "index", index)
        return made

    def matrix(self, stiffness: Any, damping: Any = 0.0) -> Array:
        k, b = np.broadcast_arrays(np.asarray(stiffness, float), np.asarray(damping, float))
        path, r = self.loop.path, self.loop.directions.shape[1]
        entry = np.vstack([path.B, np.zeros((r, r))])
        spring = np.hstack([path.C, np.zeros((r, r))])
        rate = np.hstack([path.C, -np.eye(r)]) / self.period
        return np.asarray(
            self.base + k[..., None, None] * (entry @ spring) + b[..., None, None] * (entry @ rate), dtype=float
        )

    def needed(self, angle: Array) -> NDArray[np.complex128]:
        path = self.loop.path
        theta = np.asarray(angle, dtype=float)
        ahead = -2 * np.sin(theta / 2) ** 2 + 1j * np.sin(theta)
        matrix = ahead[:, None, None] * np.eye(path.nstates) - (path.A - np.eye(path.nstates))
        right = np.broadcast_to(path.B.astype(complex), (len(theta), *path.B.shape))
        values = np.linalg.eigvals(path.C @ np.linalg.solve(matrix, right))
        ordered = np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)
        return np.asarray(1 / ordered[:, self.index], dtype=complex)


def _edge(loop: ScenarioLoop) -> Boundary:
    """Return the exact boundary of a scenario's loop, every direction with the same K and B."""
    r = loop.directions.shape[1]
    if r == 1:
        return boundary(wall_loops(loop)[0], points=1000)
    parts: list[Boundary] = []
    scale: tuple[float, float] | None = None
    for points in (100, 700):  # first to see how large the region is: one direction alone may cut it very steeply
        parts = []
        for index in range(r):
            with suppress(StabilityError):
                parts.append(trace(_Coupled.of(loop, index), points, 0.0, scale, alone=False))
        if parts:
            scale = max(float(p.damping.max()) for p in parts), max(float(p.stiffness.max()) for p in parts)
    if not parts:
        raise StabilityError("no object of any stiffness is stable in this loop")
    damping, stiffness, angle = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("damping", "stiffness", "angle")
    )
    return Boundary(damping, stiffness, angle, parts[0].inside)


def _passive(s: Scenario, loop: ScenarioLoop, edge: Boundary) -> tuple[Array, Array] | None:
    if s.servo.topology != "impedance_display" or s.controller.kind not in ("none", "gain"):
        return None
    if math.isnan(loop.damping_felt) or loop.damping_felt <= 0 or not loop.rests:
        return None
    share = max(s.controller.gain or (1.0,))
    b = np.linspace(0, min(float(edge.damping.max()), 1.02 * loop.damping_felt / share), 25)
    k = passive_stiffness(damping=loop.damping_felt, period=s.period, virtual_damping=b * share, delay=s.device.delay)
    return b, k / share


def simulated_boundary(
    s: Scenario, edge: Boundary, count: int, progress: Callable[[float], None] | None = None
) -> tuple[SimulatedPoint, ...]:
    """Return ``count`` points of the boundary as the full simulation finds them: by bisection on growth.

    The object is held from both sides at the start tip; the device is as the scenario has it but without dry friction,
    counts and limits, which bound every swing; the push is a millinewton, so that the motion is small at first.
    """
    if count < 1:
        return ()
    loop = scenario_loop(s)
    experiment = _free_run(s)
    if s.object.kind == "wall" and np.max(np.abs(loop.directions)) < 1 - 1e-9:
        return ()  # an oblique surface has no spring along its normal alone
    rising = np.flatnonzero(edge.stiffness > 0.05 * edge.stiffness.max())
    rising = rising[np.linspace(0, len(rising) - 1, min(len(rising), 12 * count)).astype(int)]
    walls = _Coupled.of(loop, 0).matrix(edge.stiffness[rising], edge.damping[rising])
    # where a second swing hardly decays, no run of sane length tells the two apart
    clear = np.array([_other(one) < 1 - 5e-4 for one in walls], dtype=bool)
    chosen = rising[clear]
    if len(chosen) > count:
        chosen = chosen[np.linspace(0, len(chosen) - 1, count + 2).astype(int)[1:-1]]
    points = []
    for number, index in enumerate(chosen):
        b, k = float(edge.damping[index]), float(edge.stiffness[index])
        found = _bisect(experiment, loop, b, k, float(edge.angle[index]))
        if found is not None:
            points.append(SimulatedPoint(b, found, k))
        if progress:
            progress((number + 1) / count)
    return tuple(points)


def _free_run(s: Scenario) -> Any:
    """Return a scenario made ready to run against a spring, without dry friction, counts and limits."""
    from dataclasses import replace

    from palpate.loop.simulate import prepare

    tables = s.to_dict()
    tables["device"] = {**tables["device"], "encoder": False, "saturation": False}
    tables["run"] = {"duration": f"{2 * s.period:.9g} s", "substeps": max(4, s.run.substeps)}
    experiment = prepare(tables)
    device = experiment.device.with_friction(coulomb=0.0)
    experiment.setup.friction = device.core_friction
    return replace(experiment, device=device)


def _bisect(experiment: Any, loop: ScenarioLoop, damping: float, exact: float, angle: float) -> float | None:
    """Return the stiffness at which the simulated swing neither grows nor dies, near ``exact`` N/m; None if unclear."""
    r = loop.directions.shape[1]
    settle = 12 / max(1 - _other(_Coupled.of(loop, 0).matrix(exact, damping)), 1e-9)
    cycles = 40 * 2 * math.pi / max(angle, 1e-9)
    ticks = int(min(max(5 * settle, 5 * cycles, 500), 60_000))
    force = np.zeros((ticks + 1, 3))
    force[:5] = 1e-3 * loop.directions.sum(axis=1) / math.sqrt(r)
    setup = experiment.setup
    setup.anchor = _spring(experiment.device.forward(experiment.start))
    tracking = not np.any(experiment.operator) and experiment.scenario.servo.topology == "force_tracking"
    silent = np.zeros_like(force)
    felt = np.abs(loop.directions).max(axis=1)
    sharp = 3 if angle > 0.05 else 1  # differences that hide what is slower; a slow swing would sink into rounding

    def grows(stiffness: float) -> bool:
        setup.stiffness, setup.damping = stiffness * felt, damping * felt
        rows, count, unstable = setup.run(*((force, silent) if tracking else (silent, force)))
        if unstable >= 0:
            return True
        dof = experiment.device.dof
        tip = experiment.device.forward(np.asarray(rows)[:count, :dof]) @ loop.directions
        return bool(np.ptp(tip, axis=0).max() > 5e-4) or growth(tip, sharp) > 1  # half a millimetre from a millinewton

    low, high = 0.9 * exact, 1.12 * exact
    if grows(low) or not grows(high):
        return None
    for _ in range(14):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows(middle) else (middle, high)
    return 0.5 * (low + high)


def _other(matrix: Array) -> float:
    """Return the largest modulus of the eigenvalues off the unit circle that swing a third as fast as the one on it."""
    values = np.linalg.eigvals(matrix)
    moduli = np.abs(values)
    on = np.abs(moduli - 1) < 1e-6
    fast = np.abs(values - 1) > np.abs(values[on] - 1).max(initial=0.0) / 3
    return float(moduli[~on & fast].max(initial=0.0))


def _spring(point: Array) -> Any:
    from palpate import _core

    anchor = _core.Anchor()
    anchor.kind = _core.Anchor.Kind.point
    anchor.point = point
    return anchor
