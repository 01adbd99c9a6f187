"""Places at which a run touches a mesh: the loop linearized there, and the surface around them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace

import control
import numpy as np
from numpy.typing import NDArray

from palpate.arrays import Array
from palpate.contact import Mesh, Surface
from palpate.contact.simplices import area_vectors
from palpate.control.controller import Controller
from palpate.errors import StabilityError
from palpate.scenario import Scenario
from palpate.simulation.contact_law import ContactLaw
from palpate.simulation.controllers import build_controller
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.meshes import mesh_origin, touched_mesh
from palpate.simulation.proxy_law import ProxyProbe
from palpate.simulation.trace import Trace
from palpate.stability.mesh_modes import (
    ContactMode,
    SurfacePoint,
    edge_modes,
    face_modes,
    vertex_mode,
)

__all__ = ["NORMAL_RESOLUTION", "Site", "TouchedSurface"]

Faces = NDArray[np.int64]
NORMAL_RESOLUTION = np.radians(6.0)  # normals within this angle are represented by one
NEAR = 2e-3  # m: faces this near to the path of the proxy are tested
POINTS = 50  # of the path, from which the distance of a face is measured
GROUPS = 8  # largest number of normals at a site; more are represented more coarsely
FLAT = 1e-6  # height of a neighbor's corner over a face, relative to the edge, above which their edge is a valley
SLIDES = 8  # directions of slip measured on a curved surface
KEPT = 0.95  # share of the lag that these slips keep: a slow slide, so that the contact hardly moves in a tick


@dataclass(frozen=True, eq=False)
class Site:
    """Pose of the run in contact, and the contact modes around it.

    Attributes:
        row: sample of the trace.
        time: s.
        loop: the loop of a unit spring at this pose; its path is that of every contact.
        points: surface points, one for each group of normals and each stiffness.
        resolution: largest angle between the normal of a face and that of its group, rad.
        modes: contact modes of the faces near the proxy.
        resting: the mode at this sample of a proxy that keeps its place, or without friction follows the tip.
        point: surface under the proxy, with its dynamic friction.
        face: corners of the flat face under the proxy (3, 3), m; None where the law depends on the place.
    """

    row: int
    time: float
    loop: ScenarioLoop
    points: tuple[SurfacePoint, ...]
    resolution: float
    modes: tuple[ContactMode, ...]
    resting: ContactMode
    point: SurfacePoint
    face: Array | None

    @property
    def path(self) -> control.StateSpace:
        """Return the path from the force on the object to the motion of the tip."""
        return self.loop.path


class TouchedSurface:
    """Mesh of a scenario in the device frame, its surface, and the loop around it.

    Attributes:
        scenario: the scenario.
        mesh: the mesh.
        surface: the surface.
        curved: whether the law of a contact depends on the place, by shading, a continuous field or a spherical tip.
    """

    def __init__(self, scenario: Scenario) -> None:
        self.scenario = scenario
        device = scenario.load_device()
        start = scenario.start
        pose = device.inverse(start.tip) if start.tip is not None else np.array(start.pose, dtype=float)
        self.mesh, self.surface = touched_mesh(scenario, mesh_origin(scenario))
        assert scenario.object.mesh is not None
        self.radius = scenario.object.mesh.radius
        self.curved = self.surface.shading != 0.0 or self.surface.field == "continuous" or self.radius > 0.0
        self.controller: Controller = build_controller(scenario, device, pose)
        tables = scenario.to_dict()
        self._spring = Scenario.from_dict({**tables, "object": {"kind": "spring", "stiffness": "1 N/m"}})
        normals = area_vectors(self.mesh.vertices, self.mesh.triangles)
        self.normals: Array = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        self.stiffness = face_stiffness(self.surface, self.mesh)

    def loop(self, trace: Trace, row: int) -> ScenarioLoop:
        """Return the loop at a sample of a trace, around a unit spring in every direction."""
        return scenario_loop(
            self._spring,
            pose=trace["angle"][row],
            tip_force=trace["command_force"][row],
            operator_force=trace["operator_force"][row],
            controller=None if self.scenario.controller.kind == "workspace" else self.controller,
        )

    def point(self, normal: Array, stiffness: float, damping: float, *, static: bool = True) -> SurfacePoint:
        """Return the surface with a normal and a stiffness (N/m); with static or with dynamic friction.

        A normalized controller sees the design stiffness along the normal. The friction's limit, a force, remains.
        """
        s, period = self.surface, self.scenario.period
        tangential = stiffness if s.tangential is None else float(s.tangential)
        friction = s.static_friction if static or s.dynamic_friction is None else s.dynamic_friction
        drag = float(s.viscous) / (period * tangential) if tangential > 0.0 else 0.0
        seen = self._ratio(normal, stiffness)
        return SurfacePoint(normal, seen * stiffness, tangential, friction / seen, drag, seen * damping, period)

    def _ratio(self, normal: Array, stiffness: float) -> float:
        """Return the factor on the normal force by which the controller scales it, 1 unless it is normalized."""
        design = self.controller.design_stiffness
        return 1.0 if design is None or not stiffness > 0.0 else float(normal**2 @ np.asarray(design)) / stiffness

    def site(self, trace: Trace, row: int, faces: Faces) -> Site:
        """Return the site at a sample, with the modes of ``faces`` (indices)."""
        damping = float(np.max(np.asarray(self.surface.damping)))
        groups, resolution = group_normals(self.normals[faces], self.stiffness[faces])
        points = [
            self.point(normal, k, damping) for normal, low, high in groups for k in sorted({low, high}) if k > 0.0
        ]
        modes = [mode for point in points for mode in self._face(point)]
        modes += self._valleys(faces, damping)
        here = self.point(trace["normal"][row], float(trace["surface_stiffness"][row, 0]), damping)
        rest, slips = self._measured(trace, row, damping)
        resting = rest or self._face(here)[0]
        modes += [resting, *slips]
        loop, time = self.loop(trace, row), float(trace.time[row])
        slow = self.point(here.normal, here.stiffness, damping, static=False)
        triangle = int(trace["triangle"][row, 0])
        face = None if self.curved or triangle < 0 else self.mesh.vertices[self.mesh.triangles[triangle]]
        return Site(row, time, loop, tuple(points), resolution, tuple(modes), resting, slow, face)

    def _face(self, point: SurfacePoint) -> list[ContactMode]:
        """Return the modes on a face; a proxy slides with the dynamic friction."""
        modes = face_modes(point)
        dynamic = self.surface.dynamic_friction
        if dynamic is None or dynamic == point.friction:
            return modes
        slides = face_modes(replace(point, friction=dynamic))
        return [mode for mode in modes if mode.kind == "sticking"] + [m for m in slides if m.kind != "sticking"]

    def _valleys(self, faces: Faces, damping: float) -> list[ContactMode]:
        """Return the modes of the valley edges and vertices among ``faces``."""
        modes: list[ContactMode] = []
        if self.radius > 0.0 or self.surface.shading != 0.0:
            return (
                modes  # shading hides them; a sphere bridges other valleys: they are measured where the run meets them
            )
        vertices, triangles = self.mesh.vertices, self.mesh.triangles
        known: dict[tuple[int, int], int] = {}
        ends: Counter[int] = Counter()
        seen: list[Array] = []
        for f in faces.tolist():
            for i in range(3):
                a, b = int(triangles[f, i]), int(triangles[f, (i + 1) % 3])
                other = known.pop((b, a), None)
                if other is None:
                    known[a, b] = f
                    continue
                edge = vertices[b] - vertices[a]
                apex = vertices[next(v for v in triangles[other] if v not in (a, b))]
                if (apex - vertices[a]) @ self.normals[f] <= FLAT * np.linalg.norm(edge):
                    continue
                ends.update((a, b))
                t = edge / np.linalg.norm(edge)
                pair = {float(self.stiffness[f, 1]), float(self.stiffness[other, 1])}
                if any(abs(t @ one) > np.cos(NORMAL_RESOLUTION) for one in seen):
                    continue
                seen.append(t)
                for side in (f, other):
                    for k in sorted(pair):
                        modes += edge_modes(self.point(self.normals[side], k, damping, static=False), t)
        held = [v for v, count in ends.items() if count > 1]
        if held:
            k = float(self.stiffness[faces, 1].max())
            modes.append(vertex_mode(self.point(self.normals[faces[0]], k, damping)))
        return modes

    def _measured(self, trace: Trace, row: int, damping: float) -> tuple[ContactMode | None, list[ContactMode]]:
        """Return the mode at rest and those of slips, measured on the proxy itself where it is at a sample.

        The mode at rest is None if its law is not smooth there. Slips are measured on a curved surface only, and those
        of a sphere are those on flat faces.
        """
        place, triangle = trace["proxy"][row], int(trace["triangle"][row, 0])
        normal, depth = trace["normal"][row], float(trace["depth"][row, 0])
        own = replace(self.surface, damping=0.0)
        here = self.point(normal, float(trace["surface_stiffness"][row, 0]), damping, static=False)
        ratio = self._ratio(normal, float(trace["surface_stiffness"][row, 0]))
        tip, period, when = place - depth * normal, self.scenario.period, f"at t = {trace.time[row]:.3g} s"
        law = ProxyProbe(self.mesh, own.core_for(self.mesh), self.radius).law(triangle, normal, place, tip)
        rest = None

        def seen(law: ContactLaw) -> ContactLaw:
            damped = law.damped(damping, normal, period)
            return damped if ratio == 1.0 else damped.scaled(ratio, normal if here.rubs else None)

        if law is not None:
            kind = "sticking" if here.rubs else "face"
            rest = ContactMode(kind, f"at rest {when}", seen(law), normal)
        slips: list[ContactMode] = []
        if not self.curved or self.radius > 0.0 or not here.rubs or np.isinf(here.friction) or here.friction == 0.0:
            return rest, slips
        sliding = replace(own, static_friction=here.friction * ratio, dynamic_friction=here.friction * ratio)
        probe = ProxyProbe(self.mesh, sliding.core_for(self.mesh), self.radius)
        kept = max(KEPT, 0.5 * (1.0 + here.least_kept))
        lag = here.friction * here.stiffness / here.tangential * depth / ((1 + here.drag) * kept - here.drag)
        for angle in 2.0 * np.pi * np.arange(SLIDES) / SLIDES:
            s = np.array([np.cos(angle), np.sin(angle)]) @ here.tangents()
            law = probe.law(triangle, normal, place, tip + lag * s)
            if law is not None:
                name = f"sliding {when} along ({s[0]:.2f}, {s[1]:.2f}, {s[2]:.2f})"
                slips.append(ContactMode("sliding", name, seen(law), normal))
        return rest, slips


def contact_rows(trace: Trace, count: int, last: int) -> list[int]:
    """Return up to ``count`` samples in contact, spread over the path of the proxy, the last of them ``last``.

    Raises:
        StabilityError: the tip never touches the mesh.
    """
    touching = np.flatnonzero((trace["touching"][: last + 1, 0] > 0.0) & (trace["depth"][: last + 1, 0] > 0.0))
    if touching.size == 0:
        raise StabilityError(
            "object: the tip never touches the mesh in this run; move the mesh (object.position) or press longer "
            "(run.duration)"
        )
    depth = trace["depth"][touching, 0]
    firm = touching[depth >= 0.25 * np.median(depth)]  # not the first graze
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(trace["proxy"][firm], axis=0), axis=1))])
    goals = np.linspace(0.0, travelled[-1], count)
    rows = {int(firm[min(int(np.searchsorted(travelled, goal)), len(firm) - 1)]) for goal in goals}
    return sorted({*rows, int(firm[-1])})


def faces_near(mesh: Mesh, visited: Faces, path: Array) -> Faces:
    """Return the ``visited`` faces and those within ``NEAR`` of the ``path`` (k, 3) that share a corner with one."""
    from trimesh.triangles import closest_point

    corners = np.zeros(len(mesh.vertices), dtype=bool)
    corners[mesh.triangles[visited].ravel()] = True
    ring = np.setdiff1d(np.flatnonzero(corners[mesh.triangles].any(axis=1)), visited)
    places = path[:: max(len(path) // POINTS, 1)]
    pairs = np.repeat(mesh.vertices[mesh.triangles[ring]], len(places), axis=0)
    points = np.tile(places, (len(ring), 1))
    nearest: Array = closest_point(pairs, points)  # type: ignore[no-untyped-call]
    away = np.linalg.norm(nearest - points, axis=1).reshape(len(ring), len(places))
    return np.union1d(visited, ring[away.min(axis=1) <= NEAR]).astype(np.int64)


def face_stiffness(surface: Surface, mesh: Mesh) -> Array:
    """Return the least and largest stiffness on each face (m, 2), N/m."""
    values = np.atleast_1d(np.asarray(surface.stiffness, dtype=float))
    faces, vertices = len(mesh.triangles), len(mesh.vertices)
    if len(values) == 1:
        return np.full((faces, 2), values[0])
    if len(values) == faces and surface.field == "discrete":
        return np.stack([values, values], axis=1)
    if len(values) == faces:  # spread over the vertices: between the extremes around them
        low, high = np.full(vertices, np.inf), np.zeros(vertices)
        for i in range(3):
            np.minimum.at(low, mesh.triangles[:, i], values)
            np.maximum.at(high, mesh.triangles[:, i], values)
    else:
        low = high = values
    return np.stack([low[mesh.triangles].min(axis=1), high[mesh.triangles].max(axis=1)], axis=1)


def group_normals(
    normals: Array, stiffness: Array, resolution: float = NORMAL_RESOLUTION
) -> tuple[list[tuple[Array, float, float]], float]:
    """Return groups of faces (normal, least and largest stiffness), and the largest angle in a group, rad.

    The angle grows from ``resolution`` until there are few enough groups.
    """
    groups: list[tuple[Array, float, float]] = []
    left, widest = np.arange(len(normals)), 0.0
    while left.size:
        cosine = normals[left] @ normals[left[0]]
        members = left[cosine >= np.cos(resolution)]
        widest = max(widest, float(np.arccos(np.clip(normals[members] @ normals[left[0]], -1.0, 1.0)).max()))
        groups.append((normals[left[0]], float(stiffness[members, 0].min()), float(stiffness[members, 1].max())))
        left = left[cosine < np.cos(resolution)]
    if len(groups) > GROUPS:
        return group_normals(normals, stiffness, 1.5 * resolution)
    return groups, widest
