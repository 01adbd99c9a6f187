"""A solid pressed through snapshots: its own compliance and energy, no energy out, two tips, a thread."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from nightly import NIGHTLY, some
from numpy.typing import NDArray
from palpate import fem as bodies
from palpate.errors import PoseError
from palpate.fem import BodyError, BodyWarning, HyperelasticModel, Law, Material, QuasiStaticSolver, block
from palpate.fem.checks import TipShape
from palpate.fem.quasi_static import _found, _history
from palpate.fem.selectors import half_space

Array = NDArray[np.float64]
ROOT = Path(__file__).parents[2]
BOTTOM, TOP = half_space("z", "<", 1e-9), half_space("z", ">", 0.03 - 1e-9)
VOLUME = block((0.04, 0.04, 0.03), 0.005)
MATERIAL = Material(8e3, 0.4)
RADIUS, UP = 8e-3, np.array([0.0, 0.0, 1.0])
MIDDLE = np.array([0.02, 0.02, 0.03])


def pressed(law: Law = "neo-hookean") -> QuasiStaticSolver:
    return QuasiStaticSolver(HyperelasticModel(VOLUME, MATERIAL, BOTTOM, TOP, law=law))


def centre(x: float, y: float, depth: float) -> Array:
    return np.array([x, y, 0.03 + RADIUS - depth])


@pytest.mark.parametrize("poisson", some([0.49, 0.3]))
def test_a_small_press_is_that_of_quadratic_elements(poisson: float) -> None:
    """A flat end, against linear elasticity on cells of half the size."""
    solid = QuasiStaticSolver(HyperelasticModel(VOLUME, Material(8e3, poisson), BOTTOM, TOP))
    fine = block((0.04, 0.04, 0.03), 0.0025)
    flat = bodies.build(fine, young=8e3, poisson=poisson, fixed=BOTTOM, touch=TOP)
    expected = flat.simulate_path([[0.02, 0.02, 0.03 - 2e-5]], 10e-3, outward=UP, tip="flat").force[0, 2]
    force, _ = solid.indent(MIDDLE, 10e-3, 2e-5, outward=UP, tip="flat")
    assert force[2] == pytest.approx(expected, rel=0.05)


def test_nodes_pass_the_edge_of_a_deep_flat_end_without_steps() -> None:
    """0.4 radii deep over 1.6 mm: at most half a percent of the force in 2.7 um."""
    body = bodies.build(VOLUME, young=8e3, poisson=0.45, fixed=BOTTOM, touch=TOP, order=1).hyperelastic(
        "1 ms", update_interval="1 ms"
    )
    down = np.linspace([0.0, 0.0, 0.0], [0.0, 0.0, -2e-3], 200)
    along = down[-1] + np.arange(1, 601)[:, None] * [2.5e-6, 0.9e-6, 0.0]
    path = np.array([0.017, 0.0183, 0.03]) + np.vstack([down, np.repeat(down[-1:], 50, axis=0), along])
    force = body.simulate_path(path, 5e-3, outward=UP, tip="flat").force[249:]
    steps = np.linalg.norm(np.diff(force, axis=0), axis=1)
    assert steps.max() < 0.005 * force[:, 2].min()
    assert np.ptp(force[:, 2]) < 0.1 * force[:, 2].min()


@pytest.mark.parametrize("law", ["neo-hookean", "corotational"])
def test_deep_presses_do_the_work_that_the_body_holds(law: Law) -> None:
    """A fifth of the height deep: the settled force is the slope of the settled energy."""
    body = pressed(law)
    held, felt = [], []
    for depth in (5.9e-3, 6e-3, 6.1e-3):
        force, _ = body.indent(MIDDLE, RADIUS, depth, outward=UP)
        felt.append(force[2])
        held.append(body.core.energy())
    assert felt[1] == pytest.approx((held[2] - held[0]) / 2e-4, rel=0.01)
    assert felt[0] < felt[1] < felt[2]


SLIM = block((0.02, 0.02, 0.03), 0.005)


@pytest.mark.parametrize("law", ["neo-hookean", "corotational"])
@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_a_column_that_stands_under_the_tip_only_is_pressed_by_a_quarter(law: Law, tip: TipShape) -> None:
    """Under the forces alone it would fall, so its exact tangent is no longer positive: at rest still.

    The force is that of the solid's own assembly; a sphere's is the slope of its energy (a flat end's edge stores some
    of its own); a body pressed in ticks feels the same.
    """
    solid = HyperelasticModel(SLIM, MATERIAL, BOTTOM, TOP, law=law)
    column, point, depths = QuasiStaticSolver(solid), [0.012, 0.01, 0.03], (7.7e-3, 8e-3, 8.3e-3)
    held = []
    for depth in depths:
        force, displacement = column.indent(point, RADIUS, depth, outward=UP, tip=tip)
        held.append(column.core.energy())
        assert force[2] == pytest.approx(-solid.evaluate(displacement).forces[:, 2].sum(), rel=0.02)
    middle, _ = column.indent(point, RADIUS, depths[1], outward=UP, tip=tip)
    if tip == "sphere":
        assert middle[2] == pytest.approx((held[2] - held[0]) / (depths[2] - depths[0]), rel=0.02)
    body = bodies.build(SLIM, young=8e3, poisson=0.4, fixed=BOTTOM, touch=TOP, order=1).hyperelastic("1 ms", law=law)
    assert body.indent(point, RADIUS, depths[1], tip=tip).force[2] == pytest.approx(middle[2], rel=0.02)


def test_a_press_through_which_the_tip_loses_the_body_is_refused() -> None:
    column = QuasiStaticSolver(HyperelasticModel(SLIM, MATERIAL, BOTTOM, TOP))
    with pytest.raises(BodyError, match=r"depth: at 15 mm .*in contact was at \d.* mm: use a smaller depth"):
        column.indent([0.01, 0.01, 0.03], RADIUS, 15e-3, outward=UP, tip="flat")
    slim = bodies.build(SLIM, young=8e3, poisson=0.4, fixed=BOTTOM, touch=TOP, order=1).hyperelastic("1 ms")
    with pytest.raises(BodyError, match=r"depth: at 20 mm .*in contact was at"):
        slim.indent([0.01, 0.01, 0.03], RADIUS, 20e-3, tip="flat")


def test_far_in_a_press_ends_at_rest_or_says_that_it_does_not() -> None:
    """A sphere deep into a small block: the slope of the solid's own energy, the same by every road, or a sentence."""
    low = block((0.04, 0.04, 0.02), 0.005)
    solid = QuasiStaticSolver(HyperelasticModel(low, MATERIAL, BOTTOM, half_space("z", ">", 0.02 - 1e-9)))
    body = bodies.build(low, young=8e3, poisson=0.4, fixed=BOTTOM, touch="z > 19.999 mm", order=1).hyperelastic("1 ms")
    top, held = [0.02, 0.02, 0.02], []
    for depth in (6.35e-3, 6.45e-3):
        solid.indent(top, RADIUS, depth, outward=UP)
        held.append(solid.core.energy())
    force = body.indent(top, RADIUS, 6.4e-3).force
    assert force[2] == pytest.approx((held[1] - held[0]) / 1e-4, rel=1e-3)
    assert solid.indent(top, RADIUS, 6.4e-3, outward=UP)[0] == pytest.approx(force, rel=1e-3, abs=1e-4 * force[2])
    for depth in ("14 mm", "15 mm", "16 mm"):
        with pytest.raises(BodyError, match=rf"depth: at {depth} .*in contact was at \d.* mm: use a smaller"):
            body.indent(top, RADIUS, depth)


def test_the_snapshots_compliance_is_that_of_the_tangent() -> None:
    """Under a deep press: against the inverse of the whole tangent; estimated farther out, and definite throughout."""
    body = pressed()
    _, displacement = body.indent(MIDDLE, RADIUS, 6e-3, outward=UP)
    names, normals, compliance, inner = body.core.local_model()
    solid = body.solid
    solid.evaluate(displacement)
    free = solid.elements.free
    k = np.empty((len(free), len(free)))
    for column, dof in enumerate(free):
        way = np.zeros(3 * len(solid.points))
        way[dof] = 1.0
        k[:, column] = np.asarray(solid.core.tangent(way.reshape(-1, 3))).ravel()[free]
    node = names[:, 0].astype(int)
    load = np.zeros((len(solid.points), 3, len(node)))
    load[solid.elements.contact_nodes[node], :, np.arange(len(node))] = -normals
    load = load.reshape(-1, len(node))[free]
    expected = load.T @ np.linalg.solve(0.5 * (k + k.T), load)
    assert np.abs(compliance - compliance.T).max() == 0.0
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    near = inner[:, 0] > 0
    assert near.sum() == 32
    assert len(names) == 81  # all of the top
    off = (compliance - expected) / scale
    assert np.abs(off[np.ix_(near, near)]).max() < 0.01
    own = np.diag(compliance) / np.diag(expected)
    assert (own[near] < 1 + 1e-5).all()  # what is left over makes it stiffer, never softer
    assert np.abs(off[np.ix_(~near, near)]).max() < 0.02
    outside = np.ix_(~near, ~near)
    assert np.sqrt((off[outside] ** 2).mean()) < 0.15
    assert own[~near].max() < 1.4  # at the edges of the top it is far too stiff
    assert np.linalg.eigvalsh(compliance / scale)[0] > 0


def wander(rng: np.random.Generator, ticks: int, tips: int = 1) -> Array:
    """Closed paths of sine sums that press, slide and leave; out of the body at both ends."""
    t = np.linspace(0, 2 * np.pi, ticks)[:, None]
    waves = np.arange(1, 4)
    path = np.zeros((ticks, tips, 3))
    for tip in range(tips):
        for axis in range(3):
            amplitude = rng.standard_normal(3) / waves * (5e-3 if axis < 2 else 2.5e-3)
            path[:, tip, axis] = np.sin(waves * t + rng.uniform(0, 6, 3)) @ amplitude
        path[:, tip] += [0.02 if tips == 1 else 0.012 + 0.016 * tip, 0.02, 0.03 + RADIUS - 3e-3]
    lift = 0.03 * (1 - np.sin(t[:, 0] / 2)) ** 2
    path[..., 2] += lift[:, None]
    return path


@pytest.mark.parametrize("tips", [1, 2])
def test_tips_never_get_out_more_than_they_put_in(tips: int) -> None:
    """Random closed paths at hand speed, slow steps of 20 ms: the account is the work, and never below zero."""
    rng = np.random.default_rng(tips)
    deepest = 0.0
    for law in ("neo-hookean", "corotational"):
        body = pressed(law)  # type: ignore[arg-type]
        for _ in range(3):
            body.reset()
            path = wander(rng, 6000, tips)
            felt = body.simulate_path(path, RADIUS, outward=UP, every=80)  # 0.25 ms each, for the sum's sake
            mean = 0.5 * (felt.force[1:] + felt.force[:-1])
            work = np.concatenate([[0.0], np.cumsum(-(mean * np.diff(path, axis=0)).sum(axis=(1, 2)))])
            most = felt.potential.max()
            assert most > 1e-4
            assert (felt.tank_energy >= 0).all()
            assert (felt.potential >= 0).all()
            assert work.min() > -0.01 * most
            assert work[-1] > -0.01 * most
            touching = felt.nodes.sum(axis=1) > 0
            began = np.flatnonzero(touching[1:] & ~touching[:-1])
            ended = np.flatnonzero(touching[:-1] & ~touching[1:])
            for a, b in zip(began, ended[ended > began[0]], strict=False):
                account = felt.potential[a : b + 1] + felt.tank_energy[a : b + 1]
                assert np.abs(work[a : b + 1] - work[a] - account).max() < 0.01 * most
            deepest = max(deepest, most)
    assert deepest > 5e-4


def test_two_tips_feel_each_other_and_add_up_where_presses_are_small() -> None:
    body = pressed()
    one, two = centre(0.01, 0.02, 3e-5), centre(0.03, 0.02, 3e-5)
    away = centre(0.03, 0.02, -5e-3)
    alone = body.core.settle(*ways(np.stack([one, away])), 30)[-1]
    body.reset()
    both = body.core.settle(*ways(np.stack([one, two])), 30)[-1]
    assert both[2] == pytest.approx(both[12], rel=0.02)  # mirror images, but for the way that the cells are cut
    assert both[2] < alone[2]  # the neighbour has pulled the surface down
    # A force on either moves the other.
    names, _, compliance, _ = body.core.local_model()
    at = body.solid.points[body.solid.elements.contact_nodes[names[:, 0].astype(int)]]
    i = int(np.argmin(np.linalg.norm(at[:, :2] - one[:2], axis=1)))
    j = int(np.argmin(np.linalg.norm(at[:, :2] - two[:2], axis=1)))
    assert 0.0 < compliance[i, j] < 0.5 * compliance[i, i]
    # Deep: the second tip, lowered beside the first, changes what the first feels.
    body.reset()
    deep = np.stack([centre(0.01, 0.02, 5e-3), away])
    before = body.core.settle(*ways(deep), 40)[-1, 2]
    after = body.core.settle(*ways(np.stack([deep[0], centre(0.03, 0.02, 5e-3)])), 40)[-1, 2]
    assert 0.5 * before < after < 0.99 * before


@pytest.mark.parametrize(("speed", "every"), [(0.2, 30), (0.4, 20), (0.4, 30)] if NIGHTLY else [(0.4, 30)])
def test_a_quick_tip_does_not_lose_the_surface(speed: float, every: int) -> None:
    """8 or 12 mm a slow step, over cells of 5 mm: nodes without columns carry it until the next snapshot."""
    volume = block((0.1, 0.04, 0.03), 0.005)
    body = QuasiStaticSolver(HyperelasticModel(volume, MATERIAL, BOTTOM, TOP))
    down = np.linspace(-1e-3, 4e-3, 160)
    along = np.arange(0.02, 0.08, speed * 1e-3)
    path = np.concatenate(
        [[centre(0.02, 0.02, d) for d in down], [centre(0.02, 0.02, 4e-3)] * 300,
         [centre(x, 0.02, 4e-3) for x in along], [centre(0.08, 0.02, 4e-3)] * 300]
    )  # fmt: skip
    force = body.simulate_path(path, RADIUS, outward=UP, every=every).force[:, 0, 2]
    slide = force[460 : 460 + len(along)]
    assert slide.min() > 0.75 * force[459]
    assert slide.max() < 1.6 * force[459]
    assert force[-1] == pytest.approx(force[459], rel=0.04)  # mirror images, but for the way that the cells are cut


def ways(tips: Array) -> tuple[Array, Array, Array, bool]:
    places = np.ascontiguousarray(tips[None])
    return places, np.ascontiguousarray(np.broadcast_to(UP, places.shape)), np.full(len(tips), RADIUS), False


def test_in_turn_is_the_same_each_time_and_ends_where_it_settles() -> None:
    depth = np.concatenate([np.linspace(-1e-3, 6e-3, 300), np.full(500, 6e-3)])
    path = np.array([centre(0.02, 0.021, d) for d in depth])
    body = pressed()
    felt = body.simulate_path(path, RADIUS, outward=UP)
    body.reset()
    again = body.simulate_path(path, RADIUS, outward=UP)
    assert np.array_equal(felt.force, again.force)
    settled, _ = body.indent([0.02, 0.021, 0.03], RADIUS, 6e-3, outward=UP)
    assert felt.force[-1, 0] == pytest.approx(settled, rel=0.01, abs=0.01 * settled[2])
    steps = np.abs(np.diff(felt.force[:, 0, 2]))
    assert steps.max() < 0.03 * settled[2]  # blended: a snapshot makes no step that is felt


def test_a_thread_of_its_own_brings_the_servo_to_the_same_force() -> None:
    depth = np.concatenate([np.linspace(-1e-3, 5e-3, 300), np.full(900, 5e-3)])
    path = np.array([centre(0.02, 0.02, d) for d in depth])
    body = pressed()
    live = body.simulate_realtime(path, RADIUS, outward=UP)
    settled, _ = body.indent(MIDDLE, RADIUS, 5e-3, outward=UP)
    assert live.touches.force[-1, 0, 2] == pytest.approx(settled[2], rel=0.03)
    assert len(live.steps) > 3
    assert len(live.ticks) == len(path)
    body.reset()
    still = body.simulate_realtime(path[50:100], RADIUS, outward=UP, thread=False)
    assert len(still.steps) == 0
    assert still.touches.force[-1, 0, 2] > 0.0  # the model of the body at rest is there before the first tick


def test_what_is_refused() -> None:
    solid = HyperelasticModel(VOLUME, MATERIAL, BOTTOM, TOP)
    with pytest.raises(BodyError, match="nodes_per_tip: 65 must be a whole number, from 4 to 64"):
        QuasiStaticSolver(solid, nodes_per_tip=65)
    body = QuasiStaticSolver(solid)
    with pytest.raises(PoseError, match="two tips"):
        body.simulate_path(np.zeros((5, 3, 3)), RADIUS, outward=UP)
    with pytest.raises(BodyError, match="radius: 0 m must be positive"):
        body.simulate_path(np.zeros((5, 3)), 0.0, outward=UP)
    with pytest.raises(BodyError, match="every: 0 must be"):
        body.simulate_path(np.zeros((5, 3)), RADIUS, outward=UP, every=0)
    with pytest.raises(BodyError, match='period: "0 s" must be positive'):
        body.simulate_realtime(np.zeros((5, 3)), RADIUS, outward=UP, period="0 s")


PAD = block((0.064, 0.064, 0.008), 0.004)
RADII = np.array([8e-3, 14e-3, 20e-3])


def test_a_tip_over_more_nodes_than_a_local_model_holds_is_refused() -> None:
    """A flat end of 30 mm has 176 nodes under it, a local model 128: its force would be too small."""
    body = QuasiStaticSolver(HyperelasticModel(PAD, MATERIAL, BOTTOM, half_space("z", ">", 0.008 - 1e-9)))
    middle = np.array([0.032, 0.032, 0.008])
    with pytest.raises(BodyError, match=r"depth: at 0\.4 mm more than 128 nodes lie under the tip: use a smaller tip"):
        body.indent(middle, 30e-3, 4e-4, outward=UP, tip="flat")
    body.reset()
    down = middle - np.outer(np.append(np.linspace(-1e-4, 4e-4, 100), np.full(60, 4e-4)), UP)
    with pytest.raises(BodyError, match=r"contact force was not found in \d+ of 160 ticks: too many nodes"):
        body.simulate_path(down, 30e-3, outward=UP, tip="flat")


def test_a_second_tip_whose_force_is_not_found_is_refused_too() -> None:
    rows = np.ones((3, 24))  # ten columns per tip, the last of which is 0 if the force was not found; then four
    assert _history(rows, 2).force.shape == (3, 2, 3)
    for tip in range(2):
        lost = rows.copy()
        lost[1, 10 * tip + 9] = 0.0
        assert _found(lost, 2).tolist() == [True, False, True]


def test_a_run_in_real_time_that_misses_forces_is_kept_and_warns() -> None:
    """176 nodes lie under the flat end: no force is found where it presses."""
    body = QuasiStaticSolver(HyperelasticModel(PAD, MATERIAL, BOTTOM, half_space("z", ">", 0.008 - 1e-9)))
    down = np.array([0.032, 0.032, 0.008]) - np.outer(np.append(np.linspace(-1e-4, 4e-4, 100), np.full(200, 4e-4)), UP)
    with pytest.warns(BodyWarning, match="the contact force was not found in") as warned:
        live = body.simulate_realtime(down, 30e-3, outward=UP, tip="flat")
    missing = int(np.count_nonzero(~live.found))
    assert live.found[:20].all()
    assert f"in {missing} of 300 ticks" in str(warned[0].message)
    assert missing > 20
    assert np.isfinite(live.touches.force).all()


def test_a_flat_end_on_a_pad_grows_between_that_on_a_half_space_and_its_area() -> None:
    """Up to the nodes that a local model holds: the force grows with the radius R by more than R and less than R^2."""
    body = QuasiStaticSolver(HyperelasticModel(PAD, MATERIAL, BOTTOM, half_space("z", ">", 0.008 - 1e-9)))
    middle, found = np.array([0.032, 0.032, 0.008]), []
    for radius in RADII:
        force, _ = body.indent(middle, radius, 4e-4, outward=UP, tip="flat")
        path = np.tile(middle - 4e-4 * UP, (200, 1))
        held = body.simulate_path(path, radius, outward=UP, tip="flat")
        assert held.force[-1, 0, 2] == pytest.approx(force[2], rel=1e-3)
        found.append(force[2])
    over_radius, over_area = np.array(found) / RADII, np.array(found) / RADII**2
    assert np.all(np.diff(over_radius) > 0.0)
    assert np.all(np.diff(over_area) < 0.0)


def test_a_body_that_collapses_gives_bounded_forces_no_energy_and_comes_back() -> None:
    """Half the block's height deep, where tetrahedra are inverted, and out again."""
    body = pressed("corotational")
    way = (np.linspace(-1e-3, 16e-3, 1200), np.full(200, 16e-3), np.linspace(16e-3, -1e-3, 1200), np.full(200, -1e-3))
    path = np.array([centre(0.02, 0.02, depth) for depth in np.concatenate(way)])
    rows = body.core.simulate_path(path[:, None], np.tile(UP, (len(path), 1, 1)), np.array([RADIUS]), False, 20)
    force, lost = rows[:, 2], np.flatnonzero(rows[:, 9] == 0.0)
    assert np.all(np.diff(lost[lost < 1400]) == 1)  # until the tip goes out again
    assert 0.008 < np.concatenate(way)[lost[0]] < 0.013
    assert force.max() < 1.6 * force[lost[0]]  # a linear model: the tip goes in by 60 % more
    work = np.append(0.0, np.cumsum(-0.5 * (force[1:] + force[:-1]) * np.diff(path[:, 2])))
    assert np.all(work - rows[:, 10] - rows[:, 11] > -1e-4 * work.max())
    assert rows[-1, 7] == 0
    again = body.core.simulate_path(path[:700, None], np.tile(UP, (700, 1, 1)), np.array([RADIUS]), False, 20)
    np.testing.assert_allclose(again[:, 2], force[:700], atol=0.02 * force[:700].max())


@pytest.mark.parametrize("source", ["hyperelastic_lanes.cpp", "local_contact_lanes.cpp", "body_lanes.cpp"])
def test_wide_code_of_bodies_is_shared_with_nothing(source: str) -> None:
    """The same templates are compiled for several widths of registers: each file's copy is its own."""
    names = shutil.which("nm")
    built = sorted(ROOT.glob(f"build/*/python/src/CMakeFiles/_core_lanes_[48].dir/**/{source}.o"))
    if names is None or not built:
        pytest.skip("needs nm and the object files that an editable install leaves in build/")
    for file in built:
        listing = subprocess.run([names, file], check=True, capture_output=True, text=True).stdout
        assert " T " in listing
        assert [line for line in listing.splitlines() if " W " in line or " u " in line] == []
