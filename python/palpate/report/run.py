"""Page of one run: verdict, numbers, figures and scenario."""

from __future__ import annotations

import json
from typing import Any

from palpate.metrics import summarize
from palpate.plotting import figures
from palpate.report.contact import palpation_section, sliding_section
from palpate.report.html import Page
from palpate.simulation.trace import Trace


def run_page(trace: Trace, summary: dict[str, Any] | None = None) -> Page:
    """Return the page of a trace; `summary` is `summarize(trace)`, which is computed if None."""
    found = summarize(trace) if summary is None else summary
    page = Page(found["title"] or "Run", str(trace.scenario.get("description", "")))
    page.section("Verdict")
    page.verdict(found["verdict"][0].upper() + found["verdict"][1:] + ".", trace.verdict.state.tone)
    for warning in found["warnings"]:
        page.verdict(f"{warning[0].upper()}{warning[1:]}.", "note")
    facts = [("duration", f"{found['duration_s']:.4g} s"), ("samples", f"{found['samples']}")]
    if trace.verdict.linear is not None:
        facts.append(("linear loop", trace.verdict.linear))
    for key, name, unit, scale in (
        ("peak_deflection_m", "largest deflection", "mm", 1e3),
        ("peak_reference_force_N", "largest reference", "N", 1.0),
        ("peak_object_force_N", "largest force on the object", "N", 1.0),
        ("peak_command_force_N", "largest command", "N", 1.0),
        ("peak_motor_force_N", "largest force of the motors", "N", 1.0),
    ):
        if found[key] is not None:
            facts.append((name, f"{found[key] * scale:.4g} {unit}"))
    if found["saturated_fraction"]:
        facts.append(("saturated", f"{found['saturated_fraction'] * 100:.3g} % of the time"))
    page.facts(facts)
    _axes(page, found["axes"])
    if found.get("sliding") is not None:
        sliding_section(page, trace, found["sliding"])
    if found.get("palpation") is not None:
        palpation_section(page, trace, found["palpation"])
    page.section("Time histories")
    if "deflection" in trace and not ({"proxy", "contact_nodes"} & trace.channels.keys()) and len(trace) > 1:
        page.figure(figures.deflection(trace), "Deflection of the object at the tip.")
    if len(trace) > 1:
        page.figure(figures.forces(trace), "Forces at the tip.")
        page.figure(figures.torques(trace), "Motor torques.")
        page.figure(figures.angles(trace), "Joint positions.")
    if "energy" in trace and len(trace) > 1:
        page.figure(figures.energy(trace), "Kinetic and potential energy of the device.")
    page.section("Reproduction")
    page.paragraph(f"palpate {trace.metadata.get('version', 'unknown')}. The scenario below reproduces the trace.")
    page.code(json.dumps(trace.scenario, indent=2, ensure_ascii=False), "Scenario")
    if trace.metadata.get("controller"):
        page.code(json.dumps(trace.metadata["controller"], indent=2, ensure_ascii=False), "Controller")
    return page


def _axes(page: Page, axes: dict[str, dict[str, Any]]) -> None:
    if not axes:
        return

    def shown(value: float | None, digits: str, scale: float = 1.0) -> str:
        return "–" if value is None else format(value * scale, digits)

    rows = [
        (
            axis,
            shown(row["steady_deflection_m"], ".4f", 1e3),
            shown(row["expected_deflection_m"], ".4f", 1e3),
            shown(row["error_percent"], ".3g"),
            shown(row["overshoot_percent"], ".1f"),
            shown(row["settling_5_percent_s"], ".0f", 1e3),
        )
        for axis, row in axes.items()
    ]
    page.table(
        ["axis", "steady deflection", "force / stiffness", "error", "overshoot", "5 % settling"],
        rows,
        "Steady state and transient of each axis.",
        units=["", "mm", "mm", "%", "%", "ms"],
    )
