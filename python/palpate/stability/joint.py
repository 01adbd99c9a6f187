"""Joint stability of several devices on one body: their loops around one response of the body to all tips."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import control
import numpy as np
from scipy.linalg import block_diag

from palpate.arrays import Array
from palpate.scenario import Scenario
from palpate.simulation.body_response import HeldTips, body_response
from palpate.simulation.controllers import read_scenarios
from palpate.simulation.joint_run import JointRun, simulate_together
from palpate.simulation.linear_loop import ScenarioLoop, require_linear_parts
from palpate.simulation.shared_body import SharedBody
from palpate.simulation.verdict import FAILED, OSCILLATES, State
from palpate.stability.contact_loop import ContactStability, device_loop, judge, loop_around

__all__ = ["JointStability", "joint_stability", "run_alone"]

_ENDS = frozenset((State.CONTACT_LOST, State.OUT_OF_REACH, State.DRIVE_LIMIT))  # of runs that the loops do not describe


@dataclass(frozen=True)
class JointStability:
    """Stability of several devices on one body, linearized where their run has left the tips.

    A body couples the loops: what one device presses out, the other feels. So each may be stable while the others hold
    still, and all together not.

    Attributes:
        together: of all devices. Its radius, criteria and margin are those of one loop with the motions of all tips.
            Its normal and its static stiffness are those of the first device.
        each: of each device while the others hold still.
        run: the run at whose end the loops are linearized.
    """

    together: ContactStability
    each: tuple[ContactStability, ...]
    run: JointRun

    @property
    def state(self) -> State:
        """STABLE or UNSTABLE where the linear loops and the run agree, otherwise UNDECIDED.

        A run agrees that the loops are unstable if a device oscillates: one that still moves may come to rest.

        A run that loses the contact, or leaves the reach or the limits of a drive, has that state.
        """
        if (ended := self.run.verdict.state) in _ENDS:
            return ended
        if self.together.state is State.STABLE and self.run.settled:
            return State.STABLE
        if self.together.state is State.UNSTABLE and self.run.verdict.state in OSCILLATES:
            return State.UNSTABLE
        return State.UNDECIDED

    def __str__(self) -> str:
        """Return the verdict, the loops and the runs as text."""
        whole = _sentence("all devices together", self.together)
        lines = [f"{self.state.label.capitalize()}: {whole}"]
        if self.state in _ENDS:
            lines = [_headline(self.run), f"  {whole}"]
        elif self.state is State.UNDECIDED and self.run.overlap is not None:
            lines = [f"{self.state.label.capitalize()}: {self.run.overlap}", f"  {whole}"]
        for tip, (alone, trace) in enumerate(zip(self.each, self.run.traces, strict=True), 1):
            lines.append(f"  {_sentence(f'device {tip}, the others held still', alone)}")
            lines.append(f"  device {tip} in the run: {trace.verdict}")
        return "\n".join(lines)


def run_alone(run: JointRun, problem: str) -> tuple[State, str]:
    """Return state and text, as those of a `JointStability`, of a run whose joint loop is not known.

    Args:
        run: of all devices.
        problem: why the loop is not known.
    """
    rows = [f"  device {number} in the run: {trace.verdict}" for number, trace in enumerate(run.traces, 1)]
    state = run.verdict.state
    if state not in FAILED:
        return State.UNDECIDED, "\n".join([f"Undecided: {problem}", *rows])
    return state, "\n".join([_headline(run), f"  no joint loop is known: {problem}", *rows])


def _headline(run: JointRun) -> str:
    return f"{run.verdict.state.label.capitalize()}: {run.verdict.reason}"


def joint_stability(
    scenarios: Sequence[Scenario | Mapping[str, Any] | str | Path], run: JointRun | None = None
) -> JointStability:
    """Return the joint stability of several devices on one body, at the end of their run.

    The tips are held there until the body rests. Its response to a small displacement of each tip is measured at all
    tips, in the core's own model, and the devices' linear loops are closed around it. Motions are tested in all
    directions in which the devices move. Encoder counts and drive limits are neglected.

    Args:
        scenarios: as of `palpate.simulation.simulate_together`.
        run: of these scenarios; None, or if it does not have every tick: they are run.

    Raises:
        ScenarioError: as `simulate_together`.
        StabilityError: a tip is off the body at the end of the run, a device has a part without a linear model, or the
            body's response does not decay.
    """
    loaded = [scenario.with_every_tick() for scenario in read_scenarios(scenarios)]
    for scenario in loaded:
        require_linear_parts(scenario)
    recorded = run is not None and all(len(trace) == len(run.contacts[0].nodes) for trace in run.traces)
    found = run if run is not None and recorded else simulate_together(loaded)
    shared = SharedBody(loaded)
    count = min(len(trace) for trace in found.traces)
    held = HeldTips(shared, np.stack([trace["tip"][:count] for trace in found.traces], axis=1))
    response = body_response(held)
    each, loops = [], []
    for tip, (scenario, trace) in enumerate(zip(loaded, found.traces, strict=True)):
        own = response.of_tip(tip, int(held.each[tip]))
        loop = device_loop(scenario, trace, count - 1, own.frame[:, 0], True)
        depth = -float(trace["deflection"][count - 1] @ own.frame[:, 0])
        around = loop_around(loop.path, loop.directions, own)
        each.append(judge(around, around, own, depth))
        loops.append(loop)
    path, directions = _side_by_side(loops)
    whole = loop_around(path, directions, response)
    return JointStability(judge(whole, whole, response, each[0].depth), tuple(each), found)


def _side_by_side(loops: Sequence[ScenarioLoop]) -> tuple[control.StateSpace, Array]:
    """Return the paths of several devices as one, and their directions, block by block."""
    paths = [loop.path for loop in loops]
    blocks = [block_diag(*(getattr(path, name) for path in paths)) for name in "ABCD"]
    return control.StateSpace(*blocks, paths[0].dt), block_diag(*(loop.directions for loop in loops))


def _sentence(name: str, one: ContactStability) -> str:
    margin = "any factor" if np.isinf(one.stiffness_margin) else f"{one.stiffness_margin:.4g}"
    reach = "" if np.isnan(one.stiffness_margin) else f", {margin} times the body's stiffness before it oscillates"
    return f"{name}: small motions are {one.state.label} (spectral radius {one.radius:.6g}){reach}"
