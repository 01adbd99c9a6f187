"""The cost of vibration modes: bytes and seconds counted by hand."""

from __future__ import annotations

import pytest
from palpate.fem.modes_cost import fill, groups, modes_cost


def test_modes_need_the_factor_and_the_bases() -> None:
    """20 modes have 76 vectors, doubled as they grow, and 40 groups of nodes have 240 residual vectors, five times."""
    cost = modes_cost(9000.0, 40.0, 20, 4e6, 3.0)
    assert cost.count == 20
    assert cost.memory == pytest.approx(12.0 * 4e6 + 8.0 * 9000.0 * (152 + 20 + 1200), rel=1e-12)
    assert cost.seconds == pytest.approx(3.0 + 316 * 8e6 / 3.5e9, rel=1e-12)
    assert str(cost) == "computing 20 modes: 0.15 GB, about 3.7 s"
    assert modes_cost(9000.0, 40.0, 20, 4e6).seconds == pytest.approx(cost.seconds - 3.0, rel=1e-12)


def test_groups_are_at_most_80_at_least_16_and_no_more_than_the_nodes() -> None:
    """300 MB of residual vectors of 8 bytes, six for each group."""
    assert groups(1e3, 500.0) == 80
    assert groups(1e3, 7.0) == 7
    assert groups(125e3, 500.0) == 50
    assert groups(1e7, 500.0) == 16
    assert groups(1e7, 9.0) == 9


def test_the_fill_grows_with_the_power_4_thirds() -> None:
    assert fill(1e3) == pytest.approx(36e4)
    assert fill(8e3) == pytest.approx(16.0 * fill(1e3))
