"""Z-width of a scenario: the stable and passive walls in stiffness and damping, exact and by simulation."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from palpate.arrays import Array
from palpate.errors import StabilityError
from palpate.files import check_suffix, write_json
from palpate.linear.linear_device import HumanArm, SampledDevice
from palpate.linear.wall import WallLoop, wall_loop
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.stability.encoder_counts import friction_for_counts
from palpate.stability.maps.boundary_curve import Boundary, stability_boundary, trace_boundary
from palpate.stability.maps.simulated import SimulatedBoundary, simulated_boundary
from palpate.stability.maps.wall_interval import wall_spectral_radius
from palpate.stability.passivity import field_damping, passive_stiffness

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "Corner",
    "ZWidth",
    "loop_radii",
    "operator_name",
    "other_operators",
    "spring_zwidth",
    "wall_loops",
    "written",
]

Progress = Callable[[str, float], None]
HAND = HumanArm(0.15, 4.5, 560.0)
TISSUE = (500.0, 0.5)  # N/m, N s/m
MARGIN = 1.08  # size of the map relative to the exact curve
VANISHES = 0.02  # fraction of the map below which details are invisible
FINE = 100_000  # points of a curve of which the corner shows a few hundred
OBLIQUE = "the surface is oblique to the axes, and no spring acts along its normal alone"
BY_CHOICE = "it was not asked for"


TOLERANCE = 1e-7  # modulus over 1 beyond the rounding error of double roots, which is 1.5e-8


@dataclass(frozen=True)
class Corner:
    """Enlarged map about the origin, for an object or passive walls too small for the whole map.

    Attributes:
        window: largest B, N s/m, and K, N/m, of the corner.
        edge: exact boundary of the scenario's own loop there.
        simulated: the same by simulation; None if it was not simulated.
    """

    window: tuple[float, float]
    edge: Boundary
    simulated: SimulatedBoundary | None


@dataclass(frozen=True)
class ZWidth:
    """Stable walls of a scenario.

    Attributes:
        title: title of the scenario.
        curves: exact boundaries by operator; the first is the scenario's own operator.
        passive: (B, K) of the boundary of the passive walls, each (k,); None if it is unknown.
        not_passive: reason why `passive` is None; empty otherwise.
        simulated: the scenario's own boundary by simulation; None if it was not simulated.
        here: (B, K) of the scenario's object, N s/m and N/m.
        corner: enlarged map about the origin, if details would be invisible in the whole.
        never: operators with which no wall is stable, for example because the arm tips over along the surface.
        stable_here: whether the loop with the scenario's object is stable, by its own eigenvalues.
        min_stable_stiffness: least K with which the scenario's loop is stable, N/m, for any damping; above 0 if the
            device is unstable without an object.
        not_simulated: reason why `simulated` is None; empty otherwise.
        gaps: bands of unstable objects under the boundaries, by operator, at the damping of the scenario's object and
            at that of the stiffest object: (B, lower K, upper K), N s/m and N/m. An operator without one is absent.
        exact_here: largest stable K with the damping of the object, N/m, by the eigenvalues of the loop; None if none
            is stable; nan if it is not known.
        unstable_by: what `verdict` says if the loop is stable by the curves but not otherwise; empty if it is not.
    """

    title: str
    curves: Mapping[str, Boundary]
    passive: tuple[Array, Array] | None
    not_passive: str
    simulated: SimulatedBoundary | None
    here: tuple[float, float]
    stable_here: bool
    corner: Corner | None = None
    never: tuple[str, ...] = ()
    min_stable_stiffness: float = 0.0
    not_simulated: str = ""
    gaps: Mapping[str, tuple[tuple[float, float, float], ...]] = field(default_factory=dict)
    exact_here: float | None = math.nan
    unstable_by: str = ""

    @property
    def verdict(self) -> str:
        """Whether the loop with the scenario's own object is stable, as a sentence."""
        b, k = self.here
        state = "stable" if self.stable_here else self.unstable_by or "unstable"
        return f"The loop with the scenario's object, K = {k:g} N/m and B = {b:g} N·s/m, is {state}."

    @property
    def gap_remarks(self) -> list[str]:
        """Return a sentence for each band of unstable objects under a boundary."""
        return [
            f"{name}, with {b:.4g} N·s/m: unstable from {written(low)} to {written(high)}, "
            "below the stiffest stable object."
            for name, bands in self.gaps.items()
            for b, low, high in bands
        ]

    @property
    def stiffest_here(self) -> float | None:
        """Largest stable K with the damping of the scenario's object, N/m, to four digits; None if there is none."""
        known = self.exact_here is None or not math.isnan(self.exact_here)
        return self.exact_here if known else next(iter(self.curves.values())).stiffest_at(self.here[0])

    @property
    def facts(self) -> list[str]:
        """The stiffest stable object of each operator, the bands, the passive and the simulated boundary, in words."""
        lines = []
        for name, curve in self.curves.items():
            b, k = curve.stiffest
            lines.append(f"{name}: up to {written(k)}, with {b:.4g} N·s/m of damping")
        if self.stiffest_here is not None:
            lines.append(f"with the {self.here[0]:.4g} N·s/m of the scenario: up to {written(self.stiffest_here)}")
        lines += self.gap_remarks
        lines += [f"{name}: no object of any size is stable" for name in self.never]
        if self.passive is not None:
            lines.append(f"passive in every hand: up to {written(self.passive[1].max())}")
        else:
            lines.append(f"passive walls: none known; {self.not_passive}")
        if self.simulated is not None:
            off = f"at most {100 * self.simulated.furthest:.2g} % of the map off the exact curve"
            lines.append(f"simulated boundary ({self.simulated.runs:,} runs): {off}")
        else:
            lines.append(f"no simulated boundary: {self.not_simulated}")
        return lines

    def __str__(self) -> str:
        """Return title, verdict and facts, a line each."""
        return "\n  ".join([self.title, self.verdict, *self.facts])

    def plot(self, ax: Axes | None = None) -> Axes:
        """Draw the boundaries, stiffness over damping, with the scenario's object, and return the axes.

        Args:
            ax: axes of matplotlib to draw into; None: new ones of pyplot.
        """
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.subplots(figsize=(6.4, 4.0), layout="constrained")[1]
        for name, curve in self.curves.items():
            ax.plot(curve.damping, curve.stiffness / 1e3, label=name)
        if self.passive is not None:
            ax.plot(self.passive[0], self.passive[1] / 1e3, "--", label="passive")
        ax.plot(self.here[0], self.here[1] / 1e3, "o", color="black", label="object")
        ax.set_xlabel("damping [N*s/m]")
        ax.set_ylabel("stiffness [N/mm]")
        ax.legend()
        return ax

    def _repr_html_(self) -> str:
        """Return a table of the boundaries, for a notebook."""
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{c.stiffness[0] / 1e3:.4g}</td><td>{c.stiffness.max() / 1e3:.4g}</td>"
            f"<td>{c.damping[c.stiffness.argmax()]:.4g}</td></tr>"
            for name, c in self.curves.items()
        )
        return (
            f"<p><b>{escape(self.title)}</b>: stable walls; the object has {self.here[1] / 1e3:.4g} N/mm and "
            f"{self.here[0]:.4g} N*s/m</p><table><thead><tr><th>operator</th><th>undamped [N/mm]</th>"
            f"<th>largest [N/mm]</th><th>at damping [N*s/m]</th></tr></thead><tbody>{rows}</tbody></table>"
            + "".join(f"<p>{escape(remark)}</p>" for remark in self.gap_remarks)
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers for JSON, in N/m and N s/m."""
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
            "not_simulated": self.not_simulated,
            "corner": None
            if self.corner is None
            else {
                "damping_N_s_per_m": self.corner.edge.damping.tolist(),
                "stiffness_N_per_m": self.corner.edge.stiffness.tolist(),
                "simulated": _numbers(self.corner.simulated),
            },
            "never_stable": list(self.never),
            "unstable_below": {
                name: [{"damping_N_s_per_m": b, "stiffness_N_per_m": [low, high]} for b, low, high in bands]
                for name, bands in self.gaps.items()
            },
            "min_stable_stiffness_N_per_m": self.min_stable_stiffness,
            "object": {
                "damping_N_s_per_m": self.here[0],
                "stiffness_N_per_m": self.here[1],
                "stable": self.stable_here,
            },
        }

    def save(self, path: str | Path) -> Path:
        """Write the numbers atomically as `.json` and return the path.

        Raises:
            OutputError: the suffix is not `.json`, or the file cannot be written.
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


def written(stiffness: float) -> str:
    """Return a stiffness, N/m, with the unit of its size."""
    return f"{stiffness:.4g} N/m" if stiffness < 1e3 else f"{stiffness / 1e3:.4g} N/mm"


def spring_zwidth(s: Scenario, simulated: bool, report: Progress) -> ZWidth:
    """Return the Z-width of a scenario whose object is a spring or a wall; see ``palpate.stability.zwidth``.

    The object is replaced by springs and dampers of every size, equal in all directions of the object and damped by
    backward difference. The map of an impedance display includes other operators.

    Raises:
        StabilityError: no object of any stiffness is stable, or the scenario has no loop.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    own = scenario_loop(s)
    if s.object.coupling != "backward":
        raise StabilityError('object.coupling: a Z-width is of walls damped by backward difference; write "backward"')
    report("exact boundary", 0.05)
    edge = _edge(own)
    min_stable_stiffness = _min_stable_stiffness(own, edge)
    here = (float(own.damping.max()), float(own.stiffness.max()))
    curves = {operator_name(s): edge}
    loops = {operator_name(s): own}
    never = []
    for name, arm in other_operators(s):
        try:
            loop = scenario_loop(s, arm=arm, operator_force=(0.0, 0.0, 0.0))
            curves[name] = _edge(loop)
            loops[name] = loop
        except StabilityError:
            never.append(name)
    exact = _stiffest_at(own, edge, here)
    most = {name: curve.stiffest_at(here[0]) for name, curve in curves.items()}
    if exact is None or not math.isnan(exact):
        most[operator_name(s)] = exact
    bands = {name: _unstable_bands(loop, curves[name], here[0], most[name]) for name, loop in loops.items()}
    gaps = {name: found for name, found in bands.items() if found}
    report("passive walls", 0.15)
    passive, reason = _passive(s, own, edge)
    found, corner = None, None
    if simulated:
        whole = (MARGIN * float(edge.damping.max()), MARGIN * float(edge.stiffness.max()))
        found = simulated_boundary(
            s, own, edge, whole, min_stable_stiffness, lambda done: report("simulating", 0.2 + 0.4 * done)
        )
    window = _corner_window(edge, passive, here)
    if window is not None:
        near = _edge(own, FINE).up_to(1.1 * window[0])
        near_simulated = None
        if simulated:
            near_simulated = simulated_boundary(
                s, own, near, window, min_stable_stiffness, lambda done: report("simulating", 0.6 + 0.3 * done)
            )
        corner = Corner(window, near, near_simulated)
    stable = own.spectral_radius() < 1.0
    why = "" if found is not None else OBLIQUE if simulated else BY_CHOICE
    softest = min_stable_stiffness
    return ZWidth(
        s.title, curves, passive, reason, found, here, stable, corner, tuple(never), softest, why, gaps, exact
    )


def _stiffest_at(loop: ScenarioLoop, edge: Boundary, here: tuple[float, float]) -> float | None:
    """Return the largest stable K (N/m) with the damping of ``here`` (B, K), to 0.001 %.

    The curve gives the size of the map alone: between its points, and where it turns, it may be another branch.

    Returns:
        None if no K above 1e-7 of the map is stable, nan if the largest K that is tried is.
    """
    b, own = here
    scale = max(float(edge.stiffness.max()), own)
    near = [k * share for k in (own, edge.stiffest_at(b)) if k for share in (0.998, 1.0, 1.002)]
    k = np.unique(np.concatenate([np.geomspace(1e-7, 1e3, 1000) * scale, np.array(near)]))
    stable = np.flatnonzero(loop_radii(loop, k, np.full(len(k), b)) < 1.0)
    if not len(stable):
        return None
    last = int(stable[-1])
    return math.nan if last == len(k) - 1 else _crossing(loop, b, k[last], k[last + 1], 1e-5, 0.0)


def _unstable_bands(
    loop: ScenarioLoop, edge: Boundary, damping: float, most_here: float | None
) -> tuple[tuple[float, float, float], ...]:
    """Return the bands (B, lower K, upper K) in which objects softer than the stiffest stable one are unstable.

    They are searched at `damping`, up to `most_here`, and at the damping of the stiffest object, on 500 values of K. A
    controller with resonances may stabilize two ranges of stiffness and none in between.
    """
    bands = []
    for b, most in dict([(damping, most_here), edge.stiffest]).items():
        if most is None:
            continue
        k = np.unique(np.concatenate([np.geomspace(1e-7, 0.999, 300), np.linspace(5e-3, 0.995, 200)])) * most
        radius = loop_radii(loop, k, np.full(len(k), b))
        unstable = np.concatenate([[False], radius > 1 + TOLERANCE, [False]])
        ends = np.flatnonzero(np.diff(unstable.astype(int)))
        for first, last in zip(ends[::2], ends[1::2], strict=True):
            low = 0.0 if first == 0 else _crossing(loop, b, k[first - 1], k[first])
            high = most if last == len(k) else _crossing(loop, b, k[last - 1], k[last])
            bands.append((b, low, high))
    return tuple(bands)


def _crossing(
    loop: ScenarioLoop, damping: float, low: float, high: float, width: float = 1e-3, tolerance: float = TOLERANCE
) -> float:
    """Return the stiffness between `low` and `high` at which the loop changes its stability, to a relative `width`."""

    def unstable(k: float) -> bool:
        return bool(loop_radii(loop, np.array([k]), np.array([damping]))[0] >= 1 + tolerance)

    below = unstable(low)
    while high - low > width * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if unstable(middle) == below else (low, middle)
    return 0.5 * (low + high)


def _min_stable_stiffness(loop: ScenarioLoop, edge: Boundary) -> float:
    """Return the least stiffness with which a loop is stable, N/m; 0 if it is stable without an object.

    There a root is at +1, whatever the damping.
    """
    b, k = edge.inside

    def excess_radius(exponent: float) -> float:
        return loop.spectral_radius(math.exp(exponent), b) - 1.0

    low, inside = math.log(1e-6 * k), math.log(k)
    if excess_radius(low) < 1e-9:
        return 0.0
    return float(math.exp(brentq(excess_radius, low, inside, xtol=1e-9)))


def _corner_window(
    edge: Boundary, passive: tuple[Array, Array] | None, here: tuple[float, float]
) -> tuple[float, float] | None:
    """Return the largest (B, K) of the corner map; None if the whole map shows every detail."""
    wide, high = float(edge.damping.max()), float(edge.stiffness.max())
    b, k = here if here[0] < VANISHES * wide and here[1] < VANISHES * high else (0.0, 0.0)
    if passive is not None and (passive[0].max() < VANISHES * wide or passive[1].max() < VANISHES * high):
        b, k = max(b, float(passive[0].max())), max(k, float(passive[1].max()))
    if k <= 0:
        return None
    window = 2.5 * (b or wide * k / high), 2.5 * k
    return window if window[0] < wide / 4 and window[1] < high / 4 else None


def operator_name(s: Scenario) -> str:
    """Return the name of a scenario's operator on the map."""
    o = s.operator
    if o.kind != "arm":
        return "nobody holds it" if s.servo.topology == "impedance_display" else "the loop"
    return "the scenario's arm" + (", through tissue" if o.tissue_stiffness is not None else ", rigid grip")


def other_operators(s: Scenario) -> list[tuple[str, HumanArm | None]]:
    """Return other operators for the map, by name; empty if the device model admits none."""
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
    """Return a scenario's loop as loops against a wall (K, B), one per decoupled direction.

    Raises:
        StabilityError: the directions are coupled through device or controller.
    """
    path = loop.path
    r = loop.directions.shape[1]
    if r == 1:
        return [_single(path.A, path.B[:, 0], path.C[0], loop.period)]
    raise StabilityError(
        "the directions are coupled, so one (K, B) for all of them has no single curve; use one direction"
    )


def loop_radii(loop: ScenarioLoop, stiffness: Array, damping: Array) -> Array:
    """Return the spectral radius (n,) of a scenario's loop for objects with one K (n,), N/m, and B (n,), N s/m.

    The stiffness and the damping are those of every direction; the damping is by backward difference.
    """
    if loop.directions.shape[1] == 1:
        return wall_spectral_radius(wall_loops(loop)[0], stiffness=stiffness, virtual_damping=damping, workers=1)
    return wall_spectral_radius(_Coupled.of(loop, 0), stiffness=stiffness, virtual_damping=damping, workers=1)


def _single(a: Array, b: Array, c: Array, period: float) -> WallLoop:
    n = len(a)
    return wall_loop(SampledDevice(np.asarray(a - np.eye(n)), -np.asarray(b), np.zeros(n), np.asarray(c), 0, period))


class _Coupled(WallLoop):
    """Wall with one (K, B) in several coupled directions; W is an eigenvalue of the inverse response.

    Attributes:
        loop: the scenario's loop.
        index: rank of the eigenvalue of the response by modulus.
    """

    loop: ScenarioLoop
    index: int

    @classmethod
    def of(cls, loop: ScenarioLoop, index: int) -> _Coupled:
        """Return the loop of the eigenvalue with rank ``index`` by modulus."""
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
    for count in (100, points):  # the first pass estimates the size of the region
        parts = []
        for index in range(r):
            with suppress(StabilityError):
                parts.append(trace_boundary(_Coupled.of(loop, index), count, 0.0, scale, single=False))
        if parts:
            scale = max(float(p.damping.max()) for p in parts), max(float(p.stiffness.max()) for p in parts)
    if not parts:
        raise StabilityError("no object of any stiffness is stable in this loop")
    damping, stiffness, angle = (
        np.concatenate([getattr(part, name) for part in parts]) for name in ("damping", "stiffness", "angle")
    )
    return Boundary(damping, stiffness, angle, parts[0].inside)


def _passive(s: Scenario, loop: ScenarioLoop, edge: Boundary) -> tuple[tuple[Array, Array] | None, str]:
    """Return (B, K) of the boundary of the passive walls, or None and the reason."""
    if s.servo.topology != "impedance_display":
        return None, "the loop tracks a reference force and has no operator, so passivity does not apply"
    if s.controller.kind not in ("none", "gain"):
        return None, "the controller is dynamic, and the passivity condition holds for a constant gain only"
    if math.isnan(loop.device_damping):
        return None, "the device model does not specify its own damping"
    if loop.device_damping <= 0:
        if np.all(loop.own.viscous > 0.0):
            return (
                None,
                "the torque that balances the weight turns with the pose at ticks, and takes all of the friction",
            )
        return None, "the device has no damping of its own, so no wall is passive"
    if not loop.rests:
        return None, "without an operator the device tips over under gravity, so no wall is passive"
    gain = max(s.controller.gain or (1.0,))
    counts: tuple[float, float] | None = None  # K without B and B without K, for which the joints have friction
    if s.device.encoder:
        counts = _friction_suffices(s, loop)
        if min(counts) <= 0.0:
            return None, "encoder counts generate energy that only dry friction dissipates, and a joint has none"
    b = np.linspace(0, min(float(edge.damping.max()), 1.02 * loop.device_damping / gain), 25)
    k = _passive_stiffness(s, loop.device_damping, b * gain)
    if counts is not None:
        k = np.clip(k, 0.0, counts[0] * (1.0 - b * gain / counts[1]).clip(min=0.0))
    return (b, k / gain), ""


def _passive_stiffness(s: Scenario, own: float, b: Array) -> Array:
    """Return the largest passive K (k,), N/m, with dampers B (k,), N s/m, and the device's own damping, N s/m."""
    if not s.servo.jitter:
        return passive_stiffness(damping=own, period=s.period, virtual_damping=b, delay=s.device.delay)
    longest = s.period + s.servo.jitter  # the servo divides differences over it by the period
    left = own - b * longest / s.period
    unit = field_damping(lipschitz=1.0, longest_period=longest, delay=s.device.delay)
    return np.asarray(np.maximum(left, 0.0) / unit, dtype=float)


def _friction_suffices(s: Scenario, loop: ScenarioLoop) -> tuple[float, float]:
    """Return K, N/m, without B, and B, N s/m, without K, for which the joints have the friction that counts need."""
    own = s.load_device().coulomb
    needed = (friction_for_counts(s, loop, k, b) for k, b in ((1.0, 0.0), (0.0, 1.0)))
    stiffest, damped = (float(np.divide(own, n, out=np.full_like(own, np.inf), where=n > 0.0).min()) for n in needed)
    return stiffest, damped
