"""Summary of a trace: its verdict with details, and metrics."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate.contact.unfound import UNFOUND, unfound
from palpate.devices.reach import near_limits
from palpate.fem.indentation import OVERLAPS_UNTOUCHED
from palpate.metrics.body_contact import FEW, PalpationMetrics, palpation_metrics, some_samples
from palpate.metrics.mesh_contact import SlidingMetrics, sliding_metrics
from palpate.scenario import Scenario
from palpate.scenario.signal import Signal
from palpate.simulation.bodies import overlaps_untouched, tip_depths
from palpate.simulation.continuation import moves_on
from palpate.simulation.decision import BAND
from palpate.simulation.drive_hold import drive_hold, motor_load
from palpate.simulation.energy_balance import energy_balance
from palpate.simulation.evidence import pushed_through
from palpate.simulation.recorded import external_forces, recorded_scenario
from palpate.simulation.statics import expected_deflection
from palpate.simulation.step_response import step_response
from palpate.simulation.trace import Trace, complete
from palpate.simulation.verdict import State
from palpate.simulation.windows import windows

__all__ = ["summarize"]

AXES = ("x", "y", "z")
MAX_INITIAL_DEPTH = 1e-4  # m, penetration at the start above which the summary mentions it
OTHER = 0.02  # relative difference of two depths above which both are stated
LEAST_DEFLECTION = 1e-6  # m, steady deflection of an axis below which its transient is of no interest


def summarize(trace: Trace) -> dict[str, Any]:
    """Return the verdict and the metrics of a run for JSON, in SI except for percentages.

    "state" is the verdict's label and "verdict" a sentence with details. "stable" is true if the state is "settled".
    A reference on several axes has the settling time and the error of the deflection as a vector in "magnitude".
    "warnings" are sentences on the drive and on singular poses. Each driven axis has the steady tip deflection, the
    expected deflection (reference force over stiffness) and the error against it. It also has the overshoot, the
    growth of an oscillation, and the 5 % settling time, which counts from the last step or the end of a ramp. The whole
    run has the peak reference, command, torque and object force, and the force that the motors must deliver. The peak
    of a force is its magnitude over the three axes. A run of an impedance display that records every tick has the
    energies of `EnergyBalance`.

    A run on a mesh has "sliding" (`SlidingMetrics`) and a run on a body "palpation" (`PalpationMetrics`) in place of
    the axes. A run that diverged has no steady state, and only the peaks are given.

    Raises:
        TraceError: the trace lacks a channel that every run records.
    """
    with complete():
        return _summarize(trace)


def _summarize(trace: Trace) -> dict[str, Any]:
    scenario = recorded_scenario(trace)
    summary: dict[str, Any] = {
        "title": "" if scenario is None else scenario.title,
        "stable": trace.verdict.settled,
        "state": trace.verdict.state.label,
        "verdict": str(trace.verdict),
        "judgment": trace.verdict.to_dict(),
        "unstable_from_s": trace.unstable_from,
        "duration_s": float(trace.time[-1]) if len(trace) else 0.0,
        "samples": len(trace),
        "peak_reference_force_N": _peak(trace, "reference_force") or None,
        "peak_command_force_N": _peak(trace, "command_force"),
        "peak_motor_force_N": _peak(trace, "motor_force"),
        "peak_object_force_N": _peak(trace, "object_force"),
        "peak_deflection_m": _peak(trace, "deflection"),
        "peak_torque": _peak_each(trace, "torque"),
        "torque_unit": trace.channels["torque"].unit if "torque" in trace else None,
        "saturated_fraction": float(np.mean(trace["saturated"])) if "saturated" in trace and len(trace) else None,
        "energy": _energy(trace, scenario),
        "axes": {},
    }
    if "proxy" in trace:
        details = _on_mesh(summary, trace)
    elif "contact_nodes" in trace:
        details = _on_body(summary, trace)
    else:
        details = [*_on_axes(summary, trace, scenario), *_in_wall(trace, scenario)]
        if scenario is not None and scenario.operator.kind == "fixed":
            details = []  # nothing moves
    if trace.verdict.settled and scenario is not None and scenario.operator.kind != "fixed" and details:
        colon = "" if details[0].startswith("to 5 %") else ":"
        summary["verdict"] = f"{trace.verdict.state.label}{colon} {details[0]}"
        details = [*details[1:], *filter(None, [moves_on(trace)])]
    summary["verdict"] = "; ".join([summary["verdict"], *details, *_guard(trace, scenario)])
    if "guard" in trace.metadata:
        summary["guard"] = trace.metadata["guard"]
    summary["warnings"] = [*_drive(trace, scenario), *_reach(trace, scenario)]
    return {key: _plain(value) for key, value in summary.items()}


def _guard(trace: Trace, scenario: Scenario | None) -> list[str]:
    """Return the guard of the run, with the friction that it takes from the device."""
    found = trace.metadata.get("guard")
    if found is None or scenario is None:
        return []
    name = str(found["kind"]).replace("_", " ")
    if found["kind"] != "energy_bound":
        return [f"guard: {name}"]
    force = scenario.load_device().torque_unit
    speed = "m" if force == "N" else "rad"
    viscous, dry = (", ".join(f"{value:.3g}" for value in found[key]) for key in ("damping", "coulomb"))
    return [f"guard: {name} that relies on the device's friction, {viscous} {force}*s/{speed} and {dry} {force}"]


def _plain(value: Any) -> Any:
    """Return a value for JSON; a number that is not finite, because it overflowed or cannot be known, is None."""
    if isinstance(value, dict):
        return {key: _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _on_axes(summary: dict[str, Any], trace: Trace, scenario: Scenario | None) -> list[str]:
    """Add the step response of every driven axis; return the settling time and steady error in words."""
    if not trace.completed or "deflection" not in trace or len(trace) < 2:
        return []
    expected, deflection = expected_deflection(scenario), trace["deflection"]
    start = 0.0 if scenario is None else float((scenario.reference or scenario.operator).start)
    moving = max(0.0, _constant_from(scenario) - start)
    least = max(LEAST_DEFLECTION, BAND * float(np.max(np.linalg.norm(deflection, axis=1))))
    driven, constant = any(expected), windows(external_forces(trace, scenario))[-1].constant
    of_peak = False
    for axis in range(deflection.shape[1]):
        if not expected[axis] and (driven or np.max(np.abs(deflection[:, axis])) < least):
            continue  # coupling or rounding
        response = step_response(trace.time, deflection[:, axis], start=start, expected=expected[axis])
        of_peak |= response.returns
        summary["axes"][AXES[axis]] = {
            "steady_deflection_m": response.steady,
            "expected_deflection_m": response.expected,
            "error_percent": response.error_percent,
            "overshoot_percent": None if response.returns else response.overshoot_percent,
            "settling_5_percent_s": _after(response.settling_time, moving),
            "peak_deflection_m": response.peak,
            "ripple_m": response.ripple,
            "swing_growth": response.swing_growth if constant else None,
        }
    if not trace.verdict.settled:
        return []
    rows = summary["axes"].values()
    times = [row["settling_5_percent_s"] for row in rows]
    several = sum(bool(value) for value in expected) > 1
    if not times or (None in times and not several) or not _one_step(scenario):
        return [trace.verdict.reason]
    slowest: float | None
    worst: float | None
    if several:
        slowest, worst = _magnitude(trace, expected, start)
        slowest = _after(slowest, moving)
        summary["magnitude"] = {"settling_5_percent_s": slowest, "error_percent": worst}
    else:
        slowest = max(times)
        worst = max((abs(row["error_percent"]) for row in rows if row["error_percent"] is not None), default=None)
    if slowest is None:
        return [trace.verdict.reason]
    when = f"in {slowest * 1e3:.3g} ms" if slowest < 1.0 else f"in {slowest:.3g} s"
    if any(signal.rise is not None for signal in _forces(scenario)):
        when = f"{when} after the end of the ramp" if slowest else "by the end of the ramp"
    text = f"to 5 %{' of its peak' if of_peak and not several else ''} {when}"
    if scenario is not None and scenario.run.record_every > 1:
        text += f" (recorded every {1e3 * scenario.run.record_every * scenario.period:.3g} ms)"
    return [text if worst is None else f"{text}, steady error {worst:.3g} %"]


def _forces(scenario: Scenario | None) -> list[Signal]:
    """Return the signals of a scenario that have a force."""
    signals = () if scenario is None else (scenario.reference, scenario.operator)
    return [signal for signal in signals if signal is not None and signal.force]


def _constant_from(scenario: Scenario | None) -> float:
    """Return the time, s, from which the steps and ramps of a scenario are constant."""
    return max((signal.start + (signal.rise or 0.0) for signal in _forces(scenario)), default=0.0)


def _after(settling: float | None, moving: float) -> float | None:
    """Return a settling time, s, less the time in which the external force still moved; None: not settled."""
    return None if settling is None else max(0.0, settling - moving)


def _in_wall(trace: Trace, scenario: Scenario | None) -> list[str]:
    """Return that a tip that is free to move began deep in a wall."""
    if scenario is None or scenario.contact_kind not in ("wall", "force_law") or scenario.operator.kind == "fixed":
        return []
    if "deflection" not in trace or not len(trace) or not trace["touching"][0, 0]:
        return []
    return _began(float(np.linalg.norm(trace["deflection"][0])), "wall")


def _magnitude(trace: Trace, expected: Sequence[float | None], start: float) -> tuple[float | None, float]:
    """Return settling time, s, and steady error, percent, of the deflection as a vector, whatever the axes."""
    known = [axis for axis, value in enumerate(expected) if value is not None]
    wanted, deflection = np.array([expected[axis] for axis in known], dtype=float), trace["deflection"][:, known]
    steady = deflection[-max(1, len(deflection) // 20) :].mean(axis=0)
    away = step_response(trace.time, np.linalg.norm(deflection - steady, axis=1), start=start)
    return away.settling_time, 100.0 * float(np.linalg.norm(steady - wanted) / np.linalg.norm(wanted))


def _one_step(scenario: Scenario | None) -> bool:
    """Return whether the external force is one step or ramp, so that a settling time has a meaning."""
    if scenario is None:
        return True
    moves = scenario.operator.table is not None or (scenario.reference is not None and scenario.reference.table)
    return not moves and all(signal.shape in ("step", "ramp") and signal.stop is None for signal in _forces(scenario))


def _on_mesh(summary: dict[str, Any], trace: Trace) -> list[str]:
    """Add the sliding metrics; return the details of a run on a mesh."""
    found = sliding_metrics(trace)
    summary["sliding"] = None if found is None else found.to_dict()
    began = _began(float(trace["depth"][0, 0]), "mesh") if len(trace) else []
    if found is None or not trace.completed:
        return began
    text = f"slides {found.path * 1e3:.3g} mm over the mesh, {_at_the_end(found, trace)} at the end"
    if found.step_at_crossing is not None:
        held = f"lost for {found.lost_ticks} ticks" if found.lost_ticks else "held"
        text += f"; contact {held}, largest force step at a crossing {found.step_at_crossing:.3g} N"
    return [text, *began]


def _on_body(summary: dict[str, Any], trace: Trace) -> list[str]:
    """Add the palpation metrics; return the details of a run on a body."""
    found = palpation_metrics(trace)
    summary["palpation"] = None if found is None else found.to_dict()
    if found is None and trace.completed and "contact_nodes" in trace:
        over = [f"the tip {OVERLAPS_UNTOUCHED}"] if overlaps_untouched(trace, some_samples(trace)) else []
        return [*over, *_began(_initial_depth(trace), "body")]
    if found is None or not trace.completed:
        return []
    at_depth, largest = f"{found.deepest_force:.3g} N", f"{summary['peak_object_force_N']:.3g} N"
    text = (
        f"presses the body in by {found.deepest * 1e3:.3g} mm with {at_depth}"
        f"{'' if at_depth == largest else f' (largest force {largest})'}"
    )
    if found.tip_depth is not None:
        tip = "deepest tip" if found.final_tip_forces else "tip"
        text += f", its {tip} {found.tip_depth * 1e3:.3g} mm below the surface at rest"
        end = found.final_tip_depth
        if end is not None and found.touching_at_end and abs(end - found.tip_depth) > OTHER * max(end, found.tip_depth):
            text += f" ({end * 1e3:.3g} mm and {found.final_force:.3g} N at the end)"
    others = found.touching_at_end and pushed_through(trace) is not None
    text += f", {'is in contact by another tip' if others else _at_the_end(found, trace)} at the end"
    if found.final_tip_forces:
        text += f", its tips with {', '.join(f'{force:.3g}' for force in found.final_tip_forces)} N"
    if found.mesh_error is not None:
        text += f"; the mesh adds an error of up to {100 * found.mesh_error:.0f} % to that force ({found.nodes} nodes)"
    elif found.nodes >= FEW:
        text += "; the error of that force by the mesh is not known"
    if found.softening is not None:
        text += f"; small strains are assumed: at that depth it may be up to {100 * found.softening:.0f} % too small"
    if found.nodes < FEW:
        few = "1 node carries" if found.nodes == 1 else f"{found.nodes} nodes carry"
        text += f"; only {few} that force: take a finer mesh or a larger tip"
    if found.over_untouched:
        text += f"; the tip {OVERLAPS_UNTOUCHED}"
    if found.unsolved and UNFOUND not in trace.verdict.reason:
        text += f"; {unfound(_samples(found.unsolved))}"
    if found.contact_lost:
        text += f"; in {_samples(found.contact_lost)} the tip is in the body without contact"
    return [text, *_began(_initial_depth(trace), "body")]


def _initial_depth(trace: Trace) -> float:
    """Return how far a body is pressed in at the first sample, m, or how deep the tip is if its force was not found."""
    unsolved = "solved" in trace and not trace["solved"][0, 0]
    if unsolved and (below := tip_depths(trace)) is not None:
        return float(below[0])
    return float(np.linalg.norm(trace["deflection"][0])) if trace["touching"][0, 0] else 0.0


def _samples(count: int) -> str:
    return "1 sample" if count == 1 else f"{count} samples"


def _at_the_end(found: SlidingMetrics | PalpationMetrics, trace: Trace) -> str:
    if found.settled and trace.verdict.settled:
        return "rests in contact"
    return "is in contact" if found.touching_at_end else "is apart"


def _began(depth: float, touched: str) -> list[str]:
    if depth <= MAX_INITIAL_DEPTH:
        return []
    check = "check object.position" + ("" if touched == "wall" else " and the unit of its file")
    return [f"it began {depth * 1e3:.3g} mm deep in the {touched}; {check}"]


def _drive(trace: Trace, scenario: Scenario | None) -> list[str]:
    """Return how often the drive is at its limit, and how long or by how much it cannot give the force at the end."""
    found = []
    if "saturated" in trace and (share := float(np.mean(trace["saturated"])) if len(trace) else 0.0):
        found.append(f"the drive is at its limit {share * 100.0:.3g} % of the time")
    if scenario is None or "motor_force" not in trace or not len(trace):
        return found
    if scenario.device.saturation:
        ends = trace.verdict.state in (State.UNSTABLE, State.DRIVE_LIMIT)
        hold = None if ends else drive_hold(trace, scenario)
        return [*found, *([hold] if hold else [])]
    device, force = scenario.load_device(), motor_load(trace, scenario)
    if force.max() > device.peak_force:
        limit = device.peak_force
        return [f"without drive limits: the motors deliver {force.max():.3g} N, of which the drive gives {limit:.3g} N"]
    last, limit = float(np.mean(force[-max(len(force) // 20, 1) :])), device.continuous_force
    if last > limit and trace.verdict.state is not State.UNSTABLE:
        return [f"without drive limits: the motors hold {last:.3g} N, of which the drive gives {limit:.3g} N for long"]
    return []


def _energy(trace: Trace, scenario: Scenario | None) -> dict[str, float] | None:
    """Return the energies of a run of an impedance display, J; None if they are not known."""
    if scenario is None or not trace.completed or len(trace) < 2:
        return None
    found = energy_balance(trace, scenario, windows(external_forces(trace, scenario))[-1])
    if found is None:
        return None
    return {
        "supplied_J": found.supplied,
        "generated_in_last_fifth_J": found.generated,
        "generated_in_fourth_fifth_J": found.generated_before,
    }


def _reach(trace: Trace, scenario: Scenario | None) -> list[str]:
    """Return warnings if the run comes near a singular pose or a joint limit, or the wall cannot be felt at its end."""
    if scenario is None or "angle" not in trace or not len(trace) or trace.verdict.state is State.OUT_OF_REACH:
        return []
    device, normal = scenario.load_device(), scenario.object.normal
    found = near_limits(device, trace["angle"])
    jacobian = np.reshape(device.jacobian(trace["angle"][-1]), (3, device.dof))
    if normal is not None and np.linalg.norm(normal @ jacobian) < 1e-9 * np.linalg.norm(jacobian):
        found.append(
            "the device cannot move along the wall's normal, so it cannot render the wall: choose another normal"
        )
    return found


def _peak(trace: Trace, name: str) -> float | None:
    if name not in trace or not len(trace):
        return None
    return float(np.max(np.linalg.norm(trace[name], axis=1)))


def _peak_each(trace: Trace, name: str) -> list[float] | None:
    if name not in trace or not len(trace):
        return None
    return [float(value) for value in np.max(np.abs(trace[name]), axis=0)]
