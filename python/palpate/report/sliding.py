"""The section of a report about sliding contact with a mesh: figures and table."""

from __future__ import annotations

from typing import Any, Final

from palpate.plotting.mesh_contact import profile, stiffness_and_depth, trajectory
from palpate.plotting.surface import stretched
from palpate.report.html import Page
from palpate.report.numbers import numbers_table
from palpate.simulation.trace import Trace

__all__ = ["sliding_section", "sliding_table"]

# what, key in summary["sliding"], unit, factor
_NUMBERS: Final = (
    ("way over the surface", "path_m", "mm", 1e3),
    ("contact lost", "lost_ticks", "ticks", 1.0),
    ("largest force step at a crossing", "step_at_crossing_N", "N", 1.0),
    ("largest force step elsewhere", "step_elsewhere_N", "N", 1.0),
    ("deflection at the end", "deflection_m", "mm", 1e3),
    ("force / stiffness there (F/K)", "expected_deflection_m", "mm", 1e3),
    ("error against F/K at the end", "deflection_error_percent", "%", 1.0),
    ("rms distance from F/K on the way", "deflection_rms_error_m", "mm", 1e3),
    ("energy that the field generated", "energy_generated_J", "mJ", 1e3),
    ("energy that friction took", "energy_dissipated_J", "mJ", 1e3),
    ("force power from 20 to 500 Hz", "ripple_power_N2", "mN²", 1e6),
)


def sliding_section(page: Page, trace: Trace, sliding: dict[str, Any]) -> None:
    """Write what a slide shows on the page of a run; `sliding` is `summarize(trace)["sliding"]`."""
    page.section("The slide")
    way = trajectory(trace)
    page.figure(
        way,
        "The way of the tip under the surface, and of its proxy on it. The darker, the stiffer." + stretched(way),
    )
    page.figure(profile(trace), "The same from the side: between the two lies the deflection.")
    page.figure(
        stiffness_and_depth(trace),
        "Stiffness under the tip, and how deep the tip lies. Dashed: reference force along the normal over stiffness.",
    )
    sliding_table(page, sliding)


def sliding_table(page: Page, sliding: dict[str, Any]) -> None:
    """Write the numbers of a slide as a table."""
    numbers_table(page, _NUMBERS, sliding, "The slide in numbers, from the first touch to the end of the run.")
