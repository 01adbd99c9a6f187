"""Comparison of guards: the plain wall against a loop written out, each way against stored runs, and the ranking."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.devices import load
from palpate.errors import StabilityError
from palpate.metrics import compare_guards, guard_comparison, tip_axis
from palpate.metrics.guard_comparison import TipAxis, _Axis, _movable, _Press, _row, _Way, _ways

T = 1e-3
AXIS = TipAxis(0.06, 0.05, 0.02, 1e-5)


def written_out(loop: _Axis, rendered: float, stiffness: float, impact: float) -> _Press:
    """Return what a run shows: a mass with viscous friction under held forces, its motion in closed form."""
    m, b, n = loop.axis.mass, loop.axis.damping, round(2.0 / loop.period)
    fade, tau = math.exp(-b * loop.period / m), m / b
    x, v, line = 0.0, impact, [0.0] * loop.delay
    tips, forces = [], []
    for _ in range(n + 1):
        tips.append(x)
        measured = round(x / loop.axis.count) * loop.axis.count if loop.axis.count else x
        forces.append(max(rendered * measured, 0.0))
        line.append(forces[-1])
        total = loop.push - line.pop(0)
        ends = total / b
        x, v = x + ends * loop.period + (v - ends) * tau * (1.0 - fade), ends + (v - ends) * fade
    end = tips[len(tips) - round(0.25 * len(tips)) :]
    depth = sum(end) / len(end)
    felt = float(np.mean(forces[-len(end) :])) / (stiffness * depth)
    return _Press((max(end) - min(end)) / 2.0, felt, float(np.abs(np.diff(forces)).max()))


@pytest.mark.parametrize(("delay", "period"), [(0, T), (2, T), (1, 0.5e-3)])
@pytest.mark.parametrize("coupling", [math.inf, 300.0])
def test_a_plain_wall_is_that_of_the_loop_written_out(delay: int, period: float, coupling: float) -> None:
    """Alone, and as a spring in series with that of a coupling."""
    loop = _Axis(TipAxis(0.06, 0.9, 0.0, 0.0), period, delay, 0.5)
    found = loop.press(200.0, _Way("", coupling=coupling), 0.05)
    expected = written_out(loop, 1.0 / (1.0 / 200.0 + 1.0 / coupling), 200.0, 0.05)
    assert found.swing == pytest.approx(expected.swing, rel=1e-6, abs=1e-12)
    assert (found.felt, found.jump) == pytest.approx((expected.felt, expected.jump), rel=1e-6)


def test_a_wall_that_is_not_touched_or_diverges_is_not_felt() -> None:
    loop = _Axis(AXIS, T, 0, 0.0)
    away = loop.press(200.0, _Way(""), -0.1)
    assert (away.felt, away.jump) == (0.0, 0.0)
    assert loop.press(200.0, _Way("", admittance=True), 0.0).felt == 0.0
    assert _Axis(AXIS, T, 1, 1.0).press(1e12, _Way(""), 0.1) == _Press(math.inf, 0.0, math.inf)


STORED = {  # felt share, largest step of the force, N, and swing, m
    "free": {
        "no guard": (1, 0.0356763806, 7.70706e-11),
        "damper of 0.1 m/T": (1, 0.347148122, 0),
        "damper of 0.4 m/T": (1.0000015, 1.35499751, 1.23945e-08),
        "passivity controller, cap 0.1 m/T": (1, 0.0356763806, 7.70706e-11),
        "passivity controller, cap 0.5 m/T": (1, 0.0356763806, 7.70706e-11),
        "half-sample, backward difference": (1, 0.0351196493, 2.05823e-11),
        "half-sample, adaptive window": (1, 0.0351196493, 2.05823e-11),
        "half-sample, observer": (1, 0.0350732184, 2.0729e-11),
        "half-sample, observer, deadbeat exit": (1, 0.0350732184, 2.0729e-11),
        "sample-estimate-hold": (1, 0.0350321378, 2.08081e-11),
        "sample-estimate-hold, no correction": (1, 0.0351196493, 2.05823e-11),
        "energy bound": (1, 0.0356763806, 7.70706e-11),
        "virtual coupling of 2 b/T": (0.9375, 0.0341608186, 7.42709e-11),
        "virtual coupling of 8 b/T (two-port)": (0.983606557, 0.0352868235, 6.70513e-11),
        "admittance display, workspace controller": (0.999576599, 0.0482506698, 0.000309955),
    },
    "dry": {
        "no guard": (0.999040012, 0.038, 0),
        "damper of 0.1 m/T": (1.00110568, 0.372, 0),
        "damper of 0.4 m/T": (1.00111224, 1.452, 0),
        "passivity controller, cap 0.1 m/T": (0.999040012, 0.038, 0),
        "passivity controller, cap 0.5 m/T": (0.999040012, 0.038, 0),
        "half-sample, backward difference": (1.00090729, 0.038, 0),
        "half-sample, adaptive window": (1.00062437, 0.0376666667, 0),
        "half-sample, observer": (1.00076197, 0.0367563283, 0),
        "half-sample, observer, deadbeat exit": (1.00076197, 0.0367563283, 0),
        "sample-estimate-hold": (1.0002967, 0.039, 0),
        "sample-estimate-hold, no correction": (1.00090729, 0.038, 0),
        "energy bound": (0.999040012, 0.038, 0),
        "energy bound, dry friction": (0.999040012, 0.038, 0),
        "virtual coupling of 2 b/T": (0.90886002, 0.0345454545, 0),
        "virtual coupling of 8 b/T (two-port)": (0.976023402, 0.0370731707, 0),
        "admittance display, workspace controller": (0.997875579, 0.177575403, 0.000280635),
    },
}


@pytest.mark.parametrize("axis", [TipAxis(0.06, 1.5, 0.0, 0.0), TipAxis(0.06, 1.0, 0.05, 1e-5)], ids=["free", "dry"])
def test_every_way_shows_the_force_of_earlier_runs(axis: TipAxis) -> None:
    loop = _Axis(axis, T, 0, 0.8)
    found = {way.name: loop.press(200.0, way, 0.05) for way in _ways(axis, T, 0)}
    expected = STORED["dry" if axis.coulomb else "free"]
    assert list(found) == list(expected)
    for name, press in found.items():
        felt, jump, swing = expected[name]
        assert (press.felt, press.jump) == pytest.approx((felt, jump), rel=1e-6), name
        assert press.swing == pytest.approx(swing, rel=1e-4, abs=1e-9), name


def test_the_ways_follow_from_mass_friction_and_period() -> None:
    """A unit of damping is m/T, and a wall of 2 b/T is passive without a guard."""
    ways = _ways(AXIS, T, 0)
    sure = "every stiffness, if b is true"
    half = {"kind": "half_sample", "horizon": 0.5, "observer": 1000.0, "deadbeat": False}
    bound = {"kind": "energy_bound", "damping": [0.05], "lateness": 0.0}
    expected = [
        _Way("no guard", "stiffness up to 2 b/T = 100 N/m"),
        _Way("damper of 0.1 m/T", damping=6.0),
        _Way("damper of 0.4 m/T", damping=24.0),
        _Way("passivity controller, cap 0.1 m/T", guard={"kind": "passivity_controller", "cap": 0.1}),
        _Way("passivity controller, cap 0.5 m/T", guard={"kind": "passivity_controller", "cap": 0.5}),
        _Way("half-sample, backward difference", guard={**half, "velocity": "backward"}),
        _Way("half-sample, adaptive window", guard={**half, "velocity": "adaptive_window"}),
        _Way("half-sample, observer", guard={**half, "velocity": "observer"}),
        _Way("half-sample, observer, deadbeat exit", guard={**half, "velocity": "observer", "deadbeat": True}),
        _Way("sample-estimate-hold", guard={"kind": "sample_estimate_hold", "correction": 1.0}),
        _Way("sample-estimate-hold, no correction", guard={"kind": "sample_estimate_hold", "correction": 0.0}),
        _Way("energy bound", sure, guard={**bound, "coulomb": [0.0]}),
        _Way(
            "energy bound, dry friction",
            "every stiffness, if b and f_c are true",
            guard={**bound, "coulomb": [pytest.approx(0.016)]},
        ),
        _Way("virtual coupling of 2 b/T", sure, coupling=100.0),
        _Way("virtual coupling of 8 b/T (two-port)", "by the two-port alone, which is not exact", coupling=400.0),
        _Way("admittance display, workspace controller", "needs a force sensor", admittance=True),
    ]
    assert len(ways) == len(expected)
    for way, one in zip(ways, expected, strict=True):
        assert (way.name, way.guarantee, way.guard, way.admittance) == (
            one.name, one.guarantee, one.guard, one.admittance
        )  # fmt: skip
        assert (way.damping, way.coupling) == pytest.approx((one.damping, one.coupling))
    names = [way.name for way in ways]
    delayed = _ways(AXIS, T, 1)  # passive up to b over (n + 1/2) T
    renamed = [name.replace("b/T", "b/(3 T)") for name in names if "deadbeat" not in name]
    assert [way.name for way in delayed] == renamed
    assert delayed[0].guarantee == "stiffness up to 2 b/(3 T) = 33.33 N/m"
    assert [way.coupling for way in delayed if "coupling" in way.name] == pytest.approx([100.0 / 3.0, 400.0 / 3.0])
    smooth = _ways(TipAxis(0.06, 0.05, 0.0, 1e-5), T, 0)
    assert [way.name for way in smooth] == [name for name in names if "dry" not in name]
    without = _ways(TipAxis(0.06, 0.0, 0.02, 1e-5), T, 0)
    assert [way.name for way in without] == [*names[:11], names[-1]]
    assert without[0].guarantee == "stiffness up to 2 b/T = 0 N/m"


@pytest.mark.parametrize(("count", "rest"), [(0.0, 15e-6), (20e-6, 20e-6)])
def test_a_way_reaches_up_to_the_last_stiffness_before_the_first_that_fails(count: float, rest: float) -> None:
    """It rests within 15 µm or one count after every impact, and shows 90 %."""
    shown: dict[tuple[float, float], _Press] = {}

    def row(*walls: tuple[float, float, float, float]) -> Any:
        """Return the row of walls, each of stiffness, worst swing, least share and largest step."""
        for stiffness, swing, felt, jump in walls:
            shown[stiffness, 0.1] = _Press(0.5 * swing, felt, 0.25 * jump)
            shown[stiffness, 0.2] = _Press(swing, felt + 0.05, jump)
            shown[stiffness, 0.3] = _Press(0.2 * swing, felt + 0.01, 0.5 * jump)
        loop: Any = SimpleNamespace(
            axis=TipAxis(0.1, 0.0, 0.0, count), press=lambda stiffness, _way, speed: shown[stiffness, speed]
        )
        return _row(loop, _Way("it", "nothing"), [wall[0] for wall in walls], [0.1, 0.2, 0.3])

    found = row((100.0, rest, 0.9, 3.0), (200.0, 0.5 * rest, 0.95, 4.0), (300.0, 1.01 * rest, 0.99, 5.0))
    assert (found.name, found.guarantee) == ("it", "nothing")
    assert (found.stiffness, found.felt, found.jump, found.swing) == (200.0, 0.95, 4.0, 1.01 * rest)
    found = row((100.0, 0.0, 0.95, 3.0), (200.0, 0.0, 0.899, 4.0), (300.0, 0.0, 0.99, 5.0))
    assert (found.stiffness, found.felt, found.jump, found.swing) == (100.0, 0.95, 3.0, 0.0)
    found = row((100.0, math.inf, 0.0, 3.0))
    assert (found.stiffness, found.swing) == (0.0, math.inf)
    assert math.isnan(found.felt)
    assert math.isnan(found.jump)


def test_a_comparison_runs_every_way_on_every_wall_with_every_impact(monkeypatch: pytest.MonkeyPatch) -> None:
    runs: list[Any] = []

    def press(loop: _Axis, stiffness: float, way: _Way, impact: float) -> _Press:
        runs.append((loop, way.name, stiffness, impact))
        return _Press(0.0, 1.0, stiffness)

    monkeypatch.setattr(_Axis, "press", press)
    said: list[tuple[str, float]] = []
    found = compare_guards("slider", progress=lambda *one: said.append(one))
    device = load("slider")
    axis = tip_axis(device, device.model.working_pose, [1.0, 0.0, 0.0])
    ways = _ways(axis, device.servo_period, 0)
    walls, impacts = (500.0, 1e3, 2e3, 3.5e3, 5e3, 1e4, 2e4), (0.02, 0.1, 0.3)
    assert said == [(way.name, number / len(ways)) for number, way in enumerate(ways)]
    loop = _Axis(axis, device.servo_period, 0, 1.0)
    assert runs == [(loop, way.name, wall, speed) for way in ways for wall in walls for speed in impacts]
    assert (found.device, found.axis, found.period, found.delay, found.push) == (
        "slider", axis, device.servo_period, 0, 1.0
    )  # fmt: skip
    assert (found.stiffnesses, found.impacts) == (walls, impacts)
    assert [(row.name, row.stiffness, row.jump) for row in found.rows] == [(way.name, 2e4, 2e4) for way in ways]
    runs.clear()
    arm, pose = load("phantom-premium-1.5a"), [0.2, 1.9, 2.9]
    for direction, along in (([0.0, 3.0, 0.0], [0.0, 1.0, 0.0]), (None, [0.0, 0.0, 1.0])):
        found = compare_guards(
            arm, pose, direction, period="2 ms", delay=64, push="0.5 N", stiffnesses=[7.0], impacts=[0.4]
        )
        assert found.axis == tip_axis(arm, pose, along)
        assert (found.period, found.delay, found.push) == (2e-3, 64, 0.5)
    assert compare_guards(arm, axis=AXIS, push=0.0, stiffnesses=[7.0], impacts=[0.4]).axis is AXIS


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"delay": -1}, r"^delay must be 0 to 64 servo periods, not -1$"),
        ({"delay": 65}, r"^delay must be 0 to 64 servo periods, not 65$"),
        ({"stiffnesses": []}, "at least one of each"),
        ({"impacts": []}, "at least one of each"),
        ({"stiffnesses": [0.0, 5.0]}, "stiffnesses must be positive"),
        ({"push": -1.0}, "push must not be negative"),
        ({"period": 0.0}, "period must be positive"),
    ],
)
def test_a_comparison_of_nothing_is_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(StabilityError, match=says):
        compare_guards("slider", axis=AXIS, **change)


def test_a_saved_comparison_has_null_for_what_is_not_known(tmp_path: Path) -> None:
    rows = (
        guard_comparison.GuardRow("a", 100.0, 0.95, 0.5, 1e-6, "none"),
        guard_comparison.GuardRow("b", 0.0, math.nan, math.nan, math.inf, "none"),
    )
    made = guard_comparison.GuardComparison("slider", AXIS, T, 1, (100.0,), (0.1,), 1.0, rows)
    path = made.save(tmp_path / "a.json")
    assert json.loads(path.read_text()) == {
        "device": "slider",
        "axis": {"mass": 0.06, "damping": 0.05, "coulomb": 0.02, "count": 1e-5},
        "period": T,
        "delay": 1,
        "stiffnesses": [100.0],
        "impacts": [0.1],
        "push": 1.0,
        "rows": [
            {"name": "a", "stiffness": 100.0, "felt": 0.95, "jump": 0.5, "swing": 1e-6, "guarantee": "none"},
            {"name": "b", "stiffness": 0.0, "felt": None, "jump": None, "swing": None, "guarantee": "none"},
        ],
    }


def test_a_direction_may_deviate_by_a_millionth_from_the_way_of_the_tip() -> None:
    slider = load("slider")
    assert tip_axis(slider, [0.0], [1.0, 0.9e-6, 0.0]).mass == pytest.approx(0.06)
    with pytest.raises(ValueError, match="cannot move its tip along it"):
        tip_axis(slider, [0.0], [1.0, 1.5e-6, 0.0])
    oblique: Any = SimpleNamespace(jacobian=lambda _: np.array([[0.6], [0.0], [0.8]]))
    assert _movable(oblique, [0.0]).tolist() == [0.0, 0.0, 1.0]  # no axis is, and the refusal names the direction
    nearly: Any = SimpleNamespace(jacobian=lambda _: np.array([[1.0], [0.9e-6], [0.0]]))
    assert _movable(nearly, [0.0]).tolist() == [1.0, 0.0, 0.0]
    less: Any = SimpleNamespace(jacobian=lambda _: np.array([[1.0], [1.5e-6], [0.0]]))
    assert _movable(less, [0.0]).tolist() == [0.0, 0.0, 1.0]
