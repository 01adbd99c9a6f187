"""Summary of a trace: metrics, and a verdict in one sentence."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.errors import PalpateError
from palpate.metrics.body_contact import FEW, PalpationMetrics, palpation_metrics
from palpate.metrics.mesh_contact import SlidingMetrics, sliding_metrics
from palpate.metrics.step import StepResponse, step_response
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace

__all__ = ["expected_deflection", "scenario_of", "summarize"]

Array = NDArray[np.float64]
AXES = ("x", "y", "z")
GROWTH_LIMIT = 1.02  # growth of an oscillation per quarter of the run above which it is unstable
MAX_TOUCHES = 3  # contacts in a quarter of a run under constant forces above which the tip bounces endlessly
MAX_INITIAL_DEPTH = 1e-4  # m, penetration at the start above which the verdict mentions it


def summarize(trace: Trace) -> dict[str, Any]:
    """Return the metrics of a run for JSON, in SI except for percentages.

    Each axis has the steady tip deflection, the expected deflection (reference force over stiffness) and the error
    against it, overshoot, 5 % settling time, and the growth of an oscillation. The whole run has the peak command,
    torque and object force. "stable" is also false for a run that ends with a growing oscillation.

    A run on a mesh has "sliding" (`SlidingMetrics`) and a run on a body "palpation" (`PalpationMetrics`) in place of
    the axes. A run that diverged has no steady state, and only the peaks are given.
    """
    scenario = scenario_of(trace)
    summary: dict[str, Any] = {
        "title": "" if scenario is None else scenario.title,
        "stable": trace.stable,
        "unstable_from_s": trace.unstable_from,
        "duration_s": float(trace.time[-1]) if len(trace) else 0.0,
        "samples": len(trace),
        "peak_command_force_N": _peak(trace, "command_force"),
        "peak_object_force_N": _peak(trace, "object_force"),
        "peak_deflection_m": _peak(trace, "deflection"),
        "peak_torque": _peak_each(trace, "torque"),
        "torque_unit": trace.channels["torque"].unit if "torque" in trace else None,
        "saturated_fraction": float(np.mean(trace["saturated"])) if "saturated" in trace and len(trace) else None,
        "axes": {},
    }
    if "proxy" in trace:
        return _on_mesh(summary, trace)
    if "pressed_nodes" in trace:
        return _on_body(summary, trace)
    if trace.stable and "deflection" in trace and len(trace) > 1:
        start = 0.0 if scenario is None else _step_time(scenario)
        expected = expected_deflection(scenario)
        deflection = trace["deflection"]
        for axis in range(deflection.shape[1]):
            if expected[axis] is None and not np.any(deflection[:, axis]):
                continue
            target = expected[axis]
            response = step_response(trace.time, deflection[:, axis], start=start, expected=target)
            summary["axes"][AXES[axis]] = {
                "steady_deflection_m": response.steady,
                "expected_deflection_m": response.expected,
                "error_percent": response.error_percent,
                "overshoot_percent": response.overshoot_percent,
                "settling_5_percent_s": response.settling_time,
                "peak_deflection_m": response.peak,
                "ripple_m": response.ripple,
                "swing_growth": response.swing_growth if _rests(scenario, trace) else None,
            }
    summary["stable"] = trace.stable and not _growing_axes(summary)
    if scenario is not None and scenario.operator.kind == "fixed":
        summary["verdict"] = f"tip fixed for {summary['duration_s']:.4g} s"
    elif trace.stable and not _rests(scenario, trace):
        summary["verdict"] = f"bounded for {summary['duration_s']:.4g} s under a force that changes: no steady state"
    else:
        summary["verdict"] = _verdict(summary)
    return _saturated(summary)


def _on_mesh(summary: dict[str, Any], trace: Trace) -> dict[str, Any]:
    """Return the summary of a run on a mesh, with sliding metrics in place of the axes."""
    found = sliding_metrics(trace)
    summary["sliding"] = None if found is None else found.to_dict()
    if found is None or not trace.stable:
        return _without_contact(summary, trace, "mesh")
    depth = step_response(trace.time, trace["depth"][:, 0])
    if _grows(depth) and not found.settled:
        return _unstable(summary, f"the oscillation of the depth grows, by {_percent(depth)} in a quarter of the run")
    if bounces := _endless_bounces(trace):
        return _unstable(summary, f"the tip bounces on the mesh, {bounces} times in the last quarter of the run")
    summary["verdict"] = f"stable: slides {found.path * 1e3:.3g} mm over the mesh, {_at_the_end(found)} at the end"
    if found.step_at_crossing is not None:
        summary["verdict"] += (
            f"; contact lost for {found.lost_ticks} ticks, largest force step at a crossing "
            f"{found.step_at_crossing:.3g} N"
        )
    return _began_and_saturated(summary, float(trace["depth"][0, 0]), "mesh")


def _on_body(summary: dict[str, Any], trace: Trace) -> dict[str, Any]:
    """Return the summary of a run on a body, with palpation metrics in place of the axes."""
    found = palpation_metrics(trace)
    summary["palpation"] = None if found is None else found.to_dict()
    if found is None or not trace.stable:
        return _without_contact(summary, trace, "body")
    scenario, size = scenario_of(trace), np.linalg.norm(trace["deflection"], axis=1)
    response = step_response(trace.time, size)
    if _grows(response) and not found.settled:
        return _unstable(
            summary, f"the oscillation of the deflection grows, by {_percent(response)} in a quarter of the run"
        )
    if (response.swing_growth or 0.0) > 1.0 / GROWTH_LIMIT and not found.settled and _rests(scenario, trace):
        return _unstable(summary, f"the force oscillates by {found.final_swing:.3g} N and does not decay")
    if bounces := _endless_bounces(trace):
        return _unstable(summary, f"the tip bounces on the body, {bounces} times in the last quarter of the run")
    at_depth, largest = f"{found.deepest_force:.3g} N", f"{summary['peak_object_force_N']:.3g} N"
    summary["verdict"] = (
        f"stable: presses the body in by {found.deepest * 1e3:.3g} mm with {at_depth}"
        f"{'' if at_depth == largest else f' (largest force {largest})'}, {_at_the_end(found)} at the end"
    )
    if found.nodes < FEW:
        summary["verdict"] += f"; only {found.nodes} nodes carry that force: take a finer mesh or a larger tip"
    if found.unsolved:
        summary["verdict"] += f"; in {found.unsolved} samples more nodes were under the tip than the solver considers"
    return _began_and_saturated(summary, float(size[0]) if trace["touching"][0, 0] else 0.0, "body")


def _without_contact(summary: dict[str, Any], trace: Trace, touched: str) -> dict[str, Any]:
    """Return the summary of a run that diverged or never made contact."""
    if not trace.stable:
        summary["verdict"] = f"unstable from t = {summary['unstable_from_s']:.4g} s"
    else:
        summary["verdict"] = f"bounded for {summary['duration_s']:.4g} s, but the tip never touched the {touched}"
    return summary


def _unstable(summary: dict[str, Any], why: str) -> dict[str, Any]:
    summary["stable"] = False
    summary["verdict"] = f"unstable: {why}"
    return summary


def _grows(response: StepResponse) -> bool:
    return (response.swing_growth or 0.0) > GROWTH_LIMIT and response.settling_time is None


def _percent(response: StepResponse) -> str:
    return f"{((response.swing_growth or 0.0) - 1.0) * 100.0:.3g} %"


def _at_the_end(found: SlidingMetrics | PalpationMetrics) -> str:
    return "rests in contact" if found.settled else "still moves" if found.touching_at_end else "is apart"


def _began_and_saturated(summary: dict[str, Any], depth: float, touched: str) -> dict[str, Any]:
    """Add the initial penetration (m) and the saturation of the drive to the verdict."""
    if depth > MAX_INITIAL_DEPTH:
        summary["verdict"] += f"; it began {depth * 1e3:.3g} mm deep in the {touched}"
    return _saturated(summary)


def _saturated(summary: dict[str, Any]) -> dict[str, Any]:
    if summary["saturated_fraction"]:
        summary["verdict"] += f"; the drive at its limit {summary['saturated_fraction'] * 100.0:.3g} % of the time"
    return summary


def _endless_bounces(trace: Trace) -> int:
    """Return the number of contacts in the last quarter of a run; 0 if they are few or the forces change."""
    contact = trace["touching"][-(len(trace) // 4) :, 0] > 0.0
    bounces = int(np.count_nonzero(contact[1:] & ~contact[:-1]))
    return bounces if bounces > MAX_TOUCHES and _rests(scenario_of(trace), trace, 0.25) else 0


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


def _rests(scenario: Scenario | None, trace: Trace, part: float = 0.5) -> bool:
    """Return whether the external forces are constant over the last fraction `part` of the run."""
    if scenario is None or not len(trace):
        return True
    signal = scenario.reference or scenario.operator
    if signal.force is None and signal.table is None:
        return True
    middle = float(trace.time[-1]) * (1.0 - part)
    times = [signal.start + (signal.rise or 0.0), *([signal.stop] if signal.stop is not None else [])]
    times += [row[0] for row in signal.table or ()]
    return signal.shape != "sine" and not any(middle < time <= float(trace.time[-1]) for time in times)


def _growing_axes(summary: dict[str, Any]) -> list[str]:
    """Return the axes with a growing oscillation that has not settled."""
    return [
        axis
        for axis, row in summary["axes"].items()
        if row["settling_5_percent_s"] is None and (row["swing_growth"] or 0.0) > GROWTH_LIMIT
    ]


def _step_time(scenario: Scenario) -> float:
    signal = scenario.reference or scenario.operator
    return float(signal.start)


def scenario_of(trace: Trace) -> Scenario | None:
    """Return the scenario of a trace; None if it is missing or cannot be read."""
    try:
        return Scenario.from_dict(trace.scenario) if trace.scenario else None
    except PalpateError:
        return None  # written by another version, or its device file is missing


def _peak(trace: Trace, name: str) -> float | None:
    if name not in trace or not len(trace):
        return None
    return float(np.max(np.linalg.norm(trace[name], axis=1)))


def _peak_each(trace: Trace, name: str) -> list[float] | None:
    if name not in trace or not len(trace):
        return None
    return [float(value) for value in np.max(np.abs(trace[name]), axis=0)]


def _verdict(summary: dict[str, Any]) -> str:
    axes = summary["axes"]
    if summary["unstable_from_s"] is not None:
        return f"unstable from t = {summary['unstable_from_s']:.4g} s"
    if axes_growing := _growing_axes(summary):
        factor = max(axes[axis]["swing_growth"] for axis in axes_growing)
        return (
            f"unstable: the oscillation along {', '.join(axes_growing)} grows, by {(factor - 1.0) * 100.0:.3g} % "
            "in a quarter of the run"
        )
    unsettled = [axis for axis, row in axes.items() if row["settling_5_percent_s"] is None]
    if unsettled:
        decaying = all((axes[axis]["swing_growth"] or GROWTH_LIMIT) < 1.0 / GROWTH_LIMIT for axis in unsettled)
        state = "stable, its oscillation decays," if decaying else "bounded,"
        return f"{state} but not settled along {', '.join(unsettled)} after {summary['duration_s']:.4g} s"
    worst = max((abs(row["error_percent"]) for row in axes.values() if row["error_percent"] is not None), default=None)
    slowest = max((row["settling_5_percent_s"] for row in axes.values()), default=None)
    if slowest is None:
        return f"stable for {summary['duration_s']:.4g} s"
    text = "stable: settles to 5 % in " + (f"{slowest * 1e3:.3g} ms" if slowest < 1.0 else f"{slowest:.3g} s")
    return text if worst is None else f"{text}, steady error {worst:.3g} %"
