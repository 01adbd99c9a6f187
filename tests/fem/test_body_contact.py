"""A rigid tip on a body: laws of contact on a body made of finite elements."""

from __future__ import annotations

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.errors import PoseError
from palpate.fem import Body, BodyError, BodyWarning, block
from palpate.fem.checks import TipShape

TOP = 0.02


@pytest.fixture(scope="module")
def body() -> Body:
    """40 x 40 x 20 mm, bonded below, touched on its top."""
    volume = block((0.04, 0.04, TOP), (1 / 300, 1 / 300, 0.005))
    return bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="box 8 8 19.9 to 32 32 20.1 mm")


def test_forces_and_displacements_keep_the_contact_conditions(body: Body) -> None:
    """No node is inside the tip, none is pulled, and the displacement is the compliance times the forces."""
    felt = body.indent([0.02, 0.02, TOP], "8 mm", "1.5 mm")
    nodes, forces = body.core.contact_forces()
    assert (forces > 0).all()
    assert len(nodes) >= 4
    below = np.hypot(*(body.nodes[:, :2] - 0.02).T)
    inside = below < 8e-3
    gap = TOP - 1.5e-3 + 8e-3 - np.sqrt(8e-3**2 - below[inside] ** 2) - (body.nodes + felt.displacement)[inside, 2]
    assert gap.min() > -1e-8
    assert felt.force[2] == pytest.approx(forces.sum(), rel=1e-12)
    load = np.zeros((len(body.nodes), 3))
    load[nodes] = -forces[:, None] * body.normals[nodes]
    expected = (body.compliance.astype(float) @ load.ravel()).reshape(-1, 3)
    assert felt.displacement == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_a_flat_end_smaller_than_a_patch_at_its_middle_has_the_normal_force_beside_it(body: Body) -> None:
    """Exactly over a node the end has no direction to the node, whose force was not a number."""
    node = body.nodes[np.argmin(np.linalg.norm(body.nodes - body.nodes.mean(axis=0), axis=1))]
    for kind in (body, body.with_friction(0.3), body.viscoelastic("1 ms", instantaneous_ratio=2, retardation_time=0.1)):
        with pytest.warns(BodyWarning):
            at, beside = (kind.indent(node + step, 1e-3, 2e-4, tip="flat") for step in (np.zeros(3), [1e-7, 0.0, 0.0]))
        assert at.nodes == beside.nodes == 1
        assert at.force == pytest.approx([0.0, 0.0, beside.force[2]], rel=1e-3, abs=1e-9)


def test_a_flat_end_stiffens_in_proportion_to_youngs_modulus_and_not_with_depth(body: Body) -> None:
    stiffness = [body.indent([0.02, 0.02, TOP], 5e-3, d, tip="flat").force[2] / d for d in (0.5e-3, 2e-3)]
    assert stiffness[0] == pytest.approx(stiffness[1], rel=1e-9)
    softer = bodies.build(block((0.04, 0.04, TOP), 0.01), young=5e3, fixed="z < 0.001 mm", touch="z > 19.9 mm")
    stiffer = bodies.build(block((0.04, 0.04, TOP), 0.01), young=15e3, fixed="z < 0.001 mm", touch="z > 19.9 mm")
    at = ([0.02, 0.02, TOP], 15e-3, 1e-3)
    assert stiffer.indent(*at, tip="flat").force[2] == pytest.approx(
        3 * softer.indent(*at, tip="flat").force[2], rel=1e-5
    )


@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_no_closed_path_of_the_tip_gives_work(body: Body, tip: TipShape) -> None:
    """Random smooth loops that press, slide, lift off and come back: net work is nothing of what is exchanged."""
    rng = np.random.default_rng(11)
    t = np.linspace(0.0, 2 * np.pi, 16001)
    for _ in range(20):
        waves = [rng.normal(size=2) @ [np.sin(k * t), np.cos(k * t)] / k for k in (1, 2, 3) for _ in range(3)]
        path = np.stack([sum(waves[i::3]) for i in range(3)], axis=1) * [1.5e-3, 1.5e-3, 0.8e-3]
        path += [0.02, 0.02, TOP - 1e-3 + (6e-3 if tip == "sphere" else 0.0)]
        felt = body.simulate_path(path, 6e-3, outward=[0, 0, 1], tip=tip)
        work = -(0.5 * (felt.force[1:] + felt.force[:-1]) * np.diff(path, axis=0)).sum(axis=1)
        assert abs(work.sum()) < 2e-5 * np.abs(work).sum()
        assert felt.nodes.max() >= 3


def test_force_has_no_step_where_nodes_come_and_go(body: Body) -> None:
    """A slide at constant depth, 1 um a tick: the force moves by what the path allows, for a flat end's edge too."""
    along = np.arange(0.014, 0.026, 1e-6)
    for tip, top, most in (("sphere", 6e-3, 0.02), ("flat", 0.0, 0.02)):
        path = np.stack([along, np.full_like(along, 0.0207), np.full_like(along, TOP - 1e-3 + top)], axis=1)
        felt = body.simulate_path(path, 6e-3, outward=[0, 0, 1], tip=tip)  # type: ignore[arg-type]
        assert np.abs(np.diff(felt.force, axis=0)).max() < most * 1e-1 * np.linalg.norm(felt.force, axis=1).max()
        assert np.diff(felt.nodes).any()


def test_what_cannot_be_pressed_is_refused(body: Body) -> None:
    with pytest.raises(PoseError, match="three finite numbers"):
        body.indent([0.0, np.nan, 0.0], 5e-3, 1e-3)
    with pytest.raises(BodyError, match="radius: 0 m must be positive"):
        body.indent([0.02, 0.02, TOP], 0.0, 1e-3)
    with pytest.raises(BodyError, match="length"):
        body.indent([0.02, 0.02, TOP], "5 kPa", 1e-3)
    with pytest.raises(BodyError, match="points are in m"):
        body.indent([20.0, 20.0, 1e3 * TOP], 5e-3, 1e-3)
    with pytest.raises(BodyError, match="not 'cone'"):
        body.indent([0.02, 0.02, TOP], 5e-3, 1e-3, tip="cone")  # type: ignore[arg-type]
    with pytest.raises(BodyError, match="points out of the body"):
        body.indent([0.02, 0.02, TOP], 5e-3, -1e-3)


def test_a_tip_that_does_not_go_in_feels_nothing(body: Body) -> None:
    """The force rises from zero: none at zero depth, nor above the surface, and nothing moves."""
    touching = body.indent([0.02, 0.02, TOP], 5e-3, 0.0)
    assert not touching.force.any()
    assert not touching.displacement.any()
    assert not body.simulate_path([[0.02, 0.02, TOP + 6e-3]], 5e-3).force.any()
    assert not body.displacement().any()
