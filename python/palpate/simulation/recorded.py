"""A trace as its judge sees it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from palpate.arrays import Array
from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.simulation.support_phase import support_phase

__all__ = [
    "OneOfScene",
    "Recorded",
    "each_recorded",
    "external_forces",
    "held_tip",
    "of_each_object",
    "recorded_scenario",
    "without_trend",
]


class Recorded(Protocol):
    """Trace as the judge sees it: time (n,), s, channels by name, time of divergence, s, and metadata."""

    @property
    def time(self) -> Array:
        """Times (n,), s."""
        ...

    @property
    def unstable_from(self) -> float | None:
        """Time of divergence, s."""
        ...

    @property
    def metadata(self) -> dict[str, Any]:
        """Scenario and controller."""
        ...

    def __getitem__(self, name: str) -> Array: ...
    def __contains__(self, name: object) -> bool: ...


def recorded_scenario(trace: Recorded) -> Scenario | None:
    """Return the scenario of a trace; None if it is missing or cannot be read."""
    try:
        return Scenario.from_dict(trace.metadata["scenario"]) if trace.metadata.get("scenario") else None
    except PalpateError:
        return None  # written by another version, or its device file is missing


@dataclass(frozen=True)
class OneOfScene:
    """Trace of a scene as that of one of its objects, which has the channels of that name."""

    trace: Recorded
    name: str
    metadata: dict[str, Any]

    @property
    def time(self) -> Array:
        """Times (n,), s."""
        return self.trace.time

    @property
    def unstable_from(self) -> float | None:
        """Time of divergence, s."""
        return self.trace.unstable_from

    def __getitem__(self, channel: str) -> Array:
        own = f"{self.name}_{channel}"
        return self.trace[own if own in self.trace else channel]

    def __contains__(self, channel: object) -> bool:
        return f"{self.name}_{channel}" in self.trace or channel in self.trace


def each_recorded(trace: Recorded) -> list[Recorded]:
    """Return the trace, or that of a scene once for each of its objects, as if there were no other."""
    scenario = recorded_scenario(trace)
    if scenario is None or scenario.objects is None:
        return [trace]
    return [
        OneOfScene(trace, name, {**trace.metadata, "scenario": one.to_dict()})
        for name, one in scenario.each_object.items()
    ]


def held_tip(trace: Recorded) -> Array:
    """Return the position of the tip that the operator holds (n, 3), m: behind the flexible mode, if there is one."""
    return trace["tip"] + trace["tip_offset"] if "tip_offset" in trace else trace["tip"]


def without_trend(motion: Array) -> Array:
    """Return positions at even times (n, k) less their quadratic trend: the oscillation, in the unit of `motion`."""
    basis = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, len(motion)), 3))[0]
    return np.asarray(motion - basis @ (basis.T @ motion))


def of_each_object(trace: Recorded, channel: str) -> list[Array]:
    """Return a channel of the object, or of each of several objects that have it (n, k); [] if none has."""
    scenario = trace.metadata.get("scenario") or {}
    names = [channel, *(f"{name}_{channel}" for name in scenario.get("objects") or {})]
    return [trace[name] for name in names if name in trace]


def external_forces(trace: Recorded, scenario: Scenario | None) -> Array:
    """Return what acts on a run from outside (n, 7): forces of reference and operator, N, and changes of supports.

    A motion of the operator, m, stands in place of its force. The last column is the number of changes of the supports
    of the bodies so far.
    """
    reference = trace["reference_force"] if "reference_force" in trace else np.zeros((len(trace.time), 3))
    operator = np.zeros_like(reference)
    if scenario is not None and scenario.operator.moves:
        operator = scenario.operator.values(trace.time)
    phase = np.zeros(len(trace.time)) if scenario is None else support_phase(scenario, trace.time)
    return np.hstack([reference, operator, phase[:, None]])
