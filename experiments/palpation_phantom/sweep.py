"""Sweep over the palpation phantom: stiffness along the path, and detectability of the nodule."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from palpate.arrays import Array
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

LENGTH: Final = 64e-3  # m
SPEED: Final = 20e-3  # m/s
FROM: Final = 1.0  # begin of the motion, s
AWAY: Final = (20e-3, 28e-3)  # distance from the center that counts as beside the nodule, m


@dataclass(frozen=True)
class StiffnessProfile:
    """Stiffness along a sweep, force over deflection.

    Attributes:
        position: of the tip along the path, from its center (n,), m.
        stiffness: (n,), N/m.
        over: maximum within the radius of the nodule from the center, N/m.
        beside: median at 20 to 28 mm from the center, N/m.
    """

    position: Array
    stiffness: Array
    over: float
    beside: float

    @property
    def contrast(self) -> float:
        """Relative increase of the stiffness over the nodule against that beside it."""
        return self.over / self.beside - 1.0


@dataclass(frozen=True)
class PalpationSweep:
    """Sweep over a phantom with the nodule and without.

    Attributes:
        title: description of the phantom.
        trace: with the nodule.
        with_nodule, without_nodule: stiffness along the path with the nodule and without.
    """

    title: str
    trace: Trace
    with_nodule: StiffnessProfile
    without_nodule: StiffnessProfile

    @property
    def contrast(self) -> float:
        """Relative increase of the stiffness at the center due to the nodule."""
        return self.with_nodule.over / self.without_nodule.over - 1.0

    @property
    def detectable(self) -> bool:
        """Whether the contrast exceeds the just-noticeable difference."""
        return self.contrast > JND

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
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
    """Sweep over a phantom with a nodule and over one without.

    Both phantoms are stored in the cache of bodies of scenarios.

    Args:
        contrast: modulus of the nodule over that of the block.
        depth: of the top of the nodule below the top of the block, m or text.
        spacing: of the cells, m or text.
        progress: called with a description and the fraction done while the phantoms are built.

    Raises:
        ScenarioError: the phantom cannot be built.
    """
    deep, stiff = to_si(depth, "m", "depth"), to_si(contrast, "", "contrast")
    cells = write(to_si(spacing, "m", "spacing"), "m")
    body = {"shape": "phantom", "depth": write(deep, "m"), "spacing": cells, "radius": "8 mm", "tip": "flat"}
    traces = []
    for times in (stiff, 1.0):
        scenario = Scenario.from_dict(sweep_scenario({**body, "contrast": times}))
        scenario_body(scenario, progress)
        traces.append(simulate(scenario))
    with_nodule, without_nodule = (stiffness_profile(trace) for trace in traces)
    title = f"Nodule of {stiff:g} times the stiffness at a depth of {1e3 * deep:g} mm"
    return PalpationSweep(title, traces[0], with_nodule, without_nodule)


def sweep_scenario(
    body: dict[str, Any], *, press: float | str = 0.6, law: str = "LQG", title: str = ""
) -> dict[str, Any]:
    """Return the scenario of a constant force and a sweep along x over the center of a body.

    Args:
        body: [object.body], with the origin at the center of the top.
        press: force along -z, N or text, that the controller tracks.
        law: "lead–lag" or "LQG".
        title: of the scenario.

    Raises:
        ScenarioError: the law is unknown, or the force cannot be read.
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
    """Return the stiffness along the sweep of a trace.

    Args:
        trace: of a `sweep_scenario`.
        nodule: radius of the nodule, m or text.

    Raises:
        ScenarioError: the tip has no contact over the nodule or beside it.
    """
    radius = to_si(nodule, "m", "nodule")
    moving = (trace.time > FROM + 0.2) & (trace["touching"][:, 0] > 0.0)
    position = trace["tip"][moving, 0] - trace["tip"][0, 0]
    deflection = np.linalg.norm(trace["deflection"][moving], axis=1)
    stiffness = np.linalg.norm(trace["object_force"][moving], axis=1) / deflection
    over, beside = np.abs(position) < radius, (np.abs(position) > AWAY[0]) & (np.abs(position) < AWAY[1])
    if not (over.any() and beside.any()):
        raise ScenarioError(
            f"trace: the tip has no contact within {1e3 * radius:g} mm of the center of the sweep, or at "
            f"{1e3 * AWAY[0]:g} to {1e3 * AWAY[1]:g} mm from it: give the trace of a sweep over a phantom"
        )
    return StiffnessProfile(
        position,
        stiffness,
        over=float(stiffness[over].max()),
        beside=float(np.median(stiffness[beside])),
    )
