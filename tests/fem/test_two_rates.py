"""Linear bodies at two rates: against the same bodies at one rate."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from palpate import fem as bodies
from palpate.fem import Body, BodyError, block
from palpate.fem.checks import TipShape

RADIUS, TOP = 8e-3, 0.015
Make = Callable[..., Body]
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "viscoelastic": ("viscoelastic", {"instantaneous_ratio": 3.0, "retardation_time": "50 ms"}),
    "modal": ("modal", {"rayleigh_beta": "3 ms"}),
    "viscoelastic modes": (
        "modal",
        {"rayleigh_beta": "3 ms", "instantaneous_ratio": 2.0, "retardation_time": "50 ms"},
    ),
    "mass_spring": ("mass_spring", {"rayleigh_beta": "4 ms", "rayleigh_alpha": "10 1/s"}),
    "hardening springs": (
        "mass_spring",
        {"rayleigh_beta": "4 ms", "rayleigh_alpha": "10 1/s", "hardening_strain": 0.1},
    ),
}
every = pytest.mark.parametrize("kind", KINDS)


@pytest.fixture(scope="module")
def body() -> Body:
    volume = block((0.03, 0.03, TOP), 0.005)
    return bodies.build(
        volume, young=5e3, poisson=0.45, fixed="z <= 0 mm", touch=f"z >= {1e3 * TOP - 1e-6} mm", modes=20, order=1
    )


def made(body: Body, kind: str, **more: Any) -> Body:
    name, options = KINDS[kind]
    one: Body = getattr(body, name)("1 ms", **options, **more)
    return one


def path(ticks: int, depth: float = 2e-3, side: float = 1e-3, rest: int = 0) -> np.ndarray:
    """Press in and move to the side within `ticks`, then rest."""
    s = np.minimum(np.arange(ticks + rest) / ticks, 1.0)
    return np.stack(
        [0.0151 + side * s, 0.0148 - 0.5 * side * s, TOP + RADIUS - depth * np.sin(0.5 * np.pi * s)], axis=1
    )


@every
@pytest.mark.parametrize("tip", ["sphere", "flat"])
@pytest.mark.parametrize("interval", ["5 ms", "20 ms"])
def test_at_rest_the_force_is_that_of_one_rate(body: Body, kind: str, tip: TipShape, interval: str) -> None:
    """Both rates have the same equilibrium; 0.1 % is the motion that is left after 1.5 s."""
    way = path(200, rest=1500)
    if tip == "flat":
        way[:, 2] -= RADIUS
    one = made(body, kind).simulate_path(way, RADIUS, tip=tip, outward=[0, 0, 1]).force[-1]
    two = made(body, kind, update_interval=interval).simulate_path(way, RADIUS, tip=tip, outward=[0, 0, 1]).force[-1]
    assert np.linalg.norm(one) > 0.05
    across = 1e-3 if tip == "sphere" else 2e-2  # a local model does not divide what it holds by the coverage
    assert abs(two - one)[2] < 1e-3 * np.linalg.norm(one)
    assert np.linalg.norm(two - one) < across * np.linalg.norm(one)


@every
def test_a_flat_end_that_slides_is_pushed_aside_no_more_than_at_one_rate(body: Body, kind: str) -> None:
    """Nothing that a local model holds is divided by a coverage that shrinks meanwhile."""
    t = np.arange(1400) * 1e-3
    aside = np.interp(t, [0.5, 0.8], [0.0, 1.0])
    way = np.stack(
        [0.016 - 4e-3 * aside, 0.014 + 2e-3 * aside, TOP + np.interp(t, [0.0, 0.1], [1e-3, -1.5e-3])], axis=1
    )
    one, two = (
        made(body, kind, **more).simulate_path(way, RADIUS, tip="flat", outward=[0, 0, 1]).force[500:]
        for more in ({}, {"update_interval": "20 ms"})
    )
    assert np.linalg.norm(two - one, axis=1).max() < 0.15 * np.linalg.norm(one, axis=1).max()


@every
def test_an_interval_of_a_tick_is_one_rate(body: Body, kind: str) -> None:
    way = path(300)
    one = made(body, kind).simulate_path(way, RADIUS).force
    two = made(body, kind, update_interval="1 ms").simulate_path(way, RADIUS).force
    np.testing.assert_allclose(two, one, atol=5e-5 * np.abs(one).max())


@every
def test_an_indentation_is_that_of_one_rate(body: Body, kind: str) -> None:
    point = (0.015, 0.015, TOP)
    one = made(body, kind).indent(point, RADIUS, "2 mm").force
    two = made(body, kind, update_interval="10 ms").indent(point, RADIUS, "2 mm").force
    np.testing.assert_array_equal(one, two)


@every
def test_repeated_runs_are_identical(body: Body, kind: str) -> None:
    one, two = (made(body, kind, update_interval="20 ms") for _ in range(2))
    first = one.simulate_path(path(300), RADIUS).force
    np.testing.assert_array_equal(first, two.simulate_path(path(300), RADIUS).force)
    one.core.reset()
    np.testing.assert_array_equal(first, one.simulate_path(path(300), RADIUS).force)


@every
def test_friction_at_rest_is_near_that_of_one_rate(body: Body, kind: str) -> None:
    """A sticking tip is dragged 0.5 mm: the same static compliance, but full patches and no memory across.

    At one rate the pressed springs also move their nodes sideways.
    """
    rub = {"static_friction": 0.8, "dynamic_friction": 0.6}
    way = np.concatenate([path(200, side=0.0, rest=100), path(200, side=0.0, rest=700)[-700:]])
    way[300:, 0] += 0.5e-3 * np.minimum(np.arange(len(way) - 300) / 100, 1.0)
    one = made(body, kind, **rub).simulate_path(way, RADIUS)
    two = made(body, kind, update_interval="20 ms", **rub).simulate_path(way, RADIUS)
    assert np.linalg.norm(one.friction[-1]) > 0.01
    allowed = (0.15 if "spring" in kind else 0.1) * np.linalg.norm(one.friction[-1])
    assert np.linalg.norm(two.friction[-1] - one.friction[-1]) < allowed


def test_the_static_compliance_of_springs_is_their_displacement_at_rest(body: Body) -> None:
    """Across the normals too: the tip presses a single node, by a small force, until the model rests."""
    springs = made(body, "mass_spring", update_interval="20 ms", static_friction=0.5)
    compliance = springs._network_compliance()
    one = made(body, "mass_spring")
    node = int(np.argmin(np.linalg.norm(one.nodes - [0.015, 0.015, TOP], axis=1)))
    tip = one.nodes[node] + [0.0, 0.0, RADIUS - 1e-6]
    force = one.simulate_path(np.tile(tip, (4000, 1)), RADIUS).force[-1]
    nodes, forces = one.core.contact_forces()
    assert nodes.tolist() == [node]
    moved = compliance[:, 3 * node + 2].reshape(-1, 3) * -forces[0]
    found = np.array(one.core.displacement())
    np.testing.assert_allclose(found, moved, atol=2e-3 * np.abs(moved).max())
    assert force[2] == pytest.approx(forces[0])
    assert np.abs(moved[:, :2]).max() > 0.01 * np.abs(moved).max()


def test_a_static_body_has_nothing_to_update(body: Body) -> None:
    way = path(100)
    one = body.signed_distance("1 ms").simulate_path(way, RADIUS).force
    two = body.signed_distance("1 ms", update_interval="20 ms").simulate_path(way, RADIUS).force
    np.testing.assert_array_equal(one, two)


def test_combinations_that_are_not_offered_say_so(body: Body) -> None:
    with pytest.raises(BodyError, match="update_interval: it lasts one tick"):
        body.mass_spring("1 ms", update_interval="0.2 ms")
    for kind in ("modal", "viscoelastic"):
        with pytest.raises(BodyError, match="update_interval: a body with a state and contact"):
            made(body, kind, contact="signed_distance", update_interval="20 ms")
    made(body, "modal").with_friction(0.3)
    two = made(body, "modal", update_interval="20 ms")
    assert "update_interval 20 ms" in str(two.kind)
    assert two.with_friction(0.3).update_ticks == (20,)


def errors_over_speed(body: Body, kind: str | None, interval: int, speed: float) -> dict[str, float]:
    """Return rms errors of the force of a tip that moves at up to `speed`, m/s, relative to the rms force.

    "hold" keeps the force of the last update, and "linear" adds the tangent stiffness of the static contact there times
    the motion since (Cavusoglu & Tendick 2000). Both become known an interval after the position that they use, like
    the local models of "two rates".
    """
    swing = 2e-3
    phase = np.arange(2000) * 1e-3 * speed / swing
    start = np.minimum(np.arange(2000) / 300, 1.0)
    way = np.stack(
        [
            0.015 + 1e-3 * np.sin(0.7 * phase),
            0.015 + 1e-3 * np.sin(0.9 * phase),
            TOP + RADIUS - start * (2e-3 + 0.7 * swing * np.sin(phase)),
        ],
        axis=1,
    )
    one = body if kind is None else made(body, kind)
    full = one.simulate_path(way, RADIUS).force
    hold, linear = np.zeros_like(full), np.zeros_like(full)
    for tick in range(0, len(way) - interval, interval):
        used = slice(tick + interval, tick + 2 * interval)
        body.core.reset()
        step = 2e-5 * np.concatenate([np.zeros((1, 3)), np.eye(3), -np.eye(3)])
        near = np.array([body.simulate_path(way[tick] + one_step[None], RADIUS).force[-1] for one_step in step])
        stiffness = (near[1:4] - near[4:]).T / 4e-5
        hold[used] = full[tick]
        linear[used] = full[tick] + (way[used] - way[tick]) @ stiffness.T
    late = slice(400, None)
    found = {"hold": hold, "linear": linear}
    if kind is not None:
        found["two rates"] = made(body, kind, update_interval=f"{interval} ms").simulate_path(way, RADIUS).force
    size = np.sqrt(np.mean(np.sum(full[late] ** 2, axis=1)))
    return {
        name: float(np.sqrt(np.mean(np.sum((force[late] - full[late]) ** 2, axis=1))) / size)
        for name, force in found.items()
    }


@pytest.mark.parametrize("kind", ["viscoelastic", "modal", "mass_spring", "hardening springs"])
@pytest.mark.parametrize("speed", [20e-3, 50e-3])
def test_a_local_model_is_nearer_than_the_last_force(body: Body, kind: str, speed: float) -> None:
    """docs/validation/deformable-bodies.md has the numbers."""
    found = errors_over_speed(body, kind, 20, speed)
    assert found["two rates"] < 0.5 * found["hold"]
    assert found["two rates"] < found["linear"]
