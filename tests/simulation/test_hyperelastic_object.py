"""A body under large displacements in a scenario: the laws of small ones, of energy, and of the solid by itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from nightly import nightly, some
from palpate import fem as bodies
from palpate import simulate
from palpate.errors import ScenarioError
from palpate.fem import BodyError, HyperelasticModel, Material, QuasiStaticSolver
from palpate.fem.selectors import Selector
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.simulation.bodies import place_body, pressed_at
from palpate.simulation.judgment import judge
from palpate.simulation.verdict import State
from palpate.stability import contact_stability

POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]
HAND = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"}
VOLUME = bodies.block((0.04, 0.04, 0.03), 0.005)
BOTTOM, TOP = bodies.half_space("z", "<", 1e-9), bodies.half_space("z", ">", 0.03 - 1e-9)


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 x 40 x 30 mm of 8 kPa, bonded below, touched on its top, condensed from quadratic tetrahedra."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    bodies.build(VOLUME, young=8e3, poisson=0.4, fixed=BOTTOM, touch=TOP, output=path)
    return path


def tables(block: Path, force: float, height: float, duration: str = "0.4 s", **body: Any) -> dict[str, Any]:
    """A press of `force`, N, by a hand-held arm on the block's top, `height`, m, under the start tip."""
    chosen = {"file": str(block), "origin": ["21 mm", "18.5 mm", "30 mm"], "radius": "8 mm", "kind": "neo-hookean"}
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "0.1 s", "force": ["0 N", "0 N", f"{-force:g} N"]},
        "operator": HAND,
        "object": {"kind": "body", "position": ["0 mm", "0 mm", f"{-height:g} m"], "body": chosen | body},
        "run": {"duration": duration},
    }


def deep(block: Path, **body: Any) -> dict[str, Any]:
    return tables(block, 1.8, 8.3e-3, "0.6 s", **body)


def test_a_tip_that_starts_deep_inside_is_undecided_for_want_of_a_force(block: Path) -> None:
    trace = simulate(tables(block, 1.0, 0.0, "0.1 s", radius="25 mm"))
    assert not trace["solved"][:-1].any()
    assert trace.verdict.state is State.UNDECIDED
    text = summarize(trace)["verdict"]
    assert "the contact force was not found in 101 of 101 samples" in text
    assert "it began 25 mm deep in the body; check object.position" in text


INERTIA = {"density": "1000 kg/m^3", "rayleigh_beta": "2 ms"}
RELAXING = {"instantaneous_ratio": 2.0, "retardation_time": "0.1 s"}


@pytest.mark.parametrize(("depth", "body"), [(0.5, INERTIA), (1.0, RELAXING), (7.5, INERTIA | RELAXING), (11.0, {})])
def test_a_run_that_starts_in_contact_begins_in_equilibrium(block: Path, depth: float, body: dict[str, Any]) -> None:
    """At rest and relaxed, with the force of a slow press, and it stays there under a fixed tip."""
    scenario = tables(block, 0.0, depth * 1e-3 - 8e-3, "0.2 s", **body)
    del scenario["reference"]
    scenario["object"]["position"] = ["0 mm", "0 mm", f"{depth - 8.0} mm"]
    trace = simulate({**scenario, "servo": {"topology": "impedance_display"}, "operator": {"kind": "fixed"}})
    at = np.array([21e-3, 18.5e-3, 30e-3])
    expected = bodies.load(block).hyperelastic("1 ms").indent(at, 8e-3, depth * 1e-3).force
    assert -trace["object_force"] == pytest.approx(
        np.tile(expected, (len(trace.time), 1)), abs=0.005 * float(np.linalg.norm(expected))
    )


@pytest.mark.parametrize("depth", [6.4, 7.2])
def test_a_flat_end_that_starts_deep_begins_in_the_equilibrium_of_a_slow_press(block: Path, depth: float) -> None:
    """One large step ended in another one, with a force that was a tenth smaller and pointed sideways."""
    end = {"tip": "flat", "radius": "8 mm"}
    scenario = tables(block, 0.0, 0.0, "20 ms", **end)
    del scenario["reference"]
    scenario["object"]["position"] = ["0 mm", "0 mm", f"{depth} mm"]
    trace = simulate({**scenario, "servo": {"topology": "impedance_display"}, "operator": {"kind": "fixed"}})
    at = np.array([21e-3, 18.5e-3, 30e-3])
    expected = bodies.load(block).hyperelastic("1 ms").indent(at, 8e-3, depth * 1e-3, tip="flat").force
    assert -trace["object_force"][0] == pytest.approx(expected, abs=0.005 * float(np.linalg.norm(expected)))


@pytest.mark.parametrize("law", ["neo-hookean", "corotational"])
def test_a_small_press_in_the_loop_is_near_that_of_the_condensed_body(block: Path, law: str) -> None:
    """Some hundredths of a millimetre deep, where a condensed body of quadratic elements on the same cells is right."""
    flat = {"tip": "flat", "radius": "6 mm"}
    large = simulate(tables(block, 0.03, 5e-6, kind=law, **flat))
    linear = simulate(tables(block, 0.03, 5e-6, kind="compliance", **flat))
    assert 1e-5 < linear["deflection"][-1, 2] * -1 < 1e-4
    for channel, axes in (("tip", 3), ("object_force", 3), ("deflection", 1)):  # a condensed one yields along normals
        moved = (large[channel] - linear[channel])[:, -axes:]
        assert np.abs(moved[-50:]).max() < 0.05 * np.ptp(linear[channel], axis=0).max(), channel


def test_the_same_scenario_gives_the_same_trace(block: Path) -> None:
    """Bit for bit, and through the scenario's own text; the body that was made for it is not changed by a run."""
    scenario = Scenario.from_dict(deep(block, update_interval="15 ms", nodes_per_tip=24))
    first, second = simulate(scenario), simulate(Scenario.from_dict(scenario.to_dict()))
    assert scenario.to_dict()["object"]["body"]["options"] == {"update_interval": "0.015 s", "nodes_per_tip": 24.0}
    for channel in first.channels:
        assert np.array_equal(first[channel], second[channel]), channel
    other = simulate(deep(block, update_interval="40 ms"))
    assert not np.array_equal(first["tip"], other["tip"])


def test_the_work_of_the_tip_is_what_the_body_holds(block: Path) -> None:
    """In, held, out again: at each tick work = stored + saved, neither below zero; both end with the contact."""
    course = [["0 s", 0.0], ["0.25 s", -1.8], ["0.45 s", -1.8], ["0.7 s", 0.4], ["0.8 s", 0.4]]
    reference = {"shape": "table", "table": [[t, "0 N", "0 N", f"{f:g} N"] for t, f in course]}
    trace = simulate({**deep(block), "reference": reference, "run": {"duration": "0.8 s"}})
    force, tip, on = trace["object_force"], trace["tip"], trace["touching"][:, 0] > 0
    held = (trace["stored_energy"] + trace["tank_energy"])[:, 0]
    mean = 0.5 * (force[1:] + force[:-1])
    work = np.concatenate([[0.0], np.cumsum((mean * np.diff(tip, axis=0)).sum(axis=1))])
    most = trace["stored_energy"].max()
    assert most > 5e-4
    assert trace["tank_energy"].max() > 1e-3 * most
    assert trace["stored_energy"].min() >= 0.0
    assert trace["tank_energy"].min() >= 0.0
    first, last = np.flatnonzero(on)[[0, -1]]
    assert on[first:last].all()
    np.testing.assert_allclose(work[first:last], held[first:last], atol=0.01 * most)
    assert not on[-1]
    found = summarize(trace)["palpation"]
    assert found["stored_J"] == found["saved_J"] == 0.0
    assert found["lost_J"] > -0.01 * most


@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_the_loop_feels_what_the_body_answers(block: Path, tip: str) -> None:
    """The tip's way played to the body by itself gives the loop's forces back, and the report its shape."""
    height = 8.3e-3 if tip == "sphere" else 3e-4
    scenario = Scenario.from_dict(tables(block, 1.5, height, tip=tip, radius="8 mm"))
    trace = simulate(scenario)
    body, origin, _ = place_body(scenario, trace["tip"][0] + np.array(scenario.object.position))
    path = trace["tip"] - origin  # the core's own rounding: its last bit decides when the solver stops
    body.core.reset()
    felt = body.simulate_path(path, 8e-3, outward=[0, 0, 1], tip=tip)  # type: ignore[arg-type]
    assert felt.nodes.max() >= 4
    np.testing.assert_allclose(trace["object_force"], -felt.force, atol=1e-9)
    np.testing.assert_allclose(trace["deflection"], felt.deflection, atol=1e-9)
    np.testing.assert_array_equal(trace["contact_nodes"][:, 0], felt.nodes)
    shown = pressed_at(trace, -1)
    under = np.argmin(np.linalg.norm(body.nodes - path[-1], axis=1))
    assert shown.displacement[under, 2] == pytest.approx(
        path[-1, 2] - (8e-3 if tip == "sphere" else 0) - 0.03, abs=5e-4
    )
    assert (shown.pressure @ body.contents.areas) == pytest.approx(np.linalg.norm(trace["object_force"][-1]), rel=0.12)


@nightly
def test_a_body_with_inertia_that_relaxes_has_in_the_loop_the_forces_that_it_has_by_itself(block: Path) -> None:
    memory = {
        "density": "1000 kg/m^3",
        "rayleigh_alpha": "5 1/s",
        "instantaneous_ratio": 2.0,
        "retardation_time": "50 ms",
    }
    forces = {}
    given: dict[str, dict[str, Any]] = {"both": memory, "none": {}}
    for name, options in given.items():
        scenario = Scenario.from_dict(tables(block, 1.0, 8.3e-3, update_interval="4 ms", **options))
        trace = simulate(scenario)
        assert trace["solved"].all()
        body, origin, _ = place_body(scenario, trace["tip"][0] + np.array(scenario.object.position))
        body.core.reset()
        felt = body.simulate_path(trace["tip"] - origin, 8e-3)
        np.testing.assert_allclose(trace["object_force"], -felt.force, atol=1e-2 * np.abs(felt.force).max())
        forces[name] = felt.force[:, 2] / np.maximum(-felt.deflection[:, 2], 1e-6)
    assert (forces["both"][60:120] > 1.2 * forces["none"][60:120]).all()  # stiffer at first, while it rises


def test_a_deep_press_rests_where_the_solid_by_itself_does(block: Path) -> None:
    """A quarter of the block's height deep, by another road: a solid of its own assembly, pressed without a loop."""
    trace = simulate({**deep(block), "run": {"duration": "1.8 s"}})
    found = summarize(trace)["palpation"]
    assert found["settled"]
    depth = trace["tip"][0, 2] - trace["tip"][-1, 2] - 0.3e-3
    assert depth > 5e-3
    solid = QuasiStaticSolver(HyperelasticModel(VOLUME, Material(8e3, 0.4), BOTTOM, TOP))
    aside = (trace["tip"][-1] - trace["tip"][0])[:2]
    force, _ = solid.indent([0.021 + aside[0], 0.0185 + aside[1], 0.03], 8e-3, depth, outward=[0, 0, 1])
    np.testing.assert_allclose(trace["object_force"][-1], -force, atol=0.01 * force[2])
    judged = contact_stability(trace)
    assert judged.stable
    assert judged.static_stiffness > 1.1 * force[2] / depth  # it stiffens: the slope is above the secant


def test_a_run_on_more_nodes_than_a_local_model_holds_is_not_settled(tmp_path: Path) -> None:
    """176 nodes lie under the flat end, a local model has 128: the force is too small, however calm the tip."""
    pad, path = bodies.block((0.064, 0.064, 0.008), 0.004), tmp_path / "pad.h5"
    bodies.build(pad, young=8e3, poisson=0.4, fixed=BOTTOM, touch=bodies.half_space("z", ">", 7.9e-3), output=path)
    here = {"origin": ["32 mm", "32 mm", "8 mm"], "tip": "flat"}
    wide = simulate(tables(path, 2.0, 2e-4, "0.3 s", radius="30 mm", **here))
    assert summarize(wide)["palpation"]["unsolved"] > 150
    assert judge(wide).state is State.UNDECIDED
    assert "the contact force was not found in" in judge(wide).reason
    assert pressed_at(wide, -1).displacement.min() < -1e-4  # the page shows it all the same
    scene = tables(path, 2.0, 2e-4, "0.3 s", radius="30 mm", **here)
    far = {"kind": "wall", "normal": [0.0, 0.0, 1.0], "stiffness": "1 N/mm", "position": ["0 mm", "0 mm", "-50 mm"]}
    scene["objects"] = {"pad": scene.pop("object"), "floor": far}
    judged = judge(simulate(scene))
    assert judged.state is State.UNDECIDED
    assert "more than 128 nodes lie under the tip" in judged.reason
    small = simulate(tables(path, 2.0, 2e-4, "0.8 s", radius="18 mm", **here))
    assert summarize(small)["palpation"]["unsolved"] == 0
    assert judge(small).state is State.SETTLED
    small["solved"][100:120] = 0.0  # on the way: the rest may be another one
    assert judge(small).state is State.UNDECIDED
    assert "not found in 20 of 801 samples" in judge(small).reason


def test_what_cannot_be_is_refused(block: Path) -> None:
    with pytest.raises(ScenarioError, match=r"update_interval: it lasts one tick \(0.001 s\) or more, not 0.0001 s"):
        simulate(deep(block, update_interval="0.1 ms"))
    with pytest.raises(ScenarioError, match="nodes_per_tip: 65 must be a whole number, from 4 to 64"):
        simulate(deep(block, nodes_per_tip=65))
    with pytest.raises(ScenarioError, match=r'unknown key "sideways_fraction" in \[object.body\]'):
        simulate(deep(block, sideways_fraction=0.5))
    with pytest.raises(ScenarioError, match="did you mean neo-hookean"):
        simulate(deep(block, kind="neo-hooke"))
    with pytest.raises(BodyError, match="neo-hookean or corotational"):
        bodies.load(block).hyperelastic("1 ms", law="mooney")  # type: ignore[arg-type]


def sideways(depth: float, reach: float, ticks: int) -> np.ndarray:
    """In at once, held, then `reach` along x and back, of a flat end; (m, 3), m."""
    still = np.tile([0.016, 0.0185, 0.03 - depth], (300, 1))
    along = np.concatenate([np.linspace(0, 1, ticks), np.linspace(1, 0, ticks)])
    return np.concatenate([still, still[-1] + reach * along[:, None] * [1.0, 0.0, 0.0]])


def test_friction_sticks_and_slips_as_on_the_condensed_body(block: Path) -> None:
    """Small: the way to sliding as on the linear body, whose stiffness converges to 56.2 N/m (cells of 2 mm).

    The linear body of these cells has 12 % less. Sliding is mu N.
    """
    body = bodies.load(block)
    path = sideways(5e-5, 8e-4, 400)
    kinds = (body.hyperelastic("1 ms", static_friction=0.5, dynamic_friction=0.4), body.with_friction(0.5, 0.4))
    large, small = (kind.simulate_path(path, "6 mm", outward=[0, 0, 1], tip="flat") for kind in kinds)
    drag, true = large.friction[:, 0], small.friction[:, 0]
    load = large.force[:, 2]
    rate = np.abs(drag[301:] / load[301:])
    assert rate.max() < 0.5 + 1e-9
    np.testing.assert_allclose(rate[380], 0.4, rtol=1e-6)  # slides
    way = path[309, 0] - path[300, 0]
    assert (drag[300] - drag[309]) / way == pytest.approx(56.2, rel=0.06)
    assert (true[300] - true[309]) / way == pytest.approx(56.2, rel=0.13)
    assert np.abs(drag - true).max() < 0.12 * load.max()


@pytest.mark.parametrize(
    ("size", "cell", "fixed", "place", "within"),
    [
        ((0.04, 0.04, 0.02), 4e-3, "z < 0.1 mm", (0.02, 0.02), 0.13),
        ((0.06, 0.012, 0.012), 3e-3, "x < 0.1 mm", (0.03, 0.006), 0.40),
        ((0.016, 0.016, 0.04), 4e-3, "z < 0.1 mm", (0.008, 0.008), 0.13),
    ],
    ids=["block", "beam", "column"],
)
def test_a_sticking_sphere_shears_the_body_as_linear_elasticity_does(
    size: tuple[float, float, float], cell: float, fixed: str, place: tuple[float, float], within: float
) -> None:
    """Along and across, 1 mm deep, against signed distance with the full compliance.

    One compliance for the whole body and all directions was 2 to 15 times too stiff, or a tenth.
    """
    body = bodies.build(bodies.block(size, cell), young=1e4, fixed=fixed)
    top, radius, way = np.array([*place, size[2]]), 6e-3, 1e-4
    down = top + [0.0, 0.0, radius] + np.linspace(1e-4, -1e-3, 100)[:, None] * [0.0, 0.0, 1.0]
    still = np.repeat(down[-1:], 60, axis=0)
    for axis in np.eye(3)[:2]:
        path = np.vstack([down, still, down[-1] + np.linspace(0.0, way, 60)[:, None] * axis, still + way * axis])
        stiffness = []
        for kind in (
            body.signed_distance(static_friction=5.0),
            body.hyperelastic("1 ms", update_interval="2 ms", static_friction=5.0),
        ):
            force = kind.simulate_path(path, radius).force @ axis
            stiffness.append((force[150] - force[-1]) / way)
        assert stiffness[1] == pytest.approx(stiffness[0], rel=within)


@pytest.mark.parametrize(
    "memory", some([INERTIA | RELAXING, INERTIA, RELAXING]), ids=some(["both", "inertia", "relaxation"])
)
def test_a_sticking_sphere_shears_a_body_with_memory_as_one_without_in_the_long_term(memory: dict[str, Any]) -> None:
    """Its lateral stiffness was 39 to 44 % larger: that of the body at rest, by quadratic elements."""
    body = bodies.build(bodies.block((0.04, 0.04, 0.02), 4e-3), young=1e4, fixed="z < 0.1 mm")
    down = [0.02, 0.02, 0.026] + np.linspace(1e-4, -1e-3, 100)[:, None] * [0.0, 0.0, 1.0]
    still = np.repeat(down[-1:], 400, axis=0)
    way = np.array([1e-4, 0.0, 0.0])
    path = np.vstack([down, still, down[-1] + np.linspace(0.0, 1.0, 60)[:, None] * way, still + way])
    forces = []
    for options in ({}, memory):
        kind = body.hyperelastic("1 ms", update_interval="4 ms", static_friction=5.0, **options)
        forces.append(kind.simulate_path(path, 6e-3).force[:, 0])
    without, with_memory = (force[500] - force[-1] for force in forces)
    assert with_memory == pytest.approx(without, rel=0.08)


def test_friction_does_not_depend_on_the_order_of_the_nodes() -> None:
    """The lateral force of a press was between 0.0097 and 0.0133 N in three orders."""
    volume = bodies.block((0.04, 0.03, 0.02), 5e-3)
    points, low = volume.points.copy(), volume.points[:, 2].min()
    points[:, 2] *= 1.0 + 0.15 * np.sin(60.0 * points[:, 0]) + 0.1 * np.cos(80.0 * points[:, 1])
    top = points[np.argmin(np.linalg.norm(volume.points - [0.02, 0.015, 0.02], axis=1))] + [0.0, 0.0, 6e-3]
    steps = np.linspace(0.0, 1.0, 200)[:, None]
    path = np.vstack(
        [top + [0, 0, 1e-3] + steps * [3e-4, 2e-4, -3e-3], np.repeat(top[None] + [3e-4, 2e-4, -2e-3], 50, axis=0)]
    )
    rng, forces = np.random.default_rng(1), []
    for order in (np.arange(len(points)), rng.permutation(len(points)), rng.permutation(len(points))):
        cells = np.argsort(order)[volume.tetrahedra]
        other = bodies.Volume(points[order], cells, "bumps")
        held = Selector("below", lambda places: places[:, 2] < low + 1e-6)
        body = bodies.build(other, young=1e4, fixed=held, order=1)
        kind = body.hyperelastic("1 ms", update_interval="2 ms", static_friction=0.5)
        forces.append(kind.simulate_path(path, 6e-3).force[-1])
    assert np.ptp(forces, axis=0).max() < 2e-3 * np.linalg.norm(forces[0])
    assert np.linalg.norm(forces[0][:2]) > 0.05 * forces[0][2]


def test_friction_takes_work_and_gives_none(block: Path) -> None:
    """Deep, led back and forth by a hand: at each tick the work of the tip is at least what the body holds."""
    led = [["0 s", "0 N", "0 N", "0 N"], ["0.3 s", "0 N", "0 N", "0 N"], ["0.5 s", "1.5 N", "0 N", "0 N"],
           ["0.8 s", "-0.8 N", "0.5 N", "0 N"]]  # fmt: skip
    setup = {**deep(block, static_friction=0.5, dynamic_friction=0.4), "run": {"duration": "0.9 s"}}
    trace = simulate({**setup, "operator": {**HAND, "shape": "table", "table": led}})
    force, tip = trace["object_force"], trace["tip"]
    held = (trace["stored_energy"] + trace["tank_energy"])[:, 0]
    work = np.concatenate([[0.0], np.cumsum((0.5 * (force[1:] + force[:-1]) * np.diff(tip, axis=0)).sum(axis=1))])
    most = trace["stored_energy"].max()
    assert (work - held).min() > -0.01 * most
    assert (work - held)[-1] > 0.1 * most
    assert np.diff(work - held).min() > -0.01 * most
    smooth = simulate({**setup, "object": deep(block)["object"], "operator": {**HAND, "shape": "table", "table": led}})
    assert np.ptp(smooth["tip"][:, 0]) > 1.2 * np.ptp(tip[:, 0])
    assert trace.completed
