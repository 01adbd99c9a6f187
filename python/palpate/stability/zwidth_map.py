"""The Z-width of a scenario: every stiffness and damping that its loop bears, exact and as the simulation finds it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from palpate.errors import StabilityError
from palpate.files import check_suffix, write_json
from palpate.linear.linear_device import HumanArm, SampledDevice
from palpate.linear.wall import WallLoop, wall_loop
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenario
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.stability.boundaries import Boundary, stability_boundary, trace
from palpate.stability.passivity import passive_stiffness
from palpate.stability.simulated import SimulatedBoundary, simulated_boundary

__all__ = ["Corner", "ZWidth", "wall_loops", "zwidth"]

Array = NDArray[np.float64]
Progress = Callable[[str, float], None]
HAND = HumanArm(0.15, 4.5, 560.0)
TISSUE = (500.0, 0.5)  # N/m, N s/m
MARGIN = 1.08  # of the map beyond the exact curve
VANISHES = 0.02  # share of the map below which nothing is seen
CLOSE = 100_000  # points of a curve of which a corner shows a few hundred


@dataclass(frozen=True)
class Corner:
    """The map about no damping and no stiffness, where its whole would hide the object or the passive walls.

    Attributes:
        window: largest B, N s/m, and K, N/m, of the corner.
        edge: the exact boundary of the scenario's own loop there.
        simulated: the same, found by running the loop; None where it was not.
    """

    window: tuple[float, float]
    edge: Boundary
    simulated: SimulatedBoundary | None


@dataclass(frozen=True)
class ZWidth:
    """The stable walls of a scenario.

    Attributes:
        title: the scenario's.
        curves: exact boundaries by who holds the device; the first is the scenario's own operator.
        passive: (B, K) of the edge of the passive walls, each (k,); None where nothing is known of them.
        not_passive: why `passive` is None; empty otherwise.
        simulated: the scenario's own boundary, found by running it; None where it was not.
        here: (B, K) of the scenario's object.
        corner: the map about its origin, where something would vanish at the scale of the whole.
        never: operators with whom no wall of any size is stable, as where the arm tips over along the surface.
        min_stable_stiffness: K from which on the scenario's loop is stable, N/m, for any damping; above 0 if the device
            falls over without an object.
    """

    title: str
    curves: Mapping[str, Boundary]
    passive: tuple[Array, Array] | None
    not_passive: str
    simulated: SimulatedBoundary | None
    here: tuple[float, float]
    corner: Corner | None = None
    never: tuple[str, ...] = ()
    min_stable_stiffness: float = 0.0

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
            "simulated": _numbers(self.simulated),
            "corner": None
            if self.corner is None
            else {
                "damping_N_s_per_m": self.corner.edge.damping.tolist(),
                "stiffness_N_per_m": self.corner.edge.stiffness.tolist(),
                "simulated": _numbers(self.corner.simulated),
            },
            "never_stable": list(self.never),
            "min_stable_stiffness_N_per_m": self.min_stable_stiffness,
            "object": {"damping_N_s_per_m": self.here[0], "stiffness_N_per_m": self.here[1]},
        }

    def save(self, path: str | Path) -> Path:
        """Write the numbers as `.json`, whole or not at all; return the path.

        Raises:
            OutputError: the suffix is another one, or the file cannot be written.
        """
        return write_json(check_suffix(path, (".json",), "a Z-width"), self.to_dict())


def _numbers(found: SimulatedBoundary | None) -> dict[str, Any] | None:
    if found is None:
        return None
    return {
        "damping_N_s_per_m": found.damping.tolist(),
        "stiffness_N_per_m": found.stiffness.tolist(),
        "distance_from_exact": found.distance.tolist(),
        "runs": found.runs,
        "duration_s": found.duration,
    }


def zwidth(
    scenario: Scenario | Mapping[str, Any] | str | Path,
    *,
    controller: Any = None,
    simulated: bool = True,
    progress: Progress | None = None,
) -> ZWidth:
    """Return the Z-width of a scenario's loop: the exact boundary, the passive walls, and the boundary found by runs.

    The object of the scenario is replaced by spring and damper of every size, the same in all directions in which it is
    felt, damped by backward difference. An impedance display is also judged in other hands.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        controller: in place of the scenario's: a Controller or a python-control system, as for `palpate.simulate`. A
            Python function has no linear model and is refused.
        simulated: whether to find the boundary by simulation as well.
        progress: called with a text and the share done.

    Raises:
        StabilityError: no object of any stiffness is stable, or the loop has none.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    tell = progress or (lambda _text, _share: None)
    s = read_scenario(scenario, controller)
    own = scenario_loop(s)
    if s.object.coupling != "backward":
        raise StabilityError('object.coupling: a Z-width is of walls damped by backward difference; write "backward"')
    tell("exact boundary", 0.05)
    edge = _edge(own)
    min_stable_stiffness = _softest(own, edge)
    curves = {_holder(s): edge}
    never = []
    for name, arm in _other_hands(s):
        try:
            curves[name] = _edge(scenario_loop(s, arm=arm, operator_force=(0.0, 0.0, 0.0)))
        except StabilityError:
            never.append(name)
    tell("passive walls", 0.15)
    here = (float(own.damping.max()), float(own.stiffness.max()))
    passive, reason = _passive(s, own, edge)
    found, corner = None, None
    if simulated:
        whole = (MARGIN * float(edge.damping.max()), MARGIN * float(edge.stiffness.max()))
        found = simulated_boundary(
            s, own, edge, whole, min_stable_stiffness, lambda share: tell("simulating", 0.2 + 0.4 * share)
        )
    window = _corner_window(edge, passive, here)
    if window is not None:
        near = _edge(own, CLOSE).up_to(1.1 * window[0])
        again = None
        if simulated:
            again = simulated_boundary(
                s, own, near, window, min_stable_stiffness, lambda share: tell("simulating", 0.6 + 0.3 * share)
            )
        corner = Corner(window, near, again)
    return ZWidth(s.title, curves, passive, reason, found, here, corner, tuple(never), min_stable_stiffness)


def _softest(loop: ScenarioLoop, edge: Boundary) -> float:
    """Return the stiffness from which on a loop is stable, N/m: the object has to make up for what is negative.

    There a root is at +1, where damping has no say.
    """
    b, k = edge.inside

    def grows(exponent: float) -> float:
        return loop.spectral_radius(math.exp(exponent), b) - 1.0

    min_stable_stiffness, inside = math.log(1e-6 * k), math.log(k)
    if grows(min_stable_stiffness) < 1e-9:
        return 0.0
    return float(math.exp(brentq(grows, min_stable_stiffness, inside, xtol=1e-9)))


def _corner_window(
    edge: Boundary, passive: tuple[Array, Array] | None, here: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the largest (B, K) of the corner that needs a picture of its own; None if the whole shows everything."""
    wide, high = float(edge.damping.max()), float(edge.stiffness.max())
    b, k = here if here[0] < VANISHES * wide and here[1] < VANISHES * high else (0.0, 0.0)
    if passive is not None and (passive[0].max() < VANISHES * wide or passive[1].max() < VANISHES * high):
        b, k = max(b, float(passive[0].max())), max(k, float(passive[1].max()))
    if k <= 0:
        return None
    window = 2.5 * (b or wide * k / high), 2.5 * k
    return window if window[0] < wide / 4 and window[1] < high / 4 else None


def _holder(s: Scenario) -> str:
    o = s.operator
    if o.kind != "arm":
        return "nobody holds it" if s.servo.topology == "impedance_display" else "the loop"
    return "the scenario's arm" + (", through tissue" if o.tissue_stiffness is not None else ", rigid grip")


def _other_hands(s: Scenario) -> list[tuple[str, HumanArm | None]]:
    """Return other operators to draw, where the device can be held at all."""
    if s.servo.topology != "impedance_display" or s.device.model != "nonlinear":
        return []
    tissue = HumanArm(HAND.mass, HAND.damping, HAND.stiffness, *TISSUE)
    if s.operator.kind != "arm":
        return [("a rigid grip", HAND), ("through fingertip tissue", tissue)]
    o = s.operator
    other = HumanArm(
        o.mass or 0.0,
        o.damping or 0.0,
        o.stiffness or 0.0,
        None if o.tissue_stiffness is not None else TISSUE[0],
        0.0 if o.tissue_stiffness is not None else TISSUE[1],
    )
    name = "the same arm, rigid grip" if o.tissue_stiffness is not None else "the same arm, through tissue"
    return [(name, other), ("nobody holds it", HumanArm(0.0, 0.0, 0.0))]


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
    return wall_loop(SampledDevice(np.asarray(a - np.eye(n)), -np.asarray(b), np.zeros(n), np.asarray(c), 0, period))


class _Coupled(WallLoop):
    """A wall of one (K, B) in several coupled directions: W is an eigenvalue of the inverse response."""

    loop: ScenarioLoop
    index: int

    @classmethod
    def of(cls, loop: ScenarioLoop, index: int) -> _Coupled:
        """Return the loop as seen by the eigenvalue that is ``index``-th in modulus."""
        path, r = loop.path, loop.directions.shape[1]
        n = path.nstates
        tip = SampledDevice(path.A - np.eye(n), path.B[:, 0], np.zeros(n), path.C[0], 0, loop.period)
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

    def required_wall_response(self, angle: Array) -> NDArray[np.complex128]:
        path = self.loop.path
        theta = np.asarray(angle, dtype=float)
        ahead = -2 * np.sin(theta / 2) ** 2 + 1j * np.sin(theta)
        matrix = ahead[:, None, None] * np.eye(path.nstates) - (path.A - np.eye(path.nstates))
        right = np.broadcast_to(path.B.astype(complex), (len(theta), *path.B.shape))
        values = np.linalg.eigvals(path.C @ np.linalg.solve(matrix, right))
        ordered = np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)
        return np.asarray(1 / ordered[:, self.index], dtype=complex)


def _edge(loop: ScenarioLoop, points: int = 1000) -> Boundary:
    """Return the exact boundary of a scenario's loop, every direction with the same K and B."""
    r = loop.directions.shape[1]
    if r == 1:
        return stability_boundary(wall_loops(loop)[0], points=points)
    parts: list[Boundary] = []
    scale: tuple[float, float] | None = None
    for count in (100, points):  # first to see how large the region is: one direction alone may cut it very steeply
        parts = []
        for index in range(r):
            with suppress(StabilityError):
                parts.append(trace(_Coupled.of(loop, index), count, 0.0, scale, alone=False))
        if parts:
            scale = max(float(p.damping.max()) for p in parts), max(float(p.stiffness.max()) for p in parts)
    if not parts:
        raise StabilityError("no object of any stiffness is stable in this loop")
    damping, stiffness, angle = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("damping", "stiffness", "angle")
    )
    return Boundary(damping, stiffness, angle, parts[0].inside)


def _passive(s: Scenario, loop: ScenarioLoop, edge: Boundary) -> tuple[tuple[Array, Array] | None, str]:
    """Return (B, K) of the edge of the passive walls, or None and the reason."""
    if s.servo.topology != "impedance_display":
        return None, "the loop tracks a reference force: no hand holds it, so passivity says nothing of it"
    if s.controller.kind not in ("none", "gain"):
        return None, "a controller with a memory is in the loop: no closed form tells where it is passive"
    if math.isnan(loop.device_damping):
        return None, "the model does not say how much damping the device has of its own"
    if loop.device_damping <= 0:
        return None, "the device has no damping of its own, so no wall is passive"
    if not loop.rests:
        return None, "in nobody's hand the device tips over under gravity, so no wall is passive"
    share = max(s.controller.gain or (1.0,))
    b = np.linspace(0, min(float(edge.damping.max()), 1.02 * loop.device_damping / share), 25)
    k = passive_stiffness(damping=loop.device_damping, period=s.period, virtual_damping=b * share, delay=s.device.delay)
    return (b, k / share), ""
