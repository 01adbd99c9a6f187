"""Certificates of scenarios on meshes agree with the loop as it runs, or are undecided and say why."""

from __future__ import annotations

import os
from pathlib import Path
from time import process_time
from typing import Any

import pytest
from palpate.errors import StabilityError
from palpate.metrics import measure_performance
from palpate.scenario import Scenario
from palpate.simulation.simulator import simulate
from palpate.simulation.verdict import State
from palpate.stability import certify, switching, zwidth
from random_mesh_loops import loops, outcome

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NIGHTLY = os.environ.get("PALPATE_NIGHTLY", "") not in {"", "0"}
ROUNDS = int(os.environ.get("PALPATE_ROUNDS", "1"))


def _press(stiffness: str, **surface: Any) -> dict[str, Any]:
    """Return a scenario in which an arm through tissue presses the Premium on a cube."""
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {
            "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m",
            "tissue_stiffness": "800 N/m", "tissue_damping": "1 N*s/m",
            "shape": "ramp", "rise": "0.2 s", "force": ["0 N", "0 N", "-1.5 N"],
        },
        "object": {
            "kind": "mesh",
            "position": ["0.5 mm", "0.3 mm", "-0.5 mm"],
            "mesh": {"shape": "box", "edge": "80 mm", "divisions": 4},
            "surface": {"stiffness": stiffness, "static_friction": 0.2, **surface},
        },
        "run": {"duration": "1 s"},
    }  # fmt: skip


@pytest.mark.parametrize(
    "name", ["slide-cube-small-steps", "slide-cube-large-steps", "slide-cube-by-forces", "slide-organ"]
)
def test_the_slides_are_stable_in_every_mode_and_any_order_within_five_seconds(name: str) -> None:
    pytest.importorskip("clarabel")
    start = process_time()
    certificate = certify(SCENARIOS / f"{name}.toml")
    spent = process_time() - start
    assert certificate.stable, certificate.claim
    assert "stay bounded in any order of the modes" in certificate.claim
    assert certificate.margin["gain_margin"] > 1.1
    assert all(certificate.criteria.values())
    assert spent < 5.0


def test_a_surface_stiffer_than_its_margin_is_not_stable_and_a_softer_one_is() -> None:
    certificate = certify(_press("300 N/m"))
    assert certificate.stable, certificate.claim
    limit = 300.0 * certificate.margin["gain_margin"]
    assert certify(_press(f"{0.9 * limit} N/m")).stable
    assert not certify(_press(f"{1.1 * limit} N/m")).stable
    at_rest = 300.0 * certificate.margin["gain_margin_at_rest"]
    beyond = certify(_press(f"{1.3 * max(limit, at_rest)} N/m"))
    assert beyond.verdict.state is State.UNSTABLE, beyond.claim


def test_an_unstable_run_is_its_own_counter_example() -> None:
    certificate = certify(_press("20000 N/m"))
    assert certificate.verdict.state is State.UNSTABLE
    assert certificate.counter_example is not None
    again = simulate(Scenario.from_dict(certificate.counter_example.scenario))
    assert not again.verdict.settled


def test_without_the_optimizer_the_certificate_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    tables = _press("500 N/m")
    monkeypatch.setattr(switching, "common_lyapunov", lambda *_: None)
    import palpate.stability.mesh_certificate as module
    from palpate.stability import mode_stability

    monkeypatch.setattr(mode_stability, "common_lyapunov", lambda *_: None)
    monkeypatch.setattr(module, "has_solver", lambda: False)
    certificate = certify(tables)
    assert certificate.stable
    assert certificate.margin["dwell_time_s"] > 0.0
    assert any("pip install clarabel" in step for step in certificate.method)


def test_a_frictionless_contact_under_integrators_is_not_certified() -> None:
    tables = Scenario.from_file(SCENARIOS / "slide-organ.toml").to_dict()
    tables["object"]["surface"]["tangential"] = "0 N/m"
    tables["controller"] = {"kind": "lqg", "stiffness": "1 N/mm"}
    del tables["operator"]
    assert not certify(tables).stable


def test_a_mesh_that_the_tip_cannot_reach_is_an_error_with_a_remedy() -> None:
    tables = _press("500 N/m")
    tables["object"]["position"] = ["0 mm", "0 mm", "-60 mm"]
    for judge in (certify, zwidth, measure_performance):
        with pytest.raises(StabilityError, match="never touches the mesh"):
            judge(tables)


def test_the_zwidth_of_a_mesh_ends_where_a_mode_becomes_unstable() -> None:
    found = zwidth(_press("500 N/m"))
    curve = found.curves["every contact mode"]
    assert found.here == (0.0, 500.0)
    undamped = float(curve.stiffness[0])
    assert certify(_press(f"{0.95 * undamped} N/m")).stable
    assert not certify(_press(f"{1.05 * undamped} N/m")).stable
    middle = len(curve.stiffness) // 2
    b, k = float(curve.damping[middle]), float(curve.stiffness[middle])
    assert certify(_press(f"{0.95 * k} N/m", damping=f"{0.95 * b} N*s/m")).stable
    assert not certify(_press(f"{1.05 * k} N/m", damping=f"{1.05 * b} N*s/m")).stable


def test_the_performance_on_a_mesh_is_that_of_a_wall_where_the_tip_rests() -> None:
    tables = _press("500 N/m")
    on_mesh = measure_performance(tables).along[0]
    wall = {**tables, "object": {"kind": "wall", "stiffness": "500 N/m", "normal": [0, 0, 1]}}
    on_wall = measure_performance(wall).along[0]
    assert on_mesh.direction == pytest.approx((0.0, 0.0, 1.0))
    assert on_mesh.static_stiffness == pytest.approx(on_wall.static_stiffness, rel=0.05)


@pytest.mark.parametrize("seed", range(ROUNDS if NIGHTLY else 1))
def test_certificates_of_random_loops_agree_with_the_pushed_run(seed: int, tmp_path: Path) -> None:
    """No verdict is wrong: a stable loop rests after a push, and an unstable one does not."""
    undecided = 0
    for index, tables in enumerate(loops(1000 + seed, 10, tmp_path)):
        state = certify(tables).verdict.state
        seen, text = outcome(tables, index)
        if state is State.STABLE:
            assert seen in ("rests", "decays"), f"loop {index}: stable, but {text}"
        elif state is State.UNSTABLE:
            assert seen in ("moves", "apart"), f"loop {index}: unstable, but it rests ({text})"
        else:
            undecided += 1
    assert undecided <= 3
