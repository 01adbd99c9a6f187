"""Force laws, fields and textures as objects of a scenario: energies, refusals, and verdicts that a run confirms."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import palpate
import pytest
from palpate.errors import ScenarioError, StabilityError
from palpate.linear import HumanArm, LinearDevice
from palpate.scenario import Scenario
from palpate.simulation import ForceLaw, build_simulation
from palpate.simulation.verdict import State
from palpate.stability import certify, critical_stiffness
from palpate.stability.rest_certificate import texture_law

HAND = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "100 N/m"}


def slider(chosen: dict[str, Any], push: str = "-1 N", delay: int = 0) -> dict[str, Any]:
    """Return an impedance display pushed along -x."""
    return {
        "device": {"name": "slider", "delay": delay},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {**HAND, "force": [push, "0 N", "0 N"]},
        "object": chosen,
        "run": {"duration": "1 s"},
    }


def law(formula: str = "500 * x", deepest: str = "10 mm", **law: Any) -> dict[str, Any]:
    return {"kind": "force_law", "normal": [1, 0, 0], "law": {"formula": formula, "deepest": deepest, **law}}


def field(kind: str, **keys: Any) -> dict[str, Any]:
    return {"kind": "field", "field": {"kind": kind, **keys}}


def test_a_table_equals_its_formula_and_the_object_that_simulate_takes() -> None:
    text = law("500 * x + 1e5 * x^2", entries=101)
    depth = np.linspace(0.0, 0.01, 101)
    force = 500 * depth + 1e5 * depth**2
    columns = {"depth": [f"{x!r} m" for x in depth.tolist()], "force": [f"{f!r} N" for f in force.tolist()]}
    table = {"kind": "force_law", "normal": [1, 0, 0], "law": columns}
    own = ForceLaw.table(depth, force, [0, 0, 0], [1, 0, 0])
    traces = [
        palpate.simulate(slider(text)),
        palpate.simulate(slider(table)),
        palpate.simulate(slider(text), object=own),
    ]
    for trace in traces[1:]:
        assert trace["tip"].tobytes() == traces[0]["tip"].tobytes()
        assert trace["stored_energy"].tobytes() == traces[0]["stored_energy"].tobytes()
    assert traces[0].verdict.state is State.SETTLED
    assert traces[0]["object_force"][-1, 0] == pytest.approx(-np.interp(traces[0]["depth"][-1, 0], depth, force))


def test_a_linear_law_is_the_wall_of_its_slope() -> None:
    wall = {"kind": "wall", "stiffness": "500 N/m", "normal": [1, 0, 0]}
    for delay in (0, 1):
        on_law, on_wall = (palpate.simulate(slider(one, delay=delay)) for one in (law(), wall))
        assert on_law["tip"] == pytest.approx(on_wall["tip"], abs=1e-13)


def test_the_energy_of_a_law_is_the_work_of_the_tip() -> None:
    trace = palpate.simulate({**slider(law("500 * x + 1e5 * x^2")), "run": {"duration": "50 ms", "substeps": 2}})
    force, tip = trace["object_force"][:, 0], trace["tip"][:, 0]
    work = np.concatenate([[0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(tip))])
    assert work[-1] > 1e-4
    assert work == pytest.approx(trace["stored_energy"][:, 0], abs=1e-3 * work.max())


@pytest.mark.parametrize(
    ("chosen", "says"),
    [
        (law("sin(1000 * x)"), "force must rise from entry to entry"),
        (law("1 / x"), "force 1 is inf; every entry must be finite"),
        (law("x + 1"), "the first force must be 0 N"),
        (law("system(x)"), "law.*no number, no variable and no function"),
        ({**law(), "stiffness": "1 N/m"}, "the law has its own in"),
        ({"kind": "force_law", "normal": [1, 0, 0]}, "law is missing; write a table"),
        ({"kind": "force_law", "law": law()["law"]}, "a force law needs its outward normal"),
        ({**law(), "law": {"formula": "x"}}, "deepest is missing"),
        ({**law(), "law": {"depth": ["0 mm", "1 mm"]}}, "force is missing"),
        (field("viscous"), "damping is missing"),
        (field("viscous", damping="1 N*s/m", mass="1 kg"), 'mass has no meaning for kind = "viscous"'),
        (field("viscous", damping="1 N"), "damping.*is a force"),
        (field("gravity_well", stiffness="1 N/m", radius="1 mm", largest_force="0 N"), "force must be positive"),
        (field("vibration", force=["1 N"] * 3, frequency="50 Hz", at_contact=True), "needs its outward normal"),
        (
            {"kind": "textured_wall", "stiffness": "1 N/mm", "normal": [1, 0, 0],
             "texture": {"wavelength": "1 mm", "across": [2, 0, 0], "height": "0.1 mm"}},
            "must not be along the normal",
        ),
        (
            {"kind": "textured_wall", "stiffness": "1 N/mm", "normal": [1, 0, 0],
             "texture": {"wavelength": "1 mm", "across": [0, 1, 0]}},
            "height is missing",
        ),
    ],
)  # fmt: skip
def test_what_is_no_law_and_no_field_is_refused(chosen: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        Scenario.from_dict(slider(chosen))


def test_a_field_that_the_servo_cannot_sample_is_refused() -> None:
    with pytest.raises(ScenarioError, match="below half the servo rate, 500 Hz"):
        palpate.simulate(slider(field("vibration", force=["1 N"] * 3, frequency="500 Hz")))
    with pytest.raises(ScenarioError, match=r"object\.field: .*the mass diverges on its coupling"):
        palpate.simulate(slider(field("virtual_mass", mass="0.1 g", stiffness="1 N/mm")))


def test_a_scenario_with_a_law_is_written_and_read_back_equal() -> None:
    for chosen in (law("500 * x + 1e5 * x^2"), field("virtual_mass", mass="0.2 kg", stiffness="500 N/m")):
        scenario = Scenario.from_dict(slider(chosen))
        assert Scenario.from_dict(scenario.to_dict()) == scenario


@pytest.mark.parametrize("delay", [0, 1])
def test_the_verdict_of_a_law_agrees_with_its_runs(delay: int) -> None:
    """A law whose every slope is 10 % above the exact limit bounces; 30 % below it rests."""
    device = LinearDevice.of_mass(0.06, 0.05, HumanArm(0.15, 4.5, 100.0))
    limit = critical_stiffness(device, period=1e-3, delay=delay)
    below, above = (slider(law(f"{share * limit} * x"), "-5 N", delay) for share in (0.7, 1.1))
    for tables in (below, above):
        tables["run"] = {"duration": "2 s"}
    assert certify(below).verdict.state is State.STABLE
    assert palpate.simulate(below).verdict.state is State.SETTLED
    assert certify(above).verdict.state is State.UNSTABLE
    assert palpate.simulate(above).verdict.state in (State.UNSTABLE, State.BOUNDED_OSCILLATION)


def test_a_viscous_field_has_the_verdict_of_its_damper() -> None:
    gentle, strong = (slider(field("viscous", damping=f"{b} N*s/m")) for b in (3, 1000))
    found = certify(gentle)
    assert found.verdict.state is State.STABLE
    assert "142 times as damped (426 N s/m)" in found.claim
    assert palpate.simulate(gentle).verdict.state is State.SETTLED
    assert certify(strong).verdict.state is State.UNSTABLE
    assert palpate.simulate(strong).verdict.state in (State.UNSTABLE, State.BOUNDED_OSCILLATION)


def test_a_gravity_well_is_a_spring_where_its_force_is_linear_and_undecided_beyond() -> None:
    well = field("gravity_well", stiffness="500 N/m", radius="20 mm", largest_force="3 N")
    inside = palpate.simulate(slider(well, "-0.5 N"))
    spring = palpate.simulate(slider({"kind": "spring", "stiffness": "500 N/m"}, "-0.5 N"))
    assert inside["tip"] == pytest.approx(spring["tip"], abs=1e-13)
    assert inside.verdict.linear == spring.verdict.linear
    found = certify(slider(well, "-0.5 N"))
    assert found.verdict.state is State.STABLE
    assert any("within 6 mm of the center" in one for one in found.assumptions)
    beyond = certify(slider(copy.deepcopy(well), "-5 N"))
    assert beyond.verdict.state is State.UNDECIDED
    assert "leaves the distance" in beyond.claim


def test_objects_without_a_loop_are_refused_in_one_sentence() -> None:
    for chosen, says in (
        (field("constant", force=["1 N"] * 3), "closes no loop"),
        (field("vibration", force=["1 N"] * 3, frequency="50 Hz"), "closes no loop"),
    ):
        with pytest.raises(StabilityError, match=says):
            certify(slider(chosen))
    with pytest.raises(StabilityError, match="no spring with one stiffness"):
        palpate.stability.zwidth(slider(law()))


def textured(stiffness: str, **texture: Any) -> dict[str, Any]:
    return {
        "kind": "textured_wall",
        "stiffness": stiffness,
        "normal": [0, 0, 1],
        "texture": {"wavelength": "4 mm", "across": [1, 0, 0], **texture},
    }


def held_arm(touched: dict[str, Any], period: str = "1 ms") -> dict[str, Any]:
    """Return an impedance display on the arm, held by a hand that presses with 1 N and leans to the side."""
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 rad", "2.2305 rad", "3.2776 rad"]},
        "servo": {"period": period, "topology": "impedance_display"},
        "operator": {**HAND, "force": ["0.3 N", "0 N", "-1 N"]},
        "object": touched,
        "run": {"duration": "2 s"},
    }


@pytest.mark.parametrize("texture", [{"height": "0.2 mm"}, {"lateral_force": "0.2 N"}])
def test_a_textured_wall_is_judged_where_its_run_rests(texture: dict[str, Any]) -> None:
    """Law: the verdict of the certificate agrees with the run, and the exact slope is that of the force."""
    verdicts = []
    for stiffness in ("300 N/m", "20 N/mm"):
        tables = held_arm(textured(stiffness, **texture))
        found, run = certify(tables), palpate.simulate(tables).verdict
        verdicts.append(found.verdict.state)
        assert found.verdict.state is not State.STABLE or run.state is State.SETTLED
        assert found.verdict.state is not State.UNSTABLE or run.state is State.UNSTABLE
    assert verdicts[0] is State.STABLE
    assert verdicts[1] is not State.STABLE
    own = Scenario.from_dict(held_arm(textured("1 N/mm", height="0.2 mm", lateral_force="0.1 N")))
    parameters = build_simulation(own).objects[""].parameters
    assert parameters is not None
    place, step = parameters["point"] + np.array([0.7e-3, 0.0, -1e-3]), 1e-7

    def force(p: Any) -> Any:
        offset, number = p - parameters["point"], 2.0 * np.pi / parameters["wavelength"]
        sine, cosine = np.sin(number * offset[0]), np.cos(number * offset[0])
        size = parameters["stiffness"] * (parameters["height"] * sine - offset[2])
        side = size * parameters["height"] * number * cosine + parameters["lateral_force"] * sine
        return np.array([side, 0.0, -size])

    slope = [(force(place + step * e) - force(place - step * e)) / (2.0 * step) for e in np.eye(3)]
    assert pytest.approx(np.array(slope).T, abs=1e-3) == texture_law(parameters, place, 1e-3).D
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turned = {**parameters, "normal": turn @ parameters["normal"], "across": turn @ parameters["across"]}
    oblique = texture_law(turned, parameters["point"] + turn @ (place - parameters["point"]), 1e-3)
    assert pytest.approx(turn @ np.array(slope).T @ turn.T, abs=1e-3) == oblique.D


def test_a_virtual_mass_is_judged_by_its_own_sampled_motion() -> None:
    """Law: held by a hand it is stable up to a coupling that the run confirms; free it drifts, which is said."""
    for stiffness, expected in (("200 N/m", State.STABLE), ("40 N/mm", State.UNSTABLE)):
        ball = field("virtual_mass", mass="0.2 kg", stiffness=stiffness, coupling_damping="0.5 N*s/m")
        tables = slider(ball)
        tables["run"] = {"duration": "6 s"}
        judged = certify(tables)
        assert judged.verdict.state is expected
        if expected is State.UNSTABLE:
            assert judged.counter_example is not None
            assert judged.counter_example.scenario == judged.scenario
            assert judged.counter_example.growth == np.inf
    free = slider(field("virtual_mass", mass="0.2 kg", stiffness="200 N/m", coupling_damping="0.5 N*s/m"))
    free["operator"] = {"kind": "none"}
    found = certify(free)
    assert found.verdict.state is State.UNDECIDED
    assert "nothing holds the tip or the mass" in found.claim


def test_the_tip_feels_a_virtual_mass() -> None:
    """A free tip with a coupled mass accelerates under a force as both masses together."""
    tables = slider(field("virtual_mass", mass="0.2 kg", stiffness="2 N/mm", coupling_damping="5 N*s/m"))
    tables["operator"] = {"kind": "force", "force": ["1 N", "0 N", "0 N"]}
    tables["run"] = {"duration": "0.2 s"}
    trace = palpate.simulate(tables)
    speed = trace["velocity"][:, 0]
    acceleration = (speed[-1] - speed[100]) / (trace.time[-1] - trace.time[100])
    mean = 0.5 * (speed[-1] + speed[100])
    assert acceleration == pytest.approx((1.0 - 0.05 * mean) / 0.26, rel=0.03)


def test_a_sweep_runs_laws_and_fields() -> None:
    tables = slider(law("300 * x + 1e5 * x^2"))
    found = palpate.sweep(tables, over={"operator.stiffness": ["50 N/m", "100 N/m"]})
    assert set(np.ravel(found.outcomes["verdict"])) == {int(State.SETTLED)}
