"""Page of a Z-width map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from palpate.plotting.style import COLORS, INK, TITLE, new_figure
from palpate.report.html import Page
from palpate.stability.maps.boundary_curve import Boundary
from palpate.stability.maps.simulated import SimulatedBoundary
from palpate.stability.maps.zwidth_map import ZWidth, written

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


MARGIN = 1.12  # size of the map over the extent of the scenario's own curve
DOTS = 40  # approximate number drawn
ROOM = 0.3  # share of the panel near the origin in both directions below which a region has no room for its name
BEYOND = 1.15  # size over the map from which another operator's curve has a figure of its own


def zwidth_page(z: ZWidth) -> Page:
    """Return the page of a Z-width."""
    name, own = next(iter(z.curves.items()))
    b, k = own.stiffest
    page = Page(
        f"Z-width: {z.title}",
        f"An object of stiffness K and damping B below a curve is stable{', but for the bands below' * bool(z.gaps)}. "
        "The curve is computed from the linearized "
        "loop" + ("." if z.simulated is None else "; the dots come from simulations."),
    )
    page.verdict(z.verdict, "good" if z.stable_here else "bad")
    facts = [(f"stiffest object at B = {b:.3g} N·s/m, the peak of the curve", written(k))]
    if z.stiffest_here is not None:
        facts.insert(0, (f"stiffest object at B = {z.here[0]:.3g} N·s/m, as in the scenario", written(z.stiffest_here)))
    if z.min_stable_stiffness > 0.0:
        facts.append(("softest stable object", written(z.min_stable_stiffness)))
    if z.passive is not None:
        facts.append(("stiffest passive object", written(z.passive[1].max())))
    page.facts(facts)
    for remark in z.gap_remarks:
        page.paragraph(f"**Unstable band**: {remark}")
    page.figure(
        zwidth_figure(z),
        f"Filled: stable objects ({name}). {_dashed(z)}"
        + ("" if z.corner is not None else _dark(z))
        + _runs(z.simulated),
        label="map of stable stiffness against damping",
    )
    close = close_figure(z)
    if close is not None:
        shown = [
            *([f"complete curves of {'the modes' if _of_modes(z) else 'other operators'}"] if _has_larger(z) else []),
            *(["the map near its origin"] if z.corner is not None else []),
        ]
        title = " and ".join(shown)
        corner = "" if z.corner is None else _dark(z) + _runs(z.corner.simulated)
        page.figure(close, f"{title[0].upper()}{title[1:]}. {corner}", label=title)
    if z.passive is None:
        page.paragraph(f"**No passive region**: {z.not_passive}.")
    kinds = _of_modes(z)
    if kinds:
        page.paragraph(
            "The forces of the surface are scaled at the depths of the run. A stiffer surface under the same force is "
            "touched less deep, and may be stable above the curve; `palpate certify` decides that."
        )
    page.section("Contact modes" if kinds else "Operators")
    page.table(
        ("contact mode" if kinds else "operator", "stiffest object", "with damping", "without damping"),
        [(who, c.stiffest[1] / 1e3, c.stiffest[0], _undamped(c)) for who, c in z.curves.items()],
        f"Limits of the same loop for each {'kind of mode' if kinds else 'operator'}.",
        units=("", "N/mm", "N·s/m", "N/m"),
    )
    for who in z.never:
        page.paragraph(f"**{who}**: no wall is stable; the device is unstable along the surface.")
    page.section("Simulations")
    page.paragraph(_method(z))
    return page


def _of_modes(z: ZWidth) -> bool:
    """Return whether the curves are of the contact modes of a mesh, not of operators."""
    return "every contact mode" in z.curves


def _dashed(z: ZWidth) -> str:
    if len(z.curves) == 1:
        return ""
    return f"Dashed: {'modes of one kind' if _of_modes(z) else 'the same loop with other operators'}. "


def _dark(z: ZWidth) -> str:
    return "" if z.passive is None else "Dark: passive, and therefore stable with every passive operator. "


def _runs(found: SimulatedBoundary | None) -> str:
    if found is None:
        return ""
    return f"Dots: stability limit of the simulated loop ({found.runs:,} runs of {found.duration:.2g} s)."


def _method(z: ZWidth) -> str:
    if z.simulated is None:
        return f"There is no simulated boundary: {z.not_simulated}."
    off = z.simulated.distance
    return (
        "The loop was simulated on a coarse grid of K and B, which was refined between growing and decaying "
        f"oscillations: {z.simulated.runs:,} runs instead of {z.simulated.cells:,}, independent of the computed curve. "
        "The excitation is a force of 1 mN. Dry friction, encoder quantization and drive limits are left out, because "
        "they bound an oscillation and would hide its growth. At a corner of the curve two modes are at their limits "
        "at once, and the dots are less accurate there. The dots are "
        f"{100 * np.median(off):.1g} % of the map off the computed curve (median), at most {100 * off.max():.2g} %."
    )


def _undamped(c: Boundary) -> float | None:
    """Return the critical stiffness without damping, N/m; None if the curve does not reach it."""
    undamped = c.damping < 1e-6 * c.damping.max()
    return float(c.stiffness[undamped].max()) if np.any(undamped) else None


def zwidth_figure(z: ZWidth) -> Figure:
    """Return the map of K against B at the scale of the scenario's own curve."""
    figure, axes = new_figure(1, 1, width=8.0, height=4.6)
    panel = axes[0][0]
    own = next(iter(z.curves.values()))
    wide, high = MARGIN * float(own.damping.max()), MARGIN * float(own.stiffness.max()) / 1e3
    _curves(panel, z.curves.items())
    if z.corner is None:
        _passive(panel, z, 1e-3)
    _dots(panel, z.simulated, 1e-3, DOTS)
    _object(panel, z, 1e-3)
    if z.corner is not None:
        panel.annotate(
            "enlarged below",
            (0.0, 0.0),
            xytext=(0.035 * wide, 0.09 * high),
            arrowprops={"arrowstyle": "->", "color": INK},
        )
    _frame(panel, max(wide, 1.1 * z.here[0]), max(high, 1.1e-3 * z.here[1]), "N/mm")
    handles, labels = panel.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3)
    return figure


def close_figure(z: ZWidth) -> Figure | None:
    """Return panels of the complete curves and of the map near its origin; None if neither is needed."""
    beyond = _has_larger(z)
    count = beyond + (z.corner is not None)
    if count == 0:
        return None
    figure, axes = new_figure(1, count, width=4.3 * count, height=3.3, sharex=False)
    panels = axes[0]
    if beyond:
        panel = panels[0]
        _curves(panel, z.curves.items())
        wide = max(float(c.damping.max()) for c in z.curves.values())
        high = max(float(c.stiffness.max()) for c in z.curves.values())
        _frame(panel, 1.05 * wide, 1.05e-3 * high, "N/mm")
        panel.set_title("complete curves", **TITLE)
    if z.corner is not None:
        panel = panels[-1]
        _curves(panel, [("", z.corner.edge)], 1.0)
        _passive(panel, z, 1.0)
        _dots(panel, z.corner.simulated, 1.0, DOTS // 2)
        wide, high = z.corner.window
        if z.here[0] <= wide and z.here[1] <= high:  # it is not clipped, and would shrink the panel
            _object(panel, z, 1.0)
        _frame(panel, *z.corner.window, "N/m")
        panel.set_title("near the origin", **TITLE)
        if z.passive is not None:
            b, k = (float(values.max()) for values in z.passive)
            if min(b / wide, k / high) > ROOM:
                panel.annotate("passive", (b / 3, k / 3), ha="center", va="center")
            else:
                arrow = {"arrowstyle": "->", "color": INK}
                panel.annotate("passive", (b / 3, k / 3), xytext=(0.1 * wide, 0.15 * high), arrowprops=arrow)
    return figure


def _has_larger(z: ZWidth) -> bool:
    """Return True if the curve of another operator leaves the map of the scenario's own."""
    own = next(iter(z.curves.values()))
    return any(
        c.damping.max() > BEYOND * MARGIN * own.damping.max()
        or c.stiffness.max() > BEYOND * MARGIN * own.stiffness.max()
        for c in z.curves.values()
    )


def _curves(panel: Axes, curves: Iterable[tuple[str, Boundary]], scale: float = 1e-3) -> None:
    for index, (name, c) in enumerate(curves):
        label: str | None = f"{name}, computed" if index == 0 else name
        if index == 0:
            _fill(panel, c, scale)
        for first, last in c.pieces:
            x, y = c.damping[first:last], c.stiffness[first:last] * scale
            panel.plot(x, y, color=COLORS[index % len(COLORS)], label=label, linestyle="-" if index == 0 else "--")
            label = None


def _fill(panel: Axes, c: Boundary, scale: float) -> None:
    """Fill the stable objects: those below a piece of the curve, less those below a piece under it."""
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

    pieces = [np.column_stack([c.damping[a:b], c.stiffness[a:b] * scale]) for a, b in c.pieces]
    rings = [np.vstack([piece, piece[-1] * [1, 0], piece[0] * [1, 0], piece[0]]) for piece in pieces]
    turned = []
    for piece, ring in zip(pieces, rings, strict=True):
        depth = sum(Path(other).contains_point(piece[len(piece) // 2]) for other in rings if other is not ring)
        (x, y), (ahead, above) = ring[:-1].T, ring[1:].T
        left = np.sum(x * above - y * ahead) > 0.0
        turned.append(Path(ring if left == (depth % 2 == 0) else ring[::-1], closed=True))  # a hole turns the other way
    panel.add_patch(PathPatch(Path.make_compound_path(*turned), color=COLORS[0], alpha=0.12, linewidth=0))


def _passive(panel: Axes, z: ZWidth, scale: float) -> None:
    if z.passive is not None:
        b, k = z.passive
        panel.fill_between(b, k * scale, color=INK, alpha=0.3, linewidth=0, label="passive: stable with every operator")


def _dots(panel: Axes, found: SimulatedBoundary | None, scale: float, count: int) -> None:
    if found is not None:
        every = slice(None, None, max(1, math.ceil(len(found.damping) / count)))
        x, y = found.damping[every], found.stiffness[every] * scale
        panel.plot(x, y, "o", markersize=3.5, color=INK, label="simulated", zorder=4)


def _object(panel: Axes, z: ZWidth, scale: float) -> None:
    panel.plot(
        [z.here[0]],
        [z.here[1] * scale],
        "x",
        markersize=9,
        markeredgewidth=2.0,
        color=COLORS[1],
        clip_on=False,  # the object often lies on an axis
        zorder=5,
        label="the scenario's object",
    )


def _frame(panel: Axes, wide: float, high: float, unit: str) -> None:
    panel.set_xlabel("damping B [N·s/m]")
    panel.set_ylabel(f"stiffness K [{unit}]")
    panel.set_xlim(0, wide)
    panel.set_ylim(0, high)
