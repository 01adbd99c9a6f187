"""A tip on bodies as curved and as thin as itself: no step of force, no energy out, no node left inside."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from nightly import NIGHTLY
from numpy.typing import NDArray
from palpate import fem as bodies
from palpate.fem import Body, block
from palpate.fem.checks import TipShape
from palpate.fem.volume import Volume
from scipy.optimize import nnls
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
UP, PERIOD = np.array([0.0, 0.0, 1.0]), 1e-3


@cache
def rod() -> Body:
    """Return a lying rod of 5 mm radius and 30 mm, held below."""
    volume = block((0.03, 0.01, 0.01), (2e-3, 1.25e-3, 1.25e-3))
    x, y, z = (volume.points - [0.015, 0.005, 0.005]).T
    y, z = y / 5e-3, z / 5e-3
    round_ = np.stack([x, 5e-3 * y * np.sqrt(1 - z * z / 2), 5e-3 * z * np.sqrt(1 - y * y / 2)], axis=1)
    return bodies.build(Volume(round_, volume.tetrahedra, "rod"), young=10e3, fixed="z < -3.5 mm", order=1, modes=20)


@cache
def plate() -> Body:
    """Return a plate of 3 mm, held along one side, both faces to be touched."""
    volume = block((0.024, 0.024, 0.003), (2e-3, 2e-3, 1.5e-3))
    points = volume.points - [0.012, 0.012, 0.003]
    return bodies.build(Volume(points, volume.tetrahedra, "plate"), young=10e3, fixed="x < -11.9 mm", modes=20)


@cache
def wedge() -> Body:
    """Return a block that thins to an edge of 2 mm."""
    volume = block((0.02, 0.02, 0.02), (2e-3, 2e-3, 2e-3))
    points = volume.points - [0.01, 0.01, 0.02]
    points[:, 1] *= 0.1 - 45.0 * points[:, 2]
    return bodies.build(Volume(points, volume.tetrahedra, "wedge"), young=10e3, fixed="z < -19.9 mm", order=1, modes=20)


SHAPES: dict[str, tuple[Callable[[], Body], float]] = {"rod": (rod, 5e-3), "plate": (plate, 0.0), "wedge": (wedge, 0.0)}


@pytest.fixture(scope="module", params=SHAPES)
def shape(request: pytest.FixtureRequest) -> tuple[Body, float]:
    """Return a body, and how high its top lies, m."""
    make, top = SHAPES[request.param]
    return make(), top


def wander(rng: np.random.Generator, ticks: int, deep: float) -> Array:
    """Places (ticks + 1, 3), m, of a smooth closed path from 6 mm above the origin to about `deep` below it."""
    t, order = np.linspace(0.0, 2 * np.pi, ticks + 1), np.arange(1, 4)
    even, odd = rng.normal(size=(2, 3, 3)) / order
    path = (np.cos(np.outer(t, order)) @ even.T + np.sin(np.outer(t, order)) @ odd.T) * [2e-3, 2e-3, 1e-3]
    path -= path[0]
    path[:, 2] += 6e-3 * np.clip(1.0 - 2.0 * np.minimum(t, 2 * np.pi - t), 0.0, 1.0) ** 2 - deep * np.sin(t / 2)
    return np.asarray(path)


@pytest.mark.parametrize(("radius", "deep"), [*([(2.5e-3, 1e-3)] if NIGHTLY else []), (2.5e-3, 4e-3), (4e-3, 2e-3)])
def test_no_closed_path_around_a_slender_body_gives_work(shape: tuple[Body, float], radius: float, deep: float) -> None:
    """Nodes on the flanks and the far side come under the tip and leave it without a force, by its place alone."""
    body, top = shape
    rng, pressed = np.random.default_rng(3), 0
    for _ in range(8):
        path = wander(rng, 16_000, deep) + (top + radius) * UP
        body.core.reset()
        felt = body.simulate_path(path, radius, outward=UP)
        work = -(0.5 * (felt.force[1:] + felt.force[:-1]) * np.diff(path, axis=0)).sum(axis=1)
        assert abs(work.sum()) <= 2e-4 * np.abs(work).sum()
        assert not felt.nodes[[0, -1]].any()
        # The work is what the body holds, at every tick: energy has no step where a node comes or goes.
        assert np.abs(np.cumsum(work) - felt.energy[1:]).max() <= 2e-3 * felt.energy.max()
        pressed = max(pressed, int(felt.nodes.max()))
    assert pressed > 1


def depths(body: Body, centre: Array, radius: float) -> Array:
    """How deep each node is in a sphere (n,), m, along its normal; its side goes on as a cone at 78 degrees."""
    away, normals = body.nodes - centre, body.normals
    height = (away * normals).sum(axis=1)
    aside = np.sqrt(np.maximum((away**2).sum(axis=1) - height**2, 0.0))
    sine = np.sqrt(0.96)
    side = np.sqrt(np.maximum(radius**2 - aside**2, 0.0))
    return np.asarray(height + np.where(aside < sine * radius, side, (radius - sine * aside) / 0.2))


def test_the_forces_are_those_of_all_nodes_at_once(shape: tuple[Body, float]) -> None:
    """Against Lawson and Hanson's least squares over every node that faces the tip, where it has passed none."""
    body, top = shape
    n, normals = len(body.nodes), body.normals
    blocks = body.compliance.astype(float).reshape(n, 3, n, 3)
    compliance = np.einsum("ia,iajb,jb->ij", normals, blocks, normals)
    rng, tried = np.random.default_rng(7), 0
    for radius in (2.5e-3, 4e-3):
        for _ in range(60):
            place = np.array([*rng.uniform(-3e-3, 3e-3, 2), top + radius - rng.uniform(0.2e-3, 2e-3)])
            deep, facing = depths(body, place, radius), normals @ UP
            beyond = 2 * ((body.nodes - place) * normals).sum(axis=1) - deep  # the sphere's upper side
            passed = (beyond > -0.4 * radius) & ((beyond < 0) | (facing > 0.6)) & (facing > -0.5)
            if (passed & (deep > -1e-3)).any():
                continue
            near = np.flatnonzero((facing > -0.5) & (beyond < 0) & (deep > -0.5 * radius))
            part = compliance[np.ix_(near, near)]
            root = np.linalg.cholesky(part)
            expected = np.zeros(n)
            expected[near], _ = nnls(root.T, np.linalg.solve(root, deep[near]), maxiter=10_000)
            body.core.reset()
            body.simulate_path(place[None], radius, outward=UP)
            nodes, forces = body.core.contact_forces()
            found = np.zeros(n)
            found[nodes] = forces
            assert found == pytest.approx(expected, abs=2e-5 * max(expected.max(), 1e-12))
            tried += int(expected.any())
    assert tried > 20


@pytest.mark.parametrize("kind", ["compliance", "modal"])
def test_force_has_no_step_on_a_slender_body(shape: tuple[Body, float], kind: str) -> None:
    """A slide at constant depth across all of it, 1 um a tick: as nodes come and go force moves little."""
    body, top = shape
    made = {
        "compliance": body,
        "modal": body.modal(PERIOD, rayleigh_alpha=50.0, rayleigh_beta=2e-3),
    }[kind]
    across = np.arange(-3e-3, 3e-3, 1e-6)
    path = np.stack([np.full_like(across, 5e-4), across, np.full_like(across, top - 1.5e-3 + 2.5e-3)], axis=1)
    down = path[0] + np.outer(np.linspace(3e-3, 0.0, 1000), UP)
    made.core.reset()
    felt = made.simulate_path(np.concatenate([down, path]), 2.5e-3, outward=UP)
    force = felt.force[1200:]  # what inertia stirs up has died down
    assert np.linalg.norm(np.diff(force, axis=0), axis=1).max() < 0.05 * np.linalg.norm(force, axis=1).max()


@pytest.mark.parametrize("tip", ["sphere", "flat"])
def test_a_tip_through_a_thin_plate_presses_its_near_face_only(tip: TipShape) -> None:
    """5 mm of radius, 7 mm deep into 3 mm: the far face, which turns away, is not touched."""
    body = plate()
    body.core.reset()
    top = 5e-3 if tip == "sphere" else 0.0
    depth = np.linspace(0.0, 7e-3, 2000)
    path = np.array([0.003, 0.0005, top]) - np.outer(depth, UP)
    felt = body.simulate_path(path, 5e-3, outward=UP, tip=tip)
    nodes, _ = body.core.contact_forces()
    assert (body.normals[nodes] @ UP > 0).all()
    assert (np.diff(felt.force[200:, 2]) > 0).all()


def test_the_force_of_a_press_at_a_vertex_turns_with_the_body() -> None:
    """The press followed the normal of one of the triangles there: forces of turned copies differed by 1 to 3 %."""
    volume = block((0.03, 0.03, 0.015), 5e-3)
    points = volume.points.copy()
    points[:, 2] *= 1.0 + 0.15 * np.sin(100.0 * points[:, 0]) + 0.1 * np.cos(120.0 * points[:, 1])
    top = np.flatnonzero(volume.points[:, 2] > 14.9e-3)
    middle = top[np.argmin(np.linalg.norm(volume.points[top, :2] - 0.012, axis=1))]

    def press(angle: float) -> Array:
        turn = Rotation.from_rotvec([0.0, 0.0, angle]).as_matrix()
        turned = Volume(points @ turn.T, volume.tetrahedra, "bumps")
        body = bodies.build(turned, young=10e3, fixed="z < 0.1 mm", order=1)
        return np.asarray(body.signed_distance().indent(turn @ points[middle], 8e-3, 1e-3).force @ turn)

    expected = press(0.0)
    for angle in (0.4, 1.9, 3.0, 4.4):
        np.testing.assert_allclose(press(angle), expected, atol=1e-4 * np.linalg.norm(expected))
