"""Surfaces in 3D: coloured by what their vertices have, linearly in between; what is flat stretched, and said so."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.plotting.style import FAINT, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["coloured", "divided", "frame", "new_space", "stretched"]

Array = NDArray[np.float64]
AXES: Final = ("x", "y", "z")
_STEPS: Final = 16  # of colour, from the least value of a surface to its largest: no piece of a triangle spans more
_LINE: Final = 0.25  # points
_SHORT: Final = 0.3  # of the longest axis: one that has no room for more than two numbers


def divided(values: ArrayLike, span: float) -> list[tuple[NDArray[np.intp], Array]]:
    """Return how triangles are divided so that no piece spans more than a part of `span`, for values linear in each.

    Args:
        values: at the triangles' corners (m, 3).
        span: that a sixteenth of is the most between two corners of a piece; of the values' unit.

    Returns:
        Each way in which triangles are divided, along their sides into 1, 2, ... parts: which triangles are (k,), and
        the corners of their pieces as weights of the triangle's corners (pieces, 3, 3).
    """
    table = np.asarray(values, dtype=float)
    parts = np.ones(len(table), dtype=int)
    if span > 0.0:
        parts = np.maximum(1, np.ceil(_STEPS * np.ptp(table, axis=1) / span * (1.0 - 1e-9))).astype(int)
    return [(np.flatnonzero(parts == count), _pieces(int(count))) for count in np.unique(parts)]


def coloured(solid: Any, corners: ArrayLike, values: ArrayLike, scale: Any) -> Any:
    """Draw triangles into 3D axes in the colours of their corners' values, which are linear between them.

    matplotlib gives a facet one colour; so triangles are drawn in pieces (`divided`), each in that of its mean. Their
    sides are drawn faintly, among the pieces: what lies behind is hidden.

    Args:
        solid: axes with projection "3d".
        corners: of the triangles (m, 3, 3), in the axes' unit.
        values: at the corners (m, 3).
        scale: matplotlib's ScalarMappable, from values to colours.

    Returns:
        matplotlib's Poly3DCollection.
    """
    from matplotlib.colors import to_rgba
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    x, table = np.asarray(corners, dtype=float), np.asarray(values, dtype=float)
    faint = np.array(to_rgba(FAINT))
    shapes, inner, outer = [], [], []
    for which, weights in divided(table, float(scale.norm.vmax - scale.norm.vmin)):
        pieces = np.einsum("pcw,kwi->kpci", weights, x[which]).reshape(-1, 3, 3)
        colours = scale.to_rgba(np.einsum("pcw,kw->kp", weights / 3.0, table[which]).ravel())
        whole = len(weights) == 1
        shapes.append(pieces)
        inner.append(colours)
        outer.append(np.broadcast_to(faint, colours.shape) if whole else colours)
        if not whole:
            sides = _sides(x[which], int(np.sqrt(len(weights))))
            shapes.append(sides)
            inner.append(np.zeros((len(sides), 4)))
            outer.append(np.broadcast_to(faint, (len(sides), 4)))
    drawn = Poly3DCollection(
        np.concatenate(shapes), facecolors=np.concatenate(inner), edgecolors=np.concatenate(outer), linewidths=_LINE,
        rasterized=True, clip_on=False,
    )  # fmt: skip
    drawn.set_in_layout(False)  # the axes are; matplotlib takes what is not clipped for as large as its numbers are
    solid.add_collection3d(drawn)
    return drawn


def new_space(columns: int = 1, *, width: float = 8.6, height: float = 3.9) -> tuple[Figure, list[Any]]:
    """Return a figure in palpate's style and its 3D axes in a row, in mm, without panes; sizes in inches."""
    figure, rows = new_figure(1, columns, width=width, height=height, sharex=False)
    spaces = []
    for flat in rows[0]:
        place = flat.get_subplotspec()
        flat.remove()
        spaces.append(figure.add_subplot(place, projection="3d", computed_zorder=False))
        for name in AXES:
            axis = getattr(spaces[-1], f"{name}axis")
            axis.set_label_text(f"{name} [mm]")
            axis.pane.set_visible(False)
    return figure, spaces


def frame(solid: Any, points: ArrayLike, least: float, *, zoom: float = 1.0) -> None:
    """Fit 3D axes around points (n, 3); what is flat takes at least the part `least` of the longest extent."""
    x = np.asarray(points, dtype=float)
    span, drawn = _spans(x, least)
    middle = (x.min(axis=0) + x.max(axis=0)) / 2.0
    half = np.where(span > 0.0, span, drawn) / 2.0
    solid.set(**{f"{name}lim": (m - h, m + h) for name, m, h in zip(AXES, middle, half, strict=True)})
    solid.set_box_aspect(drawn, zoom=zoom)
    for name, part, low, high in zip(AXES, drawn / drawn.max(), x.min(axis=0), x.max(axis=0), strict=True):
        if part < _SHORT and high > low:
            step = 10.0 ** np.floor(np.log10(high - low))
            solid.set(**{f"{name}ticks": np.unique([np.ceil(low / step) * step, np.floor(high / step) * step])})


def stretched(figure: Figure) -> str:
    """Return the end of a caption: how far the first 3D axes of a figure stretch what is flat; "" if they do not."""
    solid: Any = next(axes for axes in figure.axes if axes.name == "3d")
    factors = solid.get_box_aspect() / [np.ptp(getattr(solid, f"get_{name}lim")()) for name in AXES]
    told = [
        f"{name} is stretched {factor:.3g} times"
        for name, factor in zip(AXES, factors / factors.min(), strict=True)
        if factor > 1.005
    ]
    return f" To be seen, {' and '.join(told)}." if told else ""


def _spans(points: Array, least: float) -> tuple[Array, Array]:
    """Return the extent of points along each axis (3,), and how long it is drawn."""
    span = np.ptp(points, axis=0)
    span = np.where(span > 1e-9 * span.max(), span, 0.0)
    return span, np.maximum(span, least * span.max())


def _pieces(count: int) -> Array:
    """Return the triangles of one divided along its sides into `count`, as weights of its corners (count^2, 3, 3)."""
    found = []
    for i in range(count):
        for j in range(count - i):
            found.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < count - 1:
                found.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    second = np.array(found, dtype=float) / count
    return np.concatenate([1.0 - second.sum(axis=2, keepdims=True), second], axis=2)


def _sides(corners: Array, count: int) -> Array:
    """Return the sides of triangles (m, 3, 3) in `count` parts each, as triangles without area (3 count m, 3, 3)."""
    along = np.linspace(0.0, 1.0, count + 1)[:, None, None, None]
    at = (1.0 - along) * corners + along * np.roll(corners, -1, axis=1)
    return np.stack([at[:-1], at[1:], at[1:]], axis=-2).reshape(-1, 3, 3)
