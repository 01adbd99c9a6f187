"""Damping by matching closed-loop responses, and its agreement with the direct regressor."""

from dataclasses import replace

import numpy as np
import pytest
from identify_data import premium_recording
from palpate import devices
from palpate import identification as identify
from palpate.errors import RecordingError

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
