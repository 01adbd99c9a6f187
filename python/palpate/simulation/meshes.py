"""Mesh and surface of a scenario's [object.mesh] and [object.surface], in the device frame."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.arrays import Array, Indices
from palpate.contact import Mesh, Surface
from palpate.devices import Device
from palpate.errors import PalpateError
from palpate.scenario.model import Scenario
from palpate.scenario.touched import MeshChoice, SurfaceChoice

Triangles = Indices


def touched_mesh(scenario: Scenario, origin: Array) -> tuple[Mesh, Surface]:
    """Return the mesh of a scenario's object of kind "mesh", its origin at `origin` (3,), m, and its surface.

    Raises:
        ScenarioError: the file cannot be read, or the surface does not match the mesh.
    """
    touched = scenario.object
    assert touched.mesh is not None
    assert touched.surface is not None
    try:
        own = _mesh(touched.mesh)
    except PalpateError as problem:
        field, _, reason = str(problem).partition(": ")
        if field == "unit":
            raise scenario.mistake("object.mesh.unit", reason) from None
        raise scenario.mistake(
            f"object.mesh.{'shape' if touched.mesh.file is None else 'file'}", str(problem)
        ) from None
    turn = Rotation.from_euler("xyz", touched.mesh.rotation).as_matrix()
    mesh = Mesh(own.vertices @ turn.T + origin, own.triangles, open=touched.mesh.open, repair=False)
    surface = _surface(touched.surface, own, scenario.period)
    try:
        surface.core_for(mesh)
    except PalpateError as problem:
        field, _, reason = str(problem).partition(" ")
        raise scenario.mistake(f"object.surface.{field}", reason) from None
    return mesh, surface


def mesh_origin(scenario: Scenario) -> Array:
    """Return the origin of a scenario's mesh in the device frame (3,), m: at the start tip as the encoders read it."""
    device, start = scenario.load_device(), scenario.start
    pose = device.inverse(start.tip) if start.tip is not None else np.array(start.pose, dtype=float)
    return np.asarray(sensed_tip(scenario, device, pose) + np.array(scenario.object.position), dtype=float)


def sensed_tip(scenario: Scenario, device: Device, start: Array) -> Array:
    """Return the tip at a start pose (dof,) as the encoders read it (3,), m.

    An object is placed there; otherwise a stiff one would push at rest.
    """
    pose, step = start.copy(), device.encoder_step
    counted = scenario.device.encoder & (step > 0.0)
    pose[counted] = np.rint(start[counted] / step[counted]) * step[counted]
    return device.forward(pose)


def box_mesh(edge: float, divisions: int) -> tuple[Array, Triangles]:
    """Return vertices (n, 3), m, and triangles (m, 3) of a cube; the origin is the middle of its top.

    Each face has `divisions` squares of two triangles along an edge, with parallel diagonals.
    """
    n = divisions
    steps = np.arange(n + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    i, j = (grid.ravel() for grid in np.meshgrid(steps[:-1], steps[:-1], indexing="ij"))
    a, b, c, d = i * (n + 1) + j, (i + 1) * (n + 1) + j, (i + 1) * (n + 1) + j + 1, i * (n + 1) + j + 1
    face = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    grids: list[Indices] = []
    triangles: list[Indices] = []
    for axis in range(3):
        for high in (True, False):
            points = np.zeros((len(u), 3), dtype=np.int64)
            points[:, axis] = n if high else 0
            points[:, (axis + 1) % 3], points[:, (axis + 2) % 3] = u, v
            triangles.append((face if high else face[:, ::-1]) + len(grids) * len(u))
            grids.append(points)
    whole, same = np.unique(np.concatenate(grids), axis=0, return_inverse=True)
    vertices = whole * (edge / n) - np.array([edge / 2.0, edge / 2.0, edge])
    return vertices, same.reshape(-1)[np.concatenate(triangles)].astype(np.int64)


def bumpy_ellipsoid(size: tuple[float, float, float], bump: float, divisions: int) -> tuple[Array, Triangles]:
    """Return vertices (n, 3), m, and triangles (m, 3) of an ellipsoid with smooth bumps; its top is the origin.

    The mesh is an icosphere, subdivided `divisions` times. The point in direction e (unit) lies at size/2 * e * r(e),
    r = 1 + bump (sin(5 x + 1) sin(4 y + 2) + sin(3 z) cos(4 x + 3 y)) / 2, so |r - 1| <= bump.
    """
    import trimesh

    sphere = trimesh.creation.icosphere(subdivisions=divisions)
    e = np.asarray(sphere.vertices, dtype=float)
    half = np.asarray(size) / 2.0
    top = half * np.array([0.0, 0.0, 1.0]) * _bumps(np.array([[0.0, 0.0, 1.0]]), bump)[0]
    return e * _bumps(e, bump)[:, None] * half - top, np.asarray(sphere.faces, dtype=np.int64)


def _bumps(e: Array, bump: float) -> Array:
    x, y, z = e.T
    waves = np.sin(5 * x + 1) * np.sin(4 * y + 2) + np.sin(3 * z) * np.cos(4 * x + 3 * y)
    return np.asarray(1.0 + 0.5 * bump * waves, dtype=float)


def _mesh(choice: MeshChoice) -> Mesh:
    if choice.file is not None and choice.unit is not None:
        return Mesh.load(choice.file, unit=choice.unit, open=choice.open)
    return _shape(choice.edge, choice.size, choice.bump, choice.divisions)


@lru_cache(maxsize=8)
def _shape(
    edge: float | None, size: tuple[float, float, float] | None, bump: float | None, divisions: int | None
) -> Mesh:
    assert divisions is not None
    if edge is not None:
        return Mesh(*box_mesh(edge, divisions))
    assert size is not None
    assert bump is not None
    return Mesh(*bumpy_ellipsoid(size, bump, divisions))


def _surface(choice: SurfaceChoice, own: Mesh, period: float) -> Surface:
    """Return the surface; its patterns refer to the mesh in its own frame."""
    values = np.array(choice.stiffness)
    if choice.pattern in ("stripes", "checkerboard"):
        assert choice.width is not None
        middle = own.vertices[own.triangles].mean(axis=1) - own.vertices.min(axis=0)
        bands = np.floor(middle / choice.width).astype(np.int64)
        number = bands[:, 0] if choice.pattern == "stripes" else bands[:, 0] + bands[:, 1]
        values = values[number % len(values)]
    return Surface(
        stiffness=values,
        tangential=choice.tangential,
        static_friction=choice.static_friction,
        dynamic_friction=choice.dynamic_friction,
        viscous=choice.viscous,
        damping=choice.damping,
        field=choice.field,
        shading=choice.shading,
        period=period,
    )
