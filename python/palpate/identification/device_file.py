"""Device files from identified parameters."""

from __future__ import annotations

import os
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Final

from palpate.devices.writer import write_device
from palpate.errors import DeviceError
from palpate.files import as_path

if TYPE_CHECKING:
    from palpate.identification.parameters import ParameterFit

_IDENTIFIED: Final = ("mass", "inertia", "friction")  # tables that the estimate determines


def write_fit(fit: ParameterFit, path: str | os.PathLike[str]) -> Path:
    """Write the device file of an estimate: see `ParameterFit.save`."""
    file = as_path(path, DeviceError)
    device, given = fit.device, fit.template.parameters.values
    source = f"identified from {fit.file} on {date.today().isoformat()}"
    sources = {"identified": source, "device": f"device {fit.template.name}, unchanged"}
    new = {
        key
        for key, values in device.parameters.values.items()
        if key.partition(".")[0] in _IDENTIFIED or values != given.get(key)
    }
    keys = device.parameters.values
    comments = [
        f"{device.name}: {source}.",
        f"Estimates with {100 * fit.level:g} % intervals. The masses and inertias below are one choice that has these",
        "base parameters; no other choice moves differently.",
        *_rows(fit),
    ]
    named = replace(device, name=file.stem, description=f"{device.description}; identified from {fit.file}")
    return write_device(file, named, sources, {k: "identified" if k in new else "device" for k in keys}, None, comments)


def _rows(fit: ParameterFit) -> list[str]:
    """Return a line per parameter: value, interval, unit and meaning."""
    lines = []
    for i, p in enumerate(fit.parameters):
        interval = f"{fit.low[i]:.4g} to {fit.high[i]:.4g}"
        mark = "; not determined by this recording" if p.name in fit.undetermined else ""
        lines.append(f"  {p.name:4}{fit.value[i]:>12.4g}  {interval:>26}  {p.unit}, {p.meaning}{mark}")
    return lines
