"""A press into a body in pictures: the deformed body, force against deflection, energy, and the numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.loop.palpation import JND, felt_along, work_so_far
from palpate.report.figures import thin
from palpate.report.numbers import Number, numbers_table
from palpate.report.style import COLOURS, FAINT, INK, TITLE, new_figure
from palpate.report.surface import coloured, frame, new_space, stretched

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from palpate.bodies import Body
    from palpate.loop.trace import Trace
    from palpate.report.html import Page

__all__ = ["body_energy", "deformed", "felt", "force_and_deflection", "palpation_section", "palpation_table"]

Array = NDArray[np.float64]
_FLAT: Final = 0.15  # of the body's longest extent: the least that an axis takes in its picture
# what, key in summary["palpation"], unit, factor
_NUMBERS: Final[tuple[Number, ...]] = (
    ("deepest deflection", "deepest_m", "mm", 1e3),
    ("force there", "deepest_force_N", "N", 1.0),
    ("force over deflection there", "stiffness_N_per_m", "N/m", 1.0),
    ("nodes pressed there", "nodes", "", 1.0),
    ("way of the tip in contact", "path_m", "mm", 1e3),
    ("touches", "touches", "", 1.0),
    ("deflection at the end", "final_deflection_m", "mm", 1e3),
    ("force at the end", "final_force_N", "N", 1.0),
    ("swing of the force at the end", "final_swing_N", "mN", 1e3),
    ("work of the tip on the body", "work_J", "mJ", 1e3),
    ("stored in it at the first sample", "at_start_J", "mJ", 1e3),
    ("stored in the body at the end", "stored_J", "mJ", 1e3),
    ("saved for snapshots to come", "saved_J", "mJ", 1e3),
    ("lost in the body", "lost_J", "mJ", 1e3),
    ("added by holding the force from sample to sample", "held_J", "mJ", 1e3),
)


def palpation_section(page: Page, trace: Trace, found: dict[str, Any]) -> None:
    """Write what a press into a body shows on the page of a run; `found` is `trace.summary()["palpation"]`."""
    from palpate.loop.body import pressed_at

    deepest = int(np.argmax(np.linalg.norm(trace["deflection"], axis=1)))
    page.section("The body")
    at = pressed_at(trace, deepest)
    picture = deformed(at.body, at.displacement, at.pressure)
    page.figure(
        picture,
        f"The body's surface at t = {trace.time[deepest]:.3g} s, where it is pressed deepest, in its own frame: how "
        "far it has moved, and the pressure of the tip on it." + stretched(picture),
    )
    page.figure(force_and_deflection(trace), "Force of the tip on the body, and how far the pressed patch has moved.")
    if found["felt_most_N_per_m"] is not None:
        rise = found["felt_most_N_per_m"] / found["felt_median_N_per_m"] - 1.0
        page.figure(
            felt(trace),
            f"Stiffness felt along the way: at most {100 * rise:.3g} % over its median, "
            f"{'more' if rise > JND else 'less'} than the {100 * JND:g} % (band) that a hand just notices.",
        )
    page.figure(body_energy(trace), "Work of the tip on the body, and what pressing has stored in it.")
    palpation_table(page, found)


def palpation_table(page: Page, found: dict[str, Any]) -> None:
    """Write the numbers of a press as a table."""
    shown = [number for number in _NUMBERS if number[1] not in ("saved_J", "at_start_J") or found[number[1]]]
    numbers_table(page, shown, found, "The press in numbers, from the first touch to the end of the run.")


def deformed(body: Body, displacement: ArrayLike, pressure: ArrayLike) -> Figure:
    """Return the touchable surface as it is pressed, in 3D: coloured by its displacement, and by the tip's pressure.

    Both are those of the nodes, and linear between them; the scales end at the largest.

    Args:
        body: any kind.
        displacement: of its nodes (n, 3), m, as `Body.press` and `pressed_at` give it.
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


def felt(trace: Trace) -> Figure:
    """Return force over deflection along the tip's way, and what a hand just notices above its median."""
    way, stiffness = felt_along(trace)
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
