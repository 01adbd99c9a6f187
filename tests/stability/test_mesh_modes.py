"""The linear laws of a contact with a mesh agree with the proxy that runs in the servo."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.contact import Mesh, Surface
from palpate.simulation.contact_law import ContactLaw
from palpate.simulation.meshes import box_mesh
from palpate.simulation.proxy_law import ProxyProbe
from palpate.stability.mesh_modes import (
    SurfacePoint,
    edge_modes,
    face_modes,
    friction_law,
    sliding_mode,
    vertex_mode,
)
from palpate.stability.mode_stability import _groups
from scipy.spatial.transform import Rotation

PERIOD = 1e-3
PIT = np.array([[0.02, 0.02, 0], [-0.02, 0.02, 0], [-0.02, -0.02, 0], [0.02, -0.02, 0], [0, 0, -0.015]])
PIT_FACES = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])


def _response(law: ContactLaw, z: complex) -> np.ndarray:
    if not len(law.A):
        return law.D
    return law.D + law.C @ np.linalg.solve(z * np.eye(len(law.A)) - law.A, law.B)


def _difference(one: ContactLaw, other: ContactLaw) -> float:
    """Return the largest relative difference of the frequency responses of two laws."""
    at = [np.exp(1j * angle) for angle in (0.05, 0.7, 3.0)]
    return max(float(np.abs(_response(one, z) - _response(other, z)).max() / np.abs(one.D).max()) for z in at)


def _mesh(shape: str, rng: np.random.Generator) -> Mesh:
    turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
    if shape == "torus":
        import trimesh

        torus = trimesh.creation.torus(0.05, 0.02, major_sections=24, minor_sections=12)
        return Mesh(torus.vertices @ turn.T, torus.faces)
    vertices, faces = box_mesh(0.08, 3)
    return Mesh(vertices @ turn.T, faces)


def _touched(mesh: Mesh, triangle: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return a place well inside a triangle (3,) and its outward normal (3,)."""
    corners = mesh.vertices[mesh.triangles[triangle]]
    weights = 0.2 + 0.4 * rng.dirichlet([1.0, 1.0, 1.0])
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    return weights / weights.sum() @ corners, normal / np.linalg.norm(normal)


@pytest.mark.parametrize("shape", ["box", "torus"])
@pytest.mark.parametrize(
    ("friction", "tangential", "viscous"),
    [(0.0, None, 0.0), (0.4, None, 0.0), (0.3, 0.5, 0.0), (0.3, 0.5, 3.0), (0.0, 0.7, 2.0), (0.5, 0.0, 0.0)],
)
def test_a_face_answers_as_its_law_when_the_proxy_sticks_and_slides(
    shape: str, friction: float, tangential: float | None, viscous: float
) -> None:
    rng = np.random.default_rng(int(100 * friction) + int(10 * viscous) + len(shape))
    for _ in range(3):
        mesh, k = _mesh(shape, rng), float(rng.uniform(200.0, 4000.0))
        kt = k if tangential is None else tangential * k
        spring = None if tangential is None else kt
        surface = Surface(k, tangential=spring, static_friction=friction, viscous=viscous, period=PERIOD)
        probe = ProxyProbe(mesh, surface.core_for(mesh), 0.0)
        triangle = int(rng.integers(len(mesh.triangles)))
        place, normal = _touched(mesh, triangle, rng)
        point = SurfacePoint(normal, k, kt, friction, viscous / (PERIOD * kt) if kt else 0.0, 0.0, PERIOD)
        depth = 3e-4
        rest = probe.law(triangle, normal, place, place - depth * normal)
        assert rest is not None
        assert _difference(face_modes(point)[0].law, rest) < 1e-6
        if friction == 0.0 or kt == 0.0:
            continue
        angle, kept = float(rng.uniform(0.0, 6.0)), float(rng.uniform(max(point.least_kept + 0.02, 0.3), 0.98))
        s = np.array([np.cos(angle), np.sin(angle)]) @ point.tangents()
        lag = friction * k / kt * depth / ((1.0 + point.drag) * kept - point.drag)
        slides = probe.law(triangle, normal, place, place - depth * normal + lag * s)
        assert slides is not None
        assert _difference(sliding_mode(point, s, kept).law, slides) < 1e-5


def test_a_pit_has_the_stiffness_of_an_edge_in_its_valleys_and_of_a_vertex_at_its_bottom() -> None:
    mesh = Mesh(PIT, PIT_FACES, open=True)
    probe = ProxyProbe(mesh, Surface(1000.0, period=PERIOD).core_for(mesh), 0.0)
    bottom, corner = PIT[4], PIT[0]
    along = (corner - bottom) / np.linalg.norm(corner - bottom)
    down = np.array([0.0, 0.0, -1.0]) + along[2] * along
    down /= np.linalg.norm(down)
    middle = 0.5 * (bottom + corner)
    edge = probe.law(0, probe.normals[0], middle - 1e-3 * (PIT[0] - PIT[1]), middle + 5e-4 * down)
    point = SurfacePoint(-down, 1000.0, 1000.0, 0.0, 0.0, 0.0, PERIOD)
    assert edge is not None
    assert np.allclose(edge.D, edge_modes(point, along)[0].law.D, atol=1e-3)
    held = probe.law(
        0, probe.normals[0], bottom + 1e-3 * (PIT[0] + PIT[1] - 2 * bottom), bottom - np.array([0.0, 0.0, 5e-4])
    )
    assert held is not None
    assert np.allclose(held.D, vertex_mode(point).law.D, atol=1e-3)


def test_any_friction_lies_in_the_hull_of_the_laws_of_the_disk() -> None:
    """A stick or slide of the proxy on one face gives, in every tick, the force of a law with |u| <= 1."""
    rng = np.random.default_rng(3)
    mesh, k, kt, mu, viscous = Mesh(*box_mesh(0.2, 1)), 1000.0, 600.0, 0.3, 1.5
    surface = Surface(k, tangential=kt, static_friction=mu, viscous=viscous, period=PERIOD)
    proxy = ProxyProbe(mesh, surface.core_for(mesh), 0.0).proxy
    path = np.cumsum(rng.normal(0.0, 2e-4, (400, 3)), axis=0)
    path[:, 2] = -1e-3 - 5e-4 * np.abs(np.sin(np.arange(400) / 15.0))
    path[0] = [0.0, 0.0, 1e-5]
    rows, _ = proxy.simulate_path(np.ascontiguousarray(path))
    point = SurfacePoint(np.array([0.0, 0.0, 1.0]), k, kt, mu, viscous / (PERIOD * kt), 0.0, PERIOD)
    base, g = friction_law(point, np.zeros(2)), point.least_kept
    slides = 0
    for before, row, tip in zip(rows[1:-1], rows[2:], path[2:], strict=True):
        state = -before[0:3]  # the lag less the tip
        friction = (-row[6:9] - base.C @ state - base.D @ tip)[:2]
        size = float(np.linalg.norm(friction)) / ((1.0 - g) * mu * k * row[9])
        assert size <= 1.0 + 1e-6
        slides += size > 1.0 - 1e-6
    assert 100 < slides < 390  # both sticking and sliding occur


def test_points_that_differ_in_stiffness_only_are_one_group() -> None:
    def point(normal: list[float], stiffness: float, drag: float) -> SurfacePoint:
        return SurfacePoint(np.array(normal), stiffness, 100.0, 0.3, drag, 0.0, PERIOD)

    up, aside = [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]
    points = [point(up, 100.0, 0.5), point(up, 300.0, 0.5), point(up, 300.0, 0.7), point(aside, 100.0, 0.7),
              point(aside, 200.0, 0.7), point(up, 100.0, 0.5)]  # fmt: skip
    groups = _groups(points)
    assert [len(group) for group in groups] == [2, 1, 2, 1]
    assert [one for group in groups for one in group] == points
    assert _groups([]) == []


@pytest.mark.parametrize(
    ("friction", "drag", "damping"), [(0.4, 0.0, 0.0), (0.4, 1.5, 0.0), (0.0, 1.5, 0.0), (0.4, 1.5, 3.0)]
)
def test_the_friction_law_is_the_recursion_of_the_lag(friction: float, drag: float, damping: float) -> None:
    """l' = g (l + dx) + (1 - g) (mu d k / k_t) u and f = -k d n + k_t l, with the depth d = -n.x and a damper."""
    normal, k, kt = np.array([0.36, 0.48, 0.8]), 900.0, 400.0
    point = SurfacePoint(normal, k, kt, friction, drag, damping, PERIOD)
    u = np.array([0.3, -0.8])
    law, along, across = friction_law(point, u), u @ point.tangents(), np.eye(3) - np.outer(normal, normal)
    g = drag / (1.0 + drag)
    rng = np.random.default_rng(0)
    state, lag, before = np.zeros(len(law.A)), np.zeros(3), np.zeros(3)
    for _ in range(12):
        tip = rng.normal(size=3)
        depth = -normal @ tip
        lag = g * (lag + across @ (tip - before)) + (1.0 - g) * friction * k * depth / kt * along
        force = -k * depth * normal + kt * lag + damping / PERIOD * (normal @ (tip - before)) * normal
        np.testing.assert_allclose(law.C @ state + law.D @ tip, force, rtol=1e-9, atol=1e-9)
        state, before = law.A @ state + law.B @ tip, tip


def test_a_proxy_that_never_slides_has_both_springs() -> None:
    point = SurfacePoint(np.array([0.0, 0.6, 0.8]), 900.0, 400.0, np.inf, 1.5, 0.0, PERIOD)
    law = friction_law(point, np.array([0.3, 0.4]))
    assert law.A.size == 0
    assert np.linalg.eigvalsh(law.D) == pytest.approx([400.0, 400.0, 900.0])
    assert law.D @ point.normal == pytest.approx(900.0 * point.normal)
