"""Contact by the tip's signed distance on bodies of finite elements: accuracy, energy, invariance, and its refusals."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from palpate import _core
from palpate import fem as bodies
from palpate.contact import Mesh
from palpate.errors import PalpateError, PoseError
from palpate.fem import Body, BodyError, BodyWarning, block
from palpate.fem.checks import TipShape
from palpate.scenario import Scenario
from palpate.scenario.body import BodyChoice
from tip_work import largest_fall, path_work

TOP = 0.02
AT = [0.0203, 0.0196, TOP]


@pytest.fixture(scope="module")
def body() -> Body:
    """40 x 40 x 20 mm of 10 kPa, bonded below, cells of 4 mm, the whole surface touched."""
    volume = block((0.04, 0.04, TOP), (4e-3, 4e-3, 5e-3))
    made = bodies.build(volume, young=10e3, fixed="z < 0.001 mm", modes=12)
    return made.signed_distance()


def test_a_small_contact_is_softer_than_with_nodes_alone_and_a_large_one_alike(body: Body) -> None:
    """Nodes alone are too stiff: by over 15 % at a contact radius below one cell, by about 10 % at two cells."""
    nodal = Body(body.contents)
    small, large = ((AT, 8e-3, 1.5e-3), ([0.02, 0.02, TOP], 40e-3, 2e-3))
    assert nodal.indent(*small).force[2] > 1.15 * body.indent(*small).force[2]
    assert 0.8 < body.indent(*large).force[2] / nodal.indent(*large).force[2] < 1.0


@pytest.mark.parametrize("tip", ["sphere", "flat"])
@pytest.mark.parametrize("memory", ["none", "creep", "modes"])
def test_the_force_does_not_depend_on_the_registers_of_the_machine(
    monkeypatch: pytest.MonkeyPatch, body: Body, memory: str, tip: TipShape
) -> None:
    """The code for the narrowest and for the widest registers gives the same bits, with friction too."""
    s = np.linspace(0.0, 1.0, 400)[:, None]
    path = np.array([0.012, 0.017, TOP + 4e-3]) + s * [0.02, 0.006, 0.0] - np.sin(np.pi * s) ** 2 * [0.0, 0.0, 6e-3]
    make, felt = _core.SignedDistanceBody, []
    rough = {"contact": "signed_distance", "static_friction": 0.4, "dynamic_friction": 0.3}

    class Narrow(_core.SignedDistanceBody):
        def __init__(self, *args: object, **options: object) -> None:
            super().__init__(*args, **options, lanes=2)

    for core in (make, Narrow):
        monkeypatch.setattr(_core, "SignedDistanceBody", core)
        if memory == "creep":
            made = body.viscoelastic("1 ms", instantaneous_ratio=2.0, retardation_time="0.1 s", **rough)
        elif memory == "modes":
            made = body.modal("1 ms", rayleigh_beta=1e-4, **rough)
        else:
            made = body.signed_distance(static_friction=0.4, dynamic_friction=0.3)
        felt.append(made.simulate_path(path, 5e-3, tip=tip, outward=[0.0, 0.0, 1.0] if tip == "flat" else None))
    assert np.abs(felt[0].force).max() > 0.05
    for name in ("force", "deflection", "energy"):
        np.testing.assert_array_equal(getattr(felt[0], name), getattr(felt[1], name))


def test_a_flat_end_that_slides_as_it_touches_and_leaves_keeps_its_contact(body: Body) -> None:
    """Friction dissipates the tip's work; that is no push through the body."""
    s = np.linspace(0.0, 1.0, 300)[:, None]
    path = np.array([0.016, 0.02, TOP + 2e-4]) + s * [8e-3, 0.0, 0.0] - np.sin(np.pi * s) ** 2 * [0.0, 0.0, 2.2e-3]
    smooth = body.signed_distance().simulate_path(path, 5e-3, outward=[0.0, 0.0, 1.0], tip="flat")
    for friction in (0.1, 0.3, 0.7):
        rough = body.signed_distance(static_friction=friction)
        felt = rough.simulate_path(path, 5e-3, outward=[0.0, 0.0, 1.0], tip="flat")
        assert not felt.lost.any()
        assert felt.force[:, 2] == pytest.approx(smooth.force[:, 2], abs=0.15 * smooth.force[:, 2].max())


def test_the_displacement_is_the_compliance_times_the_forces(body: Body) -> None:
    felt = body.indent(AT, 8e-3, 3e-3)
    nodes, inward = body.core.contact_forces()
    load = np.zeros((len(body.nodes), 3))
    load[nodes] = body.core.friction_forces() - inward[:, None] * body.normals[nodes]
    assert load.sum(axis=0) == pytest.approx(-felt.force, abs=1e-9)
    expected = (body.compliance.astype(float) @ load.ravel()).reshape(-1, 3)
    assert felt.displacement == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    gap = np.linalg.norm(body.nodes + felt.displacement - (AT + np.array([0, 0, 5e-3])), axis=1) - 8e-3
    assert -1.5e-3 < gap.min() < 0.0  # the elastic layer is compressed


@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_no_closed_path_gives_work(body: Body, tip: TipShape) -> None:
    """Over the top and beyond its edges, there and back by another way."""
    rng = np.random.default_rng(5)
    s = np.linspace(0.0, 2 * np.pi, 8001)
    outward = [0.0, 0.0, 1.0] if tip == "flat" else None
    for _ in range(2):
        a, b = rng.uniform(0, 6.28, 2)
        side = 22e-3 if tip == "sphere" else 12e-3
        path = np.stack([0.02 + side * np.cos(s + a), 0.02 + side * np.sin(2 * s + b), np.full(len(s), TOP)], axis=1)
        path[:, 2] += (5e-3 if tip == "sphere" else 0.0) + 1e-3 - 3e-3 * np.sin(s / 2) ** 2
        felt = body.simulate_path(path, 5e-3, outward=outward, tip=tip)
        work = path_work(felt, path)
        assert not felt.force[[0, -1]].any()
        assert np.abs(work).sum() > 1e-4
        assert work.sum() > -2e-5 * np.abs(work).sum()
        if tip == "sphere":
            assert np.abs(np.cumsum(work) - felt.energy[1:]).max() < 1e-3 * felt.energy.max()


def test_the_force_does_not_step_as_the_tip_slides_over_an_edge(body: Body) -> None:
    x = np.linspace(0.02, 0.05, 12001)  # 2.5 um per step
    path = np.stack([x, np.full(len(x), 0.0213), np.full(len(x), TOP + 3.5e-3)], axis=1)
    path = np.vstack([path[:1] + np.linspace([0, 0, 2e-3], [0, 0, 0], 200), path])
    force = body.simulate_path(path, 5e-3).force[200:]
    assert np.linalg.norm(np.diff(force, axis=0), axis=1).max() < 5e-3 * np.linalg.norm(force, axis=1).max()


def test_the_outward_direction_has_no_influence(body: Body) -> None:
    path = np.stack([np.linspace(0.01, 0.03, 200), np.full(200, 0.02), np.full(200, TOP + 4e-3)], axis=1)
    body.core.reset()
    one = body.simulate_path(path, 5e-3, outward=[0, 0, 1]).force
    body.core.reset()
    assert np.array_equal(body.simulate_path(path, 5e-3, outward=[1, 0, 0]).force, one)


def test_a_scaled_body_has_the_scaled_force(body: Body) -> None:
    assert body.scaled_stiffness(3.0).indent(AT, 6e-3, 2e-3).force == pytest.approx(
        3.0 * body.indent(AT, 6e-3, 2e-3).force, rel=1e-3
    )


def test_a_tip_that_is_pushed_through_loses_contact_and_gains_no_energy(body: Body) -> None:
    depth = np.concatenate([np.linspace(-1e-3, 9e-3, 2000), np.linspace(9e-3, -1e-3, 2000)])
    path = np.stack([np.full(4000, 0.0203), np.full(4000, 0.0196), TOP + 4e-3 - depth], axis=1)
    body.core.reset()
    with pytest.warns(BodyWarning, match="path: from step") as warned:
        felt = body.simulate_path(path, 4e-3)
    first = int(np.argmax(felt.lost))
    assert f"from step {first} on a tip is pushed through the body" in str(warned[-1].message)
    assert felt.lost.any()
    assert 4e-3 < depth[first] < 9e-3
    assert not felt.force[felt.lost].any()
    assert not felt.lost[-1]
    assert path_work(felt, path).sum() > 0.0
    with pytest.raises(BodyError, match="pushed through the body at"):
        body.indent(AT, 4e-3, 9e-3)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["elastic", "viscoelastic", "modal"])
def test_no_body_pulls_in_a_tip_that_is_below_its_surface(body: Body, kind: str, friction: float) -> None:
    """Presses to 1.5 radii with sideways moves: the body pushes the tip out, or the tip is lost and has no force."""
    made = Body(body.contents)
    rub = {"static_friction": friction} if friction else {}
    relaxing: dict[str, Any] = {"instantaneous_ratio": 1.4, "retardation_time": "30 ms", "contact": "signed_distance"}
    period, pulls, lost = 0.25e-3, [], 0
    t = np.arange(0.0, 0.6, period)
    for seed in range(12):
        random = np.random.default_rng(seed)
        when = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.6])
        depth = np.interp(t, when, [-0.2, *(random.uniform(0.6, 1.5, 4)), -0.2]) * 4e-3
        aside = [np.interp(t, when, random.uniform(-4e-3, 4e-3, 6)) for _ in range(2)]
        path = np.stack([AT[0] + aside[0], AT[1] + aside[1], TOP + 4e-3 - depth], axis=1)
        match kind:
            case "elastic":
                deep = made.signed_distance(**rub)
            case "viscoelastic":
                deep = made.viscoelastic(period, **relaxing, **rub)
            case _:
                deep = made.modal(period, rayleigh_alpha="20 1/s", **relaxing, **rub)
        felt = deep.simulate_path(path, 4e-3)
        normal = felt.force[:, 2] - felt.friction[:, 2]
        pulls.append(normal[path[:, 2] < TOP].min())
        lost += felt.lost.any()
        if kind != "modal":  # waves do work on a tip within a period
            assert largest_fall([felt], [path]) < 0.02 * felt.energy.max()
    assert min(pulls) > -1e-6
    assert lost > 3


@pytest.mark.filterwarnings("ignore:path. from step")
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["elastic", "viscoelastic", "modal"])
def test_a_flat_end_is_pushed_through_and_then_has_no_force(body: Body, kind: str, friction: float) -> None:
    """Its rod touched the nodes beside it, however far behind the body it was. Work is lost, none is gained."""
    made, radius, period = Body(body.contents), 6e-3, 0.5e-3
    relax: dict[str, Any] = {"instantaneous_ratio": 1.4, "retardation_time": "30 ms"} if kind == "viscoelastic" else {}
    if kind == "elastic":
        pressed = made.signed_distance()
    elif kind == "viscoelastic":
        pressed = made.viscoelastic(period, contact="signed_distance", **relax)
    else:
        pressed = made.modal(period, rayleigh_alpha="20 1/s", contact="signed_distance")
    pressed = pressed.with_friction(friction, friction)
    depth = np.concatenate([np.linspace(-1e-3, 5.0 * radius, 2000), np.linspace(5.0 * radius, -1e-3, 2000)])
    path = np.stack([np.full_like(depth, AT[0]), np.full_like(depth, AT[1]), TOP - depth], axis=1)
    felt = pressed.simulate_path(path, radius, tip="flat", outward=[0.0, 0.0, 1.0])
    assert 1.1 * radius < depth[np.flatnonzero(felt.lost)[0]] < 3.0 * radius
    assert felt.lost[depth > 3.0 * radius].all()
    assert not felt.force[felt.lost].any()
    assert not felt.lost[-1]
    work = -np.cumsum(0.5 * (felt.force[1:] + felt.force[:-1])[:, 2] * np.diff(path[:, 2]))
    assert work.min() > -1e-9
    assert work[-1] > 0.0


def test_a_way_is_behind_the_fixed_part_if_it_crosses_it(body: Body) -> None:
    """The bottom of the block is fixed, its edges included: a way crosses it where it changes from above to below."""
    random = np.random.default_rng(5)
    for _ in range(300):
        start, end = random.uniform([-0.01, -0.01, -0.02], [0.05, 0.05, 0.03], (2, 3))
        share = start[2] / (start[2] - end[2])
        at = start + share * (end - start)
        crosses = 0.0 < share < 1.0 and bool(((at[:2] > 0.0) & (at[:2] < 0.04)).all())
        assert body.is_behind_fixed(start, end) == crosses
    for vertex in body.points[body.points[:, 2] == 0.0]:
        assert body.is_behind_fixed(vertex + np.array([0.0, 0.0, 0.02]), vertex - np.array([0.0, 0.0, 0.01]))


def test_a_fixed_part_counts_under_any_name() -> None:
    floor = bodies.Selector("the floor", lambda x: x[:, 2] < 1e-6)
    body = bodies.build(block((0.02, 0.02, 0.01), 5e-3), young=1e4, fixed=[floor])
    above = np.array([0.01, 0.01, 0.02])
    assert body.is_behind_fixed(above, above - [0.0, 0.0, 0.021])
    assert not body.is_behind_fixed(above, above - [0.0, 0.0, 0.019])


@pytest.mark.parametrize("elements", ["volume", "boundary"])
def test_a_held_part_counts_as_a_fixed_one(elements: str) -> None:
    solid, way = block((0.02, 0.02, 0.01), 5e-3), np.array([0.0, 0.0, 0.021])
    if elements == "volume":
        body = bodies.build(solid, young=1e4, fixed="x < 0.1 mm")
    else:
        used, faces = np.unique(solid.surface, return_inverse=True)
        body = bodies.build_boundary(Mesh(solid.points[used], faces.reshape(-1, 3)), young=1e4, fixed="x < 0.1 mm")
    above = np.array([0.012, 0.01, 0.02])
    assert not body.is_behind_fixed(above, above - way)
    assert body.held("z < 0.1 mm").is_behind_fixed(above, above - way)


@pytest.mark.parametrize(("core", "anchored"), [("20 kPa", False), ("1 MPa", True)])
def test_a_stiff_part_that_is_fixed_counts_as_a_fixed_one(core: str, anchored: bool) -> None:
    """A surface of 4 kPa cannot be pressed into a core that is much stiffer, but moves a loose nodule."""
    solid = block((0.02, 0.02, 0.012), (4e-3, 4e-3, 1.5e-3))
    above, way = np.array([0.011, 0.009, 0.012]), np.array([0.0, 0.0, 0.005])
    skinned = bodies.build(solid, young=core, fixed="z < 0.1 mm", surface_layer="3 mm = 4 kPa", touch="z > 11.9 mm")
    assert skinned.is_behind_fixed(above, above - way) == anchored
    assert not skinned.is_behind_fixed(above, above - 0.4 * way)
    loose = bodies.build(solid, young=4e3, fixed="z < 0.1 mm", regions=f"box 4 4 3 to 16 16 9 mm = {core}")
    assert not loose.is_behind_fixed(above, above - way)


def test_the_depth_along_an_axis_is_the_way_to_the_surface_there(body: Body) -> None:
    random = np.random.default_rng(6)
    up, aside = np.array([0.0, 0.0, 1.0]), np.array([0.6, 0.0, 0.8])
    for _ in range(200):
        x, y, z = random.uniform([-0.005, -0.005, -0.005], [0.045, 0.045, 0.025])
        inside = 0.0 < x < 0.04 and 0.0 < y < 0.04 and 0.0 < z < TOP
        assert body.depth_along(np.array([x, y, z]), up) == pytest.approx(TOP - z if inside else 0.0)
        way = min((TOP - z) / 0.8, (0.04 - x) / 0.6) if inside else 0.0
        assert body.depth_along(np.array([x, y, z]), aside) == pytest.approx(way)


def test_a_tool_that_reaches_into_the_body_before_the_press_is_told_from_one_pushed_through(body: Body) -> None:
    tool = body.with_contact_points([[0.0, 0.0, 0.0], [5e-3, 0.0, -10e-3]])
    with pytest.raises(BodyError, match=r"contact_points: before the press a tip of the tool is already inside"):
        tool.indent(AT, 5e-3, 1e-3)


def test_a_press_whose_force_falls_with_the_depth_is_warned_of(body: Body) -> None:
    forces: list[float] = []
    falls: list[bool] = []
    for depth in np.arange(3.5e-3, 9e-3, 1e-4):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                forces.append(float(body.indent(AT, 4e-3, depth).force[2]))
            except BodyError:  # pushed through
                break
        told = [one for one in caught if "the force is largest at a depth of" in str(one.message)]
        assert all(one.filename == __file__ for one in told)
        falls.append(len(told) == 1)
    fallen = np.array(forces) / np.maximum.accumulate(forces)
    assert min(fallen) < 0.99
    assert not any(np.array(falls) & (fallen > 0.995))
    assert all(np.array(falls)[fallen < 0.985])


def test_sideways_displacement_counts_by_its_fraction(body: Body) -> None:
    """A smaller fraction is stiffer under an oblique sphere; the record of the model names it."""
    part = body.signed_distance(sideways_fraction=0.5)
    assert part.indent(AT, 6e-3, 5e-3).force[2] > 1.02 * body.indent(AT, 6e-3, 5e-3).force[2]
    assert "sideways_fraction 0.5" in str(part)
    for bad in (-0.1, 1.5):
        with pytest.raises(BodyError, match="sideways_fraction"):
            body.signed_distance(sideways_fraction=bad)


def test_friction_rises_to_the_cone_and_takes_work_on_a_closed_path(body: Body) -> None:
    """Dragged there and back: at most mu times the normal forces, and the tip works whenever the surface slips."""
    mu = 0.5
    rough = body.with_friction(mu)
    depth = np.concatenate([np.linspace(-5e-4, 2e-3, 300), np.full(1200, 2e-3), np.linspace(2e-3, -5e-4, 300)])
    way = np.concatenate([np.zeros(300), np.linspace(0.0, 2.5e-3, 600), np.linspace(2.5e-3, 0.0, 600), np.zeros(300)])
    path = np.stack([0.0203 + way, np.full(1800, 0.0196), TOP + 10e-3 - depth], axis=1)
    felt = rough.simulate_path(path, 10e-3)
    normal = (felt.force - felt.friction)[:, 2]
    assert (np.linalg.norm(felt.friction, axis=1) <= 1.1 * mu * normal).all()  # forces are tilted by the sphere's slope
    assert felt.friction[899, 0] == pytest.approx(-mu * normal[899], rel=0.06)
    work = path_work(felt, path)
    assert not felt.force[-1].any()
    assert work.sum() > 0.1 * np.abs(work).sum()
    assert (np.cumsum(work) > felt.energy[1:] - 1e-3 * felt.energy.max()).all()
    assert rough.indent(AT, 8e-3, 1e-3).force == pytest.approx(body.indent(AT, 8e-3, 1e-3).force, rel=1e-6)


def test_a_standard_linear_solid_relaxes_by_the_closed_form(body: Body) -> None:
    """Held at one depth: 1 + (ratio - 1) exp(-ratio t / retardation time), with the layer of the contact as well."""
    time, ratio = "0.2 s", 2.5
    solid = body.viscoelastic("1 ms", instantaneous_ratio=ratio, retardation_time=time, contact="signed_distance")
    elastic = body.simulate_path(np.array([[*AT[:2], TOP + 10e-3 - 1.5e-3]]), 10e-3).deflection[-1]
    still = np.tile([*AT[:2], TOP + 10e-3 - 1.5e-3], (1000, 1))
    history = solid.simulate_path(still, 10e-3)
    felt = history.force[:, 2]
    assert history.deflection[-1] == pytest.approx(elastic, rel=0.02, abs=1e-5)  # with the creep of the layer
    at_rest = body.indent(AT, 10e-3, 1.5e-3).force[2]
    t = 1e-3 * np.arange(1, 1001)
    assert felt == pytest.approx(at_rest * (1.0 + (ratio - 1.0) * np.exp(-ratio * t / 0.2)), rel=0.03)
    assert solid.indent(AT, 10e-3, 1.5e-3).force[2] == pytest.approx(at_rest, rel=1e-6)


def test_a_closed_path_over_a_solid_that_creeps_takes_work(body: Body) -> None:
    solid = body.viscoelastic("1 ms", instantaneous_ratio=2.5, retardation_time="0.2 s", contact="signed_distance")
    s = np.linspace(0.0, 2 * np.pi, 2001)
    lift = TOP + 6e-3 - 3e-3 * np.sin(s / 2) ** 2
    path = np.stack([0.02 + 12e-3 * np.cos(s), 0.02 + 12e-3 * np.sin(2 * s), lift], axis=1)
    felt = solid.simulate_path(path, 5e-3)
    work = path_work(felt, path)
    assert work.sum() > 0.05 * np.abs(work).sum()
    assert (np.cumsum(work) - felt.energy[1:]).min() > -1e-3 * felt.energy.max()


def test_a_contact_surface_that_does_not_match_is_refused(body: Body) -> None:
    vertices, triangles, node, modulus = body._contact_patches()
    arrays = body._arrays()
    none = (np.empty((0, 0), dtype=np.float32), np.empty(0))
    for wrong in ((vertices, triangles, node[1:], modulus), (vertices, triangles, node, modulus[1:])):
        with pytest.raises(ValueError, match="match"):
            _core.SignedDistanceBody(*arrays, *wrong, 0.45, *none)


def test_two_tips_share_one_body(body: Body) -> None:
    """The second tip pushes the surface away from the first; a tip that starts inside is lost and the other is not."""
    steps = np.linspace(0.0, 2e-3, 200)[:, None]
    down = np.array([0.0, 0.0, -1.0])
    one, two = np.array([0.015, 0.02, TOP + 5e-3]) + steps * down, np.array([0.025, 0.02, TOP + 5e-3]) + steps * down
    alone = body.simulate_path(one, 5e-3)
    both = body.simulate_tips(np.stack([one, two], axis=1), [5e-3, "5 mm"])
    assert 0.5 * alone.force[-1, 2] < both[0].force[-1, 2] < 0.97 * alone.force[-1, 2]
    assert both[0].energy[-1] == both[1].energy[-1] > alone.energy[-1]
    inside = np.tile([0.02, 0.02, 0.01], (200, 1))
    found = body.simulate_tips(np.stack([one, inside], axis=1), [5e-3, 2e-3])
    assert found[1].lost.all()
    assert found[0].force == pytest.approx(alone.force, rel=1e-6, abs=1e-9)
    lying = body.simulate_tips(one[:, None], [5e-3], segments=[[0.0, "8 mm", 0.0]])[0]
    assert lying.force[-1, 2] > 1.5 * alone.force[-1, 2]
    with pytest.raises(BodyError, match="signed distance"):
        Body(body.contents).simulate_tips(one[:, None], [5e-3])
    with pytest.raises(PoseError, match="1 to 8 tips"):
        body.simulate_tips(np.zeros((4, 9, 3)), [5e-3] * 9)


def test_displacement_and_pressure_are_those_of_the_last_tips_whether_one_or_several(body: Body) -> None:
    way = np.array([0.02, 0.02, TOP + 5e-3]) - np.linspace(0.0, 2e-3, 100)[:, None] * [0.0, 0.0, 1.0]
    beside = way + np.array([5e-3, 0.0, 0.0])
    body.simulate_path(way, 5e-3)
    alone, pressure = body.displacement(), body.pressure()
    two = body.simulate_tips(np.stack([way, beside], axis=1), [5e-3, 5e-3])
    normal_force = body.contents.areas @ body.pressure()
    assert normal_force == pytest.approx(sum(one.force[-1, 2] for one in two), rel=0.03)
    assert np.linalg.norm(body.displacement() - alone) > 0.3 * np.linalg.norm(alone)
    body.simulate_tips(way[:, None], [5e-3])
    np.testing.assert_allclose(body.displacement(), alone, atol=1e-5 * np.abs(alone).max())
    body.simulate_tips(np.stack([way, beside], axis=1), [5e-3, 5e-3])
    body.simulate_path(way, 5e-3)
    np.testing.assert_array_equal(body.displacement(), alone)
    np.testing.assert_array_equal(body.pressure(), pressure)


def test_a_tip_above_more_nodes_than_the_contact_has_is_named() -> None:
    fine = bodies.build(block((0.04, 0.04, 0.01), (2.4e-3, 2.4e-3, 5e-3)), young=10e3, fixed="z < 0.001 mm", order=1)
    assert len(fine.nodes) > 256
    with pytest.warns(BodyWarning, match="more than 256 nodes are near the tip"):
        fine.signed_distance().indent([0.02, 0.02, 0.01], 0.05, 1e-3, tip="flat")


def choice_of(lines: str) -> BodyChoice:
    """Return [object.body] of a scenario with a block and further lines."""
    text = f"""
        device.name = "phantom-premium-1.5a"
        start.pose = ["0 rad", "2.2305 rad", "3.2776 rad"]
        servo.period = "1 ms"
        reference.force = ["0 N", "0 N", "-0.1 N"]
        [object]
        kind = "body"
        [object.body]
        shape = "block"
        size = ["40 mm", "40 mm", "20 mm"]
        young = "10 kPa"
        spacing = "5 mm"
        radius = "8 mm"
        {lines}
        [run]
        duration = "0.1 s"
    """
    choice = Scenario.from_text(text, "press.toml", None).object.body
    assert choice is not None
    return choice


def test_a_scenario_takes_the_kind_and_the_contact() -> None:
    choice = choice_of('kind = "signed_distance"\nsideways_fraction = 0.65\nstatic_friction = 0.4')
    assert (choice.kind, choice.options) == ("signed_distance", {"sideways_fraction": 0.65, "static_friction": 0.4})
    choice = choice_of('kind = "modal"\nmodes = 20\ncontact = "signed_distance"')
    assert choice.contact == "signed_distance"
    with pytest.raises(PalpateError, match="contact has no meaning for mass_spring"):
        choice_of('kind = "mass_spring"\ncontact = "signed_distance"')


def test_tips_are_given_to_the_core_as_unit_axes_and_lengths(body: Body, monkeypatch: pytest.MonkeyPatch) -> None:
    """A sphere has an axis too, and the length 0."""
    asked: list[Any] = []
    rows = np.random.default_rng(0).uniform(1.0, 2.0, (4, 2, 15))
    rows[1, 0, 9], rows[2, 1, 9] = 0.0, 0.0  # not solved
    rows[:, :, 14] = 0.0

    class Core:
        def simulate_tips(self, *given: Any) -> np.ndarray:
            asked.append(given)
            return rows.copy()

    monkeypatch.setattr(body, "_signed_distance_core", lambda count, tool: asked.append(count) or Core())
    paths = np.random.default_rng(1).normal(size=(4, 2, 3))
    with pytest.warns(BodyWarning, match="the forces of 2 of 8 steps are not converged to 2 %"):
        found = body.simulate_tips(paths, [5e-3, "2 mm"], segments=[[0.0, "3 mm", "4 mm"], ["0 mm"] * 3])
    count, (centers, axes, radii, along) = asked
    assert count == 2
    np.testing.assert_array_equal(centers, paths)
    np.testing.assert_allclose(axes, [[0.0, 0.6, 0.8], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(radii, [5e-3, 2e-3])
    np.testing.assert_allclose(along, [5e-3, 0.0])
    for tip in range(2):
        np.testing.assert_array_equal(found[tip].force, rows[:, tip, :3])


def test_a_tip_that_is_none_is_refused(body: Body) -> None:
    path = np.zeros((4, 1, 3))
    for wrong in (np.zeros((4, 3)), np.zeros((4, 1, 2)), np.zeros((4, 0, 3))):
        with pytest.raises(PoseError, match=r"paths are \(m, tips, 3\) numbers in m of 1 to 8 tips; these have shape"):
            body.simulate_tips(wrong, [5e-3])
    with pytest.raises(PoseError, match=r"1 paths need 1 radii and segments, not 2 and \(1, 3\)"):
        body.simulate_tips(path, [5e-3, 5e-3])
    with pytest.raises(PoseError, match=r"1 paths need 1 radii and segments, not 1 and \(2, 3\)"):
        body.simulate_tips(path, [5e-3], segments=np.zeros((2, 3)))
    with pytest.raises(PoseError, match="paths"):
        body.simulate_tips(path * np.nan, [5e-3])
    with pytest.raises(PoseError, match="segments"):
        body.simulate_tips(path, [5e-3], segments=[[0.0, np.inf, 0.0]])
    with pytest.raises(BodyError, match="radii"):
        body.simulate_tips(path, [0.0])


@pytest.mark.parametrize("kind", ["viscoelastic", "modal"])
def test_a_relaxing_body_loses_no_energy_by_the_begin_or_end_of_contact(body: Body, kind: str) -> None:
    """A tip presses, lifts and presses again. Work less stored energy, that of the layer included, does not fall."""
    options = {"instantaneous_ratio": 2.5, "retardation_time": "0.3 s"}
    made = Body(body.contents)
    rest = made.viscoelastic("1 ms", contact="signed_distance", **options) if kind == "viscoelastic" else None
    rest = rest or made.modal("1 ms", rayleigh_beta="0.2 ms", contact="signed_distance", **options)
    t = np.arange(801) * 1e-3
    depth = 2.2e-3 * np.interp(t, [0.0, 0.1, 0.3, 0.34, 0.36, 0.46, 0.7, 0.8], [0.0, 1.0, 1.0, 0.0, 0.0, 0.6, 0.6, 0.0])
    path = np.stack([np.full_like(t, AT[0]), np.full_like(t, AT[1]), TOP + 6.2e-3 - depth], axis=1)
    felt = rest.simulate_path(path, "6 mm")
    begun = np.flatnonzero((felt.nodes[1:] > 0) != (felt.nodes[:-1] > 0))
    assert len(begun) == 4
    # A force that is constant over the period does its work at its end value in the theory of the models.
    lost = -(felt.force[1:] * np.diff(path, axis=0)).sum(axis=1) - np.diff(felt.energy)
    assert lost.min() > -1e-5 * felt.energy.max()
    assert felt.energy[350] > 0.02 * felt.energy.max()  # off the body, which has not recovered yet
