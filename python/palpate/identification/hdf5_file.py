"""Recording as HDF5: data sets time, angle, torque (and excitation), each with its unit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from palpate.arrays import Array
from palpate.errors import RecordingError
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
    with h5py.File(file, "r") as store:
        data = {name: _find(store, name) for name in _DESCRIPTIONS}
        for name in ("time", "angle", "torque"):
            if data[name] is None:
                raise RecordingError(
                    f"{file}: there is no channel '{name}' (a palpate trace has time, angle and torque)"
                )
        time, angle, torque = (_channel(data[name], name, file) for name in ("time", "angle", "torque"))
        excitation = None if data["excitation"] is None else _channel(data["excitation"], "excitation", file)
        try:
            metadata = json.loads(store.attrs.get("metadata", "{}"))
        except (json.JSONDecodeError, TypeError):
            metadata = {}
        period = float(store.attrs.get("period", 0.0))
    if angle.slides != torque.slides:
        raise RecordingError(f"{file}: rad goes with N*m and m with N, not '{angle.unit}' with '{torque.unit}'")
    return Columns(
        time.values.ravel(),
        angle.values,
        torque.values,
        period,
        {**(metadata if isinstance(metadata, dict) else {}), "file": file.name},
        None if excitation is None else excitation.values,
        ("m", "N") if angle.slides else ("rad", "N*m"),
    )


def write_hdf5(recording: Columns, path: Path) -> None:
    """Write every channel with its unit and a description."""
    angle_unit, torque_unit = recording.units
    units = {"time": "s", "angle": angle_unit, "torque": torque_unit, "excitation": torque_unit}
    with h5py.File(path, "w") as store:
        for name, unit in units.items():
            values = getattr(recording, name)
            if values is not None:
                data = store.create_dataset(name, data=values)
                data.attrs["unit"] = unit
                data.attrs["description"] = _DESCRIPTIONS[name]
        store.attrs["period"] = recording.period
        store.attrs["metadata"] = json.dumps(recording.metadata)


def _find(store: Any, name: str) -> h5py.Dataset | None:
    """Return a data set at the root or under `channels`; None if there is none."""
    places = (store.get(place) for place in (name, f"channels/{name}"))
    return next((data for data in places if isinstance(data, h5py.Dataset)), None)


def _channel(data: h5py.Dataset, name: str, file: Path) -> _Channel:
    unit = data.attrs.get("unit", data.attrs.get("units", ""))
    text = unit.decode() if isinstance(unit, bytes) else str(unit)
    scale, slides = channel_scale(name, text, f"{file}: channel '{name}'")
    return _Channel(np.asarray(data, dtype=float) * scale, text, slides)
