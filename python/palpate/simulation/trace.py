"""Trace of a run: channels with units, scenario and version."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import ArrayLike

from palpate.arrays import Array
from palpate.checks import MAX_TIPS
from palpate.errors import OutputError, PalpateError
from palpate.files import HDF5_SIGNATURE, as_path, atomic_write
from palpate.files.hdf5_output import write_hdf5
from palpate.files.json_text import load_json
from palpate.scenario import Scenario
from palpate.simulation.judgment import judge
from palpate.simulation.trace_export import (
    Channel,
    TraceContent,
    columns,
    write_csv,
    write_mat,
    write_mcap,
    write_parquet,
)
from palpate.simulation.verdict import Verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


# channel: (unit, description); `angle`, `velocity` and `torque` are per joint (m, m/s, N for a sliding one).
CHANNELS: Final[dict[str, tuple[str, str]]] = {
    "angle": ("rad", "joint angles"),
    "velocity": ("rad/s", "joint velocities"),
    "tip": ("m", "tip position, base frame"),
    "tip_offset": ("m", "displacement of the tip by the flexible mode, from the position that the joint angles give"),
    "deflection": ("m", "deflection of the object at the tip, per axis"),
    "object_force": ("N", "force of the tip on the object"),
    "command_force": (
        "N",
        "tip force of operator and motors commanded, without gravity compensation",
    ),
    "motor_force": ("N", "share of the motors: the command minus the reference force of the operator"),
    "torque": ("N*m", "joint torques of the command and the gravity compensation"),
    "motor_torque": ("N*m", "share of the motors"),
    "reference_force": ("N", "reference force, exerted by the operator"),
    "operator_force": ("N", "force of the operator on the tip, without the inertial force of a rigid arm"),
    "tool": ("m", "position of the virtual tool, which touches the object"),
    "measured_force": ("N", "force of the operator on the tip, as the servo measures it"),
    "guarded": ("", "1 while the guard changes the force"),
    "energy": ("J", "kinetic and potential energy of the device"),
    "proxy": ("m", "proxy of the tip on the mesh (center of a sphere)"),
    "normal": ("", "outward unit normal of the mesh at the proxy; zero without contact"),
    "depth": ("m", "depth of the tip below the proxy or the surface, along the normal"),
    "slope": ("N/m", "slope of the force law at the depth of the tip"),
    "mass_position": ("m", "position of the virtual mass"),
    "surface_stiffness": ("N/m", "stiffness of the mesh at the proxy, along the normal"),
    "stored_energy": ("J", "elastic and kinetic energy of the object"),
    "tank_energy": ("J", "level of the energy tank of the body (large displacements)"),
    "contact_nodes": ("", "number of nodes of the body in contact"),
    "solved": ("", "1; 0 if the contact force was not found, as with too many nodes under the tip"),
    "contact_moment": ("N*m", "moment about the tip of the force of the tip on the object, per axis"),
    **{f"point{k}_force": ("N", f"force of tip {k} of the tool on the object") for k in range(1, MAX_TIPS + 1)},
    "contact_lost": ("", "1 while the tip is inside the body without contact: it began there or was pushed through"),
    "triangle": ("", "index of the triangle in contact, -1 without contact"),
    "frame_position": ("m", "origin of the frame of a moving object"),
    "frame_rotation": ("rad", "rotation of the frame of a moving object, as a rotation vector"),
}
_OF_OBJECTS: Final = {"force": CHANNELS["object_force"], "touching": ("", "1 while the tip touches it"), **CHANNELS}
_FORMAT: Final = "palpate-trace-1"
_JOINTS: Final = ("angle", "velocity", "torque", "motor_torque")
_HDF5: Final = (".h5", ".hdf5")
# suffix: first bytes of a file of that format
_SIGNATURES: Final = {
    ".h5": HDF5_SIGNATURE,
    ".hdf5": HDF5_SIGNATURE,
    ".csv": b"time [s]",
    ".mat": b"MATLAB 5.0",
    ".parquet": b"PAR1",
    ".mcap": b"\x89MCAP0\r\n",
}


class TraceError(PalpateError):
    """A trace has wrong shapes or values that are not finite, or a file is not a trace."""


def describe_channel(name: str) -> tuple[str, str]:
    """Return unit and description of a channel; that of one object of a scene begins with the object's name."""
    if name in CHANNELS:
        return CHANNELS[name]
    own = max((key for key in _OF_OBJECTS if name.endswith(f"_{key}")), key=len, default="")
    unit, description = _OF_OBJECTS.get(own, ("", ""))
    return unit, f"{name.removesuffix(f'_{own}')}: {description}" if description else ""


@dataclass(frozen=True, repr=False)
class Trace(TraceContent):
    """Channels of a run over one time axis.

    Attributes:
        time: (n,), s, increasing.
        channels: by name; those of `CHANNELS`, and any other.
        unstable_from: time of divergence, s, at which the recording ends; None for a loop that did not diverge.
        metadata: "scenario" (tables of text with units), "version", and anything that JSON can hold.

    Raises:
        TraceError: lengths differ, or a value is not finite.
    """

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
            unit, description = describe_channel(name)
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
    def completed(self) -> bool:
        """Whether the run went to its end without divergence; the verdict says whether it settled."""
        return self.unstable_from is None

    @cached_property
    def verdict(self) -> Verdict:
        """Verdict of the run, by the rule that every command uses (see `palpate.simulation.decision`).

        A run that records fewer ticks than it judges has it in its metadata.
        """
        with complete():
            return Verdict.from_dict(self.metadata.get("verdict")) or judge(self)

    @property
    def stable(self) -> bool:
        """Whether the verdict is "settled"."""
        return self.verdict.settled

    @property
    def scenario(self) -> dict[str, Any]:
        """The scenario's tables, as text with units; empty if none is known."""
        return dict(self.metadata.get("scenario", {}))

    def recorded(self, scenario: Scenario) -> Trace:
        """Return what a scenario records of this trace of every tick, with the verdict of every tick."""
        every = scenario.run.record_every
        if every == 1:
            return self
        told = {"scenario": scenario.to_dict(), "verdict": self.verdict.to_dict()}
        return self.thinned(every, {**self.metadata, **told})

    def thinned(self, every: int, metadata: Mapping[str, Any]) -> Trace:
        """Return the trace of every n-th sample, with other metadata."""
        channels = {name: replace(one, values=one.values[::every]) for name, one in self.channels.items()}
        return Trace(self.time[::every], channels, self.unstable_from, dict(metadata))

    def save(self, path: str | Path) -> Path:
        """Write the trace atomically in the format of the suffix.

        `.h5` (HDF5): a dataset per channel with its unit, the metadata as JSON; `load` reads it back. Exports: `.csv`,
        `.mat` (MATLAB 5), `.parquet`, and `.mcap` for Foxglove and PlotJuggler. The last two need `palpate[export]`.
        Returns the path.

        Raises:
            TraceError: the suffix is of no known format.
            OutputError: the file cannot be written, or is one of another format.
        """
        file = as_path(path, OutputError)
        exports = {".csv": write_csv, ".mat": write_mat, ".parquet": write_parquet, ".mcap": write_mcap}
        suffix = file.suffix.lower()
        if suffix not in {*_HDF5, *exports}:
            raise TraceError(
                f"{file}: the suffix decides the format of a trace; it is .h5, .csv, .mat, .parquet or .mcap, "
                f"not {file.suffix!r}"
            )
        _check_format(file)
        if suffix in _HDF5:
            return write_hdf5(file, self._fill_hdf5)
        return atomic_write(file, lambda part: exports[suffix](self, part))

    def to_pandas(self) -> DataFrame:
        """Return a table with a row per sample and a column per component, "tip_x [m]"; the index is the time, s.

        Raises:
            TraceError: pandas is not installed.
        """
        try:
            import pandas as pd
        except ImportError:
            raise TraceError("to_pandas needs pandas: pip install 'palpate[export]'") from None
        table = pd.DataFrame(columns(self)).set_index("time [s]")
        table.attrs.update(self.metadata)
        return table

    def __repr__(self) -> str:
        end = f" to {self.time[-1]:g} s" if len(self) else ""
        state = "" if self.unstable_from is None else f", diverged at {self.unstable_from:g} s"
        return f"<Trace: {len(self)} samples{end}{state}; {', '.join(self.channels)}>"

    def plot(self, channel: str = "deflection", ax: Axes | None = None) -> Axes:
        """Draw a channel over the time and return its axes; components that stay zero are left out.

        Args:
            channel: its name, such as "object_force".
            ax: axes of matplotlib to draw into; None: new ones of pyplot.

        Raises:
            KeyError: there is no such channel.
        """
        values = self[channel]
        if ax is None:
            from matplotlib import pyplot

            ax = pyplot.subplots(figsize=(6.4, 3.2), layout="constrained")[1]
        names = "xyz" if values.shape[1] == 3 and channel not in _JOINTS else "123"
        shown = [i for i in range(values.shape[1]) if values[:, i].any()] or [0]
        for i in shown:
            ax.plot(self.time, values[:, i], label=names[i] if i < len(names) else str(i + 1))
        unit = self.channels[channel].unit
        ax.set_xlabel("time [s]")
        ax.set_ylabel(f"{channel.replace('_', ' ')} [{unit}]" if unit else channel.replace("_", " "))
        if values.shape[1] > 1:
            ax.legend()
        return ax

    def _repr_html_(self) -> str:
        """Return a table of the channels, for a notebook."""
        title = escape(str(self.scenario.get("title", "Trace")))
        end = f"{self.time[-1]:g} s" if len(self) else "nothing"
        state = f"diverged at {self.unstable_from:g} s" if self.unstable_from is not None else "ran to its end"
        rows = "".join(
            f"<tr><td>{escape(name)}</td><td>{escape(c.unit)}</td><td>{_extent(c.values)}</td>"
            f"<td>{escape(c.description)}</td></tr>"
            for name, c in self.channels.items()
        )
        return (
            f"<p><b>{title}</b>: {len(self)} samples to {end}, {state}</p><table><thead><tr><th>channel</th>"
            f"<th>unit</th><th>least to largest</th><th>meaning</th></tr></thead><tbody>{rows}</tbody></table>"
        )

    def _fill_hdf5(self, file: Any) -> None:
        file.attrs["format"] = _FORMAT
        file.attrs["completed"] = self.completed
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
    def load(cls, path: str | Path) -> Trace:
        """Read a trace that `save` wrote as `.h5`.

        Raises:
            TraceError: the file does not exist, has another suffix, was changed since it was written, or holds no
                trace.
        """
        from palpate.files.hdf5_input import check_hdf5, open_sealed

        file_path = as_path(path, TraceError)
        if file_path.suffix.lower() not in _HDF5:
            raise TraceError(
                f"{file_path}: a trace is loaded from .h5, not from {file_path.suffix!r}; the other formats are exports"
            )
        with open_sealed(check_hdf5(file_path, TraceError, "trace"), TraceError, "trace") as file:
            if file.text_attribute("format", default="") != _FORMAT:
                raise TraceError(f"{file_path}: not a trace of palpate")
            channels = {}
            for name in file.names("channels"):
                place = f"channels/{name}"
                unit, description = (file.text_attribute(key, place) for key in ("unit", "description"))
                channels[name] = Channel(file.array(place, "f", 2).astype(float, copy=False), unit, description)
            unstable = file.number_attribute("unstable_from", default=math.inf)
            metadata = {
                name: load_json(file.text(f"metadata/{name}"), TraceError, f"{file_path}: metadata {name}")
                for name in file.names("metadata", optional=True)
            }
            time = file.array("time", "f", 1).astype(float, copy=False)
        _check_metadata(metadata, file_path)
        try:
            return cls(time, channels, None if unstable == math.inf else unstable, metadata)
        except TraceError as problem:
            raise TraceError(f"{file_path}: {problem}") from None


def _check_metadata(metadata: Mapping[str, Any], file: Path) -> None:
    """Raise TraceError if the metadata that palpate uses have another type."""
    for name, kind in (("scenario", dict), ("controller", dict), ("object", dict), ("version", str)):
        if name in metadata and not isinstance(metadata[name], kind):
            raise TraceError(f"{file}: not a complete trace: its {name} has the wrong type")


@contextmanager
def complete() -> Iterator[None]:
    """Raise TraceError where code meets a trace without a channel or column that every run records."""
    try:
        yield
    except (LookupError, TypeError, AttributeError, ArithmeticError, ValueError) as problem:
        if isinstance(problem, PalpateError):
            raise
        raise TraceError(f"the trace is not complete, so it cannot be judged: {problem}") from problem


def _extent(values: Array) -> str:
    return f"{values.min():.4g} to {values.max():.4g}" if values.size else ""


def _check_format(file: Path) -> None:
    """Raise OutputError if a file exists whose content does not have the format of its suffix."""
    try:
        with file.open("rb") as opened:
            begin = opened.read(len(b"MATLAB 5.0"))
    except OSError:
        return  # there is no file, or the attempt to write it raises
    suffix = file.suffix.lower()
    same = not begin or begin.startswith(_SIGNATURES[suffix])
    if same and begin and suffix in _HDF5:
        same = _FORMAT.encode() in file.read_bytes()  # without HDF5, which the file of another program may break
    if not same:
        raise OutputError(
            f"{file}: cannot be written: a file of that name is there, and it is no trace saved as {suffix}; choose "
            "another name, or delete it"
        )
