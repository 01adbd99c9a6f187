"""One direction of a tip as a mass: by the tip's inertia, by the power of friction, and by the angle of one count."""

from __future__ import annotations

import numpy as np
import pytest
from palpate import devices
from palpate.errors import PoseError
from palpate.metrics import tip_axis
from palpate.metrics.device_performance import moving_force, tip_inertia
from palpate.metrics.guard_comparison import _movable

ARM = devices.load("phantom-premium-1.5a")
POSE = np.array([0.2, 2.2305, 3.2776])
SINGULAR = np.array([0.0, 2.0, 2.0 + np.pi / 2.0])  # of rank two


@pytest.mark.parametrize("name", ["phantom-premium-1.5a", "phantom-premium-1.5a-rotors", "slider", "haply-2diy"])
def test_a_direction_has_the_mass_and_the_friction_of_a_tip_that_moves_along_it(name: str) -> None:
    """The power lost at 1 m/s is b + f; the kinetic energy of a push along e is F^2 t^2 / (2 m)."""
    device = devices.load(name)
    pose = POSE if device.dof == 3 else np.array(device.model.working_pose, dtype=float)
    rng = np.random.default_rng(1)
    jacobian = device.jacobian(pose)
    for _ in range(3):
        direction = jacobian @ rng.normal(size=device.dof)
        e = direction / np.linalg.norm(direction)
        found = tip_axis(device, pose, 7.0 * direction)
        speeds = np.linalg.lstsq(jacobian, e, rcond=None)[0]
        assert found.damping == pytest.approx(speeds @ np.diag(device.viscous) @ speeds)
        assert found.coulomb == pytest.approx(np.abs(speeds) @ device.coulomb)
        impulse = np.linalg.solve(device.mass_matrix(pose), jacobian.T @ e)  # joint speeds after 1 N s along e
        assert found.mass == pytest.approx(1.0 / (impulse @ device.mass_matrix(pose) @ impulse))
        if device.dof == 3:
            assert found.mass == pytest.approx(1.0 / (e @ np.linalg.inv(tip_inertia(device, pose)) @ e))
        moved = [abs(e @ jacobian[:, joint]) * device.encoder_step[joint] for joint in range(device.dof)]
        assert max(moved) == pytest.approx(found.count)


def test_a_singular_pose_or_a_direction_out_of_reach_has_no_axis() -> None:
    with pytest.raises(PoseError, match="singular"):
        tip_axis(ARM, SINGULAR, np.linalg.svd(ARM.jacobian(SINGULAR))[0][:, 0])
    with pytest.raises(PoseError, match="direction: the device cannot move its tip along it; give another"):
        tip_axis(devices.load("slider"), [0.0], [1.0, 1e-3, 0.0])


@pytest.mark.parametrize(("name", "axis"), [("phantom-premium-1.5a", 2), ("haply-2diy", None), ("slider", 0)])
def test_the_chosen_direction_is_the_last_along_which_the_tip_moves(name: str, axis: int | None) -> None:
    device = devices.load(name)
    pose = np.array(device.model.working_pose, dtype=float)
    along = _movable(device, pose)
    moves = [number for number in range(3) if np.linalg.norm(device.jacobian(pose)[number]) > 1e-9]
    assert along.tolist() == np.eye(3)[moves[-1]].tolist()
    assert axis in (None, moves[-1])


def test_a_joint_that_a_direction_does_not_turn_is_not_moved_by_it() -> None:
    """The first joint turns across the plane of the arm; its lever is rounding, and its friction none."""
    free = ARM.with_friction(coulomb=[0.0, 0.02, 0.03])
    jacobian = free.jacobian(POSE)
    across = jacobian[:, 0] / np.linalg.norm(jacobian[:, 0])
    for along in (jacobian[:, 1] + 0.3 * jacobian[:, 2], jacobian[:, 2] - 0.2 * jacobian[:, 1]):
        e = along - (along @ across) * across
        e /= np.linalg.norm(e)
        expected = min(friction / abs(e @ jacobian[:, joint]) for joint, friction in ((1, 0.02), (2, 0.03)))
        assert moving_force(free, POSE, e) == pytest.approx(expected)
        assert moving_force(free, POSE, e + 1e-3 * across) == 0.0
