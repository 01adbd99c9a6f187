"""One Lyapunov matrix for the workspace: found at a few poses, verified at others without the solver."""

from __future__ import annotations

import numpy as np
import pytest
from nightly import NIGHTLY
from palpate.arrays import Array
from palpate.control import workspace
from palpate.devices import Device, load
from palpate.devices.device import Parameters
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.stability.switching import decrease, has_solver, strongest_lyapunov
from palpate.stability.workspace_certificate import certify_workspace, workspace_loops

pytestmark = pytest.mark.skipif(not has_solver(), reason="needs Clarabel")
ARM, ROTORS = load("phantom-premium-1.5a"), load("phantom-premium-1.5a-rotors")
PERIOD = 5e-4


def drawn(count: int, seed: int) -> Array:
    """Return random poses with a condition number of the Jacobian up to 4."""
    generator, found = np.random.default_rng(seed), []
    while len(found) < count:
        q = generator.uniform([-0.8, -0.3, -0.3], [0.8, 2.4, 3.3])
        if np.linalg.cond(ARM.jacobian(q)) <= 4.0:
            found.append(q)
    return np.array(found)


def test_one_matrix_holds_at_unseen_poses_and_with_unmodeled_rotors() -> None:
    controller = workspace(ARM, PERIOD)
    exact, rotors = (16, 10) if NIGHTLY else (5, 3)
    poses = drawn(exact, seed=1)
    vertices = np.concatenate([workspace_loops(controller, poses), workspace_loops(controller, poses[:rotors], ROTORS)])
    certificate = certify_workspace(vertices)
    unseen = drawn(300 if NIGHTLY else 20, seed=7)
    assert certificate.contraction <= 0.9990
    for device in (ARM, ROTORS):
        assert certificate.verify(workspace_loops(controller, unseen, device)) <= 0.9990
    # the bound holds for a random order of poses
    generator, state = np.random.default_rng(0), np.ones(15)
    norm = np.sqrt(state @ certificate.matrix @ state)
    for _ in range(200):
        state = vertices[generator.integers(len(vertices))] @ state
        after = np.sqrt(state @ certificate.matrix @ state)
        assert after <= certificate.contraction * norm * (1 + 1e-12)
        norm = after


def test_an_operator_may_grip_and_let_go() -> None:
    controller = workspace(ARM, PERIOD)
    pose = drawn(1, seed=1)
    hand = HumanArm(0.15, 4.5, 560.0)
    certificate = certify_workspace(
        np.concatenate([workspace_loops(controller, pose), workspace_loops(controller, pose, arm=hand)])
    )
    assert certificate.contraction < 1.0


def mass(kilograms: float) -> Device:
    return Device(
        "mass", "", "tip_device", Parameters({"mass.apparent": (kilograms,) * 3, "friction.viscous": (0.0,) * 3})
    )


def test_the_factor_of_one_axis_is_that_of_the_circle_criterion() -> None:
    """An arbitrarily varying gain is proved up to (2 + alpha)/(2 - alpha), alpha the symmetric disk margin."""
    controller = workspace(mass(0.1), PERIOD)

    def proved(factor: float) -> bool:
        pair = np.array(
            [workspace_loops(controller, np.zeros(3), mass(0.1 / gain))[0][::3, ::3] for gain in (1 / factor, factor)]
        )
        p = strongest_lyapunov(pair)
        return p is not None and bool(decrease(pair, p).min() > 0.0)

    assert proved(2.78)
    assert not proved(2.86)


def test_a_loop_that_is_unstable_by_itself_is_named() -> None:
    controller = workspace(ARM, PERIOD)
    loops = workspace_loops(controller, drawn(2, seed=1))
    with pytest.raises(StabilityError, match="loop 1 is unstable by itself"):
        certify_workspace(np.stack([loops[0], 1.02 * loops[1]]))


def test_the_spectral_radius_is_that_of_the_observers_slow_pole() -> None:
    loops = workspace_loops(workspace(mass(0.1), PERIOD), np.zeros((1, 3)))
    assert np.abs(np.linalg.eigvals(loops[0])).max() == pytest.approx(0.995012479, rel=1e-6)


def test_a_delayed_command_is_the_tip_acceleration_of_the_next_tick_at_every_pose() -> None:
    """In the state, over the bandwidth: a tick adds T times it to the velocity, and T^2 / 2 to the deflection."""
    controller = workspace(ARM, PERIOD)
    tick = PERIOD * controller.bandwidth
    for loop in workspace_loops(controller, drawn(3, seed=1), delay=2):
        now, late = loop[:, 9:12], loop[:, 6:9]
        assert now[3:6] / tick == pytest.approx(np.eye(3), abs=5e-3)
        assert now[:3] / tick**2 == pytest.approx(0.5 * np.eye(3), abs=5e-3)
        assert late[:6] == pytest.approx(0.0, abs=1e-12)
