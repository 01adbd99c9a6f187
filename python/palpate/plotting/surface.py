"""3D surfaces with linearly interpolated colors, and axes that stretch flat surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.arrays import Array
from palpate.plotting.style import FAINT, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AXES: Final = ("x", "y", "z")
_STEPS: Final = 16  # of color over the range of the values; no piece of a triangle spans more than one
_LINE: Final = 0.25  # points
_SHORT: Final = 0.3  # length over the longest axis, below which an axis has two ticks


def divided(values: ArrayLike, span: float) -> list[tuple[NDArray[np.intp], Array]]:
    """Subdivide triangles until the values at the corners of a piece differ by at most a sixteenth of `span`.

    Args:
        values: at the corners of the triangles (m, 3), linear in between.
        span: range of the colors, in the unit of the values.

    Returns:
        For each number of parts per side: the triangles with that subdivision (k,), and the corners of the pieces as
        barycentric weights (pieces, 3, 3).
    """
    table = np.asarray(values, dtype=float)
    parts = np.ones(len(table), dtype=int)
    if span > 0.0:
        parts = np.maximum(1, np.ceil(_STEPS * np.ptp(table, axis=1) / span * (1.0 - 1e-9))).astype(int)
    return [(np.flatnonzero(parts == count), _pieces(int(count))) for count in np.unique(parts)]


def draw_colored(solid: Any, corners: ArrayLike, values: ArrayLike, scale: Any) -> Any:
    """Draw triangles into 3D axes with colors interpolated between the values at their corners.

    matplotlib has one color per polygon, so triangles are drawn in pieces (`divided`) of their mean color. The sides of
    the triangles belong to the same collection, so they are depth-sorted with the pieces.

    Args:
        solid: axes with projection "3d".
        corners: of the triangles (m, 3, 3), in the unit of the axes.
        values: at the corners (m, 3).
        scale: matplotlib ScalarMappable that maps values to colors.

    Returns:
        The matplotlib Poly3DCollection.
    """
    from matplotlib.colors import to_rgba
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    x, table = np.asarray(corners, dtype=float), np.asarray(values, dtype=float)
    faint = np.array(to_rgba(FAINT))
    shapes, inner, outer = [], [], []
    low, high = float(scale.norm.vmin), float(scale.norm.vmax)
    for index, weights in divided(np.clip(table, low, high), high - low):  # beyond the scale there is one color
        pieces = np.einsum("pcw,kwi->kpci", weights, x[index]).reshape(-1, 3, 3)
        colors = scale.to_rgba(np.einsum("pcw,kw->kp", weights / 3.0, table[index]).ravel())
        undivided = len(weights) == 1
        shapes.append(pieces)
        inner.append(colors)
        outer.append(np.broadcast_to(faint, colors.shape) if undivided else colors)
        if not undivided:
            sides = _sides(x[index], int(np.sqrt(len(weights))))
            shapes.append(sides)
            inner.append(np.zeros((len(sides), 4)))
            outer.append(np.broadcast_to(faint, (len(sides), 4)))
    collection = Poly3DCollection(
        np.concatenate(shapes), facecolors=np.concatenate(inner), edgecolors=np.concatenate(outer), linewidths=_LINE,
        rasterized=True, clip_on=False,
    )  # fmt: skip
    collection.set_in_layout(False)  # matplotlib would take unclipped 3D data for 2D extents
    solid.add_collection3d(collection)
    return collection


def new_space(columns: int = 1, *, width: float = 8.6, height: float = 3.9) -> tuple[Figure, list[Any]]:
    """Return a figure in palpate's style and a row of 3D axes in mm, without panes; sizes in inches."""
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
    """Fit 3D axes to points.

    Args:
        solid: axes with projection "3d".
        points: (n, 3), in the unit of the axes.
        least: smallest length of an axis over the longest one; shorter axes are stretched.
        zoom: of the camera.
    """
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
    """Return a sentence for the caption on the stretched axes of a figure's first 3D axes; "" if there are none."""
    solid: Any = next(axes for axes in figure.axes if axes.name == "3d")
    factors = solid.get_box_aspect() / [np.ptp(getattr(solid, f"get_{name}lim")()) for name in AXES]
    axes = [
        f"{name} is stretched {factor:.3g} times"
        for name, factor in zip(AXES, factors / factors.min(), strict=True)
        if factor > 1.005
    ]
    return f" For visibility, {' and '.join(axes)}." if axes else ""


def _spans(points: Array, least: float) -> tuple[Array, Array]:
    """Return the extent of points along each axis (3,), and its drawn length (3,)."""
    span = np.ptp(points, axis=0)
    span = np.where(span > 1e-9 * span.max(), span, 0.0)
    return span, np.maximum(span, least * span.max())


def _pieces(count: int) -> Array:
    """Return the pieces of a triangle with sides in `count` parts, as barycentric weights (count^2, 3, 3)."""
    pieces = []
    for i in range(count):
        for j in range(count - i):
            pieces.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < count - 1:
                pieces.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    second = np.array(pieces, dtype=float) / count
    return np.concatenate([1.0 - second.sum(axis=2, keepdims=True), second], axis=2)


def _sides(corners: Array, count: int) -> Array:
    """Return the sides of triangles (m, 3, 3) in `count` parts, as degenerate triangles (3 count m, 3, 3)."""
    t = np.linspace(0.0, 1.0, count + 1)[:, None, None, None]
    points = (1.0 - t) * corners + t * np.roll(corners, -1, axis=1)
    return np.stack([points[:-1], points[1:], points[1:]], axis=-2).reshape(-1, 3, 3)
