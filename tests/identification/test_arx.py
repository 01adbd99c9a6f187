"""ARX: known models come back with honest uncertainty; residual tests and order selection tell right from wrong."""

from dataclasses import replace

import control
import numpy as np
import pytest
import scipy
from palpate.errors import RecordingError
from palpate.identification import Recording, arx, arx_models, independence, select_order, whiteness
from palpate.identification.arx_models import ArxModel

PERIOD = 0.01
NA = np.array([[2, 0], [1, 2]])
NB = np.array([[2, 1], [0, 2]])
NK = np.array([[1, 2], [0, 1]])


def known():
    a = np.zeros((2, 2, 3))
    a[:, :, 0] = np.eye(2)
    a[0, 0, 1:], a[1, 1, 1:], a[1, 0, 1] = [-1.5, 0.7], [-1.2, 0.5], 0.3
    b = np.zeros((2, 2, 3))
    b[0, 0, 1:3], b[0, 1, 2], b[1, 1, 1:3] = [1.0, 0.5], -0.4, [0.8, -0.2]
    return a, b


def record(n=4000, noise=0.1, seed=0):
    """Simulate the difference equation itself, sample by sample."""
    a, b = known()
    draw = np.random.default_rng(seed)
    u, e = draw.normal(size=(n, 2)), noise * draw.normal(size=(n, 2))
    y = np.zeros((n, 2))
    for t in range(n):
        y[t] = e[t]
        for lag in range(min(t, 2) + 1):
            y[t] += b[:, :, lag] @ u[t - lag] - (a[:, :, lag] @ y[t - lag] if lag else 0)
    return Recording(np.arange(n) * PERIOD, y, u)


def test_a_known_model_is_recovered_exactly_without_noise():
    a, b = known()
    recording = record(400, noise=0.0)
    # counting from the means spoils the first samples' equations by their means: ask to rounding of those
    model = arx(recording, NA, NB, NK)
    np.testing.assert_allclose(model.a, a, atol=0.02)
    np.testing.assert_allclose(model.b, b, atol=0.02)
    assert model.count == 5 + 5
    assert np.count_nonzero(model.a_std) == 5


def test_coefficients_scatter_as_the_covariance_says():
    a, b = known()
    scores = []
    for seed in range(40):
        model = arx(record(1000, seed=seed), NA, NB, NK)
        for value, true, std in ((model.a, a, model.a_std), (model.b, b, model.b_std)):
            scores.append(((value - true) / np.where(std > 0, std, np.inf))[std > 0])
    scores = np.concatenate(scores)
    assert abs(scores.mean()) < 0.2
    assert 0.9 < scores.std() < 1.1  # 400 scores: standard error 0.035
    assert np.mean(np.abs(scores) < 1.96) > 0.91  # 95 % promised, standard error 1.1 %, correlated


def test_noise_covariance_is_estimated():
    np.testing.assert_allclose(arx(record(20000), NA, NB, NK).noise, 0.01 * np.eye(2), atol=4e-4)


def test_state_space_obeys_the_difference_equation():
    a, b = known()
    b[1, 0, 0] = 0.6  # a coefficient without delay, and what it does through y2
    zero = np.zeros(2)
    model = ArxModel(NA, np.add(NB, [[0, 0], [1, 0]]), NK, PERIOD, a, b, a * 0, b * 0, (), np.eye(2), zero, zero, 100)
    system = model.to_statespace()
    assert isinstance(system, control.StateSpace)
    assert system.dt == PERIOD
    u = np.random.default_rng(0).normal(size=(2, 60))
    out = control.forced_response(system, inputs=u).outputs
    for t in range(2, 60):
        left = sum(a[:, :, lag] @ out[:, t - lag] for lag in range(3))
        right = sum(b[:, :, lag] @ u[:, t - lag] for lag in range(3))
        np.testing.assert_allclose(left, right, atol=1e-10)
    np.testing.assert_allclose(model.simulate(u.T), out.T, atol=1e-10)


def test_free_run_finds_its_initial_state():
    recording = record(2000, noise=0.0)
    model = arx(recording, NA, NB, NK)
    late = recording.slice(1000, 1400)  # does not start at rest
    fit = model.fit(late)
    assert np.all(fit.free_run > 95)
    assert np.all(fit.one_step > 95)
    rest = model.simulate(late.torque)
    assert np.linalg.norm(rest - late.angle) > 2 * np.linalg.norm(fit.free - late.angle)


def test_the_structure_of_a_phantom_is_accepted():
    # (3.24): joint 1 alone, joints 2 and 3 driven by both torques, two samples of delay.
    draw = np.random.default_rng(0)
    recording = Recording(np.arange(500) * PERIOD, draw.normal(size=(500, 3)), draw.normal(size=(500, 3)))
    model = arx(recording, np.diag([6, 5, 5]), [[5, 0, 0], [0, 4, 4], [0, 4, 4]], [[2, 0, 0], [0, 2, 2], [0, 2, 2]])
    assert model.count == 6 + 5 + 5 + 5 + 4 * 4
    names = [row["name"] for row in model.coefficients()]
    assert names[0] == "a11[1]"
    assert "b23[2]" in names
    assert "b23[1]" not in names
    assert model.to_statespace().nstates == 6 + 5 + 5


def test_noise_on_the_angles_biases_least_squares_and_instruments_do_not():
    clean = record(20000, noise=0.0)
    noisy = replace(clean, angle=clean.angle + 0.7 * np.random.default_rng(5).normal(size=clean.angle.shape))
    a, _ = known()
    plain = np.abs(arx(noisy, NA, NB, NK).a - a).max()
    cured = np.abs(arx(noisy, NA, NB, NK, instruments=clean).a - a).max()
    assert plain > 0.1
    assert cured < 0.02


def test_too_little_excitation_names_the_coefficient():
    recording = record(500)
    twice = replace(recording, torque=np.column_stack([recording.torque[:, 0], recording.torque[:, 0]]))
    with pytest.raises(RecordingError, match=r"too little excitation: b\d\d\[\d\] cannot be distinguished"):
        arx(twice, 2, 2, 1)
    still = replace(recording, torque=recording.torque * [1.0, 0.0])
    with pytest.raises(RecordingError, match=r"nothing in the recording acts on b12\[1\]"):
        arx(still, 2, 2, 1)


@pytest.mark.parametrize(
    ("orders", "says"),
    [
        (([[1]], 1, 1), "na must be a 2 x 2 matrix"),
        ((1, [[1, 1], [1, -1]], 1), "nb must be"),
        ((1, 1, 0.5), "nk must be"),
        ((0, [[1, 1], [0, 0]], 1), "without any coefficient"),
        ((200, 200, 1), "too few"),
    ],
)
def test_impossible_orders_say_why(orders, says):
    with pytest.raises(RecordingError, match=says):
        arx(record(500), *orders)


def test_another_sampling_period_is_refused():
    model = arx(record(500), NA, NB, NK)
    other = record(500)
    with pytest.raises(RecordingError, match=r"sampled every 0\.01 s but the recording every 0\.02 s"):
        model.fit(Recording(2 * other.time, other.angle, other.torque))


def test_order_selection_finds_the_true_order():
    table = select_order(record(6000), [(n * (NA > 0), np.full((2, 2), n), 1) for n in (1, 2, 3, 4, 5)])
    counts = [c.count for c in table.candidates]
    assert counts == sorted(counts)
    assert table.best["bic"] == table.best["mdl"] == 1
    assert table.best["aic"] >= 1
    assert table.chosen("bic") is table.candidates[1]
    assert table.chosen() is table.candidates[table.best["free_run"]]
    with pytest.raises(
        RecordingError, match="there is no criterion 'cic'; take one of aic, bic, mdl, one_step, free_run"
    ):
        table.chosen("cic")
    assert table.chosen("bic").one_step.min() > table.candidates[0].one_step.min()
    assert "bic" in str(table)


def test_an_order_needs_structures_to_choose_from():
    with pytest.raises(RecordingError, match="give at least one structure"):
        select_order(record(200), [])


def test_whiteness_has_its_false_alarm_rate_and_sees_colour():
    draw = np.random.default_rng(0)
    white = [whiteness(draw.normal(size=1000)).passed for _ in range(300)]
    assert 0.96 < np.mean(white) <= 1.0  # 99 % promised
    coloured = np.convolve(draw.normal(size=1001), [1.0, 0.3])[1:-1]
    assert not whiteness(coloured).passed


def test_independence_has_its_false_alarm_rate_for_coloured_signals_and_sees_a_missed_path():
    draw = np.random.default_rng(1)

    def slow():
        return np.convolve(draw.normal(size=3000), 0.9 ** np.arange(40), mode="valid")

    white = draw.normal(size=(2, 4000))
    assert independence(*white, confidence=0.95).limit == pytest.approx(1.96 / np.sqrt(4000), rel=0.1)
    passed = [independence(slow(), slow()).passed for _ in range(200)]
    assert np.mean(passed) > 0.9
    u = slow()
    assert not independence(0.3 * np.roll(u, 3) + slow(), u).passed


def test_residuals_of_a_true_model_pass_and_of_a_poor_one_fail():
    recording = record(4000, seed=2)
    used, unused = recording.split(0.5)
    good, poor = arx(used, NA, NB, NK), arx(used, 1, 1, 1)
    for model, verdict in ((good, True), (poor, False)):
        left = model.residuals(unused)
        past = unused.torque[model.reach :]
        white = [whiteness(e).passed for e in left.T]
        independent = [independence(left[:, k], past[:, j]).passed for k in range(2) for j in range(2)]
        assert all(white) == verdict
        assert all(independent) == verdict


def test_the_noise_is_that_of_the_residuals_with_their_degrees_of_freedom():
    """Also between outputs with different numbers of coefficients."""
    recording = record(300)
    model = arx(recording, NA, NB, NK)
    error = model.residuals(recording)
    freedom = len(error) - np.array([NA[k].sum() + NB[k].sum() for k in range(2)])
    np.testing.assert_allclose(model.noise, error.T @ error / np.sqrt(np.outer(freedom, freedom)))
    for k in range(2):
        deviation = np.concatenate([model.a_std[k][model.a_std[k] > 0], model.b_std[k][model.b_std[k] > 0]])
        np.testing.assert_allclose(deviation, np.sqrt(np.diag(model.covariance[k])))


def test_least_squares_and_instruments_solve_the_normal_equations_in_any_units():
    """X^T r = 0 or Z^T r = 0; the second result is (X^T X)^-1, or G R G^T with G = (Z^T X)^-1 Z^T.

    R is the autocovariance of the errors, with weights that fall from 1 to 0 over the lags.
    """
    rng = np.random.default_rng(0)
    scale = np.array([1e-6, 1.0, 1e5])
    x, target = rng.normal(size=(60, 3)) * scale, rng.normal(size=60)
    z = (x / scale + 0.3 * rng.normal(size=(60, 3))) * [1e3, 1.0, 1e-7]
    solution, inverse = arx_models._least_squares(x, target, str)
    np.testing.assert_allclose(scale * solution, np.linalg.lstsq(x / scale, target, rcond=None)[0], rtol=1e-9)
    outer = np.outer(scale, scale)
    np.testing.assert_allclose(inverse * outer, np.linalg.inv((x / scale).T @ (x / scale)), rtol=1e-9, atol=1e-12)
    solution, spread = arx_models._instrumental(x, target, z, 4)
    np.testing.assert_allclose((z.T @ (target - x @ solution)) / np.linalg.norm(z, axis=0), 0.0, atol=1e-9)
    gain, error = np.linalg.inv(z.T @ x) @ z.T, target - x @ solution
    lagged = np.array([error[lag:] @ error[: 60 - lag] for lag in range(5)]) / 57 * (1 - np.arange(5) / 5)
    autocovariance = scipy.linalg.toeplitz(np.append(lagged, np.zeros(55)))
    np.testing.assert_allclose(spread * outer, gain @ autocovariance @ gain.T * outer, rtol=1e-8, atol=1e-12)


def test_noise_on_the_angles_scatters_an_instrumental_estimate_by_its_standard_deviation():
    """The equation's errors are then a moving average of the noise, not white."""
    rng = np.random.default_rng(5)
    values, told = [], []
    for _ in range(60):
        torque = rng.normal(size=(400, 1))
        clean = scipy.signal.lfilter([0.0, 1.0, 0.5], [1.0, 1.6, 0.73], torque, axis=0)
        noisy = clean + 0.5 * rng.normal(size=clean.shape)
        recordings = [Recording(time=0.01 * np.arange(400), angle=angle, torque=torque) for angle in (noisy, clean)]
        model = arx(recordings[0], 2, 2, 1, instruments=recordings[1])
        values.append(model.a[0, 0, 1:])
        told.append(model.a_std[0, 0, 1:])
    scatter = np.std(values, axis=0)
    assert (np.median(told, axis=0) < 1.5 * scatter).all()  # white errors would tell 2.3 and 2.7 times it
    assert (np.median(told, axis=0) > 0.7 * scatter).all()


def test_regressors_without_excitation_are_named():
    rng = np.random.default_rng(0)
    x, target = rng.normal(size=(60, 3)), rng.normal(size=60)
    still = x * [1.0, 0.0, 1.0]
    with pytest.raises(RecordingError, match="nothing in the recording acts on the name of 1"):
        arx_models._least_squares(still, target, "the name of {}".format)
    for share, alike in ((0.5e-10, True), (2e-10, False)):
        twin = np.column_stack([x[:, 0], x[:, 1], x[:, 0] / np.linalg.norm(x[:, 0])])
        aside = x[:, 2] - twin[:, :2] @ np.linalg.lstsq(twin[:, :2], x[:, 2], rcond=None)[0]
        twin[:, 2] += share * aside / np.linalg.norm(aside)
        if alike:
            with pytest.raises(RecordingError, match="the name of 2 cannot be distinguished from the others"):
                arx_models._least_squares(twin, target, "the name of {}".format)
        else:
            arx_models._least_squares(twin, target, "the name of {}".format)
    for columns, z in ((still, x), (x, still)):
        with pytest.raises(RecordingError, match="a regressor of the model is zero throughout"):
            arx_models._instrumental(columns, target, z, 4)
    with pytest.raises(RecordingError, match="the instruments do not distinguish the coefficients"):
        arx_models._instrumental(x, target, np.column_stack([x[:, 0], x[:, 0], x[:, 1]]), 4)


@pytest.mark.parametrize("unit", [1e-6, 1e4])
def test_criteria_of_order_do_not_depend_on_the_unit_of_the_angle(unit: float) -> None:
    """They compare the same samples for every order."""
    rng = np.random.default_rng(3)
    torque = rng.normal(size=(600, 1))
    angle = scipy.signal.lfilter([0.0, 1.0], [1.0, -1.2, 0.7, -0.2], torque + 0.3 * rng.normal(size=(600, 1)), axis=0)
    tables = []
    for scale in (1.0, unit):
        record = Recording(0.01 * np.arange(600), scale * angle, torque)
        tables.append(select_order(record, [(n, n, 1) for n in range(1, 9)]))
    for name in ("aic", "bic", "mdl"):
        one, other = ([getattr(c, name) for c in table.candidates] for table in tables)
        np.testing.assert_allclose(np.diff(one), np.diff(other), rtol=1e-6, atol=1e-6)
        assert tables[0].best[name] == tables[1].best[name]


def test_a_residual_test_needs_four_samples_a_lag_of_one_signal_that_moves():
    rng = np.random.default_rng(0)
    signal = rng.normal(size=100)
    x = signal - signal.mean()
    expected = [x[k:] @ x[: len(x) - k] / (x @ x) for k in range(1, 26)]
    np.testing.assert_allclose(whiteness(signal, 25).correlation, expected, atol=1e-12)
    for wrong, lags in ((signal[:99], 25), (signal[:, None], 25), (signal, 0), (signal, -1)):
        said = f"a residual test over {lags} lags needs at least {4 * lags} samples of one signal"
        for call in (lambda x=wrong, k=lags: whiteness(x, k), lambda x=wrong, k=lags: independence(x, signal, k)):
            with pytest.raises(RecordingError, match=said):
                call()
    with pytest.raises(RecordingError, match="the signal of a residual test is constant"):
        whiteness(np.full(100, 3.0), 25)
    with pytest.raises(RecordingError, match="residual and input must be equally long; they have 100 and 120 samples"):
        independence(signal, rng.normal(size=120), 25)


def test_the_reach_is_that_of_the_longest_regressor():
    def of(na, nb, nk):
        table = np.zeros((2, 2, 9))
        counts = [np.full((2, 2), k) for k in (na, nb, nk)]
        return ArxModel(*counts, PERIOD, table, table, table, table, (), np.eye(2), np.zeros(2), np.zeros(2), 100).reach

    assert [of(5, 1, 1), of(1, 5, 1), of(1, 2, 4), of(0, 1, 1), of(2, 0, 7)] == [5, 5, 5, 1, 2]


def test_an_output_may_have_coefficients_of_outputs_alone():
    rng = np.random.default_rng(5)
    y = np.zeros((400, 2))
    for k in range(1, 400):
        y[k] = 0.8 * y[k - 1] + rng.normal(size=2)
    record = Recording(PERIOD * np.arange(400), y, rng.normal(size=(400, 2)))
    model = arx(record, 1, [[0, 0], [1, 1]], 1)
    assert (model.na.sum(), model.nb.sum()) == (2, 2)
