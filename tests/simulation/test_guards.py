"""Guards of a scenario: what they guarantee on any object, what they refuse, and that no linear verdict is claimed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import palpate
import pytest
from palpate import devices, metrics, stability
from palpate.errors import PalpateError, ScenarioError, StabilityError
from palpate.metrics.guard_comparison import _Axis, _row, _Way, _ways
from palpate.scenario import Scenario
from palpate.simulation import Trace, build_simulation, resolve, simulate
from palpate.sweeps import sweep
from scipy.linalg import expm

CATALOG = Path(devices.__file__).parent
VISCOUS, COULOMB = np.array([0.05, 0.001, 0.01]), np.array([5e-3, 2e-3, 3e-3])
OBJECTS: dict[str, dict[str, Any]] = {
    "wall": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "6 N/mm"},
    "mesh": {
        "kind": "mesh",
        "mesh": {"shape": "box", "edge": "60 mm", "divisions": 4, "rotation": ["0 deg", "20 deg", "0 deg"]},
        "surface": {"stiffness": "6 N/mm", "static_friction": 0.6, "dynamic_friction": 0.4},
    },
    "body": {
        "kind": "body",
        "position": ["0 mm", "0 mm", "-9 mm"],
        "body": {
            "shape": "block",
            "size": ["40 mm", "40 mm", "20 mm"],
            "young": "600 kPa",
            "spacing": "10 mm",
            "radius": "8 mm",
        },
    },
}
BOUND = {"kind": "energy_bound", "viscous": 1.0, "coulomb": 1.0}


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the file of the arm with dry friction in its joints."""
    text = (CATALOG / "phantom-premium-1.5a.toml").read_text(encoding="utf-8")
    values = ", ".join(f'"{value} N*m"' for value in COULOMB)
    path = tmp_path_factory.mktemp("device") / "dry-arm.toml"
    path.write_text(text.replace("[friction]", f'[friction]\ncoulomb = {{ value = [{values}], source = "assumed" }}'))
    return str(path)


def press(arm: str, touched: dict[str, Any], guard: dict[str, Any] | None, **other: Any) -> Scenario:
    """A press of 1 N on an object 1 mm below the tip, which then slides, and is pressed less and more."""
    table = [[0.0, 0.0, 0.0, -1.0], [0.2, 0.1, 0.0, -1.0], [0.3, 0.0, 0.0, -0.2], [0.4, 0.0, 0.0, -1.5]]
    rows = [[f"{t} s", *(f"{force} N" for force in forces)] for t, *forces in table]
    return Scenario.from_dict(
        {
            "device": {"name": arm, **other.pop("device", {})},
            "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
            "servo": {"period": "1 ms", "topology": "impedance_display", **other.pop("servo", {})},
            "operator": {"kind": "force", "shape": "table", "table": rows},
            "object": {"position": ["0 mm", "0 mm", "-1 mm"], **touched},
            **({} if guard is None else {"guard": guard}),
            "run": {"duration": "0.5 s"},
            **other,
        }
    )


def energy(scenario: Scenario, trace: Trace) -> np.ndarray[Any, Any]:
    """Return the energy that display and friction have absorbed at each sample (n,), J; late ticks count as T + J."""
    device, q = scenario.load_device(), trace["angle"]
    step = device.encoder_step if scenario.device.encoder else np.zeros(3)
    measured = np.where(step > 0.0, np.rint(q / np.where(step > 0.0, step, 1.0)) * step, q)
    hold = np.einsum("nij,i->nj", device.jacobian(measured), build_simulation(scenario).hold)
    own, moved = (trace["torque"] - hold)[:-1], np.diff(q, axis=0)
    longest = scenario.period + scenario.servo.jitter
    return np.cumsum((-own * moved + VISCOUS / longest * moved**2 + COULOMB * np.abs(moved)).sum(axis=1))


@pytest.mark.parametrize("kind", list(OBJECTS))
@pytest.mark.parametrize(
    "case", [{}, {"servo": {"jitter": "0.9 ms"}}, {"device": {"encoder": True, "saturation": True}}]
)
def test_an_energy_bound_never_delivers_more_than_the_friction_dissipates(
    arm: str, kind: str, case: dict[str, Any]
) -> None:
    """Law: on a wall, a mesh with friction and a body; with late ticks, counts and drive limits; without a fault."""
    scenario = press(arm, OBJECTS[kind], BOUND, **case)
    trace = simulate(scenario)
    assert trace.unstable_from is None
    assert len(trace) == 501
    assert energy(scenario, trace).min() >= -1e-14
    assert np.abs(trace["object_force"]).max() > 0.5
    reduced = np.linalg.norm(trace["command_force"], axis=1) < 0.99 * np.linalg.norm(trace["object_force"], axis=1)
    assert reduced.any()


def test_without_the_bound_the_same_press_delivers_energy(arm: str) -> None:
    scenario = press(arm, OBJECTS["wall"], None)
    assert energy(scenario, simulate(scenario)).min() < -1e-4


@pytest.mark.parametrize("kind", list(OBJECTS))
@pytest.mark.parametrize("case", [{}, {"servo": {"jitter": "0.9 ms"}}])
def test_a_passivity_controller_takes_back_what_the_display_delivers(arm: str, kind: str, case: dict[str, Any]) -> None:
    """Law: on any object it delivers under a tenth of the energy that the loop without it does, and takes it back."""
    scenario = press(arm, OBJECTS[kind], {"kind": "passivity_controller"}, **case)
    trace, bare = simulate(scenario), simulate(press(arm, OBJECTS[kind], None, **case))
    assert trace.unstable_from is None
    own = energy(scenario, trace)
    assert energy(scenario, bare).min() < -0.03
    assert own.min() > 0.1 * energy(scenario, bare).min()
    assert own[-1] > 0.0


def test_the_trace_tells_which_friction_the_bound_takes_from_the_device(arm: str) -> None:
    trace = simulate(press(arm, OBJECTS["wall"], {"kind": "energy_bound"}))
    found = trace.metadata["guard"]
    assert found["kind"] == "energy_bound"
    assert found["damping"] == pytest.approx(0.8 * VISCOUS)
    assert found["coulomb"] == pytest.approx(0.8 * COULOMB)
    summary = metrics.summarize(trace)
    assert summary["guard"] == found
    assert "relies on the device's friction, 0.04, 0.0008, 0.008 N*m*s/rad and" in summary["verdict"]


def slider(guard: Any, **other: Any) -> dict[str, Any]:
    """The catalog's slider leans on a wall with 1 N."""
    return {
        "device": {"name": "slider", **other.pop("device", {})},
        "servo": {"topology": "impedance_display", **other.pop("servo", {})},
        "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]},
        "object": {"kind": "wall", "normal": [-1, 0, 0], "stiffness": "2 N/mm"},
        "guard": guard,
        "run": {"duration": "1 s"},
        **other,
    }


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (slider({"kind": ["energy_bound", "half_sample"]}), "guard.kind: a loop has one guard"),
        (slider([{"kind": "energy_bound"}, {"kind": "half_sample"}]), "guard: a loop has one guard"),
        (slider({"kind": "half_sample", "cap": 0.3}), 'guard.cap has no meaning for kind = "half_sample"'),
        (slider({"kind": "half_sample", "observer": "300 rad/s"}), 'observer belongs to velocity = "observer"'),
        (
            slider({"kind": "sample_estimate_hold", "correction": 2.0}),
            "guard.correction: 2; it must be between 0 and 1",
        ),
        (
            slider({"kind": "half_sample", "deadbeat": True}, device={"delay": 1}),
            "guard.deadbeat: the two forces must act at once, and the device has a delay of 1 servo period(s)",
        ),
        (slider({"kind": "energy_bound", "viscous": 1.5}), "guard.viscous: 1.5; it must be above 0 and at most 1"),
        (slider({"kind": "energy_bound"}, device={"model": "linear"}), "guard.kind: an energy bound relies on dry"),
        (
            slider({"kind": "half_sample"}, servo={"topology": "force_tracking"}, operator={"kind": "none"})
            | {"reference": {"force": ["1 N", "0 N", "0 N"]}},
            "guard.kind: in force_tracking the motors supply energy by design",
        ),
    ],
)
def test_a_guard_that_does_not_fit_is_refused_with_one_sentence(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(tables)
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_device_without_viscous_friction_has_no_energy_bound(tmp_path: Path) -> None:
    text = (CATALOG / "slider.toml").read_text(encoding="utf-8")
    (tmp_path / "bare.toml").write_text(text.replace("0.05 N*s/m", "0 N*s/m"))
    with pytest.raises(ScenarioError, match=r"relies on viscous friction of each joint, and joint 1 .* has none"):
        Scenario.from_dict(slider({"kind": "energy_bound"}, device={"name": str(tmp_path / "bare.toml")}))


@pytest.mark.parametrize(
    "guard", [{"kind": "passivity_controller"}, {"kind": "half_sample"}, {"kind": "sample_estimate_hold"}, BOUND]
)
def test_no_linear_analysis_is_claimed_for_a_guarded_loop(guard: dict[str, Any]) -> None:
    """Law: the linear loop is that without the guard, so the run alone is judged and every analysis refuses."""
    tables = slider(guard, object={"kind": "spring", "stiffness": "2 N/mm"})
    trace = simulate(tables)
    assert "a guard makes the loop nonlinear" in str(trace.verdict.linear)
    assert "spectral radius" not in str(trace.verdict)
    for analysis in (stability.certify, stability.zwidth, metrics.measure_performance):
        with pytest.raises(StabilityError, match=r"guard\.kind: a guard makes the loop nonlinear"):
            analysis(tables)
    unguarded = simulate({**tables, "guard": {"kind": "none"}})
    assert "the linear loop is unstable" in str(unguarded.verdict.linear)


def test_half_sample_prediction_extends_the_spring_to_its_exact_limit() -> None:
    """Golden: with a backward difference the slider is stable up to 3448 N/m, without prediction up to 100 N/m."""
    for stiffness, decays in (("3.4 N/mm", True), ("3.5 N/mm", False)):
        spring = {"kind": "spring", "stiffness": stiffness}
        tip = simulate(slider({"kind": "half_sample"}, object=spring, run={"duration": "4 s"}))["tip"][:, 0]
        assert bool(np.ptp(tip[-1000:]) < np.ptp(tip[:1000])) is decays


@pytest.mark.parametrize("correction", [0.0, 1.0])
def test_sample_estimate_hold_extends_the_spring_to_its_exact_limit(correction: float) -> None:
    """Golden: without correction that of a damper of K T/2, 3448 N/m; with it that of the filter 2, -3/2, 1/2."""
    m, b, t = 0.06, 0.05, 1e-3
    decay = np.exp(-b * t / m)
    held = m / b * (1.0 - decay)
    a = np.zeros((4, 4))  # x, v, and x at the last two samples
    a[0, :2], a[1, 1], a[2, 0], a[3, 2] = (1.0, held), decay, 1.0, 1.0
    entry = np.array([(t - held) / b, (1.0 - decay) / b, 0.0, 0.0])
    taps = np.array([1.5, -0.5, 0.0]) + correction * np.array([0.5, -1.0, 0.5])

    def radius(stiffness: float) -> float:
        law = stiffness * np.array([taps[0], 0.0, taps[1], taps[2]])
        return float(np.abs(np.linalg.eigvals(a - np.outer(entry, law))).max())

    low, high = 1e3, 1e5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if radius(middle) < 1.0 else (low, middle)
    assert low == pytest.approx(3448.0 if correction == 0.0 else 80044.0, rel=0.01)
    for share, decays in ((0.95, True), (1.05, False)):
        spring = {"kind": "spring", "stiffness": f"{share * low!r} N/m"}
        hold = {"kind": "sample_estimate_hold", "correction": correction}
        tip = simulate(slider(hold, object=spring, run={"duration": "4 s"}))["tip"][:, 0]
        assert bool(np.ptp(tip[-1000:]) < max(0.95 * np.ptp(tip[1000:2000]), 1e-9)) is decays


@pytest.mark.parametrize("kind", list(OBJECTS))
@pytest.mark.parametrize("guard", [{"kind": "sample_estimate_hold"}, {"kind": "half_sample", "deadbeat": True}])
def test_an_estimating_guard_works_behind_any_object(arm: str, kind: str, guard: dict[str, Any]) -> None:
    """Law: on a wall, a mesh and a body the display delivers less energy than without the guard."""
    if guard.get("deadbeat"):
        guard = {**guard, "velocity": "observer"}
    scenario, bare = press(arm, OBJECTS[kind], guard), press(arm, OBJECTS[kind], None)
    trace = simulate(scenario)
    assert trace.unstable_from is None
    assert energy(scenario, trace).min() > 0.2 * energy(bare, simulate(bare)).min()


def test_the_trace_marks_the_ticks_that_a_guard_changed(arm: str) -> None:
    """Law: `guarded` is 1 exactly where the command is not the controller's."""
    for guard in (BOUND, {"kind": "passivity_controller"}):
        trace = simulate(press(arm, OBJECTS["wall"], guard))
        changed = np.abs(trace["command_force"] + trace["object_force"]).max(axis=1) > 0.0
        assert np.array_equal(trace["guarded"][:, 0] > 0.0, changed)
        assert 0 < changed.sum() < len(trace)
    assert "guarded" not in simulate(press(arm, OBJECTS["wall"], None))


def test_a_guard_is_a_key_of_a_sweep() -> None:
    found = sweep(slider({"kind": "none"}), {"guard.kind": ["none", "passivity_controller", "half_sample"]})
    assert np.isnan(found["linear"][1:]).all() or (found["linear"][1:] == 0.0).all()
    assert found["linear"][0] != 0.0
    for index in range(3):
        assert found.verdict(index) == found.simulate(index).verdict.state


def test_a_guard_is_resolved_with_the_numbers_of_the_device(arm: str, tmp_path: Path) -> None:
    resolve(press(arm, OBJECTS["wall"], BOUND, servo={"jitter": "0.2 ms"}), tmp_path / "loop")
    found = json.loads((tmp_path / "loop" / "loop.json").read_text("utf-8"))
    assert found["guard"] == {
        "kind": "energy_bound",
        "damping": pytest.approx(VISCOUS.tolist()),
        "coulomb": pytest.approx(COULOMB.tolist()),
        "lateness": 2e-4,
    }


def test_a_stepped_loop_has_the_guard(arm: str) -> None:
    scenario = press(arm, OBJECTS["wall"], {"kind": "half_sample", "velocity": "adaptive_window"})
    stepped = palpate.Loop(scenario).run()
    assert np.array_equal(stepped["torque"], simulate(scenario)["torque"])


def test_guards_compare_as_published_on_the_arms_axis() -> None:
    """Golden: largest of 0.5 to 20 N/mm with a swing of at most 15 um and 90 % felt; T = 1 ms, counts of 25 um."""
    axis = metrics.TipAxis(mass=0.045, damping=0.35, coulomb=0.04, count=25e-6)
    found = metrics.compare_guards("slider", axis=axis, period=1e-3)
    reach = {row.name: row.stiffness for row in found.rows}
    assert reach["no guard"] == 1e3
    assert reach["half-sample, backward difference"] == 1e4
    assert reach["half-sample, observer"] == 1e4
    assert reach["passivity controller, cap 0.5 m/T"] >= 1e4
    assert reach["half-sample, observer, deadbeat exit"] == 2e4
    assert reach["sample-estimate-hold"] == 1e4
    assert reach["sample-estimate-hold, no correction"] == 5e3
    assert reach["admittance display, workspace controller"] == 2e4
    soft = [row for row in found.rows if row.name.startswith("virtual coupling")]
    assert [row.stiffness for row in soft] == [0.0, 0.0]  # 0.7 and 2.8 N/mm in series show less than 90 %
    assert soft[0].swing <= 15e-6 < soft[1].swing  # the two-port accepts a coupling that swings
    bounds = [row for row in found.rows if row.name.startswith("energy bound")]
    assert len(bounds) == 2
    assert all(row.swing <= 15e-6 for row in bounds)


def test_a_press_that_leaves_the_numbers_is_unstable_although_its_rows_are_finite() -> None:
    """The run ends where it is found unstable, before a number is infinite: its swing then is no number of the way."""
    tip = metrics.TipAxis(mass=0.045, damping=0.35, coulomb=0.04, count=25e-6)
    loop = _Axis(tip, 1e-3, 0, 5.0)
    bare, *_ = _ways(tip, 1e-3, 0)
    assert loop.press(1e9, bare, 0.1).swing == np.inf


def test_a_way_to_render_a_wall_has_the_numbers_of_its_name() -> None:
    axis = metrics.TipAxis(mass=0.045, damping=0.35, coulomb=0.04, count=25e-6)
    ways = _ways(axis, 1e-3, 0)
    dampers = {way.name: way.damping for way in ways if way.damping}
    assert dampers == {f"damper of {c} m/T": pytest.approx(c * 45.0) for c in (0.1, 0.4)}
    caps = {way.name: way.guard["cap"] for way in ways if way.guard and "cap" in way.guard}
    assert caps == {f"passivity controller, cap {c} m/T": c for c in (0.1, 0.5)}
    couplings = [way.coupling for way in ways if np.isfinite(way.coupling)]
    assert couplings == pytest.approx([2 * 350.0, 8 * 350.0])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"stiffnesses": [500.0, 0.0]}, "stiffnesses must be positive"),
        ({"stiffnesses": [-1.0]}, "stiffnesses must be positive"),
        ({"stiffnesses": []}, "at least one of each"),
        ({"impacts": []}, "at least one of each"),
        ({"delay": 65}, "delay must be 0 to 64"),
        ({"delay": -1}, "delay must be 0 to 64"),
        ({"push": -1.0}, "push"),
        ({"period": 0.0}, "period"),
    ],
)
def test_a_comparison_that_cannot_be_made_is_refused(options: dict[str, Any], says: str) -> None:
    with pytest.raises(PalpateError, match=says):
        metrics.compare_guards("slider", **options)


def test_the_turning_point_of_a_slow_motion_is_no_rest() -> None:
    """Without a linear loop. A loose hand turns 21 mm deep at the end of 0.2 s, and the tip moves back by 9 mm."""
    hand = {
        "kind": "arm", "mass": "0.1 kg", "damping": "0.7 N*s/m", "stiffness": "8 N/m", "tissue_stiffness": "500 N/m",
        "tissue_damping": "0.3 N*s/m", "force": ["-0.6 N", "0 N", "0 N"],
    }  # fmt: skip
    short, long = (
        simulate(
            {
                "device": {"name": "slider"},
                "servo": {"period": "1 ms", "topology": "impedance_display"},
                "operator": hand,
                "object": {"kind": "spring", "stiffness": "39 N/m"},
                "guard": {"kind": "half_sample"},
                "run": {"duration": f"{duration} s"},
            }
        )
        for duration in (0.2, 1.0)
    )
    assert np.linalg.norm(long["tip"][-1] - short["tip"][-1]) > 0.2 * np.linalg.norm(short["tip"][-1])
    assert short.verdict.state.label == "undecided"
    assert short.verdict.reason.startswith("it rests in the last fifth alone, and moved by ")


def test_a_press_on_a_bare_wall_shows_its_stiffness_at_rest_and_its_jump_in_closed_form() -> None:
    """The mass moves between samples under a force that is held, by the exponential of its matrix."""
    tip = metrics.TipAxis(mass=0.5, damping=30.0, coulomb=0.0, count=0.0)
    loop = _Axis(tip, 1e-3, 0, 5.0)
    bare = _Way("bare")
    held = expm(1e-3 * np.array([[0.0, 1.0, 0.0], [0.0, -30.0 / 0.5, 1.0 / 0.5], [0.0, 0.0, 0.0]]))
    for way, share in ((bare, 1.0), (_Way("coupled", coupling=1200.0), 0.75)):
        found = loop.press(400.0, way, 0.1)
        assert found.felt == pytest.approx(share, rel=1e-6)
        assert found.swing < 1e-9
        state, forces = np.array([0.0, 0.1]), []
        for _ in range(300):
            forces.append(share * 400.0 * state[0])
            state = held[:2, :2] @ state + held[:2, 2] * (5.0 - forces[-1])
        assert found.jump == pytest.approx(np.abs(np.diff(forces)).max(), rel=1e-5)
    away = _Axis(tip, 1e-3, 0, 0.0).press(400.0, bare, -0.1)
    assert (away.felt, away.jump) == (0.0, 0.0)  # it never meets the wall
    delayed = _Axis(tip, 1e-3, 8, 5.0).press(1e4, bare, 0.1)
    assert delayed.swing > 1e-3 or np.isinf(delayed.swing)
    friction = _Axis(replace(tip, coulomb=1.0), 1e-3, 0, 5.0).press(400.0, bare, 0.0)
    assert 1.0 - 1.0 / 5.0 - 1e-3 < 1.0 / friction.felt < 1.0 + 1.0 / 4.0
    counted = _Axis(replace(tip, count=1e-3), 1e-3, 0, 5.0).press(400.0, bare, 0.1)
    assert counted.felt == pytest.approx(1.0, abs=0.05)
    assert counted.jump >= 0.4 - 1e-9  # a count


@pytest.mark.parametrize(
    ("count", "swings", "felts", "best"),
    [
        (0.0, [1e-6, 15e-6, 16e-6, 1e-6], [1.0, 0.9, 1.0, 1.0], 1),
        (20e-6, [1e-6, 20e-6, 20.1e-6, 1e-6], [1.0, 0.9, 1.0, 1.0], 1),
        (0.0, [1e-6, 1e-6, 1e-6, 2e-6], [1.0, 0.95, 0.92, 0.91], 3),
        (0.0, [1e-6, 1e-6, 1e-6, 1e-6], [1.0, 0.899, 0.95, 0.95], 0),
        (0.0, [np.inf, 1e-6, 1e-6, np.inf], [0.0, 1.0, 1.0, 0.0], -1),
    ],
)
def test_a_way_reaches_up_to_the_first_wall_that_swings_or_is_not_felt(
    count: float, swings: list[float], felts: list[float], best: int
) -> None:
    """Within 15 um or a count; the worst of the impacts decides on each wall."""
    walls = [100.0, 200.0, 300.0, 400.0]

    def press(stiffness: float, _way: _Way, impact: float) -> Any:
        k = walls.index(stiffness)
        worst = impact == 0.2
        return SimpleNamespace(
            swing=swings[k] if worst else 0.0, felt=felts[k] if impact == 0.1 else 1.5, jump=stiffness * impact
        )

    loop: Any = SimpleNamespace(press=press, axis=SimpleNamespace(count=count))
    found = _row(loop, _Way("a way", "a guarantee"), walls, [0.1, 0.2, 0.3])
    assert (found.name, found.guarantee, found.swing) == ("a way", "a guarantee", swings[-1])
    if best < 0:
        assert found.stiffness == 0.0
        assert np.isnan([found.felt, found.jump]).all()
    else:
        assert (found.stiffness, found.felt) == (walls[best], felts[best])
        assert found.jump == pytest.approx(0.3 * walls[best])
