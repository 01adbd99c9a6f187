"""Device with a flexible mode, and the admittance loop: two masses, and plain difference equations."""

from __future__ import annotations

import numpy as np
import pytest
from flexible_device import with_mode
from palpate import devices
from palpate.control import workspace
from palpate.devices.flexible_mode import FlexibleMode
from palpate.errors import PoseError
from palpate.linear.admittance_loop import SensedPlant, TipFeedback, admittance_loop, sensed_plant, tip_feedback
from palpate.linear.flexible_tip import couple_tip, sampled_axis
from palpate.linear.linear_device import HumanArm
from palpate.linear.sampled_loop import equations_of_motion, sampled_plants
from scipy.linalg import expm

MODE = FlexibleMode(80.0, 0.4, 0.05)
ARM = devices.load("phantom-premium-1.5a").with_viscous([2e-3, 1e-3, 3e-3])
POSE = np.array([0.2, 2.2305, 3.2776])


@pytest.mark.parametrize("mode", [MODE, FlexibleMode(20.0, 0.7, 0.3)])
def test_a_sampled_axis_is_the_exponential_of_two_masses_on_a_spring(mode: FlexibleMode) -> None:
    inertia, period = 1.3, 2e-3
    masses = inertia * np.array([1 - mode.tip_share, mode.tip_share])
    reduced = inertia * mode.tip_share * (1 - mode.tip_share)
    rate = 2 * np.pi * mode.frequency
    coupling = np.array([[-1.0, 1.0], [1.0, -1.0]]) / masses[:, None]
    whole = np.zeros((5, 5))
    whole[:2, 2:4] = np.eye(2)
    whole[2:4, :2] = reduced * rate**2 * coupling
    whole[2:4, 2:4] = 2 * mode.damping_ratio * rate * reduced * coupling
    whole[2, 4] = 1 / masses[0]
    exact = expm(whole * period)
    a, b = sampled_axis(mode, inertia, period)
    np.testing.assert_allclose(a, exact[:4, :4], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(b, exact[:4, 4], rtol=1e-9, atol=1e-15)


def test_a_coupled_tip_has_the_energy_of_its_parts() -> None:
    """Kinetic energy by shares, stretch between the sides, friction at the motors, tip behind the spring."""
    draw = np.random.default_rng(0)
    m, d, s = draw.normal(size=(3, 4, 3, 3))
    jacobian = draw.normal(size=(4, 2, 3))
    x, y = draw.normal(size=(2, 3))
    both, share = np.r_[x, y], MODE.tip_share
    got = couple_tip(m, d, s, jacobian, MODE)
    for k in range(4):
        stretch = (x - y) @ m[k] @ (x - y)
        wanted = (1 - share) * x @ m[k] @ x + share * y @ m[k] @ y
        assert both @ got[0][k] @ both == pytest.approx(wanted)
        assert both @ got[1][k] @ both == pytest.approx(x @ d[k] @ x + MODE.damping * stretch)
        wanted = (1 - share) * x @ s[k] @ x + share * y @ s[k] @ y + MODE.stiffness * stretch
        assert both @ got[2][k] @ both == pytest.approx(wanted)
        np.testing.assert_allclose(got[3][k] @ both, jacobian[k] @ y, rtol=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("full", [False, True])
def test_the_admittance_loop_is_its_law_tick_by_tick(delay: int, full: bool) -> None:
    """The tool moves by implicit Euler under object, damping and force; the observer follows the tip."""
    draw = np.random.default_rng(delay)
    n, dof, r, t = 5, 2, 2, 0.1
    plant = SensedPlant(*(draw.normal(size=s) for s in ((n, n), (n, dof), (dof, n), (r, n), (r, dof))))
    axes = np.linalg.qr(draw.normal(size=(3, r)))[0]
    feedback = TipFeedback(
        axes, draw.normal(size=(r, dof)), draw.normal(size=(dof, dof)), draw.uniform(1, 2, dof),
        draw.normal(size=(dof, dof)), 3.0, 2.0, np.array([0.5, 1.5, 2.5]), t,
    )  # fmt: skip
    k, b = (np.diag([3.0, 4.0, 5.0]), np.diag([0.3, 0.2, 0.1])) if full else (None, None)
    mass, damping = 0.7, 1.9
    a, entry, out = admittance_loop(plant, feedback, mass, damping, k, b, delay)
    stiff, loss = (np.zeros((3, 3)) if one is None else one for one in (k, b))
    state, force = draw.normal(size=len(a)), draw.normal(size=3)
    x, past = state[:n], state[n : n + (delay + 1) * dof].reshape(delay + 1, dof)
    y, v, place, speed, disturbance = state[n + (delay + 1) * dof :].reshape(5, r)
    felt = plant.force @ x + plant.force_torque @ past[delay]
    # implicit Euler: m a = felt - pushed - damping (v + t a) - K (y + t (v + t a)) - B v
    pull = axes @ felt - force - damping * (axes @ v) - stiff @ (axes @ (y + t * v)) - loss @ axes @ v
    tool = axes.T @ np.linalg.solve((mass + t * damping) * np.eye(3) + t * t * stiff, pull)
    error = feedback.jacobian @ plant.angles @ x - place
    place, speed, disturbance = place + 0.5 * error, speed + 1.5 * error, disturbance + 2.5 * error
    wanted = tool + 3.0 * (y - 0.5 * t * v - place) + 2.0 * (v - speed) - disturbance
    joint = np.linalg.solve(feedback.jacobian, np.column_stack([wanted, v]))
    torque = feedback.holding @ plant.angles @ x + feedback.inertia @ joint[:, 0]
    torque = torque + feedback.friction * joint[:, 1] - feedback.jacobian.T @ felt
    acting = torque if delay == 0 else past[delay - 1]
    known = wanted + disturbance
    after = [plant.a @ x + plant.b @ acting, torque, past[:delay].ravel(), y + t * (v + t * tool), v + t * tool]
    after += [place + t * speed + 0.5 * t * t * known, speed + t * known, disturbance]
    np.testing.assert_allclose(a @ state + entry @ force, np.concatenate(after), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(out @ state, axes @ v, rtol=1e-12)


@pytest.mark.parametrize("arm", [HumanArm(0.2, 3.0, 150.0), HumanArm(0.3, 3.0, 150.0, 900.0, 2.0)])
@pytest.mark.parametrize("device", [ARM, devices.load("slider")])
def test_the_sensor_reads_what_the_operator_exchanges_with_the_tip(device: devices.Device, arm: HumanArm) -> None:
    """A rigid grip by the hand's mass, damping and spring, tissue by its stretch, for any state and torque."""
    pose = POSE if device.dof == 3 else np.zeros(1)
    force, period = np.array([0.3, -0.2, 0.5]), 1e-3
    jacobian = device.jacobian(pose)
    moving = np.linalg.norm(jacobian, axis=1) > 0
    axes = np.eye(3)[:, moving]
    plant = sensed_plant(device, pose, arm, force, period, axes)
    m, d, s, rows = (one[0] for one in equations_of_motion(device, pose[None], arm, force))
    size, dof = len(m), device.dof
    draw = np.random.default_rng(0)
    q, qd, torque = draw.normal(size=size), draw.normal(size=size), draw.normal(size=dof)
    if arm.tissue_stiffness is None:
        acceleration = np.linalg.solve(m, np.r_[torque, np.zeros(size - dof)] - d @ qd - s @ q)
        wanted = -rows @ (arm.mass * acceleration + arm.damping * qd + arm.stiffness * q)
    else:
        stretch = np.hstack([-jacobian[moving], np.eye(moving.sum())])
        wanted = stretch @ (arm.tissue_stiffness * q + arm.tissue_damping * qd)
    got = plant.force @ np.r_[q, qd] + plant.force_torque @ torque
    np.testing.assert_allclose(got, wanted, rtol=1e-9, atol=1e-9)
    a, b, c = (one[0] for one in sampled_plants(device, pose[None], arm, force, period))
    np.testing.assert_array_equal(plant.a, a)
    np.testing.assert_array_equal(plant.b, b)
    np.testing.assert_array_equal(plant.angles, c)
    free = sensed_plant(device, pose, None, force, period, axes)
    for found, one in zip(
        (free.a, free.b, free.angles), sampled_plants(device, pose[None], None, force, period), strict=True
    ):
        np.testing.assert_array_equal(found, one[0])
    assert not free.force.any()
    assert not free.force_torque.any()
    assert (free.force.shape, free.force_torque.shape) == ((axes.shape[1], 2 * dof), (axes.shape[1], dof))


def test_the_tip_feedback_holds_the_load_at_every_pose_nearby() -> None:
    """The derivative of the torque that keeps the device at rest under a constant force of the operator."""
    law = workspace(ARM, 5e-4)
    force, step = np.array([0.3, -0.2, 0.5]), 1e-6
    found = tip_feedback(law, POSE, force)

    def held(pose: np.ndarray) -> np.ndarray:
        return np.asarray(ARM.gravity(pose) - ARM.jacobian(pose).T @ force)

    wanted = np.array([(held(POSE + step * e) - held(POSE - step * e)) / (2 * step) for e in np.eye(3)]).T
    np.testing.assert_allclose(found.holding, wanted, atol=1e-8)
    np.testing.assert_array_equal(found.axes, np.eye(3))
    np.testing.assert_array_equal(found.jacobian, ARM.jacobian(POSE))
    np.testing.assert_array_equal(found.inertia, ARM.mass_matrix(POSE))
    np.testing.assert_array_equal(found.friction, [2e-3, 1e-3, 3e-3])
    assert (found.position, found.velocity, found.period) == (law.gains.position, law.gains.velocity, 5e-4)
    np.testing.assert_array_equal(found.observer, law.gains.observer)
    with pytest.raises(PoseError, match=r"^the pose is near a singular one, where the controller bounds its force$"):
        tip_feedback(law, np.array([0.2, 2.0, 3.4]), force)


@pytest.mark.parametrize("arm", [None, HumanArm(0.2, 3.0, 150.0)])
def test_a_flexible_device_is_its_rigid_one_with_a_coupled_tip(arm: HumanArm | None) -> None:
    """The force of the operator turns the tip's side, and the operator's hand holds it."""
    force = np.array([0.3, -0.2, 0.5])
    device = with_mode(ARM, 80.0, 0.4, 0.05)
    found = [one[0] for one in equations_of_motion(device, POSE[None], arm, force)]
    m, d, s, rows = (one[0] for one in equations_of_motion(ARM, POSE[None], None, np.zeros(3)))
    m, d, s, rows = couple_tip(m, d, s, rows, MODE)
    s[3:, 3:] -= np.einsum("k,kij->ij", force, ARM.tip_hessian(POSE))
    if arm is not None:
        hold = rows.T @ rows
        m, d, s = m + arm.mass * hold, d + arm.damping * hold, s + arm.stiffness * hold
    for one, wanted in zip(found, (m, d, s, rows), strict=True):
        np.testing.assert_allclose(one, wanted, atol=1e-12 * np.abs(wanted).max())
