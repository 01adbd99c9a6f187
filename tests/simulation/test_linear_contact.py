"""A run on a mesh or body is judged with the linear loop of the contact in which it rests."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from palpate import fem
from palpate.scenario import Scenario
from palpate.simulation.evidence import evidence
from palpate.simulation.linear_evidence import linear_radii_of
from palpate.simulation.recorded import external_forces, recorded_scenario
from palpate.simulation.verdict import State
from palpate.simulation.windows import windows
from palpate.stability.contact_loop import contact_at
from palpate.stability.mesh_contact import mesh_contact
from palpate.stability.mode_stability import gain_margin


def tables(touched: dict[str, Any]) -> dict[str, Any]:
    """A hand that presses 0.6 N down."""
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {
            "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "300 N/m",
            "shape": "ramp", "rise": "0.1 s", "force": ["0 N", "0 N", "-0.6 N"],
        },
        "object": touched,
        "run": {"duration": "2.2 s"},
    }  # fmt: skip


def on_mesh() -> dict[str, Any]:
    return tables(
        {
            "kind": "mesh",
            "position": ["0.5 mm", "0.3 mm", "-0.5 mm"],
            "mesh": {"shape": "box", "edge": "80 mm", "divisions": 4},
            "surface": {"stiffness": "800 N/m", "static_friction": 0.3, "damping": "0.5 N*s/m"},
        }
    )


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("body") / "block.h5"
    shape = fem.block((0.024, 0.024, 0.012), 0.006)
    fem.build(shape, young=20e3, fixed="z < 0.001 mm", touch="z > 11.9 mm", order=1, output=path)
    return path


def on_body(block: Path, kind: str, **options: Any) -> dict[str, Any]:
    body = {"file": str(block), "origin": ["12 mm", "12 mm", "12 mm"], "kind": kind, "tip": "flat", "radius": "8 mm"}
    return tables({"kind": "body", "position": ["0 mm", "0 mm", "-0.2 mm"], "body": {**body, **options}})


def judged(scenario: dict[str, Any]) -> tuple[palpate.Trace, float]:
    """Return a run and the spectral radius with which it is judged."""
    trace = palpate.simulate(scenario)
    found, reason = linear_radii_of(trace, recorded_scenario(trace))
    assert found is not None, reason
    assert "the linear loop is stable" in str(trace.verdict.linear)
    return trace, found.worst


def test_the_linear_loop_of_a_run_on_a_mesh_is_that_of_its_certificate() -> None:
    scenario = on_mesh()
    _, radius = judged(scenario)
    assert radius == pytest.approx(mesh_contact(Scenario.from_dict(scenario), 1).resting.radius, abs=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_the_linear_loop_of_a_run_on_a_body_is_that_of_its_contact(block: Path, friction: float) -> None:
    creep = {"instantaneous_ratio": 2.0, "retardation_time": "0.05 s"}
    trace, radius = judged(on_body(block, "viscoelastic", static_friction=friction, **creep))
    scenario = Scenario.from_dict(trace.scenario)
    assert radius == pytest.approx(contact_at(scenario, trace, len(trace) - 1).radius, abs=1e-6)


@pytest.mark.parametrize("stiffness", ["0.01 N/m", "300 N/m"])
def test_the_creep_that_a_run_leaves_is_that_of_the_standard_linear_solid(block: Path, stiffness: str) -> None:
    """A run that is short against the retardation time rests, and is not settled; a longer one moves as predicted."""
    scenario = on_body(block, "viscoelastic", instantaneous_ratio=2.0, retardation_time="0.5 s", static_friction=0.3)
    scenario["operator"] |= {"stiffness": stiffness, "damping": "9 N*s/m", "force": ["0 N", "0 N", "-0.2 N"]}
    short, long = (palpate.simulate({**scenario, "run": {"duration": f"{t} s"}}) for t in (0.4, 4.0))
    read = recorded_scenario(short)
    found = evidence(short, read, windows(external_forces(short, read))[-1], None)
    moved = abs(long["tip"][-1, 2] - short["tip"][-1, 2])
    assert found.creep[0] == pytest.approx(moved, rel=0.15)
    assert moved > 0.1 * found.deflection[0]
    assert short.verdict.state is State.UNDECIDED
    assert long.verdict.state is State.SETTLED


def test_an_elastic_body_and_a_pushed_one_have_no_creep_left(block: Path) -> None:
    for kind, options, kept in (
        ("compliance", {}, np.nan),
        ("viscoelastic", {"instantaneous_ratio": 2.0, "retardation_time": "9 s"}, 0.1),
    ):
        trace = palpate.simulate({**on_body(block, kind, **options), "run": {"duration": "0.3 s"}})
        read = recorded_scenario(trace)
        found = evidence(trace, read, windows(external_forces(trace, read))[-1], None, kept)
        assert found.creep[0] == 0.0


def test_an_unstable_contact_is_never_settled() -> None:
    """A sticking contact, 6 % beyond its limit, whose oscillation has not grown yet."""
    scenario = on_mesh()
    stiff = 800.0 * gain_margin([mesh_contact(Scenario.from_dict(scenario), 1).resting])[0] * 1.06
    scenario["object"]["surface"] |= {"stiffness": f"{stiff} N/m", "damping": "0 N*s/m"}
    verdict = palpate.simulate(scenario).verdict
    assert verdict.state in (State.UNSTABLE, State.BOUNDED_OSCILLATION, State.UNDECIDED)


def test_without_a_linear_loop_the_verdict_says_why() -> None:
    """Under a sine the tip does not rest."""
    scenario = on_mesh()
    scenario["operator"] |= {"shape": "sine", "frequency": "5 Hz"}
    del scenario["operator"]["rise"]
    verdict = palpate.simulate(scenario).verdict
    assert str(verdict.linear).startswith("no linear loop is known: the tip does not rest")


def test_a_body_updated_outside_the_tick_has_no_linear_loop_in_a_run(block: Path) -> None:
    scenario = on_body(block, "neo-hookean", update_interval="10 ms")
    scenario["run"]["duration"] = "0.6 s"
    verdict = palpate.simulate(scenario).verdict
    assert "updated outside the tick" in str(verdict.linear)
