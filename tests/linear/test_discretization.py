"""Discretisation against scipy, against the exact flow, and by the order of its error."""

from __future__ import annotations

import control
import numpy as np
import pytest
from palpate import devices
from palpate.errors import DesignError
from palpate.linear import discretize, linearize
from scipy.signal import cont2discrete

ARM = devices.load("phantom-premium-1.5a")
POSE = np.array([0.0, 2.2305, 3.2776])
MODEL = linearize(ARM, POSE, inputs="force", outputs="object_force", stiffness=3500.0)
T = 5e-4


def test_zoh_equals_scipy() -> None:
    """The hold-exact model equals scipy's."""
    ours = discretize(MODEL, T)
    a, b, c, d, _ = cont2discrete((MODEL.A, MODEL.B, MODEL.C, MODEL.D), T, "zoh")
    for mine, theirs in zip((ours.A, ours.B, ours.C, ours.D), (a, b, c, d), strict=True):
        assert mine == pytest.approx(theirs, rel=1e-12, abs=1e-13)
    assert ours.dt == T
    assert ours.input_labels == MODEL.input_labels


def test_two_half_periods_are_one() -> None:
    """exp(AT) is a group: two held half-steps are one whole step."""
    whole, half = discretize(MODEL, T), discretize(MODEL, T / 2)
    assert pytest.approx(half.A @ half.A, rel=1e-12, abs=1e-14) == whole.A
    assert pytest.approx(half.A @ half.B + half.B, rel=1e-12, abs=1e-14) == whole.B


def test_tustin_has_the_bilinear_transfer_function() -> None:
    """Its response at e^{jwT} is the continuous one at (2/T) j tan(wT/2), and equals scipy's bilinear rule."""
    ours = discretize(MODEL, T, "tustin")
    a, b, c, d, _ = cont2discrete((MODEL.A, MODEL.B, MODEL.C, MODEL.D), T, "bilinear")
    for w in (3.0, 40.0, 700.0, 5000.0):
        z = np.exp(1j * w * T)
        mine = ours(z)
        assert mine == pytest.approx(c @ np.linalg.solve(z * np.eye(6) - a, b) + d, rel=1e-9)
        assert mine == pytest.approx(MODEL(2j / T * np.tan(w * T / 2)), rel=1e-9)


@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_series_error_falls_with_its_order(order: int) -> None:
    """A_d cut after (AT)^order is off by (AT)^(order+1)/(order+1)!: halving T divides the error by 2^(order+1)."""
    # A stiff scalar beside a swing, so that the error stands well above rounding.
    a = np.array([[-3.0, 0.0, 0.0], [0.0, 0.0, 2.0], [0.0, -2.0, -0.1]])
    sys = control.StateSpace(a, np.ones((3, 1)), np.eye(3), np.zeros((3, 1)))
    errors = []
    for period in (0.08, 0.04, 0.02):
        errors.append(np.abs(discretize(sys, period, "series", order=order).A - discretize(sys, period).A).max())
    slopes = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert slopes == pytest.approx(order + 1, abs=0.15)
    leading = (3.0 * 0.02) ** (order + 1) / np.prod(np.arange(1, order + 2))
    assert errors[-1] == pytest.approx(leading, rel=0.05)


def test_thesis_series_is_good_enough_at_its_period() -> None:
    """At T = 0.5 ms with N = 4 (3.12) the series misses the hold by (22.2 T)^5/5!: nothing hangs on it."""
    ours, exact = discretize(MODEL, T, "series"), discretize(MODEL, T)
    fastest = np.abs(np.diag(MODEL.A)).max()  # the yaw's damping
    assert np.abs(ours.A - exact.A).max() == pytest.approx((fastest * T) ** 5 / 120, rel=0.02)
    assert np.abs(ours.B - exact.B).max() < 1e-10 * np.abs(exact.B).max()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((discretize(MODEL, T), T), "sampled already"),
        ((MODEL, 0.0), "positive"),
        ((MODEL, float("nan")), "positive"),
        ((MODEL, T, "euler"), '"zoh", "tustin" or "series"'),
        ((control.StateSpace([[2.0]], [[1.0]], [[1.0]], [[0.0]]), 1.0, "tustin"), "pole at 2/T"),
    ],
)
def test_bad_input_gets_one_sentence(arguments, says: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DesignError, match=says):
        discretize(*arguments)
    with pytest.raises(DesignError, match="at least 2"):
        discretize(MODEL, T, "series", order=1)


def test_the_transfer_matrix_of_the_sampled_arm_has_one_sample_of_delay() -> None:
    """Yaw is apart from the other two axes; H(z) begins with C B = T^2/2 M^-1; yaw needs 2 states, the others 4."""
    device, pose, period = devices.load("phantom-premium-1.5a"), np.array([0.0, 2.2305, 3.2776]), 5e-4
    system = discretize(linearize(device, pose, inputs="torque", outputs="angle"), period, "series", order=4)
    first = np.asarray(system.C @ system.B)
    assert not np.any(system.D)
    assert not np.any(first[0, 1:])
    assert not np.any(first[1:, 0])
    np.testing.assert_allclose(first, 0.5 * period**2 * np.linalg.inv(device.mass_matrix(pose)), rtol=1e-2)
    responses = [system.C @ np.linalg.matrix_power(system.A, k) @ system.B for k in range(12)]
    for part, order in ((slice(0, 1), 2), (slice(1, 3), 4)):
        blocks = [np.hstack([responses[i + j][part, part] for j in range(6)]) for i in range(6)]
        values = np.linalg.svd(np.vstack(blocks) / np.abs(first).max(), compute_uv=False)
        assert int(np.count_nonzero(values > 1e-9 * values[0])) == order
