"""The impedance display against statics: what the operator pushes with is what the object holds."""

from __future__ import annotations

import numpy as np
import pytest
from palpate import devices
from palpate.linear.linearization import static_tip_force

from experiments.hosseini2004.cases import POSE, design
from experiments.hosseini2004.topologies import display


@pytest.mark.parametrize("stiffness", [1.0, 3.5])
def test_a_displayed_cube_yields_by_force_over_stiffness(stiffness: float) -> None:
    """Statics: C = 1 and no other force but a hold that was exact at the start: F/K within 1 % on every axis."""
    loop = display(8.5, stiffness)
    assert loop.diverged is None
    np.testing.assert_allclose(loop.steady, loop.ideal, rtol=1e-2)


def test_what_is_left_is_the_stiffness_of_gravity_and_of_the_constant_hold() -> None:
    """Closed form: (K + J^-T (dN/dq - d(J^T hold)/dq) J^-1) dp = F, for a force too small for anything else."""
    arm = devices.load("phantom-premium-1.5a")
    jacobian = arm.jacobian(POSE)
    a_q, _, a_tau = arm.linearization(POSE, np.zeros(3), arm.gravity(POSE))
    hold = static_tip_force(jacobian, arm.gravity(POSE))
    joint = -np.linalg.solve(a_tau, a_q) - np.einsum("k,kij->ij", hold, arm.tip_hessian(POSE))
    inverse = np.linalg.inv(jacobian)
    expected = np.linalg.solve(1000.0 * np.eye(3) + inverse.T @ joint @ inverse, np.full(3, 0.01)) * 1e3
    loop = display(0.01, 1.0, model="linear")
    np.testing.assert_allclose(loop.steady, expected, rtol=2e-5)
    assert np.abs(expected - loop.ideal).max() > 1e-3 * loop.ideal


def test_without_a_damper_the_sampled_display_diverges() -> None:
    """A held spring force puts energy in at every sample: at 3.5 N/mm more than the joints' friction takes out."""
    assert display(8.5, 3.5, damping=0.0, duration=2.0).diverged is not None


def test_an_integrator_in_a_display_makes_every_object_rigid() -> None:
    """The integrator of a tracking LQG ends only when the object's force, hence the deflection, is zero."""
    loop = display(8.5, 3.5, controller=design("D", "lqg"), damping=0.0, duration=2.0)
    assert loop.diverged is None
    assert np.abs(loop.steady).max() < 1e-3 * loop.ideal
