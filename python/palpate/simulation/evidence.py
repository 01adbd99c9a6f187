"""Evidence of recorded runs: windows of constant force, oscillation, steady error, reach, and the linear loop."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.arrays import Array
from palpate.control.feedback_loop import spectral_radius
from palpate.devices import Device
from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.verdict import BAND, Evidence

__all__ = [
    "Recorded",
    "Window",
    "beyond_reach",
    "conditioning",
    "constant_from",
    "evidence",
    "expected_deflection",
    "linear_radius",
    "linear_sign",
    "recorded_scenario",
    "resolution",
    "windows",
]

LEAST_WINDOW = 0.05  # fraction of a run over which the external force must be constant at its end
LEAST_PLATEAU = 0.1  # the same for a stretch before
LEAST_SAMPLES = 50  # samples of either
AT_REST = 5e-3  # m/s: largest speed of a tip at rest
AT_LIMIT = 1e-9  # distance of a spectral radius from 1 within which the linear loop is at its limit
NEAR_SINGULAR = 0.05  # ratio of the smallest to the largest singular value of the Jacobian near a singular pose
SINGULAR = 0.005  # ratio of the smallest to the largest singular value of the Jacobian of a singular pose


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


@dataclass(frozen=True)
class Window:
    """Rows `begin` to `end`, both included, of a trace; `constant`: the external force is constant in them."""

    begin: int
    end: int
    constant: bool = True

    @property
    def fifth(self) -> int:
        """Number of rows of a fifth of the window."""
        return (self.end - self.begin) // 5

    @property
    def ending(self) -> slice:
        """Rows of the last fifth."""
        return slice(self.end - max(self.fifth, 1) + 1, self.end + 1)


def constant_from(reference: ArrayLike, operator: ArrayLike) -> int:
    """Return the first sample from which the external forces (n, 3), N, stay constant."""
    forces = np.hstack([np.atleast_2d(reference), np.atleast_2d(operator)])
    changes = np.flatnonzero(np.any(forces[1:] != forces[:-1], axis=1))
    return int(changes[-1]) + 1 if len(changes) else 0


def expected_deflection(scenario: Scenario | None) -> list[float | None]:
    """Return force over stiffness per axis, m, for a constant reference force; None for other axes."""
    if scenario is None or scenario.reference is None or scenario.object.kind != "spring":
        return [None, None, None]
    reference, stiffness = scenario.reference, scenario.object.stiffness
    if reference.shape not in ("step", "ramp") or reference.stop is not None or reference.force is None:
        return [None, None, None]
    assert stiffness is not None  # a spring has one
    dof = scenario.load_device().dof
    return [
        force / k if k > 0.0 and axis < dof else None
        for axis, (force, k) in enumerate(zip(reference.force, stiffness, strict=True))
    ]


def linear_sign(radius: float) -> int:
    """Return +1 for a stable spectral radius, -1 for an unstable one, 0 at the limit."""
    return 0 if abs(radius - 1.0) < AT_LIMIT else 1 if radius < 1.0 else -1


def resolution(scenario: Scenario, device: Device, angles: ArrayLike) -> Array:
    """Return the tip displacement of two encoder counts at `angles` (n, dof): (n,), m; 0 without encoders."""
    q = np.atleast_2d(angles)
    if not scenario.device.encoder:
        return np.zeros(len(q))
    jacobian = np.reshape(device.jacobian(q), (len(q), 3, device.dof))
    return np.asarray(2.0 * np.linalg.norm(np.abs(jacobian) @ device.encoder_step, axis=1), dtype=float)


def beyond_reach(device: Device, start: ArrayLike, angles: ArrayLike) -> NDArray[np.bool_]:
    """Return whether each of `angles` (n, dof) is beyond reach (n,).

    Beyond reach are a joint outside its limits, one that has turned round since `start` (dof,), and a pose that is
    singular to SINGULAR while the start was not.
    """
    q, first = np.atleast_2d(angles), np.asarray(start, dtype=float)
    low, high = device.joint_limits
    found = np.any((q < low) | (q > high), axis=1)
    if device.model.revolute:
        found |= np.any(np.abs(q - first) > 2.0 * np.pi, axis=1)
    if conditioning(device, first[None])[0] > SINGULAR:
        found |= conditioning(device, q) < SINGULAR
    return np.asarray(found, dtype=bool)


def conditioning(device: Device, angles: Array) -> Array:
    """Return the ratio of the smallest to the largest singular value of the Jacobian at `angles` (n, dof): (n,)."""
    jacobian = np.reshape(device.jacobian(angles), (len(angles), 3, device.dof))
    values = np.linalg.svd(jacobian, compute_uv=False)
    return np.asarray(values[:, -1] / np.maximum(values[:, 0], 1e-300), dtype=float)


def recorded_scenario(trace: Recorded) -> Scenario | None:
    """Return the scenario of a trace; None if it is missing or cannot be read."""
    try:
        return Scenario.from_dict(trace.metadata["scenario"]) if trace.metadata.get("scenario") else None
    except PalpateError:
        return None  # written by another version, or its device file is missing


def linear_radius(trace: Recorded, scenario: Scenario | None) -> float | None:
    """Return the larger spectral radius of the linear loop at start and rest; None if it is unknown."""
    own: Mapping[str, Any] = trace.metadata.get("controller", {})
    if (
        scenario is None
        or own.get("given")
        or own.get("kind") == "python"
        or "object" in trace.metadata
        or scenario.object.kind not in ("spring", "wall")
    ):
        return None
    try:
        radii = [_radius(scenario_loop(scenario))]
        if trace.unstable_from is None and (pose := _rest(trace, scenario)) is not None:
            radii.append(_radius(pose))
    except PalpateError:
        return None
    return max(radii)


def _radius(loop: ScenarioLoop) -> float:
    return spectral_radius(loop.gain())


def _rest(trace: Recorded, scenario: Scenario) -> ScenarioLoop | None:
    """Return the linear loop where the run came to rest; None if it did not."""
    if scenario.device.model != "nonlinear" or len(trace.time) < 20:
        return None
    if scenario.object.kind == "wall" and not trace["touching"][-1, 0]:
        return None
    speed = np.abs(np.diff(trace["tip"][-20:], axis=0) / np.diff(trace.time[-20:])[:, None]).max()
    if speed > AT_REST:
        return None
    force, operator = trace["command_force"][-1], trace["operator_force"][-1]
    return scenario_loop(scenario, pose=trace["angle"][-1], tip_force=force, operator_force=operator)


def windows(trace: Recorded, scenario: Scenario | None) -> list[Window]:
    """Return the windows in which a run is judged; the last one ends the run."""
    reference = trace["reference_force"] if "reference_force" in trace else np.zeros((len(trace.time), 3))
    operator = np.zeros_like(reference)
    if scenario is not None and scenario.operator.moves:
        operator = scenario.operator.values(trace.time)
    forces, count = np.hstack([reference, operator]), len(trace.time)
    edges = np.concatenate([[0], np.flatnonzero(np.any(forces[1:] != forces[:-1], axis=1)) + 1, [count]])
    least = max(LEAST_SAMPLES, LEAST_PLATEAU * count)
    found = [Window(int(a), int(b) - 1) for a, b in pairwise(edges[:-1]) if b - a >= least]
    if count - edges[-2] >= max(LEAST_SAMPLES, LEAST_WINDOW * count):
        return [*found, Window(int(edges[-2]), count - 1)]
    return [*found, Window(0, count - 1, False)]


def evidence(trace: Recorded, scenario: Scenario | None, window: Window, radius: float | None) -> Evidence:
    """Return the evidence of one run in one window, as a batch measures it; `radius` is that of the linear loop."""
    first, last, fifth, ending = window.begin, window.end, window.fifth, window.ending
    before = slice(ending.start - max(fifth, 1), ending.start)
    tip, every = trace["tip"], 1 if scenario is None else scenario.run.record_every
    bend = np.zeros(len(tip))
    rate = np.diff(trace.time)
    velocity = np.diff(tip, axis=0) / (rate / np.median(rate))[:, None]
    bend[2:] = np.linalg.norm(np.diff(velocity, axis=0), axis=1)

    def largest(begin: int, end: int) -> float:
        return float(bend[begin + 1 : end + 1].max(initial=0.0))

    deflection = trace["deflection"] if "deflection" in trace else tip - tip[0]
    touching = trace["touching"][:, 0] > 0.0
    command, force = trace["command_force"][ending], np.linalg.norm(trace["object_force"], axis=1).max()
    half = max(len(command) // 2, 1)
    drift = np.linalg.norm(command[half:].mean(axis=0) - command[:half].mean(axis=0)) if len(command) > 1 else 0.0
    known: dict[str, Any] = {}
    if scenario is not None:
        device = scenario.load_device()
        q = trace["angle"]
        known = {
            "resolution": resolution(scenario, device, q[last : last + 1])[0],
            "beyond": bool(beyond_reach(device, q[0], q[first : last + 1]).any()),
            "error": _error(scenario, deflection[ending]),
            "pressed": scenario.object.kind in ("wall", "mesh", "body") and _pressed(trace, scenario, touching, last),
            "apart": _apart(trace, touching) if scenario.object.kind in ("wall", "mesh", "body") else 0.0,
            "lossy": scenario.device.encoder or scenario.device.saturation or bool(np.any(device.coulomb)),
        }
    return Evidence.of(
        1,
        unstable_from=np.nan,
        early=largest(first + fifth, first + 2 * fifth),
        prior=largest(last - 2 * fifth, last - fifth),
        late=largest(last - fifth, last),
        ripple=float(np.ptp(tip[ending], axis=0).max(initial=0.0)) / 2.0,
        ripple_before=float(np.ptp(tip[before], axis=0).max(initial=0.0)) / 2.0,
        swing=swing(trace.time[ending], tip[ending]),
        swing_before=swing(trace.time[before], tip[before]),
        deflection=float(np.linalg.norm(deflection[ending].mean(axis=0))),
        drift=drift / max(force, 1e-12) if scenario is not None and scenario.reference is not None else np.nan,
        touching=float(touching[ending].mean()),
        contacts=float(np.count_nonzero(touching[ending] & ~touching[last - fifth : last])),
        saturated=float(trace["saturated"][ending].mean()),
        constant=window.constant,
        linear=0 if radius is None else linear_sign(radius),
        decay=np.nan if radius is None else radius ** (fifth * every),
        **known,
    )


def swing(time: Array, tip: Array) -> float:
    """Return half the range of the tip (n, 3) without its quadratic trend in time (n,), m, largest of the axes."""
    if len(time) < 8:
        return float(np.ptp(tip, axis=0).max(initial=0.0)) / 2.0
    x = np.linspace(-1.0, 1.0, len(time))
    basis = np.linalg.qr(np.vander(x, 3))[0]
    return float(np.ptp(tip - basis @ (basis.T @ tip), axis=0).max()) / 2.0


def _error(scenario: Scenario, deflection: Array) -> float:
    """Return the largest relative error of the steady deflection over the driven axes; nan if it is unknown."""
    expected = [np.nan if value is None else value for value in expected_deflection(scenario)]
    size = np.abs(expected)
    driven = size > BAND * np.nanmax(size, initial=0.0)
    if not driven.any():
        return np.nan
    steady = deflection.mean(axis=0)
    return float(np.max(np.abs(steady[driven] / np.asarray(expected)[driven] - 1.0)))


def _apart(trace: Recorded, touching: NDArray[np.bool_]) -> float:
    """Return the fraction of the run since the first contact in which a pressed tip is off its object.

    The normal is that of the last contact before.
    """
    if not touching.any():
        return 0.0
    rows = np.arange(len(touching))
    last = np.maximum.accumulate(np.where(touching, rows, -1))
    load, contact = trace["reference_force"] + trace["operator_force"], trace["object_force"][np.maximum(last, 0)]
    force = np.linalg.norm(load, axis=1)
    pressed = np.sum(load * contact, axis=1) > BAND * force * np.linalg.norm(contact, axis=1)
    pressed &= force > BAND * force.max()
    since = last >= 0
    return float(np.count_nonzero(since & ~touching & pressed) / np.count_nonzero(since))


def _pressed(trace: Recorded, scenario: Scenario, touching: NDArray[np.bool_], last: int) -> bool:
    """Return whether the force at the end presses the tip against the object, as far as the run shows its normal."""
    load = trace["reference_force"][last] + trace["operator_force"][last]
    if scenario.object.normal is not None:
        outward = np.array(scenario.object.normal)
    elif touching[: last + 1].any():
        outward = -trace["object_force"][np.flatnonzero(touching[: last + 1])[-1]]
    else:
        return bool(np.any(load != 0.0))
    return bool(load @ outward < -BAND * np.linalg.norm(load) * np.linalg.norm(outward))
