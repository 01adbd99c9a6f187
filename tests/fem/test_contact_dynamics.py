"""Bodies with inertia in contact by signed distance: moments of the reduced model, rest, energy, and convergence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.arrays import Array
from palpate.fem import Body, ContactHistory, block
from palpate.fem.elements import Elements
from palpate.fem.material import Material
from palpate.fem.selectors import half_space
from palpate.fem.vibration import _orthonormalize
from scipy import sparse
from scipy.sparse.linalg import splu

TOP, RADIUS, MODES = 0.02, 15e-3, 30
VOLUME = block((0.04, 0.04, TOP), 8e-3)
FIXED, TOUCH = half_space("z", "<", 1e-9), half_space("z", ">", TOP - 1e-9)


@pytest.fixture(scope="module")
def body() -> Body:
    return bodies.build(VOLUME, young=5e3, fixed=FIXED, touch=TOUCH, modes=MODES)


def tap(body: Body, period: float, modes: int = MODES, **damping: float) -> tuple[ContactHistory, Array]:
    """Return the contact during a tap of 2 mm and 20 ms, with the lowest modes only, and the path."""
    data = body.contents
    fewer = Body(replace(data, frequencies=data.frequencies[:modes], shapes=data.shapes[:, :modes]))
    t = np.arange(0.0, 25e-3, period)
    depth = np.where(t < 20e-3, 2e-3 * np.sin(np.pi * t / 20e-3), -1e-3)
    path = np.stack([np.full(len(t), 0.0203), np.full(len(t), 0.0196), TOP + RADIUS - depth], axis=1)
    return fewer.modal(period, contact="signed_distance", **damping).simulate_path(path, RADIUS), path


def test_modes_and_residual_vectors_have_the_moments_of_all_elements(body: Body) -> None:
    """Static compliance and the inertia's first correction to it: B' K^-1 B and B' K^-1 M K^-1 B."""
    elements = Elements(VOLUME, Material(5e3), [FIXED], TOUCH)
    free, data = elements.free, body.contents
    factor = splu(elements.stiffness[free][:, free].tocsc())
    load = sparse.kron(elements.load, sparse.eye(3)).tocsr()[free].toarray()
    static = factor.solve(load)
    squares = np.concatenate([data.frequencies, data.residual_frequencies]) ** 2
    shapes = np.hstack([data.shapes, data.residual_shapes]).astype(float)
    for expected, power in ((load.T @ static, 1), (static.T @ (elements.mass[free][:, free] @ static), 2)):
        found = (shapes / squares**power) @ shapes.T
        assert np.abs(found - expected).max() < 1e-5 * np.abs(expected).max()
        alone = (data.shapes / data.frequencies ** (2 * power)) @ data.shapes.T
        assert np.abs(alone - expected).max() > 1e-3 * np.abs(expected).max()


def test_a_held_tip_feels_the_static_force_in_the_end(body: Body) -> None:
    still = np.tile([0.0203, 0.0196, TOP + RADIUS - 1.5e-3], (1500, 1))
    moving = body.modal("1 ms", rayleigh_alpha=50.0, rayleigh_beta=2e-3, contact="signed_distance")
    static = body.signed_distance().indent([0.0203, 0.0196, TOP], RADIUS, 1.5e-3)
    assert moving.simulate_path(still, RADIUS).force[-1] == pytest.approx(static.force, rel=2e-3, abs=1e-5)
    assert moving.indent([0.0203, 0.0196, TOP], RADIUS, 1.5e-3).force == pytest.approx(static.force, rel=1e-6)
    solid = body.modal(
        "1 ms",
        rayleigh_alpha=50.0,
        rayleigh_beta=2e-3,
        instantaneous_ratio=2.0,
        retardation_time="50 ms",
        contact="signed_distance",
    )
    assert solid.simulate_path(still, RADIUS).force[-1] == pytest.approx(static.force, rel=5e-3, abs=1e-5)


def test_a_tap_does_not_depend_on_the_tick_nor_on_the_number_of_modes(body: Body) -> None:
    damping = {"rayleigh_alpha": 5.0, "rayleigh_beta": 2e-4}
    peak = tap(body, 0.25e-3, **damping)[0].force[:, 2].max()
    assert tap(body, 1e-3, **damping)[0].force[:, 2].max() == pytest.approx(peak, rel=0.03)
    assert tap(body, 0.125e-3, **damping)[0].force[:, 2].max() == pytest.approx(peak, rel=0.02)
    assert tap(body, 0.25e-3, 24, **damping)[0].force[:, 2].max() == pytest.approx(peak, rel=0.02)


@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_a_body_with_inertia_stores_no_more_than_the_tip_has_worked(body: Body, ratio: float) -> None:
    felt, path = tap(body, 0.05e-3, instantaneous_ratio=ratio, retardation_time=5e-3)
    work = np.cumsum(-(0.5 * (felt.force[1:] + felt.force[:-1]) * np.diff(path, axis=0)).sum(axis=1))
    assert not felt.force[-1].any()
    assert (work - felt.energy[1:]).min() > -0.01 * felt.energy.max()
    if ratio == 1.0:  # undamped: the work is in the body, but for the loss of the ticks
        assert felt.energy[-1] == pytest.approx(work[-1], abs=0.05 * felt.energy.max())
        assert felt.energy[-1] > 0.05 * felt.energy.max()


def test_modes_and_residual_vectors_are_orthonormal_where_the_loads_span_all_unknowns() -> None:
    """A body of few unknowns: more static responses than unknowns, most of them equal to rounding."""
    body = bodies.build(block((0.02, 0.02, 0.01), 0.01), young=5e3, fixed="z <= 0 mm", order=1, modes=5)
    frequencies = np.concatenate([body.contents.frequencies, body.contents.residual_frequencies])
    assert len(frequencies) <= 3 * 9  # unknowns: nine vertices at the top
    assert np.isfinite(frequencies).all()
    assert (np.diff(np.sort(frequencies)) > 0.0).all()
    assert body.contents.residual_frequencies.min() > body.contents.frequencies.max() * (1.0 - 1e-9)


@pytest.mark.parametrize("small", [1.0, 1e-9])
def test_vectors_of_rounding_are_no_part_of_an_orthonormal_basis(small: float) -> None:
    rng = np.random.default_rng(3)
    mass = sparse.diags(rng.uniform(0.1, 10.0, 30)).tocsr()
    basis = _orthonormalize(rng.standard_normal((30, 5)), np.empty((30, 0)), mass)
    own = rng.standard_normal((30, 4))
    given = np.hstack([own, small * own @ rng.standard_normal((4, 6)), basis[:, :2] + 1e-15 * own[:, :2]])
    found = _orthonormalize(given, basis, mass)
    assert found.shape == (30, 4)
    both = np.hstack([basis, found])
    np.testing.assert_allclose(both.T @ (mass @ both), np.eye(9), atol=1e-12)
    rest = own - both @ (both.T @ (mass @ own))
    assert np.linalg.norm(rest) < 1e-10 * np.linalg.norm(own)
    everything = _orthonormalize(rng.standard_normal((30, 40)), basis, mass)
    assert everything.shape == (30, 25)
    np.testing.assert_allclose(everything.T @ (mass @ everything), np.eye(25), atol=1e-12)
