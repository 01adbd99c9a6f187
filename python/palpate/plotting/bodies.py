"""Pictures of bodies: the phantom, pressed and swept over; and one press on three kinds of the same body."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from palpate.fem.body import Body
from palpate.plotting.style import COLOURS, FAINT, INK, PAPER, TITLE, new_figure
from palpate.plotting.surface import coloured, frame, stretched

__all__ = ["draw_kinds", "draw_sweep"]


def draw_sweep(
    lump: Body, plain: Body, path: str | Path, *, radius: float = 8e-3, depth: float = 3e-3, height: float = 0.05
) -> float:
    """Draw a flat end pressed over the nodule of `lump`, and its force along sweeps over `lump` and `plain`; as PNG.

    Returns the largest force over the nodule by that over the plain body at the same place.
    """
    figure, ((left, right),) = new_figure(1, 2, width=10.5, height=4.0, sharex=False)
    left.remove()
    solid: Any = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False)
    felt = lump.indent([0.05, 0.05, height], radius, depth, tip="flat")
    displacement = lump.on_surface(felt.displacement)
    moved, down = (lump.surface.vertices + displacement - [0.0, 0.0, height]) * 1e3, -displacement[:, 2] * 1e3
    triangles = lump.surface.triangles
    scale = ScalarMappable(Normalize(0.0, depth * 1e3), "cividis")
    coloured(solid, moved[triangles], down[triangles], scale)
    frame(solid, moved, 0.16)
    solid.view_init(elev=36, azim=-58)
    solid.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="height [mm]")
    solid.set_zticks([-depth * 1e3, 0])
    solid.xaxis.labelpad = solid.yaxis.labelpad = 9
    solid.set_title(f"Flat end of {radius * 2e3:g} mm, pressed {depth * 1e3:g} mm", **TITLE)
    solid.text2D(0.0, 0.97, stretched(figure).strip(), transform=solid.transAxes, fontsize=9, va="top", color=INK)
    figure.colorbar(scale, ax=solid, shrink=0.55, pad=0.14, label="displacement, down [mm]")
    along = np.linspace(0.015, 0.085, 281)
    way = np.stack([along, np.full_like(along, 0.05), np.full_like(along, height - depth)], axis=1)
    forces = [body.simulate_path(way, radius, outward=[0, 0, 1], tip="flat").force[:, 2] for body in (lump, plain)]
    for force, colour, label in zip(forces, COLOURS, ("with the nodule", "without"), strict=False):
        right.plot(along * 1e3, force, color=colour, label=label)
    right.axvspan(42.5, 57.5, color=FAINT, alpha=0.18, lw=0)
    right.set(xlabel="place of the end along x [mm]", ylabel="force [N]", ylim=(0, None))
    right.annotate(
        "nodule, 5 mm deep", (50, 0.04), xycoords=("data", "axes fraction"), ha="center", color=INK, fontsize=9
    )
    right.set_title("Force along a sweep", **TITLE)
    right.legend(loc="lower right", bbox_to_anchor=(1, 0.12), frameon=False)
    figure.savefig(Path(path), dpi=150, facecolor=PAPER)
    middle = len(along) // 2
    return float(forces[0][middle] / forces[1][middle])


def draw_kinds(
    body: Body,
    path: str | Path,
    *,
    radius: float = 15e-3,
    depth: float = 3e-3,
    width: float = 0.06,
    height: float = 0.03,
) -> dict[str, float]:
    """Draw a sphere pressed into a block as finite elements, lattice and spline: its top, and force by depth; as PNG.

    `width` and `height` of the block, m. Returns each kind's force at `depth`, N.
    """
    kinds = {
        "finite elements": body,
        "mass_spring": body.mass_spring(1e-3, rayleigh_alpha=20.0, rayleigh_beta=2e-3),
        "free_form": body.free_form(),
    }
    figure, ((left, right),) = new_figure(1, 2, width=10.5, height=4.0, sharex=False)
    middle = width / 2
    row = np.flatnonzero(np.abs(body.nodes[:, 1] - middle) < 1e-6)
    row = row[np.argsort(body.nodes[row, 0])]
    around = np.linspace(-np.pi, 0.0, 200)
    ball = (radius * np.cos(around), radius * (1.0 + np.sin(around)) - depth)
    left.fill(*(1e3 * np.array(ball)), color=FAINT, alpha=0.25, lw=0)
    depths = np.linspace(0.0, depth, 13)
    found = {}
    for (name, kind), colour, style in zip(kinds.items(), COLOURS, ("-", "--", ":"), strict=False):
        presses = [kind.indent([middle, middle, height], radius, d) for d in depths]
        moved = presses[-1].displacement[row]
        across, up = body.nodes[row, 0] + moved[:, 0] - middle, moved[:, 2]
        left.plot(across * 1e3, up * 1e3, style, color=colour, lw=2, marker=".", ms=7, label=name)
        right.plot(depths * 1e3, [felt.force[2] for felt in presses], style, color=colour, lw=2, label=name)
        found[name] = float(presses[-1].force[2])
    left.set(
        xlabel="place along x [mm]", ylabel="height over the rest [mm]", xlim=(-28, 28), ylim=(-1.25e3 * depth, 1.8)
    )
    left.set_title(f"Under a sphere of {radius * 1e3:g} mm radius, {depth * 1e3:g} mm deep", **TITLE)
    right.set(xlabel="depth [mm]", ylabel="force [N]", xlim=(0, depth * 1e3), ylim=(0, None))
    right.set_title("Force on the sphere", **TITLE)
    right.legend(loc="upper left", frameon=False)
    figure.savefig(Path(path), dpi=150, facecolor=PAPER)
    return found
