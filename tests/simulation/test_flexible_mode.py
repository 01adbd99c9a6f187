"""Simulation of a device with its lowest flexible mode: the linear model at small motions, and the whole loop."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import palpate
import pytest
from flexible_device import device_file, with_mode
from palpate.devices import Device, load
from palpate.errors import DeviceError, ScenarioError
from palpate.linear.flexible_tip import couple_tip
from palpate.linear.linear_device import HumanArm
from palpate.linear.sampled_loop import sampled_plants
from palpate.scenario import Scenario
from palpate.simulation import build_simulation
from palpate.simulation.linear_loop import scenario_loop
from palpate.simulation.outcome_rows import outcome_of
from palpate.simulation.recorded import held_tip
from palpate.simulation.windows import Window
from palpate.stability import certify
from palpate.sweeps.excitation import excited

SLIDER, ARM, FIVE_BAR = load("slider"), load("phantom-premium-1.5a"), load("haply-2diy")
POSE = ["0 rad", "2.2305 rad", "3.2776 rad"]


def pressed(name: str, stiffness: float, **changes: Any) -> dict[str, Any]:
    """Tables of an impedance display: the operator presses a spring."""
    return {
        "device": {"name": name},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.05 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": f"{stiffness:.10g} N/m"},
        "controller": {"kind": "none"},
        "run": {"duration": "0.3 s"},
    } | changes


@pytest.mark.parametrize("device", [SLIDER, ARM, FIVE_BAR], ids=lambda device: device.name)
def test_the_linearized_plant_is_the_linear_model(device: Device) -> None:
    """At several poses, with viscous friction, and each side held against its own share of the gravity."""
    draw = np.random.default_rng(3)
    flexible = with_mode(device, 75.0, 0.3, 0.02)
    assert flexible.flexible is not None
    n = device.dof
    for _ in range(6):
        q = np.array(device.model.working_pose) + draw.uniform(-0.3, 0.3, n)
        gravity, mass = device.gravity(q), device.mass_matrix(q)
        a_q, a_v, _ = device.linearization(q, np.zeros(n), gravity)
        m, d, s, _ = couple_tip(mass, -mass @ a_v, -mass @ a_q, device.jacobian(q), flexible.flexible)
        both, held = np.concatenate([q, q]), np.concatenate([0.7 * gravity, 0.3 * gravity])
        friction = np.concatenate([device.viscous, np.zeros(n)])
        found = flexible.core_flexible.linearization(friction, both, np.zeros(2 * n), held)
        expected = np.hstack([np.linalg.solve(m, -s), np.linalg.solve(m, -d), np.linalg.inv(m)])
        for part, exact in zip(np.split(found, 3, axis=1), np.split(expected, 3, axis=1), strict=True):
            np.testing.assert_allclose(part, exact, rtol=0, atol=1e-10 * np.abs(exact).max())


@pytest.mark.parametrize(
    "hand", [None, HumanArm(0.1, 2.0, 300.0), HumanArm(0.15, 3.0, 500.0, 800.0, 0.5)], ids=["free", "grip", "tissue"]
)
def test_a_slider_moves_as_its_exact_sampled_model(tmp_path: Path, hand: HumanArm | None) -> None:
    """The slider is linear, so the whole run follows from the matrix exponential."""
    device = SLIDER.with_friction(viscous=[0.3], coulomb=[0.0])
    name = device_file(tmp_path, device, 85.0, 0.35, 0.02)
    tables = pressed(name, 100.0, reference={"shape": "step", "force": ["0.4 N", "0 N", "0 N"]})
    tables |= {"servo": {"period": "1 ms", "topology": "force_tracking"}}
    del tables["operator"]
    if hand is not None:
        operator = {"kind": "arm", "mass": f"{hand.mass} kg", "damping": f"{hand.damping} N*s/m"}
        operator |= {"stiffness": f"{hand.stiffness} N/m"}
        if hand.tissue_stiffness is not None:
            operator |= {"tissue_stiffness": f"{hand.tissue_stiffness} N/m"}
            operator |= {"tissue_damping": f"{hand.tissue_damping} N*s/m"}
        tables["operator"] = operator
    trace = palpate.simulate(tables)
    a, b, c = (m[0] for m in sampled_plants(load(name), np.zeros((1, 1)), hand, np.zeros(3), 1e-3))
    x, expected = np.zeros(len(a)), []
    for torque in trace["torque"]:
        expected.append(c @ x)
        x = a @ x + b @ torque
    found = trace["angle"]
    np.testing.assert_allclose(found, np.array(expected), rtol=0, atol=1e-6 * np.abs(found).max())
    assert np.abs(trace["tip_offset"]).max() > 1e-3 * np.abs(found).max()


def test_the_trace_has_the_offset_of_the_tip_and_the_energy_of_both_sides(tmp_path: Path) -> None:
    """Under a constant force the tip is ahead of the encoders by force over the stiffness of the mode."""
    device = SLIDER.with_friction(viscous=[1.0], coulomb=[0.0])
    name = device_file(tmp_path, device, 40.0, 0.5, 0.1)
    trace = palpate.simulate(pressed(name, 200.0, run={"duration": "3 s"}))
    mode = load(name).flexible
    assert mode is not None
    stiffness = mode.stiffness * device.parameters.one("mass.tip")
    assert trace["tip_offset"][-1, 0] == pytest.approx(0.05 / stiffness, rel=1e-3)
    assert trace["tip"][-1, 0] == pytest.approx(0.05 / 200.0, rel=1e-3)
    assert trace["energy"][-1, 0] == pytest.approx(0.5 * 0.05**2 / stiffness, rel=1e-3)
    assert trace.channels["tip_offset"].unit == "m"


def test_the_energy_of_both_sides_is_the_work_of_operator_and_motors(tmp_path: Path) -> None:
    """Without friction, under a constant force on the tip; the motors work on the encoders' side."""
    name = device_file(tmp_path, ARM.frictionless(), 50.0, 0.4, 0.0)
    operator = {"kind": "force", "force": ["0.2 N", "0.1 N", "-0.1 N"]}
    trace = palpate.simulate(pressed(name, 150.0, start={"pose": POSE}, operator=operator, run={"duration": "0.1 s"}))
    force, tip, first = trace["operator_force"], held_tip(trace), 1
    assert np.ptp(force[first:], axis=0).max() == 0.0
    power = np.sum(force[first:-1] * np.diff(tip[first:], axis=0), axis=1)
    power += np.sum(trace["torque"][first:-1] * np.diff(trace["angle"][first:], axis=0), axis=1)
    gained = trace["energy"][first + 1 :, 0] - trace["energy"][first, 0]
    np.testing.assert_allclose(gained, np.cumsum(power), rtol=0, atol=1e-4 * np.abs(gained).max())
    assert np.abs(trace["tip_offset"]).max() > 1e-6


@pytest.mark.parametrize(
    ("device", "frequency", "share", "moved"),
    [(SLIDER.with_friction(viscous=[4.0], coulomb=[0.0]), 60.0, 0.3, 0.1), (ARM, 40.0, 0.4, 0.05)],
    ids=["slider", "arm"],
)
def test_the_boundary_in_simulation_is_that_of_the_linear_loop(
    tmp_path: Path, device: Device, frequency: float, share: float, moved: float
) -> None:
    """The growth of the tip's oscillation is that of the linear loop on both sides, and zero at its boundary."""
    name = device_file(tmp_path, device, frequency, share, 0.02)
    start = [f"{q} {device.joint_unit}" for q in device.model.working_pose]

    def tables(stiffness: float, **rigid: bool) -> dict[str, Any]:
        run = pressed(name, stiffness, start={"pose": start}, run={"duration": "6 s"})
        return run | {"device": {"name": name, **rigid}}

    def boundary(**rigid: bool) -> float:
        low, high = 1.0, 1e6
        for _ in range(40):
            middle = float(np.sqrt(low * high))
            stable = scenario_loop(Scenario.from_dict(tables(middle, **rigid))).spectral_radius() < 1.0
            low, high = (middle, high) if stable else (low, middle)
        return low

    def growth(stiffness: float) -> float:
        """Logarithm of the growth per tick, from the last two fifths of the run."""
        motion = np.linalg.norm(np.diff(held_tip(palpate.simulate(tables(stiffness))), axis=0), axis=1)
        fifth = len(motion) // 5
        return float(np.log(motion[-fifth:].max() / motion[-2 * fifth : -fifth].max()) / fifth)

    exact = boundary()
    assert abs(exact / boundary(rigid=True) - 1.0) > moved
    below, above = growth(0.98 * exact), growth(1.02 * exact)
    assert below < 0.0 < above
    assert 0.98 - 0.04 * below / (above - below) == pytest.approx(1.0, abs=2e-3)


def test_a_display_with_a_mode_is_passive_by_the_damping_of_its_motors(tmp_path: Path) -> None:
    """The mode is passive, so K T/2 suffices; above it an operator behind the mode destabilizes the loop."""
    name = device_file(tmp_path, SLIDER.with_friction(viscous=[4.0], coulomb=[0.0]), 60.0, 0.3, 0.02)
    found = certify(pressed(name, 7900.0))
    assert found.passive
    assert any("requires at most 3.95 N s/m" in step for step in found.method)

    def radius(stiffness: float, mass: float, spring: float) -> float:
        loop = scenario_loop(Scenario.from_dict(pressed(name, stiffness)), arm=HumanArm(mass, 0.0, spring))
        return loop.spectral_radius()

    hands = [(mass, spring) for mass in np.geomspace(1e-3, 1.0, 3) for spring in np.geomspace(10.0, 1e6, 6)]
    assert max(radius(7900.0, *hand) for hand in [*hands, (0.001189, 4217.0)]) < 1.0 + 1e-9
    assert radius(8500.0, 0.001189, 4217.0) > 1.001


def test_a_stiff_mode_runs_as_the_rigid_device(tmp_path: Path) -> None:
    """On an arm with gravity, friction, an object and a hand; the difference falls with the square of the frequency."""
    hand = {"kind": "arm", "mass": "0.1 kg", "damping": "3 N*s/m", "stiffness": "300 N/m"}
    run = {
        "start": {"pose": POSE},
        "operator": hand | {"force": ["0.2 N", "0.1 N", "0 N"]},
        "run": {"duration": "0.1 s"},
    }

    def angles(frequency: float, **device: Any) -> np.ndarray:
        name = device_file(tmp_path, ARM, frequency, 0.3, 0.3)
        return palpate.simulate(pressed(name, 200.0, **run) | {"device": {"name": name, **device}})["angle"]

    rigid = angles(200.0, rigid=True)
    away = [np.abs(angles(frequency) - rigid).max() for frequency in (100.0, 200.0, 400.0)]
    assert away[0] / away[1] == pytest.approx(4.0, rel=0.25)
    assert away[1] / away[2] == pytest.approx(4.0, rel=0.25)
    assert away[2] < 2e-3 * np.ptp(rigid, axis=0).max()


def test_the_stepped_loop_gives_the_trace_of_the_simulation(tmp_path: Path) -> None:
    tables = pressed(device_file(tmp_path, SLIDER, 90.0), 300.0)
    whole, loop = palpate.simulate(tables), palpate.Loop(tables)
    stepped = loop.run()
    for name in whole.channels:
        assert stepped[name].tobytes() == whole[name].tobytes()


def test_a_sweep_measures_what_the_traces_show(tmp_path: Path) -> None:
    """The tip's oscillation, ripple and steady displacement of each cell, with gravity and a hand."""
    name = device_file(tmp_path, ARM, 90.0)
    hand = {"kind": "arm", "mass": "0.1 kg", "damping": "3 N*s/m", "stiffness": "300 N/m"}
    tables = pressed(name, 300.0, start={"pose": POSE}, operator=hand | {"force": ["0.2 N", "0.1 N", "0 N"]})
    found = palpate.sweep(tables, over={"object.stiffness": ["100 N/m", "400 N/m"]})
    for i, stiffness in enumerate(("100 N/m", "400 N/m")):
        simulation = excited(build_simulation(tables | {"object": {"kind": "spring", "stiffness": stiffness}}))[0]
        window = Window(simulation.setup.window_start, len(simulation.reference) - 1)
        row = outcome_of(simulation.every_tick(), 1e-3, window)
        assert found["ripple"][i] > 0.0
        for quantity in ("oscillation_2", "oscillation_5", "ripple", "steady_tip"):
            np.testing.assert_allclose(found[quantity][i], row[quantity], rtol=1e-9, atol=1e-15)


def test_a_mode_is_refused_where_the_plant_cannot_move_with_it(tmp_path: Path) -> None:
    name = device_file(tmp_path, SLIDER, 300.0)
    fixed: dict[str, Any] = {"operator": {"kind": "fixed"}}
    for change, says in (
        ({"device": {"name": name, "model": "linear"}}, "a model of the rigid device"),
        (fixed, "holds motors and tip"),
        ({"device": {"name": device_file(tmp_path, SLIDER, 1e7)}}, "more than 10000 integration steps"),
    ):
        with pytest.raises(ScenarioError, match=rf"lowest mode of .*{says}.*device\.rigid = true"):
            palpate.simulate(pressed(name, 100.0, **change))
    with pytest.raises(DeviceError, match="has no flexible mode"):
        _ = SLIDER.core_flexible
