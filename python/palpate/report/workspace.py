"""Page of the critical stiffness over the workspace."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.arrays import Array
from palpate.plotting.style import FAINT, INK, TITLE, new_figure
from palpate.report.html import Page
from palpate.stability.maps.workspace_map import Workspace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import QuadMesh
    from matplotlib.colors import LogNorm
    from matplotlib.figure import Figure


MAP = "cividis"  # perceptually uniform, also for color-blind readers and in gray
AXES = {"y-z": (2, 1), "x-z": (0, 2)}  # horizontal and vertical component of the tip in the panel of a plane
LABELS = ("x, right [mm]", "y, up [mm]", "z, toward the operator [mm]")


def workspace_page(w: Workspace) -> Page:
    """Return the page of a workspace."""
    i = w.least[0]
    page = Page(f"Workspace: {w.title}", f"Critical stiffness of a wall over the reachable poses. {w.loop}.")
    page.verdict(str(w), "good" if w.stable else "bad" if w.worst[i] <= w.least_stable else "note")
    worst = w.worst[np.isfinite(w.worst)]
    page.facts(
        [
            ("minimum", f"{w.worst[i] / 1e3:.4g} N/mm"),
            *([("softest stable wall", f"{w.least_stable / 1e3:.4g} N/mm")] if w.least_stable > 0 else []),
            ("median", f"{np.median(worst) / 1e3:.4g} N/mm"),
            ("at the start", f"{w.worst[0] / 1e3:.4g} N/mm"),
            ("walls evaluated", f"{w.stiffness.size}"),
        ]
    )
    page.figure(
        section_figure(w),
        "Critical stiffness of a wall in the worst direction, on two planes through the start: side view and top view. "
        "Circle: start. Dashed line and cross: axis of the base. Triangle: minimum over all poses, if it lies in the "
        "plane. White: unreachable or nearly singular. Hatched: no wall is stable.",
        label="maps of critical stiffness over the workspace",
    )
    page.figure(
        axes_figure(w),
        "Critical stiffness in the side view for walls normal to x (sideways), y (up) and z (toward the operator).",
        label="maps of critical stiffness for walls normal to each axis",
    )
    page.section("Direction of the wall")
    rows = []
    names = ("x", "y", "z", "largest effective mass", "medium effective mass", "smallest effective mass")
    for k, name in enumerate((*names, "worst of all")):
        values = w.stiffness[:, k] if k < len(names) else w.worst
        finite = values[np.isfinite(values)]
        at = int(np.argmin(values))
        rows.append((name, values[at], float(np.median(finite)), float(finite.max()), _mm(w.tips[at])))
    page.table(
        ("normal of the wall", "minimum", "median", "maximum", "tip at the minimum"), rows,
        "Critical stiffness over the poses.", units=("", "N/m", "N/m", "N/m", "mm"), digits=5,
    )  # fmt: skip
    page.paragraph(
        "At each pose the loop is linearized and discretized exactly. Below its critical stiffness, and above the "
        "softest stable wall where the device is unstable without one, a wall is stable for small motions about the "
        "pose, with the operator named above. Dry friction and encoder quantization are neglected."
    )
    return page


def section_figure(w: Workspace) -> Figure:
    """Return maps of the minimum critical stiffness over the directions, on each plane."""
    return _maps(w, [(name, w.worst, "side view" if name == "y-z" else "top view") for name in w.sections])


def axes_figure(w: Workspace) -> Figure:
    """Return maps of the critical stiffness of walls normal to x, y and z, in the side view."""
    return _maps(w, [("y-z", w.stiffness[:, k], f"walls normal to {'xyz'[k]}") for k in range(3)], height=3.3)


def _maps(w: Workspace, panels: list[tuple[str, Array, str]], height: float = 3.9) -> Figure:
    from matplotlib.colors import LogNorm

    figure, rows = new_figure(1, len(panels), width=9.2, height=height, sharex=False)
    shown = np.concatenate([values[w.sections[name]] for name, values, _ in panels])
    shown = shown[np.isfinite(shown) & (shown > 0)] / 1e3
    low, high = (float(np.percentile(shown, p)) for p in (0, 98)) if shown.size else (0.1, 1.0)
    norm = LogNorm(low, max(high, 1.05 * low))
    image: Any = None
    least = w.tips[w.least[0]]
    for number, (panel, (name, values, title)) in enumerate(zip(rows[0], panels, strict=True)):
        across, up = AXES[name]
        other = 3 - across - up
        image = _map(panel, w, name, values, norm)
        panel.plot(1e3 * w.start[across], 1e3 * w.start[up], "o", color="white", markeredgecolor=INK, markersize=7)
        if abs(least[other] - w.start[other]) < 0.6 * w.spacing:
            panel.plot(1e3 * least[across], 1e3 * least[up], "^", color="white", markeredgecolor=INK, markersize=8)
        if name == "x-z":
            panel.plot(1e3 * w.hinge[across], 1e3 * w.hinge[up], "P", color=INK, markersize=8)
        else:
            panel.axvline(1e3 * w.hinge[across], color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        panel.set_title(title, **TITLE)
        panel.set_xlabel(LABELS[across])
        if number == 0 or name != panels[0][0]:
            panel.set_ylabel(LABELS[up])
        panel.set_aspect("equal")
        panel.grid(visible=False)
    bar = figure.colorbar(image, ax=rows[0], extend="max", shrink=0.85, pad=0.02)
    bar.set_label("critical stiffness [N/mm]")
    ticks = _ticks(low, max(high, 1.05 * low))
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.ax.minorticks_off()
    return figure


def _map(panel: Axes, w: Workspace, name: str, values: Array, norm: LogNorm) -> QuadMesh:
    """Draw one plane, with a square per pose, hatched where no wall is stable."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    across, up = AXES[name]
    index = w.sections[name]
    x, y = w.tips[index][:, across], w.tips[index][:, up]
    column, row = (np.round((v - v.min()) / w.spacing).astype(int) for v in (x, y))
    grid = np.full((row.max() + 1, column.max() + 1), np.nan)
    grid[row, column] = values[index] / 1e3
    edges = [
        1e3 * (v.min() + w.spacing * (np.arange(n + 1) - 0.5)) for v, n in ((x, grid.shape[1]), (y, grid.shape[0]))
    ]
    left, below = (edge[:-1] for edge in edges)
    cells = [Rectangle((left[c], below[r]), 1e3 * w.spacing, 1e3 * w.spacing) for r, c in np.argwhere(grid == 0)]
    panel.add_collection(PatchCollection(cells, facecolor="none", edgecolor=FAINT, hatch="////", linewidth=0))
    return panel.pcolormesh(*edges, np.ma.masked_where(~(grid > 0), grid), norm=norm, cmap=MAP, rasterized=True)


def _ticks(low: float, high: float) -> list[float]:
    """Return three to eight round numbers from low to high, or both ends if there are fewer."""
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    for steps in ((1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7), tuple(np.arange(10, 100) / 10)):
        ticks = [float(f"{d * m:.3g}") for d in decades for m in steps if low * 0.999 <= d * m <= high * 1.001]
        if len(ticks) >= 3:
            return ticks[:: math.ceil(len(ticks) / 8)]
    return [float(f"{low:.3g}"), float(f"{high:.3g}")]


def _mm(tip: Array) -> str:
    return ", ".join(f"{part:.0f}" for part in np.round(1e3 * tip) + 0.0).replace("-", "−")
