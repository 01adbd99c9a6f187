"""A sweep over the palpation phantom: the stiffness felt along the way, and whether the nodule can be told."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from palpate.errors import ScenarioError
from palpate.metrics.body_contact import JND
from palpate.scenario import Scenario
from palpate.scenario.operators import OPERATOR_STIFFNESS, default_operator
from palpate.simulation.bodies import scenario_body
from palpate.simulation.simulator import simulate
from palpate.simulation.trace import Trace
from palpate.units import to_si, write

from experiments.palpation_phantom.stiffnesses import PERIOD, POSE, controller_of

__all__ = ["AWAY", "JND", "PalpationSweep", "StiffnessProfile", "stiffness_profile", "sweep_phantom", "sweep_scenario"]

Array = NDArray[np.float64]
LENGTH: Final = 64e-3  # m
SPEED: Final = 20e-3  # m/s
FROM: Final = 1.0  # s until the way begins
AWAY: Final = (20e-3, 28e-3)  # m from the middle: where the way counts as beside the nodule


@dataclass(frozen=True)
class StiffnessProfile:
    """The stiffness that the tip meets along a sweep, force over deflection.

    Attributes:
        place: of the tip along the way, m from its middle (n,).
        stiffness: N/m (n,).
        over: largest within the nodule's radius of the middle, N/m; beside: median 20 to 28 mm away, N/m.
    """

    place: Array
    stiffness: Array
    over: float
    beside: float

    @property
    def contrast(self) -> float:
        """How much stiffer the nodule feels than what lies beside it."""
        return self.over / self.beside - 1.0


@dataclass(frozen=True)
class PalpationSweep:
    """The same sweep over a phantom with its nodule and without.

    Attributes:
        title: which phantom.
        trace: over the nodule.
        with_nodule, without_nodule: stiffness along the path with the nodule and without.
    """

    title: str
    trace: Trace
    with_nodule: StiffnessProfile
    without_nodule: StiffnessProfile

    @property
    def contrast(self) -> float:
        """How much stiffer the middle feels for the nodule: over the phantom without it at the same place."""
        return self.with_nodule.over / self.without_nodule.over - 1.0

    @property
    def detectable(self) -> bool:
        """Whether the contrast exceeds the just-noticeable difference."""
        return self.contrast > JND

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON holds."""
        return {
            "phantom": self.title,
            "over_nodule_N_per_m": self.with_nodule.over,
            "beside_nodule_N_per_m": self.with_nodule.beside,
            "without_nodule_N_per_m": self.without_nodule.over,
            "contrast": self.contrast,
            "contrast_along_sweep": self.with_nodule.contrast,
            "just_noticeable": JND,
            "detectable": self.detectable,
        }


def sweep_phantom(
    *,
    contrast: float | str = 5.0,
    depth: float | str = "5 mm",
    spacing: float | str = "5 mm",
    progress: Callable[[str, float], None] | None = None,
) -> PalpationSweep:
    """Sweep over the phantom with a nodule `contrast` times as stiff, its top `depth` deep, and over one without.

    `depth` and the `spacing` of its cells in m, or text. Both are kept where scenarios keep bodies
    (`palpate.simulation.bodies.kept_at`); `progress` hears of their making.

    Raises:
        ScenarioError: such a phantom cannot be made.
    """
    deep, stiff = to_si(depth, "m", "depth"), to_si(contrast, "", "contrast")
    cells = write(to_si(spacing, "m", "spacing"), "m")
    body = {"shape": "phantom", "depth": write(deep, "m"), "spacing": cells, "radius": "8 mm", "tip": "flat"}
    traces = []
    for times in (stiff, 1.0):
        scenario = Scenario.from_dict(sweep_scenario({**body, "contrast": times}))
        scenario_body(scenario, progress)
        traces.append(simulate(scenario))
    lump, plain = (stiffness_profile(trace) for trace in traces)
    return PalpationSweep(f"A nodule {stiff:g} times as stiff, {1e3 * deep:g} mm deep", traces[0], lump, plain)


def sweep_scenario(
    body: dict[str, Any], *, press: float | str = 0.6, law: str = "LQG", title: str = ""
) -> dict[str, Any]:
    """Return a press of `press` and a sweep along x over the middle of a body, as their file would have it.

    Args:
        body: [object.body]: a phantom or a file, its origin in the middle of its top.
        press: along -z, N or text, held by the controller.
        law: "lead–lag" or "LQG".
        title: of the scenario.

    Raises:
        ScenarioError: the law is unknown, or the press cannot be read.
    """
    controller, force = controller_of(law), to_si(press, "N", "press")
    end = FROM + LENGTH / SPEED
    lead = OPERATOR_STIFFNESS * LENGTH
    return {
        "title": title or "A sweep over the phantom",
        "device": {"name": "phantom-premium-1.5a", "saturation": True},
        "start": {"pose": list(POSE)},
        "servo": {"period": PERIOD, "topology": "force_tracking"},
        "reference": {"shape": "ramp", "rise": "0.3 s", "force": ["0 N", "0 N", f"{-force:g} N"]},
        "operator": default_operator(
            [
                ["0 s", "0 N", "0 N", "0 N"],
                [f"{FROM:g} s", "0 N", "0 N", "0 N"],
                [f"{end:g} s", f"{lead:g} N", "0 N", "0 N"],
            ],
            rest=[f"{-LENGTH / 2:g} m", "0 m", "0 m"],
        ),
        "object": {"kind": "body", "position": ["0 mm", "0 mm", "-0.2 mm"], "body": body},
        "controller": controller,
        "run": {"duration": f"{end + 0.6:g} s"},
    }


def stiffness_profile(trace: Trace, nodule: float | str = "7.5 mm") -> StiffnessProfile:
    """Return the stiffness felt along the sweep of a trace; `nodule` is the radius of what is looked for, m or text.

    Raises:
        ScenarioError: the trace is not that of such a sweep: the tip does not touch both over the nodule and beside it.
    """
    radius = to_si(nodule, "m", "nodule")
    moving = (trace.time > FROM + 0.2) & (trace["touching"][:, 0] > 0.0)
    place = trace["tip"][moving, 0] - trace["tip"][0, 0]
    deflection = np.linalg.norm(trace["deflection"][moving], axis=1)
    stiffness = np.linalg.norm(trace["object_force"][moving], axis=1) / deflection
    near, away = np.abs(place) < radius, (np.abs(place) > AWAY[0]) & (np.abs(place) < AWAY[1])
    if not (near.any() and away.any()):
        raise ScenarioError(
            f"the tip touches nothing within {1e3 * radius:g} mm of the middle of the sweep, or "
            f"{1e3 * AWAY[0]:g} to {1e3 * AWAY[1]:g} mm beside it: this is no sweep over a phantom"
        )
    return StiffnessProfile(
        place,
        stiffness,
        over=float(stiffness[near].max()),
        beside=float(np.median(stiffness[away])),
    )
