"""Figures of runs are as stored: each number, colour, line, label and limit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from drawings import drawing
from given_runs import run_diverging, run_press, run_slide
from matplotlib.figure import Figure
from palpate.plotting import figures
from palpate.plotting.body_contact import (
    body_energy,
    deformed_surface,
    force_and_deflection,
    stiffness_along_path_figure,
)
from palpate.plotting.mesh_contact import profile, stiffness_and_depth, trajectory
from palpate.simulation import Trace
from palpate.simulation.bodies import pressed_at
from stored import check_stored

STORED = Path(__file__).with_name("stored")


@pytest.fixture(scope="module")
def traces(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Trace]:
    body = tmp_path_factory.mktemp("body") / "block.h5"
    return {"slide": run_slide(), "press": run_press(body), "diverging": run_diverging()}


def surface(trace: Trace) -> Figure:
    pressed = pressed_at(trace, -1)
    return deformed_surface(pressed.body, pressed.displacement, pressed.pressure)


FIGURES: dict[str, tuple[str, Callable[[Trace], Figure]]] = {
    "deflection": ("slide", figures.deflection),
    "deflection-target": ("slide", lambda trace: figures.deflection(trace, [None, 1e-3, -2e-3])),
    "deflection-diverging": ("diverging", figures.deflection),
    "forces": ("slide", figures.forces),
    "forces-diverging": ("diverging", figures.forces),
    "torques": ("slide", figures.torques),
    "angles": ("slide", figures.angles),
    "angles-slider": ("diverging", figures.angles),
    "energy": ("slide", figures.energy),
    "trajectory": ("slide", trajectory),
    "profile": ("slide", profile),
    "stiffness-and-depth": ("slide", stiffness_and_depth),
    "force-and-deflection": ("press", force_and_deflection),
    "stiffness-along-path": ("press", stiffness_along_path_figure),
    "body-energy": ("press", body_energy),
    "deformed-surface": ("press", surface),
}


@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_of_a_run_is_as_stored(traces: dict[str, Trace], name: str) -> None:
    run, draw = FIGURES[name]
    near = 2e-3 if run == "press" else 2e-5  # compliances have single precision
    check_stored(STORED / f"{name}.json", drawing(draw(traces[run])), near)


def test_a_comparison_is_as_stored(traces: dict[str, Trace]) -> None:
    two = {"first": traces["slide"], "second": traces["slide"]}
    check_stored(STORED / "compare.json", drawing(figures.compare(two, targets=(None, 1e-3, -2e-3))))
