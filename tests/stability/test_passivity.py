"""Passivity of the sampled wall: the exact condition against brute force, and what it promises."""

from __future__ import annotations

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from palpate.linear import HumanArm, LinearDevice, wall_loop
from palpate.stability import (
    EnergyObserver,
    coupling_damping,
    critical_stiffness,
    naive_energy,
    passive_damping,
    passive_stiffness,
    positive_real_margin,
    sufficient_damping,
    wall_spectral_radius,
    zoh_energy,
)
from scipy.linalg import eigh


def least_damping_of_sequences(stiffness: float, damping: float, delay: int, part: float, samples: int = 240) -> float:
    """Least b (T = 1) with which no motion of `samples` periods takes energy out of the wall.

    A period falls in two, the older force acting over the first `part` of it; unknown are the ways p and q in each.
    """
    count = 2 * samples
    position = np.zeros((samples + 1, count))
    for k in range(samples):
        position[k + 1] = position[k]
        position[k + 1, 2 * k : 2 * k + 2] += 1.0
    work = np.zeros((count, count))
    for k in range(samples):
        force = stiffness * position[k] + damping * (position[k] - (position[k - 1] if k else 0.0))
        if k + delay < samples:
            work[2 * (k + delay) + 1] += force  # the newer force, over q
        if k + delay + 1 < samples:
            work[2 * (k + delay + 1)] += force  # still acting, over p
    dissipated = np.diag(np.tile([1 / part if part > 0 else 1e12, 1 / (1 - part)], samples))
    return float(-eigh(0.5 * (work + work.T), dissipated, eigvals_only=True)[0])


@pytest.mark.parametrize(
    ("stiffness", "damping", "delay"),
    [
        (1.0, 0.0, 0.0),
        (1.0, 1.0, 0.0),
        (1.0, 1.0, 1.0),
        (0.3, 1.0, 2.0),
        (1.0, 0.0, 0.25),
        (1.0, 1.0, 0.5),
        (0.5, 1.0, 1.7),
    ],
)
def test_exact_damping_against_every_motion_of_a_finite_length(stiffness: float, damping: float, delay: float) -> None:
    """The worst of all motions of 240 periods comes within a few per cent from below, and never above."""
    exact = passive_damping(stiffness=stiffness, virtual_damping=damping, period=1.0, delay=delay)
    whole = int(delay)
    found = least_damping_of_sequences(stiffness, damping, whole, delay - whole)
    assert found <= exact * (1 + 1e-9)
    assert found == pytest.approx(exact, rel=0.03)


@given(
    stiffness=st.floats(0.0, 5.0),
    damping=st.floats(-2.0, 2.0),
    delay=st.floats(0.0, 4.0),
)
@settings(max_examples=60)
def test_sufficient_damping_suffices(stiffness: float, damping: float, delay: float) -> None:
    """K(n + 1/2)T + |B| is never less than what the wall needs, and exactly that without delay."""
    given_ = {"stiffness": stiffness, "virtual_damping": damping, "period": 0.7, "delay": delay}
    assert passive_damping(**given_) <= sufficient_damping(**given_) * (1 + 1e-9) + 1e-9
    at_once = {**given_, "delay": 0.0}
    assert sufficient_damping(**at_once) == pytest.approx(passive_damping(**at_once), rel=1e-9)


@given(
    mass=st.floats(0.005, 2.0),
    damping=st.floats(0.01, 10.0),
    period=st.floats(1e-4, 1e-2),
    delay=st.sampled_from([0.0, 0.4, 1.0, 2.0, 3.7]),
    share=st.floats(0.0, 0.99),
    hand=st.tuples(st.floats(-3, 1), st.floats(-3, 2), st.floats(0, 6)),
)
@settings(max_examples=80)
def test_a_passive_wall_is_stable(
    mass: float, damping: float, period: float, delay: float, share: float, hand: tuple[float, float, float]
) -> None:
    """The passive region lies inside the stable one, for the bare device and in any hand."""
    virtual = share * damping / 2
    stiffest = float(passive_stiffness(damping=damping, period=period, virtual_damping=virtual, delay=delay))
    assert stiffest > 0
    arm = HumanArm(*(10.0**x for x in hand))
    for tip in (LinearDevice.of_mass(mass, damping), LinearDevice.of_mass(mass, damping, arm)):
        radius = wall_spectral_radius(
            tip, stiffness=0.999 * stiffest, virtual_damping=virtual, period=period, delay=delay
        )
        assert float(radius) < 1 + 1e-10
    bare = critical_stiffness(LinearDevice.of_mass(mass, damping), period=period, delay=delay, virtual_damping=virtual)
    assert stiffest <= bare * (1 + 1e-9)


def random_hand(rng: np.random.Generator) -> HumanArm:
    """A passive operator: mass, spring and damper, rigid or behind tissue, over many decades."""
    tissue = 10 ** rng.uniform(0, 6) if rng.random() < 0.5 else None
    return HumanArm(
        10 ** rng.uniform(-3, 1),
        10 ** rng.uniform(-4, 1) if rng.random() < 0.7 else 0.0,
        10 ** rng.uniform(-1, 6),
        tissue,
        10 ** rng.uniform(-4, 1) if rng.random() < 0.7 else 0.0,
    )


def test_a_thousand_passive_hands_and_the_worst_of_them() -> None:
    """Just under the exact damping no hand makes the loop unstable; 10 % short of it the search finds one that does."""
    rng = np.random.default_rng(3)
    mass, b, period, delay = 0.06, 1.0, 1e-3, 1
    virtual = 0.3
    stiffness = float(passive_stiffness(damping=b, period=period, virtual_damping=virtual, delay=delay))
    hands = [random_hand(rng) for _ in range(1000)]
    radii = [
        wall_loop(LinearDevice.of_mass(mass, b, h), period, delay).spectral_radius(stiffness, virtual) for h in hands
    ]
    assert max(radii) <= 1 + 1e-10

    def radius(log_mass: float, log_stiffness: float, wall: float) -> float:
        tip = LinearDevice.of_mass(mass, b, HumanArm(10**log_mass, 0.0, 10**log_stiffness))
        return wall_loop(tip, period, delay).spectral_radius(wall, virtual)

    grid = [(m, k) for m in np.linspace(-1, 2, 31) for k in np.linspace(2, 7, 51)]
    worst = max(grid, key=lambda hand: radius(*hand, 1.1 * stiffness))
    assert radius(*worst, 1.1 * stiffness) > 1 + 1e-7
    assert radius(*worst, stiffness) <= 1 + 1e-10


def test_one_bounce_off_a_wall_to_the_microjoule() -> None:
    """60 g at .3 m/s into 3 N/mm, held 1 ms: the wall gives 1.149 mJ, and the naive count says it takes 1.106 mJ."""
    mass, stiffness, period, speed = 0.06, 3000.0, 1e-3, 0.3
    x, v, positions, forces = 0.0, speed, [], []
    while not positions or x > 0:
        positions.append(x)
        forces.append(-stiffness * x)
        x, v = x + v * period + forces[-1] * period**2 / (2 * mass), v + forces[-1] * period / mass
    positions.append(x)
    forces.append(0.0)
    observer = EnergyObserver()
    for position, force in zip(positions, forces, strict=True):
        observer.update(position)
        observer.set_force(force)
    assert f"{1e3 * zoh_energy(forces, positions):.3f}" == "1.149"
    assert f"{1e3 * naive_energy(forces[:-1], positions[:-1]):.3f}" == "-1.106"
    assert observer.energy == pytest.approx(0.5 * mass * (v**2 - speed**2), rel=1e-12)


def test_virtual_coupling_bound_holds_for_every_passive_object_behind_it() -> None:
    """Any mass, damper and spring behind k_c, b_c needs no more than b_c + k_c T/2; a clamp needs it all."""
    rng = np.random.default_rng(5)
    k, b, t = 800.0, 0.2, 1e-3
    z = control.TransferFunction([1, 0], [1], t)
    coupling = k + b / t * (z - 1) / z
    most = 0.0
    for _ in range(60):
        m, c, s = 10 ** rng.uniform(-3, 1), 10 ** rng.uniform(-3, 2), 10 ** rng.uniform(0, 5)
        # implicit: v = v_before + (T/M)(f - c v - s x), x = x_before + T v, all at the same sample
        velocity = control.minreal(1 / (m / t * (z - 1) / z + c + s * t * z / (z - 1)), verbose=False)
        assert positive_real_margin(velocity, t) > -1e-9
        position = velocity * t * z / (z - 1)
        felt = control.minreal(coupling / (1 + coupling * position), verbose=False)
        most = max(most, passive_damping(law=felt, period=t))
    bound = coupling_damping(coupling_stiffness=k, coupling_damping=b, period=t)
    assert most <= bound * (1 + 1e-6)
    assert most > 0.9 * bound  # a heavy or stiff object is nearly a clamp
    assert passive_damping(law=control.minreal(coupling, verbose=False), period=t) == pytest.approx(bound, rel=1e-9)


def test_explicit_virtual_mass_is_not_passive_and_the_implicit_one_is() -> None:
    """Re of (T/M)/(z-1) is -T/2M on the whole circle, of (T/M) z/(z-1) it is T/2M."""
    t, m = 1e-3, 0.5
    explicit, implicit = control.TransferFunction([t / m], [1, -1], t), control.TransferFunction([t / m, 0], [1, -1], t)
    assert positive_real_margin(explicit, t) == pytest.approx(-t / (2 * m), rel=1e-6)
    assert positive_real_margin(implicit, t) == pytest.approx(t / (2 * m), rel=1e-6)
