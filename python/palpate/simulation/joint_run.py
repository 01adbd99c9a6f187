"""Run of several devices on one deformable body: one servo reads all tips, finds their contact, and drives all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from palpate.arrays import Array, Flags
from palpate.fem.indentation import LOST, SOLVED, ContactHistory
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenarios
from palpate.simulation.evidence import resolution
from palpate.simulation.loop import Loop
from palpate.simulation.recorded import external_forces
from palpate.simulation.shared_body import SharedBody
from palpate.simulation.tool_motion import overlapping
from palpate.simulation.trace import Trace, describe_channel
from palpate.simulation.trace_export import Channel
from palpate.simulation.user_object import ContactResult
from palpate.simulation.verdict import FAILED, State, Verdict
from palpate.simulation.windows import Window, windows

__all__ = ["JointRun", "simulate_together"]

_SHALLOW: Final = 50e-6  # depth up to which the stiffness of a contact is not known, m; as of a single tip


@dataclass(frozen=True)
class JointRun:
    """Run of several devices on one body.

    Attributes:
        traces: of each device; the force of its tip on the body is `object_force`.
        contacts: of each tip, in the body's frame; a row for each tick.
        tips: as the servo read them in each tick, each in its device's frame (m, k, 3), m.
        solved: whether the forces of all tips were found in each tick (m,).
        overlap: that two tips overlap at the end of the run, as a sentence; None if none do.
    """

    traces: tuple[Trace, ...]
    contacts: tuple[ContactHistory, ...]
    tips: Array = field(default_factory=lambda: np.zeros((0, 0, 3)), repr=False)
    solved: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool), repr=False)
    overlap: str | None = None

    @property
    def settled(self) -> bool:
        """Whether every device has settled, and no two tips overlap."""
        return self.verdict.settled

    @property
    def verdict(self) -> Verdict:
        """Verdict of the run: that of the first device that failed, else of the first undecided one, else settled.

        The reason names the devices.
        """
        each = [(number, trace.verdict) for number, trace in enumerate(self.traces, 1)]
        bad = [one for one in each if one[1].state in FAILED] or [one for one in each if not one[1].settled]
        if not bad and self.overlap is not None:
            return Verdict(State.UNDECIDED, self.overlap)
        if not bad:
            return Verdict(State.SETTLED, "all devices rest")
        state = bad[0][1].state
        reasons = [f"device {number}: {own.reason if own.state is state else own}" for number, own in bad]
        begins = [own.since for _, own in bad if own.since is not None]
        return Verdict(state, "; ".join(reasons), min(begins, default=None))


class _Presented:
    """Object of one device's loop: the contact that was found for its tip at this sample."""

    contact = ContactResult(np.zeros(3))

    def step(self, _tip: Any) -> ContactResult:
        return self.contact


def simulate_together(scenarios: Sequence[Scenario | Mapping[str, Any] | str | Path]) -> JointRun:
    """Run several devices that touch one deformable body, each with one tip.

    All tips are read at the same sample, and the body answers to all of them in that sample: a press by one device is
    felt by the others within a period. The run ends with the longest scenario, or when a loop diverges. The verdicts
    are those of every tick, whatever `run.record_every` is.

    Args:
        scenarios: one for each device, 2 to 8. Their objects are the same body, with contact by signed distance; its
            position, origin and rotation are those in the frame of each device.

    Raises:
        ScenarioError: as `SharedBody` and `palpate.simulate`.
    """
    loaded = read_scenarios(scenarios)
    ticked = [scenario.with_every_tick() for scenario in loaded]
    shared = SharedBody(loaded)
    objects = [_Presented() for _ in loaded]
    loops = [Loop(scenario, object=own) for scenario, own in zip(ticked, objects, strict=True)]
    rows, read = [], []
    for _ in range(max(loop.samples for loop in loops)):
        tips = np.array([[_sensed(loop) for loop in loops]])
        read.append(tips[0])
        row = shared.step(tips)
        rows.append(row[0])
        for own, turn, contact in zip(objects, shared.rotations, row[0], strict=True):
            own.contact = _contact(turn, contact)
        for loop in loops:
            loop.step()
        if any(loop.diverged for loop in loops):
            break
    found = np.array(rows)
    counts = max(_counts(loop) for loop in loops)
    tips = np.array(read)
    whole = [
        _trace(loop, scenario, turn, found[:, tip], counts, tips)
        for tip, (loop, scenario, turn) in enumerate(zip(loops, ticked, shared.rotations, strict=True))
    ]
    traces = tuple(trace.recorded(scenario) for trace, scenario in zip(whole, loaded, strict=True))
    solved = np.asarray((found[:, :, SOLVED] > 0.0).all(axis=1), dtype=bool)
    found[:, :, SOLVED] = 1.0  # where they were not, the traces say so
    contacts = tuple(ContactHistory.of(found[:, tip]) for tip in range(len(loops)))
    pair = overlapping(shared.in_body(tips[-1:])[0], shared.radii)
    return JointRun(
        traces, contacts, tips, solved, pair and f"the tips of devices {pair}: press less, or farther apart"
    )


def _counts(loop: Loop) -> float:
    """Return the tip displacement of two encoder counts of a device at its start, m."""
    simulation = loop.simulation
    return float(resolution(simulation.scenario, simulation.device, simulation.start)[0])


def _trace(loop: Loop, scenario: Scenario, turn: Array, rows: Array, counts: float, tips: Array) -> Trace:
    """Return the trace of a device, with what the shared body adds for its verdict.

    Args:
        loop: of the device.
        scenario: of the device, with the body.
        turn: body frame to device frame (3, 3).
        rows: of the core, of the device's tip in each tick (m, 15).
        counts: largest tip displacement of two encoder counts of all devices, m: each feels the counts of the others.
        tips: of all devices in each tick (m, k, 3), m.
    """
    trace = loop.trace
    kept = rows[: len(trace)]
    values = {"deflection": kept[:, 3:6] @ turn.T, "solved": kept[:, SOLVED, None], "contact_lost": kept[:, LOST, None]}
    channels = {name: Channel(value, *describe_channel(name)) for name, value in values.items()}
    growths = [_growth(tips, window) for window in windows(external_forces(trace, scenario))]
    known = {**trace.metadata["object"], "name": "shared body", "resolution_m": counts, "growth_of_all": growths}
    metadata = {**trace.metadata, "scenario": scenario.to_dict(), "object": known}
    return replace(trace, channels={**trace.channels, **channels}, metadata=metadata)


def _growth(tips: Array, window: Window) -> float:
    """Return the growth factor of the oscillation of all tips (m, k, 3), m, together in the last fifth of a window.

    It is the root mean square of their second differences, relative to that of the fifth before.
    """
    before, after = (np.square(np.diff(tips[window.part(n, n + 1)], n=2, axis=0)).sum() for n in (3, 4))
    return float(np.sqrt(after / before)) if before > 0.0 else 1.0


def _sensed(loop: Loop) -> Array:
    """Return the tip of a loop as its servo reads it now (3,), m."""
    simulation = loop.simulation
    angles, step = loop.angles.copy(), simulation.device.encoder_step
    counted = simulation.scenario.device.encoder & (step > 0.0)
    angles[counted] = np.rint(angles[counted] / step[counted]) * step[counted]
    return np.asarray(simulation.tip(angles[None])[0])


def _contact(turn: Array, row: Array) -> ContactResult:
    """Return the contact of a tip in its device's frame, from a row of the core in the body's frame."""
    felt, deflection = turn @ row[0:3], turn @ row[3:6]
    pressed = felt - turn @ row[10:13]
    size = float(np.linalg.norm(pressed))
    if not row[8] or size == 0.0:
        return ContactResult(np.zeros(3), touching=False)
    normal = pressed / size
    depth = float(-normal @ deflection)
    stiffness = float(normal @ felt) / depth if depth > _SHALLOW else 0.0
    return ContactResult(-felt, deflection, normal, depth, max(stiffness, 0.0), touching=True)
