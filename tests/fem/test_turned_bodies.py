"""A body that is turned and moved has the same forces, turned with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import palpate
import pytest
from palpate import fem
from palpate.arrays import Array
from palpate.fem import Body
from palpate.fem.selectors import Selector
from scipy.spatial.transform import Rotation

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


TURNS = {
    "onto its side": ([0.0, np.pi / 2.0, 0.0], [0.0, 0.0, 0.0]),
    "upside down": ([np.pi, 0.0, 0.0], [0.0, 0.0, 0.0]),
    "anywhere": ([0.24, 0.48, -0.72], [0.5, -0.3, 0.7]),
}


def block(turn: Array, shift: Array) -> Body:
    """Return a block that is bonded below and touched on its top, turned (3, 3) and moved (3,), m."""
    volume = fem.block(SIDES, 0.004)

    def height(points: Array) -> Array:
        return np.asarray(((points - shift) @ turn)[:, 2])

    return fem.build(
        replace(volume, points=volume.points @ turn.T + shift), young=20e3, order=1, modes=10,
        fixed=Selector("below", lambda points: height(points) < 1e-6, False),
        touch=Selector("above", lambda points: height(points) > SIDES[2] - 1e-6, False),
    )  # fmt: skip


def approach() -> Array:
    """Path that comes from beside the block, stops above it, presses it and slides (m, 3), m; axis 2 is upward."""
    corners = np.array([[40.0, 12.0, 20.0], [12.0, 12.0, 19.0], [11.0, 12.5, 16.5], [12.5, 10.0, 16.5]])
    steps = [np.linspace(a, b, 40, endpoint=False) for a, b in pairwise(corners)]
    return np.asarray(1e-3 * np.vstack([*steps, np.tile(corners[-1], (10, 1))]))


@pytest.fixture(scope="module")
def straight() -> Body:
    return block(np.eye(3), np.zeros(3))


@pytest.fixture(scope="module", params=TURNS)
def turned(request: pytest.FixtureRequest) -> tuple[Body, Array, Array]:
    vector, place = TURNS[request.param]
    turn, shift = Rotation.from_rotvec(vector).as_matrix(), np.array(place)
    return block(turn, shift), turn, shift


@pytest.mark.parametrize("kind", KINDS)
def test_the_forces_turn_with_the_body(straight: Body, turned: tuple[Body, Array, Array], kind: str) -> None:
    """Each update of a static hyperelastic body is one step of iterations, which stop at other places when turned."""
    expected = KINDS[kind](straight).simulate_path(approach(), RADIUS).force
    body, turn, shift = turned
    found = KINDS[kind](body).simulate_path(approach() @ turn.T + shift, RADIUS).force
    size = np.linalg.norm(expected, axis=1)
    assert size[-1] > 0.02
    assert not size[:50].any()
    near = {"neo-hookean": 0.06, "corotational": 0.06, "with inertia": 3e-3}.get(kind, 1e-5)
    np.testing.assert_allclose(found @ turn, expected, atol=near * size.max())


@pytest.mark.parametrize("kind", ["neo-hookean", "compliance"])
@pytest.mark.parametrize("far", [0.5e-3, 3e-3, 8e-3, 20e-3])
def test_a_tip_beside_a_tall_body_feels_nothing(kind: str, far: float) -> None:
    tall = fem.build(
        fem.block((0.016, 0.016, 0.08), 0.008), young=20e3, order=1, fixed="z < 0.001 mm", touch="z > 4 mm"
    )
    place = np.array([0.016 + 4e-3 + far, 0.008, 0.02])
    assert not KINDS[kind](tall).simulate_path(np.tile(place, (12, 1)), 4e-3).force.any()


@pytest.mark.parametrize("kind", ["neo-hookean", "corotational"])
def test_a_loop_rests_on_the_side_of_a_hyperelastic_body(kind: str, tmp_path: Path) -> None:
    fem.build(
        fem.block((0.012, 0.024, 0.024), 0.004), young=20e3, order=1,
        fixed="x < 0.001 mm", touch="x > 11.9 mm", output=tmp_path / "side.h5",
    )  # fmt: skip
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
