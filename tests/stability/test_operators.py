"""Passive is passive for everybody: operators searched for the worst, fields that are not linear, late ticks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate.linear import HumanArm, LinearDevice, wall_loop
from palpate.stability import certify, critical_stiffness, field_damping, passive_stiffness
from scipy.linalg import expm
from scipy.optimize import differential_evolution

Array = NDArray[np.float64]
MASS, B, PERIOD = 0.06, 0.05, 1e-3  # the slider of the catalog


def slider(stiffness: float) -> dict[str, Any]:
    return {
        "device": {"name": "slider"},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "shape": "step", "force": ["0.1 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": f"{stiffness} N/m"},
        "run": {"duration": "0.2 s"},
    }


def radii(hands: Array, stiffness: float) -> Array:
    """Spectral radii of the slider against a wall in hands of five decimal logarithms (5, n), written out by hand."""
    mass, damping, spring, tissue, soft = 10.0**hands
    block = np.zeros((len(mass), 5, 5))
    block[:, 0, 1] = block[:, 2, 3] = 1.0
    block[:, 1, :5] = np.stack([-tissue, -(B + soft), tissue, soft, np.ones_like(mass)], axis=1) / MASS
    block[:, 3, :4] = np.stack([tissue, soft, -(tissue + spring), -(soft + damping)], axis=1) / mass[:, None]
    held = expm(block * PERIOD)
    closed = held[:, :4, :4].copy()
    closed[:, :, 0] -= stiffness * held[:, :4, 4]
    return np.asarray(np.abs(np.linalg.eigvals(closed)).max(axis=1))


@pytest.mark.parametrize(("stiffness", "survives"), [(99.0, True), (130.0, False)])
def test_a_certificate_survives_the_worst_of_thousands_of_hands(stiffness: float, survives: bool) -> None:
    """Differential evolution breeds the hand that makes the loop swing most: none breaks what is certified passive.

    99 N/m needs 0.0495 of 0.05 N s/m and is certified passive; 130 N/m is not, and the same search breaks it at once.
    """
    certificate = certify(slider(stiffness))
    assert (certificate.passive is True) is survives
    seen: list[float] = []

    def calm(hands: Array) -> Array:
        found = radii(hands, stiffness)
        seen.extend(found)
        return -found

    bounds = [(-3, 1), (-6, 1), (-1, 6), (0, 7), (-6, 1)]
    options = {"maxiter": 60, "popsize": 20, "polish": False, "tol": 0.0}
    worst = differential_evolution(calm, bounds, seed=0, vectorized=True, updating="deferred", **options).x
    assert len(seen) >= 5000
    assert bool(max(seen) <= 1 + 1e-9) is survives
    mass, damping, spring, tissue, soft = 10.0**worst
    loop = wall_loop(LinearDevice.of_mass(MASS, B, HumanArm(mass, damping, spring, tissue, soft)), PERIOD)
    assert loop.spectral_radius(stiffness) == pytest.approx(
        max(seen), abs=1e-8
    )  # the product's loop of the worst agrees


def network(rng: np.random.Generator, inner: int) -> LinearDevice:
    """The slider with a random passive network on it: masses, dampers and springs among ``inner`` more coordinates."""
    n = inner + 1

    def part(low: float, high: float, rank: int) -> Array:
        ties = rng.normal(size=(n, rank)) * 10 ** rng.uniform(low, high, size=rank)
        return np.asarray(ties @ ties.T)

    device = np.zeros((n, n))
    device[0, 0] = 1.0
    inertia = MASS * device + part(-2, 0, n) + np.diag([0.0] + [1e-4] * inner)
    damping = B * device + part(-2, 0.5, int(rng.integers(0, n + 1)))
    stiffness = part(0, 3, n)
    return LinearDevice(inertia, damping, stiffness, np.eye(1, n), np.ones(1))


def test_a_thousand_random_passive_networks() -> None:
    """Whatever is built of masses, dampers and springs, up to three coordinates deep, is passive, and stable."""
    rng = np.random.default_rng(6)
    virtual = 0.01
    limit = float(passive_stiffness(damping=B, period=PERIOD, virtual_damping=virtual))
    largest = max(
        wall_loop(network(rng, int(rng.integers(0, 4))), PERIOD).spectral_radius(limit * (1 - 1e-9), virtual)
        for _ in range(1000)
    )
    assert largest <= 1 + 1e-9
    assert limit < critical_stiffness(LinearDevice.of_mass(MASS, B), period=PERIOD, virtual_damping=virtual)


def pull(x: float) -> float:
    """Force (N) of a soft skin over a hard core, conservative, its slope between 100 and 900 N/m."""
    soft, hard, edge, width = 100.0, 900.0, 2e-3, 2e-4
    return float(-(soft * x + (hard - soft) * width * np.logaddexp(0.0, (x - edge) / width)))


@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize(("share", "passive"), [(1.0, True), (0.1, False)])
def test_a_nonlinear_field_with_late_ticks(delay: int, share: float, passive: bool) -> None:
    """With L(T_max/2 + n T_max) of damping no bounce gives energy, however late the ticks; with a tenth one does.

    A mass leaves the bottom of the field: a passive field never gives it back more than it had. Ticks come at random,
    never later than T_max; the motion between them is exact.
    """
    late, mass, speed = 4e-3, 2.0, 0.3
    b = share * field_damping(lipschitz=900.0, longest_period=late, delay=delay)
    fastest = 0.0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        x, v, line = 0.0, speed, [pull(0.0)] * delay
        for _ in range(600):
            line.append(pull(x))
            end = line.pop(0) / b  # the speed that it would settle to
            h = late * (1.0 if rng.random() < 0.7 else rng.uniform(0.2, 1.0))
            decay = np.exp(-b * h / mass)
            x, v = x + end * h + (v - end) * mass / b * (1 - decay), end + (v - end) * decay
            fastest = max(fastest, abs(v))
    assert bool(fastest <= speed) is passive
