"""The section of a report about contact with a deformable body: figures and table."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from palpate.metrics.body_contact import JND
from palpate.plotting.body_contact import body_energy, deformed, force_and_deflection, stiffness_along_path_figure
from palpate.plotting.surface import stretched
from palpate.report.html import Page
from palpate.report.numbers import Number, numbers_table
from palpate.simulation.bodies import pressed_at
from palpate.simulation.trace import Trace

__all__ = ["palpation_section", "palpation_table"]

# what, key in summary["palpation"], unit, factor
_NUMBERS: Final[tuple[Number, ...]] = (
    ("deepest deflection", "deepest_m", "mm", 1e3),
    ("force there", "deepest_force_N", "N", 1.0),
    ("force over deflection there", "stiffness_N_per_m", "N/m", 1.0),
    ("nodes pressed there", "nodes", "", 1.0),
    ("way of the tip in contact", "path_m", "mm", 1e3),
    ("touches", "touches", "", 1.0),
    ("deflection at the end", "final_deflection_m", "mm", 1e3),
    ("force at the end", "final_force_N", "N", 1.0),
    ("swing of the force at the end", "final_swing_N", "mN", 1e3),
    ("work of the tip on the body", "work_J", "mJ", 1e3),
    ("stored in it at the first sample", "at_start_J", "mJ", 1e3),
    ("stored in the body at the end", "stored_J", "mJ", 1e3),
    ("saved for snapshots to come", "saved_J", "mJ", 1e3),
    ("lost in the body", "lost_J", "mJ", 1e3),
    ("added by holding the force from sample to sample", "held_J", "mJ", 1e3),
)


def palpation_section(page: Page, trace: Trace, found: dict[str, Any]) -> None:
    """Write what a press into a body shows on the page of a run; `found` is `summarize(trace)["palpation"]`."""
    deepest = int(np.argmax(np.linalg.norm(trace["deflection"], axis=1)))
    page.section("The body")
    at = pressed_at(trace, deepest)
    picture = deformed(at.body, at.displacement, at.pressure)
    page.figure(
        picture,
        f"The body's surface at t = {trace.time[deepest]:.3g} s, where it is pressed deepest, in its own frame: how "
        "far it has moved, and the pressure of the tip on it." + stretched(picture),
    )
    page.figure(force_and_deflection(trace), "Force of the tip on the body, and how far the pressed patch has moved.")
    if found["path_stiffness_max_N_per_m"] is not None:
        rise = found["path_stiffness_max_N_per_m"] / found["path_stiffness_median_N_per_m"] - 1.0
        page.figure(
            stiffness_along_path_figure(trace),
            f"Stiffness felt along the way: at most {100 * rise:.3g} % over its median, "
            f"{'more' if rise > JND else 'less'} than the {100 * JND:g} % (band) that a hand just notices.",
        )
    page.figure(body_energy(trace), "Work of the tip on the body, and what pressing has stored in it.")
    palpation_table(page, found)


def palpation_table(page: Page, found: dict[str, Any]) -> None:
    """Write the numbers of a press as a table."""
    shown = [number for number in _NUMBERS if number[1] not in ("saved_J", "at_start_J") or found[number[1]]]
    numbers_table(page, shown, found, "The press in numbers, from the first touch to the end of the run.")
