"""Closed loops of the thesis: response to a force step on a cube."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from palpate import Trace, simulate
from palpate.arrays import Array
from palpate.simulation.step_response import StepResponse, step_response

from experiments.hosseini2004.cases import CASES, POSE, Tracking
from experiments.hosseini2004.experimental import PERIOD

__all__ = ["FORCES", "STIFFNESSES", "Loop", "loop_of", "respond", "respond_case", "scenario"]

FORCES: Final = (1.0, 4.0, 8.5)  # N, chapter 4
STIFFNESSES: Final = (1.0, 1.05, 2.0, 2.5, 3.0, 3.5)  # N/mm, chapters 4 and 5
Model = Literal["nonlinear", "linear", "experimental"]


@dataclass(frozen=True)
class Loop:
    """One run: the same force on every axis, on a cube of one stiffness, from rest at (0, 2.2305, 3.2776) rad.

    Attributes:
        force: N, on each axis.
        stiffness: N/mm.
        time: (n,), s.
        deflection: (n, 3), mm.
        axes: step response of each axis, in mm and s; empty if the run diverged.
        diverged: time of divergence, s; None if the run did not diverge.
    """

    force: float
    stiffness: float
    time: Array
    deflection: Array
    axes: tuple[StepResponse, ...]
    diverged: float | None

    @property
    def ideal(self) -> float:
        """Force over stiffness (3.35), mm."""
        return self.force / self.stiffness

    @property
    def steady(self) -> Array:
        """Steady deflection of x, y, z, mm; nan if the run diverged."""
        return np.array([axis.steady for axis in self.axes]) if self.axes else np.full(3, np.nan)

    @property
    def error(self) -> Array:
        """Steady deflection less the ideal one, x, y, z, mm."""
        return np.asarray(self.steady - self.ideal, dtype=float)

    @property
    def overshoot(self) -> float:
        """Largest overshoot of the axes, %."""
        return max((axis.overshoot_percent for axis in self.axes), default=np.nan)

    @property
    def settling(self) -> float | None:
        """Time after which every axis stays within 5 % of its steady value, s; None if one does not."""
        times = [axis.settling_time for axis in self.axes]
        return None if not times or any(t is None for t in times) else max(t for t in times if t is not None)


def scenario(
    force: float, stiffness: float, model: Model, kinematics: Literal["nonlinear", "linear"], duration: float
) -> dict[str, Any]:
    """Return the scenario of a run; force in N, stiffness in N/mm, duration in s."""
    return {
        "title": f"{force:g} N on {stiffness:g} N/mm",
        "device": {"name": "phantom-premium-1.5a", "model": model, "kinematics": kinematics},
        "start": {"pose": [f"{angle} rad" for angle in POSE]},
        "servo": {"period": f"{PERIOD * 1e3:g} ms", "topology": "force_tracking"},
        "reference": {"shape": "step", "force": [f"{force} N"] * 3},
        "object": {"kind": "spring", "stiffness": f"{stiffness} N/mm"},
        "run": {"duration": f"{duration} s"},
    }


def respond(
    controller: Tracking,
    *,
    force: float = 8.5,
    stiffness: float = 3.5,
    model: Model = "nonlinear",
    kinematics: Literal["nonlinear", "linear"] = "nonlinear",
    duration: float = 1.0,
) -> Loop:
    """Run a controller on a device model; N, N/mm, s."""
    trace = simulate(scenario(force, stiffness, model, kinematics, duration), controller=controller)
    return loop_of(trace, force, stiffness)


def loop_of(trace: Trace, force: float, stiffness: float) -> Loop:
    """Return the step responses of a trace with `force`, N, on `stiffness`, N/mm."""
    deflection = trace["deflection"] * 1e3
    axes: tuple[StepResponse, ...] = ()
    if trace.completed:
        ideal = force / stiffness
        axes = tuple(step_response(trace.time, deflection[:, i], expected=ideal) for i in range(3))
    return Loop(force, stiffness, trace.time, deflection, axes, trace.unstable_from)


def respond_case(
    case: Literal["A", "B", "C", "D"], controller: Tracking, *, force: float, stiffness: float, duration: float
) -> Loop:
    """Run a controller on the models of a case; N, N/mm, s."""
    chosen = CASES[case]
    return respond(
        controller,
        force=force,
        stiffness=stiffness,
        model=chosen.model,
        kinematics=chosen.kinematics,
        duration=duration,
    )
