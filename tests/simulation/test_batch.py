"""Loops side by side in vector lanes: each computes, bit for bit, what it computes alone."""

from __future__ import annotations

import importlib.util
import platform
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import _core
from palpate.simulation.simulator import Simulation, build_simulation
from workspace_loops import slide

ROOT = Path(__file__).parents[2]
POSE = ["0.1 rad", "2.2305 rad", "3.2776 rad"]
ARM = {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m"}
PUSH = {"shape": "ramp", "force": ["1 N", "-1 N", "-2 N"], "rise": "20 ms"}
SCENARIOS: dict[str, dict[str, Any]] = {
    "follows a force": {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"topology": "force_tracking"},
        "reference": {"shape": "sine", "frequency": "3 Hz", "force": ["1 N", "0.5 N", "-0.7 N"]},
        "object": {"kind": "spring", "stiffness": "500 N/m", "damping": "2 N*s/m"},
    },
    "counts, limits, delay": {
        "device": {"name": "phantom-premium-1.5a-rotors", "encoder": True, "saturation": True, "delay": 2},
        "start": {"pose": POSE},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "force", **PUSH},
        "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "1 N/mm", "damping": "1 N*s/m"},
    },
    "rigid hand": {
        "device": {"name": "phantom-premium-1.5a", "encoder": True},
        "start": {"pose": POSE},
        "servo": {"topology": "impedance_display"},
        "operator": {**ARM, **PUSH},
        "object": {"kind": "spring", "stiffness": "1 N/mm", "coupling": "bilinear", "damping": "0.5 N*s/m"},
    },
    "tissue and dry friction": {
        "device": {"name": "phantom-premium-1.5a-rotors"},
        "start": {"pose": POSE},
        "servo": {"topology": "impedance_display"},
        "operator": {**ARM, **PUSH, "tissue_stiffness": "500 N/m", "tissue_damping": "0.5 N*s/m"},
        "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "1 N/mm"},
    },
    "controller with states": {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"topology": "force_tracking", "period": "0.5 ms"},
        "reference": {"shape": "step", "force": "2 N"},
        "object": {"kind": "spring", "stiffness": "1 N/mm"},
        "controller": {"kind": "lqg", "stiffness": "1 N/mm"},
    },
    "normalized, spring": {
        "device": {"name": "phantom-premium-1.5a", "encoder": True},
        "start": {"pose": POSE},
        "servo": {"topology": "force_tracking", "period": "0.5 ms"},
        "reference": {"shape": "step", "force": "0.3 N"},
        "object": {"kind": "spring", "stiffness": "1 N/mm", "damping": "0.5 N*s/m"},
        "controller": {"kind": "lqg", "normalize": True},
    },
    "normalized, outside a wall": {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"topology": "force_tracking", "period": "0.5 ms"},
        "reference": {"shape": "step", "force": ["0.1 N", "0 N", "-0.5 N"]},
        "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "1 N/mm", "position": ["0 mm", "0 mm", "-2 mm"]},
        "controller": {"kind": "lqg", "normalize": "0.8 N/mm"},
    },
    "workspace": {
        "device": {"name": "phantom-premium-1.5a-rotors", "encoder": True, "saturation": True, "delay": 1},
        "start": {"pose": POSE},
        "servo": {"topology": "force_tracking", "period": "0.5 ms"},
        "reference": {"shape": "step", "force": ["2 N", "-1 N", "1 N"]},
        "operator": ARM,
        "object": {"kind": "spring", "stiffness": "1 N/mm", "damping": "0.5 N*s/m"},
        "controller": {"kind": "workspace"},
    },
    "workspace, outside a wall": {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"topology": "force_tracking", "period": "0.5 ms"},
        "reference": {"shape": "step", "force": ["0.1 N", "0 N", "-0.5 N"]},
        "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "1 N/mm", "position": ["0 mm", "0 mm", "-2 mm"]},
        "controller": {"kind": "workspace", "bandwidth": "100 rad/s", "operator_mass": "0.1 kg"},
    },
    "workspace of two joints": {
        "device": {"name": "haply-2diy", "encoder": True, "saturation": True},
        "start": {"tip": ["0 mm", "120 mm", "0 mm"]},
        "servo": {"topology": "force_tracking", "period": "0.5 ms"},
        "reference": {"shape": "step", "force": ["0.5 N", "-0.5 N", "0.2 N"]},
        "object": {"kind": "spring", "stiffness": "200 N/m"},
        "controller": {"kind": "workspace"},
    },
    "late ticks": {
        "device": {"name": "phantom-premium-1.5a-rotors", "delay": 1},
        "start": {"pose": POSE},
        "servo": {"topology": "impedance_display", "jitter": "0.7 ms"},
        "operator": {**ARM, **PUSH},
        "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "1 N/mm", "damping": "0.5 N*s/m"},
    },
    "slider": {
        "device": {"name": "slider", "delay": 1},
        "servo": {"topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["-0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": "40 N/m"},
    },
}


def _ready(name: str, duration: str = "0.2 s") -> Simulation:
    return build_simulation({**SCENARIOS[name], "run": {"duration": duration}})


def _cells(experiment: Simulation, stiffness: np.ndarray, **options: int) -> np.ndarray:
    columns = {"stiffness": np.ascontiguousarray(np.repeat(stiffness[:, None], 3, axis=1))}
    rows = _core.run_cells(
        experiment.setup, experiment.reference, experiment.operator, columns, len(stiffness), **options
    )
    return np.asarray(rows)


@pytest.mark.parametrize("name", SCENARIOS)
def test_every_lane_computes_what_a_loop_alone_computes(name: str) -> None:
    experiment = _ready(name)
    stiffness = np.concatenate([np.linspace(20.0, 4000.0, 17), [3e5, 50.0]])  # one that diverges among its neighbours
    rows = _cells(experiment, stiffness)
    dof = experiment.device.dof
    lost = 0
    for k, found in zip(stiffness, rows, strict=True):
        experiment.setup.stiffness = np.full(3, k)
        alone, unstable_tick = experiment.run()
        assert found[0] == unstable_tick
        if unstable_tick >= 0:
            lost += 1
            continue
        np.testing.assert_array_equal(found[-2 * dof :], alone[-1, : 2 * dof])
        angles = alone[experiment.setup.window_start :, :dof]
        np.testing.assert_array_equal(
            found[15 : 15 + 2 * dof], np.concatenate([angles.min(axis=0), angles.max(axis=0)])
        )
        assert found[8] == pytest.approx(np.linalg.norm(alone[:, 2 * dof : 2 * dof + 3], axis=1).max(), rel=1e-12)
    assert lost < len(stiffness) - 4


@pytest.mark.parametrize("name", ["follows a force", "tissue and dry friction"])
def test_results_do_not_depend_on_lanes_threads_or_neighbours(name: str) -> None:
    experiment = _ready(name, "0.1 s")
    stiffness = np.geomspace(50.0, 2e5, 131)
    rows = _cells(experiment, stiffness)
    for lanes, threads in ((2, 1), (4, 2), (8, 3)):
        np.testing.assert_array_equal(_cells(experiment, stiffness, lanes=lanes, threads=threads), rows)
    order = np.random.default_rng(5).permutation(len(stiffness))
    np.testing.assert_array_equal(_cells(experiment, stiffness[order], threads=2), rows[order])


def test_cells_have_their_own_delay_hand_and_start() -> None:
    experiment = _ready("rigid hand")
    setup, count = experiment.setup, 11
    random = np.random.default_rng(3)
    columns = {
        "delay": np.arange(count, dtype=float)[:, None],
        "arm_mass": random.uniform(0.0, 0.3, (count, 1)),
        "arm_damping": random.uniform(1.0, 5.0, (count, 1)),
        "arm_stiffness": random.uniform(100.0, 900.0, (count, 1)),
        "start": experiment.start + random.uniform(-0.1, 0.1, (count, 3)),
        "stiffness": random.uniform(100.0, 1000.0, (count, 3)),
        "coulomb": np.zeros((count, 3)),
    }
    columns["arm_mass"][4] = 0.0  # another shape of computation: it may not share a pack with the rest
    rows = np.asarray(_core.run_cells(setup, experiment.reference, experiment.operator, columns, count))
    for i, found in enumerate(rows):
        hand = setup.human_arm
        hand.mass, hand.damping = columns["arm_mass"][i, 0], columns["arm_damping"][i, 0]
        hand.stiffness = columns["arm_stiffness"][i, 0]
        setup.human_arm, setup.delay = hand, i
        setup.start, setup.stiffness = columns["start"][i], columns["stiffness"][i]
        alone, unstable_tick = experiment.run()
        assert found[0] == unstable_tick
        if unstable_tick < 0:
            np.testing.assert_array_equal(found[-6:], alone[-1, :6])


def test_wrong_columns_are_refused() -> None:
    experiment = _ready("slider")
    with pytest.raises(ValueError, match="no column stifness"):
        _core.run_cells(experiment.setup, experiment.reference, experiment.operator, {"stifness": np.ones((2, 3))}, 2)
    with pytest.raises(ValueError, match="cells x 3"):
        _core.run_cells(experiment.setup, experiment.reference, experiment.operator, {"stiffness": np.ones((2, 2))}, 2)


def test_a_loop_that_lanes_cannot_run_is_refused_by_its_reason() -> None:
    tool = {"mass": "0.1 kg", "damping": "2 N*s/m"}
    display = {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": POSE},
        "servo": {"period": "0.5 ms", "topology": "admittance_display", "tool": tool},
        "operator": {**ARM, "force": ["0 N", "0 N", "-1 N"]},
        "object": {"kind": "wall", "normal": [0, 0, 1], "stiffness": "1 N/mm"},
        "controller": {"kind": "workspace"},
        "run": {"duration": "0.1 s"},
    }
    for tables, reason in (
        (display, "the controller of an admittance display"),
        (slide(0.0, False, True), "another object"),
        ({**SCENARIOS["rigid hand"], "guard": {"kind": "energy_bound"}}, "a guard"),
    ):
        experiment = build_simulation(tables)
        with pytest.raises(ValueError, match=f"this loop has {reason}: run it alone"):
            _core.run_cells(experiment.setup, experiment.reference, experiment.operator, {}, 2)


def test_wide_code_stays_in_its_own_file(tmp_path: Path) -> None:
    """No function that another file could share is compiled for wide lanes, or an older machine would stop at it."""
    compiler, names = shutil.which("g++"), shutil.which("nm")
    if compiler is None or names is None or platform.machine() != "x86_64":
        pytest.skip("needs g++ and nm on an x86 machine")
    wide = _built_lanes() or _compiled_lanes(compiler, tmp_path)
    listing = subprocess.run([names, "-C", wide], check=True, capture_output=True, text=True).stdout
    shared = [line for line in listing.splitlines() if " W " in line or " u " in line]
    assert shared
    lanes = 4 if "_core_lanes_4.dir" in str(wide) else 8
    assert [line for line in shared if f"Pack<{lanes}>" not in line and f", {lanes}>" not in line] == []


def _built_lanes() -> Path | None:
    """Return an object file of wide lanes that an editable install left in build/, if no source is newer."""
    sources = [*ROOT.glob("core/include/**/*.hpp"), *ROOT.glob("python/src/*"), ROOT / "CMakeLists.txt"]
    newest = max(source.stat().st_mtime for source in sources)
    built = ROOT.glob("build/*/python/src/CMakeFiles/_core_lanes_[48].dir/batch_lanes.cpp.o")
    return next((path for path in built if path.stat().st_mtime > newest), None)


def _compiled_lanes(compiler: str, folder: Path) -> Path:
    found = importlib.util.find_spec("cmeel")
    eigen = Path("/usr/include/eigen3")
    if found is not None and found.origin is not None:
        eigen = Path(found.origin).parents[1] / "cmeel.prefix/include/eigen3"
    if not eigen.exists():
        pytest.skip("needs Eigen")
    flags = ["-std=c++20", "-O3", "-DNDEBUG", "-fPIC", "-ffp-contract=off", "-Wno-psabi", "-DPALPATE_LANES=8"]
    wide = ["-DEIGEN_DONT_VECTORIZE", "-mavx512f", "-mavx512dq", "-mavx512vl", "-mfma"]
    paths = [f"-I{ROOT / 'core/include'}", "-isystem", str(eigen), str(ROOT / "python/src/batch_lanes.cpp")]
    subprocess.run([compiler, *flags, *wide, *paths, "-c", "-o", folder / "lanes.o"], check=True)
    return folder / "lanes.o"
