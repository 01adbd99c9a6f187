"""Style of the figures: colors that color-blind readers can distinguish.

A page replaces the colors by those of its theme (`palpate.report.theme`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe & Ito 2008, without yellow, which has too little contrast on white; INK takes the place of black.
COLORS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
INK: Final = "#1d2126"  # text and axes
FAINT: Final = "#8a9099"  # grid
PAPER: Final = "#fefefe"
# matplotlib applies the style of a title when it is set, not when the figure is created.
TITLE: Final[dict[str, Any]] = {"loc": "left", "fontsize": 10.5, "fontweight": "bold"}

RC: Final[dict[Any, Any]] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.facecolor": "none",
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.useoffset": False,
    "axes.formatter.use_mathtext": False,  # its parser dominates the time of a report
    "axes.grid": True,
    "axes.labelcolor": INK,
    "axes.labelsize": 10.0,
    "axes.linewidth": 0.8,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.facecolor": "none",
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "grid.alpha": 0.35,
    "grid.color": FAINT,
    "grid.linewidth": 0.6,
    "legend.fontsize": 9.5,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "lines.solid_capstyle": "round",
    "savefig.facecolor": "none",
    "svg.fonttype": "path",
    "svg.hashsalt": "palpate",
    "text.color": INK,
    "xtick.color": INK,
    "xtick.labelsize": 9.5,
    "ytick.color": INK,
    "ytick.labelsize": 9.5,
}


def new_figure(
    rows: int = 1,
    columns: int = 1,
    *,
    width: float = 8.6,
    height: float = 2.9,
    sharex: bool = True,
    sharey: bool = False,
) -> tuple[Figure, list[list[Axes]]]:
    """Return a figure in palpate's style and its axes, by rows.

    The function does not use pyplot or other global state, so it can run in threads.

    Args:
        rows: number of rows.
        columns: number of columns.
        width: of the figure, inches.
        height: of one row, inches.
        sharex: whether the axes share the x axis.
        sharey: whether the axes share the y axis.
    """
    import matplotlib as mpl
    from cycler import cycler
    from matplotlib.figure import Figure

    with mpl.rc_context({**RC, "axes.prop_cycle": cycler(color=list(COLORS))}):
        figure = Figure(figsize=(width, height * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False)
        return figure, [list(row) for row in axes]
