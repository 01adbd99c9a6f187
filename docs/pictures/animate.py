"""Draw docs/pictures/palpation.gif: a run of scenarios/palpate-phantom.toml at half speed.

    python docs/pictures/animate.py [FILE.gif]

Left, the contact surface of the phantom with the tip on it; right, force and deflection of the same run.
"""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from palpate import Trace, simulate
from palpate.plotting.style import COLORS, FAINT, INK
from palpate.simulation.bodies import pressed_at
from PIL import Image

HERE = Path(__file__).parent
SCENARIO = HERE.parents[1] / "scenarios" / "palpate-phantom.toml"
FRAMES = 40
SLOWER = 2.0  # times real time
STRETCH = 4.0  # of depths
MIDDLE = 0.05  # m, x of the nodule
RADIUS = 8.0  # mm, of the flat tip
HEIGHT = 30.0  # mm, of the drawn tip
COLOR_LIMIT = 3.0  # mm
COLORS_IN_FILE = 64


def draw_body(solid: Any, trace: Trace, row: int) -> None:
    """Draw the top of the body and the tip at one sample."""
    at = pressed_at(trace, row)
    moved = 1e3 * at.body.on_surface(at.displacement)
    rest = 1e3 * at.body.surface.vertices
    top = rest[:, 2].max()
    x = rest + moved
    x[:, 2] = STRETCH * (x[:, 2] - top)
    triangles = at.body.surface.triangles[np.all(rest[at.body.surface.triangles, 2] > top - 1e-6, axis=1)]
    depth = -moved[triangles, 2].mean(axis=1)
    faces = Poly3DCollection(x[triangles], facecolors=colors(depth), edgecolors="#ffffff50", linewidths=0.3)
    solid.add_collection3d(faces)
    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    circle = RADIUS * np.column_stack([np.cos(angle), np.sin(angle)])
    tip = 1e3 * at.tip - [0.0, 0.0, top]
    bottom = np.column_stack([tip[:2] + circle, np.full(len(angle), STRETCH * tip[2])])
    upper = bottom + np.array([0.0, 0.0, HEIGHT])
    sides = np.stack([bottom[:-1], bottom[1:], upper[1:], upper[:-1]], axis=1)
    grey = "#aeb6c2"
    solid.add_collection3d(Poly3DCollection([*sides, upper], facecolors=grey, edgecolors=grey))
    solid.plot(*upper.T, color=INK, linewidth=0.8, zorder=10)


def colors(depth: Any) -> Any:
    """Return the colors of depths, mm."""
    from matplotlib import colormaps

    return colormaps["YlOrRd"](0.1 + 0.8 * np.round(np.clip(depth / COLOR_LIMIT, 0.0, 1.0) * 20.0) / 20.0)


def draw(trace: Trace, row: int, nodule: float) -> Image.Image:
    """Return one frame; the tip is over the nodule at `nodule`, s."""
    figure = Figure(figsize=(8.0, 3.3), dpi=100, facecolor="white")
    solid: Any = figure.add_axes((-0.02, -0.1, 0.62, 1.2), projection="3d", computed_zorder=False)
    draw_body(solid, trace, row)
    solid.set(xlim=(0, 100), ylim=(0, 100), zlim=(-20, 30))
    solid.set_box_aspect((100, 100, 50), zoom=1.12)
    solid.view_init(elev=24, azim=-70)
    solid.set_axis_off()
    figure.text(0.015, 0.03, f"tissue of 10 kPa, hidden nodule of 50 kPa; depths x {STRETCH:g}", fontsize=9, color=INK)
    time, force = trace.time, -trace["object_force"][:, 2]
    deflection = 1e3 * np.linalg.norm(trace["deflection"], axis=1)
    for place, values, label, color, limit in (
        (0.61, force, "force [N]", COLORS[1], 0.8),
        (0.15, deflection, "deflection [mm]", COLORS[0], 4.0),
    ):
        panel = figure.add_axes((0.65, place, 0.33, 0.29))
        panel.plot(time, values, color=FAINT, alpha=0.45, linewidth=1.2)
        panel.plot(time[: row + 1], values[: row + 1], color=color, linewidth=1.8)
        panel.plot(time[row], values[row], "o", color=color, markersize=4)
        panel.set(xlim=(0.0, time[-1]), ylim=(0.0, limit))
        panel.set_title(label, loc="left", fontsize=10, color=INK)
        panel.spines[["top", "right"]].set_visible(False)
        panel.axvline(nodule, color=INK, linewidth=0.8, linestyle=(0, (2, 3)))
        panel.grid(alpha=0.3)
    panel.text(nodule + 0.07, 0.4, "nodule", fontsize=9, color=INK)
    panel.set_xlabel("time [s]", fontsize=9)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return Image.open(buffer).convert("RGB")


def main(path: Path) -> None:
    """Run the scenario and write the animation."""
    trace = simulate(SCENARIO)
    rows = np.linspace(0, len(trace) - 1, FRAMES).round().astype(int)
    along = [pressed_at(trace, int(row)).tip[0] for row in rows]
    nodule = float(np.interp(MIDDLE, along, trace.time[rows]))
    frames = [draw(trace, int(row), nodule) for row in rows]
    whole = Image.fromarray(np.concatenate([np.asarray(frame) for frame in frames[:: FRAMES // 5]]))
    palette = whole.quantize(COLORS_IN_FILE, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)
    indexed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    pause = round(1000 * SLOWER * float(trace.time[-1]) / FRAMES)
    indexed[0].save(path, save_all=True, append_images=indexed[1:], duration=pause, loop=0, optimize=True)
    print(f"{path}: {path.stat().st_size / 1000:.0f} kB, {FRAMES} frames, {pause} ms each")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "palpation.gif")
