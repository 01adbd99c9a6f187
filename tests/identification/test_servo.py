"""The joint-space servo: its law, and the motion of a mass under held forces in closed form."""

import re
from dataclasses import replace

import numpy as np
import pytest
from palpate import devices
from palpate.errors import RecordingError
from palpate.identification.servo import JointServo, home, respond, torque_response
from scipy import signal

ARM = devices.load("phantom-premium-1.5a")
SLIDER = devices.load("slider")
PERIOD = 1e-3


def push(device, count=60, seed=0, size=0.05):
    return size * np.random.default_rng(seed).normal(size=(count, device.dof))


def test_a_mass_moves_under_held_forces_as_in_closed_form():
    """x_n = sum over the forces before of T^2 / m (n - j - 1/2), for a mass without friction, at rest at first."""
    free = SLIDER.with_friction(viscous=np.zeros(1), coulomb=np.zeros(1))
    mass = float(free.mass_matrix(np.zeros(1))[0, 0])
    force = push(free, 40, size=1.0)
    found = torque_response(free, np.zeros(1), np.zeros(1), force, PERIOD)
    count = np.arange(40)
    lever = np.tril(count[:, None] - count[None] - 0.5, -1)
    np.testing.assert_allclose(found, PERIOD**2 / mass * lever @ force, rtol=1e-9, atol=1e-15)
    moving = torque_response(free, np.array([0.01]), np.array([0.2]), force, PERIOD)
    np.testing.assert_allclose(moving[:, 0] - found[:, 0], 0.01 + 0.2 * PERIOD * count, rtol=1e-9)


@pytest.mark.parametrize("device", [ARM, SLIDER], ids=["arm", "slider"])
def test_the_command_is_the_law_of_the_servo_on_the_reading(device):
    """By a filter of the whole record; the velocity starts with the first difference."""
    servo = JointServo.tuned(device, cutoff=30.0)
    extra, sway = push(device), push(device, seed=1, size=0.01)
    for period in (1e-3, 2e-3):
        got = respond(device, servo, extra, period, sway=sway)
        keep = np.exp(-2 * np.pi * 30.0 * period)
        steps = np.diff(got.reading, axis=0, prepend=got.reading[:1]) / period
        velocity = signal.lfilter([1 - keep], [1, -keep], steps, axis=0)
        wanted = servo.bias_torque + servo.kp * (servo.pose + sway - got.reading) - servo.kd * velocity + extra
        np.testing.assert_allclose(got.torque, wanted, atol=1e-9)
        assert np.ptp(velocity) > 0


@pytest.mark.parametrize("device", [ARM, SLIDER], ids=["arm", "slider"])
def test_the_angles_are_those_of_the_commands_without_servo(device):
    servo = JointServo.tuned(device)
    ripple = push(device, seed=2)
    begin = np.array(servo.pose) + 0.01
    got = respond(device, servo, push(device), PERIOD, torque_noise=ripple, start=begin)
    again = torque_response(device, begin, np.zeros(device.dof), got.torque + ripple, PERIOD)
    np.testing.assert_array_equal(got.angle, again)
    np.testing.assert_array_equal(got.angle[0], begin)


def test_noise_of_the_torque_moves_the_arm_as_excitation_does_but_is_not_in_the_command():
    servo = JointServo.tuned(ARM)
    extra = push(ARM)
    hidden = respond(ARM, servo, 0 * extra, PERIOD, torque_noise=extra, encoder=False)
    known = respond(ARM, servo, extra, PERIOD, encoder=False)
    np.testing.assert_allclose(hidden.angle, known.angle, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(hidden.torque + extra, known.torque, atol=1e-8)


def test_sway_of_the_pose_acts_as_an_excitation_of_the_stiffness_times_the_sway():
    servo = JointServo.tuned(ARM)
    sway = push(ARM, size=0.02)
    swayed = respond(ARM, servo, 0 * sway, PERIOD, sway=sway, encoder=False)
    pushed = respond(ARM, servo, np.array(servo.kp) * sway, PERIOD, encoder=False)
    np.testing.assert_allclose(swayed.angle, pushed.angle, rtol=1e-9, atol=1e-12)


def test_the_reading_is_the_angle_with_its_noise_rounded_to_counts():
    servo = JointServo.tuned(ARM)
    jitter = push(ARM, size=1e-3, seed=3)
    bare = respond(ARM, servo, push(ARM), PERIOD, angle_noise=jitter, encoder=False)
    np.testing.assert_array_equal(bare.reading, bare.angle + jitter)
    got = respond(ARM, servo, push(ARM), PERIOD, angle_noise=jitter)
    step = ARM.encoder_step
    counts = got.reading / step
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-9)
    off = np.abs(got.reading - got.angle - jitter) / step
    assert 0.4 < off.max() < 0.5 + 1e-9


def test_a_servo_at_rest_at_its_pose_stays_there():
    """Gravity at the pose is compensated by the bias."""
    pose = home(ARM) + np.array([0.1, 0.2, -0.1])
    got = respond(ARM, JointServo.tuned(ARM, pose), np.zeros((50, 3)), PERIOD, encoder=False)
    np.testing.assert_allclose(got.angle, np.tile(pose, (50, 1)), atol=1e-9)
    np.testing.assert_allclose(got.torque, np.tile(ARM.gravity(pose), (50, 1)), atol=1e-9)


def test_tuning_gives_each_joint_its_frequency_and_damping():
    for device, pose in ((ARM, None), (ARM, home(ARM) + 0.2), (SLIDER, None)):
        servo = JointServo.tuned(device, pose, frequency=2.5, damping=0.3, cutoff=70.0)
        place = home(device) if pose is None else pose
        for j in range(device.dof):
            mass = device.mass_matrix(place)[j, j]
            poles = np.roots([mass, servo.kd[j], servo.kp[j]])
            np.testing.assert_allclose(np.abs(poles), 2 * np.pi * 2.5, rtol=1e-12)
            np.testing.assert_allclose(-poles.real / np.abs(poles), 0.3, rtol=1e-9)
        assert servo.pose == tuple(place)
        assert servo.bias_torque == tuple(device.gravity(place))
        assert servo.cutoff == 70.0
        assert JointServo.from_metadata(servo.describe()) == JointServo(**servo.describe()) == servo
    default = JointServo.tuned(ARM)
    assert default == JointServo.tuned(ARM, frequency=1.5, damping=0.5, cutoff=50.0)
    assert JointServo(*[(1.0,)] * 4).cutoff == 50.0


@pytest.mark.parametrize("pose", [[0.1, 0.2], [0.1, 0.2, np.nan], [0.1, 0.2, np.inf], 0.3])
def test_a_pose_of_another_shape_or_not_finite_is_refused(pose):
    with pytest.raises(RecordingError, match="the pose must be 3 finite joint coordinates, not "):
        JointServo.tuned(ARM, pose)


def test_an_incomplete_description_is_no_servo():
    whole = JointServo.tuned(ARM).describe()
    for key in whole:
        assert JointServo.from_metadata({k: v for k, v in whole.items() if k != key}) is None
    for wrong in (None, "servo", whole | {"kp": ["a"]}, whole | {"cutoff": None}):
        assert JointServo.from_metadata(wrong) is None


def test_a_run_that_diverges_says_when_and_how_to_avoid_it():
    """It ends 10 m from the pose, whatever the pose."""
    limp = JointServo((3.0,), (0.0,), (0.0,), (0.0,))
    free = SLIDER.with_friction(viscous=np.zeros(1), coulomb=np.zeros(1))
    mass = float(free.mass_matrix(np.zeros(1))[0, 0])
    force = 20.0 * mass / (1e-3 * 100) ** 2 * np.ones((200, 1))  # 10 m after 100 ticks
    for sign in (1.0, -1.0):
        with pytest.raises(RecordingError) as caught:
            respond(free, limp, sign * force, 1e-3)
        assert re.fullmatch(
            r"the experiment diverges at t = (0\.099|0\.1) s; stiffen the servo or lower the excitation",
            str(caught.value),
        )
    assert len(respond(free, limp, force[:98], 1e-3).angle) == 98


def test_a_fitted_device_that_diverges_says_when():
    with pytest.raises(RecordingError, match=r"^the fitted device diverges at t = [0-9.]+ s$"):
        torque_response(ARM, home(ARM), np.zeros(3), 1e6 * np.ones((20, 3)), PERIOD)


def test_coordinates_without_an_encoder_are_read_exactly():
    bare = replace(SLIDER, parameters=SLIDER.parameters.with_values(drive__encoder_step=0.0))
    servo = JointServo.tuned(bare)
    got = respond(bare, servo, push(bare), PERIOD)
    np.testing.assert_array_equal(got.reading, got.angle)
