"""Laws that the arm's dynamics obey whatever its parameters are: energy, work, symmetry, exact derivatives."""

from __future__ import annotations

import numpy as np
import pytest
from core_runs import run
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from palpate import devices
from palpate.devices import Device
from riesz import riesz_derivative

Array = NDArray[np.float64]
NAMES = ["phantom-premium-1.5a", "phantom-premium-1.5a-rotors"]
ARM = devices.load("phantom-premium-1.5a")
ANGLES = hnp.arrays(np.float64, 3, elements=st.floats(-np.pi, np.pi))
SPEEDS = hnp.arrays(np.float64, 3, elements=st.floats(-20, 20))
TORQUES = hnp.arrays(np.float64, 3, elements=st.floats(-0.3, 0.3))
EQUILIBRIUM = np.array([0.0, 2.2305, 3.2776])  # rad


def mass_derivatives(device: Device, q: Array) -> Array:
    """dM/dq, (3, 3, 3), last index the joint: exact, because M is a trigonometric polynomial of degree 2."""
    return np.stack([riesz_derivative(device.mass_matrix, q, j) for j in range(3)], axis=-1)


@pytest.mark.parametrize("name", NAMES)
def test_mdot_minus_2c_is_skew_symmetric(name: str) -> None:
    """qd^T (dM/dt - 2C) qd = 0 and more: the matrix itself is skew, to 1e-12 of the size of its terms."""
    device = devices.load(name)
    rng = np.random.default_rng(11)
    for _ in range(500):
        q, qd = rng.uniform(-np.pi, np.pi, 3), rng.uniform(-20, 20, 3)
        change = mass_derivatives(device, q) @ qd
        coriolis = device.coriolis(q, qd)
        skew = change - 2 * coriolis
        size = np.abs(change).max() + 2 * np.abs(coriolis).max()
        assert np.abs(skew + skew.T).max() <= 1e-12 * size


@given(ANGLES, SPEEDS)
def test_coriolis_is_made_of_christoffel_symbols(q: Array, qd: Array) -> None:
    """C_ij = 1/2 sum_k (dM_ij/dq_k + dM_ik/dq_j - dM_jk/dq_i) qd_k: so dM/dt - 2C is skew."""
    d = mass_derivatives(ARM, q)
    symbols = 0.5 * (d + np.swapaxes(d, 1, 2) - np.transpose(d, (2, 0, 1)))
    np.testing.assert_allclose(ARM.coriolis(q, qd), symbols @ qd, rtol=0, atol=1e-15 * (1 + np.abs(qd).max()))


@given(ANGLES)
def test_gravity_is_the_derivative_of_potential_energy(q: Array) -> None:
    expected = [float(riesz_derivative(lambda p: np.array(ARM.energy(p, np.zeros(3))), q, j)) for j in range(3)]
    np.testing.assert_allclose(ARM.gravity(q), expected, rtol=0, atol=1e-15)


@given(ANGLES, SPEEDS)
def test_energy_is_kinetic_plus_potential(q: Array, qd: Array) -> None:
    kinetic = ARM.energy(q, qd) - ARM.energy(q, np.zeros(3))
    assert kinetic == pytest.approx(0.5 * qd @ ARM.mass_matrix(q) @ qd, abs=1e-14, rel=1e-12)


@given(ANGLES)
def test_inertia_is_symmetric_and_positive(q: Array) -> None:
    mass = ARM.mass_matrix(q)
    np.testing.assert_array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass).min() > 1e-4


@given(ANGLES, SPEEDS, TORQUES)
def test_inverse_dynamics_undoes_forward_dynamics(q: Array, qd: Array, tau: Array) -> None:
    """M qdd + C qd + N + k qd = tau, with qdd from `acceleration`, which does not use M, C and N as matrices."""
    qdd = ARM.acceleration(q, qd, tau)
    terms = [ARM.mass_matrix(q) @ qdd, ARM.coriolis(q, qd) @ qd, ARM.gravity(q), ARM.viscous * qd]
    scale = sum(float(np.abs(t).max()) for t in terms)
    np.testing.assert_allclose(sum(terms), tau, rtol=0, atol=1e-13 * scale)


@given(ANGLES, SPEEDS, TORQUES)
def test_power_balance(q: Array, qd: Array, tau: Array) -> None:
    """dE/dt = tau . qd - qd . k qd along the motion."""
    qdd = ARM.acceleration(q, qd, tau)
    change = np.array([riesz_derivative(lambda p: np.array(ARM.energy(p, qd)), q, j) for j in range(3)])
    rate = change @ qd + qd @ ARM.mass_matrix(q) @ qdd
    assert rate == pytest.approx(tau @ qd - qd @ (ARM.viscous * qd), abs=1e-11)


def test_energy_is_constant_when_nothing_damps_or_pushes() -> None:
    """10 s of tumbling from (1, 1, 1): kinetic and potential energy change all the while, their sum to 1e-9 never."""
    device = ARM.frictionless()
    speed = np.array([3.0, -2.0, 4.0])
    trace = run(
        device, ticks=10_000, period=1e-3, substeps=10, start=[1.0, 1.0, 1.0], start_speed=speed, record_every=10
    )
    assert trace.unstable_tick == -1
    energy = device.energy(trace.q, trace.qd)
    kinetic = energy - device.energy(trace.q, np.zeros_like(trace.q))
    assert np.ptp(kinetic) > 0.01  # J: there is motion to speak of
    assert np.abs(energy / energy[0] - 1).max() < 1e-9


def test_a_constant_tip_force_does_the_work_force_times_way() -> None:
    """Undamped, E(t) - E(0) = f . (p(t) - p(0)): force, Jacobian, dynamics and energy in one balance over 2 s."""
    device = ARM.frictionless()
    force = np.array([0.3, -0.2, 0.1])
    trace = run(device, ticks=2000, period=1e-3, substeps=10, start=EQUILIBRIUM, tip_force=force)
    gained = device.energy(trace.q, trace.qd) - device.energy(EQUILIBRIUM, np.zeros(3))
    work = (device.forward(trace.q) - device.forward(EQUILIBRIUM)) @ force
    assert np.ptp(work) > 0.05  # J
    np.testing.assert_allclose(gained, work, rtol=0, atol=1e-9)


def test_damping_only_takes_energy() -> None:
    trace = run(ARM, ticks=3000, period=1e-3, start=[1.0, 3.0, 4.0], start_speed=[0.0, 0.1, 0.1])
    energy = ARM.energy(trace.q, trace.qd)
    assert np.all(np.diff(energy) <= 1e-15)
    assert energy[0] - energy[-1] > 1e-3  # J


@given(ANGLES, SPEEDS, TORQUES, st.floats(-np.pi, np.pi))
def test_dynamics_do_not_know_which_way_the_base_looks(q: Array, qd: Array, tau: Array, turn: float) -> None:
    turned = np.add(q, [turn, 0.0, 0.0])
    np.testing.assert_array_equal(ARM.mass_matrix(turned), ARM.mass_matrix(q))
    np.testing.assert_array_equal(ARM.acceleration(turned, qd, tau), ARM.acceleration(q, qd, tau))


@given(ANGLES, SPEEDS, TORQUES)
def test_linearization_is_the_derivative_of_acceleration(q: Array, qd: Array, tau: Array) -> None:
    """Dual numbers against a sixth-order difference of the real function."""
    stencil = {1: 45 / 60, 2: -9 / 60, 3: 1 / 60}
    for which, exact in enumerate(ARM.linearization(q, qd, tau)):
        for j in range(3):
            step = 1e-2 if which else 3e-3
            total = np.zeros(3)
            for k, weight in stencil.items():
                for sign in (1, -1):
                    state = [q.copy(), qd.copy(), tau.copy()]
                    state[which][j] += sign * k * step
                    total += sign * weight * ARM.acceleration(*state)
            np.testing.assert_allclose(exact[:, j], total / step, rtol=1e-6, atol=1e-5)


def test_same_setup_gives_the_same_trace_bit_for_bit() -> None:
    first, second = (run(ARM, ticks=500, period=1e-3, start=[1.0, 1.0, 1.0]) for _ in range(2))
    np.testing.assert_array_equal(first.q, second.q)
