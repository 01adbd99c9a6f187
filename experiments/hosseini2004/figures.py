"""Figures of the thesis, drawn from simulations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from palpate.plotting.figures import thin
from palpate.plotting.style import COLORS, FAINT, INK, TITLE, new_figure

from experiments.hosseini2004.motion import Motion

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["angles", "eigenvalues", "lines", "poles_in_the_disk", "steps"]

DASHED = (0, (4, 3))


def angles(
    motions: Mapping[str, Motion],
    *,
    targets: Sequence[float | None] = (None, None, None),
    limits: ArrayLike | None = None,
) -> Figure:
    """Draw joint angles of several motions, a panel for each joint.

    `targets` (3,), rad, are dashed; `limits` (3, 2) cut the y axes.
    """
    figure, rows = new_figure(1, 3)
    for joint, panel in enumerate(rows[0]):
        for label, motion in motions.items():
            panel.plot(*thin(motion.time, motion.q[:, joint]), label=label)
        target = targets[joint]
        if target is not None:
            panel.axhline(target, color=INK, linestyle=DASHED, linewidth=1.0, zorder=1)
        if limits is not None:
            panel.set_ylim(*np.asarray(limits, dtype=float)[joint])
        _title(panel, f"θ{joint + 1}")
        panel.set_xlabel("time [s]")
    rows[0][0].set_ylabel("angle [rad]")
    _legend(figure, rows[0][0])
    return figure


def eigenvalues(groups: Mapping[str, ArrayLike]) -> Figure:
    """Draw eigenvalues in the complex plane, a colour for each group, 1/s."""
    figure, rows = new_figure(1, 1, width=6.2, height=3.4)
    panel = rows[0][0]
    panel.axvline(0.0, color=FAINT, linewidth=1.0)
    panel.axhline(0.0, color=FAINT, linewidth=1.0)
    for (label, values), marker in zip(groups.items(), ("o", "x", "^"), strict=False):
        points = np.asarray(values, dtype=complex)
        panel.plot(points.real, points.imag, marker, label=label, markersize=7, markeredgewidth=1.8, fillstyle="none")
    panel.set_xlabel("real part [1/s]")
    panel.set_ylabel("imaginary part [rad/s]")
    _legend(figure, panel)
    return figure


def poles_in_the_disk(groups: Mapping[str, ArrayLike]) -> Figure:
    """Draw sampled poles with the unit circle."""
    figure, rows = new_figure(1, 1, width=4.6, height=4.3)
    panel = rows[0][0]
    turn = np.linspace(0, 2 * np.pi, 400)
    panel.plot(np.cos(turn), np.sin(turn), color=FAINT, linewidth=1.2)
    for (label, values), marker in zip(groups.items(), ("o", "x", "^"), strict=False):
        points = np.asarray(values, dtype=complex)
        panel.plot(points.real, points.imag, marker, label=label, markersize=7, markeredgewidth=1.8, fillstyle="none")
    panel.set_aspect("equal")
    panel.set_xlabel("real part")
    panel.set_ylabel("imaginary part")
    _legend(figure, panel)
    return figure


def lines(
    series: Mapping[str, tuple[ArrayLike, ArrayLike]],
    *,
    titles: Sequence[str],
    ylabel: str,
    xlabel: str = "time [s]",
    sharey: bool = False,
    height: float = 2.9,
    dashed: Sequence[str] = (),
) -> Figure:
    """Draw series of (time (n,), values (n, k)) over each other, a panel for each of the k columns."""
    figure, rows = new_figure(1, len(titles), sharey=sharey, height=height)
    for column, panel in enumerate(rows[0]):
        for label, (time, values) in series.items():
            table = np.asarray(values, dtype=float)
            look = {"linestyle": DASHED, "linewidth": 1.2, "color": INK, "zorder": 5} if label in dashed else {}
            panel.plot(*thin(time, table[:, column]), label=label, **look)  # type: ignore[arg-type]
        _title(panel, titles[column])
        panel.set_xlabel(xlabel)
    rows[0][0].set_ylabel(ylabel)
    _legend(figure, rows[0][0])
    return figure


def steps(
    panels: Mapping[str, Mapping[str, tuple[ArrayLike, ArrayLike]]],
    *,
    targets: Sequence[float],
    ylabel: str = "deflection [mm]",
    until: float | None = None,
    lowest: float | None = None,
    highest: float | None = None,
) -> Figure:
    """Draw step responses: a row for each entry of `panels`, three axes across; each series is (time, values (n, 3)).

    `targets` are dashed in every panel; the y axis is cut at `lowest` and `highest`, the time axis at `until`.
    """
    figure, rows = new_figure(len(panels), 3, sharey=True, height=2.5)
    for (name, series), row in zip(panels.items(), rows, strict=True):
        for axis, panel in enumerate(row):
            for index, (label, (time, values)) in enumerate(series.items()):
                colour = COLORS[index % len(COLORS)]
                panel.plot(*thin(time, np.asarray(values, dtype=float)[:, axis]), label=label, color=colour)
            for target in targets:
                panel.axhline(target, color=INK, linestyle=DASHED, linewidth=0.9, zorder=1)
            _title(panel, f"{name}, {'xyz'[axis]}" if name else "xyz"[axis])
            if until is not None:
                panel.set_xlim(0.0, until)
            if lowest is not None and highest is not None:
                panel.set_ylim(lowest, highest)
        row[0].set_ylabel(ylabel)
    for panel in rows[-1]:
        panel.set_xlabel("time [s]")
    _legend(figure, rows[0][0])
    return figure


def _legend(figure: Figure, panel: Axes) -> None:
    handles, labels = panel.get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside lower center", ncols=min(6, len(labels)), frameon=False)


def _title(panel: Axes, text: str) -> None:
    panel.set_title(text, **TITLE)
