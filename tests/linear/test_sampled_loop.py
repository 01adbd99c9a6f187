"""The sampled loop against derivatives of the motion, against its difference equations, and against its transfer."""

from __future__ import annotations

import control
import numpy as np
import pytest
from derivatives import central
from numpy.typing import NDArray
from palpate import devices
from palpate.control import Controller
from palpate.linear.linear_device import HumanArm
from palpate.linear.sampled_loop import assemble_loop, observable_reduction, sampled_plants
from scipy.linalg import expm

Array = NDArray[np.float64]
ARM = devices.load("phantom-premium-1.5a").with_viscous([2e-3, 1e-3, 3e-3])
PERIOD = 1e-3


def sampled_motion(q0: Array, arm: HumanArm | None, force: Array) -> tuple[Array, Array]:
    """Return (A, B) of a device at rest from derivatives of its equations of motion."""
    place, rest = ARM.forward(q0), ARM.gravity(q0) - ARM.jacobian(q0).T @ force
    hand = 3 if arm is not None and arm.tissue_stiffness is not None else 0
    size = 3 + hand

    def motion(z: Array) -> Array:
        x, v, u = z[:size], z[size : 2 * size], z[2 * size :]
        q, qd = x[:3], v[:3]
        jacobian, inertia = ARM.jacobian(q), ARM.mass_matrix(q)
        torque = rest + u + jacobian.T @ force
        if arm is None:
            return np.concatenate([v, ARM.acceleration(q, qd, torque)])
        push, speed = ARM.forward(q) - place, jacobian @ qd
        if arm.tissue_stiffness is None:
            torque = torque - jacobian.T @ (arm.stiffness * push + arm.damping * speed)
            free = inertia @ ARM.acceleration(q, qd, torque)
            return np.concatenate([v, np.linalg.solve(inertia + arm.mass * jacobian.T @ jacobian, free)])
        tissue = arm.tissue_stiffness * (push - x[3:]) + arm.tissue_damping * (speed - v[3:])
        moved = (tissue - arm.stiffness * x[3:] - arm.damping * v[3:]) / arm.mass
        return np.concatenate([v, ARM.acceleration(q, qd, torque - jacobian.T @ tissue), moved])

    slope = central(motion, np.concatenate([q0, np.zeros(2 * size)[: size - 3], np.zeros(size + 3)]))
    whole = expm(PERIOD * np.vstack([slope, np.zeros((3, 2 * size + 3))]))
    return whole[: 2 * size, : 2 * size], whole[: 2 * size, 2 * size :]


@pytest.mark.parametrize("arm", [None, HumanArm(0.15, 4.5, 200.0), HumanArm(0.3, 3.0, 150.0, 700.0, 2.5)])
def test_sampled_plants_are_the_derivatives_of_the_motion_at_rest(arm: HumanArm | None) -> None:
    """At each of several poses, with the force of the operator at rest turning with the tip."""
    poses, force = np.array([[0.1, 2.2305, 3.2776], [-0.4, 0.5, -0.3]]), np.array([0.4, -0.7, 0.5])
    a, b, c = sampled_plants(ARM, poses, arm, force, PERIOD)
    for k, pose in enumerate(poses):
        expected_a, expected_b = sampled_motion(pose, arm, force)
        np.testing.assert_allclose(a[k], expected_a, rtol=0, atol=2e-7 * np.abs(expected_a).max())
        np.testing.assert_allclose(b[k], expected_b, rtol=0, atol=2e-7 * np.abs(expected_b).max())
        np.testing.assert_array_equal(c[k], np.eye(3, len(a[k])))


@pytest.mark.parametrize("delay", [0, 1, 3])
@pytest.mark.parametrize("states", [0, 2])
def test_the_loop_is_its_difference_equations(delay: int, states: int) -> None:
    """Two loops of random unsymmetric matrices at once, each excited by an arbitrary force."""
    rng = np.random.default_rng(10 * delay + states)
    pa, pb, pc = (rng.normal(size=shape) for shape in ((2, 4, 4), (2, 4, 2), (2, 2, 4)))
    jacobian, stiffness = rng.normal(size=(2, 3, 2)), rng.normal(size=(2, 2, 2))
    law = [rng.normal(size=shape) for shape in ((states, states), (states, 6), (3, states), (3, 6))]
    a, b, c = assemble_loop((pa, pb, pc), jacobian, stiffness, Controller(control.StateSpace(*law, PERIOD)), delay)
    forces = rng.normal(size=(7, 3))
    for k in range(2):
        x, state, memory, z = np.zeros(4), np.zeros(states), [np.zeros(2)] * delay, np.zeros(a.shape[-1])
        for force in forces:
            np.testing.assert_allclose(c[k] @ z, jacobian[k] @ pc[k] @ x, rtol=1e-10, atol=1e-10)
            command = law[2] @ state + law[3][:, 3:] @ force
            memory = [jacobian[k].T @ command + stiffness[k] @ pc[k] @ x, *memory]
            x = pa[k] @ x + pb[k] @ memory.pop()
            state = law[0] @ state + law[1][:, 3:] @ force
            z = a[k] @ z + b[k] @ force


def test_the_reduced_loop_has_the_same_transfer_and_no_hidden_mode() -> None:
    """Hidden: one mode that the force does not reach and one that the tip does not show, in mixed coordinates."""
    rng = np.random.default_rng(4)
    a = np.diag([0.9, 0.5, -0.3, 0.7, 0.2])
    entry, out = rng.normal(size=(5, 3)), rng.normal(size=(3, 5))
    entry[3], out[:, 4] = 0.0, 0.0
    mixed = rng.normal(size=(5, 5)) * np.array([1e-4, 1.0, 1e3, 1.0, 10.0])[:, None]
    a, entry, out = mixed @ a @ np.linalg.inv(mixed), mixed @ entry, out @ np.linalg.inv(mixed)
    directions = np.linalg.qr(rng.normal(size=(3, 2)))[0]
    small = observable_reduction(a, entry, out, directions)
    assert small[0].shape == (3, 3)
    assert sorted(np.linalg.eigvals(small[0]).real) == pytest.approx([-0.3, 0.5, 0.9])
    for z in (1.1, -0.4 + 0.9j, 3.0j):
        whole = directions.T @ out @ np.linalg.solve(z * np.eye(5) - a, entry @ directions)
        np.testing.assert_allclose(small[2] @ np.linalg.solve(z * np.eye(3) - small[0], small[1]), whole, rtol=1e-7)
    empty = observable_reduction(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)), directions)
    assert [one.shape for one in empty] == [(0, 0), (0, 2), (2, 0)]
