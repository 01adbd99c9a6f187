"""Counter-examples: the operator and the object that they show an instability with, and the growth they state."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace
from palpate.stability import counter_example
from palpate.stability.counter_example import _make_bilateral, _run, _with_push, divergence_example, growth, to_toml

ARM = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m", "tissue_stiffness": "500 N/m",
       "tissue_damping": "1 N*s/m"}  # fmt: skip


def display(normal: list[float] | None = None, **tables: Any) -> Scenario:
    wall = {"kind": "wall", "stiffness": "2 N/mm", "damping": "3 N*s/m", "normal": normal}
    return Scenario.from_dict(
        {
            "device": {"name": "phantom-premium-1.5a"},
            "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "1 ms", "topology": "impedance_display"},
            "operator": {**ARM, "force": ["1 N", "0 N", "0 N"]},
            "object": {"kind": "spring", "stiffness": "1 N/mm"} if normal is None else wall,
            "run": {"duration": "0.1 s"},
            **tables,
        }
    )


SLIDER: dict[str, Any] = {"device": {"name": "slider"}, "start": {"pose": ["0 m"]}, "operator": {"kind": "none"}}


@pytest.mark.parametrize("kind", ["arm", "force", "none"])
def test_the_push_is_a_tenth_of_a_newton_into_a_wall(kind: str) -> None:
    made = _with_push(display([0.6, 0.0, 0.8]), ARM, kind)
    force = [float(part.removesuffix(" N")) for part in made["force"]]
    assert force == pytest.approx([-0.06, 0.0, -0.08])
    assert made["shape"] == "step"
    assert made["kind"] == ("arm" if kind == "arm" else "force")
    kept = {key: value for key, value in made.items() if key not in ("kind", "shape", "force")}
    assert kept == ({key: value for key, value in ARM.items() if key != "kind"} if kind == "arm" else {})


def test_on_a_spring_the_push_is_along_every_axis_in_which_the_device_moves() -> None:
    assert _with_push(display(), {}, "force")["force"] == ["0.1 N"] * 3
    assert _with_push(display(**SLIDER), {}, "force")["force"] == ["0.1 N", "0 N", "0 N"]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_wall_becomes_a_spring_along_its_normal_alone(axis: int, side: float) -> None:
    normal = [0.0, 0.0, 0.0]
    normal[axis] = side
    scenario = display(normal)
    tables = scenario.to_dict()
    tables["object"]["position"] = ["1 mm", "2 mm", "3 mm"]
    _make_bilateral(scenario, tables)
    found = Scenario.from_dict(tables).object
    assert found.kind == "spring"
    expected = np.zeros(3)
    expected[axis] = 1.0
    assert np.array(found.stiffness) == pytest.approx(2000.0 * expected)
    assert np.array(found.damping) == pytest.approx(3.0 * expected)
    assert np.array(found.position) == pytest.approx(np.zeros(3))


def test_springs_and_oblique_walls_stay_as_they_are() -> None:
    for scenario in (display(), display([0.6, 0.0, 0.8])):
        tables = scenario.to_dict()
        _make_bilateral(scenario, tables)
        assert tables["object"] == scenario.to_dict()["object"]


@pytest.mark.parametrize(("radius", "ticks"), [(1.01, 694.2), (1.5, 400.0), (1.0 + 1e-9, 400_000.0)])
def test_an_example_lasts_until_a_thousandfold_growth_within_bounds(
    radius: float, ticks: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[dict[str, Any]] = []
    monkeypatch.setattr(counter_example, "_run", lambda tables, subject: given.append(tables))
    divergence_example(display([0.0, 0.0, 1.0], run={"duration": "0.1 s", "record_every": 5}), radius)
    made = Scenario.from_dict(given[0])
    assert made.run.duration / made.period == pytest.approx(ticks, rel=1e-3)
    assert made.run.record_every == 1
    assert made.operator.kind == "arm"
    assert made.object.kind == "spring"


@pytest.mark.parametrize(
    ("ratios", "diverges", "pushes", "says"),
    [
        ([1.6], False, [0.1], "pushed with 0.1 N, it grows 1.6-fold from the run's second fifth to its last."),
        ([1.4, 3.0], False, [0.1, 1.0], "pushed with 1 N, it grows 3-fold"),
        ([1.0, 1.0, 1.5], False, [0.1, 1.0, 5.0], "pushed with 5 N, it grows 1.5-fold"),
        ([1.0, 1.0, 1.4], False, [0.1, 1.0, 5.0], None),
        ([1.0], True, [0.1], "pushed with 0.1 N, it diverges after 0.0123 s."),
    ],
)
def test_a_push_becomes_larger_until_the_oscillation_grows(
    ratios: list[float], diverges: bool, pushes: list[float], says: str | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.1 N, 1 N and 5 N, along each axis."""
    forces: list[float] = []

    def simulate(scenario: Scenario) -> Trace:
        assert scenario.operator.force is not None
        forces.append(float(scenario.operator.force[0]))
        made = Trace.of(np.zeros(1), {"tip": np.zeros((1, 3))})
        return replace(made, unstable_from=0.0123 if diverges else None)

    left = iter(ratios)
    monkeypatch.setattr(counter_example, "simulate", simulate)
    monkeypatch.setattr(counter_example, "growth", lambda _: next(left))
    monkeypatch.setattr(counter_example, "held_tip", lambda _: None)
    tables = display().to_dict()
    tables["operator"] = _with_push(display(), ARM, "arm")
    found = _run(tables, "it")
    assert (found is None) is (says is None)
    if found is not None and says is not None:
        assert found.sentence.startswith(says)
        assert found.growth == (math.inf if diverges else ratios[-1])
        assert float(Scenario.from_dict(found.scenario).operator.force[0]) == pytest.approx(forces[-1])  # type: ignore[index]
    assert forces == pytest.approx(pushes)


@pytest.mark.parametrize("factor", [0.5, 1.0, 3.0])
def test_growth_is_the_ratio_of_the_last_fifth_to_the_second(factor: float) -> None:
    """Three fifths lie between; a straight motion has no second difference."""
    t = np.arange(1001) / 200.0
    wave = factor ** (t / 3.0) * np.sin(2.0 * np.pi * 20.0 * t)
    tip = np.column_stack([wave, 0.5 * wave, 0.0 * t])
    assert growth(tip) == pytest.approx(factor, rel=0.01)
    slide = 1e3 * t[:, None] * np.array([1.0, 0.0, 2.0])
    assert growth(tip + slide) == pytest.approx(1.0, rel=0.2)
    assert growth(tip + slide, 2) == pytest.approx(factor, rel=0.01)
    assert math.isnan(growth(np.zeros((10, 3))))


def test_scenario_tables_survive_their_text() -> None:
    tables = {
        "title": 'a "quoted" title\nof two lines, C:\\x',
        "run": {"duration": "1 s", "count": 3, "share": 0.1, "on": True, "off": False},
        "object": {"stiffness": ["1 N/m", "2 N/m"], "rows": [[1, 2.5], [3, -4]], "mesh": {"edge": "1 mm", "n": 2}},
        "limits": {"up": math.inf, "low": -math.inf},
    }
    text = to_toml(tables)
    assert tomllib.loads(text) == tables
    assert text.endswith("\n")
    assert text.index("[run]") < text.index("[object]")
    assert tomllib.loads(to_toml({"run": {"duration": "1 s"}})) == {"run": {"duration": "1 s"}}
    assert math.isnan(tomllib.loads(to_toml({"x": {"y": math.nan}}))["x"]["y"])
