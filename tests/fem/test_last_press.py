"""Pressure and displacement belong to the last motion of a tip: a press, a path, or several paths."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from palpate import fem
from palpate.fem import Body, BodyWarning, block

CREEP = {"instantaneous_ratio": 2.0, "retardation_time": "0.1 s"}
POINT, TIP, DEPTH = (12e-3, 12e-3, 12e-3), 8e-3, 1e-3
KINDS: dict[str, Callable[[Body], Body]] = {
    "compliance": lambda body: body,
    "compliance, friction": lambda body: body.with_friction(0.4, 0.3),
    "signed distance": lambda body: body.signed_distance(),
    "signed distance, friction": lambda body: body.signed_distance().with_friction(0.4, 0.3),
    "relaxing": lambda body: body.viscoelastic("1 ms", **CREEP),
    "relaxing, signed distance": lambda body: body.viscoelastic("1 ms", contact="signed_distance", **CREEP),
    "relaxing, two rates": lambda body: body.viscoelastic("1 ms", update_interval="4 ms", **CREEP),
    "modal": lambda body: body.modal("1 ms", rayleigh_beta="1 ms"),
    "mass-spring": lambda body: body.mass_spring("1 ms"),
    "mass-spring, two rates": lambda body: body.mass_spring("1 ms", update_interval="4 ms"),
    "hyperelastic": lambda body: body.hyperelastic("1 ms"),
    "changing supports": lambda body: body.signed_distance().with_support_changes(
        [{"at": "20 ms", "held": "x < 1 mm"}], period="1 ms"
    ),
}


@pytest.fixture(scope="module")
def soft() -> Body:
    """Return a block of 24 x 24 x 12 mm with modes, touched on the top."""
    volume = block((0.024, 0.024, 0.012), (3e-3, 3e-3, 3e-3))
    return fem.build(volume, young=10e3, fixed="z < 0.1 mm", touch="z > 11.9 mm", modes=10, density=1000.0)


@pytest.fixture(autouse=True)
def coarse() -> Iterator[None]:
    """Expect the warnings of a coarse mesh."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", BodyWarning)
        yield


@pytest.mark.parametrize("kind", KINDS)
def test_pressure_and_displacement_after_a_press_are_those_of_the_press(soft: Body, kind: str) -> None:
    body = KINDS[kind](soft)
    path = np.linspace((8e-3, 12e-3, 20.5e-3), (8e-3, 12e-3, 18.5e-3), 40)
    body.simulate_path(path, TIP)
    pressed = body.indent(POINT, TIP, DEPTH)
    normal = float(body.contents.areas @ body.pressure())
    assert normal == pytest.approx(pressed.force[2], rel=0.02)
    np.testing.assert_array_equal(body.displacement(), pressed.displacement)
    moved = body.simulate_path(path, TIP)
    assert float(body.contents.areas @ body.pressure()) == pytest.approx(moved.force[-1, 2], rel=0.02)
    assert not np.array_equal(body.displacement(), pressed.displacement)
