"""The Z-width page's table of hands."""

from __future__ import annotations

from pathlib import Path

import pytest
from palpate.report.zwidth import zwidth_page
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.stability import zwidth

SLIDER = Path(__file__).parents[2] / "scenarios" / "slider-wall-stable.toml"


def test_undamped_stiffness_of_each_hand_stands_on_the_page() -> None:
    """Golden: 60 g, 0.05 N·s/m, 1 ms: 100 N/m in nobody's hand, 9135 gripped rigidly, 1484 through fingertip tissue."""
    map_of_slider = zwidth(Scenario.from_file(SLIDER), simulated=False)
    assert map_of_slider.stiffest_here == pytest.approx(100.01, rel=1e-3)
    page = zwidth_page(map_of_slider).html()
    assert "<dt>stiffest object at B = 0 N·s/m, as in the scenario</dt><dd>100 N/m</dd>" in page
    assert "softest stable object" not in page  # every softer one is stable
    rows = page[page.index("nobody holds it</td>") :]
    found = []
    for who in ("nobody holds it", "a rigid grip", "through fingertip tissue"):
        row = rows[rows.index(f"{who}</td>") :].split("</tr>")[0]
        found.append(float(row.split("</td>")[-2].split(">")[-1]))
    assert found == pytest.approx([100.01, 9135, 1484], rel=1e-3)


def test_a_loop_that_needs_an_object_has_a_softest() -> None:
    """The identified model drifts off by itself: below the softest object a root lies outside the circle."""
    scenario = Scenario.from_file(SLIDER.with_name("identified-model.toml"))
    found = zwidth(scenario, simulated=False)
    loop = scenario_loop(scenario)
    assert found.min_stable_stiffness > 1.0
    for damping in (0.0, 0.5):
        assert (
            loop.spectral_radius(0.999 * found.min_stable_stiffness, damping)
            > 1.0
            > loop.spectral_radius(1.001 * found.min_stable_stiffness, damping)
        )
    assert zwidth(Scenario.from_file(SLIDER), simulated=False).min_stable_stiffness == 0.0
