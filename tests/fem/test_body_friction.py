"""A tip that drags a body of finite elements along: friction against a dense solution, Coulomb's cone and energy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.fem import Body, BodyError, block
from scipy import sparse
from scipy.sparse.linalg import splu

TOP = 0.02
RADIUS = 8e-3


@pytest.fixture(scope="module")
def body() -> Body:
    """40 x 40 x 20 mm, bonded below, touched on its top."""
    volume = block((0.04, 0.04, TOP), (1 / 300, 1 / 300, 0.005))
    return bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="box 8 8 19.9 to 32 32 20.1 mm")


@pytest.fixture(scope="module")
def small() -> Body:
    """30 x 30 x 20 mm with cells of 5 mm and vibration modes, touched on its top."""
    volume = block((0.03, 0.03, TOP), 0.005)
    return bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="z > 19.99 mm", modes=20)


Rough = Callable[[Body, float, float], Body]
PERIOD = 1e-3
KINDS: dict[str, Rough] = {
    "compliance": lambda body, hold, slide: body.with_friction(hold, slide),
    "modal": lambda body, hold, slide: body.modal(
        PERIOD, rayleigh_alpha=100.0, rayleigh_beta=2e-3, static_friction=hold, dynamic_friction=slide
    ),
    "modal that creeps": lambda body, hold, slide: body.modal(
        PERIOD,
        rayleigh_alpha=100.0,
        rayleigh_beta=2e-3,
        instantaneous_ratio=2.0,
        retardation_time=0.02,
        static_friction=hold,
        dynamic_friction=slide,
    ),
    "viscoelastic": lambda body, hold, slide: body.viscoelastic(
        PERIOD, instantaneous_ratio=2.0, retardation_time=0.02, static_friction=hold, dynamic_friction=slide
    ),
    "mass_spring": lambda body, hold, slide: body.mass_spring(
        PERIOD, rayleigh_alpha=20.0, rayleigh_beta=2e-3, static_friction=hold, dynamic_friction=slide
    ),
}


def _drag(way: np.ndarray, depth: float = 1.5e-3) -> np.ndarray:
    return np.array([0.0195, 0.0203, TOP + RADIUS - depth]) + np.outer(way, [0.8, 0.6, 0.0])


def test_a_patch_that_sticks_is_the_dense_solution(body: Body) -> None:
    """Tangential forces that move all pressed nodes with the tip, by solving the whole compliance for them."""
    way = 1e-6
    felt = body.with_friction(100.0).simulate_path(_drag(np.r_[0.0, np.full(30, way)], 3e-3), RADIUS, outward=[0, 0, 1])
    body.simulate_path(_drag(np.array([way]), 3e-3), RADIUS, outward=[0, 0, 1])
    nodes, _ = body.core.contact_forces()
    unknown = np.stack([3 * nodes, 3 * nodes + 1], axis=1).ravel()
    part = body.compliance[np.ix_(unknown, unknown)].astype(float)
    forces = np.linalg.solve(part, np.tile([0.8 * way, 0.6 * way], len(nodes))).reshape(-1, 2)
    assert len(nodes) >= 5
    assert -felt.friction[-1, :2] == pytest.approx(forces.sum(axis=0), rel=1e-3)


def test_the_surface_goes_along_until_the_cone_and_its_displacement_is_that_of_all_forces(body: Body) -> None:
    rough = body.with_friction(0.8, 0.5)
    felt = rough.simulate_path(_drag(np.arange(0.0, 4e-3, 1e-5)), RADIUS, outward=[0, 0, 1])
    pressing = felt.force - felt.friction
    smooth = body.simulate_path(_drag(np.arange(0.0, 4e-3, 1e-5)), RADIUS, outward=[0, 0, 1])
    assert pressing[:, 2] == pytest.approx(smooth.force[:, 2], rel=1e-12)
    ratio = np.linalg.norm(felt.friction, axis=1) / pressing[:, 2]
    assert ratio.max() == pytest.approx(0.8, rel=0.01)
    assert ratio[-1] == pytest.approx(0.5, rel=1e-3)
    (nodes, forces), dragged = rough.core.contact_forces(), rough.core.friction_forces()
    load = np.zeros((len(body.nodes), 3))
    load[nodes] = dragged - forces[:, None] * body.normals[nodes]
    expected = (body.compliance.astype(float) @ load.ravel()).reshape(-1, 3)
    moved = rough.displacement()
    assert moved == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    assert (moved[nodes] @ [0.8, 0.6, 0.0] > 0.2e-3).all()
    assert felt.deflection[-1] @ [0.8, 0.6, 0.0] == pytest.approx(
        (forces / forces.sum()) @ moved[nodes] @ [0.8, 0.6, 0.0], rel=0.1
    )


def test_a_press_from_rest_has_no_friction_in_it(body: Body) -> None:
    at = ([0.02, 0.02, TOP], RADIUS, 1.5e-3)
    assert body.with_friction(0.5).indent(*at).force == pytest.approx(body.indent(*at).force, rel=1e-12)


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_rests_in_its_cones_breaks_away_and_slides(small: Body, name: str) -> None:
    """Coulomb: no node over its cone; the whole breaks away at the static coefficient and slides with the dynamic."""
    hold, slide = 0.8, 0.5
    rough = KINDS[name](small, hold, slide)
    rest, way = np.zeros(150), np.linspace(0.0, 6e-3, 1200)
    start = np.array([0.0125, 0.0143, TOP + RADIUS - 2e-3])
    path = start + np.outer(np.r_[rest, way], [0.8, 0.6, 0.0])
    rough.core.reset()
    felt, cones = [], []
    for part in np.array_split(path, 45):
        felt.append(rough.simulate_path(part, RADIUS, outward=[0, 0, 1], go_on=True))
        forces, dragged = rough.core.contact_forces()[1], rough.core.friction_forces()
        cones.append(np.linalg.norm(dragged, axis=1) / forces)
        assert np.abs(dragged[:, 2]).max() == 0.0
    assert max(cone.max() for cone in cones) <= hold * (1 + 1e-9)
    pressing = np.concatenate([f.force - f.friction for f in felt])[:, 2]
    friction = np.concatenate([f.friction for f in felt])
    ratio = np.linalg.norm(friction, axis=1)[100:] / pressing[100:]
    assert (ratio[:50] < 0.1).all()
    assert ratio.max() == pytest.approx(hold, rel=0.03)
    assert ratio[-1] == pytest.approx(slide, rel=2e-3)
    assert friction[-1] @ [-0.8, -0.6, 0.0] == pytest.approx(slide * pressing[-1], rel=2e-3)
    # Let go to rest where it is, it stays there, within the cones.
    held = rough.simulate_path(np.tile(path[-1], (400, 1)), RADIUS, outward=[0, 0, 1], go_on=True)
    assert held.friction[-1] == pytest.approx(held.friction[-2], rel=1e-3)
    assert np.linalg.norm(held.friction[-1]) <= hold * pressing[-1]


@pytest.mark.parametrize("name", ["modal", "modal that creeps", "viscoelastic"])
def test_dragged_slowly_kinds_with_a_memory_are_the_compliance(small: Body, name: str) -> None:
    """At 1 mm/s, far slower than masses swing or tissue creeps: the same friction, sticking, slipping, sliding."""
    way = np.r_[np.zeros(300), np.linspace(0.0, 4e-3, 4000)]
    path = np.array([0.0125, 0.0143, TOP + RADIUS - 2e-3]) + np.outer(way, [0.8, 0.6, 0.0])
    still = KINDS["compliance"](small, 0.6, 0.6).simulate_path(path, RADIUS, outward=[0, 0, 1])
    moving = KINDS[name](small, 0.6, 0.6).simulate_path(path, RADIUS, outward=[0, 0, 1])
    pressing = (still.force - still.friction)[300::100, 2]
    assert (moving.force - moving.friction)[300::100, 2] == pytest.approx(pressing, rel=0.02)
    one, other = (np.linalg.norm(felt.friction[300::100], axis=1) / pressing for felt in (still, moving))
    assert other == pytest.approx(one, abs=0.02)
    assert one[5] < 0.4
    assert one[-1] == pytest.approx(0.6, rel=1e-3)


def test_a_lattice_that_sticks_is_the_dense_solution_of_its_springs(small: Body) -> None:
    """Forces that move all pressed nodes sideways with the tip, and inwards by what it has sunk there."""
    rough, way = KINDS["mass_spring"](small, 100.0, 100.0), 2e-5
    path = np.tile([0.0125, 0.0143, TOP + 0.06 - 1e-3], (600, 1))
    path[300:, 0] += way
    felt = rough.simulate_path(path, 0.06, outward=[0, 0, 1])
    nodes, _ = rough.core.contact_forces()
    begin, vertices, shares = small._patches()
    load = sparse.csr_matrix((shares, vertices, begin), shape=(len(small.nodes), len(small.contents.vertices)))[nodes]
    free = np.flatnonzero(np.repeat(~small.contents.dirichlet, 3))
    full = sparse.kron(load, sparse.eye(3), format="csr")[:, free]
    yields = full @ splu(small.spring_network.matrix[free][:, free].tocsc()).solve(full.T.toarray())
    aside = small.nodes[nodes] - path[0]
    sunk = [np.sqrt(0.06**2 - (aside[:, 0] - x) ** 2 - aside[:, 1] ** 2) for x in (0.0, way)]
    moved = np.stack([np.full(len(nodes), way), np.zeros(len(nodes)), sunk[0] - sunk[1]], axis=1)
    forces = np.linalg.solve(yields, moved.ravel()).reshape(-1, 3)
    assert len(nodes) >= 4
    assert felt.nodes[299] == len(nodes)
    assert felt.friction[-1, 0] - felt.friction[299, 0] == pytest.approx(-forces[:, 0].sum(), rel=0.05)


def test_coefficients_that_cannot_be_are_refused(body: Body) -> None:
    for static, dynamic in ((-0.1, None), (0.3, 0.4), (np.nan, None), (np.inf, 0.2)):
        with pytest.raises(BodyError, match="_friction: "):
            body.with_friction(static, dynamic)
