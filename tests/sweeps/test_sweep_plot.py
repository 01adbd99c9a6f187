"""The picture of a sweep: each cell in the color of its verdict, in the units of the axes, with the exact boundary."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from palpate.simulation.verdict import State
from palpate.sweeps import SweepError
from palpate.sweeps.axes import Axis
from palpate.sweeps.sweep_plot import COLORS, _is_geometric, _label, _scale, plot_sweep

SLIDER: dict[str, Any] = {
    "device": {"name": "slider"}, "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]}, "object": {"kind": "spring", "stiffness": "50 N/m"},
}  # fmt: skip
STATES = [State.SETTLED, State.UNSTABLE, State.UNDECIDED]


def drawn(
    *axes: Axis, verdict: Any, ripple: Any = None, tables: Any = None, design: str = "cell", draws: int = 1
) -> Any:
    plan: Any = SimpleNamespace(axes=axes, draws=draws, tables=tables or SLIDER, design=design)
    outcomes = {"verdict": np.array(verdict, dtype=float), "ripple": np.array(0.0 if ripple is None else ripple)}
    figure = Figure()
    return plot_sweep(SimpleNamespace(plan=plan, outcomes=outcomes), figure.subplots())


def legend(ax: Any) -> list[str]:
    return [text.get_text() for text in ax.figure.legends[0].get_texts()]


def test_a_line_shows_the_ripple_of_each_cell_and_those_that_diverged_at_its_top() -> None:
    axis = Axis("servo.period", "s", (1e-3, 2e-3, 3e-3, 4e-3))
    ax = drawn(axis, verdict=[0, 1, 2, 0], ripple=[2e-6, 5e-4, np.nan, 0.0])
    points = {to_rgba(line.get_color()): line.get_xydata() for line in ax.lines if len(line.get_xdata())}
    expected = {
        State.SETTLED: [[1.0, 2e-3], [4.0, 1e-9]], State.BOUNDED_OSCILLATION: [[2.0, 0.5]], State.UNSTABLE: [[3.0, 1.5]]
    }  # fmt: skip
    assert set(points) == {to_rgba(COLORS[state]) for state in expected}
    for state, wanted in expected.items():
        np.testing.assert_allclose(points[to_rgba(COLORS[state])], wanted)
    assert (ax.get_yscale(), ax.get_xlabel(), ax.get_ylabel()) == ("log", "servo period [ms]", "ripple [mm]")
    assert legend(ax) == ["settled", "bounded oscillation", "unstable"]
    none = drawn(axis, verdict=[2, 2, 2, 2], ripple=[np.inf, np.nan, np.nan, np.inf])
    found = next(line.get_ydata() for line in none.lines if len(line.get_xdata()))
    np.testing.assert_allclose(found, 3.0)


def test_a_map_shows_each_cell_and_where_the_linear_loop_is_at_its_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first axis is vertical; without a damper the slider is stable up to 100 N/m."""
    monkeypatch.setattr("palpate.sweeps.sweep_plot.FINE", 60)
    stiffness = Axis("object.stiffness", "N/m", (20.0, 100.0, 500.0))
    damping = Axis("object.damping", "N*s/m", (0.0, 0.1, 0.2, 0.3))
    verdict = np.arange(12).reshape(3, 4) % 3 * 2.0
    verdict[1, 1] = np.nan
    for axes, values in (((stiffness, damping), verdict), ((damping, stiffness), verdict.T)):
        ax = drawn(*axes, verdict=values)
        mesh, contour = ax.collections[:2]
        shown = np.ma.filled(np.ma.asarray(mesh.get_array()).reshape(values.shape).astype(float), np.nan)
        np.testing.assert_array_equal(shown, values)
        colors = mesh.cmap(mesh.norm(np.arange(len(State))))
        np.testing.assert_allclose(colors, [to_rgba(COLORS[state]) for state in State], atol=0.003)
        vertices = np.vstack([path.vertices for path in contour.get_paths()])
        upright = axes[0] is stiffness
        k, b = vertices[:, int(upright)], vertices[:, int(not upright)]
        assert (k.min() >= 20.0, k.max() <= 500.0) == (True, True)
        assert k[np.argmin(b)] == pytest.approx(100.0, rel=0.2)
        assert np.ptp(k) > 50.0
        names = [ax.get_ylabel(), ax.get_xlabel()]
        assert names == ["object stiffness [N/m]", "object damping [N·s/m]"][:: 1 if upright else -1]
        assert legend(ax)[-1] == "exact boundary"
        assert (ax.get_xscale(), ax.get_yscale()) == (("linear", "log") if upright else ("log", "linear"))


@pytest.mark.parametrize(
    ("controller", "design", "bounded"),
    [("gain", "cell", True), ("lqg", "cell", False), ("lqg", "once", True), ("none", "cell", True)],
)
def test_the_boundary_is_that_of_one_controller(
    controller: str, design: str, bounded: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("palpate.sweeps.sweep_plot.scenario_loop", lambda _: "a loop")
    monkeypatch.setattr("palpate.sweeps.sweep_plot.Scenario", SimpleNamespace(from_dict=lambda tables: tables))
    monkeypatch.setattr("palpate.sweeps.sweep_plot.loop_radii", lambda _loop, k, b: k / 3000.0 + 0.0 * b)
    axes = (Axis("object.stiffness", "N/m", (1e3, 5e3)), Axis("object.damping", "N*s/m", (0.0, 1.0)))
    tables = {**SLIDER, "controller": {"kind": controller}}
    ax = drawn(*axes, verdict=np.zeros((2, 2)), tables=tables, design=design)
    assert (legend(ax) == ["settled", "exact boundary"]) is bounded
    if bounded:
        vertices = np.vstack([path.vertices for path in ax.collections[1].get_paths()])
        np.testing.assert_allclose(vertices[:, 1], 3.0)  # N/mm
        assert np.ptp(vertices[:, 0]) == pytest.approx(1.0)
    other = (Axis("object.stiffness", "N/m", (1e3, 5e3)), Axis("servo.period", "s", (1e-3, 2e-3)))
    assert legend(drawn(*other, verdict=np.zeros((2, 2)), tables=tables, design=design)) == ["settled"]


def test_units_are_those_that_read_well() -> None:
    for unit, values, expected in (
        ("N/m", (1.0, 999.0), (1.0, "N/m")), ("N/m", (1.0, 1000.0), (1e-3, "N/mm")),
        ("N/m", (-2e3, 1.0), (1e-3, "N/mm")), ("", (3,), (1.0, "")),
        ("m", (0.1,), (1e3, "mm")), ("s", (0.1,), (1e3, "ms")), ("N*s/m", (0.1,), (1.0, "N·s/m")),
    ):  # fmt: skip
        assert _scale(Axis("a.b", unit, values)) == expected
    assert _label(Axis("object.static_friction", "", (0.1,))) == "object static friction"
    assert _label(Axis("servo.period", "s", (0.1,))) == "servo period [ms]"


def test_values_are_geometric_if_their_ratios_are_equal_and_their_steps_are_not() -> None:
    for values, expected in (
        ((1.0, 2.0, 4.0), True), ((1.0, 2.0, 3.0), False), ((5.0, 5.0, 5.0), False), ((0.0, 0.0, 1.0), False),
        ((-1.0, -2.0, -4.0), False), (tuple(np.geomspace(1e-6, 1e3, 40)), True), ((1.0, 2.0, 4.0001), False),
    ):  # fmt: skip
        assert _is_geometric(np.array(values)) is expected


def test_more_axes_draws_or_words_are_not_drawn() -> None:
    axis, words = Axis("a", "", (1, 2)), Axis("b", "", ("x", "y"))
    for axes, draws in (((axis,) * 3, 1), ((axis,), 2), ((axis, words), 1), ((words,), 1)):
        with pytest.raises(SweepError, match="a sweep is drawn over one or two numeric axes with one draw each"):
            drawn(*axes, verdict=[0.0], draws=draws)


def test_without_axes_a_figure_of_its_own_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    figure = Figure()

    def subplots(**options: Any) -> Any:
        asked.append(options)
        return figure, figure.subplots()

    monkeypatch.setattr("matplotlib.pyplot.subplots", subplots)
    plan = SimpleNamespace(axes=[Axis("servo.period", "s", (1e-3, 2e-3))], draws=1, tables={}, design="cell")
    found: Any = SimpleNamespace(plan=plan, outcomes={"ripple": [1e-6, 2e-6], "verdict": np.zeros(2)})
    assert plot_sweep(found) is figure.axes[0]
    assert asked == [{"figsize": (6.4, 4.2), "layout": "constrained"}]


def test_points_of_a_line_and_its_boundary_are_drawn_thin_and_dark() -> None:
    axis = Axis("servo.period", "s", (1e-3, 2e-3))
    ax = drawn(axis, verdict=[0, 2], ripple=[1e-6, 2e-6])
    marks = [line for line in ax.lines if len(line.get_xdata())]
    assert {(line.get_marker(), line.get_linestyle(), line.get_markeredgewidth()) for line in marks} == {
        ("o", "None", 0.4)
    }
    assert {line.get_markeredgecolor() for line in marks} == {"#1d2126"}
    legend_of = ax.figure.legends[0]
    assert legend_of._ncols == 2
    many = drawn(Axis("servo.period", "s", tuple(1e-3 * np.arange(1, 6))), verdict=[0, 1, 2, 3, 4], ripple=[1e-6] * 5)
    assert many.figure.legends[0]._ncols == 4
    stiffness = Axis("object.stiffness", "N/m", (20.0, 100.0, 500.0))
    both = drawn(stiffness, Axis("object.damping", "N*s/m", (0.0, 0.1, 0.2)), verdict=np.zeros((3, 3)))
    contour = both.collections[1]
    assert float(np.max(contour.get_linewidth())) == 1.2
    assert both.collections[0].get_rasterized()
    line = both.figure.legends[0].get_lines()[0]
    assert (line.get_linewidth(), line.get_color()) == (1.2, "#1d2126")
