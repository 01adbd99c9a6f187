"""A recording as HDF5: data sets time, angle, torque (and excitation), each with its unit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from palpate.arrays import Array
from palpate.errors import RecordingError
from palpate.identification.channel_units import (
    ANGLE_UNITS,
    FORCE_UNITS,
    LENGTH_UNITS,
    TIME_UNITS,
    TORQUE_UNITS,
    joint_scale,
    scale_of,
)
from palpate.identification.samples import Columns


def read_hdf5(file: Path) -> Columns:
    """Return the samples in `file`; raises RecordingError that names the channel."""
    with h5py.File(file, "r") as store:

        def channel(name: str, required: bool = True) -> tuple[Array, str] | None:
            for place in (name, f"channels/{name}"):
                if place in store and isinstance(store[place], h5py.Dataset):
                    unit = store[place].attrs.get("unit", store[place].attrs.get("units", ""))
                    return np.asarray(store[place], dtype=float), unit.decode() if isinstance(unit, bytes) else str(
                        unit
                    )
            if required:
                raise RecordingError(
                    f"{file}: there is no channel '{name}' (a palpate trace has time, angle and torque)"
                )
            return None

        time, angle, torque = channel("time"), channel("angle"), channel("torque")
        excitation = channel("excitation", required=False)
        metadata: dict[str, Any] = {}
        text = store.attrs.get("metadata")
        if text is not None:
            try:
                loaded = json.loads(text)
            except (json.JSONDecodeError, TypeError):
                loaded = {}
            metadata = loaded if isinstance(loaded, dict) else {}
        period = float(store.attrs.get("period", 0.0))
    assert time is not None
    assert angle is not None
    assert torque is not None
    seconds = time[0].ravel() * scale_of(time[1], TIME_UNITS, f"{file}: channel 'time'", "time")
    angle_scale, slides = joint_scale(angle[1], ANGLE_UNITS, LENGTH_UNITS, f"{file}: channel 'angle'", "a joint")
    torque_scale, pushes = joint_scale(torque[1], TORQUE_UNITS, FORCE_UNITS, f"{file}: channel 'torque'", "a torque")
    if slides != pushes:
        raise RecordingError(f"{file}: rad goes with N*m and m with N, not '{angle[1]}' with '{torque[1]}'")
    injected = None
    if excitation is not None:
        scale, _ = joint_scale(excitation[1], TORQUE_UNITS, FORCE_UNITS, f"{file}: channel 'excitation'", "a torque")
        injected = excitation[0] * scale
    return Columns(
        seconds,
        angle[0] * angle_scale,
        torque[0] * torque_scale,
        period,
        {**metadata, "file": file.name},
        injected,
        ("m", "N") if slides else ("rad", "N*m"),
    )


def write_hdf5(recording: Columns, path: Path) -> None:
    """Write every channel with its unit and a description."""
    with h5py.File(path, "w") as store:
        channels: dict[str, tuple[Array | None, str, str]] = {
            "time": (recording.time, "s", "time of the sample"),
            "angle": (recording.angle, recording.units[0], "joint coordinates as the encoders read them"),
            "torque": (recording.torque, recording.units[1], "joint torque held from this sample to the next"),
            "excitation": (recording.excitation, recording.units[1], "injected part of the torque"),
        }
        for name, (values, unit, description) in channels.items():
            if values is not None:
                data = store.create_dataset(name, data=values)
                data.attrs["unit"] = unit
                data.attrs["description"] = description
        store.attrs["period"] = recording.period
        store.attrs["metadata"] = json.dumps(recording.metadata)
