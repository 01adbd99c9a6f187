"""A scenario resolved to plain data runs in C++ without Python, with the results of Python, bit for bit."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flexible_device import device_file
from nightly import NIGHTLY, nightly, some
from palpate import fem
from palpate.control import Controller
from palpate.devices import load
from palpate.errors import OutputError, ScenarioError
from palpate.scenario import Scenario
from palpate.simulation import build_simulation, resolve, simulate
from palpate.simulation.loop_config import with_checksum

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]
POINTS = [["-9 mm", "0 mm", "0 mm"], ["9 mm", "2 mm", "0 mm"]]
MOVING = {
    "rotation": [["0 s", "0 deg", "0 deg", "0 deg"], ["0.15 s", "1 deg", "-2 deg", "10 deg"]],
    "closed_points": [["-6 mm", "0 mm", "0 mm"], ["6 mm", "0 mm", "0 mm"]],
    "opening": [["50 ms", 1], ["0.1 s", 0.3]],
}
SHIPPED = sorted(path.stem for path in (ROOT / "scenarios").glob("*.toml"))
HYPERELASTIC = {"press-deep"}
# Without hyperelastic solvers and optimization, the program compiles in a quarter of the time. It gives the same bits.
LIBRARY = ("-DPALPATE_HYPERELASTIC=ON", "-DPALPATE_NATIVE_LANES=ON") if NIGHTLY else ()
OPTIMIZATION = "-O1" if NIGHTLY else "-O0"


def command(*words: object) -> str:
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def program() -> Path:
    """examples/cpp/run_loop, built as a program outside the tree builds it."""
    build = ROOT / "build" / "examples"
    ninja = f"-DCMAKE_MAKE_PROGRAM={BIN / 'ninja'}"
    python = f"-DPython_EXECUTABLE={sys.executable}"
    prefix = f"-DCMAKE_INSTALL_PREFIX={build / 'prefix'}"
    command(BIN / "cmake", "-S", ROOT, "-B", build / "core", "-G", "Ninja", ninja, python, prefix, *LIBRARY)
    command(BIN / "ninja", "-C", build / "core")
    command(BIN / "cmake", "--install", build / "core")
    eigen = command(sys.executable, "-m", "cmeel", "cmake").strip()
    found = f"-DCMAKE_PREFIX_PATH={build / 'prefix'};{eigen}"
    options = [found, f"-DCMAKE_CXX_FLAGS_RELEASE={OPTIMIZATION} -DNDEBUG"]
    if compiler := os.environ.get("PALPATE_TEST_CXX"):
        options.append(f"-DCMAKE_CXX_COMPILER={compiler}")
    command(BIN / "cmake", "-S", ROOT / "examples" / "cpp", "-B", build / "run", "-G", "Ninja", ninja, *options)
    command(BIN / "ninja", "-C", build / "run", "run_loop")
    return build / "run" / "run_loop"


def rows_of(program: Path, folder: Path, *options: str) -> tuple[bytes, int]:
    """Return the bytes of the rows that the program writes, and the tick of divergence."""
    file = folder.parent / "rows"
    told = command(program, folder, file, *options)
    found = re.fullmatch(r"(\d+) rows, diverged at tick (-?\d+)\n", told)
    assert found, told
    return file.read_bytes(), int(found[2])


def check(program: Path, scenario: Any, folder: Path, controller: Controller | None = None) -> None:
    """Compare the rows of both programs, bit for bit."""
    rows, unstable_tick = build_simulation(scenario, controller).run()
    assert resolve(scenario, folder, controller) == folder
    assert rows_of(program, folder) == (rows.tobytes(), unstable_tick)
    assert len(rows) > 20


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[nightly] if name in HYPERELASTIC else []) for name in SHIPPED]
)
def test_shipped_scenarios_run_alike(program: Path, name: str, tmp_path: Path) -> None:
    scenario: Any = ROOT / "scenarios" / f"{name}.toml"
    if name == "press-deep":  # of 3 s, which take 10 s in each program
        scenario = Scenario.from_file(scenario).to_dict()
        scenario["run"]["duration"] = "0.6 s"
    check(program, scenario, tmp_path / "loop")


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """40 x 40 x 20 mm of 10 kPa, bonded below, touched on its top, with vibration modes."""
    path = tmp_path_factory.mktemp("body") / "block.h5"
    volume = fem.block((0.04, 0.04, 0.02), (0.005, 0.005, 0.01))
    fem.build(volume, young=10e3, fixed="z < 0.001 mm", touch="z > 19.9 mm", order=1, modes=10, output=path)
    return path


def press(block: Path, **body: Any) -> dict[str, Any]:
    """A press of 0.3 N along -z by a hand-held arm."""
    middle = ["20 mm", "20 mm", "20 mm"]
    turned = ["5 deg", "-10 deg", "40 deg"]
    return {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"period": "1 ms"},
        "reference": {"shape": "ramp", "rise": "50 ms", "force": ["0.1 N", "0 N", "-0.3 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {
            "kind": "body",
            "position": ["0 mm", "0 mm", "-0.5 mm"],
            "body": {"file": str(block), "origin": middle, "rotation": turned, "radius": "8 mm", **body},
        },
        "run": {"duration": "0.2 s"},
    }


@pytest.mark.parametrize("tip", some(["sphere", "flat"]))
@pytest.mark.parametrize("friction", some([{"static_friction": 0.5, "dynamic_friction": 0.4}, {}]))
@pytest.mark.parametrize(
    ("kind", "options"),
    [
        ("compliance", {"stiffness_scale": 1.5}),
        ("modal", {"rayleigh_alpha": "1 1/s", "rayleigh_beta": "1 ms"}),
        ("modal", {"instantaneous_ratio": 2.0, "retardation_time": "50 ms"}),
        ("viscoelastic", {"instantaneous_ratio": 2.0, "retardation_time": "50 ms"}),
        ("mass_spring", {"rayleigh_beta": "2 ms"}),
        ("modal", {"rayleigh_beta": "1 ms", "update_interval": "7 ms"}),
        ("viscoelastic", {"instantaneous_ratio": 2.0, "retardation_time": "50 ms", "update_interval": "7 ms"}),
        ("mass_spring", {"rayleigh_beta": "2 ms", "update_interval": "7 ms"}),
        ("mass_spring", {"rayleigh_beta": "2 ms", "hardening_strain": 0.1}),
        ("mass_spring", {"rayleigh_beta": "2 ms", "hardening_strain": 0.1, "update_interval": "7 ms"}),
        ("mass_spring", {"rayleigh_beta": "2 ms", "exponent": -6, "stiffness_limit": 8}),
        ("signed_distance", {"sideways_fraction": 0.7}),
        ("signed_distance", {"contact_points": POINTS}),
        ("signed_distance", {"contact_points": POINTS, "tool": MOVING}),
        ("modal", {"contact": "signed_distance", "rayleigh_beta": "1 ms"}),
        ("viscoelastic", {"contact": "signed_distance", "instantaneous_ratio": 2.0, "retardation_time": "50 ms"}),
    ],
)
def test_linear_bodies_run_alike(
    program: Path, block: Path, tmp_path: Path, kind: str, options: dict[str, Any], friction: dict[str, Any], tip: str
) -> None:
    tables = press(block, kind=kind, tip=tip, **options, **friction)
    check(program, tables, tmp_path / "loop")
    rows = np.fromfile(tmp_path / "rows").reshape(201, -1)
    assert rows[:, -7 - 3 * len(options.get("contact_points", ()))].max() >= 3  # contact nodes


@pytest.mark.parametrize("tip", some(["flat", "sphere"]))
@pytest.mark.parametrize(
    "options",
    [
        {},
        {"kind": "signed_distance", "sideways_fraction": 0.7},
        {"kind": "signed_distance", "static_friction": 0.5, "dynamic_friction": 0.4},
    ],
)
def test_bodies_whose_supports_change_run_alike(
    program: Path, block: Path, tmp_path: Path, options: dict[str, Any], tip: str
) -> None:
    changes = [{"at": "80 ms", "held": "x < 11 mm"}, {"at": "0.12 s", "held": "y < 11 mm", "touchable": "x > 10 mm"}]
    check(program, press(block, tip=tip, supports=changes, **options), tmp_path / "loop")
    rows = np.fromfile(tmp_path / "rows").reshape(201, -1)
    assert rows[:, -7].max() >= 3  # contact nodes
    check(program, press(block, tip=tip, **options), tmp_path / "same")
    assert np.any(np.fromfile(tmp_path / "rows").reshape(201, -1)[130:] != rows[130:])


def test_a_body_of_springs_runs_alike(program: Path, tmp_path: Path) -> None:
    """A stretched grid of 8 x 8 threads, without volumes; pressed by a flat end."""
    side, step = 9, 5e-3
    x, y = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    at = np.arange(side * side).reshape(side, side)
    threads = [(at[:-1], at[1:]), (at[:, :-1], at[:, 1:])]
    a, b, c, d = (corner.ravel() for corner in (at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]))
    fem.build_springs(
        step * np.stack([x.ravel(), y.ravel(), 0 * x.ravel() + 4.0], axis=1),
        np.concatenate([np.stack([one.ravel(), two.ravel()], axis=1) for one, two in threads]),
        stiffness="300 N/m",
        rest_lengths=0.8 * step,
        damping="0.02 N*s/m",
        masses="0.2 g",
        fixed=((x % (side - 1) == 0) | (y % (side - 1) == 0)).ravel(),
        triangles=np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]),
        output=tmp_path / "net.h5",
    )
    check(program, press(tmp_path / "net.h5", kind="mass_spring", exponent=3), tmp_path / "loop")
    rows = np.fromfile(tmp_path / "rows").reshape(201, -1)
    assert rows[:, -7].max() >= 3  # contact nodes


@nightly
@pytest.mark.parametrize("law", ["neo-hookean", "corotational"])
@pytest.mark.parametrize("friction", [{}, {"static_friction": 0.5, "dynamic_friction": 0.4}])
def test_hyperelastic_bodies_run_alike(
    program: Path, block: Path, tmp_path: Path, law: str, friction: dict[str, Any]
) -> None:
    """The solver of the library palpate::hyperelastic is that of the Python module."""
    check(program, press(block, kind=law, update_interval="7 ms", **friction), tmp_path / "loop")
    rows = np.fromfile(tmp_path / "rows").reshape(201, -1)
    assert rows[:, -7].max() >= 3  # contact nodes


@pytest.mark.skipif(NIGHTLY, reason="the program has the library")
def test_a_program_without_the_library_of_a_body_names_it(program: Path, block: Path, tmp_path: Path) -> None:
    resolve(press(block, kind="neo-hookean", update_interval="7 ms"), tmp_path / "loop")
    done = subprocess.run([program, tmp_path / "loop", tmp_path / "rows"], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "link palpate::hyperelastic" in done.stderr


def test_a_flexible_mode_runs_alike(program: Path, tmp_path: Path) -> None:
    name = device_file(tmp_path, load("phantom-premium-1.5a"), 70.0)
    tables = {
        "device": {"name": name, "encoder": True},
        "start": {"pose": POSE},
        "servo": {"period": "1 ms", "jitter": "0.2 ms"},
        "reference": {"force": ["0.1 N", "0 N", "-0.3 N"]},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
        "object": {"kind": "spring", "stiffness": "300 N/m"},
        "controller": {"kind": "none"},
        "run": {"duration": "0.2 s"},
    }
    check(program, tables, tmp_path / "loop")


FORCE_OBJECTS: dict[str, dict[str, Any]] = {
    "law": {"kind": "force_law", "normal": [0, 0, 1], "law": {"formula": "200 * x + 1e5 * x^2", "deepest": "5 mm"}},
    "well": {"kind": "field", "field": {"kind": "gravity_well", "stiffness": "50 N/m", "radius": "10 mm"}},
    "drag": {"kind": "field", "field": {"kind": "viscous", "damping": "1 N*s/m"}},
    "weight": {"kind": "field", "field": {"kind": "constant", "force": ["0 N", "-0.1 N", "0 N"]}},
    "ring": {
        "kind": "field",
        "normal": [0, 0, 1],
        "field": {
            "kind": "vibration",
            "force": ["0 N", "0 N", "0.2 N"],
            "frequency": "150 Hz",
            "decay": "30 ms",
            "at_contact": True,
        },
    },
    "ball": {"kind": "field", "field": {"kind": "virtual_mass", "mass": "0.1 kg", "stiffness": "200 N/m"}},
    "file": {
        "kind": "textured_wall",
        "stiffness": "300 N/m",
        "normal": [0, 0, 1],
        "texture": {"wavelength": "1 mm", "across": [1, 0, 0], "height": "0.05 mm", "lateral_force": "0.1 N"},
        "frame": {"displacement": [["0 s", "0 mm", "0 mm", "0 mm"], ["0.1 s", "1 mm", "0 mm", "0 mm"]]},
    },
}


def test_force_laws_fields_and_textures_run_alike(program: Path, block: Path, tmp_path: Path) -> None:
    tables = press(block)
    tables.pop("object")
    check(program, {**tables, "objects": FORCE_OBJECTS}, tmp_path / "scene")
    check(program, {**tables, "object": FORCE_OBJECTS["law"]}, tmp_path / "law")


def test_a_scene_with_a_moving_body_and_a_turning_mesh_runs_alike(program: Path, block: Path, tmp_path: Path) -> None:
    sway = [["0 s", "0 mm", "0 mm", "0 mm"], ["0.1 s", "1 mm", "0 mm", "1 mm"]]
    turn = [["0.05 s", "0 deg", "0 deg", "0 deg"], ["0.2 s", "10 deg", "0 deg", "20 deg"]]
    tables = press(block)
    tables["objects"] = {
        "tissue": {**tables.pop("object"), "frame": {"displacement": sway}},
        "bone": {**organ()["object"], "position": ["1 mm", "0 mm", "0 mm"], "frame": {"rotation": turn}},
        "rib": {"kind": "wall", "normal": [0, 1, 0], "stiffness": "300 N/m", "position": ["0 mm", "0.5 mm", "0 mm"]},
    }
    check(program, tables, tmp_path / "loop")
    trace = simulate(tables)
    assert all(trace[f"{name}_touching"].any() for name in tables["objects"])


def wall(**other: Any) -> dict[str, Any]:
    """A slider that leans on a wall."""
    return {
        "title": 'A "wall" of 50 N/m – über Δ \U0001f590',
        "device": {"name": "slider"},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["-0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "50 N/m"},
        "run": {"duration": "0.5 s"},
        **other,
    }


def organ(**surface: Any) -> dict[str, Any]:
    """A slider that leans on a mesh with a pattern of stiffness."""
    shape = {
        "shape": "box",
        "edge": "40 mm",
        "divisions": 4,
        "rotation": ["0 deg", "-90 deg", "0 deg"],
        "radius": "2 mm",
    }
    laid = {"stiffness": ["100 N/m", "50 N/m"], "pattern": "checkerboard", "width": "10 mm", **surface}
    return wall(object={"kind": "mesh", "position": ["3 mm", "0 mm", "0 mm"], "mesh": shape, "surface": laid})


@pytest.mark.parametrize(
    "tables",
    [
        wall(servo={"topology": "impedance_display", "jitter": "0.3 ms"}, run={"duration": "0.5 s", "seed": 7}),
        wall(device={"name": "slider", "model": "linear"}),
        wall(device={"name": "slider", "delay": 3}, run={"duration": "0.5 s", "substeps": 5, "record_every": 7}),
        wall(object={"kind": "spring", "stiffness": "500 N/m"}, run={"duration": "10 s"}),
        wall(object={"kind": "spring", "stiffness": "50 N/m", "damping": "0.02 N*s/m", "coupling": "bilinear"}),
        wall(operator={"kind": "fixed"}),
        wall(object={"kind": "none"}),
        wall(guard={"kind": "energy_bound"}, servo={"topology": "impedance_display", "jitter": "0.3 ms"}),
        wall(guard={"kind": "passivity_controller", "cap": 0.3}, object={"kind": "spring", "stiffness": "500 N/m"}),
        wall(
            guard={"kind": "half_sample", "velocity": "observer", "horizon": 1.5}, device={"name": "slider", "delay": 1}
        ),
        organ(),
        organ(field="continuous", static_friction=0.4, damping="0.01 N*s/m", shading="30 deg"),
        organ(static_friction=0.8, dynamic_friction=0.6, viscous="0.1 N*s/m"),
    ],
)
def test_what_a_scenario_can_set_runs_alike(program: Path, tables: dict[str, Any], tmp_path: Path) -> None:
    check(program, tables, tmp_path / "loop")


def test_a_loop_that_is_stepped_runs_alike(program: Path, block: Path, tmp_path: Path) -> None:
    """servo::Loop and servo::simulate give the same rows."""
    for number, tables in enumerate(
        (wall(), press(block, kind="viscoelastic", instantaneous_ratio=2.0, retardation_time="50 ms"))
    ):
        folder = tmp_path / str(number) / "loop"
        resolve(tables, folder)
        assert rows_of(program, folder, "step") == rows_of(program, folder)


def test_a_controller_of_the_caller_is_resolved(program: Path, tmp_path: Path) -> None:
    import control

    filtered = control.StateSpace(
        0.3 * np.eye(3), 0.7 * np.eye(3, 6) - 0.7 * np.eye(3, 6, 3), np.eye(3), np.zeros((3, 6)), 1e-3
    )
    tables = wall(operator={"kind": "force", "shape": "step", "force": ["-0.1 N", "0 N", "0 N"]})
    check(program, tables, tmp_path / "loop", Controller(filtered))


def test_every_double_is_kept(tmp_path: Path) -> None:
    """JSON holds the shortest text of each double, so no bit is lost."""
    scenario = Scenario.from_dict(wall(object={"kind": "spring", "stiffness": f"{0.1 + 0.2!r} N/m"}))
    resolve(scenario, tmp_path / "loop")
    found = json.loads((tmp_path / "loop" / "loop.json").read_text("utf-8"))
    assert found["object"]["stiffness"] == [*build_simulation(scenario).setup.stiffness]


def test_the_text_ends_with_the_checksum_of_all_bytes_before(tmp_path: Path) -> None:
    data = (resolve(wall(), tmp_path / "loop") / "loop.json").read_bytes()
    end = b'"crc32": "%08x"\n}\n' % zlib.crc32(data[:-22])
    assert data[-22:] == end
    assert json.loads(data)["run"]["ticks"] == 500


def test_a_refused_scenario_writes_nothing(block: Path, tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"object\.body\.update_interval: it lasts one tick"):
        resolve(press(block, kind="neo-hookean", update_interval="0.1 ms"), tmp_path / "loop")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_the_loader_would_refuse_is_not_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("palpate.simulation.loop_config._TICKS", 499)
    with pytest.raises(OutputError, match=r"run.duration: 500 servo periods; .* at most 499"):
        resolve(wall(), tmp_path / "loop")
    assert list(tmp_path.iterdir()) == []


def test_folders_of_others_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear", "utf-8")
    (tmp_path / "file").write_text("", "utf-8")
    with pytest.raises(OutputError, match="holds other files"):
        resolve(wall(), tmp_path / "mine")
    with pytest.raises(OutputError, match="it is a file"):
        resolve(wall(), tmp_path / "file")
    resolve(organ(), tmp_path / "loop")
    resolve(wall(), tmp_path / "loop")  # replaces the whole folder
    assert {path.name for path in (tmp_path / "loop").iterdir()} == {"loop.json", "operator_force.float64"}
    assert {path.name for path in tmp_path.iterdir()} == {"mine", "file", "loop"}


def edited(change: Callable[[dict[str, Any]], object]) -> Callable[[Path], object]:
    """Return a function that changes loop.json in a folder."""

    def edit(folder: Path) -> None:
        file = folder / "loop.json"
        tables = json.loads(file.read_text("utf-8"))
        change(tables)
        del tables["crc32"]
        file.write_text(with_checksum(tables), "utf-8")

    return edit


def flipped(folder: Path) -> None:
    file = folder / "vertices.float64"
    data = bytearray(file.read_bytes())
    data[11] ^= 4
    file.write_bytes(data)


def stray_index(folder: Path) -> None:
    file = folder / "triangles.int32"
    rows = np.fromfile(file, "<i4")
    rows[5] = 1000
    rows.tofile(file)
    edited(lambda t: t["object"]["triangles"].update(crc32=f"{zlib.crc32(rows.tobytes()):08x}"))(folder)


def text(words: str) -> Callable[[Path], object]:
    return lambda folder: (folder / "loop.json").write_text(words, "utf-8")


@pytest.mark.parametrize(
    ("damage", "told"),
    [
        (lambda folder: (folder / "loop.json").unlink(), "there is no file loop.json"),
        ((lambda folder: (folder / "vertices.float64").unlink()), "vertices.float64\" is missing"),
        (lambda folder: (folder / "vertices.float64").write_bytes(b"1234"), "has 4 bytes instead of 2352"),
        (flipped, 'object.vertices: the file "vertices.float64" is damaged: its checksum is'),
        (stray_index, "object.triangles holds the index 1000, which does not exist"),
        (text("[" * 100_000), "line 1: arrays and objects are nested too deeply"),
        (text('{"a": [' + "0, " * 2_000_000 + "0]}"), "the document has too many values"),
        (text(" " * (2**24 + 1)), "loop.json is longer than"),
        (text('{"a": 1,\n "a": 2}'), "line 2: a name occurs twice"),
        (text('{"a": NaN}'), "a value is missing or is not JSON"),
        (text('{"a": 1e999}'), "outside the range of double precision"),
        (text('{"a": 1'), "the closing brace of an object is missing"),
        (text("3"), "the document must be an object"),
        (edited(lambda t: t.update(format="other")), 'format must be "palpate loop"'),
        (edited(lambda t: t.update(version=1)), "version is 1; this palpate reads version 2"),
        (edited(lambda t: t.pop("plant")), "plant is missing"),
        (edited(lambda t: t["mechanism"].update(name="crane")), 'mechanism.name is "crane"'),
        (edited(lambda t: t["mechanism"]["parameters"].clear()), "mechanism.parameters.mass.tip is missing"),
        (edited(lambda t: t["servo"].update(period=0)), "servo.period is 0; it must be between 1e-09 and 1000"),
        (edited(lambda t: t["mechanism"]["parameters"].update({"mass.tip": [0]})), "mass.tip must be positive"),
        (edited(lambda t: t["servo"].update(start=[0, 1])), "servo.start has 2 numbers instead of 1"),
        (edited(lambda t: t["run"].update(ticks=10**12)), "run.ticks is 1e+12; it must be between"),
        (edited(lambda t: t["run"].update(ticks=600)), "run.operator_force.shape must be [601, 3]"),
        (edited(lambda t: t["run"].update(record_every=0)), "run.record_every is 0"),
        (edited(lambda t: t["controller"].update(order=10**9)), "controller.order is 1000000000"),
        (edited(lambda t: t["controller"].update(order=2)), "controller.a has 0 numbers instead of 4"),
        (edited(lambda t: t["object"].update(kind="ghost")), 'object.kind is "ghost"; this version knows'),
        (edited(lambda t: t["object"]["vertices"].update(shape=[2**32, 3])), "object.vertices.bytes is"),
        (edited(lambda t: t["object"]["vertices"].update(shape=[2**31, 3], bytes=24 * 2**31)), "vertices.bytes is"),
        (edited(lambda t: t["object"]["vertices"].update(shape=[10**8, 3], bytes=24 * 10**8)), "instead of 2400000000"),
        (edited(lambda t: t["object"]["vertices"].update(dtype="float32")), 'dtype is "float32" instead of "float64"'),
        (edited(lambda t: t["object"]["vertices"].update(file="../vertices")), "must be the plain name of a file"),
        (edited(lambda t: t["object"]["surface"].update(dynamic_friction=2)), "object.surface does not fit the mesh"),
    ],
)  # fmt: skip
def test_damage_is_told_in_a_sentence(
    program: Path, tmp_path: Path, damage: Callable[[Path], object], told: str
) -> None:
    resolve(organ(), tmp_path / "loop")
    damage(tmp_path / "loop")
    done = subprocess.run(
        [program, tmp_path / "loop", tmp_path / "rows"], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2, done.stdout + done.stderr
    assert told in done.stderr
    assert done.stderr.startswith(str(tmp_path / "loop"))
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "rows").exists()


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda t: t["controller"].update(tool_mass=0), "controller.kind the tool's mass must be positive and finite"),
        (lambda t: t["controller"].pop("tool_damping"), "controller.tool_damping is missing"),
        (lambda t: t["plant"].update(kind="fixed"), "whose force sensor needs a nonlinear or a flexible plant"),
        (
            lambda t: t.update(guard={"kind": "passivity_controller", "cap": 0.5}),
            "guard.kind is a guard, which an admittance display does not have",
        ),
    ],
)
def test_an_admittance_display_that_cannot_run_is_told(
    program: Path, tmp_path: Path, change: Callable[[dict[str, Any]], object], told: str
) -> None:
    resolve(ROOT / "scenarios" / "admittance-display.toml", tmp_path / "loop")
    edited(change)(tmp_path / "loop")
    done = subprocess.run(
        [program, tmp_path / "loop", tmp_path / "rows"], capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 2, done.stdout + done.stderr
    assert told in done.stderr
