"""A tip that drags a body of finite elements along: friction against a dense solution, Coulomb's cone and energy."""

from __future__ import annotations

import numpy as np
import pytest
from palpate import bodies
from palpate.bodies import Body, BodyError, block

TOP = 0.02
RADIUS = 8e-3


@pytest.fixture(scope="module")
def body() -> Body:
    """40 x 40 x 20 mm, bonded below, touched on its top."""
    volume = block((0.04, 0.04, TOP), (1 / 300, 1 / 300, 0.005))
    return bodies.build(volume, young=10e3, fixed="z < 0.001 mm", touch="box 8 8 19.9 to 32 32 20.1 mm")


def _drag(way: np.ndarray, depth: float = 1.5e-3) -> np.ndarray:
    return np.array([0.0195, 0.0203, TOP + RADIUS - depth]) + np.outer(way, [0.8, 0.6, 0.0])


def test_a_patch_that_sticks_is_the_dense_solution(body: Body) -> None:
    """Tangential forces that move all pressed nodes with the tip, by solving the whole compliance for them."""
    way = 1e-6
    felt = body.rough(100.0).follow(_drag(np.r_[0.0, np.full(30, way)], 3e-3), RADIUS, outward=[0, 0, 1])
    body.follow(_drag(np.array([way]), 3e-3), RADIUS, outward=[0, 0, 1])
    nodes, _ = body.core.pressed()
    unknown = np.stack([3 * nodes, 3 * nodes + 1], axis=1).ravel()
    part = body.compliance[np.ix_(unknown, unknown)].astype(float)
    forces = np.linalg.solve(part, np.tile([0.8 * way, 0.6 * way], len(nodes))).reshape(-1, 2)
    assert len(nodes) >= 5
    assert -felt.friction[-1, :2] == pytest.approx(forces.sum(axis=0), rel=1e-3)


def test_the_surface_goes_along_until_the_cone_and_its_displacement_is_that_of_all_forces(body: Body) -> None:
    rough = body.rough(0.8, 0.5)
    felt = rough.follow(_drag(np.arange(0.0, 4e-3, 1e-5)), RADIUS, outward=[0, 0, 1])
    pressing = felt.force - felt.friction
    smooth = body.follow(_drag(np.arange(0.0, 4e-3, 1e-5)), RADIUS, outward=[0, 0, 1])
    assert pressing[:, 2] == pytest.approx(smooth.force[:, 2], rel=1e-12)
    ratio = np.linalg.norm(felt.friction, axis=1) / pressing[:, 2]
    assert ratio.max() == pytest.approx(0.8, rel=0.01)
    assert ratio[-1] == pytest.approx(0.5, rel=1e-3)
    (nodes, forces), dragged = rough.core.pressed(), rough.core.dragged()
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
    assert body.rough(0.5).press(*at).force == pytest.approx(body.press(*at).force, rel=1e-12)


def test_coefficients_that_cannot_be_are_refused(body: Body) -> None:
    for static, dynamic in ((-0.1, None), (0.3, 0.4), (np.nan, None), (np.inf, 0.2)):
        with pytest.raises(BodyError, match="coefficients of friction"):
            body.rough(static, dynamic)
