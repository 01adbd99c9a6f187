"""Run of several devices on one deformable body: one servo reads all tips, finds their contact, and drives all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from palpate.arrays import Array, Flags
from palpate.fem.indentation import SOLVED, ContactHistory
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenario
from palpate.simulation.loop import Loop
from palpate.simulation.shared_body import SharedBody
from palpate.simulation.trace import Trace
from palpate.simulation.user_object import ContactResult

__all__ = ["JointRun", "simulate_together"]

_SHALLOW: Final = 50e-6  # depth up to which the stiffness of a contact is not known, m; as of a single tip


@dataclass(frozen=True)
class JointRun:
    """Run of several devices on one body.

    Attributes:
        traces: of each device. The force of the body is their `object_force`; their scenario's object is "none".
        contacts: of each tip, in the body's frame; a row for each tick.
        solved: whether the contact forces were found, in each tick (m,).
    """

    traces: tuple[Trace, ...]
    contacts: tuple[ContactHistory, ...]
    solved: Flags

    @property
    def settled(self) -> bool:
        """Whether every device has settled, all contact forces were found, and no tip was pushed through the body."""
        kept = bool(self.solved.all()) and not any(contact.lost.any() for contact in self.contacts)
        return kept and all(trace.verdict.settled for trace in self.traces)


class _Presented:
    """Object of one device's loop: the contact that was found for its tip at this sample."""

    contact = ContactResult(np.zeros(3))

    def step(self, _tip: Any) -> ContactResult:
        return self.contact


def simulate_together(scenarios: Sequence[Scenario | Mapping[str, Any] | str | Path]) -> JointRun:
    """Run several devices that touch one deformable body, each with one tip.

    All tips are read at the same sample, and the body answers to all of them in that sample: a press by one device is
    felt by the others within a period. The run ends with the longest scenario, or when a loop diverges.

    Args:
        scenarios: one for each device, 2 to 8. Their objects are the same body, with contact by signed distance; its
            position, origin and rotation are those in the frame of each device.

    Raises:
        ScenarioError: as `SharedBody` and `palpate.simulate`.
    """
    loaded = [read_scenario(scenario) for scenario in scenarios]
    shared = SharedBody(loaded)
    objects = [_Presented() for _ in loaded]
    loops = [Loop(scenario, object=own) for scenario, own in zip(loaded, objects, strict=True)]
    rows = []
    for _ in range(max(loop.samples for loop in loops)):
        tips = np.array([[_sensed(loop) for loop in loops]])
        row = shared.step(tips)
        rows.append(row[0])
        for own, turn, contact in zip(objects, shared.rotations, row[0], strict=True):
            own.contact = _contact(turn, contact)
        for loop in loops:
            loop.step()
        if any(loop.diverged for loop in loops):
            break
    found = np.array(rows)
    solved = np.asarray(found[:, :, SOLVED].all(axis=1))
    found[:, :, SOLVED] = 1.0
    return JointRun(
        tuple(
            _with_deflection(loop.trace, loop.scenario.run.record_every, found[:, tip, 3:6] @ turn.T)
            for tip, (loop, turn) in enumerate(zip(loops, shared.rotations, strict=True))
        ),
        tuple(ContactHistory.of(found[:, tip]) for tip in range(len(loops))),
        solved,
    )


def _with_deflection(trace: Trace, every: int, deflection: Array) -> Trace:
    """Return a trace with the deflection of each tick (m, 3), m, at its samples."""
    channel = replace(trace.channels["deflection"], values=deflection[::every][: len(trace)])
    return replace(trace, channels={**trace.channels, "deflection": channel})


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
