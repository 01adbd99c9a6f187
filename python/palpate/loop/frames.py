"""The whole surface of a body as a running loop presses it, for drawing: by a thread that the servo never waits for."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.bodies.errors import BodyError
from palpate.loop.body import scenario_body

if TYPE_CHECKING:
    from palpate.loop.simulate import Experiment

__all__ = ["Frame", "SurfaceFrames"]


class Frame(NamedTuple):
    """One frame."""

    number: int  # how many the thread could have made so far; 0: none yet
    tick: int  # of the servo, that it shows; -1: none yet
    displacement: NDArray[np.float64]  # of the body's nodes, in its own frame (n, 3), m


class SurfaceFrames:
    """Displacement of a body's nodes under the forces of the servo's latest tick held for long, `rate` times a second.

    The servo copies the pressed nodes and their forces to where a thread fetches them; neither waits for the other,
    and the loop's result is the same, bit for bit, with and without. For one loop at a time.
    """

    def __init__(self, experiment: Experiment, rate: float = 60.0) -> None:
        """Draw the body of an experiment whenever it runs, `rate` Hz of real time.

        Raises:
            BodyError: the experiment has no body, it is one under large displacements, or the rate is not positive.
        """
        if experiment.scenario.object.body is None:
            raise BodyError("there is no body to draw: the scenario's object is none")
        if not 0.0 < rate < np.inf:
            raise BodyError(f"frames come at a positive rate in Hz, not {rate:g}")
        body = scenario_body(experiment.scenario)
        if isinstance(body.core, _core.NonlinearBody):
            raise BodyError(
                "frames multiply forces by a compliance, which large displacements do not have: take a linear kind"
            )
        self._core = _core.SurfaceFrames(np.ascontiguousarray(body.compliance), rate)
        experiment.setup.watch(self._core)

    def latest(self) -> Frame:
        """Return the last frame; all zeros before the first. Never waits."""
        return Frame(*self._core.latest())
