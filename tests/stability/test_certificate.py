"""Certificates and Z-widths of scenarios: what is claimed is what the full simulation does."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import simulate
from palpate.cli.main import app
from palpate.errors import StabilityError
from palpate.linear import HumanArm
from palpate.linear.linear_device import LinearDevice
from palpate.report import zwidth_page
from palpate.scenario import Scenario
from palpate.simulation import scenario_loop
from palpate.simulation.verdict import State
from palpate.stability import certification, certify, destabilizing_operator, stability_boundary, wall_limit, zwidth
from palpate.stability.certificate import _margin_line
from palpate.stability.counter_example import divergence_example, growth, to_toml
from palpate.stability.maps.zwidth_map import _edge, loop_radii, wall_loops
from slider_press import slider
from typer.testing import CliRunner

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def test_stable_and_passive_slider() -> None:
    """97 N/m of 100.01: stable with 3.1 % to spare, and passive (KT/2 = .0485 of .05 N s/m)."""
    certificate = certify(slider())
    assert certificate.stable
    assert certificate.passive
    assert certificate.counter_example is None
    exact = wall_limit(mass=0.06, damping=0.05, period=1e-3).critical_stiffness
    assert certificate.margin["gain_margin"] == pytest.approx(exact / 97, rel=1e-8)
    assert certificate.margin["passive_damping_required_N_s_per_m"] == pytest.approx(0.0485, rel=1e-8)
    assert set(certificate.criteria) == {"eigenvalues", "Jury", "Routh", "Lyapunov"}
    assert all(certificate.criteria.values())
    assert "passive" in certificate.claim
    assert any("the tip does not rest" in step for step in certificate.method)
    assert "spectral_radius_at_rest" not in certificate.margin
    json.dumps(certificate.to_dict(), allow_nan=False)


def test_unstable_slider_has_a_counter_example_that_runs() -> None:
    """130 N/m is beyond the limit: the scenario in the certificate, read back from its text, diverges from rest."""
    certificate = certify(slider("130 N/m"))
    assert certificate.verdict.state is State.UNSTABLE
    assert not any(certificate.criteria.values())
    assert certificate.margin["critical_gain"] == pytest.approx(100.0139 / 130, rel=1e-5)
    example = certificate.counter_example
    assert example is not None
    trace = simulate(Scenario.from_text(example.toml()))
    assert growth(trace["tip"]) == pytest.approx(example.growth, rel=1e-9)
    assert example.growth > 5
    assert str(certificate).endswith(f"Counter-example: {example.sentence}")


def test_the_counter_example_of_a_wall_holds_the_tip_from_both_sides() -> None:
    """The linear verdict is of a tip that stays in contact: a bilateral spring along the normal shows it."""
    scenario = Scenario.from_dict(slider(object={"kind": "wall", "stiffness": "2 N/mm", "normal": [-1, 0, 0]}))
    example = divergence_example(scenario, scenario_loop(scenario).spectral_radius())
    assert example is not None
    assert example.scenario["object"]["kind"] == "spring"
    assert scenario_loop(Scenario.from_dict(example.scenario)).spectral_radius() == pytest.approx(
        scenario_loop(scenario).spectral_radius(), rel=1e-12
    )


def test_a_loop_at_its_limit_or_with_criteria_that_disagree_is_undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    exact = wall_limit(mass=0.06, damping=0.05, period=1e-3).critical_stiffness
    at_limit = certify(slider(f"{exact!r} N/m"))
    assert at_limit.verdict.state is State.UNDECIDED
    assert "so near its limit (spectral radius 1 " in at_limit.claim
    mixed = {"eigenvalues": True, "Jury": False, "Routh": True, "Lyapunov": True}
    monkeypatch.setattr(certification, "check_stability", lambda _: (0.999, mixed))
    doubtful = certify(slider())
    assert doubtful.verdict.state is State.UNDECIDED
    assert "(eigenvalues: stable, Jury: unstable, Routh: stable, Lyapunov: stable)" in doubtful.claim
    monkeypatch.setattr(certification, "check_stability", lambda _: (1.0 - 1e-13, dict.fromkeys(mixed, True)))
    assert certify(slider()).verdict.state is State.UNDECIDED


def test_a_wall_seen_through_an_encoder_needs_friction_to_be_passive() -> None:
    """Without Coulomb friction no stiffness is passive (Abbott & Okamura 2005), and the remark says so."""
    for encoder in (False, True):
        scenario = Scenario.from_dict(slider("90 N/m", device={"name": "slider", "encoder": encoder}))
        passive, required, remark = certification._passivity_condition(scenario, scenario_loop(scenario))
        assert passive is not encoder
        assert required == pytest.approx(0.045)  # K T / 2
        needs = "counts of 23 µm at the tip require 0.001035 N of dry friction of joint 1, and it has 0 N (Abbott"
        assert (needs in remark) is encoder


def test_stable_but_not_passive_names_the_hand_that_breaks_it() -> None:
    """Virtual damping lets a bare slider show 2 N/mm, but some mass and spring in its place makes it unstable."""
    tables = slider("2000 N/m", object={"kind": "spring", "stiffness": "2000 N/m", "damping": "3 N*s/m"})
    certificate = certify(tables)
    assert certificate.stable
    assert certificate.passive is False
    example = certificate.counter_example
    assert example is not None
    assert "in a hand of" in example.sentence
    assert not any("destabilizes the loop was found" in step for step in certificate.method)
    exactly = (
        "Passivity, exactly: the object requires 4 N s/m of the device's own damping at the tip and there is 0.05 N"
    )
    assert any(step.startswith(exactly) for step in certificate.method)  # K T / 2 + B
    hand = Scenario.from_text(example.toml())
    assert hand.operator.kind == "arm"
    assert hand.operator.damping == 0.0
    assert hand.run.substeps >= 20 > Scenario.from_dict(tables).run.substeps
    assert scenario_loop(hand).spectral_radius() > 1
    assert example.growth > 1.5
    assert destabilizing_operator(Scenario.from_dict(slider("90 N/m"))) is None  # a passive wall has none


def test_the_worst_operator_is_at_least_as_bad_as_random_ones() -> None:
    """Without a damper of its own, and at the mass and stiffness that are written."""
    spring = {"kind": "spring", "stiffness": "2000 N/m", "damping": "3 N*s/m"}
    scenario = Scenario.from_dict(slider("2000 N/m", object=spring))
    found = destabilizing_operator(scenario)
    assert found is not None
    written = Scenario.from_dict(found.scenario).operator
    assert written.damping == 0.0

    def radius(mass: float, stiffness: float) -> float:
        arm = HumanArm(mass, 0.0, stiffness)
        return scenario_loop(scenario, arm=arm, operator_force=(0.0, 0.0, 0.0)).spectral_radius()

    worst = radius(written.mass or 0.0, written.stiffness or 0.0)
    rng = np.random.default_rng(2)
    others = [radius(*10.0 ** rng.uniform([-3.0, -1.0], [1.0, 7.0])) for _ in range(40)]
    assert worst > 1.0
    assert worst - 1.0 > 0.9 * (max(others) - 1.0)
    run = Scenario.from_dict(found.scenario).run  # until an oscillation has grown a thousandfold
    assert worst ** (run.duration / scenario.period) == pytest.approx(1e3, rel=1e-2)


def test_a_claim_names_the_operator_unless_the_loop_is_passive() -> None:
    def claim(stiffness: str, **tables: Any) -> str:
        return certify(slider(stiffness, **tables)).claim

    assert "stable with every passive operator" in claim("90 N/m")
    phase_lead = claim("20 N/m", controller={"kind": "lead_lag"})
    assert "with the operator described; whether it is passive is not known" in phase_lead


def test_no_passivity_is_claimed_of_an_arm_that_tips_over() -> None:
    """Balanced by a constant force an arm may stand on a hilltop: whatever the damping, it is not stable in no hand."""
    scenario = Scenario.from_file(SCENARIOS / "drive-limits-and-encoder.toml")
    soft = scenario.to_dict()
    soft["object"] = {**soft["object"], "stiffness": "1 N/m", "damping": "0 N*s/m"}
    loop = scenario_loop(Scenario.from_dict(soft))
    assert loop.device_damping > 1e-3 * 1.5 * 1.0  # K(n + 1/2)T would be covered
    assert not loop.rests
    assert certify(soft).passive is None
    assert zwidth(scenario, simulated=False).passive is None
    assert "nobody holds it" in zwidth(scenario, simulated=False).never


def test_a_run_that_diverges_is_not_called_stable() -> None:
    """Small motions die out, but a reference force of 4 kN throws the arm: no claim of stability."""
    thrown = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "0.5 ms"},
        "reference": {"shape": "step", "force": ["4000 N", "4000 N", "4000 N"]},
        "object": {"kind": "spring", "stiffness": "3.5 N/mm"},
        "controller": {"kind": "lqg"},
        "run": {"duration": "0.5 s"},
    }
    certificate = certify(thrown)
    assert all(certificate.criteria.values())
    assert not certificate.stable


@pytest.mark.parametrize("name", ["press-stiff-cube-lqg", "press-soft-cube-lead-lag", "arm-through-tissue-on-a-wall"])
def test_scenarios_of_the_project_are_certified(name: str) -> None:
    certificate = certify(SCENARIOS / f"{name}.toml")
    assert certificate.stable
    assert certificate.margin["gain_margin"] > 2
    assert certificate.margin["spectral_radius"] < 1
    tested_again = any("the loop was tested again where it came to rest" in step for step in certificate.method)
    assert tested_again is name.startswith("press")
    assert ("spectral_radius_at_rest" in certificate.margin) is tested_again
    assert "operator" in " ".join(certificate.assumptions) or "reference force" in " ".join(certificate.assumptions)


def test_nonlinear_arm_goes_unstable_where_the_certificate_says() -> None:
    """LQG on the nonlinear arm: 1 % under the certified factor a nudge dies, 1 % above it grows."""
    tables: dict[str, Any] = Scenario.from_file(SCENARIOS / "press-stiff-cube-lqg.toml").to_dict()
    scenario = Scenario.from_dict(tables)
    from palpate.simulation.controllers import build_controller

    device = scenario.load_device()
    controller = build_controller(scenario, device, np.array(scenario.start.pose))
    factor = certify(scenario).margin["gain_margin"]
    tables["reference"] = {"shape": "step", "force": ["0.001 N", "0.001 N", "0.001 N"]}
    tables["run"] = {"duration": "2 s", "substeps": 4}
    for share, grows in ((0.99, False), (1.01, True)):
        stiffness = share * factor * scenario.object.stiffness[0]  # type: ignore[index]
        tables["object"] = {"kind": "spring", "stiffness": f"{stiffness!r} N/m"}
        trace = simulate(tables, controller)
        assert (not trace.stable or growth(trace["tip"], 3) > 1) is grows


def test_loop_of_a_slider_scenario_is_the_wall_loop() -> None:
    """Delay, controller gain and damping of a scenario against the same in the one-line question."""
    tables = slider("1 N/m", device={"name": "slider", "delay": 2}, controller={"kind": "gain", "gain": 2.0})
    loop = wall_loops(scenario_loop(Scenario.from_dict(tables)))[0]
    curve, same = (
        stability_boundary(loop, points=300),
        stability_boundary(LinearDevice.of_mass(0.06, 0.05), period=1e-3, delay=2, points=300),
    )
    assert 2 * curve.stiffest[1] == pytest.approx(same.stiffest[1], rel=1e-4)
    assert 2 * curve.damping[-1] == pytest.approx(same.damping[-1], rel=1e-4)


def test_zwidth_of_a_slider() -> None:
    """The simulated boundary lies on the exact curve; the passive region below it; a rigid grip above."""
    told: list[float] = []
    found = zwidth(slider(), progress=lambda _, share: told.append(share))
    assert told == sorted(told)
    assert 0.0 <= told[0] <= told[-1] <= 1.0
    names = list(found.curves)
    assert names[0] == "nobody holds it"
    assert found.simulated is not None
    assert len(found.simulated.damping) > 100
    assert found.simulated.runs < found.simulated.cells / 5
    assert found.simulated.furthest < 2e-3
    assert found.curves["a rigid grip"].stiffest[1] > 3 * found.curves[names[0]].stiffest[1]
    assert found.passive is not None
    assert found.passive[1].max() == pytest.approx(100.0, rel=1e-6)  # 2b/T
    corner = found.corner  # 100 N/m beside 41 N/mm: passive walls and object would not be seen
    assert corner is not None
    assert corner.window == pytest.approx((0.1275, 250.0))
    assert corner.simulated is not None
    assert corner.simulated.furthest < 2e-3
    assert corner.window[0] < corner.edge.damping.max() < 1.15 * corner.window[0]
    for b, k in zip(corner.simulated.damping[::10], corner.simulated.stiffness[::10], strict=True):
        exact = wall_limit(mass=0.06, damping=0.05, period=1e-3, virtual_damping=b).critical_stiffness
        assert k == pytest.approx(exact, rel=2e-3)
    html = zwidth_page(found).html()
    assert "<svg" in html
    assert "is stable" in html
    assert found.stable_here
    assert "http://" not in html.replace("http://www.w3.org", "")
    title, verdict, *facts = str(found).split("\n  ")
    assert (title, verdict, facts) == (found.title, found.verdict, found.facts)
    assert any(fact.startswith("passive in every hand: up to ") for fact in facts)


def test_zwidth_of_the_nonlinear_arm_with_a_controller() -> None:
    found = zwidth(SCENARIOS / "press-stiff-cube-lqg.toml")
    assert found.simulated is not None
    assert len(found.simulated.damping) > 100
    assert np.median(found.simulated.distance) < 1e-4
    assert found.simulated.furthest < 0.01  # a cell of the map, where the curve has a corner; 2 % was asked
    assert found.corner is None
    assert found.passive is None
    assert "tracks a reference force" in found.not_passive


def test_a_loop_that_settles_elsewhere_is_not_called_stable() -> None:
    """Through tissue the arm, thrown by a swing that grew, may come to rest at another pose."""
    found = zwidth(SCENARIOS / "arm-through-tissue-on-a-wall.toml").simulated
    assert found is not None
    assert found.furthest < 2e-3


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"object": {"kind": "none"}}, "nothing is touched"),
        ({"operator": {"kind": "fixed"}}, "keeps the tip still"),
        ({"object": {"kind": "wall", "stiffness": "1 N/m", "normal": [0, 1, 0]}}, "cannot move along it"),
    ],
)
def test_scenarios_without_a_loop_are_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(StabilityError, match=says):
        certify(slider(**change))


def test_certify_and_zwidth_from_the_command_line(tmp_path: Path) -> None:
    """Exit code 0 for stable, 1 for unstable with a counter-example beside it, 2 for a scenario without a loop."""
    runner = CliRunner()
    good, bad, none = tmp_path / "good.toml", tmp_path / "bad.toml", tmp_path / "none.toml"
    good.write_text(to_toml(slider()), "utf-8")
    bad.write_text(to_toml(slider("130 N/m")), "utf-8")
    none.write_text(to_toml(slider(operator={"kind": "fixed"})), "utf-8")
    result = runner.invoke(app, ["certify", str(good), "--out", str(tmp_path / "good")])
    assert result.exit_code == 0, result.output
    assert "Stable: " in result.output
    written = json.loads((tmp_path / "good" / "certificate.json").read_text("utf-8"))
    assert written["state"] == "stable"
    result = runner.invoke(app, ["certify", str(bad), "--out", str(tmp_path / "bad")])
    assert result.exit_code == 1
    assert simulate(tmp_path / "bad" / "counter-example.toml")["tip"].size > 0
    assert runner.invoke(app, ["certify", str(none), "--out", str(tmp_path / "none")]).exit_code == 2
    assert not (tmp_path / "none").exists()
    result = runner.invoke(app, ["zwidth", str(good), "--out", str(tmp_path / "good"), "--no-simulate"])
    assert result.exit_code == 0, result.output
    assert "N/m and B = 0 N·s/m, is stable." in result.output
    result = runner.invoke(app, ["zwidth", str(bad), "--out", str(tmp_path / "bad"), "--no-simulate"])
    assert result.exit_code == 1
    assert "K = 130 N/m and B = 0 N·s/m, is unstable." in result.output
    result = runner.invoke(app, ["zwidth", str(good), "--out", str(tmp_path / "good"), "--no-simulate"])
    assert (tmp_path / "good" / "zwidth.html").stat().st_size > 10_000
    written = json.loads((tmp_path / "good" / "zwidth.json").read_text("utf-8"))
    assert written["simulated"] is None
    curve = written["curves"]["nobody holds it"]
    assert len(curve["damping_N_s_per_m"]) == 1000
    stiffest, damping = max(zip(curve["stiffness_N_per_m"], curve["damping_N_s_per_m"], strict=True))
    assert f"nobody holds it: up to {stiffest / 1e3:.4g} N/mm, with {damping:.4g} N·s/m of damping" in result.output


def test_certificate_of_a_held_slider_is_the_one_line_answer() -> None:
    """The same arm, rigid and through tissue, in a scenario and in `wall`: the same critical stiffness."""
    operator = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
    tissue = {"tissue_stiffness": "500 N/m", "tissue_damping": "0.5 N*s/m"}
    for extra, arm in (({}, HumanArm(0.15, 4.5, 560)), (tissue, HumanArm(0.15, 4.5, 560, 500, 0.5))):
        certificate = certify(slider("1000 N/m", operator={**operator, **extra}))
        exact = wall_limit(mass=0.06, damping=0.05, period=1e-3, arm=arm).critical_stiffness
        assert certificate.stable
        assert 1000 * certificate.margin["gain_margin"] == pytest.approx(exact, rel=1e-8)


def test_on_the_boundary_of_two_directions_a_root_is_on_the_circle() -> None:
    scenario = Scenario.from_dict(
        slider(
            device={"name": "haply-2diy"},
            start={"tip": ["20 mm", "100 mm", "0 mm"]},
            operator={"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"},
        )
    )
    loop = scenario_loop(scenario)
    assert loop.directions.shape == (3, 2)
    edge = _edge(loop, 60)
    assert loop_radii(loop, edge.stiffness, edge.damping) == pytest.approx(np.ones(len(edge.damping)), abs=2e-9)


@pytest.mark.parametrize(
    ("name", "value", "line"),
    [
        ("gain_reduction_margin", 0.0, "gain reduction margin: 0 (stable at every smaller gain)"),
        ("gain_reduction_margin", 0.5, "gain reduction margin: 0.5 (smallest stable factor on the gain of the loop)"),
        ("gain_margin", math.inf, "gain margin: inf (stable at every larger gain)"),
        ("gain_margin", 2.0, "gain margin: 2 (largest stable factor on the gain of the loop)"),
        ("delay_margin_s", 6.5416e-4, "delay margin: 0.65416 ms"),
        ("doubling_time_s", 55.741, "doubling time: 55.741 s"),
        ("depth_m", 2.7408e-3, "depth: 2.7408 mm"),
        ("phase_margin_deg", 0.03, "phase margin: 0.03 deg"),
    ],
)
def test_a_margin_has_a_meaning_and_a_suitable_unit(name: str, value: float, line: str) -> None:
    assert _margin_line(name, value) == f"  {line}"
