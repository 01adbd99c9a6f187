"""The proxy from Python: closed forms on a plane and a sphere, and the case in which CHAI3D's proxy locks up."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate import Mesh, PalpateError, Proxy, Surface
from palpate.contact import SurfaceError
from touch_shapes import ball, box

from benchmarks.proxy_steps import orbit, time_steps

Array = NDArray[np.float64]


def test_step_and_follow_say_the_same() -> None:
    mesh = Mesh(*ball(12, bump=0.1))
    surface = Surface(stiffness="0.1 N/mm", static_friction=0.5, dynamic_friction=0.3)
    path = orbit(400, 0.1) * 1.02
    whole = Proxy(mesh, surface).simulate_path(path)
    one = Proxy(mesh, surface)
    for i, tip in enumerate(path):
        contact = one.step(tip)
        assert contact.touching == whole.touching[i]
        np.testing.assert_array_equal(contact.force, whole.force[i])
        np.testing.assert_array_equal(contact.position, whole[i].position)
    assert len(whole) == 400


@pytest.mark.parametrize("radius", [0.0, 0.01])
def test_on_a_sphere_position_and_normal_are_radial(radius: float) -> None:
    """Frictionless, the proxy lies on the tip's radius; facets of size h differ from the sphere by angles of h / 2R."""
    pieces = 71
    mesh = Mesh(*ball(pieces))
    path = orbit(3000)
    contacts = Proxy(mesh, Surface(stiffness=100.0), radius=radius).simulate_path(path)
    outward = path / np.linalg.norm(path, axis=1, keepdims=True)
    facet = 1.2 / pieces  # largest edge over radius
    assert contacts.touching.all()
    assert np.linalg.norm(contacts.normal - outward, axis=1).max() < facet
    centre = (0.5 + radius) * outward
    assert np.linalg.norm(contacts.position - centre, axis=1).max() < 0.05 * facet
    depth = 0.5 + radius - np.linalg.norm(path, axis=1)
    np.testing.assert_allclose(contacts.depth, depth, atol=0.5 * facet**2)
    np.testing.assert_allclose(np.linalg.norm(contacts.force, axis=1), 100.0 * contacts.depth, rtol=1e-9)


@pytest.mark.parametrize("radius", [0.0, 0.01])
def test_frictional_lag_on_a_sphere(radius: float) -> None:
    """Under steady sliding the spring is inclined to the normal by the angle of friction: tan = mu_d."""
    mesh = Mesh(*ball(71))
    angle = np.arange(3000) * 1e-3
    path = 0.48 * np.stack([np.cos(angle), np.sin(angle), 0.1 * np.ones_like(angle)], axis=1)
    contacts = Proxy(mesh, Surface(static_friction=0.6, dynamic_friction=0.4), radius=radius).simulate_path(path)
    spring = contacts.position - path
    outward = contacts.position / np.linalg.norm(contacts.position, axis=1, keepdims=True)
    along = np.sum(spring * outward, axis=1)
    lag = np.linalg.norm(spring - along[:, None] * outward, axis=1)
    late = slice(500, None)
    np.testing.assert_allclose((lag / along)[late], 0.4, atol=0.02)  # facets tilt the normal by up to 0.01
    tangential = contacts.force - np.sum(contacts.force * contacts.normal, axis=1)[:, None] * contacts.normal
    ratio = np.linalg.norm(tangential, axis=1) / np.sum(contacts.force * contacts.normal, axis=1)
    assert np.all(ratio[late] <= 0.6 * (1 + 1e-9))
    assert np.median(ratio[late]) == pytest.approx(0.4, abs=1e-6)


@pytest.mark.parametrize("friction", [0.0, 0.6])
@pytest.mark.parametrize("radius", [0.0, 0.01])
def test_the_bumpy_ball_of_100k_triangles_never_locks_up(radius: float, friction: float) -> None:
    """Where CHAI3D's proxy of radius 0.01 sticks in a fifth to a half of the ticks, ours is always inside its cone."""
    mesh = Mesh(*ball(71, bump=0.04))
    assert len(mesh.triangles) == 100_820
    path = orbit(20_000, 0.04)
    proxy = Proxy(mesh, Surface(stiffness=100.0, static_friction=friction, dynamic_friction=friction / 1.5), radius)
    contacts = proxy.simulate_path(path)
    assert contacts.touching.all()
    spring = contacts.position - path
    along = np.sum(spring * contacts.normal, axis=1)
    lag = np.linalg.norm(spring - along[:, None] * contacts.normal, axis=1)
    assert np.all(lag <= friction * along * (1 + 1e-6) + 1e-7)
    assert proxy.iteration_limit_count <= 20  # of 20,000: the step goes on in the next tick, it is not held


def test_continuous_field_has_smaller_steps_and_does_no_net_work() -> None:
    """On a flat face of patches of 0.2 and 3.5 N/mm: force steps 10 times smaller, and no work round a closed path."""
    mesh = Mesh(*box((0.05, 0.05, 0.05), 10))
    patch = np.floor(mesh.vertices[mesh.triangles].mean(axis=1) / 0.02 + 50).sum(axis=1) % 2
    stiffness = np.where(patch == 0, 200.0, 3500.0)
    angle = np.linspace(0.0, 2 * np.pi, 400_001)
    shift = angle + 0.3
    path = np.stack([0.031 * np.cos(angle), 0.027 * np.sin(shift), 0.0485 + 0.0005 * np.sin(3 * angle)], axis=1)
    speed = np.stack([-0.031 * np.sin(angle), 0.027 * np.cos(shift), 0.0015 * np.cos(3 * angle)], axis=1)
    steps, work = {}, {}
    for field in ("discrete", "continuous"):
        proxy = Proxy(mesh, Surface(stiffness=stiffness, field=field))
        proxy.step([0.031, 0.0, 0.06])
        force = proxy.simulate_path(path).force
        steps[field] = np.linalg.norm(np.diff(force, axis=0), axis=1).max()
        power = np.sum(force * speed, axis=1)[:-1]  # a sum over a whole period: exact for smooth forces
        work[field] = abs(power.sum()) / np.abs(power).sum()
    assert steps["continuous"] < 0.1 * steps["discrete"]
    assert work["continuous"] < 1e-9
    assert work["discrete"] > 1e-2


def test_nan_is_counted_and_the_contact_held() -> None:
    proxy = Proxy(Mesh(*box((1.0, 1.0, 1.0), 2)), Surface())
    path = np.array([[0.0, 0, 2], [0.1, 0.2, 0.9], [np.nan, 0, 0], [0.1, np.inf, 0], [0.2, 0.2, 0.9]])
    contacts = proxy.simulate_path(path)
    assert proxy.invalid_input_count == 2
    np.testing.assert_array_equal(contacts.force[2], contacts.force[1])
    np.testing.assert_allclose(contacts.position[4], [0.2, 0.2, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"stiffness": [1.0, 2.0]}, "one per triangle"),
        ({"stiffness": -1.0}, "not negative"),
        ({"stiffness": np.nan}, "finite"),
        ({"stiffness": "3 N"}, "stiffness"),
        ({"tangential": "-1 N/mm"}, "tangential"),
        ({"static_friction": -0.1}, "static_friction"),
        ({"static_friction": 0.1, "dynamic_friction": 0.2}, "must not exceed"),
        ({"field": "smooth"}, "field"),
        ({"period": 0.0}, "period"),
    ],
)
def test_a_surface_that_cannot_be_is_refused(options: dict[str, object], words: str) -> None:
    mesh = Mesh(*box((1.0, 1.0, 1.0), 2))
    with pytest.raises(SurfaceError, match=words):
        Proxy(mesh, Surface(**options))  # type: ignore[arg-type]


def test_shapes_of_tips_and_paths_are_checked() -> None:
    proxy = Proxy(Mesh(*box((1.0, 1.0, 1.0), 2)))
    for shape in ((2,), (4,), (1, 3)):
        with pytest.raises(PalpateError, match=re.escape(f"a tip is three numbers in m; this has shape {shape}")):
            proxy.step(np.ones(shape))
    for shape in ((3,), (2, 2), (1, 2, 3)):
        with pytest.raises(PalpateError, match=re.escape(f"a path is (n, 3) numbers in m; this has shape {shape}")):
            proxy.simulate_path(np.ones(shape))
    with pytest.raises(SurfaceError, match="radius"):
        Proxy(proxy.mesh, radius=-1.0)


def test_what_is_no_mesh_surface_or_tip_is_refused() -> None:
    mesh = Mesh(*box((1.0, 1.0, 1.0), 2))
    with pytest.raises(PalpateError, match=r"Mesh\.load"):
        Proxy("liver.stl")  # type: ignore[arg-type]
    with pytest.raises(SurfaceError, match="Surface"):
        Proxy(mesh, 400.0)  # type: ignore[arg-type]
    with pytest.raises(SurfaceError, match="field"):
        Surface(field="smooth")  # type: ignore[arg-type]
    with pytest.raises(SurfaceError, match="static_friction"):
        Surface(static_friction=-1.0)
    with pytest.raises(PalpateError, match="without units"):
        Proxy(mesh).step(["0 mm", "0 mm", "1 mm"])  # type: ignore[list-item]


def test_the_stopwatch_counts_every_tick() -> None:
    """A measured median lies between nothing and a millisecond, and no tick is lost on the way."""
    found = time_steps(Mesh(*ball(12)), orbit(500), passes=2)
    assert 0.0 < found["median"] <= found["p99.9"] <= found["worst"] <= found["worst_single"]
    assert found["median"] < 1000.0
    assert found["lost"] == 0


@pytest.mark.parametrize("radius", [0.0, 1e-3])
def test_friction_where_soft_meets_stiff_is_that_of_what_is_touched(radius: float) -> None:
    """Dragged from 0.2 to 3.5 N/mm, the proxy lags no farther than friction on the triangle it reports would let it."""
    mesh = Mesh(*box((0.04, 0.04, 0.04), 16))
    stiff = np.where(mesh.vertices[mesh.triangles].mean(axis=1)[:, 0] < 0.0, 200.0, 3500.0)
    proxy = Proxy(mesh, Surface(stiffness=stiff, tangential=1000.0, static_friction=0.2), radius=radius)
    x = np.linspace(-2e-3, 6e-3, 1601)
    proxy.step([-2e-3, 1.3e-3, 0.06])
    contacts = proxy.simulate_path(np.stack([x, np.full_like(x, 1.3e-3), np.full_like(x, 0.0355 + radius)], axis=1))
    assert set(np.unique(contacts.stiffness)) == {200.0, 3500.0}
    assert np.all(x - contacts.position[:, 0] <= 0.2 * contacts.stiffness / 1000.0 * contacts.depth * (1 + 1e-9))


@pytest.mark.parametrize("radius", [0.0, 0.01])
@pytest.mark.parametrize("pieces", [12, 71])
def test_shading_takes_the_facets_out_of_a_ball(radius: float, pieces: int) -> None:
    """The force's steps from tick to tick are those of a true ball: 100 N/m times the step of the spring's vector."""
    path = orbit(6000)
    outward = path / np.linalg.norm(path, axis=1, keepdims=True)
    true = 100.0 * ((0.5 + radius) * outward - path)

    def steps(force: Array) -> float:
        return float(np.sqrt(np.mean(np.sum(np.diff(force, axis=0) ** 2, axis=1))))

    mesh = Mesh(*ball(pieces))
    contacts = Proxy(mesh, Surface(stiffness=100.0, shading="30 deg"), radius).simulate_path(path)
    assert contacts.touching.all()
    assert steps(contacts.force) == pytest.approx(steps(true), rel=0.05)
    assert np.linalg.norm(contacts.normal - outward, axis=1).max() < 0.1 / pieces
    assert steps(Proxy(mesh, Surface(stiffness=100.0), radius).simulate_path(path).force) > 1.2 * steps(true)


@pytest.mark.parametrize("radius", [0.0, 0.01])
def test_shaded_force_is_continuous_across_edges(radius: float) -> None:
    """Ten times as many ticks on the same way: the largest step of the force is a tenth; unshaded it stays."""
    mesh = Mesh(*ball(8))

    def largest(ticks: int, shading: float) -> float:
        angle = np.linspace(0.2, 1.3, ticks)
        way = 0.47 * np.stack([np.cos(angle), np.sin(angle), 0.3 * np.ones(ticks)], axis=1) / np.sqrt(1.09)
        force = Proxy(mesh, Surface(stiffness=100.0, shading=shading), radius).simulate_path(way).force
        return float(np.linalg.norm(np.diff(force[ticks // 20 :], axis=0), axis=1).max())

    assert largest(20_000, 0.5) < 0.15 * largest(2_000, 0.5)
    if radius == 0.0:
        assert largest(20_000, 0.0) > 0.7 * largest(2_000, 0.0)


@pytest.mark.parametrize("friction", [0.0, 0.5])
def test_shading_leaves_creases_alone(friction: float) -> None:
    """A box has nothing to shade: the same force as without, round its edges too."""
    mesh = Mesh(*box((0.05, 0.05, 0.05), 6))
    angle = np.linspace(0.0, 6.0, 4000)
    path = 0.049 * np.stack([np.cos(angle), np.sin(3 * angle), np.sin(2 * angle + 0.4)], axis=1)
    plain, shaded = (
        Proxy(mesh, Surface(static_friction=friction, shading=angle)).simulate_path(path).force for angle in (0.0, 0.5)
    )
    np.testing.assert_allclose(shaded, plain, atol=1e-3)


@pytest.mark.parametrize("angle", ["2 mm", -0.1, "100 deg", float("nan")])
def test_shading_is_an_angle(angle: float | str) -> None:
    with pytest.raises(SurfaceError, match="shading"):
        Proxy(Mesh(*box((1.0, 1.0, 1.0), 2)), Surface(shading=angle))


@pytest.mark.parametrize("shading", [0.0, 0.5])
def test_a_curved_mesh_gives_no_energy(shading: float) -> None:
    """Round closed paths on one stiffness: at edges the proxy drops to less energy, never to more; shaded, keeps it."""
    mesh = Mesh(*ball(22))
    angle = np.linspace(0.0, 2 * np.pi, 60_001)
    out = np.stack([np.cos(angle) + 0.2 * np.sin(2 * angle), np.sin(angle), 0.4 * np.sin(2 * angle)], axis=1)
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    path = (0.5 - 0.01 * (1.0 + 0.4 * np.sin(3 * angle)))[:, None] * out
    proxy = Proxy(mesh, Surface(stiffness=1000.0, shading=shading))
    proxy.step(1.2 * path[0])
    proxy.simulate_path(path[-1000:])
    work = np.sum(proxy.simulate_path(0.5 * (path[1:] + path[:-1])).force * np.diff(path, axis=0), axis=1)
    net = work.sum() / np.abs(work).sum()
    assert -0.05 < net < 1e-9 if shading == 0.0 else abs(net) < 1e-5
