"""Controllers that divide by the stiffness of the tick: one loop for every stiffness of the object."""

from __future__ import annotations

import copy
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
import palpate
import pytest
from one_node import one_node
from palpate.arrays import Array
from palpate.control import Controller
from palpate.errors import DesignError, ScenarioError, StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.scenario import Scenario
from palpate.simulation import ContactResult, scenario_loop
from palpate.simulation.controllers import build_controller, with_controller
from palpate.simulation.linear_contact import contact_radius
from palpate.simulation.linear_loop import controlled_object, touched_directions
from palpate.simulation.loop_config import resolve
from palpate.simulation.verdict import State
from palpate.stability import certify, zwidth
from palpate.stability.mesh_contact import mesh_contact

SLIDE = Path(__file__).parents[2] / "scenarios/slide-cube-by-forces.toml"
POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]
PERIOD = 5e-4
LQG = {"kind": "lqg", "normalize": True}


ARM = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}


def press(**changes: Any) -> dict[str, Any]:
    """Return tables of a step of 0.5 N on a spring at the pose of the thesis; `changes` replace tables."""
    tables: dict[str, Any] = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"period": "0.5 ms"},
        "reference": {"shape": "step", "force": "0.5 N"},
        "object": {"kind": "spring", "stiffness": "1 N/mm"},
        "controller": LQG,
        "run": {"duration": "0.2 s"},
    }
    return copy.deepcopy(tables) | changes


def spring(stiffness: float) -> dict[str, Any]:
    return {"kind": "spring", "stiffness": f"{stiffness!r} N/m"}


def settling(share: Array) -> float:
    """Return the last time (s) at which a force over its reference (n, 3) is outside 5 %."""
    return PERIOD * (int(np.flatnonzero(np.any(np.abs(share - 1.0) > 0.05, axis=1))[-1]) + 1)


def curve(stiffness: float, controller: dict[str, Any] = LQG) -> Array:
    trace = palpate.simulate(press(object=spring(stiffness), controller=controller))
    return np.asarray(trace["deflection"] * stiffness / 0.5)


def test_the_step_is_the_same_at_every_stiffness() -> None:
    stiffest = curve(10e3)
    for stiffness in (100.0, 200.0, 500.0, 1000.0, 2000.0, 3500.0, 10e3):
        share = curve(stiffness)
        assert settling(share) == pytest.approx(53.5e-3, abs=1.01 * PERIOD)
        assert np.abs(share - stiffest).max() < 0.011
    assert settling(curve(200.0, {"kind": "lqg", "stiffness": "1 N/mm"})) > 0.15  # without normalization


def test_at_the_design_stiffness_nothing_changes() -> None:
    plain, normalized = ({"kind": "lqg", "stiffness": "1 N/mm", "normalize": on} for on in (False, True))
    assert np.abs(curve(1000.0, plain) - curve(1000.0, normalized)).max() < 1e-9


@pytest.mark.parametrize("kind", ["lead_lag", "gain", "state_space"])
def test_every_linear_controller_can_be_normalized(kind: str) -> None:
    table: dict[str, Any] = {"kind": kind, "normalize": "1 N/mm"}
    if kind == "gain":
        table["gain"] = 0.5
    if kind == "state_space":
        table |= {"A": [], "B": [], "C": [], "D": (0.5 * np.hstack([np.eye(3), -np.eye(3)])).tolist()}
    if kind == "lead_lag":
        table["stiffness"] = "1 N/mm"
    shares = []
    for stiffness in (300.0, 3000.0):
        trace = palpate.simulate(press(object=spring(stiffness), controller=table, run={"duration": "0.02 s"}))
        shares.append(trace["object_force"] / stiffness * 1000.0)
    soft, stiff = shares
    assert np.abs(soft).max() > 0.05
    # the reference in N is the same, so the deflection, and not its share of the target, scales with 1/K
    assert np.allclose(soft * 300.0, stiff * 3000.0, atol=0.02 * np.abs(soft * 300.0).max())


def test_all_operators_are_stable_at_every_stiffness() -> None:
    exact = Scenario.from_dict(press())
    device = exact.load_device()
    law = build_controller(exact, device, device.inverse(device.forward(np.array([0.0, 2.2305, 3.2776]))))
    hands = [
        None,
        *(HumanArm(m, b, k) for m, b, k in product((0.05, 0.15, 0.3, 0.5), (0, 1, 4.5, 20), (0, 100, 560, 2000))),
    ]
    worst = 0.0
    for name in ("phantom-premium-1.5a", "phantom-premium-1.5a-rotors"):
        scenario = Scenario.from_dict(press(device={"name": name}, object=spring(10e3)))
        for hand in hands:
            loop = scenario_loop(scenario, arm=hand, operator_force=(0.0, 0.0, 0.0), controller=law)
            worst = max(worst, loop.spectral_radius())
    assert len(hands) == 65
    assert worst < 1.0


def test_the_linear_loop_does_not_depend_on_the_stiffness() -> None:
    radii = [scenario_loop(Scenario.from_dict(press(object=spring(k)))).spectral_radius() for k in (50.0, 1e3, 2e4)]
    assert radii == pytest.approx([radii[1]] * 3, rel=1e-9)
    plain = press(object=spring(1e4), controller={"kind": "lqg", "stiffness": "1 N/mm"})
    assert scenario_loop(Scenario.from_dict(plain)).spectral_radius() > 1.0


class Switching:
    """Wall along z whose stiffness changes at random every few ticks; the controller is told `wrong` times it."""

    def __init__(self, every: int, seed: int, wrong: float = 1.0) -> None:
        self.every, self.seed, self.wrong = every, seed, wrong

    def reset(self) -> None:
        self.generator, self.tick = np.random.default_rng(self.seed), 0

    def step(self, tip: Any) -> ContactResult:
        if self.tick == 0:
            self.start = tip.position[2]
        if self.tick % self.every == 0:
            self.stiffness = float(self.generator.uniform(200.0, 3500.0))
        self.tick += 1
        depth = float(self.start - tip.position[2])
        force = [0.0, 0.0, -self.stiffness * max(depth, 0.0)]
        told = self.wrong * self.stiffness
        return ContactResult(force, (0.0, 0.0, -max(depth, 0.0)), (0.0, 0.0, 1.0), depth, told, depth > 0.0)


@pytest.mark.parametrize("every", [1, 10, 100])
@pytest.mark.parametrize("controller", [LQG, {"kind": "workspace"}])
@pytest.mark.parametrize("name", ["phantom-premium-1.5a", "phantom-premium-1.5a-rotors"])
def test_a_stiffness_that_switches_at_random_keeps_the_deflection_bounded(
    every: int, controller: dict[str, Any], name: str
) -> None:
    tables = press(
        device={"name": name, "encoder": True, "saturation": True},
        reference={"shape": "step", "force": ["0 N", "0 N", "-0.5 N"]},
        controller=controller,
        run={"duration": "0.5 s"},
    )
    trace = palpate.simulate(tables, object=Switching(every, seed=every))
    depth = -(trace["tip"] - trace["tip"][0])[:, 2]
    assert trace.completed
    assert depth[-200:].mean() > 0.3 * 0.5 / 3500.0
    assert depth.max() <= 1.05 * 0.5 / 200.0


@pytest.mark.parametrize("every", [1, 30, 100])
@pytest.mark.parametrize("wrong", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("operator", [{}, {"operator": ARM}])
def test_a_switching_stiffness_that_is_known_wrongly_keeps_the_deflection_bounded(
    every: int, wrong: float, operator: dict[str, Any]
) -> None:
    """With counts, limits, unknown rotors, and a hand of 0.15 kg or none; at rest force and reference agree."""
    tables = press(
        device={"name": "phantom-premium-1.5a-rotors", "encoder": True, "saturation": True},
        reference={"shape": "step", "force": ["0 N", "0 N", "-0.5 N"]},
        controller={"kind": "workspace"},
        run={"duration": "0.5 s"},
        **operator,
    )
    trace = palpate.simulate(tables, object=Switching(every, every, wrong))
    depth = -(trace["tip"] - trace["tip"][0])[:, 2]
    assert trace.completed
    assert depth.max() <= 1.05 * 0.5 / 200.0


def test_outside_a_wall_the_signed_depth_brings_the_tip_to_it() -> None:
    wall = {"kind": "wall", "stiffness": "3.5 N/mm", "normal": [0, 0, 1], "position": ["0 mm", "0 mm", "-5 mm"]}
    tables = press(object=wall, reference={"shape": "step", "force": ["0 N", "0 N", "-1 N"]}, run={"duration": "0.3 s"})
    trace = palpate.simulate(tables)
    depth = 5e-3 - (trace["tip"] - trace["tip"][0])[:, 2] - 10e-3
    assert trace["object_force"][-1, 2] == pytest.approx(-1.0, abs=0.02)
    first = int(np.flatnonzero(trace["touching"][:, 0])[0])
    assert depth[first:].max() < 1e-3  # an overshoot of the way
    free = palpate.simulate(press(object=wall, reference={"shape": "step", "force": ["0 N", "0 N", "0 N"]}))
    assert np.abs(free["tip"] - free["tip"][0]).max() < 1e-5  # without a reference nothing draws the tip to the wall


@pytest.mark.parametrize("controller", [{**LQG, "windup_time": "0.2 s"}, {"kind": "workspace"}])
@pytest.mark.parametrize("seed", [1, 2])
def test_a_slide_over_polygons_of_random_stiffness_keeps_contact_and_depth(
    seed: int, controller: dict[str, Any]
) -> None:
    tables = Scenario.from_file(SLIDE).to_dict()
    random = np.exp(np.random.default_rng(seed).uniform(np.log(50.0), np.log(10e3), 768))
    surface = tables["object"]["surface"]
    for key in ("pattern", "width"):
        del surface[key]
    surface |= {"stiffness": [f"{k:.6g} N/m" for k in random], "pattern": "listed"}
    tables["object"]["mesh"]["divisions"] = 8
    tables["reference"]["table"] = [
        ["0 s", "0 N", "0 N", "0 N"],
        ["0.1 s", "0 N", "0 N", "-0.5 N"],
        ["0.2 s", "0 N", "0 N", "-0.5 N"],
        ["0.25 s", "0.8 N", "0.16 N", "-0.5 N"],
    ]
    tables |= {"controller": controller, "run": {"duration": "0.9 s"}}
    trace = palpate.simulate(tables)
    start = int(np.flatnonzero(trace["touching"][:, 0])[0])
    assert trace.completed
    assert start < 10
    assert trace["touching"][start:, 0].all()
    assert len(np.unique(trace["triangle"])) > 5
    assert trace["depth"].max() <= 1.05 * 0.5 / random.min()


@pytest.mark.parametrize("controller", [LQG, {"kind": "workspace"}])
def test_on_a_mesh_that_sticks_the_loop_at_rest_does_not_depend_on_its_stiffness(controller: dict[str, Any]) -> None:
    radii = []
    for stiffness in ("300 N/m", "10 N/mm"):
        surface = {"stiffness": stiffness, "tangential": "1 N/mm", "static_friction": 0.3}
        mesh = {"kind": "mesh", "mesh": {"shape": "box", "edge": "40 mm", "divisions": 2}, "surface": surface}
        press_down = {"shape": "step", "force": ["0 N", "0 N", "-0.5 N"]}
        scenario = Scenario.from_dict(press(object=mesh, controller=controller, reference=press_down))
        resting = mesh_contact(scenario, sites=1).resting.radius
        trace = palpate.simulate(scenario)
        assert contact_radius(trace, scenario)[0] == pytest.approx(resting, rel=1e-6)
        radii.append(resting)
    assert radii[0] == pytest.approx(radii[1], rel=1e-4)
    assert max(radii) < 1.0


@pytest.mark.parametrize("stiffness", [200.0, 1024.0, 5000.0])
def test_a_body_settles_like_a_spring(stiffness: float, tmp_path: Path) -> None:
    path = one_node(stiffness, tmp_path / "one.h5")
    body = {"kind": "body", "body": {"file": str(path), "radius": "20 mm", "tip": "flat"}}
    tables = press(object=body, reference={"shape": "step", "force": ["0 N", "0 N", "-0.5 N"]})
    share = palpate.simulate(tables)["object_force"][:, 2:] / -0.5
    wall = {"kind": "wall", "stiffness": f"{stiffness} N/m", "normal": [0, 0, 1]}
    expected = palpate.simulate(tables | {"object": wall})["object_force"][:, 2:] / -0.5
    assert settling(share) < 70e-3  # the stiffness is not known in the first 50 um
    assert share.max() < 1.06
    assert share[-1, 0] == pytest.approx(1.0, abs=0.01)
    assert np.abs(share - expected).max() < 0.3


def test_certify_judges_the_constant_loop_and_names_the_assumption() -> None:
    stiff = press(object=spring(10e3))
    certificate = certify(stiff)
    assert certificate.verdict.state is State.STABLE
    assert "same for every stiffness" in certificate.verdict.reason
    assert any("divides reference and object force" in one for one in certificate.assumptions)
    margins = certify(press(object=spring(200.0))).margin
    assert margins["gain_margin"] == pytest.approx(certificate.margin["gain_margin"], rel=1e-6)


def test_a_normalized_loop_has_no_z_width() -> None:
    with pytest.raises(StabilityError, match="same for every stiffness"):
        zwidth(press())


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"controller": {"kind": "gain", "gain": 1.0, "normalize": True}}, "has no design stiffness"),
        ({"controller": {"kind": "lqg", "normalize": "0 N/mm"}}, "must be positive"),
        ({"controller": {"kind": "lqg", "normalize": "3 mm"}}, "normalize"),
    ],
)
def test_a_mistake_in_normalize_is_named(changes: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ScenarioError, match=sentence):
        Scenario.from_dict(press(**changes))


def test_an_impedance_display_cannot_divide_out_the_stiffness() -> None:
    tables = press(servo={"topology": "impedance_display"}, operator={"kind": "force", "force": "1 N"})
    del tables["reference"]
    with pytest.raises(ScenarioError, match="feels the object's stiffness"):
        Scenario.from_dict(tables)


def test_an_object_with_a_stiffness_but_no_normal_is_refused() -> None:
    def careless(tip: Any) -> ContactResult:
        return ContactResult([0.1, 0.0, 0.0], stiffness=100.0)

    with pytest.raises(ScenarioError, match="without the normal along which it acts"):
        palpate.simulate(press(), object=careless)


def test_a_resolved_loop_and_a_scenario_of_the_controller_keep_the_normalization(tmp_path: Path) -> None:
    folder = resolve(press(), tmp_path / "loop")
    assert '"normalized_state_space"' in (folder / "loop.json").read_text("utf-8")
    scenario = Scenario.from_dict(press())
    law = build_controller(scenario, scenario.load_device(), np.array([0.0, 2.2305, 3.2776]))
    given = palpate.simulate(press(object=spring(200.0), controller={"kind": "none"}), controller=law)
    assert np.array_equal(given["tip"], palpate.simulate(press(object=spring(200.0)))["tip"])
    again = Scenario.from_dict(with_controller(scenario, law).to_dict())
    assert again.controller.normalize == pytest.approx((1000.0,) * 3)


def test_a_normalized_controller_sees_its_design_stiffness_in_any_object_with_a_spring() -> None:
    """In 0.5 N/m as well as in 4 N/mm, and the damping in the same ratio; an axis without a spring is left alone."""
    touched = SimpleNamespace(stiffness=(0.5, 4000.0, 0.0), damping=(0.1, 2.0, 3.0))
    scenario: Any = SimpleNamespace(object=touched)
    law: Any = SimpleNamespace(design_stiffness=np.full(3, 1000.0))
    k, b = controlled_object(scenario, law)
    np.testing.assert_allclose(k, [1000.0, 1000.0, 0.0])
    np.testing.assert_allclose(b, [200.0, 0.5, 3.0])


def test_an_object_is_felt_where_it_has_a_spring_or_a_damper() -> None:
    touched = SimpleNamespace(kind="spring", stiffness=(1.0, 0.0, 0.0), damping=(2.0, 3.0, 0.0))
    scenario: Any = SimpleNamespace(object=touched)
    np.testing.assert_array_equal(touched_directions(scenario, np.eye(3)), np.eye(3)[:, :2])
    np.testing.assert_array_equal(touched_directions(scenario, np.diag([0.0, 1.0, 1.0])), np.eye(3)[:, 1:2])


def test_a_design_stiffness_is_one_or_three_numbers_or_text_with_a_unit() -> None:
    plain = Controller.gain(1.0, 1e-3)
    assert plain.normalized("1.5 N/mm").design_stiffness == (1500.0, 1500.0, 1500.0)
    assert plain.normalized(200.0).design_stiffness == (200.0, 200.0, 200.0)
    assert plain.normalized([1.0, 2.0, 3.0]).design_stiffness == (1.0, 2.0, 3.0)
    for wrong in ("1.5 mm", 0.0, -1.0, np.inf, [1.0, np.nan, 1.0]):
        with pytest.raises(DesignError, match="normalized: stiffness"):
            plain.normalized(wrong)


def test_a_controller_has_six_inputs_three_outputs_a_period_and_finite_matrices() -> None:
    def made(a: float = 0.5, b: float = 1.0, c: float = 1.0, d: float = 0.0, dt: Any = 1e-3, n: int = 6) -> Controller:
        system = control.StateSpace([[a]], np.full((1, n), b), np.full((3, 1), c), np.full((3, n), d), dt)
        return Controller(system, np.zeros((1, 3)))

    assert made().system.nstates == 1
    for name in "abcd":
        with pytest.raises(DesignError, match="a controller's matrices must be finite"):
            made(**{name: np.nan})
    for wrong in (0, True, None):
        with pytest.raises(DesignError, match="a controller is sampled with its servo period in s, not dt = "):
            made(dt=wrong)
    with pytest.raises(DesignError, match=r"maps 6 inputs \[F_ref; F_object\] to 3 outputs, not 5 to 3"):
        made(n=5)
    with pytest.raises(DesignError, match=r"antiwindup must be 1 x 3 \(states x forces\), not \(3, 1\)"):
        Controller(made().system, np.zeros((3, 1)))
