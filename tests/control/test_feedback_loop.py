"""Plants that a design accepts, axes that it acts on, and systems in series."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
import pytest
from palpate.control.feedback_loop import active_axes, require_sampled, series
from palpate.errors import DesignError

RNG = np.random.default_rng(0)
PLANT = (0.5 * np.eye(4), RNG.normal(size=(4, 3)), RNG.normal(size=(3, 4)), np.zeros((3, 3)))


def plant(*, of: int = -1, value: float = 0.0, dt: Any = 1e-3) -> control.StateSpace:
    matrices = [m.copy() for m in PLANT]
    if of >= 0:
        matrices[of][1, 2] = value
    return control.StateSpace(*matrices, dt)


def test_a_plant_is_sampled_finite_and_three_by_three() -> None:
    assert require_sampled(plant(), "lqg") == 1e-3
    for dt in (0, True, None):
        with pytest.raises(DesignError, match="lqg: the plant must be sampled"):
            require_sampled(plant(dt=dt), "lqg")
    for of in range(4):
        for value in (np.nan, np.inf, -np.inf):
            with pytest.raises(DesignError, match="lqg: the plant's matrices must be finite"):
                require_sampled(plant(of=of, value=value), "lqg")
    a, b, c, d = PLANT
    for wrong in (control.StateSpace(a, b[:, :2], c, d[:, :2], 1e-3), control.StateSpace(a, b, c[:2], d[:2], 1e-3)):
        with pytest.raises(DesignError, match="lqg: the plant maps 3 tip forces to 3 object forces"):
            require_sampled(wrong, "lqg")


def test_the_axes_of_a_plant_are_those_on_which_the_command_acts() -> None:
    a, b, c, d = PLANT
    for axes in ([0], [1], [0, 2], [0, 1, 2]):
        reach = np.isin(np.arange(3), axes)
        assert active_axes(control.StateSpace(a, b * reach, c * reach[:, None], d, 1e-3)).tolist() == axes
        direct = control.StateSpace(a, 0 * b, c, np.diag(reach * 5.0), 1e-3)
        assert active_axes(direct).tolist() == axes
    with pytest.raises(DesignError, match="connects no force"):
        active_axes(control.StateSpace(a, 0 * b, c, d, 1e-3))


def test_a_series_is_the_product_of_its_responses_with_the_states_of_both() -> None:
    first, second = plant(of=3, value=0.3), plant(of=3, value=-2.0)
    both = series(first, second)
    assert both.nstates == 8
    for angle in (0.1, 2.0):
        z = np.exp(1j * angle)
        np.testing.assert_allclose(both(z), second(z) @ first(z), rtol=1e-10)
    assert both.dt == 1e-3
