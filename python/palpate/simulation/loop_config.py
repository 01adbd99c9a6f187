"""Resolution of a scenario to plain data, for the C++ core without Python."""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate import _core
from palpate.control.controller import Controller
from palpate.control.workspace_controller import OPTIONS, WorkspaceController
from palpate.devices import Device
from palpate.errors import OutputError
from palpate.fem.model_data import model_data
from palpate.files import as_path, read_utf8, write_folder
from palpate.files.json_text import load_table
from palpate.files.output import Writer
from palpate.scenario import Scenario
from palpate.scenario.body import BodyChoice
from palpate.scenario.tool import Tool
from palpate.simulation.bodies import place_body
from palpate.simulation.guards import guard_numbers
from palpate.simulation.meshes import touched_mesh
from palpate.simulation.placed_objects import PlacedObject
from palpate.simulation.simulator import Simulation, build_simulation, package_version

FORMAT: Final = "palpate loop"
VERSION: Final = 2
_DTYPES: Final = {"float64": "<f8", "float32": "<f4", "int32": "<i4", "uint8": "|u1"}
_LARGEST: Final = 2**32  # bytes of one blob
_ORDER: Final = 1000  # states of a controller or a sampled plant
_ARM: Final = ("mass", "damping", "stiffness", "tissue", "tissue_stiffness", "tissue_damping")
_TICKS: Final = 2**22  # servo periods of a run


def resolve(
    scenario: Scenario | Mapping[str, Any] | str | Path, folder: str | Path, controller: Controller | None = None
) -> Path:
    """Write a scenario's loop as plain data that the C++ core loads and runs; return the folder.

    The folder holds `loop.json` and binary blobs; docs/reference/loop-config.md describes them. Its files change
    together. An existing folder is replaced if it is empty or holds a resolved loop.

    Args:
        scenario: a Scenario, its tables, or the path of its TOML file.
        folder: to write.
        controller: replaces the one that [controller] describes.

    Raises:
        ScenarioError: as `simulate`.
        OutputError: the folder cannot be written, or holds other files.
    """
    simulation = build_simulation(scenario, controller)
    target = as_path(folder, OutputError)
    _check_replaceable(target)
    blobs = _Blobs()
    document = _document(simulation, blobs)
    writers: dict[str, Writer] = {name: partial(_write_bytes, data=data) for name, data in blobs.files.items()}
    text = with_checksum(document).encode()
    write_folder(target, {**writers, "loop.json": partial(_write_bytes, data=text)}, only=True)
    return target


def with_checksum(document: Mapping[str, Any]) -> str:
    """Return the text of `loop.json`; its last member is the checksum of the text before it."""
    text = json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False).removesuffix("\n}") + ",\n "
    return f'{text}"crc32": "{zlib.crc32(text.encode()):08x}"\n}}\n'


def _write_bytes(path: Path, data: bytes) -> None:
    path.write_bytes(data)


class _Blobs:
    """Arrays as the content of files, by file name, which begins with `prefix`."""

    def __init__(self, prefix: str = "", files: dict[str, bytes] | None = None) -> None:
        self.prefix = prefix
        self.files: dict[str, bytes] = {} if files is None else files

    def named(self, name: str) -> _Blobs:
        """Return the same files, for arrays of one of several objects."""
        return _Blobs(f"{name}.", self.files)

    def write(self, name: str, array: ArrayLike, dtype: str = "float64") -> dict[str, Any]:
        """Add an array by rows; return its entry in `loop.json`."""
        values = np.ascontiguousarray(array, dtype=_DTYPES[dtype])
        data = values.tobytes()
        if len(data) > _LARGEST:
            raise OutputError(f"{name}: {len(data)} bytes; a blob has at most {_LARGEST}")
        file = f"{self.prefix}{name}.{dtype}"
        self.files[file] = data
        return {
            "file": file,
            "dtype": dtype,
            "shape": list(values.shape),
            "bytes": len(data),
            "crc32": f"{zlib.crc32(data):08x}",
        }

    def signal(self, name: str, values: NDArray[np.float64]) -> dict[str, Any] | None:
        """Write a force at each sample (ticks + 1, 3), N; return None if it is always zero."""
        return self.write(name, values) if np.any(values) else None


def _document(simulation: Simulation, blobs: _Blobs) -> dict[str, Any]:
    scenario, device, setup = simulation.scenario, simulation.device, simulation.setup
    if not isinstance(simulation.controller, Controller | WorkspaceController):
        raise OutputError("controller: a controller written in Python cannot be resolved; write it in C++")
    ticks = len(simulation.reference) - 1
    if ticks > _TICKS:
        raise OutputError(f"run.duration: {ticks} servo periods; a resolved loop has at most {_TICKS}")
    known = device.model.parameters
    parameters = {key: _list(values) for key, values in device.parameters.values.items() if key in known}
    guard = guard_numbers(scenario, device)
    return {
        "format": FORMAT,
        "version": VERSION,
        "written_by": f"palpate {package_version()}",
        "title": scenario.title,
        "mechanism": {"name": device.model.name, "parameters": parameters},
        "servo": _servo(setup),
        "plant": _plant(setup),
        "object": _objects(simulation, blobs),
        "controller": _controller(simulation.controller, device, scenario.servo.tool),
        **({} if guard is None else {"guard": guard}),
        "run": {
            "ticks": ticks,
            "record_every": setup.record_every,
            "reference": blobs.signal("reference", simulation.reference),
            "operator_force": blobs.signal("operator_force", simulation.operator),
        },
    }


def _servo(setup: Any) -> dict[str, Any]:
    limits = setup.limits
    return {
        "period": setup.period,
        "delay": setup.delay,
        "start": _list(setup.start),
        "gravity_compensation": _list(setup.gravity_compensation),
        "frozen_kinematics": setup.frozen_kinematics,
        "encoder_step": _list(setup.encoder_step),
        "limits": {
            "peak_force": _finite(limits.peak_force),
            "continuous_force": _finite(limits.continuous_force),
            "thermal_time": limits.thermal_time,
            "peak_torque": [_finite(value) for value in _list(limits.peak_torque)],
        },
    }


def _plant(setup: Any) -> dict[str, Any]:
    friction, arm = setup.friction, setup.human_arm
    moving = "nonlinear" if setup.flexible is None else "flexible"
    kind = "fixed" if setup.fixed else "sampled" if setup.linear else moving
    table: dict[str, Any] = {
        "kind": kind,
        "start_speed": _list(setup.start_speed),
        "substeps": setup.substeps,
        "jitter": setup.jitter,
        "seed": setup.seed,
        "speed_limit": setup.speed_limit,
        "friction": {
            name: _list(getattr(friction, name)) for name in ("viscous", "coulomb", "breakaway", "stribeck_speed")
        },
        "human_arm": {name: getattr(arm, name) for name in _ARM} | {"rest": _list(arm.rest)},
    }
    if kind == "flexible":
        table["flexible"] = {
            name: getattr(setup.flexible, name) for name in ("frequency", "tip_share", "damping_ratio")
        }
    if kind == "sampled":
        table["model"] = {
            "order": _order(len(np.asarray(setup.plant_a)), "the sampled plant"),
            "a": _list(setup.plant_a),
            "b": _list(setup.plant_b),
            "c": _list(setup.plant_c),
            "working_torque": _list(setup.working_torque),
        }
    return table


def _controller(controller: Controller | WorkspaceController, device: Device, tool: Tool | None) -> dict[str, Any]:
    if isinstance(controller, WorkspaceController):
        if controller.device != device:
            raise OutputError("controller: it knows another device than that of the scenario, so it cannot be resolved")
        if tool is not None:
            feedback = {name: getattr(controller, name) for name in ("bandwidth", "damping", "observer", "disturbance")}
            friction = _list(device.viscous)
            own = {"tool_mass": tool.mass, "tool_damping": tool.damping, "friction": friction}
            return {"kind": "admittance", **feedback, **own}
        numbers = {name: getattr(controller, name) for name in OPTIONS if name != "stiffness"}
        return {
            "kind": "workspace",
            **numbers,
            "stiffness": list(controller.stiffness),
            "friction": _list(device.viscous),
        }
    system = controller.system
    order = _order(system.nstates, "the controller")
    none = np.zeros((order, 3))
    normalized = controller.design_stiffness is not None
    return {
        "kind": "normalized_state_space" if normalized else "state_space",
        **({"design_stiffness": _list(np.array(controller.design_stiffness))} if normalized else {}),
        "order": order,
        **{name.lower(): _list(getattr(system, name)) for name in "ABCD"},
        "antiwindup": _list(none if controller.antiwindup is None else controller.antiwindup),
    }


def _objects(simulation: Simulation, blobs: _Blobs) -> dict[str, Any]:
    placed = simulation.objects
    if "" in placed:
        return _object(placed[""], blobs)
    parts = {name: _object(one, blobs.named(name)) for name, one in placed.items()}
    return {"kind": "scene", "objects": parts}


def _object(placed: PlacedObject, blobs: _Blobs) -> dict[str, Any]:
    frame = placed.scenario.object.frame
    if frame is None:
        return _single(placed, blobs)
    return {
        "kind": "moving_frame",
        "origin": _list(placed.origin),
        "motion": blobs.write("motion", frame.rows()),
        "object": _single(placed, blobs),
    }


def _single(placed: PlacedObject, blobs: _Blobs) -> dict[str, Any]:
    touched, setup = placed.scenario.object, placed.setup
    if touched.mesh is not None:
        return _mesh(placed, blobs)
    if touched.body is not None:
        return _body(placed, blobs)
    if (parameters := placed.parameters) is not None:
        return _force_object(parameters, blobs)
    kinds = _core.SpringWallParameters.Kind
    shapes = {kinds.none: "none", kinds.point: "point", kinds.half_space: "half_space"}
    backward = setup.difference == _core.CouplingDifference.backward
    return {
        "kind": "spring_wall",
        "shape": shapes[setup.wall.kind],
        "point": _list(setup.wall.point),
        "normal": _list(setup.wall.normal),
        "stiffness": _list(setup.stiffness),
        "damping": _list(setup.damping),
        "difference": "backward" if backward else "bilinear",
    }


def _force_object(parameters: Mapping[str, Any], blobs: _Blobs) -> dict[str, Any]:
    """Return a force law, a field or a textured wall; the columns of a table are blobs."""
    plain = {key: _list(value) if isinstance(value, np.ndarray) else value for key, value in parameters.items()}
    plain |= {key: None for key, value in plain.items() if isinstance(value, float) and math.isinf(value)}
    if parameters["kind"] != "force_law":
        return plain
    return {**plain, **{key: blobs.write(key, parameters[key]) for key in ("depth", "force")}}


def _mesh(placed: PlacedObject, blobs: _Blobs) -> dict[str, Any]:
    choice = placed.scenario.object.mesh
    assert choice is not None
    mesh, surface = touched_mesh(placed.scenario, placed.place)
    core = surface.core_for(mesh)
    return {
        "kind": "mesh",
        "radius": choice.radius,
        "open": mesh.open,
        "vertices": blobs.write("vertices", mesh.vertices),
        "triangles": blobs.write("triangles", mesh.triangles, "int32"),
        "surface": {
            "stiffness": blobs.write("stiffness", core.stiffness),
            "damping": blobs.write("damping", core.damping),
            "tangential": core.tangential,
            "static_friction": _finite(core.static_friction),
            "dynamic_friction": _finite(core.dynamic_friction),
            "viscous": core.viscous,
            "field": "discrete" if core.field == _core.FieldKind.discrete else "continuous",
            "shading": core.shading,
            "period": core.period,
        },
    }


def _body(placed: PlacedObject, blobs: _Blobs) -> dict[str, Any]:
    scenario = placed.scenario
    choice = scenario.object.body
    assert choice is not None
    body, origin, rotation = place_body(scenario, placed.place)
    data = model_data(body)
    dtypes = {name: array.dtype.name for name, array in data.arrays.items()}
    return {
        "kind": "body",
        "model": data.model,
        "placement": {
            "origin": _list(origin),
            "rotation": _list(rotation),
            "tip": choice.tip,
            "radius": choice.radius,
            **_tool(choice, blobs),
        },
        **data.parameters,
        **{name: blobs.write(name, array, dtypes[name]) for name, array in data.arrays.items()},
    }


def _tool(choice: BodyChoice, blobs: _Blobs) -> dict[str, Any]:
    """Return the motion of a body's tool; {} if it moves with the tip."""
    if choice.tool is None:
        return {}
    places: dict[str, ArrayLike] = {
        "open": choice.contact_points,
        "closed": choice.tool.closed_points or choice.contact_points,
        "motion": choice.tool.rows(),
    }
    return {"tool": {name: blobs.write(f"tool_{name}", array) for name, array in places.items()}}


def _order(order: int, name: str) -> int:
    if order > _ORDER:
        raise OutputError(f"{name} has {order} states; a resolved loop has at most {_ORDER}")
    return order


def _list(values: ArrayLike) -> list[float]:
    """Return the numbers of an array as a flat list, row by row."""
    return [float(value) for value in np.asarray(values, dtype=float).reshape(-1)]


def _finite(value: float) -> float | None:
    """Return a number, or None for infinity, which JSON cannot hold."""
    return None if math.isinf(value) else float(value)


def _check_replaceable(target: Path) -> None:
    """Raise OutputError if the target is a file, or a folder with other content."""
    if target.is_symlink() or (target.exists() and not target.is_dir()):
        raise OutputError(f"{target}: cannot be written: it is a file or a link, not a folder")
    if not target.is_dir() or not any(target.iterdir()):
        return
    try:
        text = read_utf8(target / "loop.json", OutputError, kind="a resolved loop")
        ours = load_table(text, OutputError, "loop.json").get("format") == FORMAT
    except OutputError:
        ours = False
    if not ours:
        raise OutputError(f"{target}: the folder holds other files; name an empty or a new one")
