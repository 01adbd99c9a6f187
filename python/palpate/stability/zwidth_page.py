"""The picture of a Z-width, with its tables, as one HTML file."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from palpate.report.html import Page
from palpate.report.style import COLOURS, INK, new_figure
from palpate.stability.boundary import Boundary

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from palpate.stability.zwidth import ZWidth

__all__ = ["zwidth_figure", "zwidth_page"]

Array = NDArray[np.float64]


def zwidth_page(z: ZWidth) -> Page:
    """Return the page of a Z-width."""
    name, own = next(iter(z.curves.items()))
    b, k = own.stiffest
    page = Page(
        f"Z-width: {z.title}",
        "Every stiffness K and damping B under a curve is a stable object; the curve is exact, the points were found "
        "by running the loop.",
    )
    page.verdict(_sentence(z, own), "good" if _under(own, *z.here) else "bad")
    facts = [("stiffest object", f"{k / 1e3:.4g} N/mm"), ("its damping", f"{b:.4g} N·s/m")]
    if z.passive is not None:
        facts.append(("stiffest passive object", f"{z.passive[1].max() / 1e3:.4g} N/mm"))
    if z.simulated:
        facts.append(("simulation against theory", f"{100 * max(abs(p.error) for p in z.simulated):.2g} %"))
    page.facts(facts)
    page.figure(
        zwidth_figure(z),
        f"Stable objects ({name}) under the filled curve; other curves: the same loop in other hands. Shaded darkest: "
        "passive, so stable in every passive hand. Points: simulated.",
        label="map of stable stiffness against damping",
    )
    if z.simulated:
        page.section("Simulated against exact")
        page.table(
            ("damping B", "exact K", "simulated K", "difference"),
            [(p.damping, p.exact, p.stiffness, f"{100 * p.error:+.4f} %") for p in z.simulated],
            "Critical stiffness by bisection on the growth of a small swing in the full simulation.",
            units=("N·s/m", "N/m", "N/m", ""),
            digits=6,
        )
    page.section("Who holds it")
    page.table(
        ("operator", "stiffest object", "with damping", "without damping"),
        [(who, c.stiffest[1] / 1e3, c.stiffest[0], _undamped(c)) for who, c in z.curves.items()],
        "The same loop in other hands.",
        units=("", "N/mm", "N·s/m", "N/m"),
    )
    for who in z.never:
        page.paragraph(f"**{who}**: no wall of any size is stable; the device tips over along the surface.")
    return page


def _sentence(z: ZWidth, own: Boundary) -> str:
    b, k = z.here
    where = "inside" if _under(own, b, k) else "outside"
    return f"The scenario's object, K = {k:g} N/m with B = {b:g} N·s/m, lies {where} the stable region."


def _under(own: Boundary, b: float, k: float) -> bool:
    """Return whether (b, k) lies in the region that the curve and the axes enclose."""
    crossings = 0
    for first, last in _pieces(own):
        x, y = own.damping[first:last], own.stiffness[first:last]
        spans = (np.minimum(x[:-1], x[1:]) <= b) & (b < np.maximum(x[:-1], x[1:]))
        at = y[:-1][spans] + (b - x[:-1][spans]) / (x[1:] - x[:-1])[spans] * (y[1:] - y[:-1])[spans]
        crossings += int(np.sum(at > k))
    if b <= own.damping.min() and crossings == 0:
        return bool(k < own.stiffness[int(np.argmin(own.damping))])
    return crossings % 2 == 1


def _undamped(c: Boundary) -> float | None:
    """Return the stiffness at which the curve meets the axis of no damping, N/m; None where it does not."""
    near = c.damping < 1e-6 * c.damping.max()
    return float(c.stiffness[near].max()) if np.any(near) else None


def _pieces(c: Boundary) -> list[tuple[int, int]]:
    """Return (first, past the last) of the stretches of a curve without a jump."""
    if len(c.damping) < 3:
        return [(0, len(c.damping))]
    jump = np.hypot(np.diff(c.damping) / np.ptp(c.damping), np.diff(c.stiffness) / np.ptp(c.stiffness)) > 0.05
    ends = [0, *(np.flatnonzero(jump) + 1).tolist(), len(c.damping)]
    return list(pairwise(ends))


def zwidth_figure(z: ZWidth) -> Figure:
    """Return K against B: exact curves, passive region, simulated points, and the scenario's object."""
    figure, axes = new_figure(1, 1, width=8.0, height=4.6)
    panel = axes[0][0]
    for index, (name, c) in enumerate(z.curves.items()):
        label: str | None = name
        for first, last in _pieces(c):
            x, y = c.damping[first:last], c.stiffness[first:last] / 1e3
            if index == 0:
                panel.fill_between(x, y, color=COLOURS[0], alpha=0.12, linewidth=0)
            panel.plot(x, y, color=COLOURS[index % len(COLOURS)], label=label, linestyle="-" if index == 0 else "--")
            label = None
    if z.passive is not None:
        panel.fill_between(z.passive[0], z.passive[1] / 1e3, color=INK, alpha=0.45, linewidth=0, label="passive")
    if z.simulated:
        panel.plot(
            [p.damping for p in z.simulated],
            [p.stiffness / 1e3 for p in z.simulated],
            "o",
            markersize=5,
            color=INK,
            label="simulated",
        )
    panel.plot(
        [z.here[0]],
        [z.here[1] / 1e3],
        "x",
        markersize=9,
        markeredgewidth=2.0,
        color=COLOURS[1],
        clip_on=False,  # it often lies on an axis
        zorder=5,
        label="the scenario's object",
    )
    panel.set_xlabel("damping B [N·s/m]")
    panel.set_ylabel("stiffness K [N/mm]")
    panel.set_xlim(left=0)
    panel.set_ylim(bottom=0)
    panel.legend(loc="best")
    return figure
