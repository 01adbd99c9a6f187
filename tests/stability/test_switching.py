"""Switching between matrices of a sector: common Lyapunov functions, dwell times, and loops without either."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.stability import switching
from palpate.stability.switching import Sector, common_lyapunov, decrease, dwell_time

CORNERS = 16


def _sector(high: float, friction: float = 0.3, low: float = 0.0, damping: float = 0.4) -> Sector:
    """Return a mass of 1 kg that a damped hand of 30 N/m holds in a plane, on a wall of normal x, at 100 Hz."""
    from scipy.linalg import expm

    hand = np.array([[0, 1, 0, 0], [-30, -damping, 0, 0], [0, 0, 0, 1], [0, 0, -30, -damping]], dtype=float)
    whole = np.zeros((6, 6))
    whole[:4, :4] = hand
    whole[1, 4] = whole[3, 5] = 1.0
    step = expm(whole * 0.01)
    row = np.array([1.0, 0.0, 0.0, 0.0])
    return Sector("wall", step[:4, :4], -step[:4, 4], -step[:4, 5:], row, low, high, friction)


def test_a_common_lyapunov_function_bounds_every_order_of_stiffness_and_friction() -> None:
    rng = np.random.default_rng(1)
    sector = _sector(4.0, 0.3)
    found = common_lyapunov([sector], CORNERS)
    assert found is not None
    assert found.decrease > 0.0
    x = np.array([1.0, 0.0, -0.5, 0.2])
    value = x @ found.matrix @ x
    for _ in range(3000):
        kappa, u = rng.uniform(sector.low, sector.high), rng.uniform(-1.0, 1.0)
        x = sector.base @ x + (sector.normal * kappa + sector.tangent[:, 0] * sector.friction * kappa * u) * (
            sector.row @ x
        )
        after = x @ found.matrix @ x
        assert after <= value * (1.0 - 0.999 * found.decrease)
        value = after


def test_the_optimizer_finds_a_function_that_sums_of_lyapunov_matrices_do_not() -> None:
    pytest.importorskip("clarabel")
    solved = [
        high for high in np.linspace(2.0, 12.0, 21) if (f := common_lyapunov([_sector(high)], CORNERS)) and f.solved
    ]
    assert solved
    for high in solved:
        sector = _sector(high)
        found = common_lyapunov([sector], CORNERS)
        assert found is not None
        assert decrease(sector.matrices(64), found.matrix).min() > 0.0


def test_no_function_is_found_where_an_order_of_two_stable_matrices_diverges() -> None:
    a, b = np.array([[0.0, 1.3], [-0.6, 0.0]]), np.array([[0.0, -0.6], [1.3, 0.0]])
    assert max(np.abs(np.linalg.eigvals(m)).max() for m in (a, b)) < 1.0
    assert np.abs(np.linalg.eigvals(a @ b)).max() > 1.0
    sectors = [Sector(n, m, np.zeros(2), np.zeros((2, 0)), np.ones(2), 0.0, 0.0, 0.0) for n, m in (("a", a), ("b", b))]
    assert common_lyapunov(sectors, CORNERS) is None
    waits = dwell_time(np.array([a, b]))
    assert waits is not None
    assert waits.samples > 1.0
    length = int(np.ceil(waits.samples)) + 1
    cycle = np.linalg.matrix_power(a, length) @ np.linalg.matrix_power(b, length)
    assert np.abs(np.linalg.eigvals(cycle)).max() < 1.0


def test_without_the_optimizer_sums_and_dwell_times_remain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(switching, "has_solver", lambda: False)
    found = common_lyapunov([_sector(0.5, damping=2.0)], CORNERS)
    assert found is not None
    assert not found.solved
    assert dwell_time(_sector(4.0).matrices(CORNERS)) is not None


def test_an_unstable_matrix_has_neither() -> None:
    unstable = _sector(1e5)
    assert common_lyapunov([unstable], CORNERS) is None
    assert dwell_time(unstable.matrices(CORNERS)) is None


@pytest.mark.parametrize("corners", [3, 4, 7, 16])
def test_the_polygon_of_a_sector_contains_every_friction_force(corners: int) -> None:
    """In the tangent plane the hull of the corners has a support of at least mu kappa in each direction."""
    normal, tangent = np.array([1.0, 0.0, 0.0]), np.eye(3)[:, 1:]
    sector = Sector("wall", np.zeros((3, 3)), normal, tangent, np.array([0.0, 1.0, 0.0]), 2.0, 5.0, 0.4)
    inputs = sector.matrices(corners)[:, :, 1]
    assert np.array_equal(sector.matrices(corners)[:, :, [0, 2]], np.zeros((2 * corners, 3, 2)))
    for kappa in (2.0, 5.0):
        edge = inputs[inputs[:, 0] == kappa][:, 1:]
        assert len(edge) == corners
        angle = np.linspace(0.0, 2.0 * np.pi, 97)
        support = (edge @ np.array([np.cos(angle), np.sin(angle)])).max(axis=0)
        assert support.min() >= 0.4 * kappa * (1.0 - 1e-12)
        assert support.max() <= 0.4 * kappa / np.cos(np.pi / corners) * (1.0 + 1e-12)
    assert len(Sector("", np.zeros((3, 3)), normal, tangent, normal, 2.0, 2.0, 0.0).matrices(corners)) == 1
