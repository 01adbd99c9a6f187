"""Integral action: simple poles at z = 1 in every direction."""

from __future__ import annotations

import numpy as np
import pytest
from palpate.arrays import Array
from palpate.stability.mesh_rest import integrates_every_axis
from scipy.linalg import block_diag

I3 = np.eye(3)


@pytest.mark.parametrize(
    ("poles", "integrates"),
    [
        ([1.0, 1.0, 1.0], True),
        ([1.0, 1.0, 1.0, 0.5, -0.2], True),
        ([1.0, 1.0, 0.999999], False),
        ([1.0, 1.0, 1.0, 1.0], True),
        ([0.9, 0.5, 0.0], False),
    ],
)
def test_a_controller_integrates_if_its_residue_at_one_has_full_rank(poles: list[float], integrates: bool) -> None:
    rng = np.random.default_rng(len(poles))
    n = len(poles)
    basis = np.linalg.qr(rng.standard_normal((n, n)))[0]
    a = basis @ np.diag(poles) @ basis.T
    b, c = rng.standard_normal((n, 3)), rng.standard_normal((3, n))
    assert integrates_every_axis(a, b, c) == integrates


def test_an_integrator_that_no_error_drives_or_no_command_shows_does_not_count() -> None:
    two: Array = np.diag([1.0, 1.0, 0.0])
    assert integrates_every_axis(I3, I3, I3)
    assert not integrates_every_axis(I3, two, I3)
    assert not integrates_every_axis(I3, I3, two)
    assert not integrates_every_axis(np.zeros((0, 0)), np.zeros((0, 3)), np.zeros((3, 0)))


def test_a_double_pole_at_one_is_not_judged() -> None:
    double = block_diag([[1.0, 1.0], [0.0, 1.0]], I3[:2, :2])
    assert not integrates_every_axis(double, np.ones((4, 3)), np.ones((3, 4)))
