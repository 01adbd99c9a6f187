"""The response of stacked systems from their modes is C (z - A)^-1 B + D, on a grid and in pairs."""

from __future__ import annotations

import numpy as np
from palpate.stability.maps.modal_response import ModalResponse


def test_modes_give_the_response_of_every_system_at_every_point() -> None:
    rng = np.random.default_rng(0)
    a, b, c = rng.normal(size=(5, 4, 4)) / 3.0, rng.normal(size=(5, 4, 2)), rng.normal(size=(5, 3, 4))
    d = rng.normal(size=(3, 2))
    found = ModalResponse(a, b, c, d)
    assert found.complete.all()
    z = np.exp(1j * np.array([0.1, 1.0, 3.0]))
    grid, index = found.grid(z), np.array([4, 0, 2])
    for i in range(5):
        for k, point in enumerate(z):
            np.testing.assert_allclose(
                grid[i, k], c[i] @ np.linalg.solve(point * np.eye(4) - a[i], b[i]) + d, rtol=1e-9
            )
    np.testing.assert_allclose(found.pairs(z, index), grid[index, np.arange(3)], rtol=1e-12)


def test_a_defective_matrix_is_not_complete_and_a_gain_has_no_modes() -> None:
    block = np.array([[[0.5, 1.0], [0.0, 0.5]]])
    assert not ModalResponse(block, np.ones((1, 2, 1)), np.ones((1, 1, 2))).complete.any()
    gain = ModalResponse(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((3, 0)), np.arange(6.0).reshape(3, 2))
    np.testing.assert_array_equal(gain.grid(np.array([1j, -1.0]))[1], np.arange(6.0).reshape(3, 2))
