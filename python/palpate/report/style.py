"""How palpate's figures and pages look: colours that colour-blind people tell apart, on light and on dark paper.

Figures are drawn with stand-in colours; on a page they follow its theme (`inline_svg` turns them into CSS variables).
"""

from __future__ import annotations

import io
import re
from importlib import resources
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["COLOURS", "CSS", "FAINT", "INK", "PAPER", "TITLE", "inline_svg", "new_figure"]

# Okabe & Ito 2008, without its yellow, which is lost on white paper; its black is the ink.
COLOURS: Final = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
INK: Final = "#1d2126"  # text and axes
FAINT: Final = "#8a9099"  # grid, targets' labels
PAPER: Final = "#fefefe"
# matplotlib asks for a title's looks when it is set, not when the figure is made.
TITLE: Final[dict[str, Any]] = {"loc": "left", "fontsize": 10.5, "fontweight": "bold"}
_UNDATED: Final = {"Date": None, "Creator": None}
_ON_DARK: Final = ("#4aa8e0", "#f08a3c", "#2cc295", "#e2a0c4", "#f0b840", "#8fd0f5")

_RC: Final[dict[Any, Any]] = {
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

    with mpl.rc_context({**_RC, "axes.prop_cycle": cycler(color=list(COLOURS))}):
        figure = Figure(figsize=(width, height * rows), layout="constrained")
        axes = figure.subplots(rows, columns, sharex=sharex, sharey=sharey, squeeze=False)
        return figure, [list(row) for row in axes]


def inline_svg(figure: Figure, number: int, label: str) -> str:
    """Return a figure as SVG to stand in HTML: its ids begin with f`number`-, its colours follow the page's theme."""
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context(_RC):
        figure.savefig(buffer, format="svg", dpi=200, metadata=_UNDATED, bbox_inches="tight")
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'id="', f'id="f{number}-', svg)
    svg = re.sub(r'href="#', f'href="#f{number}-', svg)
    svg = re.sub(r"url\(#", f"url(#f{number}-", svg)
    svg = re.sub(r' d="([^"]*)"', lambda m: f' d="{_shorter(m[1])}"', svg)
    for index, colour in enumerate(COLOURS):
        svg = svg.replace(colour, f"var(--c{index})")
    svg = svg.replace(INK, "var(--ink)").replace(FAINT, "var(--faint)").replace(PAPER, "var(--paper)")
    svg = svg.replace("#000000", "var(--ink)").replace("#ffffff", "var(--paper)")
    head = svg[: svg.index(">") + 1]
    width = re.search(r'width="([\d.]+)pt"', head)
    shown = f"{float(width[1]) * 96 / 72:.0f}px" if width else "100%"
    new_head = re.sub(r' (?:width|height)="[^"]*"', "", head)
    # What is drawn in black names no colour in the file: it takes what it inherits, here the page's ink.
    look = f"max-width:{shown};fill:var(--ink)"
    new_head = new_head.replace("<svg", f'<svg role="img" aria-label="{_attribute(label)}" style="{look}"', 1)
    return new_head + svg[len(head) :]


def _shorter(path: str) -> str:
    """Cut the coordinates of a path to a hundredth of a point; collapse its whitespace."""
    return re.sub(r"\s+", " ", re.sub(r"-?\d+\.\d{3,}", lambda m: f"{float(m[0]):.2f}", path)).strip()


def _attribute(text: str) -> str:
    return text.replace("&", "&amp;").replace('"', "&quot;").replace("<", "&lt;")


def _variables(colours: tuple[str, ...]) -> str:
    return "".join(f"--c{index}:{colour};" for index, colour in enumerate(colours))


_LIGHT: Final = (
    f"--paper:#fff;--panel:#f5f6f8;--ink:{INK};--soft:#59616b;--faint:{FAINT};--line:#d9dde2;--link:#005a8c;"
    "--good:#00694d;--good-paper:#e2f4ee;--note:#7a5200;--note-paper:#fdf1d8;--bad:#a33600;--bad-paper:#fde8de;"
    + _variables(COLOURS)
)
_DARK: Final = (
    "--paper:#14171b;--panel:#1d2126;--ink:#e6e9ed;--soft:#a9b1bb;--faint:#7d858f;--line:#343a42;--link:#6cbdf0;"
    "--good:#5fd4b0;--good-paper:#12332a;--note:#f0c060;--note-paper:#3a2d0f;--bad:#ff9a6b;--bad-paper:#43200f;"
    + _variables(_ON_DARK)
)

CSS: Final = (
    f":root {{ color-scheme: light dark; {_LIGHT} }}\n"
    f"@media (prefers-color-scheme: dark) {{ :root {{ {_DARK} }} }}\n"
    f"@media print {{ :root {{ color-scheme: light; {_LIGHT} }} }}\n"
    + resources.files("palpate.report").joinpath("page.css").read_text("utf-8")
)
