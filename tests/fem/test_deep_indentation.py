"""A tip pushed through the surface: every kind of body goes on pressing back, and gives out no energy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.fem import Body, block
from palpate.fem.checks import TipShape
from palpate.fem.indentation import NODES

TOP, PERIOD = 0.02, 1e-3
TIPS: dict[TipShape, float] = {"sphere": 4e-3, "flat": 3e-3}
KINDS: dict[str, Callable[[Body], Body]] = {
    "compliance": lambda body: body,
    "compliance, rough": lambda body: body.with_friction(0.5),
    "modal": lambda body: body.modal(PERIOD, rayleigh_alpha=50.0, rayleigh_beta=2e-3),
    "modal, rough": lambda body: body.modal(PERIOD, rayleigh_alpha=50.0, rayleigh_beta=2e-3, static_friction=0.5),
    "viscoelastic": lambda body: body.viscoelastic(PERIOD, instantaneous_ratio=2.0, retardation_time=0.5),
    "mass_spring": lambda body: body.mass_spring(PERIOD, rayleigh_alpha=20.0, rayleigh_beta=2e-3),
}


@pytest.fixture(scope="module")
def body() -> Body:
    """40 x 40 x 20 mm, cells of 3.3 mm, bonded below, touched on its top."""
    volume = block((0.04, 0.04, TOP), (1 / 300, 1 / 300, 0.005))
    touch = "box 8 8 19.9 to 32 32 20.1 mm"
    return bodies.build(volume, young=10e3, poisson=0.4, fixed="z < 0.001 mm", touch=touch, modes=10, order=1)


@pytest.mark.parametrize("tip", TIPS)
@pytest.mark.parametrize("name", KINDS)
def test_force_grows_with_depth_for_three_radii_and_no_energy_comes_out(body: Body, name: str, tip: TipShape) -> None:
    """Down at 12 mm/s or less: inertia and creep only add to the force. Then up again, and clear of it.

    `simulate_path` would refuse the tetrahedra of the springs that are inverted from 1.5 radii on; a servo goes on.
    """
    kind, radius = KINDS[name](body), TIPS[tip]
    depth = np.linspace(0.0, 3.0 * radius, 1000)
    depth = np.r_[depth, depth[::-1], np.full(50, -radius)]
    path = np.array([0.0197, 0.0206, TOP + (radius if tip == "sphere" else 0.0)]) - np.outer(depth, [0, 0, 1])
    kind.core.reset()
    rows = kind.core.simulate_path(path, np.tile([0.0, 0.0, 1.0], (len(path), 1)), radius, tip == "flat")
    force = rows[:1000, 2]
    assert (np.diff(force[100:]) > 0).all()
    assert force[-1] > 1.5 * force[500] > 0
    work = -(rows[1:, :3] * np.diff(path, axis=0)).sum(axis=1)
    assert work.cumsum().min() > -1e-9
    assert rows[-1, NODES] == 0


@pytest.mark.parametrize("tip", TIPS)
def test_a_sphere_that_is_not_told_where_out_is_finds_it_by_what_it_presses(body: Body, tip: TipShape) -> None:
    radius = TIPS[tip]
    depth = np.linspace(-1e-3, 3.0 * radius, 400)
    path = np.array([0.0197, 0.0206, TOP + (radius if tip == "sphere" else 0.0)]) - np.outer(depth, [0, 0, 1])
    told = body.simulate_path(path, radius, outward=[0, 0, 1], tip=tip)
    if tip == "sphere":
        assert np.array_equal(body.simulate_path(path, radius, tip=tip).force, told.force)
    pressed = body.indent([0.0197, 0.0206, TOP], radius, 3.0 * radius, tip=tip)
    assert pressed.force == pytest.approx(told.force[-1], rel=1e-9, abs=1e-12)


def test_deep_in_it_a_tip_slides_and_comes_back_without_work(body: Body) -> None:
    """Closed paths at one to three radii, and at last out: nothing of what is exchanged is made or lost."""
    rng, t = np.random.default_rng(5), np.linspace(0.0, 2 * np.pi, 8001)
    for tip, radius in TIPS.items():
        for _ in range(4):
            waves = rng.normal(size=(3, 2)) @ np.stack([np.sin(t), np.sin(2 * t)])
            path = 1.5e-3 * waves.T + np.array([0.02, 0.02, TOP])
            path[:, 2] += (radius if tip == "sphere" else 0.0) + radius - 3.0 * radius * np.sin(t / 2)
            body.core.reset()
            felt = body.simulate_path(path, radius, outward=[0, 0, 1], tip=tip)
            work = -(0.5 * (felt.force[1:] + felt.force[:-1]) * np.diff(path, axis=0)).sum(axis=1)
            assert abs(work.sum()) < 1e-4 * np.abs(work).sum()
            assert not felt.nodes[[0, -1]].any()
            assert path[:, 2].min() < TOP - radius
            assert felt.nodes[4000] > 2
