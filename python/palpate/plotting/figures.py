"""The standard pictures of a trace: one panel per axis or joint, units on every axis, targets dashed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.metrics.summary import expected_deflection, scenario_of
from palpate.plotting.style import COLOURS, INK, TITLE, new_figure
from palpate.simulation.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["angles", "compare", "deflection", "energy", "forces", "panels", "thin", "torques"]

Array = NDArray[np.float64]
AXES: Final = ("x", "y", "z")
_POINTS: Final = 1600  # on a line: more are not seen


def deflection(trace: Trace, targets: Sequence[float | None] | None = None) -> Figure:
    """Return tip deflection against time, mm, per axis; `targets` (3,), m, dashed (from the scenario if not given)."""
    if targets is None:
        targets = expected_deflection(scenario_of(trace))
    values = trace["deflection"]
    shown = [axis for axis in range(values.shape[1]) if targets[axis] is not None or np.any(values[:, axis])] or [0]
    figure, axes = panels(trace.time, values[:, shown] * 1e3, [f"along {AXES[i]}" for i in shown], "deflection [mm]")
    for panel, axis in zip(axes, shown, strict=True):
        target = targets[axis]
        if target is not None:
            _target(panel, target * 1e3, "force / stiffness")
    _mark_divergence(axes, trace)
    return figure


def forces(trace: Trace) -> Figure:
    """Return the forces at the tip against time, N, per axis: those of the trace that are not zero throughout."""
    names = {
        "reference_force": ("reference", {"color": INK, "linestyle": (0, (4, 3)), "linewidth": 1.1}),
        "operator_force": ("operator", {"color": COLOURS[2]}),
        "object_force": ("on the object", {"color": COLOURS[0]}),
        "command_force": ("commanded", {"color": COLOURS[1], "linewidth": 1.1}),
    }
    here = {name: look for name, look in names.items() if name in trace and np.any(trace[name])}
    moved = [axis for axis in range(3) if any(np.any(trace[name][:, axis]) for name in here)] or [0]
    figure, rows = new_figure(1, len(moved), sharey=True)
    axes = rows[0]
    for panel, axis in zip(axes, moved, strict=True):
        for name, (label, look) in here.items():
            panel.plot(*thin(trace.time, trace[name][:, axis]), label=label, **look)  # type: ignore[arg-type]
        panel.set_title(f"along {AXES[axis]}", **TITLE)
        panel.set_xlabel("time [s]")
    axes[0].set_ylabel("force [N]")
    if here:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    _mark_divergence(axes, trace)
    return figure


def torques(trace: Trace) -> Figure:
    """Return the motor torques against time, per joint."""
    return _joints(trace, "torque", "force" if trace.channels["torque"].unit == "N" else "torque")


def angles(trace: Trace) -> Figure:
    """Return the joint angles against time, per joint."""
    return _joints(trace, "angle", "position" if trace.channels["angle"].unit == "m" else "angle")


def energy(trace: Trace) -> Figure:
    """Return the device's energy against time."""
    figure, axes = panels(trace.time, trace["energy"], [""], "energy [J]")
    _mark_divergence(axes, trace)
    return figure


def compare(
    traces: Mapping[str, Trace],
    channel: str = "deflection",
    *,
    scale: float = 1e3,
    ylabel: str = "deflection [mm]",
    targets: Sequence[float | None] = (None, None, None),
    components: Sequence[int] = (0, 1, 2),
    names: Sequence[str] = ("along x", "along y", "along z"),
) -> Figure:
    """Return one channel of several traces, a colour for each, a panel per component; values are times `scale`."""
    figure, rows = new_figure(1, len(components), sharey=True, height=3.2)
    axes = rows[0]
    for panel, component in zip(axes, components, strict=True):
        for label, trace in traces.items():
            panel.plot(*thin(trace.time, trace[channel][:, component] * scale), label=label)
        if (target := targets[component]) is not None:
            panel.axhline(target * scale, color=INK, linestyle=(0, (4, 3)), linewidth=1.0, zorder=1)
        panel.set_title(names[component], **TITLE)
        panel.set_xlabel("time [s]")
    axes[0].set_ylabel(ylabel)
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(labels)))
    return figure


def panels(
    time: ArrayLike, values: ArrayLike, titles: Sequence[str], ylabel: str, *, sharey: bool = True
) -> tuple[Figure, list[Axes]]:
    """Return a figure with one panel for each column of `values` (n, k), side by side, and its axes."""
    table = np.asarray(values, dtype=float)
    figure, rows = new_figure(1, table.shape[1], sharey=sharey)
    for index, (panel, title) in enumerate(zip(rows[0], titles, strict=True)):
        panel.plot(*thin(time, table[:, index]), color=COLOURS[0])
        panel.set_title(title, **TITLE)
        panel.set_xlabel("time [s]")
    rows[0][0].set_ylabel(ylabel)
    return figure, rows[0]


def thin(time: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    """Return fewer samples that draw the same line: the least and the largest value of each stretch, in their order."""
    t, y = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if len(t) <= _POINTS:
        return t, y
    stretch = int(np.ceil(len(t) / (_POINTS // 2)))
    kept = {0, len(t) - 1}
    for begin in range(0, len(t), stretch):
        part = y[begin : begin + stretch]
        kept.update((begin + int(np.argmin(part)), begin + int(np.argmax(part))))
    index = np.array(sorted(kept))
    return t[index], y[index]


def _joints(trace: Trace, name: str, quantity: str) -> Figure:
    channel = trace.channels[name]
    unit = channel.unit.replace("*", "·")
    count = channel.values.shape[1]
    titles = [f"joint {i + 1}" for i in range(count)] if count > 1 else [""]
    figure, axes = panels(trace.time, channel.values, titles, f"{quantity} [{unit}]", sharey=name == "torque")
    _mark_divergence(axes, trace)
    return figure


def _target(panel: Axes, value: float, label: str) -> None:
    panel.axhline(value, color=INK, linestyle=(0, (4, 3)), linewidth=1.0, zorder=1)
    text: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points"}
    panel.annotate(f"{label} = {value:.3g}", (0.98, value), xytext=(0, -4), ha="right", va="top", fontsize=9, **text)
    low, high = panel.get_ylim()
    panel.set_ylim(min(low, value), max(high, value + 0.06 * (high - low)))


def _mark_divergence(axes: Sequence[Axes], trace: Trace) -> None:
    if trace.unstable_from is None:
        return
    for panel in axes:
        panel.axvline(trace.unstable_from, color=COLOURS[1], linewidth=1.4)
    axes[-1].annotate(
        f"unstable from {trace.unstable_from:.4g} s",
        (trace.unstable_from, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, 3),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=9,
        color=COLOURS[1],
    )
