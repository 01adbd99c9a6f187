"""The whole surface of a body as a running loop presses it, for drawing: by a thread that the servo never waits for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from palpate import _core
from palpate.fem.errors import BodyError
from palpate.simulation.bodies import scenario_body
from palpate.simulation.simulator import Simulation


class Frame(NamedTuple):
    """One frame."""

    number: int  # how many there could have been so far; 0: none yet
    tick: int  # of the servo, that it shows; -1: none yet
    displacement: NDArray[np.float64]  # of the body's nodes, in its own frame (n, 3), m


class SurfaceFrames:
    """Displacement of a body's nodes while a loop runs. The loop's result is the same, bit for bit, with and without.

    Of a linear kind: under the forces of the servo's latest tick held for long, `rate` times a second. The servo
    copies the pressed nodes and their forces to where a thread fetches them; neither waits for the other.
    Under large displacements: as each slow step left them, with the tip where the servo had it as that step began.
    For one loop at a time.
    """

    def __init__(self, experiment: Simulation, rate: float = 60.0) -> None:
        """Draw the body of an experiment whenever it runs, `rate` Hz of real time (or with each slow step).

        Raises:
            BodyError: the experiment has no body, or the rate is not positive.
        """
        if experiment.scenario.object.body is None:
            raise BodyError("there is no body to draw: the scenario's object is none")
        if not 0.0 < rate < np.inf:
            raise BodyError(f"frames come at a positive rate in Hz, not {rate:g}")
        body = scenario_body(experiment.scenario)
        self._core: _core.DeformationFrames | _core.SurfaceFrames
        self._shares: sparse.csr_matrix | None = None
        if isinstance(body.core, _core.HyperelasticBody):
            self._shares = body.patch_weights
            self._core = _core.DeformationFrames(self._shares.shape[1])
        else:
            self._core = _core.SurfaceFrames(np.ascontiguousarray(body.compliance), rate)
        experiment.setup.watch(self._core)

    def latest(self) -> Frame:
        """Return the last frame; all zeros before the first. Never waits."""
        number, tick, displacement = self._core.latest()
        return Frame(number, tick, displacement if self._shares is None else self._shares @ displacement)
