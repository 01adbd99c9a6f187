"""A force law: its table, its energy by sums, and each table that is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from palpate.contact.force_law import ForceLaw, law_fault
from palpate.errors import ScenarioError

POINT, UP = [1e-3, 2e-3, 3e-3], [0.0, 0.0, 2.0]
DEPTH, FORCE = np.array([0.0, 1e-3, 3e-3, 4e-3]), np.array([0.0, 0.5, 3.5, 3.75])


def test_a_law_is_linear_between_its_entries_and_goes_on_with_its_last_slope() -> None:
    """Its energy is the sum of the trapezoids."""
    law = ForceLaw.table(
        ["0 mm", "1 mm", "3 mm", "4 mm"], ["0 N", "0.5 N", "3.5 N", "3.75 N"], ["1 mm", "2 mm", "3 mm"], UP
    )
    np.testing.assert_allclose(law.depth, DEPTH)
    np.testing.assert_allclose(law.force, FORCE)
    np.testing.assert_allclose(law.point, POINT)
    assert law.normal.tolist() == [0.0, 0.0, 1.0]
    np.testing.assert_allclose(law.slopes, [500.0, 1500.0, 250.0])
    assert (law.softest, law.stiffest) == pytest.approx((250.0, 1500.0))
    for depth in (0.0, 0.4e-3, 1e-3, 2.2e-3, 3.9e-3, 4e-3, 6e-3):
        force = np.interp(depth, DEPTH, FORCE) + 250.0 * max(depth - 4e-3, 0.0)
        fine = np.linspace(0.0, depth, 20_001)
        along = np.interp(fine, DEPTH, FORCE) + 250.0 * np.maximum(fine - 4e-3, 0.0)
        energy = float(np.sum(0.5 * (along[1:] + along[:-1]) * np.diff(fine)))
        assert law.at(depth) == pytest.approx(force, rel=1e-12)
        assert law.energy(depth) == pytest.approx(energy, rel=1e-6)
    assert (law.at(-1e-3), law.energy(-1e-3)) == (0.0, 0.0)


def test_a_formula_is_a_table_of_a_thousand_equal_steps() -> None:
    law = ForceLaw.formula(lambda x: 300.0 * x + 2e6 * x**3, "5 mm", POINT, UP)
    np.testing.assert_allclose(law.depth, 5e-6 * np.arange(1001))
    np.testing.assert_allclose(law.force, 300.0 * law.depth + 2e6 * law.depth**3)
    assert law.point.tolist() == POINT
    few = ForceLaw.formula(lambda x: 300.0 * x, 0.01, POINT, [0.0, 0.6, 0.8], 3)
    assert few.depth.tolist() == [0.0, 0.005, 0.01]
    np.testing.assert_allclose(few.normal, [0.0, 0.6, 0.8])
    with pytest.raises(ScenarioError, match=r"^force law: the formula must give one number for each depth: "):
        ForceLaw.formula(lambda _: "x", 0.01, POINT, UP)  # type: ignore[arg-type, return-value]
    with pytest.raises(ScenarioError, match=r"force law: deepest.* a length is needed"):
        ForceLaw.formula(lambda x: x, "1 N", POINT, UP)


FAULTS: list[tuple[Any, Any, str]] = [
    ([0.0], [0.0], "depth and force need the same number of entries, at least two, not (1,) and (1,)"),
    ([0.0, 1.0], [0.0], "depth and force need the same number of entries, at least two, not (2,) and (1,)"),
    ([[0.0, 1.0]], [[0.0, 1.0]],
     "depth and force need the same number of entries, at least two, not (1, 2) and (1, 2)"),
    ([0.0, np.nan, np.inf], [0.0, 1.0, 2.0], "depth 2 is nan; every entry must be finite"),
    ([0.0, 1.0, 2.0], [0.0, 1.0, np.inf], "force 3 is inf; every entry must be finite"),
    ([0.1, 1.0], [0.0, 1.0], "the first depth must be 0 m, not 0.1 m"),
    ([0.0, 1.0], [-0.1, 1.0], "the first force must be 0 N, not -0.1 N"),
    ([0.0, 1.0, 1.0, 0.5], [0.0, 1.0, 2.0, 3.0],
     "depth must rise from entry to entry, but it goes from 1 to 1 m at entry 3; sort or smooth the table"),
    ([0.0, 1.0, 2.0], [0.0, -1.0, 2.0],
     "force must rise from entry to entry, but it goes from 0 to -1 N at entry 2; sort or smooth the table"),
    ([0.0, 5e-324], [0.0, 1.0], "a slope is not finite; the depths are too close to each other"),
    ([0.0, 1e-3], [0.0, 1e-3], ""),
    ([0.0, 1e-3, 2e-3], [0.0, 0.4, 0.5], ""),
]  # fmt: skip


@pytest.mark.parametrize(("depth", "force", "fault"), FAULTS, ids=range(len(FAULTS)))
def test_the_first_fault_of_a_table_is_told(depth: Any, force: Any, fault: str) -> None:
    assert law_fault(np.array(depth), np.array(force)) == fault
    if fault:
        with pytest.raises(ScenarioError) as caught:
            ForceLaw.table(depth, force, POINT, UP)
        assert str(caught.value) == f"force law: {fault}"
    else:
        ForceLaw.table(depth, force, POINT, UP)


def test_a_plane_has_a_point_and_a_normal() -> None:
    three = "force law: point and normal must be three finite numbers each"
    for point, normal, says in (
        (POINT[:2], UP, three),
        (POINT, UP[:2], three),
        (POINT, [0.0, 0.0, np.nan], three),
        ([0.0, np.inf, 0.0], UP, three),
        (POINT, [0.0, 0.0, 0.0], "force law: the normal has no length; give the outward direction, such as [0, 0, 1]"),
    ):
        with pytest.raises(ScenarioError) as caught:
            ForceLaw.table(DEPTH, FORCE, point, normal)
        assert str(caught.value) == says
    assert ForceLaw.table(DEPTH, FORCE, POINT, [0.5, 0.0, 0.0]).normal.tolist() == [1.0, 0.0, 0.0]
    with pytest.raises(ScenarioError, match=r"force law: depth"):
        ForceLaw.table(["1 N", "2 N"], FORCE[:2], POINT, UP)
    with pytest.raises(ScenarioError, match=r"force law: point"):
        ForceLaw.table(DEPTH, FORCE, ["1 N", "2 N", "3 N"], UP)
