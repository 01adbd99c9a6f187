"""Contact by signed distance on bodies that bend much more than they are dented: energy, stiffness of a beam."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest
from nightly import some
from palpate import _core, fem
from palpate.fem import Body, block
from palpate.fem.checks import TipShape
from tip_work import largest_fall

LENGTH, WIDTH, HEIGHT, YOUNG = 0.06, 0.012, 0.012, 50e3
RADIUS, PERIOD = 6e-3, 1e-3


@pytest.fixture(scope="module")
def beam() -> Body:
    """Cantilever of 60 x 12 x 12 mm, 50 kPa, held at x = 0."""
    return fem.build(block((LENGTH, WIDTH, HEIGHT), 4e-3), young=YOUNG, fixed="x <= 0 mm")


@pytest.fixture(scope="module")
def soft_beam() -> Body:
    """Cantilever of 60 x 15 x 10 mm, 10 kPa, held at x = 0, with modes."""
    return fem.build(block((LENGTH, 0.015, 0.01), 2.5e-3), young=1e4, fixed="x <= 0 mm", modes=20)


def kind_of(body: Body, kind: str, friction: float) -> Body:
    """Return the body, static or relaxing, with contact by signed distance."""
    rub: dict[str, Any] = {"static_friction": friction} if friction else {}
    if kind == "elastic":
        return body.signed_distance(**rub)
    return body.viscoelastic(
        PERIOD, instantaneous_ratio=1.5, retardation_time="30 ms", contact="signed_distance", **rub
    )


def path_of(move: str) -> np.ndarray:
    """Return the centers (1200, 3) of a tip that presses by 2 mm, moves by hand and lifts, m."""
    t = np.arange(0.0, 1.2, PERIOD)
    depth = np.interp(t, [0.0, 0.3, 1.0, 1.2], [-0.2e-3, 2e-3, 2e-3, -0.2e-3])
    x, y = np.full_like(t, 0.8 * LENGTH), np.full_like(t, 0.5 * WIDTH + 0.3e-3)
    if move == "across":
        y = 0.5 * WIDTH + np.interp(t, [0.3, 0.6, 0.9], [0.0, 0.3, -0.3]) * WIDTH
    elif move == "along":
        x = np.interp(t, [0.3, 0.9], [0.4, 0.9]) * LENGTH
    elif move == "off the end":
        x = 0.8 * LENGTH + np.interp(t, [0.3, 0.9], [0.0, 0.2 * LENGTH + 1.2 * RADIUS])
    return np.stack([x, y, HEIGHT + RADIUS - depth], axis=1)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("kind", ["elastic", "viscoelastic"])
@pytest.mark.parametrize("move", ["press", "across", "along", "off the end"])
def test_every_force_is_found_and_work_less_stored_energy_does_not_fall(
    beam: Body, move: str, kind: str, friction: float
) -> None:
    path = path_of(move)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of forces that are not converged
        felt = kind_of(beam, kind, friction).simulate_path(path, RADIUS)
    assert felt.force[:, 2].max() > 2e-3
    assert largest_fall([felt], [path]) < 0.01 * felt.energy.max()


def test_the_force_is_that_of_a_cantilever(beam: Body) -> None:
    """Force over deflection at the place of contact, against bending and shear (Timoshenko 1921, shear factor 5/6)."""
    made = kind_of(beam, "elastic", 0.0)
    felt = made.simulate_path(path_of("press"), RADIUS)
    held = 600
    arm, area, inertia = 0.8 * LENGTH, WIDTH * HEIGHT, WIDTH * HEIGHT**3 / 12.0
    shear = YOUNG / (2.0 * 1.45)
    compliance = arm**3 / (3.0 * YOUNG * inertia) + arm / (5.0 / 6.0 * shear * area)
    np.testing.assert_allclose(felt.force[held, 2] * compliance, 2e-3, rtol=0.03)


@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_the_force_does_not_depend_on_the_registers_of_the_machine(
    monkeypatch: pytest.MonkeyPatch, beam: Body, tip: TipShape
) -> None:
    """The code for the narrowest and for the widest registers gives the same bits."""
    path = path_of("along") - [0.0, 0.0, RADIUS if tip == "flat" else 0.0]
    make, felt = _core.SignedDistanceBody, []

    class Narrow(_core.SignedDistanceBody):
        def __init__(self, *args: object, **options: object) -> None:
            super().__init__(*args, **options, lanes=2)

    for core in (make, Narrow):
        monkeypatch.setattr(_core, "SignedDistanceBody", core)
        made = kind_of(beam, "viscoelastic", 0.3)
        felt.append(made.simulate_path(path, RADIUS, tip=tip, outward=[0.0, 0.0, 1.0] if tip == "flat" else None))
    assert felt[0].force[:, 2].max() > 2e-3
    for name in ("force", "deflection", "energy"):
        np.testing.assert_array_equal(getattr(felt[0], name), getattr(felt[1], name))


@pytest.mark.parametrize("kind", ["elastic", "modal"])
def test_a_tip_above_a_corner_of_the_beam_is_not_lost(kind: str) -> None:
    """A swinging beam too leaves a tip whose center stays 3.5 mm and more above the top."""
    made = fem.build(block((LENGTH, WIDTH, HEIGHT), 4e-3), young=YOUNG, fixed="x <= 0 mm", modes=12)
    t = np.arange(0.0, 0.4, PERIOD)
    when = np.linspace(0.0, t[-1], 6)
    for seed in range(20):
        random = np.random.default_rng(seed)
        x, y, depth = (np.interp(t, when, random.uniform(*span, 6)) for span in ((57.5, 60.0), (0.5, 3.0), (-0.5, 2.5)))
        path = np.stack([1e-3 * x, 1e-3 * y, HEIGHT + RADIUS - 1e-3 * depth], axis=1)
        if kind == "modal":
            body = made.modal(PERIOD, rayleigh_alpha="20 1/s", contact="signed_distance", static_friction=0.3)
        else:
            body = kind_of(made, kind, 0.3)
        felt = body.simulate_path(path, RADIUS)
        assert felt.force.any()
        assert not felt.lost.any()


@pytest.mark.filterwarnings("ignore:the forces of")
@pytest.mark.parametrize("speed", some([0.15, 0.05]))
@pytest.mark.parametrize(
    ("kind", "part"),
    [("elastic", 0.25), ("elastic", 0.35), ("elastic", 0.5), ("modal", 0.35), ("relaxing modal", 0.35)],
)
def test_a_flat_end_that_breaks_away_is_not_lost(soft_beam: Body, kind: str, part: float, speed: float) -> None:
    """At 150 mm/s and a third of its radius deep it was lost in the first tick of the slide, and had no force.

    A beam with inertia swings away from the end, with which nothing drops through it either.
    """
    relax = {"instantaneous_ratio": 2.0, "retardation_time": "50 ms"} if kind == "relaxing modal" else {}
    swinging = soft_beam.modal(PERIOD, rayleigh_alpha=20.0, rayleigh_beta=1e-3, contact="signed_distance", **relax)
    for radius in (4e-3, 6e-3):
        depth = np.concatenate([np.linspace(-1e-4, part * radius, 100), np.full(50, part * radius)])
        press = np.stack([np.full_like(depth, 0.035), np.full_like(depth, 0.0075), 0.01 - depth], axis=1)
        slide = press[-1] + np.arange(1.0, 3e-3 / (speed * PERIOD) + 1.0)[:, None] * [speed * PERIOD, 0.0, 0.0]
        path = np.vstack([press, slide, np.repeat(slide[-1:], 50, axis=0)])
        for friction in (0.5, 2.0):
            body = soft_beam.signed_distance() if kind == "elastic" else swinging
            body = body.with_friction(friction, 0.8 * friction)
            felt = body.simulate_path(path, radius, tip="flat", outward=[0, 0, 1])
            assert not felt.lost.any()
            assert kind != "elastic" or felt.force[-1, 2] > 2e-4


@pytest.mark.filterwarnings("ignore:the forces of")
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_two_tips_that_pinch_the_beam_return_no_more_than_their_work(beam: Body, friction: float) -> None:
    """Random pinches, where the contact snaps; forces that are not found keep those of the last tick."""
    t = np.arange(0.0, 1.2, PERIOD)
    when = np.linspace(0.0, 1.2, 7)
    for seed in range(20):
        random = np.random.default_rng(seed)
        tips = []
        for side in (1.0, -1.0):
            x = np.interp(t, when, np.clip(random.uniform(25.0, 55.0) + random.uniform(-6.0, 6.0, 7), 5.0, 58.0))
            y = np.interp(t, when, random.uniform(2.0, 10.0, 7))
            depth = np.interp(t, when, [-0.3, *random.uniform(0.0, 2.5, 5), -0.3])
            z = 6.0 + side * (12.0 - depth)
            tips.append(1e-3 * np.stack([x, y, z], axis=1))
        felt = kind_of(beam, "elastic", friction).simulate_tips(np.stack(tips, axis=1), [RADIUS, RADIUS])
        assert felt[0].energy.max() > 2e-5
        assert largest_fall(felt, tips) < 0.05 * felt[0].energy.max()


@pytest.mark.parametrize("body", ["beam", "relaxing block"])
def test_no_node_is_in_contact_twice_and_a_path_repeats_its_forces(beam: Body, body: str) -> None:
    """A node that a look at the bent body had listed was listed again: its layer counted twice, and a force 6 % too
    large stayed."""
    if body == "beam":
        touched, low, high, top = beam.signed_distance(), [0.02, 0.004], [0.05, 0.008], HEIGHT
    else:
        relaxing = {"instantaneous_ratio": 5.0, "retardation_time": "50 ms", "contact": "signed_distance"}
        block_ = fem.build(block((0.06, 0.06, 0.025), 5e-3), young=20e3, fixed="z <= 0 mm", touch="z >= 25 mm")
        touched, low, high, top = block_.viscoelastic(PERIOD, **relaxing), [0.02, 0.02], [0.04, 0.04], 0.025
    rng = np.random.default_rng(3)
    for _ in range(60):
        radius = rng.uniform(4e-3, 8e-3)
        depth = rng.uniform(0.15, 0.4) * radius
        end = np.array([*rng.uniform(low, high), top + radius - depth])
        slide = np.linspace(1.0, 0.0, 100)[:, None] * np.append(rng.uniform(-5e-3, 5e-3, 2), 0.0)
        down = slide[0] + np.linspace(depth + 1e-3, 0.0, 100)[:, None] * [0.0, 0.0, 1.0]
        path = end + np.vstack([down, slide, np.zeros((50, 3))])
        first = touched.simulate_path(path, radius, outward=(0, 0, 1)).force
        nodes = touched.core.contact_forces()[0]
        assert len(np.unique(nodes)) == len(nodes)
        assert np.array_equal(touched.simulate_path(path, radius, outward=(0, 0, 1)).force, first)
