"""The sampled wall against numbers derived by hand and computed elsewhere, to the digits they are known to."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.linear import HumanArm, LinearDevice
from palpate.stability import (
    certify_coupling,
    coulomb_amplitude,
    coupling_damping,
    critical_stiffness,
    field_damping,
    naive_energy,
    passive_damping,
    quantized_stiffness,
    stability_boundary,
    two_port_limit,
    two_port_margin,
    wall_limit,
    wall_spectral_radius,
    zoh_energy,
)
from scipy.optimize import brentq

PERIOD = 1e-3  # s
ARM = (0.15, 4.5, 560.0)  # kg, N s/m, N/m


def scaled(mass: float, period: float, stiffness: float, damping: float) -> tuple[float, float]:
    """Return kappa = KT^2/m and beta = BT/m."""
    return stiffness * period**2 / mass, damping * period / mass


@pytest.mark.parametrize(
    ("delay", "kappa", "beta"),
    [
        (0, ".68629", ".8284"),
        (1, ".14447", ".4247"),
        (2, ".06243", ".2914"),
        (3, ".03478", ".2224"),
        (5, ".01535", ".1512"),
    ],
)
@pytest.mark.parametrize(("mass", "period"), [(0.06, 1e-3), (2.0, 5e-4)])
def test_stiffest_wall_of_a_free_mass(delay: int, kappa: str, beta: str, mass: float, period: float) -> None:
    """KT^2/m at its largest, over all BT/m, for n samples of delay; 12 - 8 sqrt 2 at 2 sqrt 2 - 2 without."""
    traced = stability_boundary(LinearDevice.of_mass(mass), period=period, delay=delay, points=20_001)
    damping, stiffness = traced.stiffest
    found = scaled(mass, period, stiffness, damping)
    assert f"{found[0]:.5f}"[1:] == kappa
    assert found[1] == pytest.approx(float(beta), abs=2e-4)  # flat at the top
    if delay == 0:
        assert found[0] == pytest.approx(12 - 8 * np.sqrt(2), rel=1e-7)
        at = critical_stiffness(
            LinearDevice.of_mass(mass), period=period, virtual_damping=(2 * np.sqrt(2) - 2) * mass / period
        )
        assert at * period**2 / mass == pytest.approx(12 - 8 * np.sqrt(2), rel=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 2, 3, 5])
def test_closed_form_of_the_undamped_boundary(delay: int) -> None:
    """kappa = 4 tan^2(t/2) cos((n+1)t), beta = 2 sin(t/2) sin((n+1/2)t)/cos^2(t/2), every point of the curve."""
    traced = stability_boundary(LinearDevice.of_mass(1.0), period=1.0, delay=delay)
    t = traced.angle
    kappa = 4 * np.tan(t / 2) ** 2 * np.cos((delay + 1) * t)
    beta = 2 * np.sin(t / 2) * np.sin((delay + 0.5) * t) / np.cos(t / 2) ** 2
    assert traced.stiffness == pytest.approx(kappa, rel=1e-9, abs=1e-10)
    assert traced.damping == pytest.approx(beta, rel=1e-8, abs=1e-10)
    assert t[-1] == pytest.approx(np.pi / (2 * (delay + 1)), rel=1e-5)  # it ends where the wall has no stiffness
    assert len(t) == 1000


@pytest.mark.parametrize("beta", [0.01, 0.3, 0.83, 1.5, 1.9])
def test_undamped_critical_stiffness_without_delay(beta: float) -> None:
    """kappa < 2 beta (2 - beta)/(2 + beta)."""
    critical = critical_stiffness(LinearDevice.of_mass(1.0), period=1.0, virtual_damping=beta)
    assert critical == pytest.approx(2 * beta * (2 - beta) / (2 + beta), rel=1e-11)


@pytest.mark.parametrize("b", [1e-6, 0.05, 0.5, 5.0, 60.0])
@pytest.mark.parametrize("damping", [0.0, 0.5, 5.0, 20.0])
def test_damped_critical_stiffness_without_delay(b: float, damping: float) -> None:
    """K_c = [(1-a) + (B/T)(b1 + a b0) - (B/T)^2 b0 (b0 + b1)] / [b0 (1 + b1 B/T)] for any damping b."""
    from mpmath import mp, mpf

    mp.dps = 40
    m, t, c, rate = mpf("0.06"), mpf("0.001"), mpf(b), mpf(damping) / mpf("0.001")
    a, tau = mp.exp(-c * t / m), m / c
    b1, b0 = (t - tau * (1 - a)) / c, (tau * (1 - a) - a * t) / c
    exact = ((1 - a) + rate * (b1 + a * b0) - rate**2 * b0 * (b0 + b1)) / (b0 * (1 + b1 * rate))
    found = critical_stiffness(LinearDevice.of_mass(0.06, b), period=PERIOD, virtual_damping=damping)
    assert found == pytest.approx(float(exact), rel=1e-9)


def test_linear_rule_overestimates() -> None:
    """Exact over K = (b + B)/(T/2 + t_d) (Gil, Hulin): 1.00 for little damping, .85 to .91 at BT/m = .1."""
    ratios = []
    for delay in (0, 1):
        for beta in (1e-4, 0.1):
            exact = critical_stiffness(LinearDevice.of_mass(1.0), period=1.0, delay=delay, virtual_damping=beta)
            ratios.append(exact / (beta / (0.5 + delay)))
    assert [f"{r:.2f}" for r in (ratios[0], ratios[2])] == ["1.00", "1.00"]
    assert 0.845 < ratios[3] < ratios[1] < 0.915


def test_the_hand_raises_a_bare_device_from_100_to_9135() -> None:
    """A rigid grip does; through fingertip tissue the same arm gives a sixth of it."""
    bare = wall_limit(mass=0.06, damping=0.05, period=PERIOD)
    rigid = wall_limit(mass=0.06, damping=0.05, period=PERIOD, arm=HumanArm(*ARM))
    tissue = wall_limit(mass=0.06, damping=0.05, period=PERIOD, arm=HumanArm(*ARM, 500.0, 0.5))
    assert f"{bare.critical_stiffness:.0f}" == "100"
    assert f"{rigid.critical_stiffness:.0f}" == "9135"
    assert tissue.critical_stiffness < rigid.critical_stiffness / 6
    assert "9135" in str(rigid)
    assert "passive" in str(rigid)


def test_the_hand_behind_tissue_by_another_route() -> None:
    """Two masses, spring and damper between them, written out by hand: the same critical stiffness."""
    from scipy.linalg import expm

    m, b, (mh, bh, kh), kt, bt = 0.06, 0.05, ARM, 500.0, 0.5
    a = np.array(
        [
            [0, 1, 0, 0],
            [-kt / m, -(b + bt) / m, kt / m, bt / m],
            [0, 0, 0, 1],
            [kt / mh, bt / mh, -(kh + kt) / mh, -(bh + bt) / mh],
        ]
    )
    block = np.zeros((5, 5))
    block[:4, :4], block[1, 4] = a, 1 / m
    held = expm(block * PERIOD)

    def outside(stiffness: float) -> float:
        closed = held[:4, :4].copy()
        closed[:, 0] -= stiffness * held[:4, 4]
        return float(np.abs(np.linalg.eigvals(closed)).max()) - 1

    direct = brentq(outside, 500.0, 3000.0, xtol=1e-9)
    found = critical_stiffness(LinearDevice.of_mass(m, b, HumanArm(mh, bh, kh, kt, bt)), period=PERIOD)
    assert found == pytest.approx(direct, rel=1e-9)
    assert f"{found:.1f}" == "1483.9"


def test_passive_damping_with_delay() -> None:
    """T = K = B = 1: n = 1 needs 1.625, n = 3 needs 2.540; without delay KT/2 + |B| (Colgate & Schenkel)."""
    needed = [passive_damping(stiffness=1, virtual_damping=1, period=1, delay=n) for n in (0, 1, 3)]
    assert [f"{b:.3f}" for b in needed] == ["1.500", "1.625", "2.540"]
    assert passive_damping(stiffness=800, virtual_damping=-3, period=2e-3) == pytest.approx(3.8, rel=1e-9)


def test_passive_damping_with_a_velocity_filter_and_a_virtual_mass() -> None:
    """KT/2 + B (1 - alpha)/(1 + alpha); a virtual mass alone 2M/T."""
    filtered = passive_damping(stiffness=2, virtual_damping=3, period=0.1, velocity_filter=0.4)
    assert filtered == pytest.approx(2 * 0.05 + 3 * 0.6 / 1.4, rel=1e-9)
    assert passive_damping(virtual_mass=3, period=0.1) == pytest.approx(60, rel=1e-9)


def test_two_port_admits_four_times_the_exact_stiffness() -> None:
    """Llewellyn's test with a Tustin hold lets k_c reach 8b/T without damping; exactly it is 2b/T."""
    b = 0.05
    assert two_port_limit(damping=b, period=PERIOD) == pytest.approx(400)
    for k, says in ((399.0, True), (401.0, False)):
        port = two_port_margin(damping=b, coupling_stiffness=k, coupling_damping=0, period=PERIOD)
        assert (port >= -1e-10) is says
    assert coupling_damping(coupling_stiffness=100, coupling_damping=0, period=PERIOD) == pytest.approx(b)
    verdict = certify_coupling(damping=b, coupling_stiffness=300, coupling_damping=0, period=PERIOD)
    assert not verdict.passive
    assert verdict.two_port > -1e-12
    assert "although the two-port criterion accepts it" in verdict.sentence
    assert certify_coupling(damping=b, coupling_stiffness=60, coupling_damping=0.02, period=PERIOD).passive


def test_field_quantisation_and_coulomb_bounds() -> None:
    """L(T_max/2 + n T_max) + B_max; min(2b/T, 2f_c/Delta); A* = 4f_c/[pi sqrt(K/m)(KT/2 - b)]."""
    assert field_damping(lipschitz=1000, longest_period=2e-3, delay=1, virtual_damping=0.5) == pytest.approx(3.5)
    assert quantized_stiffness(damping=0.05, coulomb=0.04, period=1e-3, quantum=23e-6) == pytest.approx(100)
    assert quantized_stiffness(damping=5, coulomb=0.04, period=1e-3, quantum=40e-6) == pytest.approx(2000)
    damped = {"damping": 5, "coulomb": 0.04, "period": 1e-3, "quantum": 40e-6}
    assert quantized_stiffness(**damped, virtual_damping=0.6) == pytest.approx(800)  # 2f_c/Delta - 2B/T
    assert quantized_stiffness(**damped, virtual_damping=1.1) == 0.0
    swing = coulomb_amplitude(mass=0.06, stiffness=600, damping=0.1, coulomb=0.02, period=1e-3)
    assert swing == pytest.approx(4 * 0.02 / (np.pi * 100 * 0.2))
    assert coulomb_amplitude(mass=0.06, stiffness=200, damping=0.1, coulomb=0.02, period=1e-3) == np.inf


def test_half_a_sample_of_prediction() -> None:
    """F = K(x + vT/2): lossless with the exact v for all kappa < 4; by backward difference .002 becomes .063."""
    delta = 0.001  # bT/m

    def beyond(kappa: float) -> float:
        return (
            float(
                wall_spectral_radius(
                    LinearDevice.of_mass(1.0, delta), stiffness=kappa, virtual_damping=kappa / 2, period=1.0
                )
            )
            - 1
        )

    plain = critical_stiffness(LinearDevice.of_mass(1.0, delta), period=1.0)
    assert f"{plain:.3f}" == "0.002"
    assert f"{brentq(beyond, 0.01, 0.3):.3f}" == "0.063"
    for kappa in (0.01, 1.0, 3.99):  # x+ = x + v + a/2, v+ = v + a, a = -kappa (x + v/2)
        exact = np.array([[1 - kappa / 2, 1 - kappa / 4], [-kappa, 1 - kappa / 2]])
        assert np.abs(np.linalg.eigvals(exact)) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(np.linalg.eigvals([[1 - 4.01 / 2, 1 - 4.01 / 4], [-4.01, 1 - 4.01 / 2]])).max() > 1.01


def test_a_held_force_works_over_the_way_after_it() -> None:
    """A mass that swings against a held spring gains energy; F_k (x_k - x_{k-1}) says that it loses it."""
    m, k, x, v, xs, fs = 0.06, 3000.0, 0.0, 0.1, [], []
    for _ in range(400):
        f = -k * x
        xs.append(x)
        fs.append(f)
        x, v = x + v * PERIOD + f * PERIOD**2 / (2 * m), v + f * PERIOD / m
    v_last = v - fs[-1] * PERIOD / m
    gained = 0.5 * m * (v_last**2 - 0.1**2)
    assert zoh_energy(fs, xs) == pytest.approx(gained, rel=1e-9)
    assert naive_energy(fs, xs) < 0 < gained


@pytest.mark.parametrize(
    ("delay", "says"),
    [(0, "no delay"), (1, "1 sample of delay"), (2, "2 samples of delay"), (0.5, "0.5 samples of delay")],
)
def test_the_sentence_of_a_wall_names_its_delay_and_what_is_passive(delay: float, says: str) -> None:
    sentence = str(wall_limit(mass=0.06, damping=0.05, period=PERIOD, delay=delay))
    assert f"at 1000 Hz, {says}, with 0 N s/m" in sentence
    passive = wall_limit(mass=0.06, damping=0.05, period=PERIOD, delay=delay).passive_stiffness
    assert f"Up to {passive:.5g} N/m it is passive" in sentence
    none = wall_limit(mass=0.06, damping=0.0, period=PERIOD, delay=delay)
    assert "No wall is" in str(none)
