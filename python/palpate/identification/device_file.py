"""Device files from identified parameters."""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Final

from palpate.devices import Device
from palpate.devices.writer import write_device
from palpate.errors import DeviceError
from palpate.files import as_path

_IDENTIFIED: Final = ("mass", "inertia", "friction")  # tables that the estimate determines


def write_fit(
    path: str | os.PathLike[str], device: Device, template: Device, recording: str, comments: Iterable[str]
) -> Path:
    """Write the device file of an estimate.

    Args:
        path: file to write (.toml).
        device: estimated device.
        template: device whose other numbers are kept.
        recording: name of the recording.
        comments: lines at the top of the file.

    Raises:
        DeviceError: the parameters are those of no physical device.
        OutputError: the file cannot be written.
    """
    file, given = as_path(path, DeviceError), template.parameters.values
    source = f"identified from {recording} on {date.today().isoformat()}"
    sources = {"identified": source, "device": f"device {template.name}, unchanged"}
    values = device.parameters.values
    new = {key for key in values if key.partition(".")[0] in _IDENTIFIED or values[key] != given.get(key)}
    named = replace(device, name=file.stem, description=f"{device.description}; identified from {recording}")
    origins = {key: "identified" if key in new else "device" for key in values}
    return write_device(file, named, sources, origins, None, [f"{device.name}: {source}.", *comments])
