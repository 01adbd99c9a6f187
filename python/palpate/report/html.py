"""Self-contained HTML page of text, tables, matrices and figures."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Literal

from palpate.files import check_suffix, write_text
from palpate.report.theme import CSS, inline_svg

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Tone = Literal["good", "note", "bad"]
_STATUS: Final = {"match": "✓ match", "erratum": "✎ erratum", "differs": "✗ differs"}
_MINUS: Final = "−"
_FACTS: Final = 5  # facts in a row, at most


class Page:
    """HTML page. Each method appends one element and returns the page.

    Texts may contain `code`, **bold** and *emphasis*; everything else is escaped.
    """

    def __init__(self, title: str, lead: str = "", *, footer: str = "") -> None:
        self.title = title
        self.lead = lead
        self.footer = footer
        self._parts: list[str] = []
        self._sections: list[tuple[str, str]] = []
        self._figures = 0
        self._tables = 0

    def section(self, title: str, anchor: str | None = None) -> Page:
        """Begin a section, which is listed in the contents of the page."""
        name = anchor or _slug(title)
        taken = {used for used, _ in self._sections}
        count = 2
        while name in taken:
            name, count = f"{anchor or _slug(title)}-{count}", count + 1
        self._sections.append((name, title))
        return self.raw(f'<h2 id="{html.escape(name, quote=True)}">{_inline(title)}</h2>')

    def subsection(self, title: str) -> Page:
        """Begin a subsection."""
        return self.raw(f"<h3>{_inline(title)}</h3>")

    def paragraph(self, text: str) -> Page:
        """Add a paragraph."""
        return self.raw(f"<p>{_inline(text)}</p>")

    def items(self, texts: Iterable[str]) -> Page:
        """Add a bulleted list."""
        return self.raw("<ul>" + "".join(f"<li>{_inline(text)}</li>" for text in texts) + "</ul>")

    def verdict(self, text: str, tone: Tone) -> Page:
        """Add the main result as one highlighted sentence."""
        sign = {"good": "✓", "note": "!", "bad": "✗"}[tone]
        return self.raw(
            f'<p class="verdict {tone}"><span aria-hidden="true">{sign}</span><span>{_inline(text)}</span></p>'
        )

    def facts(self, facts: Iterable[tuple[str, Any]]) -> Page:
        """Add large numbers, given as (label, value with unit), in rows of at most five and of about equal length."""
        listed = list(facts)
        entries = "".join(f"<div><dt>{_inline(label)}</dt><dd>{_cell(value)[0]}</dd></div>" for label, value in listed)
        columns = math.ceil(len(listed) / math.ceil(len(listed) / _FACTS)) if listed else 1
        return self.raw(f'<dl class="facts columns-{columns}">{entries}</dl>')

    def table(
        self,
        header: Sequence[str],
        rows: Iterable[Sequence[Any]],
        caption: str = "",
        *,
        units: Sequence[str] | None = None,
        digits: int = 4,
    ) -> Page:
        """Add a table.

        Args:
            header: names of the columns.
            rows: cells. Columns of numbers and dashes are right-aligned, None is a dash, and "match", "erratum" and
                "differs" become badges.
            caption: text after the number of the table.
            units: of the columns, shown below their names.
            digits: significant digits of numbers.

        Raises:
            ValueError: a row, or `units`, has not the length of `header`.
        """
        listed = [list(row) for row in rows]
        for wrong in [row for row in [*listed, *([units] if units else [])] if len(row) != len(header)]:
            raise ValueError(f"a table of {len(header)} columns has a row of {len(wrong)}: {list(wrong)!r:.80}")
        cells = [[_cell(value, digits) for value in row] for row in listed]
        numeric = [all(row[column][1] or row[column][0] == "–" for row in cells) for column in range(len(header))]
        heads = []
        for column, name in enumerate(header):
            unit = f'<span class="unit">{_inline(units[column])}</span>' if units and units[column] else ""
            heads.append(f'<th scope="col"{_right(numeric[column])}>{_inline(name)}{unit}</th>')
        body = "".join(
            "<tr>" + "".join(f"<td{_right(numeric[i])}>{text}</td>" for i, (text, _) in enumerate(row)) + "</tr>\n"
            for row in cells
        )
        self._tables += 1
        title = f"<caption><b>Table {self._tables}.</b> {_inline(caption)}</caption>" if caption else ""
        return self.raw(
            f'<div class="scroll" tabindex="0"><table>{title}<thead><tr>{"".join(heads)}</tr></thead>'
            f"<tbody>\n{body}</tbody></table></div>"
        )

    def matrices(
        self,
        title: str,
        printed: Sequence[Sequence[str | float]],
        computed: Any,
        *,
        differs: Any = None,
        explanation: str = "",
        labels: tuple[str, str] = ("printed", "computed"),
    ) -> Page:
        """Add two matrices side by side, with the entries that differ marked in both.

        Args:
            title: of the pair.
            printed: published entries, as text or numbers.
            computed: entries of the same shape, shown with the decimals of the printed ones.
            differs: whether each entry differs (same shape); None for the result of `differs_in_print`.
            explanation: reason of the differences.
            labels: of the matrices.

        Raises:
            ValueError: the shapes differ.
        """
        values = [[float(entry) for entry in row] for row in computed]
        shape = [len(row) for row in printed]
        if shape != [len(row) for row in values]:
            raise ValueError(
                f"{title}: printed and computed must have one shape, not {shape} and {[*map(len, values)]}"
            )
        left, right = [], []
        for i, row in enumerate(printed):
            texts = [entry if isinstance(entry, str) else f"{entry:g}" for entry in row]
            marks = [
                bool(differs[i][j]) if differs is not None else differs_in_print(text, values[i][j])
                for j, text in enumerate(texts)
            ]
            left.append([(_typeset(text), mark) for text, mark in zip(texts, marks, strict=True)])
            right.append([(_with_decimals_of(text, values[i][j]), marks[j]) for j, text in enumerate(texts)])
        sides = "".join(
            f'<div><p class="side">{_inline(label)}</p><div class="scroll" tabindex="0">{_matrix(rows)}</div></div>'
            for label, rows in zip(labels, (left, right), strict=True)
        )
        why = f'<p class="explain">{_inline(explanation)}</p>' if explanation else ""
        return self.raw(
            f'<div class="pair"><p class="pair-title">{_inline(title)}</p>'
            f'<div class="pair-sides">{sides}</div>{why}</div>'
        )

    def figure(self, figure: Figure, caption: str, *, label: str = "") -> Page:
        """Add a matplotlib figure with a caption; `label` is its text for screen readers."""
        self._figures += 1
        svg = inline_svg(figure, self._figures, label or caption)
        return self.raw(
            f"<figure>{svg}<figcaption><b>Figure {self._figures}.</b> {_inline(caption)}</figcaption></figure>"
        )

    def code(self, text: str, summary: str = "") -> Page:
        """Add preformatted text, such as a file; with a `summary` it is collapsed."""
        block = f"<pre><code>{html.escape(text)}</code></pre>"
        return self.raw(f"<details><summary>{_inline(summary)}</summary>{block}</details>" if summary else block)

    def raw(self, markup: str) -> Page:
        """Add HTML without escaping. The markup must be trusted."""
        self._parts.append(markup)
        return self

    def extend(self, other: Page) -> Page:
        """Append the elements of another page, whose figures and tables keep their numbers."""
        self._parts += other._parts
        self._sections += other._sections
        self._figures, self._tables = self._figures + other._figures, self._tables + other._tables
        return self

    def html(self) -> str:
        """Return the whole page."""
        contents = ""
        if len(self._sections) > 3:
            entries = "".join(f'<li><a href="#{name}">{_inline(title)}</a></li>' for name, title in self._sections)
            contents = f'<nav aria-label="Contents"><ol>{entries}</ol></nav>'
        lead = f'<p class="lead">{_inline(self.lead)}</p>' if self.lead else ""
        footer = f"<footer>{_inline(self.footer)}</footer>" if self.footer else ""
        body = "\n".join(self._parts)
        return (
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f"<title>{html.escape(self.title)}</title>\n<style>{CSS}</style>\n</head>\n<body>\n"
            f'<main class="page">\n<h1>{_inline(self.title)}</h1>\n{lead}\n{contents}\n{body}\n{footer}\n</main>\n'
            "</body>\n</html>\n"
        )

    def save(self, path: str | Path) -> Path:
        """Write the page to an `.html` file atomically; return the path.

        Raises:
            OutputError: the suffix is not `.html`, or the file cannot be written.
        """
        text = self.html()
        file = check_suffix(path, (".html",), "a page")
        return write_text(file, text)


def number(value: float, digits: int = 4) -> str:
    """Return a number with `digits` significant digits, a typographic minus, and powers of ten as 1.2 × 10⁻⁷."""
    if not math.isfinite(value):
        return "∞" if value > 0 else f"{_MINUS}∞" if value < 0 else "not a number"
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(value)))
    if size < -4 or size >= max(digits, 6):
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        power = str(int(exponent)).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
        return f"{_trim(mantissa)} × 10{power}".replace("-", _MINUS)
    return _trim(f"{value:.{max(0, digits - 1 - size)}f}").replace("-", _MINUS)


def differs_in_print(printed: str, computed: float) -> bool:
    """Return whether `computed` differs from `printed` by more than one unit in its last digit.

    A difference of one unit may come from truncation or from rounded intermediate results.
    """
    text = printed.replace(_MINUS, "-").strip()
    mantissa, _, exponent = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    step = 10.0 ** (int(exponent or 0) - decimals)
    return abs(float(text) - computed) > 1.5 * step * (1.0 + 1e-9)


def _with_decimals_of(printed: str, value: float) -> str:
    """Return `value` with as many decimals as `printed` has."""
    mantissa, _, exponent = printed.replace(_MINUS, "-").strip().lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    text = f"{value:.{decimals}e}" if exponent else f"{value:.{decimals}f}"
    return _typeset(text[1:] if text.startswith("-") and float(text) == 0.0 else text)


def _typeset(text: str) -> str:
    return html.escape(text.strip().replace("-", _MINUS))


def _trim(text: str) -> str:
    return text.rstrip("0").rstrip(".") if "." in text else text


def _matrix(rows: Sequence[Sequence[tuple[str, bool]]]) -> str:
    body = "".join(
        "<tr>"
        + "".join(f'<td class="differs">{text}</td>' if mark else f"<td>{text}</td>" for text, mark in row)
        + "</tr>"
        for row in rows
    )
    return f'<table class="matrix"><tbody>{body}</tbody></table>'


def _right(numeric: bool) -> str:
    return ' class="number"' if numeric else ""


def _cell(value: Any, digits: int = 4) -> tuple[str, bool]:
    """Return the HTML of a cell, and whether it is a number."""
    if value is None:
        return "–", False
    if isinstance(value, bool):
        return "yes" if value else "no", False
    if isinstance(value, int):
        return str(value).replace("-", _MINUS), True
    if hasattr(value, "__float__"):
        return number(float(value), digits), True
    text = str(value)
    if text in _STATUS:
        return f'<span class="status {text}">{_STATUS[text]}</span>', False
    is_number = re.fullmatch(r"(under |over )?[-−+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", text) is not None
    return _typeset(text) if is_number else _inline(text), is_number


def _inline(text: str) -> str:
    marked = html.escape(text)
    pieces = re.split(r"(`[^`]+`)", marked)
    for index, piece in enumerate(pieces):
        if piece.startswith("`") and piece.endswith("`") and len(piece) > 2:
            pieces[index] = f"<code>{piece[1:-1]}</code>"
        else:
            bold = re.sub(r"\*\*(?=\S)(.+?)(?<=\S)\*\*", r"<b>\1</b>", piece)
            pieces[index] = re.sub(r"(?<![\w*])\*(?=[^\s*])([^*]+?)(?<=\S)\*(?![\w*])", r"<em>\1</em>", bold)
    return "".join(pieces)


def _slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "section"
