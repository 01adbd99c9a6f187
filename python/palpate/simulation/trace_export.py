"""Content of a trace, and its export formats: CSV, MAT, Parquet and MCAP. Each writer writes one file."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from palpate.arrays import Array
from palpate.errors import OutputError

AXES: Final = ("x", "y", "z")
_PER_JOINT: Final = ("angle", "velocity", "torque")


@dataclass(frozen=True)
class Channel:
    """Quantity as a function of time.

    Attributes:
        values: (n, k), one row per sample.
        unit: SI, such as "N*m".
        description: one line.
    """

    values: Array
    unit: str
    description: str = ""


@dataclass(frozen=True)
class TraceContent:
    """Content of a trace; `Trace` describes the fields."""

    time: Array
    channels: dict[str, Channel]
    unstable_from: float | None = None
    metadata: dict[str, Any] = field(default_factory=dict)


def column_names(name: str, count: int) -> list[str]:
    """Return the names of a channel's columns: with the axis, or with the number of the joint."""
    labels = AXES if count == 3 and name not in _PER_JOINT else tuple(str(i + 1) for i in range(count))
    return [name] if count == 1 else [f"{name}_{label}" for label in labels]


def columns(trace: TraceContent) -> dict[str, Array]:
    """Return every column by its name with the unit in brackets, "tip_x [m]"."""
    found = {"time [s]": trace.time}
    for name, channel in trace.channels.items():
        for column, title in enumerate(column_names(name, channel.values.shape[1])):
            found[f"{title} [{channel.unit}]"] = channel.values[:, column]
    return found


def write_csv(trace: TraceContent, path: Path) -> None:
    """Write one row per sample, with every digit; the header has name, axis or joint, and unit."""
    table = columns(trace)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows([repr(value) for value in row] for row in np.column_stack([*table.values()]).tolist())


def write_mat(trace: TraceContent, path: Path) -> None:
    """Write a MATLAB 5 file: `time`, one variable (n, k) per channel, `units` and `metadata` (JSON)."""
    from scipy.io import savemat

    content: dict[str, Any] = {
        "time": trace.time[:, None],
        **{name: channel.values for name, channel in trace.channels.items()},
        "units": {"time": "s", **{name: channel.unit for name, channel in trace.channels.items()}},
        "metadata": _json(trace),
    }
    with path.open("wb") as file:
        savemat(file, content, do_compression=True, long_field_names=True)


def write_parquet(trace: TraceContent, path: Path) -> None:
    """Write one column per component, named as in CSV; the metadata are JSON in the schema.

    Raises:
        OutputError: pyarrow is not installed.
    """
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ImportError:
        raise OutputError("a trace is saved as .parquet by pyarrow: pip install 'palpate[export]'") from None
    table = pa.table({name: np.ascontiguousarray(values) for name, values in columns(trace).items()})
    parquet.write_table(table.replace_schema_metadata({"palpate": _json(trace)}), path)


def write_mcap(trace: TraceContent, path: Path) -> None:
    """Write one topic of JSON messages per channel, which Foxglove and PlotJuggler open.

    Raises:
        OutputError: the package mcap is not installed.
    """
    try:
        from mcap.writer import Writer
    except ImportError:
        raise OutputError("a trace is saved as .mcap by the package mcap: pip install 'palpate[export]'") from None
    stamps = np.rint(1e9 * trace.time).astype(np.int64).tolist()
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="palpate")
        writer.add_metadata("palpate", {"trace": _json(trace)})
        for name, channel in trace.channels.items():
            keys = [key.removeprefix(f"{name}_") for key in column_names(name, channel.values.shape[1])]
            keys = ["value"] if len(keys) == 1 else keys
            schema = {
                "type": "object",
                "description": f"{channel.description} [{channel.unit}]",
                "properties": {key: {"type": "number"} for key in keys},
            }
            kind = writer.register_schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
            topic = writer.register_channel(
                topic=f"/{name}", message_encoding="json", schema_id=kind, metadata={"unit": channel.unit}
            )
            for stamp, row in zip(stamps, channel.values.tolist(), strict=True):
                message = json.dumps(dict(zip(keys, row, strict=True))).encode()
                writer.add_message(channel_id=topic, log_time=stamp, publish_time=stamp, data=message)
        writer.finish()  # type: ignore[no-untyped-call,unused-ignore]


def _json(trace: TraceContent) -> str:
    content = {"metadata": dict(trace.metadata), "unstable_from_s": trace.unstable_from}
    return json.dumps(content, allow_nan=False, ensure_ascii=False)
