"""The cost of vibration modes: bytes and seconds counted by hand, and the remedy for each library."""

from __future__ import annotations

import pytest
from palpate.fem import modes_cost as module
from palpate.fem.modes_cost import fill, groups, modes_cost


@pytest.mark.parametrize(("library", "entry"), [("SuperLU", 30.0), ("CHOLMOD", 12.0), ("PARDISO", 12.0)])
def test_modes_need_the_factor_and_the_bases(library: str, entry: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """20 modes have 76 vectors, doubled as they grow, and 40 groups of nodes have 240 residual vectors, four times."""
    monkeypatch.setattr(module, "installed", lambda: library)
    cost = modes_cost(9000.0, 40.0, 20, 4e6, 1e9, 5e9)
    assert (cost.count, cost.library) == (20, library)
    assert cost.memory == pytest.approx(entry * 4e6 + 8.0 * 9000.0 * (152 + 20 + 960), rel=1e-12)
    if library == "SuperLU":
        assert cost.seconds == pytest.approx(1e9 / 2.5e8 + 316 * 8e6 / 1.5e9, rel=1e-12)
        assert modes_cost(9000.0, 40.0, 20, 4e6, 1e9, 0.5).seconds == pytest.approx(4e10 + 316 * 8e6 / 1.5e9, rel=1e-12)
        assert str(cost) == "computing 20 modes: 0.2 GB, about 5.7 s by SuperLU"
        assert cost.remedy == "fewer modes, the faster PARDISO (extra body), "
    else:
        assert cost.seconds is None
        assert str(cost) == f"computing 20 modes: 0.13 GB by {library}"
        assert cost.remedy == "fewer modes, "
    assert modes_cost(9000.0, 40.0, 20, 4e6).seconds is None


def test_groups_are_at_most_80_at_least_16_and_no_more_than_the_nodes() -> None:
    """300 MB of residual vectors of 8 bytes, six for each group."""
    assert groups(1e3, 500.0) == 80
    assert groups(1e3, 7.0) == 7
    assert groups(125e3, 500.0) == 50
    assert groups(1e7, 500.0) == 16
    assert groups(1e7, 9.0) == 9


def test_the_fill_grows_with_the_power_4_thirds() -> None:
    assert fill(1e3) == pytest.approx(30e4)
    assert fill(8e3) == pytest.approx(16.0 * fill(1e3))
