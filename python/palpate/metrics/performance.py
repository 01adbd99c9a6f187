"""Performance of a scenario's loop: rendered stiffness, bandwidth, rate hardness and ripple."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.files import check_suffix, write_json
from palpate.linear.linear_device import HumanArm
from palpate.metrics.body_performance import body_loop_response
from palpate.metrics.device_performance import DeviceMeasures, device_measures
from palpate.metrics.hardness import rate_hardness
from palpate.metrics.loop_response import LoopResponse
from palpate.metrics.vibration import Ripple, ripple
from palpate.scenario import Scenario
from palpate.simulation.controllers import read_scenario
from palpate.simulation.linear_loop import require_linear_parts, scenario_arm
from palpate.simulation.simulator import simulate
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State

__all__ = ["DirectionalPerformance", "Performance", "measure_performance"]

Progress = Callable[[str, float], None]
JND = 0.23  # just noticeable relative difference of stiffness (Jones & Hunter 1990)
BAND = (0.5, 8.0)  # Hz, voluntary motion
_NO_MOTION = "no ripple is measured, and the frequency responses are those of no motion that lasts."
RIPPLE_WINDOW = 0.5  # s, over which ripple is measured
DEFAULT_ARM = HumanArm(0.15, 4.5, 560.0, 500.0, 0.5)  # for a scenario without operator


@dataclass(frozen=True)
class DirectionalPerformance:
    """Performance along one direction.

    Attributes:
        direction: unit vector (3,).
        frequency: (k,), Hz.
        rendered: dynamic stiffness of the loop, (k,), N/m, complex.
        desired: dynamic stiffness of the object, (k,), N/m; free: that of the device without object.
        static_stiffness: N/m; inf with an integrator that admits no steady deflection.
        band_stiffness: (smallest, largest) Re(rendered) from 0.5 to 8 Hz, N/m.
        transparency_bandwidth: frequency up to which rendered and desired stiffness differ by at most 23 %, Hz; 0:
            they differ by more at the lowest frequency, 0.1 Hz, and may agree above it.
        rate_hardness: over the first 10 ms of contact, N/m; nan unless the loop is an impedance display with a damper
            by backward difference.
        bandwidth: -3 dB frequency of the force on the operator per command, or of the object force per reference, Hz;
            inf: above half the sampling rate.
        precision: relative error of the static force: of the rendered stiffness, or of the object force per reference;
            nan: a display of an object without stiffness.
    """

    direction: tuple[float, float, float]
    frequency: Array
    rendered: NDArray[np.complex128]
    desired: NDArray[np.complex128]
    free: NDArray[np.complex128]
    static_stiffness: float
    band_stiffness: tuple[float, float]
    transparency_bandwidth: float
    rate_hardness: float
    bandwidth: float
    precision: float

    @property
    def impedance(self) -> NDArray[np.complex128]:
        """Return the rendered impedance Z(jw), force per velocity, (k,), N s/m."""
        return np.asarray(self.rendered / (2j * np.pi * self.frequency), dtype=complex)


@dataclass(frozen=True)
class Performance:
    """Performance of a scenario's loop.

    Attributes:
        title: title of the scenario.
        topology: "impedance_display" or "force_tracking".
        hold_bandwidth: -3 dB frequency of the hold alone (clamped tip), Hz.
        along: performance along each direction of the object.
        ripple: ripple of the tip in the last half second of contact; None: the run is unstable, or the contact is too
            short.
        remark: the ripple in words.
        device: measures of the device itself at that pose, as its file gives them.
        assumed_arm: arm that the force bandwidth of an impedance display assumes, as the scenario has none; else None.
    """

    title: str
    topology: str
    hold_bandwidth: float
    along: tuple[DirectionalPerformance, ...]
    ripple: Ripple | None
    remark: str
    device: DeviceMeasures
    assumed_arm: HumanArm | None = None

    @property
    def assumption(self) -> str:
        """Return the sentence about the assumed arm; "" if none is assumed."""
        a = self.assumed_arm
        if a is None:
            return ""
        tissue = ""
        if a.tissue_stiffness is not None:
            tissue = f" behind tissue of {a.tissue_stiffness:g} N/m and {a.tissue_damping:g} N s/m"
        return (
            f"The scenario has no arm; the force bandwidth assumes one of {a.mass:g} kg, {a.damping:g} N s/m and "
            f"{a.stiffness:g} N/m{tissue}."
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the numbers for JSON; values that are not finite become null."""

        def plain(value: float) -> float | None:
            return float(value) if math.isfinite(value) else None

        return {
            "title": self.title,
            "hold_bandwidth_Hz": plain(self.hold_bandwidth),
            "assumption": self.assumption or None,
            "device": {
                "peak_force_N": [plain(x) for x in self.device.peak_force],
                "continuous_force_N": [plain(x) for x in self.device.continuous_force],
                "peak_acceleration_m_per_s2": [plain(x) for x in self.device.peak_acceleration],
                "tip_mass_kg": list(self.device.tip_mass),
                "kinematic_isotropy": self.device.kinematic_isotropy,
                "inertial_isotropy": self.device.inertial_isotropy,
                "moving_force_N": list(self.device.moving_force),
                "dynamic_range_dB": plain(self.device.dynamic_range),
                "resolution_m": self.device.resolution,
            },
            "directions": [
                {
                    "direction": list(a.direction),
                    "static_stiffness_N_per_m": plain(a.static_stiffness),
                    "stiffness_0.5_to_8_Hz_N_per_m": [plain(k) for k in a.band_stiffness],
                    "transparency_bandwidth_Hz": plain(a.transparency_bandwidth),
                    "rate_hardness_N_per_m": plain(a.rate_hardness),
                    "force_bandwidth_Hz": plain(a.bandwidth),
                    "static_precision": plain(a.precision),
                    "frequency_Hz": a.frequency.tolist(),
                    "impedance_real_N_s_per_m": a.impedance.real.tolist(),
                    "impedance_imag_N_s_per_m": a.impedance.imag.tolist(),
                }
                for a in self.along
            ],
            "ripple": None
            if self.ripple is None
            else {
                "frequency_Hz": self.ripple.worst,
                "over_threshold": self.ripple.ratio,
                "perceptible": self.ripple.perceptible,
            },
            "remark": self.remark,
        }

    def save(self, path: str | Path) -> Path:
        """Write the numbers atomically as `.json` and return the path.

        Raises:
            OutputError: the suffix is not `.json`, or the file cannot be written.
        """
        return write_json(check_suffix(path, (".json",), "performance"), self.to_dict())


def measure_performance(
    scenario: Scenario | Mapping[str, Any] | str | Path, *, controller: Any = None, progress: Progress | None = None
) -> Performance:
    """Return the performance of a scenario's loop at its start, and the ripple of its run.

    With a mesh it is that where the run ends in contact, along the normal there. With a deformable body it is that
    along the normal of the contact where the run rests, with the body's own states.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        controller: in place of the scenario's: a Controller or a python-control system, as for `palpate.simulate`. A
            Python function has no linear model and is refused.
        progress: called with a text and the share done.

    Raises:
        StabilityError: the object has no stiffness, the tip does not touch the mesh or stay on the body, or the device
            model has no motion between samples.
        ScenarioError, DesignError, PoseError: as ``palpate.simulate``.
    """
    report = progress or (lambda _text, _fraction: None)
    s = read_scenario(scenario, controller)
    with s.naming_place():
        return _measure(s, report)


def _measure(s: Scenario, report: Progress) -> Performance:
    """Return the performance of a scenario's loop; errors as `measure_performance`, without their place."""
    require_linear_parts(s)
    s = s.with_every_tick()  # fewer samples alias the ripple
    trace = simulate(s) if s.object.kind == "mesh" else None
    loop: LoopResponse
    if s.object.kind == "body":
        loop = body_loop_response(s)
    else:
        loop = LoopResponse.of(s) if trace is None else LoopResponse.on_mesh(s, trace)
    report("frequency response", 0.1)
    along = tuple(_directional(loop, n, s) for n in loop.directions())
    report("simulating", 0.5)
    ripple, remark = _ripple(s, simulate(s) if trace is None else trace)
    measures = device_measures(loop.device, loop.pose)
    assumed = DEFAULT_ARM if s.servo.topology == "impedance_display" and scenario_arm(s) is None else None
    return Performance(s.title, s.servo.topology, 0.442946 / s.period, along, ripple, remark, measures, assumed)


def _directional(loop: LoopResponse, n: Array, s: Scenario) -> DirectionalPerformance:
    f = np.geomspace(0.1, 0.499 / loop.period, 400)
    rendered, free = (np.array(1 / (n @ loop.displacement(f, on) @ n), dtype=complex) for on in (True, False))
    desired = np.array(n @ loop.desired(f) @ n, dtype=complex)

    def deviation(at: Array) -> Array:
        return np.abs(1 / (n @ loop.displacement(at) @ n) / (n @ loop.desired(at) @ n) - 1)

    def felt(at: Array) -> Array:
        return np.asarray((1 / (n @ loop.displacement(at) @ n)).real, dtype=float)

    display, arm = s.servo.topology == "impedance_display", scenario_arm(s)
    transfer = loop.transmitted(f, arm or DEFAULT_ARM, n) if display else n @ loop.reference(f, arm) @ n
    gain = np.abs(transfer)
    static = _static_stiffness(loop, n)
    return DirectionalPerformance(
        (float(n[0]), float(n[1]), float(n[2])), f, rendered, desired, free,
        static,
        (_least(felt), -_least(lambda at: -felt(at))),
        _transparent_up_to(f, deviation),
        rate_hardness(loop, n) if display and loop.coupling == "backward" else float("nan"),
        _bandwidth(f, gain),
        _precision(loop, n, static if display else None, arm),
    )  # fmt: skip


def _transparent_up_to(f: Array, deviation: Callable[[Array], Array]) -> float:
    """Return the frequency up to which a deviation stays within JND, Hz, refined between the frequencies f (k,)."""
    for _ in range(3):
        beyond = deviation(f) > JND
        if not beyond.any():
            return float(f[-1])
        if beyond[0]:
            return 0.0
        first = int(np.argmax(beyond))
        f = np.geomspace(f[first - 1], f[first], 33)
    return float(f[0])


def _least(function: Callable[[Array], Array]) -> float:
    """Return the least value of a function of the frequency in BAND, by a grid that is refined about it."""
    f = np.linspace(*BAND, 600)
    for _ in range(4):
        values = function(f)
        k = int(np.argmin(values))
        f = np.linspace(f[max(k - 1, 0)], f[min(k + 1, len(f) - 1)], 33)
    return float(values[k])


def _bandwidth(f: Array, gain: Array) -> float:
    """Return the frequency at which a gain (k,) falls by 3 dB, Hz; inf if it does not. It is linear in log f (k,)."""
    level = gain[0] / np.sqrt(2)
    low = np.flatnonzero(gain < level)
    if not low.size:
        return float("inf")
    above, below = low[0] - 1, low[0]
    share = (gain[above] - level) / (gain[above] - gain[below])
    return float(f[above] * (f[below] / f[above]) ** share)


def _static_stiffness(loop: LoopResponse, n: Array) -> float:
    """Return the static stiffness, N/m; inf with an integrator that admits no steady deflection."""
    slow, slower = 1 / (n @ loop.displacement([2e-3, 1e-3]) @ n)
    return float("inf") if abs(slower) > 1.5 * abs(slow) else float(slower.real)


def _precision(loop: LoopResponse, n: Array, static: float | None, arm: HumanArm | None = None) -> float:
    """Return the relative error of a static stiffness, N/m, or of the tracked force if it is None; nan: of a damper.

    An arm holds a part of the tracked force.
    """
    if static is None:
        return abs(float((n @ loop.reference([1e-3], arm)[0] @ n).real) - 1.0)
    desired = float((n @ loop.desired(np.array([1e-3]))[0] @ n).real)
    return abs(static / desired - 1.0) if desired != 0.0 else float("nan")


def _ripple(s: Scenario, trace: Trace) -> tuple[Ripple | None, str]:
    if not trace.completed:
        return None, f"The run diverges at {trace.unstable_from:g} s: {_NO_MOTION}"
    if trace.verdict.state is State.UNSTABLE:
        return None, f"The run is unstable, {trace.verdict.reason}: {_NO_MOTION}"
    period = s.period * s.run.record_every
    tip, touching = trace["tip"], trace["touching"][:, 0] > 0
    length = math.ceil(RIPPLE_WINDOW / period)
    last = next((end for end in range(len(tip), length - 1, -1) if touching[end - length : end].all()), None)
    if last is None:
        return None, f"The contact is shorter than {RIPPLE_WINDOW:g} s: too short to measure the ripple."
    found = ripple(tip[last - length : last], period)
    counts = "" if s.device.encoder else " Encoder counts, the main cause of ripple, are switched off (device.encoder)."
    return found, f"{found}{counts}"
