"""Page of a sweep: numbers of cells by verdict, and a map over one or two axes."""

from __future__ import annotations

from palpate.plotting.style import new_figure
from palpate.report.html import Page
from palpate.simulation.verdict import State
from palpate.sweeps.axes import SweepError
from palpate.sweeps.run import Sweep
from palpate.sweeps.sweep_plot import MOST, plot_sweep


def sweep_page(found: Sweep) -> Page:
    """Return the page of a sweep."""
    page = Page(f"Sweep: {found.plan.tables.get('title', '')}", " × ".join(f"{a.path} ({len(a)})" for a in found.axes))
    counts = found.outcomes.tally()
    page.table(
        ["verdict", "cells", "share"],
        [
            (state.label, f"{count:,}", f"{100 * count / found.plan.count:.3g}")
            for state, count in zip(State, counts, strict=True)
            if count
        ],
        "Verdicts of the cells.",
        units=["", "", "%"],
    )
    page.paragraph(f"{str(found.excitation).capitalize()}.")
    if found.plan.tables.get("controller", {}).get("kind", "none") not in ("none", "gain", "state_space"):
        when = "once, for the scenario as it stands" if found.plan.design == "once" else "for each cell"
        page.paragraph(f"The controller is designed {when}.")
    try:
        figure, rows = new_figure(1, 1, height=4.2)
        plot_sweep(found, rows[0][0])
    except SweepError:
        return page
    part = any(len(axis) > MOST for axis in found.axes)
    drawn = f" Of an axis at most {MOST:,} values are drawn." if part else ""
    caption = f"Verdict of each cell.{drawn} Line: where the linear loop is at its limit."
    page.figure(figure, caption, label="map of verdicts")
    return page
