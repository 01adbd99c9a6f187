"""Windows of a Z-width: how long simulated runs last, how far their points lie from the curve, what a corner shows."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.stability.maps import simulated, zwidth_map

SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "force", "shape": "step", "force": ["0.5 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "80 N/m"},
}
WINDOW = (10.0, 2000.0)


def boundary(monkeypatch: pytest.MonkeyPatch, exact: Any, points: Any, minimum: float = 0.0, **tables: Any) -> Any:
    """Return the boundary of a window whose map has the given points, without its runs."""
    found = SimpleNamespace(boundary=np.array(points, dtype=float), ran=np.eye(3, dtype=bool))
    monkeypatch.setattr(simulated, "follow", lambda *_: found)
    scenario = Scenario.from_dict({**SLIDER, **tables})
    return simulated.simulated_boundary(scenario, scenario_loop(scenario), exact, WINDOW, minimum)


def curve(damping: Any, stiffness: Any, hertz: Any, period: float = 1e-3) -> Any:
    angle = 2.0 * math.pi * period * np.asarray(hertz, dtype=float)
    b, k = np.asarray(damping, dtype=float), np.asarray(stiffness, dtype=float)
    return SimpleNamespace(damping=b, stiffness=k, angle=angle, pieces=[(0, len(b))])


@pytest.mark.parametrize(
    ("hertz", "seconds"),
    [
        ([10.0, 20.0, 30.0], 2.5),
        ([40.0, 50.0, 30.0], 1.0),  # 25 periods take less
        ([5.0, 20.0, 30.0], 4.0),  # and here more than the most
        ([20.0, 1.0, 30.0], 1.25),  # the second point is above the window
        ([20.0, 30.0, 1.0], 1.25),  # and the third below its fiftieth
    ],
)
def test_a_run_lasts_25_periods_of_the_slowest_oscillation_in_the_window(
    hertz: list[float], seconds: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    exact = curve([1.0, 2.0, 3.0], [1000.0, 2001.0 if hertz[1] == 1.0 else 1500.0, 30.0], hertz)
    found = boundary(monkeypatch, exact, np.empty((0, 2)))
    assert found.duration == pytest.approx(seconds, abs=2e-3)
    assert math.isnan(found.furthest)
    assert (found.runs, found.cells) == (3, 9)
    half = curve(exact.damping, exact.stiffness, hertz, period=5e-4)
    servo = {"period": "0.5 ms", "topology": "impedance_display"}
    assert boundary(monkeypatch, half, [[1.0, 1.0]], servo=servo).duration == pytest.approx(seconds, abs=1e-3)


def test_without_a_curve_in_the_window_a_run_lasts_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    assert boundary(monkeypatch, curve([11.0, 12.0], [100.0, 100.0], [1.0, 1.0]), [[1.0, 1.0]]).duration == 1.0


def test_distances_from_a_curve_are_shares_of_the_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a corner: beside one leg, beside the other, beyond an end, and beside the lower edge where it counts."""
    exact = curve([0.0, 5.0, 5.0], [1000.0, 1000.0, 0.0], [50.0, 50.0, 50.0])
    points = [[2.5, 1200.0], [6.0, 500.0], [8.0, 1800.0], [2.0, 300.0]]
    expected = [0.1, 0.1, math.hypot(0.3, 0.4), 0.3]
    found = boundary(monkeypatch, exact, points)
    np.testing.assert_allclose(found.distance, expected)
    assert found.furthest == pytest.approx(0.5)
    lower = boundary(monkeypatch, exact, points, minimum=200.0)
    np.testing.assert_allclose(lower.distance, [*expected[:3], 0.05])
    exact.pieces = [(0, 2), (2, 3)]  # the vertical leg is no part of the curve
    np.testing.assert_allclose(boundary(monkeypatch, exact, points[:2]).distance, [0.1, math.hypot(0.1, 0.25)])


def test_an_oblique_wall_has_no_simulated_boundary(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = curve([1.0, 2.0], [1000.0, 1000.0], [50.0, 50.0])
    arm = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "operator": {"kind": "force", "shape": "step", "force": ["0 N", "0 N", "-0.5 N"]},
    }
    for normal, oblique in (([0.0, 0.0, 1.0], False), ([0.0, 0.6, 0.8], True)):
        wall = {"kind": "wall", "stiffness": "80 N/m", "normal": normal}
        found = boundary(monkeypatch, exact, [[1.0, 900.0]], object=wall, **arm)
        assert (found is None) == oblique


def test_a_corner_is_shown_of_what_vanishes_in_the_map() -> None:
    """2.5 times the walls below a fiftieth of the map, in the map's shape where one of them is zero."""
    edge = curve([0.0, 100.0, 50.0], [0.0, 1000.0, 5000.0], [50.0] * 3)
    corner = zwidth_map._corner_window
    assert corner(edge, None, (1.0, 80.0)) == pytest.approx((2.5, 200.0))
    assert corner(edge, None, (0.0, 80.0)) == pytest.approx((2.5 * 80.0 * 100.0 / 5000.0, 200.0))
    for here in ((0.0, 0.0), (2.1, 80.0), (1.0, 101.0)):  # nothing, or visible without it
        assert corner(edge, None, here) is None
    passive = (np.array([0.0, 1.5]), np.array([60.0, 0.0]))
    assert corner(edge, passive, (2.1, 80.0)) == pytest.approx((3.75, 150.0))
    assert corner(edge, passive, (1.0, 80.0)) == pytest.approx((3.75, 200.0))
    assert corner(edge, (np.array([0.0, 9.9]), passive[1]), (0.0, 0.0)) == pytest.approx((24.75, 150.0))
    assert corner(edge, (np.array([0.0, 10.1]), passive[1]), (0.0, 0.0)) is None  # a quarter of the map
    assert corner(edge, (passive[0], np.array([499.0, 0.0])), (0.0, 0.0)) == pytest.approx((3.75, 1247.5))
    assert corner(edge, (passive[0], np.array([501.0, 0.0])), (0.0, 0.0)) is None
    assert corner(edge, (np.array([9.0]), np.array([300.0])), (0.0, 0.0)) is None  # both visible


@pytest.mark.parametrize(("pole", "expected"), [(0.95, 0.0), (1.05, 500.0), (1.2, 2000.0)])
def test_the_least_stable_stiffness_brings_the_root_of_a_falling_device_back(pole: float, expected: float) -> None:
    """x <- (a - k b) x is stable from k = (a - 1)/b on; 0 where it is stable alone."""
    loop = SimpleNamespace(spectral_radius=lambda k, _b: abs(pole - 1e-4 * k))
    edge = SimpleNamespace(inside=(3.0, 4000.0))
    assert zwidth_map._min_stable_stiffness(loop, edge) == pytest.approx(expected, rel=1e-6)  # type: ignore[arg-type]


def test_the_growth_of_a_linear_device_is_that_of_the_nonlinear_one_where_both_are_the_same() -> None:
    """A slider: a mass with viscous friction. The last loop diverges."""
    stiffness = np.array([20.0, 90.0, 120.0, 200.0, 1e5])[:, None] * np.ones(3)
    damping = np.array([0.0, 0.0, 0.1, 0.0, 0.0])[:, None] * np.ones(3)
    found = []
    for model in ("nonlinear", "linear"):
        scenario = Scenario.from_dict({**SLIDER, "device": {"name": "slider", "model": model}})
        simulation = simulated._prepare(scenario, scenario_loop(scenario), 700)
        found.append(simulated._growth(simulation, stiffness, damping))
    assert found[0][0] < 1.0 < found[0][3] < found[0][4] == np.inf
    np.testing.assert_allclose(found[1], found[0], rtol=1e-3)
