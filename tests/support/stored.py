"""Comparison of whole results with those stored beside the tests.

`PALPATE_STORE=1 pytest tests/report tests/plotting` writes them anew; read the difference before it is committed.
"""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest
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

RELATIVE: Final = 2e-5
ABSOLUTE: Final = 1e-9
REMEDY: Final = "if it is meant, write the stored results anew with PALPATE_STORE=1 and read their difference"


def check_stored(file: Path, found: Any, relative: float = RELATIVE) -> None:
    """Compare texts, numbers, lists and tables of them with those in a JSON file."""
    found = _plain(found)
    if os.environ.get("PALPATE_STORE"):
        file.parent.mkdir(exist_ok=True)
        file.write_text(_written(found), "utf-8")
    stored = json.loads(file.read_text("utf-8"))
    places = _differences(stored, found, file.stem, relative)
    assert not places, "\n".join([*places[:10], REMEDY])


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


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(key): _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(part) for part in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return value if value is None or isinstance(value, str | bool | int | float) else str(value)


def _written(found: Any) -> str:
    """Return JSON with a line for each entry, and ten digits of each number."""
    rounded = json.loads(json.dumps(found), parse_float=lambda digits: float(f"{float(digits):.10g}"))
    if isinstance(rounded, dict):
        rows = [f"{json.dumps(key)}: {json.dumps(entry, ensure_ascii=False)}" for key, entry in rounded.items()]
        return "{\n" + ",\n".join(rows) + "\n}\n"
    if not isinstance(rounded, list):
        return json.dumps(rounded, ensure_ascii=False) + "\n"
    return "[\n" + ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in rounded) + "\n]\n"


def _differences(stored: Any, found: Any, place: str, relative: float) -> list[str]:
    if isinstance(stored, dict) and isinstance(found, dict) and stored.keys() == found.keys():
        return [line for key in stored for line in _differences(stored[key], found[key], f"{place}.{key}", relative)]
    if isinstance(stored, list) and isinstance(found, list) and len(stored) == len(found):
        pairs = enumerate(zip(stored, found, strict=True))
        return [line for i, (a, b) in pairs for line in _differences(a, b, f"{place}[{i}]", relative)]
    if isinstance(stored, float) or isinstance(found, float):
        near = pytest.approx(stored, rel=relative, abs=ABSOLUTE, nan_ok=True)
        return [] if isinstance(found, int | float) and found == near else [_line(place, stored, found)]
    return [] if stored == found else [_line(place, stored, found)]


def _line(place: str, stored: Any, found: Any) -> str:
    return f"{place}: stored {str(stored)[:100]}, found {str(found)[:100]}"
