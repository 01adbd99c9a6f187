"""Recording as HDF5: data sets time, angle, torque (and excitation), each with its unit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from palpate.arrays import Array
from palpate.errors import RecordingError
from palpate.files import hdf5_output
from palpate.files.hdf5_input import Hdf5Reader, open_foreign
from palpate.files.json_text import load_table
from palpate.identification.channel_units import channel_scale
from palpate.identification.samples import Columns

_DESCRIPTIONS = {
    "time": "time of the sample",
    "angle": "joint coordinates as the encoders read them",
    "torque": "joint torque held from this sample to the next",
    "excitation": "injected part of the torque",
}


class _Channel(NamedTuple):
    values: Array  # SI
    unit: str  # in the file
    slides: bool


def read_hdf5(file: Path) -> Columns:
    """Return the samples of a file. Raise RecordingError, naming the channel, if one is missing or has no unit."""
    with open_foreign(file, RecordingError, "recording") as store:
        places = {name: _place(store, name) for name in _DESCRIPTIONS}
        if not any(places.values()):
            raise RecordingError(
                f"{file}: this is not a recording, as it has none of the channels time, angle and torque; give the "
                "trace of a run, or a file with these channels"
            )
        for name in ("time", "angle", "torque"):
            if not places[name]:
                raise RecordingError(
                    f"{file}: there is no channel '{name}' (a palpate trace has time, angle and torque)"
                )
        time, angle, torque = (_channel(store, name, places[name]) for name in ("time", "angle", "torque"))
        excitation = _channel(store, "excitation", places["excitation"]) if places["excitation"] else None
        metadata = load_table(store.text_attribute("metadata", default="{}"), RecordingError, f"{file}: metadata")
        period = store.number_attribute("period", default=0.0)
    if angle.slides != torque.slides:
        raise RecordingError(f"{file}: rad goes with N*m and m with N, not '{angle.unit}' with '{torque.unit}'")
    return Columns(
        time.values.ravel(),
        angle.values,
        torque.values,
        period,
        {**metadata, "file": file.name},
        None if excitation is None else excitation.values,
        ("m", "N") if angle.slides else ("rad", "N*m"),
    )


def write_hdf5(recording: Columns, path: Path) -> Path:
    """Write every channel with its unit and a description, atomically."""
    angle_unit, torque_unit = recording.units
    units = {"time": "s", "angle": angle_unit, "torque": torque_unit, "excitation": torque_unit}

    def fill(store: Any) -> None:
        for name, unit in units.items():
            values = getattr(recording, name)
            if values is not None:
                data = store.create_dataset(name, data=values)
                data.attrs["unit"] = unit
                data.attrs["description"] = _DESCRIPTIONS[name]
        store.attrs["period"] = recording.period
        store.attrs["metadata"] = json.dumps(recording.metadata)

    return hdf5_output.write_hdf5(path, fill)


def _place(store: Hdf5Reader, name: str) -> str:
    """Return where a channel is, at the root or under `channels`; "" if there is none."""
    return next((place for place in (name, f"channels/{name}") if store.has(place)), "")


def _channel(store: Hdf5Reader, name: str, place: str) -> _Channel:
    unit = store.text_attribute("unit", place, store.text_attribute("units", place, ""))
    scale, slides = channel_scale(name, unit, f"{store.path}: channel '{name}'")
    return _Channel(store.array(place, "iuf").astype(float) * scale, unit, slides)
