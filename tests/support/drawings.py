"""Description of figures as plain values."""

from __future__ import annotations

from typing import Any

import numpy as np
from fingerprint import fingerprint
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import Collection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text


def drawing(figure: Figure) -> dict[str, Any]:
    """Return all that a figure shows as plain values; an array is its length and fingerprint."""
    return {
        "size": figure.get_size_inches(),
        "texts": [_text(one) for one in (*figure.texts, figure._suptitle) if one],  # type: ignore[attr-defined]
        "legends": [_legend(one) for one in figure.legends],
        "axes": [_axes(one) for one in figure.axes],
    }


def _axes(axes: Axes) -> dict[str, Any]:
    z = ("z",) if hasattr(axes, "get_zlim") else ()
    found: dict[str, Any] = {
        "titles": [_text(axes.title), _text(axes._left_title)],  # type: ignore[attr-defined]
        "aspect": axes.get_aspect(),
        "frame": [axes.axison, *(axes.spines[side].get_visible() for side in axes.spines)],
        "view": [getattr(axes, name, None) for name in ("elev", "azim", "roll")],
        "box": list(getattr(axes, "_box_aspect", None) if z else [axes.get_box_aspect()]),
    }
    for name in ("x", "y", *z):
        axis = getattr(axes, f"{name}axis")
        found[name] = {
            "label": _text(axis.label),
            "scale": axis.get_scale(),
            "limits": getattr(axes, f"get_{name}lim")(),
            "ticks": [float(x) for x in axis.get_majorticklocs()],
            "shown": [text.get_text() for text in axis.get_majorticklabels()],
            "padding": axis.labelpad,
        }
    if bar := getattr(axes, "_colorbar", None):
        info = getattr(axes, "_colorbar_info", {})
        found["bar"] = [
            bar.extend,
            bar.orientation,
            *(info.get(key) for key in ("shrink", "pad", "aspect", "fraction")),
        ]
    legend = axes.get_legend()
    found["legend"] = _legend(legend) if legend else None
    found["artists"] = [_artist(one) for one in axes.get_children() if isinstance(one, Line2D | Patch | Collection)]
    found["texts"] = [_text(one) for one in axes.texts]
    return found


def _artist(artist: Artist) -> dict[str, Any]:
    found: dict[str, Any] = {
        "type": type(artist).__name__,
        "label": str(artist.get_label()),
        "alpha": _array(artist.get_alpha()),
        "order": artist.get_zorder(),
        "shown": artist.get_visible(),
    }
    if isinstance(artist, Line2D):
        data = artist.get_data_3d() if hasattr(artist, "get_data_3d") else artist.get_data()
        found |= {
            "data": [_array(part) for part in data],
            "color": to_hex(artist.get_color()),
            "width": artist.get_linewidth(),
            "dashes": artist._unscaled_dash_pattern,  # type: ignore[attr-defined]
            "marker": [str(artist.get_marker()), artist.get_markersize(), artist.get_markeredgewidth()],
            "marker colors": [to_hex(artist.get_markerfacecolor()), to_hex(artist.get_markeredgecolor())],
        }
    elif isinstance(artist, Patch):
        found |= {
            "path": _array(artist.get_path().vertices),
            "face": to_hex(artist.get_facecolor(), keep_alpha=True),
            "edge": to_hex(artist.get_edgecolor(), keep_alpha=True),
            "width": artist.get_linewidth(),
            "hatch": artist.get_hatch(),
        }
    elif isinstance(artist, Collection):
        faces = getattr(artist, "_faces", None)
        found |= {
            "paths": [_array(path.vertices) for path in artist.get_paths()][:20] if faces is None else _array(faces),
            "offsets": _array(artist.get_offsets()),
            "sizes": _array(artist.get_sizes()) if hasattr(artist, "get_sizes") else None,
            "faces": _array(getattr(artist, "_facecolor3d", artist.get_facecolor())),
            "edges": _array(getattr(artist, "_edgecolor3d", artist.get_edgecolor())),
            "widths": _array(artist.get_linewidth()),
            "dashes": str(artist.get_linestyle()),
            "hatch": artist.get_hatch(),
        }
    if isinstance(artist, ScalarMappable) and artist.get_array() is not None:
        values = np.ma.filled(np.ma.asarray(artist.get_array(), dtype=float), -1.0)
        found["values"] = [_array(values), artist.get_clim(), artist.get_cmap().name, type(artist.norm).__name__]
    return found


def _text(text: Text) -> list[Any]:
    style = [text.get_color(), text.get_fontsize(), str(text.get_fontweight()), text.get_ha(), text.get_va()]
    return [text.get_text(), list(text.get_position()) if text.get_text() else None, *style, text.get_rotation()]


def _legend(legend: Any) -> dict[str, Any]:
    return {
        "texts": [_text(one) for one in legend.get_texts()],
        "handles": [_artist(one) for one in legend.legend_handles],
        "place": [str(legend._loc), legend._ncols, legend.get_frame_on()],
    }


def _array(values: Any) -> Any:
    if values is None or np.ndim(values) == 0:
        return values
    array = np.asarray(np.ma.filled(values, np.nan) if np.ma.isMaskedArray(values) else values, dtype=float)
    missing = ~np.isfinite(array)
    return [*array.shape, int(missing.sum()), fingerprint(np.where(missing, -1.0, array), smallest=1e-4)]
