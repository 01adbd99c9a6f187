"""The Z-width page's table of hands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from palpate import simulate
from palpate.report.zwidth import zwidth_figure, zwidth_page
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.stability import zwidth
from palpate.stability.maps.zwidth_map import written
from slider_press import resonant

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


def test_the_stiffest_object_with_a_damping_is_that_of_the_loop_not_of_the_map() -> None:
    """Integral action bounds soft objects on a branch that is 60,000 times lower than the map."""
    system = control.sample_system(control.ss(control.tf([0.3, 6.0], [1.0, 0.2])), 1e-3, "bilinear")
    a, b, c, d = (float(m[0, 0]) for m in (system.A, system.B, system.C, system.D))
    found = zwidth(
        {
            "device": {"name": "slider"},
            "servo": {"period": "1 ms"},
            "reference": {"shape": "step", "force": ["0.1 N", "0 N", "0 N"]},
            "object": {"kind": "spring", "stiffness": "50 N/m", "damping": "0.5 N*s/m"},
            "controller": {"kind": "state_space", "A": [[a]], "B": [[b, 0, 0, -b, 0, 0]], "C": [[c], [0], [0]]}
            | {"D": [[d, 0, 0, -d, 0, 0], [0] * 6, [0] * 6]},
        },
        simulated=False,
    )
    (curve,) = found.curves.values()
    on_the_map = curve.stiffest_at(0.5)
    assert on_the_map is not None
    most = found.stiffest_here
    assert most is not None
    assert most < 0.6 * on_the_map

    def radius(k: float) -> float:
        """Return that of slider, hold, controller and backward difference."""
        mass, friction, t = 0.06, 0.05, 1e-3
        decay = np.exp(-friction / mass * t)
        speed = (1.0 - decay) / friction
        felt = np.array([k + 0.5 / t, 0.0, -0.5 / t, 0.0])
        step = np.zeros((4, 4))
        step[:2, :2] = [[1.0, mass * speed], [0.0, decay]]
        step[:2] -= np.outer([(t - mass * speed) / friction, speed], d * felt + [0.0, 0.0, 0.0, c])
        step[2, 0], step[3], step[3, 3] = 1.0, b * felt, a
        return float(np.abs(np.linalg.eigvals(step)).max())

    assert radius(0.999 * most) < 1.0 < radius(1.001 * most)


def test_a_band_of_unstable_objects_under_the_stiffest_stable_one_is_named() -> None:
    found = zwidth(Scenario.from_dict(resonant("100 N/m")), simulated=False)
    assert found.stiffest_here is not None
    (here, *_) = [band for band in found.gaps["the scenario's arm, rigid grip"] if band[0] == 0.0]
    _, low, high = here
    assert 100 < low < high < found.stiffest_here
    loop = scenario_loop(Scenario.from_dict(resonant("100 N/m")))
    for stiffness, stable in ((0.99 * low, True), (1.01 * low, False), (0.99 * high, False), (1.01 * high, True)):
        assert (loop.spectral_radius(stiffness, 0.0) < 1.0) is stable
    assert loop.spectral_radius(0.99 * found.stiffest_here, 0.0) < 1.0
    said = f"with 0 N·s/m: unstable from {written(low)} to {written(high)}, below the stiffest stable object."
    assert any(remark.endswith(said) for remark in found.gap_remarks)
    page = zwidth_page(found).html()
    assert said in page
    assert "below a curve is stable, but for the bands below." in page
    bands = found.to_dict()["unstable_below"]["the scenario's arm, rigid grip"]
    assert {"damping_N_s_per_m": 0.0, "stiffness_N_per_m": [low, high]} in bands


def test_the_map_is_filled_where_objects_are_stable() -> None:
    """A band of unstable objects is a hole, and a map without bands has none."""
    for scenario in (Scenario.from_dict(resonant("100 N/m")), Scenario.from_file(SLIDER)):
        found = zwidth(scenario, simulated=False)
        figure = zwidth_figure(replace(found, curves=dict([next(iter(found.curves.items()))])))
        (panel,) = figure.axes
        for line in (*panel.lines, *panel.texts):
            line.set_visible(False)
        panel.grid(visible=False)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())[::-1, :, :3]
        own, loop = next(iter(found.curves.values())), scenario_loop(scenario)
        rng, states = np.random.default_rng(1), set()
        for share in rng.uniform(0.03, 1.0, (60, 2)):
            b, k = share * [own.damping.max(), own.stiffness.max()]
            margin = loop.spectral_radius(k, b) - 1.0
            x, y = panel.transData.transform((b, k * 1e-3))
            if abs(margin) > 1e-4:
                assert (pixels[int(y), int(x)].min() < 250) == (margin < 0.0), (b, k)
                states.add(margin < 0.0)
        assert states == {True, False}


def test_a_run_agrees_with_the_band_of_unstable_objects() -> None:
    verdicts = [
        str(simulate(resonant(stiffness)).verdict).split(":")[0] for stiffness in ("100 N/m", "5 N/mm", "60 N/mm")
    ]
    assert verdicts == ["settled", "unstable", "settled"]


def test_a_map_without_bands_names_none() -> None:
    found = zwidth(Scenario.from_file(SLIDER), simulated=False)
    assert found.gaps == {}
    assert "Unstable band" not in zwidth_page(found).html()
    assert "below a curve is stable. The curve" in zwidth_page(found).html()
