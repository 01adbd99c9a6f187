"""Products and solutions in place are those of numpy, whatever the sizes, in both precisions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from palpate.fem import dense

SIZES = st.integers(0, 40)


def random(rng: np.random.Generator, kind: type, *shape: int) -> NDArray[Any]:
    return np.asfortranarray(rng.standard_normal(shape).astype(kind))


@settings(max_examples=60)
@given(SIZES, st.integers(1, 40), SIZES, st.sampled_from([np.float64, np.float32]), st.integers(0, 2**32 - 1))
def test_they_are_those_of_numpy(m: int, n: int, k: int, kind: type, seed: int) -> None:
    """Lower triangles of squares only: what lies above stays as it was."""
    rng, near = np.random.default_rng(seed), 1e-11 if kind is np.float64 else 1e-3
    root = random(rng, kind, n, n)
    square = np.asfortranarray(root @ root.T + n * np.eye(n, dtype=kind))
    factor = square.copy(order="F")
    assert dense.potrf(factor)
    lower = np.tril(factor)
    np.testing.assert_allclose(lower @ lower.T, square, atol=near * n)
    b = random(rng, kind, m, n)
    solved = b.copy(order="F")
    dense.trsm(factor, solved)
    np.testing.assert_allclose(solved @ lower.T, b, atol=near)
    for sign in (1.0, -1.0):
        c = random(rng, kind, m, m)
        before = c.copy()
        dense.syrk(sign, b, c)
        np.testing.assert_allclose(np.tril(c), np.tril(before + sign * b @ b.T), atol=near)
        assert np.array_equal(np.triu(c, 1), np.triu(before, 1))
    c, d = random(rng, kind, m, k), random(rng, kind, k, n)
    before = c.copy()
    dense.gemm(-1.0, b, d, c)
    np.testing.assert_allclose(c, before - b @ d.T, atol=near)


def test_what_is_not_positive_definite_has_no_factor() -> None:
    assert not dense.potrf(np.asfortranarray(np.diag([1.0, -1.0])))


@pytest.mark.parametrize(
    "wrong", [np.ones((2, 3)), np.ones((2, 3), np.float32, order="F"), np.ones((6, 6), order="F")[::2, ::2]]
)
def test_arrays_of_another_kind_are_refused(wrong: NDArray[Any]) -> None:
    with pytest.raises(ValueError, match="Fortran order"):
        dense.syrk(-1.0, wrong, np.zeros((len(wrong), len(wrong)), order="F"))


def test_sizes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match="do not match"):
        dense.trsm(np.eye(3, order="F"), np.zeros((2, 4), order="F"))
    for rows in (1, 3):
        with pytest.raises(ValueError, match="do not match"):
            dense.syrk(1.0, np.zeros((2, 4), order="F"), np.zeros((rows, rows), order="F"))
    with pytest.raises(ValueError, match="do not match"):
        dense.gemm(-1.0, np.zeros((2, 3), order="F"), np.zeros((3, 3), order="F"), np.zeros((2, 2), order="F"))
