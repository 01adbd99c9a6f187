"""Runs that check a certificate of a contact: the scenario until it rests, and again with a small push."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.simulation.simulator import Simulation
from palpate.simulation.trace import Trace

__all__ = ["Observed", "PushedRun", "run_on", "run_pushed"]

SETTLE = 2.0  # s that a run goes on after its forces stop changing
LONGER = 4.0  # s that a run goes on that seems to fail
PUSH = 0.02  # s, duration of the push
SHARE = 0.02  # of the contact force
MOVING = 1e-4  # m/s: a tip that swings or slides faster does not rest
PERSISTS = 0.3  # motion long after a push, relative to that right after it, that counts as not decaying
BOUNCING = 0.7  # speed at the end relative to that before, above which the bounces do not die out
BOUNCES = 3  # contacts under constant forces in the time observed, above which the tip bounces endlessly


@dataclass(frozen=True)
class Observed:
    """Run of a scenario, continued under its last forces.

    Attributes:
        trace: the run, every tick.
        rest: index of the last sample, or of the last before the forces of a sine go on changing.
        constant: whether the forces stop changing.
        failure: how the run fails: it diverges, bounces or oscillates; empty if it does not.
    """

    trace: Trace
    rest: int
    constant: bool
    failure: str


@dataclass(frozen=True)
class PushedRun:
    """Run that is pushed where it rests.

    Attributes:
        push: N.
        time: s that it was watched after the push.
        decay: response to the push at the end, relative to that right after it.
        swing: speed at the end about the smooth motion, rms, m/s.
        slide: speed of the proxy at the end without a push, m/s; 0 if it slides slower and slower.
        failure: how the run fails; empty if it does not.
    """

    push: float
    time: float
    decay: float
    swing: float
    slide: float
    failure: str

    @property
    def moves(self) -> bool:
        """Whether the pushed tip does not come to rest."""
        return bool(self.failure) or self.decay > PERSISTS


def run_on(scenario: Scenario) -> Observed:
    """Return the run of a scenario, continued under its last forces if they change near its end."""
    last = _last_change(scenario)
    duration = scenario.run.duration
    if last is not None and duration < last + SETTLE / 2:
        duration = last + SETTLE
    trace, failure = _watched(_simulation(scenario, duration), last)
    if failure and trace.completed:  # a slow transient may yet decay
        longer, failure = _watched(_simulation(scenario, duration + LONGER), last)
        trace = longer if failure else trace
    return Observed(trace, len(trace) - 1, last is not None, failure)


def _watched(simulation: Simulation, last: float | None) -> tuple[Trace, str]:
    """Return a run, and how it fails in its last part, up to ``SETTLE``, under forces constant from ``last`` s on."""
    trace, period = simulation.trace(*simulation.run()), simulation.scenario.period
    if trace.unstable_from is not None:
        return trace, f"diverges at {trace.unstable_from:.3g} s"
    if last is None:
        return trace, ""
    watched = min(round((len(trace) * period - last) / period), round(SETTLE / period), len(trace) // 2)
    return trace, _failure(trace["tip"][-watched:], trace["touching"][-watched:, 0] > 0.0, period)


def run_pushed(scenario: Scenario, observed: Observed, watch: float) -> PushedRun:
    """Return the run again, with a short push where it rests, compared for ``watch`` s with the run without it.

    Both are without the limits of the drive, whose windings would warm up meanwhile.
    """
    if scenario.device.saturation:
        unlimited = scenario.device.model_copy(update={"saturation": False})
        scenario = scenario.model_copy(update={"device": unlimited})
    period, rest = scenario.period, observed.rest
    simulation = _simulation(scenario, rest * period + PUSH + watch)
    force = float(np.linalg.norm(observed.trace["object_force"][rest]))
    size, ticks = max(SHARE * force, 1e-3), round(PUSH / period)
    shape = np.sin(np.pi * np.arange(1, ticks + 1) / (ticks + 1))
    push = np.zeros_like(simulation.operator)
    push[rest + 1 : rest + 1 + ticks] = size * shape[:, None] * _direction(observed.trace["normal"][rest])
    free = _trace(simulation, simulation.reference, simulation.operator)
    pushed = _trace(simulation, simulation.reference, simulation.operator + push)
    if np.array_equal(free["tip"], pushed["tip"]):  # a sampled model of the device has no operator
        pushed = _trace(simulation, simulation.reference + push, simulation.operator)
    for trace in (pushed, free):
        if trace.unstable_from is not None:
            after = trace.unstable_from - rest * period
            return PushedRun(size, watch, np.inf, np.inf, 0.0, f"diverges {after:.3g} s after the push")
    start = rest + 1 + ticks
    response = np.diff(pushed["tip"][start:] - free["tip"][start:], axis=0) / period
    speed = np.linalg.norm(response, axis=1)
    fifth = max(len(speed) // 5, 1)
    early, late = (float(np.sqrt(np.mean(part**2))) for part in (speed[:fifth], speed[-fifth:]))
    failure = _failure(pushed["tip"][start:], pushed["touching"][start:, 0] > 0.0, period)
    swing = _swing(pushed["tip"][-fifth:], period)
    earlier, slide = (_slide(free["proxy"][start:], end, fifth, period) for end in (3, 5))
    if slide < 0.5 * earlier:
        slide = 0.0
    return PushedRun(size, watch, late / early if early > 0.0 else 0.0, swing, slide, failure)


def _slide(proxy: Array, end: int, fifth: int, period: float) -> float:
    """Return the mean speed of the proxy (n, 3) in one fifth of a run, 1 to 5, m/s."""
    part = proxy[(end - 1) * fifth : end * fifth]
    return float(np.linalg.norm(part[-1] - part[0]) / (fifth * period))


def _trace(simulation: Simulation, reference: Array, operator: Array) -> Trace:
    simulation.restart()
    rows, count, unstable = simulation.setup.run(np.ascontiguousarray(reference), np.ascontiguousarray(operator))
    return simulation.trace(np.asarray(rows)[:count], unstable, reference)


def _simulation(scenario: Scenario, duration: float) -> Simulation:
    run = scenario.run.model_copy(update={"duration": duration, "record_every": 1})
    return Simulation.of(scenario.model_copy(update={"run": run}))


def _last_change(scenario: Scenario) -> float | None:
    """Return the time after which the forces of a scenario are constant, s; None if they never are."""
    times = [0.0]
    for signal in (scenario.reference, scenario.operator):
        if signal is None or (signal.force is None and signal.table is None):
            continue
        if signal.shape == "sine" and signal.stop is None:
            return None
        times += [signal.start + (signal.rise or 0.0), signal.stop or 0.0]
        times += [row[0] for row in signal.table or ()]
    return max(times)


def _direction(normal: Array) -> Array:
    """Return the direction of the push (3,): into the surface and along it."""
    side = np.eye(3)[int(np.argmin(np.abs(normal)))]
    along = np.cross(normal, side)
    direction = -normal + 0.7 * along / np.linalg.norm(along) + 0.4 * side
    return np.asarray(direction / np.linalg.norm(direction), dtype=float)


def _failure(tip: Array, touching: NDArray[np.bool_], period: float) -> str:
    """Return how a tip under constant forces fails to come to rest; empty if it does."""
    watched = tip[-len(touching) :]
    part = len(watched) // 4
    earlier, late = (_swing(watched[i * part : (i + 1) * part], period) for i in (1, 3))
    bounces = int(np.count_nonzero(touching[1:] & ~touching[:-1]))
    if bounces > BOUNCES and not touching[-len(touching) // 5 :].all() and late > BOUNCING * earlier:
        return f"bounces on the mesh, {bounces} times in {len(touching) * period:.3g} s"
    if late > MOVING and late > 0.9 * earlier:
        return f"oscillates at {late * 1e3:.2g} mm/s without decay"
    return ""


def _swing(tip: Array, period: float) -> float:
    """Return the rms speed of a tip (n, 3) about its slow motion, a parabola, m/s."""
    n = len(tip)
    if n < 8:
        return 0.0
    powers = np.vander(np.linspace(-1.0, 1.0, n), 3)
    rest = tip - powers @ np.linalg.lstsq(powers, tip, rcond=None)[0]
    return float(np.sqrt(np.mean(np.sum((np.diff(rest, axis=0) / period) ** 2, axis=1))))
