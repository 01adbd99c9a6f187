"""A deformable body that the tips of several devices touch."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Final

import numpy as np

from palpate import _core
from palpate.arrays import Array
from palpate.checks import MAX_TIPS, close_pair
from palpate.errors import ScenarioError
from palpate.fem import Body
from palpate.scenario import Scenario
from palpate.scenario.body import BodyChoice
from palpate.simulation.bodies import place_body
from palpate.simulation.meshes import sensed_tip

__all__ = ["SharedBody"]

_OWN: Final = ("origin", "rotation", "radius")  # keys of [object.body] that differ between the devices


class SharedBody:
    """A body with contact by signed distance, and the tips of several devices on it.

    Positions and forces are those of each device's frame.

    Attributes:
        scenarios: of the devices; their bodies are the same but for the pose and the radius of the tip.
        core: the body with one tip for each device, at rest.
        body: the body in its own frame.
        origins: of the body's frame in each device's frame (k, 3), m.
        rotations: body frame to each device's frame (k, 3, 3).
        radii: of the tips (k,), m.
    """

    def __init__(self, scenarios: Sequence[Scenario]) -> None:
        """Read and place the body.

        Raises:
            ScenarioError: there are fewer than two or more than eight devices, their bodies or servo periods differ,
                or a scenario has a part that a shared body does not take.
        """
        if not 2 <= len(scenarios) <= MAX_TIPS:
            raise ScenarioError(f"{len(scenarios)} scenarios; 2 to {MAX_TIPS} devices share a body")
        self.scenarios = tuple(scenarios)
        choices = [_checked(scenario) for scenario in scenarios]
        for scenario, choice in zip(scenarios[1:], choices[1:], strict=True):
            _check_same(scenarios[0], choices[0], scenario, choice)
        placed, starts = [], []
        for scenario in scenarios:
            device = scenario.load_device()
            tip = scenario.start.tip
            start = np.array(scenario.start.pose) if tip is None else device.inverse(tip)
            starts.append(sensed_tip(scenario, device, start))
            placed.append(place_body(scenario, starts[-1] + np.array(scenario.object.position)))
        self.body: Body = placed[0][0]
        self.core: _core.SignedDistanceBody = self.body._signed_distance_core(len(scenarios))
        self.origins = np.array([origin for _, origin, _ in placed])
        self.rotations = np.array([turn for _, _, turn in placed])
        self.radii = np.array([choice.radius for choice in choices])
        if same := close_pair(self.in_body(np.array([starts]))[0].tolist()):
            mistake = f"tips {same[0]} and {same[1]} start in the same place of the body: move one of them"
            raise scenarios[same[1] - 1].mistake("object.body.origin", mistake)

    @property
    def friction(self) -> bool:
        """Whether the body has dry friction."""
        return self.body.kind.friction[0] > 0.0

    def step(self, tips: Array) -> Array:
        """Move all tips, one period for each row, and return the core's rows (m, k, 15), body frame.

        Args:
            tips: centers of the tips, each in its device's frame (m, k, 3), m.
        """
        k = len(self.radii)
        centers = self.in_body(tips)
        axes = np.tile([0.0, 0.0, 1.0], (k, 1))
        return np.asarray(self.core.simulate_tips(np.ascontiguousarray(centers), axes, self.radii, np.zeros(k)))

    def in_body(self, tips: Array) -> Array:
        """Return the centers of tips (m, k, 3), m, each in its device's frame, in the frame of the body."""
        return np.asarray(np.einsum("kji,mkj->mki", self.rotations, tips - self.origins))

    def pressed(self, tips: Array) -> tuple[Array, Array]:
        """Return displacement (n, 3), m, and pressure (n,), Pa, of the nodes after a path of all tips from rest.

        Args:
            tips: centers of the tips, each in its device's frame (m, k, 3), m.
        """
        self.core.reset()
        self.step(tips)
        body = copy(self.body)
        body.core = self.core
        return body.displacement(), body.pressure()

    def forces(self, rows: Array) -> Array:
        """Return the forces of the tips on the body (m, k, 3), N, each in its device's frame, from the core's rows."""
        return np.asarray(-np.einsum("kij,mkj->mki", self.rotations, rows[:, :, 0:3]))


def _checked(scenario: Scenario) -> BodyChoice:
    """Return the body of a scenario whose device may share it; raise ScenarioError for any other."""
    choice = scenario.object.body
    if scenario.objects is not None:
        raise scenario.mistake("objects", "devices share one body; write it as [object]")
    if choice is None:
        raise scenario.mistake("object.kind", 'devices share a body; write kind = "body"')
    if choice.tip != "sphere":
        raise scenario.mistake("object.body.tip", "a shared body takes spheres")
    if "signed_distance" not in (choice.kind, choice.contact):
        raise scenario.mistake(
            "object.body.kind", "a shared body has contact by signed distance; write that kind or contact"
        )
    if choice.contact_points:
        raise scenario.mistake("object.body.contact_points", "on a shared body each device has one tip")
    if choice.supports is not None:
        raise scenario.mistake("object.body.supports", "the supports of a shared body do not change; write held")
    if scenario.object.frame is not None:
        raise scenario.mistake("object.frame", "a shared body rests")
    if scenario.servo.tool is not None:
        raise scenario.mistake("servo.topology", "an admittance display does not share a body")
    if scenario.servo.jitter > 0.0:
        raise scenario.mistake("servo.jitter", "devices on a shared body are sampled together, on time")
    if scenario.guard.kind == "half_sample":
        raise scenario.mistake(
            "guard.kind", "half_sample moves the tip of one device, which a shared body does not take"
        )
    return choice


def _check_same(first: Scenario, choice: BodyChoice, scenario: Scenario, other: BodyChoice) -> None:
    if scenario.period != first.period:
        raise scenario.mistake("servo.period", f"devices that share a body have one period, {1e3 * first.period:g} ms")
    tables = [{**dict(body), **body.options} for body in (choice, other)]
    for key in [*BodyChoice.model_fields, *choice.options, *other.options]:
        if key not in (*_OWN, "options") and tables[0].get(key) != tables[1].get(key):
            raise scenario.mistake(
                f"object.body.{key}",
                f"differs from that of {first.source or first.title}; devices share one body, placed in each frame",
            )
