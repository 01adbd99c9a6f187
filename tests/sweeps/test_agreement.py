"""The cells of a sweep agree with the exact curve, with the certificate and with the run of the same scenario."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from palpate.errors import ScenarioError
from palpate.linear import LinearDevice
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.stability import critical_stiffness
from palpate.stability.maps.zwidth_map import loop_radii
from palpate.sweeps import State, SweepError, sweep

SCENARIOS = Path(__file__).parents[2] / "scenarios"
SIZE = 24
# scenario: largest stiffness (N/m) and damping (N s/m) of the map, duration
MAPS = {
    "slider-wall-stable": (200.0, 0.2, "20 s"),
    "arm-through-tissue-on-a-wall": (6000.0, 10.0, "2 s"),
    "press-stiff-cube-lqg": (15000.0, 20.0, "1 s"),
    "press-soft-cube-lead-lag": (60000.0, 20.0, "1 s"),
}


def tables_of(name: str, duration: str | None = None) -> dict[str, Any]:
    tables = tomllib.loads((SCENARIOS / f"{name}.toml").read_text("utf-8"))
    if duration is not None:
        tables["run"] = {"duration": duration}
    return tables


@pytest.mark.parametrize("linear", [True, False], ids=["with-the-linear-loop", "runs-alone"])
@pytest.mark.parametrize("name", MAPS)
def test_no_cell_away_from_the_exact_curve_is_wrong(name: str, linear: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two cells from the curve: no unstable loop is settled, no stable one unstable; with both, 99.5 % are right."""
    if not linear:
        monkeypatch.setattr(
            "palpate.sweeps.plan.linear_radii", lambda _simulation, _columns, count: np.full(count, np.nan)
        )
    most_k, most_b, duration = MAPS[name]
    tables = tables_of(name, duration)
    over = {
        "object.stiffness": f"{most_k / SIZE} N/m..{most_k} N/m:{SIZE}",
        "object.damping": f"0 N*s/m..{most_b} N*s/m:{SIZE}",
    }
    found = sweep(tables, over, design="once")
    k, b = np.meshgrid(*(found.values(path) for path in over), indexing="ij")
    radii = loop_radii(scenario_loop(Scenario.from_dict(tables)), k.ravel(), b.ravel())
    exact = (radii < 1.0).reshape(k.shape)
    padded = np.pad(exact, 2, mode="edge")
    window = np.lib.stride_tricks.sliding_window_view(padded, (5, 5))
    far = np.all(window == exact[..., None, None], axis=(2, 3))
    assert exact.any()
    assert (~exact).any()
    assert not (far & exact & found.unstable).any()
    assert not (far & ~exact & found.settled).any()
    if linear:
        oscillates = found.outcomes.where(State.UNSTABLE, State.BOUNDED_OSCILLATION)
        right = np.where(exact, found.settled, oscillates)
        assert right[far].mean() >= 0.995


def test_a_cell_has_the_verdict_of_its_run() -> None:
    found = sweep(tables_of("press-stiff-cube-lqg"), {"object.stiffness": "0.5 N/mm..12 N/mm:12"}, design="once")
    states = {found.verdict(i) for i in range(12)}
    assert states >= {State.SETTLED, State.UNSTABLE}
    for i in range(12):
        assert found.simulate(i).verdict.state is found.verdict(i)


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
    np.testing.assert_allclose(1e3 * stiffness[::20], exact, rtol=5e-3)
    labels = {text.get_text() for text in axes.figure.legends[0].get_texts()}
    assert labels >= {"settled", "unstable", "exact boundary"}
    with pytest.raises(SweepError, match="one or two numeric axes"):
        sweep(tables, {**over, "device.delay": [0, 1]}).plot(Figure().add_subplot())
