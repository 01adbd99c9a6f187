"""Theme of a page: style sheet, and SVG figures whose colors follow the theme."""

from __future__ import annotations

import html
import io
import re
from importlib import resources
from typing import TYPE_CHECKING, Final

from palpate.plotting.style import COLORS, FAINT, INK, PAPER, RC

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_UNDATED: Final = {"Date": None, "Creator": None}
_ON_DARK: Final = ("#4aa8e0", "#f08a3c", "#2cc295", "#e2a0c4", "#f0b840", "#8fd0f5")


def _variables(colors: tuple[str, ...]) -> str:
    """Return the CSS variables of the colors of lines."""
    return "".join(f"--c{index}:{color};" for index, color in enumerate(colors))


_LIGHT: Final = (
    f"--paper:#fff;--panel:#f5f6f8;--ink:{INK};--soft:#59616b;--faint:{FAINT};--line:#d9dde2;--link:#005a8c;"
    "--good:#00694d;--good-paper:#e2f4ee;--note:#7a5200;--note-paper:#fdf1d8;--bad:#a33600;--bad-paper:#fde8de;"
    + _variables(COLORS)
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


def inline_svg(figure: Figure, number: int, label: str) -> str:
    """Return a figure as SVG for HTML; its ids begin with f`number`-, and its colors follow the theme of the page."""
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context(RC):
        figure.savefig(buffer, format="svg", dpi=200, metadata=_UNDATED, bbox_inches="tight")
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'id="', f'id="f{number}-', svg)
    svg = re.sub(r'href="#', f'href="#f{number}-', svg)
    svg = re.sub(r"url\(#", f"url(#f{number}-", svg)
    svg = re.sub(r' d="([^"]*)"', lambda m: f' d="{_shorten(m[1])}"', svg)
    for index, color in enumerate(COLORS):
        svg = svg.replace(color, f"var(--c{index})")
    svg = svg.replace(INK, "var(--ink)").replace(FAINT, "var(--faint)").replace(PAPER, "var(--paper)")
    svg = svg.replace("#000000", "var(--ink)").replace("#ffffff", "var(--paper)")
    head = svg[: svg.index(">") + 1]
    width = re.search(r'width="([\d.]+)pt"', head)
    shown = f"{float(width[1]) * 96 / 72:.0f}px" if width else "100%"
    new_head = re.sub(r' (?:width|height)="[^"]*"', "", head)
    # Black shapes have no color attribute in the file; they inherit the ink of the page.
    style = f"max-width:{shown};fill:var(--ink)"
    new_head = new_head.replace("<svg", f'<svg role="img" aria-label="{html.escape(label)}" style="{style}"', 1)
    return new_head + svg[len(head) :]


def _shorten(path: str) -> str:
    """Return a path with coordinates rounded to 0.01 pt and collapsed whitespace."""
    return re.sub(r"\s+", " ", re.sub(r"-?\d+\.\d{3,}", lambda m: f"{float(m[0]):.2f}", path)).strip()
