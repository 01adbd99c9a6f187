"""Devices with a lowest flexible mode, for tests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from palpate.devices import Device
from palpate.devices.device import Parameters
from palpate.devices.writer import write_device


def with_mode(device: Device, frequency: float, share: float, damping: float) -> Device:
    mode = {"flexible.frequency": (frequency,), "flexible.tip_share": (share,), "flexible.damping_ratio": (damping,)}
    return replace(device, parameters=Parameters(dict(device.parameters.values) | mode))


def device_file(folder: Path, device: Device, frequency: float, share: float = 0.4, damping: float = 0.01) -> str:
    """Write a device with a mode; return the path of its file."""
    own = with_mode(device, frequency, share, damping)
    path = folder / f"{device.model.name}-{frequency:g}-{share:g}.toml"
    write_device(path, own, {"me": "test"}, dict.fromkeys(own.model.fields, "me"))
    return str(path)
