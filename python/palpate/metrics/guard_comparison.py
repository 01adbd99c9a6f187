"""Comparison of guards, walls, couplings and displays on one axis of a device, by running its servo loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from palpate import _core
from palpate.arrays import Array
from palpate.checks import not_negative, positive
from palpate.devices import Device, load
from palpate.errors import PoseError, StabilityError
from palpate.files import check_suffix, write_json
from palpate.metrics.device_performance import tip_inertia
from palpate.simulation.guards import set_guard

__all__ = ["GuardComparison", "GuardRow", "TipAxis", "compare_guards", "tip_axis"]

LADDER: Final = (500.0, 1e3, 2e3, 3.5e3, 5e3, 1e4, 2e4)  # N/m
IMPACTS: Final = (0.02, 0.1, 0.3)  # m/s
DURATION: Final = 2.0  # s
LAST: Final = 0.25  # of the duration, in which the tip must rest
REST: Final = 15e-6  # m: largest swing of a tip at rest, unless one count is more
FELT: Final = 0.9  # least share of the stiffness that a wall must show
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class TipAxis:
    """One direction of a device's tip as a mass with friction and an encoder.

    Attributes:
        mass: apparent mass, kg.
        damping: viscous friction, N s/m.
        coulomb: dry friction, N.
        count: largest motion of the tip along the direction in one count of a joint, m; 0 without encoder.
    """

    mass: float
    damping: float
    coulomb: float
    count: float


@dataclass(frozen=True)
class GuardRow:
    """One way to render a wall, and how far it reaches.

    Attributes:
        name: of the way.
        stiffness: largest tested one, N/m, up to which the tip rests after every impact and at least 90 % is felt; 0:
            none.
        felt: force at rest over stiffness times depth there, the least of the impacts; nan for none.
        jump: largest change of the force in one tick there, N; nan for none.
        swing: half the range of the tip over the last quarter of the run, at the largest tested stiffness, m; inf: it
            diverges.
        guarantee: what is guaranteed for every passive operator.
    """

    name: str
    stiffness: float
    felt: float
    jump: float
    swing: float
    guarantee: str


@dataclass(frozen=True)
class GuardComparison:
    """Comparison of guards on one axis of a device.

    Attributes:
        device: name.
        axis: the direction of the tip as a mass.
        period: T, s; delay: servo periods.
        stiffnesses: tested, N/m; impacts: speeds, m/s; push: force that presses, N.
        rows: of every way.
    """

    device: str
    axis: TipAxis
    period: float
    delay: int
    stiffnesses: tuple[float, ...]
    impacts: tuple[float, ...]
    push: float
    rows: tuple[GuardRow, ...]

    def save(self, path: str | Path) -> Path:
        """Write the comparison as JSON; an infinite or unknown number is null. Return the path."""
        table = asdict(self)
        for row in table["rows"]:
            row.update({key: None for key, value in row.items() if isinstance(value, float) and not np.isfinite(value)})
        return write_json(check_suffix(path, (".json",), "a comparison"), table)


def compare_guards(
    device: Device | str,
    pose: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    *,
    axis: TipAxis | None = None,
    period: float | str | None = None,
    delay: int = 0,
    push: float | str = 1.0,
    stiffnesses: Sequence[float] = LADDER,
    impacts: Sequence[float] = IMPACTS,
    progress: Progress | None = None,
) -> GuardComparison:
    """Compare a plain wall, damped walls, guards, couplings and an admittance display on one axis of a device.

    The servo loop of the core runs each of them for 2 s, on a wall of each stiffness, after an impact at each speed,
    pressed by a constant force. The device is the mass, friction and encoder of one direction of its tip, so that the
    tip cannot slide away.

    Args:
        device: or its name in the catalog, or its file.
        pose: (dof,), rad; the mechanism's working pose if not given.
        direction: of the wall's normal (3,); z if not given, or y or x if the device cannot move along it.
        axis: in place of that of the device.
        period: T, s; that of the device if not given.
        delay: servo periods from the computation of a force to its application.
        push: N.
        stiffnesses: N/m, rising.
        impacts: m/s.
        progress: called with a text and the fraction done.

    Raises:
        PoseError: the pose is singular.
        DeviceError: the device cannot be read.
        StabilityError: an argument is out of range.
    """
    chosen = load(device) if isinstance(device, str) else device
    at = chosen.model.working_pose if pose is None else pose
    along = axis if axis is not None else tip_axis(chosen, at, _movable(chosen, at) if direction is None else direction)
    time = chosen.servo_period if period is None else positive(period, "period", "s")
    if not 0 <= delay <= 64:
        raise StabilityError(f"delay must be 0 to 64 servo periods, not {delay}")
    force = not_negative(push, "push", "N")
    if not stiffnesses or not impacts or min(stiffnesses) <= 0.0:
        raise StabilityError("stiffnesses must be positive and impacts given: at least one of each")
    report = progress or (lambda _text, _fraction: None)
    ways = _ways(along, time, delay)
    rows = []
    for number, way in enumerate(ways):
        report(way.name, number / len(ways))
        rows.append(_row(_Axis(along, time, delay, force), way, stiffnesses, impacts))
    return GuardComparison(chosen.name, along, time, delay, tuple(stiffnesses), tuple(impacts), force, tuple(rows))


def tip_axis(device: Device, pose: ArrayLike, direction: ArrayLike) -> TipAxis:
    """Return one direction e of a device's tip as a mass, at a pose (dof,), rad.

    The mass is 1/(e . L^-1 e) of the tip's inertia L. Frictions are those of the tip that moves along e: viscous
    e . J^-T B J^-1 e, dry sum_i f_i |J^-1 e|_i.

    Raises:
        PoseError: the pose is singular, or the device cannot move along the direction.
    """
    q, e = np.asarray(pose, dtype=float), np.asarray(direction, dtype=float)
    e = e / np.linalg.norm(e)
    jacobian = device.jacobian(q)
    speeds = np.linalg.pinv(jacobian) @ e
    if np.linalg.norm(jacobian @ speeds - e) > 1e-6:
        raise PoseError("direction: the device cannot move its tip along it; give another")
    mobility = e @ jacobian @ np.linalg.solve(device.mass_matrix(q), jacobian.T @ e)
    if device.dof == 3:
        tip_inertia(device, q)  # refuses a singular pose
    counts = np.abs(e @ jacobian) * device.encoder_step
    return TipAxis(
        float(1.0 / mobility),
        float(np.sum(device.viscous * speeds**2)),
        float(np.sum(device.coulomb * np.abs(speeds))),
        float(counts.max()),
    )


def _movable(device: Device, pose: ArrayLike) -> Array:
    """Return the first of z, y and x along which the device can move its tip."""
    jacobian = device.jacobian(pose)
    across = np.eye(3) - jacobian @ np.linalg.pinv(jacobian)  # what cannot be reached of each axis
    free = [number for number in (2, 1, 0) if np.linalg.norm(across[number]) <= 1e-6]
    return np.asarray(np.eye(3)[free[0] if free else 2], dtype=float)


@dataclass(frozen=True)
class _Way:
    """One way to render a wall.

    Attributes:
        name, guarantee: as of `GuardRow`.
        damping: of the wall, N s/m.
        guard: numbers of `guard_numbers`.
        coupling: stiffness of a virtual coupling before the wall, N/m.
        admittance: whether the operator's force is measured and moves a tool of the tip's mass, without damper, which
            the tip follows. Tool and tip then start at rest where the force gives the speed of the impact at the wall.
    """

    name: str
    guarantee: str = "none"
    damping: float = 0.0
    guard: dict[str, Any] | None = None
    coupling: float = float("inf")
    admittance: bool = False


def _ways(axis: TipAxis, period: float, delay: int) -> list[_Way]:
    """Return each way to render a wall; a deadbeat exit needs a loop without delay."""
    unit = axis.mass / period
    exact = 2.0 * axis.damping / ((2 * delay + 1) * period)  # Colgate & Schenkel 1997, of a spring behind the delay
    over = "T" if delay == 0 else f"({2 * delay + 1} T)"

    def bound(coulomb: float) -> dict[str, Any]:
        return {"kind": "energy_bound", "damping": [axis.damping], "coulomb": [coulomb], "lateness": 0.0}

    def half(velocity: str, deadbeat: bool = False) -> dict[str, Any]:
        kind = {"kind": "half_sample", "velocity": velocity, "horizon": 0.5, "observer": 1000.0}
        return kind | {"deadbeat": deadbeat}

    def estimate(correction: float) -> dict[str, Any]:
        return {"kind": "sample_estimate_hold", "correction": correction}

    ways = [
        _Way("no guard", f"stiffness up to 2 b/{over} = {exact:.4g} N/m"),
        _Way("damper of 0.1 m/T", damping=0.1 * unit),
        _Way("damper of 0.4 m/T", damping=0.4 * unit),
        _Way("passivity controller, cap 0.1 m/T", guard={"kind": "passivity_controller", "cap": 0.1}),
        _Way("passivity controller, cap 0.5 m/T", guard={"kind": "passivity_controller", "cap": 0.5}),
        _Way("half-sample, backward difference", guard=half("backward")),
        _Way("half-sample, adaptive window", guard=half("adaptive_window")),
        _Way("half-sample, observer", guard=half("observer")),
        *([_Way("half-sample, observer, deadbeat exit", guard=half("observer", True))] if delay == 0 else []),
        _Way("sample-estimate-hold", guard=estimate(1.0)),
        _Way("sample-estimate-hold, no correction", guard=estimate(0.0)),
    ]
    if axis.damping > 0.0:
        sure = "every stiffness, if b is true"
        ways += [
            _Way("energy bound", sure, guard=bound(0.0)),
            *(
                [
                    _Way(
                        "energy bound, dry friction",
                        "every stiffness, if b and f_c are true",
                        guard=bound(0.8 * axis.coulomb),
                    )
                ]
                if axis.coulomb > 0.0
                else []
            ),
            _Way(f"virtual coupling of 2 b/{over}", sure, coupling=exact),
            _Way(
                f"virtual coupling of 8 b/{over} (two-port)",
                "by the two-port alone, which is not exact",
                coupling=4 * exact,
            ),
        ]
    return [*ways, _Way("admittance display, workspace controller", "needs a force sensor", admittance=True)]


@dataclass(frozen=True)
class _Axis:
    """The loop of one axis of the tip, pressed by a force, N."""

    axis: TipAxis
    period: float
    delay: int
    push: float

    def press(self, stiffness: float, way: _Way, impact: float) -> _Press:
        """Return what a run on a wall shows after an impact."""
        device = load("slider")
        setup = device.setup()
        setup.mechanism = device.model.create({"mass.tip": (self.axis.mass,)})
        friction = setup.friction
        friction.viscous = np.array([self.axis.damping])
        friction.coulomb = friction.breakaway = np.array([self.axis.coulomb])
        setup.friction = friction
        setup.encoder_step = np.array([self.axis.count])
        setup.start, setup.start_speed = np.zeros(1), np.array([impact])
        setup.period, setup.delay, setup.substeps = self.period, self.delay, 2
        wall = _core.SpringWallParameters()
        wall.kind, wall.point, wall.normal = wall.Kind.half_space, np.zeros(3), np.array([-1.0, 0.0, 0.0])
        setup.wall = wall
        rendered = 1.0 / (1.0 / stiffness + 1.0 / way.coupling)
        setup.stiffness, setup.damping = np.full(3, rendered), np.full(3, way.damping)
        set_guard(setup, way.guard)
        ticks = round(DURATION / self.period)
        push, none = np.zeros((ticks + 1, 3)), np.zeros((ticks + 1, 3))
        push[:, 0] = self.push
        if way.admittance:
            knows = (setup.mechanism, friction.viscous, _core.WorkspaceParameters())
            setup.set_admittance_controller(*knows, self.axis.mass, 0.0)
            if self.push > 0.0:
                run_up = self.axis.mass * impact**2 / (2.0 * self.push)
                setup.start, setup.start_speed = np.full(1, -run_up), np.zeros(1)
        rows, count, unstable = setup.run(none, push)
        rows = np.asarray(rows)[:count]
        if unstable >= 0 or not np.isfinite(rows).all():
            return _Press(np.inf, 0.0, np.inf)
        tip, force = rows[:, 0], -rows[:, 5]  # of the tip on the motors
        end = slice(len(tip) - round(LAST * len(tip)), None)
        depth = float(tip[end].mean())
        felt = float(force[end].mean()) / (stiffness * depth) if depth > 0.0 else 0.0
        return _Press(float(np.ptp(tip[end])) / 2.0, felt, float(np.abs(np.diff(force)).max()))


@dataclass(frozen=True)
class _Press:
    """Swing of the tip at the end, m; share of the stiffness that is felt; largest change of the force in a tick, N."""

    swing: float
    felt: float
    jump: float


def _row(loop: _Axis, way: _Way, stiffnesses: Sequence[float], impacts: Sequence[float]) -> GuardRow:
    """Return how far one way to render a wall reaches."""
    rest = max(REST, loop.axis.count)
    best, felt, jump = 0.0, float("nan"), float("nan")
    worst: Array = np.zeros(0)
    reaches = True
    for stiffness in stiffnesses:
        presses = [loop.press(stiffness, way, speed) for speed in impacts]
        worst = np.array([max(one.swing for one in presses), min(one.felt for one in presses)])
        reaches = reaches and bool(worst[0] <= rest and worst[1] >= FELT)
        if reaches:
            best, felt, jump = stiffness, float(worst[1]), max(one.jump for one in presses)
    return GuardRow(way.name, best, felt, jump, float(worst[0]), way.guarantee)
