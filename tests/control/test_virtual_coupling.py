"""The sampled spring and dashpot against its difference equation, and when it is passive."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.control import virtual_coupling
from palpate.control.stability_margins import frequency_response
from palpate.errors import DesignError
from scipy.signal import lfilter

K, B, T = 3500.0, 2.0, 5e-4


def run(system, deflection: np.ndarray) -> np.ndarray:  # type: ignore[no-untyped-def]
    x, out = np.zeros((system.nstates, 1)), []
    for d in deflection:
        out.append(float((system.C @ x + system.D * d)[0, 0]))
        x = system.A @ x + system.B * d
    return np.array(out)


def test_difference_equations() -> None:
    """backward: K d + B (d - d_1)/T; bilinear: K d + B d', d' = 2/T (d - d_1) - d'_1 (3.34)."""
    d = np.random.default_rng(0).normal(size=50) * 1e-3
    assert run(virtual_coupling(K, B, T), d) == pytest.approx(lfilter([K + B / T, -B / T], [1], d), rel=1e-9)
    rate = lfilter([2 / T, -2 / T], [1, 1], d)
    assert run(virtual_coupling(K, B, T, "bilinear"), d) == pytest.approx(K * d + B * rate, rel=1e-9)


def test_bilinear_is_the_analogue_at_the_warped_frequency() -> None:
    for theta in (0.1, 1.0, 3.0):
        expected = K + B * 2j / T * np.tan(theta / 2)
        assert frequency_response(virtual_coupling(K, B, T, "bilinear"), theta)[0, 0] == pytest.approx(expected)


def test_passive_up_to_the_exact_limit() -> None:
    """Colgate & Schenkel: b > (T/2) Re{(1 - e^{-j th}) H}/(1 - cos th) at every th; the worst is B + K T/2 at pi."""
    theta = np.linspace(1e-3, np.pi, 4000)
    h = np.array([frequency_response(virtual_coupling(K, B, T), t)[0, 0] for t in theta])
    needed = T / 2 * ((1 - np.exp(-1j * theta)) * h).real / (1 - np.cos(theta))
    assert needed.max() == pytest.approx(B + K * T / 2, rel=1e-6)
    assert theta[np.argmax(needed)] == pytest.approx(np.pi)


def test_without_damping_it_is_a_constant() -> None:
    assert virtual_coupling(K, 0.0, T, "bilinear").nstates == 0
    assert virtual_coupling(K, 0.0, T).D[0, 0] == K


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ((-1.0, B, T), "stiffness must be finite and not negative"),
        ((K, np.inf, T), "damping must be finite"),
        ((K, B, 0.0), "period must be positive"),
        ((K, B, T, "forward"), '"backward" or "bilinear"'),
    ],
)
def test_bad_input_gets_one_sentence(arguments, says: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(DesignError, match=says):
        virtual_coupling(*arguments)
