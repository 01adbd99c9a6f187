"""Tips that touch a beam where other forces have bent it to, far from its place at rest."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from palpate import fem
from palpate.fem import Body, ContactHistory, block

LENGTH, WIDTH, HEIGHT, YOUNG = 0.06, 0.012, 0.012, 50e3
RADIUS, PERIOD = 3e-3, 1e-3
BENT = 7e-3  # depth of the first tip at x = 55 mm


@pytest.fixture(scope="module")
def beam() -> Body:
    """Cantilever of 60 x 12 x 12 mm, 50 kPa, held at x = 0."""
    return fem.build(block((LENGTH, WIDTH, HEIGHT), 3e-3), young=YOUNG, fixed="x <= 0 mm", modes=12)


def ramp(times: list[float], values: list[float], count: int = 2000) -> np.ndarray:
    """Return a quantity (count,) that passes through values at shares of the time."""
    return np.interp(np.linspace(0.0, 1.0, count), times, values)


def at(x: float, z: np.ndarray) -> np.ndarray:
    """Return centers (m, 3) in the beam's middle plane, m."""
    return np.stack([np.full_like(z, x), np.full_like(z, 0.5 * WIDTH), z], axis=1)


def press(times: list[float]) -> np.ndarray:
    """Return the path of the first tip, which bends the beam between two shares of the time."""
    return at(0.055, HEIGHT + RADIUS - ramp(times, [-0.5e-3, BENT]))


def felt_by(body: Body, *paths: np.ndarray) -> list[ContactHistory]:
    """Return the contact of the tips; every force is found, no contact is lost."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        felt = body.simulate_tips(np.stack(paths, axis=1), [RADIUS] * len(paths))
    assert not any(one.lost.any() for one in felt)
    return felt


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_a_beam_pressed_onto_a_tip_rests_on_it_as_if_the_tip_had_come_last(beam: Body, friction: float) -> None:
    """A tip 2 mm below the beam at rest, and one that comes from below when the beam is bent, prop it alike."""
    body = beam.signed_distance(static_friction=friction) if friction else beam.signed_distance()
    below = -RADIUS - 2e-3
    first = felt_by(body, press([0.0, 0.9]), at(0.045, ramp([0.0, 1.0], [below, below])))
    last = felt_by(body, press([0.0, 0.4]), at(0.045, ramp([0.4, 0.9], [below - 10e-3, below])))
    assert not first[1].force[:600].any()
    assert first[1].force[-1, 2] < -0.02
    if friction == 0.0:
        for one, other in zip(first, last, strict=True):
            np.testing.assert_allclose(other.force[-1], one.force[-1], atol=2e-3 * np.linalg.norm(one.force[-1]))
    else:
        np.testing.assert_allclose(last[1].force[-1, 2], first[1].force[-1, 2], rtol=0.2)


def test_a_second_tip_meets_the_bent_beam_at_its_deflection(beam: Body) -> None:
    """Deflection beside the force of a cantilever, bending and shear: Timoshenko 1921, shear factor 5/6."""
    arm, x = 0.055, 0.035
    area, inertia, shear = WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12.0, YOUNG / (2.0 * 1.45)
    slip = 1.0 / (5.0 / 6.0 * shear * area)
    under = arm**3 / (3.0 * YOUNG * inertia) + arm * slip
    beside = x**2 * (3.0 * arm - x) / (6.0 * YOUNG * inertia) + x * slip
    depth = ramp([0.5, 1.0], [-1e-3, 6e-3])
    felt = felt_by(beam.signed_distance(), press([0.0, 0.4]), at(x, HEIGHT + RADIUS - depth))
    touched = np.flatnonzero(felt[1].force[:, 2] > 0.0)
    np.testing.assert_allclose(depth[touched[0]], BENT * beside / under, rtol=0.1)
    assert (felt[1].force[touched[0] :, 2] > 0.0).all()


def test_a_released_beam_swings_against_a_tip_above_it(beam: Body) -> None:
    """Energy never exceeds the work of the tips on the beam."""
    t = PERIOD * np.arange(2000)
    body = beam.modal(PERIOD, rayleigh_alpha="5 1/s", contact="signed_distance")
    up = ramp([0.0, 0.5, 0.505, 1.0], [-0.5e-3, BENT, -15e-3, -15e-3])
    first = at(0.055, HEIGHT + RADIUS - up)
    above = at(0.045, np.full_like(t, HEIGHT + RADIUS + 2e-3))
    felt = felt_by(body, first, above)
    assert not felt[1].force[:1000].any()
    hits = felt[1].force[1000:, 2]
    assert hits.max() > 5e-3
    assert hits.min() >= 0.0
    assert felt[0].energy[1100:].max() < felt[0].energy[:1000].max()
