"""H-infinity synthesis against closed forms, and the share of the optimal robustness that a loop keeps."""

from __future__ import annotations

import control
import numpy as np
import pytest
from palpate.control import Controller, gap_margin, h_infinity, lqg, optimal_gap_margin, robustness
from palpate.control.stability_margins import peak_gain
from palpate.errors import DesignError


def scalar_problem(a: float, state_cost: float, command_cost: float, noise: float) -> control.StateSpace:
    """Return x+ = a x + w1 + u, z = (state_cost x, command_cost u), y = x + noise w2."""
    d = [[0, 0, 0], [0, 0, command_cost], [0, noise, 0]]
    return control.StateSpace([[a]], [[1, 0, 1]], [[state_cost], [0], [1]], d, 1.0)


def integrators(count: int, period: float = 1e-3) -> control.StateSpace:
    """Return 1/s or 1/s^2, sampled with a zero-order hold."""
    if count == 1:
        return control.StateSpace([[1.0]], [[period]], [[1.0]], [[0.0]], period)
    return control.StateSpace([[1.0, period], [0.0, 1.0]], [[period**2 / 2], [period]], [[1.0, 0.0]], [[0.0]], period)


def four_blocks(plant: control.StateSpace) -> control.StateSpace:
    """Return the problem whose norm is ||[K; I] (I - P K)^-1 [I P]||."""
    none = np.zeros((plant.nstates, 1))
    return control.StateSpace(
        plant.A,
        np.hstack([none, plant.B, plant.B]),
        np.vstack([none.T, plant.C, plant.C]),
        [[0, 0, 1], [1, 0, 0], [1, 0, 0]],
        plant.dt,
    )


@pytest.mark.parametrize(
    ("problem", "level"),
    [
        (scalar_problem(1.0, 1.0, 1.0, 1.0), 2 * np.cos(np.pi / 7)),
        (scalar_problem(1.2, 1.0, 0.5, 0.1), 1.1741316),
        (scalar_problem(0.9, 1.0, 2.0, 0.01), 2.0591497),
        (four_blocks(integrators(1)), 1.414568),
        (four_blocks(integrators(2)), 2.613921),
    ],
)
def test_the_least_level_is_the_published_one(problem: control.StateSpace, level: float) -> None:
    assert h_infinity(problem, 1, 1).level == pytest.approx(level, rel=1e-5)


@pytest.mark.parametrize("scale", [1e-3, 0.2, 50.0])
def test_the_least_level_grows_with_the_costs_and_the_disturbances(scale: float) -> None:
    problem = scalar_problem(1.2, 1.0, 0.5, 0.1)
    costly = scalar_problem(1.2, scale, 0.5 * scale, 0.1)
    disturbed = control.StateSpace(
        problem.A, problem.B * [scale, scale, 1.0], problem.C, problem.D * [scale, scale, 1.0], 1.0
    )
    least = h_infinity(problem, 1, 1).level
    for other in (costly, disturbed):
        assert h_infinity(other, 1, 1).level == pytest.approx(scale * least, rel=1e-5)


def test_no_random_controller_reaches_a_lower_level() -> None:
    problem = scalar_problem(1.0, 1.0, 1.0, 1.0)
    least = h_infinity(problem, 1, 1).level
    generator = np.random.default_rng(3)
    norms = []
    for gain in generator.uniform(-1.9, -0.1, 12):
        a = [[1.0 + gain]]
        loop = control.StateSpace(a, [[1.0, gain]], [[1.0], [gain]], [[0.0, 0.0], [0.0, gain]], 1.0)
        norms.append(peak_gain(loop)[0])
    assert least < min(norms)


@pytest.mark.parametrize("count", [1, 2])
def test_the_optimal_gap_margin_is_that_of_the_synthesis(count: int) -> None:
    plant = integrators(count)
    design = h_infinity(four_blocks(plant), 1, 1)
    assert optimal_gap_margin(plant) == pytest.approx(1 / design.level, rel=1e-6)
    assert gap_margin(plant, design.controller) == pytest.approx(1 / design.level, rel=1e-4)


@pytest.mark.parametrize(
    ("period", "delay", "optimum"), [(5e-4, 0, 0.371), (5e-4, 1, 0.350), (1e-3, 0, 0.360), (1e-3, 1, 0.321)]
)
def test_the_optimum_of_a_sampled_mass_falls_with_period_and_delay(period: float, delay: int, optimum: float) -> None:
    a, b, c = np.array([[1.0, period], [0.0, 1.0]]), np.array([[period**2 / 2], [period]]), 200.0**2 * np.eye(1, 2)
    if delay:
        a = np.block([[a, b], [np.zeros((1, 3))]])
        b, c = np.eye(3, 1, -2), np.hstack([c, [[0.0]]])
    plant = control.StateSpace(a, b, c, [[0.0]], period)
    assert optimal_gap_margin(plant) == pytest.approx(optimum, abs=6e-4)


def test_the_peak_gains_are_those_of_closed_form() -> None:
    resonance = control.ss(control.tf([1.0], [1.0, -1.2, 0.9], 1.0))
    assert peak_gain(resonance) == pytest.approx((12.909945, 0.884943), rel=1e-6)
    assert peak_gain(control.ss(control.tf([1.0], [1.0, -0.5], 1.0)))[0] == pytest.approx(2.0)


def test_a_loop_keeps_a_share_of_the_optimal_robustness_and_an_unstable_one_none() -> None:
    axis = integrators(2, 5e-4)
    plant = control.append(*[control.StateSpace(axis.A, axis.B / 0.1, 1000.0 * axis.C, axis.D, axis.dt)] * 3)
    found = robustness(lqg(plant), plant)
    assert 0.3 < found.share < 1.0
    assert found.margin == pytest.approx(found.share * found.optimum)
    assert robustness(Controller.gain(1.0, 5e-4), plant, crossover=100.0).share == 0.0


def test_a_command_without_cost_is_refused() -> None:
    with pytest.raises(DesignError, match="D12 and D21 of full rank"):
        h_infinity(scalar_problem(0.9, 0.0, 0.0, 1.0), 1, 1)


@pytest.mark.parametrize("dt", [0, True])
def test_a_plant_without_a_period_is_refused(dt: float) -> None:
    plant = scalar_problem(0.9, 1.0, 1.0, 1.0)
    with pytest.raises(DesignError, match="must be sampled with its period"):
        h_infinity(control.StateSpace(plant.A, plant.B, plant.C, plant.D, dt), 1, 1)


@pytest.mark.parametrize(("seed", "count"), [(0, 1), (1, 1), (2, 2)])
def test_the_controller_keeps_its_level_on_any_problem(seed: int, count: int) -> None:
    """Three exogenous inputs and outputs, full feedthrough also from command to measurement, mixed coordinates."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(3, 3))
    a *= 1.1 / np.abs(np.linalg.eigvals(a)).max()
    b, c, d = rng.normal(size=(3, 3 + count)), rng.normal(size=(3 + count, 3)), 0.3 * rng.normal(size=[3 + count] * 2)
    d[:3, 3] += [1.0, -0.5, 0.8]
    d[3, :3] += [0.7, 1.0, -0.6]
    if count == 2:
        d[:3, 4] += [0.4, 1.0, 0.9]
        d[4, :3] += [-0.5, 0.8, 1.0]
    design = h_infinity(control.StateSpace(a, b, c, d, 1.0), count, count)
    k = design.controller
    e = np.linalg.inv(np.eye(count) - k.D @ d[3:, 3:])  # u = e (C_k x_k + D_k (C_2 x + D_21 w))
    into_u = e @ np.hstack([k.D @ c[3:], k.C, k.D @ d[3:, :3]])
    into_y = np.hstack([c[3:], np.zeros((count, k.nstates)), d[3:, :3]]) + d[3:, 3:] @ into_u
    n = 3 + k.nstates
    loop_a = np.block([[a, np.zeros((3, k.nstates))], [np.zeros((k.nstates, 3)), k.A]])
    loop_a = loop_a + np.vstack([b[:, 3:] @ into_u[:, :n], k.B @ into_y[:, :n]])
    loop_b = np.vstack([b[:, :3] + b[:, 3:] @ into_u[:, n:], k.B @ into_y[:, n:]])
    loop_c = np.hstack([c[:3], np.zeros((3, k.nstates))]) + d[:3, 3:] @ into_u[:, :n]
    loop_d = d[:3, :3] + d[:3, 3:] @ into_u[:, n:]
    assert np.abs(np.linalg.eigvals(loop_a)).max() < 1.0
    z = np.exp(1j * np.linspace(0.0, np.pi, 150))
    gains = [np.linalg.norm(loop_c @ np.linalg.solve(x * np.eye(n) - loop_a, loop_b) + loop_d, 2) for x in z]
    assert max(gains) <= design.level * (1.0 + 1e-3)
    assert max(gains) >= 0.9 * design.level  # the least level is nearly reached
