"""The style of palpate's figures: colors that color-blind readers can distinguish, on light and on dark paper.

Figures are drawn with stand-in colors. On a page they follow its theme (`palpate.report.theme`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["COLOURS", "FAINT", "INK", "PAPER", "RC", "TITLE", "new_figure"]

# Okabe & Ito 2008, without its yellow, which is lost on white paper; its black is the ink.
COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
INK: Final = "#1d2126"  # text and axes
FAINT: Final = "#8a9099"  # grid, targets' labels
PAPER: Final = "#fefefe"
# matplotlib asks for a title's looks when it is set, not when the figure is made.
TITLE: Final[dict[str, Any]] = {"loc": "left", "fontsize": 10.5, "fontweight": "bold"}

RC: Final[dict[Any, Any]] = {
    "axes.axisbelow": True,
    "axes.edgecolor": INK,
    "axes.facecolor": "none",
    "axes.formatter.limits": (-4, 5),
    "axes.formatter.use_mathtext": False,  # parsing it takes most of the time a report takes
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
    """Return a figure in palpate's style and its axes as rows of columns; sizes in inches, `height` of one row.

    Nothing global is touched: no pyplot, so a server or a test may draw in threads.
    """
    import matplotlib as mpl
    from cycler import cycler
    from matplotlib.figure import Figure

    with mpl.rc_context({**RC, "axes.prop_cycle": cycler(color=list(COLOURS))}):
        figure = Figure(figsize=(width, height * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False)
        return figure, [list(row) for row in axes]
