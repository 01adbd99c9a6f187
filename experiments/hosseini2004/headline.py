"""Headline figure of the report: responses on soft and stiff cubes, compared with the thesis."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from palpate.plotting.figures import thin
from palpate.plotting.style import COLORS, INK, TITLE, new_figure
from palpate.report import Page

from experiments.hosseini2004.cases import tracking_controllers
from experiments.hosseini2004.loops import Loop, respond
from experiments.hosseini2004.printed_numbers import printed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["headline"]

SOFT_TO_STIFF: Final = (1.0, 2.0, 2.5, 3.0, 3.5)  # N/mm, table 5.1
DURATION: Final = 1.0  # s; the integrators of the LQG still reduce the error then
FLOOR: Final = 1e-8  # %; smallest error drawn
SHOWN: Final = 100.0  # ms
MARKS: Final = {"lead–lag": (COLORS[1], "o"), "LQG": (COLORS[0], "o"), "workspace": (COLORS[2], "s")}


def headline(page: Page) -> Figure:
    """Add the first section with its figure, and return the figure."""
    loops = {
        name: [respond(law, stiffness=k, duration=DURATION) for k in SOFT_TO_STIFF]
        for name, law in tracking_controllers().items()
        if name in MARKS
    }
    figure = _draw(loops)
    worst = {name: max(_error(loop) for loop in runs) for name, runs in loops.items()}
    slowest = {name: 1e3 * max(loop.settling or np.inf for loop in runs) for name, runs in loops.items()}
    page.section("Palpate's own controllers at a glance", "at-a-glance")
    page.verdict(
        "Palpate's own controllers, each designed once, press the nonlinear arm with 8.5 N into cubes of 1 to 3.5 "
        f"N/mm. Errors after 1 s: lead–lag at most {worst['lead–lag']:.2f} %, LQG {worst['LQG']:.4f} %, workspace "
        f"controller {worst['workspace']:.1g} %.",
        "good" if max(worst["LQG"], worst["workspace"]) < 0.1 else "bad",
    )
    page.figure(
        figure,
        "Left: the tip's deflection along z under the workspace controller, settled within 5 % after "
        f"{slowest['workspace']:g} ms at most, and under the LQG (dotted, {slowest['LQG']:g} ms); dashed, force / "
        "stiffness. Right: errors after 1 s on the cubes of table 5.1; the thesis's are known to half of 0.01 mm and "
        "not drawn below that. The thesis has other controllers. As in the thesis, the drive has no limits.",
        label="Deflection against time for five stiffnesses, and errors of the thesis's and palpate's controllers",
    )
    return figure


def _error(loop: Loop) -> float:
    return float(np.abs(loop.error).max() / loop.ideal * 100)


def _draw(loops: dict[str, list[Loop]]) -> Figure:
    figure, rows = new_figure(1, 2, width=9.0, height=3.6, sharex=False)
    left, right = rows[0]
    for loop, lqg, color in zip(loops["workspace"], loops["LQG"], COLORS, strict=False):
        left.plot(*thin(loop.time * 1e3, loop.deflection[:, 2]), color=color)
        left.plot(*thin(lqg.time * 1e3, lqg.deflection[:, 2]), ":", color=color, linewidth=1.2)
        left.axhline(loop.ideal, color=INK, linestyle=(0, (4, 3)), linewidth=0.8, zorder=1)
        left.annotate(
            f"{loop.stiffness:g} N/mm",
            (SHOWN, loop.ideal),
            xytext=(4, {2.5: 1, 3.5: -3}.get(loop.stiffness, 0)),  # the two lowest lines lie close
            textcoords="offset points",
            va="center",
            fontsize=8.5,
            color=color,
            annotation_clip=False,
        )
    left.set_xlim(0.0, SHOWN)
    left.set_ylim(0.0, 9.6)
    left.set_xlabel("time [ms]")
    left.set_ylabel("deflection along z [mm]")
    left.set_title("8.5 N on cubes: workspace controller, LQG dotted", **TITLE)
    for column, (label, color) in enumerate((("lead–lag, thesis", COLORS[1]), ("LQG, thesis", COLORS[0])), start=1):
        errors = []
        for k in SOFT_TO_STIFF:
            deflection = float(printed(f"tab5.1-{k:.1f}").rows[0][column])
            # A printed deflection is known to half of 0.01 mm; an error below that is drawn as that half.
            errors.append(max(abs(deflection - 8.5 / k), 0.005) / (8.5 / k) * 100)
        right.semilogy(SOFT_TO_STIFF, errors, "x--", color=color, label=label, linewidth=1.1, markeredgewidth=1.6)
    for name, (color, marker) in MARKS.items():
        errors = [max(_error(loop), FLOOR) for loop in loops[name]]
        right.semilogy(SOFT_TO_STIFF, errors, marker + "-", color=color, label=f"{name}, palpate")
    right.set_xlabel("stiffness of the cube [N/mm]")
    right.set_ylabel("error after 1 s [%]")
    right.set_ylim(FLOOR, 100.0)
    right.set_title("error (palpate: worst axis; thesis: z)", **TITLE)
    handles, labels = right.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    return figure
