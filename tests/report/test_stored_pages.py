"""Pages and their figures are as stored: each word, number, colour, line and limit."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import given_results as given
import pytest
from drawings import drawing
from given_runs import run_diverging, run_press, run_slide
from matplotlib.figure import Figure
from palpate.report import Page, html
from palpate.report.performance import performance_page, ripple_figure, stiffness_figure
from palpate.report.run import run_page
from palpate.report.workspace import axes_figure, section_figure, workspace_page
from palpate.report.zwidth import close_figure, zwidth_figure, zwidth_page
from palpate.stability.maps.workspace_map import Workspace
from palpate.stability.maps.zwidth_map import Corner, ZWidth
from stored import check_stored

STORED = Path(__file__).with_name("stored")


def full_zwidth() -> ZWidth:
    corner = Corner((0.5, 20.0), given.curve(0.5, 18.0), given.simulated(given.curve(0.5, 18.0)))
    return given.zwidth(
        curves={"a hand": given.OWN, "nobody": given.curve(14.0, 3000.0)}, passive=given.PASSIVE, not_passive="",
        simulated=given.simulated(given.OWN), not_simulated="", never=("a ghost",), min_stable_stiffness=3.0,
        corner=corner,
    )  # fmt: skip


def falling_workspace() -> Workspace:
    w = given.grid_workspace()
    stiffness = w.stiffness.copy()
    stiffness[w.sections["y-z"][[3, 17]]] = 0.0
    return replace(w, stiffness=stiffness)


FIGURES: dict[str, Callable[[], Figure | None]] = {
    "zwidth": lambda: zwidth_figure(full_zwidth()),
    "zwidth-plain": lambda: zwidth_figure(given.zwidth()),
    "zwidth-close": lambda: close_figure(full_zwidth()),
    "workspace-sections": lambda: section_figure(given.grid_workspace()),
    "workspace-axes": lambda: axes_figure(given.grid_workspace()),
    "workspace-falling": lambda: section_figure(falling_workspace()),
    "performance-stiffness": lambda: stiffness_figure(given.performance()),
    "performance-one-direction": lambda: stiffness_figure(given.performance(along=given.performance().along[:1])),
    "performance-ripple": lambda: ripple_figure(given.performance()),
}
PAGES: dict[str, Callable[[], Page]] = {
    "zwidth": lambda: zwidth_page(full_zwidth()),
    "zwidth-plain": lambda: zwidth_page(given.zwidth(stable_here=False)),
    "workspace": lambda: workspace_page(given.grid_workspace()),
    "workspace-falling": lambda: workspace_page(falling_workspace()),
    "performance": lambda: performance_page(given.performance()),
}


def lines(page: Page) -> list[str]:
    text = re.sub(r"<style>.*?</style>", "", page.html(), flags=re.DOTALL)
    return re.sub(r"palpate \d[\w.+]*", "palpate VERSION", text).splitlines()


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_is_as_stored(name: str) -> None:
    figure = FIGURES[name]()
    assert figure is not None
    check_stored(STORED / f"figure-{name}.json", drawing(figure))


@pytest.mark.parametrize("name", PAGES)
def test_a_page_is_as_stored(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(html, "inline_svg", lambda *words: f"<svg>{words[1:]}</svg>")
    check_stored(STORED / f"page-{name}.json", lines(PAGES[name]()))


def test_pages_of_runs_are_as_stored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(html, "inline_svg", lambda *words: f"<svg>{words[1:]}</svg>")
    runs = {"slide": run_slide(), "press": run_press(tmp_path / "block.h5"), "diverging": run_diverging()}
    for name, trace in runs.items():
        found = [line.replace(str(tmp_path), "FOLDER") for line in lines(run_page(trace))]
        check_stored(STORED / f"page-{name}.json", found)


def test_a_changed_number_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PALPATE_STORE", raising=False)
    higher = given.zwidth(curves={"a hand": replace(given.OWN, stiffness=1.001 * given.OWN.stiffness)})
    with pytest.raises(AssertionError, match=r"figure-zwidth-plain\.axes\[0\]"):
        check_stored(STORED / "figure-zwidth-plain.json", drawing(zwidth_figure(higher)))
