"""Map of the verdicts of a sweep over one or two axes, with the exact boundary where it is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from palpate.errors import PalpateError
from palpate.scenario import Scenario
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.verdict import State
from palpate.stability.maps.zwidth_map import loop_radii
from palpate.sweeps.axes import Axis, SweepError
from palpate.sweeps.outcomes import Outcomes
from palpate.sweeps.plan import Plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["COLORS", "plot_sweep"]

# Okabe & Ito 2008: distinct for color-blind readers; the good state is pale, so that the others stand out.
COLORS: Final = {
    State.SETTLED: "#cfe3ef",
    State.BOUNDED_OSCILLATION: "#e69f00",
    State.UNSTABLE: "#d55e00",
    State.CONTACT_LOST: "#cc79a7",
    State.OUT_OF_REACH: "#56b4e9",
    State.DRIVE_LIMIT: "#009e73",
    State.UNDECIDED: "#8a9099",
    State.STABLE: "#cfe3ef",
}
SCALES: Final = {"N/m": (1e-3, "N/mm"), "m": (1e3, "mm"), "s": (1e3, "ms")}
MOST: Final = 1000  # cells along an axis that are drawn: of more, every second or third one, and so on
FINE: Final = 300  # points along the second axis of the grid on which the exact boundary is traced


class _Result(Protocol):
    @property
    def plan(self) -> Plan:
        """Definition of the sweep."""
        ...

    @property
    def outcomes(self) -> Outcomes:
        """Outcomes by name."""
        ...


def plot_sweep(found: _Result, ax: Axes | None = None) -> Axes:
    """Draw the verdicts of a sweep and return the axes.

    Two axes give a map; the first one is vertical. One axis gives the ripple of each cell, m. Of an axis with more than
    1000 values, every second or third one is drawn, and so on. A map over the stiffness
    and damping of a spring or wall also has the exact boundary of the linear loop.

    Args:
        found: a sweep over one or two numeric axes, one draw each.
        ax: axes of matplotlib to draw into; None: new ones of pyplot.

    Raises:
        SweepError: the sweep has more axes, several draws, or an axis of words.
    """
    axes = found.plan.axes
    if len(axes) > 2 or found.plan.draws > 1 or any(isinstance(axis.values[0], str) for axis in axes):
        raise SweepError("a sweep is drawn over one or two numeric axes with one draw each; select cells and plot them")
    if ax is None:
        from matplotlib import pyplot

        ax = pyplot.subplots(figsize=(6.4, 4.2), layout="constrained")[1]
    states = _thinned(found, "verdict")
    (_line if len(axes) == 1 else _map)(found, ax, states)
    present = [state for state in State if np.any(states == state)]
    _legend(ax, present)
    return ax


def _thinned(found: _Result, name: str) -> NDArray[np.float64]:
    """Return the values of the cells that are drawn, by name of the outcome."""
    steps = tuple(slice(None, None, _step(axis)) for axis in found.plan.axes)
    return np.array(np.asarray(found.outcomes[name])[steps], dtype=float)  # a copy: the whole need not be kept


def _step(axis: Axis) -> int:
    return -(-len(axis) // MOST)


def _map(found: _Result, ax: Axes, states: NDArray[np.float64]) -> None:
    from matplotlib.colors import BoundaryNorm, ListedColormap

    vertical, horizontal = found.plan.axes
    y, x = (_scaled(axis)[:: _step(axis)] for axis in (vertical, horizontal))
    colors = ListedColormap([COLORS[state] for state in State])
    norm = BoundaryNorm(np.arange(len(State) + 1) - 0.5, len(State))
    ax.pcolormesh(x, y, np.ma.masked_invalid(states), cmap=colors, norm=norm, shading="nearest", rasterized=True)
    _exact(found.plan, ax)
    for axis, values, label in ((vertical, y, ax.set_ylabel), (horizontal, x, ax.set_xlabel)):
        label(_label(axis))
        if len(values) > 2 and _is_geometric(values):
            (ax.set_yscale if axis is vertical else ax.set_xscale)("log")


def _line(found: _Result, ax: Axes, states: NDArray[np.float64]) -> None:
    axis = found.plan.axes[0]
    x, ripple = _scaled(axis)[:: _step(axis)], 1e3 * _thinned(found, "ripple")
    known = ripple[np.isfinite(ripple) & (ripple > 0.0)]
    top = known.max() if len(known) else 1.0
    shown = np.where(np.isfinite(ripple), np.maximum(ripple, 1e-9), 3.0 * top)  # those that diverged, at the top
    for state in State:
        cells = states == state
        ax.plot(x[cells], shown[cells], "o", color=COLORS[state], markeredgecolor="#1d2126", markeredgewidth=0.4)
    ax.set_yscale("log")
    ax.set_xlabel(_label(axis))
    ax.set_ylabel("ripple [mm]")


def _exact(plan: Plan, ax: Axes) -> None:
    """Draw where the spectral radius of the linear loop is 1, over stiffness and damping."""
    paths = [axis.path for axis in plan.axes]
    own = plan.tables.get("controller", {}).get("kind", "none")
    designed_once = plan.design == "once" or own in ("none", "gain", "state_space")
    if sorted(paths) != ["object.damping", "object.stiffness"] or not designed_once:
        return
    try:
        loop = scenario_loop(Scenario.from_dict(plan.tables))
    except PalpateError:
        return
    fine = [np.linspace(min(axis.values), max(axis.values), FINE) for axis in plan.axes]
    first, second = np.meshgrid(*fine, indexing="ij")
    k, b = (first, second) if paths[0] == "object.stiffness" else (second, first)
    radii = loop_radii(loop, k.ravel(), b.ravel()).reshape(k.shape)
    scales = [_scale(axis)[0] for axis in plan.axes]
    ax.contour(fine[1] * scales[1], fine[0] * scales[0], radii, levels=[1.0], colors="#1d2126", linewidths=1.2)


def _legend(ax: Axes, present: Sequence[State]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Patch | Line2D] = [Patch(color=COLORS[state], label=state.label) for state in present]
    if len(ax.collections) > 1 and any(np.size(path.vertices) for path in ax.collections[1].get_paths()):
        handles.append(Line2D([], [], color="#1d2126", linewidth=1.2, label="exact boundary"))
    ax.figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 4))


def _scale(axis: Axis) -> tuple[float, str]:
    """Return the factor from the values of an axis to those drawn, and their unit."""
    if axis.unit == "N/m" and max(abs(value) for value in axis.values) < 1e3:
        return 1.0, "N/m"
    return SCALES.get(axis.unit, (1.0, axis.unit.replace("*", "·")))


def _scaled(axis: Axis) -> NDArray[np.float64]:
    return _scale(axis)[0] * np.asarray(axis.values, dtype=float)


def _label(axis: Axis) -> str:
    unit = _scale(axis)[1]
    return axis.path.replace(".", " ").replace("_", " ") + (f" [{unit}]" if unit else "")


def _is_geometric(values: NDArray[np.float64]) -> bool:
    if np.any(values <= 0.0):
        return False
    ratio = values[1:] / values[:-1]
    return bool(np.ptp(ratio) < 1e-6 * ratio[0] and np.ptp(np.diff(values)) > 1e-6 * values[0])
