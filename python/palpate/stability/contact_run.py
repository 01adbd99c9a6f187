"""Runs that check a certificate of a contact: the scenario until it rests, and again with a small push."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.simulation.judgment import judge, judge_pushed
from palpate.simulation.simulator import Simulation
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import OSCILLATES, State, Verdict

__all__ = ["Observed", "PushedRun", "run_on", "run_pushed"]

SETTLE = 2.0  # s that a run goes on after its forces stop changing
LONGER = 4.0  # s that a run goes on that seems to fail
PUSH = 0.02  # s, duration of the push
SHARE = 0.02  # of the contact force
MOVING = 1e-4  # m/s: a tip that slides faster does not rest


@dataclass(frozen=True)
class Observed:
    """Run of a scenario, continued under its last forces.

    Attributes:
        trace: the run, every tick.
        rest: index of the last sample, or of the last before the forces of a sine go on changing.
        constant: whether the forces stop changing.
        verdict: of the run by itself, without the linear loop.
    """

    trace: Trace
    rest: int
    constant: bool
    verdict: Verdict

    @property
    def fails(self) -> bool:
        """Whether the run diverges, bounces or oscillates."""
        return self.verdict.state in OSCILLATES


@dataclass(frozen=True)
class PushedRun:
    """Run that is pushed where it rests.

    Attributes:
        push: N.
        time: s that it was watched after the push.
        kept: response to the push at the end, relative to that right after it.
        slide: speed of the proxy at the end without a push, m/s; 0 if it slides slower and slower.
        verdict: of the run after the push.
        free: the run without the push, every tick.
    """

    push: float
    time: float
    kept: float
    slide: float
    verdict: Verdict
    free: Trace

    @property
    def fails(self) -> bool:
        """Whether the run diverges, bounces, oscillates or keeps its response to the push."""
        return self.verdict.state in OSCILLATES


def run_on(scenario: Scenario, hold: float = 0.0) -> Observed:
    """Return the run of a scenario, continued under its last forces if they change near its end.

    Args:
        scenario: the scenario.
        hold: s for which its last forces last at least, if they stop changing.
    """
    last = _last_change(scenario)
    duration = scenario.run.duration
    if last is not None and duration < last + max(SETTLE / 2, hold):
        duration = last + max(SETTLE, hold)
    trace = _simulation(scenario, duration).simulate()
    verdict = judge(trace, math.nan)
    if last is not None and verdict.state in OSCILLATES and trace.completed:  # a slow transient may yet decay
        longer = _simulation(scenario, duration + LONGER).simulate()
        again = judge(longer, math.nan)
        trace, verdict = (longer, again) if again.state in OSCILLATES else (trace, again)
    return Observed(trace, len(trace) - 1, last is not None, verdict)


def run_pushed(scenario: Scenario, observed: Observed, watch: float, radius: float) -> PushedRun:
    """Return the run again, with a short push where it rests, compared for ``watch`` s with the run without it.

    Both are without the limits of the drive, whose windings would warm up meanwhile.

    Args:
        scenario: of the run.
        observed: the run.
        watch: s.
        radius: spectral radius where the run rests; nan: the run alone is judged. By itself it does not make the run
            unstable.
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
    free = simulation.simulate()
    pushed = replace(simulation, operator=simulation.operator + push).simulate()
    start = rest + 1 + ticks
    for trace in (pushed, free):
        if trace.unstable_from is not None:
            return PushedRun(size, watch, np.inf, 0.0, judge_pushed(trace, start, np.inf), free)
    response = np.diff(pushed["tip"][start:] - free["tip"][start:], axis=0) / period
    speed = np.linalg.norm(response, axis=1)
    fifth = max(len(speed) // 5, 1)
    early, late = (float(np.sqrt(np.mean(part**2))) for part in (speed[:fifth], speed[-fifth:]))
    kept = late / early if early > 0.0 else 0.0
    earlier, slide = (_slide(free["proxy"][start:], end, fifth, period) for end in (3, 5))
    if slide < 0.5 * earlier:
        slide = 0.0
    verdict = judge_pushed(pushed, start, kept, radius)
    if verdict.state is State.UNSTABLE and verdict.since is None:  # by the linear loop alone
        verdict = judge_pushed(pushed, start, kept)
    return PushedRun(size, watch, kept, slide, verdict, free)


def _slide(proxy: Array, end: int, fifth: int, period: float) -> float:
    """Return the mean speed of the proxy (n, 3) in one fifth of a run, 1 to 5, m/s."""
    part = proxy[(end - 1) * fifth : end * fifth]
    return float(np.linalg.norm(part[-1] - part[0]) / (fifth * period))


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
    direction = -normal + 0.7 * along / max(float(np.linalg.norm(along)), 1e-300) + 0.4 * side
    return np.asarray(direction / np.linalg.norm(direction), dtype=float)
