"""Figures of a tip that presses a deformable body: deformation, force, stiffness and energy."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.fem import Body
from palpate.metrics.body_contact import JND, stiffness_along_path, work_so_far
from palpate.plotting.figures import thin
from palpate.plotting.style import COLOURS, FAINT, INK, TITLE, new_figure
from palpate.plotting.surface import coloured, frame, new_space
from palpate.simulation.trace import Trace

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["body_energy", "deformed", "force_and_deflection", "stiffness_along_path_figure"]

Array = NDArray[np.float64]

_FLAT: Final = 0.15  # of the body's longest extent: the least that an axis takes in its picture


def deformed(body: Body, displacement: ArrayLike, pressure: ArrayLike) -> Figure:
    """Return the touchable surface as it is pressed, in 3D: coloured by its displacement, and by the tip's pressure.

    Both are those of the nodes, and linear between them; the scales end at the largest.

    Args:
        body: any kind.
        displacement: of its nodes (n, 3), m, as `Body.indent` and `pressed_at` give it.
        pressure: on each node's patch (n,), Pa, as `Body.pressure`.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    figure, spaces = new_space(2, width=9.6)
    triangles, x = body.surface.triangles, _moved(body, displacement)
    shades = (
        (1e3 * np.linalg.norm(body.on_surface(displacement), axis=1), "displacement [mm]", "cividis"),
        (1e-3 * body.on_surface(pressure), "pressure [kPa]", "magma_r"),
    )
    for solid, (values, label, colours) in zip(spaces, shades, strict=True):
        scale = ScalarMappable(Normalize(0.0, max(float(values.max()), 1e-12)), colours)
        coloured(solid, x[triangles], values[triangles], scale)
        frame(solid, x, _FLAT, zoom=1.1)
        solid.view_init(elev=45, azim=-58)
        solid.xaxis.labelpad = solid.yaxis.labelpad = 8
        solid.zaxis.labelpad = 2
        solid.locator_params(nbins=4)
        solid.locator_params(axis="z", nbins=2)
        figure.colorbar(scale, ax=solid, shrink=0.6, pad=0.1, location="bottom", aspect=30, label=label)
    return figure


def force_and_deflection(trace: Trace) -> Figure:
    """Return force and deflection against time, and against each other."""
    size, deep = np.linalg.norm(trace["object_force"], axis=1), 1e3 * np.linalg.norm(trace["deflection"], axis=1)
    figure, rows = new_figure(1, 3, height=2.6, sharex=False)
    force, deflection, both = rows[0]
    force.plot(*thin(trace.time, size), color=COLOURS[0])
    force.set(xlabel="time [s]", ylabel="force [N]")
    deflection.plot(*thin(trace.time, deep), color=COLOURS[1])
    deflection.set(xlabel="time [s]", ylabel="deflection [mm]")
    both.plot(deep, size, color=INK, linewidth=1.1)
    both.set(xlabel="deflection [mm]", ylabel="force [N]")
    return figure


def stiffness_along_path_figure(trace: Trace) -> Figure:
    """Return force over deflection along the tip's way, and what a hand just notices above its median."""
    way, stiffness = stiffness_along_path(trace)
    figure, rows = new_figure(1, 1, height=2.6)
    panel = rows[0][0]
    median = float(np.median(stiffness))
    panel.axhspan(median, (1.0 + JND) * median, color=FAINT, alpha=0.22, linewidth=0)
    panel.plot(1e3 * way, stiffness, color=COLOURS[0])
    panel.set(xlabel="way across the force [mm]", ylabel="force / deflection [N/m]")
    panel.set_ylim(0.0, 1.1 * max(float(stiffness.max()), (1.0 + JND) * median))
    return figure


def body_energy(trace: Trace) -> Figure:
    """Return work on the body and energy stored in it against time, mJ; between them lies what it lost."""
    figure, rows = new_figure(1, 1, height=2.3)
    panel = rows[0][0]
    panel.plot(*thin(trace.time, 1e3 * work_so_far(trace)), color=COLOURS[2], label="work of the tip", linewidth=2.4)
    panel.plot(*thin(trace.time, 1e3 * trace["stored_energy"][:, 0]), color=INK, label="stored", linestyle=(0, (4, 3)))
    saved = trace["saved_energy"][:, 0]
    if saved.any():
        held = 1e3 * (trace["stored_energy"][:, 0] + saved)
        panel.plot(
            *thin(trace.time, held), color=COLOURS[1], label="stored and saved", linestyle=(0, (1, 2)), linewidth=2.4
        )
    panel.set(xlabel="time [s]", ylabel="energy [mJ]")
    panel.legend(loc="best")
    panel.set_title("", **TITLE)
    return figure


def _moved(body: Body, displacement: ArrayLike) -> Array:
    """Return where the vertices of the touchable surface are (v, 3), mm."""
    return np.asarray(1e3 * (body.surface.vertices + body.on_surface(displacement)))
