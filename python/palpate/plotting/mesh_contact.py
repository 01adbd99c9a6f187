"""Figures of a tip that slides over a mesh: path, profile, stiffness and depth."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from palpate.arrays import Array
from palpate.contact import Mesh
from palpate.contact.simplices import area_vectors
from palpate.plotting.figures import thin
from palpate.plotting.style import COLORS, FAINT, INK, new_figure
from palpate.plotting.surface import frame, new_space
from palpate.scenario import Scenario
from palpate.simulation.meshes import touched_mesh
from palpate.simulation.moving_frame import seen_from_object, touching_tip, turned_to_object
from palpate.simulation.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_MARGIN: Final = 6e-3  # m, of the surface around the path
_DASHED: Final = (0, (4, 3))


def trajectory(trace: Trace) -> Figure:
    """Return the paths of tip and proxy in 3D over the surface, mm from the start."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex
    from matplotlib.ticker import MaxNLocator
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    contact = trace["touching"][:, 0] > 0.0
    tip, proxy = touching_tip(trace), seen_from_object(trace, trace["proxy"])
    start = tip[0]
    tip, proxy = 1e3 * (tip - start), 1e3 * (proxy - start)
    proxy = np.where(contact[:, None], proxy, np.nan)
    mesh, stiffness = _surface_of(trace)
    corners = 1e3 * (mesh.vertices[mesh.triangles] - start)
    path = np.vstack([tip, proxy[contact]])
    low, high = path.min(axis=0) - 1e3 * _MARGIN, path.max(axis=0) + 1e3 * _MARGIN
    center = corners.mean(axis=1)
    facing = area_vectors(mesh.vertices, mesh.triangles) @ _mean_normal(trace) > 0.0
    shown = facing & np.all((center >= low) & (center <= high), axis=1)

    figure, (space,) = new_space()
    low_k, range_k = float(stiffness.min()), float(np.ptp(stiffness)) or 1.0
    shades = [to_hex(colormaps["Greys"](0.1 + 0.55 * (float(k) - low_k) / range_k)) for k in stiffness[shown]]
    space.add_collection3d(
        Poly3DCollection(corners[shown], facecolors=shades, edgecolors=FAINT, linewidths=0.25, alpha=0.55, zorder=1)
    )
    samples = np.linspace(0, len(tip) - 1, min(len(tip), 700)).astype(int)
    space.plot(*tip[samples].T, color=COLORS[1], linewidth=1.6, label="tip", zorder=3)
    space.plot(*proxy[samples].T, color=COLORS[0], linewidth=1.6, label="proxy", zorder=4)
    points = np.vstack([corners[shown].reshape(-1, 3), path])
    frame(space, points, 0.3, zoom=1.35)
    for artist in (*space.lines, *space.collections):
        artist.set(clip_on=False, in_layout=False)  # a zoom above 1 draws beyond the box of the axes
    for name in "xyz":
        axis = getattr(space, f"{name}axis")
        axis.labelpad = 12 if name == "x" else 2
        axis.set_major_locator(MaxNLocator(4))
    space.view_init(elev=24, azim=-68)
    space.legend(loc="upper right")
    return figure


def profile(trace: Trace) -> Figure:
    """Return the paths of tip and proxy in the plane of the normal and the direction of motion, mm from the start."""
    contact = trace["touching"][:, 0] > 0.0
    up = _mean_normal(trace)
    tip, proxy = touching_tip(trace), seen_from_object(trace, trace["proxy"])
    heading = _heading(tip[contact], up)
    figure, rows = new_figure(1, 1, height=2.6)
    side = rows[0][0]
    for name, color, points in (("tip", COLORS[1], tip), ("proxy", COLORS[0], proxy)):
        path = 1e3 * (points - tip[0])
        if name == "proxy":
            path = np.where(contact[:, None], path, np.nan)
        side.plot(path @ heading, path @ up, color=color, label=name)
    side.set_xlabel("along the path [mm]")
    side.set_ylabel("along the normal [mm]")
    side.legend(loc="best")
    return figure


def stiffness_and_depth(trace: Trace) -> Figure:
    """Return the stiffness under the tip and its depth against time, with F/K if there is a reference force."""
    contact = trace["touching"][:, 0] > 0.0
    stiffness = np.where(contact, trace["surface_stiffness"][:, 0], np.nan)
    figure, rows = new_figure(2, 1, height=2.2)
    (above,), (below,) = rows
    above.plot(trace.time, stiffness / 1e3, color=COLORS[2])
    above.set_ylabel("stiffness [N/mm]")
    above.set_ylim(0.0, 1.08 * float(np.nanmax(stiffness)) / 1e3)
    below.plot(*thin(trace.time, 1e3 * trace["depth"][:, 0]), color=COLORS[0], label="depth of the tip")
    if np.any(trace["reference_force"]):
        normal_force = np.maximum(0.0, -np.sum(trace["reference_force"] * trace["normal"], axis=1))
        expected = 1e3 * normal_force / np.where(stiffness > 0.0, stiffness, np.nan)
        below.plot(trace.time, expected, color=INK, linestyle=_DASHED, linewidth=1.1, label="F/K")
    below.set_ylabel("depth [mm]")
    below.set_xlabel("time [s]")
    below.legend(loc="best")
    return figure


def _surface_of(trace: Trace) -> tuple[Mesh, Array]:
    """Return the mesh of a trace in the device frame, in its own if it moves; and its stiffness per triangle (m,)."""
    scenario = Scenario.from_dict(trace.scenario)
    moving = scenario.object.frame is not None
    origin = np.zeros(3) if moving else trace["tip"][0] + np.array(scenario.object.position)
    mesh, surface = touched_mesh(scenario, origin)
    values = np.asarray(surface.stiffness, dtype=float)
    if len(values) == len(mesh.vertices) != len(mesh.triangles):
        values = values[mesh.triangles].mean(axis=1)
    return mesh, np.broadcast_to(values, len(mesh.triangles))


def _mean_normal(trace: Trace) -> Array:
    """Return the mean unit normal in contact (3,), in the frame of the mesh if that moves."""
    mean = turned_to_object(trace, trace["normal"])[trace["touching"][:, 0] > 0.0].mean(axis=0)
    return np.asarray(mean / np.linalg.norm(mean), dtype=float)


def _heading(path: Array, up: Array) -> Array:
    """Return the tangential direction (3,) from the start to the end of a path (n, 3); zero if they coincide."""
    chord = path[-1] - path[0]
    chord = chord - (chord @ up) * up
    length = np.linalg.norm(chord)
    return np.asarray(chord / length if length > 0.0 else np.zeros(3), dtype=float)
