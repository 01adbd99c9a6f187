"""The run of a scenario on a body, held at its end, pushed slightly and watched."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from palpate.scenario import Scenario
from palpate.simulation.simulator import build_simulation
from palpate.simulation.trace import Trace

__all__ = ["ObservedRun", "Outcome", "observe"]

Outcome = Literal["rests", "diverges", "bounces", "oscillates", "leaves"]
HOLD = 0.5  # s for which the signals keep their last value before the push, at least
SHORTEST, LONGEST = 1500, 20_000  # ticks after the push
_PUSH, _ASIDE, _PUSH_TICKS = 0.05, 0.02, 5  # share of the contact force, into the body and aside
_DECAYED = 0.3  # motion in the last fifth relative to the first, below which it decays
_STILL = 1e-6  # motion per tick relative to the deflection that does not count
_TOUCHES = 3  # contacts in the last two fifths from which on the tip bounces


@dataclass(frozen=True)
class ObservedRun:
    """A run with its continuation.

    Attributes:
        trace: of every tick: the scenario's own run, its hold, the push, and the ticks after it.
        end: index of the last sample of the scenario's own run.
        held: index of the last sample before the push.
        outcome: what the tip does after the push.
        decay: motion in the last fifth after the push relative to that in the first; nan if it diverged.
        sentence: the observation.
    """

    trace: Trace
    end: int
    held: int
    outcome: Outcome
    decay: float
    sentence: str


def observe(scenario: Scenario, ticks: int = SHORTEST, hold: float = HOLD) -> ObservedRun:
    """Run a scenario on a body, hold its signals, push the tip slightly, and observe it for some ticks.

    The push is a force of the operator for five ticks: 5 % of the force of the contact into the body, 2 % aside.

    Args:
        scenario: its object is a body.
        ticks: for which the tip is observed after the push.
        hold: s, before the push.
    """
    tables = scenario.to_dict()
    tables["run"] = {**tables["run"], "record_every": 1}
    simulation = build_simulation(tables)
    end = len(simulation.reference) - 1
    held = end + math.ceil(hold / scenario.period)
    more = held - end + 1 + ticks
    reference, operator = (
        np.vstack([table, np.tile(table[-1], (more, 1))]) for table in (simulation.reference, simulation.operator)
    )
    first = replace(simulation, reference=reference[: held + 1], operator=operator[: held + 1])
    trace = first.trace(*first.run())
    if trace.completed and np.any(trace["touching"][-1]):
        force = trace["object_force"][-1]
        across = np.cross(force, np.eye(3)[int(np.argmin(np.abs(force)))])
        aside = np.linalg.norm(force) * across / max(float(np.linalg.norm(across)), 1e-300)
        operator[held + 1 : held + 1 + _PUSH_TICKS] += _PUSH * force + _ASIDE * aside
        whole = replace(simulation, reference=reference, operator=operator)
        trace = whole.trace(*whole.run())
    outcome, decay = _outcome(scenario, trace, held)
    return ObservedRun(trace, end, held, outcome, decay, _sentence(scenario, trace, hold, held, outcome, decay))


def _outcome(scenario: Scenario, trace: Trace, held: int) -> tuple[Outcome, float]:
    if not trace.completed:
        return "diverges", float("nan")
    pushed = len(trace) > held + 1 + _PUSH_TICKS
    watched = slice(held + 1 + _PUSH_TICKS, None) if pushed else slice(held // 2, None)
    touching, tip = trace["touching"][watched, 0] > 0.0, trace["tip"][watched]
    late = touching[-2 * len(touching) // 5 :]
    if int(np.count_nonzero(late[1:] & ~late[:-1])) > _TOUCHES:
        return "bounces", float("nan")
    motion = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    fifth = max(len(motion) // 5, 1)
    first, last = float(motion[:fifth].max()), float(motion[-fifth:].max())
    decay = last / first if first > 0.0 else 0.0
    still = _STILL * float(np.linalg.norm(trace["deflection"][watched], axis=1).max())
    if scenario.device.encoder:
        device = scenario.load_device()
        still = max(still, float((np.abs(device.jacobian(trace["angle"][-1])) @ device.encoder_step).max()))
    if decay > _DECAYED and last > still:
        return "oscillates", decay
    return ("rests" if touching[-1] else "leaves"), decay


def _sentence(scenario: Scenario, trace: Trace, hold: float, held: int, outcome: Outcome, decay: float) -> str:
    run = f"The scenario was run for {scenario.run.duration:g} s and held for {hold:g} s"
    after = (len(trace) - held) * scenario.period
    if outcome == "diverges":
        return f"{run}; it diverged at {trace.unstable_from:g} s."
    if outcome == "leaves":
        return f"{run}; at its end the tip is off the body."
    if len(trace) == held + 1:
        return f"{run}; at its end the tip {outcome}."
    pushed = f"{run}, pushed by 5 % of its force for {_PUSH_TICKS} ticks, and observed for {after:.3g} s"
    if outcome == "rests":
        return f"{pushed}: the motion decays, to {decay:.2g} of its first fifth."
    if outcome == "bounces":
        return f"{pushed}: the tip bounces on the body."
    return f"{pushed}: the motion does not decay ({decay:.3g} times that of its first fifth)."
