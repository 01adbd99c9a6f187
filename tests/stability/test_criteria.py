"""Eigenvalues, Jury, Routh and Lyapunov: four criteria that share no step, one verdict."""

from __future__ import annotations

import os

import numpy as np
import pytest
from numpy.typing import NDArray
from palpate.errors import StabilityError
from palpate.linear import LinearDevice, wall_loop
from palpate.stability import (
    characteristic_polynomial,
    critical_stiffness,
    jury,
    lyapunov,
    precise_tables,
    routh,
    wall_polynomial,
)

Array = NDArray[np.float64]
# 2,000 loops; PALPATE_ROUNDS=10 (`make nightly`) tests 10,000.
LOOPS = min(2_000 * int(os.environ.get("PALPATE_ROUNDS", "1")), 10_000)


def agree(matrices: Array, polynomials: Array, outside: float = 1e-9) -> tuple[int, int]:
    """Hold the four criteria against each other; return how many loops were stable, and how many unstable."""
    radius = np.abs(np.linalg.eigvals(matrices)).max(axis=-1)
    clear = np.abs(radius - 1) > outside
    stable = radius < 1
    for road in (jury(polynomials), routh(polynomials), lyapunov(matrices)):
        assert np.array_equal(road.stable[clear], stable[clear]), type(road).__name__
    inside = (np.abs(np.linalg.eigvals(matrices)) > 1).sum(axis=-1)
    counted = routh(polynomials).outside
    assert np.array_equal(counted[clear], inside[clear])  # Routh counts the roots outside, too
    return int((stable & clear).sum()), int((~stable & clear).sum())


def test_the_criteria_agree_on_random_loops() -> None:
    """A mass against a wall: state matrices by the exponential, polynomials by the closed form."""
    rng = np.random.default_rng(1)
    m, b = np.exp(rng.uniform(np.log(0.01), 0, LOOPS)), np.exp(rng.uniform(np.log(1e-3), np.log(10), LOOPS))
    t, alpha = np.exp(rng.uniform(np.log(1e-4), np.log(1e-2), LOOPS)), rng.uniform(0, 0.9, LOOPS)
    delay = rng.integers(0, 5, LOOPS)
    stiffness = np.exp(rng.uniform(np.log(1e-5), np.log(2), LOOPS)) * m / t**2
    damping = np.exp(rng.uniform(np.log(1e-4), np.log(2), LOOPS)) * m / t
    stable = unstable = 0
    for n in range(5):
        which = np.flatnonzero(delay == n)
        matrices = np.array(
            [
                wall_loop(LinearDevice.of_mass(m[i], b[i]), t[i], n, alpha[i]).matrix(stiffness[i], damping[i])
                for i in which
            ]
        )
        polynomials = wall_polynomial(
            mass=m[which],
            damping=b[which],
            period=t[which],
            stiffness=stiffness[which],
            virtual_damping=damping[which],
            delay=n,
            velocity_filter=alpha[which],
        )
        assert characteristic_polynomial(matrices) == pytest.approx(polynomials, abs=1e-12)
        counts = agree(matrices, polynomials)
        stable, unstable = stable + counts[0], unstable + counts[1]
    assert stable > LOOPS / 5
    assert unstable > LOOPS / 5


@pytest.mark.parametrize("delay", [0, 2])
def test_loops_next_to_the_boundary(delay: int) -> None:
    """From 1e-1 down to 1e-7 of the critical stiffness on either side, at ordinary devices."""
    rng = np.random.default_rng(2)
    sides = np.concatenate([10.0 ** -np.arange(1, 8), -(10.0 ** -np.arange(1, 8))])
    matrices, rows = [], []
    for _ in range(40):
        m, b, t = 10 ** rng.uniform(-1.5, 0), 10 ** rng.uniform(-2, 0.5), 10 ** rng.uniform(-3.5, -2.5)
        damping = 10 ** rng.uniform(-2, -0.8) * m / t
        loop = wall_loop(LinearDevice.of_mass(m, b), t, delay)
        critical = critical_stiffness(loop, virtual_damping=damping)
        stiffness = critical * (1 + sides)
        matrices.append(loop.matrix(stiffness, damping))
        rows.append(
            wall_polynomial(mass=m, damping=b, period=t, stiffness=stiffness, virtual_damping=damping, delay=delay)
        )
        radius = np.abs(np.linalg.eigvals(matrices[-1])).max(axis=-1)
        assert np.array_equal(radius < 1, sides < 0)  # the critical stiffness is where it is said to be
    agree(np.concatenate(matrices), np.concatenate(rows))


def test_lyapunov_matrix_is_a_certificate() -> None:
    """P > 0 and P - A^T P A > 0, recomputed here; an unstable A has none."""
    loop = wall_loop(LinearDevice.of_mass(0.06, 0.5), 1e-3, 1)
    stable = lyapunov(loop.matrix(500.0, 1.0))
    assert stable.stable
    a, p = loop.matrix(500.0, 1.0), stable.matrix
    for matrix in (p, p - a.T @ p @ a):
        scale = 1 / np.sqrt(np.diag(matrix))
        assert np.linalg.eigvalsh(matrix * scale[:, None] * scale).min() > 0
    assert not lyapunov(loop.matrix(1e6, 1.0)).stable


def test_tables_of_many_roots_near_one_need_digits() -> None:
    """Fifteen roots within 1e-3 of the circle: doubles lose them in the coefficients, decimals do not."""
    rng = np.random.default_rng(0)
    for shift, stable in ((0.0, True), (2.5e-3, False)):
        roots = np.exp(-rng.uniform(1e-3, 2e-3, 15)) + np.eye(15)[0] * shift
        basis = np.linalg.qr(rng.normal(size=(15, 15)))[0]
        assert precise_tables(basis @ np.diag(roots) @ basis.T) == (stable, stable)


def test_textbook_polynomials() -> None:
    """Roots are known: (z - .5)(z + .9)(z - .2j)(z + .2j), one moved outside, and one on the circle."""
    inside = np.poly([0.5, -0.9, 0.2j, -0.2j]).real
    outside = np.poly([1.5, -0.9, 0.2j, -0.2j]).real
    assert jury(inside).stable
    assert routh(inside).stable
    assert not jury(outside).stable
    assert int(routh(outside).outside) == 1
    assert int(routh(np.poly([1.5, -1.9, 0.1])).outside) == 2
    assert not jury(np.poly([1.0, 0.3])).stable
    assert not routh(np.poly([1.0, 0.3])).stable


@pytest.mark.parametrize("road", [jury, routh])
@pytest.mark.parametrize("bad", [[1.0], [0.0, 1.0], [1.0, np.nan], 3.0])
def test_what_is_no_polynomial_is_refused(road: object, bad: object) -> None:
    with pytest.raises(StabilityError, match=r"^(jury|routh): "):
        road(bad)  # type: ignore[operator]


@pytest.mark.parametrize("bad", [[0.5], np.ones((2, 3)), [[0.5, np.nan], [0.0, 0.5]]])
def test_lyapunov_refuses_what_is_no_square_finite_matrix(bad: object) -> None:
    with pytest.raises(StabilityError, match=r"^lyapunov: "):
        lyapunov(bad)  # type: ignore[arg-type]
