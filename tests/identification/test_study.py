"""identify_recording: from a file to a verdict on data not used for the fit; experiments that drift or run away."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from identify_data import premium_recording
from palpate import devices
from palpate import identification as identify
from palpate.errors import DeviceError, RecordingError
from palpate.identification import study as study_module
from palpate.identification.study import arx_structures

ARM = devices.load("phantom-premium-1.5a")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    file = premium_recording().save(folder / "experiment.h5")
    steps = []
    result = identify.identify_recording(file, "phantom-premium-1.5a", folder / "out", progress=steps.append)
    return result, folder / "out" / "identification.json", steps


def test_result_is_json_and_says_where_the_recording_comes_from(study):
    result, file, steps = study
    assert json.loads(file.read_text()) == json.loads(json.dumps(result, allow_nan=False))
    assert "simulated" in result["recording"]["source"]
    assert len(steps) == 3


def test_every_parameter_has_an_interval_beside_the_catalog(study):
    rows = study[0]["parameters"]
    assert len(rows) == 14
    for row in rows:
        assert row["low"] < row["value"] < row["high"]
        if row["catalog"]:
            assert abs(row["error_percent"]) < 5


def test_fitted_device_free_runs_on_unused_data_and_beats_the_linear_model(study):
    run = study[0]["free_run"]
    assert min(run["device"]) > 95
    assert min(run["device"]) > min(run["arx"])


def test_summary_tells_the_main_points(study):
    text = study[0]["summary"]
    for words in ("simulated", "95 % interval", "M22", "not used for the fit", "white"):
        assert words in text


def test_bad_input_is_one_sentence_with_the_file(tmp_path):
    still = tmp_path / "still.csv"
    rows = "\n".join(f"{k * 0.001:.3f}, 0, 0, 0, 0, 0, 0" for k in range(9000))
    still.write_text("time [s], q1 [rad], q2 [rad], q3 [rad], tau1 [N*m], tau2 [N*m], tau3 [N*m]\n" + rows)
    with pytest.raises(RecordingError, match=r"still\.csv: too little excitation: torque 1 is 0"):
        identify.identify_recording(still, ARM, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    with pytest.raises(DeviceError):
        identify.identify_recording(premium_recording(), "no-such-device")


def test_doubts_about_the_intervals_are_in_summary_and_json(study):
    assert study[0]["doubts"] == []
    assert "Doubt" not in study[0]["summary"]
    late = replace(premium_recording(), torque=np.roll(premium_recording().torque, 1, axis=0))
    result = identify.identify_recording(late, ARM)
    assert re.match(r"The torque acts (1|0\.99\d|1\.0\d?) ± 0\.0\d+ ms before its time stamp", result["doubts"][-1])
    assert f"Doubt: {result['doubts'][-1]}" in result["summary"]


def test_experiment_is_reproducible_and_its_seed_is_the_noise():
    one, again, other = (
        identify.simulate_experiment(ARM, duration=1.0, sway=None, excitation=fast(), seed=s) for s in (1, 1, 2)
    )
    np.testing.assert_array_equal(one.angle, again.angle)
    assert np.any(one.angle != other.angle)
    counts = one.angle / ARM.encoder_step
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)


def fast():
    return identify.multisine([0.02, 0.02, 0.01], (2.0, 8.0), lines=5)


def test_without_the_servo_the_arm_drifts_and_with_it_it_stays():
    push = identify.multisine([0.02, 0.02, 0.01], (0.3, 6.0), lines=5)
    held = identify.simulate_experiment(ARM, push, duration=10.0, period=2e-3)
    tuned = identify.JointServo.tuned(ARM)
    limp = identify.JointServo(tuned.pose, (0.0,) * 3, (0.0,) * 3, tuned.bias_torque)
    free = identify.simulate_experiment(ARM, push, duration=10.0, period=2e-3, servo=limp)
    away = np.abs(np.array([r.angle[-2000:] - tuned.pose for r in (held, free)])).max(axis=(1, 2))
    assert away[0] < 0.5
    assert away[1] > 3 * away[0]


def test_the_servo_law_is_what_is_recorded():
    recording = identify.simulate_experiment(ARM, fast(), duration=1.0)
    servo = identify.JointServo(**recording.metadata["servo"])
    keep = np.exp(-2 * np.pi * servo.cutoff * recording.period)
    velocity, torque = np.zeros(3), []
    for k, angle in enumerate(recording.angle):
        if k:
            velocity = keep * velocity + (1 - keep) / recording.period * (angle - recording.angle[k - 1])
        torque.append(servo.bias_torque + np.array(servo.kp) * (servo.pose - angle) - np.array(servo.kd) * velocity)
    np.testing.assert_allclose(recording.torque, torque + recording.excitation, atol=1e-12)


def test_a_runaway_experiment_says_when():
    tuned = identify.JointServo.tuned(ARM)
    wrong_way = identify.JointServo(tuned.pose, tuple(-10 * k for k in tuned.kp), tuned.kd, tuned.bias_torque)
    with pytest.raises(RecordingError, match=r"diverges at t = [\d.]+ s"):
        identify.simulate_experiment(ARM, fast(), duration=5.0, servo=wrong_way)
    with pytest.raises(RecordingError, match=r"has 2 channels; phantom-premium-1\.5a has 3 joints"):
        identify.simulate_experiment(ARM, identify.multisine([0.1, 0.1], (1.0, 5.0)))


def test_linear_models_have_the_orders_two_to_four_and_the_coupling_of_the_masses():
    """The yaw of the PHANToM is not coupled with its other two joints."""
    coupled = np.array([[1, 0, 0], [0, 1, 1], [0, 1, 1]])
    structures = arx_structures(ARM)
    assert [one[0].max() for one in structures] == [2, 3, 4]
    for na, nb, nk in structures:
        assert np.array_equal(na, na.max() * coupled)
        assert np.array_equal(nb, na)
        assert np.array_equal(nk, coupled)


def test_a_free_run_is_as_good_as_it_is_nearer_to_the_record_than_the_record_to_its_mean(monkeypatch):
    """100 % for the record, 0 for its mean, and 100 % less the misfit in between."""
    unused = premium_recording()
    begin = round(study_module.SPEEDS / unused.period)
    wanted = unused.angle[begin:]
    for share, offset in ((0.0, 0.0), (1.0, 0.0), (0.3, 0.0), (0.3, 2.0)):
        moved = replace(unused, angle=unused.angle + offset)
        run = wanted + offset + share * (wanted.mean(axis=0) - wanted)
        monkeypatch.setattr(study_module, "estimate_parameters", lambda *_, **__: SimpleNamespace(device=ARM))
        monkeypatch.setattr(study_module, "torque_response", lambda *_, run=run: run)
        found, reason = study_module._device_free_run(ARM, unused, moved, True)
        assert found == pytest.approx([100.0 * (1.0 - share)] * 3, abs=1e-9)
        assert reason is None
