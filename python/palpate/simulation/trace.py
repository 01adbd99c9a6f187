"""What a run leaves behind: channels with units, and the scenario and version they came from."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.errors import PalpateError
from palpate.files import named, write_whole

__all__ = ["CHANNELS", "Channel", "Trace", "TraceError"]

Array = NDArray[np.float64]
AXES: Final = ("x", "y", "z")

# channel: (unit, description); `angle`, `velocity` and `torque` are per joint (m, m/s, N for a sliding one).
CHANNELS: Final[dict[str, tuple[str, str]]] = {
    "angle": ("rad", "joint angles"),
    "velocity": ("rad/s", "joint velocities"),
    "tip": ("m", "tip position, base frame"),
    "deflection": ("m", "how far the tip has pushed the object in, per axis"),
    "object_force": ("N", "force of the tip on the object"),
    "command_force": ("N", "tip force that the controller commands, without the gravity hold"),
    "torque": ("N*m", "motor torques at the joints"),
    "reference_force": ("N", "reference force"),
    "operator_force": ("N", "force of the operator on the tip"),
    "energy": ("J", "kinetic and potential energy of the device"),
    "proxy": ("m", "the tip's proxy on the mesh (a sphere's centre)"),
    "normal": ("", "unit normal of the mesh there, outward; zero where apart"),
    "depth": ("m", "of the tip under the proxy, along the normal"),
    "surface_stiffness": ("N/m", "of the mesh at the proxy, along the normal"),
    "stored_energy": ("J", "in the body: elastic and kinetic"),
    "saved_energy": ("J", "put into the body besides, kept for snapshots to come (large displacements)"),
    "pressed_nodes": ("", "number of the body's nodes that the tip presses"),
    "solved": ("", "1; 0: more nodes lay under the tip than are looked at"),
    "triangle": ("", "number of the touched triangle, -1 where apart"),
}
_FORMAT: Final = "palpate-trace-1"


class TraceError(PalpateError):
    """A trace has wrong shapes, values that are not finite, or a file that is none."""


@dataclass(frozen=True)
class Channel:
    """One quantity in time.

    Attributes:
        values: (n, k), one row per sample.
        unit: SI, as "N*m".
        description: one line.
    """

    values: Array
    unit: str
    description: str = ""


@dataclass(frozen=True)
class Trace:
    """Channels of a run over one time axis.

    Attributes:
        time: (n,), s, increasing.
        channels: by name; those of `CHANNELS`, and any other.
        unstable_from: s, when the loop diverged; nothing is recorded from then on. None: it did not.
        metadata: "scenario" (tables of text with units), "version", and anything that JSON can hold.

    Raises:
        TraceError: lengths differ, or a value is not finite.
    """

    time: Array
    channels: dict[str, Channel]
    unstable_from: float | None = None
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.time.ndim != 1 or not np.all(np.isfinite(self.time)) or np.any(np.diff(self.time) <= 0.0):
            raise TraceError("time must be finite and increasing, one value per sample")
        for name, channel in self.channels.items():
            if channel.values.ndim != 2 or len(channel.values) != len(self.time):
                shape, n = channel.values.shape, len(self.time)
                raise TraceError(f"channel {name} must have one row per sample, {n} of them, not {shape}")
            if not np.all(np.isfinite(channel.values)):
                row = int(np.flatnonzero(~np.isfinite(channel.values).all(axis=1))[0])
                raise TraceError(
                    f"channel {name} is not finite at t = {self.time[row]:g} s: cut the trace where the loop diverges"
                )
        if self.unstable_from is not None and not math.isfinite(self.unstable_from):
            raise TraceError("unstable_from must be a finite time or None")

    @classmethod
    def of(
        cls,
        time: ArrayLike,
        values: Mapping[str, ArrayLike],
        *,
        units: Mapping[str, str] | None = None,
        unstable_from: float | None = None,
        metadata: Mapping[str, Any] | None = None,
    ) -> Trace:
        """Return a trace of channels named as in `CHANNELS`, (n,) or (n, k) each; `units` overrides theirs."""
        channels = {}
        for name, entry in values.items():
            array = np.array(entry, dtype=float)
            unit, description = CHANNELS.get(name, ("", ""))
            rows = array[:, None] if array.ndim == 1 else array
            channels[name] = Channel(rows, (units or {}).get(name, unit), description)
        return cls(np.array(time, dtype=float), channels, unstable_from, dict(metadata or {}))

    def __len__(self) -> int:
        return len(self.time)

    def __getitem__(self, name: str) -> Array:
        """Return the values (n, k) of a channel."""
        if name not in self.channels:
            raise KeyError(f"no channel {name!r}; there are {', '.join(self.channels)}")
        return self.channels[name].values

    def __contains__(self, name: object) -> bool:
        return name in self.channels

    @property
    def stable(self) -> bool:
        """Whether the run went to its end."""
        return self.unstable_from is None

    @property
    def scenario(self) -> dict[str, Any]:
        """The scenario's tables, as text with units; empty if none is known."""
        return dict(self.metadata.get("scenario", {}))

    def write(self, path: str | Path) -> Path:
        """Write HDF5, whole or not at all: a dataset per channel with its unit, the metadata as JSON.

        The file opens in MATLAB, Julia or Python. Returns the path.
        """
        return write_whole(path, self._write_hdf5)

    def _write_hdf5(self, path: Path) -> None:
        import h5py

        with h5py.File(path, "w") as file:
            file.attrs["format"] = _FORMAT
            file.attrs["stable"] = self.stable
            if self.unstable_from is not None:
                file.attrs["unstable_from"] = self.unstable_from
                file.attrs["unstable_from_unit"] = "s"
            for key, value in self.metadata.items():
                file[f"metadata/{key}"] = json.dumps(value, allow_nan=False, ensure_ascii=False)
            time = file.create_dataset("time", data=self.time, track_times=False)
            time.attrs["unit"] = "s"
            time.make_scale("time")
            group = file.create_group("channels", track_order=True)
            for name, channel in self.channels.items():
                data = group.create_dataset(
                    name, data=channel.values, compression="gzip", compression_opts=1, shuffle=True, track_times=False
                )
                data.attrs["unit"] = channel.unit
                data.attrs["description"] = channel.description
                data.dims[0].attach_scale(time)

    @classmethod
    def read(cls, path: str | Path) -> Trace:
        """Read what `write` wrote.

        Raises:
            TraceError: the file does not exist, is no HDF5, or holds no trace.
        """
        import h5py

        file_path = named(path, TraceError)
        try:
            with h5py.File(file_path, "r") as file:
                if file.attrs.get("format") != _FORMAT:
                    raise TraceError(f"{file_path}: not a trace of palpate")
                channels = {
                    name: Channel(np.array(data, dtype=float), str(data.attrs["unit"]), str(data.attrs["description"]))
                    for name, data in file["channels"].items()
                }
                unstable = file.attrs.get("unstable_from")
                metadata = {key: json.loads(entry[()]) for key, entry in file.get("metadata", {}).items()}
                time = np.array(file["time"], dtype=float)
        except FileNotFoundError:
            raise TraceError(f"{file_path}: there is no such file") from None
        except TraceError:
            raise
        except (OSError, LookupError, RuntimeError, TypeError, AttributeError, ValueError) as problem:
            # What h5py raises for a damaged file, or one of another shape.
            raise TraceError(f"{file_path}: not a readable trace: {problem}") from None
        return cls(time, channels, None if unstable is None else float(unstable), metadata)

    def write_csv(self, path: str | Path) -> Path:
        """Write one row per sample, whole or not at all; the header has name, axis or joint, and unit in brackets."""
        return write_whole(path, self._write_csv)

    def _write_csv(self, path: Path) -> None:
        header = ["time [s]"]
        for name, channel in self.channels.items():
            count = channel.values.shape[1]
            per_joint = name in ("angle", "velocity", "torque")
            labels = AXES if count == 3 and not per_joint else tuple(str(i + 1) for i in range(count))
            suffixes = [""] if count == 1 else [f"_{label}" for label in labels]
            header += [f"{name}{suffix} [{channel.unit}]" for suffix in suffixes]
        table = np.column_stack([self.time, *(channel.values for channel in self.channels.values())])
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(header)
            writer.writerows([repr(value) for value in row] for row in table.tolist())
