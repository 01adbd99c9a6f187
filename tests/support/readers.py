"""Every reader of the package with valid files of its format, for fuzzing."""

from __future__ import annotations

import json
import random
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import trimesh
from mutations import mutate_bytes, mutate_hdf5, mutate_text, reforge
from one_node import one_node
from palpate import fem
from palpate.cli.body import _rows
from palpate.contact.mesh import Mesh
from palpate.devices import load
from palpate.devices.catalog import identified_model, read_numbers
from palpate.identification.recording import Recording
from palpate.metrics import summarize
from palpate.scenario import Scenario
from palpate.simulation.trace import Trace
from palpate.sweeps import open_sweep
from palpate.sweeps.run import plan_of
from palpate.sweeps.store import FileStore, tally
from palpate.units import UNITS, parse_quantity
from resealed import reseal

SCENARIOS: Final = Path(__file__).parents[2] / "scenarios"
SLIDER: Final[dict[str, Any]] = {
    "device": {"name": "slider"},
    "start": {"pose": ["0 m"]},
    "servo": {"topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["1 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "100 N/m"},
    "run": {"duration": "0.06 s"},
}


class Reader(NamedTuple):
    """One format: its valid files, mutation of one of them into a file, and the code that reads and uses it."""

    seeds: list[tuple[str, bytes]]  # name and content
    mutate: Callable[[bytes, Path, random.Random], None]
    use: Callable[[Path], object]


def _text(data: bytes, path: Path, rng: random.Random) -> None:
    mutate = mutate_text if rng.random() < 0.66 else mutate_bytes
    path.write_bytes(mutate(data, rng))


def _bytes(data: bytes, path: Path, rng: random.Random) -> None:
    path.write_bytes(mutate_bytes(data, rng))


def _forge(data: bytes, path: Path, rng: random.Random) -> None:
    path.write_bytes(reforge(data, rng))
    reseal(path)


def _use_scenario(path: Path) -> None:
    scenario = Scenario.from_file(path)
    assert Scenario.from_dict(scenario.to_dict()).to_dict() == scenario.to_dict()
    json.dumps(scenario.to_dict(), allow_nan=False)


def _use_device(path: Path) -> None:
    device = load(path)
    read_numbers(path)
    assert np.isfinite(device.forward([0.1] * device.dof)).all() or device.dof > 1
    if device.identified_model is not None:
        identified_model(device)


def _use_units(path: Path) -> None:
    text = path.read_text("utf-8", "replace")
    for unit in ("", *UNITS):
        try:
            value = parse_quantity(text, unit)
        except ValueError:
            continue
        assert np.isfinite(value)


def _use_trace(path: Path) -> None:
    trace = Trace.load(path)
    json.dumps(summarize(trace), allow_nan=False)


def _use_body(path: Path) -> None:
    body = fem.load(path)
    list(_rows(body))
    assert np.isfinite(body.compliance).all()


def _use_sweep(path: Path) -> None:
    found = open_sweep(path)
    assert sum(tally(path)) <= found.plan.count
    assert all(found[name].shape[: len(found.shape)] == found.shape for name in found.outcomes)


def _use_recording(path: Path) -> None:
    assert np.isfinite(Recording.load(path).angle).all()


def _use_mesh(path: Path) -> None:
    mesh = Mesh.load(path, unit="mm", open=True)
    mesh.diagnose()


def readers(folder: Path) -> dict[str, Reader]:
    """Return every reader; valid HDF5 files are made in `folder`."""
    time, wave = np.arange(60) * 1e-3, np.sin(np.arange(60))
    recording = Recording(time, wave[:, None], wave[:, None], metadata={"device": "slider"})
    plan = plan_of(SLIDER, {"object.stiffness": [100.0, 200.0]}, random={"object.damping": "0 N*s/m..1 N*s/m"})
    with FileStore(folder / "sweep.h5", plan) as store:
        store.put(0, plan.run(0, 2))
    from palpate import simulate

    hdf5 = {
        "trace": (simulate(SLIDER).save(folder / "trace.h5"), _use_trace),
        "body": (one_node(100.0, folder / "body.h5"), _use_body),
        "sweep": (folder / "sweep.h5", _use_sweep),
        "recording": (recording.save(folder / "recording.h5"), _use_recording),
    }
    scenarios = [(path.name, path.read_bytes()) for path in sorted(SCENARIOS.glob("*.toml"))]
    devices = [
        (name, resources.files("palpate.devices").joinpath(name).read_bytes())
        for name in ("slider.toml", "phantom-premium-1.5a.toml", "haply-2diy.toml")
    ]
    devices.append(("based.toml", b'based_on = "slider"\nname = "x"\n[mass]\ntip = {value = "70 g", source = "me"}\n'))
    csv = recording.save(folder / "recording.csv").read_bytes()
    found = {
        "scenario": Reader(scenarios, _text, _use_scenario),
        "device": Reader(devices, _text, _use_device),
        "csv": Reader([("a.csv", csv)], _text, _use_recording),
        "units": Reader([("a.txt", text.encode()) for _, text in UNITS.values()], _bytes, _use_units),
        "mesh": Reader(_meshes(), _bytes, _use_mesh),
    }
    for name, (path, use) in hdf5.items():
        seeds = [("a.h5", path.read_bytes())]
        found[name] = Reader(seeds, _bytes, use)
        found[f"{name}, other objects"] = Reader(seeds, mutate_hdf5, use)
        found[f"{name}, forged"] = Reader(seeds, _forge, use)
    return found


def _meshes() -> list[tuple[str, bytes]]:
    ball = trimesh.creation.icosphere(subdivisions=1, radius=20.0)
    seeds = []
    for kind, options in (("stl", {}), ("stl_ascii", {}), ("obj", {}), ("ply", {}), ("ply", {"encoding": "ascii"}),
                          ("off", {}), ("glb", {})):  # fmt: skip
        data = ball.export(file_type=kind, **options)
        seeds.append((f"a.{kind.partition('_')[0]}", data if isinstance(data, bytes) else str(data).encode()))
    return seeds
