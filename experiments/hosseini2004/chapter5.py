"""Chapter 5: table 5.1 and figures 5.1 to 5.4, deflection of deformable cubes; then the slide."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from palpate.report import Page

from experiments.hosseini2004 import figures
from experiments.hosseini2004.cases import design
from experiments.hosseini2004.chapter5_sliding import sliding
from experiments.hosseini2004.checks import Check, at_most, compare, printed, within
from experiments.hosseini2004.loops import Loop, respond

__all__ = ["chapter5"]

ROWS: Final = (3.5, 1.0, 2.0, 2.5, 3.0)  # N/mm, as table 5.1 orders them
FORCE: Final = 8.5  # N


def chapter5(page: Page, tick: Callable[[str, float], None]) -> list[Check]:
    """Compute table 5.1 and the slides for the page, return their checks; `tick(text, fraction)` reports progress."""
    page.section("Chapter 5: deformable objects", "chapter-5")
    controllers = {"lead–lag": design("D", "lead_lag"), "LQG": design("D", "lqg")}
    tick("deflections", 0.0)
    loops = {
        name: [respond(c, force=FORCE, stiffness=k, duration=0.8) for k in ROWS] for name, c in controllers.items()
    }
    checks = _table(page, loops)
    tick("figures", 0.1)
    for name, number in (("lead–lag", "5.1 and 5.3"), ("LQG", "5.2 and 5.4")):
        series = {
            f"{loop.stiffness:g} N/mm": (loop.time, loop.deflection)
            for loop in sorted(loops[name], key=lambda loop: loop.stiffness)
        }
        page.figure(
            figures.steps(
                {"": series},
                targets=[loop.ideal for loop in loops[name]],
                until=0.2,
                lowest=-0.5,
                highest=10.0,
            ),
            f"{name[0].upper() + name[1:]}, 8.5 N on each axis, nonlinear device (the thesis's figures {number}). "
            "Dashed: force / stiffness.",
        )
    return [*checks, *sliding(page, lambda text, part: tick(text, 0.15 + 0.85 * part))]


def _table(page: Page, loops: dict[str, list[Loop]]) -> list[Check]:
    checks: list[Check] = []
    rows = []
    for lead_lag, lqg in zip(loops["lead–lag"], loops["LQG"], strict=True):
        key = f"tab5.1-{lead_lag.stiffness:.1f}"
        entry = printed(key)
        desired, thesis_lead_lag, thesis_lqg = (float(text) for text in entry.rows[0])
        ideal = lead_lag.ideal
        desired_check = _desired(key, ideal)
        mine = [
            desired_check,
            at_most(
                f"{key}-lead-lag",
                f"lead–lag on {lead_lag.stiffness:g} N/mm: steady error in z (thesis: {thesis_lead_lag:g} mm)",
                abs(thesis_lead_lag - ideal),
                abs(float(lead_lag.error[2])),
                "mm",
                where=entry.where,
                note=f"{lead_lag.steady[2]:.4f} mm of {ideal:.4f}; no worse than the thesis; {_transient(lead_lag)}",
            ),
            at_most(
                f"{key}-lqg",
                f"LQG on {lqg.stiffness:g} N/mm: steady error in z (thesis: {thesis_lqg:g} mm)",
                abs(thesis_lqg - ideal),
                abs(float(lqg.error[2])),
                "mm",
                tolerance=0.005,
                where=entry.where,
                note=f"{lqg.steady[2]:.4f} mm of {ideal:.4f}; no worse than the thesis, whose deflection is printed to "
                f"half of 0.01 mm; {_transient(lqg)}",
            ),
            within(
                f"{key}-lqg-exact",
                f"LQG on {lqg.stiffness:g} N/mm: steady deflection in z against F/K",
                ideal,
                float(lqg.steady[2]),
                "mm",
                1e-3 * ideal,
                where=entry.where,
                note="within 0.1 %",
            ),
        ]
        checks += mine
        status = "erratum" if any(c.status == "erratum" for c in mine) else "match"
        if any(c.status == "differs" for c in mine):
            status = "differs"
        rows.append((f"{lead_lag.stiffness:g}", f"{desired:.2f}", f"{ideal:.4f}", f"{thesis_lead_lag:.2f}",
                     f"{lead_lag.steady[2]:.4f}", f"{thesis_lqg:.2f}", f"{lqg.steady[2]:.4f}", status))  # fmt: skip
    page.table(
        ["stiffness", "desired", "F/K", "lead–lag", "lead–lag", "LQG", "LQG", "status"],
        rows,
        "Table 5.1: deflection in z at 8.5 N on each axis, nonlinear device, one fixed controller of each kind. The "
        "erratum is 2.42 for 8.5/3.5 = 2.4286: digits cut, not rounded.",
        units=["N/mm", "printed, mm", "mm", "thesis, mm", "palpate, mm", "thesis, mm", "palpate, mm", ""],
    )  # fmt: skip
    transient = [
        (f"{a.stiffness:g}", f"{a.overshoot:.1f}", _ms(a), f"{b.overshoot:.1f}", _ms(b))
        for a, b in zip(loops["lead–lag"], loops["LQG"], strict=True)
    ]
    page.table(
        ["stiffness", "lead–lag overshoot", "lead–lag settling", "LQG overshoot", "LQG settling"],
        transient,
        "The transient beside it: the worst of the three axes; settling to 5 %.",
        units=["N/mm", "%", "ms", "%", "ms"],
    )
    return checks


def _desired(key: str, ideal: float) -> Check:
    """The printed desired deflection against F/K."""
    text = printed(key)
    values = np.array([[ideal, *text.values[0, 1:]]])
    return compare(key, values)[0]


def _ms(loop: Loop) -> str:
    return "–" if loop.settling is None else f"{loop.settling * 1e3:.0f}"


def _transient(loop: Loop) -> str:
    settling = "not reached" if loop.settling is None else f"{loop.settling * 1e3:.0f} ms"
    return f"overshoot {loop.overshoot:.1f} %, 5 % settling {settling}"
