"""Metrics of a run on a mesh: force steps, deflection, lost contact, energy and ripple."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import welch

from palpate.arrays import Array
from palpate.simulation.moving_frame import seen_from_object, touching_tip, turned_to_object
from palpate.simulation.trace import Trace
from palpate.units import parse_quantity

__all__ = ["LAST", "RIPPLE_BAND", "SlidingMetrics", "sliding_metrics"]

RIPPLE_BAND = (20.0, 500.0)  # Hz, perceptible vibration
LAST = 0.1  # s at the end of a run, over which the final state is averaged


@dataclass(frozen=True)
class SlidingMetrics:
    """Metrics of a tip on a mesh, from the first contact to the end of the run, in N, m, J and N^2.

    Paths and energies are those in the frame of the mesh, if that moves. The tip of an admittance display is its
    virtual tool.

    Attributes:
        path: length of the path of the proxy on the surface.
        lost_ticks: servo ticks without contact; None, as the next two, if not every tick was recorded.
        step_at_crossing: largest change of the object force per tick while the proxy crosses to another triangle.
        step_elsewhere: largest change of the object force per tick within one triangle.
        deflection: depth of the tip, mean over the last 0.1 s.
        expected_deflection: reference force along the normal over the stiffness (F/K), mean over the last 0.1 s; None
            without a reference.
        deflection_error_percent: relative error of `deflection`.
        deflection_rms_error: root mean square of depth - F/K over the run; None without a reference.
        energy_generated: work of the force field on the tip plus the increase of its stored energy; zero for a
            conservative field. The force is linear between samples.
        energy_dissipated: energy dissipated by friction, from the tangential force between tip and proxy.
        ripple_power: power of the object force between 20 and 500 Hz, sum of the axes (Welch 1967); nan if unknown.
        final_force: magnitude of the object force, mean over the last 0.1 s.
        final_swing: peak-to-peak object force over the last 0.1 s, largest of the axes.
        touching_at_end: whether contact was kept over the last 0.1 s.
    """

    path: float
    lost_ticks: int | None
    step_at_crossing: float | None
    step_elsewhere: float | None
    deflection: float
    expected_deflection: float | None
    deflection_error_percent: float | None
    deflection_rms_error: float | None
    energy_generated: float
    energy_dissipated: float
    ripple_power: float
    final_force: float
    final_swing: float
    touching_at_end: bool

    @property
    def settled(self) -> bool:
        """Whether the tip is at rest in contact at the end, with a force steady to 1 % or 1 mN."""
        return self.touching_at_end and self.final_swing <= max(1e-3, 0.01 * self.final_force)

    def to_dict(self) -> dict[str, Any]:
        """Return the metrics for JSON, with the unit as suffix of each name."""
        units = {
            "path": "m",
            "deflection": "m",
            "expected_deflection": "m",
            "deflection_rms_error": "m",
            "ripple_power": "N2",
        }
        units |= dict.fromkeys(("step_at_crossing", "step_elsewhere", "final_force", "final_swing"), "N")
        units |= dict.fromkeys(("energy_generated", "energy_dissipated"), "J")
        named = {f"{key}_{units[key]}" if key in units else key: value for key, value in asdict(self).items()}
        return {**named, "settled": self.settled}


def sliding_metrics(trace: Trace, *, tangential: float | None = None) -> SlidingMetrics | None:
    """Return the metrics of a trace on a mesh; None without a mesh or with fewer than two samples in contact.

    With encoders the tip position of the servo differs from the recorded one by up to half a count.

    Args:
        trace: a run on a mesh.
        tangential: stiffness between tip and proxy along the surface, N/m; None: that of the scenario, by default the
            stiffness along the normal.
    """
    if "proxy" not in trace or np.count_nonzero(trace["touching"]) < 2:
        return None
    first = int(np.argmax(trace["touching"][:, 0] > 0.0))
    time = trace.time[first:]
    names = ("touching", "normal", "depth", "surface_stiffness", "triangle", "object_force")
    touching, normal, depth, stiffness, triangle, force = (trace[name][first:] for name in names)
    tip, proxy = touching_tip(trace)[first:], seen_from_object(trace, trace["proxy"])[first:]
    own_normal, own_force = (turned_to_object(trace, trace[name])[first:] for name in ("normal", "object_force"))
    contact = touching[:, 0] > 0.0
    both = contact[1:] & contact[:-1]
    every_tick = _record_every(trace) == 1
    steps = np.linalg.norm(np.diff(force, axis=0), axis=1)
    crossing = both & (np.diff(triangle[:, 0]) != 0.0)
    last = time >= time[-1] - LAST
    spring = _tangential(trace) if tangential is None else tangential
    along = stiffness[:, 0] if spring is None else np.where(contact, spring, 0.0)
    generated, dissipated = _energy(tip, proxy, own_normal, depth[:, 0], stiffness[:, 0], along, own_force)
    expected = _expected(trace, first, normal, stiffness[:, 0], contact)
    at_rest = last & contact
    deflection = float(np.mean(depth[at_rest])) if at_rest.any() else 0.0
    expected_at_rest = rms = error = None
    if expected is not None:
        rms = float(np.sqrt(np.mean((depth[contact, 0] - expected[contact]) ** 2)))
        if at_rest.any():
            expected_at_rest = float(np.mean(expected[at_rest]))
            error = (deflection / expected_at_rest - 1.0) * 100.0 if expected_at_rest > 0.0 else None
    return SlidingMetrics(
        path=float(np.sum(np.linalg.norm(np.diff(proxy, axis=0), axis=1)[both])),
        lost_ticks=int(np.count_nonzero(~contact)) if every_tick else None,
        step_at_crossing=float(np.max(steps[crossing], initial=0.0)) if every_tick else None,
        step_elsewhere=float(np.max(steps[~crossing], initial=0.0)) if every_tick else None,
        deflection=deflection,
        expected_deflection=expected_at_rest,
        deflection_error_percent=error,
        deflection_rms_error=rms,
        energy_generated=generated,
        energy_dissipated=dissipated,
        ripple_power=_ripple_power(force, float(time[1] - time[0])),
        final_force=float(np.mean(np.linalg.norm(force[last], axis=1))),
        final_swing=float(np.max(np.ptp(force[last], axis=0))),
        touching_at_end=bool(contact[last].all()),
    )


def _record_every(trace: Trace) -> int:
    return int(trace.scenario.get("run", {}).get("record_every", 1))


def _tangential(trace: Trace) -> float | None:
    text = trace.scenario.get("object", {}).get("surface", {}).get("tangential")
    return None if text is None else parse_quantity(text, "N/m")


def _expected(trace: Trace, first: int, normal: Array, stiffness: Array, contact: NDArray[np.bool_]) -> Array | None:
    """Return F/K (n,), m, at each sample; None without a reference force."""
    reference = trace["reference_force"][first:]
    if not np.any(reference):
        return None
    pressed = np.maximum(0.0, -np.sum(reference * normal, axis=1))
    return np.asarray(np.divide(pressed, stiffness, out=np.zeros_like(pressed), where=contact & (stiffness > 0.0)))


def _energy(
    tip: Array, proxy: Array, normal: Array, depth: Array, stiffness: Array, spring: Array, object_force: Array
) -> tuple[float, float]:
    """Return the energy (J) that the field generated, and what friction dissipated.

    The force on the tip is the sum of the field (normal force and its tangential gradient) and of the tangential spring
    between tip and proxy. Only the field may generate energy, and only the spring may dissipate it.
    """
    tangential_offset = proxy - tip - depth[:, None] * normal
    length = np.sum(tangential_offset * tangential_offset, axis=1)
    tangential_force = spring[:, None] * tangential_offset
    move = np.diff(tip, axis=0)

    def work(force: Array) -> float:
        return float(np.sum(0.5 * (force[1:] + force[:-1]) * move))

    def stored(stiff: Array, square: Array) -> float:
        return float(0.5 * (stiff[-1] * square[-1] - stiff[0] * square[0]))

    return (
        work(-object_force - tangential_force) + stored(stiffness, depth**2),
        -work(tangential_force) - stored(spring, length),
    )


def _ripple_power(force: Array, period: float) -> float:
    """Return the power (N^2) of the force in `RIPPLE_BAND`, below half the sampling rate; nan if none is."""
    samples = min(len(force), round(0.25 / period))
    if 0.5 / period < RIPPLE_BAND[0] or samples < 2:
        return math.nan
    frequency, density = welch(force, 1.0 / period, nperseg=samples, axis=0, detrend="constant")
    band = (frequency >= RIPPLE_BAND[0]) & (frequency <= RIPPLE_BAND[1])
    return float(np.sum(density[band]) * (frequency[1] - frequency[0])) if len(frequency) > 1 else 0.0
