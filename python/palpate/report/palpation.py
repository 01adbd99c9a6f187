"""Section of a report on contact with a deformable body."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from palpate.metrics.body_contact import JND
from palpate.plotting.body_contact import (
    body_energy,
    deformed_surface,
    force_and_deflection,
    stiffness_along_path_figure,
)
from palpate.plotting.surface import stretched
from palpate.report.html import Page
from palpate.report.numbers import Number, numbers_table
from palpate.simulation.bodies import pressed_at
from palpate.simulation.trace import Trace

# name, key in summary["palpation"], unit, factor
_NUMBERS: Final[tuple[Number, ...]] = (
    ("deepest deflection", "deepest_m", "mm", 1e3),
    ("force there", "deepest_force_N", "N", 1.0),
    ("force over deflection there", "stiffness_N_per_m", "N/m", 1.0),
    ("nodes in contact there", "nodes", "", 1.0),
    ("path length of the tip in contact", "path_m", "mm", 1e3),
    ("number of contacts", "touches", "", 1.0),
    ("deflection at the end", "final_deflection_m", "mm", 1e3),
    ("force at the end", "final_force_N", "N", 1.0),
    ("oscillation of the force at the end", "final_swing_N", "mN", 1e3),
    ("work of the tip on the body", "work_J", "mJ", 1e3),
    ("energy stored at the first sample", "at_start_J", "mJ", 1e3),
    ("energy stored at the end", "stored_J", "mJ", 1e3),
    ("energy in the tank at the end", "saved_J", "mJ", 1e3),
    ("energy dissipated in the body", "lost_J", "mJ", 1e3),
    ("energy added by the zero-order hold of the force", "held_J", "mJ", 1e3),
)


def palpation_section(page: Page, trace: Trace, found: dict[str, Any]) -> None:
    """Add the section on contact with a body; `found` is `summarize(trace)["palpation"]`."""
    deepest = int(np.argmax(np.linalg.norm(trace["deflection"], axis=1)))
    page.section("Deformable body")
    at = pressed_at(trace, deepest)
    picture = deformed_surface(at.body, at.displacement, at.pressure)
    page.figure(
        picture,
        f"Surface of the body at t = {trace.time[deepest]:.3g} s, at the largest deflection, in the body frame: "
        "displacement, and pressure of the tip." + stretched(picture),
    )
    page.figure(force_and_deflection(trace), "Force of the tip on the body, and deflection of the contact patch.")
    if found["path_stiffness_max_N_per_m"] is not None:
        rise = found["path_stiffness_max_N_per_m"] / found["path_stiffness_median_N_per_m"] - 1.0
        page.figure(
            stiffness_along_path_figure(trace),
            f"Stiffness along the path: at most {100 * rise:.3g} % over its median, "
            f"{'more' if rise > JND else 'less'} than the just-noticeable difference of {100 * JND:g} % (band).",
        )
    page.figure(body_energy(trace), "Work of the tip on the body, and energy stored in the body.")
    palpation_table(page, found)


def palpation_table(page: Page, found: dict[str, Any]) -> None:
    """Add the table of the numbers of the contact."""
    shown = [number for number in _NUMBERS if number[1] not in ("saved_J", "at_start_J") or found[number[1]]]
    numbers_table(page, shown, found, "Contact with the body, from the first contact to the end of the run.")
