"""Verdicts of a batch: what each cell's numbers are judged by, and the linear loop of each cell."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.linear_evidence import linear_sign
from palpate.simulation.outcome_rows import Excursion
from palpate.simulation.simulator import build_simulation
from palpate.sweeps import judged_rows
from palpate.sweeps.judged_rows import _beyond, _slowest_slide, judge_rows, linear_radii

ARM: dict[str, Any] = {
    "device": {"name": "phantom-premium-1.5a", "encoder": True},
    "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
    "servo": {"period": "1 ms"},
    "reference": {"force": ["0.3 N", "-0.2 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "1 N/mm", "position": ["0 mm", "0 mm", "0 mm"]},
    "run": {"duration": "0.1 s"},
}
SLIDER: dict[str, Any] = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "50 N/m", "damping": "0.5 N*s/m"},
    "run": {"duration": "0.1 s"},
}
N = 6


@pytest.fixture
def judged(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Return what the verdicts are decided by; all cells are given and get the verdict 3."""
    rng = np.random.default_rng(1)
    names = ("oscillation_2", "oscillation_4", "oscillation_5", "touching_5", "contacts_5", "saturated_5")
    out = {name: rng.random(N) for name in names}
    out |= {"steady_tip": 1e-3 * rng.normal(size=(N, 3)), "unstable_from": np.full(N, np.nan)}
    out["unstable_from"][2] = 0.03
    out["ripple"] = out["oscillation_5"] * np.array([1.0, 5.0, 20.0, 0.1, 2.0, 1.5])
    seen: dict[str, Any] = {"out": out}
    monkeypatch.setattr(judged_rows, "name_rows", lambda _rows, period: seen.update(period=period) or dict(out))
    monkeypatch.setattr(judged_rows, "excursions", lambda rows: ("of", rows))
    monkeypatch.setattr(judged_rows, "_beyond", lambda *what: seen.update(reach=what) or np.arange(N) % 2 == 0)
    monkeypatch.setattr(judged_rows, "_slowest_slide", lambda _: 0.99)
    monkeypatch.setattr(judged_rows, "decide", lambda evidence: seen.update(evidence=evidence) or np.full(N, 3))
    return seen


@pytest.mark.parametrize("kind", ["spring", "wall", "none"])
def test_a_cell_is_judged_by_its_deflection_and_the_decay_of_its_linear_loop(kind: str, judged: dict[str, Any]) -> None:
    tables = {**ARM, "object": {"kind": "none"}}
    if kind == "spring":
        tables["object"] = {"kind": "spring", "stiffness": "1 N/mm"}
    elif kind == "wall":
        place = ["0.1 mm", "0.2 mm", "-0.3 mm"]
        tables["object"] = {"kind": "wall", "stiffness": "1 N/mm", "normal": [-0.6, 0.0, 0.8], "position": place}
    simulation = build_simulation(tables)
    simulation.setup.window_start = 40
    stiffness = np.linspace(500.0, 1500.0, N)[:, None] * np.array([1.0, 1.5, 2.0])
    radii = np.array([0.5, 0.9999, 1.0, 1.2, np.nan, 0.999])
    columns = {"stiffness": stiffness} if kind == "spring" else {}
    rows = np.zeros((N, 30))
    found = judge_rows(simulation, rows, columns, radii)
    evidence, out = judged["evidence"], judged["out"]
    steady = out["steady_tip"] - np.array(simulation.scenario.object.position)
    force = np.array([0.3, -0.2, 0.0])
    if kind == "wall":
        normal = np.array([-0.6, 0.0, 0.8])
        np.testing.assert_allclose(evidence.deflection, [max(-one @ normal, 0.0) for one in steady])
        assert evidence.pressed.all()
        assert np.isnan(evidence.error).all()
    else:
        np.testing.assert_allclose(evidence.deflection, [np.linalg.norm(one) for one in steady])
        assert not evidence.pressed.any()
    if kind == "spring":
        wanted = force / stiffness
        error = [
            max(abs(one[axis] / want[axis] - 1.0) for axis in (0, 1)) for one, want in zip(steady, wanted, strict=True)
        ]
        np.testing.assert_allclose(evidence.error, error)
        np.testing.assert_allclose(judged["reach"][2], wanted)
    else:
        assert np.isnan(judged["reach"][2]).all()
        assert judged["reach"][2].shape == (N, 3)
    assert judged["period"] == 1e-3
    assert judged["reach"][0] is simulation
    assert judged["reach"][1] == ("of", rows)
    np.testing.assert_array_equal(judged["reach"][3], evidence.error)
    for name, key in (("unstable_from", "unstable_from"), ("early", "oscillation_2"), ("prior", "oscillation_4"),
                      ("late", "oscillation_5"), ("ripple", "ripple"), ("touching", "touching_5"),
                      ("contacts", "contacts_5"), ("saturated", "saturated_5")):  # fmt: skip
        np.testing.assert_array_equal(getattr(evidence, name), out[key])
    fifth = (100 - 40) // 5
    np.testing.assert_allclose(evidence.decay, radii**fifth)
    turns = fifth * np.sqrt(out["oscillation_5"] / out["ripple"]) / (2.0 * np.pi)
    assert 0 < np.count_nonzero(turns < 1.0) < N
    np.testing.assert_array_equal(
        evidence.trend, [r if t < 1.0 else 0.0 for r, t in zip(out["ripple"], turns, strict=True)]
    )
    np.testing.assert_array_equal(evidence.linear, [1, 1, 0, -1, 0, 1])
    jacobian = simulation.device.jacobian(simulation.start)
    counts = 2.0 * np.linalg.norm(np.abs(jacobian) @ simulation.device.encoder_step)
    np.testing.assert_allclose(evidence.resolution, counts)
    assert evidence.lossy.all()
    np.testing.assert_array_equal(evidence.beyond, np.arange(N) % 2 == 0)
    assert list(found) == [*out, "beyond_reach", "linear", "verdict"]
    np.testing.assert_array_equal(found["beyond_reach"], [1.0, 0.0, np.nan, 0.0, 1.0, 0.0])
    np.testing.assert_array_equal(found["linear"], [1.0, 1.0, 0.0, -1.0, 0.0, 1.0])
    np.testing.assert_array_equal(found["verdict"], np.full(N, 3.0))


@pytest.mark.parametrize("slide", [np.nan, 0.9957, 0.9958, 0.9999])
def test_a_slide_along_a_wall_counts_if_it_outlasts_a_fifth(
    slide: float, judged: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """95 % must be left of it after the fifth of twelve ticks."""
    monkeypatch.setattr(judged_rows, "_slowest_slide", lambda _: slide)
    simulation = build_simulation(ARM)
    simulation.setup.window_start = 40
    radii = np.array([0.5, 0.9999, 0.99999, 1.2, np.nan, 0.9])
    judge_rows(simulation, np.zeros((N, 30)), {}, radii)
    left = slide**12 if slide**12 > 0.95 else np.nan
    expected = np.fmax(radii**12, left)
    np.testing.assert_allclose(judged["evidence"].decay, expected)
    assert (0.9957**12 > 0.95, 0.9958**12 > 0.95) == (False, True)


def test_the_slowest_slide_is_the_slowest_motion_that_decays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the loop with a spring in place of the wall; one at its limit does not decay."""
    asked: list[Any] = []
    moduli = [0.3, -0.97, 1.0 - 0.9e-9, 1.0, 1.3]

    def loop(scenario: Any, controller: Any) -> Any:
        asked.append((scenario.object.kind, scenario.object.normal, controller))
        return SimpleNamespace(path=SimpleNamespace(A=np.diag(moduli)))

    monkeypatch.setattr(judged_rows, "scenario_loop", loop)
    wall = {"kind": "wall", "stiffness": "1 N/mm", "normal": [1.0, 0.0, 0.0]}
    simulation = build_simulation({**ARM, "object": wall})
    assert _slowest_slide(simulation) == pytest.approx(0.97)
    assert asked == [("spring", None, simulation.controller)]
    moduli[:] = [0.3, 0.2, 1.0 - 2e-9, 1.5, -0.5]
    assert _slowest_slide(simulation) == 1.0 - 2e-9
    moduli[:] = [1.0, 2.0, 3.0]
    assert np.isnan(_slowest_slide(simulation))
    assert np.isnan(_slowest_slide(build_simulation(ARM)))

    def none(*_: Any, **__: Any) -> Any:
        raise StabilityError("no loop")

    monkeypatch.setattr(judged_rows, "scenario_loop", none)
    assert np.isnan(_slowest_slide(simulation))


def test_a_cell_is_beyond_reach_by_its_pose_or_where_its_force_would_take_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """The second is asked only near a singular pose, off force over stiffness; cells that diverged are not asked."""
    asked: dict[str, Any] = {}

    def left(device: Any, start: Any, least: Any, greatest: Any, worst: Any) -> Any:
        asked.update(device=device, start=start, least=least, greatest=greatest, worst=worst)
        return np.array([True, False, False, False, False])

    monkeypatch.setattr(judged_rows, "excursion_beyond", left)
    monkeypatch.setattr(judged_rows, "conditioning", lambda _device, end: asked.update(end=end) or end[:, 1])
    monkeypatch.setattr(
        judged_rows, "unreachable", lambda _device, start, to: asked.update(to=to) or np.array([True, False])
    )
    position = ["1 mm", "2 mm", "3 mm"]
    simulation = build_simulation({**ARM, "object": {**ARM["object"], "position": position}})
    end = np.array([[0.0, 0.9], [np.nan, np.nan], [0.0, 0.049], [0.0, 0.01], [0.0, 0.05], [0.0, 0.01]])
    error = np.array([0.1, 0.1, -1.1e-3, 1e-3, 0.2, 0.3])
    expected = 1e-2 * np.arange(18.0).reshape(6, 3)
    joints = Excursion(end + 1.0, end + 2.0, end + 3.0, end)
    found = _beyond(simulation, joints, expected, error)
    kept = [0, 2, 3, 4, 5]
    for name, add in (("least", 1.0), ("greatest", 2.0), ("worst", 3.0)):
        np.testing.assert_array_equal(asked[name], end[kept] + add)
    np.testing.assert_array_equal(asked["end"], end[[0, 2, 4, 5]])
    np.testing.assert_allclose(asked["to"], expected[[2, 5]] + np.array([1e-3, 2e-3, 3e-3]))
    np.testing.assert_array_equal(asked["start"], simulation.start)
    assert found.tolist() == [True, False, True, False, False, False]
    asked.pop("to")
    flat = simulation.scenario.model_copy(
        update={"device": simulation.scenario.device.model_copy(update={"kinematics": "linear"})}
    )
    other: Any = SimpleNamespace(device=simulation.device, start=simulation.start, scenario=flat)
    assert _beyond(other, joints, expected, error).tolist() == [True, *[False] * 5]
    assert "to" not in asked


@pytest.mark.parametrize(
    ("change", "columns", "known"),
    [
        ({}, {}, True),
        ({}, {"stiffness": [1.0, 1.0, 1.0]}, True),
        ({}, {"stiffness": [1.0, 1.0, 1.0], "damping": [2.0, 2.0, 2.0], "seed": [1.0]}, True),
        ({}, {"stiffness": [1.0, 2.0, 1.0]}, False),
        ({}, {"damping": [1.0, 1.0, 1.5]}, False),
        ({}, {"stiffness": [1.0, 1.0, 1.0], "arm_mass": [1.0]}, False),
        ({"object": {**SLIDER["object"], "coupling": "bilinear"}}, {}, False),
        ({"servo": {**SLIDER["servo"], "jitter": "0.1 ms"}}, {}, False),
        ({"object": {"kind": "none"}}, {}, False),
        ({"object": {"kind": "wall", "stiffness": "50 N/m", "normal": [1, 0, 0]}}, {}, True),
    ],
)
def test_the_linear_loop_is_known_for_one_stiffness_and_damping(
    change: dict[str, Any], columns: dict[str, list[float]], known: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Any] = []
    loop = SimpleNamespace(normalized=False, stiffness=np.diag([30.0, 40.0, 20.0]))
    monkeypatch.setattr(judged_rows, "scenario_loop", lambda _scenario, controller: asked.append(controller) or loop)
    monkeypatch.setattr(judged_rows, "loop_radii", lambda *what: asked.append(what) or np.arange(4.0))
    simulation = build_simulation({**SLIDER, **change})
    scale = np.arange(1.0, 5.0)[:, None]
    given = {name: scale * np.array(values) for name, values in columns.items()}
    found = linear_radii(simulation, given, 4)
    if not known:
        assert np.isnan(found).all()
        assert len(found) == 4
        return
    np.testing.assert_array_equal(found, np.arange(4.0))
    assert asked[0] is simulation.controller
    stiffness = scale[:, 0] if "stiffness" in columns else np.full(4, 50.0)
    own = simulation.scenario.object.damping[0]
    damping = 2.0 * scale[:, 0] if "damping" in columns else np.full(4, own)
    assert asked[1][0] is loop
    np.testing.assert_allclose(asked[1][1], stiffness)
    np.testing.assert_allclose(asked[1][2], damping)


def test_a_normalized_controller_sees_its_design_stiffness_in_every_cell(monkeypatch: pytest.MonkeyPatch) -> None:
    """And the damping in that ratio; without a stiffness the damping as it is."""
    loop = SimpleNamespace(normalized=True, stiffness=np.diag([30.0, 40.0, 20.0]))
    seen: list[Any] = []
    monkeypatch.setattr(judged_rows, "scenario_loop", lambda _scenario, controller: loop)
    monkeypatch.setattr(judged_rows, "loop_radii", lambda _loop, k, b: seen.append((k, b)) or k)
    simulation = build_simulation(SLIDER)
    columns = {"stiffness": np.outer([0.0, 10.0, 80.0], np.ones(3)), "damping": np.outer([3.0, 4.0, 5.0], np.ones(3))}
    linear_radii(simulation, columns, 3)
    np.testing.assert_allclose(seen[0][0], [40.0, 40.0, 40.0])
    np.testing.assert_allclose(seen[0][1], [3.0, 16.0, 2.5])

    def none(*_: Any, **__: Any) -> Any:
        raise StabilityError("no loop")

    monkeypatch.setattr(judged_rows, "scenario_loop", none)
    assert np.isnan(linear_radii(simulation, columns, 3)).all()


def test_the_radius_of_a_cell_is_that_of_its_own_loop() -> None:
    """The slider is stable up to K = 2 b/T, without a damper of the object's own."""
    simulation = build_simulation({**SLIDER, "object": {"kind": "spring", "stiffness": "50 N/m"}})
    stiffness = np.outer([90.0, 99.9, 100.1, 500.0], np.ones(3))
    radii = linear_radii(simulation, {"stiffness": stiffness}, 4)
    assert [linear_sign(radius) for radius in radii] == [1, 1, -1, -1]
    assert isinstance(simulation.scenario, Scenario)


@pytest.mark.parametrize("name", ["reference", "operator"])
def test_a_wall_is_pressed_by_the_forces_of_the_last_sample(name: str, judged: dict[str, Any]) -> None:
    """Those of reference and operator together, against its outward normal."""
    wall = {"kind": "wall", "stiffness": "1 N/mm", "normal": [0.0, 0.0, 1.0]}
    simulation = build_simulation({**ARM, "object": wall})
    forces = np.zeros_like(simulation.reference)
    pushed = forces.copy()
    pushed[-1, 2] = -1.0
    for last, pressed in ((pushed, True), (-pushed, False), (np.roll(pushed, 2, axis=0), False)):
        given = {"reference": forces, "operator": forces, name: last}
        judge_rows(replace(simulation, **given), np.zeros((N, 30)), {}, np.full(N, np.nan))
        assert judged["evidence"].pressed.all() == pressed
    moved = np.roll(pushed, 1, axis=0) + np.roll(pushed, -1, axis=0)
    judge_rows(replace(simulation, **{"reference": forces, "operator": forces, name: moved}), np.zeros((N, 30)), {},
               np.full(N, np.nan))  # fmt: skip
    assert not judged["evidence"].pressed.any()
