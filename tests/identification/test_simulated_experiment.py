"""The default experiment: its lines, its peaks, its noise, and what its recording holds."""

import re

import numpy as np
import pytest
from palpate import devices
from palpate import identification as identify
from palpate.errors import RecordingError
from palpate.identification.servo import JointServo, home, respond
from palpate.identification.simulated_experiment import (
    Noise,
    default_excitation,
    default_sway,
    simulate_experiment,
)

ARM, SLIDER = devices.load("phantom-premium-1.5a"), devices.load("slider")


def lines(values):
    """Indices of the lines of each channel."""
    power = np.abs(np.fft.rfft(values, axis=0))
    return [np.flatnonzero(column > 1e-6 * column.max()).tolist() for column in power.T]


@pytest.mark.parametrize(("device", "reach"), [(ARM, [0.4, 0.4, 0.7]), (SLIDER, [0.01])])
@pytest.mark.parametrize("duration", [10.0, 100.0])
def test_the_sway_has_two_slow_lines_a_joint_of_its_own(device, reach, duration):
    """Up to 0.35 Hz, or in a short experiment among the first four lines for each joint."""
    values = default_sway(device, duration, seed=3).sample(duration, 0.02)
    np.testing.assert_allclose(np.abs(values).max(axis=0), reach, rtol=1e-9)
    found = lines(values)
    every = sorted(line for one in found for line in one)
    assert [len(one) for one in found] == [2] * device.dof
    assert len(set(every)) == len(every)
    assert every[0] == 1
    assert every[-1] == max(4 * device.dof, int(0.35 * duration))
    other = default_sway(device, duration, seed=4).sample(duration, 0.02)
    assert np.abs(values - other).max() > 0.1 * max(reach)


@pytest.mark.parametrize("device", [ARM, SLIDER])
def test_the_excitation_has_twelve_lines_a_joint_and_overcomes_the_friction(device):
    """Less twice the dry friction, the peak swings the inertia of each joint by half its reach at 2 Hz."""
    excitation = default_excitation(device, seed=2)
    found = lines(excitation.sample(60.0, 0.02))
    assert [len(one) for one in found] == [12] * device.dof
    assert min(map(min, found)) == 18  # 0.3 Hz
    assert max(map(max, found)) == 360  # 6 Hz
    bare = default_excitation(device.with_friction(viscous=device.viscous, coulomb=np.zeros(device.dof)))
    np.testing.assert_allclose(excitation.amplitude - bare.amplitude, 2.0 * device.coulomb, rtol=1e-9)
    inertia = np.diag(device.mass_matrix(home(device)))
    reach = bare.amplitude / inertia / (4 * np.pi) ** 2
    np.testing.assert_allclose(reach, [1.0, 0.5, 0.6] if device is ARM else [0.02], rtol=1e-9)


@pytest.mark.parametrize("device", [ARM, SLIDER])
def test_the_recording_is_the_run_with_its_noise_and_all_that_was_added_to_the_servo(device):
    found = simulate_experiment(device, duration=4.0, period=2e-3, seed=5)
    push, sway = default_excitation(device), default_sway(device, 4.0)
    servo = JointServo.tuned(device)
    noise = (2e-5, 1e-3) if device is ARM else (2e-6, 1e-3)
    draw = np.random.default_rng(5)
    shape = (2000, device.dof)
    jitter, ripple = noise[0] * draw.normal(size=shape), noise[1] * draw.normal(size=shape)
    pushed, swing = push.sample(4.0, 2e-3), sway.sample(4.0, 2e-3)
    run = respond(device, servo, pushed, 2e-3, sway=swing, angle_noise=jitter, torque_noise=ripple)
    np.testing.assert_array_equal(found.angle, run.reading)
    np.testing.assert_array_equal(found.torque, run.torque)
    np.testing.assert_allclose(found.excitation, pushed + np.array(servo.kp) * swing, rtol=1e-12)
    np.testing.assert_allclose(found.time, 2e-3 * np.arange(2000), rtol=1e-12)
    assert found.period == 2e-3
    assert found.units == ((("rad", "N*m")) if device is ARM else ("m", "N"))
    assert found.metadata == {
        "source": "simulated on the nonlinear device", "device": device.name, "seed": 5, "encoder": True,
        "noise": {"angle": noise[0], "torque": noise[1]}, "servo": servo.describe(), "excitation": push.describe(),
        "sway": sway.describe(),
    }  # fmt: skip


def test_a_given_excitation_has_no_sway_unless_it_is_given_too():
    push = identify.multisine([0.02, 0.02, 0.01], (2.0, 8.0), lines=5)
    exact = Noise(0.0, 0.0)
    bare = simulate_experiment(ARM, push, duration=1.0, noise=exact, encoder=False)
    assert bare.metadata["sway"] is None
    assert bare.metadata["encoder"] is False
    np.testing.assert_array_equal(bare.excitation, push.sample(1.0, 1e-3))
    sway = identify.multisine([0.1, 0.1, 0.1], (1.0, 5.0), lines=1)
    swayed = simulate_experiment(ARM, push, duration=1.0, noise=exact, sway=sway)
    assert swayed.metadata["sway"] == sway.describe()
    with pytest.raises(RecordingError, match=r"the sway has 1 channels; phantom-premium-1\.5a has 3 joints"):
        simulate_experiment(ARM, push, duration=1.0, sway=identify.multisine([0.1], (1.0, 5.0)))


@pytest.mark.parametrize("wrong", [(-1e-9, 0.0), (0.0, -1e-9), (np.nan, 0.0), (0.0, np.inf)])
def test_noise_is_finite_and_not_negative(wrong):
    Noise(0.0, 0.0)
    with pytest.raises(RecordingError, match=re.escape(f"noise must be finite and not negative, not {wrong[0]}")):
        Noise(*wrong)
