"""Figures of a tip in contact with a deformable body: deformation, force, stiffness and energy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.fem import Body
from palpate.metrics.body_contact import JND, stiffness_along_path, work_so_far
from palpate.plotting.figures import thin
from palpate.plotting.style import COLORS, FAINT, INK, TITLE, new_figure
from palpate.plotting.surface import draw_colored, frame, new_space
from palpate.simulation.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_MIN_AXIS: Final = 0.15  # smallest length of an axis over the longest one


def deformed_surface(body: Body, displacement: ArrayLike, pressure: ArrayLike) -> Figure:
    """Return 3D views of the deformed contact surface, colored by displacement and by pressure.

    Values are interpolated between the nodes. Each color scale ends at the maximum.

    Args:
        body: with any material model.
        displacement: of the contact nodes (n, 3), m, from `Body.indent` or `pressed_at`.
        pressure: on the patches of the nodes (n,), Pa, from `Body.pressure`.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    figure, spaces = new_space(2, width=9.6)
    triangles, x = body.surface.triangles, _moved(body, displacement)
    fields = (
        (1e3 * np.linalg.norm(body.on_surface(displacement), axis=1), "displacement [mm]", "cividis"),
        (1e-3 * body.on_surface(pressure), "pressure [kPa]", "magma_r"),
    )
    for solid, (values, label, colormap) in zip(spaces, fields, strict=True):
        scale = ScalarMappable(Normalize(0.0, max(float(values.max()), 1e-12)), colormap)
        draw_colored(solid, x[triangles], values[triangles], scale)
        frame(solid, x, _MIN_AXIS, zoom=1.1)
        solid.view_init(elev=45, azim=-58)
        solid.xaxis.labelpad = solid.yaxis.labelpad = 8
        solid.zaxis.labelpad = 2
        solid.locator_params(nbins=4)
        solid.locator_params(axis="z", nbins=2)
        figure.colorbar(scale, ax=solid, shrink=0.6, pad=0.1, location="bottom", aspect=30, label=label)
    return figure


def force_and_deflection(trace: Trace, below: Array | None = None) -> Figure:
    """Return force and deflection against time, and against each other.

    Args:
        trace: on a body.
        below: depth of the tip below the surface at rest (n,), m, to be drawn beside the deflection; None: not known.
    """
    size, deep = np.linalg.norm(trace["object_force"], axis=1), 1e3 * np.linalg.norm(trace["deflection"], axis=1)
    figure, rows = new_figure(1, 3, height=2.6, sharex=False)
    force, deflection, both = rows[0]
    force.plot(*thin(trace.time, size), color=COLORS[0])
    force.set(xlabel="time [s]", ylabel="force [N]")
    (patch,) = deflection.plot(*thin(trace.time, deep), color=COLORS[1])
    deflection.set(xlabel="time [s]", ylabel="deflection [mm]")
    if below is not None:
        patch.set_label("contact patch")
        tip: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 3)), "linewidth": 1.1, "label": "tip"}
        deflection.plot(*thin(trace.time, 1e3 * below), **tip)
        deflection.set(ylabel="depth [mm]")
        deflection.legend(loc="best")
    both.plot(deep, size, color=INK, linewidth=1.1)
    both.set(xlabel="deflection [mm]", ylabel="force [N]")
    return figure


def forces_and_deflections(traces: Sequence[Trace]) -> Figure:
    """Return force and deflection of several devices against time."""
    figure, rows = new_figure(1, 2, height=2.9)
    force, deflection = rows[0]
    for number, trace in enumerate(traces, 1):
        style: dict[str, Any] = {"color": COLORS[(number - 1) % len(COLORS)], "label": f"device {number}"}
        style["linestyle"] = "-" if number == 1 else (0, (4, 1.5 * (number - 1)))  # curves may coincide
        force.plot(*thin(trace.time, np.linalg.norm(trace["object_force"], axis=1)), **style)
        deflection.plot(*thin(trace.time, 1e3 * np.linalg.norm(trace["deflection"], axis=1)), **style)
    force.set(xlabel="time [s]", ylabel="force [N]")
    deflection.set(xlabel="time [s]", ylabel="deflection [mm]")
    handles, labels = force.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def stiffness_along_path_figure(trace: Trace) -> Figure:
    """Return force over deflection along the path of the tip, with the just-noticeable band above its median."""
    path, stiffness = stiffness_along_path(trace)
    figure, rows = new_figure(1, 1, height=2.6)
    panel = rows[0][0]
    median = float(np.median(stiffness))
    panel.axhspan(median, (1.0 + JND) * median, color=FAINT, alpha=0.22, linewidth=0)
    panel.plot(1e3 * path, stiffness, color=COLORS[0])
    panel.set(xlabel="path length normal to the force [mm]", ylabel="force / deflection [N/m]")
    panel.set_ylim(0.0, 1.1 * max(float(stiffness.max()), (1.0 + JND) * median))
    return figure


def body_energy(trace: Trace) -> Figure:
    """Return the work on the body and its stored energy against time, mJ; the difference is dissipated."""
    figure, rows = new_figure(1, 1, height=2.3)
    panel = rows[0][0]
    panel.plot(*thin(trace.time, 1e3 * work_so_far(trace)), color=COLORS[2], label="work of the tip", linewidth=2.4)
    panel.plot(*thin(trace.time, 1e3 * trace["stored_energy"][:, 0]), color=INK, label="stored", linestyle=(0, (4, 3)))
    tank = trace["tank_energy"][:, 0]
    if tank.any():
        total = 1e3 * (trace["stored_energy"][:, 0] + tank)
        style: dict[str, Any] = {"linestyle": (0, (1, 2)), "linewidth": 2.4}
        panel.plot(*thin(trace.time, total), color=COLORS[1], label="stored and in the energy tank", **style)
    panel.set(xlabel="time [s]", ylabel="energy [mJ]")
    panel.legend(loc="best")
    panel.set_title("", **TITLE)
    return figure


def _moved(body: Body, displacement: ArrayLike) -> Array:
    """Return the displaced vertices of the contact surface (v, 3), mm."""
    return np.asarray(1e3 * (body.surface.vertices + body.on_surface(displacement)))
