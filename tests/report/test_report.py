"""Pages and figures: one file that fetches nothing, well-formed, safe with any text, and true to the numbers in it."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from palpate import simulate
from palpate.errors import PalpateError
from palpate.metrics import summarize
from palpate.plotting import figures
from palpate.plotting.style import new_figure
from palpate.report import Page
from palpate.report.contact import in_column, numbers_table
from palpate.report.html import _cell, differs_in_print, number
from palpate.report.run import _axes, _energy, run_page
from palpate.report.sweep import sweep_page
from palpate.report.theme import CSS, inline_svg
from palpate.simulation.trace import Trace
from palpate.simulation.verdict import State
from palpate.sweeps import sweep

VOID = {"meta", "link", "br", "hr", "img", "input", "path", "use", "rect", "line", "circle"}
FETCHES = {"src", "href", "xlink:href", "srcset", "data", "action", "poster"}


class Reader(HTMLParser):
    """Parses a page, checks that tags nest, and collects what tests ask for."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.links: list[str] = []
        self.ids: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._seen(tag, dict(attrs))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._seen(tag, dict(attrs))

    def handle_endtag(self, tag: str) -> None:
        if tag in VOID:
            return
        assert self.open, f"</{tag}> closes nothing"
        assert self.open[-1] == tag, f"</{tag}> closes <{self.open[-1]}>"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if "style" not in self.open and data.strip():
            self.words.append(data.strip())

    def _seen(self, tag: str, attributes: dict[str, str | None]) -> None:
        self.tags.append((tag, attributes))
        self.links += [str(attributes[name]) for name in FETCHES & set(attributes)]
        if attributes.get("id"):
            self.ids.append(str(attributes["id"]))

    def cells(self, tag: str = "td") -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module")
def pressed() -> Trace:
    return simulate(
        {
            "device": {"name": "phantom-premium-1.5a"},
            "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "0.5 ms"},
            "reference": {"force": ["0 N", "1 N", "2 N"]},
            "object": {"stiffness": "1 N/mm"},
            "controller": {"kind": "lqg"},
            "run": {"duration": "0.2 s"},
        }
    )


def whole_page(trace: Trace) -> Page:
    """A page with one of everything."""
    page = Page("Everything & more", "A lead with `code`, **bold** and *emphasis*.", footer="The end.")
    page.section("Verdict").verdict("Stable: K < K_c.", "good").facts([("force", "8.5 N"), ("n", 3)])
    page.section("Tables").table(["axis", "steady", "judged"], [("x", 2.4286, "match"), ("y", None, "erratum")],
                                 "Deflections.", units=["", "mm", ""])  # fmt: skip
    page.section("Matrices").matrices("A", [["1.00", "-2.5"], ["0", "3.88"]], [[1.0, -2.5], [0.0, -4.09]])
    page.subsection("Text").paragraph("a < b").items(["one", "two"]).code("x = <1>", "a file")
    page.section("Figures")
    for draw in (figures.deflection, figures.forces, figures.torques, figures.angles, figures.energy):
        page.figure(draw(trace), f"{draw.__name__} in time")
    return page


@pytest.fixture(scope="module")
def text(pressed: Trace) -> str:
    return whole_page(pressed).html()


def test_a_page_is_well_formed_and_names_are_unique(text: str) -> None:
    """Tags nest and close; five figures share no id, so that none paints with another's clip or glyphs."""
    page = Reader(text)
    assert len(page.ids) == len(set(page.ids))
    assert sum(tag == "svg" for tag, _ in page.tags) == 5
    assert text.startswith("<!doctype html>\n")


def test_a_page_fetches_nothing(text: str) -> None:
    """Self-contained: links stay on the page and lead somewhere; no scripts, frames, images, imports or fonts."""
    page = Reader(text)
    assert page.links
    assert all(link.startswith("#") and link[1:] in page.ids for link in page.links)
    assert not {"script", "iframe", "img", "link", "object", "embed", "base"} & {tag for tag, _ in page.tags}
    assert "@import" not in text
    clips = re.findall(r"url\(([^)]*)\)", text)
    assert clips
    assert all(target.startswith("#") and target[1:] in page.ids for target in clips)
    assert set(re.findall(r"https?://[^\"\s<]*", text)) <= {
        "http://www.w3.org/2000/svg",
        "http://www.w3.org/1999/xlink",
    }


def test_a_figure_is_as_wide_as_its_window_allows(text: str) -> None:
    """On a narrow window it shrinks whole: no width of its own but a largest, and no rule or box that keeps one."""
    page = Reader(text)
    figures_shown = [attributes for tag, attributes in page.tags if tag == "svg"]
    assert figures_shown
    for attributes in figures_shown:
        assert "viewbox" in attributes
        assert not {"width", "height"} & attributes.keys()
        assert re.search(r"(?:^|;)max-width:\d+px", str(attributes["style"]))
        assert not re.search(r"(?:^|;)(min-)?width:", str(attributes["style"]))
    assert text.count("<figure><svg") == len(figures_shown)  # in no box that scrolls
    rules = re.findall(r"([^{}]+)\{([^{}]*)\}", CSS)
    of_figures = ";".join(body for selector, body in rules if re.search(r"figure|svg", selector))
    assert re.search(r"[;\s]width:\s*100%", of_figures)
    assert "min-width" not in of_figures


def test_every_section_is_in_the_contents(text: str) -> None:
    """A page of more than three sections lists them; equal titles get different anchors."""
    assert Reader(text).links[:4] == ["#verdict", "#tables", "#matrices", "#figures"]
    twice = Page("t").section("Same").section("Same").section("Same")
    assert Reader(twice.html()).ids == ["same", "same-2", "same-3"]


def test_a_table_has_its_units_and_numbers_flush_right(text: str) -> None:
    """Units stand under the names, a missing value is a dash, a status is a badge."""
    page = Reader(text)
    assert ("span", {"class": "unit"}) in page.tags
    assert {"mm", "2.429", "–", "✓ match", "✎ erratum"} <= set(page.words)
    heads = {attributes.get("class") for attributes in page.cells("th")}
    assert heads == {None, "number"}
    assert any(attributes.get("class") == "number" for attributes in page.cells())
    assert ("span", {"class": "status erratum"}) in page.tags


def test_entries_that_differ_are_marked_in_both_matrices_and_no_others() -> None:
    """A reader sees at once where print and computation part."""
    page = Page("t").matrices("A", [["1.00", "-2.5"], ["0", "3.88"]], [[1.0, -2.5], [0.0, -4.09]], explanation="why")
    reader = Reader(page.html())
    marks = [attributes.get("class") == "differs" for attributes in reader.cells()]
    assert marks == [False, False, False, True] * 2
    assert "−4.09" in reader.words
    forced = Reader(Page("t").matrices("A", [["1"]], [[1.0]], differs=[[True]]).html())
    assert [attributes.get("class") for attributes in forced.cells()] == ["differs"] * 2


def test_shapes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="a table of 2 columns has a row of 1"):
        Page("t").table(["a", "b"], [(1,)])
    with pytest.raises(ValueError, match="a table of 2 columns has a row of 3"):
        Page("t").table(["a", "b"], [], units=["", "", ""])
    with pytest.raises(ValueError, match="printed and computed must have one shape"):
        Page("t").matrices("A", [["1", "2"]], [[1.0], [2.0]])


hostile = st.text(alphabet=st.sampled_from(list("<>&\"'`*_/ =aA1#\n;")), max_size=30)


@given(words=hostile)
def test_any_text_is_shown_and_never_becomes_markup(words: str) -> None:
    """Titles come from people's files: no text opens a tag, an attribute or an anchor of its own."""
    page = Page(words, words, footer=words).section(words).subsection(words).paragraph(words).items([words])
    page.table([words], [[words]], words, units=[words]).code(words, words or "s").facts([(words, words)])
    page.verdict(words, "bad")
    allowed = {
        "html", "head", "meta", "title", "style", "body", "main", "h1", "p", "h2", "h3", "ul", "li", "div", "table",
        "caption", "thead", "tbody", "tr", "th", "td", "span", "b", "em", "code", "pre", "details", "summary", "dl",
        "dt", "dd", "footer",
    }  # fmt: skip
    reader = Reader(page.html())
    assert {tag for tag, _ in reader.tags} <= allowed
    assert all(set(attributes) <= {"lang", "charset", "name", "content", "class", "id", "scope", "tabindex",
                                   "aria-hidden"} for _, attributes in reader.tags)  # fmt: skip


def test_a_label_cannot_leave_its_attribute() -> None:
    """The words that describe a figure go into an attribute."""
    figure, _ = new_figure()
    page = Page("t").figure(figure, "caption", label='"><script>alert(1)</script>')
    assert "script" not in {tag for tag, _ in Reader(page.html()).tags}


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"),
        (2.428571, "2.429"),
        (-0.5, "−0.5"),
        (8.0, "8"),
        (1234567.0, "1.235 × 10⁶"),
        (99999.0, "99999"),
        (1.2e-7, "1.2 × 10⁻⁷"),
        (-3e8, "−3 × 10⁸"),
        (math.inf, "∞"),
        (-math.inf, "−∞"),
        (math.nan, "not a number"),
    ],
)
def test_numbers_are_written_as_people_write_them(value: float, shown: str) -> None:
    assert number(value) == shown


@given(value=st.floats(min_value=1e-12, max_value=1e12), digits=st.integers(1, 8))
def test_a_written_number_is_within_half_its_last_digit(value: float, digits: int) -> None:
    """What a reader types off the page is the number, to the digits shown."""
    shown = number(value, digits).translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-"))
    mantissa, _, exponent = shown.partition(" × 10")
    assert float(mantissa) * 10.0 ** int(exponent or 0) == pytest.approx(value, rel=0.5001 * 10.0 ** (1 - digits))


@given(value=st.floats(-1e5, 1e5))
def test_numbers_of_one_table_are_compared_at_a_glance(value: float) -> None:
    """No powers of ten: a number is its digits, within half of the fourth, or a bound that holds."""
    shown = in_column(value).replace("−", "-")
    assert re.fullmatch(r"(under |over )?-?\d+(\.\d+)?", shown)
    if shown.startswith("under "):
        assert 0.0 < value < float(shown[6:]) == 1e-4
    elif shown.startswith("over "):
        assert 0.0 > value > float(shown[5:]) == -1e-4
    else:
        assert float(shown) == pytest.approx(value, rel=0.501e-3)


def test_a_bound_stands_flush_right_among_numbers() -> None:
    """4.985e-06 mJ beside 0.7459 mJ; None is a dash."""
    found = {"work_J": 7.459e-4, "lost_J": 4.985e-9, "held_J": None}
    numbers = [(key, key, "mJ", 1e3) for key in found]
    page = Page("t")
    numbers_table(page, numbers, found, "Energy.")
    reader = Reader(page.html())
    assert {"0.7459", "under 0.0001", "–"} <= set(reader.words)
    assert [attributes.get("class") for attributes in reader.cells()] == [None, "number", None] * 3


@pytest.mark.parametrize(
    ("printed", "computed", "differs"),
    [
        ("3.88", 3.884, False),
        ("3.88", 3.894, False),  # last digit off by one: cut instead of rounded
        ("3.88", 3.896, True),
        ("-.0022", 0.0023, True),
        ("64.894", -68.42, True),
        ("1.2e-4", 1.29e-4, False),
        ("1.2e-4", 1.4e-4, True),
        ("−5.70", -5.7004, False),
    ],
)
def test_a_printed_digit_may_be_off_by_one_and_no_more(printed: str, computed: float, differs: bool) -> None:
    assert differs_in_print(printed, computed) is differs


def painted(svg: str) -> set[str]:
    """The colours that a picture's shapes are filled with: their own, or the nearest they stand in; "" if none is."""
    found = set()

    def look(element: ElementTree.Element, inherited: str) -> None:
        own = re.search(r"(?:^|[;\s])fill:\s*([^;]+)", element.get("style", ""))
        colour = own[1].strip() if own else element.get("fill", inherited)
        tag = element.tag.rpartition("}")[2]
        if tag in ("path", "use", "text", "rect") and element.get("id") is None:
            found.add(colour)
        for child in element:
            if child.tag.rpartition("}")[2] not in ("defs", "clipPath"):
                look(child, colour)

    look(ElementTree.fromstring(svg), "")
    return found


def black_and_solid() -> Any:
    """A figure with parts that matplotlib makes black of itself: axes in 3D, and the bar of a colour scale."""
    figure, rows = new_figure()
    rows[0][0].remove()
    solid: Any = figure.add_subplot(1, 1, 1, projection="3d")
    figure.colorbar(solid.scatter([0, 1], [0, 1], [0, 1], c=[0, 1]), label="height [mm]")
    return figure


@pytest.mark.parametrize("draw", [figures.forces, figures.torques, lambda _: black_and_solid()])
def test_whatever_is_written_in_a_figure_follows_the_page(pressed: Trace, draw: Callable[[Trace], Any]) -> None:
    """Nothing is black, said or unsaid: black on the dark theme's paper is not seen. Ink is a variable of the theme."""
    svg = inline_svg(draw(pressed), 1, "label")
    colours = painted(svg)
    assert "var(--ink)" in colours
    assert not {"", "black", "#000000", "#000"} & colours
    assert not re.search(r"stroke:\s*(#000000|#000|black)", svg)


def test_a_page_is_the_same_page_again(pressed: Trace, text: str) -> None:
    """Reproducible output: no dates, no random ids."""
    assert whole_page(pressed).html() == text


def test_a_page_is_written_whole_or_not_at_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A write that fails leaves the old page, and no other file."""
    page = Page("µ → 木")
    path = page.save(tmp_path / "report.html")
    before = path.read_text("utf-8")
    assert before == page.html()

    def stop(*_: object, **__: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(Path, "write_text", stop)
    with pytest.raises(PalpateError, match=r"report\.html: cannot be written: disk full"):
        Page("new").save(path)
    assert path.read_text("utf-8") == before
    assert list(tmp_path.iterdir()) == [path]


def axis_labels(figure: Any) -> list[tuple[str, str]]:
    return [(axis.get_xlabel(), axis.get_ylabel()) for axis in figure.axes]


def test_every_axis_has_its_unit(pressed: Trace) -> None:
    """Time in seconds below, the quantity with its unit on the left of the first panel."""
    units = {figures.deflection: "mm", figures.forces: "N", figures.torques: "N·m", figures.angles: "rad",
             figures.energy: "J"}  # fmt: skip
    for draw, unit in units.items():
        labels = axis_labels(draw(pressed))
        assert all(below == "time [s]" for below, _ in labels)
        assert labels[0][1].endswith(f"[{unit}]")


def test_the_target_line_is_force_over_stiffness(pressed: Trace) -> None:
    """1 N and 2 N on 1 N/mm: dashed at 1 mm and 2 mm; an axis that nothing pushes has its zero."""
    panels = figures.deflection(pressed).axes
    dashed = [line.get_ydata()[0] for panel in panels for line in panel.lines if len(line.get_xdata()) == 2]
    assert dashed == pytest.approx([0.0, 1.0, 2.0])


def test_a_diverging_run_is_drawn_up_to_where_it_diverges() -> None:
    """The figure says from when on."""
    trace = Trace.of(np.linspace(0.0, 0.1, 50), {"deflection": np.ones((50, 3))}, unstable_from=0.12)
    figure = figures.deflection(trace)
    words = [text.get_text() for panel in figure.axes for text in panel.texts]
    assert "unstable from 0.12 s" in words


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 5000))
def test_thinning_keeps_ends_order_and_extremes(seed: int, count: int) -> None:
    """A line drawn of fewer samples shows every peak: its extremes are the data's, its points are data."""
    values = np.random.default_rng(seed).standard_normal(count)
    t, y = figures.thin(np.arange(count), values)
    assert len(t) <= 1700
    assert np.all(np.diff(t) > 0)
    assert (t[0], t[-1]) == (0, count - 1)
    assert (y.min(), y.max()) == (values.min(), values.max())
    assert np.array_equal(values[t.astype(int)], y)


def test_traces_are_compared_in_one_figure(pressed: Trace) -> None:
    figure = figures.compare({"one": pressed, "two": pressed}, targets=(None, 1e-3, 2e-3))
    assert [len(panel.lines) for panel in figure.axes] == [2, 3, 3]
    assert [entry.get_text() for entry in figure.legends[0].get_texts()] == ["one", "two"]
    single = figures.compare({"one": pressed}, components=(2,), targets=(None, 1e-3, 2e-3))
    assert [panel.get_title(loc="left") for panel in single.axes] == ["along z"]
    assert [panel.get_ylabel() for panel in figure.axes] == [single.axes[0].get_ylabel(), "", ""]
    assert [entry.get_text() for entry in single.legends[0].get_texts()] == ["one"]


def test_an_extended_page_keeps_sections_and_numbers_of_both() -> None:
    """Sections are listed in order, and tables go on counting after the pages that were joined."""
    second = Page("b").section("Later").table(["x"], [(1,)], "one")
    page = Page("a").section("First").table(["x"], [(1,)]).extend(second).section("End").table(["x"], [(1,)], "two")
    text = page.section("More").html()
    assert re.findall(r'<h2 id="([^"]+)"', text) == ["first", "later", "end", "more"]
    assert [*re.findall(r"<b>Table (\d)", text)] == ["1", "3"]


@pytest.mark.parametrize(("count", "columns"), [(1, 1), (4, 4), (5, 5), (6, 3), (7, 4), (8, 4), (9, 5), (11, 4)])
def test_rows_of_facts_are_of_about_equal_length(count: int, columns: int) -> None:
    """The last row lacks fewer facts than there are rows, and the style sheet has the rule of each length."""
    text = Page("a").facts([(f"{i}", f"{i} N") for i in range(count)]).html()
    assert f'<dl class="facts columns-{columns}">' in text
    assert re.search(rf"\.columns-{columns} \{{\s*grid-template-columns: repeat\({columns},1fr\)", CSS)
    assert columns <= 5
    assert -(-count // columns) * columns - count < -(-count // columns)
    assert '<dl class="facts columns-1"></dl>' in Page("a").facts([]).html()


def test_a_page_says_once_what_the_linear_loop_says(pressed: Trace) -> None:
    linear = "the linear loop is unstable (spectral radius 1.1)"
    for reason in ("it grows", f"it grows; {linear}"):
        verdict = replace(pressed.verdict, reason=reason, linear=linear)
        trace = replace(pressed, metadata=dict(pressed.metadata) | {"verdict": verdict.to_dict()})
        shown = re.sub("<details>.*", "", run_page(trace, summarize(pressed) | {"verdict": str(verdict)}).html())
        assert shown.lower().count(linear) == 1


@pytest.mark.parametrize(
    ("energy", "shown"),
    [(0.0, "0 J"), (1.5, "1.5 J"), (-2.218e-6, "−2.22 µJ"), (0.0325, "32.5 mJ"), (3.2e-11, "0.032 nJ")],
)
def test_an_energy_has_the_unit_that_suits_it(energy: float, shown: str) -> None:
    assert _energy(energy) == shown


def test_columns_without_a_value_are_left_out_of_the_steady_state() -> None:
    one = {"steady_deflection_m": 1e-3, "expected_deflection_m": None, "error_percent": None,
           "overshoot_percent": 3.0, "settling_5_percent_s": None}  # fmt: skip
    page = Page("a run")
    _axes(page, {"x": one}, None)
    heads = re.findall(r"<th scope[^>]*>(.*?)</th>", page.html())
    assert [re.sub("<.*", "", head) for head in heads] == ["axis", "steady deflection", "overshoot"]
    assert "Settling" not in page.html()


def test_a_page_states_verdict_facts_and_every_warning(pressed: Trace) -> None:
    found = summarize(pressed) | {"warnings": ["the drive gets warm", "Counts are coarse"]}
    text = run_page(pressed, found).html()
    assert [
        one for one in re.findall("<h2[^>]*>([^<]*)</h2>", text) if one in ("Verdict", "Time histories", "Reproduction")
    ] == [
        "Verdict",
        "Time histories",
        "Reproduction",
    ]
    for sentence in ("The drive gets warm.", "Counts are coarse."):
        assert text.count(sentence) == 1
    assert found["verdict"][1:] in text
    assert "The drive" not in run_page(pressed).html()
    for key, unit, scale in (
        ("peak_deflection_m", "mm", 1e3),
        ("peak_reference_force_N", "N", 1.0),
        ("peak_object_force_N", "N", 1.0),
        ("peak_command_force_N", "N", 1.0),
    ):
        if found[key]:
            assert f"{found[key] * scale:.4g} {unit}" in text


def test_a_page_reproduces_the_scenario_and_the_controller_of_its_run(pressed: Trace) -> None:
    """Both are on the page as JSON, collapsed, with every letter as it is."""
    told = dict(pressed.metadata) | {"controller": {"kind": "lqg", "stiffness": "1 N/mm ± 5 µ<N>"}}
    trace = Trace.of(pressed.time[:1], {name: pressed[name][:1] for name in pressed.channels}, metadata=told)
    text = run_page(trace, summarize(pressed)).html()
    codes = dict(re.findall(r"<details><summary>(\w+)</summary><pre><code>(.*?)</code></pre></details>", text, re.S))
    assert json.loads(unescape(codes["Scenario"])) == trace.scenario
    assert json.loads(unescape(codes["Controller"])) == told["controller"]
    assert "± 5 µ&lt;N&gt;" in codes["Controller"]


@pytest.mark.parametrize(
    ("value", "shown", "numeric"),
    [(-3, "−3", True), (12, "12", True), (True, "yes", False), (False, "no", False), (None, "–", False),
     (-0.5, "−0.5", True), ("under 0.1", "under 0.1", True), ("-2", "−2", True), ("a < b", "a &lt; b", False)],
)  # fmt: skip
def test_a_cell_shows_numbers_with_a_minus_and_words_escaped(value: object, shown: str, numeric: bool) -> None:
    assert _cell(value) == (shown, numeric)


def test_a_run_has_three_sections_at_least_and_a_sweep_is_named_with_its_axes(pressed: Trace) -> None:
    found = re.findall(r"<h2[^>]*>(.*?)</h2>", run_page(pressed).html())
    assert [found[0], *found[-2:]] == ["Verdict", "Time histories", "Reproduction"]
    tables = {
        "title": "A [slider]", "device": {"name": "slider"}, "servo": {"topology": "impedance_display"},
        "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "100 N/m"}, "run": {"duration": "0.02 s"},
    }  # fmt: skip
    axes = {"object.stiffness": ["50 N/m", "100 N/m", "500 N/m"], "object.damping": ["0 N*s/m", "1 N*s/m"]}
    cells = sweep(tables, axes)
    page = sweep_page(cells).html()
    assert re.search(r"<h1[^>]*>Sweep: A \[slider\]</h1>", page)
    assert "object.stiffness (3) × object.damping (2)" in page
    rows = re.findall(r"<tr><td>([a-z ]+)</td><td[^>]*>(\d+)</td><td[^>]*>([\d.]+)</td></tr>", page)
    assert sum(int(row[1]) for row in rows) == 6
    for name, count, share in rows:
        states = [State(int(one)).label for one in np.ravel(cells["verdict"])]
        assert states.count(name) == int(count)
        assert float(share) == pytest.approx(100 * int(count) / 6, rel=5e-3)
    assert "map of verdicts" in page
    assert "The controller is designed" not in page
