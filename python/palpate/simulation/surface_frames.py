"""Displacement of a body's surface while a loop runs, for drawing, without delaying the servo."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from palpate import _core
from palpate.arrays import Indices
from palpate.fem.errors import BodyError
from palpate.simulation.bodies import scenario_body
from palpate.simulation.simulator import Simulation


class Frame(NamedTuple):
    """One frame."""

    number: int  # of frames so far; 0 before the first
    tick: int  # of the servo; -1 before the first
    displacement: NDArray[np.float64]  # of the body's nodes, in its own frame (n, 3), m


class SurfaceFrames:
    """Displacement of a body's nodes while one loop runs. The results of the loop are bitwise the same.

    For a linear body it is the long-term displacement under the forces of the latest tick, `rate` times per second. The
    servo copies nodes and forces to a buffer that a thread reads; neither waits for the other. For a hyperelastic body
    it is that of each model update, with the tip at the begin of the update.
    """

    def __init__(self, experiment: Simulation, rate: float = 60.0) -> None:
        """Observe the body of an experiment, at `rate`, Hz of real time, or at each model update.

        Raises:
            BodyError: the experiment has no body, or the rate is not positive.
        """
        if experiment.scenario.object.body is None:
            raise BodyError("there is no body to draw: the scenario's object is not a body")
        if not 0.0 < rate < np.inf:
            raise BodyError(f"frames come at a positive rate in Hz, not {rate:g}")
        if experiment.scenario.object.body.supports is not None:
            raise BodyError("supports: the surface of a body whose supports change cannot be drawn while a loop runs")
        body = scenario_body(experiment.scenario)
        self._core: _core.DeformationFrames | _core.SurfaceFrames
        self._vertices: Indices | None = None
        if isinstance(body.core, _core.HyperelasticBody):
            self._vertices = body.node_vertices
            self._core = _core.DeformationFrames(len(body.contents.vertices))
        else:
            self._core = _core.SurfaceFrames(np.ascontiguousarray(body.compliance), rate)
        experiment.setup.set_observer(self._core)

    def latest(self) -> Frame:
        """Return the last frame; all zeros before the first. Never waits."""
        number, tick, displacement = self._core.latest()
        return Frame(number, tick, displacement if self._vertices is None else displacement[self._vertices])
