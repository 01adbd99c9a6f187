"""A body that is touched on another side has the same forces, turned with it."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import palpate
import pytest
from palpate import fem
from palpate.arrays import Array
from palpate.fem import Body

SIDES, RADIUS = (0.024, 0.024, 0.012), 6e-3

KINDS: dict[str, Callable[[Body], Body]] = {
    "compliance": lambda body: body,
    "signed distance": lambda body: body.signed_distance(),
    "friction": lambda body: body.signed_distance(static_friction=0.5),
    "viscoelastic": lambda body: body.viscoelastic("1 ms", instantaneous_ratio=2.0, retardation_time="20 ms"),
    "modal": lambda body: body.modal("1 ms"),
    "mass-spring": lambda body: body.mass_spring("1 ms"),
    "neo-hookean": lambda body: body.hyperelastic("1 ms", update_interval="5 ms"),
    "corotational": lambda body: body.hyperelastic("1 ms", law="corotational", update_interval="5 ms"),
    "with inertia": lambda body: body.hyperelastic("1 ms", update_interval="5 ms", density="1000 kg/m^3"),
}


def block(axis: int) -> Body:
    """Return a block that is bonded at the plane 0 of an axis and touched opposite; its axes follow in cyclic order."""
    name, height = "xyz"[axis], 1e3 * SIDES[2]
    return fem.build(
        fem.block(np.roll(SIDES, axis + 1), 0.004), young=20e3, order=1, modes=10,
        fixed=f"{name} < 0.001 mm", touch=f"{name} > {height - 0.1} mm",
    )  # fmt: skip


@pytest.fixture(scope="module")
def blocks() -> list[Body]:
    return [block(axis) for axis in range(3)]


def approach() -> Array:
    """Path that comes from beside the block, stops above it, presses it and slides (m, 3), m; axis 2 is upward."""
    corners = np.array([[40.0, 12.0, 20.0], [12.0, 12.0, 19.0], [11.0, 12.5, 16.5], [12.5, 10.0, 16.5]])
    steps = [np.linspace(a, b, 40, endpoint=False) for a, b in pairwise(corners)]
    return np.asarray(1e-3 * np.vstack([*steps, np.tile(corners[-1], (10, 1))]))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("axis", [0, 1])
def test_the_forces_turn_with_the_side_that_is_touched(blocks: list[Body], kind: str, axis: int) -> None:
    expected = KINDS[kind](blocks[2]).simulate_path(approach(), RADIUS).force
    found = KINDS[kind](blocks[axis]).simulate_path(np.roll(approach(), axis + 1, axis=1), RADIUS).force
    size = np.linalg.norm(expected, axis=1)
    assert size[-1] > 0.02
    assert not size[:50].any()
    np.testing.assert_allclose(found, np.roll(expected, axis + 1, axis=1), atol=2e-3 * size.max())


@pytest.mark.parametrize("kind", ["neo-hookean", "compliance"])
@pytest.mark.parametrize("far", [0.5e-3, 3e-3, 8e-3, 20e-3])
def test_a_tip_beside_a_tall_body_feels_nothing(kind: str, far: float) -> None:
    tall = fem.build(
        fem.block((0.016, 0.016, 0.08), 0.008), young=20e3, order=1, fixed="z < 0.001 mm", touch="z > 4 mm"
    )
    place = np.array([0.016 + 4e-3 + far, 0.008, 0.02])
    assert not KINDS[kind](tall).simulate_path(np.tile(place, (12, 1)), 4e-3).force.any()


@pytest.mark.parametrize("kind", ["neo-hookean", "corotational"])
def test_a_loop_rests_on_the_side_of_a_hyperelastic_body(blocks: list[Body], kind: str, tmp_path: Path) -> None:
    blocks[0].save(tmp_path / "side.h5")
    trace = palpate.simulate(
        {
            "device": {"name": "slider"},
            "start": {"pose": ["0 mm"]},
            "servo": {"period": "1 ms", "topology": "impedance_display"},
            "operator": {
                "kind": "arm", "mass": "0.1 kg", "damping": "10 N*s/m", "stiffness": "100 N/m", "shape": "ramp",
                "rise": "0.3 s", "force": ["-0.3 N", "0 N", "0 N"],
            },
            "object": {
                "kind": "body",
                "position": ["-6.2 mm", "0 mm", "0 mm"],
                "body": {"file": str(tmp_path / "side.h5"), "kind": kind, "radius": "6 mm", "origin": ["12 mm"] * 3},
            },
            "run": {"duration": "2 s"},
        }
    )  # fmt: skip
    assert trace["solved"].all()
    assert trace.verdict.settled
    reached = -trace["tip"][-1, 0]
    assert -trace["object_force"][-1, 0] == pytest.approx(0.3 - 100.0 * reached, rel=0.01)
