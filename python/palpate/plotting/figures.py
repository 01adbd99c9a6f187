"""Standard figures of a trace: one panel per axis or joint, with units on every axis and dashed targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.plotting.style import COLORS, INK, TITLE, new_figure
from palpate.simulation.recorded import recorded_scenario
from palpate.simulation.statics import expected_deflection
from palpate.simulation.trace import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXES: Final = ("x", "y", "z")
_POINTS: Final = 1600  # maximum number of points of a line
_START: Final = 0.1  # of the run: a spike within it may be cut off
_FLAT: Final = (0.05, 1.0 / 3.0)  # range of the later forces over the whole, between which a spike flattens them
_RARE: Final = 0.02  # of the samples: a spike that lasts longer is not cut off
_NEAR: Final = 0.5  # of the range of the later forces: a peak that is no farther from them is not cut off
_ROOM: Final = 0.1  # of that range, above and below
# force: name in the legend, style
_FORCES: Final[Mapping[str, tuple[str, dict[str, Any]]]] = {
    "reference_force": ("reference", {"color": INK, "linestyle": (0, (4, 3)), "linewidth": 1.1}),
    "operator_force": ("operator", {"color": COLORS[2]}),
    "object_force": ("on the object", {"color": COLORS[0]}),
    "motor_force": ("of the motors", {"color": COLORS[1], "linewidth": 1.1}),
}


def deflection(trace: Trace, targets: Sequence[float | None] | None = None) -> Figure:
    """Return the deflection of the tip against time, mm, per axis.

    Args:
        trace: the run.
        targets: dashed target of each axis, m, or None (3,); None for those of the scenario.
    """
    if targets is None:
        targets = expected_deflection(recorded_scenario(trace))
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
    """Return the forces at the tip against time, N, per axis; forces and axes that are always zero are left out.

    A spike at the start that would flatten the rest is cut off (`force_limits`); numbers at the edge are its peaks.
    """
    shown = {name: style for name, style in _FORCES.items() if name in trace and np.any(trace[name])}
    nonzero = [axis for axis in range(3) if any(np.any(trace[name][:, axis]) for name in shown)] or [0]
    figure, rows = new_figure(1, len(nonzero), sharey=True)
    axes = rows[0]
    for panel, axis in zip(axes, nonzero, strict=True):
        for name, (label, style) in shown.items():
            panel.plot(*thin(trace.time, trace[name][:, axis]), label=label, **style)
        panel.set_title(f"along {AXES[axis]}", **TITLE)
        panel.set_xlabel("time [s]")
    axes[0].set_ylabel("force [N]")
    if (limits := force_limits(trace)) is not None:
        axes[0].set_ylim(limits)
        for panel, axis in zip(axes, nonzero, strict=True):
            for name, (_, style) in shown.items():
                _mark_peaks(panel, trace.time, trace[name][:, axis], limits, style["color"])
    if shown:
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    _mark_divergence(axes, trace)
    return figure


def force_limits(trace: Trace) -> tuple[float, float] | None:
    """Return the limits of the axis of `forces`, N, if a spike at the start of a run would flatten the rest.

    The spike lies in the first tenth of the run, lasts a fiftieth of it at most, and is three times as large as the
    range of the forces after that tenth. None without such a spike, and if hardly any force follows it.
    """
    values = np.hstack([trace[name] for name in _FORCES if name in trace] or [np.zeros((len(trace), 1))])
    late = trace.time >= trace.time[0] + _START * (trace.time[-1] - trace.time[0])
    low, high, whole = float(values[late].min()), float(values[late].max()), float(np.ptp(values))
    if not _FLAT[0] * whole <= high - low <= _FLAT[1] * whole:
        return None
    span, least, greatest = high - low, float(values.min()), float(values.max())
    low = (least if least >= low - _NEAR * span else low) - _ROOM * span
    high = (greatest if greatest <= high + _NEAR * span else high) + _ROOM * span
    beyond = ((values < low) | (values > high)).any(axis=1)
    return (low, high) if 0.0 < np.mean(beyond) <= _RARE else None


def torques(trace: Trace) -> Figure:
    """Return the motor torques against time, per joint."""
    name = "motor_torque" if "motor_torque" in trace else "torque"
    return _joints(trace, name, "force" if trace.channels[name].unit == "N" else "torque")


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
    """Return one channel of several traces, with one color per trace and one panel per component.

    Args:
        traces: by label.
        channel: name of the channel.
        scale: factor on the values and targets.
        ylabel: quantity and unit of the scaled values.
        targets: dashed target of each component, in the unit of the channel, or None.
        components: indices of the components.
        names: titles of the panels, by component.
    """
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
    """Return a figure with a row of panels, one per column of `values` (n, k), and its axes."""
    table = np.asarray(values, dtype=float)
    figure, rows = new_figure(1, table.shape[1], sharey=sharey)
    for index, (panel, title) in enumerate(zip(rows[0], titles, strict=True)):
        panel.plot(*thin(time, table[:, index]), color=COLORS[0])
        panel.set_title(title, **TITLE)
        panel.set_xlabel("time [s]")
    rows[0][0].set_ylabel(ylabel)
    return figure, rows[0]


def thin(time: ArrayLike, values: ArrayLike) -> tuple[Array, Array]:
    """Return fewer samples (k,) of time and values (n,) with the minimum and the maximum of each interval, in order."""
    t, y = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    if len(t) <= _POINTS:
        return t, y
    length = int(np.ceil(len(t) / (_POINTS // 2)))
    kept = {0, len(t) - 1}
    for begin in range(0, len(t), length):
        part = y[begin : begin + length]
        kept.update((begin + int(np.argmin(part)), begin + int(np.argmax(part))))
    index = np.array(sorted(kept))
    return t[index], y[index]


def _joints(trace: Trace, name: str, quantity: str) -> Figure:
    channel = trace.channels[name]
    unit = channel.unit.replace("*", "·")
    count = channel.values.shape[1]
    titles = [f"joint {i + 1}" for i in range(count)] if count > 1 else [""]
    figure, axes = panels(
        trace.time, channel.values, titles, f"{quantity} [{unit}]", sharey=name in ("torque", "motor_torque")
    )
    _mark_divergence(axes, trace)
    return figure


def _target(panel: Axes, value: float, label: str) -> None:
    panel.axhline(value, color=INK, linestyle=(0, (4, 3)), linewidth=1.0, zorder=1)
    low, high = panel.get_ylim()
    panel.set_ylim(min(low, value), max(high, value + 0.06 * (high - low)))
    above = value < low + 0.15 * (high - low)
    side: dict[str, Any] = {"xytext": (0, 4 if above else -4), "va": "bottom" if above else "top"}
    text: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "fontsize": 9}
    panel.annotate(f"{label} = {value + 0.0:.3g}", (0.98, value), ha="right", **side, **text)


def _mark_peaks(panel: Axes, time: Array, values: Array, limits: tuple[float, float], color: str) -> None:
    """Write the peaks of values (n,) beyond the limits of an axis beside the edge where the line leaves it."""
    for edge, row, sign in ((limits[0], int(np.argmin(values)), -1.0), (limits[1], int(np.argmax(values)), 1.0)):
        if sign * (values[row] - edge) <= 0.0:
            continue
        panel.annotate(
            f"{'↓' if sign < 0.0 else '↑'} {values[row]:.3g} N".replace("-", "−"),
            (float(time[row]), edge),
            xytext=(7, -sign * 3),
            textcoords="offset points",
            va="bottom" if sign < 0.0 else "top",
            fontsize=9,
            color=color,
        )


def _mark_divergence(axes: Sequence[Axes], trace: Trace) -> None:
    if trace.unstable_from is None:
        return
    for panel in axes:
        panel.axvline(trace.unstable_from, color=COLORS[1], linewidth=1.4)
    axes[-1].annotate(
        f"unstable from {trace.unstable_from:.4g} s",
        (trace.unstable_from, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, 3),
        textcoords="offset points",
        ha="right",
        va="bottom",
        fontsize=9,
        color=COLORS[1],
    )
