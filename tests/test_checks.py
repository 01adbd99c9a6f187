"""Checks of arguments: each bound is where its name says, and text with a unit counts as its value."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from palpate import checks
from palpate.errors import StabilityError

TINY = np.nextafter(0.0, 1.0)


@pytest.mark.parametrize(
    ("check", "inside", "outside"),
    [
        (checks.positive, (TINY, 1e300), (0.0, -TINY)),
        (checks.not_negative, (0.0, TINY, 1e300), (-TINY, -1.0)),
        (checks.finite, (-1e300, 0.0, 1e300), ()),
        (lambda value, name, _unit: checks.fraction(value, name), (0.0, np.nextafter(1.0, 0.0)), (-TINY, 1.0, 2.0)),
    ],
)
def test_a_bound_is_where_its_name_says(
    check: Callable[[float, str, str], float], inside: tuple[float, ...], outside: tuple[float, ...]
) -> None:
    """And nothing that is not finite passes."""
    for value in inside:
        assert check(value, "it", "") == value
    for value in (*outside, math.nan, math.inf, -math.inf):
        with pytest.raises(StabilityError, match=r"^it must "):
            check(value, "it", "")


def test_text_with_a_unit_is_its_value() -> None:
    assert checks.positive("2 ms", "period", "s") == 0.002
    assert checks.finite(3.0, "delay", "samples") == 3.0
    assert checks.not_negative(3.0, "stiffness", "N/m (of the wall)") == 3.0
    with pytest.raises(StabilityError, match="period"):
        checks.positive("2 mm", "period", "s")


def test_a_tool_has_eight_points_at_most_each_in_a_place_of_its_own() -> None:
    row = [(0.01 * k, 0.0, 0.0) for k in range(9)]
    assert checks.tool_mistake([]) == checks.tool_mistake(row[:8]) == ""
    assert checks.tool_mistake(row) == "9 points; a tool has at most 8"
    assert checks.tool_mistake([*row[:3], row[1]]) == "points 2 and 4 are in the same place; remove one"
    assert checks.tool_mistake([(0.0, 0.0, 0.0), (0.0, 1e-6, 0.0)]) == ""
    assert checks.tool_mistake([(0.0, 0.0, 0.0), (0.0, 0.9e-6, 0.0)]) != ""


def test_a_refusal_states_the_unit_and_the_value() -> None:
    for check, value, says in (
        (checks.positive, 0.0, "it must be positive in N/m, not 0"),
        (checks.not_negative, -2.5, "it must not be negative in N/m; it is -2.5"),
        (checks.finite, math.inf, "it must be finite in N/m, not inf"),
    ):
        with pytest.raises(StabilityError) as caught:
            check(value, "it", "N/m")
        assert str(caught.value) == says
    with pytest.raises(StabilityError) as caught:
        checks.fraction(1.5, "it")
    assert str(caught.value) == "it must be at least 0 and below 1, not 1.5"
    with pytest.raises(StabilityError) as caught:
        checks.fraction(math.nan, "it")
    assert str(caught.value) == "it must be finite in one, not nan"
