"""Margins of sampled loops against closed forms, exact eigenvalues and the perturbation that each margin names."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from palpate import devices
from palpate.control import (
    Controller,
    closed_loop,
    critical_gain,
    gain_interval,
    lead_lag,
    loop_gain,
    loop_margins,
    lqg,
    margins,
    spectral_radius,
    virtual_coupling,
)
from palpate.control.feedback_loop import series
from palpate.control.stability_margins import frequency_response, peak_gain
from palpate.errors import DesignError
from palpate.linear import rendering_plant

T = 5e-4
POSE = np.array([0.0, 2.2305, 3.2776])
ARM = devices.load("phantom-premium-1.5a")
SLIDER = devices.load("slider")


def integrator(gain: float) -> control.StateSpace:
    return control.StateSpace([[1.0]], [[1.0]], [[gain]], [[0.0]], T)


def delayed(loop: control.StateSpace, samples: int) -> control.StateSpace:
    for _ in range(samples):
        m = loop.noutputs
        loop = series(loop, control.StateSpace(np.zeros((m, m)), np.eye(m), np.eye(m), np.zeros((m, m)), T))
    return loop


def random_loop(seed: int) -> control.StateSpace:
    """A stable closed loop of two channels and four states."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(4, 4))
    a *= 0.9 / np.abs(np.linalg.eigvals(a)).max()
    return control.StateSpace(a, rng.normal(size=(4, 2)), 0.1 * rng.normal(size=(2, 4)), np.zeros((2, 2)), T)


@pytest.mark.parametrize("gain", [0.05, 0.4, 1.1, 1.9])
def test_integrator_has_the_textbook_margins(gain: float) -> None:
    """L = g/(z-1): stable for 0 < g < 2, crosses 1 where 2 sin(theta/2) = g, with the phase -90 deg - theta/2."""
    m = loop_margins(integrator(gain))
    theta = 2 * np.arcsin(gain / 2)
    assert m.gain_down == 0.0
    assert m.gain_up == pytest.approx(2 / gain, rel=1e-9)
    assert m.phase == pytest.approx(np.degrees(np.pi / 2 - theta / 2), rel=1e-9)
    assert m.crossover == pytest.approx(theta / T, rel=1e-9)
    assert m.delay == pytest.approx((np.pi / 2 - theta / 2) / theta * T, rel=1e-9)


def test_slider_critical_stiffness_is_the_exact_one() -> None:
    """A held mass with friction against a sampled spring leaves the unit circle at K = (1 - a)/beta0."""
    mass, b = float(SLIDER.mass_matrix([0.0])[0, 0]), float(SLIDER.viscous[0])
    a, tau = np.exp(-b * T / mass), mass / b
    exact = (1 - a) * b / (tau * (1 - a) - a * T)
    plant = rendering_plant(SLIDER, [0.0], stiffness=100.0, period=T)
    loop = loop_gain(Controller.gain(1.0, T), plant)
    scalar = control.StateSpace(loop.A, loop.B[:, :1], loop.C[:1], loop.D[:1, :1], T)
    low, high = gain_interval(scalar, 0.5 * exact / 100.0)
    assert low == 0.0
    assert high * 100.0 == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize(("n", "kappa", "beta"), [(0, 0.68629, 0.8284), (1, 0.14447, 0.4247), (3, 0.03478, 0.2224)])
def test_sampled_wall_reaches_the_known_peak(n: int, kappa: float, beta: float) -> None:
    """Mass without friction, spring and backward-difference damper, n samples late: kappa_max at its beta."""
    mass = 0.1
    coupling = virtual_coupling(kappa * mass / T**2, beta * mass / T, T)
    plant = control.StateSpace([[1, T], [0, 1]], [[T**2 / 2 / mass], [T / mass]], [[1, 0]], [[0]], T)
    loop = delayed(series(plant, coupling), n)
    assert spectral_radius(loop, 0.0) == pytest.approx(1.0)
    # Only K grows; B stays: stable a little below the peak, unstable above.
    for factor, stable in ((0.99, True), (1.01, False)):
        wall = virtual_coupling(factor * kappa * mass / T**2, beta * mass / T, T)
        assert (spectral_radius(delayed(series(plant, wall), n)) < 1) is stable


@pytest.mark.parametrize("design", [lead_lag, lqg])
def test_margins_of_the_arm_are_where_its_eigenvalues_leave_the_circle(design) -> None:  # type: ignore[no-untyped-def]
    """Gain, phase and delay margins of the three-channel loop, each against exact closed-loop eigenvalues."""
    plant = rendering_plant(ARM, POSE, stiffness=2000.0, period=T)
    controller = design(rendering_plant(ARM, POSE, stiffness=1000.0, period=T))
    loop = loop_gain(controller, plant)
    m = margins(controller, plant)
    for edge, out in ((m.gain_down, 0.999), (m.gain_up, 1.001)):
        if 0 < edge < np.inf:
            assert spectral_radius(loop, edge) == pytest.approx(1.0, abs=1e-9)
            assert spectral_radius(loop, edge * out) > 1.0
            assert spectral_radius(loop, edge / out) < 1.0
    phi = np.radians(m.phase)
    assert max(spectral_radius(loop, np.exp(1j * s * phi)) for s in (1, -1)) == pytest.approx(1.0, abs=1e-9)
    assert max(spectral_radius(loop, np.exp(1j * s * phi * 0.98)) for s in (1, -1)) < 1.0
    whole = int(m.delay / T)
    assert spectral_radius(delayed(loop, whole)) < 1.0
    assert spectral_radius(delayed(loop, whole + 1)) > 1.0
    # The loop broken at the object force has the same uniform margins: its eigenvalues are the same.
    other = margins(controller, plant, at="object_force")
    assert (other.gain_up, other.phase) == pytest.approx((m.gain_up, m.phase), rel=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_disk_margin_names_a_perturbation_that_destabilises(seed: int) -> None:
    """At the peak, delta = u v*/sigma of size alpha makes I + L f singular; no grid frequency lies above the peak."""
    loop = random_loop(seed)
    if spectral_radius(loop) >= 1:
        loop = control.StateSpace(loop.A, 0.1 * loop.B, loop.C, loop.D, T)
    m = loop_margins(loop)
    half = 0.5 * np.eye(2)
    dense = np.linspace(0, np.pi, 4001)
    worst = max(np.linalg.norm(np.linalg.inv(np.eye(2) + frequency_response(loop, t)) - half, 2) for t in dense)
    assert 1 / m.disk >= worst * (1 - 1e-9)
    assert 1 / m.disk == pytest.approx(worst, rel=0.02)
    z = np.exp(1j * m.peak_frequency * T)
    response = frequency_response(loop, m.peak_frequency * T)
    u, s, vh = np.linalg.svd(np.linalg.inv(np.eye(2) + response) - half)
    delta = np.outer(vh[0].conj(), u[:, 0].conj()) / s[0]
    assert np.linalg.norm(delta, 2) == pytest.approx(m.disk, rel=1e-6)
    factor = np.linalg.solve(np.eye(2) - delta / 2, np.eye(2) + delta / 2)
    a = loop.A - loop.B @ factor @ loop.C
    assert np.abs(np.linalg.eigvals(a) - z).min() < 1e-6


def test_peak_gain_finds_a_resonance_narrower_than_the_grid() -> None:
    """1/(z^2 - 2 r cos(t) z + r^2) with r = 1 - 1e-7: the peak is 1/((1-r)|e^{jt} - r e^{-jt}|) at t."""
    r, t = 1 - 1e-7, 1.2345
    a = np.array([[2 * r * np.cos(t), -(r**2)], [1.0, 0.0]])
    peak, where = peak_gain(control.StateSpace(a, [[1.0], [0.0]], [[1.0, 0.0]], [[0.0]], T))
    assert where == pytest.approx(t, abs=1e-6)
    assert peak == pytest.approx(1 / ((1 - r) * abs(np.exp(1j * t) - r * np.exp(-1j * t))), rel=1e-4)


def resonance(r: float, t: float, peak: float) -> control.StateSpace:
    """Return g/(z^2 - 2 r cos(t) z + r^2): peak g/((1 - r^2) sin(t)) where cos(theta) = cos(t) (1 + r^2)/(2 r)."""
    a = np.array([[2 * r * np.cos(t), -(r**2)], [1.0, 0.0]])
    return control.StateSpace(a, [[1.0], [0.0]], [[0.0, peak * (1 - r**2) * np.sin(t)]], [[0.0]], T)


@pytest.mark.parametrize("angle", [0.7, 1.3, 2.1, 2.5])
def test_peak_gain_of_two_channels_is_that_of_the_higher_although_the_grid_hits_the_lower(angle: float) -> None:
    for r in (0.6, 0.75, 0.9):
        sharp, blunt = resonance(1 - 1e-5, 1.2, 1.0), resonance(r, angle, 1.0005)
        peak, where = peak_gain(control.append(sharp, blunt))
        assert peak == pytest.approx(1.0005, rel=2e-6)
        assert np.cos(where) == pytest.approx(np.cos(angle) * (1 + r**2) / (2 * r), abs=1e-3)


@pytest.mark.parametrize("above", [1e-4, 1e-3, 1e-2])
def test_a_peak_that_just_exceeds_one_has_both_its_crossings(above: float) -> None:
    """|z^2 + a z + b|^2 = (1 - b)^2 + a^2 + 2 a (1 + b) cos(theta) + 4 b cos(theta)^2 on the circle."""
    r, t = 0.99, 1.0
    loop = resonance(r, t, 1 + above)
    a, b, g = -2 * r * np.cos(t), r**2, float(loop.C[0, 1])
    theta = np.arccos(np.roots([4 * b, 2 * a * (1 + b), (1 - b) ** 2 + a**2 - g**2]))
    z = np.exp(1j * theta)
    phases = np.pi - np.abs(np.angle(g / (z**2 + a * z + b)))
    m = loop_margins(loop)
    assert np.radians(m.phase) == pytest.approx(phases.min(), rel=1e-7)
    assert m.crossover * T == pytest.approx(theta[np.argmin(phases)], rel=1e-9)


def test_an_interval_of_gains_ends_on_both_sides_where_the_pole_leaves_the_circle() -> None:
    """0.5/(z - 1.1) closes to the pole 1.1 - k/2, which is inside for 0.2 < k < 4.2, from any gain in between."""
    loop = control.StateSpace([[1.1]], [[0.5]], [[1.0]], [[0.0]], T)
    for around in (0.25, 1.0, 4.0):
        assert gain_interval(loop, around) == pytest.approx((0.2, 4.2), rel=1e-9)
    m = loop_margins(loop)
    assert (m.gain_down, m.gain_up) == pytest.approx((0.2, 4.2), rel=1e-9)
    stable = control.StateSpace([[0.5]], [[0.0]], [[1.0]], [[0.0]], T)
    assert gain_interval(stable) == (0.0, np.inf)


def test_a_narrow_range_of_unstable_gains_ends_the_interval() -> None:
    """Poles 0.2 +- sqrt(d^2/10 - 0.961), d = k - 3: outside of the circle for |d| < 0.1, and from sqrt(16.01)."""
    m = np.sqrt(0.1) * np.diag([1.0, -1.0])
    at_three = np.array([[0.2, -np.sqrt(0.961)], [np.sqrt(0.961), 0.2]])
    loop = control.StateSpace(at_three + 3.0 * m, np.eye(2), m, np.zeros((2, 2)), T)
    assert gain_interval(loop, 1.0) == pytest.approx((0.0, 2.9), rel=1e-9)
    assert gain_interval(loop, 4.0) == pytest.approx((3.1, 3.0 + np.sqrt(16.01)), rel=1e-9)
    assert critical_gain(loop, 3.0) == pytest.approx(2.9, rel=1e-9)


@pytest.mark.parametrize("half", [1e-2, 1e-3, 2e-4])
@pytest.mark.parametrize("center", [3.0, 2.71828])
def test_a_range_of_unstable_gains_narrower_than_a_step_ends_the_interval(half: float, center: float) -> None:
    """Poles 0.2 +- sqrt((d^2 - half^2)/10 - 0.96), d = k - center: outside of the circle for |d| < half."""
    m = np.sqrt(0.1) * np.diag([1.0, -1.0])
    turn = np.sqrt(0.96 + 0.1 * half**2)
    loop = control.StateSpace(np.array([[0.2, -turn], [turn, 0.2]]) + center * m, np.eye(2), m, np.zeros((2, 2)), T)
    assert gain_interval(loop, 1.0)[1] == pytest.approx(center - half, rel=1e-6)
    assert gain_interval(loop, 4.0)[0] == pytest.approx(center + half, rel=1e-6)
    assert critical_gain(loop, 3.5) == pytest.approx(center - half, rel=1e-6)


def test_critical_gain_of_an_unstable_loop() -> None:
    """5/(z-1) is unstable; from small gains up it leaves the circle at 2/5."""
    assert critical_gain(integrator(5.0)) == pytest.approx(0.4, rel=1e-9)
    with pytest.raises(DesignError, match="stable up to"):
        critical_gain(integrator(1.0))
    with pytest.raises(DesignError, match="unstable at every gain"):
        critical_gain(integrator(-1.0))


def test_an_unstable_loop_has_no_margins() -> None:
    with pytest.raises(DesignError, match="spectral radius"):
        loop_margins(integrator(2.5))
    with pytest.raises(DesignError, match="unstable at the gain"):
        gain_interval(integrator(2.5))


def test_controller_and_plant_must_share_the_period() -> None:
    plant = rendering_plant(ARM, POSE, stiffness=1000.0, period=1e-3)
    with pytest.raises(DesignError, match="sample both alike"):
        loop_gain(Controller.gain(1.0, T), plant)


def test_closed_loop_agrees_with_the_loop_gain() -> None:
    """y = (I + L)^-1 times the open path; its poles are those that the spectral radius sees."""
    plant = rendering_plant(ARM, POSE, stiffness=1000.0, period=T, method="tustin")  # with a direct part
    controller = lqg(plant)
    whole = closed_loop(controller, plant)
    assert np.abs(np.linalg.eigvals(whole.A)).max() == pytest.approx(spectral_radius(loop_gain(controller, plant)))
    for theta in (0.01, 0.3, 2.0):
        z = np.exp(1j * theta)
        c, p = controller.system(z), plant(z)
        u = np.linalg.solve(np.eye(3) - c[:, 3:] @ p, c[:, :3])
        assert frequency_response(whole, theta) == pytest.approx(np.vstack([p @ u, u]), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("dt", [0, True, None])
def test_margins_need_a_sampled_square_loop(dt: Any) -> None:
    one = integrator(0.5)
    with pytest.raises(DesignError, match="square and sampled"):
        loop_margins(control.StateSpace(one.A, one.B, one.C, one.D, dt))
    with pytest.raises(DesignError, match="square and sampled"):
        loop_margins(control.StateSpace(one.A, np.hstack([one.B, one.B]), one.C, [[0.0, 0.0]], one.dt))


@pytest.mark.parametrize("direct", [0.0, 2.0])
def test_a_gain_above_one_at_half_the_sampling_rate_bears_no_further_sample_of_delay(direct: float) -> None:
    """L = -1.2/(z + 0.5) + D: a sample of delay turns the sign of L(-1), whatever the crossings below it."""
    loop = control.StateSpace([[-0.5]], [[1.0]], [[-1.2]], [[direct]], T)
    found = loop_margins(loop)
    assert found.spectral_radius < 1.0
    assert spectral_radius(delayed(loop, 1)) > 1.0
    assert found.delay <= T
