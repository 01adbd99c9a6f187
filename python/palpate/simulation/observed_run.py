"""The run of a scenario on a body, held at its end, pushed slightly and watched."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from palpate.scenario import Scenario
from palpate.simulation.judgment import judge_pushed
from palpate.simulation.recorded import held_tip
from palpate.simulation.simulator import build_simulation
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import OSCILLATES, State, Verdict

__all__ = ["ObservedRun", "observe"]

HOLD = 0.5  # s for which the signals keep their last value before the push, at least
SHORTEST, LONGEST = 1500, 20_000  # ticks after the push
_PUSH, _ASIDE, _PUSH_TICKS = 0.05, 0.02, 5  # share of the contact force, into the body and aside
_STILL = 1e-6  # motion per tick relative to the deflection that does not count


@dataclass(frozen=True)
class ObservedRun:
    """A run with its continuation.

    Attributes:
        trace: of every tick: the scenario's own run, its hold, the push, and the ticks after it.
        end: index of the last sample of the scenario's own run.
        held: index of the last sample before the push.
        verdict: of the run after the push.
        kept: motion in the last fifth after the push relative to that in the first; nan if it diverged.
        lasts: whether the contact lasts over the last two fifths after the push.
        sentence: the observation.
    """

    trace: Trace
    end: int
    held: int
    verdict: Verdict
    kept: float
    lasts: bool
    sentence: str

    @property
    def oscillates(self) -> bool:
        """Whether the run diverges, bounces, oscillates or keeps its response to the push."""
        return self.verdict.state in OSCILLATES

    @property
    def rests(self) -> bool:
        """Whether the tip rests in contact."""
        return self.verdict.settled and self.lasts


def observe(scenario: Scenario, ticks: int = SHORTEST, hold: float = HOLD) -> ObservedRun:
    """Run a scenario on a body, hold its signals, push the tip slightly, and observe it for some ticks.

    The push is a force of the operator for five ticks: 5 % of the force of the contact into the body, 2 % aside.

    Args:
        scenario: its object is a body.
        ticks: for which the tip is observed after the push.
        hold: s, before the push.
    """
    tables = scenario.to_dict()
    tables["run"] = {**tables.get("run", {}), "record_every": 1}
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
    pushed = trace.completed and len(trace) > held + 1 + _PUSH_TICKS
    begin = held + 1 + _PUSH_TICKS if pushed else min(held // 2, len(trace) - 1)
    kept = _kept(scenario, trace, begin) if trace.completed else float("nan")
    verdict = judge_pushed(trace, begin, kept if pushed else float("nan"))
    touching = trace["touching"][begin:, 0] > 0.0
    lasts = trace.completed and bool(touching[-2 * len(touching) // 5 :].all())
    sentence = _sentence(scenario, trace, hold, held, verdict)
    return ObservedRun(trace, end, held, verdict, kept, lasts, sentence)


def _kept(scenario: Scenario, trace: Trace, begin: int) -> float:
    """Return the motion per tick in the last fifth from sample `begin` on, relative to the first; 0 if it is still."""
    tip = held_tip(trace)[begin:]
    motion = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    fifth = max(len(motion) // 5, 1)
    first, last = float(motion[:fifth].max(initial=0.0)), float(motion[-fifth:].max(initial=0.0))
    still = _STILL * float(np.linalg.norm(trace["deflection"][begin:], axis=1).max())
    if scenario.device.encoder:
        device = scenario.load_device()
        still = max(still, float((np.abs(device.jacobian(trace["angle"][-1])) @ device.encoder_step).max()))
    return 0.0 if last <= still or first == 0.0 else last / first


def _sentence(scenario: Scenario, trace: Trace, hold: float, held: int, verdict: Verdict) -> str:
    run = f"The scenario was run for {scenario.run.duration:g} s and held for {hold:g} s"
    if verdict.state is State.UNSTABLE and not trace.completed:
        return f"{run}; it {verdict.reason}."
    if len(trace) == held + 1:
        return f"{run}; its verdict is {verdict}."
    after = (len(trace) - held) * scenario.period
    return (
        f"{run}, pushed by 5 % of its force for {_PUSH_TICKS} ticks, and observed for {after:.3g} s; its verdict is "
        f"{verdict}."
    )
