"""Input of bodies is accepted up to each bound, in any unit, and refused beyond it with the number as it was given."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from palpate.errors import PoseError
from palpate.fem import checks
from palpate.fem.errors import BodyError, BodyWarning


@pytest.mark.parametrize(
    ("check", "inside", "outside"),
    [
        (lambda x: checks.positive(x, "Pa", "young"), [1e-300, "1 kPa"], [0.0, "-1 Pa", -1e-300]),
        (lambda x: checks.not_negative(x, "m", "radius"), [0.0, "0 mm", 2.0], [-1e-300, "-1 mm"]),
        (checks.indentation_depth, [0.0, "3 mm"], [-1e-12, "-3 mm"]),
        (checks.tick_period, [1e-7, 100.0, "0.1 us", "1 ms"], [0.9e-7, 100.1, 0.0, "0.09 us"]),
        (lambda x: checks.whole(x, "modes", 1), [1, 7, "3", 1e6], [0, 1.5, -1, "0"]),
        (lambda x: checks.whole(x, "modes", 1, 20), [1, 20], [0, 21, 20.5]),
        (checks.stiffness_ratio, [1.0, "1", 3.0], [0.999, "0.5", -2.0]),
        (lambda x: checks.friction_coefficients(0.5, x), [0.0, 0.5, "0.5", None], [0.501, -0.1]),
        (checks.check_tip, ["sphere", "flat"], ["cube", None, 3]),
        (lambda x: checks.number(x, "m", "size"), [1.0, "1 m", -5.0], [float("nan"), float("inf"), "1 kg", "much"]),
    ],
)
def test_a_number_is_accepted_up_to_its_bound_and_refused_beyond(
    check: Callable[[Any], Any], inside: list[Any], outside: list[Any]
) -> None:
    for value in inside:
        check(value)
    for value in outside:
        with pytest.raises(BodyError):
            check(value)


def test_text_with_a_unit_is_the_number_in_si() -> None:
    assert checks.length("12 mm", "x") == checks.length(0.012, "x") == pytest.approx(0.012)
    assert checks.tick_period("0.5 ms") == pytest.approx(5e-4)
    assert checks.friction_coefficients(0.7, None) == (0.7, 0.7)
    assert checks.friction_coefficients("0.7", "0.2") == (0.7, 0.2)
    assert checks.whole("12", "n", 0) == 12
    assert checks.unit_of_length("cm") == pytest.approx(0.01)
    mixed = checks.lengths([["1 mm", 2.0], [3, "4 cm"]], "points")
    np.testing.assert_allclose(mixed, [[1e-3, 2.0], [3.0, 0.04]])
    np.testing.assert_array_equal(checks.point_of(["1 m", 2, 3.0]), [1.0, 2.0, 3.0])
    with pytest.raises(BodyError, match="not a unit of length"):
        checks.unit_of_length("kg")


def test_a_body_of_an_unlikely_size_is_warned_of_with_the_unit_that_it_may_have() -> None:
    for extent, unit in ((0.99e-3, "m"), (2.01, "mm"), (40.0, "mm")):
        with pytest.warns(BodyWarning, match=f'--unit {unit}"?'):
            checks.warn_of_size(extent, stacklevel=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for extent in (1e-3, 0.05, 2.0):
            checks.warn_of_size(extent, stacklevel=1)
    with pytest.warns(BodyWarning, match="extent of 0.5 mm"):
        checks.warn_of_size(0.5e-3, stacklevel=1)
    with pytest.warns(BodyWarning, match="extent of 40 m"):
        checks.warn_of_size(40.0, stacklevel=1)


def test_the_first_row_that_is_not_finite_is_named() -> None:
    points = np.ones((6, 2, 3))
    checks.check_finite(points, "path")
    points[3, 1, 2] = points[5, 0, 0] = np.nan
    with pytest.raises(PoseError, match=r"path: row 3 of 6 .*\(1, 1, 1, 1, 1, nan\)"):
        checks.check_finite(points, "path")
    for wrong in ([1.0, 2.0], [1.0, 2.0, np.inf], "5 mm"):
        with pytest.raises((PoseError, BodyError)):
            checks.point_of(wrong)
    with pytest.raises(PoseError, match="same length"):
        checks.lengths([[1.0, 2.0], [3.0]], "points")


def test_directions_are_unit_vectors_and_one_serves_for_all() -> None:
    many = np.array([[0.0, 0.0, 2.0], [3.0, 4.0, 0.0]])
    np.testing.assert_allclose(checks.directions(many, (2, 3)), [[0, 0, 1], [0.6, 0.8, 0]])
    np.testing.assert_allclose(checks.directions([0, -5, 0], (4, 3)), np.tile([0, -1, 0], (4, 1)))
    for wrong in ([0, 0, 0], [1.0, np.nan, 0.0], [1, 2], np.ones((3, 3)), "up"):
        with pytest.raises(PoseError, match="outward"):
            checks.directions(wrong, (2, 3))
