"""Sweeps over objects that do not run in SIMD lanes."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate.scenario import Scenario
from palpate.simulation.outcome_rows import name_rows
from palpate.simulation.simulator import build_simulation
from palpate.sweeps import sweep
from palpate.sweeps.excitation import excited

SCENARIOS = Path(__file__).parents[2] / "scenarios"


def short(name: str) -> dict[str, Any]:
    tables = tomllib.loads((SCENARIOS / name).read_text())
    return {**tables, "run": {**tables["run"], "duration": "0.15 s"}}


@pytest.mark.parametrize("name", ["slide-cube-small-steps.toml", "palpate-phantom.toml"])
def test_a_cell_on_a_mesh_or_body_is_the_run_of_its_scenario(name: str) -> None:
    over = {"servo.jitter": ["0 s", "0.1 ms"]}
    found = sweep(short(name), over)
    for cell in range(2):
        simulation, _ = excited(build_simulation(found.plan.scenario(cell)))
        row = np.asarray(simulation.setup.outcome(simulation.reference, simulation.operator))
        alone = name_rows(row[None], simulation.scenario.period)
        for key, values in alone.items():
            own = np.asarray(found.outcomes[key])[cell]
            np.testing.assert_allclose(own, values[0], rtol=1e-9, atol=1e-15, err_msg=key)


def test_a_spring_has_the_same_outcome_in_lanes_and_alone() -> None:
    found = sweep(short("press-stiff-cube-lqg.toml"), {"object.stiffness": ["1 N/mm", "2 N/mm", "3 N/mm"]})
    for cell in range(3):
        simulation, _ = excited(build_simulation(found.plan.scenario(cell)))
        row = np.asarray(simulation.setup.outcome(simulation.reference, simulation.operator))
        for key, values in name_rows(row[None], simulation.scenario.period).items():
            np.testing.assert_array_equal(np.asarray(found.outcomes[key])[cell], values[0], err_msg=key)


def test_a_controller_designed_once_holds_for_cells_on_a_mesh() -> None:
    """The outcome of a cell is that of its trace, with one controller for all cells."""
    tables = short("slide-cube-small-steps.toml")
    peaks = {}
    for design in ("once", "cell"):
        found = sweep(tables, {"controller.stiffness": ["1 N/mm", "3 N/mm"]}, design=design)
        for cell in range(2):
            trace = found.simulate(cell)
            assert found.verdict(cell) is trace.verdict.state
            largest = np.linalg.norm(trace["command_force"], axis=1).max()
            assert found["peak_command_force"][cell] == pytest.approx(largest, rel=1e-9)
        peaks[design] = found["peak_command_force"][1]
    assert peaks["once"] != pytest.approx(peaks["cell"], rel=1e-6)


@pytest.mark.parametrize(
    ("name", "path", "values", "numbers", "read"),
    [
        (
            "slide-organ.toml", "object.surface.stiffness", ["0.5 N/mm", "1 N/mm"], [500.0, 1000.0],
            lambda s: s.object.surface.stiffness[0],
        ),
        ("slide-organ.toml", "object.mesh.size.z", "40 mm..50 mm:2", [0.04, 0.05], lambda s: s.object.mesh.size[2]),
        (
            "palpate-phantom.toml", "object.body.stiffness_scale", [1.0, 2.0], [1.0, 2.0],
            lambda s: s.object.body.stiffness_scale,
        ),
        (
            "moving-surface.toml", "objects.rib.stiffness", ["0.2 N/mm", "2 N/mm"], [200.0, 2000.0],
            lambda s: s.objects["rib"].stiffness[0],
        ),
        (
            "moving-surface.toml", "objects.heart.mesh.radius", ["0 mm", "3 mm"], [0.0, 0.003],
            lambda s: s.objects["heart"].mesh.radius,
        ),
    ],
)  # fmt: skip
def test_a_key_of_a_mesh_a_body_or_one_of_several_objects_is_an_axis(
    name: str, path: str, values: Any, numbers: list[float], read: Callable[[Scenario], float]
) -> None:
    """Each cell is the run of the scenario with that value, and the value matters."""
    found = sweep(short(name), {path: values})
    for cell, number in enumerate(numbers):
        assert read(found.plan.scenario(cell)) == number
        assert found.verdict(cell) is found.simulate(cell).verdict.state
    assert found["peak_object_force"][0] != pytest.approx(found["peak_object_force"][1], rel=1e-6)
