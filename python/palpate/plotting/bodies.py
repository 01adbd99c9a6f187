"""Figures of bodies: a sweep over the phantom, and an indentation of three material models."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from palpate.fem.body import Body
from palpate.plotting.style import COLORS, FAINT, INK, PAPER, TITLE, new_figure
from palpate.plotting.surface import draw_colored, frame, stretched


def draw_sweep(
    with_nodule: Body,
    without_nodule: Body,
    path: str | Path,
    *,
    radius: float = 8e-3,
    depth: float = 3e-3,
    height: float = 0.05,
) -> float:
    """Draw the phantom indented by a flat end over its nodule, and the force along sweeps; write a PNG file.

    Args:
        with_nodule: phantom with the nodule.
        without_nodule: phantom without the nodule.
        path: file to write.
        radius: of the flat end, m.
        depth: of the indentation, m.
        height: of the phantom, m.

    Returns:
        The force over the nodule over the force at the same position without it.
    """
    figure, ((left, right),) = new_figure(1, 2, width=10.5, height=4.0, sharex=False)
    left.remove()
    solid: Any = figure.add_subplot(1, 2, 1, projection="3d", computed_zorder=False)
    indentation = with_nodule.indent([0.05, 0.05, height], radius, depth, tip="flat")
    displacement = with_nodule.on_surface(indentation.displacement)
    moved = (with_nodule.surface.vertices + displacement - [0.0, 0.0, height]) * 1e3
    down = -displacement[:, 2] * 1e3
    triangles = with_nodule.surface.triangles
    scale = ScalarMappable(Normalize(0.0, depth * 1e3), "cividis")
    draw_colored(solid, moved[triangles], down[triangles], scale)
    frame(solid, moved, 0.16)
    solid.view_init(elev=36, azim=-58)
    solid.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="height [mm]")
    solid.set_zticks([-depth * 1e3, 0])
    solid.xaxis.labelpad = solid.yaxis.labelpad = 9
    solid.set_title(f"Flat end of {radius * 2e3:g} mm, depth {depth * 1e3:g} mm", **TITLE)
    solid.text2D(0.0, 0.97, stretched(figure).strip(), transform=solid.transAxes, fontsize=9, va="top", color=INK)
    figure.colorbar(scale, ax=solid, shrink=0.55, pad=0.14, label="displacement, down [mm]")
    x = np.linspace(0.015, 0.085, 281)
    sweep = np.stack([x, np.full_like(x, 0.05), np.full_like(x, height - depth)], axis=1)
    forces = [
        body.simulate_path(sweep, radius, outward=[0, 0, 1], tip="flat").force[:, 2]
        for body in (with_nodule, without_nodule)
    ]
    for force, color, label in zip(forces, COLORS, ("with the nodule", "without"), strict=False):
        right.plot(x * 1e3, force, color=color, label=label)
    right.axvspan(42.5, 57.5, color=FAINT, alpha=0.18, lw=0)
    right.set(xlabel="position along x [mm]", ylabel="force [N]", ylim=(0, None))
    right.annotate(
        "nodule, 5 mm deep", (50, 0.04), xycoords=("data", "axes fraction"), ha="center", color=INK, fontsize=9
    )
    right.set_title("Force along a sweep", **TITLE)
    right.legend(loc="lower right", bbox_to_anchor=(1, 0.12), frameon=False)
    figure.savefig(Path(path), dpi=150, facecolor=PAPER)
    middle = len(x) // 2
    return float(forces[0][middle] / forces[1][middle])


def draw_models(
    body: Body,
    path: str | Path,
    *,
    radius: float = 15e-3,
    depth: float = 3e-3,
    width: float = 0.06,
    height: float = 0.03,
) -> dict[str, float]:
    """Draw the indentation of a block by a sphere for three material models; write a PNG file.

    The left panel shows the top of the block, the right panel force over depth.

    Args:
        body: the block.
        path: file to write.
        radius: of the sphere, m.
        depth: of the indentation, m.
        width: of the block, m.
        height: of the block, m.

    Returns:
        The force of each model at `depth`, N.
    """
    models = {
        "finite elements": body,
        "mass_spring": body.mass_spring(1e-3, rayleigh_alpha=20.0, rayleigh_beta=2e-3),
        "free_form": body.free_form(),
    }
    figure, ((left, right),) = new_figure(1, 2, width=10.5, height=4.0, sharex=False)
    middle = width / 2
    row = np.flatnonzero(np.abs(body.nodes[:, 1] - middle) < 1e-6)
    row = row[np.argsort(body.nodes[row, 0])]
    angle = np.linspace(-np.pi, 0.0, 200)
    ball = (radius * np.cos(angle), radius * (1.0 + np.sin(angle)) - depth)
    left.fill(*(1e3 * np.array(ball)), color=FAINT, alpha=0.25, lw=0)
    depths = np.linspace(0.0, depth, 13)
    forces = {}
    for (name, model), color, style in zip(models.items(), COLORS, ("-", "--", ":"), strict=False):
        indentations = [model.indent([middle, middle, height], radius, d) for d in depths]
        moved = indentations[-1].displacement[row]
        x, z = body.nodes[row, 0] + moved[:, 0] - middle, moved[:, 2]
        left.plot(x * 1e3, z * 1e3, style, color=color, lw=2, marker=".", ms=7, label=name)
        right.plot(depths * 1e3, [i.force[2] for i in indentations], style, color=color, lw=2, label=name)
        forces[name] = float(indentations[-1].force[2])
    left.set(xlabel="position along x [mm]", ylabel="height [mm]", xlim=(-28, 28), ylim=(-1.25e3 * depth, 1.8))
    left.set_title(f"Sphere of {radius * 1e3:g} mm radius, depth {depth * 1e3:g} mm", **TITLE)
    right.set(xlabel="depth [mm]", ylabel="force [N]", xlim=(0, depth * 1e3), ylim=(0, None))
    right.set_title("Force on the sphere", **TITLE)
    right.legend(loc="upper left", frameon=False)
    figure.savefig(Path(path), dpi=150, facecolor=PAPER)
    return forces
