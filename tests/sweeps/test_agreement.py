"""The cells of a sweep agree with the exact curve, with the certificate and with the run of the same scenario."""

from __future__ import annotations

import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from agreement import CLASSES, expected_classes, far, right_states, static_error
from nightly import NIGHTLY, nightly
from numpy.typing import NDArray
from palpate.arrays import Array
from palpate.errors import ScenarioError
from palpate.linear import LinearDevice
from palpate.scenario import Scenario
from palpate.simulation.decision import BAND
from palpate.simulation.outcome_rows import Excursion
from palpate.simulation.simulator import build_simulation
from palpate.stability import critical_stiffness
from palpate.sweeps import State, SweepError, sweep
from palpate.sweeps.judged_rows import _beyond

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SIZE = 100 if NIGHTLY else 24
SHOULDER = np.array([0.0, 0.17, -0.215])  # m, of the arm
# scenario: largest stiffness (N/m) and damping (N s/m) of the map, duration
MAPS = {
    "slider-wall-stable": (200.0, 0.2, "20 s"),
    "arm-through-tissue-on-a-wall": (6000.0, 10.0, "2 s"),
    "press-stiff-cube-lqg": (15000.0, 20.0, "1 s"),
    "press-soft-cube-lead-lag": (60000.0, 20.0, "1 s"),
}
MORE = {  # slower maps; a sweep refuses the identified model, so its cells are run one by one
    "slider-wall-unstable": (200.0, 0.2, "20 s"),
    "drive-limits-and-encoder": (15000.0, 20.0, "4 s"),
    "identified-model": (5000.0, 1.5, "12 s"),  # near the stretched arm it takes 10 s to rest
}


def tables_of(name: str, duration: str | None = None) -> dict[str, Any]:
    tables = tomllib.loads((SCENARIOS / f"{name}.toml").read_text("utf-8"))
    if duration is not None:
        tables["run"] = {"duration": duration}
    return tables


def map_of(name: str) -> tuple[Array, Array, NDArray[np.int_], NDArray[np.int_], NDArray[np.bool_]]:
    """Return K, B, the states, the expected classes and the stability of the cells of a map (n, n)."""
    most_k, most_b, duration = (MAPS | MORE)[name]
    tables = tables_of(name, duration)
    over = {
        "object.stiffness": f"{most_k / SIZE} N/m..{most_k} N/m:{SIZE}",
        "object.damping": f"0 N*s/m..{most_b} N*s/m:{SIZE}",
    }
    k, b = np.meshgrid(np.linspace(most_k / SIZE, most_k, SIZE), np.linspace(0.0, most_b, SIZE), indexing="ij")
    if name == "identified-model":
        spring = [
            {"kind": "spring", "stiffness": f"{x} N/m", "damping": f"{y} N*s/m"}
            for x, y in zip(k.flat, b.flat, strict=True)
        ]
        runs = (palpate.simulate({**tables, "object": one}).verdict.state for one in spring)
        states = np.fromiter(runs, dtype=int, count=k.size).reshape(k.shape)
    else:
        states = sweep(tables, over, design="once").outcomes["verdict"].astype(int)
    return k, b, states, *expected_classes(tables, k, b)


def assert_agreement(name: str, linear: bool) -> None:
    """Assert that no cell away from the exact curve is wrong; with the linear loop, most right."""
    k, b, states, classes, stable = map_of(name)
    away, right = far(stable), right_states(classes, states, stable)
    claimed = np.isin(states, (State.SETTLED, State.UNSTABLE)) & ~right
    rows = [
        (k[i], b[i], CLASSES[classes[i]], State(states[i]).label) for i in zip(*np.nonzero(claimed & away), strict=True)
    ]
    report = f"{name}: {right[away].mean():.2%} of {away.sum()} right, {len(rows)} wrong"
    print(report)
    assert not rows, f"{report}: {rows[:9]}"
    if linear:
        assert right[away].mean() >= 0.995, report
        assert len(np.unique(classes)) > 1 or name == "drive-limits-and-encoder"


@pytest.mark.parametrize("linear", [True, False], ids=["with-the-linear-loop", "runs-alone"])
@pytest.mark.parametrize("name", MAPS)
def test_no_cell_away_from_the_exact_curve_is_wrong(name: str, linear: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cells from the curve: none settled that must not be, no stable one unstable; with both, 99.5 % right."""
    if not linear:
        monkeypatch.setattr(
            "palpate.sweeps.plan.linear_radii", lambda _simulation, _columns, count: np.full(count, np.nan)
        )
    assert_agreement(name, linear)


@nightly
@pytest.mark.parametrize("name", MORE)
def test_the_other_scenarios_agree_with_the_exact_curve(name: str) -> None:
    assert_agreement(name, linear=True)


def test_a_rest_beyond_the_reach_is_out_of_reach_in_a_run_and_in_a_cell() -> None:
    """At 300 N/m, F/K is 3.9 mm beyond the stretched arm; with damping the run ends near there, not singular."""
    tables = tables_of("press-stiff-cube-lqg")
    tables["object"] = {"kind": "spring", "stiffness": "300 N/m", "damping": "4 N*s/m"}
    found = sweep(tables, {"object.stiffness": ["300 N/m", "600 N/m"]}, design="once")
    assert [found.verdict(i) for i in range(2)] == [State.OUT_OF_REACH, State.SETTLED]
    assert found.simulate(0).verdict.state is State.OUT_OF_REACH


def test_a_cell_that_overshoots_the_reach_is_out_of_reach() -> None:
    found = sweep(tables_of("press-stiff-cube-lqg"), {"object.stiffness": ["420 N/m"]}, design="once")
    assert found.simulate(0).verdict.state is State.OUT_OF_REACH
    assert found.verdict(0) is State.OUT_OF_REACH
    assert found.outcomes["beyond_reach"][0] == 1.0


@pytest.mark.parametrize(("kinematics", "anchor"), [("nonlinear", 0.0), ("linear", 0.0), ("nonlinear", 0.03)])
def test_a_cell_that_ends_near_the_stretched_arm_is_beyond_reach_if_its_rest_is(kinematics: str, anchor: float) -> None:
    """The arm of 385 mm bends by 6 deg at the end; a tip with a frozen Jacobian has no such limit.

    The rest is force over stiffness from the anchor of the spring, also if that is a share of the arm farther out.
    """
    tables = tables_of("press-stiff-cube-lqg")
    tables["device"]["kinematics"] = kinematics
    anchored = anchor * (np.asarray(build_simulation(tables).device.forward([0.0, 2.0, 2.0 + np.pi / 2])) - SHOULDER)
    tables["object"]["position"] = [f"{x!r} m" for x in anchored.tolist()]
    simulation = build_simulation(tables)
    stretched, bent = np.array([0.0, 2.0, 2.0 + np.pi / 2]), np.array([0.0, 2.0, 2.0 + np.pi / 2 + 0.1])
    begin, near, outside = (np.asarray(simulation.device.forward(q)) for q in (simulation.start, bent, stretched))
    ends = np.tile(bent, (3, 1))
    farther = 1.01 * (outside - SHOULDER) + SHOULDER
    rests = np.array([near - begin, farther - begin, farther - begin]) - anchored
    found = _beyond(simulation, Excursion(ends, ends, ends, ends), rests, np.array([0.06, 0.06, 0.0]))
    assert found.tolist() == [False, kinematics == "nonlinear", False]  # the last has come to rest there


def test_a_joint_that_passes_its_limit_and_returns_puts_a_cell_out_of_reach(tmp_path: Path) -> None:
    text = (SCENARIOS.parent / "python/palpate/devices/phantom-premium-1.5a.toml").read_text("utf-8")
    lower, upper = '["-1 rad", "1 rad", "3.2767 rad"]', '["1 rad", "3 rad", "4 rad"]'
    rows = (f'{key} = {{ value = {value}, source = "assumed" }}' for key, value in (("lower", lower), ("upper", upper)))
    limits = "\n".join(["", "[limits]", *rows, ""])
    (tmp_path / "limited.toml").write_text(text.replace("\n[drive]", f"{limits}\n[drive]"), "utf-8")
    tables = tables_of("press-stiff-cube-lqg")
    tables["device"]["name"] = str(tmp_path / "limited.toml")
    found = sweep(tables, {"object.stiffness": [tables["object"]["stiffness"]]}, design="once")
    run = found.simulate(0)
    angle = run["angle"][:, 2]
    assert angle.min() < 3.2767 < min(angle[0], angle[-1])
    assert run.verdict.state is found.verdict(0) is State.OUT_OF_REACH


@pytest.mark.parametrize(("stiffness", "duration", "settles"), [(800.0, "4 s", True), (400.0, "4 s", False)])
def test_the_identified_model_rests_where_its_torque_is_the_working_torque(
    stiffness: float, duration: str, settles: bool
) -> None:
    """The constant hold of gravity leaves the rest off force over stiffness; a run that is not there yet says so."""
    tables = tables_of("identified-model", duration)
    tables["object"] = {"kind": "spring", "stiffness": f"{stiffness} N/m"}
    trace = palpate.simulate(tables)
    off = np.abs(stiffness * trace["deflection"][-1] / 8.5 - 1.0).max()
    exact = static_error(Scenario.from_dict(tables), np.array([stiffness]))[0]
    assert exact < BAND
    assert (abs(off - exact) < 1e-4) == settles
    assert (trace.verdict.state is State.SETTLED) == settles
    assert settles or "still moves" in trace.verdict.reason


def test_a_cell_has_the_verdict_of_its_run() -> None:
    found = sweep(tables_of("press-stiff-cube-lqg"), {"object.stiffness": "0.5 N/mm..12 N/mm:12"}, design="once")
    states = {found.verdict(i) for i in range(12)}
    assert states >= {State.SETTLED, State.UNSTABLE}
    for i in range(12):
        assert found.simulate(i).verdict.state is found.verdict(i)


def test_a_fast_divergence_overflows_without_a_warning() -> None:
    tables = tables_of("press-stiff-cube-lqg", "3 s")
    tables["object"] = {"kind": "spring", "stiffness": "300 N/m", "damping": "80 N*s/m"}
    with warnings.catch_warnings(action="error"):
        found = sweep(tables, {"object.stiffness": ["300 N/m"]}, design="once")
    assert found.verdict(0) is State.UNSTABLE


def test_a_spring_away_from_the_start_is_judged_by_its_own_deflection() -> None:
    tables = tables_of("press-stiff-cube-lqg")
    tables["object"] = {"kind": "spring", "stiffness": "1 N/mm", "position": ["2 mm", "0 mm", "0 mm"]}
    found = sweep(tables, {"object.stiffness": ["1 N/mm"]}, design="once")
    assert found.verdict(0) is found.simulate(0).verdict.state is State.SETTLED


def test_forces_that_end_too_early_are_held() -> None:
    found = sweep(tables_of("arm-through-tissue-on-a-wall"), {"object.stiffness": ["0.5 N/mm", "1 N/mm"]})
    assert found.excitation.held == pytest.approx(0.3)
    np.testing.assert_allclose(found.simulate(0)["touching"][-1], 1.0)
    assert sweep(tables_of("press-stiff-cube-lqg"), {"object.stiffness": ["1 N/mm"]}).excitation.held is None


def test_a_scenario_without_excitation_is_refused() -> None:
    tables = tables_of("slider-wall-stable", "0.1 s")
    tables["operator"] = {"kind": "none"}
    with pytest.raises(SweepError, match="scenario: no excitation"):
        sweep(tables, {"object.stiffness": ["50 N/m"]})


def test_an_error_names_the_line_of_the_file_or_the_varied_value(tmp_path: Path) -> None:
    text = (SCENARIOS / "slider-wall-stable.toml").read_text("utf-8")
    linear = tmp_path / "linear.toml"
    linear.write_text(text.replace("[device]\n", '[device]\nmodel = "linear"\n'), "utf-8")
    line = linear.read_text("utf-8").splitlines().index('model = "linear"') + 1
    over = {"object.stiffness": ["-50 N/m"]}
    with pytest.raises(SweepError, match=rf"linear\.toml, line {line}: device\.model: a sweep runs"):
        sweep(linear, over)
    with pytest.raises(ScenarioError, match=r"^object\.stiffness = -50.0 N/m: object\.stiffness: "):
        sweep(SCENARIOS / "slider-wall-stable.toml", over)


def test_a_controller_designed_once_is_that_of_the_scenario() -> None:
    over = {"object.stiffness": "0.5 N/mm..60 N/mm:8"}
    tables = tables_of("press-soft-cube-lead-lag")
    once, each = sweep(tables, over, design="once"), sweep(tables, over)
    assert once.unstable.any()
    assert not each.unstable.any()
    certificate = palpate.stability.certify(once.scenario(0), once.plan.controller())
    assert certificate.stable == once.settled[0]


def test_the_exact_boundary_of_the_map_separates_the_cells() -> None:
    from matplotlib.figure import Figure

    tables = tables_of("slider-wall-stable", "20 s")
    over = {"object.stiffness": "50 N/m..150 N/m:11", "object.damping": "0 N*s/m..0.04 N*s/m:5"}
    found = sweep(tables, over)
    axes = found.plot(Figure().add_subplot())
    contour = axes.collections[1]
    damping, stiffness = np.vstack([path.vertices for path in contour.get_paths() if len(path.vertices)]).T
    mass = LinearDevice.of_mass(0.06, 0.05)
    exact = [critical_stiffness(mass, period=1e-3, virtual_damping=b) for b in damping[::20]]
    np.testing.assert_allclose(stiffness[::20], exact, rtol=5e-3)
    labels = {text.get_text() for text in axes.figure.legends[0].get_texts()}
    assert labels >= {"settled", "unstable", "exact boundary"}
    with pytest.raises(SweepError, match="one or two numeric axes"):
        sweep(tables, {**over, "device.delay": [0, 1]}).plot(Figure().add_subplot())
