"""The slider pressed against a sampled wall: where sampled-data theory is exact, the simulation must agree with it.

A mass m with damping b, held input, n samples of delay, wall force K x + B (x_k - x_(k-1)) / T. Its characteristic
polynomial is (z - 1)(z - a) z^(n+1) + (b1 z + b0)[(K + B/T) z - B/T], with a = exp(-bT/m), t = m/b,
b1 = (T - t (1 - a))/b, b0 = (t (1 - a) - a T)/b. Set z = e^(j w): its roots cross the circle at the critical K below.
"""

from __future__ import annotations

import numpy as np
import pytest
from core_runs import Run, impedance_display, run, spring_at
from numpy.typing import NDArray
from palpate import devices

Array = NDArray[np.float64]
SLIDER = devices.load("slider")
MASS, PERIOD = 0.06, 1e-3  # kg, s


def held_input(b: float) -> tuple[float, float, float]:
    """a, b1 (m/N), b0 (m/N) of the mass under an input held for one period."""
    if b == 0.0:
        return 1.0, PERIOD**2 / (2 * MASS), PERIOD**2 / (2 * MASS)
    a, t = np.exp(-b * PERIOD / MASS), MASS / b
    return float(a), float((PERIOD - t * (1 - a)) / b), float((t * (1 - a) - a * PERIOD) / b)


def spectral_radius(b: float, delay: int, stiffness: float, damping: float) -> float:
    """Largest root of the characteristic polynomial."""
    a, b1, b0 = held_input(b)
    wall = np.array([stiffness + damping / PERIOD, -damping / PERIOD])
    plant = np.polymul(np.polymul([1, -1], [1, -a]), [1] + [0] * (delay + 1))
    return float(np.abs(np.roots(np.polyadd(plant, np.polymul([b1, b0], wall)))).max())


def undamped_boundary(delay: int, angle: float) -> tuple[float, float]:
    """(K, B) on the boundary for b = 0, by the closed form in the crossing angle."""
    kappa = 4 * np.tan(angle / 2) ** 2 * np.cos((delay + 1) * angle)
    beta = 2 * np.sin(angle / 2) * np.sin((delay + 0.5) * angle) / np.cos(angle / 2) ** 2
    return float(kappa * MASS / PERIOD**2), float(beta * MASS / PERIOD)


def damped_boundary(b: float, delay: int, angle: float) -> tuple[float, float]:
    """(K, B) on the boundary for any b, from W = -e^(jnw) / G(e^(jw))."""
    a, b1, b0 = held_input(b)
    z = np.exp(1j * angle)
    w = -np.exp(1j * delay * angle) * (z - 1) * (z - a) / (b1 * z + b0)
    return float(w.real - w.imag * np.tan(angle / 2)), float(PERIOD * w.imag / np.sin(angle))


def critical_without_delay(b: float, damping: float) -> float:
    """K_c for n = 0 and any b, in closed form."""
    a, b1, b0 = held_input(b)
    rate = damping / PERIOD
    return ((1 - a) + rate * (b1 + a * b0) - rate**2 * b0 * (b0 + b1)) / (b0 * (1 + b1 * rate))


def press(b: float, delay: int, stiffness: float, damping: float, ticks: int = 2000) -> Run:
    """Let the slider go at 1 um/s on the wall, held from both sides so that the loop is linear."""
    return run(
        SLIDER.with_viscous([b]),
        ticks=ticks,
        period=PERIOD,
        substeps=4,
        start_speed=[1e-6],
        delay=delay,
        wall=spring_at([0.0, 0.0, 0.0]),
        stiffness=[stiffness, 0.0, 0.0],
        damping=[damping, 0.0, 0.0],
        controller=impedance_display(),
    )


def growth(trace: Run) -> float:
    """Growth of the swing's envelope per sample, between the third and the last quarter of the run."""
    assert trace.unstable_tick == -1
    x = np.abs(trace.q[:, 0])
    quarter = len(x) // 4
    return float((x[3 * quarter : 4 * quarter].max() / x[2 * quarter : 3 * quarter].max()) ** (1 / quarter))


CASES = [
    pytest.param(b, delay, *damped_boundary(b, delay, part * np.pi / (2 * (delay + 1))), id=f"b={b}, n={delay}, {part}")
    for b in (0.0, 0.05, 1.0)
    for delay in (0, 1, 3)
    for part in (0.3, 0.6, 0.8)
]


@pytest.mark.parametrize(("b", "delay", "critical", "damping"), CASES)
def test_loop_is_stable_below_and_unstable_above_the_critical_stiffness(
    b: float, delay: int, critical: float, damping: float
) -> None:
    """0.97 of the exact critical stiffness dies out and 1.03 grows, each as fast as its largest root says."""
    assert critical > 0
    for share, stable in ((0.97, True), (1.03, False)):
        found = growth(press(b, delay, share * critical, damping))
        expected = spectral_radius(b, delay, share * critical, damping)
        assert (found < 1) is stable
        assert found - 1 == pytest.approx(expected - 1, rel=0.05)


@pytest.mark.parametrize("delay", [0, 1, 2, 3, 5])
def test_closed_form_without_damping_lies_on_the_unit_circle(delay: int) -> None:
    for part in np.linspace(0.1, 0.9, 9):
        angle = part * np.pi / (2 * (delay + 1))
        stiffness, damping = undamped_boundary(delay, angle)
        assert spectral_radius(0.0, delay, stiffness, damping) == pytest.approx(1.0, abs=1e-9)
        assert (stiffness, damping) == pytest.approx(damped_boundary(0.0, delay, angle), rel=1e-9)


@pytest.mark.parametrize(
    ("delay", "stiffest", "at"),
    [(0, 0.68629, 0.8284), (1, 0.14447, 0.4247), (2, 0.06243, 0.2914), (3, 0.03478, 0.2224), (5, 0.01535, 0.1512)],
)
def test_stiffest_undamped_wall(delay: int, stiffest: float, at: float) -> None:
    """KT^2/m at its largest over all BT/m; without delay it is 12 - 8 sqrt 2 at 2 sqrt 2 - 2."""
    angle = np.linspace(0, np.pi / (2 * (delay + 1)), 200_001)[1:-1]
    pairs = np.array([undamped_boundary(delay, w) for w in angle[:: max(1, len(angle) // 20_000)]])
    best = pairs[np.argmax(pairs[:, 0])]
    assert best[0] * PERIOD**2 / MASS == pytest.approx(stiffest, abs=5e-6)
    assert best[1] * PERIOD / MASS == pytest.approx(at, abs=2e-4)
    if delay == 0:
        assert stiffest == pytest.approx(12 - 8 * np.sqrt(2), abs=5e-6)


@pytest.mark.parametrize("b", [0.05, 0.5, 5.0])
def test_critical_stiffness_without_delay_in_closed_form(b: float) -> None:
    for damping in (0.0, 0.5, 5.0, 20.0):
        critical = critical_without_delay(b, damping)
        assert spectral_radius(b, 0, 0.999999 * critical, damping) < 1
        assert spectral_radius(b, 0, 1.000001 * critical, damping) > 1


def test_linear_rule_overestimates() -> None:
    """K < (b + B)/(T/2 + delay) is for little damping: at BT/m = 0.1 the exact boundary is 8 to 16 % lower."""
    for delay in (0, 1):
        angles = np.linspace(0, np.pi / (2 * (delay + 1)), 20_001)[1:-1]
        pairs = np.array([undamped_boundary(delay, w) for w in angles])
        near = pairs[np.argmin(np.abs(pairs[:, 1] * PERIOD / MASS - 0.1))]
        rule = near[1] / (PERIOD / 2 + delay * PERIOD)
        assert 0.84 < near[0] / rule < 0.92


def test_energy_over_a_hold_is_force_times_the_way_after_it() -> None:
    """A held force does F_k (x_(k+1) - x_k) of work; the naive F_k (x_k - x_(k-1)) has even the sign wrong."""
    trace = press(0.0, 0, 3000.0, 0.0, ticks=400)
    x, force = trace.q[:, 0], -trace.object_force[:, 0]
    kinetic = SLIDER.energy(trace.q, trace.qd)
    exact = float(np.sum(force[:-1] * np.diff(x)))
    naive = float(np.sum(force[1:] * np.diff(x)))
    assert exact == pytest.approx(kinetic[-1] - kinetic[0], rel=1e-9)
    assert naive < 0 < exact
