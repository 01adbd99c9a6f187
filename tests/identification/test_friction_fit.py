"""Damping by matching closed-loop responses, and its agreement with the direct regressor."""

from dataclasses import replace

import numpy as np
import pytest
from identify_data import premium_recording
from palpate import devices
from palpate import identification as identify
from palpate.errors import RecordingError
from palpate.identification.friction import _block_covariance, _Matching

ARM = devices.load("phantom-premium-1.5a")


@pytest.fixture(scope="module")
def matched():
    return identify.friction_by_matching(premium_recording(), ARM, seconds=5.0, start=0.7 * ARM.viscous)


def test_matching_recovers_the_damping_within_five_percent_and_says_how_sure_it_is(matched):
    fit = matched
    np.testing.assert_allclose(fit.viscous, ARM.viscous, rtol=0.05)
    assert np.all(fit.viscous_half < 0.05 * ARM.viscous)
    # three intervals at 95 %: an error of twice the half width happens once in 10,000
    assert np.all(np.abs(fit.viscous - ARM.viscous) < 2 * fit.viscous_half)
    # what is left is noise: a few counts of the encoder, hundreds of times less than the swing
    assert np.all(fit.misfit < 5 * ARM.encoder_step)


def test_both_ways_agree_within_their_intervals(matched):
    direct = identify.friction_by_regressor(premium_recording(), ARM)
    apart = np.abs(direct.viscous - matched.viscous)
    assert np.all(apart < 2 * (direct.viscous_half + matched.viscous_half))
    assert direct.coulomb is not None


def test_matching_needs_to_know_the_loop():
    recording = premium_recording()
    with pytest.raises(RecordingError, match="its excitation and its servo"):
        identify.friction_by_matching(replace(recording, excitation=None), ARM)
    with pytest.raises(RecordingError, match="its excitation and its servo"):
        identify.friction_by_matching(replace(recording, metadata={}), ARM)


def test_the_covariance_is_that_of_the_blocks():
    """With independent noise it is the one of least squares; the freedom is the blocks less the parameters."""
    rng = np.random.default_rng(3)
    slope = rng.normal(size=(20_000, 2, 3)) * [1.0, 2.0, 0.5]
    rest = 0.1 * rng.normal(size=(20_000, 2))
    covariance, freedom = _block_covariance(slope, rest, 1e-2)
    assert freedom == 20_000 // 50 - 3
    expected = 0.01 * np.linalg.inv(np.einsum("nij,nik->jk", slope, slope))
    np.testing.assert_allclose(np.diag(covariance), np.diag(expected), rtol=0.25)
    blocks = [slope[k : k + 50].reshape(100, 3).T @ rest[k : k + 50].ravel() for k in range(0, 20_000, 50)]
    inverse = expected / 0.01
    exact = inverse @ sum(np.outer(m, m) for m in blocks) @ inverse * 400 / 397
    np.testing.assert_allclose(covariance, exact)
    with pytest.raises(RecordingError, match=r"3\.9 s are too short"):
        _block_covariance(slope[:390], rest[:390], 1e-2)


def test_the_sensitivity_is_the_slope_over_a_twentieth_of_the_friction_or_a_thousandth_of_the_scale():
    rng = np.random.default_rng(0)
    slope, rest = rng.normal(size=(30, 3, 3)), rng.normal(size=(30, 3))
    at, asked = np.array([0.2, 0.0, 0.01]), []

    class Linear(_Matching):
        def __init__(self):
            self.scale = np.array([1.0, 2.0, 1.0])

        def error(self, viscous):
            asked.append(viscous - at)
            return rest - slope @ (viscous - at)

    np.testing.assert_allclose(Linear().sensitivity(at, rest), slope, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(asked, np.diag([0.01, 2e-3, 1e-3]), atol=1e-12)


def test_the_scale_is_the_mean_of_inertia_and_stiffness_and_runs_are_counted():
    recording = premium_recording()
    servo = identify.JointServo(**recording.metadata["servo"])
    matching = _Matching(recording, ARM, servo, 40)
    inertia = np.diag(ARM.mass_matrix(np.array(servo.pose)))
    np.testing.assert_allclose(matching.scale, np.sqrt(inertia * servo.kp))
    left = [matching.error(ARM.viscous), matching.error(2.0 * ARM.viscous)]
    assert matching.runs == 2
    assert left[0].shape == (40, 3)
    np.testing.assert_array_equal(left[0][0], 0.0)  # the run begins where the recording does
    assert np.any(left[0] != left[1])
